"""Affine forms: numbers c + sum d_i e_i with unknown e_i in [-1, 1], and bounds beside them.

There is a symbol e_i for each number of the design within its tolerance, one for each rounding and
one for each curvature. Where a form fails, at branches and knots, bounds alone remain; where no
bound is proved they are infinite, never wrong.

Source: de Figueiredo & Stolfi, Affine arithmetic, Numer. Algorithms 37 (2004).
"""

from __future__ import annotations

import math
import operator
import threading
from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np

from blockmech.engines.enclosed.rounding import (
    PI,
    ROUNDED_UP,
    TINY,
    ULP,
    above,
    below,
    cosine_and_sine,
    exponential,
)
from blockmech.engines.numpy import each_part
from blockmech.ground.plane import EPS, NAN, SCALAR_PRIMITIVES
from blockmech.typing import Array, Nested, Real

EXACT = np.zeros(0)  # coefficients of a number that is exact


class _Symbols(threading.local):
    """Number of symbols in use."""

    count = 0


SYMBOLS = _Symbols()


class Doubt:
    """A truth value that the bounds leave open; ``at`` is that of the planned design."""

    __slots__ = ("at",)

    def __init__(self, at: object) -> None:
        self.at = bool(at)

    def __and__(self, term: bool | Doubt) -> bool | Doubt:
        return term is not False and Doubt(self.at and planned(term))

    def __or__(self, term: bool | Doubt) -> bool | Doubt:
        return True if term is True else Doubt(self.at or planned(term))

    __rand__, __ror__ = __and__, __or__


class Enclosed:
    """Operators by those that each kind of enclosed number has: +, *, -x, 1 / x, < and <=."""

    __slots__ = ()
    imag = 0.0  # as of any real number

    @property
    def real(self) -> Self:
        """Itself: no component of a vector."""
        return self

    def __radd__(self: Real, term: Real) -> Real:
        return self + term

    def __sub__(self: Real, term: Real) -> Real:
        return self + -term

    def __rsub__(self: Real, term: Real) -> Real:
        return -self + term

    def __rmul__(self: Real, factor: Real) -> Real:
        return self * factor

    def __truediv__(self: Real, divisor: Real) -> Real:
        enclosed: Real = divisor if isinstance(divisor, Enclosed) else form(divisor)
        return self * enclosed.inverse()

    def __rtruediv__(self: Real, dividend: Real) -> Real:
        return self.inverse() * dividend

    def __gt__(self: Real, limit: Real) -> Real:
        return -self < -limit

    def __ge__(self: Real, limit: Real) -> Real:
        return -self <= -limit


