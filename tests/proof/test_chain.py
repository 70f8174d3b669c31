"""A chain of a thousand dyads given as links and joints in shuffled order.

Its forces are those of a recursion in thirty digits (`chain.py`); the work it asks for grows
with its length and no faster. Times are in `tests/benchmarks/test_chain.py`.
"""

from __future__ import annotations

import functools
import json

import pytest

from tests.doors import linkage_of as loads
from tests.proof import chain
from tests.wiring import same_bits

LONGEST = 1000
Q, RATE, ACCELERATION = chain.HOME + 0.05, 2.0, -1.0
TOLERANCE = 1e-10  # [-] of the largest: the task
WANT = ("joint.*.reaction", "driver.motor.drive")


@functools.cache
def made(number):
    return loads(json.dumps(chain.document(number))).decompose()


@functools.cache
def compiled(number):
    return made(number).compile()


def test_a_thousand_dyads_are_recognised_in_their_order():
    types = [block["type"] for block in made(LONGEST).data["blocks"].values()]
    assert types == ["frame", "driver.crank", *["dyad.rrr"] * LONGEST]
    rods = [unit.links[1] for unit in made(LONGEST).formation.units[1:]]
    assert rods == [f"rod{k:04}" for k in range(LONGEST)]
    assert made(LONGEST).graph.check() == []


def test_every_reaction_is_that_of_the_recursion():
    request = {"at": Q, "rates": RATE, "accelerations": ACCELERATION}
    run = compiled(LONGEST).run(**request, want=WANT)
    forces, moment = chain.recursion(LONGEST, Q, RATE, ACCELERATION)
    assert len(forces) == 3 * LONGEST + 1
    largest = max(map(abs, forces.values()))
    for joint, force in forces.items():
        assert abs(run[f"joint.{joint}.reaction"][0] - force) <= TOLERANCE * largest, joint
    assert run["driver.motor.drive"][0] == pytest.approx(moment, rel=TOLERANCE)
    batch = compiled(LONGEST).run(**request, want=WANT, engine="numpy")
    assert same_bits(run, batch) == []  # of as many kernels in one program


def test_the_work_is_in_proportion_to_the_number_of_dyads():
    calls = {n: compiled(n).plan(WANT).calls for n in (10, 100, LONGEST)}
    a_dyad = (calls[100] - calls[10]) / 90
    assert calls[LONGEST] - calls[100] == a_dyad * 900
    assert 0 < a_dyad < 10
