"""Panels of curves as a picture: one quantity with its unit a panel, a column wide.

Legends stand above the axes, so they cover no curve; a gap is a gap, and is shaded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.draw import palette as ink
from blockmech.draw.paper import legend_above, new_figure, scaled_unit, shown_name, styled

Array = NDArray[np.float64]

PANEL = 128.0  # [pt] height of a panel's axes, and what is between two
BOTTOM = 30.0  # [pt] for the words below the last one
FEW = 25  # samples up to which they are marked
TALL = 4  # panels up to which they stand below one another
USUAL, PEAK = 0.95, 20.0  # peaks are what exceeds 20 times what 95 % of the samples stay below
DEGREES = (15, 30, 60, 90, 180, 360, 720, 1800, 3600)  # steps of ticks
WITHOUT = "without friction"
TWIN = (4.0, 1.8)  # dashes of the curve without friction


@dataclass(frozen=True)
class Curve:
    """One line of a panel; ``without`` is the same without friction, if that differs."""

    name: str
    values: Array
    without: Array | None = None


@dataclass(frozen=True)
class Panel:
    """One quantity: its words, its SI unit, its curves."""

    quantity: str
    unit: str
    curves: tuple[Curve, ...]

    @property
    def rows(self) -> list[Array]:
        """All values, those without friction included."""
        both = [(c.values, c.without) for c in self.curves]
        return [row for pair in both for row in pair if row is not None]

    @property
    def shown(self) -> tuple[float, float]:
        """The range that is shown: all of it, but peaks near a dead centre are cut off."""
        y = np.concatenate([row[np.isfinite(row)] for row in self.rows])
        if not len(y):
            return 0.0, 0.0
        usual = float(np.quantile(np.abs(y), USUAL))
        if usual > 0 and np.abs(y).max() > PEAK * usual:
            y = y[np.abs(y) <= 2 * usual]
        return float(y.min()), float(y.max())

    @property
    def peak(self) -> float:
        """Largest value that is cut off; 0 if none is."""
        largest = max((float(np.nanmax(np.abs(r), initial=0.0)) for r in self.rows), default=0.0)
        return largest if largest > max(map(abs, self.shown)) else 0.0

    @property
    def labels(self) -> list[str]:
        """Names in the legend; one curve that has a frictionless twin is "with friction"."""
        if len(self.curves) == 1 and self.curves[0].without is not None:
            return ["with friction"]
        return [shown_name(c.name) for c in self.curves]


@dataclass(frozen=True)
class Abscissa:
    """What curves are drawn over: words with a unit, values (n,), and events to mark."""

    words: str
    values: Array
    angle: bool = False  # in degrees
    events: tuple[tuple[float, str], ...] = ()


@dataclass
class Plot:
    """A drawn picture: the figure, and its axes from top to bottom."""

    figure: Any
    axes: list[Any]


def draw_panels(panels: Sequence[Panel], along: Abscissa) -> Plot:
    """Draw panels below one another, a column wide, legends above their axes.

    Many panels stand in two columns.
    """
    columns = 1 if len(panels) <= TALL else 2
    rows = math.ceil(len(panels) / columns)
    with styled():
        width = columns * ink.COLUMN
        figure = new_figure(width, BOTTOM + rows * PANEL, layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False)
        plot = Plot(figure, list(grid.T.flat)[: len(panels)])
        lines = [0] * rows
        for k, (panel, axes) in enumerate(zip(panels, plot.axes, strict=True)):
            _draw_panel(axes, panel, along)
            lines[k % rows] = max(lines[k % rows], legend_above(axes, ink.COLUMN))
            last = k % rows == rows - 1 or k == len(panels) - 1
            axes.tick_params(labelbottom=last)
            if last:
                axes.set_xlabel(along.words, labelpad=2)
        figure.set_figheight(figure.get_figheight() + sum(lines) * ink.ROW / 72)
        for axes in grid.T.flat[len(panels) :]:
            axes.remove()
        figure.align_ylabels(plot.axes)
    return plot


def _draw_panel(axes: Any, panel: Panel, along: Abscissa) -> None:
    """Draw the curves of a panel, with labels for the legend."""
    order = np.arange(len(along.values))
    step = np.diff(along.values)
    if np.any(step > 0) and np.any(step < 0):
        order = np.argsort(along.values, kind="stable")
    x = along.values[order]
    factor, unit = scaled_unit(panel.unit, max(map(abs, panel.shown)))
    alone = len(panel.curves) == 1
    for i, (curve, label) in enumerate(zip(panel.curves, panel.labels, strict=True)):
        style = {**ink.curve_style(i), "lw": 1.2, "zorder": 2.5, "label": label}
        _line(axes, x, curve.values[order] * factor, "o", style)
    for i, curve in enumerate(panel.curves):
        if curve.without is not None:
            # One pair of curves differs in colour and dashes; of many, the thin ones.
            colour = ink.SERIES[1] if alone else ink.curve_style(i)["color"]
            style = {"color": colour, "lw": 1.1 if alone else 0.5, "label": WITHOUT}
            style |= {"zorder": 3 if alone else 2, "dashes": TWIN if alone else ()}
            _line(axes, x, curve.without[order] * factor, "s", style)
    _shade_gaps(axes, x, np.vstack([row[order] for row in panel.rows]))
    for at, words in along.events:
        axes.axvline(at, color=ink.GREY, lw=0.6, dashes=(1.5, 2), zorder=1, label=words)
    axes.set_ylabel(f"{panel.quantity} [{unit or '–'}]", labelpad=3)
    axes.margins(x=0.01 if len(x) > 1 else 0.5)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)
    _ticks(axes, along, x)
    if panel.peak:
        factor, unit = scaled_unit(panel.unit, panel.peak)
        axes.plot([], [], " ", label=f"cut-off peaks up to {panel.peak * factor:.3g} {unit}")
        factor, _ = scaled_unit(panel.unit, max(map(abs, panel.shown)))
        low, high = (factor * y for y in panel.shown)
        air = 0.05 * (high - low or 1.0)
        axes.set_ylim(low - air, high + air)


def _line(axes: Any, x: Array, y: Array, mark: str, style: dict[str, Any]) -> None:
    """A curve; few samples are marked, and so is one that stands alone between gaps."""
    good = np.isfinite(y)
    left, right = np.append(False, good[:-1]), np.append(good[1:], False)
    alone = np.flatnonzero(good & ~left & ~right)
    if len(y) <= FEW:
        style = {"marker": mark, "ms": 2.6, "markevery": None, **style}
    elif len(alone):
        style = {"marker": mark, "ms": 2.0, "markevery": alone.tolist(), **style}
    axes.plot(x, y, **style)


def _shade_gaps(axes: Any, x: Array, y: NDArray[Any]) -> None:
    """Shade where a curve has no answer."""
    bad = ~np.isfinite(y).all(axis=0)
    starts = np.flatnonzero(bad & ~np.append(False, bad[:-1]))
    ends = np.flatnonzero(bad & ~np.append(bad[1:], False))
    for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
        left, right = x[max(a - 1, 0)], x[min(b + 1, len(x) - 1)]
        style = {"facecolor": ink.FRAME_FILL, "edgecolor": ink.PALE, "hatch": "////", "lw": 0}
        axes.axvspan(left, right, zorder=0.5, label="no answer", **style)


def _ticks(axes: Any, along: Abscissa, x: Array) -> None:
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    span = float(np.ptp(x)) if len(x) else 0.0
    round_numbers = [1, 2, 2.5, 5, 10]
    whole = [step for step in DEGREES if span <= 7 * step and along.angle and span >= 90]
    wide = MultipleLocator(whole[0]) if whole else MaxNLocator(7, steps=round_numbers)
    axes.xaxis.set_major_locator(wide)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=round_numbers))
