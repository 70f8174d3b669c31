"""Following a real quantity along a cycle: its signal, and every turn of it.

Samples show where the signal turns; more poses of the mechanism close in on each turn.
Where a stretch that can be computed ends, its end is found to rounding and the value
there is judged: a limit, or growth without bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.cycle import Cycle
from blockmech.analysis.peaks import Floats, last_place, least_place, turning_place
from blockmech.errors import Problem, RequestError
from blockmech.failures import without_gaps

EPS = float(np.finfo(float).eps)
ROUNDING = 64 * EPS  # of the value: smaller ups and downs are noise
LARGE = 0.9  # share of the samples below the size that rounding is judged by
NOISY = 0.1  # turns a sample, above which a signal is rounding only
CLOSES = 1e-9  # relative, of values at both ends of whole turns that count as the same
SMOOTH = 1e-6  # of a bracket: a place less certain than that is no smooth turn
GRADED = 24  # extra samples towards the end of what can be computed


class Signal(NamedTuple):
    """A real quantity along a cycle.

    ``value`` gives it at places (n,); ``smooth`` something that turns at the same places,
    without a kink.
    """

    name: str
    value: Callable[[Floats], Floats]
    smooth: Callable[[Floats], Floats]


def signal_of(cycle: Cycle, output: str, part: str) -> Signal:
    """A real output, or a part of a vector."""

    def read(s: Floats) -> Any:
        return cycle.run(s, output)[output]

    if part == "x":
        return _plain(output, lambda s: np.asarray(read(s).real))
    if part == "y":
        return _plain(output, lambda s: np.asarray(read(s).imag))
    if part == "magnitude":
        return Signal(output, lambda s: np.abs(read(s)), lambda s: np.abs(read(s)) ** 2)
    if output.endswith(".angle"):
        return _plain(output, _continued(cycle, read))
    return _plain(output, lambda s: np.asarray(read(s), dtype=float))


def _plain(name: str, value: Callable[[Floats], Floats]) -> Signal:
    return Signal(name, value, value)


def _continued(cycle: Cycle, read: Callable[[Floats], Any]) -> Callable[[Floats], Floats]:
    """An angle that does not jump by a turn on any stretch: it stays near the samples."""
    places = cycle.places()
    known = np.asarray(read(places), dtype=float)
    good = np.isfinite(known)
    for a, b in stretches(good):
        known[a : b + 1] = np.unwrap(known[a : b + 1])
    places, known = places[good], known[good]
    between = (places[1:] + places[:-1]) / 2

    def value(s: Floats) -> Floats:
        angle = np.asarray(read(s), dtype=float)
        if not len(known):
            return angle
        turns = np.round((known[np.searchsorted(between, s)] - angle) / (2 * math.pi))
        return np.asarray(angle + 2 * math.pi * turns)

    return value


def stretches(good: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]])))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


class Turn(NamedTuple):
    """An extreme as a place s of a cycle."""

    s: float
    value: float
    sign: int  # +1 a maximum, -1 a minimum
    end: bool


class Turns(NamedTuple):
    """The smallest and the largest value of a signal, and its turns inside the range.

    ``closed`` says that the cycle is a whole turn after which the signal repeats.
    """

    low: Turn
    high: Turn
    inner: tuple[Turn, ...]
    closed: bool


def turns_of(cycle: Cycle, signal: Signal) -> Turns:
    """Follow a signal over a cycle."""
    follower = _Follower(cycle, signal)
    inner, ends = follower.all()
    found = [*inner, *ends]
    low = min(found, key=lambda t: t.value)
    high = max(found, key=lambda t: t.value)
    return Turns(low._replace(sign=-1), high._replace(sign=1), tuple(inner), follower.closed)


class _Follower:
    """Closes in on the turns of one signal."""

    def __init__(self, cycle: Cycle, signal: Signal) -> None:
        self.cycle = cycle
        self.signal = signal
        self.places = cycle.places()
        self.values = signal.value(self.places)
        self.good = np.isfinite(self.values)
        if not self.good.any():
            # The run's own error says which block fails, and where.
            without_gaps(cycle.run(self.places, signal.name), "raise")
            raise RequestError(
                Problem("bad-request", signal.name, "it has no value anywhere in the cycle")
            )
        size = float(np.abs(self.values[self.good]).max())
        apart = abs(self.values[-1] - self.values[0])
        self.closed = bool(cycle.turns and self.good.all() and apart <= CLOSES * size)

    def all(self) -> tuple[list[Turn], list[Turn]]:
        """Turns inside, in order, and the values at the ends of every stretch."""
        y = self.values
        if self.good.all() and np.ptp(y) <= ROUNDING * np.abs(y).max():
            return [], [Turn(self.cycle.low, float(y[0]), 1, True)]
        if self.closed:
            step = self.places[1] - self.places[0]
            s = np.concatenate([[self.places[0] - step], self.places])
            y = np.concatenate([[y[-2]], y])
            return sorted(self._inside(s, y, -math.inf, math.inf)), []
        inner, ends = [], []
        for a, b in stretches(self.good):
            s, y, outer = self._stretch(a, b)
            inner += self._inside(s, y, float(s[0]), float(s[-1]))
            ends += outer
        return sorted(inner), ends

    def _inside(self, s: Floats, y: Floats, low: float, high: float) -> list[Turn]:
        """Turns between samples s with values y, closed in on no farther than low and high."""
        if len(y) < 3:
            return []
        left, right = y[1:-1] - y[:-2], y[1:-1] - y[2:]
        # Not the largest value: near a pole of the output that says nothing about the rest.
        size = np.maximum(np.abs(y[1:-1]), np.quantile(np.abs(y), LARGE))
        seen = np.maximum(np.abs(left), np.abs(right)) > ROUNDING * size
        top = (left > 0) & (right >= 0) & seen
        bottom = (left < 0) & (right <= 0) & seen
        found = [(i, 1) for i in (np.flatnonzero(top) + 1).tolist()]
        found += [(i, -1) for i in (np.flatnonzero(bottom) + 1).tolist()]
        if len(found) > NOISY * len(y):  # rounding about zero: there is nothing to close in on
            ends = ((int(np.argmax(y)), 1), (int(np.argmin(y)), -1))
            return [Turn(self._wrapped(float(s[i])), float(y[i]), sign, False) for i, sign in ends]
        return [
            self._turn((float(s[i - 1]), float(s[i]), float(s[i + 1])), sign, (low, high))
            for i, sign in found
        ]

    def _turn(
        self, around: tuple[float, float, float], sign: int, widest: tuple[float, float]
    ) -> Turn:
        """Close in on the turn between the outer two of three places."""
        bracket = (around[0], around[2])
        places = [around[1]]
        smooth = turning_place(self.signal.smooth, bracket, widest, sign)
        if smooth is not None:
            places.insert(0, smooth.place)
        if smooth is None or smooth.error > SMOOTH * (bracket[1] - bracket[0]):
            places.insert(0, least_place(lambda s: -sign * self._one(s), *bracket, steps=72)[0])
        values = [self._one(s) for s in places]
        best = max(sign * v for v in values)
        # The first place that is best within rounding, so a flat top keeps its smooth place.
        i = next(i for i, v in enumerate(values) if sign * v >= best - ROUNDING * abs(best))
        return Turn(self._wrapped(places[i]), values[i], sign, False)

    def _one(self, s: float) -> float:
        return float(self.signal.value(np.array([s]))[0])

    def _wrapped(self, s: float) -> float:
        """A place of a closed cycle inside its range."""
        if not self.closed:
            return s
        span = self.cycle.high - self.cycle.low
        if s < self.cycle.low - 1e-12 * span:
            return s + span
        return s - span if s >= self.cycle.high - 1e-12 * span else s

    # -- ends of stretches that can be computed ------------------------------------------

    def _stretch(self, a: int, b: int) -> tuple[Floats, Floats, list[Turn]]:
        """Samples of a stretch, denser towards an end that is a dead centre, and its ends."""
        s, y = self.places[a : b + 1], self.values[a : b + 1]
        step = float(self.places[1] - self.places[0])
        outer = []
        for i, side in ((a, -1), (b, 1)):
            if 0 <= i + side < len(self.places):
                edge = last_place(
                    lambda x: math.isfinite(self._one(x)),
                    float(self.places[i]),
                    float(self.places[i + side]),
                )
                more = edge - side * 4 * step * (np.arange(GRADED) / GRADED) ** 2
                more = more[(more >= self.places[a] - step) & (more <= self.places[b] + step)]
                s, y = np.append(s, more), np.append(y, self.signal.value(more))
                outer.append(self._at_edge(edge, -side * step))
            else:
                outer.append(Turn(float(self.places[i]), float(self.values[i]), 1, True))
        order = np.unique(s, return_index=True)[1]
        s, y = s[order], y[order]
        good = np.isfinite(y)
        return s[good], y[good], outer

    def _at_edge(self, edge: float, inward: float) -> Turn:
        """The value towards a dead centre: a limit, or without bound.

        Steps towards it shrink by 100 each: the value then settles, or it grows like
        1/sqrt(distance), each time by 10 times more.
        """
        far, near, nearest = (self._one(edge + inward * x) for x in (1e-2, 1e-4, 1e-6))
        if abs(nearest - near) > 2 * abs(near - far) + ROUNDING * abs(near):
            return Turn(edge, math.copysign(math.inf, nearest - near), 1, True)
        return Turn(edge, self._one(edge), 1, True)
