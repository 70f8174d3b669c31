r"""The engine of enclosures: every number with proved bounds, for rounding and for tolerances.

A number is an affine form c + sum d_i e_i with unknown e_i in [-1, 1]: one for each number of the
design within its tolerance, one for each rounding and each curvature. Where that fails, at branches
and knots, bounds alone are left. Where no bound is proved they are infinite: never a wrong bound.

What solvers find is proved by their own step of Newton's method N (`ground.plane.implicit`):
with N(x0) + N'(X) (X - x0) inside the box X, X holds a solution (Brouwer), and only one, as N is
then a contraction. Loops themselves run on the numbers of the planned design.

Sources: de Figueiredo & Stolfi, Affine arithmetic, Numer. Algorithms 37 (2004); Rump,
Verification methods, Acta Numerica 19 (2010), sections 10.7 and 13.
"""

from __future__ import annotations

import itertools
import math
import operator
import threading
from collections.abc import Callable, Mapping, Sequence
from decimal import Context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.binding import Binder, bind
from blockmech.engines.numpy import Planar, each_part
from blockmech.ground.plane import (
    EPS,
    NAN,
    REST_SHARE,
    SCALAR_PRIMITIVES,
    cross,
    dot,
    primitives_of,
)
from blockmech.plan.plan import Program
from blockmech.typing import LinkPosition

Array = NDArray[Any]
ULP = EPS / 2  # largest relative error of one operation
ROOM = 1.0 + 2.0**-30  # for the roundings in a bound itself
TINY = 1e-300  # what numbers lose that are smaller than the smallest normal one
NONE = np.zeros(0)
DIGITS = Context(prec=40)  # its exponential and logarithm are rounded correctly
ATTEMPTS = 4  # boxes that are tried for a solution


class _Symbols(threading.local):
    """Number of symbols that stand for something."""

    count = 0


SYMBOLS = _Symbols()


def below(x: float) -> float:
    """The next number below; minus infinity where nothing is known."""
    return math.nextafter(x, -math.inf) if x == x else -math.inf


def above(x: float) -> float:
    """The next number above."""
    return math.nextafter(x, math.inf) if x == x else math.inf


class Doubt:
    """A truth value that the bounds leave open; ``at`` is that of the planned design."""

    __slots__ = ("at",)

    def __init__(self, at: Any) -> None:
        self.at = bool(at)

    def __and__(self, term: Any) -> Any:
        return (
            term and Doubt(self.at and planned(term))
            if isinstance(term, bool)
            else Doubt(self.at and planned(term))
        )

    def __or__(self, term: Any) -> Any:
        return True if term is True else Doubt(self.at or planned(term))

    __rand__, __ror__ = __and__, __or__


