"""Equilibria of one driver: all roots of the effort of the loads over its range.

The effort becomes a series on each arc on which the mechanism closes, in a share in which also
what grows like the root at a dead centre is smooth, and all its roots are found. Its integral is
the potential where the loads follow the coordinate alone.

Where joint friction holds the driver it rests: wherever no friction lets it start, as the two least
efforts that start it either way (`blockmech.dynamics.sticking`) are against it. The ends of these
intervals are roots of the efforts.

Source: numerics of `blockmech.functions.series`.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from blockmech.analysis.equilibrium import Curve, Equilibria, Equilibrium, Kind, equilibrium_of
from blockmech.analysis.limits import limits
from blockmech.analysis.scan import NODES, TURN, Span, runs
from blockmech.dynamics import loads
from blockmech.dynamics.programs import tangents
from blockmech.dynamics.system import System
from blockmech.functions.roots import NEWTON_STEPS, SCANNED, bisect
from blockmech.functions.series import Series, fit, panels
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR, DOUBLE_ROOT, EQUAL
from blockmech.typing import Arguments, Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

SAME = DOUBLE_ROOT  # [rad] or share of the span: two equilibria are one


class Piece(NamedTuple):
    """An arc of the only driver: its ends, whether it is a closed turn, and its smooth parts."""

    low: float
    high: float
    closed: bool
    cuts: tuple[float, ...]
    spans: tuple[Span, ...]


@dataclass(frozen=True)
class Line:
    """The only driver along the arcs on which it is looked for, at a time [s].

    ``near`` a place, where only the arc about that is
    """

    mechanism: Compiled
    system: System
    t: float
    near: float | None = None

    def effort(self, q: Floats) -> Floats:
        """Effort (n,) of the loads at rest; NaN where there is no pose."""
        terms = self.system.sample(q, 0.0, self.t)
        return np.where(terms.possible, terms.tau, np.nan)

    @property
    def repeats(self) -> bool:
        """Whether everything that depends on the coordinate repeats with it."""
        return self.system.period is not None

    def arcs(self) -> Iterator[Piece]:
        """Each arc between the end stops that is looked at."""
        for piece in self._arcs():
            middle = (piece.low + piece.high) / 2
            target = middle if self.near is None else self.near
            if self.system.rotary[0]:
                target -= TURN * round((target - middle) / TURN)
            if piece.low <= target <= piece.high:
                yield piece

    def _arcs(self) -> Iterator[Piece]:
        (stop_low, stop_high), rotary = self.system.stops[0], self.system.rotary[0]
        closure = limits(self.mechanism)
        free = math.isinf(stop_low) and math.isinf(stop_high)
        size = loads.largest_length(self.mechanism.structure)
        farthest = math.inf if rotary else loads.REACH * size
        for arc in closure.arcs:
            low, high = (min(max(end.q, -farthest), farthest) for end in (arc.start, arc.end))
            passed = [point.q for point in arc.change_points]
            if closure.whole_turn and free:
                if not self.repeats:  # each turn is another: that about the start
                    low = self.mechanism.scene.start_of(self.mechanism.drivers[0])[0] - TURN / 2
                high = low + (self.system.period or TURN)
                yield self._cut_at_kinks(low, high, self.repeats, passed)
                continue
            shifts = [0]
            if rotary and not free:  # as the stops name it, any number of turns away
                a, b = max(stop_low, low - TURN), min(stop_high, high + TURN)
                shifts = [*range(math.floor((a - high) / TURN), math.ceil((b - low) / TURN) + 1)]
                if closure.whole_turn:
                    low, high, shifts = a, b, [0]
            for shift in shifts:
                a, b = max(low + TURN * shift, stop_low), min(high + TURN * shift, stop_high)
                if a < b:
                    yield self._cut_at_kinks(a, b, False, passed)

    def _cut_at_kinks(self, low: float, high: float, closed: bool, passed: list[float]) -> Piece:
        """An arc cut at the kinks of the loads and, a little aside, at change points."""
        kinks = _repeated(self.system.knots, self.system.period, low, high)
        passed = _repeated(passed, TURN if self.system.rotary[0] else None, low, high)
        aside = {q: BLUR if any(abs(q - p) <= BLUR for p in passed) else 0.0
                 for q in (low, high, *kinks, *passed)}  # fmt: skip
        cuts = _distinct(sorted({low, high, *kinks, *passed}), 4 * BLUR, 0.0)
        long = not self.system.rotary[0] and high - low > 4 * self.system.span
        size, last = self.system.span if long else math.inf, len(cuts) - 2
        spans = tuple(
            Span(a + aside[a], b - aside[b], turn=True)
            if closed or 0 < i < last
            else Span(a + aside[a], b - aside[b], size=size)
            for i, (a, b) in enumerate(itertools.pairwise(cuts))
        )
        return Piece(low, high, closed, tuple(cuts), spans)

    def series(self, span: Span) -> Series:
        """The effort by the share of a span: what the loads do is its integral."""

        def function(u: Floats) -> Floats:
            return self.effort(span.place(u)) * span.slope(u)

        edges = panels(0.0, 1.0, max(2, math.ceil((span.high - span.low) / self.system.span * 11)))
        return fit(function, edges[:-1] if len(edges) > SCANNED else edges, n=NODES)

    def roots(self, span: Span, series: Series) -> Iterator[float]:
        """Places at which the effort of the loads vanishes, to rounding."""
        broken = [] if series.resolved.all() else self._between_samples(span)
        for guess in [*span.place(series.roots()).tolist(), *broken]:
            q = self._newton_root(guess)
            if q is not None and span.low - EPS <= q <= span.high + EPS:
                yield q

    def jump(self, q: float) -> int:
        """The sign [-] of the effort beyond a place at which it jumps to the other one, else 0."""
        aside = BLUR * np.array([-20.0, -2.0, 2.0, 20.0])
        y = self.effort(q + aside)
        settled = np.abs(y[[1, 2]]) > np.abs(y[[0, 3]]) / 2
        return int(np.sign(y[2])) if y[1] * y[2] < 0 and settled.all() else 0

    def pressed_stops(self, low: float, high: float) -> Iterator[float]:
        """End stops among the ends of an arc that the loads push against."""
        for side, q, stop in zip((-1, 1), (low, high), self.system.stops[0], strict=True):
            if q == stop and side * float(self.effort(np.array([q]))[0]) > self.system.rounding(q):
                yield q

    def _between_samples(self, span: Span) -> Iterator[float]:
        """Changes of sign where there is no series."""
        q = span.place(np.linspace(0.0, 1.0, 4 * SCANNED + 3)[1:-1])
        y = self.effort(q)
        for i in np.flatnonzero(y[:-1] * y[1:] < 0).tolist():
            before = y[i] > 0

            def same(x: float, before: bool = before) -> bool:
                return bool((self.effort(np.array([x]))[0] > 0) == before)

            yield bisect(same, q[i], q[i + 1])

    def _newton_root(self, q: float) -> float | None:
        """A root by Newton's method with the exact slope; None where it is none."""
        span = self.system.span
        for _ in range(NEWTON_STEPS):
            local = tangents(self.mechanism, [[q]], t=self.t)
            slope = float(local.K[0, 0, 0])
            step = -float(local.effort[0, 0]) / slope if slope else 0.0
            if not (math.isfinite(step) and local.margin[0] > 0 and abs(step) < SAME * span * 1e4):
                return None
            q += step
            if abs(step) <= 4 * EPS * max(abs(q), span):
                return q
        noise = self.system.rounding(q)
        small = abs(float(self.effort(np.array([q]))[0])) <= 64 * noise
        return q if small or abs(step) <= SAME * span else None


