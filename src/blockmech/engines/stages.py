"""Steps of DOP853, one after the other, written once: as machine code, and for Python as it is.

Of each step, until most are done or the bound is reached:

    K_s = the rates at t + C_s h, y + h sum_j A_sj K_j, for each stage s
    off = norm of h sum_j E_j K_j, in tolerances, of two estimates
    the step is taken where off < 1, else it is tried again with a shorter h

A step in which something may happen is the last: its first component leaves the ``free_range``, or
what is ``watched`` changes its sign at a stage of the step. Of the first two, which may dip to
zero between two stages, a stage that is not `FAR` from zero may not differ from the end by a third
of it either: then none is twice another. The rates are those of a traced program of one lane
(`blockmech.engines.assembly`), asked by a body: they are worked out state by state, hundreds of
times in what a call from Python takes.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.1, II.4
(control of the step: safety 0.9, factors from 0.2 to 10 as in SciPy) and II.10 (the estimates).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from math import sqrt
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.engines import loops
from blockmech.engines.assembly import Text
from blockmech.engines.llvm import FILL, addresses_of, machine_code, row_of
from blockmech.engines.loops import Counts, Reals
from blockmech.engines.nodes import Untraceable
from blockmech.engines.trace import FOLLOWED, Body, Trace
from blockmech.plan import Program
from blockmech.plane import EPS

Floats = NDArray[np.float64]
FAR = 0.125  # of a margin, 21 degrees of a transmission angle; and of inertia, in usual ones


class Sizes(NamedTuple):
    """Sizes of a stepper: components of a state, numbers of a row, and the stages.

    first : column of the first number that is watched
    ends : stages up to the end of a step; the others are for its dense output
    """

    state: int
    width: int
    first: int
    stages: int
    ends: int


Rows: TypeAlias = Annotated[Reals, "of.width"]
Blocks: TypeAlias = Annotated[Reals, "of.stages", "of.width"]
States: TypeAlias = Annotated[Reals, "of.state"]
Fill: TypeAlias = Callable[[Reals, Reals, Reals, int, int, int, int], float]


class Scheme(NamedTuple):
    """Coefficients of a method, see `Sizes`.

    A : (stages, stages), C : (stages,)
    E : (2, ends) of the estimates of orders 5 and 3
    """

    A: Floats
    C: Floats
    E: Floats


@cache
def scheme() -> Scheme:
    """Twelve stages of the step, the rates at its end, three of its dense output, as SciPy's."""
    from scipy.integrate import DOP853

    n, whole = DOP853.n_stages, len(DOP853.D[0])
    A, C = np.zeros((whole, whole)), np.ones(whole)
    A[:n, :n], A[n, :n], A[n + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
    C[:n], C[n + 1 :] = DOP853.C, DOP853.C_EXTRA
    return Scheme(A, C, np.array([DOP853.E5, DOP853.E3]))


def rates_at(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    K: Rows,
    y: Reals,
    state: Reals,
    A: Annotated[Reals, "of.stages"],
    C: Reals,
    t: float,
    h: float,
    begin: int,
    end: int,
) -> None:
    """Rows of the program at some stages of a step; ``x`` leads to ``state``."""
    for s in range(begin, end):
        for i in range(of.state):
            total = 0.0
            for j in range(s):
                total += A[s, j] * K[j, i]
            state[i] = y[i] + h * total
        state[of.state] = t + C[s] * h
        fill(x, numbers, K[s], 1, 1, 0, 1)


def error_of(
    of: Sizes,
    K: Rows,
    y: Reals,
    new: Reals,
    h: float,
    E: Annotated[Reals, "of.ends"],
    tolerances: States,
) -> float:
    """Error of a step in tolerances, of the estimates of orders 5 and 3."""
    fifths, thirds = 0.0, 0.0
    for i in range(of.state):
        scale = tolerances[1, i] + max(abs(y[i]), abs(new[i])) * tolerances[0, i]
        fifth, third = 0.0, 0.0
        for j in range(of.ends):
            fifth += E[0, j] * K[j, i]
            third += E[1, j] * K[j, i]
        fifth, third = fifth / scale, third / scale
        fifths += fifth * fifth
        thirds += third * third
    if fifths + thirds == 0.0:
        return 0.0
    return h * (fifths / sqrt((fifths + 0.01 * thirds) * of.state))


def is_calm(of: Sizes, K: Rows, watched: int) -> bool:
    """Whether nothing that is watched may have changed its sign in a step."""
    for w in range(watched):
        end = K[of.ends - 1, of.first + w]
        for s in range(of.stages):
            now = K[s, of.first + w]
            near = abs(now - end) * 3.0 < end or (now > FAR and end > FAR)
            alike = now * end > 0.0 or now == 0.0
            if not (near if w < 2 else alike):
                return False
    return True


def steps(
    of: Sizes,
    fill: Fill,
    x: Reals,
    numbers: Reals,
    blocks: Blocks,
    states: States,
    state: Reals,
    A: Annotated[Reals, "of.stages"],
    C: Reals,
    E: Annotated[Reals, "of.ends"],
    tolerances: States,
    control: Reals,
    times: Reals,
    most: int,
    watched: int,
) -> int:
    """How many steps were made; negative where something may happen in the last one.

    control : step to try, bound, longest step, how many were tried, the free_range
    """
    m = 0
    while times[m] < control[1] and m < most:
        t, K, y = times[m], blocks[m], states[m]
        shortest = abs(t) * EPS * 10.0
        free, grows = max(min(control[0], control[2]), shortest), 10.0
        while True:
            if free < shortest:
                return m
            later = min(t + free, control[1])
            h = later - t
            control[3] += 1.0
            rates_at(of, fill, x, numbers, K, y, state, A, C, t, h, 1, of.ends)
            off = error_of(of, K, y, state, h, E, tolerances)
            factor = 0.9 / sqrt(sqrt(sqrt(off)))
            if off < 1.0:
                break
            free, grows = h * max(0.2, factor), 1.0
        control[0] = h * min(factor, grows)
        m += 1
        times[m] = later
        for i in range(of.state):
            states[m, i] = state[i]
        rates_at(of, fill, x, numbers, K, y, state, A, C, t, h, of.ends, of.stages)
        for k in range(of.width):
            blocks[m, 0, k] = K[of.ends - 1, k]
        inside = control[4] < states[m, 0] and states[m, 0] < control[5]
        if not (inside and is_calm(of, K, watched)):
            return -m
    return m


def fleet(
    of: Sizes,
    fill: Fill,
    slots: int,
    more: int,
    x: Reals,
    numbers: Reals,
    blocks: Blocks,
    states: States,
    state: Reals,
    A: Annotated[Reals, "of.stages"],
    C: Reals,
    E: Annotated[Reals, "of.ends"],
    tolerances: States,
    controls: Annotated[Reals, "6"],
    times: Reals,
    given: Reals,
    counts: Counts,
    most: int,
    watched: int,
    designs: int,
) -> None:
    """Steps of each design, from its first state and time."""
    for d in range(designs):
        first = d * (most + 1)
        P, y, t = numbers[d * slots :], states[first:], times[first:]
        for i in range(of.state):
            state[i] = y[0, i]
        state[of.state] = t[0]
        for k in range(more):
            state[of.state + 1 + k] = given[d * more + k]
        fill(x, P, blocks[first, 0], 1, 1, 0, 1)
        counts[d] = steps(
            of,
            fill,
            x,
            P,
            blocks[first:],
            y,
            state,
            A,
            C,
            E,
            tolerances[2 * d :],
            controls[d],
            t,
            most,
            watched,
        )


class CompiledRhs:
    """A body of a program, as machine code for states and for steps.

    Its inputs are the components of the state, the time, and ``more`` numbers that are given; its
    values their rates, and last what is ``watched``: two that may dip to zero, others, and one
    that need not be looked at.
    """

    def __init__(
        self, program: Program, body: Body, dimension: int, more: int, watched: int
    ) -> None:
        """Raises `Untraceable` for what is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.dimension, self.inputs, self.watched = dimension, dimension + 1 + more, watched
        trace = Trace(program, body, self.inputs)
        if trace.asked:
            raise Untraceable(FOLLOWED)
        self.rows: list[Any] = [*trace.values]
        width, (stages, ends) = len(self.rows), (scheme().C.size, scheme().E.shape[1])
        of = Sizes(dimension, width, width - watched, stages, ends)
        fill: Any = "fill"  # by its name in the text
        made = {f.__name__: partial(f, of=of, fill=fill) for f in (steps, fleet)}
        text = Text(1).fill(self.inputs, self.rows, loops=made)
        kinds = ((name, loops.signature(f)) for name, f in made.items())
        self.at, self.steps, self._fleet = machine_code(text, ("fill", FILL), *kinds)
        self.program = program
        self.numbers = row_of(program)

    def room_of(self, most: int) -> int:
        """How many numbers so many steps of a design leave at their stages."""
        return (most + 1) * len(scheme().C) * len(self.rows)

    def fleet(
        self,
        slots: Floats,
        given: Floats,
        begin: tuple[Floats, Floats],
        control: Floats,
        tolerances: Floats,
        most: int,
        room: Floats,
    ) -> FleetSteps:
        """Steps of m designs, each from its own ``begin`` (t (m,), y (m, n)), at most so many.

        slots : (m, k) numbers of the program, given : (m, p) of the right-hand side
        control : (m, 6) step to try, bound, longest step, 0, and the free_range (`CompiledStepper`)
        tolerances : (m, 2, n) relative and absolute ones
        room : numbers, at least m `room_of` so many steps; what was in it is gone
        """
        by, m, n, width = scheme(), len(slots), self.dimension, len(self.rows)
        t, y = np.zeros((m, most + 1)), np.zeros((m, most + 1, n))
        t[:, 0], y[:, 0] = begin
        K = room[: m * self.room_of(most)].reshape(m, most + 1, len(by.C), width)
        counts = np.zeros(m, np.int64)
        state = np.zeros(self.inputs)
        x = addresses_of(state)
        slots, given, control, tolerances = map(
            np.ascontiguousarray, (slots, given, control, tolerances)
        )
        arrays = slots, K, y, state, by.A, by.C, by.E, tolerances, control, t, given, counts
        places = (a.ctypes.data for a in arrays)
        self._fleet(slots.shape[1], given.shape[1], x, *places, most, self.watched, m)
        return FleetSteps(t, y, K, np.abs(counts), counts < 0, control[:, 0], control[:, 3])


class FleetSteps(NamedTuple):
    """Steps of m designs.

    t : (m, s + 1) [s], y : (m, s + 1, n) where they begin, and where the last ends
    K : (m, s + 1, stages, r) rows of the program at their stages, until the room is used again;
        of no step that of the start
    made : (m,) how many steps, doubtful : (m,) whether something may happen in the last one
    h : (m,) [s] the step to try next, tried : (m,) how many were tried
    """

    t: Floats
    y: Floats
    K: Floats
    made: NDArray[np.int64]
    doubtful: NDArray[np.bool_]
    h: Floats
    tried: Floats


class Steps(NamedTuple):
    """Some steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    K : (m, s, r) rows of the program at their stages, until the next steps are made
    h : [s] the step to try next
    tried : how many steps were tried
    doubtful : whether something may happen in the last one
    """

    t: Floats
    y: Floats
    K: Floats
    h: float
    tried: int
    doubtful: bool


class CompiledStepper:
    """Rates with numbers that are given."""

    def __init__(self, rates: CompiledRhs, given: Sequence[float]) -> None:
        self._rates = rates
        self._parameters = rates.numbers.ctypes.data
        self._state = np.array([0.0] * (rates.dimension + 1) + [*given])
        self._row = np.zeros(len(rates.rows))
        self._room = np.zeros((0, 0, 0))
        self._x = addresses_of(self._state)

    def steps(
        self,
        begin: Any,
        h: float,
        ends: tuple[float, float],
        free_range: tuple[float, float],
        tolerances: Floats,
        most: int,
        every: bool = True,
    ) -> Steps:
        """Steps from ``begin`` (t, y), at most so many.

        ends : [s] where they end, and the longest one
        free_range : between which the first component is to stay
        tolerances : (2, n) relative and absolute ones
        every : whether all that is watched is looked at, or all but the last
        """
        r, n, width = self._rates, self._rates.dimension, self._row.size
        by, watched = scheme(), r.watched - (not every)
        if len(self._room) <= most:
            self._room = np.zeros((most + 1, len(by.C), width))
        K, t, y = self._room, np.zeros(most + 1), np.zeros((most + 1, n))
        t[0], y[0] = begin
        K[0, 0] = self.at(*begin)
        control = np.array([h, *ends, 0.0, *free_range])
        arrays = K, y, self._state, by.A, by.C, by.E, tolerances, control, t
        places = (x.ctypes.data for x in arrays)
        count = r.steps(self._x, self._parameters, *places, most, watched)
        m = abs(count)
        h, tried = float(control[0]), int(control[3])
        return Steps(t[: m + 1], y[: m + 1], K[:m], h, tried, count < 0)

    def at(self, t: float, y: Sequence[float]) -> list[float]:
        """What the program says of a state."""
        r, n = self._rates, self._rates.dimension
        self._state[:n], self._state[n] = y, t
        r.at(self._x, self._parameters, self._row.ctypes.data, 1, 1, 0, 1)
        row: list[float] = self._row.tolist()
        return row
