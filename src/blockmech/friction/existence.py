"""Whether the friction equations of a group have a solution for every load: one number.

The indices sign det(1 - diag(k) dg R) of all solutions of a group sum to the same number for
every load, as the equations are positively homogeneous far out: that number is the degree of
their loads-free part. For a dyad it is 1 where ``c < 1``: there is a solution for every load, and
their number is odd. Where ``c > 1`` it is 0, of a guide with a length also -1: the solution that
is connected with zero friction, of index +1, is not the only one, or there is none.

Without loads the links of a dyad are in equilibrium under two forces each: all its pairs carry
the same force X.

- Pins alone, X = sum_j R_j k_j |X|: c = |sum_j R_j k_j|.
- Pins and a guide of normal force N, |X| = sqrt(N^2 + (k N)^2): c = |sqrt(1 + k^2) a + b|, with
  a = sum_pins R_Nj k_j and b = R_N k.
- The guide with a length, pressed by g = max(|N|, 2 |C| / L): the load that the friction of one
  newton of load brings, |X| being a root of a quadratic equation.
- Two guides: eigenvalues of N = |R k N| with N >= 0, those above 1 taken in pairs.
- One pair with friction, of any group: c = |k| g(R).

c = 1 is where reactions grow without bound; a solution comes from infinity there or goes there.

Sources: blockmech's own for pins and guides with pins; Radons & Tonelli-Cueto, Generalized Perron
roots and solvability of the absolute value equation, SIAM J. Matrix Anal. Appl. 44 (2023), for
guides alone.
"""

from __future__ import annotations

from blockmech.friction.equations import load_norm
from blockmech.ground.plane import EPS, hyp, maximum, mul, sqrt, where
from blockmech.ground.tolerances import ROUNDED
from blockmech.typing import Influences, Real, Reals, Values


def existence(k: Reals, contacts: Values, rows: Influences) -> Real:
    """The number c [-] of a group: of a dyad, or of one pair with friction.

    Parameters
    ----------
    k : m signed Coulomb factors [m] or [-]
    contacts : m numbers of ways in which a pair is pressed: 0 of a pin, 2 of a guide, 4 of one
        with a length
    rows : m x m influences of unit friction on the loads
    """
    guides = [j for j, n in enumerate(contacts) if n]
    if len(k) == 1:
        return abs(k[0]) * load_norm(rows[0][0], bool(guides))
    if not guides:
        parts = [mul(R, kj) for R, kj in zip(rows[0], k, strict=True)]
        return cancelled(hyp(sum_of(parts)), [hyp(part) for part in parts])
    if len(guides) == 1:
        return by_guide(guides[0], k, contacts, rows)
    A = [[rows[p][q].real * k[q] for q in guides] for p in guides]
    return of_two(A[0][0], A[0][1], A[1][0], A[1][1])


def sum_of(parts: Reals) -> Real:
    """The sum of some numbers or vectors."""
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def cancelled(c: Real, sizes: Reals) -> Real:
    """A sum that may be rounding of its parts: then it is zero, as couples may cancel."""
    return where(c <= ROUNDED * EPS * sum_of(sizes), 0.0 * c, c)


def by_guide(g: int, k: Reals, contacts: Values, rows: Influences) -> Real:
    """c of pins and a guide."""
    parts = [mul(rows[g][j], k[j]) for j, n in enumerate(contacts) if not n]
    pins, of_guide, square = sum_of(parts), mul(rows[g][g], k[g]), k[g] * k[g]
    a = pins.real
    if contacts[g] == 2:
        sizes = [abs(part.real) for part in (*parts, of_guide)]
        return cancelled(abs(a * sqrt(1.0 + square) + of_guide.real), sizes)
    # |X| = s per newton on the guide: s^2 = (a s + b)^2 + k^2, its smaller positive root; where
    # |a| > 1 there is a larger one, beyond which the sum of the indices is 0 again.
    b, top = of_guide.real, of_guide.real * of_guide.real + square
    root = sqrt(maximum(top - a * a * square, 0.0))
    below, above = root - a * b, -root - a * b
    nearest_load = top / where(below > 0.0, below, 1.0)
    largest_load = top / where(above > 0.0, above, 1.0)
    c = load_norm(mul(pins, nearest_load) + of_guide, True)
    second_c = load_norm(mul(pins, largest_load) + of_guide, True)
    twice = (abs(a) > 1.0) & (top > a * a * square) & (above > 0.0) & (second_c > 0.0)
    both = maximum(c, 1.0 / where(second_c > 0.0, second_c, 1.0))
    return where(abs(a) <= 1.0, maximum(c, abs(a)), where(twice, both, abs(a)))


def of_two(a: Real, b: Real, c: Real, d: Real) -> Real:
    """c of two guides: the largest eigenvalue of N = |A N|, N >= 0, of its odd ones above 1."""
    alternating, low, high = 1.0 + 0.0 * a, 0.0 * a, 0.0 * a
    for p, q in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        trace, det = p * a + q * d, p * q * (a * d - b * c)
        spread = trace * trace - 4.0 * det
        root = sqrt(maximum(spread, 0.0))
        for size in (0.5 * (trace + root), 0.5 * (trace - root)):
            # eigenvectors (p b, size - p a) and (size - q d, q c): either may vanish
            first_component, second_component = p * b * (size - p * a), (size - q * d) * q * c
            real = (spread >= 0.0) & (first_component >= 0.0) & (second_component >= 0.0)
            # (1, 0) and (0, 1) belong to both signs of their zero, and count once
            first = (c == 0.0) & (abs(size - p * a) <= ROUNDED * EPS * size)
            second = (b == 0.0) & (abs(size - q * d) <= ROUNDED * EPS * size)
            real = where(first, q > 0.0, where(second, p > 0.0, real))
            size = where(real & (size > 0.0), size, 0.0)
            alternating = where(size > 1.0, -alternating, alternating)
            low, high = maximum(low, where(size > 1.0, 0.0, size)), maximum(high, size)
    return where(alternating < 0.0, high, low)
