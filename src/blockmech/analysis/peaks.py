"""The largest values of many functions of one coordinate between their samples, all at once.

Samples only start the search. Beside those that stand out, or that no cubic joins to the next ones,
a function is asked at eight places of a panel, whose polynomial says where the top is and what it
may miss. Panels are halved until that is nothing, or until they cannot hold more than is known: at
a corner or a jump down to rounding.

Source: Piyavskii, USSR Computational Mathematics 12 (1972), of bounds by which panels are left out;
those are the ends of the panels' series, as in `blockmech.functions.series`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from blockmech.functions.series import MOST
from blockmech.ground.tolerances import DOUBLE_ROOT, EQUAL, ROUNDING
from blockmech.typing import Floats, Indices

Truths: TypeAlias = NDArray[np.bool_]
Function: TypeAlias = Callable[[Indices, Floats], Floats]
"""Numbers (k,) of functions, places (k, 8) -> their values (k, 8); NaN where there is none."""

REMAINDER = 8 * ROUNDING  # of the largest value: what the polynomial of a panel usually may leave
# Weights of five samples: how much a function may rise beside the middle one. A parabola rises by
# an eighth of its second difference, what no cubic joins by three times its fourth.
RISE = 3.0 * np.array([1.0, -4.0, 6.0, -4.0, 1.0]) - np.array([0.0, 1.0, -2.0, 1.0, 0.0]) / 8.0
BESIDE = np.arange(-1, 2)  # numbers of samples around one
AROUND = np.arange(-3, 4)  # the same, by which the place of a top is predicted
WINDOW = 0.0625  # of the spacing of samples: half the panel about a predicted place
STEPS = 2  # of Newton's method from a node, or from a prediction
TOPS = 4  # smooth ones of a function that are told from another
NOISY = 0.3  # turns a sample, above which a function is rounding only
NODES = np.asarray(chebyshev.chebpts2(8))  # of a panel: machine code computes eight side by side


class Peaks(NamedTuple):
    """The largest values of m functions.

    value, place : (m,) and where it is; infinite at a pole
    error : (m,) what a value may miss; infinite where a function ends between its samples
    """

    value: Floats
    place: Floats
    error: Floats

    @property
    def limit(self) -> Floats:
        """Above which (m,) there is more."""
        return self.value + REMAINDER * np.abs(self.value)

    def rise(self, row: Indices, value: Floats, position: Floats) -> None:
        """Put in values of functions, of some several, where they are larger."""
        before = self.value[row]
        np.maximum.at(self.value, row, value)
        new = (value == self.value[row]) & (value > before)
        self.place[row[new]] = position[new]


@dataclass
class Search:
    """A search for the largest values of m functions on a range of which n samples are known.

    Attributes
    ----------
    function : gives values between them
    s : (n,) rising
    y : (m, n) values there, all finite
    absolute : whether the size of values counts
    turn : whether the range is a whole turn, behind which functions repeat if their ends agree
    suspects : (m, n) samples beside which anything may be
    remainder : what the polynomial of a panel may leave, of the largest value, and how narrow a
        panel becomes, of the largest place: in a narrower one slips that reverse together differ
    """

    function: Function
    s: Floats
    y: Floats
    absolute: bool = False
    turn: bool = False
    suspects: Truths | None = None
    remainder: float = REMAINDER
    peaks: Peaks = field(init=False)

    def __post_init__(self) -> None:
        self.y = np.ascontiguousarray(self.y, dtype=float)

    def largest(self) -> Peaks:
        """The largest values."""
        (m, n), steps = self.y.shape, np.diff(self.s)
        if n < len(AROUND) or np.ptp(steps) > EQUAL * steps[0]:
            size = self._size(self.y)
            self.peaks = Peaks(size.max(axis=1), self.s[size.argmax(axis=1)], np.zeros(m))
            row, cell = np.divmod(np.arange(m * (n - 1)), n - 1)
        else:
            size = np.abs(self.y.T[:: n // 4], order="C").max(axis=0)
            self.turn &= bool((np.abs(self.y[:, -1] - self.y[:, 0]) <= EQUAL * size).all())
            row, cell = self._smooth()
        if len(row):
            self._halve(row, self.s[cell], self.s[cell + 1])
        return self.peaks

    def _size(self, y: Floats) -> Floats:
        return np.abs(y) if self.absolute else y

    # -- at equal steps ------------------------------------------------------------------

    def _smooth(self) -> tuple[Indices, Indices]:
        """Find the tops of smooth functions; functions, and cells of them, that are left."""
        y, size = self.y, self._size(self.y)
        bound, row, k = self._bound(y, size), np.arange(len(y)), size.argmax(axis=1)
        self.peaks = Peaks(size[row, k], self.s[k], np.zeros(len(y)))
        tops, limit = [(row, k)], self.peaks.limit
        while len(row) and len(tops) <= TOPS:
            bound.put(self._around(row, k, BESIDE), -np.inf)
            k = bound.argmax(axis=1)[row]
            higher = bound[row, k] > limit[row]
            row, k = row[higher], k[higher]
            tops.append((row, k))
        row, k = map(np.concatenate, zip(*tops, strict=True))
        sure = self._put_tops(row, k)
        open_ = np.bincount(row, ~sure, len(y)) > 0.0
        open_[row[len(y) :]] = True
        open_ |= False if self.suspects is None else self.suspects.any(axis=1)
        rows = np.flatnonzero(open_)
        if not len(rows):
            return rows, rows
        bound[rows] = self._bound(y[rows], size[rows])
        bound.put(self._around(row[sure], k[sure], BESIDE), -np.inf)
        bound[row[~sure], k[~sure]] = np.inf
        high = bound[rows] > self.peaks.limit[rows][:, None]
        high |= False if self.suspects is None else self.suspects[rows]
        if self.turn:
            high[:, -1] = high[:, 0]
        row, cell = np.divmod(np.flatnonzero(high[:, 1:] | high[:, :-1]), len(self.s) - 1)
        return rows[row], cell

    def _bound(self, y: Floats, size: Floats) -> Floats:
        """What functions are at most beside samples (m, n), judged by their neighbours."""
        bound = np.correlate(y.ravel(), RISE, "same").reshape(y.shape)
        if self.turn:
            seam = np.concatenate([y[:, -5:-1], y[:, :5]], axis=1)
            seam = np.correlate(seam.ravel(), RISE, "same").reshape(seam.shape)
            bound[:, -3:], bound[:, :2] = seam[:, 2:5], seam[:, 4:6]
        else:
            bound[:, :2], bound[:, -2:] = bound[:, [2]], bound[:, [-3]]
        np.abs(bound, out=bound)
        bound += size
        if self.turn:  # which is the first one again
            bound[:, -1] = -np.inf
        return bound

    def _around(self, row: Indices, k: Indices, steps: Indices) -> Indices:
        """Where in y samples are that lie so many steps behind samples k of functions."""
        n = self.y.shape[1]
        index = np.arange(-n, 2 * n)
        index = index % (n - 1) if self.turn else index.clip(0, n - 1)
        return np.asarray(n * row + index.take(k + n + steps[:, None]))

    def _put_tops(self, row: Indices, k: Indices) -> Truths:
        """Find tops of functions beside samples k; which functions are surely smooth there."""
        s, n, spacing, reach = self.s, len(self.s), self.s[1] - self.s[0], AROUND[-1]
        sign = np.sign(self.y[row, k]) if self.absolute else np.ones(len(row))
        nearest = k if self.turn else k.clip(reach, n - 1 - reach)
        y = self.y.take(self._around(row, nearest, AROUND)) * sign
        offset = (k - nearest).astype(float)
        top = turning(polynomial(tuple(AROUND.tolist())) @ y, offset)
        predicted = s[k] + spacing * np.clip(top - offset, -1.0, 1.0)
        half = WINDOW * spacing
        middle = predicted if self.turn else predicted.clip(s[0] + half, s[-1] - half)
        start = (predicted - middle) / half
        values = self.function(row, middle[:, None] + half * NODES) * sign[:, None]
        z, top, tail = summits(values, start)
        inside = np.abs(z) < 1.0
        at_end = ~inside & ((k == 0) | (k == n - 1)) & (not self.turn)
        sure: Truths = (tail <= self.remainder * np.abs(top)) & (
            inside & (np.abs(z - start) < 0.5) | at_end
        )
        risen = sure & inside
        self.peaks.rise(row[risen], top[risen], (middle + half * z)[risen])
        return sure

    # -- wherever there may be more ------------------------------------------------------

    @np.errstate(all="ignore")  # of functions without bound
    def _halve(self, row: Indices, low: Floats, high: Floats) -> None:
        """Find the largest values on panels of functions, halving those that are not smooth."""
        scale, spent = np.abs(self.y).max(axis=1), np.zeros(len(self.y), np.intp)
        value, position, error = self.peaks
        while len(row):
            middle, half = (low + high) / 2, (high - low) / 2
            values = self._size(self.function(row, middle[:, None] + half[:, None] * NODES))
            k = np.where(np.isnan(values), -np.inf, values).argmax(axis=1)
            top = values[np.arange(len(row)), k]
            z, summit, tail = summits(values, NODES[k])
            smooth, inside = tail <= self.remainder * scale[row], (np.abs(z) < 1.0) & (summit > top)
            bound = steepest(values)
            risen = smooth & inside
            z, top = np.where(risen, z, NODES[k]), np.where(risen, summit, top)
            error[row[np.isnan(values).any(axis=1)]] = np.inf
            finite = top == top
            self.peaks.rise(row[finite], top[finite], (middle + half * z)[finite])
            np.add.at(spent, row, 1)
            at_peak = (low <= position[row]) & (position[row] <= high)  # or at a pole beside it
            open_ = ~smooth & (at_peak | (bound > value[row])) & np.isfinite(error[row])
            narrow = half <= self.remainder * np.abs(self.s).max()
            pole = row[open_ & narrow & (top > scale[row] / DOUBLE_ROOT)]
            value[pole] = np.inf
            open_ &= ~narrow & np.isfinite(value[row])
            over = open_ & (spent[row] > MOST)
            np.maximum.at(error, row[over], (bound - value[row])[over])
            open_ &= ~over
            row = np.repeat(row[open_], 2)
            edges = np.stack([low[open_], middle[open_], middle[open_], high[open_]], 1)
            low, high = edges.reshape(-1, 2).T
        doubt = np.flatnonzero((error > 0.0) & np.isfinite(error))
        if len(doubt) and self.y.shape[1] > 2:
            turns = np.diff(np.sign(np.diff(self.y[doubt], axis=1)), axis=1) != 0.0
            error[doubt[turns.mean(axis=1) > NOISY]] = 0.0  # there is nothing to close in on


@cache
def polynomial(nodes: tuple[float, ...]) -> Floats:
    """Values (k,) at places -> coefficients (k,) of the polynomial through them, rising."""
    return np.asarray(np.linalg.inv(np.vander(nodes, increasing=True)))


def steepest(values: Floats) -> Floats:
    """What panels (k,) hold at most, by values (k, 8) at nodes, if no slope between two nodes
    is larger elsewhere."""
    gaps = np.diff(NODES)
    slope = np.abs(np.diff(values, axis=1) / gaps).max(axis=1)
    return np.asarray((values[:, 1:] + values[:, :-1] + slope[:, None] * gaps).max(axis=1) / 2)


@cache
def panel_series() -> Floats:
    """Values (8,) at the nodes of a panel -> its polynomial, rising, and the last two
    coefficients of its Chebyshev series."""
    inverse = np.linalg.inv(chebyshev.chebvander(NODES, len(NODES) - 1))
    return np.concatenate([polynomial(tuple(NODES.tolist())), inverse[-2:]])


def turning(c: Floats, x: Floats) -> Floats:
    """Where polynomials (n, k) have their tops near x (k,), by Newton's method."""
    slopes = c[1:] * np.arange(1.0, len(c))[:, None]
    bends = slopes[1:] * np.arange(1.0, len(slopes))[:, None]
    for _ in range(STEPS):
        slope, bend = valued(slopes, x), valued(bends, x)
        with np.errstate(all="ignore"):
            x = x + np.where(bend < 0.0, -slope / bend, np.sign(slope)).clip(-1.0, 1.0)
    return x


def valued(c: Floats, x: Floats) -> Floats:
    """Values (k,) of polynomials with coefficients (n, k)."""
    if not x.any():
        c = c[:1]
    y: Floats = c[-1].copy()
    for row in c[-2::-1]:
        y *= x
        y += row
    return y


def summits(values: Floats, start: Floats) -> tuple[Floats, Floats, Floats]:
    """Tops of panels by values (k, 8) at nodes: places, values there, and what is left out.

    Places (k,) are -1 to 1 inside a panel; what its polynomial leaves out is in the values' unit.
    """
    series = panel_series() @ values.T
    c, tail = series[:-2], np.abs(series[-2:]).max(axis=0)
    z = turning(c, start)
    return z, valued(c, z.clip(-1.0, 1.0)), tail
