"""Cycles: blocks that wait for each other, diagnosed in the trade's words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blockmech.errors import Problem, listed

if TYPE_CHECKING:
    from blockmech.model.graph import Graph


def diagnose_cycle(graph: Graph, blocks: list[str]) -> Problem:
    """The problem that names a set of blocks in a cycle, and what they really are."""
    wires = [
        str(w)
        for w in graph.wires
        if w.source.split(".")[0] in blocks and w.target.split(".")[0] in blocks
    ]
    return Problem(
        "cycle",
        listed(blocks),
        f"the blocks wait for each other: {listed(wires)}",
        "",
        "",
    )