def equilibria_of_one(line: Line) -> Equilibria:
    """All equilibria of the only driver, where friction holds it, and the curves."""
    mechanism, system = line.mechanism, line.system
    driver = mechanism.drivers[0]
    name = mechanism._of_driver(driver, "q")
    units = {name: mechanism.structure.driver_joint(driver).coordinate_unit}
    has_potential = system.depends_on <= {"q", "time"}
    points: list[Equilibrium] = []
    rests: list[tuple[float, float]] = []
    balanced: list[tuple[float, float]] = []
    curves: list[Curve] = []
    for low, high, closed, cuts, spans in line.arcs():
        rows = [line.series(span) for span in spans]
        works = list(_works(rows)) if has_potential else []
        curve = _curve(line, spans, works)
        curves.append(curve)
        balances: list[float] = []
        jumps: list[float] = []
        if np.all(np.abs(np.nan_to_num(curve.effort)) <= 8 * system.rounding(curve.q)):
            balanced.append((low, high))
        else:
            roots = [
                q
                for span, series in zip(spans, rows, strict=True)
                for q in line.roots(span, series)
            ]
            balances = _distinct(sorted(roots), SAME * system.span, (high - low) * closed)
            ends = cuts[:-1] if closed else cuts[1:-1]  # dead centres are no jumps
            jumps = [q for q in ends if line.jump(q)]
        intervals = held_intervals(system, line.effort, line.t, low, high, closed, balances)
        rests += intervals
        at = tangents(mechanism, np.array([*balances, *jumps])[:, None], t=line.t)
        energy = _potentials(spans, works, balances)
        at.M[at.M[:, 0, 0] <= EQUAL**2 * system.typical_inertia(low)] = 0.0
        for i, q in enumerate(balances):
            rest = interval_about(q, intervals, closed)
            facts: Arguments = {"potential": energy[i], "interval": rest}
            points.append(equilibrium_of({name: q}, units, at, i, **facts))
        for i, q in enumerate(jumps, start=len(balances)):
            kind: Kind = "unstable" if line.jump(q) > 0 else "stable"
            points.append(equilibrium_of({name: q}, units, at, i, kind, jump=True))
        for q in () if closed else line.pressed_stops(low, high):
            at = tangents(mechanism, [[q]], t=line.t)
            points.append(equilibrium_of({name: q}, units, at, 0, "stable", stop=True))
    order = tuple(sorted(points, key=lambda e: e.q[0]))
    notes = tuple(_notes(line, curves))
    arcs = tuple(sorted(rests)), tuple(balanced), tuple(curves)
    return Equilibria(order, *arcs, name, units[name], notes)


