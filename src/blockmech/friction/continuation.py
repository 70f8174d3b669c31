"""Continuation from zero friction: what decides where no certificate does.

The physical solution is the one that starts at zero friction. Its path is followed in the
scale lambda of all friction factors, from 0 to 1, by pseudo-arclength in the homogeneous
unknowns of `friction.equations`. It ends at lambda = 1 (solved), at eta = 0 (asymptote:
reactions grow without bound whatever the loads) or where lambda turns back (fold: no
solution beyond). The last two are self-locking, and lambda there is the limit.

The path is followed to each kink of a guide's load with the contacts held, and goes on with
the new one.

Source: Allgower & Georg, Introduction to Numerical Continuation Methods, SIAM 2003
(`blockmech.continuation`); the equations are blockmech's own.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from blockmech.continuation import Curve, Point, advance, correct, crossing, point, side
from blockmech.friction.equations import Array, Equations
from blockmech.plane import EPS

# [-] of the arc: unknowns are on the unit sphere, lambda ends at 1. The first step from zero
# friction and from a kink is short, as the path may bend there; below the smallest it has no more.
STEP, LARGEST, SMALLEST = 0.05, 0.2, 1e-10
MOST = 500  # steps, halvings included: a path takes some ten
KINK = 64 * EPS  # of the largest load: what rounding may say about which edge presses


class Outcome(enum.IntEnum):
    """How the friction of a sample was settled."""

    CERTIFIED = 0
    BY_CONTINUATION = 1
    NOT_CONVERGED = 2
    FOLD = 3
    ASYMPTOTE = 4

    @property
    def solved(self) -> bool:
        """Whether there is an answer."""
        return self in (Outcome.CERTIFIED, Outcome.BY_CONTINUATION)


class Path(NamedTuple):
    """End of a path."""

    t: tuple[float, ...]  # friction; NaN without a solution
    g: tuple[float, ...]  # [N] loads on the pairs; NaN without a solution
    outcome: Outcome
    limit: float  # scale of the friction factors up to which a solution exists
    residual: float  # relative
    steps: int


@np.errstate(all="ignore")  # what is not finite has no solution
def continue_from_zero(
    k: Sequence[float],
    edges: Sequence[bool],
    base: Sequence[complex],
    rows: Sequence[Sequence[complex]],
) -> Path:
    """Follow the frictionless solution to full friction.

    Parameters
    ----------
    k : m signed Coulomb factors [m] or [-]
    edges : m flags, True for a pair whose load is the larger component
    base : m loads [N] without friction
    rows : m x m influences of unit friction on the loads

    Returns
    -------
    Path with friction t [N m] or [N], or the reason why there is none
    """
    eq = Equations(k, edges, base, rows)
    v, contacts = eq.start()
    curve = partial(eq.value, contacts=contacts)
    at = point(curve, v)
    way = side(curve, at)
    step = STEP
    for count in range(1, MOST + 1):
        ahead = advance(curve, at, step)
        if ahead is None:
            step /= 2
            if step < SMALLEST:
                return _ended(eq, Outcome.NOT_CONVERGED, at.v[-1], count)
            continue
        spare = partial(_spare, eq, contacts)
        kink = spare(ahead.v) < -KINK
        if kink:  # only as far as the contact is the same
            step = crossing(curve, at, step, spare)
            ahead = advance(curve, at, step) or ahead
        end = _end(eq, curve, at, ahead, step, count)
        if end is not None:
            return end
        if kink:
            contacts = eq.switched(ahead.v, contacts)
            curve = partial(eq.value, contacts=contacts)
            ahead = point(curve, ahead.v, way)
            if ahead.tangent[-1] <= 0.0:  # lambda turns back at the kink itself
                return _ended(eq, Outcome.FOLD, ahead.v[-1], count)
            step = STEP
        at, step = ahead, min(1.5 * step, LARGEST)
    return _ended(eq, Outcome.NOT_CONVERGED, at.v[-1], MOST)


def _spare(eq: Equations, contacts: Array, v: Array) -> float:
    """What the contact of some guide has left until it changes."""
    return float(eq.spare(v, contacts).min())


def _end(
    eq: Equations, curve: Curve, at: Point, ahead: Point, step: float, count: int
) -> Path | None:
    """How the path ends between two points, or None if it goes on.

    The answer lies before the fold, if there is one between them: beyond it the path comes
    back through lambda = 1 with another solution.
    """

    def place(rest: Callable[[Array], float], step: float) -> tuple[Array, float]:
        h = crossing(curve, at, step, rest)
        found = correct(curve, at.v + h * at.tangent, at.tangent)
        return (at.v if found is None else found), h

    top = ahead.v
    folds = ahead.tangent[-1] <= 0.0
    if folds:
        way = side(curve, at)
        top, step = place(lambda v: float(point(curve, v, way).tangent[-1]), step)
    if top[-1] >= 1.0:
        full, _ = place(lambda v: 1.0 - float(v[-1]), step)
        if full[-2] > 0.0:
            return _polish(eq, full, count)
    if top[-2] <= 0.0:
        pole, _ = place(lambda v: float(v[-2]), step)
        return _ended(eq, Outcome.ASYMPTOTE, pole[-1], count)
    return _ended(eq, Outcome.FOLD, top[-1], count) if folds else None


def _polish(eq: Equations, x: Array, count: int) -> Path:
    """The answer at lambda = 1: one or two steps of Newton on the friction itself."""
    n = x[:-2] / x[-2]
    for _ in range(20):
        g, slope = eq.norm(n, 1.0, eq.contacts(eq.loads(n, 1.0)))
        r = n - eq.k * g
        try:
            dn = np.linalg.solve(np.eye(eq.m) - eq.k[:, None] * slope[:, :-1], r)
        except np.linalg.LinAlgError:
            return _ended(eq, Outcome.NOT_CONVERGED, 1.0, count)
        n = n - dn
        if np.abs(dn).max() <= 4e-16 * max(1.0, np.abs(n).max()):
            break
    moved = np.append(n, 1.0) / np.hypot(np.linalg.norm(n), 1.0) - x[:-1]
    g, _ = eq.norm(n, 1.0, eq.contacts(eq.loads(n, 1.0)))
    scale = float(np.abs(eq.k * g).max()) or 1.0
    residual = float(np.abs(n - eq.k * g).max()) / scale
    if residual > 1e-12 or np.abs(moved).max() > 1e-6:  # another solution
        return _ended(eq, Outcome.NOT_CONVERGED, 1.0, count)
    t = n * eq.factor * eq.load
    return Path(
        tuple(map(float, t)),
        tuple(map(float, g * eq.load)),
        Outcome.BY_CONTINUATION,
        1.0,
        residual,
        count,
    )


def _ended(eq: Equations, outcome: Outcome, limit: Any, count: int) -> Path:
    nothing = (float("nan"),) * eq.m
    return Path(nothing, nothing, outcome, float(limit), float("nan"), count)
