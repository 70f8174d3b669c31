"""Steps of Radau's method for stiff equations, written once as those of `stages`.

Of each step, until most are done or the bound is reached:

    Z_i = h sum_j A_ij f(t + C_j h, y + Z_j), i = 1, 2, 3, by simplified Newton: with the same
        slopes J of the rates in all iterations, and in later steps as long as these converge fast
    off = norm of (m / h - J)^-1 (f(t, y) + sum_j E_j Z_j / h), in tolerances
    the step is taken where off is at most 1, else it is tried again with a shorter h

In W = T^-1 Z the system parts into one of n equations, with the real eigenvalue m of A^-1, and one
of 2 n, with the real and imaginary parts of the others. The slopes are quotients of differences.
What Z the cubic through the last step's gives is where the iteration begins.

Source: Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, IV.8; control and limits
as in SciPy's Radau.
"""

from __future__ import annotations

from functools import cache
from math import sqrt
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from blockmech.engines.loops import Counts, Reals
from blockmech.engines.stages import (
    BOUND,
    HIGH,
    LOW,
    TRIED,
    TRY,
    Arrays,
    Fill,
    Integration,
    Limits,
    Method,
    Rhs,
    Sizes,
    States,
    evaluate,
    fitting_step,
    halved,
    is_calm,
    may_turn,
    tolerated,
    trial_step,
)
from blockmech.ground.plane import EPS

ITERATIONS = 6
ITERATED = 1.0 / 16.0  # of what a step leaves by its length, what its iteration may leave
SLOW = 1e-3  # share of a correction that is left by the next one
TINY = 1e-8  # an error that lets a step grow as much as it may
SMALL = 1e-3  # of a usual size: a component of a state that is less may change by as much
STEP = sqrt(EPS)  # of a component, by which it is changed for the slopes
ROOT = sqrt(6.0)
CUBES = 3.0 ** (2.0 / 3.0) - 3.0 ** (1.0 / 3.0)
REAL, PART = 3.0 + CUBES, 3.0 - 0.5 * CUBES  # eigenvalues of A^-1, and of two the real part
TURN = 0.5 * (3.0 ** (5.0 / 6.0) + 3.0 ** (7.0 / 6.0))  # and the imaginary one
# Of a step under way: how fast the iteration converges, h, t, whether the slopes are those of this
# state, for which h there are matrices, the h to try first; of the step before its h, the one tried
# first, and its error. The next call goes on from them.
RATE, H, TIME, FRESH, KNOWN, WANTED, LAST, TRIED_FIRST, BEFORE, NUMBERS = range(10)
Threes: TypeAlias = Annotated[Reals, "3"]
Vectors: TypeAlias = Annotated[Reals, "of.state"]


class Scheme(NamedTuple):
    """Coefficients: places of the stages; T and its inverse; of the error, and of the cubic."""

    C: Reals
    T: Threes
    back: Threes
    E: Reals
    D: Threes


class Workspace(NamedTuple):
    """Of a step under way.

    now : its numbers
    Z, W : (3, n) see above, off : (3 n,) what is left of the equations, and what corrects W
    scale : (n,) tolerances, sizes : usual sizes of the components
    error : (n,) of the step, estimate : what Z says of it
    J : (n, n) slopes of the rates, real, pair : both systems, factored; pivots : and exchanged
    past : (3, n) of the cubic of the last step
    """

    now: Reals
    Z: Vectors
    W: Vectors
    off: Reals
    scale: Reals
    estimate: Reals
    error: Reals
    sizes: Reals
    J: Vectors
    real: Reals
    pair: Reals
    past: Vectors
    pivots: Counts


def workspace(of: Sizes, most: int) -> Arrays:
    """Arrays of a `Workspace`."""
    n = of.state
    threes, one, square = (3, n), (n,), (n, n)
    shapes = (
        *((NUMBERS,), threes, threes, (3 * n,), one, one, one, one),
        *(square, (n * n,), (4 * n * n,), threes, (3 * n,)),
    )
    kinds = *[np.float64] * 12, np.int64
    return [*zip(Workspace._fields, kinds, shapes, strict=True)]


