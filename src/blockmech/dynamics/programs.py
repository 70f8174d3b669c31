"""Programs of the equation of motion, and what they yield.

One driver at many states, all drivers at one state, and the sizes of their loads: each is what
passes leave of a structure in its scene where nothing else is asked for, without joint friction.
Behind them stands what signal blocks, and friction laws with a state, add.

The effort that the drivers need for a motion,

    u(q, q', q'', t) = M q'' + c - Q,

is one program of the reduction pass, without joint friction. Run on dual numbers it gives at once

    M = du/dq''      C = du/dq'      K = du/dq

exact to rounding, whatever loads act: an equilibrium is u = 0 at rest, and a small disturbance
of it obeys M x'' + C x' + K x = 0. Laws that are a user's function of Python have their
derivatives by differences.

Sources: Shabana, Dynamics of Multibody Systems, 4th ed., ch. 3 (linearised equations);
`blockmech.engines.derivatives`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blockmech.dynamics.friction import PairProgram
from blockmech.dynamics.source import FRICTIONLESS, Source, margins
from blockmech.engines.derivatives import WITH_DIFFERENCES, Dual, DualEngine, value
from blockmech.engines.interpreters import AdaptiveEvaluator, NumpyEngine
from blockmech.engines.llvm import SingleEvaluator
from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.ground.errors import refused
from blockmech.model.structure import JointRef
from blockmech.passes import forces, forward, friction, pairs, reduction, signals
from blockmech.passes.forward import link_velocity, marker_velocity
from blockmech.passes.homotopy import schedule
from blockmech.passes.loads import cm_velocity, terminal_term, weight_on
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import Value, hyp
from blockmech.signals.contract import Signal
from blockmech.typing import Arguments, Floats


class Sample(NamedTuple):
    """What a batch of states of one driver yields; arrays (n,)."""

    J: Floats  # [kg m2 or kg]
    tau: Floats  # [N m or N] all loads at (q, q', t)
    margin: Floats  # [-]
    size: Floats | None = None  # [N m or N] see `load_size`, where tau is made of loads

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Where the mechanism closes and everything is a number."""
        return np.asarray((self.margin > 0) & np.isfinite(self.J) & np.isfinite(self.tau))


class ScalarTerms(NamedTuple):
    """What one state of one driver yields; floats."""

    J: float
    tau: float
    dJ: float  # dJ/dq
    margin: float
    signals: Sequence[float] = ()  # what signal blocks make of it, see `SignalProgram`


class Terms(NamedTuple):
    """Equation of motion M q'' + c = Q of k drivers at one state."""

    M: Floats  # (k, k)
    c: Floats  # (k,)
    Q: Floats  # (k,)
    margin: float
    signals: Sequence[float] = ()


def reduced(compiled: Source) -> AdaptiveEvaluator:
    """J, tau, the load's size, then the margins, of one driver; no acceleration is computed."""
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    (driver,) = compiled.structure.drivers
    values = [s.ask(reduction.inertia, driver, driver), s.ask(reduction.reduced_load, driver)]
    return AdaptiveEvaluator(s.program([*values, load_size(s, driver), *margins(s)]))


def load_sizes(compiled: Source) -> AdaptiveEvaluator:
    """The sizes of the loads on all drivers."""
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    sizes = [load_size(s, driver) for driver in compiled.structure.drivers]
    return AdaptiveEvaluator(s.program(sizes))


def equation(compiled: Source, deflections: bool = False) -> SingleEvaluator:
    """M, Q, c (one driver: dJ/dq), what signals add, then the margins, at one state.

    With ``deflections`` the rates of the states of friction laws stand behind those of signals.
    """
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    drivers = compiled.structure.drivers
    M = [s.ask(reduction.inertia, k, m) for k in drivers for m in drivers]
    Q = [s.ask(reduction.reduced_load, k) for k in drivers]
    rule = reduction.inertia_slope if len(drivers) == 1 else reduction.bias
    c = [s.ask(rule, k) for k in drivers]
    signal_rates = [*signals.rates(s), *(friction.deflection_rates(s) if deflections else ())]
    signal_rates += signals.kinks(s)
    return SingleEvaluator(s.program([*M, *Q, *c, *signal_rates, *margins(s)]))


