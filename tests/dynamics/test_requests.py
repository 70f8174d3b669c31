"""What a simulation may be asked for: one message for each mistake, before anything is computed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics import integration
from blockmech.dynamics.motion_outputs import result_in_chart
from blockmech.dynamics.request import Until, Watch
from blockmech.ground.errors import RequestError
from tests import machines
from tests.dynamics import scenes
from tests.dynamics.one_chart import in_one_chart
from tests.dynamics.scenes import at_rest, motor, of_rate, rod

NAN = math.nan


def said(scene, *asked, **request):
    """The one message about a request that cannot be."""
    with pytest.raises(RequestError) as caught:
        scene.simulate(*asked, **{"start": at_rest(0.4), **request})
    (problem,) = caught.value.problems
    return str(problem)


@pytest.mark.parametrize("until", ["time=-1", "swings=0", "swings=2.5", "turns=0", "turns=-2"])
def test_an_end_that_cannot_be_is_refused_with_what_can(until):
    text = said(rod(), until)
    assert f'"{until}"' in text
    assert "takes a" in text


def test_an_end_made_in_python_is_checked_too():
    assert '"time=-1"' in said(rod(), Until("time", -1.0))
    assert "3 is no stopping condition" in said(rod(), 3)


def test_of_several_goals_the_first_that_is_met_ends_the_motion():
    full, fast = rod().simulate("standstill", start=at_rest(0.4)).motion, {"crank": (0.4, 30.0)}
    for until, end, t_end in (
        (f"standstill, time={2 * full.t_end}", "standstill", full.t_end),
        (f"time={full.t_end / 2}, standstill", "time", full.t_end / 2),
        (f"swings=3, {full.t_end * 1e3}ms, angle=0.3", "angle", None),
    ):
        motion = rod().simulate(until, start=at_rest(0.4)).motion
        assert (motion.end, motion.status) == (end, "reached")
        assert t_end is None or motion.t_end == pytest.approx(t_end, rel=1e-9)
    assert rod().simulate("standstill", start=fast).motion.end == "never reached: rotation"
    for until, end in (("standstill, time=2", "time"), ("standstill, turns=5, 9s", "turns")):
        assert rod().simulate(until, start=fast).motion.end == end


def test_goals_that_nobody_waits_for_together_are_refused_with_those_that_fit():
    for until in ("standstill, swings=2", "steady, time=3", ["standstill", "time=2"]):
        assert '"standstill, time=2"' in said(rod(), until)


def test_an_angle_may_be_in_degrees():
    assert Until.parse("angle=-60deg") == Until("angle", math.radians(-60.0))
    motion = rod().simulate("angle=-60deg", start=at_rest(0.4)).motion
    assert motion.q_end == pytest.approx(-math.pi / 3, abs=motion.error)


def test_a_size_is_a_number():
    assert "is not a number above zero" in said(rod(), "time=1", accuracy="small")
    step = bm.FixedStep("rk4", "small")
    assert "'small' is not a number above zero" in said(rod(), "time=1", method=step)


@pytest.mark.parametrize("size", [0, -1.0, NAN, math.inf])
def test_sizes_are_above_zero(size):
    for request in ({"accuracy": size}, {"method": bm.FixedStep("rk4", size)}):
        assert f"{size!r} is not a number above zero" in said(rod(), "time=1", **request)


def test_steps_are_fixed_of_textbook_methods_alone():
    message = said(rod(), "time=1", method=bm.FixedStep("dop853", 1e-3))
    assert 'method: no method "dop853". methods: rk4, euler_q.' in message


@pytest.mark.parametrize(
    "start",
    [{"crank": (NAN, 0.0)}, {"crank": None}, [0.3], {"crank": (1, 2, 3)}, {"crank": (0.0, 1e200)}],
)
def test_a_start_is_two_finite_numbers_for_each_driver(start):
    assert "[bad-request] start" in said(rod(), "time=1", start=start)


@pytest.mark.parametrize("angle", [0.3, "0.3 rad", np.float64(0.3)])
def test_a_coordinate_alone_starts_at_rest(angle):
    alone = rod().simulate("time=0.2", start={"crank": angle}).motion
    pair = rod().simulate("time=0.2", start={"crank": (0.3, 0.0)}).motion
    assert (alone.q_end, alone.qd_end) == (pair.q_end, pair.qd_end)


def test_what_is_no_start_or_no_goal_is_answered_in_the_names_of_the_mechanism():
    pendulum = bm.Linkage("pendulum", gravity=(0.0, -9.81))
    pendulum.add_link("arm", mass=1.0, cm=(0.5, 0.0))
    pendulum.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))
    pendulum.add_driver("swing", "O")
    mechanism = pendulum.compile()
    assert 'start={"swing": (0.0, 0.0)}' in said(mechanism, "time=1")
    assert '{"swing": (0.0, 0.0)}' in said(mechanism, "time=1", start="rest")
    assert 'write for example "time=3"' in said(mechanism, 3)


def test_end_stops_are_two_numbers_for_each_driver():
    assert "[bad-request] stops.crank" in said(rod(), "time=1", stops={"crank": 1.0})


@pytest.mark.parametrize(
    ("surface", "part"),
    [
        (lambda t, q, qd: 1 / (q - 0.4), "ZeroDivisionError"),
        (lambda t, q, qd: "below", "it gave 'below'"),
        (lambda t, q, qd: NAN, "it gave nan"),
    ],
)
@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_a_mistake_in_a_users_event_is_told_as_such(surface, part, method):
    for until in ("event", "time=1"):
        text = said(rod(), until, method=method, watch=[Watch("level", surface)])
        assert "[user-function] watch.level" in text
        assert part in text


def test_events_are_events_and_one_must_end_the_run():
    assert "are not events" in said(rod(), "time=1", watch=[lambda t, q, qd: q])
    assert "are not events" in said(rod(), "time=1", watch=Watch("brake", "q=-1"))
    passing = Watch("level", lambda t, q, qd: q, terminal=False)
    assert "watch=" in said(rod(), "event", watch=passing)


@pytest.mark.parametrize(("until", "start"), [
    ("standstill", (0.0, 0.0)), ("swings=2", (0.0, 40.0)), ("angle=-3", (0.0, 40.0)),
])  # fmt: skip
def test_a_goal_that_never_comes_is_said_to_be_never_reached(until, start):
    """From below and above its motor's steady rotation, which is told."""
    scene = rod(motor(9.0, 20.0))
    motion = scene.simulate(until, start={"crank": start}).motion
    assert (motion.status, motion.end) == ("ended", "never reached: rotation")
    steady = scene.simulate("steady", start={"crank": (0.0, 20.0)}).motion.facts
    for fact in ("period", "mean_speed"):
        assert motion.facts[fact] == pytest.approx(steady[fact], rel=1e-9)
    assert motion.cost.evaluations < integration.EVALUATIONS / 4


