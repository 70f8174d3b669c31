r"""Equilibria: where a mechanism comes to rest under its loads, and whether it stays there.

At rest the drivers need the effort u(q) = -Q(q); an equilibrium is u = 0. Small disturbances x
obey M x'' + C x' + K x = 0 with K = du/dq, exact by `blockmech.dynamics.tangents`: an equilibrium
is stable where all roots of det(M s^2 + C s + K) stay left of or on the imaginary axis.

One driver: u becomes a series on each arc on which the mechanism closes, in a share in which
also what grows like the root at a dead centre is smooth, and all its roots are found. Its
integral is the potential where the loads follow the coordinate alone. Where joints have Coulomb
friction, the driver rests wherever no friction lets it start: in intervals, whose ends are roots
of the least efforts that start it either way (`blockmech.dynamics.friction`).

Several drivers: Newton's method with the exact K, from some hundred places at once. Nothing
proves that none is missed; more ``starts`` look closer.

Sources: Shabana, Dynamics of Multibody Systems, 4th ed.; numerics of `blockmech.series`.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import numpy as np

from blockmech.analysis.limits import limits
from blockmech.analysis.scan import NODES, TURN, Span, bisect
from blockmech.arguments import declared
from blockmech.dynamics import loads
from blockmech.dynamics.system import System
from blockmech.dynamics.tangents import Tangents, refuse_signals, tangents
from blockmech.errors import refused
from blockmech.plane import EPS
from blockmech.series import DOUBLE_ROOT, SCANNED, Floats, Series, fit, panels
from blockmech.settings import friction_asked
from blockmech.told import DEGREES, TextReport, as_data, with_unit
from blockmech.typing import FrictionMethod

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Kind = Literal["stable", "unstable", "indifferent"]

NONE = 1e-9  # relative: what roots and eigenvalues leave of nothing
STEPS = 60  # of Newton's method, from far away
SAME = 1e-7  # [rad] or share of the span: two equilibria are one
ASIDE = 10 * DOUBLE_ROOT  # [rad or m] of change points, where rounding hides poses
STARTS = 256  # for each of several drivers


@dataclass(frozen=True, repr=False)
class Equilibrium(TextReport):
    """A pose in which the loads alone move nothing.

    Attributes
    ----------
    at : ``"crank.q"`` -> coordinate [rad or m]
    units : ``"crank.q"`` -> its unit
    kind : "stable", "unstable" or "indifferent"; without friction of joints
    M, C, K : (k, k) by accelerations, rates and coordinates of the drivers
    values : (2k,) eigenvalues [1/s] of disturbances, the least damped first; empty where a
        driver moves no mass
    potential : [J] of loads that follow the only driver's coordinate, from the lowest
        equilibrium of its arc; else None
    interval : (low, high) [rad or m] about it in which friction holds the only driver, or None
    stop : whether it is an end stop that the loads push against
    jump : whether the effort of the loads jumps there from one sign to the other
    """

    at: Mapping[str, float]
    units: Mapping[str, str]
    kind: Kind
    M: Floats
    C: Floats
    K: Floats
    values: Any
    potential: float | None = None
    interval: tuple[float, float] | None = None
    stop: bool = False
    jump: bool = False

    @property
    def q(self) -> Floats:
        """Coordinates (k,) [rad or m] of the drivers."""
        return np.array([*self.at.values()])

    @property
    def stiffness(self) -> float:
        """K of the only driver [N m/rad or N/m], of several the smallest of its symmetric part."""
        return float(np.linalg.eigvalsh((self.K + self.K.T) / 2)[0])

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies [rad/s] of small oscillations, rising; those without damping."""
        return natural_frequencies(self.M, self.K) if len(self.values) else np.empty(0)

    def text(self, degrees: bool = DEGREES) -> str:
        """The equilibrium as a line."""
        at = ", ".join(f"{d} = {with_unit(q, self.units[d], degrees)}" for d, q in self.at.items())
        if self.stop:
            return f"{at}  pushed against the end stop"
        rows = [f"{at}  {self.kind}" + (", where the effort jumps" if self.jump else "")]
        w = self.frequencies
        if self.kind == "unstable" and len(self.values):
            rows.append(f"disturbances grow as exp({float(self.values[0].real):.6g} t)")
        elif len(w):
            rows.append(f"frequency {', '.join(f'{x:.6g}' for x in w)} rad/s")
        if self.potential is not None:
            rows.append(f"potential {self.potential:.6g} J")
        if self.interval is not None:
            rows.append(f"friction holds it {_between(self.interval, self._unit, degrees)}")
        return ", ".join(rows)

    @property
    def _unit(self) -> str:
        return next(iter(self.units.values()))

    def to_dict(self) -> dict[str, Any]:
        """The equilibrium as a JSON object."""
        values = [[float(z.real), float(z.imag)] for z in self.values]
        names = ("at", "kind", "potential", "interval", "stop", "jump")
        found = {name: getattr(self, name) for name in names}
        found |= {name: getattr(self, name).tolist() for name in ("M", "C", "K")}
        return as_data({**found, "values": values, "frequencies": self.frequencies.tolist()})


