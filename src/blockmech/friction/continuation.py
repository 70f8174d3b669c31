"""Continuation from zero friction: what decides where no certificate does.

The physical solution is the one that starts at zero friction. Its path is followed in the
scale lambda of all friction factors, from 0 to 1, by pseudo-arclength in the homogeneous
unknowns of `friction.equations`. It ends at lambda = 1 (solved), at eta = 0 (asymptote:
reactions grow without bound whatever the loads) or where lambda turns back (fold: no
solution beyond). The last two are self-locking, and lambda there is the limit.

The path is followed to each kink of a guide's load with the contacts held, and goes on with
the new one.

Source: Allgower & Georg, Introduction to Numerical Continuation Methods, SIAM 2003
(pseudo-arclength steps).
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from blockmech.friction.equations import Array, Equations

STEP, LARGEST, SMALLEST = 0.05, 0.2, 1e-10
TURN = 0.95  # cosine of the largest turn of the tangent in one step
MOST = 500  # steps
KINK = 1e-14  # of the largest load: what rounding may say about which edge presses


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
    tangent = _tangent(eq, v, contacts, None)
    side = _side(eq, v, contacts, tangent)
    step = STEP
    for count in range(1, MOST + 1):
        moved = _moved(eq, v, contacts, tangent, step)
        if moved is None:
            step /= 2
            if step < SMALLEST:
                return _ended(eq, Outcome.NOT_CONVERGED, v[-1], count)
            continue
        new, ahead, effort = moved
        kink = bool(eq.spare(new, contacts).min() < -KINK)
        if kink:
            step = _kink(eq, v, contacts, tangent, step)
            new, ahead, effort = _moved(eq, v, contacts, tangent, step) or moved
        full = _at_full(eq, v, new, contacts) if new[-1] >= 1.0 else None
        if full is not None and full[-2] > 0.0:
            return _polish(eq, full, count)
        if new[-2] <= 0.0:
            return _ended(eq, Outcome.ASYMPTOTE, _asymptote(eq, v, contacts, tangent, step), count)
        if ahead[-1] <= 0.0:
            top = _fold(eq, v, contacts, tangent, step)
            full = _at_full(eq, v, top, contacts) if top[-1] >= 1.0 else None
            if full is not None and full[-2] > 0.0:  # lambda 1 is this side of the fold
                return _polish(eq, full, count)
            return _ended(eq, Outcome.FOLD, top[-1], count)
        if new[-1] >= 1.0:
            return _ended(eq, Outcome.NOT_CONVERGED, 1.0, count)
        if kink:
            contacts = eq.switched(new, contacts)
            ahead = _tangent(eq, new, contacts, side)
            if ahead[-1] <= 0.0:  # lambda turns back at the kink itself
                return _ended(eq, Outcome.FOLD, new[-1], count)
            step = STEP
        v, tangent = new, ahead
        if effort <= 3:
            step = min(1.5 * step, LARGEST)
    return _ended(eq, Outcome.NOT_CONVERGED, v[-1], MOST)


def _moved(
    eq: Equations, v: Array, contacts: Array, tangent: Array, step: float
) -> tuple[Array, Array, int] | None:
    """The path one step further, its tangent there and the effort; None if it turns too much."""
    found = _correct(eq, v, contacts, tangent, step)
    if found is None:
        return None
    new, effort = found
    ahead = _tangent(eq, new, contacts, _side(eq, v, contacts, tangent))
    return (new, ahead, effort) if ahead @ tangent >= TURN else None


def _tangent(eq: Equations, v: Array, contacts: Array, side: float | None) -> Array:
    """Unit null vector of the Jacobian, in the path's direction (at the start: of lambda).

    The direction is told by the sign of det [J; tangent], which is one along the whole
    path, kinks included: a change of contact adds to J a multiple of the kink's normal.
    """
    null: Array = np.linalg.svd(eq.value(v, contacts)[1])[2][-1]
    forward = null[-1] if side is None else side * _side(eq, v, contacts, null)
    return -null if forward < 0 else null


def _side(eq: Equations, v: Array, contacts: Array, tangent: Array) -> float:
    """Sign of det [J; tangent]."""
    return float(np.sign(np.linalg.det(np.vstack([eq.value(v, contacts)[1], tangent]))))


def _correct(
    eq: Equations, v: Array, contacts: Array, tangent: Array, step: float
) -> tuple[Array, int] | None:
    """Newton back to the path, across the tangent; None if it takes more than six steps."""
    guess = v + step * tangent
    x = guess.copy()
    for effort in range(1, 7):
        G, J = eq.value(x, contacts)
        A = np.vstack([J, tangent])
        try:
            dx = np.linalg.solve(A, np.append(G, tangent @ (x - guess)))
        except np.linalg.LinAlgError:
            return None
        x = x - dx
        if np.abs(dx).max() < 1e-12:
            return x, effort
    return None


def _crossing(
    eq: Equations,
    v: Array,
    contacts: Array,
    tangent: Array,
    step: float,
    rest: Callable[[Array], float],
) -> float:
    """The step at which the rest of something is used up, by regula falsi (Illinois)."""

    def at(x: float) -> float:
        moved = _correct(eq, v, contacts, tangent, x)
        return np.nan if moved is None else rest(moved[0])

    low, high, f_low, f_high = 0.0, step, rest(v), at(step)
    for k in range(30):  # a contact that has just changed starts with nothing to spare
        if f_low > 0.0:
            break
        low = step * 0.5 ** (k + 1)
        f_low = at(low)
    x, side = high, 0
    for _ in range(60):
        if high - low <= 4e-16 * high:
            break
        sound = f_low > 0.0 >= f_high
        x = (low * f_high - high * f_low) / (f_high - f_low) if sound else (low + high) / 2
        f = at(x)
        if abs(f) <= 4e-16:
            break
        if f > 0.0:
            low, f_low, f_high, side = x, f, f_high / 2 if side > 0 else f_high, 1
        else:
            high, f_high, f_low, side = x, f, f_low / 2 if side < 0 else f_low, -1
    return x


def _kink(eq: Equations, v: Array, contacts: Array, tangent: Array, step: float) -> float:
    """The step at which a guide's contact changes."""
    return _crossing(eq, v, contacts, tangent, step, lambda x: float(eq.spare(x, contacts).min()))


