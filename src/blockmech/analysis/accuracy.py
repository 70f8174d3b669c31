"""From a wanted accuracy to settings: friction method, iterations and precision.

Nothing is timed. A probe of some samples says how strongly this mechanism amplifies
rounding and what share of the outputs is friction; the contraction bound P of the
friction equations says what an iteration gains. The run that follows brings its own
residuals, contractions and margins: the estimate that is handed out is made from those,
over all samples, and a finer setting is taken where it misses the target.

    friction left out       share
    k approximations        share * P^k / (1 - P)           before the run
                            share * residual / (1 - P)      after it
    rounding                what the probe lost, times (its margin / the run's)^(3/2)

The power is that of accelerations, the most sensitive outputs: they hold the third
power of one over the normalised determinant, of which the margin is the square.

Errors are relative to an output's largest magnitude over the run; of angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.errors import Problem, RequestError, listed
from blockmech.samples import Samples

if TYPE_CHECKING:
    from blockmech.analysis.trade.errors import Yardstick
    from blockmech.compiled import Compiled
    from blockmech.plan import Plan
    from blockmech.result import Result

PROBE = 65  # samples
SAFETY = 4.0  # of a maximum over the probe against one over all samples
ENOUGH = 2048  # samples below which single precision saves nothing
MOST_ITERATIONS = 6  # beyond, Newton's method is cheaper
CONTRACTS = 0.5  # P up to which iterations are worth counting on
SINGLE = float(np.finfo(np.float32).eps)
DOUBLE = float(np.finfo(np.float64).eps)
LONG = float(np.finfo(np.longdouble).eps)


@dataclass(frozen=True)
class Accuracy:
    """What was chosen for a wanted accuracy, and the error that it is estimated to have.

    Attributes
    ----------
    target : wanted error [- or rad]
    estimate : estimated error of the worst output at the worst sample
    friction, iterations, precision : the settings taken
    why : the reason in words
    """

    target: float
    estimate: float
    friction: str
    iterations: int | None
    precision: str
    why: str

    @property
    def reached(self) -> bool:
        """Whether the estimate is within the target."""
        return self.estimate <= self.target

    def __str__(self) -> str:
        method = f"friction {self.friction}"
        if self.iterations is not None:
            method += f", {self.iterations} iterations"
        reached = "" if self.reached else "; accuracy not reached"
        return (
            f"accuracy {self.target:.1g}: {method}, {self.precision}; "
            f"estimated error {self.estimate:.1g}, {self.why}{reached}"
        )

    def to_dict(self) -> dict[str, Any]:
        """The choice as JSON data."""
        return {
            "target": self.target,
            "estimate": self.estimate if math.isfinite(self.estimate) else None,
            "reached": self.reached,
            "friction": self.friction,
            "iterations": self.iterations,
            "precision": self.precision,
            "why": self.why,
        }


class Probe(NamedTuple):
    """What some samples tell.

    share : largest share of friction in an output [-]
    contraction : largest bound P [-]
    margin : smallest margin [-]
    rounding : precision -> error of the worst output
    rubs : whether friction is computed at all
    left_out : outputs that are nothing but rounding, e.g. of a rate that is zero
    few, stick : the probe's samples, and the answers there
    """

    share: float
    contraction: float
    margin: float
    rounding: Mapping[str, float]
    rubs: bool
    left_out: tuple[str, ...]
    few: Samples
    stick: Yardstick


class Setting(NamedTuple):
    """A choice before the run, with its estimate."""

    friction: str
    iterations: int | None
    precision: str
    estimate: float


def run_to(
    mechanism: Compiled,
    taken: Samples,
    want: Iterable[str] | str,
    accuracy: float,
    static: bool,
    engine: str,
    chunk: int | None,
) -> Result:
    """Run with the settings that an accuracy needs; ``result.accuracy`` says which.

    Raises `RequestError` where the accuracy is not a positive number.
    """
    if not 0 < accuracy < math.inf:
        raise RequestError(
            Problem("bad-value", "accuracy", f"must be > 0, got {accuracy}", "", "try 1e-6")
        )
    probe = look(mechanism, taken, want, static, accuracy)
    settings = list(_settings(probe, taken.n, accuracy, engine))
    for setting in settings:
        result = _run(mechanism, taken, want, static, setting, engine, chunk)
        found = _judged(result, setting, probe, accuracy)
        if found.reached:
            break
    result.accuracy = found
    return result


def refuse_settings(accuracy: float, **given: Any) -> None:
    """Refuse settings beside an accuracy, which is there to choose them."""
    said = [name for name, value in given.items() if value is not None]
    if said:
        raise RequestError(
            Problem(
                "useless-setting",
                listed(said),
                f"accuracy={accuracy:g} chooses it",
                "",
                "give the accuracy or the setting",
            )
        )


def look(
    mechanism: Compiled,
    taken: Samples,
    want: Iterable[str] | str,
    static: bool,
    accuracy: float = math.inf,
) -> Probe:
    """Probe a request at some of its samples.

    Where double precision will not do for the accuracy, the wider one is measured as well.
    The equations of friction amplify rounding, by no more than 1 / (1 - P): what double
    precision loses is measured with friction, where a wider number is at hand to tell.
    """
    from blockmech.analysis.trade.errors import comparable, yardstick
    from blockmech.analysis.trade.thinned import thinned

    few, _ = thinned(taken, PROBE)
    plan = mechanism.plan(want, static=static)
    plain = mechanism.plan(want, friction="none", static=static)
    rubs = any(name.startswith("friction/") for name in plan.layout)
    full = {"friction": "newton", "static": static}
    none = {"friction": "none", "static": static}
    best = _result(mechanism, plan, few, "complex128", full)
    good = comparable(best, rubs)
    quality = best.quality
    P = [float(np.max(c[good], initial=0.0)) for c in quality.contraction.values()]
    margins = [float(np.min(m[good], initial=1.0)) for m in quality.margin.values()]
    smooth = _result(mechanism, plain, few, "complex128", none)
    single = _result(mechanism, plain, few, "complex64", none)
    wide = _result(mechanism, plain, few, "clongdouble", none) if LONG < DOUBLE else None
    rounding, left_out = _rounding(single, smooth, wide, good)
    if wide is not None and SAFETY * rounding["complex128"] > accuracy / 2:
        found = _lost_in_wide(mechanism, few, wide, none | {"want": plain.want}, good, left_out)
        rounding["clongdouble"] = max(rounding["clongdouble"], found)
    stick = yardstick(best, best, good).without(left_out)
    share, contraction = stick.error(smooth) if rubs else 0.0, max(P, default=0.0)
    if rubs and LONG < DOUBLE:
        exact = _result(mechanism, plan, few, "clongdouble", full)
        lost = yardstick(exact, best, good).without(left_out).error(best)
        for name, eps in (("complex128", DOUBLE), ("clongdouble", LONG)):
            rounding[name] = max(rounding[name], lost * eps / DOUBLE)
    elif rubs:
        rounding["complex128"] *= 1 + share / max(1 - contraction, DOUBLE)
    return Probe(
        share,
        contraction,
        min(margins, default=1.0),
        rounding,
        rubs,
        left_out,
        few,
        stick,
    )


def _lost_in_wide(
    mechanism: Compiled,
    few: Samples,
    wide: Result,
    settings: Mapping[str, Any],
    good: Any,
    left_out: tuple[str, ...],
) -> float:
    """Error of the widest precision: what turning the mechanism in the plane changes.

    Kernels that iterate need not gain all the digits that a wider number has.
    """
    from blockmech.analysis.trade.errors import TurnedBack, yardstick
    from blockmech.analysis.trade.turned import turned_run

    check, angle = turned_run(mechanism, few, "clongdouble", settings)
    stick = yardstick(wide, check, good, angle).without(left_out)
    return stick.error(TurnedBack(check, angle))


def _rounding(
    single: Result, double: Result, wide: Result | None, good: Any
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Errors of the precisions on the probe, without friction, and outputs made of rounding.

    Where no wider number is at hand the error in double is inferred from the one in
    single precision: rounding is linear in the last digit.
    """
    from blockmech.analysis.trade.errors import yardstick

    if wide is not None:
        stick = yardstick(wide, double, good)
        lost = max(stick.error(double), DOUBLE)
        rows = {"complex128": lost, "clongdouble": lost * LONG / DOUBLE}
    else:
        stick = yardstick(double, single, good, unsure=1.0)
        rows = {"complex128": max(stick.error(single) * DOUBLE / SINGLE, DOUBLE)}
    return {"complex64": max(stick.error(single), SINGLE), **rows}, stick.left_out


