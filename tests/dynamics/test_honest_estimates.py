"""Every estimate of an error holds, on every graph.

For each graph that can move, a few starts, the methods that apply and some targets: the true
error is never above the reported one, and a target that is missed is said to be missed. What is
taken for the truth is told in `honesty`.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.estimate import refined
from blockmech.dynamics.system import System
from blockmech.ground.plane import EPS
from blockmech.result.motion import Cost, Motion, State
from tests.campaigns.honesty import scene
from tests.dynamics.honesty import (
    DEAR,
    GRAPHS,
    REQUESTED,
    RUNS,
    TARGETS,
    Run,
    agree,
    assert_honest,
    assert_honest_at_all,
    mechanism,
    moved,
)
from tests.dynamics.one_chart import in_one_chart

STARTS = [  # of machines with several drivers: span [s], a start for each driver
    pytest.param("fivebar_falling", 0.4, ((1.2, 0.0), (2.2, 0.0)), id="fivebar-from-rest"),
    pytest.param("fivebar_falling", 0.4, ((1.0, 1.5), (2.4, -2.0)), id="fivebar-thrown"),
    pytest.param("excavator", 0.1, ((2.5, 0.0), (3.3, 0.0), (2.3, 0.1)), id="excavator"),
]
CASES = [
    pytest.param(name, run, id=f"{name.strip()}-{run.q:g}-{run.rate:g}")
    for name, (_, runs) in RUNS.items()
    for run in runs
]


def test_every_graph_of_the_gallery_is_swept():
    graphs = {path.stem for path in GRAPHS.glob("*.json")}
    assert {name.strip() for name in RUNS} | {case.values[0] for case in STARTS} == graphs


@pytest.mark.parametrize(("name", "run"), CASES)
def test_estimates_hold(name, run):
    assert_honest_at_all(name, run, "auto", TARGETS)


@pytest.mark.parametrize("name", [name for name in RUNS if name not in DEAR])
def test_integrators_are_honest(name):
    for method, target in (("dop853", 1e-6), ("radau", 1e-5), ("rk4", 1e-3)):
        assert_honest_at_all(name, RUNS[name][1][-1], method, (target,))


@pytest.mark.parametrize(("name", "span", "start"), STARTS)
def test_several_drivers_are_honest(name, span, start):
    mech = bm.Graph.load(GRAPHS / f"{name}.json").compile()

    def falling(method, accuracy):
        times = np.linspace(0.0, span, REQUESTED + 1)[1:]
        request = {"times": times, "start": dict(zip(mech.drivers, start, strict=True))}
        until = f"time={span!r}"
        return mech.simulate(
            until, method=method, accuracy=accuracy, friction="none", **request
        ).motion

    truth, second = falling("dop853", 1e-11), falling("radau", 1e-6)
    assert agree(truth, second)
    for method in ("auto", "radau"):
        assert_honest(falling(method, 1e-5), truth)


def test_the_time_of_a_dead_centre_is_honest():
    """The trammel's shoe runs out to its dead centre; in the bar's angle that is regular."""
    mech = mechanism("elliptic_trammel")
    assert math.isclose(mech.structure.blocks["bar"].l, 0.5)
    for q, rate in ((0.1, 1.0), (-0.2829, -5.29), (0.3, 0.0)):
        exact = _until_dead_centre(q, rate)
        for method, target in (("energy", 1e-12), ("dop853", 1e-6)):
            motion = in_one_chart(
                mech, "standstill", method=method, accuracy=target, start={"shoe": (q, rate)}
            )
            assert motion.end == "dead centre"
            assert abs(motion.t_end - exact) <= motion.time_error


def _until_dead_centre(q, rate):
    """Time [s] from q until shoe, bar and guide are in line, by Gauss quadrature."""
    l, g = 0.5, 9.81
    shoe, bar, end = (1.0 + 0.3 * i for i in _order())

    def parts(a):
        """J and V for the angle a of the bar at the shoe."""
        c, s = np.cos(a), np.sin(a)
        lengthwise, across = 0.05, 0.02  # [m] centre of mass in the bar's axes
        x, y = -l * s + lengthwise * s - across * c, lengthwise * c + across * s
        J = shoe * (l * s) ** 2 + end * (l * c) ** 2 + bar * (x**2 + y**2) + 0.01
        return J, g * (bar * (lengthwise * s - across * c) + end * l * s)

    start = math.acos(q / l)
    aim = 0.0 if rate > 0 or (rate == 0 and q > 0) else math.pi
    J0, V0 = parts(start)
    energy = J0 * (rate / (l * math.sin(start))) ** 2 / 2 + V0
    x, w = np.polynomial.legendre.leggauss(60)
    u = (1 + x) / 2  # the root of the way, in which a start from rest is regular
    J, V = parts(start + (aim - start) * u**2)
    return float(abs(aim - start) * (w * u) @ np.sqrt(J / (2 * (energy - V))))


def _order():
    blocks = list(mechanism("elliptic_trammel").structure.blocks)
    return blocks.index("shoe"), blocks.index("bar"), blocks.index("bar")


def test_a_motion_that_ends_before_a_dead_centre_does_not_lose_the_digits_of_its_poses():
    """0.7 mrad of a chain that folds 0.7 rad further on, by two kinds of methods."""
    run = Run(0.7241827027570691, 0.0, 0.006323030953346298)
    path, time = (moved("parallelogram_chain", run, m, 1e-14) for m in ("energy", "dop853"))
    assert abs(path.q_end - time.q_end) <= 4 * np.spacing(run.q)
    assert 0 < path.error <= 64 * np.spacing(run.q)


def test_steps_that_an_event_cuts_do_not_hide_the_error_of_a_second_run():
    """At a coarse target both runs of the slider that sticks took equal steps: 8e-16 was said."""
    mech = bm.Graph.load(GRAPHS / "motions" / "sticking_slider.json").compile()
    request = {"start": {"slider": (0.2623050323647527, 3.3383364705564734e-05)}}
    times = np.linspace(0.0, 0.3504485484886209, REQUESTED + 1)[1:]
    motion, exact = (
        mech.simulate(times=times, method="dop853", accuracy=a, **request).motion
        for a in (1e-3, 1e-13)
    )
    assert_honest(motion, exact)


def test_steps_that_agree_by_chance_in_front_of_a_dead_centre_are_not_believed():
    """With half the step a run of ``rk4`` was 1e-8 beside this one, and 1.6e-7 off."""
    _, mech, start, span = scene(958_000_005)
    exact = in_one_chart(mech, f"time={span!r}", method="energy", accuracy=1e-13, start=start)
    step = 0.000162587825116848
    motion = mech.simulate(f"time={span!r}", method=bm.FixedStep("rk4", step), start=start).motion
    assert_honest(motion, exact)
    assert motion.error < 1e-5


@pytest.mark.parametrize("target", [1e-2, 1e-3 * 10**0.5, 3.27e-4, 1e-4])
def test_loose_targets_are_judged_by_steps_whose_errors_fall_with_their_length(target):
    """Steps of such a length gave 1.5e-4 for 2.9e-4: no sixteenth was left of the difference."""
    _, mech, start, span = scene(1_129_000_008)
    request = {"start": start, "method": "dop853"}
    motion, exact = (
        mech.simulate(f"time={span!r}", accuracy=a, **request).motion for a in (target, 1e-12)
    )
    assert_honest(motion, exact)


def pairs_of(*offs):
    """Pairs of runs of q = 1 + t that are so far off, as `refined` asks for them."""
    offsets = iter(offs)

    def run(off, states):
        track = SimpleNamespace(state=lambda t: State(t * (1 + off), 1 + off + 0 * t))
        cost = Cost(states=states)
        return Motion("any", "", 0.0, 1.0, 1 + off, 1 + off, track, None, error=math.inf, cost=cost)

    return lambda _, halves: run(next(offsets), 100 if halves else 0)


@pytest.mark.parametrize("target", [1e-7, 5e-9])
def test_a_load_that_passes_through_zero_within_a_step_is_stated(target):
    """Where it does the pin's friction has a corner; half the steps may hit it worse."""
    pytest.importorskip("llvmlite")  # by whose steps it was found
    pendulum = bm.Graph.load(GRAPHS / "motions" / "pin_pendulum.json").compile()
    start = {"crank": (0.37899672956154723, -0.16631446156137006)}
    times = np.linspace(0.0, 2.074735950072201, REQUESTED + 1)[1:]
    request = {"times": times, "start": start, "method": "dop853", "engine": "llvm", "want": ()}
    motions = (pendulum.simulate(accuracy=x, **request).motion for x in (target, 1e-12))
    assert agree(*motions)