class Form:
    """A number: at the planned design ``at``, within low and high, affine c + d e if d is there."""

    __slots__ = ("absolute", "at", "c", "d", "high", "low", "r")

    def __array_ufunc__(self, ufunc: Any, method: str, *args: Any) -> Any:
        known = method == "__call__" and ufunc in FUNCTIONS
        return FUNCTIONS[ufunc](*map(form, args)) if known else NotImplemented

    def __init__(
        self, at: float, low: float, high: float, c: float = NAN, d: Array | None = None
    ) -> None:
        self.absolute: Form
        self.at, self.c, self.d, self.r = float(at), float(c), d, math.inf
        if d is not None:
            self.r = float(np.abs(d).sum()) * ROOM if d.size else 0.0
            if not math.isfinite(c) or not math.isfinite(self.r):
                self.d = None
            elif d.size:
                low, high = max(low, below(c - self.r)), min(high, above(c + self.r))
            else:
                low = high = c
        self.low, self.high = low, high

    @property
    def exact(self) -> bool:
        """Whether it is one number."""
        return self.d is not None and not self.d.size

    @property
    def real(self) -> Form:
        """Itself: no component of a vector."""
        return self

    @property
    def imag(self) -> Any:
        """Nothing."""
        return form(0.0)

    @property
    def bounds(self) -> Form:
        """The same without its symbols."""
        return Form(self.at, self.low, self.high)

    @property
    def size(self) -> float:
        """Its largest magnitude."""
        return max(abs(self.low), abs(self.high))

    def __add__(self, term: Any) -> Any:
        return _sum(self, term, 1.0)

    def __radd__(self, term: Any) -> Any:
        return _sum(form(term), self, 1.0)

    def __sub__(self, term: Any) -> Any:
        return _sum(self, term, -1.0)

    def __rsub__(self, term: Any) -> Any:
        return _sum(form(term), self, -1.0)

    def __neg__(self) -> Form:
        d = None if self.d is None else -self.d
        return Form(-self.at, -self.high, -self.low, -self.c, d)

    def __mul__(self, term: Any) -> Any:
        if isinstance(term, Dual):
            return NotImplemented
        a, b = self, form(term)
        for x, y in ((a, b), (b, a)):
            if x.exact and abs(x.c) <= 1.0 and x.c == int(x.c) and (x.c or y.size < math.inf):
                return (y if x.c > 0.0 else -y) if x.c else form(0.0)
        at = a.at * b.at
        if a is b:
            low = 0.0 if a.low <= 0.0 <= a.high else min(abs(a.low), abs(a.high)) ** 2
            low, high = max(below(low), 0.0), above(a.size * a.size)
        else:
            ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
            nan = any(x != x for x in ends)
            low, high = (-math.inf, math.inf) if nan else (below(min(ends)), above(max(ends)))
        if a.d is None or b.d is None:
            return Form(at, low, high)
        c, bent, shift = a.c * b.c, a.r * b.r, 0.0
        if a is b:
            bent = shift = 0.5 * bent
        off = (
            bent
            + ULP
            * (abs(c) * (1 + (shift > 0.0)) + 2 * shift + 4 * (abs(a.c) * b.r + abs(b.c) * a.r))
            + TINY
        )
        return affine(at, c + shift, [(b.c, a.d), (a.c, b.d)], off, low, high)

    __rmul__ = __mul__

    def __truediv__(self, term: Any) -> Any:
        if isinstance(term, Dual):
            return NotImplemented
        b = form(term)
        y: Form = self * b.inverse()
        y.at = self.at / b.at if b.at else NAN
        return y

    def __rtruediv__(self, term: Any) -> Any:
        return form(term) / self

    def __abs__(self) -> Form:
        if self.low >= 0.0:
            return self
        if not hasattr(self, "absolute"):  # the same symbol each time, so that it cancels
            self.absolute = -self if self.high <= 0.0 else between(abs(self.at), 0.0, self.size)
        return self.absolute

    def __lt__(self, term: Any) -> Any:
        b = form(term)
        return True if self.high < b.low else self.low < b.high and Doubt(self.at < b.at)

    def __le__(self, term: Any) -> Any:
        b = form(term)
        return True if self.high <= b.low else self.low <= b.high and Doubt(self.at <= b.at)

    def __gt__(self, term: Any) -> Any:
        return form(term) < self

    def __ge__(self, term: Any) -> Any:
        return form(term) <= self

    def __eq__(self, term: Any) -> Any:
        b = form(term)
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
        curve = 1.0 / nearest**3 if nearest > 1e-100 else math.inf
        curves = (0.0, curve) if self.low > 0.0 else (-curve, 0.0)
        at = 1.0 / self.at if self.at else NAN
        inside = self.d is not None and self.c * self.low > 0.0 and nearest > 1e-100
        slope = -1.0 / (self.c * self.c) if inside else NAN
        value = 1.0 / self.c if inside else NAN
        return self.bent(at, value, ULP * abs(value), slope, curves, low, high)

    def sqrt(self) -> Form:
        """The square root; not bounded where the number may be negative."""
        at = math.sqrt(self.at) if self.at >= 0.0 else NAN
        if not self.low >= 0.0:
            return unknown(at)
        low, high = max(below(math.sqrt(self.low)), 0.0), above(math.sqrt(self.high))
        if self.exact and self.c == 0.0:
            return self
        nearest = min(self.low, self.c)
        if self.d is None or not nearest > 1e-150:
            return Form(at, low, high)
        y, curve = math.sqrt(self.c), -1.0 / (8.0 * nearest * math.sqrt(nearest))
        return self.bent(at, y, ULP * y, 0.5 / y, (curve, 0.0), low, high)

    def turned(self) -> tuple[Form, Form]:
        """Cosine and sine."""
        at = (math.cos(self.at), math.sin(self.at)) if math.isfinite(self.at) else (NAN, NAN)
        middle = self.c if self.d is not None else 0.5 * (self.low + self.high)
        reach = self.r if self.d is not None else above(0.5 * above(self.high - self.low) + TINY)
        if not abs(middle) < 2.0**32 or not reach < 1.0:
            return Form(at[0], -1.0, 1.0), Form(at[1], -1.0, 1.0)
        (cos, sin), pair = turn(middle), []
        for y, slope, x in ((cos, -sin, at[0]), (sin, cos, at[1])):
            off, curve = ULP * abs(y) + 2.0**-100, 0.5 * (abs(y) + reach) * ROOM
            wide = (abs(slope) * reach + curve * reach * reach + 2 * off) * ROOM + EPS * reach
            low, high = max(below(y - wide), -1.0), min(above(y + wide), 1.0)
            side = (-0.5 * y - 0.5 * reach - EPS, -0.5 * y + 0.5 * reach + EPS)
            pair.append(self.bent(x, y, off, slope, side, low, high))
        return pair[0], pair[1]

    def exp(self) -> Form:
        """The exponential."""
        low, high = exponential(self.low), exponential(self.high)
        at = SCALAR_PRIMITIVES["exp"](self.at)
        y = exponential(self.c) if self.d is not None else NAN
        top = max(high, y) * ROOM
        return self.bent(at, y, EPS * y, y, (0.0, 0.5 * top), below(low), above(high))

    def bent(
        self,
        at: float,
        y: float,
        off: float,
        slope: float,
        curves: tuple[float, float],
        low: float,
        high: float,
    ) -> Form:
        """A smooth function of it: value and slope at c, half the second derivative around.

        ``off`` is the error of the value; the slope is good to 8 roundings of itself.
        """
        if self.d is None or not math.isfinite(y) or not math.isfinite(curves[1] - curves[0]):
            return Form(at, low, high)
        square = self.r * self.r
        lowest, highest = min(curves[0] * square, 0.0), max(curves[1] * square, 0.0)
        shift, half = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
        off += half + TINY + ULP * ((abs(y) + half) * (half > 0.0) + 16 * abs(slope) * self.r)
        return affine(at, y + shift, [(slope, self.d)], off, low, high)


