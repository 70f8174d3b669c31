r"""Panels: pieces of a motion in one direction, on Chebyshev nodes.

With v from 0 to 1 and the way from an anchor,

    q = anchor + way v^p,     w = dK/dq,     dt/dv = p |way| v^(p-1) sqrt(J / 2K)

where p = 2 at a standstill or a dead centre, so that all three are smooth in v, else 1. The
kinetic energy K is never a difference of potentials: from the anchor it is an *average* of w,
which keeps its relative accuracy where K goes to zero. All panels up to the next standstill
are arrays (m, n) that are worked on together.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev, legendre
from numpy.typing import NDArray

from blockmech.engines.kinds import Reals
from blockmech.functions.series import ended, largest
from blockmech.ground.plane import EPS

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.intp]
SMALLEST = math.ulp(0.0)  # the smallest number above zero
# Kinds of panels: a plain one, one that begins or ends with a standstill, or ends at a dead centre.
PLAIN, FROM_REST, TO_REST, TO_LIMIT = range(4)
P = np.array([1, 2, 2, 2])  # exponents of their maps
MOST = 60  # halvings of an interval: a double has no more digits
HALVINGS = range(MOST)
ROOT = math.sqrt(EPS)
NEAR = EPS ** (1 / 3) / 8  # relative, of a step of third order behind which there is rounding only


def basis(v: Any, n: int) -> Any:
    """Chebyshev polynomials (..., n) in 2 v - 1 at v (...); exact beside v = 0.

    Real parts of the powers of a number on the unit circle, whose argument is exact there; each
    half of them is the half before it times one power.
    """
    v = np.asarray(v)
    flat = v.ravel()
    z = (2 * flat - 1) + 2j * np.sqrt(flat * (1 - flat))
    columns = np.empty((n, flat.size), dtype=z.dtype)  # places side by side: most are many
    columns[0] = 1
    done = 1
    while done < n:
        more = min(done, n - done)
        np.multiply(columns[:more], z, out=columns[done : done + more])
        z, done = z * z, 2 * done
    return np.ascontiguousarray(columns.real.T).reshape(*v.shape, n)


def node_places(n: int, kind: Any = np.float64) -> Any:
    """n nodes v_i = sin^2((i + 1/2) pi / 2n), small ones to full relative accuracy."""
    return np.sin((np.arange(n) + kind(0.5)) * (2 * np.arctan(kind(1)) / n)) ** 2


class Rule(NamedTuple):
    """n nodes v on (0, 1), and what turns values there into integrals.

    v : (n,) the nodes
    powers : (4, n) v^(p-1) at the nodes, for each kind of panel
    to_series : (n, n) values -> Chebyshev coefficients in 2 v - 1
    average : (n + 1, n) values -> averages over [0, v_i], and [0, 1]
    energy : (4, n + 1, n) w -> K per unit of way at the nodes and at the end that is not known,
        for each kind of panel. Towards a dead centre 2 v w is smooth, not w
    clock : (n + 1, n) coefficients of a series -> those of its integral from v = 0
    known : (n + 1, n + 2) polynomials at 0, the nodes, and 1
    since : (n, n + 2) coefficients of a series -> its integrals from v = 0 to there
    leads : (4, n + 2) v^(p-1) there, for each kind of panel
    whole : (n,) coefficients of a series -> its integral over [0, 1]
    slopes : (n, n) values -> those of the derivative by v
    known_first : (n + 1,) the nodes, and 0
    shares : (4, n + 1) v^p there, for each kind of panel
    at_zero : (n,) polynomials at 0
    slope : (n, n) coefficients of a series -> those of its derivative by v
    """

    v: Floats
    powers: Floats
    to_series: Floats
    average: Floats
    energy: Floats
    clock: Floats
    known: Floats
    since: Floats
    leads: Floats
    whole: Floats
    slopes: Floats
    known_first: Floats
    shares: Floats
    at_zero: Floats
    slope: Floats


@cache
def rule(n: int) -> Rule:
    """The rule with n nodes.

    Its matrices are made in extended precision, where the machine has it: the angle of the
    polynomial k is rounded k times as much as that of the first.
    """
    v = node_places(n, np.longdouble)
    to_series = basis(v, n).T * (2 / np.longdouble(n))
    to_series[0] /= 2
    x, weights = _gauss(n + 1)
    s = (x + 1) / 2
    ends = np.append(v, 1)[:, None]
    values = basis(ends * s, n)  # (n + 1, gauss, n)

    def average(p: int) -> Any:
        return np.einsum("g,igk->ik", weights / 2 * p * s ** (p - 1), values) @ to_series

    plain, rest = ends * average(1), ends**2 * average(2)
    limit = (plain - plain[-1]) * (2 * v)
    limit[-1] = -plain[-1] * (2 * v)
    places = np.concatenate([[0], v, [1]])
    clock = np.asarray(chebyshev.chebint(np.eye(n), lbnd=-1) / 2)
    slope = np.vstack([chebyshev.chebder(np.eye(n)) * 2, np.zeros(n)])

    def narrow(x: Any) -> Floats:
        return np.asarray(x, dtype=np.float64)

    known = np.ascontiguousarray(narrow(basis(places, n + 1)).T)
    return Rule(
        narrow(v),
        narrow(v ** (P[:, None] - 1)),
        narrow(to_series),
        narrow(average(1)),
        narrow([plain, rest, rest, limit]),
        clock,
        known,
        clock.T @ known,
        narrow(places ** (P[:, None] - 1)),
        clock.sum(axis=0),
        narrow(basis(v, n) @ slope @ to_series),
        narrow(np.append(v, 0)),
        narrow(np.append(v, 0) ** P[:, None]),
        narrow((-1.0) ** np.arange(n)),
        slope,
    )


def _gauss(n: int) -> tuple[Any, Any]:
    """Places and weights of Gauss's rule on [-1, 1], by a step of Newton's from NumPy's."""
    p = np.zeros(n + 1, dtype=np.longdouble)
    p[-1] = 1
    x, slope = legendre.leggauss(n)[0].astype(np.longdouble), legendre.legder(p)
    x = x - legendre.legval(x, p) / legendre.legval(x, slope)
    return x, 2 / ((1 - x * x) * legendre.legval(x, slope) ** 2)


