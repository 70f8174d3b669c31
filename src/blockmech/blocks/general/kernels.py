"""Kernels of a general group: one Jacobian J serves every stage.

    position       Newton from a guess near the pose:   J step = -residual
    velocity       J x' = right side of the supports' and drivers' rates
    acceleration   J x'' = the same with the quadratic terms
    reactions      J^T lambda = -loads;  lambda are forces, couples and driving efforts
    margin         squared ratio of the extreme singular values of J

The guess is a pose that the core has followed from the group's home
(`blockmech.passes.homotopy`), so the answer is a function of the sample alone.

Sources: [R10] Eqs. 2-7 and [D14] Eqs. 1-8 for groups of any class.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from blockmech.blocks.contract import Kernels
from blockmech.blocks.general.equations import (
    Ends,
    PairPlan,
    accelerations_wanted,
    ends,
    rates_wanted,
    residuals,
    rows,
    slide,
)
from blockmech.ground.plane import (
    EPS,
    NAN,
    dot,
    expi,
    hyp,
    implicit,
    matrix,
    maximum,
    mul,
    planar,
    repeat,
    solve,
    solve_transposed,
    spread,
    sqrt,
    where,
)
from blockmech.ground.tolerances import DOUBLINGS, ROUNDED
from blockmech.typing import (
    Array,
    Complex,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Nested,
    Parameters,
    Real,
    Slide,
    Values,
)

SETTLED = 0.1  # of the root of the rounding: a last step whose square is below rounding


class Pose(NamedTuple):
    """Places of the links, both sides of each pair, Jacobian, and how Newton went.

    An entry of a solution that hangs on rows of 1 and -1 alone is a number without a pose too:
    where there is none, ``closed`` makes it NaN in every engine.
    """

    links: tuple[LinkPosition, ...]
    ends: tuple[Ends, ...]
    J: Array  # (..., N, N) lengths by the group's size
    closed: Real  # [-] 1, NaN where the pairs do not close
    first: Real  # [-] largest first step, size or radians: how far the guess was off
    reached: Real  # [-] share of the path from home that was possible; 1 is all of it


class Velocity(NamedTuple):
    """Velocities of the links and, by pair, sliding rates [m/s] (0 where it turns)."""

    links: tuple[LinkVelocity, ...]
    pairs: tuple[Real, ...]


class Acceleration(NamedTuple):
    """Accelerations of the links."""

    links: tuple[LinkAcceleration, ...]


class Reactions(NamedTuple):
    """By pair: what it transmits onto its later link, and what drives it."""

    pairs: Values
    efforts: tuple[Real, ...]


Links = tuple[LinkPosition, ...]
Plans = tuple[PairPlan, ...]


def kernels_of(plans: Plans, links: int, outer: int, driven: int) -> Kernels:
    """The kernels of a group with these pairs; see `PairPlan` for the numbers."""

    def position(*arguments: Any) -> Pose:
        *inputs, guess, p = arguments
        supports, q = tuple(inputs[:outer]), tuple(inputs[outer:])
        guessed = guess[0]
        # The guess is in double: its directions are units to this precision first.
        pose = tuple(LinkPosition(planar(x, y), unit(planar(ex, ey))) for x, y, ex, ey in guessed)
        pose, first = newton(plans, pose, supports, q, p)
        at, open_by = conditions(plans, pose, supports, q, p)
        reach: Real = 1.0
        for sides in at:
            reach = maximum(reach, hyp(sides.b.P) * (1 / p.size))
        rounding = EPS * reach  # of the places
        closed = where(largest(open_by) <= ROUNDED * rounding, 1.0 + 0.0 * rounding, NAN)
        pose = tuple(LinkPosition(mul(o, closed), mul(unit(e), closed)) for o, e in pose)
        at = tuple(ends(pair, pose, supports, p) for pair in plans)
        return Pose(pose, at, jacobian(plans, at, links, p), closed, first, guess[1])

    def velocity(pose: Pose, *arguments: Any) -> Velocity:
        *inputs, p = arguments
        supports, qd = tuple(inputs[:outer]), tuple(inputs[outer:])
        right: list[Real] = []
        for pair, at in zip(plans, pose.ends, strict=True):
            right += rates_wanted(pair, at, supports, qd, 1 / p.size)
        solved = vectors(solve(pose.J, right), p.size, pose.closed)
        moving = tuple(LinkVelocity(v, om) for v, om in solved)
        both = zip(plans, pose.ends, strict=True)
        return Velocity(moving, tuple(slide(pair, at, moving, supports) for pair, at in both))

    def acceleration(pose: Pose, vel: Velocity, *arguments: Any) -> Acceleration:
        *inputs, p = arguments
        supports, qdd = tuple(inputs[:outer]), tuple(inputs[outer:])
        right: list[Real] = []
        for pair, at, sliding in zip(plans, pose.ends, vel.pairs, strict=True):
            right += accelerations_wanted(pair, at, vel.links, sliding, supports, qdd, 1 / p.size)
        solved = vectors(solve(pose.J, right), p.size, pose.closed)
        return Acceleration(tuple(LinkAcceleration(a, al) for a, al in solved))

    def reactions(pose: Pose, *arguments: Any) -> Reactions:
        *loads, p = arguments
        right: list[Real] = []
        for load in loads:
            right += [-load.F.real * p.size, -load.F.imag * p.size, -load.M]
        solved = tuple(x * pose.closed for x in solve_transposed(pose.J, right))
        transmitted, efforts = [], [0.0] * driven
        row = 0
        for pair, at in zip(plans, pose.ends, strict=True):
            multipliers = solved[row : row + pair.rows]
            row += pair.rows
            transmitted.append(carried(pair, at, multipliers, p.size))
            if pair.driven:
                efforts[pair.drive] = (
                    multipliers[1] * (1 / p.size) if pair.prismatic else multipliers[2]
                )
        return Reactions(tuple(transmitted), tuple(efforts))

    return Kernels(position, velocity, acceleration, reactions, margin=margin)


def unit(e: Complex) -> Complex:
    """The vector at length 1."""
    return mul(e, 1 / hyp(e))


def newton(
    plans: Plans, pose: Links, supports: Values, q: tuple[Real, ...], p: Parameters
) -> tuple[Links, Real]:
    """The pose to which Newton's method comes, and the size of its first step."""
    data = (plans, supports, q, p)
    pose, first, moving = newton_step((pose, 0.0, True), *data)
    last = repeat(newton_step, (pose, first, moving), DOUBLINGS - 1, *data)
    pose, _, _ = implicit(newton_step, last, *data)
    return pose, first


