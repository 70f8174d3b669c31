"""The platform's direction by elimination: a trigonometric polynomial of degree three.

Held at a given direction e, the platform can only be shifted, and each leg confines the
shift o to a circle (RR, centre M = G - e P, radius l) or to a line (RP, PR). The
difference of two circles is a line too, so there are two lines,

    dot(nu_a, o) = c_a,  dot(nu_b, o) = c_b   =>   o = i (c_b nu_a - c_a nu_b) / cross(nu_a, nu_b)

and the circle that is left, |N|^2 - l^2 D^2 = 0 with o = N / D, is a condition on e
alone. N and D are polynomials in e and 1/e, and their degrees leave

    F(e) = sum of f_k e^k, k = -3 ... 3,   f_-k = conj f_k   (real on the unit circle)

for every mix of legs: six complex directions, real ones on the unit circle. No half
angle is used, so no direction is special. F is the Cayley-Menger determinant of the
centres and the place they have in common; for three lines it is their 3 x 3 determinant.

Where D = 0 the lines fall on each other and one direction may belong to two poses,
which mirror each other on the line of the centres.

The coefficients come from samples on the unit circle, which multiplies the polynomials
to rounding; the samples show also how large the rounding is.
Source: [M96] Merlet, Direct kinematics of planar parallel manipulators, ICRA 1996, and
[GS93] Gosselin & Sefrioui, Polynomial solutions for the direct kinematic problem of planar
three-degree-of-freedom parallel manipulators, ICAR 1991 (there with half angles).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import Problem, RequestError
from blockmech.modes.triad import Floats, Placed

DEGREE = 3
POINTS = 16  # on the unit circle; 7 would do, the others show the rounding
CIRCLE = np.exp(2j * np.pi * np.arange(POINTS) / POINTS)
EPS = float(np.finfo(float).eps)
NEGLIGIBLE = 32 * EPS  # of the largest coefficient: a leading one below it is rounding
ALIGNED = 0.05  # of its size at most: a determinant below it may belong to two poses


class Lines(NamedTuple):
    """Two lines and a circle (or three lines) for the shift, at directions (n,).

    ``rows`` are normals and right sides of lines, about ``middle``; ``radius`` is NaN
    where there is no circle.
    """

    normals: NDArray[Any]  # (2 or 3, n) complex
    sides: Floats  # (2 or 3, n)
    middle: NDArray[Any]  # (n,) complex, centre of the circle
    radius: float


def lines(held: Placed, e: NDArray[Any]) -> Lines:
    """What the legs leave of the shift at directions e (n,)."""
    circles = [k for k, kind in enumerate(held.kinds) if kind == "RR"]
    first = min(circles, key=lambda k: held.reaches[k]) if circles else -1
    middle = held.pivots[first] - e * held.pins[first] if circles else np.zeros_like(e)
    normals, sides = [], []
    for k, kind in enumerate(held.kinds):
        reach = held.reaches[k]
        foot = held.pivots[k] - e * held.pins[k] - middle  # where o - middle has its pin at G
        if kind == "RR":
            if k == first:
                continue
            other = held.reaches[first]
            normals.append(foot)
            sides.append((np.abs(foot) ** 2 - (reach - other) * (reach + other)) / 2)
        elif kind == "PR":
            normal = 1j * held.guides[k] * np.ones_like(e)
            normals.append(normal)
            sides.append(reach + _dot(normal, foot))
        else:
            normal = 1j * held.alongs[k] * e
            normals.append(normal)
            sides.append(_dot(normal, foot) - reach)
    radius = held.reaches[first] if circles else float("nan")
    return Lines(np.array(normals), np.array(sides), middle, radius)


def eliminant(held: Placed, e: NDArray[Any]) -> Floats:
    """F at directions e (n,): zero where the triad closes."""
    at = lines(held, e)
    n, c = at.normals, at.sides
    if len(n) == 3:
        f = c[0] * _cross(n[1], n[2]) + c[1] * _cross(n[2], n[0]) + c[2] * _cross(n[0], n[1])
        return np.asarray(f)
    det = _cross(n[0], n[1])
    reach = np.abs(c[1] * n[0] - c[0] * n[1])
    return np.asarray((reach - at.radius * np.abs(det)) * (reach + at.radius * np.abs(det)))


def coefficients(held: Placed) -> tuple[NDArray[Any], float]:
    """Coefficients f_-3 ... f_3 (7,) of F, and the rounding in them."""
    spectrum = np.fft.fft(eliminant(held, CIRCLE)) / POINTS
    f = spectrum[np.arange(-DEGREE, DEGREE + 1)]
    beyond = spectrum[DEGREE + 1 : POINTS - DEGREE]
    return (f + f[::-1].conj()) / 2, float(np.abs(beyond).max())


def directions(held: Placed) -> NDArray[Any]:
    """The complex directions e where F = 0: six, fewer if leading coefficients vanish.

    Real modes have theirs on the unit circle. Raises `RequestError` if F is zero
    everywhere: the platform can stand at any direction.
    """
    f, _ = coefficients(held)
    largest = float(np.abs(f).max())
    if largest <= NEGLIGIBLE * _terms(held):
        raise RequestError(
            Problem(
                "bad-triad",
                "legs",
                "the platform can move although its supports stand",
                "three legs hold it if none is the same as another or all are parallel guides",
                "leave one leg out, or place its joints elsewhere",
            )
        )
    while len(f) > 1 and np.abs(f[-1]) <= NEGLIGIBLE * largest:
        f = f[1:-1]
    if len(f) < 2:
        return np.empty(0, complex)
    # f_k and f_-k are equally large, so the roots come in pairs z, 1 / conj z, and the
    # eigenvalues of the balanced companion matrix are as good as the coefficients.
    return np.asarray(np.roots(f[::-1]), dtype=complex)


def _terms(held: Placed) -> float:
    """Size of the terms that F is the sum of."""
    at = lines(held, CIRCLE)
    n, c = np.abs(at.normals), np.abs(at.sides)
    if len(n) == 3:
        return float((c[0] * n[1] * n[2] + c[1] * n[2] * n[0] + c[2] * n[0] * n[1]).max())
    return float(((c[0] * n[1] + c[1] * n[0] + at.radius * n[0] * n[1]) ** 2).max())


def shifts(held: Placed, e: complex) -> list[complex]:
    """Shifts o that go with a direction: one, or two where the lines nearly fall together.

    They are starting points for Newton's method, also where F is only nearly zero.
    """
    at = lines(held, np.array([e]))
    n, c = at.normals[:, 0], at.sides[:, 0]
    pairs = [(0, 1)] if len(n) == 2 else [(0, 1), (1, 2), (2, 0)]
    sines = [float(_cross(n[a], n[b]) / (abs(n[a] * n[b]) or 1.0)) for a, b in pairs]
    k = int(np.argmax(np.abs(sines)))
    a, b = pairs[k]
    middle, found = complex(at.middle[0]), []
    if sines[k]:
        det = sines[k] * abs(n[a] * n[b])
        found.append(middle + complex(1j * (c[b] * n[a] - c[a] * n[b]) / det))
    if len(n) == 2 and abs(sines[k]) < ALIGNED:
        found += _chord(middle, at.radius, n, c)
    if len(n) == 2 and float(np.abs(n).max()) < ALIGNED:  # the circles nearly coincide
        found += [middle + at.radius * complex(z) for z in CIRCLE[1::5]]
    return found


def _chord(middle: complex, radius: float, n: NDArray[Any], c: Floats) -> list[complex]:
    """Where the better of two lines cuts the circle; its nearest point if it does not."""
    k = int(np.argmax(np.abs(n)))
    if n[k] == 0:
        return []
    away = complex(n[k] / abs(n[k]))
    depth = float(c[k] / abs(n[k]))
    half = (radius - depth) * (radius + depth)
    if half <= 0:
        return [middle + away * max(-radius, min(radius, depth))]
    side = 1j * away * half**0.5
    return [middle + away * depth + side, middle + away * depth - side]


def _cross(a: Any, b: Any) -> Any:
    return a.real * b.imag - a.imag * b.real


def _dot(a: Any, b: Any) -> Any:
    return a.real * b.real + a.imag * b.imag
