"""Work and precision: the error over what it costs, the habit of the field's papers.

Log-log, one series a method, the Pareto front as a broad line behind, the floor of the
reference hatched. Above the cost in seconds, below in kernel evaluations.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.paper import new_figure, rendered, shown_name, styled, text_width, wrapped
from blockmech.files import writing

if TYPE_CHECKING:
    from blockmech.analysis.trade.points import Point, Trade

PANEL = 150.0  # [pt] height of a panel's axes
LEFT, RIGHT, TOP, BETWEEN = 37.0, 8.0, 5.0, 30.0  # [pt]
XLABEL = 27.0  # [pt] below a panel
LINE = 9.5  # [pt] of caption and legend
LABEL = 6.0  # [pt] size of the settings' labels
MARKS = "osD^vPX*<>hp"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
RING = 3.4  # [pt] size of a point
GAP = 4.0  # [pt] between labels of ticks
COSTS = (("seconds", "time of one run [s]"), ("evaluations", "kernel evaluations [–]"))


Spot = tuple[float, float]
Stroke = tuple[Spot, Spot]
"""A straight line of the panel from one spot to another, in points."""


class Box(NamedTuple):
    """A rectangle in points of the panel."""

    x: float
    y: float
    width: float
    height: float

    def crossed(self, stroke: Stroke) -> bool:
        """Whether a line passes through the rectangle (Liang & Barsky)."""
        (x0, y0), (x1, y1) = stroke
        first, last = 0.0, 1.0
        for start, way, low, size in (
            (x0, x1 - x0, self.x, self.width),
            (y0, y1 - y0, self.y, self.height),
        ):
            if way == 0:
                if not low < start < low + size:
                    return False
                continue
            a, b = sorted(((low - start) / way, (low + size - start) / way))
            first, last = max(first, a), min(last, b)
        return first < last

    def meets(self, other: Box) -> bool:
        """Whether two rectangles overlap."""
        return (
            self.x < other.x + other.width
            and other.x < self.x + self.width
            and self.y < other.y + other.height
            and other.y < self.y + self.height
        )


def draw_trade(trade: Trade, path: str | os.PathLike[str]) -> Path:
    """Write the picture of a trade; the suffix says the format (png, svg, pdf)."""
    data = rendered(trade_figure(trade), refuse_other_suffixes(path))
    with writing(path) as stream:
        stream.write(data)
    return Path(path)


def refuse_other_suffixes(path: str | os.PathLike[str]) -> str:
    """The suffix of a picture's file; raises `RequestError` for one that is no picture's."""
    from blockmech.draw import STILL, _suffix

    return _suffix(path, STILL, "a plot")


def trade_figure(trade: Trade) -> Any:
    """The picture of a trade, a column wide."""
    inside = ink.COLUMN - LEFT - RIGHT
    caption = [
        line for text in _caption(trade) for line in wrapped(text, ink.SMALL, ink.COLUMN - 10)
    ]
    series = {name: _finite(points) for name, points in trade.series().items()}
    series = {name: points for name, points in series.items() if points}
    rows = _legend_rows(series, inside)
    head = LINE * len(rows) + 4
    foot = LINE * len(caption) + 6
    height = TOP + head + 2 * PANEL + BETWEEN + XLABEL + foot
    with styled():
        figure = new_figure(ink.COLUMN, height)
        top = height - TOP - head
        for cost, words in COSTS:
            box = (LEFT / ink.COLUMN, (top - PANEL) / height, inside / ink.COLUMN, PANEL / height)
            axes = figure.add_axes(box)
            _panel(axes, trade, series, cost, inside)
            axes.set_xlabel(words, labelpad=1)
            axes.set_ylabel("error [–]", labelpad=2)
            top -= PANEL + BETWEEN
        _legend(figure, rows, series, height)
        for i, line in enumerate(caption):
            y = (foot - LINE * (i + 1)) / height
            figure.text(5 / ink.COLUMN, y, line, fontsize=ink.SMALL, color=ink.INK)
    return figure


def _caption(trade: Trade) -> list[str]:
    r = trade.reference
    head = f"{shown_name(trade.mechanism, 40)}, {trade.question}."
    if not trade.points:
        return [f"{head} Nothing was measured: {'; '.join(trade.notes)}."]
    unseen = " On the hatching: no difference seen." if any(p.below for p in trade.points) else ""
    return [
        f"{head} Error: {trade.measure}, against "
        f"{r.method}, checked by {r.check}, which leaves {r.floor:.0e} open (hatched).{unseen} "
        "Time: median, bars from the fastest to the slowest of at least 5 warm runs. "
        f"Evaluations: {trade.counted}. Broad grey line: Pareto front. {meaning(trade.points)}"
    ]


def _finite(points: Sequence[Point]) -> list[Point]:
    return [p for p in points if 0 < p.error < math.inf]


def _panel(
    axes: Any, trade: Trade, series: dict[str, list[Point]], cost: str, inside: float
) -> None:
    points = [p for row in series.values() for p in row]
    if not points:
        axes.set_xticks([])
        axes.set_yticks([])
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    floor = trade.reference.floor
    xs = [getattr(p, cost) for p in points]
    if cost == "seconds":
        xs += [p.low for p in points] + [p.high for p in points]
    top = max(max(p.error for p in points), floor)
    axes.set_xlim(min(xs) / 1.6, max(xs) * 2.2)
    span = math.log10(top / floor)
    axes.set_ylim(floor / 10 ** max(0.09 * span, 0.4), top * 10 ** max(0.07 * span, 0.4))
    front = trade.pareto if cost == "seconds" else trade.pareto_by_evaluations
    axes.step(
        [getattr(p, cost) for p in front], [p.error for p in front],
        where="post", color=ink.PALE, lw=5, zorder=1, solid_capstyle="round",
    )  # fmt: skip
    axes.axhspan(1e-300, floor, facecolor="none", edgecolor=ink.GREY, hatch="////", lw=0, zorder=0)
    axes.axhline(floor, color=ink.GREY, lw=0.7, zorder=1.5)
    for i, row in enumerate(series.values()):
        colour, dashes = ink.curve_style(i)
        x, y = [getattr(p, cost) for p in row], [p.error for p in row]
        if cost == "seconds":
            bars = np.array([[p.seconds - p.low for p in row], [p.high - p.seconds for p in row]])
            axes.errorbar(
                x, y, xerr=np.maximum(bars, 0), fmt="none", ecolor=colour, elinewidth=0.5, zorder=2
            )
        (line,) = axes.plot(
            x, y, color=colour, lw=0.9, marker=MARKS[i % len(MARKS)], ms=RING,
            mfc=ink.PAPER, mew=0.8, zorder=3,
        )  # fmt: skip
        if dashes:
            line.set_dashes(dashes)
    at = _placing(axes, inside)
    strokes = _strokes(series, cost, at)
    strokes.append((at(axes.get_xlim()[0], floor), at(axes.get_xlim()[1], floor)))
    _label(axes, points, front, cost, strokes, at, inside)
    _ticks(axes.xaxis, axes.get_xlim(), 7, inside)
    _ticks(axes.yaxis, axes.get_ylim(), 8)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)


def _placing(axes: Any, inside: float) -> Callable[[float, float], Spot]:
    """From cost and error to a spot of the panel."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()

    def at(cost: float, error: float) -> Spot:
        fx = math.log(cost / x0) / math.log(x1 / x0)
        fy = math.log(error / y0) / math.log(y1 / y0)
        return fx * inside, fy * PANEL

    return at


