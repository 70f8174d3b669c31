"""Pictures of tolerances: an output with its band, and what its deviation is made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.curves import abscissa, values
from blockmech.draw.panels import Abscissa
from blockmech.draw.paper import captioned, legend_above, scaled_unit, shown_name
from blockmech.studies.tolerance import Tolerance

PANEL = 11.0 * ink.TEXT  # [pt] height of a panel
OUTPUTS, NUMBERS = 3, 5  # that one picture can hold
BAND = 3.0  # standard deviations: 99.7 % of a normal distribution


def tolerance_figure(tolerance: Tolerance, degrees: bool) -> Any:
    """The first outputs with their bands and deviations, a column wide."""
    result = tolerance.sensitivity.result
    curves = [name for name in tolerance if not tolerance.sensitivity.one_number(name)]
    names = (curves or list(tolerance))[:OUTPUTS]
    across = Abscissa("one number a design", np.zeros(1))
    if curves:
        across = abscissa(result, degrees=degrees)
    total = sum(np.nan_to_num(tolerance.shares(name)).sum(axis=1) for name in names)
    order = np.argsort(-np.asarray(total), kind="stable")[:NUMBERS]  # a colour in all panels
    caption = (
        f"{shown_name(result.mechanism.name, 40)}: outputs with bands of {BAND:g} standard "
        "deviations, a vector by its length; below the deviation, filled by the shares of the "
        "numbers in the variance"
    ) + (", dots by Monte Carlo." if tolerance.sampled else ".")
    caption += tolerance.sensitivity.doubts_text(names)
    with captioned(caption, 2 * len(names) * PANEL + 2.5 * ink.ROW) as figure:
        panels = figure.subplots(2 * len(names), sharex=True, squeeze=False)[:, 0]
        for k, name in enumerate(names):
            _band(panels[2 * k], tolerance, name, across.values)
            _shares(panels[2 * k + 1], tolerance, name, across.values, order)
        legend_above(panels[1], ink.COLUMN)
        panels[-1].set_xlabel(across.words, labelpad=1)
    return figure


def _band(axes: Any, tolerance: Tolerance, name: str, x: Any) -> None:
    run, deviation = tolerance.sensitivity, tolerance[name]
    y = np.abs(run.value(name)) if name in run.reduced else values(run.result, name)
    factor, unit = scaled_unit(run.unit_of(name), float(np.nanmax(np.abs(y))))
    y, band = factor * y, factor * BAND * deviation
    if len(x) == 1:
        axes.errorbar(x, y, band, fmt=".", color=ink.FORWARD, capsize=3)
    axes.fill_between(x, y - band, y + band, color=ink.LINK_FILLS[0], lw=0)
    axes.plot(x, y, color=ink.FORWARD, lw=0.8)
    axes.set_ylabel(f"{shown_name(name)} [{unit or '–'}]", labelpad=2)
    axes.grid(True)


def _shares(axes: Any, tolerance: Tolerance, name: str, x: Any, order: Any) -> None:
    deviation, shares = tolerance[name], np.nan_to_num(tolerance.shares(name))
    factor, unit = scaled_unit(tolerance.sensitivity.unit_of(name), float(np.nanmax(deviation)))
    rows = [factor * deviation * shares[j] for j in order]
    addresses = list(tolerance.laws)
    labels = [addresses[j] for j in order]
    if len(x) == 1:
        axes.set_xticks(x)
        for k, label in enumerate(labels):
            axes.bar(x, rows[k], bottom=sum(rows[:k]), label=label, color=ink.LINK_FILLS[k])
    else:
        axes.stackplot(x, rows, labels=labels, colors=ink.LINK_FILLS, lw=0)
    axes.plot(x, factor * deviation, color=ink.INK, lw=0.8)
    if name in tolerance.sampled:
        axes.plot(x, factor * tolerance.sampled[name].deviation, ".", ms=3, color=ink.ALARM)
    axes.set_ylabel(f"deviation [{unit or '–'}]", labelpad=2)
    axes.set_ylim(bottom=0.0)
    axes.grid(True)
