"""The graph of a document while it is made: blocks, wires, markers and who became what."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.assur.formation import Formation
from blockmech.assur.groups import Unit
from blockmech.blocks.registry import REGISTRY
from blockmech.model.diagram import GRAPH_FILE, Wire
from blockmech.model.joints.closing import Poses, coordinate
from blockmech.model.joints.connections import Connection, Connections, Seated, angle_of
from blockmech.model.joints.contents import FRAME, LinkGiven
from blockmech.model.joints.elements import Hold, element
from blockmech.model.joints.frames import GENERAL, End, Made, Seat, free_name, xy
from blockmech.model.joints.linkage import Linkage
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.naming import JointName, LinkName, Names
from blockmech.model.structure import JointRef, LinkRef, MarkerRef
from blockmech.model.writing import plain

MOST_IN_NAME = 3  # links that a group is named after


@dataclass(frozen=True)
class Sequence:
    """A document taken apart, its joints closed, nothing of it made into blocks yet."""

    pairs: Connections  # as the document names them
    seats: Seated
    formation: Formation
    poses: Poses


class Diagram:
    """Blocks as they stand in a file, made one after the other in formation order.

    Parameters
    ----------
    linkage : the document
    drivers : driven pair -> driver
    """

    def __init__(self, linkage: Linkage, drivers: Mapping[str, str]) -> None:
        self.linkage = linkage
        self.drivers = drivers
        self._blocks: dict[str, dict[str, Any]] = {}
        self._wires: list[Wire] = []
        self._seats: dict[str, Seat] = {}
        self._ends: dict[str, tuple[str, End]] = {}  # pair -> block and joint
        self._loads: dict[str, tuple[str, ...]] = {}  # load -> its elements
        self._upstream: dict[str, dict[str, None]] = {}  # block -> drivers it depends on
        self._marked: dict[tuple[str, complex, complex | None], MarkerRef] = {}
        self._guides: dict[tuple[str, complex, complex], MarkerRef] = {}
        self._taken: dict[str, set[str]] = {}
        frame = free_name(FRAME, set(linkage.drivers))
        self._open(frame, {"type": "frame", "markers": {}}, {FRAME})
        self._seats[FRAME] = Seat(frame, FRAME)
        self._upstream[frame] = {}

    # -- blocks -----------------------------------------------------------

    def add(self, unit: Unit, made: Made, found: Sequence) -> None:
        """Add the block of a unit and wire its outer joints."""
        name = self._name_of(unit, made.type)
        data: dict[str, Any] = {"type": made.type, **made.keys}
        for link, seat in made.seats.items():
            self._seats[link] = seat._replace(block=name)
        self._open(name, data, _reserved(made))
        self._links(name, data, made)
        friction = {}
        for pair, end in made.ends.items():
            c = found.seats.pairs[pair]
            self._ends[pair] = (name, end)
            if c.friction is not None:
                friction[end.joint] = plain(c.friction)
        if friction:
            data["friction"] = friction
        self._built_in(name, made)
        supports = [self._wire(name, made, found.seats.pairs[p.name]) for p in unit.outer]
        if made.type == GENERAL:
            for pair in made.drivers:
                data["pairs"][made.ends[pair].joint]["driver"] = self.drivers[pair]
        upstream: dict[str, None] = {}
        for support in sorted(supports):
            upstream |= self._upstream[support]
        upstream |= {self.drivers[pair]: None for pair in sorted(made.drivers)}
        self._upstream[name] = upstream
        if made.type == GENERAL:
            data["home"] = self._home(unit, upstream, found)

    def _name_of(self, unit: Unit, kind: str) -> str:
        if unit.kind in ("driver", "cylinder") and kind != GENERAL:
            return self.drivers[unit.driven[0]]
        wish = "_".join(unit.links[:MOST_IN_NAME])
        if len(unit.links) > MOST_IN_NAME:
            wish += f"_and_{len(unit.links) - MOST_IN_NAME}"
        return free_name(wish, {*self._blocks, *self.linkage.drivers})

    def _open(self, name: str, data: dict[str, Any], reserved: set[str]) -> None:
        self._blocks[name] = data
        self._taken[name] = set(reserved)

    def _links(self, name: str, data: dict[str, Any], made: Made) -> None:
        """Mass properties and the user's markers of the links of a block."""
        links: dict[str, Any] = {}
        for link, seat in made.seats.items():
            given = self.linkage.links[link]
            own = self._mass(given, seat)
            if own or made.type == GENERAL:
                links[seat.link] = own
        if links:
            data["links"] = links

    def _mass(self, given: LinkGiven, seat: Seat) -> dict[str, Any]:
        said = given.model_fields_set
        own: dict[str, Any] = {k: getattr(given, k) for k in ("mass", "inertia") if k in said}
        if "cm" in said:
            moved = seat.o != 0 or seat.e != 1
            own["cm"] = xy(seat.place(given.cm.z)) if moved else given.cm.written
        return own

    def _built_in(self, block: str, made: Made) -> None:
        """Remember the markers that a block brings, so that they are not made again."""
        own = {(link, seat.o): seat.link for link, seat in made.seats.items()}
        for (link, at), name in {**made.points, **own}.items():
            seat = self._seats[link]
            ref = MarkerRef(block, seat.link, name)
            self._marked[link, at, None] = self._marked[link, at, seat.e] = ref
            self._guides[link, at, seat.e] = ref

    def marker(self, link: str, at: complex, along: complex | None, wish: str) -> MarkerRef:
        """A marker at a place of a link, in a direction if one matters; made if there is none."""
        known = self._marked.get((link, at, along))
        if known is None:
            known = self._put(link, at, along, wish)
            self._marked[link, at, along] = known
            e = self._seats[link].e if along is None else along
            self._marked.setdefault((link, at, None), known)
            self._marked.setdefault((link, at, e), known)
        return known

    def guide(self, link: str, at: complex, along: complex, wish: str) -> MarkerRef:
        """A marker that stands for the line through a place in a direction."""
        known = self._guides.get((link, at, along))
        if known is None:
            known = self._guides[link, at, along] = self._put(link, at, along, wish, guide=True)
        return known

    def _put(
        self, link: str, at: complex, along: complex | None, wish: str, guide: bool = False
    ) -> MarkerRef:
        seat = self._seats[link]
        taken = self._taken[seat.block]
        if wish in taken:
            wish = free_name(f"{link}_{wish}", taken)
        taken.add(wish)
        data: dict[str, Any] = {"at": xy(seat.place(at))}
        direction = 1 + 0j if along is None else seat.direction(along)
        if direction != 1:
            data["dir"] = xy(direction)
        elif guide:
            data["angle"] = 0.0
        holder = self._blocks[seat.block]
        if link != FRAME:
            holder = holder.setdefault("links", {}).setdefault(seat.link, {})
        holder.setdefault("markers", {})[wish] = data
        return MarkerRef(seat.block, seat.link, wish)

    def _wire(self, block: str, made: Made, c: Connection) -> str:
        """Wire an outer joint to its support; returns the support's block."""
        end = made.ends[c.name]
        support = c.other(end.later)
        at, wish = c.on(support), c.name.replace(".", "_")
        if c.kind == "P":
            along = -c.guide(support) if end.turned else c.guide(support)
            source = self.guide(support, at, along, wish)
        else:
            source = self.marker(support, at, 1 + 0j if c.name in made.drivers else None, wish)
        self._wires.append(Wire(str(source), f"{block}.{end.joint}"))
        return source.block

    def _home(self, unit: Unit, upstream: Mapping[str, None], found: Sequence) -> dict[str, Any]:
        """Driver values and poses of a general group in the refined pose."""
        joints = {driver: pair for pair, driver in self.drivers.items()}
        values = {}
        for driver in upstream:
            c = found.pairs[joints[driver]]
            q = coordinate(found.poses, c)
            start = self._start(driver)
            if c.kind == "R":  # poses need not count turns: home is near to where the way starts
                q = (
                    math.fmod(q, math.tau)
                    if start is None
                    else q - math.tau * round((q - start) / math.tau)
                )
            values[driver] = q
        return {"drivers": values, "poses": {link: _pose(found.poses, link) for link in unit.links}}

    def _start(self, driver: str) -> float | None:
        """Coordinate [rad or m] at which a driver's motion starts, if the document says it."""
        law = self.linkage.drivers[driver]
        if isinstance(law, LawOfMotion):
            return float(law.at_times(np.array([law.begin()]))[0][0])
        return self.linkage.initial[driver].q if driver in self.linkage.initial else None

    # -- loads, scene, names ----------------------------------------------

    def add_loads(self, pairs: Connections) -> None:
        """Add the loads as elements, in the order of the document."""
        for name, load in self.linkage.loads.items():
            for made in element(name, load, pairs, self._seats):
                block = free_name(made.name, {*self._blocks, *self.linkage.drivers})
                self._blocks[block] = made.data
                self._loads[name] = (*self._loads.get(name, ()), block)
                for hold in made.holds:
                    source = self._hold(hold, made.name)
                    self._wires.append(Wire(str(source), f"{block}.{hold.terminal}"))

    def _hold(self, hold: Hold, wish: str) -> MarkerRef:
        seat = self._seats[hold.link]
        if hold.at is None:
            return MarkerRef(seat.block, seat.link, seat.link)
        return self.marker(hold.link, hold.at, None, wish)

    def _scene(self) -> dict[str, Any]:
        drive = {
            name: {key: value for key, value in plain(law, "law").items() if key != "joint"}
            for name, law in self.linkage.drivers.items()
            if isinstance(law, LawOfMotion)
        }
        gravity = self.linkage.gravity.written if self.linkage.gravity.z else None
        initial, stops = plain(self.linkage.initial), plain(self.linkage.stops)
        scene = {"gravity": gravity, "drive": drive, "initial": initial, "stops": stops}
        return {key: said for key, said in scene.items() if said}

    def data(self) -> dict[str, Any]:
        """The graph as it would stand in a file."""
        sections = {
            "blocks": self._blocks,
            "wires": [{"from": w.source, "to": w.target} for w in self._wires],
            "scene": self._scene(),
            **{key: plain(self.linkage.extras.get(key)) for key in ("source", "notes")},
        }
        return GRAPH_FILE.written(self.linkage.name, self.linkage.title, sections)

    def names(self, found: Sequence) -> Names:
        """Where everything went; markers that are still needed for that are made."""
        links = {}
        for link in self.linkage.links:
            seat = self._seats[link]
            given = self.linkage.links[link].markers
            markers = {
                name: self._put(link, m.at.z, m.direction, name, _is_guide(m))
                for name, m in given.items()
            }
            if link == FRAME and not markers:
                continue
            origin = self.marker(link, 0j, 1 + 0j, link)
            turn = 0.0 if seat.e == 1 else -angle_of(seat.e)
            links[link] = LinkName(LinkRef(seat.block, seat.link), origin, turn, markers)
        joints = {name: self._joint(name, found) for name in found.pairs}
        return Names(links, joints, dict(self._loads))

    def _joint(self, name: str, found: Sequence) -> JointName:
        links = found.pairs[name].links
        if name not in found.seats.sums:
            return self._end(found.seats, name, False, links)
        parts = [self._end(found.seats, n, back, links) for n, back in found.seats.sums[name]]
        first, *others = parts
        more = tuple((part.joint, part.flipped) for part in others)
        return JointName(first.joint, first.flipped, False, more, links)

    def _end(self, seats: Seated, name: str, back: bool, links: tuple[str, str]) -> JointName:
        block, end = self._ends[name]
        flipped = (end.later == seats.pairs[name].first) != back
        return JointName(JointRef(block, end.joint), flipped, end.turned, (), links)


def _reserved(made: Made) -> set[str]:
    """Names of markers that a block brings or may bring."""
    names = {seat.link for seat in made.seats.values()} | set(made.points.values())
    names |= {end.joint for end in made.ends.values()}
    return names | set(REGISTRY[made.type].built_in)


def _is_guide(marker: Any) -> bool:
    return marker.angle is not None or marker.dir is not None


def _pose(poses: Poses, link: str) -> list[float]:
    o, theta = poses.of(link)
    return [*xy(o), theta]
