"""Joint friction in motion: what is the same with one driver and with several.

The laws of the pairs at relative rates, and the force pass at states in which loads, rates, one
acceleration, or a unit of friction in one pair act alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import NumpyEngine, Planar, primitives
from blockmech.engines.scalar import AdaptiveEvaluator
from blockmech.friction import solvers
from blockmech.friction.continuation import Outcome
from blockmech.passes.signals import STATE
from blockmech.plan import Friction, Program

Floats: TypeAlias = NDArray[np.float64]
Vectors: TypeAlias = NDArray[np.complex128]
Sides: TypeAlias = tuple[int, ...]
Row: TypeAlias = list[Any]  # the program's values at a state, or at n of them


@dataclass(frozen=True)
class PairProgram:
    """The force pass with friction as input, and the laws of the m pairs.

    Values of the force pass: the driving efforts, the load of each pair, its relative rate and
    acceleration, margins.
    """

    names: tuple[str, ...]  # (m,) pairs with friction
    guides: tuple[bool, ...]  # (m,) whether the load is the larger component of (N, 2 C / L)
    program: Program
    laws: Program  # factors and drags (2 m,) at relative rates; that hold at rest; elastic ones
    whole: Program  # of one driver: the first without accelerations, signals, factors and drags
    remembers: tuple[bool, ...]  # (m,) whether a pair's law has a state of its own
    separates: tuple[bool, ...]  # (m,) whether it is a mesh that only adds to its contact
    steepest: tuple[float, ...]  # (m,) largest slopes over the load of laws that are not linear
    # in it, 0 of others; () without any
    drags: bool  # whether a law has more than a factor
    smooth: bool  # whether all laws are analytic in the speed
    batch: NumpyEngine  # the force pass on arrays
    single: Any  # and at one state, a `SingleEvaluator`


class State(NamedTuple):
    """One column of inputs of the program, besides q: what is let act."""

    qd: Any = 0.0  # a number or (n,); of several drivers (k,) or (n, k)
    qdd: Any = 0.0
    share: float = 0.0  # of the applied loads
    pair: int = -1  # the one with a unit of friction; -1: none
    push: int = -1  # the stop with a unit of push; -1: none
    t: Any = 0.0
    x: Any = None  # states of signal blocks; None: the initial ones


class FrictionState(NamedTuple):
    """One state: the acceleration, and what the pairs do."""

    qdd: Any  # of several drivers (k,)
    power: float  # [W] that friction takes, see `power_taken`
    loads: Vectors  # (m,)
    margin: float
    outcome: Outcome
    limit: float
    misfit: float = 0.0  # [-] bound of what an iteration left undone, of the largest friction
    friction: Any = ()  # (m,) [N m or N] on the later links
    pushes: Any = ()  # (a,) [N m or N] of the stops that several drivers lie against

    @property
    def locked(self) -> bool:
        """Whether no acceleration satisfies Coulomb's law, in a pose that is possible."""
        return not self.outcome.solved and self.margin > 0


def outcome_of(code: Any) -> Outcome:
    """What a solver's number says; that it found nothing where it is none."""
    return Outcome(int(code)) if code == code else Outcome.NOT_CONVERGED


def least(margins: Iterable[Any]) -> float:
    """The smallest of 1 and some margins; NaN if one is."""
    smallest = 1.0
    for m in margins:
        if not m >= smallest:
            if m != m:
                return math.nan
            smallest = float(m)
    return smallest


def signed_terms(sides: Any, law: Any, drags: bool) -> tuple[Any, Any]:
    """See `JointFriction.against`."""
    against = [-side * x for side, x in zip((*sides, *sides), law, strict=True)]
    return tuple(against[: len(sides)]), tuple(against[len(sides) :]) if drags else ()


