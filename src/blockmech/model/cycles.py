"""Cycles: blocks that wait for each other, diagnosed in the trade's words.

Such blocks are no formation sequence, but their links may well be one Assur group
of a higher class; if they are not, the over-constrained and the loose links say why.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blockmech.blocks.contract import Block, Moving
from blockmech.errors import Problem, listed
from blockmech.model.assur import Waiting, roman, waiting
from blockmech.model.rigidity import Pair

if TYPE_CHECKING:
    from blockmech.model.graph import Graph

MOST_LINKS = 1000
"""Links that are diagnosed in one graph, so that any file is answered soon."""

RULE = "a formation sequence feeds every joint from an earlier block"


def cycle(blocks: list[str]) -> Problem:
    """The problem that only names a set of blocks in a cycle."""
    remedy = "re-wire a joint of one of them to an earlier block"
    return Problem("cycle", listed(blocks), "the blocks wait for each other", RULE, remedy)


def diagnose_cycle(graph: Graph, blocks: list[str]) -> Problem:
    """The problem that names a set of blocks in a cycle, and what they really are."""
    sources = {w.target: w.source for w in graph.wires}
    links: set[str] = set()
    pairs: list[Pair] = []
    drivers: list[str] = []
    for name in blocks:
        block = graph.blocks[name]
        if not isinstance(block, Moving):
            continue
        links |= {f"{name}.{link}" for link in block.link_names}
        for joint in block.joints.values():
            where = f"{name}.{joint.name}"
            if not joint.outer:
                first, second = joint.links
                pairs.append(Pair(where, f"{name}.{first}", f"{name}.{second}", joint.kind))
            elif where in sources:
                support = _link_of(graph, sources[where])
                pairs.append(Pair(where, support, f"{name}.{joint.link}", joint.kind))
            else:
                continue
            if joint.driven:
                drivers.append(where)
    earlier = {pair.first for pair in pairs} - links
    within = set(blocks)
    inside = [
        f"{source} -> {target}"
        for target, source in sources.items()
        if source.split(".")[0] in within and target.split(".")[0] in within
    ]
    found = waiting(links, pairs, earlier, drivers)
    return Problem(
        "cycle",
        listed(blocks),
        f"the blocks wait for each other: {listed(inside)}; {found.text}",
        RULE,
        _remedy(found, blocks),
    )


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


def _link_of(graph: Graph, source: str) -> str:
    """Name of the link that carries a marker; a marker of nothing known is its own link."""
    name, _, marker = source.partition(".")
    block = graph.blocks.get(name)
    markers = block.markers_of() if isinstance(block, Block) else {}
    return f"{name}.{markers[marker][0]}" if marker in markers else source