def test_a_wheel_that_speeds_up_for_ever_reaches_no_standstill():
    wheel = rod(lambda rate: 0.01 * rate, gravity=0.0)
    motion = wheel.simulate("standstill", start={"crank": (0.0, 4.0)}).motion
    assert (motion.status, motion.end) == ("ended", "never reached: run-up")
    turn = 0.01 * 2 * math.pi / scenes.J  # [rad/s] more in each: rate' = 0.01 rate / J
    assert motion.qd_end == pytest.approx(4.0 + turn * motion.q_end / (2 * math.pi), rel=1e-9)


def test_a_wheel_that_nearly_idles_is_followed_to_its_standstill():
    """Its turns differ by less than a thousandth, all alike: no series that fades out."""
    drag, rate = of_rate(-1e-4), 4.0
    wheel = rod(drag, lambda rate: -1e-3, gravity=0.0)
    motion = wheel.simulate("standstill", start={"crank": (0.0, rate)}).motion
    assert (motion.status, motion.end) == ("reached", "standstill")
    # J rate' = -c rate - m, so J rate / c - J m / c^2 ln(1 + c rate / m) is the way
    c, m, J = 1e-4, 1e-3, scenes.J
    way = J * rate / c - J * m / c**2 * math.log1p(c * rate / m)
    assert motion.q_end == pytest.approx(way, abs=2e-9)


@pytest.mark.parametrize("until", ["angle=300", "turns=60"])
def test_a_goal_ahead_of_a_steady_rotation_is_reached(until):
    motion = rod(motor(9.0, 20.0)).simulate(until, start=at_rest(0.0)).motion
    assert motion.reached
    assert motion.q_end == pytest.approx(300.0 if until == "angle=300" else 60 * math.tau, abs=1e-9)


# -- the dead centre itself --------------------------------------------------------------------


def short_rod():
    """A slider-crank whose rod is too short for a whole turn."""
    crank, piston = bm.Link(mass=1.0, inertia=0.02), bm.Link(mass=1.1, inertia=0.01)
    return machines.slider_crank(0.12, 0.1, bodies=[crank, None, piston], branch=1).compile()


