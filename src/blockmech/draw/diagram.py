"""The block diagram as a picture ([R10] Figs. 3 and 9).

Blocks are boxes in the order of formation, joints and used markers sit on their
edges. Each wire is two lines: motion flows forward, force and moment flow back.

Sources: [R10] Ruiz, Durango & Calle 2010.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from blockmech.draw import palette as ink
from blockmech.draw.boxes import PAD, Content, Flow, Shown, content_of
from blockmech.draw.layout import arrange
from blockmech.draw.paper import new_page, shown_name, styled, text_width, wrapped
from blockmech.draw.routing import ROW, STUB, Placed, Point, Rectangle, place, way_between
from blockmech.model.graph import Graph
from blockmech.model.naming import Names

MARGIN = 6.0  # [pt] around everything
HALF = 1.35  # [pt] half the distance of a wire's two lines
PIN = 2.6  # [pt] radius of a port
HEAD = 5.0  # [pt] length of an arrowhead
LINE = 10.5  # [pt] height of a line of small text
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


def draw_diagram(graph: Graph, names: Names | None = None) -> Diagram:
    """Draw the block diagram of a graph, complete or not.

    ``names`` of the links and joints that it was made of stand in the place of its own.
    """
    content = content_of(graph, names)
    placed = _placed(content, graph)
    legend = _legend_entries(content, bool(placed.backward))
    width = max(placed.width + 2 * MARGIN, ink.COLUMN)
    title = wrapped(shown_name(content.title, 90), ink.TEXT, width - 2 * MARGIN, bold=True)
    subtitle = wrapped(shown_name(content.subtitle, 1200), ink.SMALL, width - 2 * MARGIN)
    rows = _legend_rows(legend, width - 2 * MARGIN)
    top = MARGIN + (ROW + 1) * len(title) + LINE * len(subtitle) + 6
    bottom = 8 + LINE * len(rows) + MARGIN
    with styled():
        figure, axes = new_page(width, top + placed.height + bottom)
        drawn = Diagram(figure, axes, content, placed)
        _move(placed, max(MARGIN, (width - placed.width) / 2), top)
        _draw_title(drawn, title, subtitle)
        for i, flow in enumerate(content.flows):
            _draw_wire(drawn, flow, placed.ways[i], i in placed.backward)
        for block in content.blocks:
            _draw_block(drawn, block)
        for i, flow in enumerate(content.flows):
            what = f"marker:{flow.ends.source}.{flow.ends.marker}"
            _draw_marker(drawn, placed.markers[i], what, flow.word)
        _draw_legend(drawn, rows, top + placed.height + 8 + LINE / 2)
    return drawn


# -- places ----------------------------------------------------------------------------


def _placed(content: Content, graph: Graph) -> Placed:
    boxes = [b.box() for b in content.blocks]
    wires = [f.ends for f in content.flows]
    placed = place(arrange(boxes, wires), wires)
    view = _view(graph)
    if view:
        _honour(placed, view, content)
    return placed


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


def _honour(placed: Placed, view: dict[str, Point], content: Content) -> None:
    """Move boxes to the author's places, the others below them; wires follow plainly."""
    old = dict(placed.boxes)
    x0, y0 = min(x for x, _ in view.values()), min(y for _, y in view.values())
    below = max(view[n][1] - y0 + old[n].height for n in view) + 2 * ROW
    others = [old[n] for n in old if n not in view]
    top = min((r.y for r in others), default=0.0)
    room = 2 * ROW if any(b.drive for b in content.blocks) else 0.0
    for name, r in old.items():
        x, y = view.get(name, (r.x + x0, r.y - top + below + y0))
        placed.boxes[name] = Rectangle(x - x0 + STUB, y - y0 + room, r.width, r.height)
    for box, port in placed.ports:
        x, y = placed.ports[box, port]
        new, was = placed.boxes[box], old[box]
        placed.ports[box, port] = (x - was.x + new.x, y - was.y + new.y)
    for i, flow in enumerate(content.flows):
        x, y = placed.markers[i]
        new, was = placed.boxes[flow.ends.source], old[flow.ends.source]
        placed.markers[i] = (x - was.x + new.x, y - was.y + new.y)
        end = placed.ports[flow.ends.target, flow.ends.port]
        placed.ways[i] = way_between(placed.markers[i], end, i, placed.boxes.values())
    corners = [p for way in placed.ways.values() for p in way]
    corners += [(r.x + r.width, r.y + r.height) for r in placed.boxes.values()]
    left = min(0.0, min(x for x, _ in corners) - MARGIN)
    _move(placed, -left, 0.0)
    placed.width = max(x for x, _ in corners) - left + MARGIN
    placed.height = max(y for _, y in corners)


