"""Friction laws beyond Coulomb's in motion: closed forms, integrations that know nothing of us."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import blockmech as bm
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.programs import pair_program
from blockmech.dynamics.system import System
from blockmech.plan.settings import friction_asked
from tests import machines
from tests.gallery import changed, document

G = 9.81  # [m/s2]
HANGING = -math.pi / 2  # [rad]
STRIBECK = {"static": 0.3, "kinetic": 0.2, "stribeck_speed": 0.5, "viscous": 0.01}
WAYS = [("auto", "auto"), ("dop853", "scalar"), ("dop853", "llvm"), ("radau", "auto")]


def wheel(friction, inertia=1 / 3, mass=1.0, cm=0.0, gravity=0.0):
    """One link on a pin, its inertia [kg m2] about that."""
    link = bm.Link(mass=mass, inertia=inertia - mass * cm**2, cm=(cm, 0.0))
    return machines.crank(1.0, link, friction, gravity=gravity)


def pendulum(friction):
    """1 kg, its centre 0.5 m below the pin, 1/3 kg m2 about that."""
    return wheel(friction, cm=0.5, gravity=G).compile()


# -- Stribeck's pendulum ---------------------------------------------------------------------
#
# DOP853 to 1e-13 on (J al + m g l sin th)^2 = (f r)^2 |R|^2, a quadratic in al, where R has the
# components m (l w^2 + g cos th) and m (l al + g sin th): another program, without blockmech.

REFERENCE = {0.5: 0.31149974060, 1.0: -1.79048110764}  # [s]: [rad] from below
SWINGS = 28


def law():
    return bm.friction.Stribeck(**STRIBECK, radius=0.05)


@pytest.mark.parametrize(("method", "engine"), WAYS)
def test_stribecks_pendulum_is_where_another_formulation_has_it(method, engine):
    times = [0.5] if method == "radau" else [*REFERENCE]
    moved = pendulum(law()).simulate(
        f"time={times[-1]}",
        start={"crank": (2.0 + HANGING, 0.0)},
        times=times,
        method=method,
        engine=engine,
        accuracy=1e-11,
        want=["crank.q"],
    )
    expected = np.array([REFERENCE[t] for t in times]) + HANGING
    assert np.abs(moved["crank.q"] - expected).max() <= 6e-12 + moved.motion.error
    assert moved.motion.error <= 1e-10


def test_stribecks_pendulum_rests_after_28_half_swings_where_static_friction_holds_it():
    mech = pendulum(law())
    explicit, implicit = (
        mech.simulate("time=60", start={"crank": (2.0 + HANGING, 0.0)}, method=m, want=()).motion
        for m in ("dop853", "radau")
    )
    for motion in (explicit, implicit):
        assert [e.kind for e in motion.events].count("standstill") == SWINGS
        assert motion.events[-1].kind == "rest"
        assert G * 0.5 * abs(math.sin(motion.q_end - HANGING)) <= 0.3 * 0.05 * G
        low, high = motion.facts["holding_low"], motion.facts["holding_high"]
        # a pendulum at rest: |R| = m g whatever the angle, but for the moment that is to start it
        assert high - low == pytest.approx(2 * 0.3 * 0.05 * G, rel=2e-2)
    assert abs(explicit.q_end - implicit.q_end) <= explicit.error + implicit.error
    lost = G * 0.5 * (math.cos(explicit.q_end - HANGING) - math.cos(2.0))
    assert explicit.facts["friction_work"] == pytest.approx(lost, rel=1e-10)


@pytest.mark.parametrize("q", [2.0, 0.3, -1.2])
def test_the_first_acceleration_is_the_root_of_the_quadratic(q):
    """By the law as it is at a rate, in the formulation of the reference."""
    w, f = 0.7, law().at(0.7).factor
    moved = pendulum(law()).simulate(
        "time=0.1", start={"crank": (q + HANGING, w)}, times=[0.0], want=["*.acceleration"]
    )
    acceleration = moved["crank.acceleration"][0]
    Rr, Rt = 0.5 * w**2 + G * math.cos(q), 0.5 * acceleration + G * math.sin(q)
    assert acceleration / 3 + 0.5 * G * math.sin(q) == pytest.approx(
        -f * math.hypot(Rr, Rt), rel=1e-13
    )


# -- closed forms ----------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "engine"), WAYS)
def test_a_wheel_on_a_viscous_pin_slows_down_exponentially(method, engine):
    t = np.array([0.1, 0.5] if method == "radau" else [0.5, 2.0])
    moved = wheel(bm.friction.Viscous(damping=0.2)).compile().simulate(
        f"time={t[-1]}", start={"crank": (0.3, 5.0)}, times=t, method=method, engine=engine,
        accuracy=1e-11, want=["crank.q", "crank.rate"],
    )  # fmt: skip
    decay = np.exp(-0.2 * 3 * t)
    assert np.abs(moved["crank.rate"] - 5 * decay).max() <= 1e-10
    assert np.abs(moved["crank.q"] - 0.3 - 5 * (1 - decay) / 0.6).max() <= 1e-10
    lost = (1 - decay[-1] ** 2) * 25 / 6
    assert moved.motion.facts["friction_work"] == pytest.approx(lost, rel=1e-9)


def test_a_massless_link_drags_too():
    """What turns with a wheel and weighs nothing still drags in its pins: for run and motion."""
    g = wheel(bm.friction.Viscous(damping=0.0))
    g.blocks["frame"] = bm.Frame(markers={"A": (0.0, 0.0), "D": (3.0, 0.0)})
    g.add(
        "rod", bm.RRR(l_i=3.0, l_j=1.0, branch=1, friction={"D": bm.friction.Viscous(damping=0.2)})
    )
    machines.wire(g, "crank.B rod.B", "frame.D rod.D")
    mech = g.compile()
    run = mech.run(at=[0.4, 1.0], rates=2.0, want=["crank.drive", "mechanism.friction_power"])
    assert np.abs(run["crank.drive"] - 0.2 * 2.0).max() <= 1e-14  # a parallelogram
    assert np.abs(run["mechanism.friction_power"] - 0.2 * 4.0).max() <= 1e-14
    moved = mech.simulate("time=0.4", start={"crank": (0.3, 5.0)}, times=[0.4], want="crank.rate")
    assert moved["crank.rate"][0] == pytest.approx(5 * math.exp(-0.24), rel=1e-11)


@pytest.mark.parametrize("method", ["dop853"])
def test_a_preload_brakes_evenly_and_holds(method):
    motion = wheel(bm.friction.Preload(resistance=0.5)).compile().simulate(
        "time=9", start={"crank": (0.0, 3.0)}, method=method, want=()
    ).motion  # fmt: skip
    assert motion.q_end == pytest.approx(9.0 / 2 / 1.5, rel=1e-9)
    assert motion.events[-1].t == pytest.approx(2.0, rel=1e-9)
    assert motion.facts["holding_high"] == pytest.approx(0.5, rel=1e-12)
    assert motion.facts["holding_low"] == pytest.approx(-0.5, rel=1e-12)


def test_static_friction_holds_up_to_its_own_limit_and_kinetic_friction_slows():
    pin = bm.friction.Stiction(static=0.4, kinetic=0.1, radius=0.1)
    mech = pendulum(pin)
    for q, holds in ((0.07, True), (0.0815, False)):  # 0.5 sin q against 0.4 * 0.1
        motion = mech.simulate("time=1", start={"crank": (q + HANGING, 0.0)}, want=()).motion
        assert (motion.q_end == q + HANGING) is holds
    result = mech.simulate("swings=1", start={"crank": (1.0 + HANGING, 0.0)}, want=()).motion
    weak = pendulum(bm.friction.Coulomb(coefficient=0.1, radius=0.1))
    plain = weak.simulate("swings=1", start={"crank": (1.0 + HANGING, 0.0)}, want=()).motion
    assert result.q_end == pytest.approx(plain.q_end, abs=1e-13)


# -- stick-slip ------------------------------------------------------------------------------

MASS, STIFF, PULLED = 1.0, 40.0, 0.02  # [kg], [N/m], [m/s] of the spring's other end
CURVE = bm.friction.Stribeck(static=0.3, kinetic=0.15, stribeck_speed=0.03, viscous=0.05)


def slider():
    """A slider on a rough floor; its spring's other end is pulled along, as a force of time."""
    lines = {
        "spring": {"of": "coordinate", "coefficients": [STIFF, -STIFF]},
        "pull": {"of": "time", "coefficients": [0.0, STIFF * PULLED]},
    }
    return machines.pulled(bm.Link(mass=MASS, inertia=0.1), CURVE, lines, gravity=G).compile()


