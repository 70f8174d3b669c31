"""The graph of a document while it is made: blocks, wires, markers and who became what."""

from __future__ import annotations

import math
from collections import ChainMap, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.assur.formation import Formation
from blockmech.assur.groups import Unit
from blockmech.blocks.block import REGISTRY
from blockmech.ground.errors import GraphError, Problem, listed, path_text
from blockmech.ground.names import MECHANISM, free_name
from blockmech.ground.plane import dot
from blockmech.ground.values import Place, xy
from blockmech.model.diagram import GRAPH_FILE
from blockmech.model.form import plain
from blockmech.model.joints.closing import coordinate
from blockmech.model.joints.contents import FRAME, coordinate_of
from blockmech.model.joints.drafts import GENERAL, BlockDraft, End
from blockmech.model.joints.elements import elements
from blockmech.model.joints.layout import (
    NO_CENTRE,
    Connection,
    Connections,
    Layout,
    LinkPlacement,
    Poses,
    Sums,
)
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.varied import phase, settled
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.naming import JointName, LinkName, Names
from blockmech.model.structure import COORDINATE, JointRef, LinkRef, MarkerRef
from blockmech.typing import Arguments, Data

MOST_IN_NAME = 3  # links that a group is named after


Drafts: TypeAlias = Mapping[tuple[str, ...], BlockDraft]


@dataclass(frozen=True)
class Sequence:
    """A document taken apart, its joints closed, nothing of it made into blocks yet."""

    layout: Layout  # its pairs as the document names them
    pairs: Connections  # as the formation sequence takes them
    sums: Sums
    formation: Formation
    poses: Poses
    drafts: Drafts  # blocks of dyads that closing has made already, by their links


class _Marked(NamedTuple):
    """A marker that is there, its direction in the document, and whether it stands for a line.

    One that a block brings may stand for its line or not (None).
    """

    ref: MarkerRef
    direction: complex
    line: bool | None


