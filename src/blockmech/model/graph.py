"""The graph: blocks wired by name. Local mistakes are refused at once, `check` finds the rest."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import networkx as nx

from blockmech.blocks.contract import Block, DrivingLink, Moving
from blockmech.blocks.frame import Frame
from blockmech.errors import GraphError, Problem, close_match, listed
from blockmech.loads.contract import Element
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.scene import Initial, Scene
from blockmech.model.structure import JointRef, MarkerRef, Structure, formation_order
from blockmech.values import Marker, Vector

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism
    from blockmech.result import Result


@dataclass(frozen=True)
class UnknownBlock:
    """A block of a type that is not installed: kept verbatim, drawn, never computed."""

    type: str
    raw: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Wire:
    """From a marker of an earlier link to a joint of a later block, or to an element."""

    source: str
    target: str

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


AnyBlock = Block | UnknownBlock


class Graph:
    """A mechanism as a block diagram.

    >>> import blockmech as bm
    >>> g = bm.Graph("fourbar")
    >>> g.add("frame", bm.Frame(markers={"A": (0, 0), "D": (5.5, 0)}))
    >>> g.add("crank", bm.Crank(length=2))
    >>> g.add("dyad", bm.RRR(l_i=6, l_j=3))
    >>> g.connect("frame.A", "crank.A")
    >>> g.connect("crank.B", "dyad.B")
    >>> g.connect("frame.D", "dyad.D")
    >>> g
    <Graph fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II RRR(dyad: 2,3)>
    """

    def __init__(
        self,
        name: str = "mechanism",
        *,
        title: str = "",
        gravity: complex | tuple[float, float] = 0j,
        drive: dict[str, LawOfMotion] | None = None,
    ) -> None:
        self.name = name
        self.title = title
        self.blocks: dict[str, AnyBlock] = {}
        self.wires: list[Wire] = []
        self.scene = Scene(gravity=Vector.parse(gravity))
        self.extras: dict[str, Any] = {}  # view, expect, source, notes: kept with the file
        self.file = ""  # where the graph was read from, for messages
        for driver, law in (drive or {}).items():
            self.drive(driver, law)

    # -- building ---------------------------------------------------------

    def add(self, name: str, block: AnyBlock) -> None:
        """Add a block under a name that is free.

        Raises `GraphError` for a taken or reserved name, or for what is not a block.
        """
        problem = self._name_problem(name, block)
        if problem:
            raise GraphError(problem)
        self.blocks[name] = block

    def connect(self, source: str, target: str) -> None:
        """Wire a marker ``"block.marker"`` to a joint or terminal ``"block.joint"``.

        Raises `GraphError` at once for what is locally wrong: unknown names, a
        joint that is fed already, an inner joint, a guide needed where there is none.
        """
        wire = Wire(source, target)
        problems = list(self._wire_problems(wire, self.wires))
        if problems:
            raise GraphError(problems)
        self.wires.append(wire)

    def drive(self, driver: str, law: LawOfMotion) -> None:
        """Give a driver its law of motion; replaces an earlier one."""
        self.scene = self.scene.model_copy(update={"drive": {**self.scene.drive, driver: law}})

    def start(self, driver: str, q: float = 0.0, rate: float = 0.0) -> None:
        """Give a driver its start for free motion: q [rad or m], rate [rad/s or m/s]."""
        initial = {**self.scene.initial, driver: Initial(q=q, rate=rate)}
        self.scene = self.scene.model_copy(update={"initial": initial})

    # -- checking ---------------------------------------------------------

    def check(self) -> list[Problem]:
        """All problems of the wiring, as data; an empty list is a valid mechanism."""
        problems = list(self._block_problems())
        for i, wire in enumerate(self.wires):
            problems += self._wire_problems(wire, self.wires[:i])
        problems += self._unwired()
        problems += self._scene_problems()
        if not any(p.code == "unknown-block" for p in problems):
            problems += self._cycles()
        return problems

    def structure(self) -> Structure:
        """The checked formation sequence. Raises `GraphError` with all problems."""
        problems = self.check()
        if problems:
            raise GraphError(problems)
        known = {n: b for n, b in self.blocks.items() if isinstance(b, Block)}
        frame = next(n for n, b in known.items() if isinstance(b, Frame))
        order = formation_order(known, self._dag())
        feeds: dict[JointRef, MarkerRef] = {}
        holds: dict[JointRef, MarkerRef] = {}
        for wire in self.wires:
            block, joint = wire.target.split(".")
            source, marker = wire.source.split(".")
            ref = MarkerRef(source, known[source].markers_of()[marker][0], marker)
            wires = holds if isinstance(known[block], Element) else feeds
            wires[JointRef(block, joint)] = ref
        moving = {n: b for n in order if isinstance(b := known[n], Moving)}
        elements = {n: b for n in sorted(known) if isinstance(b := known[n], Element)}
        return Structure(frame, moving, elements, known[frame], feeds, holds)

    def to_networkx(self) -> nx.DiGraph:
        """A copy of the block diagram: nodes are blocks, edges carry their ``wires``."""
        graph = nx.DiGraph(name=self.name)
        for name, block in self.blocks.items():
            kind = block.type if isinstance(block, UnknownBlock) else block.type_name
            graph.add_node(name, type=kind, block=block)
        for wire in self.wires:
            source, target = wire.source.split(".")[0], wire.target.split(".")[0]
            if not graph.has_edge(source, target):
                graph.add_edge(source, target, wires=[])
            graph.edges[source, target]["wires"].append((wire.source, wire.target))
        return graph

    # -- using ------------------------------------------------------------

    def compile(self) -> Mechanism:
        """Check the graph and freeze it into a mechanism that computes.

        The mechanism is a snapshot: the graph may be edited and compiled again.
        Raises `GraphError` with all problems.
        """
        from blockmech.mechanism import Mechanism

        return Mechanism(self.structure(), self.scene, name=self.name)

    def run(self, **request: Any) -> Result:
        """Compile and run; see `Mechanism.run`."""
        return self.compile().run(**request)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Graph:
        """Read a graph file. Raises `FormatError` with all problems of the file."""
        from blockmech.model.document import load

        return load(path)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the canonical graph file, atomically."""
        from blockmech.model.document import save

        save(self, path)

    def to_json(self) -> str:
        """The canonical text of the graph file."""
        from blockmech.model.document import dumps

        return dumps(self)

    def __repr__(self) -> str:
        if self.check():
            return f"<Graph {self.name}: {len(self.blocks)} blocks, not complete: see check()>"
        s = self.structure()
        return (
            f"<Graph {self.name}: {len(s.links) - 1} moving links, {s.pairs} pairs, "
            f"mobility {s.mobility}; {s.formula}>"
        )

    def _repr_svg_(self) -> str:
        from blockmech.draw import diagram_svg

        return diagram_svg(self)

    # -- the checks, one rule each -----------------------------------------

    def _name_problem(self, name: str, block: object) -> Problem | None:
        if not isinstance(name, str) or not name or "." in name or "/" in name:
            return Problem(
                "bad-name",
                str(name) or '""',
                "not a block name",
                'a name is not empty and has no "." or "/"',
                "choose another name",
            )
        if name in self.blocks:
            return Problem(
                "duplicate-block",
                name,
                "the name is taken",
                f"taken: {listed(self.blocks)}",
                "choose another name",
            )
        if not isinstance(block, Block | UnknownBlock):
            return Problem(
                "not-a-block",
                name,
                f"{type(block).__name__} is not a block",
                "",
                'call the class, e.g. add("crank", Crank(length=2.0))',
            )
        return None

    def _block_problems(self) -> Iterable[Problem]:
        from blockmech.blocks.contract import REGISTRY

        frames = [n for n, b in self.blocks.items() if isinstance(b, Frame)]
        if not frames:
            yield Problem(
                "no-frame",
                "blocks",
                "no block of type frame",
                "a mechanism has one fixed link",
                "add a frame with a marker for each pivot and guide",
            )
        for name in frames[1:]:
            yield Problem(
                "two-frames",
                name,
                f"a second frame beside {frames[0]}",
                "a mechanism has one fixed link",
                f"move its markers to {frames[0]}",
            )
        for name, block in self.blocks.items():
            if isinstance(block, UnknownBlock):
                yield REGISTRY.unknown(block.type, name)

    def _wire_problems(self, wire: Wire, earlier: list[Wire]) -> Iterable[Problem]:
        marker = yield from self._source(wire)
        yield from self._target(wire, marker, earlier)

    def _source(self, wire: Wire) -> Any:
        block, problem = self._end(wire, wire.source)
        if problem:
            yield problem
        if not isinstance(block, Block):
            return None
        name = wire.source.split(".")[1]
        if isinstance(block, Element):
            yield Problem(
                "not-a-marker",
                wire.source,
                f"{block.type_name} has no markers",
                "a wire starts at a marker of a link and ends at the element",
                f"turn the wire round: {wire.target} -> {wire.source}",
            )
            return None
        markers = block.markers_of()
        if name not in markers:
            yield Problem(
                "unknown-marker",
                wire.source,
                f'no marker "{name}"',
                f"markers there: {listed(markers)}",
                close_match(name, markers) or "add the marker to a link of the block",
            )
            return None
        return markers[name][1]

    def _target(self, wire: Wire, marker: Any, earlier: list[Wire]) -> Iterable[Problem]:
        block, problem = self._end(wire, wire.target)
        if problem:
            yield problem
        if not isinstance(block, Block):
            return
        name = wire.target.split(".")[1]
        if isinstance(block, Element):
            ports = list(block.terminals)
        else:
            ports = [j.name for j in block.joints.values() if j.outer]
        if name not in ports:
            inner = name in block.joints
            yield Problem(
                "unknown-joint",
                wire.target,
                "an inner joint takes no wire" if inner else f'no joint "{name}"',
                f"joints that take a wire: {listed(ports)}" if ports else "it takes no wires",
                close_match(name, ports),
            )
            return
        first = next((w for w in earlier if w.target == wire.target), None)
        if first is not None:
            yield Problem(
                "double-wire",
                wire.target,
                f"already fed by {first.source}, cannot also take {wire.source}",
                "a joint has one source",
                f"remove one of: {first}; {wire}",
            )
        if wire.source.split(".")[0] == wire.target.split(".")[0]:
            yield Problem(
                "self-wire",
                wire.target,
                f"fed by {wire.source} of the same block",
                "a joint is fed by an earlier block",
                "wire it to another block",
            )
        pointlike = isinstance(marker, Marker) and marker.angle is None and marker.dir is None
        if pointlike and isinstance(block, Moving) and block.joints[name].kind == "P":
            yield Problem(
                "pair-mismatch",
                wire.target,
                f"a prismatic joint needs a guide, {wire.source} is a point",
                "a guide is a marker with a direction",
                f'give {wire.source} an "angle" [rad] or a "dir" [dx, dy]',
            )

    def _end(self, wire: Wire, end: str) -> tuple[AnyBlock | None, Problem | None]:
        parts = end.split(".")
        if len(parts) != 2 or not all(parts):
            return None, Problem(
                "bad-address",
                end or '""',
                f'not an address, in wire "{wire}"',
                'an address is "block.joint" or "block.marker"',
                "",
            )
        if parts[0] not in self.blocks:
            return None, Problem(
                "no-such-block",
                end,
                f'no block "{parts[0]}"',
                f"blocks: {listed(self.blocks)}",
                close_match(parts[0], self.blocks) or "add the block first",
            )
        return self.blocks[parts[0]], None

    def _unwired(self) -> Iterable[Problem]:
        fed = {w.target for w in self.wires}
        for name, block in self.blocks.items():
            if isinstance(block, Moving):
                ports = [j.name for j in block.joints.values() if j.outer]
            elif isinstance(block, Element):
                ports = list(block.terminals)
            else:
                continue
            for port in ports:
                if f"{name}.{port}" not in fed:
                    yield Problem(
                        "unwired-joint",
                        f"{name}.{port}",
                        "nothing is wired to it",
                        "every joint is fed once",
                        f'connect("block.marker", "{name}.{port}")',
                    )

    def _scene_problems(self) -> Iterable[Problem]:
        drivers = [n for n, b in self.blocks.items() if isinstance(b, DrivingLink)]
        for section in ("drive", "initial"):
            for name in getattr(self.scene, section):
                if name not in drivers:
                    yield Problem(
                        "unknown-driver",
                        f"scene.{section}.{name}",
                        f'no driving link "{name}"',
                        f"driving links: {listed(drivers) or 'none'}",
                        close_match(name, drivers),
                    )

    def _cycles(self) -> Iterable[Problem]:
        from blockmech.model.cycles import diagnose_cycle

        for component in nx.strongly_connected_components(self._dag()):
            if len(component) > 1:
                yield diagnose_cycle(self, sorted(component))

    def _dag(self) -> nx.DiGraph:
        graph = nx.DiGraph()
        graph.add_nodes_from(n for n, b in self.blocks.items() if not isinstance(b, Element))
        for wire in self.wires:
            source, target = wire.source.split(".")[0], wire.target.split(".")[0]
            if source in graph and target in graph and source != target:
                graph.add_edge(source, target)
        return graph
