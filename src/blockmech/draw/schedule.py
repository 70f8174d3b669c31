"""The schedule of a request: kernel calls in columns by what waits for what, blocks in rows.

A call stands in the column after the last one that it waits for (networkx calls these
columns topological generations). Colour and dashes of an arrow say what travels along it.
"""

from __future__ import annotations

from typing import Any

from blockmech.draw.palette import BACK, DRIVE, GREY, INK, SERIES, SMALL, TEXT
from blockmech.draw.paper import new_figure, shown_name, styled
from blockmech.plan import Node, Plan

COLUMN, ROW, LANE = 92.0, 30.0, 14.0  # [pt] a column, a call, and what parts two blocks
MARGIN = 24.0  # [pt] around
ARROWS: dict[str, tuple[str, Any]] = {  # what travels -> colour, dashes
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
    places, lanes = _places(graph)
    width = COLUMN * (1 + max((x for x, _ in places.values()), default=0))
    height = ROW * sum(lanes.values()) + LANE * len(lanes)
    with styled():
        figure = new_figure(width + 2 * MARGIN + COLUMN, height + 2 * MARGIN)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(-COLUMN - MARGIN, width + MARGIN)
        axes.set_ylim(height, -2 * MARGIN)
        at = {
            call: (COLUMN * (x + 0.5), _top(lanes, call[0]) + ROW * (y + 0.5))
            for call, (x, y) in places.items()
        }
        for block in lanes:
            y = _top(lanes, block)
            axes.axhline(y - LANE / 2, color=GREY, linewidth=0.3)
            axes.text(-COLUMN, y + ROW / 2, shown_name(block, 18), va="center", weight="bold")
        for first, then, data in graph.edges(data=True):
            _arrow(axes, at[first], at[then], *ARROWS[data["kind"]])
        for call, (x, y) in at.items():
            of = f"\n({shown_name(call[2], 14)})" if call[2:] else ""
            box = {"boxstyle": "round", "facecolor": "white", "edgecolor": INK, "linewidth": 0.7}
            axes.text(x, y, call[1] + of, size=SMALL, ha="center", va="center", bbox=box)
        seen = {data["kind"] for _, _, data in graph.edges(data=True)}
        keys = [
            Line2D([], [], color=colour, linestyle=dashes, label=kind)
            for kind, (colour, dashes) in ARROWS.items()
            if kind in seen
        ]
        if keys:
            axes.legend(handles=keys, loc="upper left", ncols=3, fontsize=TEXT)
    return figure


def _places(graph: Any) -> tuple[dict[Node, tuple[int, int]], dict[str, int]]:
    """Column of each call and its row in its block, and how many rows each block has."""
    import networkx as nx

    places: dict[Node, tuple[int, int]] = {}
    rows: dict[str, int] = dict.fromkeys((call[0] for call in graph), 1)
    for column, calls in enumerate(nx.topological_generations(graph)):
        taken: dict[str, int] = {}
        for call in calls:
            row = taken[call[0]] = taken.get(call[0], -1) + 1
            places[call] = column, row
            rows[call[0]] = max(rows[call[0]], row + 1)
    return places, rows


def _top(lanes: dict[str, int], block: str) -> float:
    """Where a block's rows begin [pt]."""
    above = list(lanes)[: list(lanes).index(block)]
    return LANE * len(above) + ROW * sum(lanes[b] for b in above)


def _arrow(axes: Any, start: Any, end: Any, colour: str, dashes: Any) -> None:
    """An arrow that bends a little, so that what lies on its way stays readable."""
    level = start[1] == end[1]
    far = end[0] - start[0] > COLUMN
    style = {
        "arrowstyle": "-|>",
        "color": colour,
        "linestyle": dashes,
        "linewidth": 0.8,
        "shrinkA": TEXT,
        "shrinkB": (4 if level and not far else 2) * TEXT,  # a box is wider than high
        "connectionstyle": f"arc3,rad={-0.15 if far and level else 0.0}",
    }
    axes.annotate("", end, start, arrowprops=style, zorder=1)
