"""Equilibria: where nothing accelerates, and what becomes of disturbances there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.path.quadrature import EPS

NEWTON_STEPS = 30
LONGEST = 0.3  # step, of the scale
CLOSE = 1e-12  # step below which two more are made
STEP = 1e-3  # of difference quotients, of the scale
NONE = 1e-9  # eigenvalue, relative to the largest, that is none
FLAT = 1e-11  # acceleration, relative to the typical one, that is none


class Rest(NamedTuple):
    """An equilibrium.

    q : (k,) [rad or m]
    values : (2k,) eigenvalues [1/s] of disturbances, the slowest first
    error : of q [rad or m]
    """

    q: Floats
    values: Floats
    error: float

    @property
    def kind(self) -> str:
        """ "stable", "indifferent" or "unstable"."""
        slowest = float(self.values[0].real)
        size = float(np.abs(self.values).max())
        if abs(slowest) <= NONE * size:
            return "indifferent"
        return "stable" if slowest < 0 else "unstable"


def equilibrium(equation: Equation, t0: float, q: Floats, scale: Floats) -> Rest | None:
    """The equilibrium near coordinates q (k,) by Newton's method, or None."""
    k = equation.drivers
    still = np.zeros(k)
    q = q.copy()
    last, polished = np.inf, 0
    for _ in range(NEWTON_STEPS):
        here = _acceleration(equation, t0, q, still)
        slope = _slope(equation, t0, q, still, scale, of_rate=False)
        if not (np.isfinite(here).all() and np.isfinite(slope).all()):
            return None
        step = -np.linalg.lstsq(slope, here, rcond=1e-10)[0]
        size = float(np.abs(step / scale).max())
        step *= min(1.0, LONGEST / size) if size > 0 else 1.0
        q = q + step
        last = float(np.abs(step).max())
        polished += size < CLOSE
        if polished == 2:
            break
    else:
        if not last < 1e-9 * float(scale.max()):
            return None
    here = _acceleration(equation, t0, q, still)
    left = np.abs(np.linalg.lstsq(slope, here, rcond=1e-10)[0]).max()
    if float(np.abs(here - slope @ np.linalg.lstsq(slope, here, rcond=1e-10)[0]).max()) > (
        FLAT * (float(np.abs(slope).max()) * float(scale.max()) + equation.speed**2)
    ):
        return None  # nothing near balances what is left
    error = 4 * (last + float(left)) + 4 * EPS * float(np.abs(q).max() + scale.max())
    return Rest(q, _values(equation, t0, q, scale), error)


def _acceleration(equation: Equation, t0: float, q: Floats, qd: Floats) -> Floats:
    k = equation.drivers
    y = np.concatenate([q, qd, [0.0]])
    return np.asarray(equation.rhs(t0, y), dtype=np.float64)[k : 2 * k]


def _slope(
    equation: Equation, t0: float, q: Floats, qd: Floats, scale: Floats, of_rate: bool
) -> Floats:
    """d q''/dq or d q''/dq' (k, k), differences of fourth order."""
    columns = []
    for i in range(q.size):
        away = np.zeros(q.size)
        away[i] = STEP * scale[i]

        def at(n: float, away: Floats = away) -> Floats:
            moved = (q, qd + n * away) if of_rate else (q + n * away, qd)
            return _acceleration(equation, t0, *moved)

        rise = (at(-2) - at(2) + 8 * (at(1) - at(-1))) / (12 * away[i])
        columns.append(rise)
    return np.column_stack(columns)


def _values(equation: Equation, t0: float, q: Floats, scale: Floats) -> Floats:
    k = q.size
    rates = scale * equation.speed
    A = np.zeros((2 * k, 2 * k))
    A[:k, k:] = np.eye(k)
    A[k:, :k] = _slope(equation, t0, q, np.zeros(k), scale, of_rate=False)
    A[k:, k:] = _slope(equation, t0, q, np.zeros(k), rates, of_rate=True)
    found = np.linalg.eigvals(A)
    return np.asarray(found[np.argsort(-found.real, kind="stable")])
