"""The friction equations of a group, and what is solved for them: kernels over the primitives.

With signed Coulomb factors k_j of its pairs j, the loads F on them affine in the friction t:

    t_j = k_j g_j(F_j),      F_j = f_j + sum_m R_jm t_m,

g the norm of the pair's load: the length of the reaction for a revolute pair, the larger of
N and 2 C / L for a prismatic one (``edges``).

Whether they have a solution for every load is one number c. The indices sign det(1 - diag(k) dg R)
of all solutions of a group sum to the same number for every load, as the equations are positively
homogeneous far out: that number is the degree of their loads-free part. For a dyad it is 1 where
``c < 1``: there is a solution for every load, and their number is odd. Where ``c > 1`` it is 0, of
a guide with a length also -1: the solution that is connected with zero friction, of index +1, is
not the only one, or there is none.

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

Sources: [R10] Ruiz, Durango & Calle 2010, steps 1-5; Radons & Tonelli-Cueto, Generalized Perron
roots and solvability of the absolute value equation, SIAM J. Matrix Anal. Appl. 44 (2023), for
existence with guides alone; the homogeneous form, and existence with pins, are blockmech's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from blockmech.ground.plane import EPS, NAN, dot, hyp, maximum, mul, planar, sqrt, where
from blockmech.ground.tolerances import ROUNDED, ROUNDING
from blockmech.typing import Complex, Edges, Influences, Planars, Real, Reals, Values

SETTLED = ROUNDING / EPS  # [ulps] corrections and residuals: Newton's next step is rounding


class Equations(NamedTuple):
    """The equations of the m pairs of a group that have friction."""

    k: Reals  # signed Coulomb factors [m] or [-]
    edges: Edges  # True for a pair whose load is the larger component
    base: Planars  # loads [N] without friction
    rows: Influences  # m x m, of unit friction on the loads


def load_norm(F: Complex, edge: bool) -> Real:
    """Load on a pair [N]: length of a reaction, or larger component at a guide."""
    return maximum(abs(F.real), abs(F.imag)) if edge else hyp(F)


def loads(t: Reals, base: Planars, rows: Influences) -> tuple[Complex, ...]:
    """Loads on all pairs with friction t."""
    forces = []
    for f, row in zip(base, rows, strict=True):
        for x, influence in zip(t, row, strict=True):
            f = f + mul(influence, x)
        forces.append(f)
    return tuple(forces)


def norms(F: Planars, edges: Edges) -> tuple[Real, ...]:
    """Norms of several loads."""
    return tuple(load_norm(f, e) for f, e in zip(F, edges, strict=True))


def largest_of(values: Reals) -> Real:
    """The largest of some numbers without their signs."""
    top = abs(values[0])
    for x in values[1:]:
        top = maximum(top, abs(x))
    return top


def coulomb(k: Reals, g: Reals) -> tuple[Real, ...]:
    """Coulomb's law: the friction that loads on the pairs stand for."""
    return tuple(kj * gj for kj, gj in zip(k, g, strict=True))


def misfit(t: Reals, k: Reals, g: Reals) -> Real:
    """Residual [-] of t = k g, relative to the largest friction."""
    friction = coulomb(k, g)
    best = largest_of(friction)
    worst = largest_of([a - b for a, b in zip(t, friction, strict=True)])
    return worst / where(best > 0.0, best, 1.0)


def contraction_bound(k: Reals, edges: Edges, rows: Influences) -> Real:
    """Upper bound of P: the fourth root of the largest row sum of |R k|^4.

    From loads to loads, so that couples and forces in one group have one unit.
    """
    A = [
        [load_norm(x, e) * abs(km) for x, km in zip(row, k, strict=True)]
        for e, row in zip(edges, rows, strict=True)
    ]
    if len(A) == 1:
        return A[0][0]
    sums = [along(row, [1.0] * len(row)) for row in A]
    for _ in range(3):  # powers of the matrix on a row of ones, never their products
        sums = [along(row, sums) for row in A]
    return sqrt(sqrt(largest_of(sums)))


def slope(F: Complex, g: Real, influence: Complex, edge: bool) -> Real:
    """Derivative of a load's norm in the direction of an influence."""
    if edge:
        by_N = where(F.real < 0.0, -influence.real, influence.real)
        by_C = where(F.imag < 0.0, -influence.imag, influence.imag)
        return where(abs(F.real) >= abs(F.imag), by_N, by_C)
    projection = F.real * influence.real + F.imag * influence.imag
    return projection / where(g > 0.0, g, 1.0)


