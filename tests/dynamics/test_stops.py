"""What ends a run before its time: end stops, dead centres and poses that do not exist.

Stops are said by the scene, every method knows them, and they end the run by name. So do
the ends of a mechanism: the same name by every method, at the same time within its estimate.
"""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.request import Start, Until
from blockmech.ground.errors import FormatError, GraphError, RequestError
from tests.doors import graph_of as loads
from tests.dynamics.linkages import FourBar, guided, reduced
from tests.dynamics.scenes import of_rate, rod
from tests.dynamics.synthetic import move
from tests.machines import arms, bar

GRAPHS = Path(__file__).resolve().parents[2] / "graphs"
EXACT = 1e-12  # [rad, s] by quadrature
INTEGRATED = 1e-9  # [rad, s] the default target of the integrators
METHODS = ("energy", "dop853", "radau", "rk4", "euler_q")


@cache
def mechanism(name, stops=()):
    graph = bm.Graph.load(GRAPHS / f"{name}.json")
    for driver, low, high in stops:
        graph.add_stop(driver, low, high)
    return graph.compile()


WATT = ("watt_sixbar", (("crank", -1.0, 1.0),))


def test_the_scene_gives_the_stops_and_the_run_ends_there_with_what_was_computed():
    r = mechanism(*WATT).simulate("time=1.4")
    motion = r.motion
    assert (motion.status, motion.end) == ("ended", "end stop")
    assert motion.q_end == pytest.approx(-1.0, abs=EXACT)
    assert motion.events[-1].kind == "end stop"
    assert r.n > 100
    assert r.time[-1] == motion.t_end
    free = mechanism("watt_sixbar").simulate(times=r.time)
    assert abs(r["crank.q"] - free["crank.q"]).max() < EXACT


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_a_machine_with_a_motor_runs_into_its_stop(method):
    motor = mechanism("pump", (("crank", None, 7.0),))
    expected = mechanism("pump").simulate("angle=7", method="dop853", accuracy=1e-11).motion
    motion = motor.simulate("time=1", method=method).motion
    assert (motion.status, motion.end) == ("ended", "end stop")
    assert motion.t_end == pytest.approx(expected.t_end, abs=INTEGRATED)


@pytest.mark.parametrize("method", ["auto", "radau"])
def test_one_of_several_drivers_meets_its_stop_and_is_named(method):
    falling = mechanism("fivebar_falling", (("left", 1.0, None),))
    motion = falling.simulate("time=0.6", method=method).motion
    assert (motion.status, motion.end) == ("ended", "end stop of left")
    assert motion.q_end[0] == pytest.approx(1.0, abs=INTEGRATED)
    free = mechanism("fivebar_falling").simulate(times=[motion.t_end], accuracy=1e-10)
    assert free["left.q"][0] == pytest.approx(1.0, abs=10 * INTEGRATED)  # at 3.6 rad/s


def test_a_request_may_say_other_stops_than_the_scene():
    motion = mechanism(*WATT).simulate("standstill", stops={}).motion
    assert motion.end == "standstill"
    motion = mechanism(*WATT).simulate("standstill", stops={"crank": (-2.0, 1.0)}).motion
    assert motion.q_end == pytest.approx(-2.0, abs=EXACT)


@pytest.mark.parametrize("method", ["auto", "dop853", "rk4"])
def test_a_start_pressed_against_a_stop_stays_there(method):
    pressed = mechanism("watt_sixbar", (("crank", 0.0, 1.0),))  # its weights turn it down
    motion = pressed.simulate("time=1", method=method).motion
    assert (motion.end, motion.t_end, motion.q_end) == ("end stop", 0.0, 0.0)


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_a_start_on_a_stop_that_leaves_it_is_free(method):
    leaving = mechanism("watt_sixbar", (("crank", -1.0, 0.0),))
    motion = leaving.simulate("time=1", method=method).motion
    assert motion.q_end == pytest.approx(-1.0, abs=EXACT)


