"""Cycles: blocks that wait for each other, diagnosed in the trade's words.

Such blocks are no formation sequence, but their links may well be one Assur group of a
higher class, or separate groups in another order; if they are neither, the over-constrained
and the loose links say why. Markers tell which pairs share a pin or a direction (`axes`): two
links between the same two pins are one too many.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import networkx as nx

from blockmech.assur.formation import Formation, formation
from blockmech.assur.groups import Pair, Side, axes, roman
from blockmech.assur.rigidity import Overconstraint, TooTangledError, rigidity
from blockmech.blocks.contract import Block, Joint, Moving
from blockmech.blocks.general import GeneralGroup
from blockmech.ground.errors import Problem, listed
from blockmech.ground.names import split_address
from blockmech.model.diagram import AnyBlock, Wire

RULE = "a formation sequence feeds every joint from an earlier block"


def cycle_problem(
    blocks: Mapping[str, AnyBlock], wires: Iterable[Wire], names: Sequence[str], told: bool
) -> Problem:
    """The problem that names blocks in a cycle and, if it is to be ``told``, what they are."""
    message = "the blocks depend on each other"
    remedy = "re-wire a joint of one of them to an earlier block"
    if told:
        sources = {wire.target: wire.source for wire in wires}
        inside = [
            f"{source} -> {target}"
            for target, source in sources.items()
            if all(split_address(end, blocks)[0] in names for end in (source, target))
        ]
        message += f": {listed(inside)}"
        ring = {name: b for name in names if isinstance(b := blocks[name], Moving)}
        links = {f"{name}.{link}" for name, block in ring.items() for link in block.link_names}
        pairs = _pairs(blocks, ring, sources)
        drivers = [f"{n}.{j.name}" for n, block in ring.items() for j in block.driven]
        try:
            what, text = waiting(links, pairs, {p.first for p in pairs} - links, drivers)
        except TooTangledError:
            return Problem("cycle", listed(names), message, RULE, remedy)
        message += f"; {text}"
        remedy = "wire the links as separate groups in that order"
        if not what.complete:
            remedy = "re-wire a joint of an over-constrained link to a loose or an earlier link"
        elif len(what.units) == 1:
            group = f"group.general block of class {roman(what.units[0].number)}"
            remedy = f"replace {listed(names)} by one {group}, "
            remedy += "or re-wire a joint to a link that already moves"
    return Problem("cycle", listed(names), message, RULE, remedy)


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
    sequence, names = formation(moving, pairs, earlier, drivers), ", ".join(moving)
    if sequence.complete and len(sequence.units) == 1:
        unit = sequence.units[0]
        text = f"{names} are one Assur group of class {roman(unit.number)}"
        return sequence, text + f" with {len(unit.links)} links and {len(unit.pairs)} pairs"
    if sequence.complete:
        return sequence, f"the links can be placed in the order {sequence}"
    state = rigidity(moving, pairs, earlier, drivers)
    reasons = [f"over-constrained: {', '.join(_held(o, pairs))}" for o in state.overconstrained]
    reasons += [f"loose: {', '.join(part.links)}" for part in state.loose]
    return sequence, f"{names} do not form an Assur group; {'; '.join(reasons)}"


def _held(o: Overconstraint, pairs: Iterable[Pair]) -> Sequence[str]:
    """Over-constrained links but for those that only carry a pin of others, held once."""
    rigid_pairs = [p for p in pairs if p.name in o.pairs]
    pins = {
        p.axis: nx.MultiGraph(q.links for q in rigid_pairs if q.axis == p.axis)
        for p in rigid_pairs
        if p.axis
    }
    once = [{axis} for axis, pin in pins.items() if nx.is_forest(pin)]
    return [a for a in o.links if {p.axis for p in rigid_pairs if a in p.links} not in once]


def _pairs(
    blocks: Mapping[str, AnyBlock], ring: Mapping[str, Moving], sources: Mapping[str, str]
) -> list[Pair]:
    """The pairs of blocks in a cycle, with the axes that they share."""
    pairs, sides = [], list[Side]()
    for name, block in ring.items():
        for joint in block.joints.values():
            where = f"{name}.{joint.name}"
            if joint.outer and where not in sources:
                continue
            ends = [_support(blocks, joint, sources[where])] if joint.outer else []
            local_links = [joint.link] if joint.outer else joint.links
            ends += [(f"{name}.{link}", _place(block, joint, link)) for link in local_links]
            pairs.append(Pair(where, ends[0][0], ends[1][0], joint.kind))
            sides += [Side(where, link, joint.kind, z) for link, z in ends if z is not None]
    size = max((block.largest_length() for block in ring.values()), default=0.0)
    axis = axes(sides, size or 1.0)
    return [replace(pair, axis=axis.get(pair.name, "")) for pair in pairs]


End: TypeAlias = tuple[str, complex | None]
"""A link, and the place of a pin or direction of a guide on it; None where it is not known."""


def _place(block: Moving, joint: Joint, link: str) -> complex | None:
    """Where a joint is on one of the block's own links.

    A revolute joint's marker is named after it; the one on the second link of an inner joint
    has the link's name added: C and Cj.
    """
    if joint.kind == "P":
        return block.guide_line(joint.name, link)[1]
    if isinstance(block, GeneralGroup):
        return block.slider_place(joint.name, link)
    markers = (block.built_in.get(marker) for marker in (joint.name, joint.name + link))
    return next((block.place_of(m) for m in markers if m is not None and m.link == link), None)


def _support(blocks: Mapping[str, AnyBlock], joint: Joint, source: str) -> End:
    """The link that carries a marker; a marker of nothing known is its own link."""
    name, marker = split_address(source, blocks)
    block = blocks.get(name)
    if not isinstance(block, Block) or marker not in block.all_markers:
        return source, 0j if joint.kind == "R" else 1 + 0j
    link, at = block.all_markers[marker]
    z = block.place_of(at) if joint.kind == "R" else getattr(at, "direction", 1 + 0j)
    return f"{name}.{link}", z
