r"""Place data: what depends on the place alone, as Chebyshev series over a piece of the path.

Inertia, effort and margin. They are sampled once; whatever runs there, how often and in which
direction, needs no further kernel call.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from blockmech.dynamics.panel_nodes import (
    MARGIN,
    OVER_ALL,
    PIECE,
    PLAIN,
    SHORT,
    TAU,
    VALUES,
    J,
    basis,
    node_places,
    nodes,
    roots,
    rule,
)
from blockmech.functions.series import tail
from blockmech.ground.plane import EPS
from blockmech.typing import Floats, Real

RESOLVED = 16 * EPS  # of series: what some fifty terms leave of rounding
NOTHING = 64 * EPS  # of a margin or of the usual inertia: what rounding of a pose leaves of zero
# A series of n terms that touches zero is, by Bernstein's inequality, below (pi / 2 f)^2 / 2 of
# its largest value at one of f n nodes.
FINER = 16


def coordinate_at(low: Real, high: Real, limit: int, v: Floats) -> Floats:
    """Driver coordinates of values v of a piece's variable; towards a limit in v^2."""
    length = high - low
    if limit > 0:
        return np.asarray(high - length * v * v)
    return np.asarray(low + length * (v * v if limit else v))


def possible(rows: Floats) -> NDArray[np.bool_]:
    """Whether (..., n) there is a pose, an inertia and an effort, from rows (..., r, n)."""
    exists = (rows[..., MARGIN, :] > 0) & (rows[..., J, :] > 0)
    return np.asarray(exists & np.isfinite(rows[..., :MARGIN, :]).all(axis=-2))


def tails(series: Floats, margin: Floats) -> Floats:
    """(..., r) what series leave out, relative; none below the rounding of rates and inertia.

    A margin m (..., n) is exact to rounding, they are to 1 / m of it.
    """
    remainder, smallest_margin = tail(series), margin.min(axis=-1)[..., None]
    with np.errstate(all="ignore"):
        rounding = np.where(smallest_margin > 0, NOTHING / smallest_margin, math.inf)
    return np.where(remainder <= rounding, 0.0, remainder)


@dataclass(frozen=True)
class PlaceData:
    """Series over a piece of the path from low to high [rad or m].

    limit : -1 or +1 where the low or the high end is a dead centre, else 0. The series are
        then in v, (way to the limit) = (high - low) v^2, and J v^2 and tau v stand
        for what grows without bound
    rows : (r, n) values at the nodes: J, tau, margin, and what else depends on the place
    second : (s, k) the same but for the margin, sampled at other nodes; none where s = 0
    """

    low: float
    high: float
    limit: int
    rows: Floats
    second: Floats = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def length(self) -> float:
        """[rad or m]"""
        return self.high - self.low

    @cached_property
    def series(self) -> Floats:
        """Chebyshev coefficients (r, n)."""
        series: Floats = self.rows @ _to_series(self.rows).T
        return series

    @cached_property
    def largest(self) -> Floats:
        """(r,) magnitudes at the nodes: a series is as exact as its largest value."""
        largest: Floats = np.abs(self.rows).max(axis=1)
        return largest

    @cached_property
    def tails(self) -> Floats:
        """(r,) see `tails`."""
        return tails(self.series, self.rows[MARGIN])

    @property
    def unknown(self) -> float:
        """What the series of the inertia leaves out, relative, whatever its rounding."""
        return float(tail(self.series)[J])

    @property
    def tail(self) -> float:
        """The largest of both samplings but for the margin, the smallest of several, with kinks."""
        second_tail = 0.0
        if len(self.second):
            second = self.second @ _to_series(self.second).T
            second_tail = float(tails(second, self.rows[MARGIN]).max())
        return float(np.delete(self.tails, MARGIN).max(initial=second_tail))

    def block(self, sign: int) -> Floats:
        """The piece (5, 2, n + 2) as it is run over in a direction, see `panel_nodes`."""
        return self._blocks[sign > 0]

    @cached_property
    def _blocks(self) -> tuple[Floats, Floats]:
        """It against the coordinate, and with it."""
        n = self.rows.shape[1]
        matrices, block = nodes(n, self.second.shape[1] or n), np.zeros((PIECE, 2, n + 2))
        block[0, :, :-2], (first, second) = self.series[:MARGIN], block[:VALUES]
        block[1] = first
        if len(self.second):
            second[:, :-2] = 0.0
            second[:, : self.second.shape[1]] = self.second[:MARGIN] @ _to_series(self.second).T
        block[VALUES:OVER_ALL] = block[:VALUES] @ matrices.values
        block[VALUES, :, 1:-1] = self.rows[:MARGIN]
        back, work = block.copy(), self.length * matrices.work[PLAIN]
        back[VALUES:OVER_ALL] = block[VALUES:OVER_ALL, :, ::-1]  # the nodes lie alike
        for x, sense in ((block, 1), (back, -1)):
            x[OVER_ALL] = sense * (x[VALUES:OVER_ALL, TAU] @ work)
        return back, block

    def touches(self, row: int, level: float) -> list[float]:
        """Places at which a row that is not negative comes down to a level, or nearly."""
        series = self.series[row]
        if not may_vanish(series):
            return []
        v = np.concatenate([[0.0], roots(chebyshev.chebder(series)), [1.0]])
        low = v[basis(v, series.size) @ series <= level]
        coordinates: list[float] = coordinate_at(self.low, self.high, self.limit, low).tolist()
        return coordinates


