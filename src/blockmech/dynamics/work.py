"""dK/dq at the nodes of a panel, as a function of the kinetic energy there.

Loads of the place alone do not ask for it; loads of the rate take the rate that it means, and
joint friction is solved with the reactions that follow.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from blockmech.dynamics.friction import JointFriction, Loads, Placed, Responses, Sides
from blockmech.dynamics.panels import SMALLEST, Floats, Span
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

STEPS = 20  # of Newton: it ends by itself where steps no longer fall, after 4 to 8
FAST = 1 / 16  # by which a step falls while the matrix of Newton's method serves: a digit and more
SLOWEST = 1e-40  # [rad/s or m/s] a rate that only says in which direction loads of the rate act


class Work(Protocol):
    """dK/du along the motion at the nodes of a panel, with the energy K (n,) there."""

    def __call__(self, K: Floats) -> Floats:
        """dK/du (n,)."""
        ...


class OfRate:
    """Loads that follow the rate as well."""

    def __init__(self, system: System, q: Floats, J: Floats, sign: int) -> None:
        self._system, self._q, self._J, self._sign = system, q, J, sign

    def __call__(self, K: Floats) -> Floats:
        """The effort at the rates that K means."""
        rate = self._sign * np.sqrt(2 * np.maximum(K, 0.0) / self._J)
        found = self._system.sample(self._q, np.where(rate == 0, self._sign * SLOWEST, rate))
        return np.asarray(self._sign * found.tau)


class OfFriction:
    """Joint friction, with loads of the place and perhaps of the rate.

    lost : (n,) what friction takes, dW/du, at the energy that was asked for last
    loads : (n, m) on the pairs
    """

    def __init__(
        self, friction: JointFriction, q: Floats, rows: Floats, sign: int, sides: Sides
    ) -> None:
        self._friction, self._q, self._sign, self._sides = friction, q, sign, sides
        self._placed = Placed.of(rows, len(sides))
        self.lost = np.zeros(q.size)
        self.loads = np.zeros((q.size, len(sides)), dtype=complex)
        self.guides = friction.guides

    def _acting(self, qd2: Floats) -> Loads:
        if not self._friction.program.rate_loads:
            return self._placed.loads(qd2)
        rate = self._sign * np.maximum(np.sqrt(np.maximum(qd2, 0.0)), SLOWEST)
        return self._friction.loads(self._q, rate)

    def __call__(self, K: Floats) -> Floats:
        """Effort and friction at the rates that K means."""
        r: Responses = self._placed.responses
        qd2 = 2 * K / r.J  # beyond a standstill it goes on smoothly, with a negative square
        found = self._friction.solve(r, self._acting(qd2), self._sides)
        slowed = (r.s * found.t).sum(axis=1)
        self.lost, self.loads = -self._sign * slowed, found.F
        return np.asarray(self._sign * (found.effort - self._placed.square.push * qd2))


def settled(work: Work | None, w: Floats | None, span: Span, n: int) -> tuple[Floats, Floats]:
    """w (n,) and K (n + 1,) of a panel that fit each other; NaN where none are found.

    ``w`` is what the place does alone, or a first guess. Newton's method on  w = work(K),
    K = energy + G w; its matrix serves while steps fall fast. Steps that stop falling have met
    rounding if they are below its root, as the next would be their square; else nothing is found.
    """
    G = span.slopes(n)
    if work is None:
        assert w is not None
        return w, span.energy + G @ w
    w = work(np.full(n, span.energy)) if w is None else w
    inverse, last = None, math.inf
    for _ in range(STEPS):
        K = span.energy + G[:-1] @ w
        there = work(K)
        if inverse is None:
            step = math.sqrt(EPS) * (np.abs(K) + EPS * np.abs(K).max()) + SMALLEST
            matrix = np.eye(n) - ((work(K + step) - there) / step)[:, None] * G[:-1]
            finite = np.isfinite(matrix).all()
            inverse = np.linalg.inv(matrix) if finite else np.full((n, n), math.nan)
            there = work(K)
        change = inverse @ (there - w)
        size = float(np.abs(change).max())
        if not math.isfinite(size):
            return np.full(n, math.nan), span.energy + G @ w
        w = w + change
        within = size / float(np.abs(w).max())
        if within <= 4 * EPS or (size >= last and within <= math.sqrt(EPS)):
            return w, span.energy + G @ w
        inverse, last = (inverse if size <= FAST * last else None), size
    return np.full(n, math.nan), span.energy + G @ w
