"""Derivatives of outputs by the numbers of a design, exact to rounding.

One run on dual numbers gives them for all samples, outputs and numbers at once, joint
friction included. A second run in the opposite directions tells where an output has a kink.
Rates and accelerations of the drivers are held, also where the driver's coordinate turns.

The states of friction laws along a given motion are integrals of it: their own derivatives, which
dual numbers take from there, are differences of fourth order of the courses of designs near by.

Source: `blockmech.engines.derivatives`.
"""

from __future__ import annotations

import fnmatch
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.deflections import Course
from blockmech.analysis.ranges import cycle_of
from blockmech.analysis.turning_points import signal_of, turns_of
from blockmech.compiled import Compiled
from blockmech.engines.derivatives import DualEngine
from blockmech.engines.dual import Dual, slope
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, refused
from blockmech.ground.plane import REST_SHARE
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.parameters import Parameter, named
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Output, Plan
from blockmech.result.result import Result
from blockmech.studies.family import parameters, remade
from blockmech.studies.reductions import (
    EXTREMES,
    POSES,
    REST,
    STROKE,
    WHOLE,
    Wanted,
    is_reduction,
    wanted,
)
from blockmech.studies.rests import rest_slopes
from blockmech.studies.sampling import as_sequence
from blockmech.studies.sensitivity import Sensitivity, size_of
from blockmech.studies.variation import GIVEN, Variation, moves_drivers
from blockmech.typing import Arguments, Coordinates, Data, FrictionMethod, Numbers, OnGap

Array = NDArray[Any]
STEP = 2.0**-9  # of a number, for differences of courses known to some 1e-11
CENTRAL = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
INPUTS = {"q": "q", "rate": "qd", "acceleration": "qdd"}  # output of a driver -> program input


@declared
def sensitivity(
    mechanism: Compiled,
    want: Iterable[str] | str,
    to: Iterable[str] | str = EVERYTHING,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    friction: FrictionMethod | None = None,
    static: bool = False,
    on_gap: OnGap = "raise",
) -> Sensitivity:
    """Derivatives of outputs by numbers of the design and by coordinates of the drivers.

    Exact to rounding. Rates and accelerations of the drivers are held.

    Parameters
    ----------
    want : names or patterns of outputs; ``.x`` or ``.y`` behind a vector's is that part of it;
        or reductions of them over the samples as those of a study, ``max_abs(crank.drive)``,
        ``stroke(slider.C.p)``
    to : addresses or patterns of numbers (`Mechanism.parameters`), and of drivers their
        ``crank.q``, ``crank.rate``, ``crank.acceleration``; by default all numbers
    at, samples, times, rates, accelerations : the samples, as those of a run
    friction, static, on_gap : as those of a run

    Returns
    -------
    Sensitivity, ranked when shown

    Raises
    ------
    RequestError for unknown names, and for outputs or numbers without a derivative
    AssemblyError, SingularError, FrictionError at gaps, unless marked
    """
    asked_for, to = as_sequence("want", want), as_sequence("to", to)
    poses = {"samples": samples, "times": times, "rates": rates, "accelerations": accelerations}
    how = {"friction": friction, "static": static}
    given: Arguments = {**poses, **how}
    if any(map(is_reduction, asked_for)):
        return _of_reductions(mechanism, asked_for, to, at, given, on_gap)
    names = _differentiable(mechanism, asked_for)
    result = mechanism.run(at, want=names, on_gap=on_gap, **given)
    parameters, alone = _asked(mechanism, result, to)
    left_out = {a: why for a, p in parameters.items() if (why := without_derivative(p))}
    chosen = {a: p for a, p in parameters.items() if a not in left_out}
    near = Variation.of(mechanism, chosen.values())
    if gone := _gone(names, near, asked_for):
        result = mechanism.run(at, want=[n for n in names if n not in gone], on_gap=on_gap, **given)
    plan = near.general.plan(tuple(result), **result.settings)
    seeds = np.diag([size_of(p, chosen.values()) for p in chosen.values()])
    if not _varies(plan, near, seeds):
        bad = [a for a, seed in zip(chosen, seeds, strict=True) if not _varies(plan, near, seed)]
        left_out |= dict.fromkeys(bad, "the pieces of its table follow it by no formula")
        seeds = seeds[[a not in bad for a in chosen]]
        chosen = {a: p for a, p in chosen.items() if a not in bad}
    if wrong := left_out.keys() & alone if chosen else left_out.keys():
        raise RequestError(
            [Problem("no-derivative", a, why) for a, why in left_out.items() if a in wrong]
        )
    bent = _deflections(result, plan, chosen)
    ahead, going = _derived(plan, near, seeds, chosen, result, bent)
    behind, _ = _derived(plan, near, -seeds, chosen, result, bent)
    none = np.zeros((len(chosen), result.n), bool)
    jumps = dict.fromkeys(ahead, none)
    if any(x.any() for x in going.values()):
        for name in ahead:  # whose own plan tells which friction it follows
            own = near.general.plan([name], **result.settings).reports["rest"]
            jumps[name] = np.any([none, *(x for pair, x in going.items() if pair in own)], axis=0)
    left_out |= gone
    return Sensitivity(result, chosen, ahead, {x: -d for x, d in behind.items()}, jumps, left_out)