def _to_series(rows: Floats) -> Floats:
    return rule(rows.shape[1]).to_series


def piece_data(low: float, high: float, limit: int, rows: Floats, n: int) -> PlaceData:
    """Of rows (r, n + k) at the nodes, and at k others."""
    second = np.delete(rows[:, n:], MARGIN, axis=0) if rows.shape[1] > n else np.empty((0, 0))
    return PlaceData(low, high, limit, np.ascontiguousarray(rows[:, :n]), second)


@cache
def sampled(n: int, second_count: int) -> Floats:
    """Nodes (n + others,) of both samplings."""
    return np.append(rule(n).v, rule(second_count).v) if second_count else rule(n).v


def may_vanish(series: Floats) -> NDArray[np.bool_]:
    """Whether series (..., n) that are not negative may touch zero."""
    threshold, first = (math.pi / 2 / FINER) ** 2 / 2, series[..., 0]
    size = np.abs(series).sum(axis=-1)  # no value is larger, and none below the next
    mask = np.asarray(first + np.abs(first) - size <= threshold * size)
    if mask.any():
        values = series[mask] @ _finer(series.shape[-1]).T
        mask[mask] = values.min(axis=-1) <= threshold * np.abs(values).max(axis=-1)
    return mask


@cache
def _finer(n: int) -> Floats:
    """Values at more nodes from n coefficients."""
    return np.asarray(basis(node_places(FINER * n), n))


def mesh(
    values: Callable[[Floats], Floats],
    edges: Floats,
    n: int,
    tolerance: float,
    second_count: int = 0,
) -> tuple[PlaceData, ...]:
    """Pieces between edges, resolved to a tolerance: all that are not are halved at once.

    With a ``second_count`` they are sampled at as many other nodes as well, and resolved there.

    Left out: where a pose is impossible, or margin or inertia may touch zero, and what a part
    in `SHORT` does not resolve either.
    """
    low, high = edges[:-1], edges[1:]
    shortest = float((high - low).min(initial=math.inf)) / SHORT
    pieces: list[PlaceData] = []
    while low.size:
        q = coordinate_at(low[:, None], high[:, None], 0, sampled(n, second_count))
        rows = values(q.ravel())
        rows = np.moveaxis(rows.reshape(len(rows), -1, n + second_count), 1, 0)
        first, second = rows[..., :n], rows[..., n:]
        series = first @ rule(n).to_series.T
        feasible = possible(rows).all(axis=-1) & ~may_vanish(series[:, [MARGIN, J]]).any(axis=1)
        fine = np.ones(len(low), bool)
        for some in [series, second @ rule(second_count).to_series.T] if second_count else [series]:
            remainder = np.delete(tails(some, first[:, MARGIN]), MARGIN, axis=1)
            fine &= (remainder <= tolerance).all(axis=1)
        for i in np.flatnonzero(feasible & fine).tolist():
            pieces.append(piece_data(float(low[i]), float(high[i]), 0, rows[i], n))
        again = feasible & ~fine & (high - low > shortest)
        low, high = low[again], high[again]
        middle = (low + high) / 2
        low, high = np.append(low, middle), np.append(middle, high)
    return tuple(sorted(pieces, key=lambda piece: piece.low))