def leading(good: NDArray[np.bool_]) -> int:
    """How many of (m,) are true before the first that is not."""
    return len(good) if good.all() else int(good.argmin())


def roots(series: Floats) -> Floats:
    """Places v in [0, 1] at which a series in 2 v - 1 is zero, ascending.

    Coefficients that are rounding are left out: they would make roots of their own.
    """
    kept = chebyshev.chebtrim(series, EPS * float(np.abs(series).max()))
    if kept.size < 2:
        return np.empty(0)
    zeros = chebyshev.chebroots(kept)
    near = math.sqrt(EPS)  # a double root comes as a pair that is apart by that much
    real = zeros.real[(np.abs(zeros.imag) <= near) & (np.abs(zeros.real) <= 1 + near)]
    return np.sort((np.clip(real, -1.0, 1.0) + 1) / 2)


class Spans:
    """Where panels lie.

    begin, end : (m,) [rad or m]
    energy : (m,) [J] at the anchor, or at v = 1 where the anchor is a dead centre
    kind : (m,)
    backward : (m,) whether the anchors are where they end
    anchor, way : (m,) [rad or m] the places v = 0, and from there to v = 1
    """

    def __init__(self, begin: Floats, end: Floats, energy: Floats, kind: Ints) -> None:
        self.begin, self.end, self.energy, self.kind = begin, end, energy, kind
        self.backward: NDArray[np.bool_] = kind >= TO_REST
        self.anchor: Floats = begin.copy()
        self.way: Floats = end - begin
        for i in self.backward.nonzero()[0].tolist():  # few, if any
            self.anchor[i], self.way[i] = end[i], -self.way[i]

    def some(self, which: Any, more: Any = 0.0) -> Spans:
        """Those of a slice or of indices (k,), each with more kinetic energy (k,) [J]."""
        return Spans(
            self.begin[which], self.end[which], self.energy[which] + more, self.kind[which]
        )

    def places(self, v: Floats) -> Floats:
        """Driver coordinates (m, k) of v (k,)."""
        ways = np.where(self.kind[:, None] == PLAIN, v, v * v)
        return np.asarray(self.anchor[:, None] + self.way[:, None] * ways)

    def slopes(self, n: int) -> Floats:
        """dK/dw (m, n + 1, n) at the nodes, and at the end that is not known."""
        return np.asarray(self.way[:, None, None] * rule(n).energy[self.kind])

    def gains(self, w: Floats) -> Floats:
        """[J] (m, n + 1) by which w = dK/dq (m, n) raises K at the nodes and that end."""
        energy = rule(w.shape[1]).energy
        gains: Floats = w @ energy[PLAIN].T
        for i in self.kind.nonzero()[0].tolist():  # few, if any
            gains[i] = energy[self.kind[i]] @ w[i]
        gains *= self.way[:, None]
        return gains


