"""Following a real quantity along a cycle: its signal, and every turn of it.

Extrema are found by `blockmech.analysis.scan`. Where a stretch that can be computed ends,
its end is found to rounding and the value there is judged: a limit, or growth without bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from blockmech.analysis.peaks import Search
from blockmech.analysis.scan import ASIDE, Span, runs, scan
from blockmech.analysis.working_cycle import Cycle
from blockmech.functions.series import panels
from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import DOUBLE_ROOT, EQUAL
from blockmech.result.failures import without_gaps
from blockmech.typing import Array, Floats, Real

ROUNDING = 64 * EPS  # of the value: smaller ups and downs are noise
NOISY = 1e-4  # of its range, usual change near by above which a signal is rounding only
STEEP = 1e3  # times by which a margin falls, for a hundredth of the distance, at a change point
BEFORE = np.array([6.0, -15.0, 20.0, -15.0, 6.0, -1.0])  # extrapolates from equal steps
BESIDE = np.geomspace(1e-7, 1.0, 8)  # of the way to the next place: looked at around an extremum


class Signal(NamedTuple):
    """A real quantity along a cycle.

    ``value`` gives it at places (n,); ``smooth`` something that turns at the same places,
    without a kink; ``margin`` is the least one of what is computed there.
    """

    name: str
    value: Callable[[Floats], Floats]
    smooth: Callable[[Floats], Floats]
    margin: Callable[[Floats], Floats]


def signal_of(cycle: Cycle, output: str, part: str) -> Signal:
    """A real output, or a part of a vector."""

    def read(s: Floats) -> Real:
        result = cycle.run(s, output)
        values = np.array(result[output])
        # A slider's angle is known where it cannot be; both parts of a vector are to be NaN.
        values[result._failures.word > 0] *= np.nan
        return values

    margin = partial(_margin, cycle, output)
    if part == "magnitude":
        return Signal(output, lambda s: np.abs(read(s)), lambda s: np.abs(read(s)) ** 2, margin)
    parts: dict[str, Callable[[Floats], Real]] = {
        "x": lambda s: read(s).real,
        "y": lambda s: read(s).imag,
        "": _continuous_angle(cycle, read) if cycle.mechanism.outputs[output].circular else read,
    }
    return Signal(output, parts[part], parts[part], margin)


def _margin(cycle: Cycle, output: str, s: Floats) -> Floats:
    """The least margin (n,) at places of what an output stands on, above rounding."""
    margins = [m for (m,) in cycle.run(s, output)._reports["margin"].values()]
    return np.asarray(np.min([np.ones(len(s)), *margins], axis=0).clip(EPS))


def _continuous_angle(cycle: Cycle, read: Callable[[Floats], Real]) -> Callable[[Floats], Floats]:
    """An angle that does not jump by a turn on any stretch: it stays near the samples."""
    coordinates = cycle.places()
    angles = np.array(read(coordinates))
    good = np.isfinite(angles)
    for a, b in runs(good):
        angles[a : b + 1] = np.unwrap(angles[a : b + 1])
    coordinates, angles = coordinates[good], angles[good]
    between = (coordinates[1:] + coordinates[:-1]) / 2

    def value(s: Floats) -> Floats:
        angle = np.asarray(read(s))
        if not len(angles):
            return angle
        turns = np.round((angles[np.searchsorted(between, s)] - angle) / (2 * math.pi))
        return np.asarray(angle + 2 * math.pi * turns)

    return value


class Turn(NamedTuple):
    """An extreme as a place s of a cycle."""

    s: float
    value: float
    sign: int  # +1 a maximum, -1 a minimum
    end: bool = False  # of the range, or of a stretch that can be computed


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
    coordinates, values = cycle.places(), signal.value(cycle.places())
    good = np.isfinite(values)
    if not good.any():
        # The run's own error says which block fails, and where.
        without_gaps(cycle.run(coordinates, signal.name), "raise")
        raise refused(signal.name, "it has no value anywhere in the cycle")
    largest = float(np.abs(values[good]).max())
    repeats = abs(values[-1] - values[0]) <= EQUAL * largest
    closed = bool(cycle.turns and good.all() and repeats)
    inner: list[Turn] = []
    ends: list[Turn] = []
    if good.all() and np.ptp(values) <= ROUNDING * largest:
        ends = [Turn(cycle.low, float(values[0]), 1, True)]
    elif not (good.all() and _is_noise(signal, coordinates, values)):
        # Times the margin: near a pole the largest value says nothing about the rest.
        floor = ROUNDING * float(np.nanmax(np.abs(values) * signal.margin(coordinates)))
        for low, high in cycle.stretches(signal.value):
            aside = ASIDE * closed
            inner += _inner_extrema(
                cycle, signal, Span(low - aside, high - aside, turn=closed), floor
            )
            if not closed:
                ends += [_end_value(cycle, signal, edge) for edge in (low, high)]
    inner = [
        turn._replace(value=math.copysign(math.inf, turn.value))
        if abs(turn.value) * DOUBLE_ROOT > largest
        else turn
        for turn in inner
    ]
    if not (inner or ends):  # rounding hides all turns: the samples are as good as any place
        ends = [
            Turn(float(coordinates[i]), float(values[i]), 1)
            for i in (values.argmax(), values.argmin())
        ]
    minimum = min([*inner, *ends], key=lambda t: t.value)
    maximum = max([*inner, *ends], key=lambda t: t.value)
    return Turns(minimum._replace(sign=-1), maximum._replace(sign=1), tuple(sorted(inner)), closed)


def _is_noise(signal: Signal, samples: Floats, values: Floats) -> bool:
    """Whether a signal changes at random from one place to one beside it."""
    neighbours = signal.value(samples[:-1] + EQUAL * np.ptp(samples))
    return bool(np.median(np.abs(neighbours - values[:-1])) > NOISY * np.ptp(values))


def _inner_extrema(cycle: Cycle, signal: Signal, span: Span, floor: float) -> list[Turn]:
    """Extrema inside a stretch, in order; rounding at the margin 1 is a floor for all of them."""
    part = (span.high - span.low) / (cycle.high - cycle.low)
    edges = panels(0.0, 1.0, max(2, math.ceil(part * cycle.panels)))
    x, y = scan(signal.smooth, span, edges, signal.value)
    x, y = x[np.isfinite(y)], y[np.isfinite(y)]
    noise = np.maximum(ROUNDING * np.abs(y), floor) / signal.margin(x)
    if not (turning := _extrema_among(y, noise, span.turn)):
        return []
    indices, signs = np.array(turning).T
    steps = np.diff(x)
    room = np.minimum(np.append(0.0, steps), np.append(steps, 0.0))  # none at the ends
    s = _refine_corners(signal, x[indices], room[indices], signs)
    turns = zip(s.tolist(), signal.value(s).tolist(), signs.tolist(), strict=True)
    return [Turn(cycle.wrapped(at) if span.turn else at, *rest) for at, *rest in turns]


def _refine_corners(signal: Signal, s: Floats, room: Floats, sign: Floats) -> Floats:
    """Extrema (k,), closed in on where values beside them are better: those are no smooth ones."""
    aside = np.concatenate([[0.0], -BESIDE, BESIDE])

    def values(row: Array, shares: Floats) -> Floats:
        coordinates = s[row, None] + room[row, None] * shares
        y = signal.value(coordinates.ravel()).reshape(coordinates.shape)
        return np.asarray(sign[row, None] * y)

    at, *neighbours = values(np.arange(len(s)), aside).T
    best = np.fmax.reduce(neighbours)
    corners = np.flatnonzero((room > 0.0) & (best > at + ROUNDING * np.abs(at)))
    if len(corners):
        shares = np.array([1.0, 2.0, 3.0])  # from 1 on: places are halved to rounding of themselves
        samples = values(corners, shares - 2.0)
        search = Search(lambda k, x: values(corners[k], x - 2.0), shares, samples, remainder=EPS)
        s[corners] += room[corners] * (search.largest().place - 2.0)
    return s


def _value(signal: Signal, s: float) -> float:
    return float(signal.value(np.array([s]))[0])


def _extrema_among(y: Floats, noise: Floats, closed: bool) -> list[tuple[int, int]]:
    """Numbers and kinds of the extrema among values, apart from noise.

    Values that are alike within noise count as one.
    """
    groups = [[0]]
    for i in range(1, len(y)):
        if abs(y[i] - y[groups[-1][-1]]) <= noise[i]:
            groups[-1].append(i)
        else:
            groups.append([i])
    if closed and len(groups) > 1:  # the last place is the first one
        groups[0] = groups.pop() + groups[0]
    n, turns = len(groups), []
    level = [float(y[g[0]]) for g in groups]
    for j in range(n) if closed else range(1, n - 1):
        before, after = level[j] - level[j - 1], level[j] - level[(j + 1) % n]
        if before * after > 0:
            sign = 1 if before > 0 else -1
            turns.append((max(groups[j], key=lambda i: sign * y[i]), sign))
    return turns


def _end_value(cycle: Cycle, signal: Signal, edge: float) -> Turn:
    """The value at the end of a stretch: a limit, or without bound at a dead centre.

    Steps towards it shrink by 100 each: the value then settles, or it grows like
    1/sqrt(distance), each time by 10 times more. At a change point, where margins fall by the
    square of the distance, the value is that of the polynomial through places before it.
    """
    at = _value(signal, edge)
    if edge in (cycle.low, cycle.high):
        return Turn(edge, at, 1, True)
    inward = (cycle.high - cycle.low) / cycle.steps
    inward = inward if math.isfinite(_value(signal, edge + 1e-6 * inward)) else -inward
    steps = edge + inward * np.array([1e-2, 1e-4, 1e-6])
    first, second, third = signal.value(steps).tolist()
    margins = signal.margin(steps)
    if margins[1] < margins[0] / STEEP:
        before = signal.value(edge + inward * np.arange(1.0, len(BEFORE) + 1.0))
        at = float(BEFORE @ before) if np.isfinite(before).all() else at  # a shorter stretch
    elif abs(third - second) > 2 * abs(second - first) + ROUNDING * abs(second):
        at = math.copysign(math.inf, third - second)
    return Turn(edge, at, 1, True)
