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

import numpy as np

from blockmech.analysis.deflections import Course
from blockmech.analysis.ranges import cycle_of
from blockmech.analysis.turning_points import signal_of, turns_of
from blockmech.compiled import Compiled
from blockmech.engines.derivatives import Dual, DualEngine, slope
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, refused
from blockmech.ground.plane import REST_SHARE
from blockmech.ground.runnable import EVERYTHING
from blockmech.ground.tolerances import ROUNDING
from blockmech.model.joints.layout import NO_CENTRE, massless_welds
from blockmech.model.joints.linkage import Linkage
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
    rest_slopes,
    wanted,
)
from blockmech.studies.sampling import as_sequence
from blockmech.studies.sensitivity import Sensitivity, size_of
from blockmech.studies.variation import GIVEN, Variation, is_sided, moves_drivers
from blockmech.typing import (
    Arguments,
    Array,
    Coordinates,
    Data,
    FrictionMethod,
    Numbers,
    OnGap,
    Reals,
    Values,
)

STEP = (16 * ROUNDING) ** 0.25  # of a number, for differences of courses
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
    want : names or patterns of outputs; ``.x`` or ``.y`` after the name of a vector is its
        component; or reductions over the samples as in a study, ``max_abs(crank.drive)``,
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

    >>> print(mech.sensitivity("crank.drive", ["dyad.l_i", "dyad.l_j"], at=0.5))
    crank.drive [N m]
    number    value  largest derivative  by 1 %
    dyad.l_i  6 m    2869.09 N m/m       172
    dyad.l_j  3 m    -1987.84 N m/m      59.6
    """
    patterns, to = as_sequence("want", want), as_sequence("to", to)
    poses = {"samples": samples, "times": times, "rates": rates, "accelerations": accelerations}
    settings = {"friction": friction, "static": static}
    arguments: Arguments = {**poses, **settings}
    if any(map(is_reduction, patterns)):
        return _of_reductions(mechanism, patterns, to, at, arguments, on_gap)
    names = _differentiable(mechanism, patterns)
    result = mechanism.run(at, want=names, on_gap=on_gap, **arguments)
    parameters, alone = _named_numbers(mechanism, result, to)
    excluded = {a: why for a, p in parameters.items() if (why := without_derivative(p))}
    has_friction = result.settings["friction"] != "none" and bool(mechanism.frictional_joints)
    sided = {a: is_sided(mechanism, p.path) for a, p in parameters.items() if not p.value}
    borders = [a for a, at_side in sided.items() if at_side is False or (at_side and has_friction)]
    excluded |= dict.fromkeys(borders, "zero of it is another kind of contact")
    if isinstance(mechanism.document, Linkage):
        centreless = (f"links.{link}.mass" for link in massless_welds(mechanism.document))
        excluded |= {a: NO_CENTRE for a in centreless if a in parameters}
    chosen = {a: p for a, p in parameters.items() if a not in excluded}
    variation = Variation.of(mechanism, chosen.values())
    if gone := _missing(names, variation, patterns):
        result = mechanism.run(
            at, want=[n for n in names if n not in gone], on_gap=on_gap, **arguments
        )
    plan = variation.general.plan(tuple(result), **result.settings)
    seeds = np.diag([size_of(p, chosen.values()) for p in chosen.values()])
    if not _varies(plan, variation, seeds):
        bad = [
            a for a, seed in zip(chosen, seeds, strict=True) if not _varies(plan, variation, seed)
        ]
        excluded |= dict.fromkeys(bad, "the pieces of its table follow it by no formula")
        seeds = seeds[[a not in bad for a in chosen]]
        chosen = {a: p for a, p in chosen.items() if a not in bad}
    if wrong := excluded.keys() & alone if chosen else excluded.keys():
        raise RequestError(
            [Problem("no-derivative", a, why) for a, why in excluded.items() if a in wrong]
        )
    bent = _deflections(result, plan, chosen)
    forward, going = _derived(plan, variation, seeds, chosen, result, bent)
    behind, _ = _derived(plan, variation, -seeds, chosen, result, bent)
    none = np.zeros((len(chosen), result.n), bool)
    jumps = dict.fromkeys(forward, none)
    if any(x.any() for x in going.values()):
        for name in forward:  # whose own plan tells which friction it follows
            rest_pairs = variation.general.plan([name], **result.settings).reports["rest"]
            jumps[name] = np.any(
                [none, *(x for pair, x in going.items() if pair in rest_pairs)], axis=0
            )
    excluded |= gone
    return Sensitivity(result, chosen, forward, {x: -d for x, d in behind.items()}, jumps, excluded)


def program_numbers(plan: Plan, variation: Variation, seeds: Array) -> Values:
    """The parameters of a program, with tangents in directions (k, m) of what varies."""
    with np.errstate(all="ignore"):
        return plan.program.values(*variation.design(seeds))


def _of_reductions(
    mechanism: Compiled,
    patterns: Sequence[str],
    to: Sequence[str],
    at: Coordinates | None,
    arguments: Arguments,
    on_gap: OnGap,
) -> Sensitivity:
    """Derivatives of reductions, and of outputs that stand beside them."""
    plain = [n for n in patterns if not is_reduction(n)]
    order = ("samples", "times", "rates", "accelerations")
    samples = mechanism.samples(at, *(arguments[name] for name in order))
    columns = wanted(
        [n for n in patterns if is_reduction(n)], mechanism.outputs, samples, mechanism.drivers
    )
    if numbers := [w.label for w in columns if w.how == WHOLE]:
        why = "it is one number a turn, and has no derivative"
        raise RequestError([Problem("no-derivative", label, why) for label in numbers])
    names = [*plain, *dict.fromkeys(w.output for w in columns)]
    base = sensitivity(mechanism, names, to, at, on_gap=on_gap, **arguments)
    outputs = _differentiable(mechanism, plain) if plain else ()
    sides = ({n: side[n] for n in outputs} for side in (base.ahead, base.behind, base.jumps))
    forward, behind, jumps = sides
    values = {}
    settings = {k: arguments[k] for k in ("friction", "static")}
    for w in columns:
        at_poses, y, label = base, np.asarray(base.result[w.output]), w.label
        if w.how in EXTREMES and (turns := _extremes(base.result, w)):
            y, poses = turns
            at_poses = sensitivity(mechanism, w.output, tuple(base.parameters), **poses, **settings)
            y = np.asarray(at_poses.result[w.output]) if w.vector else y
        if w.how == STROKE:
            values[label], slopes = _stroke_slopes(base, w, settings)
            forward[label], behind[label] = slopes
        elif w.how == REST:
            slopes_of = rest_slopes(mechanism, samples, w.output, tuple(base.parameters))
            values[label], (forward[label], behind[label]) = slopes_of
        else:
            values[label] = w.value(y)
            forward[label] = w.slopes(y, at_poses.ahead[w.output])
            behind[label] = -w.slopes(y, -at_poses.behind[w.output])
        jumping = at_poses.jumps[w.output]
        jumps[label] = jumping if w.how == POSES else np.asarray(jumping.any(axis=1, keepdims=True))
    reduced = {w.label: (w, values[w.label]) for w in columns}
    return replace(base, ahead=forward, behind=behind, jumps=jumps, reduced=reduced)


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
    if not np.isfinite(y[some]).all():
        raise refused(w.label, "it grows without bound", "study it away from the pole")
    return y[some], cycle.request(np.array([turn.s for turn in every])[some])


def _stroke_slopes(
    base: Sensitivity, w: Wanted, settings: Arguments
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
        names = [run.mechanism._of_driver(d, "q") for d in drivers]
        poses = {"at": {d: [e.at[q] for e in ends] for d, q in zip(drivers, names, strict=True)}}
    at_ends = sensitivity(run.mechanism, w.output, tuple(base.parameters), **poses, **settings)
    low, high = np.asarray(at_ends.result[w.output])
    direction = (high - low) / abs(high - low) if w.vector else 1.0

    def change(d: Array) -> Array:
        return np.asarray((np.conj(direction) * (d[:, 1:] - d[:, :1])).real)

    sides = change(at_ends.ahead[w.output]), change(at_ends.behind[w.output])
    return np.array([moved.length]), sides


def chosen_numbers(mechanism: Compiled, addresses: Sequence[str]) -> dict[str, Parameter]:
    """Numbers by address that have a derivative. Raises `RequestError` for those that have none."""
    chosen = {p.address: p for p in named(parameters(mechanism), dict.fromkeys(addresses))}
    if wrong := {a: why for a, p in chosen.items() if (why := without_derivative(p))}:
        raise RequestError([Problem("no-derivative", a, why) for a, why in wrong.items()])
    return chosen


def _varies(plan: Plan, variation: Variation, seeds: Array) -> bool:
    """Whether all parameters of a program have derivatives in some directions."""
    try:
        program_numbers(plan, variation, np.atleast_2d(seeds))
    except RequestError:
        return False
    return True


def _deflections(
    result: Result, plan: Plan, chosen: Mapping[str, Parameter]
) -> dict[str, tuple[Array, Array]]:
    """States (n,) of friction laws that a program reads, and their derivatives (k, n)."""
    m, samples = result.mechanism, result.samples
    names = (f"{STATE}{m.structure.states[ref]}" for ref in m.structure.remembering)
    read = {i: name for i, name in enumerate(names) if name in plan.program.inputs}
    if not read:
        return {}
    course = m._once(Course)
    states = {i: course.of(i, samples) for i in read}
    slopes = {i: np.zeros((len(chosen), result.n)) for i in read}
    for (j, p), offset in itertools.product(enumerate(chosen.values()), CENTRAL):
        if p.path[0] == GIVEN:
            continue  # they are held, as rates are
        step = STEP * (abs(p.value) or 1.0)
        shifted = remade(m, {p.address: p.value + offset * step})._once(Course)
        for i in read:
            if not shifted.same(i, course):
                slopes[i][j] += CENTRAL[offset] / step * (shifted.of(i, samples) - states[i])
    return {name: (states[i], slopes[i]) for i, name in read.items()}


def _derived(
    plan: Plan,
    variation: Variation,
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
    sampled, drivers = result.samples.given(plan.program.inputs), result.mechanism.drivers
    inputs = dict(sampled)
    for (i, driver), x in itertools.product(enumerate(variation.base.drivers), INPUTS.values()):
        inputs[f"{x}_{i}"] = sampled[f"{x}_{drivers.index(driver)}"]
    inputs |= {name: Dual(z, seeds @ slopes) for name, (z, slopes) in bent.items()}
    for j, p in enumerate(chosen.values()):
        if p.path[0] == GIVEN:
            _, x, driver = map(str, p.path)
            name, seed = f"{x}_{variation.base.drivers.index(driver)}", np.zeros(shape)
            seed[j] = seeds[j].sum()
            inputs[name] = Dual(np.asarray(inputs[name], float), seed)
    values = DualEngine(plan.program).run(
        inputs, program_numbers(plan, variation, seeds), *shape[::-1]
    )
    derivatives, outputs = {}, variation.outputs(seeds)
    sizes = np.abs(seeds).sum(axis=1, keepdims=True)
    for name in result:
        columns = [values[i] for i in plan.layout[name]]
        with np.errstate(all="ignore"):
            d = _output_slopes(outputs[name], columns, shape)
        derivatives[name] = np.where(np.isnan(result[name]), np.nan, d / sizes)
    slips = {pair: slope(values[at[0]]) for pair, at in plan.reports["rest"].items()}
    return derivatives, {pair: np.abs(d) > REST_SHARE for pair, d in slips.items()}


def _output_slopes(output: Output, columns: Reals, shape: tuple[int, int]) -> Array:
    value = output.read(*columns)
    if output.kind == "vector":
        return np.asarray(slope(value.real) + 1j * slope(value.imag)) + np.zeros(shape)
    return np.asarray(np.broadcast_to(slope(value), shape))


def _differentiable(mechanism: Compiled, patterns: Sequence[str]) -> tuple[str, ...]:
    """Outputs that patterns name; those that have no derivative only where named one by one."""
    outputs = mechanism.outputs
    names = [n for n in outputs.match(patterns) if outputs[n].kind in ("real", "vector")]
    wrong = [n for n in patterns if n in outputs and outputs[n].kind not in ("real", "vector")]
    if wrong or not names:
        message = "derivatives are of outputs that are a number or a vector a sample"
        raise RequestError([Problem("no-derivative", n, message) for n in wrong or patterns])
    return tuple(names)


def _missing(names: Sequence[str], variation: Variation, alone: Sequence[str]) -> dict[str, str]:
    """Outputs that no design near by has, and why: of a dyad by chance its transmission angle.

    Raises `RequestError` for those that are named one by one, and where no others are.
    """
    why = "designs near by do not have it: what coincides here by chance does not there"
    gone = dict.fromkeys((n for n in names if n not in variation.general.outputs), why)
    if wrong := gone if len(gone) == len(names) else gone.keys() & set(alone):
        raise RequestError([Problem("no-derivative", n, why) for n in sorted(wrong)])
    return gone


def _named_numbers(
    mechanism: Compiled, result: Result, patterns: Sequence[str]
) -> tuple[dict[str, Parameter], set[str]]:
    """The numbers that addresses and patterns name, and which are named one by one."""
    numbers = parameters(mechanism)
    # Coordinate, rate and acceleration of each driver as numbers; as large as they become.
    parameters_ = {}
    for i, driver in enumerate(mechanism.drivers):
        for quantity, name in INPUTS.items():
            address = mechanism._of_driver(driver, quantity)
            column = result.samples.inputs[f"{name}_{i}"]
            size = float(np.abs(np.asarray(column, float)).max(initial=0.0))
            unit = mechanism.outputs[address].unit
            parameters_[address] = Parameter(address, size, unit, (GIVEN, name, driver))
    return fitting(numbers, patterns, parameters_)


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