def affine(
    at: float, c: float, terms: Any, off: float, low: float = -math.inf, high: float = math.inf
) -> Form:
    """c and factors times coefficients, with a symbol of its own for what they are off."""
    error = off * ROOM
    length = max((len(d) for _, d in terms), default=0)
    if error > 0.0:
        length = SYMBOLS.count + 1
    d = np.zeros(length)
    for factor, of in terms:
        d[: len(of)] += of if factor == 1.0 else factor * of
    if error > 0.0:
        d[-1] = error
        SYMBOLS.count += 1
    return Form(at, low, high, c, d)


def _sum(a: Form, term: Any, side: float) -> Any:
    if isinstance(term, Dual):
        return NotImplemented
    b = form(term)
    if b.exact and b.c == 0.0:
        return a
    if a.exact and a.c == 0.0:
        return b if side > 0.0 else -b
    lowest, highest = (b.low, b.high) if side > 0.0 else (-b.high, -b.low)
    low, high, at = below(a.low + lowest), above(a.high + highest), a.at + side * b.at
    if a.d is None or b.d is None:
        return Form(at, low, high)
    x = side * b.c
    c = a.c + x
    t = c - a.c
    off = abs((a.c - (c - t)) + (x - t)) + ULP * 2 * (a.r + b.r)
    if off == 0.0 and not a.d.size and not b.d.size:
        return Form(at, c, c, c, NONE)
    return affine(at, c, [(1.0, a.d), (side, b.d)], off, low, high)


def form(x: Any) -> Any:
    """A number as a form."""
    if isinstance(x, Form):
        return x
    x = float(x)
    return Form(x, x, x, x, NONE) if math.isfinite(x) else unknown(x)


def unknown(at: float = NAN) -> Form:
    """A number of which nothing is known."""
    return Form(at, -math.inf, math.inf)


def within(value: float, tolerance: float) -> Form:
    """A number somewhere within its tolerance, with a symbol of its own."""
    return affine(value, value, [], tolerance, below(value - tolerance), above(value + tolerance))


def between(at: float, low: float, high: float) -> Form:
    """A number of which bounds are known, with a symbol of its own."""
    if not high - low < math.inf:
        return Form(at, low, high)
    c = 0.5 * (low + high)
    return affine(at, c, [], above(max(high - c, c - low)) + TINY, low, high)


def planned(x: Any) -> Any:
    """What a number or a truth value, or nested tuples of them, are at the planned design."""
    if isinstance(x, Planar):
        return complex(planned(x.real), planned(x.imag))
    if isinstance(x, tuple):
        parts = [planned(part) for part in x]
        return type(x)(*parts) if hasattr(x, "_fields") else tuple(parts)
    return x.at if isinstance(x, Form | Doubt) else planned(x.x) if isinstance(x, Dual) else x


def _forms(x: Any) -> Any:
    """Nested tuples of numbers as forms."""
    if isinstance(x, tuple):
        parts = [_forms(part) for part in x]
        return type(x)(*parts) if hasattr(x, "_fields") else tuple(parts)
    if isinstance(x, complex):
        return Planar(form(x.real), form(x.imag))
    return x if isinstance(x, bool | str | Planar | Form | Doubt) or x is None else form(x)


# -- sine, exponential ---------------------------------------------------------------------

BITS = 160