def program_numbers(plan: Plan, near: Variation, seeds: Array) -> tuple[Any, ...]:
    """The parameters of a program, with tangents in directions (k, m) of what varies."""
    with np.errstate(all="ignore"):
        return plan.program.values(*near.design(seeds))


def _of_reductions(
    mechanism: Compiled,
    asked_for: Sequence[str],
    to: Sequence[str],
    at: Any,
    given: Arguments,
    on_gap: OnGap,
) -> Sensitivity:
    """Derivatives of reductions, and of outputs that stand beside them."""
    plain = [n for n in asked_for if not is_reduction(n)]
    order = ("samples", "times", "rates", "accelerations")
    taken = mechanism.samples(at, *(given[name] for name in order))
    columns = wanted(
        [n for n in asked_for if is_reduction(n)], mechanism.outputs, taken, mechanism.drivers
    )
    if numbers := [w.label for w in columns if w.how == WHOLE]:
        why = "it is one number a turn, and has no derivative"
        raise RequestError([Problem("no-derivative", label, why) for label in numbers])
    names = [*plain, *dict.fromkeys(w.output for w in columns)]
    base = sensitivity(mechanism, names, to, at, on_gap=on_gap, **given)
    kept = _differentiable(mechanism, plain) if plain else ()
    sides = ({n: side[n] for n in kept} for side in (base.ahead, base.behind, base.jumps))
    ahead, behind, jumps = sides
    values = {}
    how = {k: given[k] for k in ("friction", "static")}
    for w in columns:
        y, label = np.asarray(base.result[w.output]), w.label
        jumping = base.jumps[w.output]
        if w.how == STROKE:
            values[label], slopes = _stroke_slopes(base, w, how)
            ahead[label], behind[label] = slopes
        elif w.how in EXTREMES and (turns := _extremes(base.result, w)):
            y, poses = turns
            there = sensitivity(mechanism, w.output, tuple(base.parameters), **poses, **how)
            y = np.asarray(there.result[w.output]) if w.vector else y
            jumping = there.jumps[w.output]
            values[label] = w.value(y)
            ahead[label] = w.slopes(y, there.ahead[w.output])
            behind[label] = -w.slopes(y, -there.behind[w.output])
        elif w.how == REST:
            slopes_of = rest_slopes(mechanism, taken, w.output, tuple(base.parameters))
            values[label], (ahead[label], behind[label]) = slopes_of
        else:
            values[label] = w.value(y)
            ahead[label] = w.slopes(y, base.ahead[w.output])
            behind[label] = -w.slopes(y, -base.behind[w.output])
        jumps[label] = jumping if w.how == POSES else np.asarray(jumping.any(axis=1, keepdims=True))
    reduced = {w.label: (w, values[w.label]) for w in columns}
    return replace(base, ahead=ahead, behind=behind, jumps=jumps, reduced=reduced)


def _extremes(run: Result, w: Wanted) -> tuple[Array, Data] | None:
    """Extremes of an output over the range of a run, of those that are alike all, and the request
    for the poses where they are; None where the samples are no range."""
    try:
        cycle = cycle_of(run)
    except RequestError:
        return None
    turns = turns_of(cycle, signal_of(cycle, w.output, "magnitude" if w.vector else ""))
    every = turns.low, turns.high, *turns.inner
    y = np.array([turn.value for turn in every])
    size = np.abs(y) if w.how == "max_abs" else y
    some = np.zeros(len(y), bool)
    for sign in EXTREMES[w.how]:
        some |= np.isclose(size, sign * (sign * size).max(), rtol=REST_SHARE, atol=0.0)
    places = np.array([turn.s for turn in every])
    return y[some], cycle.request(places[some])