class Curve(NamedTuple):
    """An arc of the only driver: places (n,), the effort of the loads, their potential or None."""

    q: Floats
    effort: Floats
    potential: Floats | None


@dataclass(frozen=True, repr=False)
class Equilibria(TextReport, Sequence[Equilibrium]):
    """All equilibria that were found, in rising order of the first driver's coordinate.

    Attributes
    ----------
    found : the equilibria without friction of joints, and the end stops
    rests : (low, high) [rad or m] of the only driver: where joint friction holds it, also where
        there is no equilibrium without it; empty without friction
    balanced : (low, high) of arcs of the only driver on which the loads are balanced everywhere
    curves : of each arc of the only driver the effort of the loads and their potential
    coordinate, unit : of the only driver, e.g. "crank.q"; "" of several
    notes : what should be known
    """

    found: tuple[Equilibrium, ...]
    rests: tuple[tuple[float, float], ...] = ()
    balanced: tuple[tuple[float, float], ...] = ()
    curves: tuple[Curve, ...] = ()
    coordinate: str = ""
    unit: str = ""
    notes: tuple[str, ...] = ()

    @overload
    def __getitem__(self, index: int) -> Equilibrium: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Equilibrium, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self.found[index]

    def __len__(self) -> int:
        return len(self.found)

    @property
    def stable(self) -> tuple[Equilibrium, ...]:
        """Those at which it stays."""
        return tuple(e for e in self.found if e.kind == "stable")

    def text(self, degrees: bool = DEGREES) -> str:
        """One equilibrium a line, then the intervals of rest."""
        return "\n".join(self._lines(degrees))

    def _lines(self, degrees: bool) -> Iterator[str]:
        yield from (e.text(degrees) for e in self.found)
        if not self.found and not self.balanced:
            yield "no equilibrium"
        for one in self.balanced:
            yield f"balanced everywhere {_between(one, self.unit, degrees)}"
        for one in self.rests:
            yield f"friction holds {self.coordinate} {_between(one, self.unit, degrees)}"
        yield from self.notes

    def to_dict(self) -> dict[str, Any]:
        """All of it as a JSON object."""
        rows = [e.to_dict() for e in self.found]
        more = {"rests": self.rests, "balanced": self.balanced, "notes": self.notes}
        return {"equilibria": rows, **as_data(more)}


def _between(ends: tuple[float, float], unit: str, degrees: bool) -> str:
    low, high = (with_unit(x, unit, degrees) for x in ends)
    return f"from {low} to {high}"


# -- what a pose is ------------------------------------------------------------------------


