"""The graph: blocks wired by name. Local mistakes are refused at once, `check` finds the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.frame import Frame
from blockmech.errors import GraphError, Problem
from blockmech.loads.contract import Element
from blockmech.model import checks
from blockmech.model.attributes import KnownAttributes
from blockmech.model.diagram import AnyBlock, UnknownBlock, Wire
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.scene import Initial, Scene, Stops
from blockmech.model.structure import JointRef, MarkerRef, Structure, formation_order
from blockmech.values import Vector

if TYPE_CHECKING:
    import networkx as nx


class Graph(KnownAttributes):
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

    name: str
    title: str
    blocks: dict[str, AnyBlock]
    wires: list[Wire]
    extras: dict[str, Any]  # view, expect, source, notes: kept with the file
    file: str  # where the graph was read from, for messages
    _scene: Scene

    def __init__(
        self,
        name: str = "mechanism",
        *,
        title: str = "",
        gravity: complex | Sequence[float] = 0j,
        drive: Mapping[str, LawOfMotion] | None = None,
    ) -> None:
        self.name = name
        self.title = title
        self.blocks = {}
        self.wires = []
        self.scene = Scene(gravity=gravity)  # type: ignore[arg-type]
        self.extras = {}
        self.file = ""
        for driver, law in (drive or {}).items():
            self.drive(driver, law)

    # -- the scene --------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """Gravity, drives, start and end stops. Set as a whole; the parts have their methods."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        """Replace the scene. Raises `GraphError` for what is none."""
        if not isinstance(scene, Scene):
            found = f"{type(scene).__name__} is no scene"
            raise GraphError(Problem("wrong-type", "Graph.scene", found, "", Scene.remade))
        self.__dict__["_scene"] = scene

    @property
    def gravity(self) -> Vector:
        """Gravity [m/s2] of the scene."""
        return self.scene.gravity

    @gravity.setter
    def gravity(self, gravity: complex | Sequence[float] | Vector) -> None:
        """Set gravity [m/s2], (x, y) or x + iy. Raises `GraphError` for what is no vector."""
        made = Scene(gravity=gravity)  # type: ignore[arg-type]
        self.scene = self.scene.model_copy(update={"gravity": made.gravity})

    # -- building ---------------------------------------------------------

    def add(self, name: str, block: AnyBlock) -> None:
        """Add a block under a name that is free.

        Raises `GraphError` for a taken or reserved name, or for what is not a block.
        """
        problem = checks.name_problem(self.blocks, name, block)
        if problem:
            raise GraphError(problem)
        self.blocks[name] = block

    def connect(self, source: str, target: str) -> None:
        """Wire a marker ``"block.marker"`` to a joint or terminal ``"block.joint"``.

        Raises `GraphError` at once for what is locally wrong: unknown names, a
        joint that is fed already, an inner joint, a guide needed where there is none.
        """
        wire = Wire(source, target)
        fed = next((w for w in self.wires if w.target == target), None)
        problems = list(checks.wire_problems(self.blocks, wire, fed))
        if problems:
            raise GraphError(problems)
        self.wires.append(wire)

    def drive(self, driver: str, law: LawOfMotion) -> None:
        """Give a driver its law of motion; replaces an earlier one.

        Raises `GraphError` for what is not a law.
        """
        if not isinstance(law, LawOfMotion):
            raise GraphError(
                Problem(
                    "not-a-law",
                    f"scene.drive.{driver}",
                    f"{type(law).__name__} is not a law of motion",
                    "",
                    f'e.g. drive("{driver}", ConstantRate(rate=10.0))',
                )
            )
        self.scene = self.scene.model_copy(update={"drive": {**self.scene.drive, driver: law}})

    def start(self, driver: str, q: float = 0.0, rate: float = 0.0) -> None:
        """Give a driver its start for free motion: q [rad or m], rate [rad/s or m/s]."""
        initial = {**self.scene.initial, driver: Initial(q=q, rate=rate)}
        self.scene = self.scene.model_copy(update={"initial": initial})

    def stop(self, driver: str, low: float | None = None, high: float | None = None) -> None:
        """Give a driver end stops for free motion: lowest and highest coordinate [rad or m].

        Raises `GraphError` where neither is given or they are in the wrong order.
        """
        made = Stops(**{"from": low, "to": high})
        self.scene = self.scene.model_copy(update={"stops": {**self.scene.stops, driver: made}})

    # -- checking ---------------------------------------------------------

    def check(self) -> list[Problem]:
        """All problems of the wiring, as data; an empty list is a valid mechanism."""
        return checks.all_problems(self.blocks, self.wires, self.scene)

    def remarks(self) -> list[Problem]:
        """Unused and unreachable things: not wrong, but perhaps forgotten."""
        return checks.remarks(self.blocks, self.wires)

    def structure(self) -> Structure:
        """The checked formation sequence. Raises `GraphError` with all problems."""
        problems = self.check()
        if problems:
            raise GraphError(problems)
        known = {n: b for n, b in self.blocks.items() if isinstance(b, Block)}
        frame = next(n for n, b in known.items() if isinstance(b, Frame))
        order = formation_order(known, checks.block_dag(self.blocks, self.wires))
        feeds: dict[JointRef, MarkerRef] = {}
        holds: dict[JointRef, MarkerRef] = {}
        markers: dict[str, Any] = {}  # a frame may have thousands
        for wire in self.wires:
            block, joint = wire.target.split(".")
            source, marker = wire.source.split(".")
            if source not in markers:
                markers[source] = known[source].markers_of()
            ref = MarkerRef(source, markers[source][marker][0], marker)
            wires = holds if isinstance(known[block], Element) else feeds
            wires[JointRef(block, joint)] = ref
        moving = {n: b for n in order if isinstance(b := known[n], Moving)}
        elements = {n: b for n in sorted(known) if isinstance(b := known[n], Element)}
        return Structure(frame, moving, elements, known[frame], feeds, holds)

    def to_networkx(self) -> nx.DiGraph:
        """A copy of the block diagram: nodes are blocks, edges carry their ``wires``."""
        import networkx as nx

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

    def __repr__(self) -> str:
        if self.check():
            return f"<Graph {self.name}: {len(self.blocks)} blocks, not complete: see check()>"
        s = self.structure()
        return (
            f"<Graph {self.name}: {len(s.links) - 1} moving links, {s.pairs} pairs, "
            f"mobility {s.mobility}; {s.formula}>"
        )
