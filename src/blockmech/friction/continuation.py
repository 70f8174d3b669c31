"""Continuation from zero friction: what decides where no certificate does.

The physical solution is the one that starts at zero friction. Its path is
followed in the scale lambda of all friction factors, from 0 to 1, by
pseudo-arclength in homogeneous unknowns v = (n, eta, lambda): friction is
n / eta, so reactions that go to infinity are an ordinary point of the path.

    G_j(v) = n_j - lambda k_j | eta f_j + sum_m R_jm n_m |,     |n|^2 + eta^2 = 1

The path ends at lambda = 1 (solved), at eta = 0 (asymptote: reactions grow
without bound whatever the loads) or where lambda turns back (fold: no solution
beyond). The last two are self-locking, and lambda there is the limit.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP, LARGEST, SMALLEST = 0.05, 0.2, 1e-10
TURN = 0.95  # cosine of the largest turn of the tangent in one step
MOST = 500  # steps


class Outcome(enum.IntEnum):
    """How the friction of a sample was settled."""

    CERTIFIED = 0
    BY_CONTINUATION = 1
    NOT_CONVERGED = 2
    FOLD = 3
    ASYMPTOTE = 4


class Path(NamedTuple):
    """End of a path."""

    t: tuple[float, ...]  # friction; NaN without a solution
    g: tuple[float, ...]  # [N] loads on the pairs; NaN without a solution
    outcome: Outcome
    limit: float  # scale of the friction factors up to which a solution exists
    residual: float  # relative
    steps: int


class _Equations:
    """The equations of one sample, scaled to unit loads and unit factors."""

    def __init__(
        self,
        k: Sequence[float],
        edges: Sequence[bool],
        base: Sequence[complex],
        rows: Sequence[Sequence[complex]],
    ) -> None:
        self.edges = np.array(edges)
        f = np.array([[z.real, z.imag] for z in base])
        R = np.array([[[z.real, z.imag] for z in row] for row in rows])
        self.load = float(np.abs(f).max()) or 1.0
        self.factor = float(np.abs(k).max()) or 1.0
        self.k = np.array(k) / self.factor
        self.f = f / self.load  # (m, 2)
        self.R = R * self.factor  # (m, m, 2)
        self.m = len(self.k)

    def norm(self, n: Array, eta: float) -> tuple[Array, Array]:
        """Load norms (m,) and their gradients (m, m + 1) in (n, eta)."""
        F = eta * self.f + np.einsum("jmc,m->jc", self.R, n)
        g = np.where(self.edges, np.abs(F).max(axis=1), np.hypot(F[:, 0], F[:, 1]))
        unit = F / np.maximum(g, 1e-300)[:, None]
        if self.edges.any():
            pick = np.abs(F).argmax(axis=1)
            corner = np.zeros_like(F)
            corner[np.arange(self.m), pick] = np.sign(F[np.arange(self.m), pick])
            unit = np.where(self.edges[:, None], corner, unit)
        slope = np.empty((self.m, self.m + 1))
        slope[:, :-1] = np.einsum("jc,jmc->jm", unit, self.R)
        slope[:, -1] = np.einsum("jc,jc->j", unit, self.f)
        return g, slope

    def value(self, v: Array) -> tuple[Array, Array]:
        """G (m + 1,) and its Jacobian (m + 1, m + 2)."""
        m, n, eta, lam = self.m, v[:-2], v[-2], v[-1]
        g, slope = self.norm(n, eta)
        G = np.append(n - lam * self.k * g, n @ n + eta * eta - 1.0)
        J = np.zeros((m + 1, m + 2))
        J[:m, : m + 1] = -lam * self.k[:, None] * slope
        J[:m, :m] += np.eye(m)
        J[:m, -1] = -self.k * g
        J[m, :m], J[m, m] = 2 * n, 2 * eta
        return G, J


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
    eq = _Equations(k, edges, base, rows)
    v = np.zeros(eq.m + 2)
    v[-2] = 1.0
    tangent = _tangent(eq, v, None)
    step = STEP
    for count in range(1, MOST + 1):
        moved = _correct(eq, v, tangent, step)
        turned = None if moved is None else _tangent(eq, moved[0], tangent)
        if moved is None or turned is None or turned @ tangent < TURN:
            step /= 2
            if step < SMALLEST:
                return _ended(eq, Outcome.NOT_CONVERGED, v[-1], count)
            continue
        new, effort = moved
        if new[-1] >= 1.0:
            return _polish(eq, v, new, count)
        if new[-2] <= 0.0:
            share = v[-2] / (v[-2] - new[-2])
            return _ended(eq, Outcome.ASYMPTOTE, v[-1] + share * (new[-1] - v[-1]), count)
        if turned[-1] <= 0.0:
            return _ended(eq, Outcome.FOLD, _fold(eq, v, tangent, step), count)
        v, tangent = new, turned
        if effort <= 3:
            step = min(1.5 * step, LARGEST)
    return _ended(eq, Outcome.NOT_CONVERGED, v[-1], MOST)


def _tangent(eq: _Equations, v: Array, along: Array | None) -> Array:
    """Unit null vector of the Jacobian, in the direction of the last one (or of lambda)."""
    _, J = eq.value(v)
    null: Array = np.linalg.svd(J)[2][-1]
    ahead = null[-1] if along is None else null @ along
    return -null if ahead < 0 else null


def _correct(eq: _Equations, v: Array, tangent: Array, step: float) -> tuple[Array, int] | None:
    """Newton back to the path, across the tangent; None if it takes more than six steps."""
    guess = v + step * tangent
    x = guess.copy()
    for effort in range(1, 7):
        G, J = eq.value(x)
        A = np.vstack([J, tangent])
        try:
            dx = np.linalg.solve(A, np.append(G, tangent @ (x - guess)))
        except np.linalg.LinAlgError:
            return None
        x = x - dx
        if np.abs(dx).max() < 1e-12:
            return x, effort
    return None


def _fold(eq: _Equations, v: Array, tangent: Array, step: float) -> float:
    """Largest lambda on the path between v and one step further."""
    low, high, top = 0.0, step, float(v[-1])
    for _ in range(40):
        middle = (low + high) / 2
        moved = _correct(eq, v, tangent, middle)
        if moved is None:
            high = middle
            continue
        top = max(top, float(moved[0][-1]))
        if _tangent(eq, moved[0], tangent)[-1] > 0:
            low = middle
        else:
            high = middle
    return top


def _polish(eq: _Equations, v: Array, new: Array, count: int) -> Path:
    """Newton at lambda = 1 exactly, from the interpolated crossing."""
    share = (1.0 - v[-1]) / (new[-1] - v[-1])
    x = v + share * (new - v)
    n = x[:-2] / x[-2]
    for _ in range(20):
        g, slope = eq.norm(n, 1.0)
        r = n - eq.k * g
        try:
            dn = np.linalg.solve(np.eye(eq.m) - eq.k[:, None] * slope[:, :-1], r)
        except np.linalg.LinAlgError:
            return _ended(eq, Outcome.NOT_CONVERGED, 1.0, count)
        n = n - dn
        if np.abs(dn).max() <= 4e-16 * max(1.0, np.abs(n).max()):
            break
    near = x[:-2] / x[-2]
    g, _ = eq.norm(n, 1.0)
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


def _ended(eq: _Equations, outcome: Outcome, limit: Any, count: int) -> Path:
    nothing = (float("nan"),) * eq.m
    return Path(nothing, nothing, outcome, float(limit), float("nan"), count)


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


def confirmed(given: Any, k: Any, edges: Any, base: Any, rows: Any, tolerance: float) -> Any:
    """One uncertified sample of successive approximations: it stands if continuation agrees.

    Near a contraction rho of 1 the remaining error is rho / (1 - rho) times the last
    change, and beyond it the iteration may settle on another solution.
    """
    found = continue_from_zero(k, edges, base, rows)
    outcome = found.outcome
    if outcome == Outcome.BY_CONTINUATION:
        rho = min(max(given.contraction, 0.0), 1.0 - 1e-12)
        reach = max(tolerance, 1e-12 * max(found.g)) * max(1.0, rho / (1.0 - rho))
        off = max(abs(a - b) for a, b in zip(found.g, given.g, strict=True))
        if given.outcome or not off <= 10.0 * reach:
            outcome = Outcome.NOT_CONVERGED
    spoilt = outcome != Outcome.BY_CONTINUATION
    t = (float("nan"),) * len(given.t) if spoilt else given.t
    return given._replace(t=t, outcome=float(outcome), limit=found.limit)
