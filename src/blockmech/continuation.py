"""Continuation of a curve through the zeros of a function with one unknown too many.

Pseudo-arclength: a step goes along the tangent and Newton comes back across it; it was too long
if that fails or the tangent turns much. So turning points are ordinary points. The direction of
travel is told by the sign of det [J; tangent], which is one along the whole curve.

Source: Allgower & Georg, Introduction to Numerical Continuation Methods, SIAM 2003.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.plane import EPS

Array: TypeAlias = NDArray[np.float64]
Curve: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""Unknowns v (m + 1,) -> G (m,), which is zero on the curve, and its Jacobian (m, m + 1)."""

SHARPEST = 0.95  # cosine of the largest turn of the tangent in one step: 18 degrees
CORRECTED = 1e-12  # last correction, of unknowns of size one: Newton's next one is rounding
NEWTON = 6  # corrections of a step; it needs 3 or is too long


class Point(NamedTuple):
    """A point of a curve: unknowns and unit tangent (m + 1,), the latter in travel's direction."""

    v: Array
    tangent: Array


def side(curve: Curve, at: Point) -> float:
    """Sign of det [J; tangent]: the direction of travel."""
    return float(np.sign(np.linalg.det(np.vstack([curve(at.v)[1], at.tangent]))))


def point(curve: Curve, v: Array, way: float | None = None) -> Point:
    """A point of the curve in a direction of travel; by default the last unknown grows."""
    null: Array = np.linalg.svd(curve(v)[1])[2][-1]
    forward = null[-1] if way is None else way * side(curve, Point(v, null))
    return Point(v, -null if forward < 0 else null)


def correct(curve: Curve, guess: Array, row: Array) -> Array | None:
    """The point of the curve near a guess where ``row @ v`` is that of the guess, or None."""
    x = guess
    for _ in range(NEWTON):
        G, J = curve(x)
        try:
            dx = np.linalg.solve(np.vstack([J, row]), np.append(G, row @ (x - guess)))
        except np.linalg.LinAlgError:
            return None
        x = x - dx
        if np.abs(dx).max() < CORRECTED:
            return x
    return None


def advance(curve: Curve, at: Point, step: float) -> Point | None:
    """One step further along the curve, or None where it is too long."""
    v = correct(curve, at.v + step * at.tangent, at.tangent)
    if v is None:
        return None
    ahead = point(curve, v, side(curve, at))
    return ahead if ahead.tangent @ at.tangent >= SHARPEST else None


def crossing(curve: Curve, at: Point, step: float, rest: Callable[[Array], float]) -> float:
    """The step, at most a given one, at which the rest of something is used up.

    ``rest`` takes a point of the curve; it is not positive at the whole step. Where it is
    nothing at the beginning, it grows at first.
    """
    from scipy.optimize import brentq

    def left(h: float) -> float:
        v = correct(curve, at.v + h * at.tangent, at.tangent)
        return -1.0 if v is None else rest(v)

    low = 0.0 if rest(at.v) > 0 else step / 2
    while low > EPS * step and left(low) <= 0:
        low /= 2
    if left(low) <= 0 or left(step) > 0:
        return step
    return float(brentq(left, low, step, xtol=EPS * step, rtol=4 * EPS))
