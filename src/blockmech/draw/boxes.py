"""What a block diagram shows of a graph, complete or not: boxes, ports, wires and words.

Nothing here is placed yet. Everything is read from the declarations of the blocks;
a block of unknown type, or one that a wire names in vain, gets the ports that its
wires name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blockmech.blocks.contract import Moving
from blockmech.blocks.frame import Frame
from blockmech.draw.layout import Box, Ends
from blockmech.draw.palette import SMALL, TEXT
from blockmech.draw.paper import shown_name, text_width
from blockmech.errors import listed
from blockmech.loads.contract import Element
from blockmech.mechanism import Mechanism
from blockmech.model.diagram import UnknownBlock, Wire
from blockmech.model.graph import Graph

Kind = Literal["frame", "driver", "group", "element", "unknown", "missing"]
MOST = 40  # blocks in a diagram; a page holds no more
PAD = 5.0  # [pt] between a box's edge and its words


@dataclass(frozen=True)
class Port:
    """A joint or a terminal on the left edge; ``pair`` is "R", "P" or "" for a terminal."""

    name: str
    pair: str = ""
    wired: bool = True

    @property
    def label(self) -> str:
        """Name and pair type."""
        return shown_name(self.name, 16) + (f" ({self.pair})" if self.pair else "")


@dataclass(frozen=True)
class Shown:
    """A block as the diagram shows it."""

    name: str
    kind: Kind
    words: str  # under the name: class and kind, or the type
    ports: tuple[Port, ...]
    markers: tuple[str, ...]  # used ones, once per wire
    drive: str = ""  # symbol of a driver's coordinate and effort, e.g. "q,τ"

    def box(self) -> Box:
        """Its size for the layout."""
        small = self.kind == "element"
        name = text_width(shown_name(self.name), SMALL if small else TEXT, bold=True)
        words = text_width(shown_name(self.words), SMALL)
        left = max((text_width(p.label, SMALL) for p in self.ports), default=0.0)
        right = max((text_width(shown_name(m, 16), SMALL) for m in self.markers), default=0.0)
        gap = 9.0 if left and right else 0.0
        inside = left + 9.0 + words if small else max(words, left + gap + right)
        return Box(
            self.name,
            max(name, inside) + 2 * PAD,
            tuple(p.name for p in self.ports),
            head=1 if small else 2,
            above=2 if self.drive else 0,
            first=self.kind == "frame",
        )


@dataclass(frozen=True)
class Flow:
    """A wire: where it runs, and whether anything flows forward; effort always flows back."""

    ends: Ends
    forward: bool


@dataclass(frozen=True)
class Content:
    """All that the diagram shows."""

    title: str
    subtitle: str
    complete: bool
    blocks: tuple[Shown, ...]
    flows: tuple[Flow, ...]


def graph_of(mechanism: Mechanism) -> Graph:
    """The graph of a compiled mechanism."""
    structure = mechanism.structure
    graph = Graph(mechanism.name)
    graph.scene = mechanism.scene
    graph.blocks = {structure.frame: structure.fixed, **structure.blocks, **structure.elements}
    ends = {**structure.feeds, **structure.holds}
    graph.wires = [Wire(str(marker), str(joint)) for joint, marker in ends.items()]
    return graph


def content_of(graph: Graph) -> Content:
    """What the diagram of a graph shows."""
    ends = [_ends(w) for w in graph.wires]
    wires = [w for w in ends if w is not None]
    problems = graph.check()
    if problems:
        codes = {p.code: [q.where for q in problems if q.code == p.code] for p in problems}
        found = "; ".join(f"{code}: {listed(where, 4)}" for code, where in codes.items())
        subtitle = f"not complete – {found}"
    else:
        subtitle = graph.structure().formula.replace("->", "→")
    named = list(dict.fromkeys([*graph.blocks, *(n for w in wires for n in (w.source, w.target))]))
    if len(named) > MOST:
        subtitle = f"first {MOST} of {len(named)} blocks – {subtitle}"
        named = _first(graph, named)
    drawn = [w for w in wires if w.source in named and w.target in named]
    fed = {(w.target, w.port) for w in wires}
    return Content(
        title=graph.title or graph.name,
        subtitle=subtitle,
        complete=not problems,
        blocks=tuple(_shown(graph, name, drawn, fed) for name in named),
        flows=tuple(_flow(graph, w) for w in drawn),
    )


def _first(graph: Graph, named: list[str]) -> list[str]:
    """The first blocks: of a valid graph in the order of formation, else as they were added."""
    if not graph.check():
        s = graph.structure()
        named = [s.frame, *s.blocks, *s.elements]
    return named[:MOST]


def _ends(wire: Wire) -> Ends | None:
    """The two addresses, or None where one of them is none at all."""
    source, _, marker = wire.source.partition(".")
    target, _, port = wire.target.partition(".")
    return Ends(source, marker, target, port) if all((source, marker, target, port)) else None


def _shown(graph: Graph, name: str, wires: list[Ends], fed: set[tuple[str, str]]) -> Shown:
    block = graph.blocks.get(name)
    declared, pair = _ports(block)
    named = [w.port for w in wires if w.target == name]
    ports = tuple(
        Port(p, pair.get(p, ""), wired=(name, p) in fed) for p in dict.fromkeys([*declared, *named])
    )
    markers = tuple(w.marker for w in wires if w.source == name)
    if isinstance(block, Frame):
        return Shown(name, "frame", "fixed link", ports, markers)
    if isinstance(block, Moving):
        words = f"{block.group_class} {block.kind}".strip()
        drives = (f"q [{j.coordinate_unit}], τ [{j.effort_unit}]" for j in block.driven)
        kind: Kind = "group" if block.closes else "driver"
        return Shown(name, kind, words, ports, markers, "; ".join(dict.fromkeys(drives)))
    if isinstance(block, Element):
        words = block.type_name.rsplit(".", 1)[-1].replace("_", " ")
        return Shown(name, "element", words, ports, markers)
    if isinstance(block, UnknownBlock):
        return Shown(name, "unknown", f"{block.type}?", ports, markers)
    return Shown(name, "missing", "no such block", ports, markers)


def _ports(block: object) -> tuple[list[str], dict[str, str]]:
    """Names of the ports that a block declares, and pair types of its joints."""
    if isinstance(block, Moving):
        outer = [j for j in block.joints.values() if j.outer]
        return [j.name for j in outer], {j.name: j.kind for j in outer}
    if isinstance(block, Element):
        return list(block.terminals), {}
    return [], {}


def _flow(graph: Graph, ends: Ends) -> Flow:
    target = graph.blocks.get(ends.target)
    if isinstance(target, Element):
        return Flow(ends, forward=bool(target.reads().get(ends.port)))
    return Flow(ends, forward=True)
