"""How near a matrix is to a singular one, in machine code: extreme singular values, lanes together.

Mirrors from the left and the right leave two diagonals, whose squares q and e are those of the
matrix's singular values. Laguerre's method comes to the smallest and to the largest of them from
outside, each step one way through the factors of B^T B - x, which keep small ones exact:

    D_i = q_i + s_i,    s_1 = -x,    s_{i+1} = s_i e_i / D_i - x

Source: Golub & Van Loan, Matrix Computations, 2013, 5.4.8 (two diagonals); Fernando & Parlett,
Accurate singular values and differential qd algorithms, Numer. Math. 67 (1994), sec. 4 and 5.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from blockmech.engines.kinds import Reals
from blockmech.ground.plane import EPS

STEPS = 60  # of Laguerre's method: six or so, more where several values lie together


class Lanes(NamedTuple):
    """Matrices side by side, and their number of rows."""

    lanes: int
    n: int


def spread(of: Lanes, a: Annotated[Reals, "of.lanes"]) -> None:
    """The ratio of the extreme singular values takes the place of the first entry.

    a : (n n, lanes) columns of the matrix one after the other; what was in it is gone
    """
    n = of.n
    for c in range(n):
        mirrored(of, a, c * n + c, 1, n - c, n, n - 1 - c)
        if c < n - 2:
            mirrored(of, a, (c + 1) * n + c, n, n - 1 - c, 1, n - 1 - c)
    total = a[0] * a[0]
    for i in range(n):
        a[i * n + i] *= a[i * n + i]
        if i > 0:
            a[i * n + i - 1] *= a[i * n + i - 1]
            total += a[i * n + i] + a[i * n + i - 1]
    a[1], a[2] = 0.0 * total, total
    extreme(of, a, 1, 1.0)
    extreme(of, a, 2, -1.0)
    a[0] = np.sqrt(a[1] / a[2])


def extreme(of: Lanes, a: Annotated[Reals, "of.lanes"], at: int, side: float) -> None:
    """The smallest (side 1) or largest (-1) square, from what stands at a row."""
    n, x = of.n, a[at] + 0.0
    going, unknown = x >= 0.0, a[2] * 0.0
    for _ in range(STEPS):
        s, s1, s2 = -x, unknown - 1.0, unknown
        slope, bend = unknown, unknown
        for i in range(n):
            inverse = 1.0 / (a[i * n + i] + s)
            part = s1 * inverse
            slope = slope + part
            bend = bend + part * part - s2 * inverse
            if i < n - 1:
                e = a[(i + 1) * n + i] * inverse
                factor = e * a[i * n + i] * inverse
                s, s1, s2 = s * e - x, factor * s1 - 1.0, factor * (s2 - 2.0 * (s1 * part))
        square = n * bend - slope * slope
        root = np.sqrt((n - 1.0) * np.where(square > 0.0, square, unknown))
        step = float(n) / (side * root - slope)
        step = np.where(abs(step) < a[2], step, unknown)
        x = np.where(going, x + step, x)
        going = going & (abs(step) > 4.0 * EPS * x)
        if not np.any(going):
            break
    a[at] = x


def mirrored(
    of: Lanes,
    a: Annotated[Reals, "of.lanes"],
    first: int,
    step: int,
    count: int,
    apart: int,
    images: int,
) -> None:
    """Turn a row or column (every step-th entry) onto its first entry, and others with it."""
    total = a[first] * a[first]
    for i in range(1, count):
        total += a[first + i * step] * a[first + i * step]
    edge = np.sqrt(total)
    edge = np.where(a[first] > 0.0, -edge, edge)
    half = total - edge * a[first]
    share = np.where(half > 0.0, 1.0 / half, 0.0)
    a[first] -= edge
    for k in range(1, images + 1):
        entry = first + k * apart
        factor = a[first] * a[entry]
        for i in range(1, count):
            factor += a[first + i * step] * a[entry + i * step]
        factor *= share
        for i in range(count):
            a[entry + i * step] -= factor * a[first + i * step]
    a[first] = edge
