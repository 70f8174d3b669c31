"""Assemblies in space whose parts move in one plane, as files of bodies and joints have them.

Bodies have places and axes, joints a place and an axis between two of them. The plane is that
across all pins; its x and y are coordinate axes where it is one of theirs, upright ones with y = z.
Pins, and what turns about an axis across the plane, are pins of a drawing; what slides along an
axis in it is a guide; bodies that are fixed to each other are one link.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from blockmech.exchange.drawing import (
    FRAME,
    FREE,
    Drawing,
    Drive,
    Inertia,
    Pair,
    Ratio,
    Weld,
    scaled,
    together,
)
from blockmech.exchange.parsing import ROUNDED, Record, wrong
from blockmech.ground.names import numbered_name
from blockmech.ground.tolerances import BLUR
from blockmech.typing import Data, Floats


@dataclass(frozen=True)
class Pose:
    """A place [m] and the axes, as columns, of a body, a marker or a joint."""

    origin: Floats = field(default_factory=lambda: np.zeros(3))
    axes: Floats = field(default_factory=lambda: np.eye(3))

    def at(self, origin: Sequence[float] | Floats, axes: Floats | None = None) -> Pose:
        """That of something inside."""
        turned = self.axes if axes is None else self.axes @ axes
        return Pose(self.origin + self.axes @ np.asarray(origin), turned)


def orthonormal(axes: Floats, where: str) -> Floats:
    """The rotation next to a matrix. Raises `FormatError` where it is none up to rounding."""
    u, _, v = np.linalg.svd(axes)
    nearest: Floats = u @ v
    if abs(nearest - axes).max() > ROUNDED or np.linalg.det(nearest) < 0:
        raise wrong(where, "its columns are no axes", "a rotation")
    return nearest


def turned(axis: Sequence[float] | Floats, angle: float) -> Floats:
    """The rotation about an axis by an angle [rad]."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: Floats = (
        np.eye(3) + math.sin(angle) * across + (1 - math.cos(angle)) * across @ across
    )
    return rotation


def unit(axis: Sequence[float] | Floats, where: str) -> Floats:
    """A unit vector. Raises `FormatError` for one of no length."""
    size = float(np.linalg.norm(axis))
    if not size:
        raise wrong(where, "an axis of no length", "a direction")
    return np.asarray(axis) / size


def axes_along(axis: Floats) -> Floats:
    """Axes whose z is along a direction."""
    across = np.cross(np.array([0.0, 0.0, 1.0]), axis)
    size = float(np.linalg.norm(across))
    if size < 1e-12:
        return np.eye(3) if axis[2] > 0 else np.diag([1.0, -1.0, -1.0])
    return turned(across, math.atan2(size, float(axis[2])))


def roll_pitch_yaw(angles: Sequence[float]) -> Floats:
    """The rotation by angles [rad] about the fixed axes x, y and z in this order."""
    roll, pitch, yaw = angles
    return turned((0, 0, 1), yaw) @ turned((0, 1, 0), pitch) @ turned((1, 0, 0), roll)


def quaternion(numbers: Sequence[float], where: str) -> Floats:
    """The rotation of w, x, y, z. Raises `FormatError` where all are 0."""
    w, *v = numbers
    if not (w or any(v)):
        raise wrong(where, "a quaternion of nothing", "four numbers")
    return turned(v, 2 * math.atan2(float(np.linalg.norm(v)), w)) if any(v) else np.eye(3)


class Mass(NamedTuple):
    """Mass [kg], where its centre is [m], and the inertia [kg m2] about it in the world's axes."""

    mass: float
    centre: Floats
    inertia: Floats


class Joint(NamedTuple):
    """A joint of two bodies, its coordinate from the first to the second.

    kind : "pin", "slide", "cylinder" (either), "ball", "weld", "flat" (axis across a face),
        "slot" (the second's place in the face of the first), "line" (on its axis), "bar" (a
        distance between both), "rod" (a bar between pins)
    pose, second : of it on the first body and on the second; it is along their z axes
    zero : coordinate of the pose that is drawn, of what turns
    """

    name: str
    kind: str
    first: str
    second: str
    pose: Pose
    second_pose: Pose
    zero: float = 0.0
    law: Data | None = None
    limits: tuple[float, float] = FREE
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0


