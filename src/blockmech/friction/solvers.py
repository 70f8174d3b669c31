"""Solvers of a group's friction equations, batch-transparent like kernels.

Every reaction is affine in the friction couples and forces t, so a group's
equations are, for its pairs j with signed Coulomb factors k_j,

    t_j = k_j g_j(F_j),      F_j = f_j + sum_m R_jm t_m,

with g the norm of the pair's load: the length of the reaction for a revolute
pair, the larger of N and 2 C / L for a prismatic one (``edges``).

Each sample stops by itself and is then left alone, so an answer never depends on
the batch it came in. **Certificate**: if the spectral radius P of the matrix
|k_j| |R_jm| is below 1 the map is a contraction and exactly one solution exists.
Where that is not proved, continuation from zero friction decides
(`blockmech.friction.continuation`).

Sources: [R10] section "Kinetostatics ...", steps 1-5; Newton and the certificate
are blockmech's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from blockmech.friction.continuation import Outcome, bounded, confirmed, replaced
from blockmech.plane import EPS, NAN, hyp, maximum, mul, repair, some, sqrt, where
from blockmech.typing import Complex, Real

CAP = 100  # iterations of `successive` before it counts as not converged
NEWTON_CAP = 12
SETTLED = 4500.0  # [ulps] residual above which Newton was caught between contacts of guides


class Solution(NamedTuple):
    """Solved friction of a group, and how it went."""

    t: tuple[Real, ...]  # [N m] or [N] on the later links
    g: tuple[Real, ...]  # [N] loads on the pairs
    iterations: Real  # [-]
    residual: Real  # [-] of t = k g, relative to the largest friction
    contraction: Real  # [-] bound P, or the observed ratio of changes
    outcome: Real  # see `Outcome`
    limit: Real  # [-] scale of the friction factors up to which a solution exists


def load_norm(F: Complex, edge: bool) -> Real:
    """Load on a pair [N]: length of a reaction, or larger component at a guide."""
    return maximum(abs(F.real), abs(F.imag)) if edge else hyp(F)


def loads(t: Any, base: Any, rows: Any) -> tuple[Complex, ...]:
    """Loads on all pairs with friction t."""
    found = []
    for f, row in zip(base, rows, strict=True):
        for x, influence in zip(t, row, strict=True):
            f = f + mul(influence, x)
        found.append(f)
    return tuple(found)


def norms(F: Any, edges: Any) -> tuple[Real, ...]:
    """Norms of several loads."""
    return tuple(load_norm(f, e) for f, e in zip(F, edges, strict=True))


def contraction_bound(k: Any, edges: Any, rows: Any) -> Real:
    """Upper bound of P: the fourth root of the largest row sum of |R k|^4.

    From loads to loads, so that couples and forces in one group have one unit.
    """
    A = [
        [load_norm(x, e) * abs(km) for x, km in zip(row, k, strict=True)]
        for e, row in zip(edges, rows, strict=True)
    ]
    if len(A) == 1:
        return A[0][0]
    for _ in range(2):
        A = [[_inner(row, col) for col in zip(*A, strict=True)] for row in A]
    top = sum(A[0])
    for row in A[1:]:
        top = maximum(top, sum(row))
    return sqrt(sqrt(top))


def _inner(row: Any, col: Any) -> Real:
    total = row[0] * col[0]
    for a, b in zip(row[1:], col[1:], strict=True):
        total = total + a * b
    return total


def _known(base: Any, edges: Any) -> Real:
    """Whether the loads are numbers; they are not where a later group cannot close."""
    return 0.0 * _top(norms(base, edges)) == 0.0


def _top(values: Any) -> Real:
    top = abs(values[0])
    for x in values[1:]:
        top = maximum(top, abs(x))
    return top


def direct(k: Any, edges: Any, base: Any) -> Solution:
    """Friction of a driven pair: the load on the pair does not depend on it."""
    g = norms(base, edges)
    t = tuple(kj * gj for kj, gj in zip(k, g, strict=True))
    zero = 0.0 * t[0]
    return Solution(t, g, zero, zero, zero, zero, zero + 1.0)


def single(k: Any, edges: Any, base: Any, rows: Any) -> Solution:
    """One correction: friction from the frictionless loads ([R10], rough calculation)."""
    return _successive(k, edges, base, rows, 0.0, 1)


def successive(
    k: Any, edges: Any, base: Any, rows: Any, tolerance: float, iterations: int | None
) -> Solution:
    """Successive approximations ([R10] steps 1-5), stopped by change or by count."""
    return _successive(k, edges, base, rows, tolerance, iterations)


def _successive(
    k: Any, edges: Any, base: Any, rows: Any, tolerance: float, iterations: int | None
) -> Solution:
    g = norms(base, edges)
    t = tuple(0.0 * x for x in g)
    count = 0.0 * g[0]
    before, ratio, residual = count, count, count
    going = count <= 1.0  # false for NaN: an impossible sample is left alone
    for n in range(iterations if iterations is not None else CAP):
        next_t = tuple(kj * gj for kj, gj in zip(k, g, strict=True))
        next_g = norms(loads(next_t, base, rows), edges)
        steps = tuple(b - a for a, b in zip(g, next_g, strict=True))
        change = _top(steps)
        misfit = _top([kj * s for kj, s in zip(k, steps, strict=True)])
        scale = _top([kj * gj for kj, gj in zip(k, next_g, strict=True)])
        t = tuple(where(going, new, old) for new, old in zip(next_t, t, strict=True))
        g = tuple(where(going, new, old) for new, old in zip(next_g, g, strict=True))
        residual = where(going, misfit / where(scale > 0.0, scale, 1.0), residual)
        count = where(going, count + 1.0, count)
        if n:
            ratio = where(going, change / where(before > 0.0, before, 1.0), ratio)
        before = where(going, change, before)
        if iterations is None:
            going = going & (change > tolerance)
            if not some(going):
                break
    P = contraction_bound(k, edges, rows)
    late = going if iterations is None else (P < 0.0)
    outcome = where(late, float(Outcome.NOT_CONVERGED), count * 0.0)
    t = tuple(where(late, NAN, x) for x in t)
    solution = Solution(t, g, count, residual, where(count > 1.0, ratio, P), outcome, P * 0.0 + 1.0)
    unproved = (P >= 1.0) & _known(base, edges)
    if iterations is not None:
        counted: Solution = repair(unproved, bounded, solution, k, edges, base, rows)
        return counted
    judged: Solution = repair(unproved, confirmed, solution, k, edges, base, rows, tolerance)
    return judged


def newton(k: Any, edges: Any, base: Any, rows: Any) -> Solution:
    """Newton from the second successive iterate, certified sample by sample."""
    n = len(k)
    g = norms(base, edges)
    t = tuple(kj * gj for kj, gj in zip(k, g, strict=True))
    t = tuple(kj * gj for kj, gj in zip(k, norms(loads(t, base, rows), edges), strict=True))
    P = contraction_bound(k, edges, rows)
    count = 0.0 * P
    going = P < 1.0
    best = count
    for _ in range(NEWTON_CAP):
        F = loads(t, base, rows)
        g = norms(F, edges)
        r = [tj - kj * gj for tj, kj, gj in zip(t, k, g, strict=True)]
        slope = [[_slope(F[j], g[j], rows[j][m], edges[j]) for m in range(n)] for j in range(n)]
        step = eliminate(
            [[(1.0 if j == m else 0.0) - k[j] * slope[j][m] for m in range(n)] for j in range(n)],
            r,
        )
        t = tuple(where(going, tj - dj, tj) for tj, dj in zip(t, step, strict=True))
        count = where(going, count + 1.0, count)
        best = _top([kj * gj for kj, gj in zip(k, g, strict=True)])
        going = going & _moved(step, k, g)
        if not some(going):
            break
    g = norms(loads(t, base, rows), edges)
    misfit = _top([tj - kj * gj for tj, kj, gj in zip(t, k, g, strict=True)])
    residual = misfit / where(best > 0.0, best, 1.0)
    solution = Solution(t, g, count, residual, P, count * 0.0, count * 0.0 + 1.0)
    unproved = ((P >= 1.0) & _known(base, edges)) | (residual > SETTLED * EPS)
    settled: Solution = repair(unproved, replaced, solution, k, edges, base, rows)
    return settled


def _moved(step: Any, k: Any, g: Any) -> Real:
    """Whether a step changes any pair's friction by more than rounding of the largest load."""
    top = 4.0 * EPS * _top(g)
    excess = abs(step[0]) - top * abs(k[0])
    for d, kj in zip(step[1:], k[1:], strict=True):
        excess = maximum(excess, abs(d) - top * abs(kj))
    return excess > 0.0


