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

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property, partial
from importlib.util import find_spec
from itertools import accumulate
from math import sqrt
from pathlib import Path
from runpy import run_path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.engines import loops
from blockmech.engines.assembly import Text, piece
from blockmech.engines.llvm import FILL, addresses_of, machine_code, row_of
from blockmech.engines.loops import ROW, Counts, Reals
from blockmech.engines.nodes import Untraceable
from blockmech.engines.trace import FOLLOWED, Body, Trace
from blockmech.ground.plane import EPS
from blockmech.plan.plan import Program

Floats = NDArray[np.float64]
LANES = 2  # runs of a motion side by side: the second takes half the steps of the first
THIRD = 0.01  # weight of the estimate of order 3 where the rates are smooth
KNOWN = 64  # states looked at last whose rows are kept
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
Arrays: TypeAlias = list[tuple[str, Any, tuple[int, ...]]]
Fill: TypeAlias = Callable[[Reals, Reals, Reals, int, int, int, int], float]


class Rhs(NamedTuple):
    """What a program is asked by, and what it says.

    x : places of its inputs, which are those of ``state``: components, time, what is given
    numbers : those of the program
    K : its rows at the stages of a step
    """

    x: Reals
    numbers: Reals
    K: Rows
    state: Lanes


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

    states: States
    times: Reals
    tolerances: Limits
    controls: Controls
    series: Series
    turns: Counts
    counts: Counts
    plan: Reals
    planned: Counts


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
    workspace : what its loop needs beside, for so many steps: names, kinds and shapes; the first is
        what it knows of a step when the next steps are asked for
    """

    steps: Callable[..., None]
    lanes: int
    stages: int
    ends: int
    scheme: tuple[Floats, ...]
    states: tuple[int, int]
    workspace: Callable[[Sizes, int], Arrays]


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
    y: Lanes
    highest: Lanes
    is_at: Counts


def workspace(of: Sizes, most: int) -> Arrays:
    """Arrays of a `Workspace`."""
    rows = {"y": (of.state, of.lanes), "highest": (4 * of.state, of.lanes)}
    kinds = {"is_at": np.int64}
    return [(x, kinds.get(x, np.float64), rows.get(x, (of.lanes,))) for x in Workspace._fields]


@cache
def dop853() -> Method:
    """The explicit method of order 8."""
    by, stages, ends = scheme(), scheme().C.size, scheme().E.shape[1]
    return Method(steps, LANES, stages, ends, by, (ends - 1, stages - ends), workspace)


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
    whole = fifths / np.sqrt((fifths + work.thirds * thirds) * float(of.state))
    work.off[:] = h * np.where(fifths == 0.0, none, whole)


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
            near = abs(now - end) * 3.0 < end or (now > FAR and end > FAR)
            if not (near if w < 2 else now * end > 0.0 or now == 0.0):
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
        far, longest, fast[lane] = 0.0, controls[lane, BOUND] - time[lane], 0.0
        for i in range(of.state):
            scale = tolerated(of, tolerances, i, lane, abs(y[i, lane]))
            far += y[i, lane] / scale * (y[i, lane] / scale)
            fast[lane] += K[0, i, lane] / scale * (K[0, i, lane] / scale)
        far, fast[lane] = sqrt(far / of.state), sqrt(fast[lane] / of.state)
        h[lane] = 1e-6 if far < 1e-5 or fast[lane] < 1e-5 else 0.01 * far / fast[lane]
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
        fits = sqrt(sqrt(0.01 / quick)) if quick > 1e-15 else max(1e-6, 1e-3 * h[lane])
        if quick > 1e-15 and order == 8:
            fits = sqrt(fits)
        if controls[lane, TRY] == 0.0:
            controls[lane, TRY] = min(min(100.0 * h[lane], fits), longest)


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
    made = run.counts[0] if run.counts[0] > 0 else -run.counts[0]
    if is_at[lane] == WAITS:
        is_at[lane] = BEGINS
    if lane > 0 and is_at[lane] == BEGINS and t >= run.times[made]:
        is_at[lane] = OVER if is_at[0] == OVER else WAITS
    shortest = max(abs(t) * EPS * 10.0, SHORTEST)
    if is_at[lane] == BEGINS:
        h = control[TRY]
        if lane > 0:
            h = halved(run.times, made, t, h)
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
    most: int,
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
        is_at[lane], counts[lane], time[lane] = counts[lane], 0, times[lane * (most + 1)]
        for i in range(of.state):
            y[i, lane] = states[lane * (most + 1), i]
            state[i, lane] = y[i, lane]
        state[of.state, lane] = time[lane]
        work.thirds[lane] = controls[lane, WEIGHT]
    evaluate(of, fill, rhs, 0)
    if controls[0, TRY] == 0.0 and most > 0:
        first_steps(of, fill, rhs, run, y, time, h, off, 8)
    while True:
        going, taken = 0, False
        for lane in range(of.lanes):
            ended = not (time[lane] < controls[lane, BOUND] and counts[lane] < most)
            if is_at[lane] == BEGINS and ended:
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
                is_at[lane], taken = TAKEN, True
                controls[lane, TRY] = h[lane] * min(factor, work.grows[lane])
                counts[lane] += 1
                at = lane * (most + 1) + counts[lane]
                times[at] = work.later[lane]
                for i in range(of.state):
                    states[at, i] = state[i, lane]
        if taken:
            rates_at(of, fill, rhs, by, work, of.ends, of.stages)
            highest_terms(of, K, by.D, h, work.highest)
        for lane in range(of.lanes):
            if is_at[lane] == TAKEN:
                at, m = lane * (most + 1) + counts[lane], lane * most + counts[lane] - 1
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
    of: Sizes, fill: Fill, slots: int, more: int, rhs: Rhs, by: Scheme, run: Integration,
    work: Workspace, given: Reals, most: int, watched: int, designs: int,
) -> None:  # fmt: skip
    """Steps of each design, from its first state and time: one lane after the other."""
    for d in range(designs):
        first = d * (most + 1)
        for k in range(more):
            rhs.state[of.state + 1 + k, 0] = given[d * more + k]
        run.counts[d] = BEGINS
        steps(
            of, fill,
            Rhs(rhs.x, rhs.numbers[d * slots :], rhs.K[d * of.stages :], rhs.state), by,
            Integration(
                run.states[first:], run.times[first:], run.tolerances[2 * d :], run.controls[d:],
                run.series[d * most :], run.turns, run.counts[d:],
                run.plan[d * (most + 2) :], run.planned[d:],
            ),
            work, most, watched,
        )  # fmt: skip


class CompiledRhs:
    """A body of a program, as machine code for states and for steps.

    Its inputs are the components of the state, the time, and ``more`` numbers that are given; its
    values their rates, and last what is ``watched``: two that may dip to zero, others, and one
    that need not be looked at.
    """

    def __init__(
        self,
        program: Program,
        body: Body,
        dimension: int,
        more: int,
        watched: int,
        method: Method | None = None,
    ) -> None:
        """Raises `Untraceable` for what is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.method = method or dop853()
        self.dimension, self.inputs, self.watched = dimension, dimension + 1 + more, watched
        trace = Trace(program, body, self.inputs)
        if trace.asked:
            raise Untraceable(FOLLOWED)
        self.rows: list[Any] = [*trace.values]
        self.program, self.numbers = program, row_of(program)
        self.place = self.numbers.ctypes.data
        self.fill, self.steps = self._code(self.method.lanes, self.method.steps)

    def sizes(self, lanes: int) -> Sizes:
        """Those of so many states side by side."""
        by, width = self.method, len(self.rows)
        return Sizes(self.dimension, width, width - self.watched, by.stages, by.ends, lanes)

    def _code(self, lanes: int, function: Callable[..., None]) -> Any:
        """The rows of so many states side by side as machine code, and a function that asks it."""
        fill: Any = "fill"  # by its name in the text
        made = partial(function, of=self.sizes(lanes), fill=fill)
        text = Text(lanes).fill(self.inputs, self.rows, loops={"over": made})
        return machine_code(text, ("fill", FILL), ("over", loops.signature(made)))

    @cached_property
    def of_designs(self) -> Any:
        """The rows of one state as machine code, and `fleet`."""
        return self._code(1, fleet)

    def fleet(
        self,
        slots: Floats,
        given: Floats,
        begin: tuple[Floats, Floats],
        control: Floats,
        tolerances: Floats,
        most: int,
        plan: Floats,
        planned: NDArray[np.int64],
    ) -> FleetSteps:
        """Steps of m designs, each from its own ``begin`` (t (m,), y (m, n)), at most so many.

        slots : (m, k) numbers of the program, given : (m, p) of the right-hand side
        control : (m, 6) of an `Integration`
        tolerances : (m, 2, n) relative and absolute ones
        plan : (m, most + 2) [s] steps of a coarser run, planned : (m,) how many
        """
        by, m, n, width = scheme(), len(slots), self.dimension, len(self.rows)
        t, y = np.zeros((m, most + 1)), np.zeros((m, most + 1, n))
        t[:, 0], y[:, 0] = begin
        K, series = np.empty((m, len(by.C), width)), np.empty((m, most, 8, n))
        counts, turns = np.zeros(m, np.int64), np.zeros(most, np.int64)
        state = np.zeros(self.inputs)
        slots, given, control, tolerances, plan = map(
            np.ascontiguousarray, (slots, given, control, tolerances, plan)
        )
        work = [np.zeros(shape, kind) for _, kind, shape in workspace(self.sizes(1), most)]
        x, (_, over) = addresses_of(state), self.of_designs
        rhs = loops.places_of(Rhs(np.frombuffer(x), slots, K, state))
        planned = np.ascontiguousarray(planned)
        about = y, t, tolerances, control, series, turns, counts, plan, planned
        run = loops.places_of(Integration(*about))
        by_place = rhs, loops.places_of(by), run, loops.places_of(work), given.ctypes.data
        over(slots.shape[1], given.shape[1], *by_place, most, self.watched, m)
        made, h, tried = np.abs(counts), control[:, TRY], control[:, TRIED]
        return FleetSteps(t, y, K, series, made, counts < 0, h, tried)


