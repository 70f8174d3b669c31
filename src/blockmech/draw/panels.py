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
from blockmech.draw.paper import new_figure, scaled_unit, shown_name, styled, text_width

Array = NDArray[np.float64]
Lines = dict[str, tuple[Any, tuple[float, ...]]]

PANEL = 118.0  # [pt] height of a panel's axes
LEFT, RIGHT, TOP, BOTTOM, BETWEEN = 42.0, 10.0, 6.0, 29.0, 14.0  # [pt] around panels
FEW = 25  # samples up to which they are marked
TALL = 4  # panels up to which they stand below one another
USUAL, PEAK = 0.95, 20.0  # peaks are what exceeds 20 times what 95 % of the samples stay below
WITHOUT = "without friction"
TWIN = (4.0, 1.8)  # dashes of the curve without friction
PEAKS = "cut-off peaks up to"


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


@dataclass(frozen=True)
class Abscissa:
    """What the curves are drawn over."""

    words: str
    values: Array
    angle: bool = False  # in degrees


@dataclass
class Plot:
    """A drawn picture: the figure, its axes from top to bottom, its panels."""

    figure: Any
    axes: list[Any]
    panels: tuple[Panel, ...]


# -- ink -------------------------------------------------------------------------------


def draw_panels(panels: Sequence[Panel], along: Abscissa) -> Plot:
    """Draw panels below one another, a column wide, legends above their axes.

    Many panels stand in two columns.
    """
    columns = [list(panels)]
    if len(panels) > TALL:
        half = math.ceil(len(panels) / 2)
        columns = [list(panels[:half]), list(panels[half:])]
    heads = [[_head(p) for p in column] for column in columns]
    high = [sum(h) + PANEL * len(h) + BETWEEN * (len(h) - 1) for h in heads]
    width, height = len(columns) * ink.COLUMN, TOP + max(high) + BOTTOM
    with styled():
        figure = new_figure(width, height)
        plot = Plot(figure, [], tuple(panels))
        for i, column in enumerate(columns):
            top, x = height - TOP, i * ink.COLUMN
            for panel, head in zip(column, heads[i], strict=True):
                top -= head
                box = (x + LEFT, top - PANEL, ink.COLUMN - LEFT - RIGHT, PANEL)
                axes = figure.add_axes(_fraction(box, width, height))
                plot.axes.append(axes)
                lines = _draw_panel(axes, panel, along)
                _draw_legend(figure, lines, _legend_rows(panel), (x, top + head - 2))
                last = panel is column[-1]
                axes.tick_params(labelbottom=last)
                if last:
                    axes.set_xlabel(along.words, labelpad=2)
                top -= PANEL + BETWEEN
            figure.align_ylabels(plot.axes[-len(column) :])
    return plot


def _head(panel: Panel) -> float:
    """Height [pt] of a panel's legend."""
    rows = len(_legend_rows(panel))
    return 9.5 * rows + (3 if rows else 0)


def _fraction(
    box: tuple[float, float, float, float], width: float, height: float
) -> tuple[float, float, float, float]:
    """A box [pt] in fractions of the figure."""
    return box[0] / width, box[1] / height, box[2] / width, box[3] / height


def _draw_panel(axes: Any, panel: Panel, along: Abscissa) -> Lines:
    """Draw the curves of a panel; label in the legend -> its line and dashes."""
    order = np.arange(len(along.values))
    if _unsorted(along.values):
        order = np.argsort(along.values, kind="stable")
    x = along.values[order]
    factor, unit = scaled_unit(panel.unit, max(map(abs, panel.shown)))
    lines: Lines = {}
    for i, (curve, label) in enumerate(zip(panel.curves, _labels(panel), strict=True)):
        colour, dashes = ink.curve_style(i)
        if curve.without is not None:
            y = curve.without[order] * factor
            # One pair of curves differs in colour and dashes; of many, the thin ones.
            alone = len(panel.curves) == 1
            style = {"color": ink.SERIES[1] if alone else colour, "lw": 1.1 if alone else 0.5}
            twin = TWIN if alone else ()
            (line,) = axes.plot(
                x, y, label=WITHOUT, zorder=3 if alone else 2, **style, **_marks(y, "s")
            )
            if twin:
                line.set_dashes(twin)
            lines[WITHOUT] = (line, twin)
        y = curve.values[order] * factor
        (line,) = axes.plot(x, y, color=colour, lw=1.2, label=label, zorder=2.5, **_marks(y, "o"))
        if dashes:
            line.set_dashes(dashes)
        lines[label] = (line, dashes)
    _shade_gaps(axes, x, np.vstack([row[order] for row in panel.rows]))
    quantity = f"{panel.quantity} [{unit}]" if unit else f"{panel.quantity} [–]"
    axes.set_ylabel(quantity, labelpad=3)
    axes.margins(x=0.01 if len(x) > 1 else 0.5)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)
    _ticks(axes, along, x)
    if panel.peak:
        low, high = (factor * y for y in panel.shown)
        air = 0.05 * (high - low or 1.0)
        axes.set_ylim(low - air, high + air)
    return lines


