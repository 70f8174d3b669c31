"""What a document that cannot work is told, in the trade's words."""

from __future__ import annotations

import json

import numpy as np
import pytest

import blockmech as bm
from tests.doors import linkage_of as loads
from tests.model.joints import machines
from tests.model.joints.machines import fourbar, guide, joints_file, parallelogram, pin
from tests.soon import answered


def problems_of(data):
    return loads(json.dumps(data)).check()


def only(data):
    """The one problem of a document."""
    problems = problems_of(data)
    assert len(problems) == 1, [str(p) for p in problems]
    return problems[0]


def without(data, *joints):
    for name in joints:
        del data["joints"][name]
    return data


def with_joint(data, name, joint):
    data["joints"][name] = joint
    return data


def test_a_good_document_has_no_problem():
    assert problems_of(fourbar()) == []


def test_a_missing_joint_leaves_loose_links_and_names_them():
    problem = only(without(fourbar(), "D"))
    assert problem.code == "missing-driver"
    assert "mobility 3, drivers 1" in problem.found
    assert "rocker, rod can still move" in problem.found


def test_a_missing_driver_is_told_with_the_mobility():
    data = fourbar()
    data["drivers"] = {}
    problem = only(data)
    assert problem.code == "missing-driver"
    assert "mobility 1, drivers 0: 1 driver is missing" in problem.found


def test_two_drivers_on_one_freedom_are_told():
    data = fourbar()
    data["drivers"]["hand"] = {"joint": "D"}
    problem = only(data)
    assert problem.code == "conflicting-drivers"
    assert problem.found.startswith("motor, hand prescribe the motion of")


def test_the_same_joint_twice_is_called_coincident():
    problem = only(with_joint(fourbar(), "E", fourbar()["joints"]["D"]))
    assert (problem.code, problem.where) == ("coincident-joints", "joints.E")
    assert problem.found == "D, E join frame and rocker at the same place"


def test_a_link_that_is_pinned_twice_to_another_is_over_constrained():
    problem = only(with_joint(fourbar(), "E", pin("frame", "rocker", (3, 0), (0.5, 0))))
    assert problem.code == "over-constrained"
    assert "frame, rocker are over-constrained: their joints D, E" in problem.found
    assert "so motor cannot move" in problem.found


def test_a_driver_of_a_rigid_frame_moves_nothing():
    problem = only(parallelogram((1.0, 1.2, 1.0)))
    assert (problem.code, problem.where) == ("locked-driver", "drivers.motor")
    assert "motor moves nothing: Fa cannot move, a, b, c, frame, rod lock it" in problem.found


def test_a_parallelogram_with_three_equal_cranks_is_over_constrained_but_movable():
    problem = only(parallelogram())
    assert problem.code == "over-constrained"
    assert "a, b, c, frame, rod are over-constrained but movable" in problem.found
    assert "leave mobility 0, but their special lengths leave 1" in problem.found
    assert "remove c with its joints Fc, Rc" in problem.remedy
    rest = parallelogram((1.0, 1.0))
    assert problems_of(rest) == []


def test_without_its_driver_the_parallelogram_still_moves():
    data = parallelogram()
    data["drivers"] = {}
    assert [p.code for p in problems_of(data)] == ["over-constrained", "missing-driver"]


def test_a_parallelogram_with_five_cranks_is_movable_too():
    problem = only(parallelogram((1.0,) * 5))
    assert "mobility 0, but their special lengths leave 1" in problem.found


def test_a_structure_at_a_dead_centre_only_is_not_called_movable():
    """The rod along the frame can shake for a moment, and goes nowhere."""
    data = joints_file(
        {"a": (0, 0, 0.0), "b": (1, 0, 0.0)},
        {
            "A": pin("frame", "a", (0, 0), (0, 0)),
            "B": pin("a", "b", (1, 0), (0, 0)),
            "C": pin("frame", "b", (2, 0), (1, 0)),
        },
        {"motor": "A"},
    )
    problem = only(data)
    assert problem.code == "locked-driver"


