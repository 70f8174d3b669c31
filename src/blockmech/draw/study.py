"""Pictures of a study: curves over one number, maps over two, a matrix of scatter over more.

Designs without an answer are shown where they are: marked at the foot of a curve or a
scatter, hatched in a map.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.paper import axis_label, captioned, scaled_unit, shown_name
from blockmech.ground.errors import refused
from blockmech.result.exported import Column
from blockmech.studies.table import Study

PANEL = 14.0 * ink.TEXT  # [pt] height of a panel
CELL = 11.0 * ink.TEXT  # [pt] size of a cell of a matrix
PANELS, CELLS = 6, 7  # results and numbers that one picture can hold
DOT = 3.0  # [pt2] of a design in a scatter
ENDS = (2, 98)  # percent of the designs that the colours of a map are spread over
FOOT = 0.03  # of a panel's height: where designs without an answer are marked


def study_figure(study: Study, degrees: bool) -> Any:
    """The study: curves, maps, or a matrix of scatter.

    Raises `RequestError` where no number was kept.
    """
    results = study.table()[len(study.vary) :][:PANELS]
    if not results:
        found = "poses are arrays, and no other number was kept"
        raise refused("plot", found, "keep e.g. a max_abs as well")
    numbers = study.table()[: len(study.vary)][:CELLS]
    grid = len(study.vary) if study.designs.sampling == "grid" else 0
    mapped = grid == 2 and min(study.designs.shape) > 1
    if mapped:
        columns = min(len(results), 2)
        size = -(-len(results) // columns) * 1.25 * PANEL, columns * ink.COLUMN
    elif grid == 1:
        size = len(results) * PANEL, ink.COLUMN
    else:
        wide = max(ink.COLUMN, len(numbers) * CELL + 5 * ink.TEXT)
        size = len(results) * CELL + 3 * ink.TEXT, wide
    missing, mark = study.n - study.status.count("ok"), "hatched" if mapped else "crosses"
    caption = f"{shown_name(study.name, 40)}: {study.n} designs"
    caption += f", {missing} without an answer ({mark})" if missing else ""
    with captioned(f"{caption}.", size[0] + ink.ROW / 2, size[1]) as figure:
        if mapped:
            _maps(figure, study, results, numbers)
        else:
            _matrix(figure, study, results, numbers, curves=grid == 1)
    return figure


def _maps(figure: Any, study: Study, results: Sequence[Column], numbers: Sequence[Column]) -> None:
    """Every result by colours over two numbers."""
    first, second = numbers
    x, y = (study.grid(c.name) for c in numbers)
    columns = min(len(results), 2)
    panels = figure.subplots(-(-len(results) // columns), columns, squeeze=False).ravel()
    for axes in panels[len(results) :]:
        axes.remove()
    for axes, column in zip(panels, results, strict=False):
        known = column.values[np.isfinite(column.values)]
        low, high = np.percentile(known, ENDS) if len(known) else (0, 1)
        factor, unit = scaled_unit(column.unit, max(abs(low), abs(high)))
        z = factor * study.filled(column.values, np.nan)
        axes.patch.set(facecolor=ink.PAPER, hatch="////", edgecolor=ink.PALE)
        drawn = axes.pcolormesh(
            x, y, z, cmap="cividis", shading="nearest", rasterized=True,
            vmin=factor * low, vmax=factor * high,
        )  # fmt: skip
        bar = figure.colorbar(drawn, ax=axes, pad=0.02, extend="both")
        bar.set_label(axis_label(column.name, unit, PANEL), labelpad=2)
        axes.set_xlabel(axis_label(first.name, first.unit, ink.COLUMN * 0.7), labelpad=1)
        axes.set_ylabel(axis_label(second.name, second.unit, PANEL), labelpad=2)


def _matrix(
    figure: Any, study: Study, results: Sequence[Column], numbers: Sequence[Column], curves: bool
) -> None:
    """Every result over every number that varies; ``curves`` over the only one of a grid."""
    bad = np.array([word != "ok" for word in study.status])
    panels = figure.subplots(len(results), len(numbers), sharex="col", sharey="row", squeeze=False)
    over, beside = (ink.COLUMN, PANEL * 0.8) if curves else (CELL * 0.9, CELL * 0.9)
    for row, column in zip(panels, results, strict=True):
        sizes = np.abs(column.values[np.isfinite(column.values)])
        factor, unit = scaled_unit(column.unit, float(sizes.max(initial=0.0)))
        y = factor * column.values
        for axes, number in zip(row, numbers, strict=True):
            if curves:
                axes.plot(number.values, y, color=ink.FORWARD, marker="." if study.n <= 1 else "")
            else:
                axes.scatter(number.values, y, s=DOT, lw=0, color=ink.FORWARD, rasterized=True)
                axes.locator_params(nbins=4)
            foot, place = np.full(bad.sum(), FOOT), axes.get_xaxis_transform()
            style = {"marker": "x", "s": 8, "lw": 0.6, "color": ink.ALARM, "zorder": 3}
            axes.scatter(number.values[bad], foot, transform=place, **style)
            axes.grid(True)
        row[0].set_ylabel(axis_label(column.name, unit, beside), labelpad=2)
    for axes, number in zip(panels[-1], numbers, strict=True):
        axes.set_xlabel(axis_label(number.name, number.unit, over), labelpad=1)
