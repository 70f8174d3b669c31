"""What pairs with friction do along a motion: accelerations, friction, and what stands."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.contacts import DEPENDENT, Constraints
from blockmech.dynamics.friction import Sides
from blockmech.dynamics.sticking import JointFriction
from blockmech.typing import Floats, Indices

States: TypeAlias = tuple[Floats, Floats, Floats, Floats]  # (n, k), (n, k), (n,), (n, states)
Bools: TypeAlias = NDArray[np.bool_]
Against: TypeAlias = Callable[[Floats, Floats, Floats, Indices], Constraints]


class Along(NamedTuple):
    """What pairs with friction do at n states of a motion."""

    rates: Floats  # (n, k) without what rounding leaves pairs that stick
    qdd: Floats  # (n, k)
    friction: Floats  # (n, m)
    stand: Bools  # (n, m) which pairs stand
    pushes: Floats  # (n, a) of the stops that it lies against


def friction_along(
    friction: JointFriction,
    states: States,
    sides: Floats,
    lies: Bools,
    against: Against,
    begins: bool = True,
) -> Along:
    """What the pairs do at n states of a motion.

    ``sides`` (n, m), NaN where nothing is known; ``lies`` (n, a) whether it lies against
    each of some stops, ``against`` says which rows those have. Of a pair that only starts or
    turns back the friction is that of the sense in which it goes on. ``begins`` : whether
    sides are completed where no motion says them.
    """
    q, qd, t, x = states
    if begins:
        sides = _completed(friction, states, sides, lies, against)
    rates, qdd, rubbed = qd.copy(), np.full(qd.shape, np.nan), np.full(sides.shape, np.nan)
    stand, pushes = np.zeros(sides.shape, dtype=bool), np.zeros(lies.shape)
    kinds, which = np.unique(np.hstack([sides, lies]), axis=0, return_inverse=True)
    for kind, row in enumerate(kinds):
        if np.isnan(row).any():
            continue
        some = np.flatnonzero(which.ravel() == kind)
        side, those = tuple(row[: sides.shape[1]].tolist()), row[sides.shape[1] :] > 0
        for _ in range(2):  # the second time with rates that are those of what sticks
            state = q[some], rates[some], t[some]
            constraint = against(*state, np.flatnonzero(those)) if any(those) else None
            at = friction.instant(*state, x[some], constraint)
            rates[some] = friction.sticking_rates(at, side)
        response = friction.responses(at, side)
        qdd[some], rubbed[some] = response.qdd, response.t
        pushes[np.ix_(some, those)] = response.pushes
        size = (np.abs(at.S) @ np.abs(at.freedoms[..., None]))[..., 0]
        fast = np.abs(np.hstack([at.w, at.rate])).max(axis=-1, keepdims=True)
        rounded = np.abs(at.w) <= DEPENDENT * np.maximum(size, fast)
        still = (rounded | (at.w * np.array(side) < 0)) & ~friction.signed
        stand[some] = still | (np.array(side) == 0)
    return Along(rates, qdd, rubbed, stand, pushes)


def _completed(
    friction: JointFriction, states: States, sides: Floats, lies: Bools, against: Against
) -> Floats:
    """Sides (n, m) where no motion says them: those with which one begins there."""
    q, qd, t, x = states
    sides, begins = sides.copy(), dict[bytes, float | Sides]()
    open_ = np.isnan(sides).any(axis=1) & np.isfinite(q + qd).all(axis=1)
    if not open_.any():
        return sides
    w = friction.rates(q, qd)
    open_ &= np.isfinite(w).all(axis=1)  # where there is a pose
    moving = open_ & (w != 0).all(axis=1) & ~np.any(lies, axis=1)
    sides[moving] = friction.senses(w[moving])
    for i in np.flatnonzero(open_ & ~moving):
        key = np.array([*q[i], *qd[i], t[i], *x[i], *lies[i]]).tobytes()
        if key not in begins:
            some = slice(i, i + 1)
            state, those = (q[some], qd[some], t[some]), np.flatnonzero(lies[i])
            constraint = against(*state, those).first() if any(lies[i]) else None
            start = friction.from_state(q[i], qd[i], float(t[i]), constraint, x[i])[0]
            begins[key] = np.nan if start.end else start.sides
        sides[i] = begins[key]
    return sides
