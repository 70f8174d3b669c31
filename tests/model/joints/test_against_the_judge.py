"""Random documents against the independent multibody solver, which knows no Assur groups.

Frames, order of links, sliders, friction and loads are left to chance. The same documents in
general groups only, and in one single general group, must give the same.
"""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from blockmech.model.joints.closing import coordinate
from blockmech.model.joints.connections import connections
from tests.doors import linkage_of as loads
from tests.independent import multibody as mb
from tests.model.joints.against import Comparison
from tests.model.joints.chance import document, shuffled

ROUNDING = 1e-13  # [-] some hundred roundings of 1e-16, times the condition that is divided out
WORST = 1e4  # condition of the judge's Jacobian beyond which a document is left out
EACH = int(os.environ.get("BLOCKMECH_DOCUMENTS", "6"))  # documents of a kind; 40 is the full run

KINDS = {
    "dyads": ("dyad", "dyad", "dyad", "dyad"),
    "a driver on a moving link": ("dyad", "driver", "dyad"),
    "drivers on each other": ("driver", "driver", "dyad", "dyad"),
    "cylinders": ("cylinder", "dyad", "cylinder"),
    "a cylinder without closed form": ("bent_cylinder", "dyad"),
    "a triad": ("dyad", "triad", "dyad"),
    "pins of three links": ("fork", "dyad", "fork"),
    "a rough pin of three links": ("rough_fork", "dyad"),
}


def compared(data, general=""):
    """The comparison, or None where the judge loses its way or the document is too bad."""
    try:
        found = Comparison(data, general)
    except mb.NoSolution:
        return None
    return found if found.condition < WORST and found.forces.converged else None


@pytest.mark.parametrize("kind", KINDS)
def test_motion_and_forces_are_the_judge_s(kind):
    tried = 0
    for seed in range(EACH):
        found = compared(document(seed, KINDS[kind]))
        if found is None:
            continue
        tried += 1
        assert found.run.quality.status == ("ok",), seed
        assert found.wrong(ROUNDING) == {}, (seed, str(found.decomposed.formation))
    assert tried >= EACH / 2


@pytest.mark.parametrize("general", ["groups", "one"])
@pytest.mark.parametrize("kind", ["dyads", "cylinders", "a triad", "pins of three links"])
def test_general_groups_only_give_the_same(kind, general):
    tried = 0
    for seed in range(max(2, EACH // 2)):
        found = compared(document(seed, KINDS[kind]), general)
        if found is None:
            continue
        tried += 1
        assert found.wrong(ROUNDING) == {}, (seed, str(found.decomposed.formation))
        blocks = {b["type"] for b in found.decomposed.data["blocks"].values()}
        assert not any(b.startswith(("dyad.", "driven.")) for b in blocks)
    assert tried >= 1


@pytest.mark.parametrize("seed", range(3))
def test_the_order_in_the_file_changes_no_bit(seed):
    data = document(seed, ("dyad", "fork", "driver", "triad", "cylinder"))
    one, other = (read(d).decompose() for d in (data, shuffled(data, seed + 100)))
    assert one.names == other.names
    assert one.data["blocks"] == other.data["blocks"]
    at = {
        name: coordinate(one.poses, connections(read(data))[driver["joint"]]) + 0.01
        for name, driver in data["drivers"].items()
    }
    ask = {"at": at, "rates": dict.fromkeys(at, 1.0), "accelerations": dict.fromkeys(at, 0.5)}
    first, second = (made.compile().run(**ask, on_gap="mark") for made in (one, other))
    assert set(first) == set(second)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)


def test_every_kind_of_block_has_been_compared():
    types = {
        block["type"]
        for units in KINDS.values()
        for seed in range(6)
        for block in blocks_of(document(seed, units))
    }
    dyads = {"dyad.rrr", "dyad.rrp", "dyad.rpr", "dyad.prp", "dyad.rpp"}
    assert dyads | {"driver.crank", "driver.slide", "driven.rrr", "group.general"} <= types


def blocks_of(data):
    return read(data).decompose().data["blocks"].values()


def read(data):
    return loads(json.dumps(data))