def _arctangent(n: int) -> int:
    """2^BITS times the arctangent of 1 / n, n >= 5, to 41 units."""
    return sum((-1) ** k * ((1 << BITS) // (n ** (2 * k + 1) * (2 * k + 1))) for k in range(41))


HALF_PI = 2 * (4 * _arctangent(5) - _arctangent(239))  # Machin; to 2^-150


def turn(x: float) -> tuple[float, float]:
    """Cosine and sine, rounded from whole numbers of 160 bits: wrong by half an ulp and 2^-110.

    For angles below 2^32: a unit too much in pi / 2 is 2^-118 there.
    """
    above_, under = x.as_integer_ratio()
    fixed = (above_ << BITS) // under
    quarter = (2 * fixed + HALF_PI) // (2 * HALF_PI)
    rest = fixed - quarter * HALF_PI
    square, sums = rest * rest >> BITS, []
    for first, term in ((0, 1 << BITS), (1, rest)):
        total, n = term, first
        while abs(term) > 1:
            term = -((term * square) >> BITS) // ((n + 1) * (n + 2))
            total, n = total + term, n + 2
        sums.append(total)
    cos, sin = sums
    sides = ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
    return sides[0] / (1 << BITS), sides[1] / (1 << BITS)


def exponential(x: float) -> float:
    """The exponential, rounded correctly from 40 digits."""
    if not -700.0 < x < 700.0:
        return 0.0 if x < 0.0 else math.inf
    return float(DIGITS.exp(DIGITS.create_decimal_from_float(x)))


# -- the primitives ------------------------------------------------------------------------


def either(open_: Doubt, a: Any, b: Any) -> Any:
    """What is a or b; an answer where the other is none: that is told by margins and outcomes."""
    if isinstance(a, bool | Doubt) or isinstance(b, bool | Doubt):
        return a if a is b else Doubt(planned(a) if open_.at else planned(b))
    if isinstance(a, Dual) or isinstance(b, Dual):
        a, b = dual(a), dual(b)
        return Dual(either(open_, a.x, b.x), 0.0 * a.d, np.full(a.d.shape, math.inf))
    at = planned(a) if open_.at else planned(b)
    if any(isinstance(x, float) and x != x for x in (a, b)):
        answer = form(b if isinstance(a, float) and a != a else a)
        return Form(at, answer.low, answer.high, answer.c, answer.d)
    a, b = form(a), form(b)
    half, apart = (a + b) * 0.5, (a - b) * 0.5
    low, high = min(a.low, b.low), max(a.high, b.high)
    if half.d is None or not apart.size < math.inf:
        return Form(at, low, high)
    return affine(at, half.c, [(1.0, half.d)], apart.size, low, high)


def where(condition: Any, a: Any, b: Any) -> Any:
    """See `blockmech.ground.plane.where`, and so on."""
    return either(condition, a, b) if isinstance(condition, Doubt) else a if condition else b


def maximum(a: Any, b: Any) -> Any:
    """The larger of two numbers; it is continuous."""
    first = a > b
    if not isinstance(first, Doubt):
        return a if first else b
    if isinstance(a, Dual) or isinstance(b, Dual):
        a, b = dual(a), dual(b)
        return Dual(maximum(a.x, b.x), *_hull(a.d, a.r, b.d, b.r))
    top = either(first, a, b)
    return Form(top.at, max(form(a).low, form(b).low), top.high, top.c, top.d)


def minimum(a: Any, b: Any) -> Any:
    """The smaller of two numbers."""
    return -maximum(-lifted(a), -lifted(b))


def lifted(x: Any) -> Any:
    """A number as a form, if it is no dual number."""
    return x if isinstance(x, Dual) else form(x)


def sqrt(x: Any) -> Any:
    """The square root."""
    return lifted(x).sqrt()


def exp(x: Any) -> Any:
    """The exponential."""
    return lifted(x).exp()


def sign(x: Any) -> Any:
    """-1, 0 or 1."""
    x = form(x)
    if x.exact or x.low > 0.0 or x.high < 0.0:
        return form(float(x.low > 0.0) - float(x.high < 0.0))
    return between(math.copysign(1.0, x.at), -1.0, 1.0)


def power(x: Any, y: Any) -> Any:
    """A power: of the exponential and the logarithm of its ends, without symbols."""
    x, y = form(x), form(y)
    at = SCALAR_PRIMITIVES["power"](x.at, y.at)
    if not (y.exact and x.low >= 0.0 and x.high < math.inf):
        return unknown(at)
    ends = sorted(_power(end, y.c) for end in (x.low, x.high))
    return between(at, max(ends[0] * (1.0 - 8 * EPS), 0.0), ends[1] * (1.0 + 8 * EPS))


def _power(x: float, y: float) -> float:
    if x == 0.0:
        return 0.0 if y > 0.0 else math.inf if y < 0.0 else 1.0
    log = DIGITS.ln(DIGITS.create_decimal_from_float(x))
    return float(DIGITS.exp(DIGITS.multiply(log, DIGITS.create_decimal_from_float(y))))


def expi(t: Any) -> Planar:
    """Unit vector at an angle."""
    return Planar(*lifted(t).turned())


def hyp(z: Planar) -> Any:
    """Length of a vector."""
    return sqrt(z.real * z.real + z.imag * z.imag)


def planar(x: Any, y: Any) -> Planar:
    """A vector from its components."""
    return Planar(lifted(x), lifted(y))


def mul(z: Planar, x: Any) -> Planar:
    """Vector times real."""
    return Planar(z.real * x, z.imag * x)


def imul(z: Planar, x: Any) -> Planar:
    """Vector turned by +90 degrees, times real."""
    return Planar(-z.imag * x, z.real * x)


def angle(a: Planar, b: Planar) -> Any:
    """Angle from a to b, in (-pi, pi]: one of the planned design, and a small one from there.

    |arctan t - t + t^3 / 3| <= |t|^5 / 5.
    """
    y, x = lifted(cross(a, b)), lifted(dot(a, b))
    if isinstance(y, Dual) or isinstance(x, Dual):
        y, x = dual(y), dual(x)
        return y.along(angle(Planar(1.0, 0.0), Planar(x.x, y.x)), x, y)
    at = math.atan2(y.at + 0.0, x.at)
    about = math.atan2(y.at, x.at) if y.at == y.at and x.at == x.at else 0.0
    cos, sin = (affine(v, v, [], ULP * abs(v) + 2.0**-100) for v in turn(about))
    tangent = (y * cos - x * sin) / (x * cos + y * sin)
    c, wide = tangent.c, tangent.size
    ahead = x * cos + y * sin
    low, high = min(tangent.low, 0.0), max(tangent.high, 0.0)
    if not ahead.low > 0.0:
        return Form(at, -PI, PI)
    small = Form(at, low, high)
    if tangent.d is not None and abs(c) < 1e-3:
        value, off = c - c**3 / 3.0, abs(c) ** 5 + 4 * ULP * abs(c)
        small = tangent.bent(at, value, off, 1.0 / (1.0 + c * c), (-wide, wide), low, high)
    total = form(about) + small
    total.at = at
    return total if total.low >= -PI and total.high <= PI else Form(at, -PI, PI)


PI = above(math.pi)


def rint(x: Form) -> Form:
    """The nearest whole number."""
    return Form(np.rint(x.at), float(np.rint(x.low)), float(np.rint(x.high)))


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.add: operator.add,
    np.subtract: operator.sub,
    np.multiply: operator.mul,
    np.divide: operator.truediv,
    np.arctan2: lambda y, x: angle(Planar(form(1.0), form(0.0)), Planar(x, y)),
    np.hypot: lambda x, y: hyp(Planar(x, y)),
    np.minimum: minimum,
    np.maximum: maximum,
    np.rint: rint,
    np.absolute: abs,
    np.negative: operator.neg,
}
"""NumPy's functions that outputs are read by, and its numbers' own arithmetic."""


def modulo(x: Any, period: Any) -> Any:
    """x less whole periods; anything within one where their number is in doubt."""
    x, period = form(x), form(period)
    at = SCALAR_PRIMITIVES["modulo"](x.at, period.at)
    rest = unknown()
    if math.isfinite(x.at / period.at):
        rest = x - period * float(math.floor(x.at / period.at))
    inside = rest.low >= 0.0 and rest.high <= period.low
    return (
        Form(at, rest.low, rest.high, rest.c, rest.d) if inside else between(at, 0.0, period.high)
    )


def piecewise(x: Any, knots: Any, rows: Any) -> Any:
    """A piecewise polynomial: what all pieces say in which x may be."""
    x, at = form(x), [form(k) for k in knots]
    value = SCALAR_PRIMITIVES["piecewise"](x.at, planned(tuple(knots)), planned(tuple(rows)))
    last, pieces = len(at) - 2, []
    for k, (start, end) in enumerate(itertools.pairwise(at)):
        if x.high < start.low or x.low > end.high or (x.low >= end.high and k < last):
            continue
        part = x
        if x.low < start.low or x.high > end.high:
            part = Form(x.at, max(x.low, start.low), min(x.high, end.high))
        s, total = part - start, form(rows[0][k])
        for row in rows[1:]:
            total = total * s + row[k]
        pieces.append(total)
    if not pieces or not (at[0].high <= x.low and x.high <= at[-1].low):
        return unknown(value)
    if len(pieces) == 1:
        return Form(value, pieces[0].low, pieces[0].high, pieces[0].c, pieces[0].d)
    return between(value, min(p.low for p in pieces), max(p.high for p in pieces))


def each(function: Any, *x: Any) -> Any:
    """A function of Python, of which nothing is known but its value at a number."""
    forms = [form(v) for v in x]
    value = function(*map(planned, forms))
    return form(value) if all(v.exact for v in forms) else unknown(value)


def times(step: Any, state: Any, count: int, *data: Any) -> Any:
    """A fixed number of steps, taken as they are."""
    for _ in range(count):
        state = step(state, *data)
    return state


def repeat(step: Any, state: Any, cap: int, *data: Any) -> Any:
    """The state at which the planned design ends: a number, of which nothing is proved yet."""
    if not planned(state[-1]):
        return state
    numbers, plain = planned(state), Binder(SCALAR_PRIMITIVES)(step)
    try:
        return _forms(SCALAR_PRIMITIVES["repeat"](plain, numbers, cap, *planned(data)))
    except (ArithmeticError, ValueError):
        return _lost(_forms(numbers))


def _lost(state: Any) -> Any:
    return each_part(lambda x: unknown(planned(x)), state)


# -- derivatives, for proofs ---------------------------------------------------------------


class Dual:
    """A number with its derivatives d (m,), each to r (m,)."""

    __slots__ = ("d", "r", "x")
    __array_ufunc__ = None

    def __init__(self, x: Form, d: Any = 0.0, r: Any = 0.0) -> None:
        self.x, self.d, self.r = x, np.asarray(d, float), np.asarray(r, float)

    def of(self, y: Form, slope: Form) -> Dual:
        """A function of it: value and slope."""
        return Dual(y, *_scaled(slope, self.d, self.r))

    def __add__(self, term: Any) -> Dual:
        b = dual(term)
        d = self.d + b.d
        return Dual(self.x + b.x, d, (self.r + b.r + EPS * abs(d)) * ROOM)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.x, -self.d, self.r)

    def __sub__(self, term: Any) -> Dual:
        return self + -dual(term)

    def __rsub__(self, term: Any) -> Dual:
        return dual(term) + -self

    def __mul__(self, term: Any) -> Dual:
        b = dual(term)
        y = self.of(self.x * b.x, b.x) + b.of(self.x, self.x)
        return Dual(self.x * b.x, y.d, y.r)

    __rmul__ = __mul__

    def __truediv__(self, term: Any) -> Dual:
        b = dual(term)
        y, part = self.x / b.x, form(1.0) / b.x
        change = self.of(y, part) + b.of(y, -y * part)
        return Dual(y, change.d, change.r)

    def __rtruediv__(self, term: Any) -> Dual:
        return dual(term) / self

    def __abs__(self) -> Dual:
        y = abs(self.x)
        return self if y is self.x else -self if self.x.high <= 0.0 else self.of(y, sign(self.x))

    def __lt__(self, term: Any) -> Any:
        return self.x < dual(term).x

    def __le__(self, term: Any) -> Any:
        return self.x <= dual(term).x

    def __gt__(self, term: Any) -> Any:
        return self.x > dual(term).x

    def __ge__(self, term: Any) -> Any:
        return self.x >= dual(term).x

    def __eq__(self, term: Any) -> Any:
        return self.x == dual(term).x

    __hash__ = None  # type: ignore[assignment]

    def sqrt(self) -> Dual:
        """The square root."""
        y = self.x.sqrt()
        return self.of(y, 0.5 / y)

    def turned(self) -> tuple[Dual, Dual]:
        """Cosine and sine."""
        cos, sin = self.x.turned()
        return self.of(cos, -sin), self.of(sin, cos)

    def along(self, turned: Form, x: Dual, y: Dual) -> Dual:
        """An angle, of components x and y."""
        square = x.x * x.x + y.x * y.x
        change = y.of(turned, x.x / square) + x.of(turned, -y.x / square)
        return Dual(turned, change.d, change.r)


