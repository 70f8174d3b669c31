"""A compiled mechanism: asks for outputs, gets results.

Compiling froze the structure; a request makes (or finds) its plan, chooses an
engine and wraps the arrays in a labelled result.
"""

from __future__ import annotations

import weakref
from abc import abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import numpy as np

from blockmech.blocks.modes import TwoModes
from blockmech.engines.cost import account
from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.engines.numpy import PRECISIONS, each_part
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    BlockmechError,
    GraphError,
    Problem,
    among,
    as_names,
    listed,
    refused,
)
from blockmech.ground.memory import RETAINED, uncollected
from blockmech.ground.runnable import EVERYTHING, LazyMethod, Runnable
from blockmech.model.document import Document
from blockmech.model.graph import Graph
from blockmech.model.naming import Names
from blockmech.model.scene import Scene, SceneOfLinks
from blockmech.model.structure import Structure
from blockmech.outputs.by_block import Catalogue, in_program
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Friction, Plan
from blockmech.plan.settings import check_chunk, friction_asked
from blockmech.result.failures import without_gaps
from blockmech.result.result import Result
from blockmech.result.samples import Samples, make_samples
from blockmech.typing import (
    Arguments,
    Coordinates,
    EngineName,
    FrictionMethod,
    M,
    Numbers,
    OnGap,
    Precision,
    Real,
    Record,
    Values,
)

if TYPE_CHECKING:
    from blockmech.engines.llvm import LlvmEngine

T = TypeVar("T")
CONTRACTION = 2  # place among the reports on a group's friction, see `result.quality.assess`
CERTAIN = 1 - float(np.finfo(np.float32).eps) ** 0.5  # of an eigenvalue in single precision


