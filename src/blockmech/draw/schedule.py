"""The schedule of a request: kernel calls in columns by what waits for what, blocks in rows.

A call stands in the column after the last one that it waits for (networkx calls these
columns topological generations). Colour and dashes of an arrow say what travels along it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from blockmech.figures.palette import BACK, DRIVE, GREY, INK, SERIES, SMALL, TEXT
from blockmech.figures.paper import arrow, new_page, shown_name, styled
from blockmech.plan.plan import Node, Plan
from blockmech.typing import Arguments

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMN, ROW = 11.5 * TEXT, 3.75 * TEXT  # [pt] of a call
LANE, MARGIN = 1.75 * TEXT, 3 * TEXT  # [pt] what parts two blocks, and what is around all
ARROWS: dict[str, tuple[str, str]] = {  # what travels -> colour, dashes
    "place": (GREY, "solid"),
    "velocity": (DRIVE, "solid"),
    "acceleration": (SERIES[2], "solid"),
    "force and moment": (BACK, "dashed"),
    "reduced inertia and effort": (SERIES[3], "dashed"),
}


def draw_schedule(plan: Plan) -> Any:
    """A figure of the calls of a plan and what travels between them."""
    from matplotlib.lines import Line2D

    graph = plan.graph()
    at, tops, height = _cells(graph)
    right_edge = max((x for x, _ in at.values()), default=0.0) + COLUMN / 2 + MARGIN
    left_edge = -COLUMN - MARGIN
    with styled():
        figure, axes = new_page(right_edge - left_edge, height + 2 * MARGIN, left_edge, -2 * MARGIN)
        for block, y in tops.items():
            axes.axhline(y - LANE / 2, color=GREY, linewidth=0.3)
            axes.text(-COLUMN, y + ROW / 2, shown_name(block, 18), va="center", weight="bold")
        kinds = set()
        for first, then, data in graph.edges(data=True):
            kinds.add(data["kind"])
            _arrow(axes, at[first], at[then], len(then[1]), *ARROWS[data["kind"]])
        box = {"boxstyle": "round", "facecolor": "white", "edgecolor": INK, "linewidth": 0.7}
        for call, (x, y) in at.items():
            of = f"\n({shown_name(call[2], 14)})" if call[2:] else ""
            axes.text(x, y, call[1] + of, size=SMALL, ha="center", va="center", bbox=box)
        keys = [
            Line2D([], [], color=colour, linestyle=dashes, label=kind)
            for kind, (colour, dashes) in ARROWS.items()
            if kind in kinds
        ]
        if keys:
            axes.legend(handles=keys, loc="upper left", ncols=3, fontsize=TEXT, borderaxespad=0.5)
    return figure


def _cells(graph: Any) -> tuple[dict[Node, tuple[float, float]], dict[str, float], float]:
    """Middle of each call, top of each block, and the whole height [pt]."""
    import networkx as nx

    cells: dict[tuple[str, int], list[Node]] = {}
    for column, calls in enumerate(nx.topological_generations(graph)):
        for call in calls:
            cells.setdefault((call[0], column), []).append(call)
    tops: dict[str, float] = {}
    height = 0.0
    for block in dict.fromkeys(call[0] for call in graph):
        tops[block] = height
        height += LANE + ROW * max(len(calls) for (b, _), calls in cells.items() if b == block)
    at = {
        call: (COLUMN * (column + 0.5), tops[block] + ROW * (row + 0.5))
        for (block, column), calls in cells.items()
        for row, call in enumerate(calls)
    }
    return at, tops, height


def _arrow(axes: Axes, start: Any, end: Any, letters: int, colour: str, dashes: str) -> None:
    """An arrow to a box with so many letters; it bends, so that what it passes stays readable."""
    level, is_long = start[1] == end[1], end[0] - start[0] > COLUMN
    half_box = (0.5 + letters / 5 if level and not is_long else 2) * TEXT
    look: Arguments = {"color": colour, "linestyle": dashes, "linewidth": 0.8}
    arrow(axes, (start, end), -0.15 if is_long and level else 0.0, (TEXT, half_box), **look)