def _move(placed: Placed, dx: float, dy: float) -> None:
    for name, r in placed.boxes.items():
        placed.boxes[name] = r._replace(x=r.x + dx, y=r.y + dy)
    placed.ports.update({k: (x + dx, y + dy) for k, (x, y) in placed.ports.items()})
    placed.markers.update({k: (x + dx, y + dy) for k, (x, y) in placed.markers.items()})
    placed.ways.update({k: [(x + dx, y + dy) for x, y in way] for k, way in placed.ways.items()})


# -- ink -------------------------------------------------------------------------------


def _write(drawn: Diagram, x: float, y: float, text: str, **style: Any) -> None:
    given = {"fontsize": ink.SMALL, "va": "center_baseline", "color": ink.INK, "label": "text"}
    drawn.labels.append(drawn.axes.text(x, y, text, **{**given, **style}))


def _draw_title(drawn: Diagram, title: Sequence[str], subtitle: Sequence[str]) -> None:
    y = MARGIN + ROW / 2
    for line in title:
        _write(drawn, MARGIN, y, line, fontsize=ink.TEXT, weight="bold")
        y += ROW + 1
    for line in subtitle:
        _write(drawn, MARGIN, y, line, color=ink.INK if drawn.content.complete else ink.ALARM)
        y += LINE


def _draw_block(drawn: Diagram, block: Shown) -> None:
    from matplotlib.patches import Rectangle as Patch

    r = drawn.placed.boxes[block.name]
    wrong = block.kind == "missing"
    drawn.axes.add_patch(
        Patch(
            (r.x, r.y),
            r.width,
            r.height,
            facecolor=FILLS[block.kind],
            edgecolor=ink.ALARM if wrong else ink.PALE if block.kind == "unknown" else ink.INK,
            hatch="////" if block.kind == "unknown" else None,
            linestyle="--" if wrong else "-",
            linewidth=0.6 if block.kind == "element" else 0.9,
            zorder=2,
            label=f"box:{block.name}",
        )
    )
    if block.kind == "unknown":  # an outline over the pale hatching
        drawn.axes.add_patch(
            Patch((r.x, r.y), r.width, r.height, fill=False, edgecolor=ink.INK, lw=0.9, zorder=2.1)
        )
    small = block.kind == "element"
    middle = r.x + r.width / 2
    size = ink.SMALL if small else ink.TEXT
    backed = {"bbox": {"facecolor": ink.PAPER, "edgecolor": "none", "pad": 0.6}}
    style: dict[str, Any] = {"ha": "center", "zorder": 4}
    style |= backed if block.kind == "unknown" else {}
    _write(
        drawn,
        middle,
        r.y + 0.55 * ROW,
        shown_name(block.name),
        fontsize=size,
        weight="bold",
        **style,
    )
    words = shown_name(block.words)
    if small:
        x, y = r.x + r.width - PAD, r.y + 1.5 * ROW
        _write(drawn, x, y, words, color=ink.GREY, ha="right", zorder=4)
    else:
        color = ink.ALARM if wrong else ink.GREY
        _write(drawn, middle, r.y + 1.5 * ROW, words, color=color, **style)
    for port in block.ports:
        _draw_port(drawn, block, port.name, port.pair, port.label, port.wired)
    if block.drive:
        _draw_drive(drawn, r, block.drive)


