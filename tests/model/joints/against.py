"""A document by blockmech and by the independent judge, compared output by output."""

from __future__ import annotations

import functools
import json

import numpy as np

from tests.doors import linkage_of as loads
from tests.independent import comparison
from tests.independent import multibody as mb
from tests.model.joints.chance import judged


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
        return comparison.motion(self.run, self.judge, "link.")

    def forces(self):
        yield from comparison.forces(self.run, self.judge, "joint.", "driver.")
        largest = max(abs(float(w)) for row in self.judge.rates.values() for w in row)
        for name, joint in self.judge.forces.joints.items():
            off = abs(self.run[f"joint.{name}.slip"][0] - float(joint.slip))
            yield f"{name}.slip", comparison.relative(off, largest, self.judge)
