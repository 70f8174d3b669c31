"""The loop of a study: blocks of designs through one program, reduced as they come.

A block is as many designs as keep about 8192 samples in cache; compiled, where nothing is kept
between operations, as many as occupy all cores. Where each design needs a
program of its own, a block is one design, made and compiled by itself; the rest is the same.
What is handed out at a time is a part: a row of whole blocks, so blocks are always the same
ones, and with them the last bit of each answer.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blockmech.analysis.instant_centres import principal_axes
from blockmech.compiled import Compiled
from blockmech.engines.numpy import CHUNK, Planar, Whole
from blockmech.ground.errors import (
    AssemblyError,
    BlockmechError,
    FormatError,
    FrictionError,
    GraphError,
    SingularError,
)
from blockmech.ground.tolerances import EQUAL
from blockmech.model.parameters import Parameter
from blockmech.plan.plan import Plan
from blockmech.plan.settings import friction_asked
from blockmech.result.quality import NO_ASSEMBLY, Failures, at_most_one, failures
from blockmech.result.samples import Samples, make_samples
from blockmech.result.tables import counted
from blockmech.studies.between import Range, doubt, some_of
from blockmech.studies.family import Family, document_value, remade
from blockmech.studies.reductions import (
    EXTREMES,
    POSES,
    REST,
    STROKE,
    WHOLE,
    Wanted,
    rest_value,
    wanted,
)
from blockmech.studies.rows import COARSE, REASONS, Rows, Span
from blockmech.studies.sampling import Designs
from blockmech.typing import Arguments, Array, Data, Values

PART = 2**20  # samples of designs that are handed out at a time


@dataclass(frozen=True)
class Runner:
    """Runs designs of a family at the same poses.

    Attributes
    ----------
    family : the designs
    want : what is kept of them
    over : the poses, as `blockmech.result.samples.make_samples` takes them
    settings : friction and static, as those of a run
    engine : name of the engine, or "auto"
    """

    family: Family
    want: tuple[Wanted, ...]
    over: Arguments
    settings: Arguments
    engine: str = "auto"

    @classmethod
    def of(cls, family: Family, want: Any, over: Arguments, settings: Arguments) -> Runner:
        """That of a request. Raises `RequestError` for what is unknown or does not fit."""
        friction_asked(settings["friction"])
        m, runner = family.mechanism, cls(family, (), over, settings)
        return replace(
            runner, want=wanted(want, family.general.outputs, runner.samples(m), m.drivers)
        )

    def check_values(self, chosen: Designs) -> None:
        """Raise `FormatError` for values that the file would refuse.

        What it takes of a number are intervals: so tried are the smallest and the largest value,
        zero, and one that is not whole.
        """
        tried: dict[Parameter, Array] = {}
        for columns in chosen.given(self.spans(0, chosen.count)):
            for p, x in zip(self.family.parameters, columns.values(), strict=True):
                y = np.append(x, tried.get(p, ()))
                tried[p] = np.unique([y.min(), y.max(), *y[y == 0.0][:1], *y[y % 1.0 != 0.0][:1]])
        values = ((p, x) for p, row in tried.items() for x in row.tolist())
        problems = [problem for p, x in values for problem in self.family.problems(p, x)]
        FormatError.raise_for(dict.fromkeys(problems))

    def samples(self, mechanism: Compiled) -> Samples:
        """The poses. Raises `RequestError` where they are wrong."""
        return make_samples(mechanism._coordinate_units, mechanism.scene, **self.over)

    def samples_of_design(self) -> int:
        """Number of poses."""
        return self.samples(self.family.mechanism).n

    @property
    def coordinates(self) -> dict[str, Array]:
        """Driver -> the poses (n,) [rad or m]."""
        m = self.family.mechanism
        samples = self.samples(m)
        return {m._of_driver(d, "q"): samples.coordinate(i) for i, d in enumerate(m.drivers)}

    @property
    def words(self) -> str:
        """What is done with a design."""
        return f"at {counted(self.samples_of_design(), 'pose')}"

    def question(self) -> Data:
        """What is asked of a design, but settings and numbers."""
        samples = self.samples(self.family.mechanism)
        return {
            "poses": {name: summary(np.asarray(x)) for name, x in samples.inputs.items()},
            "times": None if samples.times is None else summary(samples.times),
        }

    def settled(self, count: int) -> Runner:
        """Itself with the engine that is the same for all of so many designs."""
        return replace(self, engine=self.prepared(count).engine.name)

    def size(self, n: int) -> int:
        """Designs of a block of n poses."""
        return 1 if self.family.alone else max(1, CHUNK // n)

    def part(self, n: int) -> int:
        """Designs handed out at a time: so many samples are work enough to start something."""
        return self.size(n) * (PART // CHUNK)

    def spans(self, start: int, stop: int) -> list[Span]:
        """Designs in portions that are handed out at a time."""
        size = self.part(self.samples_of_design())
        return [(k, min(k + size, stop)) for k in range(start, stop, size)]

    def prepared(self, count: int) -> Any:
        """The plan that serves all of so many designs, or that of the first one."""
        return _Planned(self, self.family.general, 1 if self.family.alone else count)

    def blocks(self, planned: Any, chosen: Designs) -> Iterator[Rows]:
        """All blocks of a part, one after the other."""
        numbers = chosen.columns(0, chosen.count)
        size = self.size(planned.samples.n) * planned.together
        for k in range(0, chosen.count, size):
            rows = zip(self.family.parameters, numbers.values(), strict=True)
            yield self.block(planned, {p: x[k : k + size] for p, x in rows})

    def block(self, planned: Any, columns: Mapping[Parameter, Array]) -> Rows:
        """Some designs; one whose numbers do not make a mechanism is a row without answers."""
        m = len(next(iter(columns.values())))
        if not self.family.alone:
            program = planned.plan.program
            design = self.family.design({p: x[:, None] for p, x in columns.items()})
            return self._with_followed(planned.block(program.values(*design), m), columns)
        numbers = {p.address: document_value(p, x[0]) for p, x in columns.items()}
        try:
            return self.design(remade(self.family.mechanism, numbers), columns)
        except BlockmechError as error:
            n = planned.samples.n
            values = {w.label: np.array([w.nothing(n)]) for w in self.want}
            reason = f"{error.problems[0].where} ({error.problems[0].found})"
            word = np.array([REASONS.index(NO_ASSEMBLY)], np.int8)
            return Rows(values, word, np.array([reason], object), np.array([0]), np.array([n]))

    def design(self, mechanism: Compiled, columns: Mapping[Parameter, Array]) -> Rows:
        """One design, made already."""
        planned = _Planned(self, mechanism, 1)
        values = tuple(planned.plan.program.parameters.values())
        return self._with_followed(planned.block(values, 1), columns)

    def _with_followed(self, block: Rows, columns: Mapping[Parameter, Array]) -> Rows:
        """Designs with strokes along curves and where they rest, one by one; NaN where there is
        none."""
        followed = [w for w in self.want if w.how in (STROKE, REST)]
        values = dict(block.values)
        for i, row in enumerate(zip(*columns.values(), strict=True)) if followed else ():
            numbers = {p.address: document_value(p, x) for p, x in zip(columns, row, strict=True)}
            for w in followed:
                if not (w.how == REST or (block.word[i] == 0 and np.isnan(values[w.label][i]))):
                    continue
                with suppress(FormatError, GraphError, AssemblyError, SingularError, FrictionError):
                    design = remade(self.family.mechanism, numbers)
                    if w.how == REST:
                        values[w.label][i] = rest_value(design, self.samples(design), w.output)
                        continue
                    run = design.run(want=w.output, **self.over, **self.settings)
                    values[w.label][i] = run.stroke(w.output).length
        return block._replace(values=values).without_numbers()


def summary(x: object) -> str:
    """Values or a distribution, in a word."""
    return digest(x.tobytes()) if isinstance(x, np.ndarray) else repr(x)


def digest(data: bytes) -> str:
    """A word that tells data apart."""
    return hashlib.blake2b(data, digest_size=8).hexdigest()


class _Planned:
    """A plan that is run for designs, at given poses."""

    def __init__(self, runner: Runner, mechanism: Compiled, count: int) -> None:
        self.mechanism = mechanism
        self.want = runner.want
        self.samples = runner.samples(mechanism)
        names = tuple(dict.fromkeys(column.output for column in runner.want))
        self.plan: Plan = mechanism.plan(names, **runner.settings)
        self.engine = mechanism._engine_of_designs(self.plan, count * self.samples.n, runner.engine)
        self.together = 1 if runner.family.alone else self.engine.designs_together // CHUNK
        moved = bool(mechanism.structure.remembering and runner.family.alone)
        taken = mechanism._with_deflections(self.samples) if moved else self.samples
        mechanism._refuse_states(self.plan, taken.inputs)
        self.inputs = taken.given(self.plan.program.inputs)
        self.range = Range(mechanism, self.plan, self.engine, self.samples, moved)
        self.weights = self.samples.weights(len(mechanism.drivers))

    def block(self, values: Values, m: int) -> Rows:
        """m designs with these parameters."""
        shape = (m, self.samples.n)
        engine: Any = self.engine
        numbers = engine.numbers(values)
        outputs = engine.run_designs(self.inputs, numbers)
        layout, reports = self.plan.layout, self.plan.reports
        with np.errstate(all="ignore"):
            margins = {
                block: np.broadcast_to(at_most_one(outputs[at[0]]), shape)
                for block, at in reports["margin"].items()
            }
            why = self._failures(outputs, margins, shape)
            missing = np.asarray(why.word > 0)
            without = np.asarray(missing.any(axis=1))
            rows = self._rows(why, missing, without)
            for w in self.want:
                output = self.mechanism.outputs[w.output]
                columns = [outputs[i] for i in layout[w.output]]
                if w.how in EXTREMES:
                    y = w.poses(output, columns, shape)
                    some = np.ones(m, bool) if w.of_margin else ~without
                    if not isinstance(outputs, Whole):
                        some = some & np.isfinite(y).all(axis=1)
                    rows.values[w.label] = self._followed(w, numbers, y, some, margins, rows)
                    continue
                rows.values[w.label] = kept = w.of(output, columns, shape, self.weights)
                if without.any() and not w.of_margin:
                    kept[missing if w.how == POSES else without] = np.nan
            return rows

    def _failures(
        self, outputs: Values, margins: Mapping[str, Array], shape: tuple[int, int]
    ) -> Failures:
        """Why poses (m, n) of designs have no answer."""
        outcomes = {
            block: np.broadcast_to(outputs[at[3]], shape)
            for block, at in self.plan.reports["friction"].items()
        }
        judged = {
            i
            for w in self.want
            if w.how != WHOLE and not w.output.endswith("mechanical_advantage")
            for i in self.plan.layout[w.output]
        }
        bad = np.zeros(shape, bool)
        for i in () if isinstance(outputs, Whole) else judged:
            x = outputs[i]
            for part in (x.real, x.imag) if isinstance(x, Planar) else (x,):
                if not np.isfinite(np.sum(part)):  # quicker than each by itself
                    bad |= ~np.isfinite(part)
        return failures(margins, outcomes, bad, self.mechanism.structure)

    def _rows(self, why: Failures, missing: Array, without: Array) -> Rows:
        """Rows without values: words, blocks, first poses and numbers of poses (m,) each."""
        m, first = np.arange(len(missing)), missing.argmax(axis=1)
        places = np.array([self.mechanism._block_name(b) if b else "" for b in why.blocks], object)
        blocks = places[why.block[m, first]]
        at = np.where(without, first, -1)
        return Rows({}, why.word[m, first], blocks, at, missing.sum(axis=1))

    def _followed(
        self,
        w: Wanted,
        numbers: Values,
        y: Array,
        some: Array,
        margins: Mapping[str, Array],
        rows: Rows,
    ) -> Array:
        """Extremes (m,) of some designs between the poses, at which an output is y (m, n); what is
        doubtful of them is put into the rows."""
        largest, rows_of, axes = np.full(len(y), np.nan), np.flatnonzero(some), list[Array]()
        if w.how == STROKE:  # others are those of curved paths
            *axes, is_straight = principal_axes(y[rows_of])
            axes, rows_of = [axis[is_straight] for axis in axes], rows_of[is_straight]
        if not len(rows_of):
            return largest
        if len(rows_of) < len(y):
            y, numbers = y[rows_of], some_of(numbers, rows_of)
            margins = {name: m[rows_of] for name, m in margins.items()}
        peaks = self.range.extremes(w, numbers, y, margins, axes)
        largest[rows_of] = peaks.value
        for i in np.flatnonzero(peaks.error > EQUAL * np.abs(peaks.value)).tolist():
            least = {self.mechanism._block_name(b): float(m[i].min()) for b, m in margins.items()}
            gap = np.isinf(peaks.error[i]) and self.range.cycle is not None
            if gap:
                largest[rows_of[i]] = np.nan
            rows.word[rows_of[i]] = REASONS.index(NO_ASSEMBLY if gap else COARSE)
            rows.place[rows_of[i]] = doubt(w.label, peaks, i, least)
        return largest
