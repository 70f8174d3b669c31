"""Ends and turning points of a function of one coordinate, to rounding.

Three tools, for functions that are known at single places only:

- `last_place` halves a bracket between a place where something holds and one where it
  does not, until no number lies between them;
- `least_place` closes in on a minimum by the golden section: it needs no smoothness, but
  a smooth minimum is flat, so its place comes out to the square root of rounding only;
- `turning_place` finds a smooth extremum as a root of the derivative of a Chebyshev
  interpolant, which keeps the place to rounding over the curvature. The values are
  sampled as widely around as the interpolant converges, because differentiation
  magnifies their rounding by (number of nodes) / (width).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

GOLDEN = (math.sqrt(5) - 1) / 2
REACHES = (64.0, 32.0, 16.0, 8.0, 4.0, 2.0, 1.0, 0.5)  # half widths tried, in brackets
SURE = 1e-12  # of a bracket: an error of the place that needs no better
HALVINGS = 200  # more than any bracket of doubles of like size has
NODES = 32
PHI = (np.arange(NODES) + 0.5) * (math.pi / NODES)
POINTS: Floats = np.cos(PHI)
COSINES: Floats = (2 / NODES) * np.cos(np.outer(np.arange(NODES), PHI))  # values -> series
COSINES[0] /= 2
TAIL = 6  # last coefficients that judge an interpolant: several, because some vanish by symmetry


def last_place(holds: Callable[[float], bool], inside: float, outside: float) -> float:
    """The last place, going from ``inside`` to ``outside``, where a condition holds.

    ``inside`` is taken to hold and ``outside`` not to; they are not asked.
    """
    for _ in range(HALVINGS):
        middle = inside + (outside - inside) / 2
        if middle in (inside, outside):
            break
        if holds(middle):
            inside = middle
        else:
            outside = middle
    return inside


def least_place(
    function: Callable[[float], float], low: float, high: float, steps: int = 48
) -> tuple[float, float]:
    """Place and value of a minimum between two places, by the golden section.

    Each step leaves 0.618 of the bracket (48 steps: 1e-10). NaN counts as large.
    """
    a, b = low, high
    x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    at_x, at_y = _large(function(x)), _large(function(y))
    for _ in range(steps):
        if at_x <= at_y:
            b, y, at_y = y, x, at_x
            x = b - GOLDEN * (b - a)
            at_x = _large(function(x))
        else:
            a, x, at_x = x, y, at_y
            y = a + GOLDEN * (b - a)
            at_y = _large(function(y))
    return (x, at_x) if at_x <= at_y else (y, at_y)


def _large(x: float) -> float:
    return math.inf if math.isnan(x) else x


class Turning(NamedTuple):
    """A smooth extremum: its place, and the error of the place by the interpolant's tail."""

    place: float
    error: float


def turning_place(
    function: Callable[[Floats], Floats],
    bracket: tuple[float, float],
    widest: tuple[float, float],
    sign: int,
) -> Turning | None:
    """Place of the one maximum (``sign`` +1) or minimum (-1) in a bracket.

    Parameters
    ----------
    function : (n,) -> (n,), values at places; NaN where there is none
    bracket : the extremum lies between these
    widest : places beyond these must not be asked

    Returns
    -------
    Turning, or None where the function is not smooth enough to have one
    """
    best: Turning | None = None
    low, high = bracket
    for reach in REACHES:
        grown = (reach - 0.5) * (high - low)
        a, b = max(widest[0], low - grown), min(widest[1], high + grown)
        found = _turning_in(function, a, b, bracket, sign)
        if found is not None and (best is None or found.error < best.error):
            best = found
            if best.error <= SURE * (high - low):
                break
    return best


def _turning_in(
    function: Callable[[Floats], Floats],
    a: float,
    b: float,
    bracket: tuple[float, float],
    sign: int,
) -> Turning | None:
    """The extremum by one interpolant on [a, b]."""
    centre, half = a + (b - a) / 2, (b - a) / 2
    if not half > 0:
        return None
    values = sign * function(centre + half * POINTS)
    if not np.isfinite(values).all():
        return None
    c = COSINES @ values
    slope: Floats = np.asarray(chebyshev.chebder(c), dtype=float)
    z = _falling_root(slope, (bracket[0] - centre) / half, (bracket[1] - centre) / half)
    if z is None:
        return None
    curvature = abs(_series(np.asarray(chebyshev.chebder(slope)), z))
    if not curvature > 0:
        return None
    # Noise of size t in the values is noise of about t times the number of nodes in the slope.
    error = half * NODES * float(np.abs(c[-TAIL:]).max()) / curvature
    return Turning(centre + half * z, error) if error < bracket[1] - bracket[0] else None


def _falling_root(slope: Floats, low: float, high: float) -> float | None:
    """Where a Chebyshev series falls through zero between two places."""
    low, high = max(low, -1.0), min(high, 1.0)
    if not _series(slope, low) > 0 > _series(slope, high):
        return None
    return last_place(lambda z: _series(slope, z) > 0, low, high)


def _series(c: Floats, z: float) -> float:
    return float(c @ np.cos(np.arange(len(c)) * math.acos(z)))