def dual(x: Any) -> Dual:
    """A number with derivatives, zero of others."""
    return x if isinstance(x, Dual) else Dual(form(x))


def _scaled(factor: Form, d: Array, r: Array) -> tuple[Array, Array]:
    """Derivatives times a number."""
    if not factor.size < math.inf:
        return 0.0 * d, np.where((d == 0.0) & (r == 0.0), 0.0, math.inf)
    c = 0.5 * (factor.low + factor.high)
    off = max(factor.high - c, c - factor.low) * ROOM + TINY
    y = c * d
    return y, (abs(c) * r + off * (abs(d) + r) + EPS * abs(y)) * ROOM


def _hull(a: Array, r: Array, b: Array, s: Array) -> tuple[Array, Array]:
    """What holds both of two derivatives."""
    return 0.5 * (a + b), (0.5 * abs(a - b) + np.maximum(r, s) + EPS * (abs(a) + abs(b))) * ROOM


# -- systems -------------------------------------------------------------------------------


def combined(factors: Any, forms: Sequence[Form]) -> Form:
    """The sum of forms times factors."""
    pairs = [(f, x) for f, x in zip(factors, forms, strict=True) if f != 0.0 and x.size > 0.0]
    at = sum(f * x.at for f, x in pairs)
    if any(x.d is None for _, x in pairs):
        total: Any = form(0.0)
        for f, x in pairs:
            total = total + x * f
        return Form(at, total.low, total.high)
    c = math.fsum(f * x.c for f, x in pairs)
    size = sum(abs(f) * (abs(x.c) + len(pairs) * x.r) for f, x in pairs)
    return affine(at, c, [(f, x.d) for f, x in pairs], 4 * ULP * size + (TINY if pairs else 0.0))