def _works(rows: Iterable[Series]) -> Iterator[tuple[Series, float]]:
    """The integral of the effort over each span of an arc by its share, and over those before."""
    total = 0.0
    for series in rows:
        integral = _fill_short_gaps(series).integral()
        yield integral, total
        total += float(integral(np.array([1.0]))[0])


def _curve(line: Line, spans: Sequence[Span], works: Sequence[tuple[Series, float]]) -> Curve:
    """The effort along an arc, and less its integral where that is a potential."""
    u = np.linspace(0.0, 1.0, max(9, SCANNED // 2 // len(spans)) + 1)
    q = np.concatenate([span.place(u) for span in spans])
    potential = -np.concatenate([total + integral(u) for integral, total in works] or [u + np.nan])
    return Curve(q, line.effort(q), potential if np.isfinite(potential).all() else None)


def _potentials(
    spans: Sequence[Span], works: Sequence[tuple[Series, float]], coordinates: list[float]
) -> list[float | None]:
    """Potential [J] at places of an arc, from the lowest of them; None where there is none."""
    potentials: list[float] = []
    for span, (integral, total) in zip(spans, works, strict=False):
        for q in coordinates:
            if span.low <= q <= span.high and len(potentials) <= coordinates.index(q):
                potentials.append(-(total + float(integral(span.share(np.array([q])))[0])))
    lowest = min(potentials, default=0.0)
    relative = [x - lowest if math.isfinite(x - lowest) else None for x in potentials]
    return relative + [None] * (len(coordinates) - len(relative))


def _repeated(
    coordinates: Iterable[float], period: float | None, low: float, high: float
) -> list[float]:
    """Places between two ends, repeated with a period if there is one."""
    copies = {*map(float, coordinates)}
    if period:
        ends = ((q, math.floor((low - q) / period), math.ceil((high - q) / period)) for q in copies)
        copies = {q + k * period for q, first, last in ends for k in range(first, last + 1)}
    return sorted(q for q in copies if low <= q <= high)


def _fill_short_gaps(series: Series) -> Series:
    """A series without the panels around a change point, which are too short to count."""
    bad = np.asarray(~np.isfinite(series.c).all(axis=1))
    if not bad.any() or np.diff(series.edges)[bad].sum() > SAME:
        return series
    return replace(series, c=np.where(bad[:, None], 0.0, series.c))


def _distinct(rising: list[float], apart: float, turn: float) -> list[float]:
    """Places without those that are said twice; of a closed arc the last is the first."""
    distinct: list[float] = []
    for q in rising:
        if not distinct or q - distinct[-1] > apart:
            distinct.append(q)
    if turn and len(distinct) > 1 and distinct[0] + turn - distinct[-1] <= apart:
        distinct.pop()
    return distinct


def _notes(line: Line, curves: Sequence[Curve]) -> Iterator[str]:
    if len(curves) > 1:
        name = line.mechanism._of_driver(line.mechanism.drivers[0], "q")
        yield f"of all {len(curves)} arcs of {name}: a motion need not lead from one to another"
    farthest = loads.REACH * loads.largest_length(line.mechanism.structure)
    ends = np.abs([q for curve in curves for q in (curve.q[0], curve.q[-1])])
    if not line.system.rotary[0] and np.isclose(ends, farthest).any():
        yield f"looked for from {-farthest:.6g} to {farthest:.6g} m: no group ends the travel"
    for low, high in [(curve.q[0], curve.q[-1]) for curve in curves]:
        if line.system.rotary[0] and not line.repeats and math.isclose(high - low, TURN):
            yield f"no turn is like another: looked for from {low:.6g} to {high:.6g} rad"
    if "time" in line.system.depends_on:
        yield f"loads follow the time, which is held at {line.t:.9g} s"
    if line.system.friction is None and line.mechanism.frictional_joints:
        yield "friction of joints is left out: with it the mechanism rests in intervals"


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
