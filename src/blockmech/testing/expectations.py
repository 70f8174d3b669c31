"""Graph files that are tests: the numbers under ``expect``, computed and compared.

A number is met where the distance to it is within its tolerance, the larger of ``atol``
and ``rtol`` times its size; of a 0, ``rtol`` times the largest size that the entry expects
of that output. The size of a vector is its length, so a small component beside a large
one is not held to digits it cannot have. Angles of links are compared modulo a turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np

from blockmech.ground.errors import (
    BlockmechError,
    FormatError,
    Problem,
    RequestError,
    in_file,
    path_text,
    refused,
    shown,
)
from blockmech.ground.report import LINES, Facts
from blockmech.ground.validation_errors import validated
from blockmech.model.expect import Expectation
from blockmech.result.tables import aligned
from blockmech.typing import Arguments, Array, Data, Reals

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism
    from blockmech.result.result import Result
    from blockmech.typing import FrictionMethod

NO_SIZE = "every expected number is 0, so only an atol allows an error"

RECORDED = 5  # samples of a recorded output, over the range of the laws of motion
KEPT = 1e-9  # relative tolerance of what is recorded: rounding, times a conditioning of 1e6


class Expecting(Protocol):
    """A graph or linkage; what it expects stands in its ``extras``."""

    file: str
    extras: Data

    def compile(self) -> Mechanism:
        """The mechanism that it describes."""


@dataclass(frozen=True)
class Outcome(Facts):
    """One expected number, and what came out.

    Attributes
    ----------
    output : name of the output
    unit : of ``expected``, ``got``, ``tolerance`` and ``error``
    expected : complex x + iy for a vector
    got : the same, None where there is no answer
    tolerance : distance that is allowed
    error : distance between the two, None where there is no answer
    margin : smallest margin of the groups computed for the sample [-], None if there is none
    sample : number of the sample in the entry
    drivers : driver -> coordinate [rad or m] of the sample; empty for one number a run
    entry : number of the entry in ``expect``
    reason : why there is no answer, or why the tolerance is 0
    """

    output: str
    unit: str
    expected: complex | float
    got: complex | float | None
    tolerance: float
    error: float | None
    margin: float | None
    sample: int
    drivers: Mapping[str, float]
    entry: int = 0
    reason: str = ""

    @property
    def ok(self) -> bool:
        """Whether the number is met."""
        return self.error is not None and self.error <= self.tolerance

    def to_dict(self) -> Data:
        """The outcome as a JSON object; vectors are [x, y]."""
        drivers = {f"{d}.q": q for d, q in self.drivers.items()}
        data = super().to_dict() | {"drivers": drivers, "ok": self.ok}
        omitted = {"entry"} if self.reason else {"entry", "reason"}
        return {name: x for name, x in data.items() if name not in omitted}


# -- running ---------------------------------------------------------------------------------


def check_expectations(graph: Expecting) -> list[Outcome]:
    """Compute and compare every number that a graph expects; an empty list if it has none.

    Raises
    ------
    GraphError if the graph is not complete
    FormatError, RequestError for entries that ask for what there is not, all at once
    """
    expectations = expectations_of(graph)
    if not expectations:
        return []
    mechanism = graph.compile()
    outcomes: list[Outcome] = []
    problems: list[Problem] = []
    for k, expectation in enumerate(expectations):
        try:
            outcomes += check_expectation(mechanism, expectation, k)
        except BlockmechError as error:
            problems += error.problems
    if problems:
        raise RequestError(in_file(problems, graph.file))
    return outcomes


def expectations_of(graph: Expecting) -> list[Expectation]:
    """The entries under ``expect``. Raises `FormatError` for ones written wrongly in Python."""
    expectations: list[Expectation] = []
    problems: list[Problem] = []
    for k, entry in enumerate(graph.extras.get("expect") or ()):
        expectation, wrong = validated(Expectation, entry, "an expectation", ("expect", k))
        expectations += [expectation] if expectation else []
        problems += wrong
    if problems:
        raise FormatError(in_file(problems, graph.file))
    return expectations


def check_expectation(
    mechanism: Mechanism, expectation: Expectation, entry: int = 0
) -> list[Outcome]:
    """Compute and compare the numbers of one entry, in the entry's order.

    Only the wanted outputs are computed. Raises `RequestError` with all problems for
    outputs or drivers that there are not.
    """
    where = path_text(("expect", entry))
    RequestError.raise_for(
        replace(problem, where=path_text(("expect", entry, "want", name)))
        for name, values in expectation.want.items()
        for problem in misfits(mechanism, name, values, expectation.samples)
    )
    try:
        result = _computed(mechanism, expectation)
    except RequestError as error:
        moved = (replace(p, where=f"{where}.{p.where}") for p in error.problems)
        raise RequestError(moved) from error
    rtol, atol = expectation.rtol or 0.0, expectation.atol or 0.0
    times = None if expectation.simulate is None else expectation.simulate.times
    return [
        replace(outcome, entry=entry)
        for name, values in expectation.want.items()
        for outcome in compared(result, name, as_numbers(values), rtol, atol, times)
    ]


def _computed(mechanism: Mechanism, expectation: Expectation) -> Result:
    """The run or the simulation that an entry asks for."""
    moving, want = expectation.simulate, tuple(expectation.want)
    if moving is None:
        return mechanism.run(expectation.at, friction=expectation.method, want=want, on_gap="mark")
    settings: Arguments = {"times": moving.times, "method": moving.method}
    friction: FrictionMethod | None = "none" if expectation.friction == "none" else None
    result = mechanism.simulate(moving.until, want=want, friction=friction, **settings)
    if result.motion.end == "interrupted":
        raise KeyboardInterrupt
    return result


def recorded(mechanism: Mechanism, want: Iterable[str]) -> list[Expectation]:
    """What some outputs are now, as entries of ``expect``: one each, at `RECORDED` samples.

    They hold a mechanism to what it does today, which nothing else has checked; their source
    says so. Raises `RequestError` for outputs that a file cannot hold, and where a law of
    motion is not by coordinate, `SampleError` where a sample has no answer.
    """
    blocks = mechanism._of_blocks
    starts = {d: mechanism.scene.begin(d) for d in mechanism.drivers}
    laws = all(d in mechanism.scene.drive for d in mechanism.drivers)
    samples = blocks.samples(None, RECORDED, None, None, None) if laws else None
    rows = {
        d: [float(starts[d] or 0.0)] if samples is None else samples.coordinate(i).tolist()
        for i, d in enumerate(mechanism.drivers)
    }
    result = mechanism.run(rows, want=want)
    expectations = []
    for name in result:
        if result._output(name).kind not in ("real", "vector", "number"):
            raise refused(name, f"it is a {result._output(name).kind}", "record real outputs")
        values = np.atleast_1d(result[name])
        pairs = np.iscomplexobj(values)
        listed_ = [[z.real, z.imag] for z in values.tolist()] if pairs else values.tolist()
        size = float(np.abs(values).max(initial=0.0)) or 1.0
        source = "recorded from blockmech, checked by nothing else"
        target, atol = {name: listed_}, KEPT * size
        expectations.append(Expectation(source=source, at=rows, want=target, rtol=KEPT, atol=atol))
    return expectations


def check_closing(mechanism: Mechanism) -> None:
    """Let every group close where the laws of motion, or else the free motion, begin.

    Raises `AssemblyError` if one does not. A mechanism of whose drivers nothing says where
    they begin is not tried.
    """
    drivers, scene, blocks = mechanism.drivers, mechanism.scene, mechanism._of_blocks
    want = [f"{name}.margin" for name, block in blocks.structure.blocks.items() if block.closes]
    if not want:
        return
    if all(d in scene.drive for d in drivers):
        blocks.run(samples=1, want=want)
    elif all(d in scene.initial for d in drivers):
        blocks.run({d: scene.initial[d].q for d in drivers}, want=want)


def as_numbers(values: Reals) -> Array:
    """Numbers (n,), or [x, y] pairs as complex numbers (n,)."""
    table = np.asarray(values, dtype=np.float64)
    return table if table.ndim == 1 else table[:, 0] + 1j * table[:, 1]


def misfits(mechanism: Mechanism, name: str, values: Reals, samples: int) -> Iterator[Problem]:
    """Why these values cannot be those of that output."""
    wrong = partial(Problem, "bad-expectation", "has_output")
    if name not in mechanism.outputs:
        try:
            matched = mechanism.outputs.match([name])
        except RequestError as error:
            yield from error.problems
        else:
            yield wrong("a pattern", "an expectation names one output", f'write "{matched[0]}"')
        return
    kind = mechanism.outputs[name].kind
    if kind == "matrix":
        yield wrong("a matrix over the drivers cannot be expected", "", "name another output")
    elif (kind == "vector") != isinstance(values[0], Sequence):
        is_a = "a vector [x, y]" if kind == "vector" else "a number"
        yield wrong(f"the output is {is_a}, got {shown(values[0])}")
    count = 1 if kind == "number" else samples
    if len(values) != count:
        valid = "it has one number a run" if kind == "number" else "it has one value a sample"
        yield wrong(f"has {len(values)} values, needs {count}", valid)


# -- comparing -------------------------------------------------------------------------------


def compared(
    result: Result,
    name: str,
    expected: Array,
    rtol: float,
    atol: float,
    times: Sequence[float] | None = None,
) -> Iterator[Outcome]:
    """Compare one computed output with its expected values, one outcome for each.

    Parameters
    ----------
    result : a run that holds the output
    expected : (n,) one value a sample, complex for vectors; (1,) for one number a run
    rtol, atol : relative [-] and absolute [unit of the output] tolerance
    times : (n,) [s] asked of a motion; those after its end have no answer
    """
    output = result._output(name)
    is_of_run = output.kind == "number"
    reached, motion = np.ones(len(expected), dtype=bool), result.motion
    if motion is not None and times is not None and not is_of_run:
        reached = ~np.isnan(motion.reached_times(times))
    got = np.full_like(expected, np.nan)
    got[reached] = result[name]
    margins = np.full(len(expected), np.inf)
    margins[reached] = _smallest_margins(result).min() if is_of_run else _smallest_margins(result)
    error, size = np.abs(output.difference(got, expected)), np.abs(expected)
    tolerance = np.maximum(rtol * np.where(size == 0, size.max(), size), atol)
    row = np.cumsum(reached) - 1  # of the result, for each sample
    for i in range(len(expected)):
        finite, drivers, reason = bool(np.isfinite(got[i])), {}, ""
        if reached[i] and not is_of_run:
            drivers = {d[:-2]: float(q[row[i]]) for d, q in result.drivers.items()}
        if motion is not None and not reached[i]:
            reason = f"the motion ended at {motion.t_end:.9g} s: {motion.end}"
        elif not finite:
            reason = _why_not(result, None if is_of_run else row[i])
        elif tolerance[i] == 0 and error[i] > 0 and rtol > 0:
            reason = NO_SIZE
        yield Outcome(
            name,
            output.unit,
            expected[i].item(),
            got[i].item() if finite else None,
            float(tolerance[i]),
            float(error[i]) if finite else None,
            float(margins[i]) if np.isfinite(margins[i]) else None,
            i,
            drivers,
            reason=reason,
        )


def _smallest_margins(result: Result) -> Array:
    """Smallest margin (n,) of the groups of each sample, infinite if no group is computed."""
    rows = list(result.quality.margin.values())
    if not rows:
        return np.full(result.n, np.inf)
    table = np.array([np.broadcast_to(row, result.n) for row in rows], dtype=float)
    # Behind a group that cannot close, the later ones have no margin.
    margins: Array = np.where(np.isnan(table), np.inf, table).min(axis=0)
    return margins


def _why_not(result: Result, sample: int | None) -> str:
    """Why a sample, or a number of the whole run, has no answer."""
    quality = result.quality
    if sample is None:
        sample = next(iter(quality.gaps), None)
    if sample is None or quality.status[sample] == "ok":
        return "not defined there"
    block = quality.blame[sample]
    name = result.mechanism._block_name(block)
    return f"{quality.status[sample]} ({name})" if block else "not defined there"


# -- showing ---------------------------------------------------------------------------------

HEAD = ("output", "sample: drivers [rad, m]", "expected", "got", "error", "tolerance", "margin")


def failure_table(outcomes: Iterable[Outcome]) -> str:
    """The numbers that are not met as a table, the worst first."""
    failed = sorted((o for o in outcomes if not o.ok), key=_badness, reverse=True)
    lines = aligned(HEAD, map(_row, failed[:LINES]))
    if len(failed) > LINES:
        lines.append(f"... and {len(failed) - LINES} more")
    notes = dict.fromkeys(f"{o.output}: {o.reason}" for o in failed if o.reason and o.error)
    return "\n".join([*lines, *notes])


def _badness(outcome: Outcome) -> float:
    if outcome.error is None or outcome.tolerance == 0:
        return math.inf
    return outcome.error / outcome.tolerance


def _row(o: Outcome) -> tuple[str, ...]:
    at = ", ".join(f"{d} = {q:.6g}" for d, q in o.drivers.items())
    return (
        f"{o.output} [{o.unit}]" if o.unit else o.output,
        f"{o.sample}: {at}" if at else str(o.sample),
        _number(o.expected),
        o.reason if o.got is None else _number(o.got),
        "-" if o.error is None else f"{o.error:.3g}",
        f"{o.tolerance:.3g}",
        "-" if o.margin is None else f"{o.margin:.3g}",
    )


def _number(x: complex | float) -> str:
    return f"[{x.real:.12g}, {x.imag:.12g}]" if isinstance(x, complex) else f"{x:.12g}"