class Matrix:
    """A matrix of numbers, some of them with derivatives, and the inverse of its middle."""

    def __init__(self, rows: Any) -> None:
        self.rows = tuple(tuple(row) for row in rows)
        plain = [[x.x if isinstance(x, Dual) else form(x) for x in row] for row in self.rows]
        self.forms, n = plain, len(plain)
        self.low, self.high = (
            np.array([[getattr(x, side) for x in row] for row in plain]) for side in ("low", "high")
        )
        with np.errstate(all="ignore"):
            self.middle = 0.5 * (self.low + self.high)
            self.off = np.maximum(self.high - self.middle, self.middle - self.low) * ROOM
        self.inverse, self.rest = np.zeros((n, n)), np.full((n, n), math.inf)

    @property
    def transposed(self) -> Matrix:
        """Columns for rows."""
        return Matrix(zip(*self.rows, strict=True))

    def invert(self) -> bool:
        """Whether every matrix within the bounds is regular: C A = 1 - rest, rest below 1."""
        if not (np.isfinite(self.low).all() and np.isfinite(self.high).all()):
            return False
        try:
            self.inverse = C = np.linalg.inv(self.middle)
        except np.linalg.LinAlgError:
            return False
        n = len(C)
        size = abs(C) @ (self.off + (n + 2) * EPS * abs(self.middle)) * ROOM
        self.rest = (abs(np.eye(n) - C @ self.middle) + size) * ROOM + TINY
        return bool(self.rest.sum(axis=1).max() * ROOM < 1.0)

    def doubt(self, size: Array) -> Array:
        """How far solutions may be off those of the middle, whose corrections are below a size."""
        highest = size.max(axis=0) / (1.0 - self.rest.sum(axis=1).max() * ROOM) * ROOM
        off: Array = self.rest.sum(axis=1).reshape(-1, *[1] * (size.ndim - 1)) * highest * ROOM
        return off


