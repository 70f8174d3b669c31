"""Loads whose tables end, or whose functions give NaN: the run ends there, by name.

A rod turned about its middle by a moment of 1 N m or more, J = 1/3 kg m2, without gravity:
its motion under a constant moment is a parabola in time.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from tests.dynamics.scenes import J, at_rest, motor, rod, slide
from tests.gallery import changed, document
from tests.machines import wire

START = 0.5  # [rad]
IN_TIME = ("auto", "dop853", "radau", "rk4")
OF_PLACE = (*IN_TIME, "energy", "euler_q")
LAST_TIME, LAST_ANGLE, LAST_RATE = 0.3, 0.9, 0.8
STEPS = {"euler_q": 2e-3}  # [rad] it ends up to two steps before


def linear(of, end, size=1.0):
    """The same moment up to an end of the argument."""
    return {
        "kind": "table",
        "of": of,
        "arguments": [-1.0, end],
        "values": [size, size],
        "interpolation": "linear",
    }


def function(of, end):
    """The same by a function of Python, NaN beyond."""

    def moment(x):
        return 1.0 if x <= end else math.nan

    named = {
        "time": lambda time: moment(time),
        "coordinate": lambda coordinate: moment(coordinate),
        "rate": lambda rate: moment(rate),
    }
    return named[of]


FORMS = pytest.mark.parametrize("form", [linear, function])


def test_a_run_beyond_the_end_of_a_table_names_the_load():
    wind = {"kind": "table", "of": "time", "arguments": [0.0, 1.0], "values": [0.0, 10.0]}
    arm = bm.Linkage("arm")
    arm.add_link("arm", mass=1.0, cm=(0.2, 0.0))
    arm.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))
    arm.add_driver("motor", "O", bm.motion.ConstantRate(rate=1.0))
    arm.add_load("wind", "force", link="arm", at=(0.4, 0.0), direction=(1.0, 0.0), law=wind)
    message = "wind has no value there; 8 of 10 samples"
    with pytest.raises(bm.SingularError, match=message) as caught:
        arm.run(samples=10)
    assert caught.value.failure.samples[0] == 2  # at 1.4 s, of 0.7 s a sample


def ended(law, method, start=START, until="time=1"):
    motion = rod(law, gravity=0.0).simulate(until, method=method, start=at_rest(start)).motion
    assert (motion.status, motion.end) == ("ended", "undefined load")
    assert motion.events[-1].kind == "undefined load"
    (note,) = [note for note in motion.notes if "gives no value" in note]
    assert note.startswith("load0 ")
    return motion


def assert_ends_at(motion, t):
    assert abs(motion.t_end - t) <= motion.time_error
    assert motion.error < 1e-6 or motion.method == "euler_q"
    times = np.linspace(0.0, min(t, motion.t_end), 20)
    exact = START + times**2 / (2 * J)
    assert np.abs(motion.at(times).q - exact).max() <= motion.error
    if motion.method != "euler_q":
        assert motion.qd_end == pytest.approx(t / J, rel=1e-6)


@FORMS
@pytest.mark.parametrize("method", IN_TIME)
def test_a_load_that_ends_in_time(method, form):
    motion = ended(form("time", LAST_TIME), method)
    assert motion.t_end == pytest.approx(LAST_TIME, rel=1e-9)
    assert abs(motion.q_end - START - LAST_TIME**2 / (2 * J)) <= motion.error


@FORMS
@pytest.mark.parametrize("method", OF_PLACE)
def test_a_load_that_ends_at_a_coordinate(method, form):
    motion = ended(form("coordinate", LAST_ANGLE), method)
    assert_ends_at(motion, math.sqrt(2 * J * (LAST_ANGLE - START)))
    assert motion.q_end == pytest.approx(LAST_ANGLE, abs=STEPS.get(method, 1e-6))


@FORMS
@pytest.mark.parametrize("method", IN_TIME)
def test_a_load_that_ends_at_a_rate(method, form):
    assert_ends_at(ended(form("rate", LAST_RATE), method), LAST_RATE * J)


def test_a_load_without_a_value_at_the_start():
    motion = rod(linear("time", -0.5), gravity=0.0).simulate("time=1", start=at_rest(START)).motion
    assert (motion.status, motion.end, motion.t_end) == ("failed", "undefined load", 0.0)
    (note,) = (note for note in motion.notes if "load0" in note)
    table, place = "a table of the time from -1 to -0.5 s", "t = 0 s, crank = 0.5 rad, rate 0 rad/s"
    assert note == f"load0 ({table}) gives no value beyond {place}"


def test_only_the_load_that_ends_is_named():
    scene = rod(motor(1.0, 50.0), linear("time", LAST_TIME), gravity=0.0)
    motion = scene.simulate("time=1", start=at_rest(START)).motion
    assert motion.end == "undefined load"
    assert "load1 (a table of the time from -1 to 0.3 s) gives no value" in motion.notes[-1]


def test_a_force_that_ends():
    scene = slide(law=linear("time", LAST_TIME, 3.0))
    motion = scene.simulate("time=1", start={"slider": (0.0, 0.0)}).motion
    assert motion.end == "undefined load"
    assert "force (a table of the time from -1 to 0.3 s) gives no value" in motion.notes[-1]


@pytest.mark.parametrize("method", ["dop853", "radau"])
@pytest.mark.parametrize("pull", [1.0, -1.0])
def test_a_start_at_rest_on_a_kink_of_a_load_leaves_it(method, pull):
    """A leg that met the kink where it began never moved on."""
    law = {
        "kind": "table",
        "of": "coordinate",
        "arguments": [-9.0, START, 9.0],
        "values": [pull, pull, pull],
        "interpolation": "linear",
    }
    motion = rod(law, gravity=0.0).simulate("time=1", method=method, start=at_rest(START)).motion
    assert motion.end == "time"
    assert abs(motion.q_end - START - pull / (2 * J)) <= motion.error


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_several_drivers(method):
    data = document("fivebar_falling")
    data["blocks"]["motor"] = {"type": "load.motor", "law": linear("time", 0.05)}
    ((link, _),) = data["blocks"]["left"]["links"].items()
    data["wires"] += [
        {"from": "frame.A", "to": "motor.a"},
        {"from": f"left.{link}", "to": "motor.b"},
    ]
    start = {"left": (1.2, 0.0), "right": (2.2, 0.0)}
    motion = changed(data).simulate("time=1", method=method, start=start).motion
    assert (motion.status, motion.end) == ("ended", "undefined load")
    assert motion.t_end == pytest.approx(0.05, rel=1e-9)
    assert motion.error < 1e-6
    assert "motor (a table of the time from -1 to 0.05 s) gives no value" in motion.notes[-1]


def test_a_spring_of_no_length_has_no_direction():
    """It was called a start without inertia."""
    graph = bm.Graph("spring", gravity=(0.0, 0.0))
    markers = {"A": bm.Marker(at=(0.0, 0.0), angle=0.0), "W": (0.0, 0.0)}
    graph.add("frame", bm.Frame(markers=markers))
    body = bm.Link(mass=2.0, inertia=0.1, cm=(0.0, 0.0), markers={"P": (0.0, 0.0)})
    graph.add("slider", bm.SlideDrive(links={"slider": body}))
    graph.add("spring", bm.Spring(stiffness=50.0, free_length=0.5))
    wire(graph, "frame.A slider.S", "frame.W spring.a", "slider.P spring.b")
    motion = graph.compile().simulate("time=1", start={"slider": (0.0, 0.0)}).motion
    assert (motion.status, motion.end) == ("failed", "undefined load")
    assert motion.notes[0] == "undefined load at the start"
    assert any("spring gives no value" in note for note in motion.notes)
    assert motion.error == math.inf


def motored_slider_crank(arguments, values):
    """A motor by a line of the rate, against a brake of 1 N m."""
    m = bm.Linkage("slider_crank")
    m.add_link("crank", mass=1.0, inertia=0.01)
    m.add_link("rod", mass=0.5, inertia=0.001, cm=(0.1, 0.0))
    m.add_link("piston", mass=0.5)
    m.add_joint("O", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("A", "R", ["crank", "rod"], point=(0.06, 0.0))
    m.add_joint("B", "R", ["rod", "piston"], point=(0.26, 0.0))
    m.add_joint("G", "P", ["frame", "piston"], point=(0.26, 0.0))
    m.add_driver("motor", "O")
    line = {"of": "rate", "arguments": arguments, "values": values, "interpolation": "linear"}
    m.add_load("dc", "motor", joint="O", law={"kind": "table", **line})
    m.add_load("brake", "couple", link="crank", moment=-1.0)
    return m.compile()


def test_the_search_for_a_steady_state_stays_where_the_law_has_values():
    """The same line as a longer table has the same steady state."""
    short = motored_slider_crank(["0 rpm", "1500 rpm"], [6.0, 0.0])
    longer = motored_slider_crank(["0 rpm", "3000 rpm"], [6.0, -6.0])
    motions = [m.simulate("steady", start=at_rest(0.0, "motor")).motion for m in (short, longer)]
    speeds = [motion.facts["mean_speed"] for motion in motions]
    assert speeds[0] == pytest.approx(speeds[1], rel=1e-9)
    assert all(motion.end == "steady" for motion in motions)


def test_a_law_that_ends_before_a_steady_state_is_named_with_its_range():
    m = motored_slider_crank(["0 rpm", "1500 rpm"], [6.0, 2.0])
    table = r"dc \(a table of the rate from 0 to 157.08 rad/s\) gives no value"
    with pytest.raises(bm.RequestError, match=table):
        m.simulate("steady", start=at_rest(0.0, "motor"))
    with pytest.raises(bm.RequestError, match=f"{table} at the start"):
        m.simulate("steady", start={"motor": (0.0, "1600 rpm")})
    motion = m.simulate("time=1", start={"motor": (0.0, "1600 rpm")}).motion
    assert "motor = 0 rad, rate 167.552 rad/s" in motion.notes[-1]