equation_with_deflections = partial(equation, deflections=True)


def load_inputs(compiled: Source) -> tuple[str, ...]:
    """What the loads reduced to the drivers are made of: inputs of a program that gives them."""
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    loads = [s.ask(reduction.reduced_load, k) for k in compiled.structure.drivers]
    return s.program(loads).inputs


def load_size(s: Schedule, driver: str) -> Value:
    """The sum of the magnitudes of the contributions to the effort on a driver."""
    structure, terms = s.structure, list[Value]()
    for link in structure.links:
        for force in s.ask(weight_on, link).forces if link != structure.frame_link else ():
            size_of = hyp(force) * hyp(s.ask(cm_velocity, link, driver))
            terms.append(s.line(size_of, f"{link}_size"))
    for name, element in structure.elements.items():
        for terminal, declared in element.terminals.items():
            ref = JointRef(name, terminal)
            marker, term = structure.holds[ref], s.ask(terminal_term, ref)
            if declared.kind == "point":
                size_of = hyp(term) * hyp(s.ask(marker_velocity, marker, driver))
            else:
                size_of = abs(term * s.ask(link_velocity, marker.on, driver).scalar)
            terms.append(s.line(size_of, f"{ref}_size"))
    return s.sum(terms, "size")


# -- signals --------------------------------------------------------------------------------


class SignalProgram(NamedTuple):
    """What signal blocks, and friction laws with a state, add to the programs of a system.

    The rates of all states stand in the program of the equation of motion, then the values of
    which a change of sign is a kink.

    Attributes
    ----------
    blocks : the signal blocks
    initial : states where a motion starts
    sizes : of states: 1, of friction laws the deflection in steady slip
    kinks : number of those values
    update : states that discrete blocks switch to at an instant; None without any
    updated : block and place of the state of each of its values
    """

    blocks: Mapping[str, Signal] = {}
    initial: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    kinks: int = 0
    update: SingleEvaluator | None = None
    updated: tuple[tuple[str, int], ...] = ()

    @property
    def values(self) -> int:
        """How many values they add."""
        return len(self.initial) + self.kinks

    def next_time(self, t: float) -> float:
        """The first instant of a discrete block, or kink in time, after a time [s]."""
        times = [x for b in self.blocks.values() for x in (b.next_kink(t), b.instant(t, True))]
        return min(times, default=math.inf)


NO_SIGNALS = SignalProgram()


def felt(compiled: Source) -> tuple[str, ...]:
    """Addresses of sensors that follow the friction of joints at once, as reactions do."""
    addresses, structure = [], compiled.structure
    for address, rule in structure.sensors.items():
        s = schedule(structure, compiled.scene, Friction(friction.GIVEN))
        inputs = s.program([rule(s)]).inputs
        if any(name.startswith("friction_") for name in inputs):
            addresses.append(address)
    return tuple(addresses)


def program_with_deflections(compiled: Source) -> SignalProgram:
    """The same, and the states of friction laws."""
    program = compiled._once(signal_program)
    structure, initial = compiled.structure, compiled.structure.initial_states
    laws = [structure.friction_law(ref) for ref in structure.remembering]
    bent = (abs(float(law.steady_kernel()(1.0, law.parameters()))) for law in laws)
    return program._replace(initial=initial, sizes=(*program.sizes, *bent))


def signal_program(compiled: Source) -> SignalProgram:
    """What the signal blocks of a mechanism add."""
    structure, s = compiled.structure, schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    updated = s.ask(signals.updated)
    initial = structure.initial_states
    initial = initial[: len(initial) - len(structure.remembering)]
    return SignalProgram(
        structure.signals,
        initial,
        (1.0,) * len(initial),
        len(signals.kinks(schedule(structure, compiled.scene, FRICTIONLESS))),
        SingleEvaluator(s.program(updated.values())) if updated else None,
        tuple((ref.block, structure.states[ref]) for ref in updated),
    )


# -- joint friction ----------------------------------------------------------------------


GIVEN = Friction(friction.GIVEN)


