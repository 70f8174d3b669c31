r"""Panels: the two ingredients of the path method, on Chebyshev nodes.

`PlaceData` holds what depends on the place alone (inertia, effort, margin; with joint friction
the responses of the force pass) as Chebyshev series over a piece of the driver's path. It is
sampled once; whatever runs there, how often and in which direction, needs no further kernel
call.

`Panel` is a piece of the motion: with v from 0 to 1 and the way u from its anchor,

    u = L v^p,     w = dK/du,     dt/dv = p L v^(p-1) sqrt(J / 2K)

where p = 2 at a standstill or a dead centre, so that all three are smooth in v, else 1. The
kinetic energy K is never a difference of potentials: from the anchor it is an *average* of w,
which keeps its relative accuracy where K goes to zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from blockmech.series import tail

Floats: TypeAlias = NDArray[np.float64]
EPS = float(np.finfo(float).eps)
NOTHING = 64 * EPS  # of a margin or of the usual inertia: what rounding of a pose leaves of zero
SMALLEST = 5e-324  # the smallest number above zero


class Rule(NamedTuple):
    """n nodes v on (0, 1), and what turns values there into integrals.

    to_series : (n, n) values -> Chebyshev coefficients in 2 v - 1
    average : p -> (n, n) averages over [0, v_i] with weight p s^(p-1)
    whole : p -> (n,) the same over [0, 1]
    integral : (n + 1, n) coefficients of a series -> those of its integral from v = 0
    """

    v: Floats
    to_series: Floats
    average: dict[int, Floats]
    whole: dict[int, Floats]
    integral: Floats


def basis(v: Floats, n: int) -> Floats:
    """Chebyshev polynomials (m, n) in 2 v - 1 at v (m,); exact beside v = 0.

    By the angle: v = sin^2(a / 2), and T_k(2 v - 1) = (-1)^k cos k a.
    """
    found: Floats = np.cos(np.multiply.outer(2 * np.arcsin(np.sqrt(v)), np.arange(n)))
    found[..., 1::2] *= -1
    return found


@cache
def rule(n: int) -> Rule:
    """The rule with n nodes; v_i = sin^2((i + 1/2) pi / 2n), small ones to full accuracy.

    Its matrices are made in extended precision, where the machine has it: the angles of the
    polynomial k are rounded k times as much as those of the first.
    """
    half = 2 * np.arctan(np.longdouble(1)) / n
    v = np.sin((np.arange(n) + np.longdouble(0.5)) * half) ** 2
    to_series = basis(v, n).T * (2 / np.longdouble(n))
    to_series[0] /= 2
    x, weights = leggauss(n + 1)
    s = (x.astype(np.longdouble) + 1) / 2
    values = basis(np.append(v, 1)[:, None] * s, n)  # (n + 1, gauss, n)
    average: dict[int, Floats] = {}
    whole: dict[int, Floats] = {}
    for p in (1, 2):
        rows = np.einsum("g,igk->ik", weights / 2 * p * s ** (p - 1), values) @ to_series
        average[p], whole[p] = rows[:-1].astype(float), rows[-1].astype(float)
    integral: Floats = np.asarray(chebyshev.chebint(np.eye(n), lbnd=-1) / 2)
    return Rule(v.astype(float), to_series.astype(float), average, whole, integral)


def roots(series: Floats) -> Floats:
    """Places v in [0, 1] at which a series in 2 v - 1 is zero, ascending.

    Coefficients that are rounding are left out: they would make roots of their own.
    """
    kept = chebyshev.chebtrim(series, EPS * float(np.abs(series).max()))
    if kept.size < 2:
        return np.empty(0)
    found = chebyshev.chebroots(kept)
    near = math.sqrt(EPS)  # a double root comes as a pair that is apart by that much
    real = found.real[(np.abs(found.imag) <= near) & (np.abs(found.real) <= 1 + near)]
    return np.sort((np.clip(real, -1.0, 1.0) + 1) / 2)


@dataclass(frozen=True)
class PlaceData:
    """Series over a piece of the path from low to high [rad or m].

    limit : -1 or +1 where the low or the high end is a dead centre, else 0. The series are
        then in v, (way to the limit) = (high - low) v^2, and J v^2 and tau v stand for J and
        tau, which grow without bound
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
        found: Floats = self.rows @ rule(self.rows.shape[1]).to_series.T
        return found

    @cached_property
    def tail(self) -> float:
        """What the series leave out, of the worst row."""
        rows = np.delete(self.series, 2, axis=0)  # the smallest of several margins has kinks
        left = tail(rows)
        return float(np.max(np.where(left <= self.noise, 0.0, left)))

    @property
    def noise(self) -> float:
        """Relative rounding of rates and inertia: a margin m is exact to rounding, they to 1/m."""
        least = float(self.rows[2].min())
        return NOTHING / least if least > 0 else math.inf

    def places(self, n: int) -> Floats:
        """Driver coordinates of n nodes."""
        return nodes(self.low, self.high, self.limit, n)

    def variable(self, q: Floats) -> Floats:
        """v in [0, 1] at places q."""
        if self.limit > 0:
            return np.sqrt(np.maximum(self.high - q, 0.0) / self.length)
        if self.limit < 0:
            return np.sqrt(np.maximum(q - self.low, 0.0) / self.length)
        return np.clip((q - self.low) / self.length, 0.0, 1.0)

    def at(self, q: Floats) -> Floats:
        """All rows (r, m) at places (m,) inside."""
        v = self.variable(q)
        found: Floats = self.series @ basis(v, self.series.shape[1]).T
        if self.limit:
            v = np.maximum(v, math.sqrt(SMALLEST))
            found[0] /= v * v
            found[1] /= v
        return found

    def place(self, v: Floats) -> Floats:
        """Driver coordinates of values v of the series' variable."""
        if self.limit > 0:
            return np.asarray(self.high - self.length * v * v)
        if self.limit < 0:
            return np.asarray(self.low + self.length * v * v)
        return np.asarray(self.low + self.length * v)

    def zeros(self, row: int) -> Floats:
        """Places at which a row is zero, ascending."""
        values = self.rows[row]
        if np.abs(np.sign(values).sum()) == values.size and np.ptp(values) < np.abs(values).min():
            return np.empty(0)
        return np.sort(self.place(roots(self.series[row])))

    def touches(self, row: int, level: float) -> list[float]:
        """Places at which a row that is not negative comes down to a level, or nearly.

        A series of n terms that touches zero is, by Bernstein's inequality, below
        (pi / 8)^2 / 2 of its largest value at one of 4 n nodes; only then its minima are found.
        """
        series = self.series[row]
        values = _finer(series.size) @ series
        if values.min() > (math.pi / 8) ** 2 / 2 * np.abs(values).max():
            return []
        v = np.concatenate([[0.0], roots(chebyshev.chebder(series)), [1.0]])
        found: list[float] = self.place(v[basis(v, series.size) @ series <= level]).tolist()
        return found