def _stroke_slopes(
    base: Sensitivity, w: Wanted, how: Arguments
) -> tuple[Array, tuple[Array, Array]]:
    """A stroke and its derivatives (k, 1) to both sides: those of its ends, where they are.

    An end is an extreme position, so where it is does not count in first order.
    """
    run = base.result
    moved = run.stroke(w.output)
    if moved.path == "curved":
        raise refused(w.label, "a stroke along a curve has no derivative", "take a part of it")
    ends = moved.low, moved.high
    if run.samples.times is not None:
        poses: Arguments = {"times": [float(end.time or 0.0) for end in ends]}
    else:
        drivers = run.mechanism.drivers
        places = [run.mechanism._of_driver(d, "q") for d in drivers]
        poses = {"at": {d: [e.at[q] for e in ends] for d, q in zip(drivers, places, strict=True)}}
    there = sensitivity(run.mechanism, w.output, tuple(base.parameters), **poses, **how)
    low, high = np.asarray(there.result[w.output])
    along = (high - low) / abs(high - low) if w.vector else 1.0

    def change(d: Array) -> Array:
        return np.asarray((np.conj(along) * (d[:, 1:] - d[:, :1])).real)

    sides = change(there.ahead[w.output]), change(there.behind[w.output])
    return np.array([moved.length]), sides


def chosen_numbers(mechanism: Compiled, addresses: Sequence[str]) -> dict[str, Parameter]:
    """Numbers by address that have a derivative. Raises `RequestError` for those that have none."""
    chosen = {p.address: p for p in named(parameters(mechanism), dict.fromkeys(addresses))}
    if wrong := {a: why for a, p in chosen.items() if (why := without_derivative(p))}:
        raise RequestError([Problem("no-derivative", a, why) for a, why in wrong.items()])
    return chosen


def _varies(plan: Plan, near: Variation, seeds: Array) -> bool:
    """Whether all parameters of a program have derivatives in some directions."""
    try:
        program_numbers(plan, near, np.atleast_2d(seeds))
    except RequestError:
        return False
    return True


def _deflections(
    result: Result, plan: Plan, chosen: Mapping[str, Parameter]
) -> dict[str, tuple[Array, Array]]:
    """States (n,) of friction laws that a program reads, and their derivatives (k, n)."""
    m, taken = result.mechanism, result.samples
    names = (f"{STATE}{m.structure.states[ref]}" for ref in m.structure.remembering)
    read = {i: name for i, name in enumerate(names) if name in plan.program.inputs}
    if not read:
        return {}
    own = m._once(Course)
    here = {i: own.of(i, taken) for i in read}
    slopes = {i: np.zeros((len(chosen), result.n)) for i in read}
    for (j, p), place in itertools.product(enumerate(chosen.values()), CENTRAL):
        if p.path[0] == GIVEN:
            continue  # they are held, as rates are
        step = STEP * (abs(p.value) or 1.0)
        there = remade(m, {p.address: p.value + place * step})._once(Course)
        for i in read:
            if not there.same(i, own):
                slopes[i][j] += CENTRAL[place] / step * (there.of(i, taken) - here[i])
    return {name: (here[i], slopes[i]) for i, name in read.items()}


