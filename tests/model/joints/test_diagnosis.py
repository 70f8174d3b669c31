"""What a document that cannot work is told, in the trade's words."""

from __future__ import annotations

import copy
import json
import os
import random
import re

import numpy as np
import pytest

import blockmech as bm
from tests.codes import LINKAGE_CODES as CODES
from tests.doors import linkage_of as loads
from tests.model.joints import machines
from tests.model.joints.chance import document as random_document
from tests.model.joints.machines import fourbar, guide, joints_file, parallelogram, pin
from tests.soon import answered

BROKEN = int(os.environ.get("BLOCKMECH_DOCUMENTS", "10")) * 6  # documents


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


# ---- many broken documents, against the rank of the velocity conditions ---------------------


BEFORE = (
    ("dyad", "driver", "triad", "dyad"),
    ("cylinder", "dyad", "loop"),
    ("driver", "bent_cylinder", "triad"),
)
"""Units of the documents before they are broken."""


def broken(seed):
    """A good document with joints deleted, doubled or merged, and which joints share a place."""
    chance = random.Random(seed)
    data = random_document(seed, BEFORE[seed % len(BEFORE)], loads=0, slack=0.0)
    together = {}
    for _ in range(chance.randint(1, 3)):
        joints = data["joints"]
        name = chance.choice(list(joints))
        what = chance.choice(["delete", "double", "merge", "repeat"])
        if what == "delete":
            del joints[name]
            for section in ("drivers",):
                data[section] = {d: s for d, s in data[section].items() if s["joint"] != name}
        elif what == "double":
            twin = copy.deepcopy(joints[name])
            twin["at"] = [[x + chance.uniform(-1, 1) for x in at] for at in twin["at"]]
            if twin["type"] == "P":
                twin["angle"] = [a + chance.uniform(-1, 1) for a in twin["angle"]]
            joints[f"{name}x"] = twin
        elif what == "repeat":
            joints[f"{name}y"] = copy.deepcopy(joints[name])
            together[f"{name}y"] = name
        else:
            link = chance.choice(joints[name]["links"])
            others = [n for n, j in joints.items() if n != name and link in j["links"]]
            others = [n for n in others if joints[n]["type"] == joints[name]["type"] == "R"]
            merged = {*together, *together.values()}  # to move one of these would part it again
            others = [n for n in others if n not in merged]
            if others and name not in together:
                other = joints[others[0]]
                k, m = joints[name]["links"].index(link), other["links"].index(link)
                other["at"][m] = list(joints[name]["at"][k])
                together[others[0]] = name
    return data, together


def ranks(data, together, seed):
    """Unknowns, and rows and rank without and with drivers, for places at random."""
    chance = np.random.default_rng(seed)
    column = {link: 3 * k for k, link in enumerate(data["links"])}
    place, rows, drives = {}, [], []

    def root(name):
        while name in together:
            name = together[name]
        return name

    def difference(joint, row):
        found = np.zeros(3 * len(column))
        for link, sign in zip(joint["links"], (1, -1), strict=True):
            if link in column:
                found[column[link] : column[link] + 3] += sign * np.array(row)
        return found

    for name, joint in data["joints"].items():
        x, y = place.setdefault(root(name), chance.normal(size=2))
        two = ((1, 0, -y), (0, 1, x)) if joint["type"] == "R" else ((0, 0, 1), (x, y, 0))
        rows += [difference(joint, row) for row in two]
    for driver in data["drivers"].values():
        joint = data["joints"][driver["joint"]]
        x, y = place[root(driver["joint"])]
        drives.append(difference(joint, (0, 0, 1) if joint["type"] == "R" else (-y, x, 0)))
    rank = [np.linalg.matrix_rank(np.array(m), tol=1e-8) for m in (rows, [*rows, *drives])]
    return 3 * len(column), (len(rows), int(rank[0])), (len(rows) + len(drives), int(rank[1]))


HELD = {"over-constrained", "turning-held-twice", "coincident-joints"}
FREE = {"missing-driver", "loose-links", "unconnected-links", "coincident-joints"}
DRIVERS = {"conflicting-drivers", "locked-driver", "coincident-joints"}
GEOMETRY = {"does-not-close", "dead-centre", "pose-far-off"}


def test_broken_documents_are_told_what_the_rank_says():
    kinds = set()
    for seed in range(BROKEN):
        data, together = broken(seed)
        n, (rows, rank), (all_rows, all_rank) = ranks(data, together, seed)
        with answered():
            problems = problems_of(data)
        codes = {p.code for p in problems}
        kinds |= codes
        assert codes <= set(CODES), (seed, codes)
        sound = n == all_rows == all_rank
        assert sound == (codes <= GEOMETRY), (seed, codes)
        if sound:
            continue
        if rows > rank:
            assert codes & HELD, (seed, codes)
        if all_rank < n:
            assert codes & FREE, (seed, codes)
        if rows == rank:
            assert not codes & (HELD - FREE), (seed, codes)
            if all_rows > all_rank:
                assert codes & DRIVERS, (seed, codes)
        said = {m for p in problems for m in re.findall(r"mobility (\d+), drivers", p.found)}
        assert said <= {str(n - rank)}, (seed, said)
    assert len(kinds) >= 5


def test_a_large_broken_chain_is_answered_soon():
    data = machines.chain(300)
    del data["joints"]["D0150"]
    with answered():
        problem = only(data)
    assert problem.code == "missing-driver"