def test_between_two_stops_a_swing_that_reaches_neither_is_as_without():
    wide = mechanism("watt_sixbar", (("crank", -4.0, 0.5),))
    assert wide.simulate("swings=4").motion.t_end == pytest.approx(
        mechanism("watt_sixbar").simulate("swings=4").motion.t_end, abs=EXACT
    )


# -- ends of the mechanism itself --------------------------------------------------------------

ENDS = 2  # random mechanisms of each kind
LONG = 3.0  # [s] by then every one has come to its end
BY = [  # method, target, step
    ("dop853", 1e-3, None),
    ("dop853", 1e-9, None),
    ("radau", 1e-3, None),
    ("radau", 1e-8, None),
    ("rk4", 1e-4, None),
    ("rk4", None, 0.002),
    ("euler_q", None, 1e-3),
]


def with_dead_centres(rng):
    """A four-bar thrown so hard that nothing but a dead centre stops it."""
    while True:
        system, q = reduced(FourBar(*rng.uniform(0.5, 1.5, 4).tolist())), float(rng.uniform(-3, 3))
        around = system.sample(np.linspace(-math.pi, math.pi, 361))
        if system.scalar_terms(q, 0.0, 0.0)[3] > 0.05 and not (around.margin > 0).all():
            return system, q, float(rng.choice([-1, 1]) * rng.uniform(12, 20))


def with_change_points(rng):
    """A parallelogram: in line with the frame its margin touches zero and comes back."""
    crank, base = rng.uniform(0.5, 1.5, 2).tolist()
    system = reduced(FourBar(crank, base, crank, base))
    return system, float(rng.uniform(0.3, 2.8)), float(rng.choice([-1, 1]) * rng.uniform(12, 20))


def with_a_wall(rng):
    """A sliding body behind some place of which there is no pose, without a dead centre."""
    place, push = float(rng.uniform(0.5, 2.0)), float(rng.uniform(0.5, 3.0))
    free = guided(float(rng.uniform(0.5, 3.0)), lambda q: push - q)

    def one(q, qd, t):
        return free.scalar_terms(q)[:4] if q <= place else (math.nan,) * 4

    return free.but(one=one), 0.1, float(rng.uniform(3, 6))


def between_stops(rng):
    """A four-bar between two end stops that are nearer than any dead centre."""
    while True:
        system, q, rate = with_dead_centres(rng)
        low, high = q - float(rng.uniform(0.05, 0.5)), q + float(rng.uniform(0.05, 0.5))
        if (system.sample(np.linspace(low, high, 99)).margin > 0.01).all():
            return system.but(stops=(low, high)), q, rate


KINDS = {
    with_dead_centres: "dead centre",
    with_change_points: "dead centre",
    with_a_wall: "impossible pose",
    between_stops: "end stop",
}


@pytest.mark.parametrize("seed", range(ENDS))
@pytest.mark.parametrize(("kind", "name"), KINDS.items(), ids=[k.__name__ for k in KINDS])
def test_every_method_names_the_same_end_at_the_same_time(kind, name, seed):
    system, q, rate = kind(np.random.default_rng((20261121, seed)))

    def by(method, accuracy, step=None):
        until = Until("time", LONG)
        return move(system, Start(q, rate), until, method, accuracy, step)

    truth = by("energy", 1e-12)
    assert (truth.status, truth.end) == ("ended", name)
    assert truth.time_error < 1e-8
    for method in BY:
        motion = by(*method)
        assert (motion.status, motion.end) == ("ended", name), method
        assert abs(motion.t_end - truth.t_end) <= motion.time_error + truth.time_error, method
        early = 0.9 * min(motion.t_end, truth.t_end)  # what was computed is kept
        assert abs(motion.at(early).q - truth.at(early).q) <= motion.error + truth.error, method


# -- what is refused ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stops", "code", "part"),
    [
        ({"crank": (1.0, 2.0)}, "start-outside-stops", "crank.q = 0 is not between"),
        ({"crank": (2.0, 1.0)}, "bad-value", "the lowest must be below the highest"),
        ({"cranck": (1.0, 2.0)}, "unknown-driver", 'no driver "cranck"'),
    ],
)
def test_stops_that_make_no_sense_are_refused(stops, code, part):
    with pytest.raises(RequestError) as caught:
        mechanism("watt_sixbar").simulate(stops=stops)
    (problem,) = caught.value.problems
    assert problem.code == code
    assert part in str(problem)


