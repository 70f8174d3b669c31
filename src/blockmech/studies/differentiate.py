"""Derivatives of outputs by the numbers of a design, exact to rounding.

One run on dual numbers gives them for all samples, outputs and numbers at once, joint
friction included. A second run in the opposite directions tells where an output has a kink.
Rates and accelerations of the drivers are held, also where the driver's coordinate turns.

Source: `blockmech.engines.derivatives`.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.engines.derivatives import DualEngine
from blockmech.engines.dual import Dual, slope
from blockmech.errors import Problem, RequestError
from blockmech.model.parameters import Parameter, named, parameters_of
from blockmech.passes.homotopy import path_of
from blockmech.plan import Output, Plan
from blockmech.result import Result
from blockmech.studies.family import BATCHED, Family, sections_of
from blockmech.studies.sensitivity import Sensitivity
from blockmech.typing import Coordinates, FrictionMethod, Numbers, OnGap

Array = NDArray[Any]
EVERY_NUMBER = "*"
INPUTS = {"q": "q", "rate": "qd", "acceleration": "qdd"}  # output of a driver -> program input
GIVEN = "driver"  # first key of the path of a driver's coordinate, rate or acceleration


def sensitivity(
    mechanism: Compiled,
    want: Iterable[str] | str,
    to: Iterable[str] | str = EVERY_NUMBER,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    friction: FrictionMethod | None = None,
    tolerance: float | None = None,
    iterations: int | None = None,
    static: bool = False,
    on_gap: OnGap = "raise",
) -> Sensitivity:
    """Derivatives of outputs by numbers of the design and by coordinates of the drivers.

    Exact to rounding. Rates and accelerations of the drivers are held.

    Parameters
    ----------
    want : names or patterns of outputs; ``.x`` or ``.y`` behind a vector's is that part of it
    to : addresses or patterns of numbers (`Mechanism.parameters`), and of drivers their
        ``crank.q``, ``crank.rate``, ``crank.acceleration``; by default all numbers
    at, samples, times, rates, accelerations : the samples, as those of a run
    friction, tolerance, iterations, static, on_gap : as those of a run

    Returns
    -------
    Sensitivity, ranked when shown

    Raises
    ------
    RequestError for unknown names, and for outputs or numbers without a derivative
    AssemblyError, SingularError, FrictionError at gaps, unless marked
    """
    names = _differentiable(mechanism, (want,) if isinstance(want, str) else tuple(want))
    result = mechanism.run(
        at,
        samples=samples,
        times=times,
        rates=rates,
        accelerations=accelerations,
        want=names,
        friction=friction,
        tolerance=tolerance,
        iterations=iterations,
        static=static,
        on_gap=on_gap,
    )
    asked = _asked(mechanism, result, (to,) if isinstance(to, str) else tuple(to))
    family, left_out = _separated(mechanism, asked, to)
    chosen = {a: p for a, p in asked.items() if a not in left_out}
    general = family.planned_for(p for p in chosen.values() if p.path[0] != GIVEN)
    for block in (b for b, x in mechanism.structure.blocks.items() if x.own_form):
        general.structure.paths[block] = path_of(mechanism.structure, block)
    plan = general.plan(names, **result.settings)
    for address in [] if _varies(plan, family, chosen) else list(chosen):
        if not _varies(plan, family, {address: chosen[address]}):
            left_out[address] = "the pieces of its table follow it by no formula"
            del chosen[address]
    if not chosen:
        raise RequestError([Problem("no-derivative", a, why) for a, why in left_out.items()])
    ahead, behind = (
        {name: side * d for name, d in _derived(plan, family, chosen, result, side).items()}
        for side in (1.0, -1.0)
    )
    return Sensitivity(result, chosen, ahead, behind, left_out)


def _numbers(
    plan: Plan, family: Family, chosen: Mapping[str, Parameter], side: float
) -> tuple[Any, ...]:
    """The parameters of a program, with tangents in the directions of the chosen numbers."""
    seeds = side * np.eye(len(chosen))[..., None]
    numbers = {
        p: Dual(np.float64(p.value), seed)
        for p, seed in zip(chosen.values(), seeds, strict=True)
        if p.path[0] != GIVEN
    }
    with np.errstate(all="ignore"):
        return plan.program.values(*family.design(numbers))


def _varies(plan: Plan, family: Family, chosen: Mapping[str, Parameter]) -> bool:
    """Whether all parameters of a program have derivatives by the chosen numbers."""
    try:
        _numbers(plan, family, chosen, 1.0)
    except RequestError:
        return False
    return True


def _derived(
    plan: Plan, family: Family, chosen: Mapping[str, Parameter], result: Result, side: float
) -> dict[str, Array]:
    """Derivatives (m, n) of the outputs of a result in the directions of the chosen numbers."""
    shape = len(chosen), result.n
    inputs = dict(result.samples.given(plan.program.inputs))
    for j, p in enumerate(chosen.values()):
        if p.path[0] == GIVEN and (name := str(p.path[1])) in inputs:
            seed = np.zeros(shape)
            seed[j] = side
            inputs[name] = Dual(np.asarray(inputs[name], float), seed)
    engine, numbers = DualEngine(plan.program), _numbers(plan, family, chosen, side)
    values = engine.run(inputs, numbers, result.n, len(chosen))
    found = {}
    for name in result:
        columns = [values[i] for i in plan.layout[name]]
        with np.errstate(all="ignore"):
            d = _read(result.output(name), columns, shape)
        found[name] = np.where(np.isnan(result[name]), np.nan, d)
    return found


def _read(output: Output, columns: list[Any], shape: tuple[int, int]) -> Array:
    made = output.read(*columns)
    if output.kind == "vector":
        return np.asarray(slope(made.real) + 1j * slope(made.imag)) + np.zeros(shape)
    return np.asarray(np.broadcast_to(slope(made), shape))


def _differentiable(mechanism: Compiled, patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Outputs that patterns name; those that have no derivative only where named one by one."""
    outputs = mechanism.outputs
    names = [n for n in outputs.match(patterns) if outputs[n].kind in ("real", "vector")]
    wrong = [n for n in patterns if n in outputs and outputs[n].kind not in ("real", "vector")]
    if wrong or not names:
        found = "derivatives are of outputs that are a number or a vector a sample"
        raise RequestError([Problem("no-derivative", n, found) for n in wrong or patterns])
    return tuple(names)