def newton_step(
    state: tuple[Links, Real, Real],
    plans: Plans,
    supports: Values,
    q: tuple[Real, ...],
    p: Parameters,
) -> tuple[Links, Real, Real]:
    """The pose moved by the solution of J step = -residual, by how much, and whether to go on."""
    pose, _, _ = state
    at, open_by = conditions(plans, pose, supports, q, p)
    step = solve(jacobian(plans, at, len(pose), p), [-x for x in open_by])
    pose, moved = stepped(pose, step, p.size)
    return pose, moved, moved > SETTLED * sqrt(EPS)


def conditions(
    plans: Plans, pose: Links, supports: Values, q: tuple[Real, ...], p: Parameters
) -> tuple[tuple[Ends, ...], list[Real]]:
    """Both sides of each pair at a pose, and how far all conditions are from zero."""
    at = tuple(ends(pair, pose, supports, p) for pair in plans)
    gaps: list[Real] = []
    for pair, sides in zip(plans, at, strict=True):
        gaps += residuals(pair, sides, q, 1 / p.size)
    return at, gaps


def largest(values: Iterable[Real]) -> Real:
    """The largest magnitude."""
    top: Real = 0.0
    for x in values:
        top = maximum(top, abs(x))
    return top


def stepped(pose: Links, step: tuple[Real, ...], size: Real) -> tuple[Links, Real]:
    """The pose after a step, and the step's largest part, by size or in radians."""
    moved = []
    for k, link in enumerate(pose):
        x, y, turn = step[3 * k : 3 * k + 3]
        moved.append(LinkPosition(link.o + planar(x * size, y * size), link.e * expi(turn)))
    return tuple(moved), largest(step)


def jacobian(plans: Plans, at: tuple[Ends, ...], links: int, p: Parameters) -> Array:
    """The matrix of all conditions."""
    filled: list[list[Real]] = []
    for pair, sides in zip(plans, at, strict=True):
        filled += rows(pair, sides, 3 * links, 1 / p.size)
    return matrix(filled)


def vectors(solution: tuple[Real, ...], size: Real, closed: Real) -> list[tuple[Complex, Real]]:
    """Translation and turn of each link from a scaled solution."""
    x = [part * closed for part in solution]
    return [(planar(x[k] * size, x[k + 1] * size), x[k + 2]) for k in range(0, len(x), 3)]


def carried(pair: PairPlan, at: Ends, multipliers: tuple[Real, ...], size: Real) -> Nested:
    """What a pair transmits from its part of the multipliers."""
    if not pair.prismatic:
        return planar(multipliers[0] * (1 / size), multipliers[1] * (1 / size))
    N = multipliers[0] * (1 / size)
    b, a = dot(at.b.r, at.a.u), dot(at.a.r + at.d, at.a.u)
    return Slide(N, multipliers[-1] + N * b, multipliers[-1] + N * a)


def margin(pose: Pose, p: Parameters) -> Real:
    """Squared ratio of extreme singular values; below 0 where the path from home ends."""
    ratio = spread(pose.J)
    return where(pose.reached < 1.0, pose.reached - 1.0, ratio * ratio)
