"""The graph: blocks wired by name. Local mistakes are refused at once, `check` finds the rest."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any, Self

from blockmech.blocks.block import REGISTRY
from blockmech.blocks.frame import Frame
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    MOST,
    FormatError,
    GraphError,
    Problem,
    RequestError,
    in_file,
    listed,
)
from blockmech.ground.values import Vector
from blockmech.model import checks
from blockmech.model.diagram import GRAPH_FILE, AnyBlock, UnknownBlock, Wire, python_keys
from blockmech.model.document import Document
from blockmech.model.flat import Flat, flattened
from blockmech.model.form import Draft
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.parameters import interface, named
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.model.subgraph import Subgraph, resolving
from blockmech.model.versions import VERSION
from blockmech.model.wires import checked_wires, wire_problems

if TYPE_CHECKING:
    import networkx as nx


class Graph(Document):
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

    form = GRAPH_FILE
    blocks: dict[str, AnyBlock]
    parameters: dict[str, str | list[str]]  # name -> addresses, for a graph with this one inside
    _scene: Scene

    @declared
    def __init__(
        self,
        name: str = "mechanism",
        *,
        title: str = "",
        gravity: complex | Sequence[float] = 0j,
        drive: Mapping[str, LawOfMotion] | None = None,
    ) -> None:
        super().__init__(name, title=title)
        self.gravity = gravity
        for driver, law in (drive or {}).items():
            self.drive(driver, law)

    # -- files ------------------------------------------------------------

    def _fill(self, draft: Draft) -> None:
        draft.note(python_keys(self.scene, draft.raw))
        unread = set()
        with resolving():
            for name, block in draft.items("blocks"):
                if isinstance(block, Subgraph):
                    try:
                        block = self._opened(name, block)
                    except (FormatError, GraphError) as error:
                        draft.note(error.problems)
                        block = None
                if block is None:  # a stand-in, so that wires to it are no problem
                    unread.add(name)
                self.blocks[name] = block or UnknownBlock("")
        if not (draft.wrong & {"blocks", "wires"} or draft.doubled):
            draft.fit += islice(self._wiring_problems(unread, bool(draft.content)), MOST + 1)

    def _wiring_problems(self, unread: set[str], wrong: bool) -> Iterator[Problem]:
        """All that is wrong with the graph of a file, where its wires or else ``wrong`` are.

        What follows from blocks that are ``unread`` and from wires left out is not reported.
        """
        flat = self._flattened()
        local_wires = flat.wires[len(flat.wires) - len(self.wires) :]
        faulty = [wire for wire, _, problems in checked_wires(flat.blocks, local_wires) if problems]
        refused = {end for wire in faulty for end in wire.ends}  # or the other way round
        for problem in Graph.check(self) if wrong or faulty else ():
            head, *inside = problem.where.split(".")
            follows = {
                "unknown-block": problem.where in unread,
                "unwired-joint": problem.where in refused,
                "unknown-driver": problem.where.rsplit(".", 1)[-1] in unread,
                "no-frame": bool(unread),
                "bad-address": head in unread and len(inside) > 1,
            }
            if not follows.get(problem.code, False):
                yield problem

    # -- graphs inside ----------------------------------------------------

    def flat(self) -> Self:
        """The same mechanism with the blocks of subgraphs written out, as ``knee.dyad``.

        A graph without subgraphs is returned as it is.

        >>> g.flat() is g
        True
        """
        if not any(isinstance(block, Subgraph) for block in self.blocks.values()):
            return self
        flat, copied = self._flattened(), copy.copy(self)
        copied.blocks, copied.wires, copied.scene = flat.blocks, flat.wires, flat.scene
        return copied

    @property
    def size(self) -> int:
        """Number of blocks, those of subgraphs included.

        >>> g.size
        5
        """
        return sum(b.size if isinstance(b, Subgraph) else 1 for b in self.blocks.values())

    def _flattened(self) -> Flat:
        with resolving() as files:
            for name, block in self.blocks.items():
                if isinstance(block, Subgraph) and block.content is None:
                    self.blocks[name] = self._opened(name, block)
            if self.size > files.blocks:
                message = f"{self.size:.6g} blocks with those of graphs inside"
                valid = f"a mechanism has at most {files.blocks}"
                raise GraphError(Problem("too-large", "blocks", message, valid))
        return flattened(self)

    def _opened(self, name: str, block: Subgraph) -> Subgraph:
        """A block with the graph inside of it read and checked by itself.

        Raises `FormatError`, `GraphError`, which say where inside.
        """
        where = f"blocks.{name}"
        if block.content is None:
            with resolving() as files, files.inside(self.file):
                if block.file:
                    block = block.holding(files.read(block.file, f"{where}.file", _part))
                else:
                    block = block.holding(_inline(block, self.file, where))
        if block.given and (problems := list(_misfits(block, where))):
            raise GraphError(problems)
        return block

    def in_folder(self, folder: str) -> Self:
        """The document for another folder, with rewritten paths to other files.

        >>> leg = bm.Graph("leg")
        >>> leg.in_folder("library").name
        'leg'
        """
        old = os.path.dirname(self.file)
        copied = self.snapshot()
        for name, block in self.blocks.items():
            if isinstance(block, Subgraph):
                copied.blocks[name] = block.seen_from(old, folder)
        return copied

    # -- the scene --------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """Gravity, drives, start and end stops. Set as a whole; the parts have their methods.

        >>> g.scene.drive["crank"].rate
        10.0
        """
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        """Replace the scene. Raises `GraphError` for what is none."""
        if not isinstance(scene, Scene):
            message = f"{type(scene).__name__} is no scene"
            raise GraphError(Problem("wrong-type", "Graph.scene", message, "", Scene.remade))
        self.__dict__["_scene"] = scene

    @property
    def gravity(self) -> Vector:
        """Gravity [m/s2] of the scene.

        >>> g.gravity = (0.0, -9.81)
        >>> g.gravity
        0-9.81j
        """
        return self.scene.gravity

    @gravity.setter
    def gravity(self, gravity: complex | Sequence[float] | Vector) -> None:
        """Set gravity [m/s2], (x, y) or x + iy. Raises `GraphError` for what is no vector."""
        made = Scene(gravity=gravity)  # type: ignore[arg-type]
        self.scene = self.scene.model_copy(update={"gravity": made.gravity})

    # -- building ---------------------------------------------------------

    def add(self, name: str, block: AnyBlock | Graph | str, **keys: Any) -> None:
        """Add a block under an unused name; a graph becomes a subgraph in its present state.

        Parameters
        ----------
        block : the block, or its type, such as "driver.crank", whose keys then follow

        Raises `GraphError` for a taken or reserved name, or for what is not a block, and
        `FormatError` for the file of a graph that cannot be read.

        >>> g.add("brake", "load.couple", moment=-3.0)
        >>> g.add("weight", bm.Force(force=(0.0, -9.81)))
        """
        if isinstance(block, str):
            if block not in REGISTRY:
                raise GraphError(REGISTRY.unknown(block, name))
            block = REGISTRY[block](**keys)
        elif keys:
            message, remedy = f"{listed(keys)} beside a block", "give them to the block"
            raise GraphError(Problem("wrong-value", name, message, "", remedy))
        if isinstance(block, Graph):
            block = Subgraph(graph=block)  # type: ignore[arg-type]
        problem = checks.name_problem(self.blocks, name, block)
        if problem:
            raise GraphError(problem)
        complete = self._opened(name, block) if isinstance(block, Subgraph) else block
        self.blocks[name] = complete  # type: ignore[assignment]

    def connect(self, source: str, target: str) -> None:
        """Wire a marker ``"block.marker"`` to a joint or terminal ``"block.joint"``.

        A signal, the output ``"block.output"`` of a signal block or any output of the mechanism
        by its name, is wired to an input of a signal block or to ``"load.law"``.

        Raises `GraphError` at once for what is locally wrong: unknown names, a
        joint that is fed already, an inner joint, a guide needed where there is none.

        >>> g.add("weight", bm.Force(force=(0.0, -9.81)))
        >>> g.connect("dyad.C", "weight.at")
        """
        wire = Wire(source, target)
        GraphError.raise_for(self.problems_of(wire))
        self.wires.append(wire)

    def problems_of(self, wire: Wire) -> list[Problem]:
        """Local mistakes of a new wire; see `connect`.

        >>> from blockmech.model.diagram import Wire
        >>> [problem.code for problem in g.problems_of(Wire("crank.B", "dyad.B"))]
        ['double-wire']
        """
        fed = next((w for w in self.wires if w.target == wire.target), None)
        subset = self._near({str(end).partition(".")[0] for end in wire.ends})
        problems: list[Problem] = []
        for graph in (subset, self):  # for messages all there is
            flat = graph._flattened()
            local = Wire(*map(flat.address, wire.ends))
            problems = list(wire_problems(flat.blocks, local, local.split_ends(flat.blocks), fed))
            if not problems:
                break
        return problems

    def _near(self, names: set[str]) -> Self:
        """The same with no more blocks than these, those that they stand on, and the frame."""
        subset = copy.copy(self)
        subset.wires, subset.blocks = [], {}
        waiting = {*names, *(n for n, b in self.blocks.items() if isinstance(b, Frame))}
        while waiting:
            name = waiting.pop()
            if name in self.blocks and name not in subset.blocks:
                subset.blocks[name] = block = self.blocks[name]
                waiting.add(getattr(block, "on", "").partition(".")[0])
        return subset

    def drive(self, driver: str, law: LawOfMotion) -> None:
        """Give a driver its law of motion; replaces an earlier one.

        Raises `GraphError` for what is not a law.

        >>> g.drive("crank", bm.motion.ConstantRate(rate="300rpm"))
        >>> g.run(at=0.5)["crank.rate"]
        array([31.41592654])
        """
        if not isinstance(law, LawOfMotion):
            where, message = f"scene.drive.{driver}", f"{type(law).__name__} is not a law of motion"
            remedy = f'e.g. drive("{driver}", bm.motion.ConstantRate(rate=10.0))'
            raise GraphError(Problem("not-a-law", where, message, "", remedy))
        self._give("drive", driver, law)

    @declared
    def _give(self, section: str, driver: str, item: Any) -> None:
        items = {**getattr(self.scene, section), driver: item}
        self.scene = self.scene.model_copy(update={section: items})

    # -- checking ---------------------------------------------------------

    def check(self) -> list[Problem]:
        """All problems of the wiring, as data; an empty list is a valid mechanism."""
        try:
            Graph.structure(self)
        except GraphError as error:
            return list(error.problems)
        return []

    def remarks(self) -> list[Problem]:
        """Unused and unreachable parts: not wrong, but perhaps forgotten.

        >>> g.remarks()
        []
        """
        flat = self.flat()
        return checks.remarks(flat.blocks, flat.wires)

    def structure(self) -> Structure:
        """The checked formation sequence. Raises `GraphError` with all problems.

        >>> print(g.structure().formula)
        I(crank: 0,1) -> II RRR(dyad: 2,3)
        """
        return checks.checked_structure(self._flattened())

    def to_networkx(self) -> nx.DiGraph:
        """A copy of the block diagram: nodes are blocks, edges carry their ``wires``.

        >>> sorted(g.to_networkx().edges)
        [('crank', 'dyad'), ('dyad', 'couple'), ('dyad', 'weightlike'), ('frame', 'crank'), ...
        """
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


def _part(path: str) -> Graph:
    """The graph in a file as a part of another one. Raises `FormatError`, `GraphError`."""
    content = Graph.load(path)
    GraphError.raise_for(in_file(_unfit(content), path))
    return content


def _inline(block: Subgraph, file: str, where: str) -> Graph:
    """The graph in a block as a part of another one. Raises `FormatError`, `GraphError`."""
    data = {"format": GRAPH_FILE.format, "version": VERSION, **(block.graph or {})}
    try:
        content = Graph.from_data(data, (), file)
        GraphError.raise_for(_unfit(content))
    except (FormatError, GraphError) as error:
        raise type(error)(
            p if p.file else replace(p, where=f"{where}.graph.{p.where}".rstrip("."))
            for p in error.problems
        ) from None
    return content


def _unfit(content: Graph) -> Iterator[Problem]:
    """What is wrong with a graph as a part of another one."""
    frames = [n for n, b in content.blocks.items() if isinstance(b, Frame)]
    if len(frames) > 1:
        message = f"it has two frames: {frames[0]} and {frames[1]}"
        valid = "a graph has one fixed link"
        yield Problem("two-frames", "", message, valid, f"move the markers to {frames[0]}")
    yield from content._flattened().problems
    if content.parameters:
        try:
            interface(content)
        except RequestError as error:
            yield from error.problems


def _misfits(block: Subgraph, where: str) -> Iterator[Problem]:
    """What is wrong with the numbers that a block gives the graph inside."""
    content, inside = block.content, f"{where}.parameters"
    numbers = interface(content)
    try:
        values = named({address: p for address, (p, _) in numbers.items()}, block.given)
        content.with_checked({path: x for p, x in values.items() for path in numbers[p.address][1]})
    except RequestError as error:
        yield from (replace(p, where=f"{inside}.{p.where}") for p in error.problems)
    except (FormatError, GraphError) as error:
        yield from (replace(p, where=inside, found=f"{p.where}: {p.found}") for p in error.problems)
