"""Steps of Radau's method for stiff equations, written once as those of `stages`.

Of each step, until most are done or the bound is reached:

    Z_i = h sum_j A_ij f(t + C_j h, y + Z_j), i = 1, 2, 3, by simplified Newton: with the same
        slopes J of the rates in all iterations, and in later steps as long as these converge fast
    off = norm of (m / h - J)^-1 (f(t, y) + sum_j E_j Z_j / h), in tolerances
    the step is taken where off is at most 1, else it is tried again with a shorter h

The iteration solves sum_j (A^-1)_ij dZ_j / h - J dZ_i = f_i - sum_j (A^-1)_ij Z_j / h, and m is the
real eigenvalue of A^-1. The slopes are quotients of differences. What Z the cubic through the last
step's gives is where the iteration begins.

Source: Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, IV.8; control and limits
as in SciPy's Radau.
"""

from __future__ import annotations

from functools import cache
from math import sqrt
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from blockmech.engines.kinds import Counts, First, Reals
from blockmech.engines.stages import (
    BOUND,
    HIGH,
    LOW,
    TRIED,
    TRY,
    Fill,
    Integration,
    Lane,
    Lanes,
    Limits,
    Method,
    Rhs,
    Sizes,
    States,
    evaluate,
    first_steps,
    halved,
    is_calm,
    may_turn,
    tolerated,
)
from blockmech.ground.plane import EPS

ITERATIONS = 6
ITERATED = 1.0 / 16.0  # of what a step leaves by its length, what its iteration may leave
SLOW = 1e-3  # share of a correction that is left by the next one
TINY = sqrt(EPS)  # an error that lets a step grow as much as it may
SMALL = 1e-3  # of a usual size: a component of a state that is less may change by as much
STEP = sqrt(EPS)  # of a component, by which it is changed for the slopes
ROOT = sqrt(6.0)
REAL = 3.0 + 3.0 ** (2.0 / 3.0) - 3.0 ** (1.0 / 3.0)  # the real eigenvalue of A^-1
Threes: TypeAlias = Annotated[Reals, "3"]
Vector: TypeAlias = Annotated[Reals, First("of.state")]
Vectors: TypeAlias = Annotated[Reals, "of.state"]


class Scheme(NamedTuple):
    """Coefficients: places of the stages; A^-1; of the error, and of the cubic."""

    C: Reals
    back: Threes
    E: Reals
    D: Threes


class Workspace(NamedTuple):
    """Of a step under way; the next call goes on from there.

    time : [s] where it begins, h : how long it is, trial : how long it was tried first
    last_h, last_trial, last_off : of the step before, 0 before the first; and its error
    rate : how fast the iteration converges; fresh : 1 where the slopes are those of this state
    factored : [s] length for which there are matrices
    y : state where it begins, Z : (3, n) see above, off : (3 n,) what is left of the equations
    scale : (n,) tolerances, sizes : usual sizes of the components
    error : (n,) of the step, estimate : what Z says of it
    J : (n, n) slopes of the rates, system, real : matrices of the iteration and of the error
    pivots, exchanged : of both; past : (3, n) of the cubic of the last step
    """

    time: Lane
    h: Lane
    trial: Lane
    last_h: Lane
    last_trial: Lane
    last_off: Lane
    rate: Lane
    fresh: Lane
    factored: Lane
    y: Annotated[Lanes, First("of.state")]
    Z: Annotated[Vectors, First("3")]
    off: Annotated[Reals, First("3 * of.state")]
    scale: Vector
    estimate: Vector
    error: Vector
    sizes: Vector
    J: Annotated[Vectors, First("of.state")]
    system: Annotated[Reals, First("9 * of.state * of.state")]
    real: Annotated[Reals, First("of.state * of.state")]
    past: Annotated[Vectors, First("3")]
    pivots: Annotated[Counts, First("3 * of.state")]
    exchanged: Annotated[Counts, First("of.state")]


