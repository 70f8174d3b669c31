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
from typing import TYPE_CHECKING, Any

from blockmech.blocks.joints import PAIRS
from blockmech.draw.boxes import Content, DrawnBlock, DrawnWire, Port, content_of
from blockmech.draw.layout import arrange
from blockmech.draw.routing import Placed, Point, Rectangle, honour, lay_out
from blockmech.figures import palette as ink
from blockmech.figures.palette import ROW, SIZES
from blockmech.figures.paper import fitting_columns, new_page, shown_name, styled, wrapped
from blockmech.model.graph import Graph
from blockmech.model.naming import Names
from blockmech.typing import Arguments, Data

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

ARROWHEAD = "-|>,head_length=4.2,head_width=1.5"  # [pt]
ARROWS = {"forward": ink.FORWARD, "back": ink.BACK, "cycle": ink.ALARM, "signal": ink.INK}
DASHED = (0, (3.5, 2))
SYMBOLS = {  # of joints, terminals (loads) and markers: shape, size [pt], fill
    "R": ("o", 2 * SIZES.port, ink.PAPER),
    "P": ("s", 2 * SIZES.port, ink.PAPER),
    "": ("D", 1.6 * SIZES.port, ink.PAPER),
    "q": ("D", 1.6 * SIZES.port, ink.FORWARD),
    "marker": ("o", 2 * SIZES.port - 2, ink.INK),
}
FILLS = {
    "frame": ink.FRAME_FILL,
    "driver": ink.DRIVER_FILL,
    "group": ink.GROUP_FILL,
    "element": ink.ELEMENT_FILL,
    "coupling": ink.DRIVER_FILL,
    "signal": ink.PAPER,
    "graph": ink.FRAME_FILL,
    "unknown": "none",
    "missing": ink.PAPER,
}


@dataclass
class Diagram:
    """A drawn diagram: the figure, and where everything is on it [pt, y downward].

    Labels of the artists tell what they are: ``box:crank``, ``port:crank.A``,
    ``unwired:dyad.D``, ``forward:...``, ``back:...``, ``cycle:...``, ``text``.
    """

    figure: Figure
    axes: Axes
    content: Content
    placed: Placed
    labels: list[Text] = field(default_factory=list)

    def write(self, x: float, y: float, text: str, **style: Any) -> None:
        """A line of text, its middle at a height."""
        defaults = {"fontsize": ink.SMALL, "va": "center_baseline", "color": ink.INK, "zorder": 4}
        self.labels.append(self.axes.text(x, y, text, label="text", **{**defaults, **style}))

    def arrow(self, path: Sequence[Point], kind: str, label: str) -> None:
        """A line with an arrowhead at its end."""
        from matplotlib.patches import FancyArrowPatch
        from matplotlib.path import Path

        style: Arguments = {"arrowstyle": ARROWHEAD, "mutation_scale": 1, "lw": 1.0}
        style |= {"color": ARROWS[kind], "joinstyle": "round", "zorder": 1.8}
        style |= {"ls": DASHED} if kind == "signal" else {}
        self.axes.add_patch(FancyArrowPatch(path=Path(path), label=f"{kind}:{label}", **style))

    def pin(self, x: float, y: float, pair: str, label: str, colour: str = ink.INK) -> None:
        """The symbol of a joint or a terminal; a marker is a dot."""
        self.axes.plot([x], [y], **_symbol(pair, colour), zorder=5, label=label)

    def cross(self, x: float, y: float) -> None:
        """A red cross on a stump: nothing is wired to the pin at a place."""
        self.axes.plot((x - 7.5, x), (y, y), color=ink.ALARM, marker="x", ms=5, markevery=[0], lw=1)


