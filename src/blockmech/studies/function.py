"""A mechanism as a pure function on the arrays of another library, such as JAX.

What programs of a design are made of has a meaning on these arrays (`blockmech.engines.arrays`,
`blockmech.engines.jax`), numbers of the design included: so the library compiles, batches and
differentiates outputs by all of them. Groups without closed form are followed from the home of the
design that the function was made of, so other designs are to be near it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np

from blockmech.compiled import Compiled
from blockmech.dynamics.source import margins
from blockmech.engines.arrays import ArrayEngine
from blockmech.engines.numpy import leaves
from blockmech.friction.continuation import Outcome
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    Problem,
    RequestError,
    among,
    as_names,
    listed,
    needed,
    refused,
)
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.laws_of_motion import ConstantRate
from blockmech.model.parameters import Parameter, Path
from blockmech.passes import reduction
from blockmech.passes.homotopy import schedule
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Friction, Plan, Program
from blockmech.result.result import ADVANTAGE
from blockmech.studies import family
from blockmech.studies.differentiate import INPUTS, fitting, without_derivative
from blockmech.studies.sampling import as_sequence
from blockmech.studies.variation import designed, is_sided, moves_drivers, planned_near
from blockmech.typing import Data, FrictionMethod, Precision, Real, Record, Values

TYPES = {"complex128": "float64", "complex64": "float32"}  # of the precisions of a run
TIME = "time"
Places: TypeAlias = Mapping[Parameter, tuple[Path, ...]]
"""Where each number of a document stands in its graph."""


class ProgramOfDesigns:
    """A program as a function of its inputs and of numbers of the design.

    Attributes
    ----------
    parameters : address -> number of the original design
    """

    def __init__(
        self, mechanism: Compiled, places: Places, alone: Collection[str], engine: ArrayEngine
    ) -> None:
        """Raises `RequestError` for a program with states."""
        if any(name.startswith(STATE) for name in engine.program.inputs):
            remedy = "name outputs that do without them"
            raise refused("outputs", "they depend on states, which are integrals", remedy)
        self.mechanism, self._engine = mechanism, engine
        self._places = self._formulas(places, alone)
        number = np.float32 if engine.xp.finfo(engine.dtype).bits == 32 else np.float64
        self.parameters = {p.address: number(p.value) for p in self._places}  # no weak type of JAX

    def _formulas(self, places: Places, alone: Collection[str]) -> Places:
        """The numbers that the program follows by formulas, unlike the pieces of a cubic table."""
        numbers = {path: self._engine.array(p.value) for p, all_ in places.items() for path in all_}
        try:
            self._engine.program.values(*designed(self.mechanism, numbers))
        except RequestError:
            if len(places) == 1:
                if {p.address for p in places} & set(alone):
                    raise
                return {}
            parts = [self._formulas({p: paths}, alone) for p, paths in places.items()]
            return {p: paths for part in parts for p, paths in part.items()}
        return places

    def _values(self, parameters: Record, inputs: Record) -> Values:
        among(self.parameters, "number", parameters, where="parameters")
        numbers = {**self.parameters, **parameters}
        at = {path: numbers[p.address] for p, paths in self._places.items() for path in paths}
        program = self._engine.program
        columns = {name: inputs[name] for name in program.inputs}
        return self._engine.run(columns, program.values(*designed(self.mechanism, at)))


class Function(ProgramOfDesigns):
    """Outputs as a pure function: ``f(f.parameters, {"crank.q": q})`` is a dict of arrays.

    In addition to the outputs, ``"ok"`` marks the samples with an answer.

    Attributes
    ----------
    parameters : address -> number of the original design
    inputs, outputs : names
    plan : the plan of the computation
    """

    def __init__(self, plan: Plan, inputs: Mapping[str, str], rates: Any, *of: Any) -> None:
        super().__init__(*of)
        self.plan, self._inputs, self._rates = plan, inputs, rates
        self.inputs, self.outputs = tuple(inputs), plan.want

    def __repr__(self) -> str:
        ends = f"{listed(self.inputs, 4)} -> {listed(self.outputs, 4)}"
        return f"<Function {ends}; {len(self.parameters)} parameters>"

    def __call__(self, parameters: Record, inputs: Record) -> Data:
        """Outputs (...) of a design at inputs (...) [rad or m, per s, per s2; time s].

        ``parameters`` are those that differ from ``f.parameters``: numbers, or arrays that
        broadcast with the inputs. Vectors are complex x + iy; samples without an answer are NaN.

        Raises `RequestError` for names that it does not have, and for inputs that are missing.
        """
        among(self.inputs, "number", inputs, where="inputs")
        if missing := [name for name in self.inputs if name not in inputs]:
            raise refused("inputs", f"missing: {listed(missing)}", "give an array of each")
        xp, given = self._engine.xp, {n: inputs[address] for address, n in self._inputs.items()}
        values = self._values(parameters, {**self._rates, **given})
        closing, outcomes = self.plan.verdicts
        judged = {i for n in self.outputs if n != ADVANTAGE for i in self.plan.layout[n]}
        truths = [xp.isfinite(self._engine.array(x)) for i in judged for x in leaves(values[i])]
        truths += [values[i] >= 0.0 for i in closing]
        truths += [values[i] <= float(Outcome.BY_CONTINUATION) for i in outcomes]
        ok = xp.ones(np.broadcast_shapes(*map(np.shape, given.values())), dtype=xp.bool)
        for truth in truths:
            ok = ok & truth
        return {**{name: self._read(name, values, ok.shape) for name in self.outputs}, "ok": ok}

    def _read(self, name: str, values: Values, shape: tuple[int, ...]) -> Real:
        """An output (...) of values of the program; of k drivers a matrix (..., k, k)."""
        columns = tuple(values[i] for i in self.plan.layout[name])
        y, k = self._engine.read(self.mechanism.outputs[name], columns, shape), len(columns)
        drivers = len(self.mechanism.drivers)
        is_square = self.mechanism.outputs[name].kind == "matrix" and k > drivers
        return self._engine.xp.reshape(y, (*shape, drivers, drivers)) if is_square else y


class Rates(ProgramOfDesigns):
    """The reduced equation of motion, M q'' = Q - c, as a pure function for solvers.

    Attributes
    ----------
    parameters : address -> number of the original design
    """

    @np.errstate(all="ignore")
    def __call__(
        self, t: Real, state: tuple[Real, Real], parameters: Record | None = None
    ) -> tuple[Real, Real]:
        """(q', q'') at a time [s] and a state (q, q') [rad or m, per s].

        Of k > 1 drivers q and q' are arrays (k, ...). q'' is NaN where there is no pose, and where
        nothing resists the only driver.
        """
        xp, array = self._engine.xp, self._engine.array
        q, rate = map(array, state)
        k = len(self.mechanism.drivers)
        inputs = {"t": array(t)}
        for i in range(k):
            at = i if k > 1 else ...
            inputs |= {f"q_{i}": q[at], f"qd_{i}": rate[at], f"qdd_{i}": array(0.0)}
        values = self._values(parameters or {}, inputs)
        rows = [values[i * k : (i + 1) * k] for i in range(k)]
        qdd = self._engine.meaning["solve"](rows, [-u for u in values[k * k : k * k + k]])
        good = array(rows[0][0]) > 0.0
        for margin in values[k * k + k :]:
            good = good & (margin > 0.0)
        columns = [xp.where(good, x, array(np.nan)) for x in qdd]
        return rate, xp.stack(columns) if k > 1 else columns[0]


@declared
def function(
    mechanism: Compiled,
    inputs: Iterable[str] | str,
    outputs: Iterable[str] | str = EVERYTHING,
    parameters: Iterable[str] | str = (),
    *,
    library: str | ModuleType = "jax",
    friction: FrictionMethod | None = None,
    static: bool = False,
    precision: Precision | None = None,
) -> Function:
    """Outputs as a pure function of inputs and parameters, on the arrays of another library.

    JAX compiles, batches and differentiates it, in both modes and to any order; samples without an
    answer do not contribute to gradients by shared parameters.

    Parameters
    ----------
    inputs : ``crank.q``, ``crank.rate``, ``crank.acceleration`` of the drivers [rad or m, per s,
        per s2], and ``time`` [s]; a rate that is not named is that of a law of constant rate, or 0
    outputs : names or patterns of outputs; those that are one number a run are left out
    parameters : addresses or patterns of numbers (`Mechanism.parameters`)
    library : "jax", "numpy", or the namespace of arrays that keep the array API standard
    friction, static : as those of a run
    precision : "complex128" (default) for float64, "complex64" for float32

    Returns
    -------
    Function

    Raises
    ------
    RequestError for unknown names, for inputs that are missing, for numbers on which the
    structure, the drivers or a document's geometry depend, and for outputs that depend on states
    MissingEngineError without JAX

    >>> place = mech.function("crank.q", "dyad.C.p", library="numpy", friction="none")
    >>> place
    <Function crank.q -> dyad.C.p; 0 parameters>
    """
    catalogue = mechanism.outputs
    patterns = as_sequence("outputs", outputs)
    names = [n for n in catalogue.match(patterns) if catalogue[n].kind != "number"]
    if not names:
        quantity = "it is one number a run, not one a sample"
        raise refused(listed(patterns), quantity, "name an output of samples")
    paths_of, alone = _places(mechanism, as_names("parameters", parameters))
    general = planned_near(mechanism, {x: p.value for p, paths in paths_of.items() for x in paths})
    plan = general.plan(names, friction=friction, static=static)
    drivers = list(enumerate(mechanism.drivers))
    of_inputs = {
        mechanism._of_driver(d, quantity): f"{x}_{i}"
        for i, d in drivers
        for quantity, x in INPUTS.items()
    } | {TIME: "t"}
    names_of_inputs = as_sequence("inputs", inputs)
    among(of_inputs, "number", names_of_inputs, where="inputs")
    rates: dict[str, float] = {}
    for i, driver in drivers:
        law = mechanism.scene.drive.get(driver)
        if law is None or isinstance(law, ConstantRate):
            rates |= {f"qd_{i}": law.rate if law else 0.0, f"qdd_{i}": 0.0}
    chosen = {address: of_inputs[address] for address in names_of_inputs}
    available = {*chosen.values(), *rates}
    if missing := [
        a for a, x in of_inputs.items() if x in plan.program.inputs and x not in available
    ]:
        raise refused("inputs", f"the outputs depend on {listed(missing)}", "name them as well")
    engine = _engine(plan.program, library, precision)
    return Function(plan, chosen, rates, mechanism, paths_of, alone, engine)


@declared
def rates(
    mechanism: Compiled,
    parameters: Iterable[str] | str = (),
    *,
    library: str | ModuleType = "jax",
    friction: FrictionMethod | None = None,
    precision: Precision | None = None,
) -> Rates:
    """The reduced equation of motion on another library's arrays, for solvers such as diffrax.

    Events are the solver's own: the end stops of a scene are not in it.

    Parameters
    ----------
    parameters, library, precision : as those of `function`
    friction : "none" of a mechanism with joint friction, which is not smooth

    Returns
    -------
    Rates

    Raises
    ------
    RequestError for joint friction, for states, and where nothing that moves has mass

    >>> rates = mech.rates(library="numpy", friction="none")
    >>> q_rate, acceleration = rates(0.0, (0.5, 10.0))
    >>> float(acceleration.round(3))
    -106.94
    """
    if friction != "none" and mechanism.frictional_joints:
        message = f"friction in {listed(mechanism.frictional_joints, 4)} is not smooth"
        raise refused("friction", message, 'leave it out with friction="none", or use simulate')
    paths_of, alone = _places(mechanism, as_names("parameters", parameters))
    general = planned_near(mechanism, {x: p.value for p, paths in paths_of.items() for x in paths})
    s, drivers = schedule(general.structure, general.scene, Friction("none")), mechanism.drivers
    inertia = [s.ask(reduction.inertia, k, m) for k in drivers for m in drivers]
    if any(J.zero for J in inertia[:: len(drivers) + 1]):
        raise refused("rates", "nothing that moves has mass", "give a link mass or inertia")
    efforts = [s.ask(reduction.drive_by_reduction, d) for d in drivers]
    program = s.program([*inertia, *efforts, *margins(s)])
    return Rates(mechanism, paths_of, alone, _engine(program, library, precision))


def _places(mechanism: Compiled, patterns: Iterable[str]) -> tuple[Places, set[str]]:
    """The numbers that patterns name, and where each stands in the graph; those named one by one.

    Raises `RequestError` for those that are named one by one and cannot vary.
    """
    chosen, alone = fitting(family.parameters(mechanism), patterns)
    reasons = {a: why for a, p in chosen.items() if (why := without_derivative(p))}
    paths_of = family.places_of(mechanism, tuple(p for a, p in chosen.items() if a not in reasons))
    for p, paths in paths_of.items():
        if not paths:
            reasons[p.address] = "it belongs to the geometry of the document"
        elif False in [is_sided(mechanism, path) for path in paths]:
            reasons[p.address] = "it chooses between structures"
        elif any(map(moves_drivers, paths)):
            reasons[p.address] = "it says how the drivers move"
    if wrong := reasons.keys() & alone:
        raise RequestError(Problem("bad-request", a, reasons[a]) for a in sorted(wrong))
    return {p: paths for p, paths in paths_of.items() if p.address not in reasons}, alone


def _engine(program: Program, library: str | ModuleType, precision: str | None) -> ArrayEngine:
    """The engine of a library."""
    precision = precision or "complex128"
    if precision not in TYPES:
        raise refused("precision", precision, "", listed(TYPES), code="unknown-engine")
    kind = TYPES[precision]
    if library == "jax":
        jax = needed("jax", "library", "jax")
        if precision == "complex128" and not jax.config.jax_enable_x64:
            remedy = 'jax.config.update("jax_enable_x64", True), or precision="complex64"'
            raise refused("precision", "JAX is set to single precision", remedy)
        from blockmech.engines.jax import JaxEngine

        return JaxEngine(program, kind)
    xp = np if library == "numpy" else library
    if isinstance(xp, str) or not hasattr(xp, "isdtype"):
        valid = "jax, numpy, or a namespace of the array API standard"
        raise refused("library", f"{library!r:.60} is none", "", valid, code="unknown-engine")
    return ArrayEngine(program, xp, getattr(xp, kind))