def homogeneous(v: Reals, contacts: Values, of: Equations) -> list[list[Real]]:
    """The equations in unknowns v = (n, eta, lambda), t = n / eta, and factors lambda k:

        G_j(v) = n_j - lambda k_j g_j(eta f_j + sum_m R_jm n_m),     |n|^2 + eta^2 - 1

    Lines of their Jacobian; behind it what they are at v, and zeros. Guides are pressed along
    their contacts, of +-N (x) or +-2 C / L (y).
    """
    k, edges, base, rows = of
    *n, eta, scale = v
    nothing = 0.0 * eta  # of the engine's precision, as all that is exchanged with others
    F = loads(n, [mul(f, eta) for f in base], rows)
    lines = []
    for j, (load, edge, contact) in enumerate(zip(F, edges, contacts, strict=True)):
        size = hyp(load)
        u = planar(*contact) if edge else mul(load, 1.0 / where(size > 0.0, size, 1.0))
        g = dot(u, load) if edge else size
        kj = scale * k[j]
        line = [(1.0 if m == j else 0.0) - kj * dot(u, R) for m, R in enumerate(rows[j])]
        lines.append([*line, -kj * dot(u, base[j]), -k[j] * g, n[j] - kj * g, nothing])
    sphere = [2.0 * y for y in (*n, eta)]
    return [*lines, [*sphere, nothing, along(v[:-1], v[:-1]) - 1.0, nothing]]


def limits_of(contacts: Values, edges: Edges, base: Planars, rows: Influences) -> list[list[Real]]:
    """Rows whose products with v are not negative while contacts hold, two for each guide.

    Pressed by F along c, a guide keeps that contact while F is between i c and -i c by 45
    degrees: while F has no component against (1 - i) c, or (1 + i) c.
    """
    rows_of = []
    for j, (edge, contact) in enumerate(zip(edges, contacts, strict=True)):
        if edge:
            x, y = contact
            for u in (planar(x + y, y - x), planar(x - y, x + y)):
                rows_of.append([*(dot(u, R) for R in rows[j]), dot(u, base[j]), 0.0 * x])
    return rows_of


def chosen(condition: Real, a: Reals, b: Reals) -> tuple[Real, ...]:
    """The numbers of one row where the condition holds, else those of the other."""
    return tuple(where(condition, x, y) for x, y in zip(a, b, strict=True))


def along(a: Reals, b: Reals) -> Real:
    """Scalar product of two rows."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def eliminate(matrix: Sequence[Reals], pivoting: bool = False) -> tuple[list[list[Real]], Real]:
    """Solutions for the right sides behind a square matrix, and its determinant.

    Without pivoting for an H-matrix, which that of Newton's method is wherever P < 1. With it,
    NaN for a singular one.
    """
    rows, n, det = [list(row) for row in matrix], len(matrix), 1.0
    for p in range(n):
        for q in range(p + 1, n) if pivoting else ():
            larger = abs(rows[q][p]) > abs(rows[p][p])
            pairs = list(zip(rows[p][p:], rows[q][p:], strict=True))
            rows[p][p:] = [where(larger, y, x) for x, y in pairs]
            rows[q][p:] = [where(larger, -x, y) for x, y in pairs]  # the determinant is kept
        if pivoting:
            rows[p][p] = where(rows[p][p] == 0.0, NAN, rows[p][p])
            det = det * rows[p][p]
        pivot = 1 / rows[p][p]
        for row in rows[p + 1 :]:
            factor = row[p] * pivot
            pairs = list(zip(row[p + 1 :], rows[p][p + 1 :], strict=True))
            row[p + 1 :] = [x - factor * y for x, y in pairs]
    return [_substituted(rows, k) for k in range(n, len(rows[0]))], det


def _substituted(rows: list[list[Real]], k: int) -> list[Real]:
    """Solution of a triangle of equations for the right side in column k."""
    x = [row[k] for row in rows]
    for p in reversed(range(len(x))):
        for m in range(p + 1, len(x)):
            x[p] = x[p] - rows[p][m] * x[m]
        x[p] = x[p] / rows[p][p]
    return x


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