@cache
def radau() -> Method:
    """Three stages of the step, the rates at its end, and two places more that are watched."""
    C = np.array([0.0, (4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0, 0.4, 0.82])
    A = np.array([
        [(88.0 - 7.0 * ROOT) / 360.0, (296.0 - 169.0 * ROOT) / 1800.0, (-2.0 + 3.0 * ROOT) / 225.0],
        [(296.0 + 169.0 * ROOT) / 1800.0, (88.0 + 7.0 * ROOT) / 360.0, (-2.0 - 3.0 * ROOT) / 225.0],
        [(16.0 - ROOT) / 36.0, (16.0 + ROOT) / 36.0, 1.0 / 9.0],
    ])  # fmt: skip
    back = np.linalg.inv(A)
    E = np.array([-13.0 - 7.0 * ROOT, -13.0 + 7.0 * ROOT, -1.0]) / 3.0
    high = np.array([10.0 / 3.0 + 5.0 * ROOT, 10.0 / 3.0 - 5.0 * ROOT, 10.0 / 3.0])
    square = np.array([-23.0 - 22.0 * ROOT, -23.0 + 22.0 * ROOT, -8.0]) / 3.0
    D = np.array([-high, -(square + high)])
    return Method(steps, 1, C.size, 4, Scheme(C, back, E, D), (1, 0), Workspace)


def factor(A: Reals, pivots: Counts, n: int) -> None:
    """A matrix (n, n) as a lower and an upper one in its place, whole rows exchanged."""
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i * n + k]) > abs(A[p * n + k]):
                p = i
        pivots[k] = p
        if p != k:
            for j in range(n):
                A[k * n + j], A[p * n + j] = A[p * n + j], A[k * n + j]
        for i in range(k + 1, n):
            A[i * n + k] = A[i * n + k] / A[k * n + k]
            for j in range(k + 1, n):
                A[i * n + j] -= A[i * n + k] * A[k * n + j]


def solve(A: Reals, pivots: Counts, b: Reals, n: int) -> None:
    """The solution of a system in the place of its right-hand side."""
    for k in range(n):
        p = pivots[k]
        b[k], b[p] = b[p], b[k]
    for k in range(n):
        for i in range(k + 1, n):
            b[i] -= A[i * n + k] * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k * n + j] * b[j]
        b[k] = b[k] / A[k * n + k]


def factored(of: Sizes, by: Scheme, work: Workspace) -> None:
    """Both systems of a step."""
    n, h = of.state, work.h[0]
    for i in range(n):
        for j in range(n):
            identity, slope = 1.0 if i == j else 0.0, work.J[i, j]
            work.real[i * n + j] = REAL / h * identity - slope
            for r in range(3):
                for s in range(3):
                    local = slope if r == s else 0.0
                    work.system[(r * n + i) * 3 * n + s * n + j] = (
                        by.back[r, s] / h * identity - local
                    )
    factor(work.real, work.exchanged, n)
    factor(work.system, work.pivots, 3 * n)
    work.factored[0] = h


def at_time(of: Sizes, fill: Fill, rhs: Rhs, t: float, s: int) -> None:
    """As `evaluate`, at a time [s]."""
    rhs.state[of.state, 0] = t
    evaluate(of, fill, rhs, s)


def slopes(of: Sizes, fill: Fill, rhs: Rhs, control: Reals, work: Workspace) -> None:
    """Slopes (n, n) of the rates at a state, each component moved the way it goes."""
    n, K, state, y = of.state, rhs.K, rhs.state, work.y
    for j in range(n):
        for i in range(n):
            state[i, 0] = y[i, 0]
        change = STEP * max(abs(y[j, 0]), SMALL * work.sizes[j])
        state[j, 0] = y[j, 0] + (-change if K[0, j, 0] < 0.0 else change)
        at_time(of, fill, rhs, work.time[0], 1)
        for i in range(n):
            work.J[i, j] = (K[1, i, 0] - K[0, i, 0]) / (state[j, 0] - y[j, 0])
    control[TRIED] += float(n)
    work.fresh[0], work.factored[0] = 1.0, 0.0


def norm(of: Sizes, a: Reals, scale: Reals, many: int) -> float:
    """The mean size of vectors, in tolerances."""
    total = 0.0
    for k in range(many):
        for i in range(of.state):
            part = a[k * of.state + i] / scale[i]
            total += part * part
    return sqrt(total / (many * of.state))


