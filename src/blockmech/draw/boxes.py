"""What a block diagram shows of a graph, complete or not: boxes, ports, wires and words.

Nothing here is placed yet. Everything is read from the declarations of the blocks;
a block of unknown type, or one that a wire names in vain, gets the ports that its
wires name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from blockmech.blocks.contract import Moving
from blockmech.blocks.frame import Frame
from blockmech.compiled import Compiled
from blockmech.draw.layout import Box, Ends
from blockmech.draw.palette import SMALL, TEXT
from blockmech.draw.paper import shown_name, text_width
from blockmech.errors import listed
from blockmech.loads.contract import Element
from blockmech.model.diagram import UnknownBlock, Wire
from blockmech.model.graph import Graph
from blockmech.model.naming import Names
from blockmech.model.structure import LinkRef, Structure

Kind = Literal["frame", "driver", "group", "element", "unknown", "missing"]
MOST = 40  # blocks in a diagram; a page holds no more
PAD = 5.0  # [pt] between a box's edge and its words


@dataclass(frozen=True)
class Port:
    """A joint or a terminal on the left edge; ``pair`` is "R", "P" or "" for a terminal."""

    name: str
    pair: str = ""
    wired: bool = True
    said: str = ""  # its name in a document of links and joints

    @property
    def label(self) -> str:
        """Name and pair type."""
        return shown_name(self.said or self.name, 16) + (f" ({self.pair})" if self.pair else "")


@dataclass(frozen=True)
class Shown:
    """A block as the diagram shows it."""

    name: str
    kind: Kind
    words: str  # under the name: class and kind, or the type
    ports: tuple[Port, ...]
    markers: tuple[str, ...]  # words beside the used ones, once per wire
    drive: tuple[str, ...] = ()  # a driver's coordinate and effort: "q [rad]", "τ [N m]"

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
    word: str  # beside its marker


@dataclass(frozen=True)
class Content:
    """All that the diagram shows."""

    title: str
    subtitle: str
    complete: bool
    blocks: tuple[Shown, ...]
    flows: tuple[Flow, ...]


def graph_of(mechanism: Compiled) -> Graph:
    """The graph of a compiled mechanism."""
    structure = mechanism.structure
    graph = Graph(mechanism.name)
    graph.scene = mechanism.scene
    graph.blocks = {structure.frame: structure.fixed, **structure.blocks, **structure.elements}
    ends = {**structure.feeds, **structure.holds}
    graph.wires = [Wire(str(marker), str(joint)) for joint, marker in ends.items()]
    return graph


@dataclass(frozen=True)
class Words:
    """What a document of links and joints calls the parts of its graph; nothing without one."""

    links: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # block -> links in it
    joints: Mapping[str, str] = field(default_factory=dict)  # block.joint -> joint
    markers: Mapping[str, str] = field(default_factory=dict)  # block.marker -> link or marker

    @classmethod
    def of(cls, names: Names | None, graph: Graph) -> Words:
        """The words of the document that a graph was made of."""
        if names is None:
            return cls()
        said = {where.link: link for link, where in names.links.items()}
        links = {
            name: tuple(said[ref] for x in b.link_names if (ref := LinkRef(name, x)) in said)
            for name, b in graph.blocks.items()
            if isinstance(b, Moving)
        }
        markers = {str(where.marker): link for link, where in names.links.items()}
        for where in names.links.values():
            markers |= {str(ref): marker for marker, ref in where.markers.items()}
        joints = {str(where.joint): name for name, where in names.joints.items()}
        return cls(links, joints, markers)

    def formula(self, structure: Structure) -> str:
        """The structural formula, of a document with its links."""
        if not self.links:
            return structure.formula
        return " -> ".join(
            f"{b.group_class}{f' {b.kind}' if b.closes else ''}({', '.join(self.links[n])})"
            for n, b in structure.blocks.items()
        )

    def beside(self, wire: Ends) -> str:
        """The word beside the marker of a wire."""
        marker = self.markers.get(f"{wire.source}.{wire.marker}", wire.marker)
        return self.joints.get(f"{wire.target}.{wire.port}", marker)


def content_of(graph: Graph, names: Names | None = None) -> Content:
    """What the diagram of a graph shows; ``names`` are those of links and joints."""
    said = Words.of(names, graph)
    ends = [_ends(w) for w in graph.wires]
    wires = [w for w in ends if w is not None]
    problems = graph.check()
    if problems:
        codes = {p.code: [q.where for q in problems if q.code == p.code] for p in problems}
        found = "; ".join(f"{code}: {listed(where, 4)}" for code, where in codes.items())
        subtitle = f"not complete – {found}"
    else:
        subtitle = said.formula(graph.structure()).replace("->", "→")
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
        blocks=tuple(_shown(graph, name, drawn, fed, said) for name in named),
        flows=tuple(_flow(graph, w, said) for w in drawn),
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


def _shown(
    graph: Graph, name: str, wires: list[Ends], fed: set[tuple[str, str]], said: Words
) -> Shown:
    block = graph.blocks.get(name)
    declared, pair = _ports(block)
    named = [w.port for w in wires if w.target == name]
    ports = tuple(
        Port(p, pair.get(p, ""), (name, p) in fed, said.joints.get(f"{name}.{p}", ""))
        for p in dict.fromkeys([*declared, *named])
    )
    markers = tuple(said.beside(w) for w in wires if w.source == name)
    if isinstance(block, Frame):
        return Shown(name, "frame", "fixed link", ports, markers)
    if isinstance(block, Moving):
        words = f"{block.group_class} {block.kind}".strip()
        if name in said.links:
            words = f"{words}: {', '.join(said.links[name])}"
        kind: Kind = "group" if block.closes else "driver"
        return Shown(name, kind, words, ports, markers, _drive(block))
    if isinstance(block, Element):
        words = block.type_name.rsplit(".", 1)[-1].replace("_", " ")
        return Shown(name, "element", words, ports, markers)
    if isinstance(block, UnknownBlock):
        return Shown(name, "unknown", f"{block.type}?", ports, markers)
    return Shown(name, "missing", "no such block", ports, markers)


def _drive(block: Moving) -> tuple[str, ...]:
    """Symbols of the coordinates and efforts of a block's drivers, with all their units."""
    units = {"q": [j.coordinate_unit for j in block.driven]}
    units["τ"] = [j.effort_unit for j in block.driven]
    found = {symbol: " ".join(f"[{u}]" for u in dict.fromkeys(us)) for symbol, us in units.items()}
    return tuple(f"{symbol} {said}" for symbol, said in found.items() if said)


def _ports(block: object) -> tuple[list[str], dict[str, str]]:
    """Names of the ports that a block declares, and pair types of its joints."""
    if isinstance(block, Moving):
        outer = [j for j in block.joints.values() if j.outer]
        return [j.name for j in outer], {j.name: j.kind for j in outer}
    if isinstance(block, Element):
        return list(block.terminals), {}
    return [], {}


def _flow(graph: Graph, ends: Ends, said: Words) -> Flow:
    target = graph.blocks.get(ends.target)
    if isinstance(target, Element):
        return Flow(ends, bool(target.reads().get(ends.port)), said.beside(ends))
    return Flow(ends, True, said.beside(ends))