class Form(Enclosed):
    """A number: at the planned design ``at``, within low and high, affine c + d e if d is there.

    ``r`` is the sum of its |d_i|.
    """

    __slots__ = ("absolute", "at", "c", "d", "high", "low", "r")

    def __init__(
        self, at: float, low: float, high: float, c: float = NAN, d: Array | None = None
    ) -> None:
        self.absolute: Form
        self.at, self.c, self.d, self.r = float(at), float(c), d, math.inf
        if d is not None:
            self.r = float(np.abs(d).sum()) * ROUNDED_UP if d.size else 0.0
            if not math.isfinite(c) or not math.isfinite(self.r):
                self.d = None
            elif d.size:
                low, high = max(low, below(c - self.r)), min(high, above(c + self.r))
            else:
                low = high = c
        self.low, self.high = low, high

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *arguments: Form | float) -> Real:
        if method != "__call__" or ufunc not in FUNCTIONS:
            return NotImplemented
        return FUNCTIONS[ufunc](*map(form, arguments))

    @property
    def exact(self) -> bool:
        """Whether it is a single number."""
        return self.d is not None and not self.d.size

    @property
    def magnitude(self) -> float:
        """Its largest magnitude."""
        return max(abs(self.low), abs(self.high))

    def planned_at(self, at: float) -> Form:
        """The same number, of another value at the planned design."""
        return Form(at, self.low, self.high, self.c, self.d)

    def widened(self, error: float) -> Form:
        """It and all that is as close to it as an error."""
        if self.d is not None:
            return affine(self.at, self.c, [(1.0, self.d)], error)
        return Form(self.at, below(self.low - error), above(self.high + error))

    def __add__(self, term: Real) -> Real:
        return self._sum(_term(term), 1.0)

    def __sub__(self, term: Real) -> Real:
        return self._sum(_term(term), -1.0)

    def _sum(self, b: Real, side: float) -> Real:
        if b is NotImplemented:
            return b
        if b.exact and b.c == 0.0:
            return self
        if self.exact and self.c == 0.0:
            return b if side > 0.0 else -b
        lowest, highest = (b.low, b.high) if side > 0.0 else (-b.high, -b.low)
        low, high = below(self.low + lowest), above(self.high + highest)
        at, x = self.at + side * b.at, side * b.c
        if self.d is None or b.d is None:
            return Form(at, low, high)
        c = self.c + x
        t = c - self.c
        error = abs((self.c - (c - t)) + (x - t)) + ULP * 2 * (self.r + b.r)
        return affine(at, c, [(1.0, self.d), (side, b.d)], error, low, high)

    def __neg__(self) -> Form:
        d = None if self.d is None else -self.d
        return Form(-self.at, -self.high, -self.low, -self.c, d)

    def __mul__(self, factor: Real) -> Real:
        if (b := _term(factor)) is NotImplemented:
            return NotImplemented
        for x, y in ((self, b), (b, self)):
            if x.exact and x.c in (-1.0, 0.0, 1.0) and (x.c or y.magnitude < math.inf):
                return (y if x.c > 0.0 else -y) if x.c else form(0.0)
        at = self.at * b.at
        if self is b:
            nearest = 0.0 if self.low <= 0.0 <= self.high else min(abs(self.low), abs(self.high))
            low, high = max(below(nearest**2), 0.0), above(self.magnitude**2)
        else:
            corners = [x * y for x in (self.low, self.high) for y in (b.low, b.high)]
            nan = any(x != x for x in corners)
            low, high = (-math.inf, math.inf) if nan else (below(min(corners)), above(max(corners)))
        if self.d is None or b.d is None:
            return Form(at, low, high)
        c, curvature = self.c * b.c, self.r * b.r
        shift = 0.5 * curvature if self is b else 0.0  # of a square, which curves to one side
        slopes = abs(self.c) * b.r + abs(b.c) * self.r
        rounding = ULP * (abs(c) * (1 + (shift > 0.0)) + 2 * shift + 4 * slopes)
        error = curvature - shift + rounding + TINY
        return affine(at, c + shift, [(b.c, self.d), (self.c, b.d)], error, low, high)

    def __abs__(self) -> Form:
        if self.low >= 0.0:
            return self
        if not hasattr(self, "absolute"):  # the same symbol each time, so that it cancels
            straight = self.high <= 0.0
            self.absolute = -self if straight else between(abs(self.at), 0.0, self.magnitude)
        return self.absolute

    def __lt__(self, limit: Real) -> bool | Doubt:
        b = form(limit)
        return True if self.high < b.low else self.low < b.high and Doubt(self.at < b.at)

    def __le__(self, limit: Real) -> bool | Doubt:
        b = form(limit)
        return True if self.high <= b.low else self.low <= b.high and Doubt(self.at <= b.at)

    def __eq__(self, x: Any) -> Any:
        b = form(x)
        if self.high < b.low or b.high < self.low:
            return False
        return (self.exact and b.exact) or Doubt(self.at == b.at)

    __hash__ = None  # type: ignore[assignment]

    def inverse(self) -> Form:
        """1 / x."""
        if not (self.low > 0.0 or self.high < 0.0):
            return unknown(NAN)
        low, high = below(1.0 / self.high), above(1.0 / self.low)
        nearest = min(abs(self.low), abs(self.high), abs(self.c))
        at = 1.0 / self.at if self.at else NAN
        if self.d is None or not (nearest > 1e-100 and self.c * self.low > 0.0):
            return Form(at, low, high)
        curve = 1.0 / nearest**3
        curves = (0.0, curve) if self.low > 0.0 else (-curve, 0.0)
        y = 1.0 / self.c
        return self.smooth(at, y, ULP * abs(y), -1.0 / (self.c * self.c), curves, low, high)

    def sqrt(self) -> Form:
        """The square root; not bounded where the number may be negative."""
        at = math.sqrt(self.at) if self.at >= 0.0 else NAN
        if not self.low >= 0.0:
            return unknown(at)
        if self.exact and self.c == 0.0:
            return self
        low, high = max(below(math.sqrt(self.low)), 0.0), above(math.sqrt(self.high))
        nearest = min(self.low, self.c)
        if self.d is None or not nearest > 1e-150:
            return Form(at, low, high)
        y, curve = math.sqrt(self.c), -1.0 / (8.0 * nearest * math.sqrt(nearest))
        return self.smooth(at, y, ULP * y, 0.5 / y, (curve, 0.0), low, high)

    def expi(self) -> tuple[Form, Form]:
        """Cosine and sine."""
        at = (math.cos(self.at), math.sin(self.at)) if math.isfinite(self.at) else (NAN, NAN)
        affine_ = self.d is not None
        middle = self.c if affine_ else 0.5 * (self.low + self.high)
        reach = self.r if affine_ else above(0.5 * above(self.high - self.low) + TINY)
        if not abs(middle) < 2.0**32 or not reach < 1.0:
            return Form(at[0], -1.0, 1.0), Form(at[1], -1.0, 1.0)
        (cos, sin), pair = cosine_and_sine(middle), []
        for y, slope, x in ((cos, -sin, at[0]), (sin, cos, at[1])):
            error, curve = ULP * abs(y) + 2.0**-100, 0.5 * (abs(y) + reach) * ROUNDED_UP
            width = (abs(slope) * reach + curve * reach**2 + 2 * error) * ROUNDED_UP + EPS * reach
            low, high = max(below(y - width), -1.0), min(above(y + width), 1.0)
            curves = (-0.5 * y - 0.5 * reach - EPS, -0.5 * y + 0.5 * reach + EPS)
            pair.append(self.smooth(x, y, error, slope, curves, low, high))
        return pair[0], pair[1]

    def exp(self) -> Form:
        """The exponential."""
        low, high = exponential(self.low), exponential(self.high)
        at = SCALAR_PRIMITIVES["exp"](self.at)
        y = exponential(self.c) if self.d is not None else NAN
        curves = (0.0, 0.5 * max(high, y) * ROUNDED_UP)
        return self.smooth(at, y, EPS * y, y, curves, below(low), above(high))

    def smooth(
        self,
        at: float,
        y: float,
        error: float,
        slope: float,
        curves: tuple[float, float],
        low: float,
        high: float,
    ) -> Form:
        """A smooth function of it: value and slope at c, half the second derivative around.

        ``error`` is that of the value; the slope is good to 8 roundings of itself.
        """
        if self.d is None or not math.isfinite(y) or not math.isfinite(curves[1] - curves[0]):
            return Form(at, low, high)
        square = self.r * self.r
        lowest, highest = min(curves[0] * square, 0.0), max(curves[1] * square, 0.0)
        shift, half = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
        rounding = ULP * ((abs(y) + half) * (half > 0.0) + 16 * abs(slope) * self.r)
        return affine(at, y + shift, [(slope, self.d)], error + half + TINY + rounding, low, high)