def natural_frequencies(M: Floats, K: Floats) -> Floats:
    """Natural frequencies (r,) [rad/s] of M x'' + K x = 0, rising; none of what does not swing."""
    try:
        w2 = np.linalg.eigvals(np.linalg.solve(M, K))
    except np.linalg.LinAlgError:
        return np.empty(0)
    size = float(np.abs(w2).max(initial=0.0))
    good = (w2.real > NONE * size) & (np.abs(w2.imag) <= math.sqrt(NONE) * size)
    return np.sort(np.sqrt(w2[good].real))


def companion(M: Floats, C: Floats, K: Floats) -> Floats:
    """The matrix A (2k, 2k) of (x, x')' = A (x, x'). Raises `LinAlgError` without inertia."""
    k = len(M)
    left = np.hstack([np.linalg.solve(M, K), np.linalg.solve(M, C)])
    return np.vstack([np.eye(k, 2 * k, k), -left])


def kind_of(M: Floats, C: Floats, K: Floats) -> tuple[Kind, Any]:
    """The kind of an equilibrium and the eigenvalues of its disturbances, least damped first.

    Without damping and with a symmetric K the smallest eigenvalue of K tells; an eigenvalue that
    is rounding of the largest one is none. A driver without mass follows K and C alone.
    """
    size = float(np.abs(K).max(initial=0.0))
    values: Any = np.empty(0)
    if M.any() and np.linalg.cond(M) < 1 / EPS:
        values = np.linalg.eigvals(companion(M, C, K))
        values = values[np.argsort(-values.real, kind="stable")]
    symmetric = np.abs(K - K.T).max() <= NONE * size
    if symmetric or not len(values):
        least = float(np.linalg.eigvalsh((K + K.T) / 2)[0])
        if symmetric and least < -NONE * size:
            return "unstable", values
        if not np.abs(C).max() > 0 or not len(values):
            return ("stable" if least > NONE * size else "indifferent"), values
    slowest, largest = float(values[0].real), float(np.abs(values).max())
    if slowest > NONE * largest:
        return "unstable", values
    still = float(np.abs(np.linalg.eigvals(np.linalg.solve(M, K))).min()) <= NONE * largest**2
    return ("indifferent" if still else "stable"), values


# -- one driver ----------------------------------------------------------------------------


class _Piece(NamedTuple):
    """An arc of the only driver: its ends, whether it is a closed turn, and its smooth parts."""

    low: float
    high: float
    closed: bool
    cuts: tuple[float, ...]
    spans: tuple[Span, ...]


