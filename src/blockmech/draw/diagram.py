"""The block diagram as a picture ([R10] Figs. 3 and 9).

Blocks are boxes in the order of formation, joints and used markers sit on their
edges. Each wire is two lines: motion flows forward, force and moment flow back.

Sources: [R10] Ruiz, Durango & Calle 2010.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from blockmech.draw import palette as ink
from blockmech.draw.boxes import Content, Flow, Port, Shown, content_of
from blockmech.draw.layout import arrange
from blockmech.draw.palette import ROW, SIZES
from blockmech.draw.paper import flowed, new_page, shown_name, styled, text_width, wrapped
from blockmech.draw.routing import Placed, Point, Rectangle, honour, place
from blockmech.model.graph import Graph
from blockmech.model.naming import Names

ARROWHEAD = "-|>,head_length=4.2,head_width=1.5"  # [pt]
ARROWS = {"forward": ink.FORWARD, "back": ink.BACK, "cycle": ink.ALARM}
GLYPHS = {"forward": 22.0, "back": 22.0, "cycle": 22.0, "unwired": 22.0}  # [pt] in the legend
FILLS = {
    "frame": ink.FRAME_FILL,
    "driver": ink.DRIVER_FILL,
    "group": ink.GROUP_FILL,
    "element": ink.ELEMENT_FILL,
    "unknown": ink.PAPER,
    "missing": ink.PAPER,
}


@dataclass
class Diagram:
    """A drawn diagram: the figure, and where everything is on it [pt, y downward].

    Labels of the artists tell what they are: ``box:crank``, ``port:crank.A``,
    ``unwired:dyad.D``, ``forward:...``, ``back:...``, ``cycle:...``, ``text``.
    """

    figure: Any
    axes: Any
    content: Content
    placed: Placed
    labels: list[Any] = field(default_factory=list)

    def write(self, x: float, y: float, text: str, **style: Any) -> None:
        """A line of text, its middle at a height."""
        given = {"fontsize": ink.SMALL, "va": "center_baseline", "color": ink.INK, "zorder": 4}
        self.labels.append(self.axes.text(x, y, text, label="text", **{**given, **style}))

    def arrow(self, way: Sequence[Point], colour: str, what: str) -> None:
        """A line with an arrowhead at its end."""
        from matplotlib.patches import FancyArrowPatch
        from matplotlib.path import Path

        style: dict[str, Any] = {"joinstyle": "round", "zorder": 1.8, "label": what}
        patch = FancyArrowPatch(
            path=Path(way), arrowstyle=ARROWHEAD, mutation_scale=1, color=colour, lw=1.0, **style
        )
        self.axes.add_patch(patch)

    def pin(self, x: float, y: float, pair: str, colour: str, what: str) -> None:
        """The symbol of a joint or a terminal; a marker is a dot."""
        from matplotlib.patches import Circle, Patch, RegularPolygon

        fill = ink.INK if pair == "marker" else ink.PAPER
        style: dict[str, Any] = {"facecolor": fill, "edgecolor": colour, "lw": 0.9, "zorder": 5}
        if pair in ("R", "marker"):
            patch: Patch = Circle(
                (x, y), SIZES.port if pair == "R" else SIZES.port - 1, label=what, **style
            )
        else:  # a square, for a load on its corner
            turn = math.pi / 4 if pair == "P" else 0.0
            size = SIZES.port * math.sqrt(2) if pair == "P" else SIZES.port + 0.4
            patch = RegularPolygon((x, y), 4, radius=size, orientation=turn, label=what, **style)
        self.axes.add_patch(patch)

    def cross(self, x: float, y: float) -> None:
        """A red cross on a stump: nothing is wired to the pin at a place."""
        for dx, dy in ((-10.0, -2.5), (-10.0, 2.5)):
            xs, ys = (x + dx, x + dx + 5), (y + dy, y - dy)
            self.axes.plot(xs, ys, color=ink.ALARM, lw=1.1, zorder=3)
        self.axes.plot((x - 7.5, x - SIZES.port), (y, y), color=ink.ALARM, lw=1.1, zorder=3)


def draw_diagram(graph: Graph, names: Names | None = None) -> Diagram:
    """Draw the block diagram of a graph, complete or not.

    ``names`` of the links and joints that it was made of stand in the place of its own.
    """
    content = content_of(graph, names)
    wires = [flow.ends for flow in content.flows]
    placed = place(arrange([b.box() for b in content.blocks], wires), wires)
    view = _view(graph)
    if view:
        honour(placed, view, wires, driven=any(b.drive for b in content.blocks))
    width = max(placed.width + 2 * SIZES.margin, ink.COLUMN)
    inside = width - 2 * SIZES.margin
    title = wrapped(shown_name(content.title, 90), ink.TEXT, inside, bold=True)
    subtitle = wrapped(shown_name(content.subtitle, 1200), ink.SMALL, inside)
    legend = _legend(content, bool(placed.backward))
    widths = [GLYPHS.get(kind, 10.0) + text_width(text, ink.SMALL) + 12 for kind, text in legend]
    spots = flowed(widths, inside)
    head = SIZES.margin + (ROW + 1) * len(title) + ROW * len(subtitle) + SIZES.margin
    foot = SIZES.margin + ROW * (spots[-1][0] + 1) + SIZES.margin
    left = placed.corner[0] - (width - placed.width) / 2
    with styled():
        figure, axes = new_page(width, head + placed.height + foot, left, -head)
        drawn = Diagram(figure, axes, content, placed)
        x, y = left + SIZES.margin, SIZES.margin + ROW / 2 - head
        for k, line in enumerate(title):
            drawn.write(x, y + (ROW + 1) * k, line, fontsize=ink.TEXT, weight="bold")
        colour = ink.INK if content.complete else ink.ALARM
        for k, line in enumerate(subtitle):
            drawn.write(x, y + (ROW + 1) * len(title) + ROW * k, line, color=colour)
        for i, flow in enumerate(content.flows):
            _draw_wire(drawn, flow, placed.ways[i], i in placed.backward)
        for block in content.blocks:
            _draw_block(drawn, block)
        for i, flow in enumerate(content.flows):
            at = placed.marker(i, flow.ends.source)
            what = f"marker:{flow.ends.source}.{flow.ends.marker}"
            drawn.pin(*at, "marker", ink.INK, what)
            drawn.write(at[0] - SIZES.pad, at[1], shown_name(flow.word, 16), ha="right")
        for (kind, text), (row, shift) in zip(legend, spots, strict=True):
            y = placed.height + SIZES.margin + ROW * (row + 0.5)
            _draw_glyph(drawn, kind, x + shift, y)
            drawn.write(x + shift + GLYPHS.get(kind, 10.0), y, text)
    return drawn


def _view(graph: Graph) -> dict[str, Point]:
    """Places [pt] of boxes' upper left corners that the file gives; y downward."""
    view = graph.extras.get("view")
    found: dict[str, Point] = {}
    for name, at in view.items() if isinstance(view, dict) else ():
        if isinstance(at, list | tuple) and len(at) == 2 and name in graph.blocks:
            x, y = at
            if all(isinstance(c, int | float) and math.isfinite(c) for c in (x, y)):
                found[name] = (float(x), float(y))
    return found


