"""Cycles: blocks that wait for each other, diagnosed in the trade's words.

Such blocks are no formation sequence, but their links may well be one Assur group of a
higher class, or separate groups whose pins are wired to the wrong one of their links; if
they are neither, the over-constrained and the loose links say why. Markers tell which pairs
share a pin or a direction (`axes`): two links between the same two pins are one too many.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from blockmech.assur.formation import Formation, formation, reseat
from blockmech.assur.groups import roman
from blockmech.assur.pairs import Pair, Side, axes, carriers
from blockmech.assur.rank import TooTangledError
from blockmech.assur.rigidity import rigidity
from blockmech.blocks.contract import Block, BuiltIn, Joint, Moving
from blockmech.blocks.general import GeneralGroup
from blockmech.errors import Problem, listed
from blockmech.model.diagram import AnyBlock, Wire
from blockmech.values import Marker

MOST_LINKS = 1000
"""Links that are diagnosed in one graph, so that any file is answered soon."""

RULE = "a formation sequence feeds every joint from an earlier block"


def cycle_problem(
    all_blocks: Mapping[str, AnyBlock], wires: Iterable[Wire], names: Sequence[str], told: bool
) -> Problem:
    """The problem that names blocks in a cycle and, if it is to be ``told``, what they are."""
    found = "the blocks wait for each other"
    remedy = "re-wire a joint of one of them to an earlier block"
    if told:
        sources = {wire.target: wire.source for wire in wires}
        inside = [
            f"{source} -> {target}"
            for target, source in sources.items()
            if source.split(".")[0] in names and target.split(".")[0] in names
        ]
        found += f": {listed(inside)}"
        ring = _ring(all_blocks, sources, names)
        try:
            said = _seated_elsewhere(ring) or _as_they_are(ring, names)
        except TooTangledError:
            said = ("", remedy)
        found, remedy = "; ".join(filter(None, (found, said[0]))), said[1]
    return Problem("cycle", listed(names), found, RULE, remedy)


def _as_they_are(ring: _Ring, blocks: Iterable[str]) -> tuple[str, str]:
    """What the links that wait for each other are, and what to do about it."""
    found, text = waiting(ring.links, ring.pairs, ring.earlier, ring.drivers)
    if not found.complete:
        remedy = "re-wire a joint of an over-constrained link to a loose or an earlier link"
    elif len(found.units) == 1:
        group = f"group.general block of class {roman(found.units[0].number)}"
        remedy = f"replace {listed(blocks)} by one {group}, "
        remedy += "or re-wire a joint to a link that already moves"
    else:
        remedy = "wire the links as separate groups in that order"
    return text, remedy


def waiting(
    links: Iterable[str],
    pairs: Sequence[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> tuple[Formation, str]:
    """The formation of links that wait for each other, and in a sentence what they are.

    Parameters as of `rigidity`: the links of a cycle of blocks, the pairs between them
    and to earlier links (of which only those that they are wired to matter).
    """
    moving = sorted(set(links) - set(earlier))
    found, names = formation(moving, pairs, earlier, drivers), ", ".join(moving)
    if found.complete and len(found.units) == 1:
        unit = found.units[0]
        text = f"{names} are one Assur group of class {roman(unit.number)}"
        return found, text + f" with {len(unit.links)} links and {len(unit.pairs)} pairs"
    if found.complete:
        return found, f"the links can be placed in the order {found}"
    state = rigidity(moving, pairs, earlier, drivers)
    reasons = []
    for o in state.overconstrained:
        aside = set() if o.drivers else carriers([p for p in pairs if p.name in o.pairs], earlier)
        reasons.append(f"over-constrained: {', '.join(a for a in o.links if a not in aside)}")
    reasons += [f"loose: {', '.join(part.links)}" for part in state.loose]
    return found, f"{names} are no Assur group; {'; '.join(reasons)}"


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


def _ring(
    all_blocks: Mapping[str, AnyBlock], sources: Mapping[str, str], names: Iterable[str]
) -> _Ring:
    ring, sides, size = _Ring(), list[Side](), 0.0
    for name in names:
        block = all_blocks[name]
        if not isinstance(block, Moving):
            continue
        size = max(size, block.largest_length())
        ring.links |= {f"{name}.{link}" for link in block.link_names}
        for joint in block.joints.values():
            where = f"{name}.{joint.name}"
            if joint.outer and where not in sources:
                continue
            first, second = f"{name}.{joint.links[0]}", f"{name}.{joint.later}"
            if joint.outer:
                support = _support(all_blocks, where, joint, sources[where])
                sides.append(support)
                first = support.link
            ring.pairs.append(Pair(where, first, second, joint.kind))
            sides += _own_sides(name, block, joint)
            if joint.driven:
                ring.drivers.append(where)
            if joint.name in block.friction:
                ring.rubbing.add(where)
    axis = axes(sides, size or 1.0)
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


def _support(blocks: Mapping[str, AnyBlock], where: str, joint: Joint, source: str) -> Side:
    """The side of the link that carries a marker; a marker of nothing known is its own link."""
    name, _, marker = source.partition(".")
    block = blocks.get(name)
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
