"""Random joint-based documents against a solver that knows no Assur groups.

Drivers on moving links and on each other, cylinders with and without closed form, groups of
class III and IV of pins and guides, pins of three links, friction, loads. The same documents
in general groups only, and in one single general group, must give the same. Each failure
prints the seed. ``BLOCKMECH_PROOF=500`` takes five hundred; a part is in the default suite.
"""

from __future__ import annotations

import functools
import json
import os
from collections import Counter
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from tests.doors import linkage_of as loads
from tests.independent import comparison
from tests.independent import multibody as mb
from tests.model.joints.chance import WHOLE, document, judged

SEEDS = range(int(os.environ.get("BLOCKMECH_PROOF", "16")))
FORMS = ("", "groups", "one")
MOTION = 1e-14  # of the largest of their kind, times the conditioning: measured 2e-15
FORCES = 1e-13  # of their own size, times the conditioning: measured 2e-15
MOVES = (0.05, 0.01)  # [rad or m] of the drivers from the given pose; the judge may lose its way
WORST = 1e5  # condition of the judge's Jacobian beyond which a document is left out


def data_of(seed):
    """A document of one to four groups; every other one has friction."""
    result = document(seed, replace(WHOLE, friction=seed % 2 == 1))
    system = judged(result)
    home = mb.Instant(system, system.home)
    # Poses do not count turns, so the start says in which turn of the drivers they are.
    starts = {name: float(home.coordinate(d).value) for name, d in system.drivers.items()}
    return result | {"initial": {name: {"q": q} for name, q in starts.items()}}


@functools.cache
def verdict(text, friction, move, seed):
    """A request that moves the drivers a little from the pose of a document, and the judge's."""
    chance = np.random.default_rng(seed)
    system = judged(json.loads(text))
    home = mb.Instant(system, system.home)
    start = [float(home.coordinate(d).value) for d in system.drivers.values()]
    moved, *given = (chance.uniform(-1, 1, len(start)) for _ in range(3))
    values = np.array(start) + move * moved
    poses = mb.assemble(system, system.home, values, follow=True, refine=True)
    rows = zip(("at", "rates", "accelerations"), (values, *given), strict=True)
    request = {k: dict(zip(system.drivers, x, strict=True)) for k, x in rows}
    return request, comparison.verdict(system, poses, *given, friction)


class Comparison:
    """One sample of a document in a form; the judge is asked once for all forms."""

    def __init__(self, data, general="", friction=True, move=0.05, seed=0):
        self.data, text = data, json.dumps(data)
        self.decomposed = loads(text).decompose(general)
        self.mechanism = self.decomposed.compile()
        request, self.judge = verdict(text, friction, move, seed)
        how = "newton" if friction else "none"
        self.run = self.mechanism.run(**request, friction=how, on_gap="mark")

    def motion(self):
        yield from comparison.motion(self.run, self.judge, "link.")
        system, poses = judged(self.data), self.judge.poses
        instant = mb.Instant(system, np.array([poses[link] for link in system.links]))
        for name, joint in system.joints.items():
            if joint.type == "P":
                off = abs(self.run[f"joint.{name}.coordinate"][0] - instant.coordinate(joint).value)
                yield (
                    f"{name}.coordinate",
                    comparison.relative(float(off), self.judge.size, self.judge),
                )

    def forces(self):
        yield from comparison.forces(self.run, self.judge, "joint.", "driver.")
        largest = max(abs(float(w)) for row in self.judge.rates.values() for w in row)
        for name, joint in self.judge.forces.joints.items():
            off = abs(self.run[f"joint.{name}.slip"][0] - float(joint.slip))
            yield f"{name}.slip", comparison.relative(off, largest, self.judge)


@functools.cache
def outcome(seed, form):
    """The worst errors of a document in a form, or why there are none."""
    for move in MOVES:
        with suppress(mb.NoSolution):
            result = Comparison(data_of(seed), form, seed % 2 == 1, move, seed)
            break
    else:
        return "the judge loses its way", {}, None
    if result.judge.condition > WORST:
        return "near singular", {}, None
    status = result.run.quality.status[0]
    if status != "ok" or not result.judge.forces.converged:
        judge = "solved" if result.judge.forces.converged else "not"
        return f"{status}, judge {judge}", {}, result
    motion = max(error for _, error in result.motion())
    forces = max(error for _, error in result.forces())
    return "ok", {"motion": motion, "forces": forces}, result


@pytest.mark.parametrize("form", FORMS, ids=["blocks", "groups", "one_group"])
def test_motion_and_forces_are_the_judges(form):
    outcomes, worst = Counter(), Counter()
    seeds = SEEDS[::2] if form else SEEDS
    for seed in seeds:
        said, errors, _ = outcome(seed, form)
        outcomes[said] += 1
        for kind, error in errors.items():
            allowed = {"motion": MOTION, "forces": FORCES}[kind]
            assert error <= allowed, f"seed {seed}: {kind} off by {error:.2g}"
            worst[kind] = max(worst[kind], error)
    print(form or "blocks", dict(outcomes), {k: f"{v:.1e}" for k, v in worst.items()})
    assert outcomes["ok"] >= 0.8 * len(seeds)
    # Where blockmech gives no answer, the judge has none either.
    allowed = {"ok", "the judge loses its way", "near singular"}
    assert set(outcomes) <= allowed | {"self-locked, judge not", "jammed, judge not"}


def test_documents_are_as_varied_as_they_should_be():
    blocks, kinds, units = Counter(), Counter(), Counter()
    on_moving = pins = rough = 0
    for seed in SEEDS:
        said, _, found = outcome(seed, "")
        if said != "ok":
            continue
        structure = found.mechanism.structure
        blocks.update(b.type_name for b in structure.blocks.values())
        units.update(f"{u.kind} {u.number}" for u in found.decomposed.formation.units)
        document = found.data
        kinds.update(joint["type"] for joint in document["joints"].values())
        pins += sum(len(joint["links"]) > 2 for joint in document["joints"].values())
        rough += sum("friction" in joint for joint in document["joints"].values())
        for driver in document["drivers"].values():
            on_moving += "frame" not in document["joints"][driver["joint"]]["links"]
    print(dict(blocks), dict(units), dict(kinds), f"drivers on moving links {on_moving}")
    print(f"pins of three links {pins}, rough joints {rough}")
    few = len(SEEDS) / 12
    dyads = ("dyad.rrr", "dyad.rrp", "dyad.rpr", "dyad.prp", "dyad.rpp")
    for kind in (*dyads, "driven.rrr", "group.general", "driver.crank", "driver.slide"):
        assert blocks[kind] >= few, kind
    assert min(on_moving, pins, rough) >= few
    assert sum(number for unit, number in units.items() if unit[-1] in "345") >= few
    assert min(kinds["R"], kinds["P"]) >= len(SEEDS)
