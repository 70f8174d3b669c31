"""The right-hand side of a motion as machine code, and steps of a method over it.

Rates are those of a traced program (`blockmech.engines.assembly`); loops of steps (`stages`,
`radau`) ask for them state by state, hundreds of times in what a call from Python takes.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property, partial
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.engines import loops
from blockmech.engines.assembly import Text
from blockmech.engines.kinds import arrays_of
from blockmech.engines.llvm import FILL, addresses_of, machine_code, row_of
from blockmech.engines.nodes import Untraceable
from blockmech.engines.stages import (
    BEGINS,
    OVER,
    THIRD,
    TRIED,
    TRY,
    Integration,
    Method,
    Rhs,
    Sizes,
    Workspace,
    dop853,
    fleet,
    scheme,
)
from blockmech.engines.trace import FOLLOWED, Body, Trace
from blockmech.ground.memory import RETAINED
from blockmech.plan.plan import Program
from blockmech.typing import Floats, Reals


class CompiledRhs:
    """A body of a program, as machine code for states and for steps.

    Its inputs are the components of the state, the time, and more ``parameters``; its
    values their rates, and last what is ``watched``: two that may dip to zero, others, and one
    that need not be looked at.
    """

    def __init__(
        self,
        program: Program,
        body: Body,
        dimension: int,
        parameters: int,
        watched: int,
        method: Method | None = None,
    ) -> None:
        """Raises `Untraceable` for what is more than flat arithmetic, and
        `MissingEngineError` without llvmlite."""
        self.method = method or dop853()
        self.dimension, self.inputs, self.watched = dimension, dimension + 1 + parameters, watched
        trace = Trace(program, body, self.inputs)
        if trace.asked:
            raise Untraceable(FOLLOWED)
        self.rows: Reals = [*trace.values]
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
        loop = partial(function, of=self.sizes(lanes), fill=fill)
        text = Text(lanes).fill(self.inputs, self.rows, loops={"over": loop})
        return machine_code(text, ("fill", FILL), ("over", loops.signature(loop)))

    @cached_property
    def of_designs(self) -> Any:
        """The rows of one state as machine code, and `fleet`."""
        return self._code(1, fleet)

    def fleet(
        self,
        slots: Floats,
        parameters: Floats,
        begin: tuple[Floats, Floats],
        control: Floats,
        tolerances: Floats,
        count: int,
        plan: Floats,
        planned: NDArray[np.int64],
    ) -> FleetSteps:
        """Steps of m designs, each from its own ``begin`` (t (m,), y (m, n)), at most so many.

        slots : (m, k) numbers of the program, parameters : (m, p) of the right-hand side
        control : (m, 6) of an `Integration`
        tolerances : (m, 2, n) relative and absolute ones
        plan : (m, count + 2) [s] steps of a coarser run, planned : (m,) how many
        """
        by, m, n, width = scheme(), len(slots), self.dimension, len(self.rows)
        t, y = np.zeros((m, count + 1)), np.zeros((m, count + 1, n))
        t[:, 0], y[:, 0] = begin
        K, series = np.empty((m, len(by.C), width)), np.empty((m, count, 8, n))
        counts, turns = np.zeros(m, np.int64), np.zeros(count, np.int64)
        state = np.zeros(self.inputs)
        slots, parameters, control, tolerances, plan = map(
            np.ascontiguousarray, (slots, parameters, control, tolerances, plan)
        )
        sizes = {"of": self.sizes(1), "count": count}
        work = [np.zeros(shape, kind) for _, kind, shape in arrays_of(Workspace, sizes)]
        x, (_, over) = addresses_of(state), self.of_designs
        rhs = loops.addresses_of(Rhs(np.frombuffer(x), slots, K, state))
        planned = np.ascontiguousarray(planned)
        about = y, t, tolerances, control, series, turns, counts, plan, planned
        run = Integration(*about)
        records = *map(loops.addresses_of, (by, run, work)), parameters.ctypes.data
        over(slots.shape[1], parameters.shape[1], rhs, *records, count, self.watched, m)
        number, h, tried = np.abs(counts), control[:, TRY], control[:, TRIED]
        return FleetSteps(t, y, K, series, number, counts < 0, h, tried)


class FleetSteps(NamedTuple):
    """Steps of m designs.

    t : (m, s + 1) [s], y : (m, s + 1, n) where they begin, and where the last ends
    K : (m, stages, r) rows of the program at the stages of the last one, where something may
        happen in it; else the first is that of the end
    series : (m, s, 8, n) of each, see `blockmech.engines.dense`
    number : (m,) of steps, doubtful : (m,) whether something may happen in the last one
    h : (m,) [s] the step to try next, tried : (m,) how many were tried
    """

    t: Floats
    y: Floats
    K: Floats
    series: Floats
    number: NDArray[np.int64]
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
    workspace: Any, of: Sizes, inputs: int, count: int
) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Arrays of `Rhs`, `Integration` and workspace one behind the other; where each begins.

    But for the numbers of the program, which it has itself.
    """
    sizes = {"of": of, "inputs": inputs, "count": count}
    records = (Rhs, Integration, workspace)
    arrays = [array for record in records for array in arrays_of(record, sizes)]
    lengths = (8 * math.prod(shape) for *_, shape in arrays)
    return np.dtype(arrays), tuple(accumulate(lengths, initial=0))[:-1]