def matrix(rows: Any) -> Matrix:
    """A square matrix from rows of numbers."""
    return Matrix(rows)


def solve(a: Matrix, right: Any) -> tuple[Any, ...]:
    """Solution of a x = right: of the middle, then corrected by what is left there.

    With C the inverse of the middle and C a = 1 - E, x = x0 + C (right - a x0) + E (x - x0).
    """
    n = len(a.forms)
    if not a.invert():
        return tuple(
            Dual(unknown(), 0.0, math.inf) if _dual(a, right) else unknown() for _ in right
        )
    forms = [x.x if isinstance(x, Dual) else form(x) for x in right]
    if not all(x.size < math.inf for x in forms):
        return tuple(unknown() for _ in right)
    start = a.inverse @ np.array([0.5 * (x.low + x.high) for x in forms])
    misfits = [x - combined(start, row) for x, row in zip(forms, a.forms, strict=True)]
    moved = [combined(row, misfits) for row in a.inverse]
    off = a.doubt(np.array([x.size for x in moved]))
    x = [
        form(s) + (affine(m.at, m.c, [(1.0, m.d)], e) if m.d is not None else _wider(m, e))
        for s, m, e in zip(start.tolist(), moved, off.tolist(), strict=True)
    ]
    if not _dual(a, right):
        return tuple(x)
    change = [dual(v) for v in right]
    for i, row in enumerate(a.rows):
        for v, entry in zip(x, row, strict=True):
            if isinstance(entry, Dual):
                change[i] = change[i] - Dual(form(0.0), *_scaled(v, entry.d, entry.r))
    shape = np.broadcast_shapes(*(c.d.shape for c in change))
    d, r = (np.array([np.broadcast_to(getattr(c, k), shape) for c in change]) for k in "dr")
    if not np.isfinite(r).all():
        return tuple(Dual(v, 0.0 * d[0], np.full(shape, math.inf)) for v in x)
    y = a.inverse @ d
    wide = (abs(a.inverse) @ (r + (n + 2) * EPS * abs(d))) * ROOM + TINY
    wide = (wide + a.doubt(abs(y) + wide)) * ROOM
    return tuple(Dual(v, *both) for v, both in zip(x, zip(y, wide, strict=True), strict=True))


def _wider(x: Form, off: float) -> Form:
    return Form(x.at, below(x.low - off), above(x.high + off))


def _dual(a: Matrix, right: Any) -> bool:
    return any(isinstance(x, Dual) for row in (*a.rows, right) for x in row)


def solve_transposed(a: Matrix, right: Any) -> tuple[Any, ...]:
    """Solution of a^T x = right."""
    return solve(a.transposed, right)


def spread(a: Matrix) -> Form:
    """Ratio of extreme singular values: those of the middle, as far as its factors are right.

    Of U S V with U and V orthogonal but for errors e they are those of S but for a factor
    1 + e; and no further from those of a than it is from a (Weyl).
    """
    if not (np.isfinite(a.low).all() and np.isfinite(a.high).all()):
        return unknown()
    u, s, v = np.linalg.svd(a.middle)
    n, one = len(s), np.eye(len(s))
    tilt = sum(float(np.linalg.norm(x.T @ x - one)) for x in (u, v)) + 8 * n * n * EPS
    apart = np.linalg.norm(a.middle - (u * s) @ v) + np.linalg.norm(a.off)
    off = (float(apart) + (4 * n * n * EPS + 2 * tilt) * float(s[0])) * ROOM
    at, (highest, lowest) = float(s[-1] / s[0]), (float(s[0]), float(s[-1]))
    low = max(lowest - off, 0.0) / (highest + off)
    high = (lowest + off) / (highest - off) if highest > off else 1.0
    return Form(at, max(below(below(low)), 0.0), min(above(above(high)), 1.0))


# -- proofs --------------------------------------------------------------------------------


class _Links:
    """The unknowns of a state: numbers, and of links places and turns from directions of length 1.

    The length of a direction is none: steps leave it as it is.
    """

    def __init__(self, state: Any) -> None:
        self.state = state
        self.numbers = [x for part in state for x in self._of(part)]

    def _of(self, part: Any) -> list[float]:
        if isinstance(part, LinkPosition):
            return [part.o.real, part.o.imag, 0.0]
        return [part]

    def at(self, x: Any) -> tuple[Any, ...]:
        """The state of some numbers."""
        args, pair = iter(x), []
        for part in self.state:
            if not isinstance(part, LinkPosition):
                pair.append(next(args))
                continue
            place = Planar(next(args), next(args))
            pair.append(LinkPosition(place, self._unit(part.e) * expi(next(args))))
        return tuple(pair)

    def of(self, state: Any) -> list[Any]:
        """The numbers of a state near by."""
        rows: list[Any] = []
        for error, part in zip(self.state, state, strict=True):
            if isinstance(error, LinkPosition):
                rows += [part.o.real, part.o.imag, angle(self._unit(error.e), part.e)]
            else:
                rows.append(part)
        return rows

    def _unit(self, e: complex) -> Planar:
        z = Planar(form(e.real), form(e.imag))
        return mul(z, form(1.0) / hyp(z))


