"""Every kind of load sets the motion that its own formula says.

A uniform rod on a pivot is one equation, J q'' = -m g l cos q + M(q, q', t), which SciPy
integrates here straight from the formula of the load; nothing of the package is used in it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import blockmech as bm
from blockmech.dynamics.system import System
from tests.dynamics import scenes
from tests.dynamics.scenes import TURN, WEIGHT, J

TIMES = [0.3, 0.7, 1.1, 1.5]
AGREES = 1e-8  # [rad] of two integrations in time, the judge's at 1e-12


def rod(load):
    """The rod with an element between frame (a, or from) and crank (b, or to)."""
    element, wires = load
    graph = scenes.bare_rod(K=(0.5, 1.5))
    graph.add("load", element)
    for terminal, marker in wires.items():
        graph.connect(marker, f"load.{terminal}")
    return graph.compile()


ON_CRANK = {"a": "frame.A", "b": "crank.crank"}
BACKWARD = {"a": "crank.crank", "b": "frame.A"}


def judged(moment, q0, rate, knots=()):
    """q at TIMES from the formula of the moment; steps end at kinks in time."""

    def slope(t, y):
        return [y[1], (moment(y[0], y[1], t) - WEIGHT * math.cos(y[0])) / J]

    y, t, found = [q0, rate], 0.0, {}
    for station in sorted({*TIMES, *knots}):
        if station > TIMES[-1]:
            break
        run = solve_ivp(slope, (t, station), y, method="DOP853", rtol=1e-13, atol=1e-12)
        y, t = run.y[:, -1], station
        found[station] = y[0]
    return np.array([found[t] for t in TIMES])


def straight(xs, ys, x):
    return float(np.interp(x, xs, ys))


CLOCK = ([0.0, 0.4, 0.9, 2.0], [3.0, -2.0, 4.0, 1.0])
ANGLES = ([0.0, 1.0, 2.5, 4.0], [1.0, -1.0, 2.0, 0.5])
WAVE = CubicSpline([*ANGLES[0], TURN], [*ANGLES[1], ANGLES[1][0]], bc_type="periodic")


def table(of, data, **options):
    return {"kind": "table", "of": of, "arguments": data[0], "values": data[1], **options}


LINEAR = {"interpolation": "linear"}


def everything(coordinate, rate, time):
    """A moment [N m] that no typed law can say."""
    return math.sin(coordinate) * rate - 0.3 * abs(rate) * rate + math.exp(-time)


CASES = {
    "a table of the time": (
        (bm.Motor(law=table("time", CLOCK, **LINEAR)), ON_CRANK),
        lambda q, w, t: straight(*CLOCK, t),
        CLOCK[0],
    ),
    "a wave of the time, wired backward": (
        (bm.Motor(law={"kind": "fourier", "of": "time", "period": 0.7, "sines": [2.0]}), BACKWARD),
        lambda q, w, t: -2.0 * math.sin(TURN * t / 0.7),
        (),
    ),
    "a straight law of the rate": (
        (bm.Motor(law={"kind": "dc", "stall_moment": 3.0, "no_load_speed": 20.0}), ON_CRANK),
        lambda q, w, t: 3.0 * (1 - w / 20.0),
        (),
    ),
    "a crooked law of the rate": (
        (
            bm.Motor(law={"kind": "polynomial", "of": "rate", "coefficients": [1.0, -0.2, -0.03]}),
            ON_CRANK,
        ),
        lambda q, w, t: 1.0 - 0.2 * w - 0.03 * w * w,
        (),
    ),
    "a crooked law of the rate, wired backward": (
        (
            bm.Motor(law={"kind": "polynomial", "of": "rate", "coefficients": [1.0, -0.2, 0.03]}),
            BACKWARD,
        ),
        # what it measures and what it gives are both turned round
        lambda q, w, t: -(1.0 + 0.2 * w + 0.03 * w * w),
        (),
    ),
    "a periodic table of the angle": (
        (bm.Motor(law=table("coordinate", ANGLES, turns=1), driver="crank"), ON_CRANK),
        lambda q, w, t: float(WAVE(q % TURN)),
        (),
    ),
    "a function of everything": (
        (bm.Motor(law=everything, driver="crank"), ON_CRANK),
        everything,
        (),
    ),
    "a function of rate and time, the other way round": (
        (bm.Motor(law=lambda time, rate: math.sin(3 * time) - 0.2 * rate**3), BACKWARD),
        lambda q, w, t: -(math.sin(3 * t) + 0.2 * w**3),
        (),
    ),
    "a function of the coordinate": (
        (bm.Motor(law=lambda coordinate: -0.2 * coordinate**3, driver="crank"), ON_CRANK),
        lambda q, w, t: -0.2 * q**3,
        (),
    ),
    "a torsional damper": (
        (bm.TorsionSpring(stiffness=0.0, damping=0.4), ON_CRANK),
        lambda q, w, t: -0.4 * w,
        (),
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("start", [(0.2, 0.0), (1.0, 9.0)])
def test_the_motion_is_that_of_the_loads_own_formula(name, start):
    load, moment, knots = CASES[name]
    mech = rod(load)
    r = mech.simulate(times=TIMES, accuracy=1e-9, start={"crank": start})
    error = np.abs(r["crank.q"] - judged(moment, *start, knots)).max()
    assert error <= r.motion.error + AGREES


def test_a_force_that_follows_the_time_on_the_frames_axis_needs_the_kernels():
    law = {"kind": "fourier", "of": "time", "period": 0.9, "cosines": [5.0]}
    load = (bm.Thrust(law=law, direction=(0.0, 1.0)), {"a": "frame.A", "b": "crank.B"})
    mech = rod(load)

    def moment(q, w, t):
        return 5.0 * math.cos(TURN * t / 0.9) * math.cos(q)

    r = mech.simulate(times=TIMES, accuracy=1e-9, start={"crank": (0.2, 0.0)})
    assert np.abs(r["crank.q"] - judged(moment, 0.2, 0.0)).max() <= r.motion.error + AGREES


def test_a_damped_spring_to_a_point_is_damping_that_changes_with_the_angle():
    spring = bm.Spring(stiffness=30.0, free_length=0.4, damping=2.0)
    mech = rod((spring, {"a": "frame.K", "b": "crank.B"}))

    def moment(q, w, t):
        tip = np.exp(1j * q)
        d = tip - (0.5 + 1.5j)
        size = abs(d)
        stretching = (d.conjugate() * 1j * tip).real / size  # per unit rate
        return -(30.0 * (size - 0.4) + 2.0 * stretching * w) * stretching

    r = mech.simulate(times=TIMES, accuracy=1e-9, start={"crank": (0.2, 0.0)})
    assert np.abs(r["crank.q"] - judged(moment, 0.2, 0.0)).max() <= r.motion.error + AGREES


def test_kinks_of_tables_and_of_wrapped_angles_are_known_to_the_methods():
    by_driver = bm.Motor(law=table("coordinate", ANGLES, turns=2), driver="crank")
    system = System(rod((by_driver, ON_CRANK)))
    assert system.period == 2 * TURN
    assert system.knots == pytest.approx(ANGLES[0])
    spring = bm.TorsionSpring(stiffness=1.0, rest_angle=0.5)
    assert System(rod((spring, ON_CRANK))).knots == pytest.approx([0.5 + math.pi])
    own = bm.Motor(law=table("coordinate", ([-1.0, 0.0, 2.0], [0.0, 1.0, 0.0]), turns=1))
    knots = System(rod((own, ON_CRANK))).knots
    assert knots == pytest.approx([0.0, 2.0, TURN - 1.0], abs=1e-12)


def test_a_law_of_a_driver_that_counts_turns_has_no_period():
    law = {"kind": "polynomial", "of": "coordinate", "coefficients": [0.0, -0.5]}
    assert System(rod((bm.Motor(law=law, driver="crank"), ON_CRANK))).period is None
    r = rod((bm.Motor(law=law, driver="crank"), ON_CRANK)).simulate(
        times=TIMES, start={"crank": (1.0, 9.0)}
    )
    expected = judged(lambda q, w, t: -0.5 * q, 1.0, 9.0)
    assert np.abs(r["crank.q"] - expected).max() <= r.motion.error + AGREES