@dataclass(frozen=True)
class _Line:
    """The only driver along the arcs on which it is looked for, at a time [s]."""

    mechanism: Compiled
    system: System
    t: float

    def effort(self, q: Floats) -> Floats:
        """Effort (n,) of the loads at rest; NaN where there is no pose."""
        found = self.system.sample(q, 0.0, self.t)
        return np.where(found.possible, found.tau, np.nan)

    def arcs(self) -> Iterator[_Piece]:
        """Each arc between the end stops."""
        (stop_low, stop_high), rotary = self.system.stops[0], self.system.rotary[0]
        found = limits(self.mechanism)
        free = math.isinf(stop_low) and math.isinf(stop_high)
        far = loads.REACH * loads.largest_length(self.mechanism.structure)
        for arc in found.arcs:
            low, high = (min(max(end.q, -far), far) for end in (arc.start, arc.end))
            passed = [point.q for point in arc.change_points]
            if found.whole_turn and free:
                yield self._cut(low, low + (self.system.period or TURN), True, passed)
                continue
            shifts = [0]
            if rotary and not free:  # as the stops name it, any number of turns away
                a, b = max(stop_low, low - TURN), min(stop_high, high + TURN)
                shifts = [*range(math.floor((a - high) / TURN), math.ceil((b - low) / TURN) + 1)]
                if found.whole_turn:
                    low, high, shifts = a, b, [0]
            for shift in shifts:
                a, b = max(low + TURN * shift, stop_low), min(high + TURN * shift, stop_high)
                if a < b:
                    yield self._cut(a, b, False, passed)

    def _cut(self, low: float, high: float, closed: bool, passed: list[float]) -> _Piece:
        """An arc cut at the kinks of the loads and, a little aside, at change points."""
        kinks = _repeated(self.system.knots, self.system.period, low, high)
        passed = _repeated(passed, TURN if self.system.rotary[0] else None, low, high)
        aside = {q: ASIDE if any(abs(q - p) <= ASIDE for p in passed) else 0.0
                 for q in (low, high, *kinks, *passed)}  # fmt: skip
        cuts = _distinct(sorted({low, high, *kinks, *passed}), 4 * ASIDE, 0.0)
        long = not self.system.rotary[0] and high - low > 4 * self.system.span
        size, last = self.system.span if long else math.inf, len(cuts) - 2
        spans = tuple(
            Span(a + aside[a], b - aside[b], turn=True)
            if closed or 0 < i < last
            else Span(a + aside[a], b - aside[b], size=size)
            for i, (a, b) in enumerate(itertools.pairwise(cuts))
        )
        return _Piece(low, high, closed, tuple(cuts), spans)

    def series(self, span: Span) -> Series:
        """The effort by the share of a span: what the loads do is its integral."""

        def function(u: Floats) -> Floats:
            return self.effort(span.place(u)) * span.slope(u)

        edges = panels(0.0, 1.0, max(2, math.ceil((span.high - span.low) / self.system.span * 11)))
        return fit(function, edges[:-1] if len(edges) > SCANNED else edges, n=NODES)

    def roots(self, span: Span, series: Series) -> Iterator[float]:
        """Places at which the effort of the loads vanishes, to rounding."""
        broken = [] if series.resolved.all() else self._between_samples(span)
        for place in [*span.place(series.roots()).tolist(), *broken]:
            q = self._polished(place)
            if q is not None and span.low - EPS <= q <= span.high + EPS:
                yield q

    def jump(self, q: float) -> int:
        """The sign [-] of the effort beyond a place at which it jumps to the other one, else 0."""
        aside = ASIDE * np.array([-20.0, -2.0, 2.0, 20.0])
        y = self.effort(q + aside)
        settled = np.abs(y[[1, 2]]) > np.abs(y[[0, 3]]) / 2
        return int(np.sign(y[2])) if y[1] * y[2] < 0 and settled.all() else 0

    def _between_samples(self, span: Span) -> Iterator[float]:
        """Changes of sign where there is no series."""
        q = span.place(np.linspace(0.0, 1.0, 4 * SCANNED + 3)[1:-1])
        y = self.effort(q)
        for i in np.flatnonzero(y[:-1] * y[1:] < 0).tolist():
            before = y[i] > 0

            def same(x: float, before: bool = before) -> bool:
                return bool((self.effort(np.array([x]))[0] > 0) == before)

            yield bisect(same, q[i], q[i + 1])

    def _polished(self, q: float) -> float | None:
        """A root by Newton's method with the exact slope; None where it is none."""
        span = self.system.span
        for _ in range(STEPS):
            here = tangents(self.mechanism, [[q]], t=self.t)
            slope = float(here.K[0, 0, 0])
            step = -float(here.effort[0, 0]) / slope if slope else 0.0
            if not (math.isfinite(step) and here.margin[0] > 0 and abs(step) < SAME * span * 1e4):
                return None
            q += step
            if abs(step) <= 4 * EPS * max(abs(q), span):
                return q
        noise = float(self.system.rounding(np.array([q]))[0])
        small = abs(float(self.effort(np.array([q]))[0])) <= 64 * noise
        return q if small or abs(step) <= SAME * span else None