@dataclass
class Assembly:
    """Bodies and joints in space, and what couples them."""

    where: str
    drawing: Drawing
    masses: dict[str, list[Mass]] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    ratios: list[Ratio] = field(default_factory=list)
    gravity: Floats = field(default_factory=lambda: np.zeros(3))

    def join(self, joint: Joint) -> None:
        """Add a joint, under a name of its own."""
        self.joints[numbered_name(joint.name, self.joints)] = joint

    def change(self, joint: str, **fields: Any) -> None:
        """Replace some fields of a joint."""
        self.joints[joint] = self.joints[joint]._replace(**fields)

    def project(self, root: Record, looks: Iterable[str]) -> Drawing:
        """The drawing of it all in its plane, with notes of what was not read, but for looks.

        Raises `FormatError` for what leaves the plane.
        """
        drawing = self.drawing
        drawing.free = True
        for body, masses in self.masses.items():
            if body != FRAME:
                drawing.links.setdefault(body, [])
            if body != FRAME and masses:
                drawing.inertias[body] = together(map(self._flat_mass, masses))
        senses = {joint.name: self._joint(joint) for joint in list(self.joints.values())}
        for ratio in self.ratios:
            leading, driven = senses.get(ratio.leading, 1), senses.get(ratio.driven, 1)
            signed = tuple(driven * c * leading**k for k, c in enumerate(ratio.coefficients))
            drawing.ratios.append(ratio._replace(coefficients=signed))
        drawing.welds += [self._weld(j) for j in self.joints.values() if j.kind == "weld"]
        self._tidy()
        drawing.gravity = self.flat(self.gravity)
        for sentence in root.unread(looks):
            drawing.note(sentence)
        return drawing

    @cached_property
    def plane(self) -> tuple[Floats, Floats, Floats]:
        """Normal, x and y of the plane across the axis that most pins have, or along all slides."""
        kinds = ("pin", "cylinder", "flat", "rod", "slide")
        joints = self.joints.values()
        several = {k: [j.pose.axes[:, 2] for j in joints if j.kind == k] for k in kinds}
        kind, axes = next(((k, x) for k, x in several.items() if x), ("", []))
        if not axes:
            raise wrong(self.where, "it has no joint that turns or slides", "a planar mechanism")
        if kind == "slide":
            lines = [np.cross(axes[0], x) for x in (*axes[1:], *np.eye(3)[[1, 2]])]
            axes = [unit(x, self.where) for x in lines if np.linalg.norm(x) > BLUR]
            del axes[1:]
        first = max(axes, key=lambda axis: sum(abs(abs(axis @ x) - 1) < BLUR for x in axes))
        main = int(abs(first).argmax())
        sign = float(np.sign(first[main])) * (-1.0 if main == 1 else 1.0)
        exact = abs(first[main]) > 1 - BLUR  # so that exact places stay exact
        normal = sign * (np.eye(3)[main] * np.sign(first[main]) if exact else first)
        seed = np.eye(3)[1 if abs(normal[0]) > 0.9 else 0]
        x = unit(seed - normal * (seed @ normal), self.where)
        return normal, x, np.cross(normal, x)

    def flat(self, point: Floats) -> complex:
        """A place or direction in the plane."""
        _, x, y = self.plane
        return complex(point @ x, point @ y)

    def sense(self, pose: Pose, where: str) -> float:
        """1 where what turns about an axis does so counter-clockwise, else -1.

        Raises `FormatError` where the axis is not across the plane.
        """
        if not self._across(pose.axes[:, 2]):
            raise wrong(where, "its axis is not across the plane", "a planar mechanism")
        return math.copysign(1.0, pose.axes[:, 2] @ self.plane[0])

    def _flat_mass(self, mass: Mass) -> Inertia:
        inertia = float(self.plane[0] @ mass.inertia @ self.plane[0])
        return Inertia(mass.mass, inertia, self.flat(mass.centre))

    def _across(self, axis: Floats) -> bool:
        return bool(abs(abs(axis @ self.plane[0]) - 1) < BLUR)

    def _joint(self, joint: Joint) -> float:
        """Draw a joint; the sense in which its coordinate counts there."""
        drawing, axis = self.drawing, joint.pose.axes[:, 2]
        across, inside = self._across(axis), abs(axis @ self.plane[0]) < ROUNDED
        a, b = self.flat(joint.pose.origin), self.flat(joint.second_pose.origin)
        pair = Pair(joint.first, joint.second, a, None, None, b, joint.name)
        pair = pair._replace(stiffness=joint.stiffness, damping=joint.damping)
        kind, at = joint.kind, f"{self.where}, {joint.name}"
        crooked = kind == "pin" and not self._across(joint.second_pose.axes[:, 2])
        straight = {"pin": across, "rod": across, "slide": inside, "cylinder": across or inside}
        if crooked or not straight.get(kind, True):
            self._lean(joint, at)
            return 1.0
        if kind in ("pin", "ball") or (kind in ("cylinder", "line") and across):
            sense = math.copysign(1.0, axis @ self.plane[0]) if kind != "ball" else 1.0
            drawing.pairs.append(self._turning(pair, joint, sense))
            return sense
        if kind in ("slide", "cylinder") or (kind == "flat" and inside):
            direction = self.flat(axis) * (1j if kind == "flat" else 1)
            drive = None if joint.law is None else Drive(law=joint.law)
            guide = pair._replace(angle=cmath.phase(direction), drive=drive)
            drawing.pairs.append(guide._replace(limits=joint.limits, rest=joint.rest))
        elif kind in ("bar", "rod") or (kind in ("slot", "line") and inside):
            link, angle = f"{kind}_{joint.name}", None  # without mass
            if kind in ("slot", "line"):
                angle = cmath.phase(self.flat(axis) * (1j if kind == "slot" else 1))
            drawing.links[link] = []
            second = Pair(link, joint.second, b, name=joint.name)
            first = b if angle is not None else a
            drawing.pairs += [
                Pair(joint.first, link, a, angle, None, first, f"{joint.name}_"),
                second,
            ]
        elif kind not in ("weld", "flat", "slot"):
            raise wrong(at, f"it is a {kind} across no plane", "a planar mechanism")
        return 1.0

    def _weld(self, joint: Joint) -> Weld:
        """Two bodies at a joint of both, in whose axes they are one."""
        at, second_at = (self.flat(pose.origin) for pose in (joint.pose, joint.second_pose))
        turn = joint.second_pose.axes @ joint.pose.axes.T
        normal, x, y = self.plane
        if abs(normal @ turn @ normal - 1) > BLUR:
            raise wrong(
                f"{self.where}, {joint.name}", "it welds a part askew", "a planar mechanism"
            )
        angle = math.atan2(y @ turn @ x, x @ turn @ x)
        angle = 0.0 if abs(angle) < BLUR else angle
        return Weld(joint.name, joint.first, joint.second, at, second_at, angle)

    def _lean(self, joint: Joint, at: str) -> None:
        """Hold a body as it is drawn that moves out of the plane, where it bears no other.

        Raises `FormatError` where it does.
        """
        ends = [x for j in self.joints.values() for x in (j.first, j.second)]
        alone = next((x for x in (joint.second, joint.first) if ends.count(x) == 1), None)
        if alone in (None, FRAME):
            message = "its axis is not parallel to the others"
            slid = "it slides out of the plane"
            raise wrong(at, message if joint.kind == "pin" else slid, "a planar mechanism")
        self.drawing.note(f"{alone} moves out of the plane at {joint.name}: it is held as drawn")
        self.join(joint._replace(name=f"{joint.name}, held", kind="weld"))

    def _turning(self, pair: Pair, joint: Joint, sense: float) -> Pair:
        """A pin with what counts along its coordinate, from the drawn pose."""
        low, high = (sense * (x - joint.zero) for x in joint.limits)
        rest = sense * (joint.rest - joint.zero)
        drive = None
        if joint.law is not None:
            drive = Drive(law=_counted(joint.law, joint.zero, sense))
        return pair._replace(drive=drive, limits=(min(low, high), max(low, high)), rest=rest)

    def _tidy(self) -> None:
        """Leave out joints that two links have twice, and links that no joint holds."""
        drawing = self.drawing
        size = max((abs(p.at - drawing.pairs[0].at) for p in drawing.pairs), default=0.0)
        distinct: list[Pair] = []
        for pair in drawing.pairs:
            ends = {pair.first, pair.second}
            twin = next(
                (x for x in distinct if {x.first, x.second} == ends and _same(x, pair, size)), None
            )
            if twin is None:
                distinct.append(pair)
                continue
            kind = "pin" if pair.angle is None else "guide"
            between = f"{pair.first} and {pair.second}"
            drawing.note(f"{pair.name} is a second {kind} of {between} on one axis: left out")
            if pair.drive is not None and twin.drive is None:
                distinct[distinct.index(twin)] = twin._replace(drive=pair.drive)
        drawing.pairs = distinct
        joined = {FRAME, *(x for pair in distinct for x in (pair.first, pair.second))}
        welded = [{weld.first, weld.second} for weld in drawing.welds]
        while carried := {x for ends in welded if ends & joined for x in ends} - joined:
            joined |= carried
        drawing.welds = [weld for weld in drawing.welds if weld.first in joined]
        for name in [x for x in drawing.links if x not in joined]:
            drawing.note(f"no joint holds {name}: left out")
            for point in drawing.links.pop(name):
                del drawing.points[point]


def _same(first: Pair, second: Pair, size: float) -> bool:
    if first.angle is None or second.angle is None:
        return first.angle is second.angle and abs(first.at - second.at) <= BLUR * size
    return abs(math.sin(first.angle - second.angle)) < BLUR


def _counted(law: Data, zero: float, sense: float) -> Data:
    """A law of motion less the coordinate of the drawn pose, counted in a sense.

    Turns are taken off so that it begins near the drawn pose.
    """
    if not law:
        return {}
    starts = {"harmonic": "mean", "trajectory": "values"}
    key = starts.get(law["law"], "from")
    start = law[key][0] if key == "values" else law[key]
    zero += math.tau * round((start - zero) / math.tau)
    moved: Data = {x: law[x] for x in ("from", "to", "mean", "values") if x in law}
    less = {k: [x - zero for x in v] if k == "values" else v - zero for k, v in moved.items()}
    return scaled({**law, **less}, sense)
