"""Designs that move: what a study keeps of simulations, and a function of them.

Each design is simulated; its outputs at the output times are reduced, and numbers of the motion
itself, ``motion.t_end``, stand beside them. A design whose motion cannot be computed, or ends
before its goal, has no numbers and says why; one that comes to rest has an answer.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.batch import choose_rates, moved
from blockmech.dynamics.batch_motions import Motions
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.request import (
    OUTPUTS,
    SimulationRequest,
    request_of,
)
from blockmech.dynamics.stops import stops_of
from blockmech.dynamics.system import System
from blockmech.engines.compiled_rates import CompiledRhs
from blockmech.ground.errors import BlockmechError, among, listed, refused
from blockmech.ground.tolerances import EQUAL, ROUNDING
from blockmech.model.parameters import Parameter
from blockmech.plan.settings import friction_asked
from blockmech.result.motion import FACT_UNITS, Motion, fact_unit
from blockmech.result.quality import OK
from blockmech.result.result import Result
from blockmech.studies.between import extremes_of
from blockmech.studies.family import Family, document_value, remade
from blockmech.studies.reductions import (
    EXTREMES,
    POSES,
    SIMPLE,
    Wanted,
    Words,
    column,
    columns,
)
from blockmech.studies.rows import ENDED_EARLY, NO_MOTION, REASONS, Rows
from blockmech.studies.runner import Runner
from blockmech.studies.swings import FirstSwings
from blockmech.typing import Arguments, Array, Data, Real, Record

STEP = ROUNDING**0.25  # of a number, for differences of motions
FEW = 16  # designs between two words of progress, and for which nothing is compiled
TOGETHER = 256  # designs that move side by side: their steps stay in some megabytes
WITHIN = 0.02  # of its change, within which an output has settled
MOTION = "motion"  # what is reduced is the motion itself


def _rest_time(motion: Motion) -> float:
    """When it came to rest [s]; NaN where it did not."""
    rests = [event.t for event in motion.events if event.kind == ends.REST]
    at_rest = motion.status == "rest" or motion.end == ends.REST
    return rests[-1] if rests else motion.t_end if at_rest else math.nan


NUMBERS: Mapping[str, tuple[str, Callable[[Motion], float]]] = {
    "t_end": ("s", lambda m: m.t_end),
    "q_end": ("{q}", lambda m: m.q_end),
    "rate_end": ("{q}/s", lambda m: m.qd_end),
    "error": ("{q}", lambda m: m.error),
    "time_error": ("s", lambda m: m.time_error),
    "standstills": ("", lambda m: sum(e.kind == ends.STANDSTILL for e in m.events)),
    "time_to_rest": ("s", _rest_time),
    "fluctuation": ("", lambda m: m.fluctuation(m.t_start, m.t_start + _period(m))),
}
"""Numbers of a motion that are no facts: unit and reading, of the only driver."""


def _period(motion: Motion) -> float:
    """The period of a steady motion, else the whole of it [s]."""
    return motion.facts.get("period", motion.t_end - motion.t_start)


OF_BATCH: Mapping[str, Callable[[Motions], Array]] = {
    "t_end": lambda m: m.t,
    "q_end": lambda m: m.q,
    "rate_end": lambda m: m.rate,
    "error": lambda m: m.error,
    "time_error": lambda m: m.time_error,
    "standstills": lambda m: m.standstills,
    "time_to_rest": lambda m: m.rest,
    "friction_work": lambda m: m.friction_work,
}
"""Numbers that motions side by side know."""


class Moved(NamedTuple):
    """What a design is kept as: its columns, why it has none, and where."""

    values: Record
    word: str = ""
    place: str = ""


@dataclass(frozen=True)
class MotionRunner(Runner):
    """Simulates designs of a family.

    Attributes
    ----------
    simulation : arguments of `simulate`, but outputs and friction
    n : number of output times
    """

    simulation: Arguments = field(default_factory=dict)
    n: int = OUTPUTS

    @classmethod
    def moving(
        cls, family: Family, want: Any, simulation: Arguments, settings: Arguments
    ) -> MotionRunner:
        """That of a request. Raises `RequestError` for what is unknown or does not fit."""
        m = family.mechanism
        arguments = [*inspect.signature(request_of).parameters][2:-1]  # the engine is the study's
        remedy = "friction and outputs are the study's"
        among(arguments, "argument", simulation, "unknown-argument", "simulate", remedy)
        friction_asked(settings["friction"])
        request, starts = request_of(m.scene, m._coordinate_units, **simulation)
        stops_of(m, starts, simulation.get("stops"))
        times = simulation.get("times")
        spread = OUTPUTS if times is None else len(request.times)
        runner = cls(family, (), {}, settings, simulation=simulation, n=spread)
        return replace(
            runner, want=columns(want, family.general.outputs, runner._column, runner._numbers())
        )

    def _column(self, output: Any, reduction: str) -> Wanted:
        readers: Words = {
            **dict.fromkeys((*SIMPLE, "final", POSES)),
            "settling": _share,
        }
        wanted = column(output, reduction, readers)
        return replace(wanted, unit="s") if wanted.how == "settling" else wanted

    def _numbers(self) -> dict[str, Wanted]:
        """Columns of the motion itself, by name."""
        m = self.family.mechanism
        alone = len(m.drivers) == 1
        unit = m.structure.driver_joint(m.drivers[0]).coordinate_unit if m.drivers else ""
        units = {name: u.format(q=unit) for name, (u, _) in NUMBERS.items()}
        units |= {name: fact_unit(name, unit) for name in FACT_UNITS} | {"multiplier": ""}
        works = ("friction_work", "drive_work", "impact_loss")
        several = ("t_end", "error", "time_error", *works)
        return {
            f"{MOTION}.{name}": Wanted(f"{MOTION}.{name}", name, MOTION, u, "real")
            for name, u in units.items()
            if alone or name in several
        }

    # -- what a study asks -----------------------------------------------------------------

    def samples_of_design(self) -> int:
        """Output times of a design."""
        return self.n

    def settled(self, count: int) -> MotionRunner:
        """Itself: each motion chooses its engine. Raises `RequestError` for none of motions."""
        m = self.family.mechanism
        request_of(m.scene, m._coordinate_units, engine=self.engine, **self.simulation)
        return self

    @property
    def coordinates(self) -> dict[str, Array]:
        """None: where designs are is what they are asked for."""
        return {}

    @property
    def words(self) -> str:
        """What is done with a design."""
        return f"in motion, until {self.simulation.get('until') or 'its end'}"

    def question(self) -> Data:
        """What is asked of a design, but settings and numbers."""
        return {"motion": {name: repr(x) for name, x in self.simulation.items()}}

    def size(self, n: int) -> int:
        """Designs of a block."""
        return TOGETHER

    def part(self, n: int) -> int:
        """Designs handed out at a time."""
        return TOGETHER

    def prepared(self, count: int) -> Together | None:
        """What moves designs side by side; None where each is moved by itself."""
        return None if count < FEW or self.family.alone else Together.of(self)

    def blocks(self, planned: Together | None, chosen: Any) -> Iterator[Rows]:
        """All blocks of a part, one after the other."""
        numbers, size = chosen.columns(0, chosen.count), FEW if planned is None else TOGETHER
        for k in range(0, chosen.count, size):
            rows = zip(self.family.parameters, numbers.values(), strict=True)
            yield self.block(planned, {p: x[k : k + size] for p, x in rows})

    def block(self, planned: Together | None, columns: Mapping[Parameter, Array]) -> Rows:
        """Some designs, side by side, and each by itself where that cannot be."""
        m = len(next(iter(columns.values())))
        values = {w.label: np.array([w.nothing(self.n)] * m) for w in self.want}
        word, culprit = np.zeros(m, np.int8), np.full(m, "", object)
        alone = range(m) if planned is None else planned.into(values, columns).tolist()
        for i in alone:
            row = {p.address: document_value(p, x[i]) for p, x in columns.items()}
            moved = self.moved(row)
            for label, x in moved.values.items():
                values[label][i] = x
            word[i], culprit[i] = REASONS.index(moved.word or OK), moved.place
        no_pose = np.full(m, -1), np.zeros(m, np.int64)
        return Rows(values, word, culprit, *no_pose).without_numbers()

    # -- one design ------------------------------------------------------------------------

    def moved(self, numbers: Mapping[str, float]) -> Moved:
        """What is kept of a design. `KeyboardInterrupt` ends its motion and the study's."""
        outputs = list(dict.fromkeys(w.output for w in self.want if w.how != MOTION))
        try:
            design: Any = remade(self.family.mechanism, numbers)  # a `Mechanism`, with its methods
            arguments = {
                "engine": self.engine,
                "friction": self.settings["friction"],
                **self.simulation,
            }
            times = self.simulation.get("times")
            result = design.simulate(want=() if times is None else outputs, **arguments)
        except BlockmechError as error:
            return Moved({}, NO_MOTION, f"{error.problems[0].where} ({error.problems[0].found})")
        motion = result.motion
        assert motion is not None
        if motion.end == ends.INTERRUPTED:
            raise KeyboardInterrupt
        if motion.status == "failed":
            return Moved({}, NO_MOTION, f"{motion.end}, after {motion.t_end:.9g} s")
        if motion.status in ("ended", "unfinished") and motion.end != ends.REST:
            return Moved({}, ENDED_EARLY, f"{motion.end}, after {motion.t_end:.9g} s")
        if times is None and outputs:  # no corners of a curve: all designs have as many
            t, friction = motion.times(self.n), self.settings["friction"]
            result = result_along(design, motion, t, outputs, friction)
        return Moved({w.label: self.value(w, result, motion) for w in self.want})

    def value(self, w: Wanted, result: Result, motion: Motion) -> Any:
        """One column of a motion."""
        if w.how == MOTION:
            reader = NUMBERS.get(w.output)
            return float(
                motion.facts.get(w.output, math.nan) if reader is None else reader[1](motion)
            )
        t, y = np.asarray(result.time), np.asarray(result[w.output])
        if w.how not in EXTREMES or len(t) < 2:
            return reduced(w, t, y, self.n)

        def output(row: Array, times: Array) -> Array:
            at = result_along(result.mechanism, motion, times.ravel(), w.output, friction)
            return size(np.asarray(at[w.output])).reshape(times.shape)

        friction, size = self.settings["friction"], np.abs if w.vector else np.asarray
        circular = result._output(w.output).circular
        return extremes_of(w, output, t, size(y)[None], circular, remainder=EQUAL).value[0]


