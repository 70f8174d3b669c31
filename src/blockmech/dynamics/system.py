r"""The system: all that dynamics knows of a mechanism.

The reduction pass turns a scene into inertia and effort on the drivers' coordinates q,

    J(q) q'' + J'(q) q'^2 / 2 = tau(q, q', t)          one driver
    M(q) q'' + c(q, q') = Q(q, q', t)                  several

and, where joints have friction, `friction` adds what the pairs resist with. Impossible poses
are NaN or have a margin that is not positive; nothing here raises on a pose.

Units: q [rad] or [m], J [kg m2] or [kg], tau [N m] or [N].

Sources: [D14] Durango et al. 2014, Eqs. 1-6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from blockmech.dynamics import ends, loads
from blockmech.dynamics.contacts import Constraints, constrained
from blockmech.dynamics.friction import smallest
from blockmech.dynamics.pair_stops import Counted, PairStops
from blockmech.dynamics.programs import (
    NO_SIGNALS,
    Sample,
    ScalarTerms,
    SignalProgram,
    Terms,
    equation,
    equation_with_deflections,
    load_inputs,
    load_sizes,
    pair_program,
    program_with_deflections,
    reduced,
    signal_program,
)
from blockmech.dynamics.roles import Roles
from blockmech.dynamics.source import Source, by_name
from blockmech.dynamics.sticking import JointFriction
from blockmech.engines.cost import Routes, account
from blockmech.engines.interpreters import AdaptiveEvaluator, ScalarEngine
from blockmech.engines.llvm import LlvmEngine, SingleEvaluator
from blockmech.ground.plane import EPS
from blockmech.model.structure import JointRef
from blockmech.plan.plan import Friction, Program
from blockmech.result.motion import Cost
from blockmech.typing import Floats, Real

if TYPE_CHECKING:
    from blockmech.engines.compiled_rates import CompiledStepper
    from blockmech.typing import Progress

T = TypeVar("T")
REPORTED = 256  # evaluations between two words of progress: some milliseconds of work


def run_cache(compiled: Source) -> dict[Hashable, Any]:
    """What methods keep of a mechanism from one run to the next."""
    return {}


@dataclass
class System:
    """A mechanism as dynamics sees it; one per run, because it counts its evaluations.

    Attributes
    ----------
    stops : (low, high) end stops of each driver, infinite where there is none; with several
        drivers then those of pairs
    counted : coordinates of the pairs that have end stops along the motion, with several drivers
    method : how joint friction is solved; None where it is left out or there is none
    engine : of single states: "scalar", "llvm" (machine code), or "auto": machine code once
        the mechanism was asked for so many, in all its runs, that compiling pays
    contacts : place among ``stops`` of one that it lies against -> +1 the highest, -1 the lowest
    roles : of the drivers at an instant, None where all are free at all times
    begin : states from which signal blocks and friction laws go on; empty: their own
    """

    compiled: Source
    stops: tuple[tuple[float, float], ...] = ()
    method: Friction | None = None
    progress: Progress | None = None
    engine: str = "auto"
    signals: SignalProgram = field(init=False, default=NO_SIGNALS)
    contacts: Mapping[int, int] = field(default_factory=dict)
    counted: Counted | None = None
    roles: Roles | None = None
    begin: tuple[float, ...] = ()
    budget: ends.Budget = field(default_factory=ends.Budget)
    samples: int = 0
    calls: int = 0
    singles: int = 0
    states: int = 0  # of integrations, from whatever they are
    steppers: dict[Any, CompiledStepper] = field(default_factory=dict)  # see `Equation.code`

    def __post_init__(self) -> None:
        if not self.stops:
            self.stops = ((-math.inf, math.inf),) * len(self.drivers)
        if self.remembers:
            self.signals = self.compiled._once(program_with_deflections)
        elif self.compiled.structure.signals:
            self.signals = self.compiled._once(signal_program)
        if self.begin:
            self.signals = self.signals._replace(initial=self.begin)

    # -- what it is ------------------------------------------------------------

    @property
    def drivers(self) -> tuple[str, ...]:
        """Drivers in formation order."""
        return self.compiled.structure.drivers

    @cached_property
    def rotary(self) -> tuple[bool, ...]:
        """Whether each driver's coordinate is an angle."""
        return tuple(self.compiled.structure.driver_joint(d).rotary for d in self.drivers)

    @cached_property
    def remembers(self) -> bool:
        """Whether joints have friction whose law has a state of its own."""
        rubs = self.method is not None and self.method.method != "none"
        return rubs and bool(self.compiled.structure.remembering)

    @cached_property
    def depends_on(self) -> frozenset[str]:
        """What loads and friction depend on, of {"q", "rate", "time", "state"}."""
        variables = self._of_loads(loads.depends_on)
        if self.signals.initial:  # also of signals that no load follows: only time moves them
            variables |= {"state"}
        if not self.compiled.structure.signal_wires:
            return variables
        of = {"qd": "rate", "t": "time", "x": "state"}
        inputs = {name.partition("_")[0] for name in self.compiled._once(load_inputs)}
        return variables | {variable for name, variable in of.items() if name in inputs}

    @property
    def scalar(self) -> bool:
        """Whether states are numbers: of one driver that is free at all times."""
        return len(self.drivers) == 1 and self.roles is None

    @cached_property
    def period(self) -> float | None:
        """Period [rad] of everything that depends on the only driver's coordinate."""
        return self._of_loads(loads.period_of, self.drivers[0])

    def _of_loads(self, rule: Callable[..., T], *of: str) -> T:
        """What a rule says of the structure, asked once for all runs."""
        return self.keep((rule, *of), lambda: rule(self.compiled.structure, *of))

    def keep(self, key: Hashable, make: Callable[[], T]) -> T:
        """What is made of the mechanism once, for all its runs."""
        if key not in self.cache:
            self.cache[key] = make()
        value: T = self.cache[key]
        return value

    @property
    def knots(self) -> tuple[float, ...]:
        """Kinks of loads [rad or m]: of one period from 0, or within reach."""
        return self.compiled._once(loads.knots)

    @cached_property
    def span(self) -> float:
        """A length [rad or m] over which things change."""
        return math.tau if self.rotary[0] else loads.largest_length(self.compiled.structure)

    @property
    def spans(self) -> list[float]:
        """Those of the coordinates of all drivers."""
        length = loads.largest_length
        rest = (math.tau if t else length(self.compiled.structure) for t in self.rotary[1:])
        return [self.span, *rest]

    @cached_property
    def lossless(self) -> bool:
        """Whether the loads have a potential with the period, and no joint has friction."""
        free = self.friction is None and self.period is not None
        return free and self._of_loads(loads.lossless)

    @cached_property
    def smooth(self) -> bool:
        """Whether the accelerations are smooth within a step."""
        return self.friction is None and self._of_loads(loads.smooth)

    @property
    def noise(self) -> float:
        """Relative error of inertia and effort beyond rounding."""
        return 0.0

    @property
    def equation_program(self) -> Program:
        """The program of the equation of motion at one state."""
        return self._equation.program

    @property
    def _equation(self) -> SingleEvaluator:
        return self.compiled._once(equation_with_deflections if self.remembers else equation)

    @property
    def cache(self) -> dict[Hashable, Any]:
        """What methods keep of the mechanism from one run to the next."""
        return self.compiled._once(run_cache)

    def rounding(self, q: float | Floats) -> Real:
        """That of `roundings` of the only driver: a number, or (n,) at n places."""
        unknown = self.roundings(np.atleast_1d(q)[:, None])[:, 0]
        return unknown if np.ndim(q) else float(unknown[0])

    def roundings(self, q: Floats) -> Floats:
        """What rounding leaves unknown of the efforts of the loads on all drivers [N m or N].

        (..., k) at places (..., k), at rest: each is a sum of some ten efforts.
        """

        def sizes() -> Floats:
            evaluator, coordinates = self.compiled._once(load_sizes), np.atleast_2d(q)
            by_name = {f"q_{i}": x for i, x in enumerate(coordinates.T)}
            still = np.zeros(len(coordinates))
            inputs = {name: by_name.get(name, still) for name in evaluator.program.inputs}
            return np.transpose(evaluator.run(inputs, len(coordinates)))

        return 8 * EPS * self._once("roundings", q.tobytes(), sizes).reshape(q.shape)

    @cached_property
    def friction(self) -> JointFriction | None:
        """Joint friction in motion; None where there is none or it is left out."""
        return self.friction_of(self.pairs.refs)

    def friction_of(self, pushed: tuple[JointRef, ...] = ()) -> JointFriction | None:
        """The same, with stops of pairs that may push."""
        if self.method is None or self.method.method == "none":
            return None
        program = self.keep((pair_program, pushed), lambda: pair_program(self.compiled, pushed))
        if program is None:
            return None
        states = lambda: self.compiled_states  # noqa: E731
        initial = self.signals.initial
        return JointFriction(program, self.method, self._count, states, self.roundings, initial)

    # -- end stops -------------------------------------------------------------

    @property
    def pairs(self) -> PairStops:
        """The pairs that have some, with several drivers."""
        return self.counted.pairs if self.counted else PairStops(self.compiled)

    @cached_property
    def stopped(self) -> tuple[str, ...]:
        """Names of what `stops` are of: the drivers, then coordinates of pairs."""
        return (*self.drivers, *self.pairs.names)

    def end_at(self, i: int) -> str:
        """What a motion ends by that meets a stop of one of these."""
        return ends.END_STOP if len(self.drivers) == 1 else f"{ends.END_STOP} of {self.stopped[i]}"

    def rows(self, q: Real, rate: Real) -> tuple[Floats, Floats]:
        """Rows (n, k) of all that has stops over the drivers, and drifts (n,): see `pair_stops`."""
        return self.pairs.rows(q, rate)

    def against(self, q: Real, rate: Real, t: float, lead: float = 0.0) -> Constraints | None:
        """The stops that it lies against at a state, then drivers that are not free.

        None where there is none of both. ``lead`` as of `Roles.constraint`.
        """
        stops = self.pairs.constraints(q, rate, sorted(self.contacts)) if self.contacts else None
        return stops if self.roles is None else self.roles.extend(stops, t, lead)

    def response(
        self, q: Real, rate: Real, t: float, x: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Accelerations (k,) where a motion begins; what the stops give (a,) that it lies against.

        Behind them what the drives give of drivers that are not free; x are states of signal
        blocks and friction laws.
        """
        q, rate = np.atleast_1d(q), np.atleast_1d(rate)
        if self.friction is not None:
            return self.friction.from_state(q, rate, t, self.against(q, rate, t), x)[1:]
        terms = self.terms(q, rate, t, x)
        return self.accelerations(terms.M, terms.Q - terms.c, q, rate, t)

    def coordinates(self, q: Real) -> Floats:
        """Coordinates (n,) of all that has stops."""
        of_drivers = np.atleast_1d(np.asarray(q, dtype=np.float64))
        if self.counted is None:
            return of_drivers
        return np.append(of_drivers, self.counted.at(of_drivers))

    def at_stop(self, i: int, coordinate: float) -> int:
        """Which end stop a coordinate is at: +1 the highest, -1 the lowest, 0 none."""
        for side, stop in zip((-1, 1), self.stops[i], strict=True):
            if math.isfinite(stop) and abs(coordinate - stop) <= loads.SAME * max(1.0, abs(stop)):
                return side
        return 0

    def pair_name(self, j: int) -> str:
        """A pair with friction by its number, in the words of the document."""
        assert self.friction is not None
        name = self.friction.names[j]
        return self.compiled._joint_names.get(name, name)

    @property
    def cost(self) -> Cost:
        """Evaluations so far."""
        return Cost(self.samples, self.calls, self.singles, self.states)

    # -- states ------------------------------------------------------------

    def sample(self, q: Floats, qd: Real = 0.0, t: float = 0.0) -> Sample:
        """J, tau and margin of one driver at states of any shape."""
        J, tau, size, *margins = self._batch(self.compiled._once(reduced), q, qd, t)
        margin = np.minimum.reduce([np.ones(q.size), *margins])
        return Sample(*(np.asarray(x).reshape(q.shape) for x in (J, tau, margin, size)))

    def at(self, q: float, qd: float = 0.0, t: float = 0.0) -> Sample:
        """The same (1,) of a single state; the start of a run is asked for by whoever sees it."""
        state = float(q), float(qd), float(t), self.signals.initial
        return self._once("state", state, lambda: self.sample(np.array(state[:1]), qd, t))

    def _batch(self, engine: AdaptiveEvaluator, q: Floats, qd: Real = 0.0, t: float = 0.0) -> Any:
        """Values (n,) of a program at states of one driver, flat."""
        self._count(q.size, True)
        rates = np.broadcast_to(np.asarray(qd, dtype=np.float64), q.shape).ravel()
        inputs = {"q_0": q.ravel(), "qd_0": rates, "qdd_0": 0.0 * rates, "t": np.full(q.size, t)}
        inputs |= by_name(x=[np.full(q.size, x) for x in self.signals.initial])
        with np.errstate(all="ignore"):
            return engine.run({n: inputs[n] for n in engine.program.inputs}, q.size)

    def scalar_terms(
        self,
        q: float,
        qd: float = 0.0,
        t: float = 0.0,
        x: Floats | None = None,
        qdd: float | None = None,
    ) -> ScalarTerms:
        """One state of one driver, x the states of signal blocks, by default the initial ones.

        Where signals follow the acceleration, and it is not given, the program is asked once more
        with that of the loads.
        """
        inputs = {"q_0": q, "qd_0": qd, "qdd_0": 0.0 if qdd is None else qdd, "t": t}
        values = self._single(inputs, x)
        J, tau, dJ = values[:3]
        n = 3 + self.signals.values
        if qdd is None and self.follows_acceleration:
            inputs["qdd_0"] = (tau - 0.5 * dJ * qd * qd) / J if J > 0 else math.nan
            values = self._single(inputs, x)
        return ScalarTerms(J, tau, dJ, smallest(values[n:]), values[3:n])

    @cached_property
    def follows_acceleration(self) -> bool:
        """Whether what signals make of a state follows the acceleration of a driver."""
        inputs = self.equation_program.inputs
        return self.signals.values > 0 and any(name.startswith("qdd_") for name in inputs)

    def terms(self, q: Real, qd: Real, t: float = 0.0, x: Any = None, qdd: Real = None) -> Terms:
        """The equation of motion at one state, the rest as of `scalar_terms`.

        Coordinates, rates and accelerations are numbers of one driver, else arrays (k,).
        """
        k = len(self.drivers)
        if k == 1:
            q, qd = float(np.ravel(q)[0]), float(np.ravel(qd)[0])
            rise = None if qdd is None else float(np.ravel(qdd)[0])
            J, tau, dJ, margin, signal_values = self.scalar_terms(q, qd, t, x, rise)
            bias = np.array([0.5 * dJ * qd * qd])
            return Terms(np.array([[J]]), bias, np.array([tau]), margin, signal_values)
        rises = [0.0] * k if qdd is None else qdd.tolist()
        inputs = by_name(q.tolist(), qd.tolist(), rises) | {"t": t}
        values = self._single(inputs, x)
        M = np.array(values[: k * k]).reshape(k, k)
        Q, c = np.array(values[k * k : k * k + k]), np.array(values[k * k + k : k * k + 2 * k])
        first = k * k + 2 * k
        last = first + self.signals.values
        if qdd is None and self.follows_acceleration:
            qdd, _ = self.accelerations(M, Q - c, q, qd, t)
            values = self._single(inputs | by_name(qdd=qdd.tolist()), x)
        return Terms(M, c, Q, smallest(values[last:]), values[first:last])

    def accelerations(
        self, M: Floats, Q: Floats, q: Real, rate: Real, t: float
    ) -> tuple[Floats, Floats]:
        """Accelerations (k,) by efforts, and what stops and drives give (a,), see `response`."""
        return constrained(M, Q, self.against(q, rate, t))

    def typical_inertia(self, q: float) -> float:
        """Usual inertia at a few poses around a place [kg m2 or kg]; it may have no bound."""

        def usual() -> float:
            J = self.sample(q + self.span * np.linspace(0.0, 1.0, 8, endpoint=False)).J
            good = J[np.isfinite(J) & (J > 0)]
            return float(np.median(good)) if good.size else 1.0

        return self._once("typical", q, usual)

    def _once(self, quantity: str, at: Hashable, make: Callable[[], T]) -> T:
        """What is asked of a place or a state; of many runs that start there the first asks."""
        cached: tuple[Any, Any] = self.cache.get((quantity, type(self)), (None, None))
        if cached[0] != at:
            cached = self.cache[quantity, type(self)] = at, make()
        value: T = cached[1]
        return value

    def inertia_rounding(self, q: float) -> float:
        """How many times the rounding of the inertia of the only driver at a place is its own.

        It is a sum of squares of rates, which are rounded like those of a usual place.
        """
        J = float(self.at(q).J[0])
        return max(1.0, math.sqrt(self.typical_inertia(q) / J)) if J > 0 else 1.0

    def push_rounding(self, q: float, t: float) -> float:
        """Relative rounding of the effort by which the only driver starts from rest."""
        if self.friction is not None:
            x = np.array(self.signals.initial) if self.signals.initial else None
            holding = self.friction.holding(np.array([q]), t, x)
            start = max(float(holding.low[0]), -float(holding.high[0]))
            return float(holding.rounding[0]) / start if start > holding.rounding[0] else 0.0
        tau = abs(float(self.at(q, 0.0, t).tau[0]))
        return self.rounding(q) / tau if tau > 0 else 0.0

    def _single(
        self, inputs: Mapping[str, float], x: Sequence[float] | Floats | None = None
    ) -> tuple[float, ...]:
        """Values of the program of the equation of motion at one state."""
        self._count(1, False)
        if self.signals.initial:
            inputs = {**inputs, **by_name(x=self.signals.initial if x is None else x)}
        return self.engine_of_states.one([inputs[name] for name in self.equation_program.inputs])

    @property
    def engine_of_states(self) -> ScalarEngine | LlvmEngine:
        """What says the equation of motion at single states."""
        return self._equation.engine(self.compiled_states)

    @property
    def compiled_states(self) -> bool:
        """Whether machine code is asked for single states, where there can be some."""
        if self.engine != "auto":
            return self.engine == "llvm"
        program, before = self.equation_program, self.cache.get("states", 0)
        return account(program).states_pay(program, before + self.singles + self.states)

    def routes(self, motion: Any) -> Routes:
        """What a motion has cost so far, by one route and another, where the last was the same."""
        return self._once("routes", motion, Routes)

    @property
    def quick_states(self) -> bool:
        """Whether machine code says single states, once many of them are asked for."""
        plain = type(self).scalar_terms is System.scalar_terms  # no series
        return plain and self.scalar and self.engine != "scalar"

    def idle_steppers(self, method: Any) -> list[CompiledStepper]:
        """Those of a method that runs of the mechanism have left behind."""
        idle: list[CompiledStepper] = self.cache.setdefault(("steppers", self.method, method), [])
        return idle

    def remember(self) -> None:
        """Count the states of this run among the mechanism's, and leave to others what it made."""
        for (*_, method), stepper in self.steppers.items():
            self.idle_steppers(method).append(stepper)
        self.steppers.clear()
        self.cache["states"] = self.cache.get("states", 0) + self.singles + self.states

    def _count(self, samples: int, batch: bool) -> None:
        before = self.samples + self.singles
        if batch:
            self.samples += samples
            self.calls += 1
        else:
            self.singles += samples
        after = self.samples + self.singles
        if before // REPORTED == after // REPORTED:
            return
        self.budget.check()
        if self.progress is not None:
            self.progress("computing", float(after), None)
