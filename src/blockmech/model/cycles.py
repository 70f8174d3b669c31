"""Cycles: blocks that wait for each other, diagnosed in the trade's words.

Such blocks are no formation sequence, but their links may well be one Assur group of a
higher class, or separate groups whose pins are wired to the wrong one of their links; if
they are neither, the over-constrained and the loose links say why. Markers tell which pairs
share a pin or a direction (`pins.axes`): two links between the same two pins are one too many.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from blockmech.blocks.contract import Block, BuiltIn, Joint, Moving
from blockmech.blocks.general import GeneralGroup
from blockmech.errors import Problem, listed
from blockmech.model.assur import roman
from blockmech.model.elimination import MOST_WORK, TooTangledError
from blockmech.model.formation import Waiting, formation, waiting
from blockmech.model.pins import Side, axes, reseat
from blockmech.model.rigidity import Pair
from blockmech.values import Marker

if TYPE_CHECKING:
    from blockmech.model.graph import Graph

MOST_LINKS = 1000
"""Links that are diagnosed in one graph, so that any file is answered soon."""

RULE = "a formation sequence feeds every joint from an earlier block"


def cycle(blocks: list[str], found: str = "the blocks wait for each other") -> Problem:
    """The problem that only names a set of blocks in a cycle."""
    remedy = "re-wire a joint of one of them to an earlier block"
    return Problem("cycle", listed(blocks), found, RULE, remedy)


def diagnose_cycle(graph: Graph, blocks: list[str]) -> Problem:
    """The problem that names a set of blocks in a cycle, and what they really are."""
    sources = {w.target: w.source for w in graph.wires}
    within = set(blocks)
    inside = [
        f"{source} -> {target}"
        for target, source in sources.items()
        if source.split(".")[0] in within and target.split(".")[0] in within
    ]
    told = f"the blocks wait for each other: {listed(inside)}"
    ring = _ring(graph, blocks, sources)
    moved = _seated_elsewhere(ring)
    if moved:
        order, wires = moved
        return Problem("cycle", listed(blocks), f"{told}; {order}", RULE, wires)
    try:
        found = waiting(ring.links, ring.pairs, ring.earlier, ring.drivers, MOST_WORK)
    except TooTangledError:
        return cycle(blocks, told)
    return Problem("cycle", listed(blocks), f"{told}; {found.text}", RULE, _remedy(found, blocks))


def _remedy(found: Waiting, blocks: list[str]) -> str:
    if found.is_group:
        unit = found.units[0]
        return (
            f"replace {listed(blocks)} by one group.general block of class {roman(unit.number)}, "
            "or re-wire a joint to a link that already moves"
        )
    if found.units:
        return "wire the links as separate groups in that order"
    return "re-wire a joint of an over-constrained link to a loose or an earlier link"


@dataclass
class _Ring:
    """The links of blocks in a cycle, their pairs, and the earlier links that carry them."""

    links: set[str] = field(default_factory=set)
    pairs: list[Pair] = field(default_factory=list)
    drivers: list[str] = field(default_factory=list)
    rubbing: set[str] = field(default_factory=set)  # pairs with friction

    @property
    def earlier(self) -> set[str]:
        """The links outside that carry them."""
        return {pair.first for pair in self.pairs} - self.links


def _ring(graph: Graph, blocks: list[str], sources: dict[str, str]) -> _Ring:
    ring = _Ring()
    sides: list[Side] = []
    lengths = []
    for name in blocks:
        block = graph.blocks[name]
        if not isinstance(block, Moving):
            continue
        lengths.append(block.largest_length())
        ring.links |= {f"{name}.{link}" for link in block.link_names}
        for joint in block.joints.values():
            where = f"{name}.{joint.name}"
            if not joint.outer:
                first, second = joint.links
                pair = Pair(where, f"{name}.{first}", f"{name}.{second}", joint.kind)
            elif where in sources:
                support = _support(graph, where, joint, sources[where])
                sides.append(support)
                pair = Pair(where, support.link, f"{name}.{joint.link}", joint.kind)
            else:
                continue
            ring.pairs.append(pair)
            sides += _own_sides(name, block, joint)
            if joint.driven:
                ring.drivers.append(where)
            if joint.name in block.friction:
                ring.rubbing.add(where)
    axis = axes(sides, max(lengths, default=0.0) or 1.0)
    ring.pairs = [replace(pair, axis=axis.get(pair.name, "")) for pair in ring.pairs]
    return ring


def _own_sides(name: str, block: Moving, joint: Joint) -> Iterator[Side]:
    """What the block's own links have of a joint, as far as its markers tell."""
    for link in (joint.link,) if joint.outer else joint.links:
        at = _pin(block, joint.name, link)
        if joint.kind == "P":
            at = block.guide_line(joint.name, link)[1]
        if at is not None:
            yield Side(f"{name}.{joint.name}", f"{name}.{link}", joint.kind, at)


def _pin(block: Moving, joint: str, link: str) -> complex | None:
    """Place [m] of a revolute joint on an own link: its marker is named after the joint.

    The one on the second link of an inner joint has the link's name added: C and Cj.
    """
    if isinstance(block, GeneralGroup):
        return block.pairs[joint].sides[link].at.z
    markers = (block.built_in.get(name) for name in (joint, joint + link))
    return next((block.place_of(m) for m in markers if m is not None and m.link == link), None)


def _support(graph: Graph, where: str, joint: Joint, source: str) -> Side:
    """The side of the link that carries a marker; a marker of nothing known is its own link."""
    name, _, marker = source.partition(".")
    block = graph.blocks.get(name)
    markers = block.markers_of() if isinstance(block, Block) else {}
    if not isinstance(block, Block) or marker not in markers:
        return Side(where, source, joint.kind, 0j if joint.kind == "R" else 1 + 0j)
    link, place = markers[marker]
    at = block.place_of(place) if joint.kind == "R" else _direction(place)
    return Side(where, f"{name}.{link}", joint.kind, at)


def _direction(marker: Marker | BuiltIn) -> complex:
    return marker.direction if isinstance(marker, Marker) else 1 + 0j


def _seated_elsewhere(ring: _Ring) -> tuple[str, str] | None:
    """The order in which the links can be placed if pins are wired to other links of theirs.

    Told with the wires that have to change; only pins without friction are moved, because
    friction says which links rub.
    """
    loose = [replace(p, axis="") if p.name in ring.rubbing else p for p in ring.pairs]
    before = {pair.name: pair for pair in loose}
    after = reseat(ring.links, loose, ring.earlier, ring.drivers)
    moved = [p for p in after if p.links != before[p.name].links]
    if not moved:
        return None
    axis = {pair.name: pair.axis for pair in ring.pairs}
    seated = [replace(p, axis=axis[p.name]) for p in after]
    found = formation(ring.links, seated, ring.earlier, ring.drivers)
    if not found.complete or len(found.units) < 2:
        return None
    order = f"the links can be placed in the order {found}"
    wires = []
    for pair in moved:
        own = before[pair.name].second
        if own not in pair.links:
            return order, "wire the pins to the links that are placed first"
        wires.append(f"{pair.name} to the same pin on {pair.other(own)}")
    return order, f"wire {listed(wires)}"