@dataclass(frozen=True)
class Together:
    """Moves designs of a family side by side, see `blockmech.dynamics.batch`.

    Attributes
    ----------
    runner : what is asked of each
    system, request : of the mechanism whose program serves all
    rates : that program's right-hand side
    swings : what moves them along the path, where that is all that there is to it
    """

    runner: MotionRunner
    system: System
    request: SimulationRequest
    rates: CompiledRhs
    swings: FirstSwings | None

    @classmethod
    def of(cls, runner: MotionRunner) -> Together | None:
        """That of a request; None where single motions know more, or nothing can be compiled."""
        m = runner.family.mechanism
        states = {m._of_driver(d, quantity) for d in m.drivers for quantity in ("q", "rate")}
        computable = (w.output in (OF_BATCH if w.how == MOTION else states) for w in runner.want)
        if not all(computable):
            return None
        arguments = {"engine": runner.engine, **runner.simulation}
        request, starts = request_of(m.scene, m._coordinate_units, **arguments)
        stops = stops_of(m, starts, runner.simulation.get("stops"))
        if any(math.isfinite(stop.q) for between in stops for stop in between):
            return None  # where a pair's stop is, each design says for itself
        friction = friction_asked(runner.settings["friction"])
        system = System(runner.family.general, method=friction, engine=runner.engine)
        rates, method = choose_rates(system, request), request.method
        numbers = all(w.how == MOTION for w in runner.want)
        swings = None
        if rates is not None and numbers and method != "dop853":
            swings = FirstSwings.of(system, request, rates)
        if rates is None or (method == "energy" and swings is None):
            return None
        return cls(runner, system, request, rates, swings)

    def into(self, values: dict[str, Array], columns: Mapping[Parameter, Array]) -> Array:
        """Put what is known of designs into their columns; which are to be moved by themselves."""
        runner, m = self.runner, len(next(iter(columns.values())))
        self.system.budget = ends.Budget(m * self.request.seconds)
        design = runner.family.design({p: x[:, None] for p, x in columns.items()})
        numbers = self.rates.program.values(*design)
        motions = None if self.swings is None else self.swings.moved(numbers, m)
        if motions is None:
            motions = moved(self.system, self.request, self.rates, numbers, m)
        elif motions.alone.any() and self.request.method == "auto":
            restarted = moved(self.system, self.request, self.rates, numbers, m)
            motions = motions.merged(restarted, motions.alone)
        some = np.flatnonzero(~motions.alone)
        facts = [w for w in runner.want if w.how == MOTION]
        for w in facts:
            values[w.label][some] = OF_BATCH[w.output](motions)[some]
        if len(facts) < len(runner.want):
            self._outputs_into(values, motions, some.tolist())
        return np.flatnonzero(motions.alone)

    def _outputs_into(self, values: dict[str, Array], motions: Motions, some: list[int]) -> None:
        """Put reductions of the driver's coordinate and rate of some designs into their columns."""
        runner, request = self.runner, self.request
        mechanism, t0 = runner.family.mechanism, request.start.t
        rate = mechanism._of_driver(mechanism.drivers[0], "rate")
        t = t0 + np.linspace(0.0, 1.0, runner.n) * (motions.t - t0)[:, None]
        if request.times:
            t = np.tile(request.times, (len(motions.t), 1))
        reached, t = t <= motions.t[:, None], np.minimum(t, motions.t[:, None])
        reached[:, 0] |= ~reached.any(
            axis=1
        )  # all wanted times lie after the end: it stands for them
        begin, span = t[:, 0], np.where(reached, t, -np.inf).max(axis=1) - t[:, 0]
        states = motions.track.state(t)
        ends = np.stack([motions.q, motions.rate], axis=-1)[:, None]  # which are known exactly
        states = np.where((t == motions.t[:, None])[..., None], ends, states)
        for w in (w for w in runner.want if w.how != MOTION):
            part = int(w.output == rate)
            y = states[..., part]
            if w.how in EXTREMES:
                of = np.array(some, np.intp)
                values[w.label][of] = _extremes(w, motions, of, begin[of], span[of], runner.n, part)
                continue
            for i in some:
                values[w.label][i] = reduced(w, t[i, reached[i]], y[i, reached[i]], runner.n)