def affine(
    at: float,
    c: float,
    terms: Sequence[tuple[float, Array]],
    error: float,
    low: float = -math.inf,
    high: float = math.inf,
) -> Form:
    """c and factors times coefficients, with a new symbol for their error."""
    error *= ROUNDED_UP
    if error > 0.0:
        SYMBOLS.count += 1
        length = SYMBOLS.count
    else:
        length = max((len(d) for _, d in terms), default=0)
    coefficients = np.zeros(length)
    for factor, d in terms:
        coefficients[: len(d)] += d if factor == 1.0 else factor * d
    if error > 0.0:
        coefficients[-1] = error
    return Form(at, low, high, c, coefficients)


def form(x: Form | float) -> Form:
    """A number as a form."""
    if isinstance(x, Form):
        return x
    x = float(x)
    return Form(x, x, x, x, EXACT) if math.isfinite(x) else unknown(x)


def _term(x: Real) -> Real:
    """A number as a form; other kinds of enclosed numbers work with forms themselves."""
    return NotImplemented if isinstance(x, Enclosed) and not isinstance(x, Form) else form(x)


def unknown(at: float = NAN) -> Form:
    """A number without bounds."""
    return Form(at, -math.inf, math.inf)


def within(value: float, tolerance: float) -> Form:
    """A number somewhere within its tolerance, with a new symbol."""
    return affine(value, value, [], tolerance, below(value - tolerance), above(value + tolerance))


