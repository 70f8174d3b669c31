"""MJCF: planar models of MuJoCo, a tree of bodies and pins that close loops.

Bodies move in the plane across the axis of all hinges, which is a coordinate axis. A hinge is a
pin and a slide a guide between a body and its parent, ``equality/connect`` a pin between two
bodies, an actuator drives its joint. Angles are degrees unless the compiler says radian.

Source: MuJoCo documentation, XML reference.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple
from xml.etree.ElementTree import Element

from blockmech.errors import listed
from blockmech.exchange.drawn_linkage import FRAME, Drawing, Drive, Guide, Inertia
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import number, wrong, xml_of
from blockmech.values import free_name

AXES = {2: (0, 1, 1), 0: (1, 2, 1), 1: (0, 2, -1)}  # normal -> x and y of the plane, and its sense
ACTUATORS = ("motor", "position", "velocity", "general", "intvelocity", "damper")


class Plane(NamedTuple):
    """The plane of a model: which coordinate is its normal, and how angles are written."""

    normal: int
    unit: float

    def place(self, raw: list[float]) -> complex:
        """A place in the plane."""
        x, y, _ = AXES[self.normal]
        return complex(raw[x], raw[y])

    def turn(self, body: Element, where: str) -> float:
        """The angle [rad] of a body against its parent."""
        sense = AXES[self.normal][2]
        if (quat := body.get("quat")) is not None:
            w, *v = _numbers(quat, where, 4)
            if any(abs(x) > 1e-9 for i, x in enumerate(v) if i != self.normal):
                raise wrong(where, "it is turned out of the plane", "a planar model")
            return sense * 2 * math.atan2(v[self.normal], w)
        if (euler := body.get("euler")) is not None:
            angles = _numbers(euler, where, 3)
            if any(abs(x) > 1e-9 for i, x in enumerate(angles) if i != self.normal):
                raise wrong(where, "it is turned out of the plane", "a planar model")
            return sense * angles[self.normal] * self.unit
        if any(body.get(x) for x in ("axisangle", "xyaxes", "zaxis")):
            raise wrong(where, "its orientation is written otherwise", "quat or euler")
        return 0.0


def _numbers(raw: str | None, where: str, count: int, default: str = "") -> list[float]:
    numbers = [number(word, where) for word in (raw or default).split()]
    if len(numbers) != count:
        raise wrong(where, f'"{(raw or "")[:40]}"', f"{count} numbers")
    return numbers


def read(text: str, where: str) -> Drawing:
    """The drawing of a model in its reference pose."""
    root = xml_of(text, where)
    world = root.find("worldbody")
    if root.tag != "mujoco" or world is None:
        raise wrong(where, "it has no worldbody", "<mujoco> with a <worldbody>")
    return _Reading(root, world, where).found


class _Reading:
    def __init__(self, root: Element, world: Element, where: str) -> None:
        self.where = where
        compiler = root.find("compiler")
        radian = compiler is not None and compiler.get("angle") == "radian"
        normals = {
            self._normal(j) for j in world.iter("joint") if j.get("type", "hinge") == "hinge"
        }
        if len(normals) != 1:
            raise wrong(where, "its hinges have no one axis", "a planar model with hinges")
        self.plane = Plane(normals.pop(), 1.0 if radian else math.pi / 180)
        self.found = Drawing(root.get("model") or "mujoco", "m", "MJCF file")
        self.frames: dict[str, tuple[complex, float]] = {"world": (0j, 0.0)}
        self.links = {"world": FRAME}
        self.joints: dict[str, int] = {}  # guide of a slide joint
        for body in world.findall("body"):
            self._body(body, "world")
        for k, raw in enumerate(root.findall("equality/connect")):
            self._connect(raw, f"connect_{k + 1}")
        for kind in ("weld", "joint", "tendon", "distance"):
            if root.find(f"equality/{kind}") is not None:
                self.found.note(f"equality/{kind}: left out")
        for kind in ("tendon", "contact", "keyframe"):
            if root.find(kind) is not None:
                self.found.note(f"{kind}: left out")
        for raw in root.findall("actuator/*"):
            self._actuator(raw)
        option = root.find("option")
        g = _numbers((option.get("gravity") if option is not None else None), where, 3, "0 0 -9.81")
        if self.plane.normal != 2 or any(g[:2]):
            self.found.gravity = self.plane.place(g)

    def _normal(self, joint: Element) -> int:
        axis = _numbers(joint.get("axis"), f"{self.where}, joint", 3, "0 0 1")
        main = max(range(3), key=lambda i: abs(axis[i]))
        if any(abs(x) > 1e-9 * abs(axis[main]) for i, x in enumerate(axis) if i != main):
            raise wrong(self.where, "a hinge is oblique", "hinges along one coordinate axis")
        return main

    def _body(self, body: Element, parent: str) -> None:
        drawing = self.found
        name = body.get("name") or f"body_{len(self.frames)}"
        at = f"{self.where}, body {name}"
        if name in self.frames:
            raise wrong(at, "there are two bodies of this name")
        o, angle = self.frames[parent]
        place = self.plane.place(_numbers(body.get("pos"), at, 3, "0 0 0"))
        o += place * cmath.rect(1.0, angle)
        angle += self.plane.turn(body, at)
        self.frames[name] = o, angle
        joints = body.findall("joint")
        if body.find("freejoint") is not None:
            raise wrong(at, "it moves freely in space", "hinges and slides in one plane")
        self.links[name] = self.links[parent]
        for k, joint in enumerate(joints, 1):  # each hangs on what the one before it moves
            last = k == len(joints)
            link = name if last else free_name(f"{name}_{k}", self.links)
            drawing.links[link] = []
            self._joint(joint, link, self.links[name], o, angle, at)
            self.links[name] = link
        if joints:
            self._inertial(body, name, at)
        elif self.links[name] != FRAME and body.find("inertial") is not None:
            drawing.note(f"mass of {name}, which is fixed to {parent}: left out")
        for inner in body.findall("body"):
            self._body(inner, name)

    def _point(self, name: str, z: complex, links: tuple[str, str]) -> str:
        name = free_name(name, self.found.points)
        self.found.points[name] = z
        for link in links:
            if link == FRAME:
                self.found.fixed.add(name)
            else:
                self.found.links[link].append(name)
        return name

    def _at(self, body: str, local: complex) -> complex:
        o, angle = self.frames[body]
        return o + local * cmath.rect(1.0, angle)

    def _joint(self, raw: Element, link: str, base: str, o: complex, angle: float, at: str) -> None:
        """A joint between two links, in a body that stands at a place with an angle."""
        key = raw.get("name") or f"joint_{link}"
        local = self.plane.place(_numbers(raw.get("pos"), at, 3, "0 0 0"))
        z = o + local * cmath.rect(1.0, angle)
        kind = raw.get("type", "hinge")
        for word in ("stiffness", "damping", "frictionloss", "armature", "range"):
            if any(x for x in (raw.get(word) or "").split() if float(x)):
                self.found.note(f"{word} of joint {key}: left out")
        if kind == "hinge":
            self._point(key, z, (base, link))
        elif kind == "slide":
            axis = self.plane.place(_numbers(raw.get("axis"), at, 3, "0 0 1"))
            if not axis:
                raise wrong(at, f"joint {key} slides out of the plane", "a planar model")
            self.joints[key] = len(self.found.guides)
            turned = cmath.phase(axis) + angle
            self.found.guides.append(Guide(base, link, z, turned, name=key))
        else:
            raise wrong(at, f"joint {key} is a {kind}", "hinge or slide")

    def _inertial(self, body: Element, name: str, at: str) -> None:
        raw = body.find("inertial")
        if raw is None:
            if body.find("geom") is not None:
                self.found.note(f"masses of the geoms of {name}: left out")
            return
        c = self._at(name, self.plane.place(_numbers(raw.get("pos"), at, 3, "0 0 0")))
        full = raw.get("fullinertia")
        parts = _numbers(full or raw.get("diaginertia"), at, 6 if full else 3)
        mass = number(raw.get("mass"), at)
        self.found.inertias[name] = Inertia(mass, parts[self.plane.normal], c)

    def _connect(self, raw: Element, name: str) -> None:
        at = f"{self.where}, {name}"
        one, two = raw.get("body1"), raw.get("body2") or "world"
        if one is None or unknown_of(self.frames, one, two):
            missing = listed(unknown_of(self.frames, str(one), two))
            raise wrong(at, f"no body {missing}", f"bodies: {listed(self.frames)}")
        z = self._at(one, self.plane.place(_numbers(raw.get("anchor"), at, 3)))
        self._point(raw.get("name") or name, z, (self.links[one], self.links[two]))

    def _actuator(self, raw: Element) -> None:
        key = raw.get("joint", "")
        if raw.tag not in ACTUATORS or not (key in self.found.points or key in self.joints):
            self.found.note(f"actuator {raw.get('name') or raw.tag}: left out")
        elif key in self.joints:
            i = self.joints[key]
            self.found.guides[i] = self.found.guides[i]._replace(drive=Drive(1.0, 0.0, None))
        else:
            self.found.drives[key] = Drive()


def unknown_of(known: dict[str, tuple[complex, float]], *names: str) -> list[str]:
    """The names that are not known."""
    return [name for name in names if name not in known]


READER = Reader(
    "MJCF: a planar model of MuJoCo",
    (".xml", ".mjcf"),
    lambda text: "<mujoco" in text[:2000],
    read,
)