# -- blocks ------------------------------------------------------------------------------


def _draw_block(drawn: Diagram, block: Shown) -> None:
    from matplotlib.patches import Rectangle as Patch

    r = drawn.placed.boxes[block.name]
    wrong, unknown, small = (block.kind == k for k in ("missing", "unknown", "element"))
    place, edge = ((r.x, r.y), r.width, r.height), ink.ALARM if wrong else ink.INK
    look: dict[str, Any] = {"ls": "--" if wrong else "-", "lw": 0.6 if small else 0.9, "zorder": 2}
    backed = {}
    if unknown:  # an outline over pale hatching, and words on paper
        drawn.axes.add_patch(Patch(*place, fill=False, ec=ink.PALE, hatch="////", zorder=1.9))
        look |= {"hatch": "////", "fc": "none"}
        backed = {"bbox": {"facecolor": ink.PAPER, "edgecolor": "none", "pad": 0.5}}
    look = {"fc": FILLS[block.kind], "ec": edge, "label": f"box:{block.name}", **look}
    drawn.axes.add_patch(Patch(*place, **look))
    middle, size = r.x + r.width / 2, ink.SMALL if small else ink.TEXT
    name, words = shown_name(block.name), shown_name(block.words)
    bold: dict[str, Any] = {"fontsize": size, "weight": "bold", "ha": "center", **backed}
    drawn.write(middle, r.y + 0.55 * ROW, name, **bold)
    at, side = (r.x + r.width - SIZES.pad, "right") if small else (middle, "center")
    grey = ink.ALARM if wrong else ink.GREY
    drawn.write(at, r.y + 1.5 * ROW, words, color=grey, ha=side, **backed)
    for port in block.ports:
        _draw_port(drawn, block, port, backed)
    if block.drive:
        _draw_drive(drawn, r, block.drive)


