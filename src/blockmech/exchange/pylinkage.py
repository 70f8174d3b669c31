"""pylinkage: its JSON of joints and links, and its live objects.

Rates of cranks are radians a step there; here a step is a second. Files of the topology alone
(``hypergraph``, ``assur``) have no lengths.

Source: pylinkage 1.3, ``mechanism/serialization.py``, ``simulation``, ``dyads``, ``actuators``.
"""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from typing import Any

from blockmech.couplings.laws import POLYNOMIALS
from blockmech.exchange.drawing import FRAME, Cam, Drawing, Drive, Pair, Slot, direction
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import Record, json_of, number, record_of_json, wrong
from blockmech.ground.errors import listed
from blockmech.ground.names import free_name
from blockmech.typing import Data

STEP = "rates of pylinkage are radians a step: a step was taken as a second"
LOOKS = {"name", "version", "ground", "distance", "angle", "radius", "length", "line_point"}
LOOKS |= {"initial_angle", "ref_joint1_id", "ref_joint2_id", "color", "order", "slide_distance"}
DRIVEN = ("Crank", "ArcCrank", "LinearActuator")
RIGID = ("FixedDyad", "PointTracker")
DYADS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "RRRDyad": (("anchor1", "anchor2"), ()),
    "RRPDyad": (("revolute_anchor",), ("line",)),
    "PPDyad": ((), ("line1", "line2")),
}
"""Dyad of components -> its anchors at the ends of bars, and the lines on which it slides."""
CAMS = ("TranslatingCamFollower", "OscillatingCamFollower")
MOTIONS = {"HarmonicMotionLaw": "harmonic", "CycloidalMotionLaw": "cycloidal"}
RISES = {powers: motion for motion, powers in POLYNOMIALS.items() if len(powers) > 2}
"""Rises of a cam by the name of their law, and in couplings' laws."""
LEGACY = {"Static", "Crank", "Revolute", "Fixed", "Prismatic"}


def read(text: str, where: str) -> Drawing:
    """The drawing of a file."""
    return of_data(json_of(text, where), where)


def of_data(data: object, where: str) -> Drawing:
    """The drawing of joints and links, as ``mechanism_to_dict`` gives them."""
    root = record_of_json(data, "linkage", where)
    if root.all("nodes", "instances"):
        message = "a hypergraph says who joins whom, but no lengths"
        raise wrong(where, message, "a file of mechanism_to_json", "save the mechanism itself")
    drawing = Drawing(root.get("name") or "linkage", source="pylinkage file")
    trackers: list[Record] = []
    for joint in root.all("joints"):
        key, kind = joint.get("id"), joint.get("type", "revolute")
        if kind in LEGACY:
            raise wrong(
                joint.where, f'"{kind}" is of the old format', "a file of mechanism_to_json"
            )
        if key in drawing.points:
            raise wrong(joint.where, f'there are two joints "{key}"')
        drawing.points[key] = _point(joint, "position")
        if kind == "ground":
            drawing.fixed.add(key)
        elif kind == "prismatic":
            axis = _point(joint, "axis") if joint.all("axis") else 1 + 0j
            drawing.slots[key] = [Slot(direction(0j, axis, joint.where))]
        elif kind == "tracker":
            trackers.append(joint)
    for link in root.all("links"):
        _link(link, drawing)
    for tracker in trackers:
        anchors = [tracker.get(f"ref_joint{k}_id") for k in (1, 2)]
        _rigid(drawing, tracker.get("id"), anchors, where)
    drawing.notes += root.unread(LOOKS)
    return drawing


def _point(record: Record, key: str) -> complex:
    """A place of two numbers."""
    numbers = [number(part.text, f"{record.where}, {key}") for part in record.all(key)]
    if len(numbers) != 2:
        raise wrong(record.where, f"{key} has {len(numbers)} numbers", "[x, y]")
    return complex(*numbers)