@pytest.mark.parametrize(("offs", "off"), [((4e-4, 0.0, 4e-6, 1e-7), 1e-7), ((4e-6, 0.0), 0.0)])
def test_pairs_are_refined_until_one_meets_the_target(offs, off):
    system = mechanism("watt_sixbar")._once(System)
    motion = refined(pairs_of(*offs), system, 1e-6, (), 1 / 16)
    assert motion.q_end == 1 + off
    assert motion.error == pytest.approx((4e-6 - off) / 16, rel=1e-6)


def test_below_the_floor_of_rounding_the_smaller_error_is_stated_and_the_floor_is_named():
    system = mechanism("watt_sixbar")._once(System)
    pairs = 1e-11, 0.0, 1e-14, 3e-14  # half the steps of the last pair are further off
    motion = refined(pairs_of(*pairs), system, 1e-15, (), 1 / 16)
    assert 1e-15 < motion.error < 1e-12
    assert motion.notes[-1].endswith("the floor of rounding")


def test_errors_that_cancel_by_chance_are_not_stated_where_finer_runs_tell():
    """Both runs of the first pair are 3e-6 off, and 1e-12 apart."""
    system = mechanism("watt_sixbar")._once(System)
    pairs = 3e-6 + 1e-12, 3e-6, 1e-7, 0.0, 1e-9, 0.0
    motion = refined(pairs_of(*pairs), system, 1e-15, (), 1 / 16)
    assert motion.q_end == 1.0
    assert motion.error == pytest.approx(1e-9 / 16, rel=1e-3)


SCALAR = ["hammer", "motions/clock", "motions/pin_pendulum"]
FALLING = ["watt_sixbar", "pump", "motions/shaken_slider", "stribeck_slider_crank"]
SAME = 1 + 1e-6  # of a floor of rounding, which is told by states on the way


@pytest.mark.parametrize(
    ("name", "engine"), [*((x, "scalar") for x in SCALAR), *((x, "auto") for x in FALLING)]
)
def test_a_tighter_request_states_no_larger_error(name, engine):
    mech, last = bm.Graph.load(GRAPHS / f"{name}.json").compile(), math.inf
    for target in (1e-6, 1e-9, 1e-11, 1e-12, 1e-14):
        motion = mech.simulate(
            "time=0.1", method="dop853", accuracy=target, engine=engine, want=[]
        ).motion
        assert motion.error <= last * SAME + EPS  # of the places that are compared
        assert motion.reached or any("accuracy not reached" in note for note in motion.notes)
        last = motion.error
