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
from typing import Annotated

import numpy as np

from blockmech.engines.loops import Counts, Reals
from blockmech.engines.stages import (
    BOUND,
    HIGH,
    LONGEST,
    LOW,
    TRIED,
    TRY,
    Controls,
    Fill,
    Limits,
    Method,
    Rows,
    Sizes,
    States,
    is_calm,
    may_turn,
)
from blockmech.plane import EPS

ITERATIONS = 6
SLOW = 1e-3  # share of a correction that is left by the next one
TINY = 1e-8  # an error that lets a step grow as much as it may
SMALL = 1e-3  # of a usual size: a component of a state that is less may change by as much
STEP = sqrt(EPS)  # of a component, by which it is changed for the slopes
ROOT = sqrt(6.0)
CUBES = 3.0 ** (2.0 / 3.0) - 3.0 ** (1.0 / 3.0)
REAL, PART = 3.0 + CUBES, 3.0 - 0.5 * CUBES  # eigenvalues of A^-1, and of two the real part
TURN = 0.5 * (3.0 ** (5.0 / 6.0) + 3.0 ** (7.0 / 6.0))  # and the imaginary one
Threes = Annotated[Reals, "3"]
# Numbers of a step under way, and behind them its vectors: how fast the iteration converges, h, t,
# whether the slopes are those of this state, for which h there are matrices, the h to try first; of
# the step before its h, the one tried first, and its error. The next call goes on from them.
RATE, H, TIME, FRESH, KNOWN, WANTED, LAST, TRIED_FIRST, BEFORE, VECTORS = range(10)


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
    return Method(
        steps, 1, C.size, 4, (C, T, back, E, D), (1, 0),
        lambda n, _: (VECTORS + n * (16 + 6 * n), 2 + 3 * n),
    )  # fmt: skip


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


def factored(of: Sizes, J: Reals, real: Reals, pair: Reals, pivots: Counts, h: float) -> None:
    """Both systems of a step."""
    n = of.state
    for i in range(n):
        for j in range(n):
            one, slope = 1.0 if i == j else 0.0, J[i * n + j]
            real[i * n + j] = REAL / h * one - slope
            pair[2 * i * n + j] = PART / h * one - slope
            pair[2 * i * n + n + j] = TURN / h * one
            pair[2 * (i + n) * n + j] = -TURN / h * one
            pair[2 * (i + n) * n + n + j] = PART / h * one - slope
    factor(real, pivots, n)
    factor(pair, pivots[n:], 2 * n)


def slopes(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    control: Reals,
    room: Reals,
) -> None:
    """Slopes (n, n) of the rates at a state, each component moved the way it goes."""
    n, sizes = of.state, room[VECTORS + 12 * of.state :]
    J = sizes[n:]
    state[n] = room[TIME]
    for j in range(n):
        for i in range(n):
            state[i] = y[i]
        far = STEP * max(abs(y[j]), SMALL * sizes[j])
        state[j] = y[j] + (-far if K[0, j, 0] < 0.0 else far)
        fill(x, numbers, K[1], 1, 1, 0, 1)
        for i in range(n):
            J[i * n + j] = (K[1, i, 0] - K[0, i, 0]) / (state[j] - y[j])
    control[TRIED] += float(n)
    room[FRESH], room[KNOWN] = 1.0, 0.0


def norm(of: Sizes, a: Reals, scale: Reals, many: int) -> float:
    """The mean size of vectors, in tolerances."""
    total = 0.0
    for k in range(many):
        for i in range(of.state):
            part = a[k * of.state + i] / scale[i]
            total += part * part
    return sqrt(total / (many * of.state))


def scaled(of: Sizes, tolerances: Limits, y: Reals, new: Reals, scale: Reals) -> None:
    """Tolerances of a step between two states."""
    for i in range(of.state):
        larger = max(abs(y[i]), abs(new[i]))
        scale[i] = tolerances[1, i, 0] + larger * tolerances[0, i, 0]


def moved(of: Sizes, T: Threes, a: Reals, b: Reals) -> None:
    """Three vectors b made of three others."""
    n = of.state
    for r in range(3):
        for i in range(n):
            b[r * n + i] = T[r, 0] * a[i] + T[r, 1] * a[n + i] + T[r, 2] * a[2 * n + i]