class CompiledStepper:
    """Rates with numbers that are given, and room for so many steps at a time.

    Of one run at a time.
    """

    def __init__(self, rates: CompiledRhs, limit: int) -> None:
        by = rates.method
        kind, begins = buffers(by.workspace, rates.sizes(by.lanes), rates.inputs, limit)
        memory = np.empty((), kind)
        parts = [memory[name] for name in kind.names or ()]
        inputs, self._rows, self._state, self._y, self._t, self._tolerances = parts[:6]
        self._control, self._series, self._turns, self._counts = parts[6:10]
        self._plan, self._planned, self._now = parts[10:13]
        first, row = int(memory.ctypes.data), 8 * by.lanes
        x, K, state, *rest = (first + begin for begin in begins)
        inputs.view(np.int64)[:] = range(state, state + row * rates.inputs, row)
        records = x, rates.place, K, state, *rest
        self._kept = (ctypes.c_void_p * len(records))(*records), loops.addresses_of(by.scheme)
        rhs, scheme = map(ctypes.addressof, self._kept)
        run = rhs + 8 * len(Rhs._fields)
        self._rates, self._places = rates, (rhs, scheme, run, run + 8 * len(Integration._fields))
        self._end = by.ends - 1
        self._one = x, rates.place, K, by.lanes, by.lanes, 0, 1
        self._rows_of: dict[tuple[float, ...], list[float]] = {}

    def with_numbers(self, numbers: Sequence[float]) -> CompiledStepper:
        """Itself, from now on with these numbers, and without what it knew."""
        self._state[-len(numbers) :].T[:], self._now[:] = numbers, math.nan
        self._rows_of.clear()
        self._ahead: tuple[Any, Steps] | None = None
        return self

    def steps(
        self,
        begin: tuple[float, Floats],
        h: float,
        bound: float,
        free_range: tuple[float, float],
        tolerances: Floats,
        limit: int,
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
            (_, steps), self._ahead = self._ahead, None
            return steps
        self._t[: 2 + limit : limit + 1], self._y[: 2 + limit : limit + 1] = begin
        lanes = self._rates.method.lanes
        self._counts[:lanes] = BEGINS
        self._tolerances[:] = tolerances[..., None]
        self._control[:] = h, bound, 0.0, *free_range, weight
        some = plan[: limit + 2]
        self._planned[0] = max(len(some) - 1, 0)
        self._plan[: len(some)] = some
        if finer is None:
            self._counts[1:lanes] = OVER
        else:
            self._tolerances[..., 1] = finer
        self._rates.steps(*self._places, limit, self._rates.watched - (not every))
        if finer is not None:
            self._ahead = (*key, finer.tobytes()), self._steps_of(1, limit)
        return self._steps_of(0, limit)

    def _steps_of(self, lane: int, limit: int) -> Steps:
        """The steps of a lane, of so many at most."""
        count, (h, _, tried, *_) = int(self._counts[lane]), self._control[lane].tolist()
        m, k, at = abs(count), lane * limit, lane * (limit + 1)
        states = self._t[at : at + m + 1], self._y[at : at + m + 1]
        arrays = *states, self._series[k : k + m], self._turns[k : k + m]
        row: list[float] = self._rows[self._end if count < 0 else 0, :, lane].tolist()
        return Steps._make([*(x.copy() for x in arrays), h, int(tried), count < 0, row])

    def at(self, t: float, y: Floats) -> list[float]:
        """What the program says of a state; many of an event ask for the same."""
        key = t, *y
        if key not in self._rows_of:
            if len(self._rows_of) == RETAINED:
                self._rows_of.clear()
            n = self._rates.dimension
            self._state[:n].T[:], self._state[n] = y, t
            self._rates.fill(*self._one)
            self._rows_of[key] = self._rows[0, :, 0].tolist()
        return self._rows_of[key]
