"""Polynomials and piecewise polynomials of one variable: their coefficients, and Horner's scheme.

Coefficients of a piece are of powers of the distance from its knot.

Source: de Boor, A Practical Guide to Splines, 1978 (through SciPy's splines).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, TypeAlias

from blockmech.ground.plane import apply
from blockmech.typing import Real

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


def derivatives(pieces: Sequence[Sequence[Any]]) -> tuple[Rows, Rows, Rows]:
    """Rows of pieces by their coefficients, from s^0 on, and of their first two derivatives."""
    n = max(3, *map(len, pieces))
    rows = []
    full = [[*c, *[0.0] * (n - len(c))] for c in pieces]
    for _ in range(3):
        rows.append(tuple(zip(*(reversed(c) for c in full), strict=True)))
        full = [[k * x for k, x in enumerate(c)][1:] for c in full]
    return rows[0], rows[1], rows[2]