def test_a_start_outside_the_scenes_stops_names_the_place_in_the_file():
    with pytest.raises(RequestError, match=r"scene\.stops\.crank"):
        mechanism(*WATT).simulate(start={"crank": (1.5, 0.0)})


def test_no_turn_repeats_for_ever_between_stops():
    with pytest.raises(RequestError, match=": end stop"):
        mechanism("pump", (("crank", None, 100.0),)).simulate("steady")


@pytest.mark.parametrize("stops", [{"from": 2.0, "to": 1.0}, {}, {"from": "a"}, {"low": 1.0}])
def test_a_file_with_impossible_stops_is_refused(stops):
    data = json.loads((GRAPHS / "watt_sixbar.json").read_text(encoding="utf-8"))
    data["scene"]["stops"] = {"crank": stops}
    with pytest.raises(FormatError, match=r"scene\.stops\.crank"):
        loads(json.dumps(data))


def test_stops_are_written_and_read_again():
    graph = bm.Graph.load(GRAPHS / "watt_sixbar.json")
    graph.add_stop("crank", low=-1.0)
    text = graph.to_json()
    assert '"stops": {"crank": {"from": -1.0}}' in text
    again = loads(text)
    assert again.scene.stops["crank"].bounds == (-1.0, math.inf)
    assert again.to_json() == text


def test_stops_in_python_are_checked_when_they_are_made():
    with pytest.raises(GraphError, match="must be below"):
        bm.Graph("any").add_stop("crank", 2.0, 1.0)
    graph = bm.Graph.load(GRAPHS / "watt_sixbar.json")
    graph.add_stop("cranck", 0.0, 1.0)
    (problem,) = graph.check()
    assert (problem.code, problem.where) == ("unknown-driver", "scene.stops.cranck")


@pytest.mark.parametrize("method", METHODS)
def test_a_stop_at_infinity_is_none(method):
    mech, start = rod(), {"crank": (0.3, 2.0)}
    free = mech.simulate("time=1", method=method, start=start, want=()).motion
    for bounds in ((-math.inf, 3.0), (-9.0, math.inf)):
        stops = {"crank": bounds}
        motion = mech.simulate("time=1", method=method, start=start, stops=stops, want=()).motion
        assert motion.end == "time"
        assert abs(motion.q_end - free.q_end) <= motion.error + free.error


@pytest.mark.parametrize("method", ["dop853", "radau"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-8])
def test_several_drivers_leave_a_stop_and_come_back_to_it_within_a_step(method, accuracy):
    """SciPy took the start itself for the way back, and no leg went on."""
    graph = arms({"a": 0.8, "b": 0.6}, (bar(1.2, 0.8), bar(0.9, 0.6)))
    start = {"a": (0.3, 1.0), "b": (0.7, -2.0)}
    motion = (
        graph.compile()
        .simulate("time=1", method=method, accuracy=accuracy, start=start, stops={"a": (0.3, 1.0)})
        .motion
    )
    assert motion.end == "end stop of a"
    assert abs(motion.t_end - 0.1288572182) <= motion.time_error + 1e-10


@pytest.mark.parametrize("error", [ValueError, ZeroDivisionError, np.linalg.LinAlgError])
@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_what_a_kernel_raises_is_no_solver_that_gave_up(monkeypatch, method, error):
    """A mistake of our own, say of the compiler, comes out under its own name."""

    def mistaken(self, t, y):
        raise error("of our own")

    mech = rod(of_rate(0.0, -0.3))
    monkeypatch.setattr("blockmech.dynamics.equation.Equation._alone", mistaken)
    with pytest.raises(error, match="of our own"):
        mech.simulate("time=1", method=method, start={"crank": (0.3, 0.0)})