def _draw_port(drawn: Diagram, block: Shown, name: str, pair: str, label: str, wired: bool) -> None:
    x, y = drawn.placed.ports[block.name, name]
    address = f"{block.name}.{name}"
    colour = ink.INK if wired else ink.ALARM
    _draw_pin(drawn, x, y, pair, colour, f"{'port' if wired else 'unwired'}:{address}")
    backed = {"bbox": {"facecolor": ink.PAPER, "edgecolor": "none", "pad": 0.4}}
    style = backed if block.kind == "unknown" else {}
    _write(drawn, x + PAD, y, label, color=colour, zorder=4, **style)
    if not wired:
        cross = [(x - 10, y - 2.5), (x - 5, y + 2.5)], [(x - 10, y + 2.5), (x - 5, y - 2.5)]
        for line in ([(x - 7.5, y), (x - PIN, y)], *cross):
            drawn.axes.plot(*zip(*line, strict=True), color=ink.ALARM, lw=1.1, zorder=3)


def _draw_pin(drawn: Diagram, x: float, y: float, pair: str, colour: str, what: str) -> None:
    from matplotlib.patches import Circle, Polygon
    from matplotlib.patches import Rectangle as Patch

    style: dict[str, Any] = {
        "facecolor": ink.PAPER,
        "edgecolor": colour,
        "linewidth": 0.9,
        "zorder": 5,
        "label": what,
    }
    if pair == "R":
        drawn.axes.add_patch(Circle((x, y), PIN, **style))
    elif pair == "P":
        drawn.axes.add_patch(Patch((x - PIN, y - PIN), 2 * PIN, 2 * PIN, **style))
    else:
        r = PIN + 0.4
        drawn.axes.add_patch(Polygon([(x - r, y), (x, y - r), (x + r, y), (x, y + r)], **style))


def _draw_marker(drawn: Diagram, at: Point, what: str, word: str) -> None:
    from matplotlib.patches import Circle

    x, y = at
    drawn.axes.add_patch(Circle((x, y), PIN - 0.6, facecolor=ink.INK, lw=0, zorder=5, label=what))
    _write(drawn, x - PAD, y, shown_name(word, 16), ha="right", zorder=4)


def _draw_drive(drawn: Diagram, r: Rectangle, labels: tuple[str, ...]) -> None:
    """Coordinate in and driving effort out, on top of a driver."""
    for k, (label, colour) in enumerate(zip(labels, (ink.FORWARD, ink.BACK), strict=True)):
        x = r.x + r.width / 2 + (-4, 4)[k]
        low, high = r.y - 0.5, r.y - 2 * ROW + 5
        ends = [(x, high), (x, low)] if k == 0 else [(x, low), (x, high)]
        _draw_arrow(drawn, ends, colour, f"{'forward' if k == 0 else 'back'}:drive")
        side = {"ha": "right"} if k == 0 else {"ha": "left"}
        _write(drawn, x + (-4, 4)[k], high + 4, label, color=colour, **side)


def _draw_wire(drawn: Diagram, flow: Flow, way: Sequence[Point], backward: bool) -> None:
    address = f"{flow.ends.source}.{flow.ends.marker} -> {flow.ends.target}.{flow.ends.port}"
    if backward:
        _draw_arrow(drawn, shortened(way, PIN), ink.ALARM, f"cycle:{address}")
        return
    distance = HALF if flow.forward else 0.0
    if flow.forward:
        forward = shortened(shifted(way, distance), PIN)
        _draw_arrow(drawn, forward, ink.FORWARD, f"forward:{address}")
    back = shortened(shifted(way, -distance)[::-1], PIN)
    _draw_arrow(drawn, back, ink.BACK, f"back:{address}")