def implicit(step: Any, state: Any, *data: Any) -> Any:
    """The state that a step of Newton's method proves, with nothing known where it proves none."""
    links = _Links(planned(state[0]))
    x0 = links.numbers
    if not all(map(math.isfinite, x0)):
        return (_lost(_forms(links.state)), *state[1:])
    first = links.of(step((links.at(map(form, x0)), *state[1:]), *data)[0])
    off = np.array([max(abs(y.high - x), abs(x - y.low)) for y, x in zip(first, x0, strict=True)])
    plain = _bounds(data)
    box = 2.0 * off + EPS * off.max(initial=0.0) + TINY
    for _ in range(ATTEMPTS):
        reach = _reach(step, links, box, state, plain) if np.isfinite(box).all() else box
        need = (off + reach) * ROOM
        if shrunk(need, box):
            proved = [_widened(y, e) for y, e in zip(first, reach.tolist(), strict=True)]
            return (links.at(proved), *state[1:])
        box = 2.0 * need
    return (_lost(_forms(links.state)), *state[1:])


def shrunk(need: Array, box: Array) -> bool:
    """Whether a step maps a box into its inside."""
    return bool((need < box).all())


def _reach(step: Any, links: _Links, box: Array, state: Any, data: Any) -> Array:
    """|N'(X) (X - x0)| of a box."""
    m, x = len(box), []
    for k, (at, wide) in enumerate(zip(links.numbers, box.tolist(), strict=True)):
        seed = np.zeros(m)
        seed[k] = 1.0
        x.append(Dual(Form(at, below(at - wide), above(at + wide)), seed, np.zeros(m)))
    rows = [dual(y) for y in links.of(step((links.at(x), *state[1:]), *data)[0])]
    slopes = np.array([np.broadcast_to(abs(y.d) + y.r, (m,)) for y in rows])
    with np.errstate(all="ignore"):
        reach: Array = np.nan_to_num(slopes @ box, nan=math.inf) * ROOM + TINY
    return reach


def _widened(x: Form, off: float) -> Form:
    if x.d is None:
        return _wider(x, off)
    return affine(x.at, x.c, [(1.0, x.d)], off)


def _bounds(data: Any) -> Any:
    """Nested tuples of numbers without their symbols."""
    if isinstance(data, tuple | list):
        parts = [_bounds(part) for part in data]
        return type(data)(*parts) if hasattr(data, "_fields") else tuple(parts)
    if isinstance(data, Planar):
        return Planar(_bounds(data.real), _bounds(data.imag))
    return data.bounds if isinstance(data, Form) else data


# -- the engine ----------------------------------------------------------------------------

_OWN = (where, maximum, minimum, sqrt, exp, sign, power, expi, hyp, planar, mul, imul, angle)
_MORE = (cross, dot, modulo, piecewise, each, times, repeat, implicit, matrix, solve)
PRIMITIVES: dict[str, Any] = {
    **{f.__name__: f for f in (*_OWN, *_MORE, solve_transposed, spread)},
    "EPS": EPS,
}
"""The primitives of the plane on forms."""


def held(a: Any, b: Any) -> float:
    """The larger length, of the planned design: a scale does not vary."""
    return float(max(planned(a), planned(b)))


def one_by_one(function: Callable[..., tuple[float, ...]], *x: Any) -> tuple[Any, ...]:
    """A function of numbers, of which nothing is known where they vary."""
    values = function(*map(planned, map(form, x)))
    return values if all(form(v).exact for v in x) else tuple(map(unknown, values))


@primitives_of.register(Form)
def _of_forms(x: object) -> Mapping[str, Any]:
    return {**PRIMITIVES, "maximum": held, "one_by_one": one_by_one}


class EnclosedEngine:
    """A program bound to forms, one sample at a time."""

    name = "enclosed"

    def __init__(self, program: Program) -> None:
        self.program = program
        constants = {"ZERO": _forms(0j), "ONE": _forms(1 + 0j), "REST": REST_SHARE}
        self._program = bind(program, PRIMITIVES, constants, _at_planned)

    def one(self, inputs: Sequence[Any], parameters: Sequence[Any]) -> tuple[Any, ...]:
        """Values of one sample, forms or `Planar` pairs of them."""
        return self._program(*map(form, inputs), tuple(map(_forms, parameters)))


def _at_planned(function: Any) -> Any:
    """A function that is no kernel, such as a group's path from home, of the planned design."""
    return lambda *args: function(*planned(args))