def draw_diagram(graph: Graph, names: Names | None = None) -> Diagram:
    """Draw the block diagram of a graph, complete or not.

    ``names`` of the links and joints that it was made of stand in the place of its own.
    """
    content = content_of(graph, names)
    wires = [wire.ends for wire in content.wires]
    placed = lay_out(arrange([b.box() for b in content.blocks], wires))
    view = view_of(graph)
    if view:
        honour(placed, view)
    inside = max(placed.width, ink.COLUMN - 2 * SIZES.margin)
    width = inside + 2 * SIZES.margin
    title = wrapped(shown_name(content.title, 90), ink.TEXT, inside, bold=True)
    subtitle = wrapped(shown_name(content.subtitle, 1200), ink.SMALL, inside)
    waits = any(not content.wires[i].signal for i in placed.made.backward)
    legend = _legend(content, waits)
    columns = fitting_columns([*legend], inside)
    head = 2 * SIZES.margin + (ROW + 1) * len(title) + ROW * len(subtitle)
    foot = 2 * SIZES.margin + 1.1 * ROW * -(-len(legend) // columns)
    left_edge = placed.corner[0] - (width - placed.width) / 2
    total = head + placed.height + foot
    with styled():
        from matplotlib.lines import Line2D

        figure, axes = new_page(width, total, left_edge, -head)
        diagram = Diagram(figure, axes, content, placed)
        x, y = left_edge + SIZES.margin, SIZES.margin + ROW / 2 - head
        for k, line in enumerate(title):
            diagram.write(x, y + (ROW + 1) * k, line, fontsize=ink.TEXT, weight="bold")
        colour = ink.INK if content.complete else ink.ALARM
        for k, line in enumerate(subtitle):
            diagram.write(x, y + (ROW + 1) * len(title) + ROW * k, line, color=colour)
        for i, wire in enumerate(content.wires):
            _draw_wire(diagram, i, wire)
        for block in content.blocks:
            _draw_block(diagram, block)
        handles = [Line2D([], [], label=label, **look) for label, look in legend.items()]
        corner = (SIZES.margin / width, SIZES.margin / total)
        axes.legend(handles=handles, bbox_to_anchor=corner, ncols=columns)
    return diagram


def view_of(graph: Graph) -> dict[str, Point]:
    """Places [pt] of boxes' upper left corners that the file gives; y downward."""
    view = graph.extras.get("view")
    corners: dict[str, Point] = {}
    for name, at in view.items() if isinstance(view, dict) else ():
        if isinstance(at, list | tuple) and len(at) == 2 and name in graph.blocks:
            x, y = at
            if all(isinstance(c, int | float) and math.isfinite(c) for c in (x, y)):
                corners[name] = (float(x), float(y))
    return corners


# -- blocks ------------------------------------------------------------------------------


def _draw_block(diagram: Diagram, block: DrawnBlock) -> None:
    from matplotlib.patches import Rectangle as Patch

    r = diagram.placed.boxes[block.name]
    wrong, unknown, small = (block.kind == k for k in ("missing", "unknown", "element"))
    look: Arguments = {"fc": FILLS[block.kind], "ec": ink.ALARM if wrong else ink.INK}
    look |= {"ls": "--" if wrong else "-", "lw": 0.6 if small else 0.9, "zorder": 2}
    backed = {}
    if unknown:  # words on paper over pale hatching
        diagram.axes.add_patch(Patch((r.x, r.y), r.width, r.height, **look))
        look |= {"hatch": "////", "ec": ink.PALE, "zorder": 1.9}
        backed = {"bbox": {"facecolor": ink.PAPER, "edgecolor": "none", "pad": 0.5}}
    box = Patch((r.x, r.y), r.width, r.height, label=f"box:{block.name}", **look)
    diagram.axes.add_patch(box)
    middle, size = r.x + r.width / 2, ink.SMALL if small else ink.TEXT
    bold: Arguments = {"fontsize": size, "weight": "bold", "ha": "center", **backed}
    diagram.write(middle, r.y + 0.55 * ROW, shown_name(block.name), **bold)
    at, side = (r.x + r.width - SIZES.pad, "right") if small else (middle, "center")
    grey = ink.ALARM if wrong else ink.GREY
    diagram.write(at, r.y + 1.5 * ROW, shown_name(block.words), color=grey, ha=side, **backed)
    for port in block.ports:
        _draw_port(diagram, block, port, backed)
    if block.drive:
        _draw_drive(diagram, r, block.drive)


def _draw_port(diagram: Diagram, block: DrawnBlock, port: Port, backed: Data) -> None:
    x, y = diagram.placed.port(block.name, port.name)
    colour = ink.INK if port.wired else ink.ALARM
    label = f"{'port' if port.wired else 'unwired'}:{block.name}.{port.name}"
    if not port.wired:
        diagram.cross(x, y)
    diagram.pin(x, y, port.pair, label, colour)
    diagram.write(x + SIZES.pad, y, port.label, color=colour, **backed)


def _draw_drive(diagram: Diagram, r: Rectangle, labels: tuple[str, ...]) -> None:
    """Coordinate in and driving effort out, on top of a driver."""
    low, high, middle = r.y - 0.5, r.y - 2 * ROW + 5, r.x + r.width / 2
    forward, back = labels
    diagram.arrow([(middle - 4, high), (middle - 4, low)], "forward", "drive")
    diagram.arrow([(middle + 4, low), (middle + 4, high)], "back", "drive")
    diagram.write(middle - 8, high + 4, forward, color=ink.FORWARD, ha="right")
    diagram.write(middle + 8, high + 4, back, color=ink.BACK, ha="left")


# -- wires ---------------------------------------------------------------------------------


def _draw_wire(diagram: Diagram, i: int, wire: DrawnWire) -> None:
    source, marker, *_ = wire.ends
    label, path = str(wire.ends), diagram.placed.ways[i]
    if wire.signal:
        diagram.arrow(shortened(path, SIZES.port), "signal", label)
    elif i in diagram.placed.made.backward:
        diagram.arrow(shortened(path, SIZES.port), "cycle", label)
    else:
        aside = SIZES.aside if wire.forward else 0.0
        if wire.forward:
            diagram.arrow(shortened(shifted(path, aside), SIZES.port), "forward", label)
        diagram.arrow(shortened(shifted(path, -aside)[::-1], SIZES.port), "back", label)
    x, y = path[0]
    diagram.pin(x, y, "marker", f"marker:{source}.{marker}")
    diagram.write(x - SIZES.pad, y, shown_name(wire.word, 16), ha="right")


def shifted(path: Sequence[Point], distance: float) -> list[Point]:
    """A right-angled way moved to its left (seen on the page) by a distance, corners kept."""
    moved = list(path)
    for k, ((x1, y1), (x2, y2)) in enumerate(pairwise(path)):
        r = math.hypot(x2 - x1, y2 - y1) or 1.0
        dx, dy = (y2 - y1) / r * distance, -(x2 - x1) / r * distance
        for i in (k, k + 1):
            # A horizontal part moves its ends up or down, a vertical one sideways.
            moved[i] = (moved[i][0] + dx, moved[i][1] + dy)
    return moved


def shortened(path: Sequence[Point], by: float) -> list[Point]:
    """A way whose two ends stop short by a distance."""
    cut = list(path)
    for end, neighbour in ((0, 1), (-1, -2)):
        (x, y), (x2, y2) = path[end], path[neighbour]
        r = math.hypot(x2 - x, y2 - y) or 1.0
        cut[end] = (x + (x2 - x) / r * by, y + (y2 - y) / r * by)
    return cut


# -- legend ----------------------------------------------------------------------------


def _symbol(pair: str, colour: str = ink.INK) -> Data:
    shape, size, fill = SYMBOLS[pair]
    return {"marker": shape, "ms": size, "mfc": fill, "mec": colour, "mew": 0.9, "ls": ""}


def _legend(content: Content, cycle: bool) -> dict[str, Data]:
    """Words and looks of the symbols that are there."""
    ports = [p for b in content.blocks for p in b.ports]
    pairs = {p.pair for p in ports}
    forward, back, wrong = (
        {"color": ARROWS[kind], "marker": head, "ms": 4, "lw": 1.0}
        for kind, head in (("forward", ">"), ("back", "<"), ("cycle", ">"))
    )
    cross = {"color": ink.ALARM, "marker": "x", "ms": 5, "lw": 1.0}
    signal = {"color": ink.INK, "ls": DASHED, "lw": 1.0}
    entries = (
        ("motion forward: p, v, a", forward, True),
        ("back: force F and moment M; reduced effort τ and inertia J", back, True),
        *((f"{pair.word} joint", _symbol(k), k in pairs) for k, pair in PAIRS.items()),
        ("load", _symbol(""), any(b.kind == "element" for b in content.blocks)),
        ("coupling", _symbol("q"), "q" in pairs),
        ("signal", signal, any(w.signal for w in content.wires)),
        ("marker", _symbol("marker"), bool(content.wires)),
        ("not wired", cross, not all(p.wired for p in ports)),
        ("waits for a later block", wrong, cycle),
    )
    return {text: look for text, look, is_used in entries if is_used}