def _labels(panel: Panel) -> list[str]:
    """Legend texts; one curve that has a frictionless twin is "with friction"."""
    if len(panel.curves) == 1 and panel.curves[0].without is not None:
        return ["with friction"]
    return [shown_name(c.name) for c in panel.curves]


def _unsorted(x: Array) -> bool:
    step = np.diff(x)
    return bool(np.any(step > 0) and np.any(step < 0))


def _marks(y: Array, marker: str) -> dict[str, Any]:
    """Few samples are marked, and so is one that stands alone between gaps."""
    good = np.isfinite(y)
    if len(y) <= FEW:
        return {"marker": marker, "ms": 2.6, "markevery": None}
    left, right = np.append(False, good[:-1]), np.append(good[1:], False)
    alone = np.flatnonzero(good & ~left & ~right)
    return {"marker": marker, "ms": 2.0, "markevery": alone.tolist()} if len(alone) else {}


def _shade_gaps(axes: Any, x: Array, y: NDArray[Any]) -> None:
    """Shade where a curve has no answer."""
    bad = ~np.isfinite(y).all(axis=0)
    starts = np.flatnonzero(bad & ~np.append(False, bad[:-1]))
    ends = np.flatnonzero(bad & ~np.append(bad[1:], False))
    for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
        left, right = x[max(a - 1, 0)], x[min(b + 1, len(x) - 1)]
        style = {"facecolor": "#EFEFEF", "edgecolor": ink.PALE, "hatch": "////", "lw": 0}
        axes.axvspan(left, right, zorder=0.5, label="no answer", **style)


def _ticks(axes: Any, along: Abscissa, x: Array) -> None:
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    span = float(np.ptp(x)) if len(x) else 0.0
    if along.angle and span >= 90:
        steps = (15, 30, 60, 90, 180, 360, 720, 1800, 3600)
        step = next((s for s in steps if span / s <= 7), None)
        axes.xaxis.set_major_locator(MultipleLocator(step) if step else MaxNLocator(6))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))


# -- legend ----------------------------------------------------------------------------


def _legend_rows(panel: Panel) -> list[list[tuple[str, float]]]:
    """Rows of legend texts with their x [pt]; nothing for a single nameless curve."""
    labels = _labels(panel)
    twins = any(c.without is not None for c in panel.curves)
    if len(labels) == 1 and not twins:
        labels = [n for n in labels if n]
    if twins:
        labels.append(WITHOUT)
    if panel.peak:
        factor, unit = scaled_unit(panel.unit, panel.peak)
        labels.append(f"{PEAKS} {panel.peak * factor:.3g} {unit}")
    if not labels:
        return []
    rows: list[list[tuple[str, float]]] = [[]]
    x = LEFT
    for label in labels:
        wide = (0 if label.startswith(PEAKS) else 22) + text_width(label, ink.SMALL) + 9
        if rows[-1] and x + wide > ink.COLUMN - 2:
            rows.append([])
            x = LEFT
        rows[-1].append((label, x))
        x += wide
    return rows


def _draw_legend(
    figure: Any, lines: Lines, rows: Sequence[Any], corner: tuple[float, float]
) -> None:
    """Legend texts with samples of their lines, from the upper left corner [pt]."""
    from matplotlib.lines import Line2D

    width, height = (72 * inches for inches in figure.get_size_inches())
    style = {"fontsize": ink.SMALL, "va": "center_baseline", "label": "legend"}
    for k, row in enumerate(rows):
        y = (corner[1] - 9.5 * (k + 0.5)) / height
        for label, shift in row:
            x = corner[0] + shift
            if label.startswith(PEAKS):
                figure.text(x / width, y, label, color=ink.GREY, **style)
                continue
            line, dashes = lines[label]
            common = label == WITHOUT and len(lines) > 2
            sample = Line2D(
                [x / width, (x + 19) / width],
                [y, y],
                color=ink.GREY if common else line.get_color(),
                lw=line.get_linewidth(),
                transform=figure.transFigure,
                label="legend",
            )
            if dashes:
                sample.set_dashes(dashes)
            figure.add_artist(sample)
            figure.text((x + 22) / width, y, label, **style)