class FleetSteps(NamedTuple):
    """Steps of m designs.

    t : (m, s + 1) [s], y : (m, s + 1, n) where they begin, and where the last ends
    K : (m, stages, r) rows of the program at the stages of the last one, where something may
        happen in it; else the first is that of the end
    series : (m, s, 8, n) of each, see `blockmech.engines.dense`
    made : (m,) how many steps, doubtful : (m,) whether something may happen in the last one
    h : (m,) [s] the step to try next, tried : (m,) how many were tried
    """

    t: Floats
    y: Floats
    K: Floats
    series: Floats
    made: NDArray[np.int64]
    doubtful: NDArray[np.bool_]
    h: Floats
    tried: Floats


class Steps(NamedTuple):
    """Some steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    series : (m, 8, n) of each, see `blockmech.engines.dense`
    turns : (m,) 1 of one in which the first component may turn, else 0
    h : [s] the step to try next
    tried : how many steps were tried
    doubtful : whether something may happen in the last one
    row : what the program says of the last state
    """

    t: Floats
    y: Floats
    series: Floats
    turns: NDArray[np.int64]
    h: float
    tried: int
    doubtful: bool
    row: list[float]


@cache
def buffers(
    workspace: Callable[[Sizes, int], Arrays], of: Sizes, inputs: int, most: int
) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Arrays of `Rhs`, `Integration` and workspace one behind the other; where each begins.

    But for the numbers of the program, which it has itself.
    """
    n, lanes, real, count = of.state, of.lanes, np.float64, np.int64
    arrays: Arrays = [
        ("x", count, (inputs,)),
        ("K", real, (of.stages, of.width, lanes)),
        ("state", real, (inputs, lanes)),
        ("states", real, (lanes * (most + 1), n)),
        ("times", real, (lanes * (most + 1),)),
        ("tolerances", real, (2, n, lanes)),
        ("controls", real, (lanes, 6)),
        ("series", real, (lanes * most, 8, n)),
        ("turns", count, (lanes * most,)),
        ("counts", count, (lanes,)),
        ("plan", real, (most + 2,)),
        ("planned", count, (1,)),
        *workspace(of, most),
    ]
    sizes = (8 * math.prod(shape) for *_, shape in arrays)
    return np.dtype(arrays), tuple(accumulate(sizes, initial=0))[:-1]


class CompiledStepper:
    """Rates with numbers that are given, and room for so many steps at a time.

    Of one run at a time.
    """

    def __init__(self, rates: CompiledRhs, most: int) -> None:
        by = rates.method
        kind, begins = buffers(by.workspace, rates.sizes(by.lanes), rates.inputs, most)
        whole = np.empty((), kind)
        parts = [whole[name] for name in kind.names or ()]
        inputs, self._rows, self._state, self._y, self._t, self._tolerances = parts[:6]
        self._control, self._series, self._turns, self._counts = parts[6:10]
        self._plan, self._planned, self._now = parts[10:13]
        first, row = int(whole.ctypes.data), 8 * by.lanes
        x, K, state, *more = (first + begin for begin in begins)
        inputs[:] = range(state, state + row * rates.inputs, row)
        records = x, rates.place, K, state, *more
        self._kept = (ctypes.c_void_p * len(records))(*records), loops.places_of(by.scheme)
        rhs, scheme = map(ctypes.addressof, self._kept)
        run = rhs + 8 * len(Rhs._fields)
        self._rates, self._places = rates, (rhs, scheme, run, run + 8 * len(Integration._fields))
        self._end = by.ends - 1
        self._one = x, rates.place, K, by.lanes, by.lanes, 0, 1
        self._known: dict[tuple[float, ...], list[float]] = {}

    def given(self, numbers: Sequence[float]) -> CompiledStepper:
        """Itself, from now on with these numbers, and without what it knew."""
        self._state[-len(numbers) :].T[:], self._now[:] = numbers, math.nan
        self._known.clear()
        self._ahead: tuple[Any, Steps] | None = None
        return self

    def steps(
        self,
        begin: tuple[float, Floats],
        h: float,
        bound: float,
        free_range: tuple[float, float],
        tolerances: Floats,
        most: int,
        every: bool = True,
        finer: Floats | None = None,
        weight: float = THIRD,
        plan: Floats | tuple[()] = (),
    ) -> Steps:
        """Steps from ``begin`` (t, y), so many at most.

        h : [s] the first one to try, 0 for one that fits
        bound : [s] where they end
        free_range : between which the first component is to stay
        tolerances : (2, n) relative and absolute ones
        every : whether all that is watched is looked at, or all but the last
        finer : tolerances of a run by half the steps that will ask the same after this one. It goes
            along in a lane of its own, which costs next to nothing: both wait for the same
            latencies
        weight : of the estimate of order 3, 0 where the rates have corners
        plan : (p + 1,) [s] steps of a coarser run from there on
        """
        key = begin[0], begin[1].tobytes(), h, bound, free_range, every
        if self._ahead is not None and self._ahead[0] == (*key, tolerances.tobytes()):
            (_, ahead), self._ahead = self._ahead, None
            return ahead
        self._t[: 2 + most : most + 1], self._y[: 2 + most : most + 1] = begin
        lanes = self._rates.method.lanes
        self._counts[:lanes] = BEGINS
        self._tolerances[:] = tolerances[..., None]
        self._control[:] = h, bound, 0.0, *free_range, weight
        some = plan[: most + 2]
        self._planned[0] = max(len(some) - 1, 0)
        self._plan[: len(some)] = some
        if finer is None:
            self._counts[1:lanes] = OVER
        else:
            self._tolerances[..., 1] = finer
        self._rates.steps(*self._places, most, self._rates.watched - (not every))
        if finer is not None:
            self._ahead = (*key, finer.tobytes()), self._made(1, most)
        return self._made(0, most)

    def _made(self, lane: int, most: int) -> Steps:
        """The steps of a lane, of so many at most."""
        count, (h, _, tried, *_) = int(self._counts[lane]), self._control[lane].tolist()
        m, k, at = abs(count), lane * most, lane * (most + 1)
        states = self._t[at : at + m + 1], self._y[at : at + m + 1]
        kept: Any = *states, self._series[k : k + m], self._turns[k : k + m]
        row: list[float] = self._rows[self._end if count < 0 else 0, :, lane].tolist()
        return Steps._make([*(x.copy() for x in kept), h, int(tried), count < 0, row])

    def at(self, t: float, y: Any) -> list[float]:
        """What the program says of a state; many of an event ask for the same."""
        key = t, *y
        if key not in self._known:
            if len(self._known) == KNOWN:
                self._known.clear()
            n = self._rates.dimension
            self._state[:n].T[:], self._state[n] = y, t
            self._rates.fill(*self._one)
            self._known[key] = self._rows[0, :, 0].tolist()
        return self._known[key]