def _one_driver(line: _Line) -> Equilibria:
    mechanism, system = line.mechanism, line.system
    driver = mechanism.drivers[0]
    name, unit = mechanism.of_driver(driver, "q"), mechanism.driver_joint(driver).coordinate_unit
    has_potential = system.depends_on <= {"q", "time"}
    found: list[Equilibrium] = []
    rests: list[tuple[float, float]] = []
    balanced: list[tuple[float, float]] = []
    curves: list[Curve] = []
    for low, high, closed, cuts, spans in line.arcs():
        rows = [line.series(span) for span in spans]
        curve = _curve(line, spans, rows, has_potential)
        curves.append(curve)
        places: list[float] = []
        jumps: list[float] = []
        if np.all(np.abs(np.nan_to_num(curve.effort)) <= 8 * system.rounding(curve.q)):
            balanced.append((low, high))
        else:
            roots = [
                q for span, one in zip(spans, rows, strict=True) for q in line.roots(span, one)
            ]
            places = _distinct(sorted(roots), SAME * system.span, (high - low) * closed)
            ends = cuts[:-1] if closed else cuts[1:-1]  # dead centres are no jumps
            jumps = [q for q in ends if line.jump(q)]
        held = _held(line, low, high, closed, places)
        rests += held
        at = tangents(mechanism, np.array([*places, *jumps])[:, None], t=line.t)
        energy = _potentials(spans, rows, places) if has_potential else [None] * len(places)
        massless = at.M[:, 0, 0] <= NONE**2 * system.typical_inertia(low)
        at.M[massless] = 0.0
        found += [
            _made({name: q}, {name: unit}, at, i, energy[i], _around(q, held, closed))
            for i, q in enumerate(places)
        ]
        for i, q in enumerate(jumps, start=len(places)):
            kind: Kind = "unstable" if line.jump(q) > 0 else "stable"
            of = at.M[i], at.C[i], at.K[i]
            found.append(Equilibrium({name: q}, {name: unit}, kind, *of, np.empty(0), jump=True))
        found += _at_stops(line, name, unit, (low, high), closed)
    order = sorted(found, key=lambda e: e.q[0])
    notes = tuple(_notes(line, curves))
    return Equilibria(
        tuple(order), tuple(sorted(rests)), tuple(balanced), tuple(curves), name, unit, notes
    )