def converged(of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, work: Workspace, allowed: float) -> int:
    """Iterations that a step's Z took to converge, negative where it did not."""
    n, K, h, Z, off, before = of.state, rhs.K, work.h[0], work.Z, work.off, 0.0
    work.rate[0] = 0.0
    for k in range(ITERATIONS):
        for s in range(3):
            for i in range(n):
                rhs.state[i, 0] = work.y[i, 0] + Z[s, i]
            at_time(of, fill, rhs, work.time[0] + by.C[s + 1] * h, s + 1)
        for i in range(n):
            for s in range(3):
                if K[s + 1, i, 0] - K[s + 1, i, 0] != 0.0:  # it is no number
                    return -1 - k
                back = by.back[s, 0] * Z[0, i] + by.back[s, 1] * Z[1, i] + by.back[s, 2] * Z[2, i]
                off[s * n + i] = K[s + 1, i, 0] - back / h
        solve(work.system, work.pivots, off, 3 * n)
        size, rest = norm(of, off, work.scale, 3), 1.0
        if k > 0:
            rate = size / before
            for _ in range(k, ITERATIONS):
                rest *= rate
            if not rate < 1.0 or rest / (1.0 - rate) * size > allowed:
                return -1 - k
            work.rate[0] = rate
        for s in range(3):
            for i in range(n):
                Z[s, i] += off[s * n + i]
        if size == 0.0 or (k > 0 and work.rate[0] / (1.0 - work.rate[0]) * size < allowed):
            return k + 1
        before = size
    return -ITERATIONS


def predicted(of: Sizes, by: Scheme, work: Workspace) -> None:
    """Where the iteration begins: on the cubic of the step before, if there was one."""
    n, Z, past, last = of.state, work.Z, work.past, work.last_h[0]
    for s in range(3):
        x = 1.0 + by.C[s + 1] * work.h[0] / last if last > 0.0 else 0.0
        for i in range(n):
            high = (past[0, i] * x + past[1, i]) * (1.0 - x) + past[2, i]
            Z[s, i] = high * x - past[2, i] if last > 0.0 else 0.0


def iterated(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, control: Reals, work: Workspace, allowed: float
) -> int:
    """As `converged`, once more with slopes of this state where those of one before do not do."""
    while True:
        if work.factored[0] != work.h[0]:
            factored(of, by, work)
        predicted(of, by, work)
        took = converged(of, fill, rhs, by, work, allowed)
        control[TRIED] += 3.0 * abs(float(took))
        if took > 0 or work.fresh[0] == 1.0:
            break
        slopes(of, fill, rhs, control, work)
    return took


def finish_step(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, work: Workspace, series: States
) -> None:
    """The series of a step, see `blockmech.engines.dense`, the rates at its end and inside it."""
    n, Z, past, D, state, y = of.state, work.Z, work.past, by.D, rhs.state, work.y
    for i in range(n):
        for r in range(4):
            series[r, i] = 0.0
        for r in range(2):
            past[r, i] = D[r, 0] * Z[0, i] + D[r, 1] * Z[1, i] + D[r, 2] * Z[2, i]
        past[2, i], series[7, i] = Z[2, i], y[i, 0]
        for r in range(3):
            series[4 + r, i] = past[r, i]
    for s in range(of.ends - 1, of.stages):
        share = by.C[s]
        for i in range(n):
            high = (series[4, i] * share + series[5, i]) * (1.0 - share)
            state[i, 0] = (high + series[6, i]) * share + y[i, 0]
        at_time(of, fill, rhs, work.time[0] + share * work.h[0], s)


def error_of(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, tolerances: Limits, work: Workspace, again: bool
) -> float:
    """The error of a step in tolerances; of one that is tried again it is looked at twice.

    Then for rates at a state that is off by the error itself: that takes out what is stiff of it.
    """
    n, K, E, Z, y = of.state, rhs.K, by.E, work.Z, work.y
    estimate, error = work.estimate, work.error
    for i in range(n):
        estimate[i] = (E[0] * Z[0, i] + E[1] * Z[1, i] + E[2] * Z[2, i]) / work.h[0]
        error[i] = K[0, i, 0] + estimate[i]
        larger = max(abs(y[i, 0]), abs(y[i, 0] + Z[2, i]))
        work.scale[i] = tolerated(of, tolerances, i, 0, larger)
    solve(work.real, work.exchanged, error, n)
    size = norm(of, error, work.scale, 1)
    if again and size > 1.0:
        for i in range(n):
            rhs.state[i, 0] = y[i, 0] + error[i]
        at_time(of, fill, rhs, work.time[0], 1)
        for i in range(n):
            error[i] = K[1, i, 0] + estimate[i]
        solve(work.real, work.exchanged, error, n)
        size = norm(of, error, work.scale, 1)
    return size


