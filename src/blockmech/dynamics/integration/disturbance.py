r"""How far rounding takes a run from its course: small disturbances, followed along it.

Two runs at different tolerances share the table and the kernels, and what rounds alike in
both their difference does not show. Where neighbouring motions part, near a separatrix or
from close to an unstable equilibrium, that grows: a disturbance z of the state follows

    z' = A(t) z,        A = df/dy along the run, by differences,

so with a new disturbance of variance D in every interval the covariance of all of them is

    P <- Phi P Phi^T + D,        Phi = exp(A dt).

Disturbed are the coordinate and the rate by the rounding of each step's sum, and the rate
by the relative error of the acceleration: rounding of the kernels, and the table's error.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.integration.integrate import Run
from blockmech.dynamics.integration.legs import Leg
from blockmech.dynamics.path.quadrature import EPS

MOST, LEAST = 64, 4  # intervals
SHARE = 8  # right-hand sides of the run for each interval: a judgement is cheaper than a run
STEP = 1e-7  # relative to the state: of the difference quotients
BESIDE = 1e-4  # of a leg: how far from the kink that it begins on a quotient is taken
SURELY = 4.0  # standard deviations that are called an error
SERIES = 6  # terms of the exponential, once halved
SMALL = 1 / 16  # norm of what its series is summed of
HALVINGS = 4, 1000  # at least, at most: beyond it the exponential is 0 or infinite


class Grown(NamedTuple):
    """What became of the disturbances of a run.

    coordinate : [rad or m] largest error of a coordinate
    time : [s] error of the time of its end, where an event ends it
    """

    coordinate: float
    time: float


def grown(equation: Equation, run: Run) -> Grown:
    """Errors that rounding, and the table's error, have made along a run.

    Cost: 2k + 1 right-hand sides an interval, fewer than half of what the run took.
    """
    t, steps = _stations(run)
    if t.size < 2:
        return Grown(0.0, 0.0)
    with np.errstate(all="ignore"):  # what grows without bound is infinite
        found = _followed(equation, run, t, steps)
    return Grown(*(x if x >= 0 else math.inf for x in found))


def _followed(equation: Equation, run: Run, t: Floats, steps: Floats) -> Grown:
    k = run.drivers
    q, qd = (x.reshape(t.size, k) for x in run.state(t))
    slopes, accelerations = _linear(equation, t, q, qd)
    dt = np.diff(t)
    middle = (slopes[:-1] + slopes[1:]) / 2
    flow = _exponential(np.nan_to_num(middle, posinf=0.0, neginf=0.0) * dt[:, None, None])
    noise = _noise(equation, q, qd, accelerations, dt, steps)
    P, most = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
    for Phi, D in zip(flow, noise, strict=True):
        P = Phi @ P @ Phi.T
        P.flat[:: 2 * k + 1] += D
        most = np.maximum(most, P.diagonal())
    if not np.isfinite(P).all():
        return Grown(math.inf, math.inf)
    place = SURELY * math.sqrt(float(most[:k].max()))
    if run.end == "time":
        return Grown(place, 0.0)
    last = SURELY * np.sqrt(np.maximum(P.diagonal(), 0.0))
    speed, push = float(np.abs(qd[-1]).max()), float(np.abs(accelerations[-1]).max())
    if run.end in ("standstill", "swings"):
        return Grown(place, float(last[k:].max()) / push if push > 0 else math.inf)
    # met at a speed; or, where that is nothing, by the acceleration alone
    error = float(last[:k].max())
    late = error / speed if speed > 0 else math.inf
    return Grown(place, min(late, math.sqrt(2 * error / push) if push > 0 else math.inf))


def _stations(run: Run) -> tuple[Floats, Floats]:
    """Times (m + 1,) [s] at the ends of intervals of some steps each, and how many (m,)."""
    marks = np.unique(np.concatenate([_within(leg, i > 0) for i, leg in enumerate(run.legs)]))
    marks = marks[(marks >= run.legs[0].t0) & (marks < run.t_end)]
    if not marks.size:
        return marks, marks
    count = max(LEAST, min(MOST, run.evaluations // SHARE))
    chosen = np.unique(np.linspace(0, marks.size, count + 1).astype(np.intp))
    t = np.append(marks, run.t_end)
    if marks.size < LEAST:  # long steps
        return np.linspace(t[0], t[-1], LEAST + 1), np.ones(LEAST)
    return t[chosen], np.diff(chosen).astype(np.float64)


def _within(leg: Leg, later: bool) -> Floats:
    """Times [s] at which steps begin; a later leg begins on a kink of a load: not beside that."""
    if not later:
        return leg.marks
    beside = leg.t0 + BESIDE * (leg.t1 - leg.t0)
    return np.append(beside, leg.marks[leg.marks > beside])


def _linear(equation: Equation, t: Floats, q: Floats, qd: Floats) -> tuple[Floats, Floats]:
    """A (m, 2k, 2k) and q'' (m, k) along a run.

    Coordinates are moved back against the motion: ahead there may be no pose.
    """
    m, k = q.shape
    rhs, w = equation.rhs, equation.speed
    A, qdd = np.zeros((m, 2 * k, 2 * k)), np.empty((m, k))
    A[:, :k, k:] = np.eye(k)
    y = np.zeros((m, 2 * k + 1))
    y[:, :k], y[:, k : 2 * k] = q, qd
    steps = STEP * np.maximum(np.abs(y[:, : 2 * k]), np.repeat([1e-1, 1e-1 * w], k))
    steps[:, :k] *= np.where(qd > 0, -1.0, 1.0)
    for i in range(m):
        state, time = y[i], float(t[i])
        base = rhs(time, state)[k : 2 * k]
        qdd[i] = base
        for j in range(2 * k):
            moved = state.copy()
            moved[j] += steps[i, j]
            step = float(moved[j]) - float(state[j])
            there = rhs(time, moved)[k : 2 * k]
            A[i, k:, j] = [(b - a) / step for a, b in zip(base, there, strict=True)]
    return A, qdd


def _noise(
    equation: Equation, q: Floats, qd: Floats, qdd: Floats, dt: Floats, steps: Floats
) -> Floats:
    """Variances (m, 2k) of what disturbs coordinates and rates in each interval."""
    k = q.shape[1]
    rough = EPS + equation.table_error
    usual = np.maximum(np.nanmax(np.abs(qdd), axis=0), equation.speed**2)
    found = np.empty((dt.size, 2 * k))
    found[:, :k] = (EPS * np.maximum(np.abs(q[:-1]), np.abs(q[1:]))) ** 2 * steps[:, None]
    rounded = (EPS * np.abs(qd).max(axis=0)) ** 2 * steps[:, None]
    found[:, k:] = rounded + (rough * usual * dt[:, None]) ** 2 / steps[:, None]
    return found


def _exponential(X: Floats) -> Floats:
    """exp of matrices (m, n, n), by the series of a small part and squarings.

    The parts are small for the stiffest of them too: what decays fast must not seem to grow.
    """
    size = float(np.abs(X).sum(axis=2).max(initial=0.0))
    least, most = HALVINGS
    halvings = least if size <= 2**least * SMALL else math.ceil(math.log2(size / SMALL))
    if halvings > most:
        return np.full_like(X, math.inf)
    X = X / 2**halvings
    total = term = np.broadcast_to(np.eye(X.shape[-1]), X.shape)
    for n in range(1, SERIES + 1):
        term = term @ X / n
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return np.asarray(total)