@cache
def _finer(n: int) -> Floats:
    """Values at 4 n nodes from n coefficients."""
    v: Floats = np.sin((np.arange(4 * n) + 0.5) * math.pi / (8 * n)) ** 2
    return basis(v, n)


def nodes(low: float, high: float, limit: int, n: int) -> Floats:
    """Nodes (n,) of a piece; towards a limit in v^2, see `PlaceData`."""
    v = rule(n).v
    length = high - low
    if limit > 0:
        return np.asarray(high - length * v * v)
    if limit < 0:
        return np.asarray(low + length * v * v)
    return np.where(v < 0.5, low + length * v, high - length * v[::-1])


@dataclass(frozen=True)
class Panel:
    """A piece of the motion in one direction.

    t0 : [s] when it begins
    q0, q1 : [rad or m] where it begins and ends
    K0, K1 : [J] kinetic energy there
    p : exponent of the map
    backward : whether v is measured from its end
    w, K, J : (n,) dK/du along the motion, kinetic energy and inertia at the nodes
    """

    t0: float
    q0: float
    q1: float
    K0: float
    K1: float
    p: int
    backward: bool
    w: Floats
    K: Floats
    J: Floats

    @cached_property
    def rate(self) -> Floats:
        """Chebyshev coefficients (n,) of dt/dv."""
        r = rule(self.w.size)
        with np.errstate(all="ignore"):
            slope = self.p * r.v ** (self.p - 1) * np.sqrt(self.J / (2 * self.K))
        found: Floats = r.to_series @ (abs(self.q1 - self.q0) * slope)
        return found

    def faster(self, energy: float, t: float) -> Panel:
        """The same piece of the path at another time and with more kinetic energy [J]."""
        K0, K1 = self.K0 + energy, self.K1 + energy
        return replace(self, t0=t, K0=K0, K1=K1, K=self.K + energy)

    @cached_property
    def clock(self) -> Floats:
        """Coefficients of the time since v = 0."""
        found: Floats = rule(self.w.size).integral @ self.rate
        return found

    @cached_property
    def duration(self) -> float:
        """[s]"""
        return float(self.clock.sum())

    @property
    def t1(self) -> float:
        """[s] when it ends."""
        return self.t0 + self.duration

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (m,) at times (m,) [s] within it."""
        since = self.t1 - t if self.backward else t - self.t0
        v, slope = self._moved(np.clip(since, 0.0, self.duration))
        way = self.q1 - self.q0
        u = way * v**self.p
        q = self.q1 - u if self.backward else self.q0 + u
        with np.errstate(all="ignore"):
            qd = np.where(slope > 0, self.p * way * v ** (self.p - 1) / slope, 0.0)
        return q, qd

    @cached_property
    def _timed(self) -> tuple[Floats, Floats, Floats]:
        """Times since v = 0 and v at the nodes and ends; coefficients (n + 1, 2) of t and dt/dv."""
        r = rule(self.w.size)
        both = np.stack([self.clock, np.append(self.rate, 0.0)], axis=1)
        v = np.concatenate([[0.0], r.v, [1.0]])
        times = basis(v, self.w.size + 1) @ both[:, 0]
        return np.maximum.accumulate(times), v, both

    def _moved(self, since: Floats) -> tuple[Floats, Floats]:
        """v and dt/dv at times since v = 0, by Newton's method kept within a bracket."""
        times, at_nodes, both = self._timed
        v = np.interp(since, times, at_nodes)
        low, high = np.zeros(since.shape), np.ones(since.shape)
        for _ in range(60):  # bisection alone would end then
            found, slope = (basis(v, self.w.size + 1) @ both).T
            miss = found - since
            if (np.abs(miss) <= 2 * EPS * since).all():
                break
            low, high = np.where(miss <= 0, v, low), np.where(miss >= 0, v, high)
            with np.errstate(all="ignore"):
                new = v - miss / slope
            new = np.where((new >= low) & (new <= high), new, (low + high) / 2)
            if (np.abs(new - v) <= 4 * EPS * v).all():
                v = new
                break
            v = new
        return v, basis(v, self.w.size + 1) @ both[:, 1]

    def at_place(self, q: float) -> float:
        """Time [s] at which it passes a place."""
        way = self.q1 - self.q0
        share = (self.q1 - q) / way if self.backward else (q - self.q0) / way
        v = min(max(share, 0.0), 1.0) ** (1 / self.p)
        since = float((basis(np.array([v]), self.w.size + 1) @ self.clock)[0])
        return self.t1 - since if self.backward else self.t0 + since


