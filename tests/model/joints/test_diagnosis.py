"""What a document that cannot work is told, in the trade's words."""

from __future__ import annotations

import json

import numpy as np
import pytest

import blockmech as bm
from tests.doors import linkage_of as loads
from tests.model.joints.machines import (
    chain,
    fourbar,
    guide,
    joints_file,
    parallelogram,
    pin,
    slider_crank,
)
from tests.soon import answered


def problems_of(data):
    return loads(json.dumps(data)).check()


def without(data, joint):
    del data["joints"][joint]
    return data


def with_joint(name, joint, data=None):
    data = data or fourbar()
    data["joints"][name] = joint
    return data


def driven(data, **drivers):
    return data | {"drivers": {name: {"joint": joint} for name, joint in drivers.items()}}


def without_length():
    data = fourbar()
    data["joints"]["C"]["at"][1] = [0, 0]
    return data


def gaping():
    data = fourbar()
    data["joints"]["C"]["at"][1] = [20, 0]
    return data


def pointing_back():
    data = slider_crank()
    data["joints"]["S"]["angle"][1] = np.pi
    return data


def stretched():
    poses = {"crank": (0, 0, 0), "rod": (1, 0, 0), "rocker": (5.5, 0, np.pi)}
    joints = fourbar()["joints"] | {"D": pin("frame", "rocker", (5.5, 0), (0, 0))}
    return joints_file(poses, joints, {"motor": "A"})


def shaking():
    """The rod along the frame can shake for a moment, and goes nowhere."""
    joints = {
        "A": pin("frame", "a", (0, 0), (0, 0)),
        "B": pin("a", "b", (1, 0), (0, 0)),
        "C": pin("frame", "b", (2, 0), (1, 0)),
    }
    return joints_file({"a": (0, 0, 0.0), "b": (1, 0, 0.0)}, joints, {"motor": "A"})


def away():
    data = fourbar()
    data["links"] |= {"x": {"pose": [0, 0, 0]}, "y": {"pose": [1, 0, 0]}}
    return with_joint("E", pin("x", "y", (0, 0), (0, 0)), data)


def wedges():
    joints = {
        "P": guide("frame", "a", (0, 0), (0, 0)),
        "Q": guide("a", "b", (1, 0), (0, 0), (1, 1)),
        "R": guide("frame", "b", (1, 0), (0, 0), (2, 2)),
    }
    return joints_file({"a": (0, 0, 0), "b": (1, 0, 0)}, joints, {"motor": "P"})


def parallel_guides():
    joints = {
        "O": pin("frame", "crank", (0, 0), (0, 0)),
        "P": guide("crank", "a", (0, 0), (0, 0)),
        "C": pin("a", "b", (0, 0), (0, 0)),
        "Q": guide("crank", "b", (0, 1), (0, 1)),
    }
    return joints_file(dict.fromkeys(("crank", "a", "b"), (0, 0, 0.3)), joints, {"motor": "O"})


def lifted(angle=0.6):
    """A platform pinned at both ends on two equal Scott-Russell lifts, drawn where it stands."""
    links = dict.fromkeys(("bar_1", "half_1", "foot_1"), (0.0, 0.0, 0.0))
    links |= dict.fromkeys(("bar_2", "half_2", "foot_2", "platform"), (0.0, 0.0, 0.0))
    x, y, joints = 2 * np.cos(angle), 2 * np.sin(angle), {}
    for k, begin in ((1, 0.0), (2, 4.0)):
        foot, middle, top = (begin + x, 0.0), (begin + x / 2, y / 2), (begin, y)
        joints |= {
            f"F{k}": pin(f"foot_{k}", f"bar_{k}", foot, foot),
            f"M{k}": pin(f"bar_{k}", f"half_{k}", middle, middle),
            f"O{k}": pin("frame", f"half_{k}", (begin, 0.0), (begin, 0.0)),
            f"T{k}": pin(f"bar_{k}", "platform", top, top),
            f"G{k}": guide("frame", f"foot_{k}", foot, foot),
        }
    return joints_file(links, joints, {"motor": "G1"})