@cache
def radau() -> Method:
    """Three stages of the step, the rates at its end, and two places more that are watched."""
    T = np.array([
        [0.09443876248897524, -0.14125529502095421, 0.03002919410514742],
        [0.25021312296533332, 0.20412935229379994, -0.38294211275726192],
        [1.0, 1.0, 0.0],
    ])  # fmt: skip
    back = np.array([
        [4.17871859155190428, 0.32768282076106237, 0.52337644549944951],
        [-4.17871859155190428, -0.32768282076106237, 0.47662355450055044],
        [0.50287263494578682, -2.57192694985560522, 0.59603920482822492],
    ])  # fmt: skip
    C = np.array([0.0, (4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0, 0.4, 0.82])
    E = np.array([-13.0 - 7.0 * ROOT, -13.0 + 7.0 * ROOT, -1.0]) / 3.0
    high = np.array([10.0 / 3.0 + 5.0 * ROOT, 10.0 / 3.0 - 5.0 * ROOT, 10.0 / 3.0])
    square = np.array([-23.0 - 22.0 * ROOT, -23.0 + 22.0 * ROOT, -8.0]) / 3.0
    D = np.array([-high, -(square + high)])
    return Method(steps, 1, C.size, 4, Scheme(C, T, back, E, D), (1, 0), workspace)


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


def factored(of: Sizes, work: Workspace, h: float) -> None:
    """Both systems of a step."""
    n, real, pair = of.state, work.real, work.pair
    for i in range(n):
        for j in range(n):
            one, slope = 1.0 if i == j else 0.0, work.J[i, j]
            real[i * n + j] = REAL / h * one - slope
            pair[2 * i * n + j] = PART / h * one - slope
            pair[2 * i * n + n + j] = TURN / h * one
            pair[2 * (i + n) * n + j] = -TURN / h * one
            pair[2 * (i + n) * n + n + j] = PART / h * one - slope
    factor(real, work.pivots, n)
    factor(pair, work.pivots[n:], 2 * n)


def at_time(of: Sizes, fill: Fill, rhs: Rhs, t: float, s: int) -> None:
    """As `evaluate`, at a time [s]."""
    rhs.state[of.state, 0] = t
    evaluate(of, fill, rhs, s)


def slopes(of: Sizes, fill: Fill, rhs: Rhs, y: Reals, control: Reals, work: Workspace) -> None:
    """Slopes (n, n) of the rates at a state, each component moved the way it goes."""
    n, K, state, now = of.state, rhs.K, rhs.state, work.now
    for j in range(n):
        for i in range(n):
            state[i, 0] = y[i]
        far = STEP * max(abs(y[j]), SMALL * work.sizes[j])
        state[j, 0] = y[j] + (-far if K[0, j, 0] < 0.0 else far)
        at_time(of, fill, rhs, now[TIME], 1)
        for i in range(n):
            work.J[i, j] = (K[1, i, 0] - K[0, i, 0]) / (state[j, 0] - y[j])
    control[TRIED] += float(n)
    now[FRESH], now[KNOWN] = 1.0, 0.0


def norm(of: Sizes, a: Reals, scale: Reals, many: int) -> float:
    """The mean size of vectors, in tolerances."""
    total = 0.0
    for k in range(many):
        for i in range(of.state):
            part = a[k * of.state + i] / scale[i]
            total += part * part
    return sqrt(total / (many * of.state))


def moved(of: Sizes, T: Threes, a: Vectors, b: Vectors) -> None:
    """Three vectors b made of three others."""
    for r in range(3):
        for i in range(of.state):
            b[r, i] = T[r, 0] * a[0, i] + T[r, 1] * a[1, i] + T[r, 2] * a[2, i]


def converged(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, y: Reals, work: Workspace, allowed: float
) -> int:
    """Iterations that a step's Z took to converge, negative where it did not."""
    n, K, state, back, h = of.state, rhs.K, rhs.state, by.back, work.now[H]
    Z, W, off, now, before = work.Z, work.W, work.off, work.now, 0.0
    moved(of, back, Z, W)
    now[RATE] = 0.0
    for k in range(ITERATIONS):
        for s in range(3):
            for i in range(n):
                state[i, 0] = y[i] + Z[s, i]
            at_time(of, fill, rhs, now[TIME] + by.C[s + 1] * h, s + 1)
        for i in range(n):
            fast = 0.0 * K[1, i, 0] + 0.0 * K[2, i, 0] + 0.0 * K[3, i, 0]
            if fast != 0.0:
                return -1 - k
            for r in range(3):
                rates = back[r, 0] * K[1, i, 0] + back[r, 1] * K[2, i, 0] + back[r, 2] * K[3, i, 0]
                off[r * n + i] = rates
            off[i] -= REAL / h * W[0, i]
            off[n + i] -= PART / h * W[1, i] + TURN / h * W[2, i]
            off[2 * n + i] -= PART / h * W[2, i] - TURN / h * W[1, i]
        solve(work.real, work.pivots, off, n)
        solve(work.pair, work.pivots[n:], off[n:], 2 * n)
        size, left = norm(of, off, work.scale, 3), 1.0
        if k > 0:
            rate = size / before
            for _ in range(k, ITERATIONS):
                left *= rate
            if not rate < 1.0 or left / (1.0 - rate) * size > allowed:
                return -1 - k
            now[RATE] = rate
        for r in range(3):
            for i in range(n):
                W[r, i] += off[r * n + i]
        moved(of, by.T, W, Z)
        if size == 0.0 or (k > 0 and now[RATE] / (1.0 - now[RATE]) * size < allowed):
            return k + 1
        before = size
    return -ITERATIONS


def predicted(of: Sizes, by: Scheme, work: Workspace) -> None:
    """Where the iteration begins: on the cubic of the step before, if there was one."""
    n, Z, past, now = of.state, work.Z, work.past, work.now
    for s in range(3):
        x = 1.0 + by.C[s + 1] * now[H] / now[LAST] if now[LAST] > 0.0 else 0.0
        for i in range(n):
            high = (past[0, i] * x + past[1, i]) * (1.0 - x) + past[2, i]
            Z[s, i] = high * x - past[2, i] if now[LAST] > 0.0 else 0.0


def iterated(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, y: Reals, control: Reals, work: Workspace,
    allowed: float,
) -> int:  # fmt: skip
    """As `converged`, once more with slopes of this state where those of one before do not do."""
    now = work.now
    while True:
        if now[KNOWN] != now[H]:
            factored(of, work, now[H])
            now[KNOWN] = now[H]
        predicted(of, by, work)
        took = converged(of, fill, rhs, by, y, work, allowed)
        control[TRIED] += 3.0 * abs(float(took))
        if took > 0 or now[FRESH] == 1.0:
            break
        slopes(of, fill, rhs, y, control, work)
    return took


def ended(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, y: Reals, work: Workspace, series: States
) -> None:
    """The series of a step, see `blockmech.engines.dense`, the rates at its end and inside it."""
    n, Z, past, D, state = of.state, work.Z, work.past, by.D, rhs.state
    for i in range(n):
        for r in range(4):
            series[r, i] = 0.0
        for r in range(2):
            past[r, i] = D[r, 0] * Z[0, i] + D[r, 1] * Z[1, i] + D[r, 2] * Z[2, i]
        past[2, i], series[7, i] = Z[2, i], y[i]
        for r in range(3):
            series[4 + r, i] = past[r, i]
    for s in range(of.ends - 1, of.stages):
        share = by.C[s]
        for i in range(n):
            high = (series[4, i] * share + series[5, i]) * (1.0 - share)
            state[i, 0] = (high + series[6, i]) * share + y[i]
        at_time(of, fill, rhs, work.now[TIME] + share * work.now[H], s)


def error_of(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, tolerances: Limits, y: Reals, work: Workspace,
    again: bool,
) -> float:  # fmt: skip
    """The error of a step in tolerances; of one that is tried again it is looked at twice.

    Then for rates at a state that is off by the error itself: that takes out what is stiff of it.
    """
    n, K, E, Z = of.state, rhs.K, by.E, work.Z
    estimate, error = work.estimate, work.error
    for i in range(n):
        estimate[i] = (E[0] * Z[0, i] + E[1] * Z[1, i] + E[2] * Z[2, i]) / work.now[H]
        error[i] = K[0, i, 0] + estimate[i]
        new = y[i] + Z[2, i]
        work.scale[i] = tolerated(of, tolerances, i, 0, max(abs(y[i]), abs(new)))
    solve(work.real, work.pivots, error, n)
    size = norm(of, error, work.scale, 1)
    if again and size > 1.0:
        for i in range(n):
            rhs.state[i, 0] = y[i] + error[i]
        at_time(of, fill, rhs, work.now[TIME], 1)
        for i in range(n):
            error[i] = K[1, i, 0] + estimate[i]
        solve(work.real, work.pivots, error, n)
        size = norm(of, error, work.scale, 1)
    return size


def growth(now: Reals, off: float, took: int) -> float:
    """By how many times the next step may be longer, by the error and the one before."""
    factor = 0.9 * (2 * ITERATIONS + 1) / (2 * ITERATIONS + took) / sqrt(sqrt(off))
    if now[LAST] > 0.0:
        factor *= min(1.0, now[H] / now[TRIED_FIRST] * sqrt(sqrt(now[BEFORE] / off)))
    return factor


def first_step(of: Sizes, fill: Fill, rhs: Rhs, y: Reals, work: Workspace, longest: float) -> float:
    """[s] A step that fits, by how fast the state and its rates change."""
    n, K, rates, scale = of.state, rhs.K, work.Z[0], work.scale
    for i in range(n):
        rates[i] = K[0, i, 0]
    far, fast = norm(of, y, scale, 1), norm(of, rates, scale, 1)
    h = trial_step(far, fast, longest)
    for i in range(n):
        rhs.state[i, 0] = y[i] + h * rates[i]
    at_time(of, fill, rhs, work.now[TIME] + h, 1)
    for i in range(n):
        rates[i] = K[1, i, 0] - K[0, i, 0]
    quick = max(fast, norm(of, rates, scale, 1) / h)
    return fitting_step(h, quick, 4, longest)


def left_of(loose: float) -> float:
    """What an iteration may leave [-] of a relative tolerance, by that.

    The estimate is of order 3: of a step that has just this tolerance, order 5 leaves its root.
    All steps leave to the same side what they iterate to: that is a small part of it, for two runs
    to differ by their steps, and what does not fall with the tolerance no run shows.
    """
    return max(max(10.0 * EPS / loose, ITERATED * min(0.03, sqrt(loose))), sqrt(EPS / loose))


def left_allowed(of: Sizes, tolerances: Limits, sizes: Reals) -> float:
    """What an iteration may leave [-], in tolerances; and usual sizes of the components."""
    loose = EPS
    for i in range(of.state):
        loose = max(loose, tolerances[0, i, 0])
    for i in range(of.state):
        sizes[i] = tolerances[1, i, 0] / loose
    return left_of(loose)


def steps(
    of: Sizes,
    fill: Fill,
    rhs: Rhs,
    by: Scheme,
    run: Integration,
    work: Workspace,
    most: int,
    watched: int,
) -> None:
    """Steps up to the bound, so many, or one in which something may happen: as `stages.steps`.

    The third of the controls is how many states were asked for.
    """
    n, K, states, control, now = of.state, rhs.K, run.states, run.controls[0], work.now
    y, allowed = states[0], left_allowed(of, run.tolerances, work.sizes)
    made, t, h, again = 0, run.times[0], control[TRY], False
    for i in range(n):
        rhs.state[i, 0] = y[i]
        work.scale[i] = tolerated(of, run.tolerances, i, 0, abs(y[i]))
    at_time(of, fill, rhs, t, 0)
    if h == 0.0 or now[TIME] != t or now[WANTED] != h:
        now[TIME], now[LAST] = t, 0.0
        if h == 0.0:
            h = first_step(of, fill, rhs, y, work, control[BOUND] - t)
        slopes(of, fill, rhs, y, control, work)
        h = halved(run.plan, run.planned[0], t, h)
        now[WANTED] = max(h, 10.0 * EPS * abs(t))
    h = now[WANTED]
    while made < most and t < control[BOUND]:
        later = min(t + h, control[BOUND])
        if not (h >= 10.0 * EPS * abs(t) and later > t):
            break
        h = later - t
        now[H] = h
        for i in range(n):
            work.scale[i] = tolerated(of, run.tolerances, i, 0, abs(y[i]))
        took = iterated(of, fill, rhs, by, y, control, work, allowed)
        if took < 0:
            h *= 0.5
            continue
        off = error_of(of, fill, rhs, by, run.tolerances, y, work, again)
        factor = growth(now, max(off, TINY), took)
        if not off <= 1.0:
            h, again = h * max(0.2, factor), True
            continue
        ended(of, fill, rhs, by, y, work, run.series[made])
        control[TRIED] += float(of.stages - of.ends + 1)
        run.turns[made], calm = may_turn(of, K, 0), is_calm(of, K, watched, 0)
        made += 1
        for i in range(n):
            states[made, i] = y[i] + work.Z[2, i]
        for k in range(of.width):
            K[0, k, 0] = K[of.ends - 1, k, 0]
        y, t, run.times[made], again = states[made], later, later, False
        now[TIME], now[FRESH] = t, 0.0
        now[LAST], now[TRIED_FIRST], now[BEFORE] = h, now[WANTED], max(off, TINY)
        slow = took > 2 and now[RATE] > SLOW
        if slow:
            slopes(of, fill, rhs, y, control, work)
        if slow or factor >= 1.2:
            h = h * min(10.0, factor)
        h = halved(run.plan, run.planned[0], t, h)
        now[WANTED] = h
        inside = control[LOW] < y[0] and y[0] < control[HIGH]
        if not (inside and calm):
            made = -made
            break
    run.counts[0], control[TRY] = made, h