Work: TypeAlias = Callable[[Floats, Floats], Floats]
"""dK/du at nodes of which the inertia is known: (K, indices of nodes) -> w."""


class Solved(NamedTuple):
    """dK/du on a panel's nodes, and the energy there."""

    w: Floats
    K: Floats
    G: Floats  # (n, n) dK/dw


def energies(
    n: int, p: int, length: float, backward: bool, limit: bool, K_known: float, w: Floats
) -> Floats:
    """Kinetic energy at the nodes from w = dK/du; K_known at the anchor, or before a limit."""
    found: Floats = K_known + slopes(n, p, length, backward, limit) @ w
    return found


@cache
def _slopes(n: int, p: int, backward: bool, limit: bool) -> Floats:
    r = rule(n)
    if limit:  # u from the limit, K known at v = 1; 2 v w is smooth
        inner = r.v[:, None] * r.average[1] * (2 * r.v)
        return np.asarray(r.whole[1] * (2 * r.v) - inner)
    sign = -1.0 if backward else 1.0
    return np.asarray(sign * (r.v**p)[:, None] * r.average[p])


def slopes(n: int, p: int, length: float, backward: bool, limit: bool) -> Floats:
    """dK/dw (n, n) of a panel."""
    return length * _slopes(n, p, backward, limit)


def final_energy(
    n: int, p: int, length: float, backward: bool, limit: bool, K_known: float, w: Floats
) -> float:
    """Kinetic energy at the end of the panel that is not the anchor (at the limit: there)."""
    r = rule(n)
    if limit:
        return K_known + length * float(r.whole[1] @ (2 * r.v * w))
    sign = -1.0 if backward else 1.0
    return K_known + sign * length * float(r.whole[p] @ w)