def pair_program(compiled: Source, pushed: tuple[JointRef, ...] = ()) -> PairProgram | None:
    """The force pass of a mechanism with its friction laws; None where none can act.

    ``pushed`` : pairs along whose coordinates stops may push
    """
    structure = compiled.structure
    friction_method = replace(GIVEN, pushed=pushed)  # a push loads pairs that nothing else does
    s = schedule(structure, compiled.scene, friction_method)
    joints = s.ask(friction.input_joints)
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
    apart = schedule(structure, compiled.scene, friction_method)
    rules = friction.terms, friction.terms_at_rest
    law_terms = [x for rule in rules for x in terms(apart, joints, rule)]
    laws = [structure.friction_law(ref) for ref in joints]
    rates = [*signals.rates(s), *friction.deflection_rates(s), *signals.kinks(s)]
    return PairProgram(
        tuple(map(structure.pair_name, joints)),
        tuple(pairs.statics(s, ref).edges for ref in joints),
        program,
        apart.program(law_terms),
        s.program([*values, *margins(s), *rates, *terms(s, joints, friction.terms)]),
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


def terms(s: Schedule, joints: Sequence[JointRef], rule: Callable[..., Value]) -> list[Value]:
    """Factors (m,) and drags (m,) of pairs by a rule that asks their laws."""
    laws = [s.ask(rule, ref) for ref in joints]
    return [getattr(law, part) for part in FrictionTerms._fields for law in laws]


INPUTS = ("q", "qd", "qdd")


class Tangents(NamedTuple):
    """The driving effort at n states of k drivers, with its derivatives.

    effort : (n, k) [N m or N] that the drivers need; the loads alone give its negative
    M, C, K : (n, k, k) by accelerations, rates and coordinates
    margin : (n,) [-] of the pose, NaN or not positive where it cannot be
    """

    effort: Floats
    M: Floats
    C: Floats
    K: Floats
    margin: Floats


def tangents(
    compiled: Source,
    q: ArrayLike,
    qd: ArrayLike = 0.0,
    qdd: ArrayLike = 0.0,
    t: ArrayLike = 0.0,
) -> Tangents:
    """The driving effort and its derivatives at states (n, k), without joint friction."""
    refuse_signals(compiled)
    engine = compiled._once(_effort)
    k = len(compiled.structure.drivers)
    q = np.asarray(q, float).reshape(-1, k)
    columns_by_name: Arguments = {"t": np.broadcast_to(np.asarray(t, float), len(q))}
    for which, (name, x) in enumerate(zip(INPUTS, (q, qd, qdd), strict=True)):
        columns = np.broadcast_to(np.asarray(x, float), q.shape)
        for i in range(k):
            seed = np.zeros((3 * k, len(q)))
            seed[which * k + i] = 1.0
            columns_by_name[f"{name}_{i}"] = Dual(columns[:, i], seed)
    program = engine.program
    inputs = {name: columns_by_name[name] for name in program.inputs}
    values = engine.run(inputs, tuple(program.parameters.values()), len(q), 3 * k)
    u, rest = values[:k], values[k:]
    slopes = np.array([x.d for x in u]).transpose(2, 0, 1)  # (n, k, 3k)
    margin = np.minimum.reduce([np.ones(len(q)), *(value(x) for x in rest)])
    K, C, M = (slopes[..., j * k : (j + 1) * k] for j in range(3))
    return Tangents(np.stack([x.x for x in u], axis=-1), M, C, K, np.asarray(margin))


def refuse_signals(compiled: Source) -> None:
    """Raise `RequestError` where loads follow signals, whose states are no coordinates."""
    if compiled.structure.signals:
        fault = "loads follow signals, whose states stand beside the coordinates"
        raise refused("signals", fault, "take the signals out, or simulate the motion")


def refuse_friction_states(compiled: Source) -> None:
    """Raise `RequestError` where a joint has a friction law that remembers."""
    if compiled.structure.remembering:
        fault = "it has a friction law with a state, which stands beside the coordinates"
        remedy = 'leave joint friction out with friction="none", or simulate the motion'
        raise refused(str(compiled.structure.remembering[0]), fault, remedy)


def _effort(compiled: Source) -> DualEngine:
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    efforts = [s.ask(reduction.drive_by_reduction, k) for k in compiled.structure.drivers]
    return DualEngine(s.program([*efforts, *margins(s)]), WITH_DIFFERENCES)