def test_links_away_from_the_frame_are_named():
    data = fourbar()
    data["links"] |= {"x": {"pose": [0, 0, 0]}, "y": {"pose": [1, 0, 0]}}
    problem = only(with_joint(data, "E", pin("x", "y", (0, 0), (0, 0))))
    assert problem.code == "unconnected-links"
    assert problem.found == "no joint leads from x, y to the frame"


def test_sliding_joints_in_a_loop_are_told_to_hold_the_turning_twice():
    data = joints_file(
        {"a": (0, 0, 0), "b": (1, 0, 0)},
        {
            "P": guide("frame", "a", (0, 0), (0, 0)),
            "Q": guide("a", "b", (1, 0), (0, 0), (1, 1)),
            "R": guide("frame", "b", (1, 0), (0, 0), (2, 2)),
        },
        {"motor": "P"},
    )
    problem = only(data)
    assert problem.code == "turning-held-twice"
    assert "3n - 2p is 0, but the mobility is 1" in problem.valid


def test_parallel_guides_are_told_to_slide_in_one_direction():
    data = joints_file(
        {"crank": (0, 0, 0.3), "a": (0, 0, 0.3), "b": (0, 0, 0.3)},
        {
            "O": pin("frame", "crank", (0, 0), (0, 0)),
            "P": guide("crank", "a", (0, 0), (0, 0)),
            "C": pin("a", "b", (0, 0), (0, 0)),
            "Q": guide("crank", "b", (0, 1), (0, 1)),
        },
        {"motor": "O"},
    )
    problem = only(data)
    assert problem.code == "coincident-joints"
    assert problem.found == "P, Q slide in one direction, so a, b can move freely"


def test_a_link_without_length_is_told_by_its_joints():
    data = fourbar()
    data["joints"]["C"]["at"][1] = [0, 0]
    problem = only(data)
    assert problem.code == "coincident-joints"
    assert problem.found == "C, D lie in one point, so rocker can move freely"


def test_joints_that_cannot_close_are_named_with_their_gap():
    data = fourbar()
    data["joints"]["C"]["at"][1] = [20, 0]
    problem = only(data)
    assert (problem.code, problem.where) == ("does-not-close", "joints.C")
    assert "C gapes by 18.7 m in the given pose" in problem.found


def test_a_guide_that_points_the_wrong_way_is_told_by_how_far_the_link_turns():
    data = machines.slider_crank()
    data["joints"]["S"]["angle"][1] = np.pi
    problem = only(data)
    assert (problem.code, problem.where) == ("pose-far-off", "links.piston.pose")
    assert "piston is turned by 3.14 rad" in problem.found


def test_a_pose_at_a_dead_centre_does_not_tell_the_assembly_mode():
    data = joints_file(
        {"crank": (0, 0, 0), "rod": (1, 0, 0), "rocker": (5.5, 0, np.pi)},
        fourbar()["joints"]
        | {
            "D": pin("frame", "rocker", (5.5, 0), (0, 0)),
        },
        {"motor": "A"},
    )
    problem = only(data)
    assert problem.code == "dead-centre"
    assert "rocker, rod stand at a dead centre" in problem.found


def test_a_document_without_links_is_told_so():
    assert only(joints_file({}, {}, {})).code == "no-links"


def test_every_problem_names_the_file():
    text = json.dumps(without(fourbar(), "D"))
    with pytest.raises(bm.GraphError) as caught:
        loads(text, "bar.json").decompose()
    assert [p.file for p in caught.value.problems] == ["bar.json"]


def test_a_large_broken_chain_is_answered_soon():
    data = machines.chain(300)
    del data["joints"]["D0150"]
    with answered():
        problem = only(data)
    assert problem.code == "missing-driver"
