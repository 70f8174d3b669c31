"""The right-hand side as machine code: the same numbers, the same motions, the same failures."""

import functools
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics import solvers
from blockmech.dynamics.change_points import FollowingSystem
from blockmech.dynamics.equation import Equation, cached_rates
from blockmech.dynamics.solvers import ANYWHERE, AdaptiveSolver
from blockmech.dynamics.system import System
from blockmech.engines.cost import Account
from blockmech.plan.settings import friction_asked
from tests.dynamics.test_friction import pendulum, rubbing
from tests.gallery import changed, document, mechanism
from tests.independent.released import five_bar

pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")


ROUGH = 0.3  # [m] of a pin on which a pendulum rests after ten swings
PASSES = bm.Watch("passes", lambda t, q, qd: qd * (q - 0.9), terminal=False)


def both(make, engine="llvm", **request):
    """A motion interpreted, and with machine code."""
    motions = [make().simulate(want=[], engine=e, **request).motion for e in ("scalar", engine)]
    assert [motion.engine for motion in motions] == ["scalar", "llvm"]
    return motions


def assert_one_motion(one, other):
    """Within their estimates, and by the same events."""
    assert (one.status, one.end, one.notes) == (other.status, other.end, other.notes)
    assert [e.kind for e in one.events] == [e.kind for e in other.events]
    t = np.linspace(one.t_start, min(one.t_end, other.t_end), 50)
    assert np.abs(one.at(t).q - other.at(t).q).max() <= one.error + other.error
    assert abs(one.t_end - other.t_end) <= one.time_error + other.time_error


@pytest.mark.parametrize(
    ("name", "method"),
    [(x, "dop853") for x in ("watt_sixbar", "andrews_squeezer", "pump")] + [("pump", "radau")],
)
def test_a_motion_is_the_same(name, method):
    request = {"until": "time=0.02", "method": method, "accuracy": 1e-8}
    assert_one_motion(*both(lambda: mechanism(name), **request))


@pytest.mark.parametrize("engine", ["llvm", "auto"])  # which begins in the middle of a segment
def test_a_motion_with_friction_is_the_same(monkeypatch, engine):
    monkeypatch.setattr(Account, "states_pay", lambda self, program, states: states > 700)
    request = {"until": "time=0.8", "start": {"crank": (1.0, 0.0)}, "method": "dop853"}
    request["accuracy"] = 1e-7
    first, second = both(rubbing, engine, **request)
    assert_one_motion(first, second)
    assert second.facts["energy_balance"] < 1e-7
    assert second.facts["friction_work"] == pytest.approx(first.facts["friction_work"], rel=1e-7)


@pytest.fixture(scope="module")
def to_rest():
    """``to_rest(start)``: the pendulum's motion by another method, until it rests."""

    @functools.cache
    def motion(start):
        request = {"start": {"crank": start}, "method": "radau", "accuracy": 1e-9, "want": []}
        return pendulum(radius=ROUGH).simulate("swings=100", **request).motion

    return motion


@pytest.mark.parametrize(
    "request_of",
    [
        {"until": "swings=100"},
        {"until": "time=100"},
        {"until": "swings=100", "start": {"crank": (0.5, 0.3)}},
        {"until": "swings=100", "accuracy": 1e-10},  # 1e-12 is less than steps round to
        {"until": "time=3"},
        {"until": "swings=2"},
        {"until": "swings=2", "engine": "scalar"},
    ],
)
def test_many_swings_with_friction_are_followed_in_time(request_of, to_rest):
    request = {"start": {"crank": (0.5, 0.0)}, "want": []} | request_of
    motion = pendulum(radius=ROUGH).simulate(**request).motion
    stepwise = to_rest(request["start"]["crank"])
    assert motion.method == "dop853"
    assert motion.engine == request.get("engine", "llvm")
    kinds = [e.kind for e in motion.events]
    assert kinds == [e.kind for e in stepwise.events][: len(kinds)]
    assert (kinds[-1] == "rest") == (len(kinds) == len(stepwise.events))
    last_q = float(stepwise.at(min(motion.t_end, stepwise.t_end)).q)
    off = motion.error + stepwise.error + abs(motion.qd_end) * motion.time_error
    assert abs(motion.q_end - last_q) <= off
    assert motion.error <= request.get("accuracy", 1e-9)


