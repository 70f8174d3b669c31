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
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from blockmech.plane import EPS
from blockmech.series import tail

Floats: TypeAlias = NDArray[np.float64]
NOTHING = 64 * EPS  # of a margin or of the usual inertia: what rounding of a pose leaves of zero
SMALLEST = 5e-324  # the smallest number above zero


def basis(v: Any, n: int) -> Any:
    """Chebyshev polynomials (m, n) in 2 v - 1 at v (m,); exact beside v = 0.

    By the angle: v = sin^2(a / 2), and T_k(2 v - 1) = (-1)^k cos k a.
    """
    found = np.cos(np.multiply.outer(2 * np.arcsin(np.sqrt(v)), np.arange(n)))
    found[..., 1::2] *= -1
    return found


def node_places(n: int, kind: Any = np.float64) -> Any:
    """n nodes v_i = sin^2((i + 1/2) pi / 2n), small ones to full relative accuracy."""
    return np.sin((np.arange(n) + kind(0.5)) * (2 * np.arctan(kind(1)) / n)) ** 2


class Rule(NamedTuple):
    """n nodes v on (0, 1), and what turns values there into integrals.

    v : (n,) the nodes
    to_series : (n, n) values -> Chebyshev coefficients in 2 v - 1
    average : p -> (n + 1, n) averages over [0, v_i], and [0, 1], with weight p s^(p-1)
    clock : (n + 1, n) coefficients of a series -> those of its integral from v = 0
    """

    v: Floats
    to_series: Floats
    average: dict[int, Floats]
    clock: Floats


@cache
def rule(n: int) -> Rule:
    """The rule with n nodes.

    Its matrices are made in extended precision, where the machine has it: the angle of the
    polynomial k is rounded k times as much as that of the first.
    """
    v = node_places(n, np.longdouble)
    to_series = basis(v, n).T * (2 / np.longdouble(n))
    to_series[0] /= 2
    x, weights = leggauss(n + 1)
    s = (x.astype(np.longdouble) + 1) / 2
    values = basis(np.append(v, 1)[:, None] * s, n)  # (n + 1, gauss, n)
    average: dict[int, Floats] = {}
    for p in (1, 2):
        rows = np.einsum("g,igk->ik", weights / 2 * p * s ** (p - 1), values) @ to_series
        average[p] = rows.astype(np.float64)
    clock = np.asarray(chebyshev.chebint(np.eye(n), lbnd=-1) / 2)
    return Rule(v.astype(np.float64), to_series.astype(np.float64), average, clock)


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


# -- the place -----------------------------------------------------------------------------


def place(low: float, high: float, limit: int, v: Floats) -> Floats:
    """Driver coordinates of values v of a piece's variable; towards a limit in v^2."""
    length = high - low
    if limit > 0:
        return np.asarray(high - length * v * v)
    return np.asarray(low + length * (v * v if limit else v))


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
    def tails(self) -> Floats:
        """(r,) what the series leave out, relative; none below the rounding of rates and inertia.

        A margin m is exact to rounding, they are to 1 / m of it.
        """
        left, least = tail(self.series), float(self.rows[2].min())
        known = NOTHING / least if least > 0 else math.inf
        found: Floats = np.where(left <= known, 0.0, left)
        return found

    @property
    def tail(self) -> float:
        """The largest of them but for the margin: the smallest of several margins has kinks."""
        return float(np.delete(self.tails, 2).max())

    def at(self, q: Floats) -> Floats:
        """All rows (r, m) at places (m,) inside."""
        way = self.high - q if self.limit > 0 else q - self.low
        v = np.clip(way / self.length, 0.0, 1.0)
        v = np.sqrt(v) if self.limit else v
        found: Floats = self.series @ basis(v, self.series.shape[1]).T
        if self.limit:
            v = np.maximum(v, EPS)
            found[0] /= v * v
            found[1] /= v
        return found

    def zeros(self, row: int) -> list[float]:
        """Places at which a row is zero, ascending."""
        values = self.rows[row]
        if np.ptp(values) < np.abs(values).min():  # all of one sign, and far from zero
            return []
        found = place(self.low, self.high, self.limit, roots(self.series[row]))
        return sorted(found.tolist())

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
        low = v[basis(v, series.size) @ series <= level]
        found: list[float] = place(self.low, self.high, self.limit, low).tolist()
        return found


@cache
def _finer(n: int) -> Floats:
    """Values at 4 n nodes from n coefficients."""
    return np.asarray(basis(node_places(4 * n), n))


# -- the motion ----------------------------------------------------------------------------