class Diagram:
    """Blocks as they stand in a file, made one after the other in formation order."""

    def __init__(self, linkage: Linkage, found: Sequence) -> None:
        self.linkage = linkage
        self.found = found
        self.drivers = linkage.driven  # driven pair -> driver
        self._blocks: dict[str, Data] = {}
        self._wires: list[tuple[MarkerRef | str, JointRef]] = []
        self._seats: dict[str, LinkPlacement] = {}
        self._ends: dict[str, tuple[str, End]] = {}  # pair -> block and joint
        self._beyond: dict[tuple[str, str], float] = {}  # (pair, link) of guides, see `BlockDraft`
        self._loads: dict[str, list[str]] = {}  # load -> its elements
        self._couplings: dict[str, str] = {}  # coupling -> its block
        self._signals: dict[str, str] = {}  # signal -> its block
        self._upstream: dict[str, dict[str, None]] = {}  # block -> drivers it depends on
        self._carried = defaultdict[str, list[str]](list)  # carrier -> links on it, itself one
        for link, weld in found.layout.welds.items():
            self._carried[weld.link].append(link)
        # place on a link -> the markers there: direction, and whether it stands for a line
        self._marked = defaultdict[tuple[str, complex], list[_Marked]](list)
        self._taken: dict[str, set[str]] = {}  # block -> names of markers
        reserved = {MECHANISM: ""}
        self._names = ChainMap[str, Any](self._blocks, linkage.drivers, reserved)  # that are taken
        frame = free_name(FRAME, linkage.drivers)
        self._blocks[frame] = {"type": "frame", "markers": {}}
        self._taken[frame] = {FRAME}
        self._seat(FRAME, LinkPlacement(frame, FRAME))
        self._upstream[frame] = {}

    # -- blocks -----------------------------------------------------------

    def _seat(self, carrier: str, seat: LinkPlacement) -> None:
        """Place a link of the graph, and with it the links that are welded to it."""
        for link in self._carried[carrier]:
            self._seats[link] = self.found.layout.welds[link].on(seat)

    def _mass(self, carrier: str) -> Data:
        """Mass properties of a link of the graph: of all that are welded to it."""
        links = self._carried[carrier]
        # Mass properties of links that are one, in the frame of their block.
        bodies = [(self.linkage.links[link], self._seats[link]) for link in links]
        if len(bodies) > 1:
            mass = sum(link.mass for link, _ in bodies)
            centres = [seat.place(link.cm.z) for link, seat in bodies]
            moment = sum(link.mass * z for (link, _), z in zip(bodies, centres, strict=True))
            if mass and not complex(mass):  # it varies, from nothing on
                raise GraphError(Problem("wrong-value", "links", NO_CENTRE))
            cm = moment / mass if mass else 0j
            inertia = sum(
                link.inertia + link.mass * dot(z - cm, z - cm)
                for (link, _), z in zip(bodies, centres, strict=True)
            )
            return {"mass": mass, "inertia": inertia, "cm": xy(cm)} if mass or inertia else {}
        ((body, seat),) = bodies
        fields, moved = body.model_fields_set, seat.o != 0 or seat.e != 1
        data: Data = {k: getattr(body, k) for k in ("mass", "inertia") if k in fields}
        if "cm" in fields or (moved and body.mass):
            data["cm"] = xy(seat.place(body.cm.z)) if moved else body.cm.written
        return data

    def add(self, unit: Unit, draft: BlockDraft) -> None:
        """Add the block of a unit and wire its outer joints."""
        name = self._name_of(unit, draft.type)
        pairs, general = self.found.pairs, draft.type == GENERAL
        self._blocks[name] = data = {"type": draft.type, **draft.keys}
        self._taken[name] = _reserved(draft)
        for link, seat in draft.seats.items():
            self._seat(link, seat._replace(block=name))
        masses = {seat.link: self._mass(link) for link, seat in draft.seats.items()}
        if links := {link: mass for link, mass in masses.items() if mass or general}:
            data["links"] = links
        self._ends |= {pair: (name, end) for pair, end in draft.ends.items()}
        self._beyond |= draft.beyond
        for key in ("friction", "clearance"):
            of = {end.joint: plain(getattr(pairs[pair], key)) for pair, end in draft.ends.items()}
            if values := {joint: x for joint, x in of.items() if x is not None}:
                data[key] = values
        origins = {(link, seat.o): seat.link for link, seat in draft.seats.items()}
        for (link, at), marker in {**draft.points, **origins}.items():
            seat = self._seats[link]
            self._marked[link, at].append(_Marked(MarkerRef(name, seat.link, marker), seat.e, None))
        upstream: dict[str, None] = {}
        for support in sorted(self._wire(name, draft, pairs[p.name]) for p in unit.outer):
            upstream |= self._upstream[support]
        for pair in sorted(draft.drivers):
            upstream |= self._leading(self.drivers[pair])
        self._upstream[name] = upstream
        if general:
            for pair in draft.drivers:
                data["pairs"][draft.ends[pair].joint]["driver"] = self.drivers[pair]
            data["home"] = self._home(unit, upstream)

    def _leading(self, driver: str) -> dict[str, None]:
        """The drivers that move a driver: itself, or those that it follows."""
        leads = {c.driven: c.driver for c in self.linkage.couplings.values()}
        passed = set[str]()
        while driver in leads and driver not in passed:
            passed.add(driver)
            driver = leads[driver]
        link, dot, _ = driver.partition(".")
        return self._upstream[self._seats[link].block] if dot else {driver: None}

    def _name_of(self, unit: Unit, kind: str) -> str:
        if unit.kind in ("driver", "cylinder") and kind != GENERAL:
            return self.drivers[unit.driven[0]]
        wish = "_".join(unit.links[:MOST_IN_NAME])
        if len(unit.links) > MOST_IN_NAME:
            wish += f"_and_{len(unit.links) - MOST_IN_NAME}"
        return free_name(wish, self._names)

    def marker(
        self, link: str, at: complex, along: complex | None, wish: str, guide: bool = False
    ) -> MarkerRef:
        """A marker at a place of a link, in a direction if one matters; made if there is none.

        A ``guide`` stands for the line through the place in the direction.
        """
        markers = self._marked[link, at]
        for ref, direction, line in markers:
            if line in (None, guide) and (direction == along or (along is None and not guide)):
                return ref
        ref = self._put(link, at, along, wish, guide)
        markers.append(_Marked(ref, along or self._seats[link].e, guide))
        return ref

    def _put(
        self, link: str, at: complex, along: complex | None, wish: str, guide: bool
    ) -> MarkerRef:
        seat = self._seats[link]
        used = self._taken[seat.block]
        if wish in used:
            wish = free_name(f"{link}_{wish}", used)
        used.add(wish)
        data: Data = {"at": xy(seat.place(at))}
        direction = 1 + 0j if along is None else seat.direction(along)
        if direction != 1:
            data["dir"] = xy(direction)
        elif guide:
            data["angle"] = 0.0
        holder = self._blocks[seat.block]
        if seat.link != FRAME:
            holder = holder.setdefault("links", {}).setdefault(seat.link, {})
        holder.setdefault("markers", {})[wish] = data
        return MarkerRef(seat.block, seat.link, wish)

    def _wire(self, block: str, draft: BlockDraft, c: Connection) -> str:
        """Wire an outer joint to its support; returns the support's block."""
        end, guide = draft.ends[c.name], c.kind == "P"
        support = c.other(end.later)
        direction = c.guide(support) if c.name in draft.drivers else None
        if guide:
            direction = -c.guide(support) if end.turned else c.guide(support)
        source = self.marker(support, c.on(support), direction, c.name.replace(".", "_"), guide)
        self._wires.append((source, JointRef(block, end.joint)))
        return source.block

    def _home(self, unit: Unit, upstream: Iterable[str]) -> Data:
        """Driver values and poses of a general group in the refined pose."""
        poses, values = self.found.poses, {}
        for driver in upstream:
            c = settled(self.found.layout.pairs[self.linkage.drivers[driver].joint])
            q, start = coordinate(poses, c), self._start(driver)
            if c.kind == "R":  # poses need not count turns: home is near to where the way starts
                turns = 0 if start is None else round((q - start) / math.tau)
                q = math.fmod(q, math.tau) if start is None else q - math.tau * turns
            values[driver] = q
        home_poses = {link: [*xy(poses[link].o), poses[link].theta] for link in unit.links}
        return {"drivers": values, "poses": home_poses}

    def _start(self, driver: str) -> float | None:
        """Coordinate [rad or m] at which a driver's motion starts, if the document says it."""
        law = self.linkage.drivers[driver]
        if isinstance(law, LawOfMotion):
            return float(law.at_times(np.array([law.begin()]))[0][0])
        return self.linkage.initial[driver].q if driver in self.linkage.initial else None

    # -- loads, scene, names ----------------------------------------------

    def _block(self, wish: str, data: Data) -> str:
        """Add a block without links under a name that is free."""
        name = free_name(wish, self._names)
        self._blocks[name] = data
        return name

    def add_loads(self) -> None:
        """Add the loads as elements, in the order of the document."""
        for name, load in self.linkage.loads.items():
            for wish, data, holds in elements(name, load, self.found.layout.pairs, self._seats):
                block = self._block(wish, data)
                self._loads.setdefault(name, []).append(block)
                for terminal, link, at in holds:
                    seat = self._seats[link]
                    source = MarkerRef(seat.block, seat.link, seat.link)
                    if at is not None:
                        source = self.marker(link, at, None, wish)
                    self._wires.append((source, JointRef(block, terminal)))

    def add_couplings(self) -> None:
        """Add the couplings; a wheel that is fixed to a link gets a marker at its centre."""
        for name, coupling in self.linkage.couplings.items():
            data = {"type": coupling.type_name, **plain(coupling)}
            link, _, marker = coupling.driver.partition(".")
            if marker:
                at = self.linkage.links[link].markers[marker]
                data["driver"] = str(self.marker(link, at.at.z, None, marker))
            for key, side in coupling.placed().items():
                seat, value = self._seats[self._moved(getattr(coupling, side))], data.get(key)
                if seat.o != 0 or seat.e != 1:
                    data[key] = _seated(getattr(coupling, key) if value is None else value, seat)
            self._couplings[name] = self._block(name, data)

    def add_signals(self) -> None:
        """Add the signal blocks and their wires; sensors have the document's names still."""
        for name, signal in self.linkage.signals.items():
            self._signals[name] = self._block(name, {"type": signal.type_name, **plain(signal)})
        for wire in self.linkage.wires:
            source, _, port = wire.source.partition(".")
            target, _, end = wire.target.partition(".")
            named = f"{self._signals[source]}.{port}" if source in self._signals else wire.source
            block = self._signals[target] if target in self._signals else self._loads[target][0]
            self._wires.append((named, JointRef(block, end)))

    def _moved(self, driver: str) -> str:
        """The link that a driver moves, or that carries a wheel by its address."""
        pair = next((p for p, name in self.drivers.items() if name == driver), None)
        if pair is None:
            return driver.partition(".")[0]
        c = self.found.layout.pairs[pair]
        return c.ends[c.links.index(self._ends[pair][1].later)]

    def _stops(self, name: str, stops: Arguments) -> tuple[str, Data]:
        """Stops by a driver, or by the coordinate of a pair as its block counts it.

        Raises `GraphError` for a driven pair, and one that is none of a block.
        """
        if (pair := coordinate_of(name)) is None:
            return name, stops
        c, message, remedy = self.found.layout.pairs.get(pair), "", "stop another joint"
        if c is None:
            message = f"{pair} is a pin of several links, and it is not said which two it stops"
            remedy = f"write {listed(x for x in self.found.layout.pairs if x.startswith(pair))}"
        elif c.name in self.drivers:
            message, remedy = f"{self.drivers[c.name]} drives {pair}", "stop the driver"
        elif c.name in self.found.sums:
            message = f"{pair} is no pair of two neighbours in the diagram"
        if c is None or message:
            raise GraphError(
                Problem("wrong-value", path_text(("stops", name)), message, "", remedy)
            )
        turn = -(joint := self._joint(c)).shift
        if c.kind == "R":
            first, second = (self._seats[link].e for link in c.ends)
            turn = phase(second) - phase(first)
        sign = -1 if joint.flipped != joint.turned else 1
        low, high = (stops.get(x) for x in ("from", "to"))
        ends = [None if x is None else sign * (x + turn) for x in (low, high)]
        both = dict(zip(("from", "to"), ends[::sign], strict=True))
        return f"{joint.joint}.{COORDINATE}", {
            key: x for key, x in {**stops, **both}.items() if x is not None
        }

    def data(self) -> Data:
        """The graph as it would stand in a file."""
        drive = {
            name: {key: value for key, value in plain(law).items() if key != "joint"}
            for name, law in self.linkage.drivers.items()
            if isinstance(law, LawOfMotion)
        }
        scene: Data = {
            "gravity": self.linkage.gravity.written if self.linkage.gravity.z else None,
            "drive": drive,
            "initial": plain(self.linkage.initial),
            "stops": dict(self._stops(n, plain(item)) for n, item in self.linkage.stops.items()),
            "motion": plain(self.linkage.motion),
        }
        sections = {
            "name": self.linkage.name,
            "title": self.linkage.title,
            "scene": {key: item for key, item in scene.items() if item},
            **{key: self.linkage.extras.get(key) for key in ("source", "notes")},
        }
        wires = [{"from": str(source), "to": str(end)} for source, end in self._wires]
        written = {"blocks": self._blocks, "wires": wires}  # as they stand in a file already
        return GRAPH_FILE.written(sections | {key: {} for key in written}) | written

    def names(self) -> Names:
        """Where everything went; markers that are still needed for that are made."""
        links = {}
        for link, item in self.linkage.links.items():
            seat = self._seats[link]
            markers = {
                name: self._put(link, m.at.z, m.direction, name, bool(m.dir or m.angle is not None))
                for name, m in item.markers.items()
            }
            if link == FRAME and not markers:
                continue
            origin = self.marker(link, 0j, 1 + 0j, link)
            turn = 0.0 if seat.e == 1 else -phase(seat.e)
            links[link] = LinkName(LinkRef(seat.block, seat.link), origin, turn, markers)
        joints = {name: self._joint(c) for name, c in self.found.layout.pairs.items()}
        loads = {name: tuple(blocks) for name, blocks in self._loads.items()}
        return Names(links, joints, loads, dict(self._couplings), dict(self._signals))

    def _joint(self, c: Connection) -> JointName:
        parts, turned = [], False
        for name, back in self.found.sums.get(c.name, ((c.name, False),)):
            block, end = self._ends[name]
            flipped = (end.later == self.found.pairs[name].first) != back
            parts.append((JointRef(block, end.joint), flipped))
            turned = end.turned
        (joint, flipped), *rest = parts
        earlier, later = c.links if end.later == c.second else reversed(c.links)
        shift = self._beyond.get((c.name, later), 0.0) - self._beyond.get((c.name, earlier), 0.0)
        shift = -shift if flipped != turned else shift
        return JointName(joint, flipped, turned, tuple(rest), c.ends, shift)


def _seated(value: Any, seat: LinkPlacement) -> Any:
    """A place, places or an angle of the document's frame of a link in that of its block."""
    if isinstance(value, float):
        return value - phase(seat.e)
    if isinstance(value, list) and all(isinstance(x, float) for x in value):
        return xy(seat.place(complex(*value)))
    if isinstance(value, dict):
        return value | {"points": _seated(value["points"], seat)}
    if isinstance(value, list):
        return [_seated(x, seat) for x in value]
    return xy(seat.place(Place.parse(value).z))  # as a file may have it


def _reserved(draft: BlockDraft) -> set[str]:
    """Names of markers that a block brings or may bring."""
    names = {seat.link for seat in draft.seats.values()} | set(draft.points.values())
    names |= {end.joint for end in draft.ends.values()}
    return names | set(REGISTRY[draft.type].built_in)
