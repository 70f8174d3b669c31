"""Work and precision: the error over what it costs, the habit of the field's papers.

Log-log, one series a method, the Pareto front as a broad line behind, the floor of the
reference hatched. Above the cost in seconds, below in kernel evaluations.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blockmech.analysis.trade import Point, Trade
from blockmech.analysis.trade import front as front_of
from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, legend_above, shown_name

PANEL = 22.5 * ink.TEXT  # [pt] height of a panel with what is below it
MARKS = "osD^vPX*<>hp"
MARK = 0.425 * ink.TEXT  # [pt] size of a point
LABEL = 0.75 * ink.TEXT  # [pt] size of the settings' labels
SPOTS = ((5, 5), (5, -5), (-5, 5), (-5, -5), (0, 8), (0, -8))  # [pt] of a label, tried in turn
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
COSTS = {"seconds": "time of one run [s]", "evaluations": "kernel evaluations [–]"}


def trade_figure(trade: Trade, degrees: bool) -> Any:
    """The work-precision diagram, a column wide."""
    series = trade.series()
    with captioned(_caption(trade), len(COSTS) * PANEL + ink.ROW * len(series) / 2) as figure:
        panels = figure.subplots(len(COSTS))
        for axes, (cost, words) in zip(panels, COSTS.items(), strict=True):
            axes.set_xlabel(words, labelpad=1)
            axes.set_ylabel("error [–]", labelpad=2)
            if series:
                _panel(axes, trade, cost)
            else:
                axes.set(xticks=[], yticks=[])
        legend_above(panels[0], ink.COLUMN)
        figure.draw_without_rendering()  # labels need to know how large the panels are
        for axes, cost in zip(panels, COSTS, strict=True):
            _label(axes, trade, cost)
    return figure


def _caption(trade: Trade) -> str:
    r = trade.reference
    head = f"{shown_name(trade.mechanism, 40)}, {trade.question}."
    if not trade.points:
        return f"{head} Nothing was measured: {trade.recommendation}."
    unseen = " On the hatching: no difference seen." * any(p.at_floor for p in trade.points)
    return (
        f"{head} Error: {trade.measure}, against "
        f"{r.method}, checked by {r.check}, which leaves {r.floor:.0e} open (hatched).{unseen} "
        "Time: least processor time, bars to the largest of the warm runs, or of one. "
        f"Evaluations: {trade.counted}. Broad grey line: Pareto front. Labels: the setting "
        "(c64: complex64; n: iterations; a number: accuracy asked for, or step)."
    )


def _spent(point: Point, cost: str) -> float:
    """What a point costs; one where it costs nothing, as the axis has no zero.

    A run along the path asks no kernel where all that it needs is kept.
    """
    return float(getattr(point, cost)) or 1.0


def _panel(axes: Any, trade: Trade, cost: str) -> None:
    floor = trade.reference.floor
    axes.set_xscale("log")
    axes.set_yscale("log")
    front = front_of(trade.points, cost)
    axes.step(
        [_spent(p, cost) for p in front], [p.error for p in front],
        where="post", color=ink.PALE, lw=5, zorder=1, solid_capstyle="round",
    )  # fmt: skip
    axes.axhspan(1e-300, floor, facecolor="none", edgecolor=ink.GREY, hatch="////", lw=0, zorder=0)
    axes.axhline(floor, color=ink.GREY, lw=0.7, zorder=1.5)
    for i, (name, row) in enumerate(trade.series().items()):
        style = ink.curve_style(i)
        row = [p for p in row if math.isfinite(p.error)]
        x, y = [_spent(p, cost) for p in row], [p.error for p in row]
        bars = [[0.0 for _ in row], [p.slowest - p.seconds for p in row]]
        axes.errorbar(
            x, y, xerr=bars if cost == "seconds" and np.any(bars) else None, elinewidth=0.5, lw=0.9,
            marker=MARKS[i % len(MARKS)], ms=MARK, mfc=ink.PAPER, mew=0.8, label=name, **style,
        )  # fmt: skip
    errors = [p.error for p in trade.points if math.isfinite(p.error)]
    axes.set_ylim(floor / 5, max([*errors, floor]) * 5)
    axes.margins(x=0.12)
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        log_ticks(axis, low, high)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)


def log_ticks(axis: Any, low: float, high: float) -> None:
    """Few marks on a logarithmic axis between two ends, as powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    decades = math.log10(high / low)
    few = LogLocator(subs=(1.0, 3.0) if decades < 2 else (1.0,), numticks=7)
    axis.set_major_locator(few if decades > 1 else MaxNLocator(4))
    axis.set_major_formatter(FuncFormatter(lambda x, _: power_of_ten(x)))
    axis.set_minor_locator(NullLocator())


def power_of_ten(x: float) -> str:
    """A number as a digit and a power of ten.

    >>> power_of_ten(2e-3)
    '2·10⁻³'
    """
    digit, exponent = f"{x:.1e}".split("e")
    digit = digit.removesuffix(".0")
    raised = "10" + str(int(exponent)).translate(SUPERSCRIPT)
    return raised if digit == "1" else f"{digit}·{raised}"


def _label(axes: Any, trade: Trade, cost: str) -> None:
    """Write settings beside their points, the front's first, where there is room."""
    from matplotlib.transforms import Bbox

    front = front_of(trade.points, cost)
    points = [p for p in trade.points if math.isfinite(p.error)]
    places = axes.transData.transform([(_spent(p, cost), p.error) for p in points] or [(1, 1)])
    half = MARK / 2 * axes.figure.dpi / 72
    taken = [Bbox([z - half, z + half]) for z in places]
    room, renderer = axes.get_window_extent(), axes.figure.canvas.get_renderer()
    for p in sorted(points, key=lambda p: p not in front):
        for dx, dy in SPOTS if short(p) else ():
            text = axes.annotate(
                short(p), (_spent(p, cost), p.error), (dx, dy), textcoords="offset points",
                fontsize=LABEL, color=ink.INK, in_layout=False, zorder=4,
                ha={-1: "right", 0: "center", 1: "left"}[(dx > 0) - (dx < 0)],
                va="bottom" if dy > 0 else "top",
                bbox={"facecolor": ink.PAPER, "alpha": 0.8, "lw": 0, "pad": 0.2},
            )  # fmt: skip
            box = text.get_window_extent(renderer)
            inside = room.x0 < box.x0 and box.x1 < room.x1 and room.y0 < box.y0 < box.y1 < room.y1
            if inside and not box.count_overlaps(taken):
                taken.append(box)
                break
            text.remove()


def short(p: Point) -> str:
    """A setting in as few letters as tell it from its neighbours."""
    words = p.setting.replace("clongdouble", "long double").replace("complex", "c")
    words = words.removeprefix("accuracy ").removeprefix("step ")
    if words.endswith(" iterations"):
        return f"n = {words.removesuffix(' iterations')}"
    number, _, unit = words.partition(" ")
    try:
        return f"{power_of_ten(float(number))} {unit}".rstrip()
    except ValueError:
        return words
