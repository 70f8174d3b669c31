"""A drawing of a linkage: what the files of other tools have in common, and its document.

Those tools say: points with places, links as lists of points, points that are fixed, points that
slide on a line, points that are driven. What follows from that is mechanics, and stands here once:

* every link's frame is the drawing's, so the drawn place of a point is its place on each link and
  the drawing fixes the assembly mode;
* a point where m links meet is m - 1 joints with the first of them, a fixed one joins the frame;
* a point that slides is a pin in a slot: a slider without mass between the slot's link and the
  links at the point; a link that is a slider itself stands in its place;
* a link with two fixed points is part of the frame, and so are its other points;
* a point of one link alone is a marker.

What cannot be taken is a note that names it.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

from blockmech.errors import FormatError, Problem, listed
from blockmech.values import free_name, numbered_name

FRAME = "frame"
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
TURN = (0.0, math.tau)
MOST_TEETH = 1000  # of a wheel whose size is a ratio
ROUNDING = 1e-12  # of a ratio that teeth give
ON_LINE = 1e-3  # of the distance of two centres: how far from their line a pitch point is drawn


class Slot(NamedTuple):
    """A line [rad] of the drawing on which a point slides, and the link that has it."""

    angle: float
    on: str = FRAME


class Drive(NamedTuple):
    """What drives a point: a rate [rad/s or m/s], an interval, and the link that it turns."""

    rate: float = 1.0
    start: float = TURN[0]
    stop: float | None = TURN[1]
    link: str = ""


class Inertia(NamedTuple):
    """Mass [kg], inertia [kg m2] about the centre of mass, and where that is drawn."""

    mass: float
    inertia: float
    cm: complex


class Guide(NamedTuple):
    """Two links that slide along each other without turning, at a point along an angle [rad]."""

    first: str
    second: str
    at: complex
    angle: float
    drive: Drive | None = None
    second_at: complex | None = None
    name: str = ""  # of its joint, by default both links


class Wheels(NamedTuple):
    """Two links that turn as gear wheels or by a chain, with their sizes: teeth or radii.

    Of gears that are drawn by their pitch point alone, sizes follow from the centres.
    """

    name: str
    first: str
    second: str
    sizes: tuple[float, float] = (1.0, 1.0)
    chain: bool = False
    pitch: complex | None = None


class Load(NamedTuple):
    """A force [N] at a place of a link."""

    name: str
    link: str
    at: complex
    force: complex
    turns: bool  # with the link


@dataclass
class Drawing:
    """A linkage as it is drawn, lengths in ``unit``."""

    name: str = ""
    unit: str = ""
    source: str = ""
    points: dict[str, complex] = field(default_factory=dict)
    links: dict[str, list[str]] = field(default_factory=dict)
    fixed: set[str] = field(default_factory=set)
    slots: dict[str, list[Slot]] = field(default_factory=dict)
    sliders: set[str] = field(default_factory=set)  # links that are sliders themselves
    guides: list[Guide] = field(default_factory=list)
    wheels: list[Wheels] = field(default_factory=list)
    drives: dict[str, Drive] = field(default_factory=dict)
    inertias: dict[str, Inertia] = field(default_factory=dict)
    loads: list[Load] = field(default_factory=list)
    gravity: complex = 0j  # [m/s2]
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Say what was not taken, or how something was read."""
        if text not in self.notes:
            self.notes.append(text)

    def link_of(self, points: Iterable[str]) -> str | None:
        """The first link with all these points; the frame if all are fixed."""
        wanted = set(points)
        if wanted <= self.fixed:
            return FRAME
        return next((n for n, own in self.links.items() if wanted <= set(own)), None)


def document(drawing: Drawing, unit: str | None = None) -> dict[str, Any]:
    """The joint-based document of a drawing, in SI units.

    ``unit`` is that of a file that has none. Raises `FormatError` for a drawing without links.
    """
    return _Making(drawing, unit).document()


