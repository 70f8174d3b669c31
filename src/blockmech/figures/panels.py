"""Panels of curves as a picture: one quantity with its unit a panel, a column wide.

Legends stand above the axes, so they cover no curve; a gap is a gap, and is shaded. Stretches
of a coordinate are bars, each with what ends it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.figures import palette as ink
from blockmech.figures.paper import (
    grow,
    legend_above,
    panelled,
    picture_unit,
    scaled_unit,
    shown_name,
)
from blockmech.ground.errors import refused
from blockmech.ground.units import shown_in
from blockmech.typing import Arguments, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis

PANEL = 16 * ink.TEXT  # [pt] height of a panel with what is above it
BOTTOM = 3.75 * ink.TEXT  # [pt] words below the last
FEW = 25  # samples up to which they are marked
TALL = 4  # panels up to which they stand below one another
USUAL, PEAK = 0.95, 20.0  # peaks are what exceeds 20 times what 95 % of the samples stay below
TURNS = {"°": 360.0, "rad": math.tau}
STEPS = [1, 2, 2.5, 5, 10]  # of ticks at round numbers
DEGREES = (15, 30, 60, 90, 180, 360, 720, 1800, 3600)  # steps of ticks
WITHOUT = "without friction"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Panel:
    """One quantity: its words, its SI unit, its curves by name; some ``without`` friction too."""

    quantity: str
    unit: str
    curves: Mapping[str, Floats]
    without: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def rows(self) -> Floats:
        """All values (curves, n)."""
        return np.vstack([*self.curves.values(), *self.without.values()])

    @property
    def shown(self) -> tuple[float, float]:
        """The range that is shown: all of it, but peaks near a dead centre are cut off."""
        y = self.rows[np.isfinite(self.rows)]
        usual = float(np.quantile(np.abs(y), USUAL)) if len(y) else 0.0
        if usual > 0 and np.abs(y).max() > PEAK * usual:
            y = y[np.abs(y) <= 2 * usual]
        return (float(y.min()), float(y.max())) if len(y) else (0.0, 0.0)

    @property
    def peak(self) -> float:
        """Largest value that is cut off; 0 if none is."""
        largest = float(np.nanmax(np.abs(self.rows), initial=0.0))
        return largest if largest > max(map(abs, self.shown)) else 0.0


@dataclass(frozen=True)
class Abscissa:
    """What curves are drawn over: words with a unit, values (n,), and events to mark."""

    words: str
    values: Floats
    events: tuple[tuple[float, str], ...] = ()


def draw_panels(panels: Sequence[Panel], abscissa: Abscissa, ax: Axes | None = None) -> Any:
    """A figure of panels below one another, a column wide, legends above their axes.

    Many panels stand in two columns. With ``ax`` they stand in its place.
    """
    columns = 1 if len(panels) <= TALL else 2
    rows = math.ceil(len(panels) / columns)
    layout: Arguments = {"width": columns * ink.COLUMN, "sharex": False, "ax": ax}
    with panelled("", BOTTOM + rows * PANEL, rows, columns, **layout) as grid:
        every = grid.T.ravel()
        lines = np.zeros(columns * rows, int)
        for k, (panel, axes) in enumerate(zip(panels, every, strict=False)):
            _draw_panel(axes, panel, abscissa)
            lines[k] = legend_above(axes, ink.COLUMN)
            last = (k + 1) % rows == 0 or k == len(panels) - 1
            axes.tick_params(labelbottom=last)
            axes.xaxis.label.set_visible(last)
        grow(every[0], lines.reshape(columns, rows).max(axis=0).sum(), ax)
        for axes in every[len(panels) :]:
            axes.remove()
        every[0].figure.align_ylabels(every[: len(panels)])
    return every[0].figure


def _draw_panel(axes: Axes, panel: Panel, abscissa: Abscissa) -> None:
    """Draw the curves of a panel, with labels for the legend."""
    step = np.diff(abscissa.values)
    mixed = np.any(step > 0) and np.any(step < 0)
    order = np.argsort(abscissa.values, kind="stable") if mixed else slice(None)
    x, (low, high) = abscissa.values[order], panel.shown
    factor, unit = scaled_unit(panel.unit, max(abs(low), abs(high)))
    from matplotlib.ticker import MaxNLocator

    first = len(axes.get_legend_handles_labels()[1])  # curves of runs that are there
    if first:
        factor, unit = shown_in(panel.unit, [unit_in(axes.get_ylabel())])
    pair = len(panel.curves) == len(panel.without) == 1
    for i, (name, y) in enumerate(panel.curves.items(), first):
        look = {**ink.curve_style(i), "lw": max(0.8, 1.8 - 0.2 * i), "zorder": 2.5}
        look |= {"marker": "o"}
        label = f"{shown_name(name)} with friction".lstrip() if pair else shown_name(name)
        _line(axes, x, factor * y[order], label=label, **look)
    for i, name in enumerate(panel.curves, first):
        if name in panel.without:
            # One pair of curves differs in colour and dashes; of many, the thin ones.
            look = {"color": ink.curve_style(i)["color"], "lw": 0.5, "zorder": 2, "marker": "s"}
            if pair:
                look |= {"color": ink.SERIES[1], "dashes": (4.0, 1.8), "lw": 1.1, "zorder": 3}
            _line(axes, x, factor * panel.without[name][order], label=WITHOUT, **look)
    # Shade where a curve has no answer.
    bad = ~np.isfinite(panel.rows[:, order]).all(axis=0)
    edges = np.diff(np.pad(bad.astype(int), 1))
    for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        left_end, right_end = x[max(int(a) - 1, 0)], x[min(int(b), len(x) - 1)]
        style: Arguments = {"fc": ink.FRAME_FILL, "ec": ink.PALE, "hatch": "////", "lw": 0}
        axes.axvspan(left_end, right_end, zorder=0.5, label="no answer", **style)
    for at, event in abscissa.events:
        axes.axvline(at, color=ink.GREY, lw=0.6, dashes=(1.5, 2), zorder=1, label=event)
    axes.set_ylabel(f"{panel.quantity} [{unit or '–'}]", labelpad=3)
    axes.margins(x=0.01 if len(x) > 1 else 0.5)
    label_coordinate(axes, abscissa.words)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=STEPS))
    if panel.peak:
        scale, prefixed = scaled_unit(panel.unit, panel.peak)
        axes.plot([], [], " ", label=f"cut-off peaks up to {panel.peak * scale:.3g} {prefixed}")
        air = 0.05 * (high - low or 1.0)
        axes.set_ylim(factor * (low - air), factor * (high + air))


def _line(axes: Axes, x: Floats, y: Floats, **look: Any) -> None:
    """A curve; few samples are marked, and so is one that stands alone between gaps."""
    good = np.pad(np.isfinite(y), 1)
    alone = np.flatnonzero(good[1:-1] & ~good[:-2] & ~good[2:]).tolist()
    if len(y) > FEW:
        look |= {"markevery": alone} if alone else {"marker": ""}
    axes.plot(x, y, ms=2.4, **look)


def label_coordinate(axes: Axes, label: str) -> None:
    """Name an x axis; ticks are round numbers, or parts of a turn where enough of one is drawn.

    label : with the unit in brackets at the end
    """
    from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

    axes.set_xlabel(label, labelpad=1)
    turn = TURNS.get(unit_in(label), math.inf)
    degrees = 360 * np.ptp(axes.dataLim.intervalx) / turn
    parts = [step * turn / 360 for step in DEGREES if 90 <= degrees <= 7 * step]
    axes.xaxis.set_major_locator(
        MultipleLocator(parts[0]) if parts else MaxNLocator(7, steps=STEPS)
    )
    if parts and turn == math.tau:
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: of_pi(x)))


def unit_in(label: str) -> str:
    """The unit at the end of an axis' label."""
    return label.rpartition("[")[2].rstrip("]")