def _settings(probe: Probe, n: int, accuracy: float, engine: str) -> Iterable[Setting]:
    """Settings to try, from the cheapest that should do to the most exact."""
    precisions = [
        p
        for p in probe.rounding
        if p == "complex128"
        or (engine != "scalar" and (p == "clongdouble" or (n >= ENOUGH and not probe.rubs)))
    ]
    half = accuracy / 2  # for friction, the rest for rounding
    fine = [p for p in precisions if SAFETY * probe.rounding[p] <= half] or precisions[-1:]
    if not probe.rubs:
        for precision in fine:
            yield Setting("newton", None, precision, SAFETY * probe.rounding[precision])
        return
    for k in range(MOST_ITERATIONS + 1):
        P = probe.contraction
        estimate = SAFETY * probe.share * P**k / (1 - P) if P < CONTRACTS else math.inf
        if estimate <= half:
            yield Setting(*_method(k), fine[0], estimate)
            if k:
                yield Setting(*_method(k + 1), fine[0], estimate * P)
            break
    for precision in fine:
        yield Setting("newton", None, precision, SAFETY * probe.rounding[precision])


def _method(k: int) -> tuple[str, int | None]:
    return (("none", None), ("single", None))[k] if k < 2 else ("successive", k)


def _judged(result: Result, setting: Setting, probe: Probe, accuracy: float) -> Accuracy:
    """The estimate after the run, from its own residuals, contractions and margins."""
    from blockmech.analysis.trade.errors import comparable

    quality = result.quality
    good = comparable(result, probe.rubs)
    margins = [float(np.min(m[good], initial=1.0)) for m in quality.margin.values()]
    nearer = max(1.0, probe.margin / max(min(margins, default=1.0), 1e-300))
    rounding = SAFETY * probe.rounding[setting.precision] * nearer**1.5
    rubbing = 0.0
    words = f"{rounding:.1g} from rounding"
    if probe.rubs and setting.friction == "none":
        rubbing = SAFETY * probe.share
    elif probe.rubs:
        for block, residual in quality.residual.items():
            P = float(np.max(quality.contraction[block][good], initial=probe.contraction))
            if setting.friction == "newton":
                P = min(P, CONTRACTS)  # not what decides whether it converges
            worst = float(np.max(residual[good], initial=0.0))
            rubbing += SAFETY * probe.share * worst / (1 - P) if P < 1 else math.inf
        if setting.friction != "newton":  # shares of several joints may cancel; errors need not
            rubbing = max(rubbing, SAFETY * _missed(result, setting, probe))
    if probe.rubs:
        words += f", {rubbing:.1g} from friction"
    if probe.left_out:
        words += f"; not judged, as they are rounding alone: {listed(probe.left_out, 3)}"
    return Accuracy(
        accuracy,
        rounding + rubbing,
        setting.friction,
        setting.iterations,
        setting.precision,
        words,
    )


