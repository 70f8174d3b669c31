"""Small hand-written linkages for the tests: J_red, tau_red, dJ_red/dq, margin.

One text serves batches and single poses: points are complex numbers, ``sqrt`` and
``exp`` come from NumPy or from the standard library. Nothing of the package is used
but the system that the numbers are handed over in.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from tests.dynamics.synthetic import Synthetic


def _root(x: float) -> float:
    return math.sqrt(x) if x >= 0.0 else math.nan


BATCH = SimpleNamespace(expi=lambda q: np.exp(1j * q), sqrt=np.sqrt, hyp=np.abs, low=np.minimum)
SINGLE = SimpleNamespace(expi=lambda q: cmath.exp(1j * q), sqrt=_root, hyp=abs, low=min)


def cross(a: Any, b: Any) -> Any:
    return a.real * b.imag - a.imag * b.real


def dot(a: Any, b: Any) -> Any:
    return a.real * b.real + a.imag * b.imag


class Moving(NamedTuple):
    """A vector with its derivative in the driver; the second one only where wanted."""

    p: Any
    v: Any = 0.0
    a: Any = 0.0


def add(x: Moving, y: Moving) -> Moving:
    return Moving(x.p + y.p, x.v + y.v, x.a + y.a)


def times(z: complex, x: Moving) -> Moving:
    return Moving(z * x.p, z * x.v, z * x.a)


def dyad(m: Any, B: Moving, D: Moving, li: float, lj: float, branch: int, second: bool) -> Any:
    """RRR dyad: vectors BC and DC, (rate, acceleration) of both links, margin."""
    d = D.p - B.p
    r = m.hyp(d)
    outer, inner = li + lj, li - lj
    area2 = (outer - r) * (outer + r) * (r - abs(inner)) * (r + abs(inner))
    det = branch * m.sqrt(area2) / 2
    u = (d / r) * ((inner * outer / r + r) / 2 + 1j * (det / r))
    w = u - d
    rhs = D.v - B.v
    oi, oj = dot(rhs, w) / det, dot(rhs, u) / det
    margin = area2 / (2 * li * lj) ** 2
    if not second:
        bc, dc = Moving(u, 1j * oi * u), Moving(w, 1j * oj * w)
        return bc, dc, (oi, 0.0), (oj, 0.0), margin
    rhs = D.a - B.a + oi * oi * u - oj * oj * w
    ai, aj = dot(rhs, w) / det, dot(rhs, u) / det
    bc = Moving(u, 1j * oi * u, (1j * ai - oi * oi) * u)
    dc = Moving(w, 1j * oj * w, (1j * aj - oj * oj) * w)
    return bc, dc, (oi, ai), (oj, aj), margin


Parts = Callable[[Any, Any, bool], tuple[Any, Any, Any, Any]]  # -> J, tau, dJ, margin


def reduced(parts: Parts, **options: Any) -> Synthetic:
    """A reduced system from the text of a linkage."""

    def batch(q: Any, qd: Any, t: float) -> tuple[Any, Any, Any]:
        J, tau, _, margin = parts(BATCH, q, False)
        return J, tau, margin

    def one(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        try:
            J, tau, dJ, margin = parts(SINGLE, q, True)
        except ZeroDivisionError:
            return math.nan, math.nan, math.nan, 0.0
        return J, tau, dJ, margin

    return Synthetic(one, batch, **options)


def watt_parts(m: Any, q: Any, second: bool) -> tuple[Any, Any, Any, Any]:
    """The Watt six-bar of Durango et al. 2014, Table 1: rods, gravity 9.81 m/s2 down."""
    e = m.expi(q)
    A, O4 = Moving(e, 1j * e, -e), Moving(1.6 + 0j)
    ab, _, (o3, l3), (o4, l4), m1 = dyad(m, A, O4, 1.5, 1.5, 1, second)
    B = add(A, ab)
    C, D = times(0.5, add(A, B)), times(0.5, add(B, O4))
    ce, _, (o5, l5), (o6, l6), m2 = dyad(m, C, D, 1.0, 1.0, 1, second)
    E = add(C, ce)
    J, tau, dJ = 0.25 + 0.0833, -9.81 * A.v.imag / 2, 0.0
    rods = (
        (1.5, 0.2813, C, o3, l3),
        (1.5, 0.2813, D, o4, l4),
        (1.0, 0.0833, times(0.5, add(C, E)), o5, l5),
        (1.0, 0.0833, times(0.5, add(D, E)), o6, l6),
    )
    for mass, inertia, G, o, al in rods:
        J = J + mass * dot(G.v, G.v) + inertia * o * o
        tau = tau - mass * 9.81 * G.v.imag
        if second:
            dJ = dJ + 2 * (mass * dot(G.v, G.a) + inertia * o * al)
    return J, tau, dJ, m.low(m1, m2)


def watt(**options: Any) -> Synthetic:
    """The Watt six-bar."""
    return reduced(watt_parts, **options)


def pendulum(couple: float = 0.0, **options: Any) -> Synthetic:
    """A point mass 1 kg at 1 m, gravity 1 m/s2, q from the lowest place, and a couple [N m]."""

    def parts(m: Any, q: Any, second: bool) -> tuple[Any, Any, Any, Any]:
        sine = m.expi(q).imag
        return 1.0 + 0 * sine, couple - sine, 0 * sine, 1.0 + 0 * sine

    return reduced(parts, **options)


@dataclass(frozen=True)
class FourBar:
    """A four-bar whose crank cannot turn fully; rods of 1 kg, gravity 9.81 m/s2 down."""

    crank: float = 1.0
    coupler: float = 0.8
    rocker: float = 0.7
    base: float = 1.2

    def __call__(self, m: Any, q: Any, second: bool) -> tuple[Any, Any, Any, Any]:
        e = m.expi(q)
        A, D = Moving(self.crank * e, 1j * self.crank * e, -self.crank * e), Moving(self.base + 0j)
        ab, db, (o3, l3), (o4, l4), margin = dyad(m, A, D, self.coupler, self.rocker, 1, second)
        J, tau, dJ = 1.0 + 0 * margin, -9.81 * A.v.imag / 2, 0.0
        for g, o, al in ((add(A, times(0.5, ab)), o3, l3), (add(D, times(0.5, db)), o4, l4)):
            J = J + dot(g.v, g.v) + 0.1 * o * o
            tau = tau - 9.81 * g.v.imag
            if second:
                dJ = dJ + 2 * (dot(g.v, g.a) + 0.1 * o * al)
        return J, tau, dJ, margin

    def potential(self, m: Any, q: Any) -> Any:
        """Energy of the weights [J]."""
        A, D = Moving(self.crank * m.expi(q)), Moving(self.base + 0j)
        ab, db, *_ = dyad(m, A, D, self.coupler, self.rocker, 1, False)
        height = A.p.imag / 2 + (A.p + 0.5 * ab.p).imag + (D.p + 0.5 * db.p).imag
        return 9.81 * height


def fourbar(**options: Any) -> Synthetic:
    """The four-bar that runs into dead centres."""
    return reduced(FourBar(), **options)


def guided(inertia: float, effort: Callable[[Any], Any], **options: Any) -> Synthetic:
    """A body on a straight guide: constant inertia [kg], effort(q) [N]."""

    def batch(q: Any, qd: Any, t: float) -> tuple[Any, Any, Any]:
        return inertia, effort(q) + 0 * q, 1.0

    def one(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        return inertia, float(effort(q)), 0.0, 1.0

    given = {"rotary": (False,), "period": None, "span": 1.0}
    return Synthetic(one, batch, **given, **options)


def motored(stall: float = 60.0, idle: float = 20.0, damper: float = 0.3) -> Synthetic:
    """The Watt six-bar with a motor M = stall (1 - q'/idle) and a damper that varies with q."""
    base = watt()

    def damping(q: Any) -> Any:
        return damper * (1 + 0.5 * np.cos(q))

    def motor(q: Any, qd: Any, t: float = 0.0) -> Any:
        return stall * (1 - qd / idle) if stall else 0.0 * qd

    def batch(q: Any, qd: Any, t: float) -> tuple[Any, Any, Any]:
        result = base.sample(q)
        return result.J, result.tau + motor(q, qd) - damping(q) * qd, result.margin

    def one(q: float, qd: float, t: float) -> tuple[float, float, float, float]:
        J, tau, dJ, margin, _ = base.scalar_terms(q)
        return J, tau + float(motor(q, qd)) - float(damping(q)) * qd, dJ, margin

    return Synthetic(one, batch, depends_on=frozenset({"q", "rate"}))
