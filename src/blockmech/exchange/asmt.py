"""FreeCAD and Ondsel: assemblies ``.asmt`` whose parts move in one plane.

A text whose levels are tabs. Markers of the assembly are the frame's, a joint is between two
markers and along their z axis: revolute, cylindrical across the plane and spherical joints are
pins, translational joints and cylindrical ones in the plane are guides. Parts that are fixed to
each other are one link. The plane is that across all pins; where it stands upright, y is z.

Source: OndselSolver, ``ASMTAssembly.cpp`` (reading) and its test assemblies.
"""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.exchange.drawn_linkage import FRAME, Drawing, Drive, Guide, Inertia
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import DEEPEST, MOST, number, wrong

Array = NDArray[np.float64]
PINS = ("RevoluteJoint", "SphericalJoint")
FLAT = 1e-6  # [-] what an axis may lean
PLANAR = ("PlanarJoint", "ParallelAxesJoint")  # of parts that move in the plane anyhow


@dataclass
class Item:
    """A line, and the lines below it."""

    name: str
    line: int
    inner: list[Item] = field(default_factory=list)

    def all(self, name: str) -> list[Item]:
        """The lines of a name directly below."""
        return [item for item in self.inner if item.name == name]

    def below(self, name: str) -> list[Item]:
        """What is below the line of a name; nothing without it."""
        return [inner for item in self.all(name) for inner in item.inner]

    def text(self, name: str) -> str:
        """The line below the line of a name; "" without it."""
        return next((item.name for item in self.below(name)), "")


def _items(text: str, where: str) -> Item:
    root = Item("", 0)
    stack = [root]
    for k, raw in enumerate(text.split("TimeSeries")[0].splitlines(), 1):
        if not raw.strip():
            continue
        if k > MOST:
            raise wrong(where, f"more than {MOST} lines", "a smaller assembly")
        depth = len(raw) - len(raw.lstrip("\t"))
        if depth >= DEEPEST:
            raise wrong(f"{where}, line {k}", "levels too deep in each other")
        if depth >= len(stack):
            raise wrong(f"{where}, line {k}", "it is deeper than a level below the last", "tabs")
        del stack[depth + 1 :]
        item = Item(raw.strip(), k)
        stack[-1].inner.append(item)
        stack.append(item)
    return root


def _rows(item: Item, name: str, shape: tuple[int, ...], where: str) -> Array:
    rows = [row.name.split() for row in item.below(name)]
    numbers = [number(x, f"{where}, {name}") for row in rows for x in row]
    if len(numbers) != math.prod(shape):
        raise wrong(f"{where}, {name}", f"{len(numbers)} numbers", f"{math.prod(shape)} numbers")
    return np.array(numbers).reshape(shape)


@dataclass(frozen=True)
class Frame:
    """A place [m] and the axes, as columns, of a part, a point of it or a marker."""

    place: Array
    axes: Array

    def at(self, item: Item, where: str) -> Frame:
        """That of an item inside."""
        place, axes = (
            _rows(item, "Position3D", (3,), where),
            _rows(item, "RotationMatrix", (3, 3), where),
        )
        if abs(axes @ axes.T - np.eye(3)).max() > FLAT:
            raise wrong(f"{where}, RotationMatrix", "its columns are no axes", "a rotation")
        return Frame(self.place + self.axes @ place, self.axes @ axes)


WORLD = Frame(np.zeros(3), np.eye(3))


def read(text: str, where: str) -> Drawing:
    """The drawing of an assembly as it is saved."""
    assembly = next(iter(_items(text, where).all("Assembly")), None)
    if assembly is None:
        raise wrong(where, "it has no Assembly", "an assembly of FreeCAD or OndselSolver")
    return _Reading(assembly, where).found


