"""The joint-based document of a drawing. What follows from a drawing is mechanics:

* every link's frame is the drawing's, so the drawn place of a point is its place on each link and
  the drawing fixes the assembly mode;
* a point where m links meet is m - 1 joints with the first of them, a fixed one joins the frame;
* a point that slides is a pin in a slot: a slider without mass between the slot's link and the
  links at the point, the frame where the point is fixed; a link that slides itself takes its place;
* two links with two pins in common are welded, and one with two fixed points to the frame;
* a point of one link alone is a marker.

What cannot be taken is a note that names it.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Iterable
from itertools import combinations

from blockmech.assur.groups import Pair as AssurPair
from blockmech.assur.rigidity import rigidity
from blockmech.exchange.drawing import (
    FRAME,
    FREE,
    UNITS,
    Cam,
    Drawing,
    Drive,
    Pair,
    Ratio,
    Weld,
    Wheels,
    cam_with_follower,
    rack_and_pinion,
    ratio_of_joints,
    scaled,
    wheels_that_mesh,
)
from blockmech.exchange.parsing import wrong
from blockmech.ground.errors import listed
from blockmech.ground.limits import SOLVED
from blockmech.ground.names import free_name, numbered_name
from blockmech.model.versions import VERSION
from blockmech.typing import Data

BOUNDLESS = 1e10  # what a limit is that is none


def document(drawing: Drawing, unit: str | None = None, rounded: bool = False) -> Data:
    """The joint-based document of a drawing, in SI units.

    ``unit`` is that of a file that has none; ``rounded`` keeps points that slide off their lines
    by what is drawn. Raises `FormatError` for a drawing without links.
    """
    return _DrawnDocument(drawing, unit, rounded).document()


class _DrawnDocument:
    def __init__(self, drawing: Drawing, unit: str | None, rounded: bool) -> None:
        self.drawing, self.rounded = drawing, rounded
        self.scale = self._unit(unit)
        self.taken: dict[str, set[str]] = {"joints": set(), "links": {FRAME}}
        self.links: dict[str, Data] = {}
        self.joints: dict[str, Data] = {}
        self.drivers: dict[str, Data] = {}
        self.couplings: dict[str, Data] = {}
        self.loads: dict[str, Data] = {}
        self.stops: dict[str, dict[str, float]] = {}
        self.names: dict[str, str] = {FRAME: FRAME}
        self.pairs: dict[str, str] = {}  # name of a pair in the drawing -> its joint
        self.carriers: dict[str, str] = {}  # welded link -> one that carries it

    def _unit(self, unit: str | None) -> float:
        drawing = self.drawing
        if drawing.unit:
            if unit is not None and UNITS[unit] != UNITS[drawing.unit]:
                drawing.note(f"the file is in {drawing.unit}: the unit {unit} was not used")
            return UNITS[drawing.unit]
        hint = "; --unit says another" if unit is None else ""
        drawing.note(f"the file names no unit: lengths were taken as {unit or 'm'}{hint}")
        return UNITS[unit or "m"]

    def document(self) -> Data:
        """See `document`."""
        drawing = self.drawing
        for name in drawing.links:
            self.names[name] = self._free("links", name)
            self.links[self.names[name]] = self._link(name)
        for weld in drawing.welds:
            self._weld(weld)
        while rigid := self._rigid():
            self._weld(rigid)
        for point, members in drawing.meeting().items():
            self._point(point, members)
        for pair in drawing.pairs:
            self._pair(pair)
        self._drive_something()
        self._couple()
        self._markers()
        if not self._movable():
            raise wrong(drawing.name, "it has no links that a joint joins", "", "draw the linkage")
        self._loads()
        stops = self._stops()
        document: Data = {
            "format": "blockmech/joints",
            "version": VERSION,
            "name": _clean(drawing.name) or "mechanism",
            "gravity": [g.real, g.imag] if (g := drawing.gravity) else [],
            "links": self.links,
            "joints": self.joints,
            "drivers": self.drivers,
            "couplings": self.couplings,
            "loads": self.loads,
            "stops": stops,
            "source": drawing.source,
            "notes": list(drawing.notes),
        }
        return {key: value for key, value in document.items() if value or key in ("links", "notes")}

    def _stops(self) -> dict[str, dict[str, float]]:
        """Limits by their driver, or by the coordinate of a joint that has none."""
        stops, following = {}, {coupling["driven"] for coupling in self.couplings.values()}
        for joint, ends in self.stops.items():
            driver = self._driver_of(joint)
            if driver in following:
                self.drawing.note(f"limits of {joint}, which follows: left out")
            elif ends:
                stops[driver or f"joint.{joint}.coordinate"] = ends
        return stops

    def _rigid(self) -> Weld | None:
        """A weld of the first two links that have two pins in common; None without any."""
        drawing = self.drawing
        rank = {name: k for k, name in enumerate(self.names)}
        pins: dict[tuple[str, str], set[complex]] = {}
        for point, members in drawing.meeting().items():
            if point not in drawing.slots:
                for ends in combinations(sorted(self._bodies(members), key=rank.__getitem__), 2):
                    pins.setdefault(ends, set()).add(drawing.points[point])
        for (first, second), positions in pins.items():
            if len(positions) > 1:
                fixed = f"link {second} joins fixed points: it is part of the frame"
                two = f"links {first} and {second} have two pins in common: they are one link"
                drawing.note(fixed if first == FRAME else two)
                return Weld(f"{first}_{second}", first, second, min(positions, key=abs))
        return None

    def _weld(self, weld: Weld) -> None:
        """A joint that welds two links, of which none carries the other already."""
        first, second = (self._body(link) for link in (weld.first, weld.second))
        if first == second:
            return
        if second == FRAME:
            first, second = second, first
        self.carriers[second] = first
        second_at = weld.at if weld.second_at is None else weld.second_at
        joint = self.joints[self._free("joints", weld.name)] = {
            "type": "weld",
            "links": [self.names[weld.first], self.names[weld.second]],
            "at": [self._metres(weld.at), self._metres(second_at)],
        }
        if weld.turn:
            joint["angle"] = [0.0, weld.turn]

    def _body(self, link: str) -> str:
        """The link, of those welded to one, that stands for all of them."""
        while link in self.carriers:
            link = self.carriers[link]
        return link

    def _document_bodies(self) -> dict[str, str]:
        """Link of the document -> the one that stands for all that are welded to it."""
        return {name: self.names[self._body(link)] for link, name in self.names.items()}

    def _movable(self) -> dict[str, Data]:
        """The joints in which something moves."""
        return {name: joint for name, joint in self.joints.items() if joint["type"] != "weld"}

    def _bodies(self, links: Iterable[str]) -> dict[str, str]:
        """The first of some links on each rigid body."""
        bodies: dict[str, str] = {}
        for link in links:
            bodies.setdefault(self._body(link), link)
        return bodies

    def _link(self, name: str) -> Data:
        link: Data = {"pose": [0.0, 0.0, 0.0]}
        body = self.drawing.inertias.get(name)
        if body is not None and min(body.mass, body.inertia) < 0:
            numbers = f"the mass {body.mass:g} kg and the inertia {body.inertia:g} kg m2"
            raise wrong(self.drawing.name, f"link {name} has {numbers}", "0 or more")
        if body is not None and (body.mass or body.inertia):
            link |= {"mass": body.mass, "inertia": body.inertia, "cm": self._metres(body.cm)}
        return link

    def _metres(self, z: complex) -> list[float]:
        return [z.real * self.scale, z.imag * self.scale]

    def _free(self, kind: str, text: str) -> str:
        name = numbered_name(_clean(text) or kind[:-1], self.taken[kind])
        self.taken[kind].add(name)
        return name

    # -- joints -----------------------------------------------------------------

    def _point(self, point: str, members: list[str]) -> None:
        drawing = self.drawing
        drive = drawing.drives.get(point)
        if point in drawing.slots:
            self._slotted(point, members, drive)
            return
        turning = {x for pair in drawing.wheels for x in (pair.first, pair.second)}
        # a wheel turns on the others
        bodies = self._bodies(sorted(members, key=lambda name: name in turning))
        ends = list(bodies.values())
        if drive is not None:
            turned = bodies.get(self._body(drive.link))
            if len(ends) < 2:
                drawing.note(f"point {point} is driven, but joins no two links: its drive was left")
                drive = None
            elif turned in ends[1:]:
                ends.remove(turned)
                ends.insert(1, turned)
            elif len(ends) > 2:
                drawing.note(f"{point} is driven and joins {listed(ends)}: {ends[1]} is turned")
        for k, link in enumerate(ends[1:]):
            of_link = None if k else drive
            self._pair(Pair(ends[0], link, drawing.points[point], None, of_link, name=point))

    def _slotted(self, point: str, members: list[str], drive: Drive | None) -> None:
        """A pin in one slot or two: a slider for each, unless a link of the point slides itself."""
        drawing, z = self.drawing, self.drawing.points[point]
        sliders: list[str] = []
        for k, slot in enumerate(drawing.slots[point]):
            if slot.on != FRAME and slot.on not in drawing.links:
                drawing.note(f"point {point} slides on {slot.on}, which is no link: left out")
                continue
            if slot.rider == slot.on:
                drawing.note(f"point {point} slides in its own link: left out as a slide")
                continue
            slider = slot.rider
            if not slider:
                slider = self._free("links", f"slider_{point}")
                self.links[slider] = {"pose": [0.0, 0.0, 0.0]}
                self.names[slider] = slider
            sliders.append(slider)
            foot = z
            if slot.through is not None and self.rounded:
                drawing.note(f"{point} is beside its slot by rounding: read as it is drawn")
            elif slot.through is not None:
                unit = cmath.rect(1.0, slot.angle)
                foot = slot.through + unit * ((z - slot.through) * unit.conjugate()).real
            slot_drive = drive if k == 0 else None
            name = point if members == [slot.rider] else f"{point}_slide"
            self._pair(Pair(slot.on, slider, foot, slot.angle, slot_drive, z, name))
        if not sliders:
            return
        if not {*members, *sliders[1:]}:
            drawing.note(f"point {point} slides and no link hangs on it")
        first, *pinned = self._bodies([*sliders, *members]).values()
        for link in pinned:
            self._pair(Pair(first, link, z, name=point))

    def _pair(self, pair: Pair) -> None:
        ends = {pair.first, pair.second}
        if not ends <= self.names.keys() or len(self._bodies(ends)) < 2:
            self.drawing.note(f"{pair.name} joins no two links: left out")
            return
        name = self._free("joints", pair.name or f"{pair.first}_{pair.second}")
        self.pairs[pair.name] = name
        second = pair.at if pair.second_at is None else pair.second_at
        joint = self.joints[name] = {
            "type": "R" if pair.angle is None else "P",
            "links": [self.names[pair.first], self.names[pair.second]],
            "at": [self._metres(pair.at), self._metres(second)],
        }
        scale = 1.0
        if pair.angle is not None:
            joint["angle"] = [pair.angle, pair.angle]
            scale = self.scale
        if pair.drive is not None:
            self._driven(name, pair.drive)
        if pair.limits != FREE:
            limits = {"from": pair.limits[0] * scale, "to": pair.limits[1] * scale}
            self.stops[name] = {key: x for key, x in limits.items() if abs(x) < BOUNDLESS}
        if pair.stiffness or pair.damping:
            numbers = {"stiffness": pair.stiffness, "rest_angle": pair.rest * scale}
            load = {"type": "torsion_spring", "joint": name, **numbers, "damping": pair.damping}
            self._load(f"{name}_spring", load)

    def _driven(self, joint: str, drive: Drive) -> None:
        """The driver of a joint: of a pin a turn, of a slide its interval if it has one."""
        slides = self.joints[joint]["type"] == "P"
        scale = self.scale if slides else 1.0
        law: Data = {}
        if drive.law is not None:
            law = scaled(drive.law, scale)
        elif slides and drive.stop is None:
            self.drawing.note(f"the drive of {joint} has no stroke: give it a law of motion")
        else:
            start, stop = drive.start * scale, (drive.stop or 0.0) * scale
            rate = (drive.rate or 1.0) * scale
            if not slides and rate < 0:
                start, stop = -start, -stop
            law = {"law": "constant_rate", "rate": rate, "from": start, "to": stop}
        self.drivers[self._driver_name(joint)] = {"joint": joint, **law}

    def _driver_name(self, joint: str) -> str:
        name = "motor"
        while name in self.drivers:
            name = f"motor_{joint}" if name == "motor" else f"{name}_"
        return name

    def _driver_of(self, joint: str) -> str | None:
        return next((d for d, driver in self.drivers.items() if driver["joint"] == joint), None)

    def _drive_something(self) -> None:
        """Where nothing is driven, as many joints as can move, the frame's first; this is told.

        What moves freely beside a drive gets one as well, if the drawing says so.
        """
        named = {driver["joint"]: name for name, driver in self.drivers.items()}
        movable, bodies = self._movable(), self._document_bodies()
        if not movable or (named and not self.drawing.free):
            return
        following = [self.pairs[x.driven] for x in self.drawing.ratios if x.driven in self.pairs]
        meshing: list[Wheels | Cam] = [*self.drawing.wheels, *self.drawing.cams]
        following += filter(None, (self._axles(pair)[1] for pair in meshing))
        pairs = [
            AssurPair(x, bodies[d["links"][0]], bodies[d["links"][1]], d["type"])
            for x, d in movable.items()
        ]
        links = {*bodies.values()} - {FRAME}
        driven = list(following)
        free = [pair.name for pair in pairs if pair.name not in {*following, *named}]
        free.sort(key=lambda joint: FRAME not in self.joints[joint]["links"])
        chosen: list[str] = []
        for joint in [*named, *(free if len(free) < SOLVED else free[:1])]:
            mobility = [
                rigidity(links, pairs, (FRAME,), drivers).mobility
                for drivers in (driven, [*driven, joint])
            ]
            if mobility[1] < mobility[0]:
                driven.append(joint)
                if joint not in named:
                    self.drivers[self._driver_name(joint)] = {"joint": joint}
                    chosen.append(joint)
            elif joint in named and joint not in following:
                del self.drivers[named[joint]]
                self.drawing.note(f"drive of {joint}, which follows from the others: left out")
        if chosen:
            subject = "not all is driven" if named else "nothing is driven"
            self.drawing.note(f"{subject}: {listed(chosen)} was taken, without a law of motion")

    # -- couplings ----------------------------------------------------------------

    def _couple(self) -> None:
        """A coupling for each pair of wheels and each ratio, from those that are driven on.

        Wheels turn on one link, the first of their pins; the driven one gets a driver that follows.
        """
        drawing = self.drawing
        waiting: list[Wheels | Cam | Ratio] = [*drawing.wheels, *drawing.cams, *drawing.ratios]
        going = True
        while going:
            going = False
            for pair in list(waiting):
                ends = self._ends(pair) if isinstance(pair, Ratio) else self._axles(pair)
                leading = next((k for k, end in enumerate(ends) if self._driver_of(end)), None)
                if leading is None:
                    continue
                waiting.remove(pair)
                going = True
                if self._driver_of(ends[1 - leading]):
                    drawing.note(f"{pair.name}: both sides are driven already: left out")
                elif (coupling := self._coupling_of(pair, ends, leading)) is not None:
                    self._coupling(pair.name or "gears", coupling, ends, leading)
        for pair in waiting:
            drawing.note(f"{pair.name}: no wheel of it is driven, or they have no common arm")

    def _coupling_of(
        self, pair: Wheels | Cam | Ratio, ends: tuple[str, str], leading: int
    ) -> Data | None:
        """What couples two joints, of which one leads; None and a note where it is left out."""
        joints, note = [self.joints[end] for end in ends], self.drawing.note
        if isinstance(pair, Ratio):
            units = [self.scale if joint["type"] == "P" else 1.0 for joint in joints]
            return ratio_of_joints(pair, units, leading, note)
        if isinstance(pair, Cam):
            return cam_with_follower(pair, self.scale, leading, note)
        if pair.rack is not None:
            bodies, guide = self._document_bodies(), joints[1]
            forth = bodies[guide["links"][1]] == bodies[self.names[pair.second]]
            return rack_and_pinion(pair, self.scale, guide["angle"][0] + (not forth) * math.pi)
        centres = [complex(*joint["at"][0]) for joint in joints]
        return wheels_that_mesh(pair, self.scale, centres, leading, note)

    def _ends(self, ratio: Ratio) -> tuple[str, str]:
        return self.pairs.get(ratio.leading, ""), self.pairs.get(ratio.driven, "")

    def _axles(self, pair: Wheels | Cam) -> tuple[str, str]:
        """The joints of two wheels on one link, which stands first in both; "" without any."""
        axles: list[dict[str, str]] = []
        bodies = self._document_bodies()
        for wheel, kind in (pair.first, "R"), (pair.second, "P" if pair.slides else "R"):
            body = bodies.get(self.names.get(wheel, ""), "")
            joints = [(j, d["links"]) for j, d in self.joints.items() if d["type"] == kind]
            ends = [(j, {bodies[link] for link in links}) for j, links in joints]
            axles.append({(x - {body}).pop(): j for j, x in ends if body in x})
        arm = next((link for link in axles[0] if link in axles[1]), None)
        return (axles[0][arm], axles[1][arm]) if arm is not None else ("", "")

    def _coupling(self, text: str, coupling: Data, ends: tuple[str, str], leading: int) -> None:
        """Add a coupling from the joint that is driven to the other, which gets a driver."""
        driven = ends[1 - leading]
        name = self._driver_name(driven)
        coupling |= {"driver": self._driver_of(ends[leading]), "driven": name}
        self.drivers[name] = {"joint": driven}
        names = {*self.couplings, *self.links, *self.drivers, *self.joints}
        self.couplings[free_name(_clean(text), names)] = coupling

    # -- markers and loads ----------------------------------------------------------

    def _markers(self) -> None:
        """Points that are no joint stay as markers of their link."""
        drawing = self.drawing
        for point, members in drawing.meeting().items():
            slots = drawing.slots.get(point, [])
            if FRAME in members or any(slot.rider not in members for slot in slots):
                continue
            z = drawing.points[point]
            if slots and [drawing.points[p] for p in drawing.links[members[0]]].count(z) > 1:
                continue
            if len(self._bodies(members)) == 1:
                markers = self.links[self.names[members[0]]].setdefault("markers", {})
                names = {*self.names.values(), *self.links, *markers}
                name = free_name(_clean(point) or "point", names)
                markers[name] = {"at": self._metres(z)}
            elif not members:
                drawing.note(f"point {point} is on no link: left out")

    def _load(self, text: str, load: Data) -> None:
        names = {*self.loads, *self.links, *self.drivers, *self.joints}
        self.loads[free_name(_clean(text) or load["type"], names)] = load

    def _loads(self) -> None:
        for load in self.drawing.loads:
            if load.link not in self.names or self._body(load.link) == FRAME:
                self.drawing.note(f"force {load.name} acts on no moving link: left out")
                continue
            force = {"force": [load.force.real, load.force.imag], "at": self._metres(load.at)}
            turns = {"axes": "link"} if load.turns else {}
            link = {"type": "force", "link": self.names[load.link]}
            self._load(load.name, {**link, **force, **turns})
        for spring in self.drawing.springs:
            if not {*spring.links} <= self.names.keys() or len(self._bodies(spring.links)) < 2:
                self.drawing.note(f"spring {spring.name} joins no two links: left out")
                continue
            at = [self._metres(z) for z in spring.at]
            ends = {"links": [self.names[x] for x in spring.links], "at": at}
            numbers = {"stiffness": spring.stiffness, "damping": spring.damping}
            free = {"free_length": spring.free_length * self.scale}
            self._load(spring.name, {"type": "spring", **ends, **numbers, **free})


def _clean(text: str) -> str:
    """A name that a document takes: no dot, no slash, no sign that a terminal obeys."""
    word = re.sub(r"[./\s]+", "_", text.strip())
    word = "".join(c for c in word if c.isprintable())[:60]
    return f"{word}_" if word == FRAME else word
