"""The picture of equilibria: potential and effort over the coordinate, and where it rests."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.analysis.equilibrium import Equilibria
from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, scaled_unit, shown_name
from blockmech.ground.errors import refused

PANEL = 13.0 * ink.TEXT  # [pt] height of a panel
MARKS = {"stable": "o", "unstable": "^", "indifferent": "s"}
CLEAR = 0.02  # of the effort's quantiles: what goes to infinity at a dead centre is cut off


def equilibria_figure(equilibria: Equilibria, degrees: bool) -> Any:
    """Potential and effort of the loads over the only driver's coordinate.

    Raises `RequestError` of several drivers.
    """
    if not equilibria.curves:
        found = "there is no picture of the equilibria of several drivers"
        raise refused("plot", found, "their text lists them", code="nothing-to-draw")
    factor, unit = (
        (180.0 / np.pi, "°") if degrees and equilibria.unit == "rad" else (1.0, equilibria.unit)
    )
    drawn = ["potential"] * (equilibria.curves[0].potential is not None) + ["effort of the loads"]
    counts = {k: sum(e.kind == k for e in equilibria) for k in _MARKED}
    words = [f"{n} {k} ({_MARKED[k]})" for k, n in counts.items() if n] or ["none"]
    caption = f"Equilibria of {shown_name(equilibria.coordinate)}: {', '.join(words)}"
    caption += "; shaded: where friction holds it." if equilibria.rests else "."
    with captioned(caption, len(drawn) * PANEL + 2 * ink.ROW) as figure:
        panels = figure.subplots(len(drawn), sharex=True, squeeze=False)[:, 0]
        for axes, what in zip(panels, drawn, strict=True):
            _panel(axes, equilibria, what, factor)
        panels[-1].set_xlabel(f"{shown_name(equilibria.coordinate)} [{unit}]", labelpad=1)
    return figure


_MARKED = {"stable": "dot", "unstable": "triangle", "indifferent": "square"}


def _panel(axes: Any, equilibria: Equilibria, what: str, factor: float) -> None:
    """One curve an arc, with marks at the equilibria and bands where friction holds."""
    lowest = "potential" in what
    rows = [np.asarray(c.potential if lowest else c.effort) for c in equilibria.curves]
    known = np.concatenate([row[np.isfinite(row)] for row in rows])
    low, high = np.quantile(known, [CLEAR, 1 - CLEAR]) if len(known) else (-1.0, 1.0)
    unit = "J" if lowest else f"N{' m' if equilibria.unit == 'rad' else ''}"
    scale, unit = scaled_unit(unit, max(abs(low), abs(high)))
    for curve, row in zip(equilibria.curves, rows, strict=True):
        y = row - (np.nanmin(row) if lowest else 0.0)
        axes.plot(factor * curve.q, scale * y, color=ink.FORWARD)
        for e in equilibria:
            q = float(e.q[0])
            if curve.q[0] <= q <= curve.q[-1]:
                at = float(np.interp(q, curve.q, y))
                colour = ink.ALARM if e.kind == "unstable" else ink.INK
                axes.plot(factor * q, scale * at, MARKS[e.kind], ms=4, color=colour)
    for start, end in equilibria.rests:
        axes.axvspan(factor * start, factor * end, color=ink.LINK_FILLS[1], lw=0)
    if not lowest:
        axes.axhline(0.0, color=ink.INK, lw=0.5)
        room = 0.1 * (high - low) or 1.0
        axes.set_ylim(scale * (min(low, 0.0) - room), scale * (max(high, 0.0) + room))
    axes.set_ylabel(f"{what} [{unit}]", labelpad=2)
    axes.grid(True)