def converged(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    C: Reals,
    T: Threes,
    back: Threes,
    room: Reals,
    pivots: Counts,
    allowed: float,
) -> int:
    """Iterations that a step's Z took to converge, negative where it did not."""
    n, h = of.state, room[H]
    Z = room[VECTORS:]
    W, off, scale = Z[3 * n :], Z[6 * n :], Z[9 * n :]
    real, pair = Z[13 * n + n * n :], Z[13 * n + 2 * n * n :]
    moved(of, back, Z, W)
    room[RATE], before = 0.0, 0.0
    for k in range(ITERATIONS):
        for s in range(3):
            for i in range(n):
                state[i] = y[i] + Z[s * n + i]
            state[n] = room[TIME] + C[s + 1] * h
            fill(x, numbers, K[s + 1], 1, 1, 0, 1)
        for i in range(n):
            fast = 0.0 * K[1, i, 0] + 0.0 * K[2, i, 0] + 0.0 * K[3, i, 0]
            if fast != 0.0:
                return -1 - k
            for r in range(3):
                rates = back[r, 0] * K[1, i, 0] + back[r, 1] * K[2, i, 0] + back[r, 2] * K[3, i, 0]
                off[r * n + i] = rates
            off[i] -= REAL / h * W[i]
            off[n + i] -= PART / h * W[n + i] + TURN / h * W[2 * n + i]
            off[2 * n + i] -= PART / h * W[2 * n + i] - TURN / h * W[n + i]
        solve(real, pivots, off, n)
        solve(pair, pivots[n:], off[n:], 2 * n)
        now, left = norm(of, off, scale, 3), 1.0
        if k > 0:
            rate = now / before
            for _ in range(k, ITERATIONS):
                left *= rate
            if not rate < 1.0 or left / (1.0 - rate) * now > allowed:
                return -1 - k
            room[RATE] = rate
        for i in range(3 * n):
            W[i] += off[i]
        moved(of, T, W, Z)
        if now == 0.0 or (k > 0 and room[RATE] / (1.0 - room[RATE]) * now < allowed):
            return k + 1
        before = now
    return -ITERATIONS


def predicted(of: Sizes, C: Reals, room: Reals) -> None:
    """Where the iteration begins: on the cubic of the step before, if there was one."""
    n, Z = of.state, room[VECTORS:]
    past = Z[13 * n + 6 * n * n :]
    for k in range(3 * n):
        Z[k] = 0.0
    if not room[LAST] > 0.0:
        return
    for s in range(3):
        x = 1.0 + C[s + 1] * room[H] / room[LAST]
        for i in range(n):
            high = (past[i] * x + past[n + i]) * (1.0 - x) + past[2 * n + i]
            Z[s * n + i] = high * x - past[2 * n + i]


def iterated(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    C: Reals,
    T: Threes,
    back: Threes,
    control: Reals,
    room: Reals,
    pivots: Counts,
    allowed: float,
) -> int:
    """As `converged`, once more with slopes of this state where those of one before do not do."""
    n, h = of.state, room[H]
    J = room[VECTORS + 13 * n :]
    while True:
        if room[KNOWN] != h:
            factored(of, J, J[n * n :], J[2 * n * n :], pivots, h)
            room[KNOWN] = h
        predicted(of, C, room)
        took = converged(of, fill, x, numbers, K, y, state, C, T, back, room, pivots, allowed)
        control[TRIED] += 3.0 * abs(float(took))
        if took > 0 or room[FRESH] == 1.0:
            break
        slopes(of, fill, x, numbers, K, y, state, control, room)
    return took


def ended(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    C: Reals,
    D: Threes,
    room: Reals,
    series: Reals,
) -> None:
    """The series of a step, see `blockmech.engines.dense`, the rates at its end and inside it."""
    n, Z = of.state, room[VECTORS:]
    past = Z[13 * n + 6 * n * n :]
    for i in range(n):
        for r in range(4):
            series[r * n + i] = 0.0
        for r in range(2):
            past[r * n + i] = D[r, 0] * Z[i] + D[r, 1] * Z[n + i] + D[r, 2] * Z[2 * n + i]
        past[2 * n + i], series[7 * n + i] = Z[2 * n + i], y[i]
        for r in range(3):
            series[(4 + r) * n + i] = past[r * n + i]
    for s in range(of.ends - 1, of.stages):
        share = C[s]
        for i in range(n):
            high = (series[4 * n + i] * share + series[5 * n + i]) * (1.0 - share)
            state[i] = (high + series[6 * n + i]) * share + y[i]
        state[n] = room[TIME] + share * room[H]
        fill(x, numbers, K[s], 1, 1, 0, 1)


def error_of(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    E: Reals,
    tolerances: Limits,
    room: Reals,
    pivots: Counts,
    again: bool,
) -> float:
    """The error of a step in tolerances; of one that is tried again it is looked at twice.

    Then for rates at a state that is off by the error itself: that takes out what is stiff of it.
    """
    n, h, Z = of.state, room[H], room[VECTORS:]
    scale, off, error, real = Z[9 * n :], Z[10 * n :], Z[11 * n :], Z[13 * n + n * n :]
    for i in range(n):
        off[i] = (E[0] * Z[i] + E[1] * Z[n + i] + E[2] * Z[2 * n + i]) / h
        error[i] = K[0, i, 0] + off[i]
        state[i] = y[i] + Z[2 * n + i]
    scaled(of, tolerances, y, state, scale)
    solve(real, pivots, error, n)
    size = norm(of, error, scale, 1)
    if again and size > 1.0:
        for i in range(n):
            state[i] = y[i] + error[i]
        state[n] = room[TIME]
        fill(x, numbers, K[1], 1, 1, 0, 1)
        for i in range(n):
            error[i] = K[1, i, 0] + off[i]
        solve(real, pivots, error, n)
        size = norm(of, error, scale, 1)
    return size


