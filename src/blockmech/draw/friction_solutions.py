"""Pictures of all solutions of the friction equations: over a coordinate, and over friction too."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.analysis.friction_solutions import UNDECIDED, FrictionSolutions
from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, legend_above, scaled_unit, shown_name
from blockmech.ground.errors import refused

HEIGHT = 17 * ink.TEXT  # [pt] of the axes
FILLS = (ink.GREY, ink.PAPER, ink.LINK_FILLS[0], ink.LINK_FILLS[1])
"""By number of solutions: none, one, two, three or more."""
WORDS = ("none: it jams", "one solution", "two", "three or more")


def friction_solutions_figure(solutions: FrictionSolutions, degrees: bool) -> Any:
    """The first real output over the driver; of several scales the number of solutions.

    Raises `RequestError` where not exactly one coordinate varies, or nothing is there to draw.
    """
    moving = {name: q for name, q in solutions.drivers.items() if np.ptp(q) > 0}
    if len(moving) != 1:
        found = f"{len(moving)} driver coordinates vary"
        raise refused("friction_solutions", found, "give several poses of one driver")
    ((name, q),) = moving.items()
    unit = solutions.answers.unit_of_driver(name)
    if degrees and unit == "rad":
        q, unit = np.degrees(q), "°"
    words = f"{shown_name(name)} [{unit}]"
    return (
        _map(solutions, q, words) if np.ptp(solutions.scale) > 0 else _curves(solutions, q, words)
    )


def _edges(x: Any) -> Any:
    """Borders of cells around places in rising order."""
    middle = (x[1:] + x[:-1]) / 2
    return np.concatenate([[2 * x[0] - middle[0]], middle, [2 * x[-1] - middle[-1]]])


def _curves(solutions: FrictionSolutions, q: Any, words: str) -> Any:
    """One output of each solution, and where there is none."""
    real = [name for name in solutions.answers if solutions.answers.output(name).kind == "real"]
    if not real:
        raise refused("friction_solutions", "no real output is there", "name one in want=")
    name, x = real[0], q[solutions.pose]
    factor, unit = scaled_unit(
        solutions.answers.unit(name), float(np.abs(solutions[name]).max(initial=0))
    )
    y = factor * solutions[name]
    low = np.any([np.zeros(len(x), bool), *(s < 0 for s in solutions.index.values())], axis=0)
    hollow = {"mfc": "none", "ms": 3.2}
    kinds = (
        (solutions.connected, "connected with zero friction", {"color": ink.SERIES[0], "ms": 2.2}),
        (~solutions.connected & ~low, "another one", {"color": ink.SERIES[2], **hollow}),
        (~solutions.connected & low, "another one, unstable", {"color": ink.SERIES[1], **hollow}),
    )
    caption = f"{shown_name(name)}: all solutions of Coulomb's equations."
    if UNDECIDED in solutions.proof:
        caption += (
            f" At {solutions.proof.count(UNDECIDED)} poses it is not proved that these are all."
        )
    with captioned(caption, HEIGHT + 2 * ink.ROW) as figure:
        axes = figure.subplots()
        for mask, label, style in kinds:
            if mask.any():
                axes.plot(x[mask], y[mask], "o", mew=0.7, label=label, **style)
        order = np.argsort(q, kind="stable")
        cells, none = _edges(q[order]), (solutions.counts == 0)[order]
        for i in np.flatnonzero(none):
            axes.axvspan(cells[i], cells[i + 1], color=ink.PALE, lw=0, label="none: it jams")
        axes.set_xlabel(words, labelpad=1)
        axes.set_ylabel(f"{shown_name(name)} [{unit or '–'}]")
        axes.grid(True)
        rows = legend_above(axes, ink.COLUMN)
        figure.set_figheight(figure.get_figheight() + rows * ink.ROW / 72)
    return figure


def _map(solutions: FrictionSolutions, q: Any, words: str) -> Any:
    """The number of solutions over a coordinate and the scale of friction."""
    from matplotlib.colors import ListedColormap

    places, scales = np.unique(q), np.unique(solutions.scale)
    if len(places) < 2 or len(places) * len(scales) != solutions.n:
        raise refused("friction_solutions", "its poses are no grid", "give each pose once")
    at = np.searchsorted(scales, solutions.scale), np.searchsorted(places, q)
    counts = np.zeros((len(scales), len(places)), int)
    counts[at] = np.minimum(solutions.counts, len(FILLS) - 1)
    caption = "Number of solutions of Coulomb's equations. At the red line (existence 1) reactions "
    caption += "grow without bound; where two solutions end without it they meet in a fold."
    with captioned(caption, HEIGHT + 2 * ink.ROW) as figure:
        axes = figure.subplots()
        colours = ListedColormap(FILLS)
        axes.pcolormesh(
            _edges(places), _edges(scales), counts, cmap=colours, vmin=0, vmax=3, rasterized=True
        )
        for c in solutions.existence.values():
            lines = np.full(counts.shape, np.nan)
            lines[at] = c
            with np.errstate(invalid="ignore"):
                crossed = np.nanmin(lines) < 1.0 < np.nanmax(lines)
            if crossed:
                axes.contour(places, scales, lines, [1.0], colors=ink.ALARM, linewidths=1.0)
        for i in np.unique(counts):
            axes.fill([], [], facecolor=FILLS[i], edgecolor=ink.INK, lw=0.6, label=WORDS[i])
        rows = legend_above(axes, ink.COLUMN)
        figure.set_figheight(figure.get_figheight() + rows * ink.ROW / 72)
        axes.set_xlabel(words, labelpad=1)
        axes.set_ylabel("scale of friction [–]")
    return figure
