"""Blocks, links and laws made in Python: what they accept, what they refuse and how."""

import numpy as np
import pytest

import blockmech as bm

MISTAKES = {
    "RRR.l_i: l_i must be > 0 m, got -1": lambda: bm.RRR(l_i=-1, l_j=2),
    'RRR.l_j: RRR needs "l_j" [m]': lambda: bm.RRR(l_i=1),
    "RRR.l_j: l_j must be a finite number in m, got NaN": lambda: bm.RRR(l_i=1, l_j=float("nan")),
    'did you mean "branch"?': lambda: bm.RRR(l_i=1, l_j=2, branh=1),
    "RRR.links.i.mass: mass must be >= 0 kg": lambda: bm.RRR(
        l_i=1, l_j=2, links={"i": {"mass": -1}}
    ),
    "Link.inertia: inertia must be a finite number in kg m2": lambda: bm.Link(inertia=np.inf),
    'keys there: law, rate, start, end. did you mean "start"?': lambda: bm.motion.ConstantRate(
        rate=1, stat=2
    ),
    "Frame.markers.A: A must be a place in m,": lambda: bm.Frame(markers={"A": (0, "x")}),
    "Force.force: force must be a vector [x, y]": lambda: bm.Force(force=(0,)),
    "Marker: the direction is given twice": lambda: bm.Marker(at=0j, angle=1.0, dir=(1, 0)),
    "Scene.gravity: gravity must be a vector": lambda: bm.Graph(gravity=(0, 0, 1)),
    "gravity must be a vector [x, y] of finite numbers, got 9.81": lambda: bm.Graph(gravity=9.81),
    "1: not an address": lambda: bm.Graph().connect(1, "a.b"),
}


@pytest.mark.parametrize("message", MISTAKES)
def test_a_mistake_is_one_sentence_with_the_place(message):
    with pytest.raises(bm.GraphError) as caught:
        MISTAKES[message]()
    assert message in str(caught.value)
    assert "pydantic" not in str(caught.value)


def test_all_mistakes_of_a_call_are_said_at_once():
    with pytest.raises(bm.GraphError) as caught:
        bm.RRR(l_i=-1, l_j="2", branch=0)
    assert [p.where for p in caught.value.problems] == ["RRR.l_i", "RRR.l_j", "RRR.branch"]


def test_numbers_and_arrays_of_numpy_are_numbers():
    lengths = np.array([6, 3])
    dyad = bm.RRR(l_i=lengths[0], l_j=np.float32(3), branch=np.sign(-lengths[1]))
    assert dyad == bm.RRR(l_i=6.0, l_j=3.0, branch=-1)
    frame = bm.Frame(markers={"A": np.zeros(2), "D": (lengths[0], 0)})
    assert frame == bm.Frame(markers={"A": (0, 0), "D": (6, 0)})
    table = bm.motion.Trajectory(times=np.arange(3), values=np.arange(3) / 2)
    assert table == bm.motion.Trajectory(times=[0, 1, 2], values=[0, 0.5, 1])


def test_a_marker_is_a_place_in_either_bracket():
    assert bm.Frame(markers={"A": [0, 1]}) == bm.Frame(markers={"A": (0, 1)})
    crank = {"links": {"crank": {"markers": {"P": [0.5, 0]}}}}
    assert bm.Crank(**crank).links["crank"].markers["P"].at.z == 0.5
    with pytest.raises(bm.GraphError) as caught:
        bm.Frame(markers={"A": [0, 1, 2], "D": ["x", 1]})
    assert [p.where for p in caught.value.problems] == ["Frame.markers.A", "Frame.markers.D"]
    assert all("must be a place in m, [x, y]" in p.found for p in caught.value.problems)