def of_pi(x: float) -> str:
    """An angle [rad] as a multiple of pi, e.g. 3π/4."""
    share = Fraction(x / math.pi).limit_denominator(36)
    over = f"/{share.denominator}" if share.denominator > 1 else ""
    size = abs(share.numerator)
    sign = "\N{MINUS SIGN}" if share < 0 else ""
    return f"{sign}{size if size != 1 else ''}π{over}" if size else "0"


def log_ticks(axis: XAxis | YAxis, low: float, high: float) -> None:
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


THICK = 0.62  # of a row: a bar
LABEL = 56  # characters of a bar's label: what a column holds


class Bar(NamedTuple):
    """A stretch of a driver's coordinate [rad or m]: what ends it, and places that are marked."""

    name: str
    start: float
    end: float
    ends: tuple[str, str]
    marks: tuple[float, ...] = ()
    chosen: tuple[float, ...] = ()
    colour: int = 0


def bars_figure(
    bars: Sequence[Bar], name: str, unit: str, caption: str, display: Iterable[str], ax: Axes | None
) -> Any:
    """Bars over a coordinate, a column wide. Raises `RequestError` where there is none."""
    if not bars:
        raise refused(shown_name(name), "there is no arc to draw", code="nothing-to-draw")
    scale, unit = picture_unit(unit, display)
    omitted = len(bars) - ink.MOST
    caption += f" {omitted} more are not drawn." if omitted > 0 else ""
    rows = 3 * len(bars[: ink.MOST]) + 4  # words, bar and air; axis
    with panelled(caption, rows * ink.ROW, ax=ax) as ((axes,),):
        axes.use_sticky_edges = False
        # What is shown: all finite ends; of bars that nothing ends a unit about zero.
        ends = [q for bar in bars for q in (bar.start, bar.end) if math.isfinite(q)] or [-1.0, 1.0]
        for y, bar in enumerate(bars[: ink.MOST]):
            _draw(axes, y, bar, (min(ends), max(ends)), scale)
        axes.set_ylim(len(bars[: ink.MOST]) - 1 + THICK, -1.0)
        axes.set_yticks([])
        label_coordinate(axes, f"{shown_name(name)} [{unit}]")
    return axes.figure


def _draw(axes: Axes, y: int, bar: Bar, span: tuple[float, float], scale: float) -> None:
    start, end = (min(max(q, span[0]), span[1]) * scale for q in (bar.start, bar.end))
    fill = ink.LINK_FILLS[bar.colour % len(ink.LINK_FILLS)]
    axes.barh(y, end - start, THICK / 2, start, color=fill, edgecolor=ink.INK, lw=0.6)
    axes.plot([q * scale for q in bar.marks], [y] * len(bar.marks), "|", color=ink.ALARM)
    axes.plot([q * scale for q in bar.chosen], [y] * len(bar.chosen), "o", ms=3, color=ink.INK)
    axes.annotate(
        shown_name(f"{bar.name}: {' to '.join(bar.ends)}", LABEL), (0, y - THICK / 4), (2, 1),
        xycoords=("axes fraction", "data"), textcoords="offset points", va="bottom",
        fontsize=ink.SMALL, in_layout=False,
    )  # fmt: skip