def sticking_and_slipping(t_end):
    """[t, x] of every start and stop, by solve_ivp between them."""
    t, x, events = 0.0, 0.0, []
    while True:
        t = (CURVE.static * MASS * G / STIFF + x) / PULLED  # the spring wins
        if t > t_end:
            return events
        events.append((t, x))

        def rates(s, y):
            friction = CURVE.at(max(y[1], 0.0)).factor * MASS * G
            return y[1], (STIFF * (PULLED * s - y[0]) - friction) / MASS

        def stopped(s, y):
            return y[1]

        stopped.terminal, stopped.direction = True, -1
        # From the limit itself it leaves with no acceleration: by the growing root of the linear
        # equation, which solve_ivp finds from a speed that is below all that is compared.
        leg = solve_ivp(
            rates, (t, t + 50), (x, 1e-13), "DOP853", events=stopped, rtol=1e-13, atol=1e-15
        )
        t, x = float(leg.t[-1]), float(leg.y[0, -1])
        if t > t_end:
            return events
        events.append((t, x))


def test_a_slider_on_a_pulled_spring_sticks_and_slips():
    t_end = 20.0
    motion = slider().simulate(f"time={t_end}", start={"block": (0.0, 0.0)}, want=()).motion
    stops = [(e.t, e.q) for e in motion.events if e.kind == "standstill"]
    expected = sticking_and_slipping(t_end)
    assert len(expected) >= 6
    assert np.abs(np.array(stops) - expected[1::2]).max() <= 1e-9
    assert motion.reached


