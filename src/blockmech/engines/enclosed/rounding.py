"""Bounds of rounding, and functions whose last digit is certain: from integers and decimals.

Source: Rump, Verification methods, Acta Numerica 19 (2010), section 10.
"""

from __future__ import annotations

import math
import sys
from decimal import Context

from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import ROUNDING

ULP = EPS / 2  # largest relative error of one operation
ROUNDED_UP = 1.0 + ROUNDING  # for the roundings in a bound itself
TINY = sys.float_info.min / EPS  # what numbers lose that are smaller than the smallest normal one
BITS = 160  # of the integers by which sine and cosine are computed
DIGITS = Context(prec=40)  # its exponential and logarithm are rounded correctly


def below(x: float) -> float:
    """The next number below; minus infinity of NaN."""
    return math.nextafter(x, -math.inf) if x == x else -math.inf


def above(x: float) -> float:
    """The next number above; infinity of NaN."""
    return math.nextafter(x, math.inf) if x == x else math.inf


PI = above(math.pi)


def _arctangent(n: int) -> int:
    """2^BITS times the arctangent of 1 / n, n >= 5, to 41 units."""
    return sum((-1) ** k * ((1 << BITS) // (n ** (2 * k + 1) * (2 * k + 1))) for k in range(41))


HALF_PI = 2 * (4 * _arctangent(5) - _arctangent(239))  # Machin; to 2^-150


def cosine_and_sine(x: float) -> tuple[float, float]:
    """Cosine and sine of |x| < 2^32, to half an ulp and 2^-110.

    A unit too much in pi / 2 is 2^-118 there.
    """
    numerator, denominator = x.as_integer_ratio()
    fixed = (numerator << BITS) // denominator
    quarter = (2 * fixed + HALF_PI) // (2 * HALF_PI)
    rest = fixed - quarter * HALF_PI
    square, sums = rest * rest >> BITS, []
    for n, term in ((0, 1 << BITS), (1, rest)):
        total = term
        while abs(term) > 1:
            term = -((term * square) >> BITS) // ((n + 1) * (n + 2))
            total, n = total + term, n + 2
        sums.append(total)
    cos, sin = sums
    turned = ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
    return turned[0] / (1 << BITS), turned[1] / (1 << BITS)


def exponential(x: float) -> float:
    """The exponential, rounded correctly from 40 digits."""
    if not -700.0 < x < 700.0:
        return 0.0 if x < 0.0 else math.inf
    return float(DIGITS.exp(DIGITS.create_decimal_from_float(x)))


def power(x: float, exponent: float) -> float:
    """A power of x >= 0, by exponential and logarithm of 40 digits."""
    if x == 0.0:
        return 0.0 if exponent > 0.0 else math.inf if exponent < 0.0 else 1.0
    log = DIGITS.ln(DIGITS.create_decimal_from_float(x))
    return float(DIGITS.exp(DIGITS.multiply(log, DIGITS.create_decimal_from_float(exponent))))