def _slope(F: Complex, g: Real, influence: Complex, edge: bool) -> Real:
    """Derivative of a load's norm in the direction of an influence."""
    if edge:
        along_N = where(F.real < 0.0, -influence.real, influence.real)
        along_C = where(F.imag < 0.0, -influence.imag, influence.imag)
        return where(abs(F.real) >= abs(F.imag), along_N, along_C)
    along = F.real * influence.real + F.imag * influence.imag
    return along / where(g > 0.0, g, 1.0)


def eliminate(A: list[list[Real]], b: list[Real]) -> list[Real]:
    """Solve A x = b without pivoting: A is an H-matrix wherever P < 1."""
    n = len(b)
    A, b = [list(row) for row in A], list(b)
    for p in range(n):
        pivot = 1 / A[p][p]
        for q in range(p + 1, n):
            factor = A[q][p] * pivot
            for m in range(p + 1, n):
                A[q][m] = A[q][m] - factor * A[p][m]
            b[q] = b[q] - factor * b[p]
    for p in reversed(range(n)):
        for m in range(p + 1, n):
            b[p] = b[p] - A[p][m] * b[m]
        b[p] = b[p] / A[p][p]
    return b


SOLVERS: dict[str, tuple[Callable[..., Solution], tuple[str, ...]]] = {
    "single": (single, ()),
    "successive": (successive, ("tolerance", "iterations")),
    "newton": (newton, ()),
}
"""Method -> its solver and the options of the request that it takes."""

METHODS = ("none", *SOLVERS)


def solver(method: str) -> tuple[Callable[..., Solution], tuple[str, ...]]:
    """The solver of a method and the names of its options."""
    return SOLVERS[method]