# -- one law for run and motion --------------------------------------------------------------


def test_a_motion_of_a_linkage_leaves_no_drive_over_with_any_law():
    data = document("ruiz_fourbar")
    data["blocks"]["crank"]["friction"] = {"A": {"law": "viscous", "damping": 3.0}}
    data["blocks"]["dyad"]["friction"] = {
        "B": {"law": "stribeck", **STRIBECK, "radius": 0.05},
        "C": {"law": "rolling_bearing", "mean_diameter": 0.2, "f1": 0.002, "f0": 9.0,
              "viscosity": 1e-3},
        "D": {"law": "preload", "resistance": 20.0},
    }  # fmt: skip
    mech = changed(data)
    for engine, span in (("scalar", 0.05), ("llvm", 0.3)):
        moved = mech.simulate(
            f"time={span}", start={"crank": (1.0, 30.0)}, engine=engine,
            want=["crank.drive", "crank.drive_by_reduction", "mechanism.friction_power"],
        )  # fmt: skip
        size = np.abs(moved["crank.drive_by_reduction"]).max()
        assert np.abs(moved["crank.drive"]).max() <= 1e-10 * size
        assert moved.motion.facts["energy_balance"] <= 1e-9
        assert moved["mechanism.friction_power"].min() > 0
    assert (moved.motion.method, moved.motion.why) == ("dop853", "the joints have friction")


def test_interpreted_and_compiled_states_are_the_same_to_rounding(monkeypatch):
    data = document("ruiz_fourbar")
    pin = {"law": "stribeck", **STRIBECK, "radius": 0.05}
    data["blocks"]["dyad"]["friction"] = dict.fromkeys("BCD", pin)
    mech = changed(data)
    system = System(mech, method=friction_asked(None), engine="llvm")
    fast, plain = Equation(system, 1.0), Equation(system, 1.0)
    monkeypatch.setattr(plain, "row", lambda t, y: None, raising=False)
    for q, rate in ((1.0, 20.0), (1.7, 3.0), (2.9, -0.02)):
        for one in (fast, plain):
            one.sides = system.friction.slipping(np.array([q]), np.array([rate]))
        y = np.array([q, rate, 0.0, 0.0])
        np.testing.assert_allclose(fast(0.1, y), plain(0.1, y), rtol=1e-12)
    compiled, interpreted, implicit = (
        mech.simulate("time=0.1", start={"crank": (1.0, 20.0)}, method=method, engine=engine).motion
        for method, engine in (("dop853", "llvm"), ("dop853", "scalar"), ("radau", "auto"))
    )
    for other in (interpreted, implicit):
        assert abs(compiled.q_end - other.q_end) <= compiled.error + other.error


def test_the_laws_of_a_motion_are_the_passes():
    """The one program of laws says at a rate what each law's kernel does."""
    mech = pendulum(law())
    program = pair_program(mech)
    assert program.laws.inputs == ("slip_0",)
    assert not program.drags