def moment(
    n: int, v: Reals, rate: Reals, times: Reals, slopes: Reals, clock: Reals, t: float, at: Reals
) -> None:
    """Where a panel is at a time t [s] since its anchor, by Newton's method within a bracket.

    Of the language of `blockmech.engines.loops`; run by Python it takes lists, which are quicker.

    v, times, slopes : (n + 2,) the anchor, the nodes and the end; times and dt/dv there
    rate, clock : (n,) and (n + 1,) coefficients of dt/dv and of the time since the anchor
    at : v and dt/dv there, as found
    """
    j = 0
    while j < n and times[j + 1] <= t:
        j += 1
    h, dv = max(times[j + 1] - times[j], SMALLEST), v[j + 1] - v[j]
    s = (t - times[j]) / h
    left, right = h / max(slopes[j], SMALLEST) - dv, h / max(slopes[j + 1], SMALLEST) - dv
    x = v[j] + s * (dv + (1.0 - s) * ((1.0 - s) * left - s * right))
    low, high, slope = v[j], v[j + 1], 0.0
    x, settled = min(max(low, x), high) if t > 0.0 else low, t == 0.0
    for _ in range(MOST):
        y, a, b, d, e = 2.0 * x - 1.0, clock[n], 0.0, 0.0, 0.0
        for k in range(n - 1, 0, -1):
            a, b = clock[k] + 2.0 * y * a - b, a
            d, e = rate[k] + 2.0 * y * d - e, d
        slope = rate[0] + y * d - e
        if settled:
            break
        miss = clock[0] + y * a - b - t
        if miss > 0.0:
            high = x
        else:
            low = x
        new, near = x - miss / slope if slope > 0.0 else -1.0, ROOT / 8.0 * x + EPS
        inside = new >= low - near and new <= high + near  # but for rounding
        new = min(max(new, low), high) if inside else (low + high) / 2.0
        settled = inside and abs(new - x) <= near
        x = new
    at[0], at[1] = x, slope


def span(begin: float, end: float, energy: float, kind: int = PLAIN) -> Spans:
    """A single one."""
    return Spans(*map(np.atleast_1d, (begin, end, energy, kind)))


def begin_energies(K: float, gains: Floats, more: Any) -> Floats:
    """[J] (m,) at the begin of panels in a row, of the first K; each leaves some more."""
    energies = np.empty(len(gains))
    energies[0], energies[1:] = K, K + (gains[:, -1] + more)[:-1].cumsum()
    return energies


def to_and_fro(way: Any, w: Floats) -> Any:
    """Work [J] (m,) that dK/dq (m, n) does over ways (m,), all of one sign."""
    return np.abs(way) / w.shape[1] * np.abs(w).sum(axis=1)