def _link(record: Record, drawing: Drawing) -> None:
    where, points = record.where, [part.text for part in record.all("joints")]
    if unknown := [p for p in points if p not in drawing.points]:
        raise wrong(where, f"no joint {listed(unknown)}", f"joints: {listed(drawing.points)}")
    kind, name = record.get("type", "link"), record.get("id")
    if name in drawing.links:
        raise wrong(where, f'there are two links "{name}"')
    if kind == "ground":
        drawing.fixed.update(points)
        return
    if kind in ("driver", "arc_driver"):
        motor = record.get("motor_joint") or next((p for p in points if p in drawing.fixed), "")
        if motor not in drawing.points:
            raise wrong(where, "the driver has no motor joint on the ground")
        drawing.fixed.add(motor)
        rate = record.number("angular_velocity", math.tau / 360)
        start, stop = 0.0, math.tau
        if kind == "arc_driver":
            at = record.number("initial_angle", 0.0)
            start, stop = (record.number(key, 0.0) - at for key in ("arc_start", "arc_end"))
            start, stop = (-start, -stop) if rate < 0 else (start, stop)
        drawing.drives[motor] = Drive(rate, start, stop, name)
        drawing.note(STEP)
    drawing.links[name] = points


def _rigid(drawing: Drawing, point: str, anchors: list[str], where: str) -> None:
    """A point at a fixed distance and angle of two others: on their link, if they have one."""
    on = drawing.link_of(anchors)
    if on is None:
        message = f"{point} is fixed to {listed(anchors)}, which move against each other"
        raise wrong(where, message, "two points of one link", "leave it out")
    if on == FRAME:
        drawing.fixed.add(point)
    else:
        drawing.links[on].append(point)


# -- live objects -------------------------------------------------------------------


def is_live(subject: object) -> bool:
    """Whether it is a linkage or mechanism of pylinkage."""
    return type(subject).__module__.partition(".")[0] == "pylinkage"


def of_object(subject: Any) -> Drawing:
    """The drawing of a live linkage or mechanism, in the position in which it stands."""
    where = f"pylinkage {type(subject).__name__}"
    if hasattr(subject, "components"):
        return _Components(subject, where).drawing
    if hasattr(subject, "joints") and hasattr(subject, "links"):
        from pylinkage.mechanism.serialization import mechanism_to_dict

        return of_data(mechanism_to_dict(subject), where)
    raise wrong(where, "it has no positions", "a Linkage of components, or a Mechanism")