def _draw_port(drawn: Diagram, block: Shown, port: Port, backed: dict[str, Any]) -> None:
    x, y = drawn.placed.port(block.name, port.name)
    colour = ink.INK if port.wired else ink.ALARM
    what = f"{'port' if port.wired else 'unwired'}:{block.name}.{port.name}"
    drawn.pin(x, y, port.pair, colour, what)
    drawn.write(x + SIZES.pad, y, port.label, color=colour, **backed)
    if not port.wired:
        drawn.cross(x, y)


def _draw_drive(drawn: Diagram, r: Rectangle, labels: tuple[str, ...]) -> None:
    """Coordinate in and driving effort out, on top of a driver."""
    low, high = r.y - 0.5, r.y - 2 * ROW + 5
    for label, way, side, aside in zip(
        labels, ("forward", "back"), ("right", "left"), (-4, 4), strict=True
    ):
        x = r.x + r.width / 2 + aside
        ends = [(x, high), (x, low)]
        drawn.arrow(ends if way == "forward" else ends[::-1], ARROWS[way], f"{way}:drive")
        drawn.write(x + aside, high + 4, label, color=ARROWS[way], ha=side)


# -- wires ---------------------------------------------------------------------------------


def _draw_wire(drawn: Diagram, flow: Flow, way: Sequence[Point], backward: bool) -> None:
    address = f"{flow.ends.source}.{flow.ends.marker} -> {flow.ends.target}.{flow.ends.port}"
    if backward:
        drawn.arrow(shortened(way, SIZES.port), ink.ALARM, f"cycle:{address}")
        return
    distance = SIZES.aside if flow.forward else 0.0
    if flow.forward:
        forward = shortened(shifted(way, distance), SIZES.port)
        drawn.arrow(forward, ink.FORWARD, f"forward:{address}")
    back = shortened(shifted(way, -distance)[::-1], SIZES.port)
    drawn.arrow(back, ink.BACK, f"back:{address}")


def shifted(way: Sequence[Point], distance: float) -> list[Point]:
    """A right-angled way moved to its left (seen on the page) by a distance, corners kept."""
    moved = list(way)
    for k, ((x1, y1), (x2, y2)) in enumerate(pairwise(way)):
        r = math.hypot(x2 - x1, y2 - y1) or 1.0
        dx, dy = (y2 - y1) / r * distance, -(x2 - x1) / r * distance
        for i in (k, k + 1):
            # A horizontal part moves its ends up or down, a vertical one sideways.
            moved[i] = (moved[i][0] + dx, moved[i][1] + dy)
    return moved


def shortened(way: Sequence[Point], by: float) -> list[Point]:
    """A way whose two ends stop short by a distance."""
    cut = list(way)
    for end, near in ((0, 1), (-1, -2)):
        (x, y), (x2, y2) = way[end], way[near]
        r = math.hypot(x2 - x, y2 - y) or 1.0
        cut[end] = (x + (x2 - x) / r * by, y + (y2 - y) / r * by)
    return cut


# -- legend ----------------------------------------------------------------------------


def _legend(content: Content, cycle: bool) -> list[tuple[str, str]]:
    """Kinds and words of the symbols that are there."""
    ports = [p for b in content.blocks for p in b.ports]
    entries = {
        ("forward", "motion forward: p, v, a"): True,
        ("back", "force and moment back: F, M"): True,
        ("R", "revolute joint"): any(p.pair == "R" for p in ports),
        ("P", "prismatic joint"): any(p.pair == "P" for p in ports),
        ("", "load"): any(b.kind == "element" for b in content.blocks),
        ("marker", "marker"): bool(content.flows),
        ("unwired", "not wired"): not all(p.wired for p in ports),
        ("cycle", "waits for a later block"): cycle,
    }
    return [entry for entry, there in entries.items() if there]


def _draw_glyph(drawn: Diagram, kind: str, x: float, y: float) -> None:
    if kind in ARROWS:
        ends = [(x, y), (x + 17, y)]
        drawn.arrow(ends[::-1] if kind == "back" else ends, ARROWS[kind], "legend")
    elif kind == "unwired":
        drawn.pin(x + 14, y, "R", ink.ALARM, "legend")
        drawn.cross(x + 14, y)
    else:
        drawn.pin(x + 4, y, kind, ink.INK, "legend")
