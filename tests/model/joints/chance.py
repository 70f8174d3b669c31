"""Random joint-based documents: random mechanisms said in links and joints, in their pose.

What a graph does not say is left to chance: the frames of the links and the order of links in
a joint. Pairs at one place are one pin of three links and more. The document is plain data;
`judged` is the same for the independent judge.
"""

from __future__ import annotations

import cmath
import json
import math
import random
from collections import defaultdict
from dataclasses import asdict

from blockmech.testing.strategies import EVERY, Options, Seeded, random_mechanism
from tests.blocks.twin import Twin
from tests.independent import multibody as mb

SIZES = ((4, 0), (4, 0), (6, 0), (3, 1), (5, 1))  # links and driven pairs of general groups
WHOLE = Options(
    groups=(2, 4), kinds=(*EVERY, *5 * EVERY[-1:]), sizes=SIZES, twists=True, min_margin=0.1
)
LOADS = {kind: name for name, kind in mb.KINDS.items()}


class Frames:
    """Frames of the document's own, on the links of a system."""

    def __init__(self, chance, links):
        self.names = {"frame": "frame"}
        self.places = {"frame": (0j, 0.0)}
        for k, link in enumerate(chance.sample(list(links), len(links))):
            self.names[link] = f"l{k}"
            origin = complex(chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5))
            self.places[link] = origin, chance.uniform(-3, 3)

    def turn(self, link):
        """Angle [rad] of the document's frame in the link's."""
        return self.places[link][1]

    def vector(self, link, components):
        z = complex(*components) * cmath.exp(-1j * self.turn(link))
        return [z.real, z.imag]

    def place(self, link, position):
        origin = self.places[link][0]
        return self.vector(link, (position[0] - origin.real, position[1] - origin.imag))

    def pose(self, link, x, y, angle):
        origin, turn = self.places[link]
        o = complex(x, y) + cmath.exp(1j * angle) * origin
        return [o.real, o.imag, angle + turn]


def document(seed, options=WHOLE, slack=1e-3):
    """A random document; ``slack`` is by how much the given poses are off."""
    chance, case = random.Random(seed), random_mechanism(Seeded(seed), options)
    twin = Twin(case.graph.compile())
    system, home = twin.system, [case.request["at"][d] for d in twin.mechanism.drivers]
    frames = Frames(chance, system.links)
    links = {}
    for (link, body), pose in zip(system.links.items(), twin._guess(home).tolist(), strict=True):
        rough = [x + chance.uniform(-slack, slack) for x in frames.pose(link, *pose)]
        mass = {"mass": body.mass, "inertia": body.inertia, "cm": frames.place(link, body.cm)}
        links[frames.names[link]] = {**mass, "pose": rough}
    named = {name: f"J{k}" for k, name in enumerate(system.joints)}
    joints = {named[n]: _joint(chance, frames, joint) for n, joint in system.joints.items()}
    drivers = [named[driver.joint] for driver in system.drivers.values()]
    return {
        "format": "blockmech/joints",
        "version": 2,
        "name": f"random_{seed}",
        "gravity": list(system.gravity),
        "links": links,
        "joints": _pinned_together(chance, joints, drivers),
        "drivers": {f"drive{k}": {"joint": joint} for k, joint in enumerate(drivers)},
        "loads": {f"load{k}": _load(frames, x) for k, x in enumerate(system.loads.values())},
    }


def _joint(chance, frames, joint):
    order = chance.choice([(0, 1), (1, 0)])
    links = [joint.links[k] for k in order]
    at = [frames.place(joint.links[k], joint.at[k]) for k in order]
    result = {"type": joint.type, "links": [frames.names[link] for link in links], "at": at}
    if joint.type == "P":
        result["angle"] = [joint.angle[k] - frames.turn(joint.links[k]) for k in order]
        result["slider"] = order.index(joint.slider)
    if joint.friction:
        law = {key: x for key, x in asdict(joint.friction).items() if x}
        result["friction"] = {"law": "coulomb", **law}
    return result


def _pinned_together(chance, joints, drivers):
    """The joints, pins at one place of a link as one of many links, rubbing as the first does."""
    at_place = defaultdict(list)
    for name, joint in joints.items():
        if joint["type"] == "R" and name not in drivers:
            for link, at in _ends(joint):
                at_place[link, tuple(at)].append(name)
    for same in at_place.values():
        ends = {a: z for name in same if name in joints for a, z in _ends(joints[name])}
        if len(ends) == len(same) + 1 > 2 and same[0] in joints:
            order = chance.sample(sorted(ends), len(ends))
            for name in same[1:]:
                del joints[name]
            joints[same[0]] |= {"links": order, "at": [ends[a] for a in order]}
    return joints


def _ends(joint):
    return zip(joint["links"], joint["at"], strict=True)


def _load(frames, load):
    fields = {key: x for key, x in asdict(load).items() if x is not None}
    result = {key: list(x) if isinstance(x, tuple) else x for key, x in fields.items()}
    if isinstance(load, mb.TorsionSpring):
        turn = frames.turn(load.links[1]) - frames.turn(load.links[0])
        result["rest_angle"] = math.remainder(load.rest_angle - turn, math.tau)
    if result.get("axes") == "link":
        result["force"] = frames.vector(load.link, load.force)
    if "links" in result:
        result["links"] = [frames.names[link] for link in load.links]
        if "at" in result:
            result["at"] = [frames.place(*end) for end in zip(load.links, load.at, strict=True)]
        return {"type": LOADS[type(load)], **result}
    if "at" in result:
        result["at"] = frames.place(load.link, load.at)
    return {"type": LOADS[type(load)], **result, "link": frames.names[load.link]}


def shuffled(data, seed):
    """The same document with links, joints, drivers and loads in another order."""
    chance = random.Random(seed)
    result = dict(data)
    for section in ("links", "joints", "drivers", "loads"):
        items = list(data.get(section, {}).items())
        chance.shuffle(items)
        result[section] = dict(items)
    return result


def two_link_pins(data):
    """The document with pins of many links written as pairs of the first with each other one."""
    joints = {}
    for name, joint in data["joints"].items():
        first, *rest = joint["links"]
        for k, second in enumerate(rest, start=1):
            pair = name if len(rest) == 1 else f"{name}.{second}"
            joints[pair] = joint | {
                "links": [first, second],
                "at": [joint["at"][0], joint["at"][k]],
            }
    return data | {"joints": joints}


def judged(data):
    """The document as the independent judge reads it."""
    return mb.read(json.loads(json.dumps(two_link_pins(data))))