def _strokes(
    series: dict[str, list[Point]], cost: str, at: Callable[[float, float], Spot]
) -> list[Stroke]:
    """What labels should not hide: the curves, and the bars of the times."""
    found = []
    for row in series.values():
        spots = [at(getattr(p, cost), p.error) for p in row]
        found += list(pairwise(spots))
        if cost == "seconds":
            found += [(at(p.low, p.error), at(p.high, p.error)) for p in row]
    return found


def _ticks(axis: Any, limits: tuple[float, float], most: int, wide: float = math.inf) -> None:
    """Ticks at decades, as few as fit; over a short range at more digits of each.

    Along an axis that is so wide [pt], labels keep apart and do not leave the picture.
    """
    low, high = (math.log10(x) for x in limits)
    decades = range(math.ceil(low), math.floor(high) + 1)
    each = 1 + len(decades) // (most + 1)
    ticks = [10.0**k for k in decades if k % each == 0]
    for digits in ((1, 2, 5), range(1, 10), [d / 10 for d in range(10, 100)]):
        if len(ticks) >= 3:
            break
        every = [d * 10.0**k for k in range(math.floor(low), math.ceil(high)) for d in digits]
        ticks = [x for x in every if limits[0] <= x <= limits[1]]
    if math.isfinite(wide):
        ticks = _apart(ticks, low, high, wide)
    axis.set_ticks(ticks, [power_of_ten(x) for x in ticks])
    axis.set_ticks([], minor=True)


def _apart(ticks: list[float], low: float, high: float, wide: float) -> list[float]:
    """Ticks whose labels stand side by side with room between them."""
    kept, end = [], -math.inf
    for x in ticks:
        half = text_width(power_of_ten(x), ink.SMALL) / 2
        middle = (math.log10(x) - low) / (high - low) * wide
        if middle - half >= end and middle + half <= wide + RIGHT:
            kept.append(x)
            end = middle + half + GAP
    return kept


def power_of_ten(x: float) -> str:
    """A number as a digit and a power of ten.

    >>> power_of_ten(2e-3)
    '2·10⁻³'
    """
    digit, exponent = f"{x:.1e}".split("e")
    digit = digit.removesuffix(".0")
    raised = "10" + str(int(exponent)).translate(SUPERSCRIPT)
    return raised if digit == "1" else f"{digit}·{raised}"


