"""The trade of a sweep: precisions, engines, batch sizes and friction methods.

Source of the methods compared: [R10] steps 1-5 (single, successive); Newton's method
and the precisions are blockmech's own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.trade.errors import TurnedBack, Yardstick, comparable, compared, yardstick
from blockmech.analysis.trade.measure import RUNS, Candidate, Said, measured
from blockmech.analysis.trade.points import NOTHING, Reference, Skipped, Trade
from blockmech.analysis.trade.single import where_it_stops
from blockmech.analysis.trade.thinned import thinned
from blockmech.analysis.trade.timing import Clock, once
from blockmech.analysis.trade.turned import turned_run
from blockmech.errors import Problem, RequestError, listed
from blockmech.result import Result
from blockmech.samples import Samples, make_samples

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

SAMPLES, FEW, FEWEST_SINGLE = 3601, 9, 5
TRIES = 3  # the quickest counts: of so few samples one stall would be most of the time
MORE = 8  # times as many samples in the next trial
SHARE = 0.05  # of the budget for one run of the reference
CHECK_SHARE = 0.3  # of the budget for its check
RUNS_SHARE = 0.2  # of the budget for the runs in double precision, else fewer samples are run
ALL_SHARE = 0.5  # of the budget for all runs in double precision, where samples are not asked for
CHUNKS = (512, 2048, 32768)  # beside the engine's own
TOLERANCES = (1.0, 1e-3, 1e-6, 1e-9)  # [N]
MOST_ITERATIONS = 6
SETTLED = 60  # successive iterations of the check; P^60 is rounding wherever P < 0.48
LONG: dict[str, Any] = {"precision": "clongdouble", "engine": "numpy"}
WIDER = bool(np.finfo(np.longdouble).eps < np.finfo(np.float64).eps)
UNSURE = 1.0  # floor where nothing can be confirmed
AHEAD = 2.5  # times what the first answer took: what reference, check and their reading take
COUNTED = "kernel calls and iterations of the friction equations, over all samples"
MEASURE = (
    "largest error of any output at any sample, relative to the output's largest magnitude "
    "(angles in rad)"
)


class Request(NamedTuple):
    """What is asked of every run."""

    mechanism: Compiled
    want: tuple[str, ...]
    static: bool

    def at(self, samples: Samples, **options: Any) -> Result:
        """A run at samples with some settings; gaps are NaN."""
        given = {"friction": "newton", "tolerance": None, "iterations": None}
        how = given | {k: v for k, v in options.items() if k in given}
        how["static"] = self.static
        rest = {k: v for k, v in options.items() if k not in given}
        plan = self.mechanism.plan(self.want, **how)
        values, name = self.mechanism.evaluate(plan, samples, **rest)
        return Result(self.mechanism, plan, samples, values, name, how)


@dataclass
class Sweep:
    """A sweep that is measured: request, samples, reference; and what runs were seen to take.

    Attributes
    ----------
    times : seconds a sample by (engine, precision)
    judging : seconds that comparing a run with the reference takes
    """

    request: Request
    samples: Samples
    stick: Yardstick
    times: dict[tuple[str, str], float]
    judging: float

    @property
    def known(self) -> int:
        """Number of samples at which errors are known."""
        return len(self.stick.good)

    def given(self, **options: Any) -> Result:
        """The sweep with some settings."""
        return self.request.at(self.samples, **options)

    def run(self, candidate: Candidate, limit: float | None = None) -> Result:
        """See `Bench`; what a sweep takes is known well enough beforehand."""
        return self.given(**candidate.options)

    def expected(self, candidate: Candidate) -> float:
        """See `Bench`."""
        key = _kind(candidate.options)
        if key not in self.times and key[0] == "scalar":
            self.times[key] = self._single()
        # Single precision is no dearer than double.
        each = self.times.get(key, self.times["numpy", "complex128"])
        return self.samples.n * each + self.judging / RUNS

    def _single(self) -> float:
        """Seconds a sample of the scalar engine."""
        few, _ = thinned(self.samples, FEWEST_SINGLE)
        self.request.at(few, engine="scalar")
        times = [once(lambda: self.request.at(few, engine="scalar"))[1] for _ in range(TRIES)]
        return min(times) / few.n

    def seen(self, candidate: Candidate, seconds: float, result: Result | None) -> None:
        """See `Bench`."""
        self.times[_kind(candidate.options)] = seconds / self.samples.n

    def evaluations(self, result: Result) -> int:
        """Kernel calls and iterations of the friction equations over all samples of a run.

        Newton's method starts from two successive approximations, which count as well.
        """
        count: int = result.n * result.plan.calls
        before = 2 if result.settings["friction"] == "newton" else 0
        for steps in result.quality.iterations.values():
            done = np.asarray(steps)
            count += int(np.sum(done + before * (done > 0)))
        return count

    def error(self, result: Result) -> float:
        """See `Bench`."""
        found, self.judging = once(lambda: self.stick.error(result))
        return float(found)


def _kind(options: Mapping[str, Any]) -> tuple[str, str]:
    return options["engine"], options.get("precision", "complex128")


def trade_sweep(
    mechanism: Compiled,
    want: tuple[str, ...],
    clock: Clock,
    given: dict[str, Any],
    static: bool,
    say: Said,
) -> Trade:
    """Measure the settings of `Compiled.run` for one request; see `trade`."""
    plan = mechanism.plan(want, static=static)
    rubbing = any(name.startswith("friction/") for name in plan.layout)
    free = not {"at", "samples", "times"} & set(given)
    request = Request(mechanism, want, static)
    given = given | {"samples": SAMPLES} if free else given
    samples = make_samples(mechanism, mechanism.scene, **given)
    say("reference", 0, 0)
    pilot = _piloted(request, samples, clock)
    if isinstance(pilot, str):
        skipped = tuple(Skipped(c.label, pilot) for c in _candidates(samples.n, rubbing))
        return Trade(mechanism.name, "run", MEASURE, COUNTED, NOTHING, (), skipped, (pilot,))
    most = max(FEW, int(SHARE * clock.left / pilot.long))
    if free:
        most = min(most, _holding_all(request, samples, rubbing, clock))
    if free and most < samples.n:
        samples = make_samples(mechanism, mechanism.scene, **given | {"samples": most})
    if pilot.whole:  # such an output belongs to all samples
        most = samples.n
    asked = samples.n
    sweep, reference, notes = _referred(request, samples, most, pilot, rubbing, clock)
    known = sweep.known
    candidates = tuple(_candidates(sweep.samples.n, rubbing))
    points, skipped = measured(sweep, candidates, reference.floor, clock, say)
    if pilot.cold + sweep.expected(candidates[0]) < clock.left:
        notes += where_it_stops(sweep, sweep.stick)
    names = plan.want if len(plan.want) <= 3 else (f"{len(plan.want)} outputs",)
    return Trade(
        mechanism.name,
        f"run: {', '.join(names)} at {sweep.samples.n} samples",
        MEASURE,
        COUNTED,
        reference,
        points,
        skipped,
        notes,
        judged="" if known == asked else f"at {known} of the {asked} samples",
    )


class Pilot(NamedTuple):
    """What some samples took.

    long : seconds a sample in the widest numbers
    cold : seconds until there is a first answer
    whole : whether all that can be compared is one number a run
    """

    long: float
    cold: float
    whole: bool


def _piloted(request: Request, samples: Samples, clock: Clock) -> Pilot | str:
    """What some samples took, or why the budget holds nothing more."""
    few, _ = thinned(samples, FEW)

    first, cold = once(lambda: read(request.at(few, **LONG)))
    if AHEAD * cold > clock.left:
        return (
            f"the budget of {clock.budget:g} s is too small: the first answer took {cold:.2g} s, "
            "and reference and check are still to be made"
        )
    whole = all(first.output(name).kind == "number" for name in compared(first))
    return Pilot(_each(request, samples, FEW, LONG, clock), cold, whole)


def _each(
    request: Request, samples: Samples, count: int, options: Mapping[str, Any], clock: Clock
) -> float:
    """Seconds a sample, its outputs read, of a run that was made before.

    Of few samples most of the time is that of the calls: more are tried while that is cheap.
    """
    while True:
        few, _ = thinned(samples, count)
        _, seconds = once(lambda: read(request.at(few, **options)))  # noqa: B023
        if MORE * seconds > SHARE * clock.left or count >= samples.n:
            return seconds / few.n
        count *= MORE


def _holding_all(request: Request, samples: Samples, rubbing: bool, clock: Clock) -> int:
    """Number of samples of which the budget holds runs with every setting."""
    settings = len(tuple(_candidates(samples.n, rubbing)))
    limit = ALL_SHARE * clock.left / (RUNS * settings)
    held = count = FEW
    request.at(thinned(samples, FEW)[0], engine="numpy")  # the first one compiles
    while True:
        few, _ = thinned(samples, count)
        _, seconds = once(lambda: read(request.at(few, engine="numpy")))  # noqa: B023
        if seconds > limit:
            return max(held, int(count * limit / seconds))
        if count >= samples.n:
            return samples.n
        held, count = count, MORE * count


def read(result: Result) -> Result:
    """The same, all its outputs made."""
    for name in result:
        result[name]
    return result


def _candidates(n: int, rubbing: bool) -> Iterator[Candidate]:
    yield Candidate("numpy", "complex64", {"precision": "complex64", "engine": "numpy"})
    yield Candidate("numpy", "complex128", {"engine": "numpy"})
    if WIDER:
        yield Candidate("numpy", "clongdouble", LONG)
    for chunk in CHUNKS:
        if chunk < n:
            options = {"engine": "numpy", "chunk": chunk}
            yield Candidate("batch size", f"{chunk} samples", options)
    if rubbing:
        yield from _frictions()
    # Dear where there are many samples: last, so that it takes no time from others.
    yield Candidate("scalar", "complex128", {"engine": "scalar"})


def _frictions() -> Iterator[Candidate]:
    options: dict[str, Any]
    for method in ("none", "single"):
        options = {"engine": "numpy", "friction": method}
        yield Candidate(f"friction {method}", "", options)
        yield Candidate(f"friction {method}", "complex64", options | {"precision": "complex64"})
    for k in range(2, MOST_ITERATIONS + 1):
        options = {"engine": "numpy", "friction": "successive", "iterations": k}
        yield Candidate("successive", f"{k} iterations", options)
    for tolerance in TOLERANCES:
        options = {"engine": "numpy", "friction": "successive", "tolerance": tolerance}
        yield Candidate("successive to a change", f"{tolerance:g} N", options)


def _referred(
    request: Request, samples: Samples, most: int, pilot: Pilot, rubbing: bool, clock: Clock
) -> tuple[Sweep, Reference, tuple[str, ...]]:
    """The sweep with its reference: in the widest precision, checked by the turned mechanism.

    Of more samples than the budget holds, some are compared. With friction the check also
    solves by successive approximation in place of Newton's method wherever that is sure to
    converge. Where no check of that kind fits, double precision is the check.
    """
    part, index = thinned(samples, most)
    best, seconds = once(lambda: request.at(part, **LONG))
    quality = best.quality
    good = comparable(best, rubbing)
    if not good.any():
        raise RequestError(
            Problem("nothing-to-compare", "trade", "no sample has an answer", "", "see limits")
        )
    settings: dict[str, Any] = {"want": request.want, "static": request.static}
    solver = "Newton's method"
    bound = max((float(np.max(c[good])) for c in quality.contraction.values()), default=0.0)
    if rubbing and bound < 0.5:
        settings |= {"friction": "successive", "iterations": SETTLED}
        solver = f"{SETTLED} successive approximations"
    eps = float(np.finfo(np.longdouble).eps)
    plain = request.at(part, engine="numpy")
    double = _each(request, samples, part.n, {"engine": "numpy"}, clock)
    # The turned mechanism is made, compiled and run.
    if 2 * pilot.cold + 2 * part.n * pilot.long <= CHECK_SHARE * clock.left:
        check, angle = turned_run(request.mechanism, part, "clongdouble", settings)
        stick = yardstick(best, check, good, angle)
        apart = stick.error(TurnedBack(check, angle))
        second = "the mechanism turned in the plane" + (f", {solver}" if rubbing else "")
    else:
        stick = yardstick(best, plain, good)
        apart = stick.error(plain)
        second = "double precision alone, as the budget holds no other check"
    floor = max(apart, eps)
    if len(stick.left_out) > len(stick.values):
        floor = UNSURE  # what the two differ on is no rounding: nothing can be confirmed
    digits = "80-bit or wider" if WIDER else "double"
    how = f"{digits} floating point" + (", Newton's method" if rubbing else "")
    notes = _left_out(best, good, rubbing, stick.left_out)
    times = {"complex128": double, "clongdouble": seconds / part.n}
    if part.n < samples.n:
        few = f"at {part.n} of the {samples.n} samples: the budget of {clock.budget:g} s holds"
        if RUNS * samples.n * double > RUNS_SHARE * clock.left:
            samples = part
            notes += (f"all is measured {few} no more",)
        else:
            stick = replace(stick, index=index)
            notes += (f"errors are measured {few} no larger reference",)
    seen = {("numpy", precision): each for precision, each in times.items()}
    sweep = Sweep(request, samples, stick, seen, pilot.cold / 2)
    return sweep, Reference(how, second, floor), notes


def _left_out(best: Result, good: Any, rubbing: bool, outputs: tuple[str, ...]) -> tuple[str, ...]:
    """What is not compared, and why."""
    flags = best.quality.flags
    resting = {f.sample for f in flags if f.code == "zero-relative-speed"} if rubbing else set()
    near = {f.sample for f in flags if f.code.endswith(("dead-centre", "change-point"))}
    gaps = len(set(np.flatnonzero(~good).tolist()) - resting - near)
    words = (
        (gaps, "without an answer"),
        (len(near), "within a margin of 1e-6 of a dead centre"),
        (len(resting), "where a joint is at zero relative speed, so that friction is undetermined"),
    )
    notes = [f"not compared: {count} samples {why}" for count, why in words if count]
    judged = set(compared(best))
    ratios = [n for n in best if n not in judged]
    if ratios:
        notes.append(f"not compared, as they divide by what may vanish: {listed(ratios, 3)}")
    if outputs:
        notes.append(f"not compared, as rounding alone decides them: {listed(outputs, 4)}")
    return tuple(notes)
