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
to rounding.
Source: [M96] Merlet, Direct kinematics of planar parallel manipulators, ICRA 1996, and
[GS93] Gosselin & Sefrioui, Polynomial solutions for the direct kinematic problem of planar
three-degree-of-freedom parallel manipulators, ICAR 1991 (there with half angles).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS, cross, dot
from blockmech.modes.triad import Placed
from blockmech.typing import Floats, Real, Vectors

CIRCLE = np.exp(2j * np.pi * np.arange(16) / 16)  # 7 samples are needed, more halve rounding
NEGLIGIBLE = 32 * EPS  # of the largest coefficient: a leading one below it is rounding


class Lines(NamedTuple):
    """Two lines and a circle about ``middle``, or three lines, for shifts at directions (n, m)."""

    normals: Vectors  # (2 or 3, n, m)
    sides: Floats  # (2 or 3, n, m)
    middle: Vectors  # (n, m) centre of the circle
    radius: Floats  # (n, 1); 0 where there is no circle


def lines(placed: Placed, e: Vectors) -> Lines:
    """What the legs of n triads leave of the shift at directions e (n, m)."""
    circles = [k for k, kind in enumerate(placed.kinds) if kind == "RR"]
    first = min(circles, key=lambda k: placed.reaches[:, k].sum(), default=-1)
    radius = placed.reaches[:, first, None] * bool(circles)
    feet = [placed.pivots[:, k, None] - e * placed.pins[:, k, None] for k in range(3)]
    middle = feet[first] * bool(circles)
    normals: list[Real] = []
    sides: list[Real] = []
    for k, kind in enumerate(placed.kinds):
        reach, foot = placed.reaches[:, k, None], feet[k] - middle  # its pin is at G there
        if k == first:
            continue
        if kind == "RR":
            normals.append(foot)
            sides.append((np.abs(foot) ** 2 - (reach - radius) * (reach + radius)) / 2)
        else:
            directions_of_legs = placed.guides if kind == "PR" else placed.alongs
            normal = 1j * directions_of_legs[:, k, None] * (np.ones_like(e) if kind == "PR" else e)
            normals.append(normal)
            sides.append(dot(normal, foot) + (reach if kind == "PR" else -reach))
    return Lines(np.array(normals), np.array(sides), middle, radius)


def eliminant(placed: Placed, e: Vectors) -> tuple[Floats, Floats]:
    """F (n, m) at directions e (n, m), zero where a triad closes; and the size of its terms."""
    n, c, _, radius = lines(placed, e)
    if len(n) == 3:
        turns = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        f = sum(c[i] * cross(n[j], n[k]) for i, j, k in turns)
        return f, sum(np.abs(c[i] * n[j] * n[k]) for i, j, k in turns)
    reach, det = np.abs(c[1] * n[0] - c[0] * n[1]), radius * np.abs(cross(n[0], n[1]))
    terms = np.abs(c[1] * n[0]) + np.abs(c[0] * n[1]) + radius * np.abs(n[0] * n[1])
    return (reach - det) * (reach + det), terms**2


def coefficients(placed: Placed) -> Vectors:
    """Coefficients f_-3 ... f_3 (n, 7) of F.

    Raises `RequestError` if F is zero everywhere: the platform can stand at any direction.
    """
    f, terms = eliminant(placed, np.broadcast_to(CIRCLE, (len(placed.pins), len(CIRCLE))))
    spectrum = np.fft.fft(f) / len(CIRCLE)
    coefficients_ = spectrum[:, np.arange(-3, 4)]
    if np.any(np.abs(coefficients_).max(axis=1) <= NEGLIGIBLE * terms.max(axis=1)):
        reason = "the platform can move although its supports stand"
        valid = "three legs hold it if none is the same as another or all are parallel guides"
        remedy = "leave one leg out, or place its joints elsewhere"
        raise refused("legs", reason, remedy, valid, "bad-triad")
    return np.asarray((coefficients_ + coefficients_[:, ::-1].conj()) / 2)


def directions(f: Vectors) -> Vectors:
    """The complex directions e where F = 0: six, fewer if leading coefficients vanish.

    f_k and f_-k are equally large, so the roots come in pairs z, 1 / conj z, and the
    eigenvalues of the balanced companion matrix are as good as the coefficients.
    """
    while len(f) > 1 and np.abs(f[-1]) <= NEGLIGIBLE * np.abs(f).max():
        f = f[1:-1]
    return np.asarray(np.roots(f[::-1]), complex)


def shifts(placed: Placed, e: Vectors) -> Vectors:
    """Shifts (n, 1 or 3) that may go with directions e (n,): starts of Newton's method.

    Where the two best lines cut each other; and where the better one cuts the circle, or
    comes nearest to it, for directions in which both nearly fall together.
    """
    n, c, middle, radius = (x[..., 0] for x in lines(placed, e[:, None]))
    pairs = ((0, 1), (1, 2), (2, 0))[: 1 if len(n) == 2 else 3]
    sines = np.array([cross(n[a], n[b]) / np.abs(n[a] * n[b]) for a, b in pairs])
    best = np.nanargmax(np.abs(np.nan_to_num(sines)), axis=0)
    a, b = np.array(pairs)[best].T
    row = np.arange(len(e))
    det = cross(n[a, row], n[b, row])
    cut = middle + 1j * (c[b, row] * n[a, row] - c[a, row] * n[b, row]) / det
    if len(n) == 3:
        return np.asarray(cut[:, None])
    better = np.abs(n).argmax(axis=0)
    length = np.abs(n[better, row])
    away, depth = n[better, row] / length, np.clip(c[better, row] / length, -radius, radius)
    half = np.sqrt((radius - depth) * (radius + depth))
    chord = [middle + away * (depth + side * half) for side in (1j, -1j)]
    return np.stack([cut, *chord], axis=-1)