def growth(room: Reals, off: float, took: int) -> float:
    """By how many times the next step may be longer, by the error and the one before."""
    factor = 0.9 * (2 * ITERATIONS + 1) / (2 * ITERATIONS + took) / sqrt(sqrt(off))
    if room[LAST] > 0.0:
        factor *= min(1.0, room[H] / room[TRIED_FIRST] * sqrt(sqrt(room[BEFORE] / off)))
    return factor


def first_step(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    room: Reals,
    longest: float,
) -> float:
    """[s] A step that fits, by how fast the state and its rates change.

    Source: Hairer, Norsett & Wanner, II.4, starting step size.
    """
    n, rates, scale = of.state, room[VECTORS:], room[VECTORS + 9 * of.state :]
    for i in range(n):
        rates[i] = K[0, i, 0]
    far, fast = norm(of, y, scale, 1), norm(of, rates, scale, 1)
    h = min(1e-6 if far < 1e-5 or fast < 1e-5 else 0.01 * far / fast, longest)
    for i in range(n):
        state[i] = y[i] + h * rates[i]
    state[n] = room[TIME] + h
    fill(x, numbers, K[1], 1, 1, 0, 1)
    for i in range(n):
        rates[i] = K[1, i, 0] - K[0, i, 0]
    quick = max(fast, norm(of, rates, scale, 1) / h)
    fits = sqrt(sqrt(0.01 / quick)) if quick > 1e-15 else max(1e-6, 1e-3 * h)
    return min(min(100.0 * h, fits), longest)


def left_allowed(of: Sizes, tolerances: Limits, sizes: Reals) -> float:
    """What an iteration may leave [-], in tolerances; and usual sizes of the components."""
    loose = EPS
    for i in range(of.state):
        loose = max(loose, tolerances[0, i, 0])
    for i in range(of.state):
        sizes[i] = tolerances[1, i, 0] / loose
    # Every step leaves it to the same side: what does not fall with the tolerance no run shows.
    return max(max(10.0 * EPS / loose, min(0.03, sqrt(loose))), sqrt(EPS / loose))


def steps(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    states: States,
    state: Reals,
    C: Reals,
    T: Threes,
    back: Threes,
    E: Reals,
    D: Threes,
    tolerances: Limits,
    controls: Controls,
    times: Reals,
    series: Reals,
    turns: Counts,
    room: Reals,
    counts: Counts,
    most: int,
    watched: int,
) -> None:
    """Steps up to the bound, so many, or one in which something may happen: as `stages.steps`.

    controls : the fourth is how many states were asked for
    """
    n, Z, pivots, control = of.state, room[VECTORS:], counts[2:], controls[0]
    y, scale, allowed = states[0], Z[9 * n :], left_allowed(of, tolerances, Z[12 * n :])
    made, t, h, again = 0, times[0], control[TRY], False
    for i in range(n):
        state[i] = y[i]
    state[n] = t
    fill(x, numbers, K[0], 1, 1, 0, 1)
    scaled(of, tolerances, y, y, scale)
    if h == 0.0 or room[TIME] != t or room[WANTED] != h:
        room[TIME], room[LAST] = t, 0.0
        if h == 0.0:
            h = first_step(of, fill, x, numbers, K, y, state, room, control[BOUND] - t)
        slopes(of, fill, x, numbers, K, y, state, control, room)
        room[WANTED] = max(min(h, control[LONGEST]), 10.0 * EPS * abs(t))
    h = room[WANTED]
    while made < most and t < control[BOUND]:
        later = min(t + h, control[BOUND])
        if not (h >= 10.0 * EPS * abs(t) and later > t):
            break
        h = later - t
        room[H] = h
        scaled(of, tolerances, y, y, scale)
        took = iterated(
            of, fill, x, numbers, K, y, state, C, T, back, control, room, pivots, allowed
        )
        if took < 0:
            h *= 0.5
            continue
        off = error_of(of, fill, x, numbers, K, y, state, E, tolerances, room, pivots, again)
        factor = growth(room, max(off, TINY), took)
        if not off <= 1.0:
            h, again = h * max(0.2, factor), True
            continue
        ended(of, fill, x, numbers, K, y, state, C, D, room, series[made * 8 * n :])
        control[TRIED] += float(of.stages - of.ends + 1)
        turns[made], calm = may_turn(of, K, 0), is_calm(of, K, watched, 0)
        made += 1
        for i in range(n):
            states[made, i] = y[i] + Z[2 * n + i]
        for k in range(of.width):
            K[0, k, 0] = K[of.ends - 1, k, 0]
        y, t, times[made], again = states[made], later, later, False
        room[TIME], room[FRESH] = t, 0.0
        room[LAST], room[TRIED_FIRST], room[BEFORE] = h, room[WANTED], max(off, TINY)
        slow = took > 2 and room[RATE] > SLOW
        if slow:
            slopes(of, fill, x, numbers, K, y, state, control, room)
        if slow or factor >= 1.2:
            h = min(h * min(10.0, factor), control[LONGEST])
        room[WANTED] = h
        inside = control[LOW] < y[0] and y[0] < control[HIGH]
        if not (inside and calm):
            made = -made
            break
    counts[0], control[TRY] = made, h
