"""What a block diagram shows of a graph, complete or not: boxes, ports, wires and words.

Nothing here is placed yet. Everything is read from the declarations of the blocks;
a block of unknown type, or one that a wire names in vain, gets the ports that its
wires name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from blockmech.blocks.contract import Moving
from blockmech.blocks.frame import Frame
from blockmech.blocks.joints import PAIRS
from blockmech.compiled import Compiled
from blockmech.couplings.contract import Coupling
from blockmech.draw.layout import Box
from blockmech.figures.palette import MOST, SIZES, SMALL, TEXT
from blockmech.figures.paper import shown_name, text_width
from blockmech.ground.errors import listed
from blockmech.ground.names import split_address
from blockmech.loads.contract import Element, Following
from blockmech.model.checks import couplings_of
from blockmech.model.diagram import Ends, UnknownBlock, Wire, driven_joints
from blockmech.model.flat import open_ports
from blockmech.model.graph import Graph
from blockmech.model.naming import Names
from blockmech.model.structure import LinkRef, Structure
from blockmech.model.subgraph import Subgraph
from blockmech.model.wires import inlets, signal_wire
from blockmech.signals.contract import Signal


@dataclass(frozen=True)
class Port:
    """A joint or a terminal on the left edge; ``pair`` is "R", "P" or "" for a terminal."""

    name: str
    pair: str
    wired: bool
    label: str  # name and pair type


@dataclass(frozen=True)
class DrawnBlock:
    """A block as the diagram shows it.

    ``kind`` is frame, driver, group, element, coupling, signal, graph, unknown or missing.
    """

    name: str
    kind: str
    words: str  # under the name: class and kind, or the type
    ports: tuple[Port, ...]
    markers: tuple[str, ...]  # words beside the used ones, once per wire
    drive: tuple[str, ...] = ()  # a driver's coordinate and effort: "q [rad]", "τ [N m]"

    def box(self) -> Box:
        """Its size for the layout."""
        small = self.kind == "element"
        name = text_width(shown_name(self.name), SMALL if small else TEXT, bold=True)
        label_width = text_width(shown_name(self.words), SMALL)
        markers = (shown_name(marker, 16) for marker in self.markers)
        ports_width, markers_width = (
            max((text_width(text, SMALL) for text in texts), default=0.0)
            for texts in ((port.label for port in self.ports), markers)
        )
        gap = 2 * SIZES.pad if ports_width and markers_width else 0.0
        inside = max(label_width, ports_width + gap + markers_width)
        inside = ports_width + 2 * SIZES.pad + label_width if small else inside
        return Box(
            self.name,
            max(name, inside) + 2 * SIZES.pad,
            tuple(p.name for p in self.ports),
            head=1 if small else 2,
            above=2 if self.drive else 0,
            first=self.kind == "frame",
        )


@dataclass(frozen=True)
class DrawnWire:
    """A wire: where it runs, and whether anything flows forward; effort always flows back."""

    ends: Ends
    forward: bool
    word: str  # beside its marker
    signal: bool = False  # one number, and nothing comes back


@dataclass(frozen=True)
class Content:
    """All that the diagram shows."""

    title: str
    subtitle: str
    complete: bool
    blocks: tuple[DrawnBlock, ...]
    wires: tuple[DrawnWire, ...]


@dataclass(frozen=True)
class DocumentNames:
    """What a document of links and joints calls the parts of its graph; nothing without one."""

    links: Mapping[str, Sequence[str]]  # block -> links in it
    wires: Mapping[str, str]  # block.joint or block.marker -> joint, link or marker

    @classmethod
    def of(cls, names: Names | None, graph: Graph) -> DocumentNames:
        """The words of the document that a graph was made of."""
        if names is None:
            return cls({}, {})
        called = names.of_links
        links = {
            name: [called[ref] for x in b.link_names if (ref := LinkRef(name, x)) in called]
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

    def marker_label(self, wire: Ends) -> str:
        """The word beside the marker of a wire."""
        marker = self.wires.get(f"{wire.source}.{wire.marker}", wire.marker)
        return self.wires.get(f"{wire.target}.{wire.port}", marker)


def graph_of(mechanism: Compiled) -> Graph:
    """The graph of a compiled mechanism."""
    structure = mechanism.structure
    graph = Graph(mechanism.name)
    moving = {**structure.blocks, **structure.elements, **structure.couplings, **structure.signals}
    graph.blocks = {structure.frame: structure.fixed, **moving}
    ends = {**structure.feeds, **structure.holds}
    graph.wires = [Wire(str(marker), str(joint)) for joint, marker in ends.items()]
    graph.wires += [Wire(source, str(ref)) for ref, source in structure.signal_wires.items()]
    return graph


def content_of(graph: Graph, names: Names | None = None, most: int = MOST) -> Content:
    """What the diagram of a graph shows; ``names`` are those of links and joints."""
    labels = DocumentNames.of(names, graph)
    # An address that is none at all leaves a part empty.
    wires = [ends for wire in graph.wires if all(ends := wire.split_ends(graph.blocks))]
    wires += _drive_wires(graph)
    ends_of_wires = (name for wire in wires for name in (wire.source, wire.target))
    order = list(dict.fromkeys([*graph.blocks, *ends_of_wires]))
    problems = graph.check()
    if problems:
        codes = {p.code: [q.where for q in problems if q.code == p.code] for p in problems}
        summary = "; ".join(f"{code}: {listed(where, 4)}" for code, where in codes.items())
        subtitle = f"not complete – {summary}"
    else:
        s = graph.structure()
        subtitle = labels.formula(s).replace("->", "→")
    if len(order) > most:  # of a valid graph in the order of formation
        subtitle = f"first {most} of {len(order)} blocks – {subtitle}"
        if not problems:
            order = [s.frame, *s.blocks, *s.elements, *s.couplings, *s.signals]
        order = order[:most]
    inner_wires = [w for w in wires if w.source in order and w.target in order]
    fed = {(w.target, w.port) for w in wires}
    return Content(
        title=graph.title or graph.name,
        subtitle=subtitle,
        complete=not problems,
        blocks=tuple(_block(graph, name, inner_wires, fed, labels) for name in order),
        wires=tuple(
            DrawnWire(w, _feeds(graph, w), labels.marker_label(w), signal_wire(graph.blocks, w))
            for w in inner_wires
        ),
    )


ON = "on"  # the port of a graph inside at which its frame stands
COUPLED = "q"  # the port at which a driver's coordinate enters


def _drive_wires(graph: Graph) -> Iterator[Ends]:
    """What runs from drivers to couplings, and from those to the drivers that follow."""
    drivers = driven_joints(graph.blocks)
    for name, coupling in couplings_of(graph.blocks).items():
        if coupling.driver in drivers:
            yield Ends(drivers[coupling.driver][0], "q", name, COUPLED)
        elif all(address := split_address(coupling.driver, graph.blocks)):
            yield Ends(*address, name, COUPLED)
        if coupling.driven in drivers:
            yield Ends(name, "", drivers[coupling.driven][0], COUPLED)
        elif coupling.driven.partition(".")[0] in graph.blocks:
            yield Ends(name, "", *coupling.driven.split(".", 1))
    for name, block in graph.blocks.items():
        if isinstance(block, Subgraph) and block.on:
            yield Ends(*split_address(block.on, graph.blocks), name, ON)


def _feeds(graph: Graph, wire: Ends) -> bool:
    """Whether anything flows forward: a load may read nothing of its marker."""
    target = graph.blocks.get(wire.target)
    return not isinstance(target, Element) or bool(target.reads().get(wire.port))


def _block(
    graph: Graph, name: str, wires: list[Ends], fed: set[tuple[str, str]], labels: DocumentNames
) -> DrawnBlock:
    """A block with the ports that it declares, and those that wires name."""
    block = graph.blocks.get(name)
    declared: dict[str, str] = {}
    drive: tuple[str, ...] = ()
    match block:
        case Frame():
            kind, under = "frame", "fixed link"
        case Moving():
            kind = "group" if block.closes else "driver"
            under = f"{block.group_class} {block.kind}".strip()
            declared = {j.name: j.kind for j in block.joints.values() if j.outer}
            led = {c.driven for c in couplings_of(graph.blocks).values()}
            if not led & {block.driver_name(name, j.name) for j in block.driven}:
                drive = _drive(block)
        case Element():
            kind, under = "element", block.type_name.rsplit(".", 1)[-1].replace("_", " ")
            declared = dict.fromkeys(inlets(block), "")
            if isinstance(block, Following):
                under = f"{under} {block.function()}".strip()
        case Coupling():
            kind, under = "coupling", block.type_name.rsplit(".", 1)[-1]
        case Signal():
            kind, under = "signal", block.type_name.rsplit(".", 1)[-1].replace("_", " ")
            declared = dict.fromkeys(block.inputs, "")
        case Subgraph():
            kind, under, declared = "graph", block.file or "graph", dict(open_ports(block))
        case UnknownBlock():
            kind, under = "unknown", f"{block.type}?"
        case _:
            kind, under = "missing", "no such block"
    if labels.links.get(name):
        under = f"{under}: {', '.join(labels.links[name])}"
    coupled = {(w.target, w.port) for w in _drive_wires(graph)}
    ports = []
    for port in dict.fromkeys([*declared, *(w.port for w in wires if w.target == name)]):
        pair = declared.get(port, COUPLED if (name, port) in coupled else "")
        word = shown_name(labels.wires.get(f"{name}.{port}", port), 16)
        ports.append(
            Port(port, pair, (name, port) in fed, f"{word} ({pair})" if pair in PAIRS else word)
        )
    markers = tuple(labels.marker_label(w) for w in wires if w.source == name)
    return DrawnBlock(name, kind, under, tuple(ports), markers, drive)


def _drive(block: Moving) -> tuple[str, ...]:
    """Symbols of the coordinates and efforts of a block's drivers, with all their units."""
    units = {"q": [j.coordinate_unit for j in block.driven]}
    units["τ"] = [j.effort_unit for j in block.driven]
    return tuple(f"{x} [{'] ['.join(dict.fromkeys(us))}]" for x, us in units.items() if us)