def test_friction_that_no_certificate_covers_is_left_to_continuation():
    request = {"until": "time=1", "start": {"crank": (0.5, 1.0)}, "method": "dop853"}
    first, second = both(lambda: pendulum(coefficient=1.0, radius=1.2), **request)
    assert_one_motion(first, second)
    assert second.end == "self-locking in motion"


@pytest.mark.parametrize("make", [rubbing, lambda: mechanism("watt_sixbar")])
def test_a_row_says_what_is_interpreted_otherwise(monkeypatch, make):
    system = System(make(), method=friction_asked(None), engine="llvm")
    fast, plain = Equation(system, 1.0), Equation(system, 1.0)
    monkeypatch.setattr(plain, "row", lambda t, y: None, raising=False)
    sizes = 4 if system.friction is not None else 3
    for q, rate in ((1.0, 2.0), (1.7, -3.0), (0.4, 0.5)):
        for one in (fast, plain):
            if system.friction is not None:
                one.sides = system.friction.slipping(np.array([q]), np.array([rate]))
        y = np.array([q, rate, 0.0, 0.0][:sizes])
        expected = np.array(plain(0.1, y))
        assert np.isfinite(expected).all()
        np.testing.assert_allclose(fast(0.1, y), expected, rtol=1e-11)
        margin, inertia = system.scalar_terms(q).margin, system.scalar_terms(q).J / fast.typical
        assert fast.closeness(y) == pytest.approx((margin, inertia), rel=1e-11)
        if system.friction is not None:
            np.testing.assert_allclose(fast.slips(y), plain.slips(y), rtol=1e-12)
            pairs = fast.pair_loads(0.1, y), plain.pair_loads(0.1, y)
            np.testing.assert_allclose(*pairs, rtol=1e-11)
    assert cached_rates(system) is not None


def five_bar_with(friction=None, stop=0.0):
    """Two drivers released at rest; pins that rub, and the way of the second driver [rad]."""
    case = five_bar(np.random.default_rng([1, 7]))
    for joint in case["joints"].values() if friction else ():
        joint["friction"] = friction
    if stop:
        q = case["initial"]["two"]["q"]
        case["stops"] = {"two": {"from": q - stop, "to": q + stop}}
    return bm.Linkage.from_data(case).compile()


STRIBECK = {"law": "stribeck", "kinetic": 0.1, "static": 0.2, "stribeck_speed": 0.5}


@pytest.mark.parametrize(
    "friction", [None, {"coefficient": 0.1, "radius": 0.01}, {**STRIBECK, "radius": 0.02}]
)
def test_a_row_of_several_drivers_says_what_is_interpreted_otherwise(monkeypatch, friction):
    system = System(five_bar_with(friction), method=friction_asked(None), engine="llvm")
    q = np.array([1.6, 2.4])
    fast, plain = Equation(system, q), Equation(system, q)
    monkeypatch.setattr(plain, "row", lambda t, y: None, raising=False)
    for rate in ([2.0, -1.0], [-0.3, 0.7], [1.0, 1.0]):
        for one in (fast, plain):
            if system.friction is not None:
                one.sides = system.friction.slipping(q, np.array(rate))
        y = fast.layout.start(q, rate)
        assert fast.code is not None
        np.testing.assert_allclose(fast(0.1, y), plain(0.1, y), rtol=1e-11)
        assert fast.closeness(y) == pytest.approx(plain.closeness(y), rel=1e-11)
        if system.friction is not None:
            np.testing.assert_allclose(fast.slips(y), plain.slips(y), rtol=1e-11)
            pairs = fast.pair_loads(0.1, y), plain.pair_loads(0.1, y)
            np.testing.assert_allclose(*pairs, rtol=1e-10)


@pytest.mark.parametrize("stop", [0.0, 0.6])
def test_a_motion_of_several_drivers_is_the_same(stop):
    """Reversals, and a stop of a driver that machine code does not look for, end its steps."""
    friction = {"coefficient": 0.1, "radius": 0.01}
    request = {"until": "time=0.3", "accuracy": 1e-8}
    first, second = both(lambda: five_bar_with(friction, stop), **request)
    assert_one_motion(first, second)
    assert second.end == ("end stop of two" if stop else "time")
    assert "reversal of joint.C" in [e.kind for e in second.events]
    assert second.facts["friction_work"] == pytest.approx(first.facts["friction_work"], rel=1e-8)


