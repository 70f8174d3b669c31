r"""The triad: a platform on three legs (class III, third order), its conditions and their rates.

              P3          platform   one link with three pins (or guides) P1, P2, P3
             /  \         legs       a link each, from the platform to an earlier link
           P1----P2
           |      \       leg RR: pin on the platform at the distance l from the pivot G
          G1       G2     leg RP: pivot G at the offset h from a guide line of the platform
                          leg PR: pin of the platform at the offset h from an earlier guide

The letters of a leg are those of its outer and of its platform pair. Given where the
earlier links hold the legs, the platform's origin o and its unit direction e have three
conditions, one a leg:

    RR  |o + e P - G| = l      RP  cross(e d, G - o - e P) = h      PR  cross(u, o + e P - G) = h

Their rows of rates are the unit forces that the legs can exert, so their determinant
is zero where the three lines of action meet in a point or are parallel: a dead centre.

Everything is computed for n triads at once, in lengths of one size about one place.

The platform's direction follows by elimination, from a trigonometric polynomial of degree three.
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

Sources: [M96] Merlet, Direct kinematics of planar parallel manipulators, ICRA 1996, and
[GS93] Gosselin & Sefrioui, Polynomial solutions for the direct kinematic problem of planar
three-degree-of-freedom parallel manipulators, ICAR 1991 (there with half angles).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS, cross, dot
from blockmech.typing import Array, Complex, Floats, Guide, Planars, Real, Reals, Vectors

LegKind: TypeAlias = Literal["RR", "RP", "PR"]
Support: TypeAlias = Complex | Guide
"""Where an earlier link holds a leg: a pivot [m], or a `Guide` (leg PR); or (n,) of them."""


class Triad(NamedTuple):
    """A platform and its three legs; numbers of legs are (3,), or (n, 3) for n triads.

    kinds : letters of each leg's outer pair and of its pair at the platform
    pins : places [m] of the pins, or of points of the guide lines (RP), on the platform
    reaches : lengths l (RR), or offsets h from the guide (RP, PR) to the left of it [m]
    alongs : unit directions of the guides on the platform (RP)
    """

    kinds: Sequence[LegKind]
    pins: Vectors | Planars
    reaches: Floats | Reals
    alongs: Vectors | Planars = (1, 1, 1)

    @classmethod
    def rrr(cls, lengths: Floats | Reals, pins: Vectors | Planars) -> Triad:
        """Legs of given lengths [m] at pins [m] of the platform."""
        return cls(("RR", "RR", "RR"), pins, lengths)


class Placed(NamedTuple):
    """n triads held by earlier links, in lengths of one size about one place.

    ``o`` of a pose in these numbers is the place of the platform's centre, the middle of
    its pins.
    """

    kinds: tuple[LegKind, ...]
    pins: Vectors  # (n, 3) about the platform's centre
    reaches: Floats  # (n, 3)
    alongs: Vectors  # (n, 3)
    pivots: Vectors  # (n, 3)
    guides: Vectors  # (n, 3) unit directions of earlier guides (PR)
    centres: Vectors  # (n,) [m] of the platform, in its own frame
    size: float  # [m]
    origin: complex  # [m]

    def rows(self, index: Any) -> Placed:
        """Some of the triads."""
        pins, reaches, alongs, pivots, guides, centres = (x[index] for x in self[1:7])
        arrays = (self.kinds, pins, reaches, alongs, pivots, guides, centres)
        return Placed(*arrays, self.size, self.origin)

    def pose(self, x: Floats) -> tuple[Vectors, Vectors]:
        """Origins (n,) [m] and directions (n,) of the platform's own frame, from x (n, 3)."""
        e = np.exp(1j * x[:, 2])
        return self.origin + self.size * (x[:, 0] + 1j * x[:, 1]) - e * self.centres, e

    def conditions(self, x: Floats) -> tuple[Floats, Floats]:
        """The conditions (n, 3) and their rates (n, 3, 3) by x (n, 3): centre and angle."""
        o, e = x[:, 0] + 1j * x[:, 1], np.exp(1j * x[:, 2])
        f, rows = np.empty((len(x), 3)), np.empty((len(x), 3, 3))
        for k, kind in enumerate(self.kinds):
            arm, reach = e * self.pins[:, k], self.reaches[:, k]
            at, away = arm, o + arm - self.pivots[:, k]
            if kind == "RR":
                r, force = np.abs(away), away / reach
                f[:, k] = (r - reach) * ((r + reach) / (2 * reach))
            elif kind == "PR":
                force = 1j * self.guides[:, k]
                f[:, k] = dot(force, away) - reach
            else:
                force, at = -1j * e * self.alongs[:, k], self.pivots[:, k] - o
                f[:, k] = dot(force, away) - reach
            rows[:, k] = np.stack([force.real, force.imag, cross(at, force)], axis=-1)
        return f, rows


def placed(
    triad: Triad, supports: Sequence[Support], like: Placed | None = None, n: int = 1
) -> Placed:
    """Hold a triad at three supports, one a leg, in n places.

    Lengths are measured by the largest one at the first place, or as in ``like``.
    """
    pins, reaches, alongs = (_three_columns(x, n) for x in triad[1:])
    guided = [isinstance(s, Guide) for s in supports]
    pivots = _three_columns([s.p if g else s for s, g in zip(supports, guided, strict=True)], n)
    guides = _three_columns([s.u if g else 1 for s, g in zip(supports, guided, strict=True)], n)
    centres = pins.mean(axis=1)
    pins = pins - centres[:, None]
    if like is None:
        origin = complex(pivots[0, 0])
        size = max(float(np.abs(x[0]).max()) for x in (pivots - origin, pins, reaches))
    else:
        size, origin = like.size, like.origin
    kinds = tuple(triad.kinds)
    pins, reaches, pivots = pins / size, reaches / size, (pivots - origin) / size
    return Placed(kinds, pins, reaches, alongs, pivots, guides, centres, size, origin)


def _three_columns(numbers: Array | Planars, n: int) -> Array:
    """Three numbers, three arrays (n,) of them, or one (n, 3), as an array (n, 3)."""
    if isinstance(numbers, np.ndarray) and numbers.ndim == 2:
        return numbers
    return np.stack([np.broadcast_to(x, n) for x in numbers], axis=-1)


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
    coefficients_ = (np.fft.fft(f) / len(CIRCLE))[:, np.arange(-3, 4)]
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