def _missed(result: Result, setting: Setting, probe: Probe) -> float:
    """Error of a setting at the probe's samples."""
    how = {k: result.settings[k] for k in ("friction", "iterations", "static")}
    few = _result(result.mechanism, result.plan, probe.few, setting.precision, how)
    return probe.stick.error(few)


def _run(
    mechanism: Compiled,
    taken: Samples,
    want: Iterable[str] | str,
    static: bool,
    setting: Setting,
    engine: str,
    chunk: int | None,
) -> Result:
    how = {"friction": setting.friction, "iterations": setting.iterations, "static": static}
    plan = mechanism.plan(want, **how)  # type: ignore[arg-type]
    chosen = "numpy" if setting.precision != "complex128" and engine == "auto" else engine
    return _result(mechanism, plan, taken, setting.precision, how, chosen, chunk)


def _result(
    mechanism: Compiled,
    plan: Plan,
    samples: Samples,
    precision: str,
    how: Mapping[str, Any],
    engine: str = "numpy",
    chunk: int | None = None,
) -> Result:
    from blockmech.result import Result

    values, name = mechanism.evaluate(plan, samples, engine, precision, chunk)
    settings = {"tolerance": None, "iterations": None, **how}
    return Result(mechanism, plan, samples, values, name, settings)