class Span(NamedTuple):
    """Where a panel lies: u = length v^p from its anchor.

    sign : direction of the motion
    energy : [J] at the anchor, or at v = 1 where the anchor is a limit
    backward : whether v is measured from its end
    limit : whether the anchor is a dead centre ahead; 2 v w is smooth then, not w
    """

    anchor: float
    length: float
    sign: int
    energy: float
    p: int = 1
    backward: bool = False
    limit: bool = False

    def places(self, v: Floats) -> Floats:
        """Driver coordinates of v."""
        way = self.sign * self.length * v**self.p
        return np.asarray(self.anchor - way if self.backward else self.anchor + way)

    def slopes(self, n: int) -> Floats:
        """dK/dw (n + 1, n) at the nodes, and at the end that is not known."""
        return self.length * _slopes(n, self.p, self.backward, self.limit)


@cache
def _slopes(n: int, p: int, backward: bool, limit: bool) -> Floats:
    r = rule(n)
    ends = np.append(r.v, 1.0)[:, None]
    if limit:  # from v = 1 down to v, of 2 v w
        found: Floats = r.average[1] * (2 * r.v)
        inner = np.vstack([ends[:-1] * found[:-1], np.zeros(n)])
        return np.asarray(found[-1] - inner)
    return np.asarray((-1.0 if backward else 1.0) * ends**p * r.average[p])


@dataclass(frozen=True)
class Panel:
    """A piece of the motion in one direction.

    t0 : [s] when it begins
    q0, q1 : [rad or m] where it begins and ends
    K0, K1 : [J] kinetic energy there
    p : exponent of the map
    backward : whether v is measured from its end
    w, K, J : (n,) dK/du along the motion, kinetic energy and inertia at the nodes
    lost : (n,) dW/du that friction takes, at the nodes; None without friction
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
    lost: Floats | None = None

    @property
    def length(self) -> float:
        """[rad or m]"""
        return abs(self.q1 - self.q0)

    @cached_property
    def rate(self) -> Floats:
        """Chebyshev coefficients (n,) of dt/dv."""
        r = rule(self.w.size)
        with np.errstate(all="ignore"):
            slope = np.sqrt(self.J / (2 * self.K)) * (self.p * self.length)
        found: Floats = r.to_series @ (slope * r.v if self.p == 2 else slope)
        return found

    @property
    def work(self) -> Floats:
        """Chebyshev coefficients (n,) of dK/du."""
        found: Floats = rule(self.w.size).to_series @ self.w
        return found

    @cached_property
    def clock(self) -> Floats:
        """Coefficients (n + 1,) of the time since v = 0."""
        found: Floats = rule(self.w.size).clock @ self.rate
        return found

    @cached_property
    def duration(self) -> float:
        """[s]"""
        return float(self.clock.sum())

    @property
    def t1(self) -> float:
        """[s] when it ends."""
        return self.t0 + self.duration

    def at_place(self, q: float) -> float:
        """Time [s] at which it passes a place."""
        share = abs(self.q1 - q if self.backward else q - self.q0) / self.length
        v = np.array([min(share, 1.0) ** (1 / self.p)])
        since = float((basis(v, self.w.size + 1) @ self.clock)[0])
        return self.t1 - since if self.backward else self.t0 + since

    def taken(self, q: float) -> float:
        """Work [J] that friction has taken when it passes a place."""
        if self.lost is None:
            return 0.0
        r = rule(self.w.size)
        series = r.clock @ (r.to_series @ (self.lost * self.p * r.v ** (self.p - 1) * self.length))
        share = abs(self.q1 - q if self.backward else q - self.q0) / self.length
        v = np.array([min(share, 1.0) ** (1 / self.p)])
        since = float((basis(v, series.size) @ series)[0])
        return float(series.sum()) - since if self.backward else since

    def faster(self, energy: float, t: float) -> Panel:
        """The same piece of the path at another time and with more kinetic energy [J]."""
        K0, K1 = self.K0 + energy, self.K1 + energy
        return replace(self, t0=t, K0=K0, K1=K1, K=self.K + energy)

    def begins_known(self, J: float, tolerance: float) -> bool:
        """Whether dt/dv begins with the rate that is known: no layer hides between the nodes."""
        if self.p != 1:
            return True
        known = self.length * math.sqrt(J / (2 * self.K0))
        size = np.abs(self.rate)
        found = float(self.rate[::2].sum() - self.rate[1::2].sum())
        left = max(float(size[-(size.size // 4) :].max()), tolerance * float(size.max()))
        return abs(found - known) <= size.size * left
