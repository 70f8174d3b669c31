"""Random joint-based documents, made pose first, so that they close with a margin.

Frames, order of links in a joint, sliders, friction and loads are all left to chance. The
document is plain data; `judged` is the same for the independent judge.
"""

from __future__ import annotations

import cmath
import json
import math
import random
from dataclasses import dataclass, field

from tests.independent import multibody as mb

LEAST_SINE = 0.4  # [-] of a group's angle: margin 0.16
DYADS = ("RRR", "RRP", "RPR", "PRP", "RPP")


@dataclass
class Making:
    """A document while it is made."""

    chance: random.Random
    rough: bool
    links: dict = field(default_factory=dict)
    joints: dict = field(default_factory=dict)
    drivers: dict = field(default_factory=dict)
    loads: dict = field(default_factory=dict)
    poses: dict = field(default_factory=lambda: {"frame": (0j, 0.0)})

    # -- pieces -----------------------------------------------------------

    def place(self):
        return complex(self.chance.uniform(-1, 1), self.chance.uniform(-1, 1))

    def along(self):
        return cmath.exp(1j * self.chance.uniform(-math.pi, math.pi))

    def support(self):
        return self.chance.choice(list(self.poses))

    def new_link(self):
        name = self.chance.choice("abcdefgh") + str(len(self.links))
        o, angle = self.place(), self.chance.uniform(-3, 3)
        self.links[name] = {
            "mass": self.chance.uniform(0.5, 2),
            "inertia": self.chance.uniform(0.05, 0.2),
            "cm": xy(self.place() / 3),
            "pose": [o.real, o.imag, angle],
        }
        return name, (o, angle)

    def settle(self, link):
        """Later links may stand on it from now on."""
        name, pose = link
        self.poses[name] = pose

    def _local(self, link, world):
        o, angle = link[1]
        return xy((world - o) * cmath.exp(-1j * angle))

    def _friction(self, kind):
        if not self.rough or self.chance.random() < 0.4:
            return {}
        law = {"law": "coulomb", "coefficient": self.chance.uniform(0.02, 0.15)}
        if kind == "R":
            law["radius"] = 0.01
        elif self.chance.random() < 0.5:
            law["guide_length"] = 0.5
        return {"friction": law}

    def _joint(self, kind, first, second, **more):
        name = f"{self.chance.choice('JKLM')}{len(self.joints)}"
        if self.chance.random() < 0.5:
            first, second = second, first
            more = {
                key: said[::-1] if isinstance(said, list) else said for key, said in more.items()
            }
        self.joints[name] = {"type": kind, "links": [first[0], second[0]], **more}
        self.joints[name] |= self._friction(kind)
        return name

    def pin(self, first, second, world):
        at = [self._local(link, world) for link in (first, second)]
        return self._joint("R", first, second, at=at)

    def guide(self, first, second, world, u, apart=None):
        far = self.chance.uniform(-0.5, 0.5) if apart is None else apart
        at = [self._local(first, world), self._local(second, world + far * u)]
        angle = [cmath.phase(u) - link[1][1] for link in (first, second)]
        return self._joint(
            "P", first, second, at=at, angle=angle, slider=self.chance.choice([0, 1])
        )

    def on(self, name):
        return name, self.poses[name]

    # -- units ------------------------------------------------------------

    def driver(self):
        link, support = self.new_link(), self.on(self.support())
        if self.chance.random() < 0.6:
            joint = self.pin(support, link, self.place())
        else:
            joint = self.guide(support, link, self.place(), self.along())
        self.drivers[f"drive{len(self.drivers)}"] = {"joint": joint}
        self.settle(link)

    def supports(self):
        """Two links, not twice the frame."""
        while True:
            found = self.support(), self.support()
            if found != ("frame", "frame"):
                return self.on(found[0]), self.on(found[1])

    def dyad(self, kind=None):
        kind = kind or self.chance.choice(DYADS)
        (a, b), i, j = self.supports(), self.new_link(), self.new_link()
        while True:
            B, C, D, u, v = self.place(), self.place(), self.place(), self.along(), self.along()
            sine = {
                "RRR": (C - B, C - D),
                "RRP": (C - B, 1j * u),
                "RPR": (D - B, 1j * u),
                "PRP": (u, v),
                "RPP": (u, v),
            }[kind]
            if far(*sine):
                break
        pin, guide = self.pin, self.guide
        if kind == "RRR":
            pin(a, i, B), pin(i, j, C), pin(b, j, D)
        elif kind == "RRP":
            pin(a, i, B), pin(i, j, C), guide(b, j, D, u)
        elif kind == "RPR":
            pin(a, i, B), guide(i, j, C, u), pin(b, j, D)
        elif kind == "PRP":
            guide(a, i, B, u), pin(i, j, C), guide(b, j, D, v)
        else:
            pin(a, i, B), guide(i, j, C, u), guide(b, j, D, v)
        for link in (i, j):
            self.settle(link)

    def fork(self, smooth=True):
        """Two RRR dyads, the second on the inner pin of the first: one pin of three links."""
        (a, b), (i, j, k, m) = self.supports(), [self.new_link() for _ in range(4)]
        B, C, D, E, F = (self.place() for _ in range(5))
        while not (far(C - B, C - D) and far(E - C, E - F)):
            B, C, D, E, F = (self.place() for _ in range(5))
        self.pin(a, i, B), self.pin(b, j, D), self.pin(k, m, E)
        self.pin(self.on(self.support()), m, F)
        name = f"P{len(self.joints)}"
        order = self.chance.sample([i, j, k], 3)
        at = [self._local(link, C) for link in order]
        self.joints[name] = {"type": "R", "links": [link[0] for link in order], "at": at}
        if not smooth:
            law = {"law": "coulomb", "coefficient": 0.1, "radius": 0.01}
            self.joints[name]["friction"] = law
        for link in (i, j, k, m):
            self.settle(link)

    def rough_fork(self):
        """The same with friction, so that it stays seated as it is."""
        self.fork(smooth=False)

    def bent_cylinder(self):
        """A cylinder whose rod is pinned off its line."""
        self.cylinder(offset=0.1)

    def cylinder(self, offset=0.0):
        """A driven length between pivots; with an offset of the rod no closed form."""
        (a, b), barrel, rod, j = self.supports(), self.new_link(), self.new_link(), self.new_link()
        B, C, D = self.place(), self.place(), self.place()
        while not far(C - B, C - D):
            B, C, D = self.place(), self.place(), self.place()
        u = (C - B) / abs(C - B) * self.chance.choice([-1, 1])
        self.pin(a, barrel, B)
        joint = self.guide(barrel, rod, B + self.chance.uniform(-0.3, 0.3) * u + 1j * offset * u, u)
        self.pin(rod, j, C)
        self.pin(b, j, D)
        self.drivers[f"lift{len(self.drivers)}"] = {"joint": joint}
        for link in (barrel, rod, j):
            self.settle(link)

    def triad(self):
        """A ternary link on three others."""
        plate, legs = self.new_link(), [self.new_link() for _ in range(3)]
        feet = [self.on(self.support()) for _ in legs]
        if all(foot[0] == "frame" for foot in feet):
            feet[0] = self.on(list(self.poses)[-1])
        for foot, leg in zip(feet, legs, strict=True):
            self.pin(foot, leg, self.place())
            if self.chance.random() < 0.7:
                self.pin(leg, plate, self.place())
            else:
                self.guide(leg, plate, self.place(), self.along())
        for link in (plate, *legs):
            self.settle(link)

    def loop(self):
        """Four links in a closed loop, two of them on earlier ones: class IV."""
        (a, b), (i, j, k, m) = self.supports(), [self.new_link() for _ in range(4)]
        pairs = ((a, i), (i, k), (k, j), (j, m), (m, i), (b, j))
        guides = self.chance.sample(pairs, self.chance.choice([0, 0, 1, 2]))
        for first, second in pairs:
            if (first, second) in guides:
                self.guide(first, second, self.place(), self.along())
            else:
                self.pin(first, second, self.place())
        for link in (i, j, k, m):
            self.settle(link)

    def load(self):
        name, (a, b) = f"load{len(self.loads)}", self.chance.sample(list(self.poses), 2)
        kind = self.chance.choice(["force", "couple", "spring", "torsion_spring", "along"])
        links, at = [a, b], [xy(self.place()), xy(self.place())]
        moving = a if a != "frame" else b
        if kind == "force":
            axes = self.chance.choice(["ground", "link"])
            force = xy(20 * self.place())
            self.loads[name] = {
                "type": kind,
                "link": moving,
                "at": at[0],
                "force": force,
                "axes": axes,
            }
        elif kind == "couple":
            moment = self.chance.uniform(-5, 5)
            self.loads[name] = {"type": kind, "link": moving, "moment": moment}
        elif kind == "spring":
            numbers = {"stiffness": 30.0, "free_length": 0.3, "damping": 2.0}
            self.loads[name] = {"type": kind, "links": links, "at": at, **numbers}
        else:
            numbers = {"stiffness": 3.0, "rest_angle": self.chance.uniform(-1, 1), "damping": 0.5}
            of_two = [name for name, joint in self.joints.items() if len(joint["links"]) == 2]
            joint = self.chance.choice(of_two)
            where = {"links": links} if kind == "torsion_spring" else {"joint": joint}
            self.loads[name] = {"type": "torsion_spring", **where, **numbers}


