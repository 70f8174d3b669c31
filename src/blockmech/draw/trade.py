"""Work and precision: the error over what it costs, the habit of the field's papers.

Log-log, one series a method, the Pareto front as a broad line behind, the floor of the
reference hatched. Above the cost in seconds, below in kernel evaluations.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.trade.report import Trade
from blockmech.draw import palette as ink
from blockmech.draw.labels import COVERED, Crowd, Label, Rect
from blockmech.draw.paper import (
    legend_above,
    new_figure,
    shown_name,
    styled,
    suffix_of,
    text_width,
    wrapped,
    write_figure,
)

if TYPE_CHECKING:
    from blockmech.analysis.trade.points import Point

PANEL = 180.0  # [pt] height of a panel with what is below it
INSIDE = ink.COLUMN - 45.0  # [pt] width of the axes
LABEL = 6.0  # [pt] size of the settings' labels
MARKS = "osD^vPX*<>hp"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
RING = 3.4  # [pt] size of a point
GAP = 4.0  # [pt] between labels of ticks
COSTS = {"seconds": "time of one run [s]", "evaluations": "kernel evaluations [–]"}


class PlottedTrade(Trade):
    """A trade with its picture."""

    def plot(self, path: str | os.PathLike[str]) -> Path:
        """Draw the work-precision diagram (png, svg or pdf)."""
        return draw_trade(self, path)


def draw_trade(trade: Trade, path: str | os.PathLike[str]) -> Path:
    """Write the picture of a trade; the suffix says the format (png, svg, pdf)."""
    return write_figure(trade_figure(trade), path, suffix_of(path))


def trade_figure(trade: Trade) -> Any:
    """The picture of a trade, a column wide."""
    text = _caption(trade)
    series = {name: _finite(points) for name, points in trade.series().items()}
    series = {name: points for name, points in series.items() if points}
    with styled():
        lines = wrapped(text, ink.SMALL, ink.COLUMN - 10)
        height = len(COSTS) * PANEL + ink.ROW * (len(lines) + len(series) / 2)
        figure = new_figure(ink.COLUMN, height, layout="constrained")
        panels = figure.subplots(len(COSTS))
        for axes, (cost, words) in zip(panels, COSTS.items(), strict=True):
            axes.set_xlabel(words, labelpad=1)
            axes.set_ylabel("error [–]", labelpad=2)
            _panel(axes, trade, series, cost)
        legend_above(panels[0], ink.COLUMN)
        figure.supxlabel("\n".join(lines), x=0.02, ha="left", fontsize=ink.SMALL)
        figure.draw_without_rendering()  # labels need to know how large the panels are
        for axes, cost in zip(panels, COSTS, strict=True):
            if series:
                _label(axes, trade, series, cost)
    return figure


def _caption(trade: Trade) -> str:
    r = trade.reference
    head = f"{shown_name(trade.mechanism, 40)}, {trade.question}."
    if not trade.points:
        return f"{head} Nothing was measured: {'; '.join(trade.notes)}."
    unseen = " On the hatching: no difference seen." if any(p.below for p in trade.points) else ""
    return (
        f"{head} Error: {trade.measure}, against "
        f"{r.method}, checked by {r.check}, which leaves {r.floor:.0e} open (hatched).{unseen} "
        "Time: median, bars from the fastest to the slowest of at least 5 warm runs. "
        f"Evaluations: {trade.counted}. Broad grey line: Pareto front. {meaning(trade.points)}"
    )


def _finite(points: Sequence[Point]) -> list[Point]:
    return [p for p in points if 0 < p.error < math.inf]


def _panel(axes: Any, trade: Trade, series: dict[str, list[Point]], cost: str) -> None:
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
    front = _front(trade, cost)
    axes.step(
        [getattr(p, cost) for p in front], [p.error for p in front],
        where="post", color=ink.PALE, lw=5, zorder=1, solid_capstyle="round",
    )  # fmt: skip
    axes.axhspan(1e-300, floor, facecolor="none", edgecolor=ink.GREY, hatch="////", lw=0, zorder=0)
    axes.axhline(floor, color=ink.GREY, lw=0.7, zorder=1.5)
    for i, (name, row) in enumerate(series.items()):
        style = ink.curve_style(i)
        x, y = [getattr(p, cost) for p in row], [p.error for p in row]
        if cost == "seconds":
            bars = np.array([[p.seconds - p.low for p in row], [p.high - p.seconds for p in row]])
            axes.errorbar(
                x,
                y,
                xerr=np.maximum(bars, 0),
                fmt="none",
                ecolor=style["color"],
                elinewidth=0.5,
                zorder=2,
            )
        axes.plot(
            x, y, **style, lw=0.9, marker=MARKS[i % len(MARKS)], ms=RING,
            mfc=ink.PAPER, mew=0.8, zorder=3, label=name,
        )  # fmt: skip
    _ticks(axes.xaxis, axes.get_xlim(), 7, INSIDE)
    _ticks(axes.yaxis, axes.get_ylim(), 8)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)


def _front(trade: Trade, cost: str) -> Sequence[Point]:
    return trade.pareto if cost == "seconds" else trade.pareto_by_evaluations


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
        if middle - half >= end and middle + half <= wide:
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


def _label(axes: Any, trade: Trade, series: dict[str, list[Point]], cost: str) -> None:
    """Write settings beside their points, front first, where there is room."""
    box, dots = axes.get_window_extent(), axes.figure.dpi / 72

    def at(x: float, error: float) -> complex:
        """A point of the panel [pt]."""
        right, up = axes.transData.transform((x, error)) - box.p0
        return complex(float(right), float(up)) / float(dots)

    crowd = Crowd(Rect(0, 0, box.width / dots, box.height / dots))
    (left, right), floor = axes.get_xlim(), trade.reference.floor
    crowd.add_line([at(left, floor), at(right, floor)])
    for row in series.values():
        crowd.add_line([at(getattr(p, cost), p.error) for p in row])
        for p in row:
            crowd.add_disc(at(getattr(p, cost), p.error), RING / 2, COVERED)
            if cost == "seconds":
                crowd.add_line([at(p.low, p.error), at(p.high, p.error)])
    first = set(map(id, _front(trade, cost)))
    said: list[tuple[str, complex]] = []
    points = [p for row in series.values() for p in row]
    for p in sorted(points, key=lambda p: id(p) not in first):
        z, text = at(getattr(p, cost), p.error), short(p)
        if not text or any(p.method == m and abs(z - u) < RING for m, u in said):
            continue
        for spot in crowd.place([Label(text, [[z]])], most=COVERED / 2):
            said.append((p.method, z))
            x, y = spot.centre().real * dots / box.width, spot.centre().imag * dots / box.height
            axes.text(
                x, y, text, fontsize=LABEL, color=ink.INK, transform=axes.transAxes,
                ha="center", va="center", zorder=4, in_layout=False,
                bbox={"facecolor": ink.PAPER, "alpha": 0.85, "lw": 0, "pad": 0.2},
            )  # fmt: skip


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
