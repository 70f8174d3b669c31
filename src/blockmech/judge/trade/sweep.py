"""The trade of a sweep: precisions, engines, batch sizes and friction methods.

Source of the methods compared: [R10] steps 1-5 (single, successive); Newton's method
and the precisions are blockmech's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.errors import Problem, RequestError, listed
from blockmech.judge.trade.errors import TurnedBack, Yardstick, comparable, compared, yardstick
from blockmech.judge.trade.points import Point, Reference, Skipped, Trade
from blockmech.judge.trade.timing import FEWEST, RAN_OUT, Clock, once, timed
from blockmech.judge.trade.turned import turned_run
from blockmech.result import Result
from blockmech.samples import Samples, make_samples

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism

Said = Callable[[str, int, int], None]  # what is measured now, number, of how many

SAMPLES, FEW = 3601, 65
SHARE = 0.05  # of the budget for one run of the reference
CHUNKS = (512, 2048, 32768)  # beside the engine's own
TOLERANCES = (1.0, 1e-3, 1e-6, 1e-9)  # [N]
MOST_ITERATIONS = 6
LONG_COSTS = 40.0  # times a run in double precision; measured 10 to 40
SETTLED = 60  # successive iterations of the check; P^60 is rounding wherever P < 0.48


class Candidate(NamedTuple):
    """One setting: how it is named and how it is run."""

    method: str
    setting: str
    options: Mapping[str, Any]


@dataclass
class Sweep:
    """A sweep that is measured: the mechanism, its samples and what is wanted."""

    mechanism: Mechanism
    samples: Samples
    request: Mapping[str, Any]
    want: tuple[str, ...]
    static: bool

    def run(self, **options: Any) -> Result:
        """The sweep with some settings, through the public call."""
        return self.mechanism.run(
            **self.request, want=self.want, static=self.static, on_gap="mark", **options
        )


def trade_sweep(
    mechanism: Mechanism,
    want: tuple[str, ...],
    clock: Clock,
    request: Mapping[str, Any],
    static: bool,
    say: Said,
) -> Trade:
    """Measure the settings of `Mechanism.run` for one request; see `trade`."""
    given = dict(request)
    if not {"at", "samples", "times"} & set(given):
        given["samples"] = _affordable(mechanism, want, static, clock)
    samples = make_samples(mechanism, mechanism.scene, **given)
    sweep = Sweep(mechanism, samples, given, want, static)
    plan = mechanism.plan(want, static=static)
    rubbing = any(name.startswith("friction/") for name in plan.layout)
    candidates = tuple(_candidates(samples.n, rubbing))
    say("reference", 0, len(candidates))
    reference, stick, notes = _reference(sweep, rubbing)
    points, skipped = _measured(sweep, candidates, reference, stick, clock, say)
    notes += _single_precision(sweep, stick, rubbing)
    names = plan.want if len(plan.want) <= 3 else (f"{len(plan.want)} outputs",)
    return Trade(
        mechanism.name,
        f"run: {', '.join(names)} at {samples.n} samples",
        "largest error of any output at any sample, relative to the output's largest "
        "magnitude (angles in rad)",
        "kernel calls and iterations of the friction equations, over all samples",
        reference,
        points,
        skipped,
        notes,
    )


def _affordable(mechanism: Mechanism, want: tuple[str, ...], static: bool, clock: Clock) -> int:
    """Number of samples whose reference takes a small part of the budget."""
    settings = {"want": want, "static": static, "precision": "clongdouble", "engine": "numpy"}

    def few() -> None:
        result = mechanism.run(samples=FEW, on_gap="mark", **settings)  # type: ignore[arg-type]
        for name in result:
            result[name]

    few()
    _, seconds = once(few)
    return int(min(SAMPLES, max(FEW, FEW * SHARE * clock.left / seconds)))


def _candidates(n: int, rubbing: bool) -> Iterator[Candidate]:
    yield Candidate("numpy", "complex64", {"precision": "complex64", "engine": "numpy"})
    yield Candidate("numpy", "complex128", {"engine": "numpy"})
    if np.finfo(np.longdouble).eps < np.finfo(np.float64).eps:
        long = {"precision": "clongdouble", "engine": "numpy"}
        yield Candidate("numpy", "clongdouble", long)
    for chunk in CHUNKS:
        if chunk < n:
            options = {"engine": "numpy", "chunk": chunk}
            yield Candidate("batch size", f"{chunk} samples", options)
    yield Candidate("scalar", "complex128", {"engine": "scalar"})
    if not rubbing:
        return
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


def _reference(sweep: Sweep, rubbing: bool) -> tuple[Reference, Yardstick, tuple[str, ...]]:
    """Reference in the widest precision, checked by the turned mechanism.

    With friction the check also solves by successive approximation in place of Newton's
    method wherever that is sure to converge.
    """
    best = sweep.run(precision="clongdouble", engine="numpy")
    quality = best.quality
    good = comparable(best, rubbing)
    if not good.any():
        raise RequestError(
            Problem("nothing-to-compare", "trade", "no sample has an answer", "", "see limits")
        )
    settings: dict[str, Any] = {"want": sweep.want, "static": sweep.static}
    solver = "Newton's method"
    bound = max((float(np.max(c[good])) for c in quality.contraction.values()), default=0.0)
    if rubbing and bound < 0.5:
        settings |= {"friction": "successive", "iterations": SETTLED}
        solver = f"{SETTLED} successive approximations"
    check, angle = turned_run(sweep.mechanism, sweep.samples, "clongdouble", settings)
    stick = yardstick(best, check, good, angle)
    eps = float(np.finfo(np.longdouble).eps)
    floor = max(stick.error(TurnedBack(check, angle)), eps)
    if len(stick.left_out) > len(stick.values):
        floor = 1.0  # what the two differ on is no rounding: nothing can be confirmed
    digits = "80-bit or wider" if eps < np.finfo(np.float64).eps else "double"
    how = f"{digits} floating point" + (", Newton's method" if rubbing else "")
    second = "the mechanism turned in the plane" + (f", {solver}" if rubbing else "")
    notes = _left_out(best, good, rubbing, stick.left_out)
    return Reference(how, second, floor), stick, notes


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
    ratios = [n for n in best if n not in compared(best)]
    if ratios:
        notes.append(f"not compared, as they divide by what may vanish: {listed(ratios, 3)}")
    if outputs:
        notes.append(f"not compared, as rounding alone decides them: {listed(outputs, 4)}")
    return tuple(notes)


def _measured(
    sweep: Sweep,
    candidates: tuple[Candidate, ...],
    reference: Reference,
    stick: Yardstick,
    clock: Clock,
    say: Said,
) -> tuple[tuple[Point, ...], tuple[Skipped, ...]]:
    """Points of the candidates that fit the budget; what is done stays done on Ctrl-C."""
    points: list[Point] = []
    skipped: list[Skipped] = []
    double = 0.0
    for i, c in enumerate(candidates):
        label = f"{c.method}, {c.setting}".rstrip(", ")
        try:
            say(label, i, len(candidates))
            expected = _expected(sweep, c, double)
            if (FEWEST + 1) * expected > clock.left:
                skipped.append(Skipped(label, _too_long((FEWEST + 1) * expected, clock)))
                continue
            result, cold = once(lambda c=c: sweep.run(**c.options))  # type: ignore[misc]
            if FEWEST * cold > clock.left:
                skipped.append(Skipped(label, _too_long(FEWEST * cold, clock)))
                continue
            took = timed(lambda c=c: sweep.run(**c.options), clock)  # type: ignore[misc]
            if took is None:
                skipped.append(Skipped(label, RAN_OUT))
                continue
        except KeyboardInterrupt:
            skipped += [
                Skipped(f"{r.method}, {r.setting}".rstrip(", "), "interrupted")
                for r in candidates[i:]
            ]
            break
        if c.method == "numpy" and c.setting == "complex128":
            double = took.seconds
        error = stick.error(result)
        points.append(
            Point(
                c.method,
                c.setting,
                *took,
                evaluations(result),
                max(error, reference.floor),
                dict(c.options),
                error < reference.floor,
            )
        )
    return tuple(points), tuple(skipped)


def _expected(sweep: Sweep, candidate: Candidate, double: float) -> float:
    """Time of one run [s] that is expected before it is made."""
    if candidate.options["engine"] == "scalar":
        few = min(sweep.samples.n, 5)
        inputs = {k: np.asarray(v)[:few] for k, v in sweep.samples.inputs.items()}
        short = Samples(few, inputs, _first(sweep.samples.times, few), sweep.samples.clock)
        plan = sweep.mechanism.plan(sweep.want, static=sweep.static)
        sweep.mechanism.evaluate(plan, short, "scalar")
        _, seconds = once(lambda: sweep.mechanism.evaluate(plan, short, "scalar"))
        return seconds * sweep.samples.n / few
    return double * (LONG_COSTS if candidate.options.get("precision") == "clongdouble" else 1.0)


def _first(times: Any, n: int) -> Any:
    return None if times is None else times[:n]


def _too_long(seconds: float, clock: Clock) -> str:
    return f"would take about {seconds:.2g} s, {max(clock.left, 0.0):.2g} s of the budget are left"


def evaluations(result: Result) -> int:
    """Kernel calls and iterations of the friction equations over all samples of a run.

    Newton's method starts from two successive approximations, which count as well.
    """
    count = result.n * result.plan.calls
    before = 2 if result.settings["friction"] == "newton" else 0
    for steps in result.quality.iterations.values():
        done = np.asarray(steps)
        count += int(np.sum(done + before * (done > 0)))
    return count


def _single_precision(sweep: Sweep, stick: Yardstick, rubbing: bool) -> tuple[str, ...]:
    from blockmech.judge.trade.single import where_it_stops

    return where_it_stops(sweep, stick)
