"""The trade of a sweep: precisions, engines, batch sizes and friction methods.

Source of the methods compared: [R10] steps 1-5 (single, successive); Newton's method
and the precisions are blockmech's own.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.trade.measure import Candidate, Clock, Question, Said, measured
from blockmech.analysis.trade.points import UNSURE, Reference
from blockmech.analysis.trade.reference_errors import (
    LONG,
    MOST_ITERATIONS,
    WIDER,
    ReferenceErrors,
    comparable,
    compared,
    reference_errors,
)
from blockmech.analysis.trade.report import Trade
from blockmech.analysis.trade.rotated import rotated_run
from blockmech.errors import Problem, RequestError, listed
from blockmech.result import Result
from blockmech.samples import DEFAULT_SAMPLES, Samples, make_samples

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

MANY = 3601  # samples where a run of them is cheap
CHEAP = (
    1e-3  # of the budget: some twenty settings run six times and more, ten times as many samples
)
CHUNKS = (512, 2048, 32768)  # samples, beside the engine's own
TOLERANCES = (1.0, 1e-3, 1e-6, 1e-9)  # [N]
SETTLED = 60  # successive iterations of the check; P^60 is rounding wherever P < 0.5
WIDEST: dict[str, Any] = {"precision": "clongdouble", "engine": "numpy"}
USABLE = 1e-3  # relative error up to which single precision is worth having
COUNTED = "kernel calls and iterations of the friction equations, over all samples"
MEASURE = (
    "largest error of any output at any sample, relative to the output's largest magnitude "
    "(angles in rad)"
)


class Sweep(NamedTuple):
    """What is asked of every run."""

    mechanism: Compiled
    want: tuple[str, ...]
    static: bool
    samples: Samples

    def given(self, **options: Any) -> Result:
        """A run with some settings; gaps are NaN."""
        known = {"friction": "newton", "tolerance": None, "iterations": None}
        how = known | {k: v for k, v in options.items() if k in known} | {"static": self.static}
        rest = {k: v for k, v in options.items() if k not in known}
        plan = self.mechanism.plan(self.want, **how)
        values, name = self.mechanism.evaluate(plan, self.samples, **rest)
        return Result(self.mechanism, plan, self.samples, values, name, how)


def trade_run(
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
    say("reference", 0, 0)
    sweep = _sampled(mechanism, want, static, given, clock)
    errors, reference, notes = _referred(sweep, rubbing)
    question = Question(
        lambda c, end: sweep.given(**c.options), _evaluations, lambda run: errors.error(run)
    )
    candidates = tuple(_candidates(sweep.samples.n, rubbing))
    points, skipped = measured(question, candidates, reference.floor, clock, say)
    if points and clock.left > 0:
        notes += _single_precision(sweep, errors)
    names = plan.want if len(plan.want) <= 3 else (f"{len(plan.want)} outputs",)
    asked = f"run: {', '.join(names)} at {sweep.samples.n} samples"
    return Trade(mechanism.name, asked, MEASURE, COUNTED, reference, points, skipped, notes)


def _sampled(
    mechanism: Compiled, want: tuple[str, ...], static: bool, given: dict[str, Any], clock: Clock
) -> Sweep:
    """The sweep at the samples that are asked for, else at many if a run is cheap."""
    if {"at", "samples", "times"} & set(given):
        return Sweep(mechanism, want, static, make_samples(mechanism, mechanism.scene, **given))
    few, many = (
        make_samples(mechanism, mechanism.scene, **given, samples=n)
        for n in (DEFAULT_SAMPLES, MANY)
    )
    sweep = Sweep(mechanism, want, static, few)
    sweep.given(engine="numpy")  # compiles
    begun = time.perf_counter()
    sweep.given(engine="numpy")
    cheap = time.perf_counter() - begun <= CHEAP * clock.budget
    return sweep._replace(samples=many) if cheap else sweep


def _evaluations(result: Result) -> int:
    """Kernel calls and iterations of the friction equations over all samples of a run.

    Newton's method starts from two successive approximations, which count as well.
    """
    count: int = result.n * result.plan.calls
    before = 2 if result.settings["friction"] == "newton" else 0
    for steps in result.quality.iterations.values():
        done = np.asarray(steps)
        count += int(np.sum(done + before * (done > 0)))
    return count


def _candidates(n: int, rubbing: bool) -> Iterator[Candidate]:
    yield Candidate("numpy", "complex64", {"precision": "complex64", "engine": "numpy"})
    yield Candidate("numpy", "complex128", {"engine": "numpy"})
    for chunk in CHUNKS:
        if chunk < n:
            options = {"engine": "numpy", "chunk": chunk}
            yield Candidate("batch size", f"{chunk} samples", options)
    if rubbing:
        yield from _frictions()
    if WIDER:
        yield Candidate("numpy", "clongdouble", WIDEST)
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


def _referred(sweep: Sweep, rubbing: bool) -> tuple[ReferenceErrors, Reference, tuple[str, ...]]:
    """The reference: in the widest precision, checked by the rotated mechanism.

    With friction the check also solves by successive approximation in place of Newton's
    method, wherever that is sure to converge.
    """
    best = sweep.given(**WIDEST)
    good = comparable(best, rubbing)
    if not good.any():
        raise RequestError(
            Problem("nothing-to-compare", "trade", "no sample has an answer", "", "see limits")
        )
    settings: dict[str, Any] = {"want": sweep.want, "static": sweep.static}
    solver = "Newton's method"
    bound = max((float(np.max(c[good])) for c in best.quality.contraction.values()), default=0.0)
    if rubbing and bound < 0.5:
        settings |= {"friction": "successive", "iterations": SETTLED}
        solver = f"{SETTLED} successive approximations"
    check = rotated_run(sweep.mechanism, sweep.samples, "clongdouble", settings)
    errors = reference_errors(best, check, good)
    floor = max(errors.error(check), LONG)
    if len(errors.left_out) > len(errors.values):
        floor = UNSURE  # what the two differ on is no rounding: nothing can be confirmed
    digits = "80-bit or wider" if WIDER else "double"
    how = f"{digits} floating point" + (", Newton's method" if rubbing else "")
    second = "the mechanism rotated in the plane" + (f", {solver}" if rubbing else "")
    notes = _left_out(best, good, rubbing, errors.left_out)
    return errors, Reference(how, second, floor), notes


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


def _single_precision(sweep: Sweep, errors: ReferenceErrors) -> tuple[str, ...]:
    """What single precision keeps at each decade of the smallest margin, in a sentence."""
    result = sweep.given(precision="complex64", engine="numpy")
    columns = [np.asarray(c, dtype=float) for c in result.quality.margin.values()]
    whole = [e for e in errors.each(result).values() if len(e) == result.n]
    if not columns or not whole:
        return ()
    margin, worst = np.min(columns, axis=0)[errors.good], np.max(whole, axis=0)[errors.good]
    decade = np.floor(np.log10(np.maximum(margin, 1e-300)))
    rows = [(10.0**k, float(worst[decade == k].max())) for k in sorted(set(decade), reverse=True)]
    kept = [f"{error:.1g} at margins from {low:.1g}" for low, error in rows]
    text = f"single precision, worst error: {', '.join(kept[:6])}"
    bad = [low for low, error in rows if error > USABLE]
    if not bad:
        least = f"{float(margin.min()):.2g}"
        return (f"{text}; it is usable down to the smallest margin met, {least}",)
    stop = min(10 * max(bad), 1.0)
    return (f"{text}; it stops being usable (error above {USABLE:g}) below a margin of {stop:.1g}",)
