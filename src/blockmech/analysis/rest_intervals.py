r"""Where joint friction holds the only driver: intervals of rest.

The driver rests wherever no friction lets it start: the two least efforts that start it either way
(`blockmech.dynamics.sticking`) are against it. The ends are roots of these efforts.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

from blockmech.analysis.scan import TURN, Span, runs
from blockmech.dynamics.system import System
from blockmech.functions.roots import SCANNED
from blockmech.ground.plane import EPS
from blockmech.typing import Floats

Effort = Callable[[Floats], Floats]


def held_intervals(
    system: System,
    effort: Effort,
    t: float,
    low: float,
    high: float,
    closed: bool,
    equilibria: list[float],
) -> list[tuple[float, float]]:
    """Where friction holds the driver on an arc: both efforts that start it are against it.

    Sampled as finely as extrema are looked for, and at every equilibrium and every place where
    the effort of the loads is smallest; the ends are roots of the two efforts.
    """
    friction = system.friction
    if friction is None:
        return []
    u = np.linspace(0.0, 1.0, SCANNED // 2 + 1)
    q = Span(low, high, turn=closed).place(u if closed else u[1:-1])
    stops = [x for x in (low, high) if x in system.stops[0]]  # others are dead centres
    q = np.unique(np.concatenate([q, equilibria, stops, _weakest(effort, q)]))
    lowest, highest, _ = friction.holding(q, t)
    holds = (lowest <= 0) & (highest >= 0)
    holds |= np.isin(q, equilibria)  # balanced: whatever friction there is holds it
    intervals: list[tuple[float, float]] = []
    for first, last in runs(holds):
        start = q[first] if first == 0 else _end(system, t, q[first], q[first - 1])
        end = q[last] if last == len(q) - 1 else _end(system, t, q[last], q[last + 1])
        intervals.append((float(start), float(end)))
    turn = high - low
    if closed and len(intervals) > 1 and intervals[0][0] == q[0] and intervals[-1][1] == q[-1]:
        across = intervals[-1][0], intervals[0][1] + turn  # the seam
        intervals = [*intervals[1:-1], across]
    return intervals


def _weakest(effort: Effort, q: Floats) -> Floats:
    """Places beside which the effort of the loads is larger on both sides."""
    y = np.abs(effort(q))
    smallest = np.concatenate([[False], (y[1:-1] <= y[:-2]) & (y[1:-1] <= y[2:]), [False]])
    i = np.flatnonzero(smallest)
    return np.concatenate([(q[i] + q[i - 1]) / 2, (q[i] + q[i + 1]) / 2]) if len(i) else q[:0]


def _end(system: System, t: float, inside: float, outside: float) -> float:
    """The last place towards one that is not held, at which friction still holds the driver."""
    from scipy.optimize import brentq

    friction = system.friction
    assert friction is not None
    largest = sys.float_info.max**0.25  # instead of infinity, of which there is no secant

    def beyond(q: float) -> float:
        lowest, highest = (float(x[0]) for x in friction.holding(np.array([q]), t)[:2])
        return float(np.clip(max(lowest, -highest), -largest, largest))

    a, b = beyond(inside), beyond(outside)
    if not a <= 0 < b:
        return inside
    return float(brentq(beyond, inside, outside, xtol=4 * EPS, rtol=4 * EPS))


def interval_about(
    q: float, intervals: list[tuple[float, float]], closed: bool
) -> tuple[float, float] | None:
    """The interval of rest that an equilibrium is in."""
    for low, high in intervals:
        for shift in (0.0, TURN, -TURN) if closed else (0.0,):
            if low - shift <= q <= high - shift:
                return low - shift, high - shift
    return None
