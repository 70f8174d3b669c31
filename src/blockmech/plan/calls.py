"""The kernel calls of a plan: as a graph of what travels between them, and as text."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain
from typing import TYPE_CHECKING

from blockmech.plan.plan import STAGES, Node, Plan

if TYPE_CHECKING:
    import networkx as nx

NAMES = re.compile(r"\.?[A-Za-z_]\w*", re.ASCII)  # in an expression; fields keep their dot
TRAVELS = {  # stage -> what it hands on
    "position": "place",
    "velocity": "velocity",
    "unit velocity": "velocity",
    "acceleration": "acceleration",
    "unit acceleration": "acceleration",
    "force": "force and moment",
    "reduction": "reduced inertia and effort",
}
BACK = ("force and moment", "reduced inertia and effort")


def graph(plan: Plan) -> nx.DiGraph:
    """The calls and what travels between them, as a directed graph without cycles.

    Nodes are calls: (block, stage), of the stages at unit rate (block, stage, driver), in
    the program's order; the stage "reduction" are a block's shares of the reduced inertia
    and effort. An edge goes from a call to one that needs what it gives, ``kind`` says
    what that is ("place", "velocity", "acceleration", "force and moment", "reduced inertia
    and effort"), and ``way`` whether it travels "forward" from the drivers or "back".
    """
    import networkx as nx

    graph = nx.DiGraph()
    behind: dict[str, tuple[Node, ...]] = {}  # value -> the calls that it comes from

    def add(call: Node, needed: Iterable[Node]) -> None:
        graph.add_node(call, block=call[0], stage=call[1])
        for source in needed:
            if source != call:
                kind = TRAVELS[source[1]]
                direction = "back" if kind in BACK else "forward"
                graph.add_edge(source, call, kind=kind, way=direction)

    lines, calls = plan.steps
    start = 0
    for call, value, line, head in calls:
        for name, text in lines[start:line]:
            parts = (behind.get(part, ()) for part in NAMES.findall(text))
            behind[name] = tuple(dict.fromkeys(chain.from_iterable(parts)))
        start = line
        add(call, behind.get(value, ()))
        if head:
            add((head, *call[1:]), (call,))
        else:
            behind[value] = (call,)
    return graph


def explain(plan: Plan) -> str:
    """The schedule as text: per stage the blocks in order, and the kernel calls."""
    calls, outputs = _counted(plan.calls, "kernel call"), _counted(len(plan.want), "output")
    rows = [f"{calls} for {outputs}"]
    for stage in STAGES:
        unit = "unit load at" if stage == "force" else "unit rate of"
        blocks = [
            e.block + (f" ({unit} {e.driver})" if e.driver else "")
            for e in plan.entries
            if e.stage == stage
        ]
        if blocks:
            rows.append(f"  {stage:<18}{len(blocks):>4}  {', '.join(blocks)}")
    return "\n".join(rows)


def _counted(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"