class PairFriction:
    """Friction of all pairs of a mechanism.

    ``count`` is called with evaluations (samples, whether a batch); ``compiled`` says whether
    single states are machine code's; ``rounding`` [N m or N] is what that leaves unknown at a
    place of the effort of the loads; ``rate_loads``: whether one follows the rate or the time;
    ``initial`` are states of signal blocks and laws.
    """

    kernels: ClassVar[Mapping[str, Any]] = {}  # beside the solver, on arrays

    def __init__(
        self,
        program: PairProgram,
        method: Friction,
        count: Callable[[int, bool], None],
        compiled: Callable[[], bool],
        rounding: Callable[[Any], Any],
        rate_loads: bool,
        initial: tuple[float, ...] = (),
    ) -> None:
        self.program, self._count, self._compiled = program, count, compiled
        self._rounding, self.rate_loads, self._initial = rounding, rate_loads, initial
        self.names = program.names
        self.guides = program.guides
        self.signed = np.logical_or(program.remembers, program.separates)  # laws say the sign
        self._laws = AdaptiveEvaluator(program.laws)
        self._constant: dict[int, list[Row]] = {}  # what laws say that follow no speed, of n rates
        still = np.zeros((len(self.names), 1))
        self.static = tuple(
            float(x[0]) for x in self._law_values(still)[1]
        )  # (2 m,) that hold at rest
        solver, options = solvers.SOLVERS[method.method]
        self.options = tuple(getattr(method, name) for name in options)
        self.solver = solver
        kernels: Any = {"solve": solver, "balanced": solvers.balanced, **self.kernels}
        self._bound = bind_functions(kernels, primitives(np.float64))
        # the solution for laws, at one state and at n of them
        self.balance = partial(solvers.balanced, solver, self.options)
        self.balance_all = partial(self._bound["balanced"], self._bound["solve"], self.options)

    def senses(self, slips: Any) -> Floats:
        """Signs (..., m) of slips; 1 of a pair whose law says the sign itself."""
        return np.where(self.signed, 1.0, np.sign(slips))

    # -- the laws ------------------------------------------------------------------------

    def _law_values(self, rates: Floats, x: Any = None, loads: Any = None) -> list[Row]:
        """Factors and drags (2 m,) of arrays (n,) at relative rates (m, n), at rest, and elastic.

        x are the states of signals and laws, by default the initial ones; ``loads`` (m, n) [N]
        those of laws that are not linear in them, by default none.
        """
        inputs, n = self.program.laws.inputs, rates.shape[1]
        if not inputs and n in self._constant:
            return self._constant[n]
        given = {f"slip_{j}": rate for j, rate in enumerate(rates)}
        states = self._initial if x is None else x
        given |= {f"{STATE}{k}": np.full(n, s) for k, s in enumerate(states)}
        loads = np.zeros(rates.shape) if loads is None else loads
        given |= {f"load_{j}": load for j, load in enumerate(loads)}
        values, m = list(self._laws.run({x: given[x] for x in inputs}, n)), 2 * len(self.names)
        terms = [values[:m], values[m : 2 * m], values[2 * m :]]
        if not inputs:
            self._constant[n] = terms
        return terms

    def law(self, rates: Floats, x: Any = None, loads: Any = None) -> Row:
        """Factors and drags (2 m,) of arrays (n,) at relative rates, states and loads."""
        return self._law_values(rates, x, loads)[0]

    def standing(self, x: Any) -> tuple[float, ...]:
        """Factors and drags (2 m,) at a standstill with states x: those of bristles are elastic."""
        if not any(self.program.remembers):
            return self.static
        return tuple(float(y[0]) for y in self._law_values(np.zeros((len(self.names), 1)), x)[2])

    # -- the force pass ------------------------------------------------------------------

    def _columns(self, q: Floats, states: list[State]) -> list[Row]:
        """The program at places (n,), or (n, k) of k drivers, in each of some states."""
        m, n, size = len(self.names), len(q), len(states) * len(q)
        self._count(size, True)

        def column(values: Iterable[Any]) -> Floats:
            """An input, one state after the other."""
            return np.concatenate([np.broadcast_to(x, n) for x in values])

        def of(i: int, x: Any) -> Any:
            """The values of one driver."""
            return x[..., i] if q.ndim > 1 and np.ndim(x) else x

        given = {"t": column(s.t for s in states), "load_share": column(s.share for s in states)}
        for i in range(1 if q.ndim == 1 else q.shape[1]):
            given[f"q_{i}"] = np.tile(of(i, q), len(states))
            given[f"qd_{i}"] = column(of(i, s.qd) for s in states)
            given[f"qdd_{i}"] = column(of(i, s.qdd) for s in states)
        for k in range(m):
            given[f"friction_{k}"] = column(float(s.pair == k) for s in states)
        for name in (x for x in self.program.program.inputs if x.startswith("push_")):
            given[name] = column(float(name == f"push_{s.push}") for s in states)
        for k, x in enumerate(self._initial):
            given[f"{STATE}{k}"] = column(x if s.x is None else s.x[..., k] for s in states)
        program = self.program.program
        with np.errstate(all="ignore"):
            values = self.program.batch.run({x: given[x] for x in program.inputs}, size)

        def each(x: Any) -> list[Any]:
            """A value in each state."""
            if isinstance(x, Planar):
                return list(map(Planar, each(x.real), each(x.imag)))
            return list(np.reshape(x, (len(states), n)))

        return [list(row) for row in zip(*map(each, values), strict=True)]

    def against(self, sides: Sequence[Any], law: Sequence[Any]) -> tuple[Any, Any]:
        """Signed factors (m,) and drags (m,) of pairs that slip in some directions.

        No drags where no law has any.
        """
        return signed_terms(sides, law, self.program.drags)

    def _one_by_one(self, q: Any, states: Sequence[State]) -> list[Row]:
        """The program at one place, a number or (k,), in each of some states."""
        self._count(len(states), False)
        engine = self.program.single.engine(self._compiled())
        return [engine.one(self._inputs(q, state)) for state in states]

    def _inputs(self, q: Any, state: State) -> list[float]:
        given: dict[str, Any] = {"t": state.t, "load_share": state.share}
        motion = {"q": q, "qd": state.qd, "qdd": state.qdd}
        for name, x in motion.items():
            values = enumerate(x) if isinstance(q, np.ndarray) else ((0, x),)
            given |= {f"{name}_{i}": value for i, value in values}
        signals = self._initial if state.x is None else state.x
        given |= {f"{STATE}{k}": float(x) for k, x in enumerate(signals)}
        units = f"friction_{state.pair}", f"push_{state.push}"
        return [given.get(x, float(x in units)) for x in self.program.program.inputs]