def _derived(
    plan: Plan,
    near: Variation,
    seeds: Array,
    chosen: Mapping[str, Parameter],
    result: Result,
    bent: Mapping[str, tuple[Array, Array]],
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Derivatives (k, n) of the outputs of a result, each in the direction of a chosen number.

    ``seeds`` (k, k) change each number by its own size; ``bent`` are the states of friction laws
    with their derivatives. And of pairs with friction, whether (k, n) they rest and the number
    sets them going.
    """
    shape = len(chosen), result.n
    given, own = result.samples.given(plan.program.inputs), result.mechanism.drivers
    inputs = dict(given)
    for (i, driver), x in itertools.product(enumerate(near.base.drivers), INPUTS.values()):
        inputs[f"{x}_{i}"] = given[f"{x}_{own.index(driver)}"]
    inputs |= {name: Dual(z, seeds @ slopes) for name, (z, slopes) in bent.items()}
    for j, p in enumerate(chosen.values()):
        if p.path[0] == GIVEN:
            _, x, driver = map(str, p.path)
            name, seed = f"{x}_{near.base.drivers.index(driver)}", np.zeros(shape)
            seed[j] = seeds[j].sum()
            inputs[name] = Dual(np.asarray(inputs[name], float), seed)
    values = DualEngine(plan.program).run(inputs, program_numbers(plan, near, seeds), *shape[::-1])
    derivatives, outputs = {}, near.outputs(seeds)
    sizes = np.abs(seeds).sum(axis=1, keepdims=True)
    for name in result:
        columns = [values[i] for i in plan.layout[name]]
        with np.errstate(all="ignore"):
            d = _read(outputs[name], columns, shape)
        derivatives[name] = np.where(np.isnan(result[name]), np.nan, d / sizes)
    slips = {pair: slope(values[at[0]]) for pair, at in plan.reports["rest"].items()}
    return derivatives, {pair: np.abs(d) > REST_SHARE for pair, d in slips.items()}


def _read(output: Output, columns: list[Any], shape: tuple[int, int]) -> Array:
    made = output.read(*columns)
    if output.kind == "vector":
        return np.asarray(slope(made.real) + 1j * slope(made.imag)) + np.zeros(shape)
    return np.asarray(np.broadcast_to(slope(made), shape))


def _differentiable(mechanism: Compiled, patterns: Sequence[str]) -> tuple[str, ...]:
    """Outputs that patterns name; those that have no derivative only where named one by one."""
    outputs = mechanism.outputs
    names = [n for n in outputs.match(patterns) if outputs[n].kind in ("real", "vector")]
    wrong = [n for n in patterns if n in outputs and outputs[n].kind not in ("real", "vector")]
    if wrong or not names:
        found = "derivatives are of outputs that are a number or a vector a sample"
        raise RequestError([Problem("no-derivative", n, found) for n in wrong or patterns])
    return tuple(names)


def _gone(names: Sequence[str], near: Variation, alone: Sequence[str]) -> dict[str, str]:
    """Outputs that no design near by has, and why: of a dyad by chance its transmission angle.

    Raises `RequestError` for those that are named one by one, and where no others are.
    """
    why = "designs near by do not have it: what coincides here by chance does not there"
    gone = dict.fromkeys((n for n in names if n not in near.general.outputs), why)
    if wrong := gone if len(gone) == len(names) else gone.keys() & set(alone):
        raise RequestError([Problem("no-derivative", n, why) for n in sorted(wrong)])
    return gone


def _asked(
    mechanism: Compiled, result: Result, patterns: Sequence[str]
) -> tuple[dict[str, Parameter], set[str]]:
    """The numbers that addresses and patterns name, and which are named one by one."""
    known = parameters(mechanism)
    # Coordinate, rate and acceleration of each driver as numbers; as large as they become.
    parameters_ = {}
    for i, driver in enumerate(mechanism.drivers):
        for what, name in INPUTS.items():
            address, given = (
                mechanism._of_driver(driver, what),
                result.samples.inputs[f"{name}_{i}"],
            )
            size = float(np.abs(np.asarray(given, float)).max(initial=0.0))
            unit = mechanism.outputs[address].unit
            parameters_[address] = Parameter(address, size, unit, (GIVEN, name, driver))
    return fitting(known, patterns, parameters_)


def fitting(
    known: Mapping[str, Parameter], patterns: Iterable[str], more: Mapping[str, Parameter] = {}
) -> tuple[dict[str, Parameter], set[str]]:
    """The numbers that addresses and patterns name, and which are named one by one.

    ``more`` are those that "*" alone does not name.
    """
    chosen: dict[str, Parameter] = {}
    alone: set[str] = set()
    every = {**known, **more}
    for pattern in patterns:
        near = known if pattern in EVERYTHING else every
        fits = {a: p for a, p in near.items() if a != pattern and fnmatch.fnmatchcase(a, pattern)}
        one = {} if fits else {p.address: p for p in named(every, {pattern: None})}
        chosen |= fits or one
        alone |= one.keys()
    return chosen, alone


def without_derivative(p: Parameter) -> str:
    """Why a number has no derivative; "" where it may have one."""
    if isinstance(p.value, int):
        return "a whole number chooses, it does not grow"
    if {"home", "pose"} & set(p.path):
        return "a home only tells the assembly mode"
    if p.path[0] != GIVEN and moves_drivers(p.path):
        return "it says how the drivers move: name their coordinate or rate"
    return ""