def growth(work: Workspace, off: float, took: int) -> float:
    """By how many times the next step may be longer, by the error and the one before."""
    factor = 0.9 * (2 * ITERATIONS + 1) / (2 * ITERATIONS + took) / sqrt(sqrt(off))
    if work.last_h[0] > 0.0:
        before = work.h[0] / work.last_trial[0] * sqrt(sqrt(work.last_off[0] / off))
        factor *= min(1.0, before)
    return factor


def iteration_tolerance(loose: float) -> float:
    """What an iteration may leave [-] of a relative tolerance, by that.

    The estimate is of order 3: of a step that has just this tolerance, order 5 leaves its root.
    All steps leave to the same side what they iterate to: that is a small part of it, for two runs
    to differ by their steps, and what does not fall with the tolerance no run shows.
    """
    return max(10.0 * EPS / loose, ITERATED * min(0.03, sqrt(loose)))


def iteration_limits(of: Sizes, tolerances: Limits, sizes: Reals) -> float:
    """What an iteration may leave [-], in tolerances; and usual sizes of the components."""
    loose = EPS
    for i in range(of.state):
        loose = max(loose, tolerances[0, i, 0])
    for i in range(of.state):
        sizes[i] = tolerances[1, i, 0] / loose
    return iteration_tolerance(loose)


def steps(
    of: Sizes,
    fill: Fill,
    rhs: Rhs,
    by: Scheme,
    run: Integration,
    work: Workspace,
    limit: int,
    watched: int,
) -> None:
    """Steps up to the bound, so many, or one in which something may happen: as `stages.steps`.

    The third of the controls is how many states were asked for.
    """
    n, K, y, time, control = of.state, rhs.K, work.y, work.time, run.controls[0]
    allowed = iteration_limits(of, run.tolerances, work.sizes)
    count = 0
    t = run.times[0]
    h = control[TRY]
    again = False
    for i in range(n):
        y[i, 0] = run.states[0, i]
        rhs.state[i, 0] = y[i, 0]
    at_time(of, fill, rhs, t, 0)
    if h == 0.0 or time[0] != t or work.trial[0] != h:
        time[0], work.last_h[0] = t, 0.0
        if h == 0.0:
            first_steps(of, fill, rhs, run, y, time, work.h, work.rate, 4)
        slopes(of, fill, rhs, control, work)
        h = halved(run.plan, run.planned[0], t, control[TRY])
        work.trial[0] = max(h, 10.0 * EPS * abs(t))
    h = work.trial[0]
    while count < limit and t < control[BOUND]:
        later = min(t + h, control[BOUND])
        if not (h >= 10.0 * EPS * abs(t) and later > t):
            break
        h = later - t
        work.h[0] = h
        for i in range(n):
            work.scale[i] = tolerated(of, run.tolerances, i, 0, abs(y[i, 0]))
        took = iterated(of, fill, rhs, by, control, work, allowed)
        if took < 0:
            h *= 0.5
            continue
        off = error_of(of, fill, rhs, by, run.tolerances, work, again)
        factor = growth(work, max(off, TINY), took)
        if not off <= 1.0:
            h, again = h * max(0.2, factor), True
            continue
        finish_step(of, fill, rhs, by, work, run.series[count])
        control[TRIED] += float(of.stages - of.ends + 1)
        run.turns[count], calm = may_turn(of, K, 0), is_calm(of, K, watched, 0)
        count += 1
        for i in range(n):
            y[i, 0] += work.Z[2, i]
            run.states[count, i] = y[i, 0]
        for k in range(of.width):
            K[0, k, 0] = K[of.ends - 1, k, 0]
        t, run.times[count], again = later, later, False
        time[0], work.fresh[0] = t, 0.0
        work.last_h[0], work.last_trial[0], work.last_off[0] = h, work.trial[0], max(off, TINY)
        slow = took > 2 and work.rate[0] > SLOW
        if slow:
            slopes(of, fill, rhs, control, work)
        if slow or factor >= 1.2:
            h = h * min(10.0, factor)
        h = halved(run.plan, run.planned[0], t, h)
        work.trial[0] = h
        inside = control[LOW] < y[0, 0] and y[0, 0] < control[HIGH]
        if not (inside and calm):
            count = -count
            break
    run.counts[0], control[TRY] = count, h
