r"""Effort, rates of signals and outputs at one state, with exact derivatives by all of it.

One program gives the driving effort u, the rates g of the states x of signal blocks, and outputs
y, as functions of coordinates, rates and accelerations of the drivers, of x, and of numbers of
the design. Run on dual numbers it gives their derivatives; what signals feed back, through any
sensor, is in them.

Source: `blockmech.engines.derivatives`; Ogata, Modern Control Engineering, 2010, section 2-7.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from blockmech.compiled import Compiled
from blockmech.dynamics.source import margins
from blockmech.engines.derivatives import WITH_DIFFERENCES, Dual, DualEngine, slope, value
from blockmech.ground.errors import refused
from blockmech.model.parameters import Parameter
from blockmech.passes import forces, reduction, signals
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.signals.contract import HELD
from blockmech.studies.variation import Variation
from blockmech.typing import Arguments, Floats

MOTION = ("q", "qd", "qdd")


class Derivatives(NamedTuple):
    """Values at one state, and derivatives by q, q', q'' of k drivers, x (n), numbers (m).

    effort, rates, outputs : (k,), (n,), (r,)
    by : rows of effort, rates and outputs, columns in that order (k + n + r, 3k + n + m)
    margin : [-] of the pose, not positive where it cannot be
    """

    effort: Floats
    rates: Floats
    outputs: Floats
    by: Floats
    margin: float


def states_and_sources(mechanism: Compiled) -> tuple[dict[str, int], dict[str, int]]:
    """Numbers in x by name: of states of signals, and of outputs held from outside.

    States move by themselves, ``pid.integral``; blocks without inputs are held, ``setpoint.y``.
    """
    states, sources = dict[str, int](), dict[str, int]()
    for ref, i in mechanism.structure.states.items():
        if ref.block in mechanism.structure.signals:
            of = sources if ref.name.startswith(HELD) else states
            of[f"{ref.block}.{ref.name.removeprefix(HELD)}"] = i
    return states, sources


def refuse_sampled(mechanism: Compiled) -> None:
    """Raise `RequestError` for signal blocks that are discrete in time."""
    for name, block in mechanism.structure.signals.items():
        if block.discrete and block.inputs:
            remedy = "take its sample away: the linear model is in continuous time"
            raise refused(name, "its output jumps at instants", remedy)


def initial_states(mechanism: Compiled, t: float) -> Floats:
    """States (n,) of signal blocks where they begin, those held from outside as at a time [s]."""
    count = sum(map(len, states_and_sources(mechanism)))
    x = np.array(mechanism.structure.initial_states[:count], float)
    s = schedule(mechanism.structure, mechanism.scene, Friction("none"))
    places = mechanism.structure.states
    held = {places[ref]: text for ref, text in s.ask(signals.updated).items()}
    if held:
        program = s.program(held.values())
        engine = DualEngine(program, WITH_DIFFERENCES)
        inputs = {name: np.array([t]) for name in program.inputs}
        values = engine.run(inputs, tuple(program.parameters.values()), 1, 0)
        x[[*held]] = [float(np.ravel(value(v))[0]) for v in values]
    return x


def derivatives_at(
    mechanism: Compiled,
    motion: Sequence[Floats],
    x: Floats,
    t: float,
    *,
    outputs: Sequence[str] = (),
    numbers: Mapping[str, Parameter],
    friction: bool = False,
) -> Derivatives:
    """Effort, rates of signals and outputs with their derivatives.

    ``motion`` are q, q', q'' (k,) of the drivers; ``friction`` puts that of joints that slip
    into all of it.
    """
    near = Variation.of(mechanism, numbers.values())
    general = near.general if numbers else mechanism
    structure, drivers = general.structure, mechanism.drivers
    s = schedule(structure, general.scene, Friction("newton" if friction else "none"))
    rule = forces.drive if friction else reduction.drive_by_reduction
    texts = [*(s.ask(rule, d) for d in drivers), *signals.rates(s)]
    layout = {}
    for name in outputs:
        wanted = list(general.outputs[name].ask(s))
        layout[name] = slice(len(texts), len(texts) + len(wanted))
        texts += wanted
    first = len(texts)
    program = s.program([*texts, *margins(s)])
    k, n, m = len(drivers), len(x), len(numbers)
    width = 3 * k + n + m
    seeds = np.eye(width)
    given: Arguments = {"t": np.array([t])}
    for i, (what, row) in enumerate(zip(MOTION, motion, strict=True)):
        for j, d in enumerate(drivers):
            name = f"{what}_{structure.drivers.index(d)}"
            given[name] = Dual(row[j : j + 1], seeds[:, i * k + j, None])
    for i in range(n):
        given[f"{signals.STATE}{i}"] = Dual(x[i : i + 1], seeds[:, 3 * k + i, None])
    parameters = tuple(program.parameters.values())
    if numbers:
        with np.errstate(all="ignore"):
            parameters = program.values(*near.design(seeds[:, 3 * k + n :]))
    columns = DualEngine(program, WITH_DIFFERENCES).run(
        {name: given[name] for name in program.inputs}, parameters, 1, width
    )
    read = near.outputs(seeds[:, 3 * k + n :])
    rows = [*columns[: k + n], *(read[name].read(*columns[at]) for name, at in layout.items())]
    y = np.array([float(np.ravel(value(v))[0]) for v in rows])
    by = np.array([np.broadcast_to(np.ravel(slope(v)), (width,)) for v in rows])
    margin = min([1.0, *(float(np.ravel(value(v))[0]) for v in columns[first:])])
    return Derivatives(y[:k], y[k : k + n], y[k + n :], by.reshape(-1, width), margin)