WRONG = {  # what it is: document, code, place, texts of the message
    "a missing joint leaves loose links": (
        lambda: without(fourbar(), "D"),
        ("missing-driver", "drivers", "mobility 3, drivers 1", "rocker, rod can still move"),
    ),
    "a missing driver": (
        lambda: driven(fourbar()),
        ("missing-driver", "drivers", "mobility 1, drivers 0: 1 driver is missing"),
    ),
    "two drivers on one freedom": (
        lambda: driven(fourbar(), motor="A", hand="D"),
        ("conflicting-drivers", "drivers.hand", "motor, hand prescribe the motion of"),
    ),
    "the same joint twice": (
        lambda: with_joint("E", fourbar()["joints"]["D"]),
        ("coincident-joints", "joints.E", "D, E join frame and rocker at the same place"),
    ),
    "a link pinned twice to another": (
        lambda: with_joint("E", pin("frame", "rocker", (3, 0), (0.5, 0))),
        (
            *("over-constrained", "links.rocker", "so motor cannot move"),
            "frame, rocker are over-constrained: their joints D, E",
        ),
    ),
    "a driver of a rigid frame": (
        lambda: parallelogram((1.0, 1.2, 1.0)),
        (
            *("locked-driver", "drivers.motor"),
            "motor moves nothing: Fa cannot move, a, b, c, frame, rod form a rigid structure",
        ),
    ),
    "a parallelogram with three equal cranks": (
        parallelogram,
        (
            *("over-constrained", "links.a"),
            "a, b, c, frame, rod are over-constrained but movable",
            "leave mobility 0, but their special lengths leave 1",
            "remove c with its joints Fc, Rc",
        ),
    ),
    "a parallelogram with five cranks": (
        lambda: parallelogram((1.0,) * 5),
        ("over-constrained", "links.a", "mobility 0, but their special lengths leave 1"),
    ),
    "a structure that is movable at a dead centre only": (
        shaking,
        ("locked-driver", "drivers.motor"),
    ),
    "links away from the frame": (
        away,
        ("unconnected-links", "links.x", "no joint leads from x, y to the frame"),
    ),
    "sliding joints in a loop": (
        wedges,
        ("turning-held-twice", "links.a", "3n - 2p is 0, but the mobility is 1"),
    ),
    "parallel guides": (
        parallel_guides,
        (
            *("coincident-joints", "joints.Q"),
            "P, Q slide in one direction, so a, b can move freely",
        ),
    ),
    "a link without length": (
        without_length,
        ("coincident-joints", "joints.D", "C, D lie in one point, so rocker can move freely"),
    ),
    "joints that cannot close": (
        gaping,
        ("does-not-close", "joints.C", "joint C has a closure error of 18.7 m in the given pose"),
    ),
    "a guide that points the wrong way": (
        pointing_back,
        ("pose-far-off", "links.piston.pose", "piston is turned by 3.14 rad"),
    ),
    "a pose at a dead centre": (
        stretched,
        ("dead-centre", "links.rocker", "rocker, rod are at a dead centre"),
    ),
    "a structure at a dead centre in every pose": (
        lifted,
        ("dead-centre", "links.bar_2", "at a dead centre for every driver value", "T1, T2"),
    ),
    "the same in another pose": (
        lambda: lifted(0.9),
        ("dead-centre", "links.bar_2", "one of their joints is redundant"),
    ),
    "no links": (lambda: joints_file({}, {}, {}), ("no-links", "links")),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_work_is_one_problem_in_the_trade_s_words(name):
    make, (code, where, *texts) = WRONG[name]
    (problem,) = problems_of(make())
    assert (problem.code, problem.where) == (code, where)
    assert [text for text in texts if text not in str(problem)] == []


def test_good_documents_have_no_problem():
    assert problems_of(fourbar()) == []
    assert problems_of(parallelogram((1.0, 1.0))) == []


def test_without_its_driver_the_parallelogram_still_moves():
    result = problems_of(driven(parallelogram()))
    assert [p.code for p in result] == ["over-constrained", "missing-driver"]


def test_every_problem_names_the_file():
    text = json.dumps(without(fourbar(), "D"))
    with pytest.raises(bm.GraphError) as caught:
        loads(text, "bar.json").decompose()
    assert [p.file for p in caught.value.problems] == ["bar.json"]


def test_a_large_broken_chain_is_answered_soon():
    with answered():
        (problem,) = problems_of(without(chain(300), "D0150"))
    assert problem.code == "missing-driver"