def _extremes(
    w: Wanted, motions: Motions, of: Array, begin: Array, span: Array, n: int, part: int
) -> Array:
    """Extremes of the coordinate (part 0) or rate (1) of some motions over spans of time [s]."""

    def output(row: Array, share: Array) -> Array:
        t = begin[row, None] + span[row, None] * share
        return motions.track.state(t, of[row])[..., part]

    share = np.linspace(0.0, 1.0, n)
    y = output(np.arange(len(of)), np.tile(share, (len(of), 1)))
    return extremes_of(w, output, share, y, remainder=EQUAL).value


def reduced(w: Wanted, t: Array, y: Array, n: int) -> Real:
    """The reduction of an output y at times t [s] of a motion; of all poses n numbers."""
    if w.how == "final":
        return y[-1]
    if w.how == "settling":
        return settling(t, y, w.sample)
    if w.how == POSES:
        row = w.nothing(n)
        row[: len(y)] = y
        return row
    return w.value(y)[0] if np.ndim(y) else y


def settling(t: Array, y: Array, share: float = WITHIN) -> float:
    """When an output y (n,) at times t (n,) [s] is near its last value for good [s].

    Near is within a share of its largest distance from there; between samples it is a line.

    >>> settling(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 0.5, 0.0, 0.0]), 0.25)
    1.5
    """
    off = np.abs(y - y[-1])
    outside = np.flatnonzero(off > share * off.max())
    if not outside.size:
        return float(t[0])
    i = int(outside[-1])
    fall = (off[i] - share * off.max()) / (off[i] - off[i + 1])
    return float(t[i] + fall * (t[i + 1] - t[i]))


def _share(text: str, name: str) -> float:
    """The share of ``settling(output, share)``. Raises `RequestError` where it is none."""
    try:
        share = float(text or WITHIN)
    except ValueError:
        share = math.nan
    if not 0.0 < share < 1.0:
        message = f'"{text}" is no share of the change'
        raise refused(f"settling({name}, {text})", message, "give a number between 0 and 1")
    return share


def runner_of(
    family: Family,
    want: Any,
    poses: Arguments,
    settings: Arguments,
    simulation: Arguments | None,
) -> Runner:
    """What runs designs at poses, or simulates them.

    Raises `RequestError` for what is unknown or does not fit.
    """
    if simulation is None:
        return Runner.of(family, want, poses, settings)
    superfluous = [name for name, x in poses.items() if x is not None]
    superfluous += ["static"] * bool(settings["static"])
    if superfluous:
        message = "designs that move have no poses"
        remedy = "name times as an argument of the motion: simulate={'times': ...}"
        raise refused(listed(superfluous), message, remedy, code="useless-setting")
    return MotionRunner.moving(family, want, simulation, settings)