def _asked(mechanism: Compiled, result: Result, patterns: tuple[str, ...]) -> dict[str, Parameter]:
    """The numbers that addresses and patterns name."""
    known = parameters_of(sections_of(mechanism))
    every = {**known, **_of_drivers(mechanism, result)}
    found: dict[str, Parameter] = {}
    for pattern in patterns:
        near = known if pattern == EVERY_NUMBER else every
        fits = {a: p for a, p in near.items() if a != pattern and fnmatch.fnmatchcase(a, pattern)}
        found |= fits or {p.address: p for p in named(every, {pattern: None})}
    return found


def _separated(
    mechanism: Compiled, asked: Mapping[str, Parameter], to: Iterable[str] | str
) -> tuple[Family, dict[str, str]]:
    """The family of the numbers, and why some have no derivative: of those named, an error."""
    left_out = {a: why for a, p in asked.items() if (why := _chooses(p))}
    numbers = [a for a, p in asked.items() if a not in left_out and p.path[0] != GIVEN]
    family = Family(mechanism, numbers)
    for p in family.parameters:
        places = family.places[p]
        if not places:
            left_out[p.address] = "it goes through the geometry of the document"
        elif any(path[0] == "scene" and path[1] not in BATCHED for path in places):
            left_out[p.address] = "it says how the drivers move: name their coordinate or rate"
    if wrong := [a for a in left_out if a in ((to,) if isinstance(to, str) else to)]:
        raise RequestError([Problem("no-derivative", a, left_out[a]) for a in wrong])
    return family, left_out


def _of_drivers(mechanism: Compiled, result: Result) -> dict[str, Parameter]:
    """Coordinate, rate and acceleration of each driver as numbers; as large as they become."""
    found = {}
    for i, driver in enumerate(mechanism.drivers):
        for what, name in INPUTS.items():
            address, key = mechanism.of_driver(driver, what), f"{name}_{i}"
            size = float(np.abs(np.asarray(result.samples.inputs[key], float)).max(initial=0.0))
            unit = mechanism.outputs[address].unit
            found[address] = Parameter(address, size, unit, (GIVEN, key))
    return found


def _chooses(p: Parameter) -> str:
    """Why a number only chooses between mechanisms; "" where it does not."""
    if isinstance(p.value, int):
        return "a whole number chooses, it does not grow"
    if {"home", "pose"} & set(p.path):
        return "a home only tells the assembly mode"
    return ""
