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

from blockmech.friction.continuation import Outcome, continue_from_zero
from blockmech.plane import EPS, NAN, hyp, implicit, maximum, mul, repair, repeat, sqrt, where
from blockmech.typing import Complex, Real

CAP = 100  # iterations of `successive`: enough for P up to 0.85, whose 100th power is 1e-7
SMALL_CHANGE = 1e-7  # of the largest load: the paper's 1e-3 N at its reactions of 1e4 N
NEWTON_CAP = 12  # steps: 5 from rounding on the square root of P on, others where edges change
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
        columns = list(zip(*A, strict=True))
        A = [
            [sum(a * b for a, b in zip(row, column, strict=True)) for column in columns]
            for row in A
        ]
    return sqrt(sqrt(_top([sum(row) for row in A])))


def _known(base: Any, edges: Any) -> Real:
    """Whether the loads are numbers; they are not where a later group cannot close."""
    return 0.0 * _top(norms(base, edges)) == 0.0


def _top(values: Any) -> Real:
    top = abs(values[0])
    for x in values[1:]:
        top = maximum(top, abs(x))
    return top


def _friction(k: Any, g: Any) -> tuple[Real, ...]:
    """Coulomb's law: the friction that loads on the pairs stand for."""
    return tuple(kj * gj for kj, gj in zip(k, g, strict=True))


def direct(k: Any, edges: Any, base: Any) -> Solution:
    """Friction of a driven pair: the load on the pair does not depend on it."""
    g = norms(base, edges)
    t = _friction(k, g)
    zero = 0.0 * t[0]
    return Solution(t, g, zero, zero, zero, zero, zero + 1.0)


def single(k: Any, edges: Any, base: Any, rows: Any) -> Solution:
    """One correction: friction from the frictionless loads ([R10], rough calculation)."""
    return successive(k, edges, base, rows, None, 1)


def successive(
    k: Any, edges: Any, base: Any, rows: Any, tolerance: float | None, iterations: int | None
) -> Solution:
    """Successive approximations ([R10] steps 1-5), stopped by change or by count.

    The change is that of the loads [N], by default relative to the largest of them. What a
    count left undone is bounded by residual / (1 - P); a bound above the friction itself is
    none, and the sample has no answer, whatever continuation would find.
    """
    g = norms(base, edges)
    t = tuple(0.0 * x for x in g)
    count = 0.0 * g[0]
    going = count <= 1.0  # false for NaN: an impossible sample is left alone
    start = Iterate(t, g, count, count, count, count, going)
    asked = tolerance if iterations is None else -1.0  # no change is so small
    last: Iterate = repeat(iterate, start, iterations or CAP, k, edges, base, rows, asked)
    P = contraction_bound(k, edges, rows)
    late = last.going if iterations is None else last.residual >= 1.0 - P
    outcome = where(late, float(Outcome.NOT_CONVERGED), count * 0.0)
    t = tuple(where(late, NAN, x) for x in last.t)
    ratio = where(last.count > 1.0, last.ratio, P)
    more = (last.count, last.residual, ratio, outcome, P * 0.0 + 1.0)
    solution = Solution(t, last.g, *more)
    if iterations is not None:
        return solution
    unproved = (P >= 1.0) & _known(base, edges)
    given = (k, edges, base, rows, enough(last.g, asked))
    found: Solution = repair(unproved, confirmed, solution, *given)
    return differentiable(found, k, edges, base, rows)


class Iterate(NamedTuple):
    """State of the successive approximations."""

    t: tuple[Real, ...]
    g: tuple[Real, ...]
    count: Real
    residual: Real
    change: Real  # [N] largest of a load, by the last step
    ratio: Real  # [-] of the last two changes
    going: Real


def enough(g: Any, tolerance: float | None) -> Real:
    """Change [N] of loads g at which successive approximations stop."""
    return max(SMALL_CHANGE, 4.0 * EPS) * _top(g) if tolerance is None else tolerance


def iterate(
    state: Iterate, k: Any, edges: Any, base: Any, rows: Any, tolerance: float | None
) -> Iterate:
    """One successive approximation: friction from the loads, loads from that friction."""
    t = _friction(k, state.g)
    g = norms(loads(t, base, rows), edges)
    steps = tuple(b - a for a, b in zip(state.g, g, strict=True))
    change, misfit, scale = _top(steps), _top(_friction(k, steps)), _top(_friction(k, g))
    residual = misfit / where(scale > 0.0, scale, 1.0)
    ratio = change / where(state.change > 0.0, state.change, 1.0)
    going = change > enough(g, tolerance)
    return Iterate(t, g, state.count + 1.0, residual, change, ratio, going)