def between(at: float, low: float, high: float) -> Form:
    """A number between bounds, with a new symbol."""
    if not high - low < math.inf:
        return Form(at, low, high)
    c = 0.5 * (low + high)
    return affine(at, c, [], above(max(high - c, c - low)) + TINY, low, high)


def planned(x: Nested) -> Any:
    """Numbers or truth values, in nested tuples, at the planned design."""
    return each_part(lambda number: getattr(number, "at", number), x, vector=complex)


def forms_of(x: Nested) -> Nested:
    """Nested tuples of numbers as forms."""
    return each_part(lambda y: y if isinstance(y, str | Enclosed | Doubt | None) else form(y), x)


# -- functions of forms ------------------------------------------------------------------


def either(doubt: Doubt, a: Form | float, b: Form | float) -> Form:
    """A number that is a or b; of an infeasible branch, which margins report, the feasible."""
    at = planned(a) if doubt.at else planned(b)
    if any(isinstance(x, float) and x != x for x in (a, b)):
        return form(b if isinstance(a, float) and a != a else a).planned_at(at)
    a, b = form(a), form(b)
    middle, apart = (a + b) * 0.5, (a - b) * 0.5
    low, high = min(a.low, b.low), max(a.high, b.high)
    if middle.d is None or not apart.magnitude < math.inf:
        return Form(at, low, high)
    return affine(at, middle.c, [(1.0, middle.d)], apart.magnitude, low, high)


def sign(x: Form | float) -> Form:
    """-1, 0 or 1."""
    x = form(x)
    if x.exact or x.low > 0.0 or x.high < 0.0:
        return form(float(x.low > 0.0) - float(x.high < 0.0))
    return between(math.copysign(1.0, x.at), -1.0, 1.0)


def maximum(x: Form | float, y: Form | float) -> Form:
    """The larger of two numbers; it is continuous."""
    a, b = form(x), form(y)
    first = a > b
    if not isinstance(first, Doubt):
        return a if first else b
    hull = either(first, a, b)
    return Form(hull.at, max(a.low, b.low), hull.high, hull.c, hull.d)


def arctangent(y: Form, x: Form) -> Form:
    """The angle of a vector, in (-pi, pi].

    That of the planned design, and a small one from there: |arctan t - t + t^3 / 3| <= |t|^5 / 5.
    """
    at = math.atan2(y.at + 0.0, x.at)
    base = math.atan2(y.at, x.at) if y.at == y.at and x.at == x.at else 0.0
    cos, sin = (affine(v, v, [], ULP * abs(v) + 2.0**-100) for v in cosine_and_sine(base))
    cosine = x * cos + y * sin
    if not cosine.low > 0.0:
        return Form(at, -PI, PI)
    tangent = (y * cos - x * sin) / cosine
    c, width = tangent.c, tangent.magnitude
    low, high = min(tangent.low, 0.0), max(tangent.high, 0.0)
    turn = Form(at, low, high)
    if tangent.d is not None and abs(c) < 1e-3:
        value, error = c - c**3 / 3.0, abs(c) ** 5 + 4 * ULP * abs(c)
        turn = tangent.smooth(at, value, error, 1.0 / (1.0 + c * c), (-width, width), low, high)
    total: Form = form(base) + turn
    inside = total.low >= -PI and total.high <= PI
    return total.planned_at(at) if inside else Form(at, -PI, PI)


FUNCTIONS: dict[np.ufunc, Callable[..., Form]] = {
    np.add: operator.add,
    np.subtract: operator.sub,
    np.multiply: operator.mul,
    np.divide: operator.truediv,
    np.arctan2: arctangent,
    np.hypot: lambda x, y: (x * x + y * y).sqrt(),
    np.minimum: lambda x, y: -maximum(-x, -y),
    np.maximum: maximum,
    np.rint: lambda x: Form(np.rint(x.at), float(np.rint(x.low)), float(np.rint(x.high))),
    np.absolute: abs,
    np.negative: operator.neg,
}
"""NumPy's functions by which outputs are read, and its numbers' own arithmetic."""
