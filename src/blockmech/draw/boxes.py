"""What a block diagram shows of a graph, complete or not: boxes, ports, wires and words.

Nothing here is placed yet. Everything is read from the declarations of the blocks;
a block of unknown type, or one that a wire names in vain, gets the ports that its
wires name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from blockmech.blocks.contract import Moving
from blockmech.blocks.frame import Frame
from blockmech.compiled import Compiled
from blockmech.draw.layout import Box, Ends
from blockmech.draw.palette import SIZES, SMALL, TEXT
from blockmech.draw.paper import shown_name, text_width
from blockmech.errors import listed
from blockmech.loads.contract import Element
from blockmech.model.diagram import UnknownBlock, Wire
from blockmech.model.graph import Graph
from blockmech.model.naming import Names
from blockmech.model.structure import LinkRef, Structure

Kind = Literal["frame", "driver", "group", "element", "unknown", "missing"]
MOST = 40  # blocks in a diagram; a page holds no more


@dataclass(frozen=True)
class Port:
    """A joint or a terminal on the left edge; ``pair`` is "R", "P" or "" for a terminal."""

    name: str
    pair: str
    wired: bool
    label: str  # name and pair type


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
        gap = 2 * SIZES.pad if left and right else 0.0
        inside = left + 2 * SIZES.pad + words if small else max(words, left + gap + right)
        return Box(
            self.name,
            max(name, inside) + 2 * SIZES.pad,
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
    graph.blocks = {structure.frame: structure.fixed, **structure.blocks, **structure.elements}
    ends = {**structure.feeds, **structure.holds}
    graph.wires = [Wire(str(marker), str(joint)) for joint, marker in ends.items()]
    return graph


@dataclass(frozen=True)
class Words:
    """What a document of links and joints calls the parts of its graph; nothing without one."""

    links: Mapping[str, Sequence[str]]  # block -> links in it
    wires: Mapping[str, str]  # block.joint or block.marker -> joint, link or marker

    @classmethod
    def of(cls, names: Names | None, graph: Graph) -> Words:
        """The words of the document that a graph was made of."""
        if names is None:
            return cls({}, {})
        said = {where.link: link for link, where in names.links.items()}
        links = {
            name: [said[ref] for x in b.link_names if (ref := LinkRef(name, x)) in said]
            for name, b in graph.blocks.items()
            if isinstance(b, Moving)
        }
        wires = {str(where.joint): joint for joint, where in names.joints.items()}
        for link, where in names.links.items():
            wires[str(where.marker)] = link
            wires |= {str(ref): marker for marker, ref in where.markers.items()}
        return cls(links, wires)

    def formula(self, structure: Structure) -> str:
        """The structural formula, of a document with its links."""
        terms = (
            f"{b.group_class}{f' {b.kind}' if b.closes else ''}({', '.join(self.links[n])})"
            for n, b in structure.blocks.items()
            if self.links
        )
        return " -> ".join(terms) or structure.formula

    def beside(self, wire: Ends) -> str:
        """The word beside the marker of a wire."""
        marker = self.wires.get(f"{wire.source}.{wire.marker}", wire.marker)
        return self.wires.get(f"{wire.target}.{wire.port}", marker)


def content_of(graph: Graph, names: Names | None = None) -> Content:
    """What the diagram of a graph shows; ``names`` are those of links and joints."""
    said = Words.of(names, graph)
    wires = [ends for wire in graph.wires if all(ends := _ends(wire))]
    problems = graph.check()
    named = list(dict.fromkeys([*graph.blocks, *(n for w in wires for n in (w.source, w.target))]))
    if problems:
        codes = {p.code: [q.where for q in problems if q.code == p.code] for p in problems}
        found = "; ".join(f"{code}: {listed(where, 4)}" for code, where in codes.items())
        subtitle = f"not complete – {found}"
    else:
        s = graph.structure()
        subtitle = said.formula(s).replace("->", "→")
    if len(named) > MOST:  # of a valid graph in the order of formation
        subtitle = f"first {MOST} of {len(named)} blocks – {subtitle}"
        named = (named if problems else [s.frame, *s.blocks, *s.elements])[:MOST]
    drawn = [w for w in wires if w.source in named and w.target in named]
    fed = {(w.target, w.port) for w in wires}
    return Content(
        title=graph.title or graph.name,
        subtitle=subtitle,
        complete=not problems,
        blocks=tuple(_shown(graph, name, drawn, fed, said) for name in named),
        flows=tuple(Flow(w, _flows(graph, w), said.beside(w)) for w in drawn),
    )


def _ends(wire: Wire) -> Ends:
    """The two addresses; some part is empty where one of them is none at all."""
    source, _, marker = wire.source.partition(".")
    target, _, port = wire.target.partition(".")
    return Ends(source, marker, target, port)


def _flows(graph: Graph, wire: Ends) -> bool:
    """Whether anything flows forward: a load may read nothing of its marker."""
    target = graph.blocks.get(wire.target)
    return not isinstance(target, Element) or bool(target.reads().get(wire.port))


def _shown(
    graph: Graph, name: str, wires: list[Ends], fed: set[tuple[str, str]], said: Words
) -> Shown:
    block = graph.blocks.get(name)
    pairs: dict[str, str] = {}  # of the ports that the block declares
    if isinstance(block, Moving):
        pairs = {j.name: j.kind for j in block.joints.values() if j.outer}
    elif isinstance(block, Element):
        pairs = dict.fromkeys(block.terminals, "")
    named = [w.port for w in wires if w.target == name]
    ports = []
    for port in dict.fromkeys([*pairs, *named]):
        pair = pairs.get(port, "")
        word = shown_name(said.wires.get(f"{name}.{port}", port), 16)
        label = f"{word} ({pair})" if pair else word
        ports.append(Port(port, pair, (name, port) in fed, label))
    kind, words = _kind(block)
    if said.links.get(name):
        words = f"{words}: {', '.join(said.links[name])}"
    markers = tuple(said.beside(w) for w in wires if w.source == name)
    drive = _drive(block) if isinstance(block, Moving) else ()
    return Shown(name, kind, words, tuple(ports), markers, drive)


def _kind(block: object) -> tuple[Kind, str]:
    """What a block is, and the words under its name."""
    match block:
        case Frame():
            return "frame", "fixed link"
        case Moving():
            words = f"{block.group_class} {block.kind}".strip()
            return "group" if block.closes else "driver", words
        case Element():
            return "element", block.type_name.rsplit(".", 1)[-1].replace("_", " ")
        case UnknownBlock():
            return "unknown", f"{block.type}?"
    return "missing", "no such block"


def _drive(block: Moving) -> tuple[str, ...]:
    """Symbols of the coordinates and efforts of a block's drivers, with all their units."""
    units = {"q": [j.coordinate_unit for j in block.driven]}
    units["τ"] = [j.effort_unit for j in block.driven]
    found = {symbol: " ".join(f"[{u}]" for u in dict.fromkeys(us)) for symbol, us in units.items()}
    return tuple(f"{symbol} {said}" for symbol, said in found.items() if said)
