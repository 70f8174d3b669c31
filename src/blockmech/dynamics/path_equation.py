"""dK/dq at the nodes of a panel, as a function of the kinetic energy there.

Loads of the place alone do not ask for it; loads of the rate take the rate that it means, and
joint friction is solved with the reactions that follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.friction import JointFriction
from blockmech.dynamics.pair_friction import Sides
from blockmech.dynamics.panels import PLAIN, SMALLEST, Floats, P, Spans, leading, rule
from blockmech.dynamics.place_data import SLIPS, TAU, J
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

FAST = 1 / 16  # by which a step falls while the matrix of Newton's method serves: a digit and more
STEPS = 16  # of Newton's method over a row of panels; what needs more goes one by one
SLOWEST = math.sqrt(SMALLEST)  # [rad/s or m/s] only says in which direction loads of the rate act


class EffortFunction(NamedTuple):
    """What acts at the nodes of a panel at some kinetic energy.

    w : (n,) dK/dq
    lost : (n,) magnitude of dW/dq that friction takes
    loads : (m,) vectors (n,) on the pairs with friction
    """

    w: Floats
    lost: Any = 0.0
    loads: Any = None


Work: TypeAlias = Callable[[Floats], EffortFunction]  # from the kinetic energy (n,) at the nodes


def of_rate(system: System, q: Floats, rows: Floats, inertia: Floats, sign: int) -> Work:
    """Loads that follow the rate as well: the effort at the rates that K means, of any shape.

    Of a straight line in the rate the last row of place data is the slope, else the kernels tell.
    """
    tau, slope = rows[TAU], sign * rows[-1]

    def work(K: Floats) -> EffortFunction:
        rate = np.maximum(np.sqrt(2 * np.maximum(K, 0.0) / inertia), SLOWEST)
        if system.damped:
            return EffortFunction(tau + slope * rate)
        return EffortFunction(system.sample(q, sign * rate).tau)

    return work


def of_friction(friction: JointFriction, q: Floats, rows: Floats, sign: int, sides: Sides) -> Work:
    """Joint friction, with loads of the place and perhaps of the rate."""
    rest, square, *responses = friction.responses(rows)
    slips = np.abs(rows[SLIPS : SLIPS + len(sides)])

    def work(K: Floats) -> EffortFunction:
        qd2 = 2 * K / rows[J]  # beyond a standstill it goes on smoothly, with a negative square
        if friction.rate_loads:
            rate = np.maximum(np.sqrt(np.maximum(qd2, 0.0)), SLOWEST)
            acting = friction.acting(q, sign * rate)
        else:
            acting = friction.at_square(rest, square, qd2)
        slipping = slips * np.sqrt(np.maximum(qd2, 0.0))
        solution = friction.solve([acting, *responses], sides, friction.law(slipping), slipping)
        return EffortFunction(solution.effort + square[0] * qd2, solution.taken, solution.loads)

    return work


def of_place(rows: Floats) -> Work:
    """Loads of the place alone."""
    acting = EffortFunction(rows[TAU])
    return lambda K: acting


def settled(work: Work, span: Spans, n: int, guess: Floats | None) -> tuple[EffortFunction, Floats]:
    """What acts on a panel and K (n + 1,), which fit each other; NaN where none are found.

    Newton's method on  w = work(K), K = energy + G w; its matrix serves while steps fall fast.
    Steps that a new matrix does not make fall have met rounding if they are below its root, as
    the next would be their square; else nothing is found.
    """
    (G,), (energy,) = span.slopes(n), span.energy
    w = work(np.full(n, energy)).w if guess is None else guess
    inverse, last, new = np.empty(0), math.inf, True
    while True:
        K = energy + G[:-1] @ w
        acting = work(K)
        if new:
            step = math.sqrt(EPS) * (np.abs(K) + EPS * np.abs(K).max()) + SMALLEST
            matrix = np.eye(n) - ((work(K + step).w - acting.w) / step)[:, None] * G[:-1]
            if not np.isfinite(matrix).all():
                break
            inverse = np.linalg.inv(matrix)
        change = inverse @ (acting.w - w)
        size = float(np.abs(change).max())
        w = w + change
        whole = float(np.abs(w).max())
        if size <= 4 * EPS * whole or (size >= last and size <= math.sqrt(EPS) * whole):
            return acting._replace(w=w), energy + G @ w
        if not math.isfinite(size) or (new and size >= last):
            break
        new, last = size > FAST * last, size
    return EffortFunction(np.full(n, math.nan)), np.full(n + 1, math.nan)


def begin_energies(K: float, gains: Floats, more: Any) -> Floats:
    """[J] (m,) at the begin of panels in a row, of the first K; each leaves some more."""
    energies = np.empty(len(gains))
    energies[0], energies[1:] = K, K + (gains[:, -1] + more)[:-1].cumsum()
    return energies


def solved(
    acts: Work, spans: Spans, w: Floats, begin: float, more: Any
) -> tuple[Floats, Floats, Floats, int]:
    r"""dK/dq (m, n) of panels in a row that begin with an energy [J], from a guess of it.

    Also gains (m, n + 1), energies (m,), and of how many panels they are found. With a = dw/dK
    the equation of Newton's method for the change of K is linear and of first order, so an
    integrating factor takes the place of a matrix:

        dK' = r + a dK  ->  dK = e^A (dK_0 + integral of e^-A r),   A = integral of a

    The slope a serves while steps fall fast, as in `settled`.
    """
    r, kind = rule(w.shape[1]), spans.kind
    bends = P[kind][:, None] * r.powers[kind] * spans.way[:, None]
    last, a, known = np.full(len(w), math.nan), None, 0
    for _ in range(STEPS):
        gains = spans.gains(w)
        K = (begin_energies(begin, gains, more)[:, None] + gains)[:, :-1]
        now = acts(K).w
        if a is None:
            step = math.sqrt(EPS) * (np.abs(K) + EPS * np.abs(K).max()) + SMALLEST
            a = (acts(K + step).w - now) / step
            A = (a * bends) @ r.energy[PLAIN].T
            growth, fading = np.exp(A), np.exp(-A[:, :-1])
        rise, change_of_K = spans.gains(fading * (now - w)), [0.0]
        for grows, rises in zip(growth[:-1, -1].tolist(), rise[:-1, -1].tolist(), strict=True):
            change_of_K.append(grows * (change_of_K[-1] + rises))
        change = now - w + a * (growth * (np.array(change_of_K)[:, None] + rise))[:, :-1]
        w = w + change
        size, whole = np.abs(change).max(axis=1), np.abs(w).max(axis=1)
        following = size * (size / last)  # at most, as steps fall faster and faster
        settled = np.fmin(size, following) <= 4 * EPS * whole
        settled |= (size >= last) & (size <= math.sqrt(EPS) * whole)
        going = leading(K.min(axis=1) > 0)  # behind a standstill nothing counts
        known = min(leading(settled), going)
        if known == going:
            break
        slow = ~(size[: known + 1] <= FAST * last[: known + 1])
        a, last = None if slow.any() else a, size
    gains = spans.gains(w)
    return w, gains, begin_energies(begin, gains, more), known
