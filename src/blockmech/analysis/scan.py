"""A function of one coordinate looked through for its extrema, and a search to rounding.

The function becomes a series (`blockmech.functions.series`); its extrema are roots of the series'
derivative, good to rounding over the curvature. Where there is no series (a corner, a jump,
the edge of what exists) panels are halved until they are tiny, and their own samples stand
for the extrema there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blockmech.functions.roots import SCANNED
from blockmech.functions.series import GOLDEN, Series, fit, nodes, panels
from blockmech.functions.series import NODES as OF_PANEL
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.typing import Floats

TURN = 2 * math.pi
# Turns are cut just before -90 degrees: arcs of symmetric mechanisms lie about 0 or pi, and what
# is at the cut is told by one of its two names whatever its rounding.
SEAM = -math.pi / 2 - DOUBLE_ROOT
ROUNDED = 16 * EPS  # of a share of one, which comes of some ten operations
NODES = 2 * OF_PANEL  # of a panel; of 128 the derivatives lose the touches of thirty loops in a row
TINY = 4096 * EPS  # [rad or m] shown as zero: rounding of places
ASIDE = GOLDEN * NODES / SCANNED * TURN  # [rad] extrema at round angles are inside panels


@dataclass(frozen=True)
class Span:
    """A range of a coordinate, walked by a share u from 0 to 1.

    What goes like the root of the distance from an end is smooth in u, as the places crowd
    there like squares. A ``turn`` closes on itself and has no ends.

    ``size`` is for a slide that goes on without end: its places crowd within that size.
    """

    low: float
    high: float
    turn: bool = False
    size: float = math.inf

    def place(self, u: Floats) -> Floats:
        """Coordinates of shares."""
        low, high = self._stretched(self.low), self._stretched(self.high)
        if self.turn:
            return np.asarray(low + (high - low) * u)
        from_low = (high - low) * np.sin(u * (math.pi / 2)) ** 2
        from_high = (high - low) * np.cos(u * (math.pi / 2)) ** 2
        w = np.where(u < 0.5, low + from_low, high - from_high)
        return np.asarray(w if math.isinf(self.size) else self.size * np.sinh(w))

    def share(self, q: Floats) -> Floats:
        """Shares of coordinates, the inverse of `place`."""
        low, high = self._stretched(self.low), self._stretched(self.high)
        if self.turn:
            return np.asarray((q - low) % TURN / (high - low))
        w = q if math.isinf(self.size) else np.arcsinh(q / self.size)
        return np.arctan2(np.sqrt(w - low), np.sqrt(high - w)) / (math.pi / 2)

    def slope(self, u: Floats) -> Floats:
        """Derivative of `place`."""
        low, high = self._stretched(self.low), self._stretched(self.high)
        if self.turn:
            return np.full(np.shape(u), high - low)
        crowding = (high - low) * (math.pi / 2) * np.sin(u * math.pi)
        if math.isinf(self.size):
            return np.asarray(crowding)
        return np.asarray(np.hypot(self.size, self.place(u)) * crowding)

    def _stretched(self, q: float) -> float:
        return q if math.isinf(self.size) else math.asinh(q / self.size)

    def panels(self, samples: int) -> Floats:
        """Edges of panels for so many samples a turn."""
        length = self._stretched(self.high) - self._stretched(self.low)
        return panels(0.0, 1.0, max(1, math.ceil(samples / NODES * length / TURN)))


def scan(
    function: Callable[[Floats], Floats],
    span: Span,
    edges: Floats,
    value: Callable[[Floats], Floats] | None = None,
) -> tuple[Floats, Floats]:
    """Look through a function on a span.

    Parameters
    ----------
    function : (k,) -> (k,), values at places; NaN where there is none
    edges : of the panels to begin with, see `Span.panels`
    value : values with extrema at the same places, to be returned in place of the function's

    Returns
    -------
    (m,) places, rising, between which the function only rises or only falls; (m,) values there
    """
    series = fit(lambda u: function(span.place(u)), edges, n=NODES)
    x = places(series, span, series.extrema())
    return x, np.asarray((value or function)(x), dtype=float)


def places(series: Series, span: Span, extra: Floats) -> Floats:
    """Where to look, rising: ends of panels, and where there is no series all samples.

    ``extra`` are shares of the span.
    """
    inner = (series.edges[:-1, None] + series.edges[1:, None]) / 2
    inner = inner + np.diff(series.edges)[:, None] / 2 * nodes(NODES)
    mask = np.zeros(inner.shape, dtype=bool)
    mask[:, [0, -1]] = True
    mask[~series.resolved] = True
    return np.unique(span.place(np.concatenate([series.edges[[0, -1]], inner[mask], extra])))


def shown_place(q: float) -> float:
    """A place [rad or m] as it is shown: rounding about zero is zero."""
    return q if abs(q) > TINY else 0.0


def runs(holds: Sequence[bool] | NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(holds).astype(int), [0]])))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))
