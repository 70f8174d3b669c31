"""Solvers of a group's friction equations, batch-transparent like kernels.

Every reaction is affine in the friction couples and forces t: see
`blockmech.friction.equations`.

Each sample stops by itself and is then left alone, so an answer never depends on
the batch it came in. **Certificate**: if the spectral radius P of the matrix
|k_j| |R_jm| is below 1 the map is a contraction and exactly one solution exists.
Where that is not proved, continuation from zero friction decides
(`blockmech.friction.continuation`); along a motion, whose friction is known, that does (``near``).

Sources: [R10] section "Kinetostatics ...", steps 1-5; Newton and the certificate
are blockmech's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from blockmech.friction.continuation import (
    ContinuationState,
    Outcome,
    Path,
    course_from_zero,
    end_of,
)
from blockmech.friction.equations import (
    SETTLED,
    Equations,
    chosen,
    contraction_bound,
    coulomb,
    eliminate,
    largest_of,
    loads,
    misfit,
    norms,
    slope,
)
from blockmech.ground.plane import EPS, NAN, implicit, maximum, minimum, repeat, times, where
from blockmech.ground.tolerances import DOUBLINGS
from blockmech.typing import Edges, Influences, Planars, Real, Reals, Values

CAP = 100  # iterations of `successive`: enough for P up to 0.85, whose 100th power is 1e-7
SMALL_CHANGE = 1e-7  # of the largest load: the paper's 1e-3 N at its reactions of 1e4 N
NEWTON_CAP = 12  # steps: 5 from rounding on the square root of P on, others where edges change


class Solution(NamedTuple):
    """Solved friction of a group, and how it went."""

    t: tuple[Real, ...]  # [N m] or [N] on the later links
    g: tuple[Real, ...]  # [N] loads on the pairs
    iterations: Real  # [-]
    residual: Real  # [-] of t = k g, relative to the largest friction
    contraction: Real  # [-] bound P, or the observed ratio of changes
    outcome: Real  # see `Outcome`
    limit: Real  # [-] scale of the friction factors up to which a solution exists


def with_drag(solved: Solution, drag: Reals) -> Solution:
    """The solution for loads that the drag has shifted, with the drag in its friction."""
    return solved._replace(t=tuple(t + d for t, d in zip(solved.t, drag, strict=True)))


def without_drag(t: Reals, drag: Reals) -> tuple[Real, ...]:
    """Friction without its drag."""
    return tuple(x - d for x, d in zip(t, drag, strict=True))


def tangent_step(
    t: Reals, k: Reals, drag: Reals, edges: Edges, base: Planars, rows: Influences
) -> tuple[tuple[Real, ...], tuple[Real, ...]]:
    """Friction, and the loads with it, by a step of Newton's method from friction t.

    ``k`` and ``drag`` are the laws' tangents at the loads with t.
    """
    linear = without_drag(t, drag)
    of = Equations(k, edges, loads(drag, base, rows), rows)
    last, _, _ = newton_step((linear, 0.0, True), of)
    t = tuple(x + d for x, d in zip(last, drag, strict=True))
    return t, norms(loads(t, base, rows), edges)


def balanced(
    solve: Callable[..., Solution],
    options: Values,
    laws: Callable[..., tuple[Reals, Reals]],
    steepest: Reals,
    edges: Edges,
    base: Planars,
    rows: Influences,
) -> Solution:
    """Friction of pairs by their laws, by tangents where these are not linear in the load.

    ``laws(g)`` are the signed factors and drags at loads g [N], ``laws()`` those at no load, which
    is any load where they are linear in it. ``steepest`` are the largest slopes of laws that are
    not, 0 of others; empty, or zeros, where all are. The loads are found by Newton's method, a
    fixed number of steps, as each squares what is left.
    """
    if not any(steepest):
        k, drag = laws()
        if not drag:
            return solve(k, edges, base, rows, *options)
        return with_drag(solve(k, edges, loads(drag, base, rows), rows, *options), drag)
    g, t = norms(base, edges), tuple(0.0 * abs(f.real) for f in base)
    for _ in range(DOUBLINGS):
        k, drag = laws(g)
        t, g = tangent_step(t, k, drag, edges, base, rows)
    k, drag = law = laws(g)
    solved = solve(k, edges, loads(drag, base, rows), rows, *options)
    slopes = [x or kj for x, kj in zip(steepest, k, strict=True)]
    return with_drag(judged(solved, law, laws(solved.g), slopes, edges, rows), drag)


def judged(
    solved: Solution, law: Any, at_solution: Any, steepest: Reals, edges: Edges, rows: Influences
) -> Solution:
    """A solution by tangents ``law`` (k, drag): it stands if its laws say the same ``there``.

    The certificate is that of the steepest slopes, with which one solution exists whatever the
    laws are below them. Where it fails nothing is proved, and there is no answer.
    """
    by_tangent, true = (
        [a * g + b for a, b, g in zip(k, drag, solved.g, strict=True)]
        for k, drag in (law, at_solution)
    )
    off = largest_of([a - b for a, b in zip(by_tangent, true, strict=True)])
    P = contraction_bound(steepest, edges, rows)
    lost = (P >= 1.0) | (off > SETTLED * EPS * largest_of(true))
    outcome = where(lost, float(Outcome.NOT_CONVERGED), solved.outcome)
    t = tuple(where(lost, NAN, x) for x in solved.t)
    return solved._replace(t=t, contraction=P, outcome=outcome)


def _is_unproved(P: Real, g: Reals) -> Real:
    """Whether no contraction P proves the friction of loads; without load there is none."""
    return (P >= 1.0) & _are_finite(g) & (largest_of(g) > 0.0)


def _are_finite(g: Reals) -> Real:
    """Whether loads are numbers; they are not where a later group cannot close."""
    return 0.0 * largest_of(g) == 0.0


def direct(k: Reals, edges: Edges, base: Planars) -> Solution:
    """Friction of a driven pair: the load on the pair does not depend on it."""
    g = norms(base, edges)
    t = coulomb(k, g)
    zero = 0.0 * t[0]
    return Solution(t, g, zero, zero, zero, zero, zero + 1.0)


def single(
    k: Reals, edges: Edges, base: Planars, rows: Influences, solvable: Real = False, near: Any = ()
) -> Solution:
    """One correction: friction from the frictionless loads ([R10], rough calculation)."""
    return successive(k, edges, base, rows, None, 1)


def successive(
    k: Reals,
    edges: Edges,
    base: Planars,
    rows: Influences,
    tolerance: float | None,
    iterations: int | None,
    solvable: Real = False,
    near: Reals = (),
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
    of = Equations(k, edges, base, rows)
    last: Iterate
    if iterations is None:
        last = repeat(iterate, start, CAP, of, tolerance)
    else:
        last = times(iterate, start, iterations, of, tolerance)
    P = contraction_bound(k, edges, rows)
    late = last.going if iterations is None else last.residual >= 1.0 - P
    outcome = where(late, float(Outcome.NOT_CONVERGED), count * 0.0)
    t = tuple(where(late, NAN, x) for x in last.t)
    ratio = where(last.count > 1.0, last.ratio, P)
    quality = (last.count, last.residual, ratio, outcome, P * 0.0 + 1.0)
    solution = Solution(t, last.g, *quality)
    if iterations is not None:
        return solution
    unproved = _is_unproved(P, g)
    course = _course(unproved, near, of, solvable)
    checks = course, near, of, enough(last.g, tolerance)
    confirmed_, _ = repeat(confirmed, (solution, unproved), 1, *checks)
    return differentiable(confirmed_, of)


class Iterate(NamedTuple):
    """State of the successive approximations."""

    t: tuple[Real, ...]
    g: tuple[Real, ...]
    count: Real
    residual: Real
    change: Real  # [N] largest of a load, by the last step
    ratio: Real  # [-] of the last two changes
    going: Real


def enough(g: Reals, tolerance: float | None) -> Real:
    """Change [N] of loads g at which successive approximations stop."""
    return max(SMALL_CHANGE, 4.0 * EPS) * largest_of(g) if tolerance is None else tolerance


def iterate(state: Iterate, of: Equations, tolerance: float | None) -> Iterate:
    """One successive approximation: friction from the loads, loads from that friction."""
    t = coulomb(of.k, state.g)
    g = norms(loads(t, of.base, of.rows), of.edges)
    steps = tuple(b - a for a, b in zip(state.g, g, strict=True))
    change, scale = largest_of(steps), largest_of(coulomb(of.k, g))
    residual = largest_of(coulomb(of.k, steps)) / where(scale > 0.0, scale, 1.0)
    ratio = change / where(state.change > 0.0, state.change, 1.0)
    going = change > enough(g, tolerance)
    return Iterate(t, g, state.count + 1.0, residual, change, ratio, going)


def confirmed(
    state: tuple[Solution, Real],
    course: ContinuationState,
    near: Reals,
    of: Equations,
    change: Real,
) -> tuple[Solution, bool]:
    """Uncertified successive approximations: they stand if continuation agrees.

    ``change`` [N] is the one at which they stopped.

    Near a contraction rho of 1 the remaining error is rho / (1 - rho) times the last
    change, and beyond it the iteration may settle on another solution.
    """
    iterated, _ = state
    end = _end(course, near, of)
    rho = minimum(maximum(iterated.contraction, 0.0), 1.0 - 1e-12)
    reach = maximum(change, 1e-12 * largest_of(end.g)) * maximum(1.0, rho / (1.0 - rho))
    off = largest_of([a - b for a, b in zip(end.g, iterated.g, strict=True)])
    solved = end.outcome == float(Outcome.BY_CONTINUATION)
    agrees = solved & (iterated.outcome == float(Outcome.CERTIFIED)) & (off <= 10.0 * reach)
    outcome = where(solved, float(Outcome.NOT_CONVERGED), end.outcome)
    outcome = where(agrees, float(Outcome.BY_CONTINUATION), outcome)
    t = tuple(where(agrees, x, NAN) for x in iterated.t)
    return iterated._replace(t=t, outcome=outcome, limit=end.limit), False


def newton(
    k: Reals, edges: Edges, base: Planars, rows: Influences, solvable: Real = False, near: Any = ()
) -> Solution:
    """Newton from the second successive iterate, certified sample by sample.

    ``solvable`` is where a solution is known to exist for every load. ``near``, if any, is
    friction (m) that is known but for rounding: of several solutions that one counts.
    """
    at_first = norms(base, edges)
    t = coulomb(k, norms(loads(coulomb(k, at_first), base, rows), edges))
    P = contraction_bound(k, edges, rows)
    start = (t, 0.0 * P, P < 1.0)
    of = Equations(k, edges, base, rows)
    t, count, _ = repeat(newton_step, start, NEWTON_CAP, of)
    g = norms(loads(t, base, rows), edges)
    residual = misfit(t, k, g)
    at_zero = (P >= 1.0) & (largest_of(at_first) == 0.0)  # where its path begins and ends
    outcome = where(at_zero, float(Outcome.BY_CONTINUATION), count * 0.0)
    solution = Solution(t, g, count, residual, P, outcome, count * 0.0 + 1.0)
    unproved = _is_unproved(P, at_first) | (residual > SETTLED * EPS)
    course = _course(unproved, near, of, solvable)
    settled, _ = repeat(replaced, (solution, unproved), 1, course, near, of)
    return differentiable(settled, of)


def differentiable(solution: Solution, of: Equations) -> Solution:
    """A solution of the friction equations, which say its derivatives."""
    t, _, _ = implicit(newton_step, (solution.t, solution.iterations, True), of)
    return solution._replace(t=t, g=norms(loads(t, of.base, of.rows), of.edges))


def newton_step(state: Values, of: Equations, pivoting: bool = False) -> Values:
    """One step of Newton's method: (friction, steps done, whether it moved)."""
    (t, count, _), (k, edges, base, rows) = state, of
    n = range(len(k))
    F = loads(t, base, rows)
    g = norms(F, edges)
    r = [tj - x for tj, x in zip(t, coulomb(k, g), strict=True)]
    A = [
        [(1.0 if j == m else 0.0) - k[j] * slope(F[j], g[j], rows[j][m], edges[j]) for m in n]
        for j in n
    ]
    (step,), _ = eliminate([[*row, x] for row, x in zip(A, r, strict=True)], pivoting)
    t = tuple(tj - dj for tj, dj in zip(t, step, strict=True))
    return t, count + 1.0, _moved(step, k, g)


