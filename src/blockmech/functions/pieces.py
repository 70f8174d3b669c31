"""Functions of one variable: polynomials, piecewise ones, their kinks and their period.

Coefficients of a piece are of powers of the distance from its knot.

Source: de Boor, A Practical Guide to Splines, 1978 (through SciPy's splines).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

from blockmech.ground.plane import apply
from blockmech.typing import Real, Reals

Row: TypeAlias = tuple[float, ...]
Rows: TypeAlias = tuple[Row, ...]
"""One coefficient of each piece a row, highest power first."""


def horner(x: Real, coefficients: Sequence[Real]) -> Real:
    """A polynomial by its coefficients, highest power first."""
    total = coefficients[0] + 0.0 * x
    for c in coefficients[1:]:
        total = total * x + c
    return total


def straight(x: Sequence[float], y: Sequence[float]) -> Rows:
    """Rows of the straight lines through points."""
    rises = zip(pairwise(x), pairwise(y), strict=True)
    return tuple((d - c) / (b - a) for (a, b), (c, d) in rises), tuple(y[:-1])


def cubic(x: Sequence[float], y: Sequence[float], repeats: bool) -> Rows:
    """Rows of the cubic spline through points, not-a-knot or of one that repeats periodic."""

    def coefficients(*numbers: float) -> Row:
        from scipy.interpolate import CubicSpline

        ends = "periodic" if repeats else "not-a-knot"
        c = CubicSpline(numbers[: len(x)], numbers[len(x) :], bc_type=ends).c
        return tuple(map(float, c.ravel()))

    flat, n = apply("one_by_one", coefficients, *x, *y), len(x) - 1
    return tuple(flat[k : k + n] for k in range(0, len(flat), n))


def derivatives(pieces: Sequence[Reals]) -> tuple[Rows, Rows, Rows]:
    """Rows of pieces by their coefficients, from s^0 on, and of their first two derivatives."""
    n = max(3, *map(len, pieces))
    rows = []
    full = [[*c, *[0.0] * (n - len(c))] for c in pieces]
    for _ in range(3):
        rows.append(tuple(zip(*(reversed(c) for c in full), strict=True)))
        full = [[k * x for k, x in enumerate(c)][1:] for c in full]
    return rows[0], rows[1], rows[2]


class Knotted:
    """A function of one variable that is smooth between its knots; by default it has none."""

    @property
    def whole(self) -> float:
        """Period of the argument, 0 where nothing repeats."""
        return 0.0

    @property
    def covers_one_turn(self) -> bool:
        """Whether it repeats after a turn of its argument."""
        return False

    def knots(self) -> Sequence[float]:
        """Arguments at which it, or a derivative of it, jumps: rising, those of one period."""
        return ()

    def rows(self) -> Sequence[float]:
        """Knots; those of a periodic function with the end of the period."""
        knots = self.knots()
        return [*knots, float(knots[0] + self.whole)] if knots and self.whole else knots

    def within(self, low: float, high: float) -> Sequence[float]:
        """Knots from low to high, repeated for a periodic function."""
        knots = self.knots()
        if not knots or not self.whole:
            return [x for x in knots if low <= x <= high]
        first = math.floor((low - knots[-1]) / self.whole)
        last = math.ceil((high - knots[0]) / self.whole)
        repeated = (x + k * self.whole for k in range(first, last + 1) for x in knots)
        return [x for x in repeated if low <= x <= high]

    def next_kink(self, x: float) -> float:
        """The first knot after an argument; infinite for none."""
        last = x + 2 * self.whole if self.whole else math.inf
        return min((y for y in self.within(x, last) if y > x), default=math.inf)

    def kinks_of_angle(self) -> Sequence[float]:
        """Knots in [-pi, pi] of a function of an angle that jumps there."""
        return (*self.within(-math.pi, math.pi), *(() if self.covers_one_turn else (math.pi,)))