def xy(z):
    return [z.real, z.imag]


def far(a, b):
    """Whether two vectors are far from parallel."""
    return abs((a.conjugate() * b).imag) > LEAST_SINE * abs(a) * abs(b)


def document(seed, units=("dyad",) * 3, rough=True, loads=3, slack=1e-3):
    """A random document with a driver first and so many more units.

    ``slack`` is by how much the given poses are off.
    """
    chance = random.Random(seed)
    making = Making(chance, rough)
    making.driver()
    for unit in units:
        getattr(making, unit)()
    for _ in range(loads):
        making.load()
    for link in making.links.values():
        link["pose"] = [x + chance.uniform(-slack, slack) for x in link["pose"]]
    return {
        "format": "blockmech/joints",
        "version": 1,
        "name": f"random_{seed}",
        "gravity": [0.3, -9.81],
        "links": making.links,
        "joints": making.joints,
        "drivers": making.drivers,
        "loads": making.loads,
    }


def shuffled(data, seed):
    """The same document with links, joints, drivers and loads in another order."""
    chance = random.Random(seed)
    found = dict(data)
    for section in ("links", "joints", "drivers", "loads"):
        items = list(data.get(section, {}).items())
        chance.shuffle(items)
        found[section] = dict(items)
    return found


def two_link_pins(data):
    """The document with pins of many links written as pairs of the first with each other one."""
    joints = {}
    for name, joint in data["joints"].items():
        first, *others = joint["links"]
        for k, other in enumerate(others, start=1):
            pair = name if len(others) == 1 else f"{name}.{other}"
            joints[pair] = joint | {"links": [first, other], "at": [joint["at"][0], joint["at"][k]]}
    return data | {"joints": joints}


def judged(data):
    """The document as the independent judge reads it."""
    return mb.read(json.loads(json.dumps(two_link_pins(data))))