@dataclass(frozen=True)
class Panels:
    """Panels that follow each other, m of them with n nodes each.

    t0 : [s] when the first begins
    w, J : (m, n) dK/dq and inertia at the nodes
    K : (m, n + 1) [J] kinetic energy there, and at the end that is not known
    second : (m, s, n + 1) place data of a second sampling at the nodes and the anchor
    """

    t0: float
    spans: Spans
    w: Floats
    K: Floats
    J: Floats
    second: Floats

    @cached_property
    def rate(self) -> Floats:
        """Chebyshev coefficients (m, n) of dt/dv."""
        r, kind = rule(self.w.shape[1]), self.spans.kind
        with np.errstate(all="ignore"):
            slope = np.sqrt(self.J / (2 * self.K[:, :-1])) * r.powers[kind]
        return np.asarray((slope @ r.to_series.T) * (P[kind] * np.abs(self.spans.way))[:, None])

    @cached_property
    def clock(self) -> Floats:
        """Coefficients (m, n + 1) of the time since v = 0."""
        times: Floats = self.rate @ rule(self.w.shape[1]).clock.T
        return times

    @cached_property
    def durations(self) -> Floats:
        """(m,) [s] that each takes."""
        return np.asarray(self.rate @ rule(self.w.shape[1]).whole)

    def durations_with(self, energies: Floats) -> Floats:
        """(k, m) [s] that each takes with so much more kinetic energy (k,) [J]."""
        r, kind, way = rule(self.w.shape[1]), self.spans.kind, np.abs(self.spans.way)[:, None]
        weights = r.average[-1] * r.powers[kind] * P[kind][:, None] * way * np.sqrt(self.J / 2)
        durations = weights / np.sqrt(self.K[:, :-1] + energies[:, None, None])
        return np.asarray(durations.sum(axis=2))

    def lasting(self, energies: Floats) -> Floats:
        """(k,) [s] that all of them take with so much more kinetic energy (k,) [J]."""
        return np.asarray(self.durations_with(energies).sum(axis=1))

    @cached_property
    def since(self) -> Floats:
        """(m + 1,) [s] after the first begins: when they begin, and when the last ends."""
        since = np.empty(len(self.w) + 1)
        since[0], since[1:] = 0.0, self.durations.cumsum()
        return since

    @property
    def times(self) -> Floats:
        """(m + 1,) [s] when that is."""
        return self.t0 + self.since

    @property
    def begin(self) -> float:
        """[rad or m] where the first begins."""
        return float(self.spans.begin[0])

    @property
    def t1(self) -> float:
        """[s] when the last ends."""
        return self.t0 + float(self.since[-1])

    @property
    def size(self) -> float:
        """[J] of all the work to and fro."""
        return float(to_and_fro(self.spans.way, self.w).sum())

    def at_end(self) -> tuple[float, float]:
        """Place [rad or m] and kinetic energy [J] at the end of the last."""
        q = float(self.spans.end[-1])
        return q, 0.0 if self.spans.kind[-1] == TO_REST else max(float(self.K[-1, -1]), 0.0)

    def taken_from(self, t0: float, energy: float = 0.0) -> Panels:
        """The same panels at another time and with more kinetic energy [J]."""
        if energy:
            return replace(self.some(slice(None), energy), t0=t0)
        panels = object.__new__(type(self))
        panels.__dict__.update(self.__dict__, t0=t0)
        return panels

    def first(self, count: int) -> Panels:
        """The first ones of them."""
        return self if count == len(self.w) else self.some(slice(count))

    def some(self, which: Any, energy: Any = 0.0) -> Panels:
        """Those of a slice or of indices (k,), each with more kinetic energy (k,) [J]."""
        K = self.K[which] + np.asarray(energy)[..., None]
        rows = self.w[which], K, self.J[which], self.second[which]
        return Panels(self.t0, self.spans.some(which, energy), *rows)

    def followed_by(self, row: Sequence[Panels]) -> Panels:
        """These and those of a row as one."""
        whole = (self, *row)
        places = (p.spans for p in whole)
        columns = zip(*((x.begin, x.end, x.energy, x.kind) for x in places), strict=True)
        spans = Spans(*map(np.concatenate, columns))
        names = ("w", "K", "J", "second")
        parts = (np.concatenate([getattr(p, name) for p in whole]) for name in names)
        return Panels(self.t0, spans, *parts)

    @property
    def other(self) -> Any:
        """The second run's, where it went beside them; else None."""
        return None

    def smooth(self, J0: Floats, tolerance: float, efforts: Any) -> NDArray[np.bool_]:
        """Whether the time of each (m,) is smooth enough for its nodes.

        J0 : (m,) at the anchors. Of a plain panel dt/dv begins with the rate that is known
        there, else a layer hides between the nodes.
        efforts : (m,) the largest [N m or N], whose rounding the energy cannot be smoother than
        """
        r, kind, way = rule(self.w.shape[1]), self.spans.kind, np.abs(self.spans.way)
        K, sizes = self.K[:, :-1], largest(self.rate)
        with np.errstate(all="ignore"):
            doubt = (r.shares[kind, :-1] / K).max(axis=1) * way
            known = way * np.sqrt(J0 / (2 * self.spans.energy))
        good = (K.min(axis=1) > 0) & (ended(*sizes) <= np.maximum(tolerance, EPS * efforts * doubt))
        left = len(r.v) * np.maximum(sizes[0], tolerance * sizes[2])
        fits = np.abs(self.rate @ r.at_zero - known) <= left
        return np.asarray(good & (fits | (kind != PLAIN)))

    # -- the state at a time -------------------------------------------------------

    @cached_property
    def _series(self) -> Floats:
        """Coefficients (m, 4, n + 1) of the time since v = 0 and its derivatives by v."""
        m, n = self.rate.shape
        series, by_v = np.zeros((m, 4, n + 1)), rule(n).slope.T
        series[:, 0], series[:, 1, :n] = self.clock, self.rate
        series[:, 2, :n] = self.rate @ by_v
        series[:, 3, :n] = series[:, 2, :n] @ by_v
        return series

    @cached_property
    def _known(self) -> tuple[Floats, Floats, Floats]:
        """v (n + 2,) of the anchor, the nodes and the end, times (m, n + 2) since v = 0, dt/dv."""
        r = rule(self.w.shape[1])
        return r.leads[TO_REST], self.rate @ r.since, self.rate @ r.known[:-1]

    def _near(self, i: Ints, since: Floats) -> Floats:
        """v (k,) of panels i some time (k,) from their anchors, by cubics between known places."""
        v, times, slope = self._known
        times, each = times[i], np.arange(len(i))
        j = np.minimum(np.maximum((times <= since[:, None]).sum(axis=1) - 1, 0), len(v) - 2)
        begin, rate = times[each, j], np.maximum(slope[i, [j, j + 1]], SMALLEST)
        h, dv = np.maximum(times[each, j + 1] - begin, SMALLEST), v[j + 1] - v[j]
        s = (since - begin) / h
        bend = (1 - s) * (h / rate[0] - dv) - s * (h / rate[1] - dv)
        near = v[j] + s * (dv + (1 - s) * bend)
        return np.asarray(np.fmin(np.fmax(near, v[j]), v[j + 1]))

    @np.errstate(all="ignore")
    def _found(self, i: Ints, since: Floats) -> tuple[Floats, Floats]:
        """In panels i (k,), some time (k,) [s] from their anchors: v and dt/dv.

        By Newton's method kept within a bracket.
        """
        duration = self.durations[i]
        since = np.minimum(np.maximum(since, 0.0), duration)
        series = self._series[i]
        v = self._near(i, since)
        low, high = np.zeros(since.shape), np.ones(since.shape)
        for _ in HALVINGS:
            known = series @ basis(v, series.shape[2])[..., None]
            time, slope, rise, bend = known[..., 0].T
            miss = time - since
            low, high = np.where(miss <= 0, v, low), np.where(miss >= 0, v, high)
            step = miss / slope
            step /= 1 - step * rise / (2 * slope)  # Halley's step: of third order
            new, near = v - step, NEAR * v + EPS
            inside = (new >= low - near) & (new <= high + near)  # but for rounding
            new = np.where(inside, np.minimum(np.maximum(new, low), high), (low + high) / 2)
            new[since == 0] = 0.0  # the anchor is known exactly
            step, v = new - v, new
            if ((np.abs(step) <= near) & (inside | (since == 0))).all():
                break  # the next one is below rounding
        return v, slope + step * (rise + step / 2 * bend)

    def _at(self, t: Any) -> tuple[Ints, Floats]:
        """At times (k,) [s]: which panels, and the time since or until their anchors."""
        i = np.searchsorted(self.times[1:-1], t, "right")
        return i, np.where(self.spans.backward[i], self.times[i + 1] - t, t - self.times[i])

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (k,) at times (k,) [s]; after the end those of the end."""
        i, since = self._at(t)
        return self.state_in(i, since)

    def at(self, t: float) -> tuple[float, float]:
        """`state` at one time: quicker than by arrays."""
        i, x, slope = self._moment(t)
        kind, way = int(self.spans.kind[i]), float(self.spans.way[i])
        lead, by_v = (1.0, way) if kind == PLAIN else (x, 2.0 * way)
        speed = by_v * lead / slope if slope > 0.0 else 0.0
        q = float(self.spans.anchor[i]) + way * x * lead
        return q, -speed if kind >= TO_REST else speed

    def _moment(self, t: float) -> tuple[int, float, float]:
        """The panel in which a time [s] is, its v and its dt/dv there."""
        starts, (v, *known) = self.times.tolist(), self._known
        i = bisect_right(starts, t, 1, len(starts) - 1) - 1
        times, slopes = (x[i].tolist() for x in known)
        since = starts[i + 1] - t if self.spans.backward[i] else t - starts[i]
        rate, clock, at = self.rate[i].tolist(), self.clock[i].tolist(), [0.0, 0.0]
        since = min(max(since, 0.0), times[-1])
        moment(len(rate), v.tolist(), rate, times, slopes, clock, since, at)  # type: ignore[arg-type]
        return i, at[0], at[1]

    def state_in(self, i: Ints, since: Floats, energy: Any = 0.0) -> tuple[Floats, Floats]:
        """The same in panels i (k,), so long since or until their anchors, with more energy."""
        if np.ndim(energy):
            return self.some(i, energy).state_in(np.arange(len(i)), since)
        v, slope = self._found(i, since)
        kind, way = self.spans.kind[i], self.spans.way[i]
        lead = np.where(kind == PLAIN, 1.0, v)
        with np.errstate(all="ignore"):
            speed = np.where(slope > 0, P[kind] * way * lead / slope, 0.0)
        return self.spans.anchor[i] + way * v * lead, np.where(
            self.spans.backward[i], -speed, speed
        )

    @property
    def known_times(self) -> Floats:
        """(m, n + 2) [s] at the anchors, nodes and ends."""
        since, times = self._known[1], self.times
        known = times[:-1, None] + since
        for i in self.spans.backward.nonzero()[0].tolist():  # few, if any
            known[i] = times[i + 1] - since[i]
        return np.asarray(known)

    @property
    def known_rates(self) -> Floats:
        """Rates (m, n + 2) of the driver there."""
        slope = self._known[2]
        lead = rule(self.w.shape[1]).leads[self.spans.kind]
        way = self.spans.way[:, None]
        passes = np.where(self.spans.backward, -1, 1) * P[self.spans.kind]
        return np.asarray(passes[:, None] * way * lead / np.where(slope > 0, slope, math.inf))

    def one_way(self) -> list[slice]:
        """Those between two standstills each."""
        kind = self.spans.kind
        ends = np.flatnonzero((kind[:-1] == TO_REST) | (kind[1:] == FROM_REST)) + 1
        return list(map(slice, [0, *ends.tolist()], [*ends.tolist(), len(kind)]))

    def at_place(self, q: float) -> float:
        """Time [s] at which they pass a place."""
        begin, end = self.spans.begin[0], self.spans.end
        i = min(int(np.searchsorted(np.abs(end - begin), abs(q - begin))), len(end) - 1)
        share = min(abs((q - self.spans.anchor[i]) / self.spans.way[i]), 1.0)
        v = np.array([share if self.spans.kind[i] == PLAIN else math.sqrt(share)])
        since = float((basis(v, self.clock.shape[1]) @ self.clock[i])[0])
        return float(self.times[i + 1] - since if self.spans.backward[i] else self.times[i] + since)


def joined(row: Sequence[Panels]) -> Panels:
    """Panels that follow each other as one."""
    return row[0].followed_by(row[1:]) if len(row) > 1 else row[0]
