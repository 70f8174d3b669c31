"""Enclosed numbers with their derivatives, each to an error: what proofs of solutions need."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blockmech.engines.enclosed.forms import Doubt, Enclosed, Form, either, form, sign
from blockmech.engines.enclosed.forms import arctangent as angle_of
from blockmech.engines.enclosed.forms import maximum as larger
from blockmech.engines.enclosed.rounding import ROUNDED_UP, TINY
from blockmech.ground.plane import EPS
from blockmech.typing import Array, Real


class Dual(Enclosed):
    """A number with its derivatives d (m,), each to r (m,)."""

    __slots__ = ("d", "r", "x")
    __array_ufunc__ = None
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, x: Form, d: Array | float = 0.0, r: Array | float = 0.0) -> None:
        self.x, self.d, self.r = x, np.asarray(d, float), np.asarray(r, float)

    @property
    def at(self) -> float:
        """The number of the planned design."""
        return self.x.at

    def chain(self, y: Form, slope: Form | float) -> Dual:
        """A function of it: value and slope."""
        return Dual(y, *scaled(form(slope), self.d, self.r))

    def __add__(self, term: Real) -> Dual:
        b = dual(term)
        d = self.d + b.d
        return Dual(self.x + b.x, d, (self.r + b.r + EPS * abs(d)) * ROUNDED_UP)

    def __neg__(self) -> Dual:
        return Dual(-self.x, -self.d, self.r)

    def __mul__(self, factor: Real) -> Dual:
        b = dual(factor)
        y = self.chain(self.x, b.x) + b.chain(self.x, self.x)
        return Dual(self.x * b.x, y.d, y.r)

    def __abs__(self) -> Dual:
        return self.chain(abs(self.x), sign(self.x))

    def __lt__(self, limit: Real) -> Real:
        return self.x < dual(limit).x

    def __le__(self, limit: Real) -> Real:
        return self.x <= dual(limit).x

    def __eq__(self, x: Any) -> Any:
        return self.x == dual(x).x

    def inverse(self) -> Dual:
        """1 / x."""
        y = self.x.inverse()
        return self.chain(y, -y * y)

    def sqrt(self) -> Dual:
        """The square root."""
        y = self.x.sqrt()
        return self.chain(y, y.inverse() * 0.5)

    def expi(self) -> tuple[Dual, Dual]:
        """Cosine and sine."""
        cos, sin = self.x.expi()
        return self.chain(cos, -sin), self.chain(sin, cos)


def dual(x: Dual | Form | float) -> Dual:
    """A number with derivatives; those of a constant are zero."""
    return x if isinstance(x, Dual) else Dual(form(x))


def arctangent(y: Dual, x: Dual) -> Dual:
    """The angle of a vector, in (-pi, pi]."""
    angle = angle_of(y.x, x.x)
    nearness = (x.x * x.x + y.x * y.x).inverse()
    change = y.chain(angle, x.x * nearness) + x.chain(angle, -y.x * nearness)
    return Dual(angle, change.d, change.r)


def select(doubt: Doubt, a: Dual, b: Dual) -> Dual:
    """A number that is a or b: nothing is known of its derivatives."""
    return Dual(either(doubt, a.x, b.x), 0.0 * a.d, np.full(a.d.shape, math.inf))


def maximum(a: Dual, b: Dual) -> Dual:
    """The larger of two numbers, of which the derivatives are of either."""
    first = a > b
    if not isinstance(first, Doubt):
        return a if first else b
    error = 0.5 * abs(a.d - b.d) + np.maximum(a.r, b.r) + EPS * (abs(a.d) + abs(b.d))
    return Dual(larger(a.x, b.x), 0.5 * (a.d + b.d), error * ROUNDED_UP)


def scaled(factor: Form, d: Array, r: Array) -> tuple[Array, Array]:
    """Derivatives times a number."""
    if not factor.magnitude < math.inf:
        return 0.0 * d, np.where((d == 0.0) & (r == 0.0), 0.0, math.inf)
    c = 0.5 * (factor.low + factor.high)
    width = max(factor.high - c, c - factor.low) * ROUNDED_UP + TINY
    y = c * d
    return y, (abs(c) * r + width * (abs(d) + r) + EPS * abs(y)) * ROUNDED_UP