def _label(
    axes: Any,
    points: list[Point],
    front: Sequence[Point],
    cost: str,
    strokes: list[Stroke],
    at: Callable[[float, float], Spot],
    inside: float,
) -> None:
    """Write settings beside their points, front first, where there is room.

    A spot that hides no line is better than one that does.
    """
    spots_of = {id(p): at(getattr(p, cost), p.error) for p in points}
    taken = [Box(x - RING / 2, y - RING / 2, RING, RING) for x, y in spots_of.values()]
    first = set(map(id, front))
    said: list[tuple[str, float, float]] = []
    for p in sorted(points, key=lambda p: id(p) not in first):
        text = short(p)
        x, y = spots_of[id(p)]
        again = any(p.method == m and math.hypot(x - u, y - v) < RING for m, u, v in said)
        if not text or again:
            continue
        free = [
            box
            for box in _around(x, y, text_width(text, LABEL))
            if 0 <= box.x <= inside - box.width
            and 0 <= box.y <= PANEL - box.height
            and not any(box.meets(other) for other in taken)
        ]
        if not free:
            continue
        spot = min(free, key=lambda box: sum(map(box.crossed, strokes)))
        taken.append(spot)
        said.append((p.method, x, y))
        axes.text(
            spot.x / inside, (spot.y + LABEL / 2) / PANEL, text, fontsize=LABEL,
            color=ink.INK, transform=axes.transAxes, va="center_baseline", zorder=4,
            bbox={"facecolor": ink.PAPER, "alpha": 0.85, "lw": 0, "pad": 0.2},
        )  # fmt: skip


def _around(x: float, y: float, w: float) -> list[Box]:
    """Rooms for a label so wide [pt] around a point, the usual ones first."""
    h = LABEL
    return [
        Box(x + 4, y - h / 2, w, h), Box(x - w - 4, y - h / 2, w, h),
        Box(x + 3, y + 3, w, h), Box(x + 3, y - h - 3, w, h),
        Box(x - w - 3, y + 3, w, h), Box(x - w - 3, y - h - 3, w, h),
        Box(x - w / 2, y + 4, w, h), Box(x - w / 2, y - h - 4, w, h),
    ]  # fmt: skip


def short(p: Point) -> str:
    """A setting in as few letters as tell it from its neighbours."""
    words = p.setting.removesuffix(" samples").replace("complex", "c").replace("clong", "long ")
    words = words.removeprefix("accuracy ").removeprefix("step ")
    if words.endswith(" iterations"):
        return f"n = {words.removesuffix(' iterations')}"
    number, _, unit = words.partition(" ")
    if "." in number or "e" in number:
        try:
            return f"{power_of_ten(float(number))} {unit}".rstrip()
        except ValueError:
            return words
    return words


def meaning(points: Sequence[Point]) -> str:
    """What the labels are."""
    settings = {p.setting for p in points}
    if any(s.startswith("accuracy") for s in settings):
        return "Labels: accuracy asked for, or step."
    words = ["Labels: precision (c64: complex64)"]
    words += ["samples of a batch"] * any(s.endswith("samples") for s in settings)
    words += ["n iterations"] * any(s.endswith("iterations") for s in settings)
    words += ["change of the last one"] * any(s.endswith(" N") for s in settings)
    return f"{', '.join(words)}."


def _legend_rows(series: dict[str, list[Point]], inside: float) -> list[list[int]]:
    """Numbers of the series, in rows that fit the width."""
    rows: list[list[int]] = [[]]
    used = 0.0
    for i, name in enumerate(series):
        wide = 22 + text_width(name, ink.SMALL)
        if rows[-1] and used + wide > inside + RIGHT:
            rows.append([])
            used = 0.0
        rows[-1].append(i)
        used += wide
    return rows


def _legend(
    figure: Any, rows: list[list[int]], series: dict[str, list[Point]], height: float
) -> None:
    from matplotlib.lines import Line2D

    names = list(series)
    y = height - TOP - LINE / 2
    for row in rows:
        x = LEFT
        for i in row:
            colour, dashes = ink.curve_style(i)
            line = Line2D(
                [x / ink.COLUMN, (x + 8) / ink.COLUMN, (x + 16) / ink.COLUMN], [y / height] * 3,
                color=colour, lw=0.9, marker=MARKS[i % len(MARKS)], ms=RING, mfc=ink.PAPER,
                mew=0.8, markevery=[1],
            )  # fmt: skip
            if dashes:
                line.set_dashes(dashes)
            figure.add_artist(line)
            figure.text(
                (x + 19) / ink.COLUMN,
                y / height,
                names[i],
                fontsize=ink.SMALL,
                va="center_baseline",
            )
            x += 22 + text_width(names[i], ink.SMALL)
        y -= LINE
