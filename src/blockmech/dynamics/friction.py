"""What joint friction in motion is made of: two programs and a solver.

The laws of the pairs at relative rates, and the force pass at states in which loads, rates, one
acceleration, or a unit of friction in one pair act alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.binding import bind_functions
from blockmech.engines.llvm import SingleEvaluator
from blockmech.engines.numpy import NumpyEngine, Planar, primitives
from blockmech.engines.scalar import AdaptiveEvaluator
from blockmech.friction import solvers
from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.model.structure import JointRef
from blockmech.passes import forces, forward, friction, pairs, signals
from blockmech.passes.homotopy import schedule
from blockmech.passes.signals import STATE
from blockmech.plan import Friction, Program, Schedule

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
    laws: Program  # factors and drags (2 m,) at relative rates; that hold at rest
    whole: Program  # for machine code: the first without accelerations, signals, laws
    remembers: tuple[bool, ...]  # (m,) whether a pair's law has a state of its own
    separates: tuple[bool, ...]  # (m,) whether it is a mesh that only adds to its contact
    steepest: tuple[float, ...]  # (m,) largest slopes over the load of laws that are not linear
    # in it, 0 of others; () without any
    drags: bool  # whether a law has more than a factor
    batch: NumpyEngine  # the force pass on arrays
    single: SingleEvaluator  # and at one state


GIVEN = Friction(friction.GIVEN)


def pair_program(compiled: Any, pushed: tuple[JointRef, ...] = ()) -> PairProgram | None:
    """The force pass of a mechanism with its friction laws; None where none can act.

    ``pushed`` : pairs along whose coordinates stops may push
    """
    structure = compiled.structure
    how = replace(GIVEN, pushed=pushed)  # a push loads pairs that nothing else does
    s = schedule(structure, compiled.scene, how)
    joints = s.ask(friction.given_joints)
    if not joints:
        return None
    values = [s.ask(forces.drive, driver) for driver in structure.drivers]
    for ref in joints:
        pair = s.ask(forces.reaction, ref)
        assert pair is not None  # such a block is active
        values.append(pairs.statics(s, ref).measure(s, ref, pair))
    values += [s.ask(forward.slip, ref) for ref in joints]
    rise = [s.ask(forward.slip_acceleration, ref) for ref in joints]
    program = s.program([*values, *rise, *margins(s)])
    apart = schedule(structure, compiled.scene, how)
    rules = friction.terms, friction.terms_at_rest
    law_terms = [x for rule in rules for x in terms(apart, joints, rule)]
    laws = [structure.friction_law(ref) for ref in joints]
    more = [*signals.rates(s), *friction.deflection_rates(s), *signals.kinks(s)]
    return PairProgram(
        tuple(map(structure.pair_name, joints)),
        tuple(pairs.statics(s, ref).edges for ref in joints),
        program,
        apart.program(law_terms),
        s.program([*values, *margins(s), *more, *terms(s, joints, friction.terms)]),
        tuple(law.remembers for law in laws),
        tuple(map(structure.separates, joints)),
        steepest(laws),
        any(law.drags for law in laws),
        NumpyEngine(program),
        SingleEvaluator(program),
    )


def steepest(laws: Sequence[FrictionLaw]) -> tuple[float, ...]:
    """Largest slopes of friction over the load where a law is not linear in it; 0 of the others."""
    if not any(law.reads_load for law in laws):
        return ()
    return tuple(float(law.parameters().steepest) if law.reads_load else 0.0 for law in laws)


def terms(s: Schedule, joints: Sequence[JointRef], rule: Callable[..., str]) -> list[str]:
    """Factors (m,) and drags (m,) of pairs by a rule that asks their laws."""
    laws = [s.ask(rule, ref) for ref in joints]
    return [f"{law}.{part}" for part in FrictionTerms._fields for law in laws]


def margins(s: Schedule) -> list[str]:
    """Margins of the groups whose poses the schedule needs."""
    blocks = [e.block for e in s.entries if e.stage == "position"]
    return [s.ask(forward.margin, b) for b in blocks if s.structure.blocks[b].closes]


class State(NamedTuple):
    """One column of inputs of the program, besides q: what is let act."""

    qd: Any = 0.0  # (k,) or (n, k)
    qdd: Any = 0.0
    share: float = 0.0  # of the applied loads
    pair: int = -1  # the one with a unit of friction; -1: none
    push: int = -1  # the stop with a unit of push; -1: none
    t: Any = 0.0
    x: Any = None  # states of signal blocks; None: the initial ones


class FrictionState(NamedTuple):
    """One state: the acceleration, and what the pairs do.

    qdd : (k,)
    power : [W] that friction takes, less what laws with a state store
    loads : (m,) on the pairs
    locked : whether no acceleration satisfies the laws, in a pose that is possible
    misfit : [-] bound of what an iteration left undone, of the largest friction
    pushes : (a,) [N m or N] of the stops that it lies against
    """

    qdd: Floats
    power: float
    loads: Vectors
    locked: bool
    misfit: float = 0.0
    pushes: Any = ()


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
    """Signed factors and drags (m,) of pairs that slip in some directions; no drags of none."""
    against = [-side * x for side, x in zip((*sides, *sides), law, strict=True)]
    return tuple(against[: len(sides)]), tuple(against[len(sides) :]) if drags else ()


class PairFriction:
    """Friction of all pairs of a mechanism.

    ``count`` is called with evaluations (samples, whether a batch); ``compiled`` says whether
    single states are machine code's; ``rounding`` (k,) [N m or N] is what that leaves unknown of
    the efforts of the loads at a place (k,); ``initial`` are states of signal blocks and laws.
    """

    def __init__(
        self,
        program: PairProgram,
        method: Friction,
        count: Callable[[int, bool], None],
        compiled: Callable[[], bool],
        rounding: Callable[[Floats], Any],
        initial: tuple[float, ...] = (),
    ) -> None:
        self.program, self._count, self._compiled = program, count, compiled
        self._rounding, self._initial = rounding, initial
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
        kernels: Any = {"solve": solver, "balanced": solvers.balanced}
        bound = bind_functions(kernels, primitives(np.float64))
        # the solution for laws, at one state and at n of them
        self.balance = partial(solvers.balanced, solver, self.options)
        self.balance_all = partial(bound["balanced"], bound["solve"], self.options)

    def senses(self, slips: Any) -> Floats:
        """Signs (..., m) of slips; 1 of a pair whose law says the sign itself."""
        return np.where(self.signed, 1.0, np.sign(slips))

    # -- the laws ------------------------------------------------------------------------

    def _law_values(self, rates: Floats, x: Any = None, loads: Any = None) -> list[Row]:
        """Factors and drags (2 m,) of arrays (n,) at relative rates (m, n), and at rest.

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
        terms = [values[:m], values[m:]]
        if not inputs:
            self._constant[n] = terms
        return terms

    def law(self, rates: Floats, x: Any = None, loads: Any = None) -> Row:
        """Factors and drags (2 m,) of arrays (n,) at relative rates, states and loads."""
        return self._law_values(rates, x, loads)[0]

    # -- the force pass ------------------------------------------------------------------

    def _columns(self, q: Floats, states: list[State]) -> list[Row]:
        """The program at places (n, k), in each of some states."""
        m, (n, k), size = len(self.names), q.shape, len(states) * len(q)
        self._count(size, True)

        def column(values: Iterable[Any]) -> Floats:
            """An input, one state after the other."""
            return np.concatenate([np.broadcast_to(x, n) for x in values])

        def of(i: int, x: Any) -> Any:
            """The values of one driver."""
            return x[..., i] if np.ndim(x) else x

        given = {"t": column(s.t for s in states), "load_share": column(s.share for s in states)}
        for i in range(k):
            given[f"q_{i}"] = np.tile(q[:, i], len(states))
            given[f"qd_{i}"] = column(of(i, s.qd) for s in states)
            given[f"qdd_{i}"] = column(of(i, s.qdd) for s in states)
        for j in range(m):
            given[f"friction_{j}"] = column(float(s.pair == j) for s in states)
        for name in (x for x in self.program.program.inputs if x.startswith("push_")):
            given[name] = column(float(name == f"push_{s.push}") for s in states)
        for j, x in enumerate(self._initial):
            given[f"{STATE}{j}"] = column(x if s.x is None else s.x[..., j] for s in states)
        program = self.program.program
        with np.errstate(all="ignore"):
            values = self.program.batch.run({x: given[x] for x in program.inputs}, size)

        def each(x: Any) -> list[Any]:
            """A value in each state."""
            if isinstance(x, Planar):
                return list(map(Planar, each(x.real), each(x.imag)))
            return list(np.reshape(x, (len(states), n)))

        return [list(row) for row in zip(*map(each, values), strict=True)]

    def _one_by_one(self, q: Floats, states: Sequence[State]) -> list[Row]:
        """The program at one place (k,), in each of some states."""
        self._count(len(states), False)
        engine = self.program.single.engine(self._compiled())
        return [list(engine.one(self._inputs(q, state))) for state in states]

    def _inputs(self, q: Floats, state: State) -> list[float]:
        given: dict[str, Any] = {"t": state.t, "load_share": state.share}
        motion = {"q": q, "qd": state.qd, "qdd": state.qdd}
        for name, x in motion.items():
            given |= {f"{name}_{i}": value for i, value in enumerate(x)}
        signals = self._initial if state.x is None else state.x
        given |= {f"{STATE}{k}": float(x) for k, x in enumerate(signals)}
        units = f"friction_{state.pair}", f"push_{state.push}"
        return [given.get(x, float(x in units)) for x in self.program.program.inputs]
