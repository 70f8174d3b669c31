r"""What holds while something lies against end stops, and which of them push.

A coordinate with a stop changes at the rate n q', n its row over the drivers, that at n q'' + b.
Against stops

    M q'' = push + sum n^T P,    n q'' + b = 0,

so q'' = Z z'' + q_p with the columns of Z a basis of what the stops leave free, and the pushes P of
the stops follow from what is left over. The stop of a driver has a row of the identity.

Source: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, ch. 5 and 8.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from blockmech.ground.tolerances import EQUAL
from blockmech.typing import Floats, Real

SETTLED = EQUAL  # [-] by which a law or a place may be missed by what is solved for: rounding
DEPENDENT = SETTLED / 10  # of the largest singular value of rows: below it they depend on others
INSTANT = 1e-6  # [s] after which what begins to act or move shows; an impact takes as long
STILL = SETTLED / 1000  # of a rate's parts, or of an impact: what is left of them is rounding


class Constraints(NamedTuple):
    """Stops that something lies against, at a state or at n of them: n q'' + b = 0.

    Drivers that follow a law or are locked stand behind them.

    pairs : of each its place among the pairs with stops, -1 of a driver's, and its sense
    speeds : rates n q', None where all are zero
    """

    rows: Floats  # (..., a, k)
    drift: Floats  # (..., a)
    pairs: tuple[tuple[int, int], ...]
    speeds: Floats | None = None  # (..., a)

    def extended(self, drives: Constraints) -> Constraints:
        """These, and behind them drivers that are not free."""
        rows = np.concatenate([self.rows, drives.rows], axis=-2)
        drift = np.concatenate([self.drift, drives.drift], axis=-1)
        joined = rows, drift, self.pairs + drives.pairs
        if drives.speeds is None:
            return Constraints(*joined)
        return Constraints(*joined, np.concatenate([0 * self.drift, drives.speeds], axis=-1))

    def first(self) -> Constraints:
        """That at the first of n states."""
        speeds = None if self.speeds is None else self.speeds[0]
        return Constraints(self.rows[0], self.drift[0], self.pairs, speeds)

    def free(self) -> tuple[Floats, Floats, Floats]:
        """Z (..., k, z), q_p (..., k), and W (..., a, k) with P = W (sum n^T P).

        A state without a pose is told by its drift, which is NaN.
        """
        rows, drift = self.rows, self.drift
        rows = np.where(np.isfinite(rows), rows, np.eye(*rows.shape[-2:]))
        if ((rows == 0) | (rows == 1)).all() and (rows.sum(axis=-1) == 1).all():
            which = rows.reshape(-1, rows.shape[-1]).any(axis=0)  # drivers alone: exactly
            shift = -(np.swapaxes(rows, -1, -2) @ drift[..., None])[..., 0]
            return np.eye(rows.shape[-1])[:, ~which], shift, rows
        _, size, turned = np.linalg.svd(rows)
        rank = int((size > DEPENDENT * size.max()).sum(axis=-1).min())
        back = np.linalg.pinv(rows, rcond=DEPENDENT)
        shift = -(back @ drift[..., None])[..., 0]
        return np.swapaxes(turned[..., rank:, :], -1, -2), shift, np.swapaxes(back, -1, -2)


def rate_along(row: Floats, rate: Real) -> float:
    """How fast a coordinate with a row over the drivers changes at their rates; 0 for rounding."""
    total = float(row @ np.atleast_1d(rate))
    return total if abs(total) > STILL * float(np.abs(row) @ np.abs(np.atleast_1d(rate))) else 0.0


def constrained(M: Floats, push: Floats, constraint: Constraints | None) -> tuple[Floats, Floats]:
    """Accelerations (k,), and pushes (a,) of the stops; NaN where a driver has no inertia."""
    if constraint is None:
        return _solved(M, push), np.empty(0)
    Z, shift, back = constraint.free()
    qdd = shift + Z @ _solved(Z.T @ M @ Z, Z.T @ (push - M @ shift))
    return qdd, back @ (M @ qdd - push)


def _solved(M: Floats, push: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.solve(M, push), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.full(len(push), math.nan)


def free_of(constraint: Constraints | None, k: int) -> Floats:
    """A basis (k, z) of what stops and drives leave free."""
    return np.eye(k) if constraint is None else constraint.free()[0]


def pushing(M: Floats, rows: Floats, apart: Floats) -> list[tuple[int, ...]]:
    """Sets of stops that may push while the others part, the one without friction first.

    ``rows`` (a, k) count positive away from the stops; ``apart`` (a,) is how fast each would part
    without any push. The first set fulfils 0 <= P, 0 <= apart + G P, one of them zero, with
    G = n M^-1 n^T (a linear complementarity problem); of the others friction may make one right.
    """
    G = rows @ np.linalg.solve(M, rows.T)
    sets, wrong = [], []
    for some in (c for n in range(len(rows) + 1) for c in combinations(range(len(rows)), n)):
        at, P = list(some), np.zeros(len(rows))
        part = G[np.ix_(at, at)]
        if some and np.linalg.matrix_rank(part, tol=DEPENDENT * G.max()) < len(some):
            continue
        P[at] = np.linalg.solve(part, -apart[at])
        separation = apart + G @ P
        sets.append(some)
        threshold = -SETTLED * np.abs(apart).max(initial=0.0)
        wrong.append(bool((P < 0).any() or (separation < threshold).any()))
    return [sets[i] for i in np.argsort(wrong, kind="stable")]