def confirmed(given: Any, k: Any, edges: Any, base: Any, rows: Any, change: float) -> Any:
    """One uncertified sample of successive approximations: it stands if continuation agrees.

    ``change`` [N] is the one at which it stopped.

    Near a contraction rho of 1 the remaining error is rho / (1 - rho) times the last
    change, and beyond it the iteration may settle on another solution.
    """
    found = continue_from_zero(k, edges, base, rows)
    outcome = found.outcome
    if outcome == Outcome.BY_CONTINUATION:
        rho = min(max(given.contraction, 0.0), 1.0 - 1e-12)
        reach = max(change, 1e-12 * max(found.g)) * max(1.0, rho / (1.0 - rho))
        off = max(abs(a - b) for a, b in zip(found.g, given.g, strict=True))
        if given.outcome or not off <= 10.0 * reach:
            outcome = Outcome.NOT_CONVERGED
    t = given.t if outcome == Outcome.BY_CONTINUATION else (NAN,) * len(given.t)
    return given._replace(t=t, outcome=float(outcome), limit=found.limit)


def newton(k: Any, edges: Any, base: Any, rows: Any) -> Solution:
    """Newton from the second successive iterate, certified sample by sample."""
    t = _friction(k, norms(base, edges))
    t = _friction(k, norms(loads(t, base, rows), edges))
    P = contraction_bound(k, edges, rows)
    start = (t, 0.0 * P, P < 1.0)
    t, count, _ = repeat(newton_step, start, NEWTON_CAP, k, edges, base, rows)
    g = norms(loads(t, base, rows), edges)
    friction = _friction(k, g)
    misfit, best = _top([tj - x for tj, x in zip(t, friction, strict=True)]), _top(friction)
    residual = misfit / where(best > 0.0, best, 1.0)
    solution = Solution(t, g, count, residual, P, count * 0.0, count * 0.0 + 1.0)
    unproved = ((P >= 1.0) & _known(base, edges)) | (residual > SETTLED * EPS)
    settled: Solution = repair(unproved, replaced, solution, k, edges, base, rows)
    return differentiable(settled, k, edges, base, rows)


def differentiable(found: Solution, k: Any, edges: Any, base: Any, rows: Any) -> Solution:
    """A solution of the friction equations, which say its derivatives."""
    start = (found.t, found.iterations, True)
    t, _, _ = implicit(newton_step, start, k, edges, base, rows)
    return found._replace(t=t)


def newton_step(state: Any, k: Any, edges: Any, base: Any, rows: Any) -> Any:
    """One step of Newton's method: (friction, steps done, whether it moved)."""
    t, count, _ = state
    n = range(len(k))
    F = loads(t, base, rows)
    g = norms(F, edges)
    r = [tj - x for tj, x in zip(t, _friction(k, g), strict=True)]
    slope = [[_slope(F[j], g[j], rows[j][m], edges[j]) for m in n] for j in n]
    step = eliminate([[(1.0 if j == m else 0.0) - k[j] * slope[j][m] for m in n] for j in n], r)
    t = tuple(tj - dj for tj, dj in zip(t, step, strict=True))
    return t, count + 1.0, _moved(step, k, g)


def replaced(given: Any, k: Any, edges: Any, base: Any, rows: Any) -> Any:
    """One uncertified sample of Newton's method: continuation's answer in its place."""
    found = continue_from_zero(k, edges, base, rows)
    return given._replace(
        t=found.t,
        g=found.g,
        iterations=float(found.steps),
        residual=found.residual,
        outcome=float(found.outcome),
        limit=found.limit,
    )


def _moved(step: Any, k: Any, g: Any) -> Real:
    """Whether a step changes any pair's friction by more than rounding of the largest load."""
    allowed = 4.0 * EPS * _top(g)
    excess = [abs(d) - allowed * abs(kj) for d, kj in zip(step, k, strict=True)]
    top = excess[0]
    for x in excess[1:]:
        top = maximum(top, x)
    return top > 0.0


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