class Compiled(Runnable[M]):
    """A valid, compiled mechanism, as analyses take it; `Mechanism` adds them as methods."""

    _called = "a compiled mechanism"
    _remedy = "compile it first: its compile() gives a mechanism"
    _run_to = LazyMethod("blockmech.analysis.accuracy.run_to")
    _with_deflections = LazyMethod("blockmech.analysis.deflections._with_deflections")

    structure: Structure
    scene: Scene
    name: str
    names: Names | None
    document: Document | None
    _plans: Callable[..., Plan]
    _cache: dict[Hashable, Any]

    def __init__(
        self,
        structure: Structure,
        scene: Scene,
        name: str = "mechanism",
        names: Names | None = None,
        document: Document | None = None,
    ) -> None:
        """``structure`` and ``scene`` are those of a graph.

        With ``names`` outputs are those of the links, joints and drivers of a joint-based document.
        ``document`` is what the user wrote, graph or linkage: other designs are made of it.
        """
        if names is not None and not isinstance(scene, SceneOfLinks):
            scene = SceneOfLinks(**dict(scene))
        vars(self).update(
            structure=_with_sensors(_followed(structure, scene), scene),
            names=names,
            scene=scene,
            name=name,
            document=document,
            # by a proxy: a mechanism whose plans hold it would be a cycle
            _plans=lru_cache(RETAINED)(partial(_plan, weakref.proxy(self))),
            _cache={},
        )

    @classmethod
    @uncollected()
    def _from_graph(
        cls, graph: Graph, names: Names | None = None, document: Document | None = None
    ) -> Self:
        """A snapshot of a graph, checked.

        With ``names`` it speaks of the document that a graph was made of. Raises
        `GraphError` with all problems.
        """
        from blockmech.passes.homotopy import refuse_open_homes

        structure = graph.structure()
        refuse_open_homes(structure)
        source, scene = (document or graph).snapshot(), graph.flat().scene
        if names is not None and (stops := getattr(document, "stops", None)):
            # those of pairs are named and counted as the document does
            scene = scene.model_copy(update={"stops": dict(stops)})
        return cls(structure, scene, graph.name, names, source)

    def __setattr__(self, name: str, value: object) -> None:
        where, message = f"Mechanism.{name}", "a compiled mechanism does not change"
        remedy = "set it on the graph or linkage, and compile that again"
        raise GraphError(Problem("frozen", where, message, "", remedy))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickled as what it was compiled of; plans and programs are made again when asked for."""
        structure = replace(self.structure, sensors={})  # without what was found from its fields
        return type(self), (structure, self.scene, self.name, self.names, self.document)

    @cached_property
    def outputs(self) -> Catalogue:
        """All available outputs, by name.

        >>> mech.outputs["crank.drive"].unit
        'N m'
        """
        return Catalogue(self.structure, self.names)

    @cached_property
    def _of_blocks(self) -> Self:
        """The same with the outputs of blocks, whatever a document calls its links."""
        return self if self.names is None else type(self)(self.structure, self.scene, self.name)

    @property
    def drivers(self) -> tuple[str, ...]:
        """Drivers in formation order.

        >>> mech.drivers
        ('crank',)
        """
        return self.structure.drivers

    @cached_property
    def _coordinate_units(self) -> Mapping[str, str]:
        """Unit of the coordinate of each driver, "rad" or "m"."""
        return {d: self.structure.driver_joint(d).coordinate_unit for d in self.drivers}

    def _of_driver(self, driver: str, quantity: str) -> str:
        """Name of an output of a driver: ``"crank.q"``, or ``"driver.motor.q"`` of a document."""
        return f"{self._driver_prefix}{driver}.{quantity}"

    @property
    def _driver_prefix(self) -> str:
        """What names of outputs put before a driver's."""
        return "" if self.names is None else "driver."

    def _block_name(self, block: str) -> str:
        """A block in a message: its name, and the links of a joint-based document in it."""
        if self.names is None:
            return block
        return self.names.of_blocks.get(block, block)

    @cached_property
    def _joint_names(self) -> Mapping[str, str]:
        """Joint of the graph -> its name in a joint-based document; empty without one."""
        return {} if self.names is None else self.names.of_joints

    @declared
    def plan(
        self,
        want: Iterable[str] | str = EVERYTHING,
        *,
        friction: FrictionMethod | None = None,
        static: bool = False,
    ) -> Plan:
        """The plan for some outputs; cached.

        Parameters
        ----------
        want : names or patterns of outputs
        friction : "none" | "single" | "successive" | "newton" (default), or `Successive`
        static : without inertia; a request at rest, with zero rates and accelerations, is static
        anyway

        Raises `RequestError` for unknown names or settings that do not fit.

        >>> print(mech.plan("dyad.C.p").calls)
        2
        """
        return self._plan_for(want, friction_asked(friction), static)

    def _plan_for(
        self, want: Iterable[str] | str, friction: Friction, static: bool = False
    ) -> Plan:
        """The same, by friction settings that are checked."""
        return self._plans(as_names("want", want), friction, static)

    def _plan_at(
        self, samples: Samples, want: Iterable[str] | str, *, static: bool, **settings: Any
    ) -> Plan:
        """The plan for some outputs at samples: where no driver moves, that without inertia."""
        return self.plan(want, static=static or samples.at_rest, **settings)

    def compile(self) -> M:
        """The mechanism itself.

        >>> mech.compile() is mech
        True
        """
        return self  # type: ignore[return-value]

    def samples(self, *request: Any) -> Samples:
        """Samples that a request names: at, samples, times, rates, accelerations.

        >>> mech.samples(None, 5).n
        5
        """
        samples = make_samples(self._coordinate_units, self.scene, *request)
        return self._with_deflections(samples) if self.structure.remembering else samples

    @declared
    def run(
        self: Runnable[M],
        at: Coordinates | None = None,
        *,
        samples: int | None = None,
        times: Numbers | None = None,
        rates: Coordinates | None = None,
        accelerations: Coordinates | None = None,
        want: Iterable[str] | str = EVERYTHING,
        friction: FrictionMethod | None = None,
        accuracy: float | None = None,
        static: bool = False,
        engine: EngineName = "auto",
        precision: Precision | None = None,
        chunk: int | None = None,
        on_gap: OnGap = "raise",
    ) -> Result[M]:
        """Compute the wanted outputs at given driver coordinates or times.

        Parameters
        ----------
        at : float or (n,) [rad or m], text as "30deg", or a mapping driver -> these
            Driver coordinates; rates follow from the scene's law of motion.
        samples : int
            That many equally spaced samples of the law's range; default 361.
        times : (n,) [s]
            Samples of the laws of motion by time.
        rates, accelerations : like ``at``
            Driver rates [rad/s or m/s] and accelerations, in place of the law's.
        want : names or patterns of outputs, e.g. ``["crank.drive", "*.reaction"]``; default all
        friction : "none" | "single" | "successive" | "newton" (default), or `Successive`
        accuracy : float [- or rad]
            Wanted error relative to each output's largest magnitude; chooses friction
            method, iterations and precision, and ``result.accuracy`` says which.
        static : without inertia
        engine : "scalar" for few samples, "numpy" for batches, "llvm" for machine code that is
            compiled at the first run, "auto" the one with the least expected time: machine code
            once the request has had enough samples for compiling to pay
        precision : "complex64" | "complex128" (default) | "clongdouble" (NumPy engine)
        chunk : samples per batch of the NumPy engine
        on_gap : what to do at samples without an answer: raise, mark them as NaN,
            or stop before the first

        Returns
        -------
        Result, labelled, with units and quality

        Raises
        ------
        GraphError with all problems of a graph or linkage that is not a valid mechanism
        RequestError for unknown names or settings that do not fit
        AssemblyError, SingularError, FrictionError at gaps, unless marked

        >>> mech.run(at="30deg", want="crank.drive")["crank.drive"].round(3)
        array([8744.465])
        """
        mechanism = cast(Compiled, self.compile())
        points = mechanism.samples(at, samples, times, rates, accelerations)
        settings: Arguments = {"friction": friction}
        if accuracy is None:
            settings["static"] = static
            result = mechanism._answer(points, want, settings, engine, precision, chunk)
        else:
            settings["precision"] = precision
            result = mechanism._run_to(accuracy, settings, points, want, static, engine, chunk)
        return without_gaps(result, on_gap)

    def _answer(
        self,
        samples: Samples,
        want: Iterable[str] | str,
        settings: Arguments,
        engine: EngineName = "auto",
        precision: Precision | None = None,
        chunk: int | None = None,
    ) -> Result:
        """The wanted outputs at samples; ``settings`` are those of `plan`; gaps are marked."""
        settings = {"friction": "newton"} | {k: x for k, x in settings.items() if x is not None}
        plan = self._plan_at(samples, want, **settings)
        if self.structure.states:
            self._refuse_states(plan, samples.inputs)
        values, name = self._evaluate(plan, samples, engine, precision or "complex128", chunk)
        return Result(self, plan, samples, values, name, settings)

    @abstractmethod
    def _feasible(self, groups: frozenset[str], fixed: Mapping[str, float] | None = None) -> str:
        """Where these groups close, in words for a message."""

    def _evaluate(
        self,
        plan: Plan,
        samples: Samples,
        engine: str = "auto",
        precision: str = "complex128",
        chunk: int | None = None,
    ) -> tuple[Values, str]:
        """Values of a plan's program at samples, and the name of the engine."""
        check_chunk(chunk)
        if engine == "auto":
            engine = self._chosen(plan, samples.n) if precision == "complex128" else "numpy"
        if self.structure.states:
            inputs = self._with_states(plan, samples)
        else:
            inputs = samples.given(plan.program.inputs)
        if engine in ("scalar", "llvm") and precision == "complex128":
            return self._engine(plan, engine, "").run(inputs, samples.n), engine
        if engine != "numpy" or precision not in PRECISIONS:
            message = f'no engine "{engine}" with precision "{precision}"'
            valid = f"engines: auto, scalar, numpy, llvm; precisions of numpy: {listed(PRECISIONS)}"
            raise refused("engine", message, valid=valid, code="unknown-engine")
        batch = self._engine(plan, "numpy", precision)
        options = {} if chunk is None else {"chunk": int(chunk)}
        values = batch.run(inputs, samples.n, **options)
        if precision == "complex64":
            values = self._doubts_in_double(plan, values, inputs, samples.n)
        return values, "numpy"

    @np.errstate(over="ignore")  # double holds numbers that single does not
    def _doubts_in_double(self, plan: Plan, values: Values, inputs: Record, n: int) -> Values:
        """Values in single precision, but with friction that it cannot tell from double.

        Those are samples at which a slow pair counts as one at rest, and those near or beyond the
        end of the certificate, where rounding of the data decides whether the mechanism jams.
        """
        doubtful = np.zeros(n, bool)
        for at in plan.reports["rest"].values():
            doubtful |= np.asarray(values[at[0]]) > 0
        for at in plan.reports["friction"].values():
            doubtful |= np.asarray(values[at[CONTRACTION]]) > CERTAIN
        i = np.flatnonzero(doubtful)
        if not i.size:
            return values
        doubted = {name: np.broadcast_to(inputs[name], n)[i] for name in plan.program.inputs}
        better = self._engine(plan, "numpy", "complex128").run(doubted, i.size)

        def mended(x: Real, y: Real) -> Real:
            merged = np.array(x)
            merged[i] = y
            return merged

        return tuple(each_part(mended, values, better))

    def _with_states(self, plan: Plan, samples: Samples) -> Record:
        """Inputs (n,) of a program that reads states; those not among them are the initial ones."""
        bent = {f"{STATE}{self.structure.states[x]}" for x in self.structure.remembering}
        if any(name not in samples.inputs for name in bent.intersection(plan.program.inputs)):
            samples = self._with_deflections(samples)
        inputs, initial = samples.given(plan.program.inputs), self.structure.initial_states
        needed = {i for i in self._states_needed(plan) if f"{STATE}{i}" not in inputs}
        return {**inputs, **{f"{STATE}{i}": np.full(samples.n, initial[i]) for i in needed}}

    def _states_needed(self, plan: Plan) -> Iterator[int]:
        """Places of the states of signal blocks that a plan's program reads."""
        for name in plan.program.inputs:
            if name.startswith(STATE):
                yield int(name[len(STATE) :])

    def _refuse_states(self, plan: Plan, inputs: Collection[str]) -> None:
        """Refuse a run of given motions that needs states of signal blocks."""
        needed = {i for i in self._states_needed(plan) if f"{STATE}{i}" not in inputs}
        needed -= {self.structure.states[ref] for ref in self.structure.remembering}
        refs = [str(ref) for ref, i in self.structure.states.items() if i in needed]
        if refs:
            message = f"the outputs depend on states of signal blocks: {listed(refs, 4)}"
            valid = "states are known along a motion"
            remedy = "ask simulate for them, or name others with want=[...]"
            raise refused("want", message, remedy, valid, "signal-states")

    def _chosen(self, plan: Plan, n: int) -> str:
        """The engine that takes the least time for n samples, and for those to be expected."""
        costs, compiled = account(plan.program), ("llvm", "") in plan.engines
        engine = costs.choice(plan.program, n, compiled)
        if engine == "llvm" and not compiled:
            try:
                self._engine(plan, "llvm", "")
            except BlockmechError:
                costs.declined = True
                engine = costs.choice(plan.program, n, compiled)
        if engine != "llvm":
            costs.count(plan.program, n)
        return engine

    def _engine_of_designs(self, plan: Plan, n: int, engine: str) -> NumpyEngine | LlvmEngine:
        """The engine for n samples of designs: of itself the quicker one."""
        if engine == "auto":
            engine = "llvm" if self._chosen(plan, n) == "llvm" else "numpy"
        among(("auto", "numpy", "llvm"), "engine", engine, "unknown-engine", "engine")
        precision = "complex128" if engine == "numpy" else ""
        bound: NumpyEngine | LlvmEngine = self._engine(plan, engine, precision)
        return bound

    def _once(self, make: Callable[[Self], T]) -> T:
        """What an analysis makes of this mechanism, made once and kept."""
        if make not in self._cache:
            self._cache.setdefault(make, make(self))  # of two threads the first one's
        value: T = self._cache[make]
        return value

    def _engine(self, plan: Plan, name: str, precision: str) -> Any:
        key = name, precision
        if key not in plan.engines:
            if name == "llvm":
                from blockmech.engines.llvm import compiled_program  # few processes need it

                engine: Any = compiled_program(plan.program)
            elif name == "scalar":
                engine = ScalarEngine(plan.program)
            else:
                engine = NumpyEngine(plan.program, precision)
            plan.engines.setdefault(key, engine)  # of two threads the first one's
        return plan.engines[key]

    @cached_property
    def frictional_joints(self) -> tuple[str, ...]:
        """Names of the joints that have friction.

        >>> mech.frictional_joints
        ('crank.A', 'dyad.B', 'dyad.C', 'dyad.D')
        """
        joints = (
            f"{name}.{joint}"
            for name, block in self.structure.blocks.items()
            for joint, law in block.friction.items()
            if law.acts
        )
        s = self.structure
        meshes = (s.pair_name(mesh) for mesh in s.meshes if not s.separates(mesh))
        return (*(self._joint_names.get(joint, joint) for joint in joints), *meshes)

    def __repr__(self) -> str:
        s = self.structure
        return (
            f"<{type(self).__name__} {self.name}: {len(s.links) - 1} moving links, "
            f"{s.pairs} pairs, mobility {s.mobility}; {s.formula}>"
        )


def _plan(mechanism: Compiled, want: tuple[str, ...], friction: Friction, static: bool) -> Plan:
    return mechanism.outputs.plan(mechanism.scene, want, friction, static)


def _with_sensors(structure: Structure, scene: Scene) -> Structure:
    """The structure with what its signal blocks read of it."""
    if structure.sensors or not (structure.signals or structure.signal_wires):
        return structure
    from blockmech.outputs.sensors import with_sensors  # few mechanisms need it

    return with_sensors(structure, scene, Catalogue(structure), in_program)


def _followed(structure: Structure, scene: Scene) -> Structure:
    """The structure with the change points of branches that follow the motion."""
    if structure.followed or not any(
        isinstance(b, TwoModes) and b.follows for b in structure.blocks.values()
    ):
        return structure
    from blockmech.passes.change_points import with_followed  # few mechanisms need it

    return with_followed(structure, scene)
