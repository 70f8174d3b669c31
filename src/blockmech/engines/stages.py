"""Steps of DOP853, one after the other, written once: as machine code, and for Python as it is.

Of each step, until most are done or the bound is reached:

    K_s = the rates at t + C_s h, y + h sum_j A_sj K_j, for each stage s
    off = norm of h sum_j E_j K_j, in tolerances, of two estimates
    the step is taken where off < 1, else it is tried again with a shorter h

Of the two, e5^2 / sqrt(e5^2 + 0.01 e3^2) is the error of order 8 where the rates are smooth. Beside
a corner it says a hundredth of what a step errs, in a coarse run and a fine one alike: there e5
alone counts, and the weight of e3 is 0.

A second run goes by a plan, the steps of the first one: none is longer than half of those there.
Each step leaves a series for the states inside it, see `blockmech.engines.dense`. One in which
something may happen is the last: its first component leaves the ``free_range``, or
what is ``watched`` changes its sign at a stage of the step. Of the first two, which may dip to
zero between two stages, a stage that is not `FAR` from zero may not differ from the end by a third
of it either: then none is twice another. The rates are those of a traced program of one lane
(`blockmech.engines.assembly`), asked by a body: they are worked out state by state, hundreds of
times in what a call from Python takes.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.1, II.4
(control of the step: safety 0.9, factors from 0.2 to 10 as in SciPy) and II.10 (the estimates).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from math import sqrt
from pathlib import Path
from runpy import run_path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.engines.assembly import piece
from blockmech.engines.kinds import ROW, Counts, First, Reals
from blockmech.ground.plane import EPS
from blockmech.typing import Floats

LANES = 2  # runs of a motion side by side: the second takes half the steps of the first
THIRD = 0.01  # weight of the estimate of order 3 where the rates are smooth
SHORTEST = 1e-99  # [s] a step at time 0 that is tried again and again
FAR = 0.125  # of a margin, 21 degrees of a transmission angle; and of inertia, in usual ones


class Sizes(NamedTuple):
    """Sizes of a stepper: components of a state, numbers of a row, and the stages.

    first : column of the first number that is watched
    ends : stages up to the end of a step; the others are for its dense output
    lanes : runs side by side
    """

    state: int
    width: int
    first: int
    stages: int
    ends: int
    lanes: int


Lane: TypeAlias = Annotated[Reals, ROW, "of.lanes"]
Lanes: TypeAlias = Annotated[Reals, "of.lanes"]
Rows: TypeAlias = Annotated[Reals, "of.width", "of.lanes"]
States: TypeAlias = Annotated[Reals, "of.state"]
Series: TypeAlias = Annotated[Reals, "8", "of.state"]
Limits: TypeAlias = Annotated[Reals, "of.state", "of.lanes"]
Controls: TypeAlias = Annotated[Reals, "6"]
Fill: TypeAlias = Callable[[Reals, Reals, Reals, int, int, int, int], float]


class Rhs(NamedTuple):
    """What a program is asked by, and what it says.

    x : places of its inputs, which are those of ``state``: components, time, what is given
    numbers : those of the program
    K : its rows at the stages of a step
    """

    x: Annotated[Reals, First("inputs")]
    numbers: Reals
    K: Annotated[Rows, First("of.stages")]
    state: Annotated[Lanes, First("inputs")]


class Integration(NamedTuple):
    """Steps of each lane, see `steps`; those of a lane stand one behind the other.

    states, times : where they begin, and where the last ends
    tolerances : relative and absolute ones
    controls : the step to try, 0 for one that fits; bound, how many were tried, the free_range,
        weight of the estimate of order 3
    series : of each, see `blockmech.engines.dense`
    turns : 1 of a step in which the last number that is watched may change its sign, else 0
    counts : steps made, negative where something may happen in the last one; first what a lane is
        at, `BEGINS` or, where there is nothing to do, `OVER`
    plan : [s] times of a coarser run, planned : how many steps these are; of the first lane
    """

    states: Annotated[States, First("of.lanes * (count + 1)")]
    times: Annotated[Reals, First("of.lanes * (count + 1)")]
    tolerances: Annotated[Limits, First("2")]
    controls: Annotated[Controls, First("of.lanes")]
    series: Annotated[Series, First("of.lanes * count")]
    turns: Annotated[Counts, First("of.lanes * count")]
    counts: Annotated[Counts, First("of.lanes")]
    plan: Annotated[Reals, First("count + 2")]
    planned: Annotated[Counts, First("1")]


class Scheme(NamedTuple):
    """Coefficients of a method, see `Sizes`.

    A : (stages, stages), C : (stages,)
    E : (2, ends) of the estimates of orders 5 and 3
    D : (4, stages) of the highest terms of a step's series
    """

    A: Annotated[Reals, "of.stages"]
    C: Reals
    E: Annotated[Reals, "of.ends"]
    D: Annotated[Reals, "of.stages"]


@cache
def scheme() -> Scheme:
    """Twelve stages of the step, the rates at its end, three of its dense output, as SciPy's.

    Its file of them is read by itself: the package around it takes a third of a second to load.
    """
    scipy = find_spec("scipy")
    folder = Path(scipy.origin or "").parent if scipy is not None else Path()
    file = folder / "integrate" / "_ivp" / "dop853_coefficients.py"
    if file.exists():
        A, C, E5, E3, D = map(run_path(str(file)).__getitem__, ("A", "C", "E5", "E3", "D"))
    else:  # of another version
        from scipy.integrate import DOP853 as by

        n, E5, E3, D = by.n_stages, by.E5, by.E3, by.D
        A, C = np.zeros((len(D[0]), len(D[0]))), np.ones(len(D[0]))
        A[:n, :n], A[n, :n], A[n + 1 :] = by.A, by.B, by.A_EXTRA
        C[:n], C[n + 1 :] = by.C, by.C_EXTRA
    return Scheme(*map(np.ascontiguousarray, (A, C, [E5, E3], D[::-1])))


class Method(NamedTuple):
    """Steps of some kind, see `steps`.

    lanes : runs side by side
    stages, ends : see `Sizes`
    scheme : arrays of coefficients
    states : for how many states a step asks that is tried, and one more that is taken
    workspace : the record of what its loop needs beside; the first of its arrays is what it knows
        of a step when the next steps are asked for
    """

    steps: Callable[..., None]
    lanes: int
    stages: int
    ends: int
    scheme: tuple[Floats, ...]
    states: tuple[int, int]
    workspace: Any


class Workspace(NamedTuple):
    """Of steps under way.

    time : [s] where they begin, later : where they end, h : how long they are
    free : [s] how long they would be without a bound; grows : by how many times the next may grow
    off, thirds : error in tolerances, and weight of the estimate of order 3
    y : states where they begin, highest : the highest terms of their series
    is_at : what lanes are at
    """

    time: Lane
    later: Lane
    h: Lane
    free: Lane
    grows: Lane
    off: Lane
    thirds: Lane
    y: Annotated[Lanes, First("of.state")]
    highest: Annotated[Lanes, First("4 * of.state")]
    is_at: Annotated[Counts, First("of.lanes")]


@cache
def dop853() -> Method:
    """The explicit method of order 8."""
    by, stages, ends = scheme(), scheme().C.size, scheme().E.shape[1]
    return Method(steps, LANES, stages, ends, by, (ends - 1, stages - ends), Workspace)


TRY, BOUND, TRIED, LOW, HIGH, WEIGHT = range(6)  # columns of a control
OVER, BEGINS, AGAIN, TAKEN, WAITS = range(5)  # what a lane is at


def evaluate(of: Sizes, fill: Fill, rhs: Rhs, s: int) -> None:
    """The row of the program at stage s, whose state stands ready."""
    fill(rhs.x, rhs.numbers, rhs.K[s], of.lanes, of.lanes, 0, 1)


def rates_at(
    of: Sizes, fill: Fill, rhs: Rhs, by: Scheme, work: Workspace, begin: int, end: int
) -> None:
    """Rows of the program at some stages of a step."""
    A, C, K, state, y, h = by.A, by.C, rhs.K, rhs.state, work.y, work.h
    for s in range(begin, end):
        for i in range(of.state):
            total = A[s, 0] * K[0, i]
            for j in range(1, s):
                total = total + A[s, j] * K[j, i]
            state[i] = y[i] + h * total
        state[of.state] = work.time + C[s] * h
        evaluate(of, fill, rhs, s)


def error_of(of: Sizes, rhs: Rhs, by: Scheme, tolerances: Limits, work: Workspace) -> None:
    """Errors of steps in tolerances, of the estimates of orders 5 and 3."""
    K, new, E, y, h = rhs.K, rhs.state, by.E, work.y, work.h
    none = 0.0 * h
    fifths, thirds = none, none
    for i in range(of.state):
        larger = np.where(abs(new[i]) > abs(y[i]), abs(new[i]), abs(y[i]))
        scale = tolerances[1, i] + larger * tolerances[0, i]
        fifth, third = none, none
        for j in range(of.ends):
            fifth = fifth + E[0, j] * K[j, i]
            third = third + E[1, j] * K[j, i]
        fifth, third = fifth / scale, third / scale
        fifths = fifths + fifth * fifth
        thirds = thirds + third * third
    error = fifths / np.sqrt((fifths + work.thirds * thirds) * float(of.state))
    work.off[:] = h * np.where(fifths == 0.0, none, error)


def highest_terms(
    of: Sizes, K: Rows, D: Annotated[Reals, "of.stages"], h: Lane, highest: Lanes
) -> None:
    """The highest terms of the series of steps, see `series_of`."""
    for r in range(4):
        for i in range(of.state):
            total = D[r, 0] * K[0, i]
            for j in range(1, of.stages):
                total = total + D[r, j] * K[j, i]
            highest[r * of.state + i] = h * total


def series_of(
    of: Sizes, K: Rows, y: Lanes, new: Reals, h: float, highest: Lanes, series: States, lane: int
) -> None:
    """The series of a step, see `blockmech.engines.dense`, from the rates at its stages."""
    for i in range(of.state):
        for r in range(4):
            series[r, i] = highest[r * of.state + i, lane]
        moved = new[i] - y[i, lane]
        first, last = h * K[0, i, lane], h * K[of.ends - 1, i, lane]
        series[4, i], series[5, i] = 2.0 * moved - last - first, first - moved
        series[6, i], series[7, i] = moved, y[i, lane]


def is_calm(of: Sizes, K: Rows, watched: int, lane: int) -> bool:
    """Whether nothing that is watched may have changed its sign in a step."""
    for w in range(watched):
        end = K[of.ends - 1, of.first + w, lane]
        for s in range(of.stages):
            now = K[s, of.first + w, lane]
            is_clear = abs(now - end) * 3.0 < end or (now > FAR and end > FAR)
            if not (is_clear if w < 2 else now * end > 0.0 or now == 0.0):
                return False
    return True


def may_turn(of: Sizes, K: Rows, lane: int) -> int:
    """1 where the last number that is watched may change its sign in a step, else 0."""
    end = K[of.ends - 1, of.width - 1, lane]
    for s in range(of.stages):
        now = K[s, of.width - 1, lane]
        if not (now * end > 0.0 or now == 0.0):
            return 1
    return 0


def tolerated(of: Sizes, tolerances: Limits, i: int, lane: int, size: float) -> float:
    """What a component of such a size may be off."""
    return float(tolerances[1, i, lane] + size * tolerances[0, i, lane])


def first_steps(
    of: Sizes, fill: Fill, rhs: Rhs, run: Integration, y: Lanes, time: Lane, h: Lane, fast: Lane,
    order: int,
) -> None:  # fmt: skip
    """The steps to try first of a method of order 4 or 8, where none is given.

    Source: Hairer, Norsett & Wanner, II.4, starting step size.
    """
    K, state, tolerances, controls = rhs.K, rhs.state, run.tolerances, run.controls
    for lane in range(of.lanes):
        size, longest, fast[lane] = 0.0, controls[lane, BOUND] - time[lane], 0.0
        for i in range(of.state):
            scale = tolerated(of, tolerances, i, lane, abs(y[i, lane]))
            size += y[i, lane] / scale * (y[i, lane] / scale)
            fast[lane] += K[0, i, lane] / scale * (K[0, i, lane] / scale)
        size, fast[lane] = sqrt(size / of.state), sqrt(fast[lane] / of.state)
        h[lane] = 1e-6 if size < 1e-5 or fast[lane] < 1e-5 else 0.01 * size / fast[lane]
        h[lane] = min(h[lane], longest)
        for i in range(of.state):
            state[i, lane] = y[i, lane] + h[lane] * K[0, i, lane]
        state[of.state, lane] = time[lane] + h[lane]
    evaluate(of, fill, rhs, 1)
    for lane in range(of.lanes):
        bends, longest = 0.0, controls[lane, BOUND] - time[lane]
        for i in range(of.state):
            scale = tolerated(of, tolerances, i, lane, abs(y[i, lane]))
            bend = (K[1, i, lane] - K[0, i, lane]) / scale
            bends += bend * bend
        quick = max(fast[lane], sqrt(bends / of.state) / h[lane])
        step = sqrt(sqrt(0.01 / quick)) if quick > 1e-15 else max(1e-6, 1e-3 * h[lane])
        if quick > 1e-15 and order == 8:
            step = sqrt(step)
        if controls[lane, TRY] == 0.0:
            controls[lane, TRY] = min(min(100.0 * h[lane], step), longest)


def halved(plan: Reals, planned: int, t: float, h: float) -> float:
    """A step, no longer than half of those that a plan has in its place; any beyond its end.

    None is as short as rounding of the time: two events may be so near.
    """
    if planned == 0 or t >= plan[planned]:
        return h
    at = piece(plan, planned + 1, t)
    half = 0.5 * (plan[at + 1] - plan[at])
    if at + 1 < planned:
        half = min(half, max(plan[at + 1] - t, 0.5 * (plan[at + 2] - plan[at + 1])))
    return float(min(h, max(half, abs(t) * EPS * 20.0)))


def tries(of: Sizes, run: Integration, work: Workspace, lane: int) -> int:
    """1 where a lane tries a step, and how long a one; else 0.

    The second lane waits for the first, whose steps are its plan, and ends where these do.
    """
    is_at, control = work.is_at, run.controls[lane]
    t, bound = work.time[lane], control[BOUND]
    count = run.counts[0] if run.counts[0] > 0 else -run.counts[0]
    if is_at[lane] == WAITS:
        is_at[lane] = BEGINS
    if lane > 0 and is_at[lane] == BEGINS and t >= run.times[count]:
        is_at[lane] = OVER if is_at[0] == OVER else WAITS
    shortest = max(abs(t) * EPS * 10.0, SHORTEST)
    if is_at[lane] == BEGINS:
        h = control[TRY]
        if lane > 0:
            h = halved(run.times, count, t, h)
        else:
            h = halved(run.plan, run.planned[0], t, h)
        work.free[lane], work.grows[lane] = max(h, shortest), 10.0
    goes = is_at[lane] == BEGINS or is_at[lane] == AGAIN
    if goes and work.free[lane] < shortest:
        is_at[lane], goes = OVER, False
    work.later[lane] = min(t + work.free[lane], bound) if goes else t
    work.h[lane] = work.later[lane] - t
    return 1 if goes else 0


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
    """Steps of each lane, up to its bound, so many, or one in which something may happen.

    The rows that are left are those at the stages of the last step, where something may happen in
    it; else the first is that of the end. Lanes are finer than the first.
    """
    K, state, states, times = rhs.K, rhs.state, run.states, run.times
    controls, counts = run.controls, run.counts
    time, h, off, y, is_at = work.time, work.h, work.off, work.y, work.is_at
    for lane in range(of.lanes):
        is_at[lane], counts[lane], time[lane] = counts[lane], 0, times[lane * (limit + 1)]
        for i in range(of.state):
            y[i, lane] = states[lane * (limit + 1), i]
            state[i, lane] = y[i, lane]
        state[of.state, lane] = time[lane]
        work.thirds[lane] = controls[lane, WEIGHT]
    evaluate(of, fill, rhs, 0)
    if controls[0, TRY] == 0.0 and limit > 0:
        first_steps(of, fill, rhs, run, y, time, h, off, 8)
    while True:
        going, accepted = 0, False
        for lane in range(of.lanes):
            at_end = not (time[lane] < controls[lane, BOUND] and counts[lane] < limit)
            if is_at[lane] == BEGINS and at_end:
                is_at[lane] = OVER
            going += tries(of, run, work, lane)
        if going == 0:
            return
        rates_at(of, fill, rhs, by, work, 1, of.ends)
        error_of(of, rhs, by, run.tolerances, work)
        for lane in range(of.lanes):
            if is_at[lane] == OVER or is_at[lane] == WAITS:
                continue
            factor = 0.9 / sqrt(sqrt(sqrt(off[lane])))
            controls[lane, TRIED] += 1.0
            if not off[lane] < 1.0:
                is_at[lane] = AGAIN
                work.free[lane], work.grows[lane] = h[lane] * max(0.2, factor), 1.0
            else:
                is_at[lane], accepted = TAKEN, True
                controls[lane, TRY] = h[lane] * min(factor, work.grows[lane])
                counts[lane] += 1
                at = lane * (limit + 1) + counts[lane]
                times[at] = work.later[lane]
                for i in range(of.state):
                    states[at, i] = state[i, lane]
        if accepted:
            rates_at(of, fill, rhs, by, work, of.ends, of.stages)
            highest_terms(of, K, by.D, h, work.highest)
        for lane in range(of.lanes):
            if is_at[lane] == TAKEN:
                at, m = lane * (limit + 1) + counts[lane], lane * limit + counts[lane] - 1
                new = states[at]
                series_of(of, K, y, new, h[lane], work.highest, run.series[m], lane)
                run.turns[m] = may_turn(of, K, lane)
                for i in range(of.state):
                    y[i, lane] = new[i]
                time[lane], is_at[lane] = work.later[lane], BEGINS
                inside = controls[lane, LOW] < new[0] and new[0] < controls[lane, HIGH]
                if not (inside and is_calm(of, K, watched, lane)):
                    is_at[lane], counts[lane] = OVER, -counts[lane]
                else:
                    for k in range(of.width):
                        K[0, k, lane] = K[of.ends - 1, k, lane]


def fleet(
    of: Sizes, fill: Fill, slots: int, extra: int, rhs: Rhs, by: Scheme, run: Integration,
    work: Workspace, parameters: Reals, limit: int, watched: int, designs: int,
) -> None:  # fmt: skip
    """Steps of each design, from its first state and time: one lane after the other."""
    for d in range(designs):
        first = d * (limit + 1)
        for k in range(extra):
            rhs.state[of.state + 1 + k, 0] = parameters[d * extra + k]
        run.counts[d] = BEGINS
        steps(
            of, fill,
            Rhs(rhs.x, rhs.numbers[d * slots :], rhs.K[d * of.stages :], rhs.state), by,
            Integration(
                run.states[first:], run.times[first:], run.tolerances[2 * d :], run.controls[d:],
                run.series[d * limit :], run.turns, run.counts[d:],
                run.plan[d * (limit + 2) :], run.planned[d:],
            ),
            work, limit, watched,
        )  # fmt: skip