def replaced(
    state: tuple[Solution, Real], course: ContinuationState, near: Any, of: Equations
) -> tuple[Solution, bool]:
    """Uncertified samples of Newton's method: continuation's answer in their place."""
    certified, _ = state
    t, g, residual, outcome, limit, count = _end(course, near, of)
    fields = {"residual": residual, "outcome": outcome, "limit": limit}
    return certified._replace(t=t, g=g, iterations=count, **fields), False


def _course(requested: Real, near: Reals, of: Equations, solvable: Real) -> ContinuationState:
    """The path from zero friction, of the samples of which no solution is known nearby."""
    if near:
        requested = requested & where(_are_finite(near), False, True)
    return course_from_zero(requested, of, solvable)


def _end(course: ContinuationState, near: Any, of: Equations) -> Path:
    """The solution that counts: the one nearby where one is known, else the end of the path."""
    end = end_of(course, of)
    if not near:
        return end
    finite = _are_finite(near)
    t, count, _ = repeat(newton_step, (near, 0.0 * near[0], finite), NEWTON_CAP, of, True)
    g = norms(loads(t, of.base, of.rows), of.edges)
    residual = misfit(t, of.k, g)
    solved = residual <= SETTLED * EPS
    t, g = (tuple(where(solved, x, NAN) for x in row) for row in (t, g))
    code = where(solved, float(Outcome.BY_CONTINUATION), float(Outcome.NOT_CONVERGED))
    rest = zip((residual, code, 1.0, count), end[2:], strict=True)
    merged = (where(finite, a, b) for a, b in rest)
    return Path(chosen(finite, t, end.t), chosen(finite, g, end.g), *merged)


def _moved(step: Reals, k: Reals, g: Reals) -> Real:
    """Whether a step changes any pair's friction by more than rounding of the largest load."""
    allowed = 4.0 * EPS * largest_of(g)
    excess = [abs(d) - allowed * abs(kj) for d, kj in zip(step, k, strict=True)]
    top = excess[0]
    for x in excess[1:]:
        top = maximum(top, x)
    return top > 0.0


SOLVERS: dict[str, tuple[Callable[..., Solution], tuple[str, ...]]] = {
    "single": (single, ()),
    "successive": (successive, ("tolerance", "iterations")),
    "newton": (newton, ()),
}
"""Method -> its solver and the options of the request that it takes."""

METHODS = ("none", *SOLVERS)
