"""What joint friction in motion is made of: two programs and a solver.

The laws of the pairs at relative rates, and the force pass at states in which loads, rates, one
acceleration, or a unit of friction in one pair act alone: together all that acts at an instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.contacts import DEPENDENT, STILL, Constraints
from blockmech.engines.binding import bind_functions
from blockmech.engines.interpreters import AdaptiveEvaluator, NumpyEngine
from blockmech.engines.llvm import SingleEvaluator
from blockmech.engines.numpy import primitives
from blockmech.friction import solvers
from blockmech.friction.continuation import Outcome
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Friction, Program
from blockmech.typing import Data, Floats, Vectors

Sides: TypeAlias = tuple[int, ...]
Times: TypeAlias = float | Floats  # [s] one, or (n,)
InnerStates: TypeAlias = Floats | None  # (..., n) of signals and laws; None: the initial ones
T = TypeVar("T", np.float64, np.complex128)


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
    compiled_form: Program  # for machine code: the first without accelerations, signals, laws
    remembers: tuple[bool, ...]  # (m,) whether a pair's law has a state of its own
    separates: tuple[bool, ...]  # (m,) whether it is a mesh that only adds to its contact
    steepest: tuple[float, ...]  # (m,) largest slopes over the load of laws that are not linear
    # in it, 0 of others; () without any
    drags: bool  # whether a law has more than a factor
    batch: NumpyEngine  # the force pass on arrays
    single: SingleEvaluator  # and at one state, a `SingleEvaluator`


class State(NamedTuple):
    """One column of inputs of the program, besides q: what is let act."""

    qd: Floats  # (k,) or (n, k)
    qdd: Floats
    share: float = 0.0  # of the applied loads
    pair: int = -1  # the one with a unit of friction; -1: none
    push: int = -1  # the stop with a unit of push; -1: none
    t: Times = 0.0
    x: InnerStates = None  # states of signal blocks


class Contact(NamedTuple):
    """What stops in contact leave free: q'' = basis z'' + shift; see `Constraints`.

    Their pushes are an affine function of z'' and of the friction of the pairs. Drivers that are
    not free stand among them.
    """

    basis: Floats  # (..., k, z)
    shift: Floats  # (..., k)
    push: Floats  # (..., a)
    of_z: Floats  # (..., a, z)
    of_t: Floats  # (..., a, m)
    carried: Floats | float = 0.0  # (..., k) rates that drivers have which are not free


class Instant(NamedTuple):
    """What loads, accelerations and friction do at a state, or at n of them (leading axis).

    From M on it is about the z freedoms that stops leave, of the k: all, where nothing lies
    against one (``contact`` None).
    """

    q: Floats  # (..., k)
    rate: Floats  # (..., k)
    M: Floats  # (..., z, z)
    push: Floats  # (..., z) efforts of the loads, less what the rates take
    S: Floats  # (..., m, z) relative rate of a pair per rate of a freedom
    b: Floats  # (..., m) relative acceleration without any of the freedoms'
    w: Floats  # (..., m) relative rate
    f: Vectors  # (..., m) loads on the pairs without accelerations of freedoms and without friction
    G: Vectors  # (..., m, z)
    R: Vectors  # (..., m, m)
    law: Floats  # (..., 2 m) factors and drags at these rates
    margin: float
    contact: Contact | None = None
    carried: Floats | float = 0.0  # (..., m) relative rates by drivers that are not free

    def against(self, constraint: Constraints, loads: Vectors, lasting: bool = True) -> Instant:
        """The same while it lies against stops, of which a unit push adds ``loads`` (..., m, a).

        ``lasting`` : pairs that stops and drives hold do not move; in an impact they may
        """
        Z, shift, back = constraint.free()
        at_shift = self.push - (self.M @ shift[..., None])[..., 0]
        push = -(back @ at_shift[..., None])[..., 0]
        of_z, of_t = back @ self.M @ Z, -back @ np.swapaxes(self.S, -1, -2)
        G, turned = self.G + loads @ back @ self.M, np.swapaxes(Z, -1, -2)
        shifted = (self.G @ shift[..., None] + loads @ push[..., None])[..., 0]
        S, b = self.S @ Z, self.b + (self.S @ shift[..., None])[..., 0]
        tied = np.abs(S).max(axis=-1, initial=0.0) <= DEPENDENT * np.abs(self.S).max(axis=-1)
        fast, moved = np.abs(self.rate).max(axis=-1), np.abs(shift)
        parts = np.abs(self.S) @ (moved + fast[..., None] ** 2)[..., None]
        still = tied & lasting & (np.abs(b) <= DEPENDENT * (np.abs(self.b) + parts[..., 0]))
        rates: Floats | float = 0.0
        carried: Floats | float = 0.0
        if constraint.speeds is not None:
            rates = (np.swapaxes(back, -1, -2) @ constraint.speeds[..., None])[..., 0]
            carried = (self.S @ rates[..., None])[..., 0]
        return self._replace(
            M=turned @ self.M @ Z,
            push=(turned @ at_shift[..., None])[..., 0],
            S=np.where(tied[..., None], 0.0, S),
            b=np.where(still, 0.0, b),
            f=self.f + shifted,
            G=G @ Z,
            R=self.R + loads @ of_t,
            contact=Contact(Z, shift, push, of_z, of_t, rates),
            carried=carried,
        )

    def part(self, which: int | NDArray[np.intp]) -> Instant:
        """That at one of n states, or those at some, where it lies against nothing."""
        return Instant._make([*(x[which] for x in self[:-3]), self.margin, None, 0.0])

    @property
    def freedoms(self) -> Floats:
        """Rates (..., z) of what is free."""
        if self.contact is None:
            return self.rate
        return (np.swapaxes(self.contact.basis, -1, -2) @ self.rate[..., None])[..., 0]

    @property
    def unheld(self) -> Floats:
        """Accelerations (z,) by the loads alone."""
        return np.asarray(np.linalg.inv(self.M) @ self.push)

    def of_drivers(self, x: Floats, shifted: bool = True) -> Floats:
        """Accelerations (..., k) of the drivers by those of what is free, or rates."""
        if self.contact is None:
            return x
        of_q = (self.contact.basis @ x[..., None])[..., 0]
        return of_q + (self.contact.shift if shifted else self.contact.carried)

    def norms(self, loads: Vectors, guides: Sequence[bool]) -> Floats:
        """Loads (..., m) as friction is of them [N]."""
        larger = np.maximum(np.abs(loads.real), np.abs(loads.imag))
        return np.asarray(np.where(guides, larger, np.abs(loads)))


class Response(NamedTuple):
    """Accelerations and friction at an instant, for some sides.

    misfit : [-] bound of what an iteration left undone, of the largest friction
    """

    at: Instant
    free: Floats  # (..., z) accelerations of what is free
    t: Floats  # (..., m)
    loads: Vectors  # (..., m)
    outcome: float | Floats = 0.0
    misfit: Times = 0.0

    @property
    def qdd(self) -> Floats:
        """Accelerations (..., k) of the drivers."""
        return self.at.of_drivers(self.free)

    @property
    def pushes(self) -> Floats:
        """What stops that it lies against give [N m or N] (..., a)."""
        if self.at.contact is None:
            return np.zeros((*self.free.shape[:-1], 0))
        push, of_z, of_t = self.at.contact[2:5]
        by_motion = of_z @ self.free[..., None] + of_t @ self.t[..., None]
        return np.asarray(push + by_motion[..., 0])

    @property
    def solved(self) -> bool:
        """Whether it satisfies the laws, of one instant."""
        code = float(self.outcome)
        return code == code and Outcome(int(code)).solved

    @property
    def locked(self) -> bool:
        """Whether no acceleration satisfies the laws, of one instant in a pose that is possible."""
        return not self.solved and self.at.margin > 0


def without_rounding(x: Floats, size: Floats | float = 0.0) -> Floats:
    """What pairs have (..., m) of rates or accelerations, 0 where that is rounding.

    A pair that never moves, as of links that turn together, has no sense, whatever rounding says.
    """
    largest = np.maximum(size, np.abs(x).max(axis=-1, keepdims=True, initial=0.0))
    return np.where(np.abs(x) <= STILL * largest, 0.0, x)


def smallest(margins: Iterable[float]) -> float:
    """The smallest of 1 and some margins; NaN if one is."""
    smallest = 1.0
    for m in margins:
        if not m >= smallest:
            if m != m:
                return math.nan
            smallest = float(m)
    return smallest


class PairFriction:
    """Friction of all pairs of a mechanism.

    ``count`` is called with evaluations (samples, whether a batch); ``compiled`` says whether
    single states are machine code's; ``rounding`` (k,) [N m or N] is what that leaves unknown of
    the efforts of the loads at a place (k,); ``initial`` are states of signal blocks and laws.
    """

    _last: tuple[Any, Any] = (None, None)

    def __init__(
        self,
        program: PairProgram,
        method: Friction,
        count: Callable[[int, bool], None],
        compiled: Callable[[], bool],
        rounding: Callable[[Floats], Floats],
        initial: tuple[float, ...] = (),
    ) -> None:
        self.program, self._count, self._compiled = program, count, compiled
        self._rounding, self._initial = rounding, initial
        self.names = program.names
        self.guides = program.guides
        self.signed = np.logical_or(program.remembers, program.separates)  # laws say the sign
        self._laws = AdaptiveEvaluator(program.laws)
        still = self._terms(np.zeros(len(self.names)))
        self._constant = None if program.laws.inputs else still
        self.static = still[2 * len(self.names) :]  # factors and drags (2 m,) that hold at rest
        solver, options = solvers.SOLVERS[method.method]
        self.options = tuple(getattr(method, name) for name in options)
        self.solver = solver
        kernels: Data = {"solve": solver, "balanced": solvers.balanced}
        bound = bind_functions(kernels, primitives(np.float64))
        # the solution for laws, at one state and at n of them
        self.balance = partial(solvers.balanced, solver, self.options)
        self.balance_all = partial(bound["balanced"], bound["solve"], self.options)

    def senses(self, slips: Floats) -> Floats:
        """Signs (..., m) of slips; 1 of a pair whose law says the sign itself."""
        return np.where(self.signed, 1.0, np.sign(slips))

    # -- the laws ------------------------------------------------------------------------

    def _terms(self, w: Floats, x: InnerStates = None, loads: Floats | None = None) -> Floats:
        """Factors and drags (..., 2 m) as of `law`, behind them those (2 m,) that hold at rest."""
        inputs, columns = self._laws.program.inputs, dict[str, Floats]()
        x = np.array(self._initial) if x is None else x
        loads = np.zeros(w.shape) if loads is None else loads
        for name, values in (("slip_", w), (STATE, x), ("load_", loads)):
            columns |= {f"{name}{j}": np.ravel(y) for j, y in enumerate(np.moveaxis(values, -1, 0))}
        n = w.size // len(self.names)
        laws = self._laws.run({name: np.resize(columns[name], n) for name in inputs}, n)
        return np.stack([np.broadcast_to(y, n) for y in laws], axis=-1).reshape(*w.shape[:-1], -1)

    def law(self, w: Floats, x: InnerStates = None, loads: Floats | None = None) -> Floats:
        """Factors and drags (..., 2 m) at relative rates (..., m).

        x (..., states) are those of signals and laws, by default the initial ones; ``loads``
        (..., m) [N] count for laws that are not linear in them, by default none.
        """
        terms = self._terms(w, x, loads) if self._constant is None else self._constant
        return np.broadcast_to(terms[..., : 2 * len(self.names)], (*w.shape[:-1], 2 * w.shape[-1]))

    # -- the force pass ------------------------------------------------------------------

    def values(self, q: Floats, states: Sequence[State]) -> Vectors:
        """Values (..., states, values) of the program at one place (k,) or at (n, k)."""
        inputs, alone = [self._inputs(q, state) for state in states], q.ndim == 1
        size = len(states) * (1 if alone else len(q))
        self._count(size, not alone)
        if alone:
            engine = self.program.single.engine(self._compiled())
            rows = [engine.one([float(x) for x in row]) for row in inputs]
            return np.array(rows, dtype=np.complex128).reshape(len(states), -1)
        columns = [
            np.concatenate([np.broadcast_to(x, len(q)) for x in column])
            for column in zip(*inputs, strict=True)
        ]
        with np.errstate(all="ignore"):
            batch = dict(zip(self.program.program.inputs, columns, strict=True))
            values = self.program.batch.run(batch, size)
        vectors = np.array([np.broadcast_to(v.real + 1j * v.imag, size) for v in values])
        return np.moveaxis(vectors.reshape(len(vectors), len(states), len(q)), -1, 0).swapaxes(1, 2)

    def _inputs(self, q: Floats, state: State) -> list[float | Floats]:
        """Those of the program in a state, numbers or (n,)."""
        values_by_name: Data = {"t": state.t, "load_share": state.share}
        x = np.array(self._initial) if state.x is None else state.x
        for name, values in (("q_", q), ("qd_", state.qd), ("qdd_", state.qdd), (STATE, x)):
            values_by_name |= {f"{name}{i}": values[..., i] for i in range(np.shape(values)[-1])}
        units = f"friction_{state.pair}", f"push_{state.push}"
        return [values_by_name.get(x, float(x in units)) for x in self.program.program.inputs]

    # -- an instant ------------------------------------------------------------

    def instant(
        self, q: Floats, qd: Floats, t: Times, x: InnerStates, constraint: Constraints | None
    ) -> Instant:
        """One state, or n; x (..., states) are those of signals and laws, None the initial ones."""
        parts = q, qd, t, x, *(() if constraint is None else (constraint.rows, constraint.drift))
        key = q.ndim, *(None if part is None else np.asarray(part).tobytes() for part in parts)
        if self._last[0] != key:
            self._last = key, self._instant(q, qd, t, x, constraint)
        instant: Instant = self._last[1]
        return instant

    def _instant(
        self, q: Floats, qd: Floats, t: Times, x: InnerStates, constraint: Constraints | None
    ) -> Instant:
        m, k = len(self.names), qd.shape[-1]
        # Columns of inputs: loads and rates, a unit of each acceleration, friction and push.
        still = State(qd=np.zeros(k), qdd=np.zeros(k))
        pairs = constraint.pairs if constraint else ()
        units = [still._replace(qdd=row) for row in np.eye(k)]
        units += [still._replace(pair=j) for j in range(len(self.names))]
        units += [still._replace(push=j) for j, _ in pairs if j >= 0]
        values = self.values(q, [State(qd=qd, qdd=np.zeros(k), share=1.0, t=t, x=x), *units])
        drives, loads = values[..., :k].real, values[..., k : k + m]
        slips, rise = (values[..., k + i * m : k + (i + 1) * m].real for i in (1, 2))
        w = without_rounding(slips[..., 0, :])
        margin = smallest(values[0, k + 3 * m :].real) if q.ndim == 1 else 1.0  # of one state

        def of(x: NDArray[T], first: int, count: int) -> NDArray[T]:
            return np.swapaxes(x[..., first : first + count, :], -1, -2)

        M, S, G, R = of(drives, 1, k), of(rise, 1, k), of(loads, 1, k), of(loads, 1 + k, m)
        largest = np.abs(S).max(axis=(-1, -2), initial=0.0)
        S = without_rounding(S, largest[..., None, None])
        push, f = -drives[..., 0, :], loads[..., 0, :]
        b = without_rounding(rise[..., 0, :], (largest * np.abs(qd).max(axis=-1) ** 2)[..., None])
        at = Instant(q, qd, M, push, S, b, w, f, G, R, self.law(w, x), margin)
        if constraint is None:
            return at
        return at.against(constraint, _pressed(constraint, of(loads, 1 + k + m, values.shape[-2])))

    def pressed(self, q: Floats, constraint: Constraints) -> Vectors:
        """What a unit push of each stop adds to the loads (m, a) on the pairs."""
        k, m = len(q), len(self.names)
        still = State(qd=np.zeros(k), qdd=np.zeros(k))
        units = [still, *(still._replace(push=j) for j, _ in constraint.pairs if j >= 0)]
        return _pressed(constraint, self.values(q, units)[1:, k : k + m].T)

    def rates(self, q: Floats, qd: Floats) -> Floats:
        """Relative rates (..., m) of the pairs."""
        k, m = q.shape[-1], len(self.names)
        slips = self.values(q, [State(qd, 0.0 * qd)])[..., 0, k + m : k + 2 * m].real
        return without_rounding(slips)

    def slipping(self, q: Floats, qd: Floats) -> Sides:
        """Senses in which pairs slip at a state."""
        return tuple(int(s) for s in self.senses(self.rates(q, qd)))


def _pressed(constraint: Constraints, loads: Vectors) -> Vectors:
    """Loads (..., m, a) on the pairs by unit pushes: those (..., m, p) of the stops of pairs."""
    of_pairs = [j >= 0 for j, _ in constraint.pairs]
    pressed = np.zeros((*loads.shape[:-1], len(of_pairs)), dtype=np.complex128)
    pressed[..., of_pairs] = loads * [sense for j, sense in constraint.pairs if j >= 0]
    return pressed