def test_in_a_dead_centre_itself_no_rates_or_forces_are_handed_out():
    want = ["crank.rate", "mechanism.kinetic_energy", "dyad.C.v", "dyad.C.p", "dyad.C.reaction"]
    mech = short_rod()
    motion = in_one_chart(mech, "time=1", start={"crank": (0.2, 20.0)})
    assert motion.end == "dead centre"
    r = result_in_chart(mech, motion, motion.times(201), want)
    energy = r["mechanism.kinetic_energy"]
    assert np.isnan(energy[-1])
    assert np.isnan(r["dyad.C.v"][-1])
    assert np.isnan(r["dyad.C.reaction"][-1])
    assert r.quality.gaps == (r.n - 1,)
    assert abs(r["crank.rate"][-1]) <= 1e-12 * 20.0  # the driver's own motion is known
    assert np.isfinite(r["dyad.C.p"]).all()
    assert np.ptp(energy[:-1]) <= 1e-8 * energy[0]


def test_the_drivers_own_motion_up_to_a_dead_centre_has_no_gap():
    r = short_rod().simulate("time=1", start={"crank": (0.2, 20.0)})
    assert not r.quality.gaps


@pytest.mark.parametrize("method", ["auto", "dop853", "radau", "rk4"])
def test_a_run_of_no_duration_is_its_start(method):
    """A path of no length has no panel, and rk4 steps of no length."""
    result = scenes.rod(scenes.of_rate(-0.1)).simulate(
        "time=0", method=method, start={"crank": (0.3, 2.0)}
    )
    motion = result.motion
    assert (motion.status, motion.end, motion.t_end) == ("reached", "time", 0.0)
    assert (motion.q_end, motion.qd_end, motion.error) == (0.3, 2.0, 0.0)
    assert result["crank.q"].tolist() == [0.3]


def test_a_goal_where_the_motion_starts_is_met_on_the_way_back():
    scene = scenes.rod(scenes.of_rate(-0.1))
    motion = scene.simulate("angle=0.3", start={"crank": (0.3, 2.0)}).motion
    assert motion.end == "angle"
    assert motion.qd_end < 0


@pytest.mark.parametrize("until", ["time=nan", "angle=abc", "turns", "standstill=3", "steady=-1"])
def test_a_goal_with_a_wrong_number_is_told_what_it_takes(until):
    name = until.partition("=")[0]
    with pytest.raises(RequestError, match=f'"{name}" takes'):
        scenes.rod().simulate(until, start={"crank": (0.3, 0.0)})


def test_wrong_kinds_of_arguments_are_refused_in_words():
    with pytest.raises(RequestError, match=r"method: got None\. give a name"):
        scenes.rod().simulate("time=1", method=None, start={"crank": (0.3, 0.0)})
    with pytest.raises(RequestError, match="cannot be called"):
        scenes.rod().simulate("time=1", progress=3, start={"crank": (0.3, 0.0)})


def test_more_steps_than_can_be_made_are_refused_before_the_first():
    with pytest.raises(RequestError, match="at most 500,000"):
        scenes.rod().simulate(
            "time=1", method=bm.FixedStep("rk4", 1e-12), start={"crank": (0.3, 0.0)}
        )


def test_rk4_gives_up_a_goal_that_is_never_met(monkeypatch):
    """A swinging rod makes no turn."""
    monkeypatch.setattr(integration, "EVALUATIONS", 2_000)
    start = {"crank": (0.3, 0.0)}
    motion = scenes.rod().simulate("turns=1", method="rk4", start=start).motion
    assert motion.status == "failed"
    assert motion.end == "more evaluations than allowed"
    assert any("may never be" in note for note in motion.notes)
    assert motion.error == math.inf


@pytest.mark.parametrize("want", ["*.q", "first.acceleration"])
def test_a_second_driver_without_inertia_is_refused_by_name(want):
    g = bm.Graph("two", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "E": (2.0, 0.0)}))
    arm = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
    for name, marker, links in (("first", "A", {"crank": arm}), ("second", "E", {})):
        g.add(name, bm.Crank(length=1.0, links=links))
        g.connect(f"frame.{marker}", f"{name}.A")
        g.start(name, q=0.3, rate=0.0)
    with pytest.raises(bm.RequestError, match="no link that second moves has mass or inertia"):
        g.compile().simulate("time=0.1", want=want)


def test_a_misspelt_output_is_refused_before_the_motion():
    def law(rate):
        raise AssertionError("the motion has begun")

    pendulum = rod(law)
    with pytest.raises(RequestError, match=r'did you mean "crank\.rate"'):
        pendulum.simulate("time=1", start=at_rest(0.5), want="crank.rat")


def test_a_standstill_says_where_it_is():
    motion = rod().simulate("standstill", start=at_rest(0.5)).motion
    first, *_ = str(motion).splitlines()
    assert first.endswith(f", at rest at {motion.q_end:.9g} rad")
    assert "at rest" not in str(rod().simulate("time=0.1", start=at_rest(0.5)).motion)