def _draw_arrow(drawn: Diagram, way: Sequence[Point], colour: str, what: str) -> None:
    """A line with an arrowhead at its end."""
    from matplotlib.patches import Polygon

    (x0, y0), (x, y) = way[-2], way[-1]
    r = math.hypot(x - x0, y - y0) or 1.0
    dx, dy = (x - x0) / r, (y - y0) / r
    neck = (x - HEAD * dx, y - HEAD * dy)
    shaft = [*way[:-1], (x - 0.7 * HEAD * dx, y - 0.7 * HEAD * dy)]
    drawn.axes.plot(
        *zip(*shaft, strict=True),
        color=colour,
        lw=1.0,
        solid_joinstyle="round",
        solid_capstyle="butt",
        zorder=1.8,
        label=what,
    )
    half = 0.42 * HEAD
    tip = [(x, y), (neck[0] - half * dy, neck[1] + half * dx)]
    tip.append((neck[0] + half * dy, neck[1] - half * dx))
    drawn.axes.add_patch(Polygon(tip, facecolor=colour, linewidth=0, zorder=3.5))


def shifted(way: Sequence[Point], distance: float) -> list[Point]:
    """A right-angled way moved to its left (seen on the page) by a distance, corners kept."""
    moved = list(way)
    for (x1, y1), (x2, y2), k in zip(way, way[1:], range(len(way)), strict=False):
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


def _legend_entries(content: Content, cycle: bool) -> list[tuple[str, str]]:
    ports = [p for b in content.blocks for p in b.ports]
    entries = [("forward", "motion forward: p, v, a"), ("back", "force and moment back: F, M")]
    entries += [("R", "revolute joint")] if any(p.pair == "R" for p in ports) else []
    entries += [("P", "prismatic joint")] if any(p.pair == "P" for p in ports) else []
    entries += [("", "load")] if any(b.kind == "element" for b in content.blocks) else []
    entries += [("marker", "marker")] if content.flows else []
    entries += [("unwired", "not wired")] if not all(p.wired for p in ports) else []
    entries += [("cycle", "waits for a later block")] if cycle else []
    return entries


def _legend_rows(
    entries: Sequence[tuple[str, str]], width: float
) -> list[list[tuple[str, str, float]]]:
    rows: list[list[tuple[str, str, float]]] = [[]]
    x = 0.0
    for kind, text in entries:
        wide = GLYPHS.get(kind, 10.0) + text_width(text, ink.SMALL) + 12
        if rows[-1] and x + wide > width:
            rows.append([])
            x = 0.0
        rows[-1].append((kind, text, x))
        x += wide
    return rows


def _draw_legend(
    drawn: Diagram, rows: Sequence[Sequence[tuple[str, str, float]]], y: float
) -> None:
    for row in rows:
        for kind, text, x0 in row:
            x = MARGIN + x0
            if kind in ARROWS:
                ends = [(x, y), (x + 17, y)]
                _draw_arrow(drawn, ends[::-1] if kind == "back" else ends, ARROWS[kind], "legend")
            elif kind == "marker":
                from matplotlib.patches import Circle

                dot = Circle((x + 4, y), PIN - 0.6, facecolor=ink.INK, lw=0)
                drawn.axes.add_patch(dot)
            elif kind == "unwired":
                _draw_pin(drawn, x + 14, y, "R", ink.ALARM, "legend")
                for s in (-2.5, 2.5):
                    xs, ys = (x + 4, x + 9), (y - s, y + s)
                    drawn.axes.plot(xs, ys, color=ink.ALARM, lw=1.1)
                drawn.axes.plot((x + 6.5, x + 14 - PIN), (y, y), color=ink.ALARM, lw=1.1)
            else:
                _draw_pin(drawn, x + 4, y, kind, ink.INK, "legend")
            _write(drawn, x + GLYPHS.get(kind, 10.0), y, text)
        y += LINE
