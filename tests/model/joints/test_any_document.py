"""Whatever stands in a joint-based file: it works, or it is told what is wrong. Soon."""

from __future__ import annotations

import json
import os
import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import blockmech as bm
from blockmech.model.reading import LARGEST
from tests.codes import FILE_CODES
from tests.codes import LINKAGE_CODES as CODES
from tests.doors import linkage_of
from tests.model.joints.machines import joints_file, pin, slider_crank
from tests.soon import answered
from tests.spoilt import any_data, spoilt

CHECKED = 10.0  # [s] of processor time in which any document is read and checked
EXAMPLES = int(os.environ.get("BLOCKMECH_EXAMPLES", "150"))  # 10000 is the full run

WORDS = st.sampled_from(("frame", "crank", "rod", "O", "A", "R", "P", "type", "at", "a.b", ""))
NUMBERS = st.one_of(
    st.integers(-3, 3), st.just(10**300), st.just(1e-300), st.floats(allow_nan=True)
)
SCALARS = st.one_of(st.none(), st.booleans(), NUMBERS, WORDS)
DATA = any_data(SCALARS, WORDS, most=3, leaves=8)


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=spoilt(slider_crank(), 3, data=DATA, numbers=NUMBERS))
def test_a_spoilt_document_is_refused_or_works(data):
    with answered(CHECKED):
        linkage, problems = read(json.dumps(data))
    assert {p.code for p in problems} <= set(FILE_CODES) | set(CODES)
    if linkage is not None:
        text = linkage.to_json()
        assert linkage_of(text).to_json() == text
        assert problems or linkage.decompose().graph.check() == []


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
    "links in loops": lambda: tangled(4000),
    "links in loops, few enough to count ranks": lambda: tangled(300),
    "links alone": lambda: joints_file({f"l{k}": (0, 0, 0) for k in range(20000)}, {}, {}),
    "joints in one point": lambda: joints_file(
        {f"l{k}": (0, 0, 0) for k in range(5000)},
        {f"j{k}": pin("frame", f"l{k}", (0, 0), (0, 0)) for k in range(5000)},
        {},
    ),
    "joints of unknown links": lambda: joints_file(
        {"a": (0, 0, 0)}, {f"j{k}": pin("x", "y", (0, 0), (0, 0)) for k in range(20000)}, {}
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