def _curve(line: _Line, spans: Sequence[Span], rows: list[Series], has_potential: bool) -> Curve:
    """The effort along an arc, and less the integral of it."""
    u = np.linspace(0.0, 1.0, max(9, SCANNED // 2 // len(spans)) + 1)
    q = np.concatenate([span.place(u) for span in spans])
    work, total = [], 0.0
    for one in rows:
        integral = _whole(one).integral()(u)
        work.append(total + integral)
        total += float(integral[-1])
    whole = -np.concatenate(work)
    potential = whole if has_potential and np.isfinite(whole).all() else None
    return Curve(q, line.effort(q), potential)


def _potentials(
    spans: Sequence[Span], rows: list[Series], places: list[float]
) -> list[float | None]:
    """Potential [J] at places of an arc, from the lowest of them."""
    from scipy.optimize import brentq

    found: list[float] = []
    total = 0.0
    for span, one in zip(spans, rows, strict=True):
        integral = _whole(one).integral()
        for q in places:
            if span.low <= q <= span.high and len(found) <= places.index(q):

                def off(u: float, span: Span = span, q: float = q) -> float:
                    return float(span.place(np.array([u]))[0]) - q

                u = (
                    brentq(off, 0.0, 1.0, xtol=EPS)
                    if off(0.0) * off(1.0) < 0
                    else float(q > span.low)
                )
                found.append(-(total + float(integral(np.array([u]))[0])))
        total += float(integral(np.array([1.0]))[0])
    lowest = min(found, default=0.0)
    made = [x - lowest if math.isfinite(x - lowest) else None for x in found]
    return made + [None] * (len(places) - len(made))


def _repeated(
    places: Iterable[float], period: float | None, low: float, high: float
) -> list[float]:
    """Places between two ends, repeated with a period if there is one."""
    found = {
        float(q + k * (period or 0.0))
        for q in places
        for k in (
            range(math.floor((low - q) / period), math.ceil((high - q) / period) + 1)
            if period
            else (0,)
        )
    }
    return sorted(q for q in found if low <= q <= high)


def _whole(one: Series) -> Series:
    """A series without the panels around a change point, which are too short to count."""
    bad = np.asarray(~np.isfinite(one.c).all(axis=1))
    if not bad.any() or np.diff(one.edges)[bad].sum() > SAME:
        return one
    return replace(one, c=np.where(bad[:, None], 0.0, one.c))


def _distinct(rising: list[float], apart: float, turn: float) -> list[float]:
    """Places without those that are said twice; of a closed arc the last is the first."""
    kept: list[float] = []
    for q in rising:
        if not kept or q - kept[-1] > apart:
            kept.append(q)
    if turn and len(kept) > 1 and kept[0] + turn - kept[-1] <= apart:
        kept.pop()
    return kept


def _made(
    at: Mapping[str, float],
    units: Mapping[str, str],
    of: Tangents,
    i: int,
    potential: float | None = None,
    interval: tuple[float, float] | None = None,
) -> Equilibrium:
    kind, values = kind_of(of.M[i], of.C[i], of.K[i])
    return Equilibrium(at, units, kind, of.M[i], of.C[i], of.K[i], values, potential, interval)


def _at_stops(
    line: _Line, name: str, unit: str, ends: tuple[float, float], closed: bool
) -> Iterator[Equilibrium]:
    """End stops that the loads push against."""
    for side, q, stop in zip((-1, 1), ends, line.system.stops[0], strict=True):
        if closed or q != stop:
            continue
        of = tangents(line.mechanism, [[q]], t=line.t)
        if -side * float(of.effort[0, 0]) > float(line.system.rounding(np.array([q]))[0]):
            none = np.empty(0)
            yield Equilibrium(
                {name: q}, {name: unit}, "stable", of.M[0], of.C[0], of.K[0], none, stop=True
            )


def _notes(line: _Line, curves: Iterable[Curve]) -> Iterator[str]:
    far = loads.REACH * loads.largest_length(line.mechanism.structure)
    ends = np.abs([q for curve in curves for q in (curve.q[0], curve.q[-1])])
    if not line.system.rotary[0] and np.isclose(ends, far).any():
        yield f"looked for from {-far:.6g} to {far:.6g} m: no group ends the travel"
    if "time" in line.system.depends_on:
        yield f"loads follow the time, which is held at {line.t:.9g} s"
    if line.system.friction is None and line.mechanism.frictional_joints:
        yield "friction of joints is left out: with it the mechanism rests in intervals"


# -- joint friction ------------------------------------------------------------------------


def _held(
    line: _Line, low: float, high: float, closed: bool, places: list[float]
) -> list[tuple[float, float]]:
    """Where friction holds the driver on an arc: both efforts that start it are against it.

    Sampled as finely as extrema are looked for, and at every equilibrium and every place where
    the effort of the loads is smallest; the ends are roots of the two efforts.
    """
    friction = line.system.friction
    if friction is None:
        return []
    u = np.linspace(0.0, 1.0, SCANNED // 2 + 1)
    q = Span(low, high, turn=closed).place(u if closed else u[1:-1])
    stops = [x for x in (low, high) if x in line.system.stops[0]]  # others are dead centres
    q = np.unique(np.concatenate([q, places, stops, _weakest(line, q)]))
    lowest, highest = friction.holding(q, line.t)
    held = (lowest <= 0) & (highest >= 0)
    held |= np.isin(q, places)  # balanced: whatever friction there is holds it
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(held & ~np.concatenate([[False], held[:-1]])).tolist():
        last = i + int(np.argmin(np.append(held[i:], False))) - 1
        start = q[i] if i == 0 else _end(line, q[i], q[i - 1])
        end = q[last] if last == len(q) - 1 else _end(line, q[last], q[last + 1])
        found.append((float(start), float(end)))
    turn = high - low
    if closed and len(found) > 1 and found[0][0] == q[0] and found[-1][1] == q[-1]:
        across = found[-1][0], found[0][1] + turn  # the seam
        found = [*found[1:-1], across]
    return found


def _weakest(line: _Line, q: Floats) -> Floats:
    """Places beside which the effort of the loads is larger on both sides."""
    y = np.abs(line.effort(q))
    least = np.concatenate([[False], (y[1:-1] <= y[:-2]) & (y[1:-1] <= y[2:]), [False]])
    i = np.flatnonzero(least)
    return np.concatenate([(q[i] + q[i - 1]) / 2, (q[i] + q[i + 1]) / 2]) if len(i) else q[:0]


def _end(line: _Line, inside: float, outside: float) -> float:
    """The last place towards one that is not held, at which friction still holds the driver."""
    from scipy.optimize import brentq

    friction = line.system.friction
    assert friction is not None
    most = sys.float_info.max**0.25  # instead of infinity, of which there is no secant

    def beyond(q: float) -> float:
        lowest, highest = (float(x[0]) for x in friction.holding(np.array([q]), line.t))
        return float(np.clip(max(lowest, -highest), -most, most))

    a, b = beyond(inside), beyond(outside)
    if not a <= 0 < b:
        return inside
    return float(brentq(beyond, inside, outside, xtol=4 * EPS, rtol=4 * EPS))


def _around(q: float, held: list[tuple[float, float]], closed: bool) -> tuple[float, float] | None:
    """The interval of rest that an equilibrium is in."""
    for low, high in held:
        for shift in (0.0, TURN, -TURN) if closed else (0.0,):
            if low - shift <= q <= high - shift:
                return low - shift, high - shift
    return None


# -- several drivers -----------------------------------------------------------------------


def _several(mechanism: Compiled, system: System, t: float, starts: int) -> Equilibria:
    """Newton's method from many places at once; steps as long as a part of the span."""
    from scipy.stats import qmc

    k, rotary = len(mechanism.drivers), np.array(system.rotary)
    ends = np.array([_range(mechanism, d) for d in mechanism.drivers])
    span = ends[:, 1] - ends[:, 0]
    points = qmc.Sobol(k, seed=np.random.default_rng(0)).random_base2(
        max(4, math.ceil(math.log2(starts * k)))
    )
    q = ends[:, 0] + points * span
    of = tangents(mechanism, q, t=t)
    alive = (of.margin > 0) & np.isfinite(of.effort).all(axis=1)
    q, size = q[alive], np.abs(of.effort[alive]).max(axis=0, initial=0.0)
    done: list[Floats] = []
    for _ in range(STEPS):
        if not len(q):
            break
        of = tangents(mechanism, q, t=t)
        good = (of.margin > 0) & np.isfinite(of.effort).all(axis=1) & np.isfinite(of.K).all((1, 2))
        q, effort, K = q[good], of.effort[good], of.K[good]
        step = np.array(
            [-np.linalg.lstsq(a, b, rcond=EPS)[0] for a, b in zip(K, effort, strict=True)]
        )
        if not len(q):
            break
        longest = (np.abs(step) / span).max(axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, 0.1 / np.maximum(longest, EPS))
        ready = longest[:, 0] <= 64 * EPS
        done += [*q[ready]]
        q = q[~ready]
    found: list[Equilibrium] = []
    names = [mechanism.of_driver(d, "q") for d in mechanism.drivers]
    units = {
        n: mechanism.driver_joint(d).coordinate_unit
        for n, d in zip(names, mechanism.drivers, strict=True)
    }
    for x in _apart(done, rotary, ends, span):
        of = tangents(mechanism, x, t=t)
        if of.margin[0] > 0 and np.all(np.abs(of.effort[0]) <= NONE * size):
            found.append(_made(dict(zip(names, x.tolist(), strict=True)), units, of, 0))
    notes = ["Newton's method from many places: more starts look closer"]
    if mechanism.frictional_joints:
        notes.append("friction of joints is left out")
    if "time" in system.depends_on:
        notes.append(f"loads follow the time, which is held at {t:.9g} s")
    return Equilibria(tuple(sorted(found, key=lambda e: e.q.tolist())), notes=tuple(notes))


def _range(mechanism: Compiled, driver: str) -> tuple[float, float]:
    """Where a driver is looked for: between its stops, a turn, its law's range, or the size."""
    scene = mechanism.scene
    low, high = scene.stops[driver].bounds if driver in scene.stops else (-math.inf, math.inf)
    law: Any = scene.drive.get(driver)
    if mechanism.driver_joint(driver).rotary:
        near = (-math.pi, math.pi)
    elif law is not None and law.by_coordinate and law.travelled[0] != law.travelled[1]:
        near = (min(law.travelled), max(law.travelled))
    else:
        size = 2 * loads.largest_length(mechanism.structure)
        near = (-size, size)
    both = math.isfinite(low) and math.isfinite(high)
    return (low, high) if both else (max(low, near[0]), min(high, near[1]))


def _apart(found: list[Floats], rotary: Any, ends: Floats, span: Floats) -> list[Floats]:
    """Places that are not the same, angles within a turn from where they were looked for."""
    kept: list[Floats] = []
    for q in found:
        q = np.where(rotary, ends[:, 0] + np.mod(q - ends[:, 0], TURN), q)
        q = np.where(rotary & (np.abs(q - ends[:, 0] - TURN) < SAME), ends[:, 0], q)
        inside = (q >= ends[:, 0] - SAME * span) & (q <= ends[:, 1] + SAME * span)

        def gap(other: Floats, q: Floats = q) -> float:
            d = np.abs(other - q)
            return float((np.where(rotary, np.minimum(d, TURN - d), d) / span).max())

        if inside.all() and all(gap(other) > SAME for other in kept):
            kept.append(q)
    return kept


@declared
def equilibria(
    mechanism: Compiled,
    *,
    friction: FrictionMethod | None = None,
    time: float | None = None,
    starts: int = STARTS,
) -> Equilibria:
    """All static equilibria: where the loads alone move nothing, and whether it stays there.

    Of one driver over its whole range between its end stops; of several by Newton's method
    from many places. Joint friction widens an equilibrium of one driver to the interval in
    which it rests.

    Parameters
    ----------
    friction : as that of a run; "none" leaves the friction of joints out
    time : [s] at which loads that follow the time are held
    starts : places for each of several drivers

    Returns
    -------
    Equilibria, a sequence of `Equilibrium`

    Raises
    ------
    RequestError where loads follow the time and none is given, or there is no driver

    >>> import blockmech as bm
    >>> mech = bm.Graph.load("graphs/watt_sixbar.json").compile()  # doctest: +SKIP
    >>> mech.equilibria().stable[0].at  # doctest: +SKIP
    """
    if not mechanism.drivers:
        raise refused("equilibria", "the mechanism has no driver", "what does not move rests")
    refuse_signals(mechanism)
    how = friction_asked(friction, None, None)
    bounds = (mechanism.scene.stops.get(d) for d in mechanism.drivers)
    stops = tuple((-math.inf, math.inf) if s is None else s.bounds for s in bounds)
    one = len(mechanism.drivers) == 1
    system = System(mechanism, stops=stops, method=how if one else None)
    if "time" in system.depends_on and time is None:
        found = "loads follow the time, so nothing stays at rest"
        raise refused("time", found, "give time=, at which they are held")
    t = 0.0 if time is None else float(time)
    if one:
        return _one_driver(_Line(mechanism, system, t))
    return _several(mechanism, system, t, starts)