@pytest.mark.parametrize("engine", ["scalar", "llvm"])
def test_a_motion_hangs_on_its_request_alone(engine):
    """With "auto" it may begin interpreted, and differ by rounding from one that is compiled."""
    mech = changed(document("watt_sixbar"))
    request = {"until": "time=0.5", "method": "dop853", "want": [], "engine": engine}
    first, second = (mech.simulate(**request).motion for _ in range(2))
    t = np.linspace(0.0, 0.5, 50)
    np.testing.assert_array_equal(first.at(t), second.at(t))


def test_motions_that_are_asked_for_again_are_compiled(monkeypatch):
    request = {"until": "time=0.5", "method": "dop853", "want": []}
    # states: some motions of both runs
    monkeypatch.setattr(Account, "states_pay", lambda self, program, states: states > 2000)
    mech = changed(document("watt_sixbar"))
    engines = [mech.simulate(**request).motion.engine for _ in range(9)]
    assert engines == sorted(engines, reverse=True)
    assert (engines[0], engines[-1]) == ("scalar", "llvm")


@pytest.mark.parametrize(
    ("name", "start", "span", "methods"),
    [
        (
            "rack_gripper",
            (0.0, 0.05),
            0.02,
            ["energy", "energy", "dop853"],
        ),  # no period: sampled anew
        ("watt_sixbar", (1.5, 0.0), 0.5, ["energy"] * 3),  # what it samples is kept
    ],
)
def test_auto_leaves_a_path_that_costs_more_than_steps(monkeypatch, name, start, span, methods):
    monkeypatch.setattr(Account, "pays", lambda self, program, seconds: seconds > 1e-3)
    mech = mechanism(name)
    request = {"until": f"time={span}", "start": {mech.drivers[0]: start}, "want": []}
    motions = [mech.simulate(**request).motion for _ in methods]
    assert [motion.method for motion in motions] == methods
    assert abs(motions[0].q_end - motions[-1].q_end) <= sum(motions[i].error for i in (0, -1))
    assert motions[-1].error <= 1e-9


def test_engines_of_motions_are_told_by_name():
    with pytest.raises(bm.RequestError, match='no engine "numpy"'):
        mechanism("watt_sixbar").simulate("time=1", engine="numpy")


def test_series_through_change_points_are_not_compiled():
    system = FollowingSystem(mechanism("watt_sixbar"), engine="llvm")
    assert Equation(system, 1.0).row(0.0, (1.0, 2.0, 0.0)) is None


def test_where_there_is_no_pose_there_are_no_rates():
    data = document("ruiz_fourbar")
    data["blocks"]["dyad"]["l_i"] = 3.0  # reaches from 2.5 to 5.5, not to 7.5
    system = System(changed(data), method=friction_asked("none"), engine="llvm")
    row = Equation(system, 0.0).row(0.0, (math.pi, 1.0, 0.0))
    assert row is not None
    assert not row[3] > 0
    assert all(math.isnan(x) for x in row[:3])


@pytest.mark.parametrize(
    ("make", "request_of"),
    [
        (rubbing, {"until": "time=0.8", "start": {"crank": (1.0, 0.0)}}),
        (lambda: mechanism("watt_sixbar"), {"until": "swings=3", "start": {"crank": (1.0, 0.0)}}),
        (lambda: mechanism("watt_sixbar"), {"until": "angle=0", "start": {"crank": (1.0, 0.0)}}),
        (lambda: mechanism("pump"), {"until": "time=1"}),
    ],
)
def test_in_steps_that_machine_code_calls_calm_nothing_happens(monkeypatch, make, request_of):
    """At a coarse target, where steps are long."""
    request = request_of | {"method": "dop853", "engine": "llvm", "accuracy": 1e-3, "want": []}
    steps = AdaptiveSolver.steps

    def alone(self, free_range=ANYWHERE, every=True):
        self.finer = None  # a run beside it would learn from its steps
        return steps(self, free_range, every)

    def in_doubt(self, free_range=ANYWHERE, every=True):
        steps = alone(self, free_range, every)
        return steps and steps._replace(calm=0, turns=())

    monkeypatch.setattr(AdaptiveSolver, "steps", alone)
    passed = make().simulate(watch=[PASSES], **request).motion
    monkeypatch.setattr(solvers, "REPORTED", 1)
    monkeypatch.setattr(AdaptiveSolver, "steps", in_doubt)
    looked_at = make().simulate(watch=[PASSES], **request).motion
    assert [e.kind for e in passed.events] == [e.kind for e in looked_at.events]
    assert passed.end == looked_at.end
    times = [[e.t for e in motion.events] for motion in (passed, looked_at)]
    np.testing.assert_allclose(*times, rtol=1e-13)  # of the same steps
