"""Pictures of a study: curves over one number, maps over two, a matrix of scatter over more.

Designs without an answer are shown where they are: marked at the foot of a curve or a
scatter, hatched in a map.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.paper import (
    new_figure,
    scaled_unit,
    shown_name,
    styled,
    text_width,
    wrapped,
)
from blockmech.draw.pictured import Pictured
from blockmech.errors import Problem, RequestError
from blockmech.export import Column
from blockmech.runnable import giving
from blockmech.studies.study import study as studied
from blockmech.studies.table import Study

PANEL = 14.0 * ink.TEXT  # [pt] height of a panel
CELL = 11.0 * ink.TEXT  # [pt] size of a cell of a matrix
PANELS, CELLS = 6, 7  # results and numbers that one picture can hold
DOT = 3.0  # [pt2] of a design in a scatter
ENDS = (2, 98)  # percent of the designs that the colours of a map are spread over
FOOT = 0.03  # of a panel's height: where designs without an answer are marked


class PlottedStudy(Pictured, Study):
    """A study with its picture."""

    def figure(self) -> Any:
        """The study: curves, maps, or a matrix of scatter.

        Raises `RequestError` where there is nothing to draw.
        """
        return study_figure(self)


study = giving(PlottedStudy, studied)


def study_figure(study: Study) -> Any:
    """The picture of a study. Raises `RequestError` where no number was kept."""
    results = study.table()[len(study.vary) :][:PANELS]
    if not results:
        found = "poses are arrays, and no other number was kept"
        raise RequestError(Problem("bad-request", "plot", found, "", "keep e.g. a max_abs as well"))
    with styled():
        if study.sampling == "grid" and len(study.vary) == 1:
            return _curves(study, results)
        if study.sampling == "grid" and len(study.vary) == 2 and min(study.shape) > 1:
            return _maps(study, results)
        return _matrix(study, results)


def _figure(study: Study, rows: int, width: float, height: float) -> tuple[Any, Any]:
    """An empty picture with its caption below, and what its panels are made in."""
    missing = study.n - study.status.count("ok")
    said = f"{shown_name(study.name, 40)}: {study.n} designs"
    said += f", {missing} without an answer" if missing else ""
    lines = wrapped(f"{said}.", ink.SMALL, width - 10)
    figure = new_figure(width, height + ink.ROW * (len(lines) + 0.5), layout="constrained")
    figure.supxlabel("\n".join(lines), x=0.02, ha="left", fontsize=ink.SMALL)
    return figure, rows


def _scaled(column: Column) -> tuple[Any, str]:
    """Values and unit as they read well."""
    sizes = np.abs(column.values[np.isfinite(column.values)])
    factor, unit = scaled_unit(column.unit, float(sizes.max(initial=0.0)))
    return column.values * factor, unit


def _label(name: str, unit: str, room: float) -> str:
    """A name and its unit, on two lines where one has not the room [pt]."""
    whole = f"{name} [{unit or '–'}]"
    if text_width(whole, ink.TEXT) <= room:
        return whole
    breaks = [k for k, sign in enumerate(whole) if sign in "(. " and k]
    at = min(breaks, key=lambda k: abs(k - len(whole) / 2))
    return f"{whole[:at]}\n{whole[at:].lstrip()}"


def _curves(study: Study, results: Sequence[Column]) -> Any:
    figure, rows = _figure(study, len(results), ink.COLUMN, len(results) * PANEL)
    x = study.table()[0]
    bad = np.array([word != "ok" for word in study.status])
    panels = np.atleast_1d(figure.subplots(rows, sharex=True))
    for axes, column in zip(panels, results, strict=True):
        y, unit = _scaled(column)
        axes.plot(x.values, y, color=ink.FORWARD, marker="." if study.n <= 1 else "")
        _marked(axes, x.values[bad])
        axes.set_ylabel(_label(column.name, unit, PANEL * 0.8), labelpad=2)
        axes.grid(True)
    panels[-1].set_xlabel(_label(x.name, x.unit, ink.COLUMN), labelpad=1)
    return figure


def _marked(axes: Any, x: Any) -> None:
    """Designs without an answer, at the foot of a panel."""
    if len(x):
        foot = np.full(len(x), FOOT)
        place = axes.get_xaxis_transform()
        axes.scatter(x, foot, marker="x", s=8, lw=0.6, color=ink.ALARM, transform=place, zorder=3)


def _maps(study: Study, results: Sequence[Column]) -> Any:
    columns = 1 if len(results) == 1 else 2
    rows = -(-len(results) // columns)
    width = columns * ink.COLUMN
    figure, _ = _figure(study, rows, width, rows * 1.25 * PANEL)
    first, second = study.table()[:2]
    x, y = (study.grid(c.name) for c in (first, second))
    panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axes in panels[len(results) :]:
        axes.remove()
    for axes, column in zip(panels, results, strict=False):
        low, high = np.nanpercentile(column.values, ENDS) if missing(column) < study.n else (0, 1)
        factor, unit = scaled_unit(column.unit, max(abs(low), abs(high)))
        z = np.full(int(np.prod(study.shape)), np.nan)
        z[: study.n] = factor * column.values
        axes.patch.set(facecolor=ink.PAPER, hatch="////", edgecolor=ink.PALE)
        drawn = axes.pcolormesh(
            x, y, z.reshape(study.shape), cmap="cividis", shading="nearest", rasterized=True,
            vmin=factor * low, vmax=factor * high,
        )  # fmt: skip
        bar = figure.colorbar(drawn, ax=axes, pad=0.02, extend="both")
        bar.set_label(_label(column.name, unit, PANEL), labelpad=2)
        axes.set_xlabel(_label(first.name, first.unit, ink.COLUMN * 0.7), labelpad=1)
        axes.set_ylabel(_label(second.name, second.unit, PANEL), labelpad=2)
    return figure


def missing(column: Column) -> int:
    """Designs without the number."""
    return int(np.count_nonzero(~np.isfinite(column.values)))


def _matrix(study: Study, results: Sequence[Column]) -> Any:
    """Every result over every number that varies, and the share of each value above."""
    numbers = study.table()[: len(study.vary)][:CELLS]
    width = max(ink.COLUMN, len(numbers) * CELL + 5 * ink.TEXT)
    figure, _ = _figure(study, len(results), width, len(results) * CELL + 3 * ink.TEXT)
    bad = np.array([word != "ok" for word in study.status])
    panels = figure.subplots(len(results), len(numbers), sharex="col", sharey="row", squeeze=False)
    for row, column in zip(panels, results, strict=True):
        y, unit = _scaled(column)
        for axes, number in zip(row, numbers, strict=True):
            axes.scatter(number.values, y, s=DOT, lw=0, color=ink.FORWARD, rasterized=True)
            _marked(axes, number.values[bad])
            axes.grid(True)
            axes.locator_params(nbins=4)
        row[0].set_ylabel(_label(column.name, unit, CELL * 0.9), labelpad=2)
    for axes, number in zip(panels[-1], numbers, strict=True):
        axes.set_xlabel(_label(number.name, number.unit, CELL * 0.9), labelpad=1)
    return figure
