"""The price of a plan: its lines counted, what is in use meanwhile, and its result."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.cost.counting import Counted, Tally, counting, counting_primitives
from blockmech.cost.weights import BATCH, COLUMN, CROWD, DRIVER, FEWEST, FRESH, LIVE, SAMPLES
from blockmech.engines.binding import bind_functions
from blockmech.engines.memory import most_kept
from blockmech.engines.numpy import NumpyEngine, Planar
from blockmech.engines.releasing import releasing
from blockmech.errors import RequestError
from blockmech.samples import Samples, make_samples

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.plan import Plan, Program

PROBE = 32  # samples on which operations are counted
NEAR = 1e-3  # [rad] or [m] around a start, where the mechanism is sure to close


class Line(NamedTuple):
    """What a line of a program costs.

    time : [ns] a sample, with few arrays in use
    operations : on arrays
    columns : of numbers that its value holds
    """

    time: float
    operations: float
    columns: int


class CostModel:
    """Costs of plans of one mechanism; lines that plans share are counted once."""

    def __init__(self, mechanism: Compiled) -> None:
        self.mechanism = mechanism
        self._lines: dict[str, Line] = {}
        self._columns: dict[str, int] = {}
        self._paths: dict[Any, Any] = {}

    def cost(self, plan: Plan) -> float:
        """Time per sample [ns] of a batch, by the weights."""
        program = plan.program
        known = all(text in self._lines for _, text in _lines(program))
        if not known or not all(text in self._columns for text in program.outputs):
            self._run(plan)
        columns = sum(self._columns[text] for text in program.outputs)
        fresh = 8 * BATCH * columns > most_kept()
        handed = columns * (COLUMN + FRESH * fresh)
        made = SAMPLES + DRIVER * (len(self.mechanism.drivers) - 1)
        return made + sum(self._times(program)) + handed

    def _times(self, program: Program) -> Iterator[float]:
        """[ns] a line, by the arrays that are in use beside it."""
        live: dict[str, int] = {}
        for text in releasing(program).source.splitlines()[1:-1]:
            if text.startswith(RELEASE):
                for name in text.removeprefix(RELEASE).split(", "):
                    live.pop(name, None)
                continue
            name, call = _parted(text)
            line = self._lines.get(call)  # none of parameters and of parts of a value
            if line is not None:
                in_use = max(sum(live.values()) + line.columns, FEWEST)
                yield line.time + CROWD * line.operations * math.log2(in_use / LIVE)
                live[name] = line.columns

    def _run(self, plan: Plan) -> None:
        """Run a plan's program line by line on counting arrays."""
        program = plan.program
        engine = NumpyEngine(program)
        space: dict[str, Any] = dict(engine.constants)
        space |= bind_functions(
            counting(program.functions, self._paths), counting_primitives(engine.dtype)
        )
        parameters = zip(program.parameters, engine.parameters, strict=True)
        space |= {name: _tables(value) for name, value in parameters}
        probe = _probe(self.mechanism)
        given = probe.given(program.inputs)
        for name in program.inputs:
            space[name] = np.asarray(given[name], dtype=float).view(Counted)
        with np.errstate(all="ignore"):
            for name, text in _lines(program):
                tally = Counted.tally = Tally()
                space[name] = eval(text, space)
                columns = _columns(space[name])
                self._lines.setdefault(text, Line(tally.time, tally.number, columns))
            for text in program.outputs:
                self._columns[text] = _columns(eval(text, space))


RELEASE = "    del "


def _lines(program: Program) -> Iterator[tuple[str, str]]:
    """Names of the values and the calls that make them."""
    parted = map(_parted, program.source.splitlines()[1:-1])
    return ((name, text) for name, text in parted if text != "P")


def _parted(line: str) -> tuple[str, str]:
    name, _, text = line.strip().partition(" = ")
    return name, text


def _tables(value: Any) -> Any:
    """A parameter in whose tables looking up is counted."""
    if type(value) is tuple:
        return tuple(map(_tables, value))
    return value.view(Counted) if isinstance(value, np.ndarray) and value.ndim else value


def _columns(value: Any) -> int:
    """Columns of numbers that a value holds; what is the same for all samples is none."""
    if isinstance(value, Planar):
        return _columns(value.real) + _columns(value.imag)
    if isinstance(value, tuple):
        return sum(map(_columns, value))
    return int(np.size(value) // np.shape(value)[0]) if np.ndim(value) else 0


def _probe(mechanism: Compiled) -> Samples:
    """Some samples of the drivers' ranges; near the start where there is no law."""
    drivers, scene = mechanism.drivers, mechanism.scene
    try:
        return make_samples(mechanism, scene, samples=PROBE)
    except RequestError:
        start = {d: scene.initial[d].q if d in scene.initial else 0.0 for d in drivers}
        at = {d: np.linspace(q, q + NEAR, PROBE) for d, q in start.items()}
        return make_samples(mechanism, scene, at, rates=dict.fromkeys(drivers, 1.0))