class _Reading:
    def __init__(self, assembly: Item, where: str) -> None:
        self.where = where
        name = assembly.text("Name")
        self.found = drawing = Drawing(name or "assembly", source="FreeCAD assembly")
        self.markers: dict[str, tuple[str, Frame]] = {}  # path -> link, where it is
        self.links: dict[str, str] = {}  # part -> link that it belongs to
        self.joints: dict[str, tuple[str, str, float]] = {}  # driven link, other, sense
        self._markers(assembly, f"/{name}", FRAME, WORLD)
        parts = [(p.text("Name"), p) for p in assembly.below("Parts") if p.name == "Part"]
        frames = {}
        for part, item in parts:
            if not part or part in self.links or part == FRAME:
                raise wrong(f"{where}, line {item.line}", f'a part is named "{part}"', "own names")
            frames[part] = WORLD.at(item, f"{where}, {part}")
            self.links[part] = part
            self._markers(item, f"/{name}/{part}", part, frames[part])
        joints = [j for c in assembly.all("ConstraintSets") for j in c.below("Joints")]
        self.normal = self._normal(joints)
        self.x, self.y = self._plane()
        for joint in joints:
            if joint.name == "FixedJoint":
                self._fix(*(link for link, _ in self._ends(joint)))
        for part in self.links:
            if self._link(part) != FRAME:
                drawing.links.setdefault(self._link(part), [])
        for joint in joints:
            self._joint(joint)
        self._masses(parts, frames)
        for motion in (m for c in assembly.all("ConstraintSets") for m in c.below("Motions")):
            self._motion(motion)
        for kind in (x for c in assembly.all("ConstraintSets") for x in c.inner):
            if kind.name not in ("Joints", "Motions") and kind.inner:
                drawing.note(f"{kind.name}: left out")
        for force in assembly.below("ForceTorques"):
            drawing.note(f"{force.name} {force.text('Name')}: left out".replace(" :", ":"))
        if assembly.all("ConstantGravity"):
            g = _rows(assembly, "ConstantGravity", (3,), where)
            drawing.gravity = complex(g @ self.x, g @ self.y)

    def _markers(self, owner: Item, path: str, link: str, base: Frame) -> None:
        for point in owner.below("RefPoints"):
            here = base.at(point, f"{self.where}, {path}")
            for marker in point.below("Markers"):
                name = f"{path}/{marker.text('Name')}"
                self.markers[name] = link, here.at(marker, f"{self.where}, {name}")

    def _link(self, part: str) -> str:
        while (other := self.links.get(part, part)) != part:
            part = other
        return part

    def _fix(self, one: str, two: str) -> None:
        one, two = self._link(one), self._link(two)
        if one != two:
            keep, gone = (two, one) if two == FRAME else (one, two)
            self.links[gone] = keep

    def _ends(self, joint: Item) -> list[tuple[str, Frame]]:
        names = [joint.text("MarkerI"), joint.text("MarkerJ")]
        for name in names:
            if name not in self.markers:
                at = f"{self.where}, {joint.text('Name') or joint.name}"
                raise wrong(at, f'no marker "{name}"', "markers of the assembly and its parts")
        return [self.markers[name] for name in names]

    def _normal(self, joints: list[Item]) -> Array:
        """The direction that all pins have."""
        axes = [(j, self._ends(j)[0][1].axes[:, 2]) for j in joints if j.name == "RevoluteJoint"]
        if not axes:
            raise wrong(self.where, "it has no revolute joint", "a planar mechanism with pins")
        first = axes[0][1]
        for joint, axis in axes:
            if abs(abs(axis @ first) - 1) > FLAT:
                at = f"{self.where}, {joint.text('Name')}"
                raise wrong(at, "its axis is not parallel to the others", "a planar mechanism")
        main = int(abs(first).argmax())
        upright = -1.0 if main == 1 else 1.0
        return np.multiply(first, upright * float(np.sign(first[main])))

    def _plane(self) -> tuple[Array, Array]:
        seed = np.eye(3)[1 if abs(self.normal[0]) > 0.9 else 0]
        x = seed - self.normal * (seed @ self.normal)
        x /= np.linalg.norm(x)
        return x, np.cross(self.normal, x)

    def _flat(self, place: Array) -> complex:
        return complex(place @ self.x, place @ self.y)

    def _joint(self, joint: Item) -> None:
        drawing, key = self.found, joint.text("Name") or f"joint_{joint.line}"
        (one, here), (two, there) = self._ends(joint)
        one, two, axis = self._link(one), self._link(two), here.axes[:, 2]
        if joint.name == "FixedJoint" or joint.name in PLANAR or one == two:
            return
        across = abs(abs(axis @ self.normal) - 1) < FLAT
        a, b = self._flat(here.place), self._flat(there.place)
        first, second = (two, one) if two == FRAME else (one, two)
        turned = -1.0 if two == FRAME else 1.0
        if joint.name in PINS or (joint.name == "CylindricalJoint" and across):
            self.joints[key] = key, second, turned * float(np.sign(axis @ self.normal))
            self._pin(key, a, first, second)
        elif joint.name in ("TranslationalJoint", "CylindricalJoint"):
            if abs(axis @ self.normal) > FLAT:
                raise wrong(f"{self.where}, {key}", "it slides out of the plane", "in the plane")
            a, b = (b, a) if two == FRAME else (a, b)
            self.joints[key] = str(len(drawing.guides)), second, turned
            drawing.guides.append(Guide(first, second, a, cmath.phase(self._flat(axis)), None, b))
        else:
            drawing.note(f"{joint.name} {key}: left out")

    def _pin(self, key: str, z: complex, first: str, second: str) -> None:
        drawing = self.found
        size = max((abs(p - z) for p in drawing.points.values()), default=0.0)
        for point, other in drawing.points.items():
            pair = {x for x in (first, second) if x != FRAME}
            held = {n for n, own in drawing.links.items() if point in own}
            if abs(z - other) <= FLAT * size and held == pair:
                drawing.note(f"{key} is a second pin of {first} and {second} on one axis: left out")
                return
        drawing.points[key] = z
        for link in (first, second):
            if link == FRAME:
                drawing.fixed.add(key)
            else:
                drawing.links[link].append(key)

    def _masses(self, parts: list[tuple[str, Item]], frames: dict[str, Frame]) -> None:
        bodies: dict[str, list[tuple[float, float, complex]]] = {}
        for part, item in parts:
            link, at = self._link(part), f"{self.where}, {part}"
            for own in item.all("PrincipalMassMarker"):
                if link == FRAME or not own.text("Mass"):
                    continue
                frame = frames[part].at(own, at)
                moments = _rows(own, "MomentOfInertias", (3,), at)
                inertia = float(moments @ (frame.axes.T @ self.normal) ** 2)
                mass = number(own.text("Mass"), f"{at}, Mass")
                bodies.setdefault(link, []).append((mass, inertia, self._flat(frame.place)))
        for link, several in bodies.items():
            mass = sum(m for m, _, _ in several)
            if mass > 0:
                cm = sum(m * c for m, _, c in several) / mass
                inertia = sum(i + m * abs(c - cm) ** 2 for m, i, c in several)
                self.found.inertias[link] = Inertia(mass, inertia, cm)

    def _motion(self, motion: Item) -> None:
        drawing, key = self.found, motion.text("MotionJoint").rpartition("/")[2]
        formula = motion.text("RotationZ") or motion.text("TranslationZ")
        if motion.name not in ("RotationalMotion", "TranslationalMotion"):
            drawing.note(f"{motion.name} {motion.text('Name')}: left out")
            return
        if key not in self.joints:
            drawing.note(f"{motion.text('Name')} moves {key}, which is no joint here: left out")
            return
        place, link, sense = self.joints[key]
        rate = _rate(formula)
        if rate is None:
            drawing.note(f"{motion.text('Name')}: {formula} is no constant rate: 1 was taken")
        drive = Drive(sense * (rate or 1.0), link=link)
        if place in drawing.points:
            drawing.drives[place] = drive
        else:
            guide = drawing.guides[int(place)]
            drawing.guides[int(place)] = guide._replace(drive=drive._replace(stop=None))


def _rate(formula: str) -> float | None:
    """The constant rate of a formula such as ``2.0d*pi*time``; None for any other."""
    rate, times = 1.0, 0
    for word in formula.replace(" ", "").split("*"):
        if word == "time":
            times += 1
        elif word in ("pi", "-pi"):
            rate *= math.pi if word == "pi" else -math.pi
        elif re.fullmatch(r"-?\d+(\.\d*)?(e-?\d+)?d?", word):
            rate *= float(word.removesuffix("d"))
        else:
            return None
    return rate if times == 1 and rate else None


def _recognises(text: str) -> bool:
    head: Any = text[:500]
    return bool(re.search(r"^Assembly\s*$", head, re.MULTILINE)) or head.startswith("OndselSolver")


READER = Reader("FreeCAD, Ondsel: a planar assembly", (".asmt",), _recognises, read)
