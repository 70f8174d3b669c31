r"""Place data: what depends on the place alone, as Chebyshev series over a piece of the path.

Inertia, effort and margin, with joint friction the responses of the force pass. They are
sampled once; whatever runs there, how often and in which direction, needs no further kernel
call.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from blockmech.dynamics.panels import Floats, basis, node_places, roots, rule
from blockmech.plane import EPS
from blockmech.series import tail

RESOLVED = 16 * EPS  # of series: what some fifty terms leave of rounding
NOTHING = 64 * EPS  # of a margin or of the usual inertia: what rounding of a pose leaves of zero
SHORT = 8  # a piece is made anew if what happens in it needs no more than this part of it
# A series of n terms that touches zero is, by Bernstein's inequality, below (pi / 2 f)^2 / 2 of
# its largest value at one of f n nodes.
FINER = 16
# Rows of place data. With friction slips and what follows; else, where loads are straight lines in
# the rate, what the effort grows by with it.
J, TAU, MARGIN, SLIPS = range(4)
DAMPING = SLIPS


def place(low: Any, high: Any, limit: int, v: Floats) -> Floats:
    """Driver coordinates of values v of a piece's variable; towards a limit in v^2."""
    length = high - low
    if limit > 0:
        return np.asarray(high - length * v * v)
    return np.asarray(low + length * (v * v if limit else v))


def possible(rows: Floats) -> NDArray[np.bool_]:
    """Whether (..., n) there is a pose, an inertia and an effort, from rows (..., r, n)."""
    there = (rows[..., MARGIN, :] > 0) & (rows[..., J, :] > 0)
    return np.asarray(there & np.isfinite(rows[..., :MARGIN, :]).all(axis=-2))


def tails(rows: Floats, series: Floats) -> Floats:
    """(..., r) what series leave out, relative; none below the rounding of rates and inertia.

    A margin m is exact to rounding, they are to 1 / m of it.
    """
    left, least = tail(series), rows[..., MARGIN, :].min(axis=-1)[..., None]
    with np.errstate(all="ignore"):
        known = np.where(least > 0, NOTHING / least, math.inf)
    return np.where(left <= known, 0.0, left)


@dataclass(frozen=True)
class PlaceData:
    """Series over a piece of the path from low to high [rad or m].

    limit : -1 or +1 where the low or the high end is a dead centre, else 0. The series are
        then in v, (way to the limit) = (high - low) v^2, and J v^2, tau v and damping v^2 stand
        for what grows without bound
    rows : (r, n) values at the nodes: J, tau, margin, and what else depends on the place
    """

    low: float
    high: float
    limit: int
    rows: Floats

    @property
    def length(self) -> float:
        """[rad or m]"""
        return self.high - self.low

    @cached_property
    def series(self) -> Floats:
        """Chebyshev coefficients (r, n)."""
        series: Floats = self.rows @ rule(self.rows.shape[1]).to_series.T
        return series

    @cached_property
    def largest(self) -> Floats:
        """(r,) magnitudes at the nodes: a series is as exact as its largest value."""
        largest: Floats = np.abs(self.rows).max(axis=1)
        return largest

    @cached_property
    def tails(self) -> Floats:
        """(r,) see `tails`."""
        return tails(self.rows, self.series)

    @property
    def unknown(self) -> float:
        """What the series of the inertia leaves out, relative, whatever its rounding."""
        return float(tail(self.series)[J])

    @property
    def tail(self) -> float:
        """The largest of them but for the margin: the smallest of several margins has kinks."""
        return float(np.delete(self.tails, MARGIN).max())

    def at(self, q: Floats) -> Floats:
        """All rows (r, m) at places (m,) inside."""
        way = self.high - q if self.limit > 0 else q - self.low
        v = np.clip(way / self.length, 0.0, 1.0)
        v = np.sqrt(v) if self.limit else v
        rows: Floats = self.series @ basis(v, self.series.shape[1]).T
        if self.limit:
            v = np.maximum(v, EPS)
            rows[[J, *range(DAMPING, len(rows))]] /= v * v
            rows[TAU] /= v
        return rows

    @cached_property
    def forward(self) -> Floats:
        """Rows (r, n + 1) at the nodes of a plain panel over all of it, and at its begin."""
        return np.column_stack([self.rows, self.series @ _ends(self.rows.shape[1])[0]])

    @cached_property
    def backward(self) -> Floats:
        """The same of a panel that runs from high to low: the nodes lie alike on both sides."""
        return np.column_stack([self.rows[:, ::-1], self.series @ _ends(self.rows.shape[1])[1]])

    def zeros(self, row: int) -> list[float]:
        """Places at which a row is zero, ascending."""
        values = self.rows[row]
        if np.ptp(values) < np.abs(values).min():  # all of one sign, and far from zero
            return []
        zeros = place(self.low, self.high, self.limit, roots(self.series[row]))
        return sorted(zeros.tolist())

    def touches(self, row: int, level: float) -> list[float]:
        """Places at which a row that is not negative comes down to a level, or nearly."""
        series = self.series[row]
        if not near_zero(series):
            return []
        v = np.concatenate([[0.0], roots(chebyshev.chebder(series)), [1.0]])
        low = v[basis(v, series.size) @ series <= level]
        places: list[float] = place(self.low, self.high, self.limit, low).tolist()
        return places


def near_zero(series: Floats) -> NDArray[np.bool_]:
    """Whether series (..., n) that are not negative may touch zero."""
    values = series @ _finer(series.shape[-1]).T
    return np.asarray(
        values.min(axis=-1) <= (math.pi / 2 / FINER) ** 2 / 2 * np.abs(values).max(axis=-1)
    )


@cache
def _ends(n: int) -> Floats:
    """Values (2, n) of the polynomials at the ends."""
    return np.asarray(basis(np.array([0.0, 1.0]), n))


@cache
def _finer(n: int) -> Floats:
    """Values at more nodes from n coefficients."""
    return np.asarray(basis(node_places(FINER * n), n))


def mesh(
    values: Callable[[Floats], Floats], edges: Floats, n: int, tolerance: float
) -> tuple[PlaceData, ...]:
    """Pieces between edges, resolved to a tolerance: all that are not are halved at once.

    Left out: where a pose is impossible, or margin or inertia may touch zero, and what a part
    in `SHORT` does not resolve either.
    """
    low, high = edges[:-1], edges[1:]
    shortest = float((high - low).min(initial=math.inf)) / SHORT
    kept: list[PlaceData] = []
    while low.size:
        rows = values(place(low[:, None], high[:, None], 0, rule(n).v).ravel())
        rows = np.moveaxis(rows.reshape(len(rows), -1, n), 1, 0)
        series = rows @ rule(n).to_series.T
        there = possible(rows).all(axis=-1) & ~near_zero(series[:, [MARGIN, J]]).any(axis=1)
        fine = (np.delete(tails(rows, series), MARGIN, axis=1) <= tolerance).all(axis=1)
        for i in np.flatnonzero(there & fine).tolist():
            kept.append(PlaceData(float(low[i]), float(high[i]), 0, rows[i]))
        again = there & ~fine & (high - low > shortest)
        low, high = low[again], high[again]
        middle = (low + high) / 2
        low, high = np.append(low, middle), np.append(middle, high)
    return tuple(sorted(kept, key=lambda piece: piece.low))