class _Components:
    """The drawing of ``simulation.Linkage``: grounds, actuators and dyads."""

    def __init__(self, linkage: Any, where: str) -> None:
        self.where = where
        self.drawing = Drawing(str(linkage.name), source="pylinkage object")
        self.names: dict[int, str] = {}
        for i, part in enumerate(linkage.components):
            kind = type(part).__name__
            name = str(part.name) if not str(part.name).isdigit() else f"{kind}_{i}"
            name = free_name(name, self.drawing.points)
            self.names[id(part)] = name
            if kind not in ("Ground", *DRIVEN, *RIGID, *DYADS, *CAMS):
                self.drawing.note(f"{name} is a {kind}: left out")
                continue
            if part.x is None or part.y is None:
                raise wrong(where, f"{name} has no position yet", "", "run one step of it first")
            coordinates = (number(v, f"{where}, {name}") for v in (part.x, part.y))
            self.drawing.points[name] = complex(*coordinates)
            self._part(part, kind, name)

    def _of(self, anchor: Any) -> str:
        part = getattr(anchor, "_parent", anchor)
        if id(part) not in self.names:
            raise wrong(self.where, "a part hangs on one that stands behind it, or in a circle")
        return self.names[id(part)]

    def _bar(self, *points: str) -> None:
        if self.drawing.link_of(points) in (None, FRAME):
            self.drawing.links["_".join(points)] = list(points)

    def _part(self, part: Any, kind: str, name: str) -> None:
        if kind == "Ground":
            self.drawing.fixed.add(name)
        elif kind == "LinearActuator":
            self._actuator(part, name)
        elif kind in DRIVEN:
            self._crank(part, name)
        elif kind in CAMS:
            self._cam(part, name)
        elif kind in RIGID:
            _rigid(self.drawing, name, [self._of(part.anchor1), self._of(part.anchor2)], self.where)
        else:
            bars, lines = DYADS[kind]
            for anchor in bars:
                self._bar(self._of(getattr(part, anchor)), name)
            for line in lines:
                self._line([self._of(getattr(part, f"{line}_anchor{k}")) for k in (1, 2)], name)

    def _crank(self, part: Any, name: str) -> None:
        anchor = self._of(part.anchor)
        self._bar(anchor, name)
        rate = number(part.angular_velocity, name)
        start, stop = 0.0, math.tau
        if hasattr(part, "arc_start"):
            at = cmath.phase(self.drawing.points[name] - self.drawing.points[anchor])
            start, stop = part.arc_start - at, part.arc_end - at
            start, stop = (-start, -stop) if rate < 0 else (start, stop)
        self.drawing.drives[anchor] = Drive(rate, start, stop, f"{anchor}_{name}")
        self.drawing.note(STEP)

    def _actuator(self, part: Any, name: str) -> None:
        anchor = self._of(part.anchor)
        if anchor not in self.drawing.fixed:
            raise wrong(self.where, f"{name} is an actuator on a moving point", "one on the ground")
        at = self.drawing.points[anchor]
        slider = f"{name}_slider"
        self.drawing.links[slider] = [name]
        drive = Drive(number(part.speed, name), 0.0, number(part.stroke, name))
        angle = number(part.angle, name)
        self.drawing.pairs.append(Pair(FRAME, slider, at, angle, drive, self.drawing.points[name]))

    def _cam(self, part: Any, name: str) -> None:
        """A follower that slides from a point of the frame, or swings about one."""
        drawing, profile = self.drawing, part.profile
        crank, centre = self._of(part.cam_driver), self._of(part.cam_driver.anchor)
        follower, at = f"{name}_follower", drawing.points[name]
        slides = hasattr(part, "guide")
        pivot = self._of(part.guide if slides else part.pivot_anchor)
        base, roller = drawing.points[pivot], float(part.roller_radius)
        start = cmath.phase(drawing.points[crank] - drawing.points[centre])
        if slides:  # the coordinate counts from the guide's point
            drawing.links[follower], phase = [name], roller + profile.base_radius
            guide = Pair(FRAME, follower, base, part.guide_angle, None, at, follower)
            drawing.pairs.append(guide)
        else:
            drawing.links[follower] = [pivot, name]
            phase = math.remainder(part.initial_angle - cmath.phase(at - base), math.tau)
        law = _law_of_profile(profile, start, f"{self.where}, {name}")
        link = next(x for x, points in drawing.links.items() if {centre, crank} <= {*points})
        drawing.cams.append(Cam(f"cam_{name}", link, follower, law, at, slides, roller, phase))

    def _line(self, ends: list[str], name: str) -> None:
        on = self.drawing.link_of(ends)
        if on is None:
            on = "_".join(ends)
            raise wrong(self.where, f"{name} slides between {on}, points of two links")
        angle = direction(self.drawing.points[ends[0]], self.drawing.points[ends[1]], self.where)
        self.drawing.slots.setdefault(name, []).append(Slot(angle, on))


def _law_of_profile(profile: Any, start: float, where: str) -> Data:
    """What a cam's radius is above its smallest, over its angle from ``start``.

    Raises `FormatError` for a profile that no law of a cam is.
    """
    rise = getattr(profile, "motion_law", None)
    powers = tuple(getattr(rise, "coefficients", ()))
    if motion := RISES.get(powers) or MOTIONS.get(type(rise).__name__):
        edges = profile.rise_start, profile.rise_end, profile.dwell_high_end, profile.fall_end
        rises = zip(pairwise(edges), (profile.total_lift, 0.0, -profile.total_lift), strict=True)
        segments = [
            {"motion": motion if lift else "dwell", "over": end - begin, "rise": lift}
            for (begin, end), lift in rises
            if end > begin
        ]
        return {"kind": "segments", "segments": segments, "start": edges[0] - start}
    knots = [float(x) for x in getattr(profile, "angles", (0.0,))]
    if not math.isclose(knots[-1] - knots[0], math.tau):
        valid = "harmonic, cycloidal, 3-4-5 or 4-5-6-7 rises, or points of a whole turn"
        raise wrong(where, f"its profile is a {type(rise or profile).__name__}", valid)
    heights = [float(radius) - profile.base_radius for radius in profile.radii[:-1]]
    table = {"kind": "table", "arguments": [x - start for x in knots[:-1]], "values": heights}
    return {**table, "period": math.tau}


def recognises(text: str) -> bool:
    """JSON with joints that have positions, or nodes of a hypergraph."""
    head = text.lstrip()[:1] == "{"
    return head and (('"joints"' in text and '"position"' in text) or '"joint_type"' in text)


READER = Reader("pylinkage: joints and links as JSON", (".json",), recognises, read)