def _asymptote(eq: Equations, v: Array, contacts: Array, tangent: Array, step: float) -> float:
    """Lambda where eta is zero, between v and one step further."""
    end = _crossing(eq, v, contacts, tangent, step, lambda x: float(x[-2]))
    moved = _correct(eq, v, contacts, tangent, end)
    return float((v if moved is None else moved[0])[-1])


def _fold(eq: Equations, v: Array, contacts: Array, tangent: Array, step: float) -> Array:
    """The point of largest lambda on the path between v and one step further."""
    side = _side(eq, v, contacts, tangent)
    end = _crossing(
        eq, v, contacts, tangent, step, lambda x: float(_tangent(eq, x, contacts, side)[-1])
    )
    moved = _correct(eq, v, contacts, tangent, end)
    return v if moved is None else moved[0]


def _at_full(eq: Equations, v: Array, new: Array, contacts: Array) -> Array | None:
    """The point of the path between v and new where lambda is 1, by Newton.

    The unknowns stay homogeneous, so a friction that goes to infinity does no harm.
    """
    x: Array = v + (1.0 - v[-1]) / (new[-1] - v[-1]) * (new - v)
    row = np.eye(eq.m + 2)[-1]
    for _ in range(12):
        G, J = eq.value(x, contacts)
        try:
            dx = np.linalg.solve(np.vstack([J, row]), np.append(G, x[-1] - 1.0))
        except np.linalg.LinAlgError:
            return None
        x = x - dx
        if np.abs(dx).max() < 1e-14:
            return x
    return None


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
    near = x[:-2] / x[-2]
    g, _ = eq.norm(n, 1.0, eq.contacts(eq.loads(n, 1.0)))
    scale = float(np.abs(eq.k * g).max()) or 1.0
    residual = float(np.abs(n - eq.k * g).max()) / scale
    if residual > 1e-12 or np.abs(n - near).max() > 0.5 * max(1.0, np.abs(near).max()):
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
