"""A document by blockmech and by the independent judge, compared output by output."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from tests.doors import linkage_of as loads
from tests.independent import multibody as mb
from tests.model.joints.chance import judged

TURN = 2 * np.pi


def wound(system, poses):
    """The system with torsion springs wound by whole turns: blockmech counts none."""
    loads = dict(system.loads)
    instant = mb.Instant(system, poses)
    for name, load in loads.items():
        rotary = isinstance(load, mb.TorsionSpring) and (
            load.joint is None or system.joints[load.joint].type == "R"
        )
        if rotary:
            angle = float(instant.coordinate(load).value) - load.rest_angle
            rest = load.rest_angle + TURN * np.ceil(angle / TURN - 0.5)
            loads[name] = replace(load, rest_angle=rest)
    return replace(system, loads=loads)


class Comparison:
    """One sample: drivers moved a little from the pose of the document."""

    def __init__(self, data, general="", friction=True, move=0.05, seed=0):
        self.data = data
        self.linkage = loads(json.dumps(data))
        self.decomposed = self.linkage.decompose(general)
        self.mechanism = self.decomposed.compile()
        chance = np.random.default_rng(seed)
        system = judged(data)
        home = mb.Instant(system, system.home)
        start = [float(home.coordinate(d).value) for d in system.drivers.values()]
        moved, rates, accelerations = (chance.uniform(-1, 1, len(start)) for _ in range(3))
        values = np.array(start) + move * moved
        poses = mb.assemble(system, system.home, values, follow=True, refine=True)
        self.condition = mb.conditioning(system, poses)
        self.poses = poses
        system = wound(system, poses)
        self.rates = mb.rates(system, poses, rates)
        self.accelerations = mb.accelerations(system, poses, self.rates, accelerations)
        self.forces = mb.reactions(system, poses, self.rates, self.accelerations, friction=friction)
        self.system = system
        self.size = float(mb.Instant(system, poses).size)
        drivers = list(system.drivers)
        self.run = self.mechanism.run(
            at=dict(zip(drivers, values, strict=True)),
            rates=dict(zip(drivers, rates, strict=True)),
            accelerations=dict(zip(drivers, accelerations, strict=True)),
            friction="newton" if friction else "none",
            on_gap="mark",
        )

    def _relative(self, found, wanted, scale):
        error = abs(complex(found) - complex(wanted))
        return error / float(scale) / self.condition if error else 0.0

    def motion(self):
        """Errors of places, velocities and accelerations, of the largest of a kind."""
        kinds = (
            ("p", "angle", self.poses),
            ("v", "omega", self.rates),
            ("a", "alpha", self.accelerations),
        )
        for vector, scalar, rows in kinds:
            wanted = np.asarray(rows, float)
            scale = max(np.abs(wanted[:, :2]).max(), self.size * np.abs(wanted[:, 2]).max())
            for name, (x, y, turn) in zip(self.system.links, wanted, strict=True):
                found = self.run[f"link.{name}.{vector}"][0]
                yield f"{name}.{vector}", self._relative(found, complex(x, y), scale)
                angle = self.run[f"link.{name}.{scalar}"][0]
                if scalar == "angle":
                    angle = turn + np.angle(np.exp(1j * (angle - turn)))
                yield f"{name}.{scalar}", self._relative(angle, turn, scale / self.size)

    def reactions(self):
        """Errors of reactions, couples, friction, slips and drives."""
        joints = self.forces.joints.items()
        largest = max(np.hypot(*map(float, j.force)) for _, j in joints)
        for name, joint in joints:
            force = complex(*map(float, joint.force))
            yield name, self._relative(self.run[f"joint.{name}.reaction"][0], force, largest)
            if joint.C is not None:
                found = self.run[f"joint.{name}.N"][0]
                yield f"{name}.N", self._relative(found, float(joint.N), largest)
                found, scale = self.run[f"joint.{name}.C"][0], largest * self.size
                yield f"{name}.C", self._relative(found, float(joint.C), scale)
            if self.linkage.joints.get(name) and self.linkage.joints[name].friction:
                found = self.run[f"joint.{name}.friction"][0]
                yield f"{name}.friction", self._relative(found, float(joint.friction), largest)
            slip = self.run[f"joint.{name}.slip"][0]
            yield f"{name}.slip", self._relative(slip, float(joint.slip), np.abs(self.rates).max())
        for name, effort in self.forces.drivers.items():
            found = self.run[f"driver.{name}.drive"][0]
            yield f"driver.{name}", self._relative(found, float(effort), largest)

    def wrong(self, tolerance):
        """What is further off than the tolerance, by name."""
        errors = dict(self.motion()) | dict(self.reactions())
        return {name: e for name, e in errors.items() if not e <= tolerance}