class _Making:
    def __init__(self, drawing: Drawing, unit: str | None) -> None:
        self.drawing = drawing
        self.scale = self._unit(unit)
        self.taken: dict[str, set[str]] = {"joints": set(), "links": {FRAME}}
        self.links: dict[str, dict[str, Any]] = {}
        self.joints: dict[str, dict[str, Any]] = {}
        self.drivers: dict[str, dict[str, Any]] = {}
        self.couplings: dict[str, dict[str, Any]] = {}
        self.names: dict[str, str] = {FRAME: FRAME}

    def _unit(self, unit: str | None) -> float:
        drawing = self.drawing
        if drawing.unit:
            if unit is not None and UNITS[unit] != UNITS[drawing.unit]:
                drawing.note(f"the file is in {drawing.unit}: the unit {unit} was not used")
            return UNITS[drawing.unit]
        if unit is None:
            drawing.note("the file names no unit: lengths were taken as m; --unit says another")
        else:
            drawing.note(f"the file names no unit: lengths were taken as {unit}")
        return UNITS[unit or "m"]

    def document(self) -> dict[str, Any]:
        """See `document`."""
        drawing = self.drawing
        self._absorb()
        for name in drawing.links:
            self.names[name] = self._free("links", name)
            self.links[self.names[name]] = self._link(name)
        for point in drawing.points:
            self._point(point)
        for guide in drawing.guides:
            self._guide(guide)
        self._couple()
        self._markers()
        if not self.joints:
            what = "it has no links that a joint joins"
            raise FormatError(Problem("bad-drawing", drawing.name, what, "", "draw the linkage"))
        if not self.drivers:
            drawing.note("nothing is driven: add a driver")
        made: dict[str, Any] = {
            "format": "blockmech/joints",
            "version": 1,
            "name": _clean(drawing.name) or "mechanism",
            "gravity": [drawing.gravity.real, drawing.gravity.imag],
            "links": self.links,
            "joints": self.joints,
            "drivers": self.drivers,
            "couplings": self.couplings,
            "loads": self._loads(),
            "source": drawing.source,
            "notes": list(drawing.notes),
        }
        if not drawing.gravity:
            del made["gravity"]
        return {key: value for key, value in made.items() if value or key == "links"}

    def _absorb(self) -> None:
        """Links with two fixed points become part of the frame, and their points fixed."""
        drawing = self.drawing
        again = True
        while again:
            again = False
            for name, points in list(drawing.links.items()):
                held = [p for p in dict.fromkeys(points) if self._is_fixed(p)]
                if name in drawing.sliders or len(held) < 2:
                    continue
                again = True
                del drawing.links[name]
                drawing.fixed.update(points)
                drawing.note(f"link {name} joins fixed points: it is part of the frame")
                for point, slots in drawing.slots.items():
                    on = [slot._replace(on=FRAME) if slot.on == name else slot for slot in slots]
                    drawing.slots[point] = on

    def _is_fixed(self, point: str) -> bool:
        return point in self.drawing.fixed and point not in self.drawing.slots

    def _link(self, name: str) -> dict[str, Any]:
        link: dict[str, Any] = {"pose": [0.0, 0.0, 0.0]}
        if (own := self.drawing.inertias.get(name)) is not None and own.mass:
            link |= {"mass": own.mass, "inertia": own.inertia, "cm": self._place(own.cm)}
        return link

    def _place(self, z: complex) -> list[float]:
        return [z.real * self.scale, z.imag * self.scale]

    def _free(self, what: str, text: str) -> str:
        name = numbered_name(_clean(text) or what[:-1], self.taken[what])
        self.taken[what].add(name)
        return name

    def _members(self, point: str) -> list[str]:
        return [name for name, own in self.drawing.links.items() if point in own]

    def _point(self, point: str) -> None:
        drawing, members = self.drawing, self._members(point)
        drive = drawing.drives.get(point)
        if point in drawing.slots:
            self._slotted(point, members, drive)
            return
        turning = {x for pair in drawing.wheels for x in (pair.first, pair.second)}
        members = sorted(members, key=lambda name: name in turning)  # a wheel turns on the others
        ends = [FRAME, *members] if point in drawing.fixed else members
        if drive is not None:
            if len(ends) < 2:
                drawing.note(f"point {point} is driven, but joins no two links: its drive was left")
                drive = None
            elif drive.link in ends[1:]:
                ends = [ends[0], drive.link, *(x for x in ends[1:] if x != drive.link)]
            elif len(ends) > 2:
                drawing.note(f"{point} is driven and joins {listed(ends)}: {ends[1]} is turned")
        for other in ends[1:]:
            joint = self._pin(point, ends[0], other)
            if drive is not None and other == ends[1]:
                self._driven(joint, drive)

    def _pin(self, point: str, first: str, second: str) -> str:
        name = self._free("joints", point)
        at = self._place(self.drawing.points[point])
        links = [self.names.get(first, first), self.names.get(second, second)]
        self.joints[name] = {"type": "R", "links": links, "at": [at, list(at)]}
        return name

    def _slotted(self, point: str, members: list[str], drive: Drive | None) -> None:
        """A pin in one slot or two: a slider for each, the first links' own if they are ones."""
        drawing = self.drawing
        own = [name for name in members if name in drawing.sliders]
        others = [name for name in members if name not in own]
        made = []
        for k, slot in enumerate(drawing.slots[point]):
            if slot.on != FRAME and slot.on not in drawing.links:
                drawing.note(f"point {point} slides on {slot.on}, which is no link: left out")
                continue
            slider = own[k] if k < len(own) else ""
            if not slider:
                name = self._free("links", f"slider_{point}")
                self.links[name] = {"pose": [0.0, 0.0, 0.0]}
                slider = self.names[name] = name
            made.append(slider)
            joint = self._slide(f"{point}_slide", slot.on, slider, point, slot.angle)
            if drive is not None and k == 0:
                self._driven(joint, drive)
        if not made:
            return
        first, *rest = made
        if not others and not rest and not own:
            drawing.note(f"point {point} slides and no link hangs on it")
        for other in [*rest, *others]:
            self._pin(point, first, other)

    def _slide(self, name: str, on: str, slider: str, point: str, angle: float) -> str:
        name = self._free("joints", name)
        at = self._place(self.drawing.points[point])
        self.joints[name] = {
            "type": "P",
            "links": [self.names.get(on, on), self.names.get(slider, slider)],
            "at": [at, list(at)],
            "angle": [angle, angle],
        }
        return name

    def _guide(self, guide: Guide) -> None:
        known = {FRAME, *self.drawing.links}
        if not {guide.first, guide.second} <= known:
            return
        name = self._free("joints", guide.name or f"{guide.first}_{guide.second}")
        second = guide.at if guide.second_at is None else guide.second_at
        self.joints[name] = {
            "type": "P",
            "links": [self.names[guide.first], self.names[guide.second]],
            "at": [self._place(guide.at), self._place(second)],
            "angle": [guide.angle, guide.angle],
        }
        if guide.drive is not None:
            self._driven(name, guide.drive)

    def _driven(self, joint: str, drive: Drive) -> None:
        """The driver of a joint: of a pin a turn, of a slide its interval if it has one."""
        slides = self.joints[joint]["type"] == "P"
        own: dict[str, Any] = {"joint": joint}
        if slides and drive.stop is None:
            self.drawing.note(f"the drive of {joint} has no stroke: give it a law of motion")
        else:
            scale = self.scale if slides else 1.0
            start, stop = drive.start * scale, (drive.stop or 0.0) * scale
            rate = (drive.rate or 1.0) * scale
            if not slides and rate < 0:
                start, stop = -start, -stop
            own |= {"law": "constant_rate", "rate": rate, "from": start, "to": stop}
        self.drivers[self._driver_name(joint)] = own

    def _couple(self) -> None:
        """A coupling for each pair of wheels, from those that are driven on.

        Both turn on one link, the first of their pins; the driven one gets a driver that follows.
        """
        waiting = list(self.drawing.wheels)
        going = True
        while going:
            going = False
            for pair in list(waiting):
                ends = self._axles(pair)
                leading = next((k for k, end in enumerate(ends) if self._driver_of(end)), None)
                if leading is None:
                    continue
                waiting.remove(pair)
                going = True
                if self._driver_of(ends[1 - leading]):
                    self.drawing.note(f"{pair.name}: both wheels are driven already: left out")
                else:
                    self._follow(pair, ends, leading)
        for pair in waiting:
            self.drawing.note(f"{pair.name}: no wheel of it is driven, or they have no common arm")

    def _axles(self, pair: Wheels) -> tuple[str, str]:
        """The pins of two wheels on one link, which stands first in both; "" without any."""
        axles: list[dict[str, str]] = []
        for wheel in (pair.first, pair.second):
            own = [(j, d["links"]) for j, d in self.joints.items() if d["type"] == "R"]
            axles.append({a: j for j, (a, b) in own if b == self.names.get(wheel)})
        arm = next((link for link in axles[0] if link in axles[1]), None)
        return (axles[0][arm], axles[1][arm]) if arm is not None else ("", "")

    def _driver_of(self, joint: str) -> str | None:
        return next((d for d, own in self.drivers.items() if own["joint"] == joint), None)

    def _follow(self, pair: Wheels, ends: tuple[str, str], leading: int) -> None:
        driven = ends[1 - leading]
        a, b = (complex(*self.joints[end]["at"][0]) for end in ends)
        sizes, inside = pair.sizes, False
        if pair.pitch is not None:
            arms = [self.scale * pair.pitch - centre for centre in (a, b)]
            across = arms[0].conjugate() * arms[1]
            if not all(arms) or abs(across.imag) > ON_LINE * abs(a - b) ** 2:
                self.drawing.note(f"{pair.name}: left out")
                self.drawing.note(f"{pair.name} is not on the line of its wheels' centres")
                return
            sizes, inside = (abs(arms[0]), abs(arms[1])), across.real > 0
        name = self._driver_name(driven)
        self.drivers[name] = {"joint": driven}
        sizes = sizes if not leading else sizes[::-1]
        made: dict[str, Any] = {"type": "gear"}
        if pair.chain:
            radii = [size * self.scale for size in sizes]
            if sum(radii) > abs(a - b):  # sizes that are teeth: the ratio is what counts
                radii = [size * abs(a - b) / (2 * sum(sizes)) for size in sizes]
                self.drawing.note(f"{pair.name}: radii from the ratio and the distance of the pins")
            made = {"type": "belt", "radii": radii}
        else:
            exact = sizes[0] / sizes[1]
            ratio = Fraction(exact).limit_denominator(MOST_TEETH)
            made["teeth"] = [ratio.numerator, ratio.denominator]
            if inside:
                made["internal"] = True
            if abs(float(ratio) / exact - 1) > ROUNDING:  # no teeth give it
                law = {"kind": "polynomial", "coefficients": [0.0, exact if inside else -exact]}
                made = {"type": "ratio", "law": law}
        made |= {"driver": self._driver_of(ends[leading]), "driven": name}
        taken = {*self.couplings, *self.links, *self.drivers, *self.joints}
        self.couplings[free_name(_clean(pair.name) or "gears", taken)] = made

    def _driver_name(self, joint: str) -> str:
        name = "motor"
        while name in self.drivers:
            name = f"motor_{joint}" if name == "motor" else f"{name}_"
        return name

    def _markers(self) -> None:
        """Points that are no joint stay as markers of their link."""
        drawing = self.drawing
        for point, z in drawing.points.items():
            members = self._members(point)
            if point in drawing.slots or (point in drawing.fixed and members):
                continue
            if len(members) == 1:
                own = self.links[self.names[members[0]]].setdefault("markers", {})
                taken = {*self.names.values(), *self.links, *own}
                name = free_name(_clean(point) or "point", taken)
                own[name] = {"at": self._place(z)}
            elif not members and point not in drawing.fixed:
                drawing.note(f"point {point} is on no link: left out")

    def _loads(self) -> dict[str, Any]:
        loads: dict[str, Any] = {}
        for load in self.drawing.loads:
            if load.link not in self.names:
                self.drawing.note(f"force {load.name} acts on no moving link: left out")
                continue
            taken = {*loads, *self.links, *self.drivers}
            name = free_name(_clean(load.name) or "force", taken)
            loads[name] = {
                "type": "force",
                "link": self.names[load.link],
                "at": self._place(load.at),
                "force": [load.force.real, load.force.imag],
            }
            if load.turns:
                loads[name]["axes"] = "link"
        return loads


def _clean(text: str) -> str:
    """A name that a document takes: no dot, no slash, no sign that a terminal obeys."""
    word = re.sub(r"[./\s]+", "_", text.strip())
    word = "".join(c for c in word if c.isprintable())[:60]
    return f"{word}_" if word == FRAME else word


def direction(a: complex, b: complex, where: str) -> float:
    """The angle [rad] of the line from a to b. Raises `FormatError` if they are at one place."""
    if a == b:
        found = "the two points of a line are at one place"
        raise FormatError(Problem("bad-drawing", where, found, "", "draw them apart"))
    return cmath.phase(b - a)
