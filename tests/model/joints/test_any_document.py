"""Floods: files of links and joints in which everything is wrong are told so soon and shortly.

Documents that are spoilt at random: `tests.fuzz`.
"""

from __future__ import annotations

import json
import random

import pytest

import blockmech as bm
from blockmech.model.reading import LARGEST
from tests.doors import linkage_of
from tests.model.joints.machines import joints_file, pin
from tests.soon import answered

CHECKED = 10.0  # [s] of processor time in which any document is read and checked


def read(text):
    """What a text holds, and what is wrong with it."""
    try:
        linkage = linkage_of(text)
    except bm.FormatError as error:
        return None, list(error.problems)
    return linkage, linkage.check()


def tangled(number):
    """Links pinned to each other at random."""
    chance = random.Random(number)
    links = {f"l{k}": [chance.random() for _ in range(3)] for k in range(number)}
    names, joints = [*links, "frame"], {"d": pin("frame", "l0", (0, 0), (0, 0))}
    for k in range((3 * number - 1) // 2):
        ends = [(chance.random(), chance.random()) for _ in range(2)]
        joints[f"j{k}"] = pin(*chance.sample(names, 2), *ends)
    return joints_file(links, joints, {"motor": "d"})


FLOODS = {
    "links in loops": lambda: tangled(2000),
    "links in loops, few enough to count ranks": lambda: tangled(300),
    "links alone": lambda: joints_file({f"l{k}": (0, 0, 0) for k in range(10000)}, {}, {}),
    "joints in one point": lambda: joints_file(
        {f"l{k}": (0, 0, 0) for k in range(2500)},
        {f"j{k}": pin("frame", f"l{k}", (0, 0), (0, 0)) for k in range(2500)},
        {},
    ),
    "joints of unknown links": lambda: joints_file(
        {"a": (0, 0, 0)}, {f"j{k}": pin("x", "y", (0, 0), (0, 0)) for k in range(10000)}, {}
    ),
}


@pytest.mark.parametrize("name", FLOODS)
def test_a_flood_is_answered_soon_and_shortly(name):
    text = json.dumps(FLOODS[name]())
    assert len(text) < LARGEST
    with answered(CHECKED):
        _, problems = read(text)
    assert problems
    assert len(problems) < 120
    assert max(len(str(p)) for p in problems) < 3000
