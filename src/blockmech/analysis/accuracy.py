"""From a wanted accuracy to settings: friction method, iterations and precision.

Nothing is timed. A probe of some samples says how strongly this mechanism amplifies
rounding, and what each way of solving friction leaves there. The run that follows brings
its own residuals, contraction bounds P and margins: the estimate that is handed out is made
from those, over all samples, and a finer setting is taken where it misses the target.

    friction left out       what the probe lost
    k approximations        the same, or share * residual / (1 - P)
    rounding                what the probe lost, times (its margin / the run's)^(3/2)

Friction is judged against Newton's method in the same precision, at every sample whose pose
is sure; rounding by precisions, where it cannot turn a friction round. Where nothing can be
judged, the most exact setting is taken and the accuracy is not said to be reached. A request
that comes again is answered by the setting that it was given: nothing in it has changed.

Samples at or near a dead centre, and outputs that come out as rounding alone, are compared with
nothing: there the estimate is what the margin allows at most, rounding over its power 3/2.

The power is that of accelerations, the most sensitive outputs: they hold the third
power of one over the normalised determinant, of which the margin is the square.

Errors are relative to an output's largest magnitude over the run; of angles in rad.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.reference_errors import (
    DOUBLE,
    LONG,
    MOST_ITERATIONS,
    WIDER,
    ReferenceErrors,
    comparable,
    reference_errors,
    run_off_by_a_digit,
)
from blockmech.analysis.trade.rotated import rotated_run
from blockmech.compiled import Compiled
from blockmech.engines.cost import ARRAY, CALL
from blockmech.ground.errors import as_names, listed, refused
from blockmech.ground.values import is_number
from blockmech.result.quality import Accuracy
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import (
    Arguments,
    Array,
    EngineName,
    FrictionMethod,
    FrictionName,
    Precision,
    Successive,
)

PROBE = 65  # samples
SAFETY = 4.0  # of a maximum over the probe against one over all samples: 3 has been seen
ENOUGH = 2 * round(CALL[0] / ARRAY[0])  # samples from which single precision, half of ARRAY, shows
CONTRACTS = 0.5  # P up to which iterations are worth counting on
SINGLE = float(np.finfo(np.float32).eps)
EPS_OF: Mapping[Precision, float] = {"complex64": SINGLE, "complex128": DOUBLE, "clongdouble": LONG}
FRICTION: tuple[tuple[FrictionName, int | None], ...] = (
    ("none", None),
    ("single", None),
    *(("successive", k) for k in range(2, MOST_ITERATIONS + 1)),
)
"""Cheaper methods than Newton's, the cheapest first."""


class Probe(NamedTuple):
    """What some samples tell.

    share : largest share of friction in an output [-]
    contraction : largest bound P [-]
    margin : smallest margin [-]
    rounding : precision -> error of the worst output
    rubs : whether friction is computed at all
    few, errors : the probe's samples, and what answers there are compared with
    """

    share: float
    contraction: float
    margin: float
    rounding: Mapping[Precision, float]
    rubs: bool
    few: Samples
    errors: ReferenceErrors


class Setting(NamedTuple):
    """Settings of a run."""

    friction: FrictionName
    iterations: int | None = None
    precision: Precision = "complex128"

    @property
    def method(self) -> FrictionMethod:
        """How joint friction is solved."""
        return self.friction if self.iterations is None else Successive(iterations=self.iterations)


def run_to(
    mechanism: Compiled,
    accuracy: float,
    settings: Arguments,
    samples: Samples,
    want: Iterable[str] | str,
    static: bool,
    engine: EngineName,
    chunk: int | None,
) -> Result:
    """Run with the settings that an accuracy needs; ``result.accuracy`` says which.

    Raises `RequestError` where the accuracy is not a positive number, or where one of the
    ``settings`` that it chooses is not None.
    """
    if chosen_settings := [name for name, value in settings.items() if value is not None]:
        chosen, remedy = f"accuracy={accuracy!r:.60} chooses it", "give the accuracy or the setting"
        raise refused(listed(chosen_settings), chosen, remedy, code="useless-setting")
    if not (is_number(accuracy) and accuracy > 0):
        wrong = f"must be > 0, got {accuracy!r:.60}"
        raise refused("accuracy", wrong, "try 1e-6", code="bad-value")
    request = _Request(mechanism, as_names("want", want), static)
    cache = mechanism._once(_decisions)
    key, fingerprint = (request.want, static, accuracy, engine), _fingerprint(samples)
    decided, setting, judged = cache.get(key, (b"", None, None))
    if setting is not None and decided == fingerprint:
        result = request.run(samples, setting, engine, chunk)
        result.accuracy = judged
        return result
    probe = look(request, _probed(samples), accuracy)
    for setting in _settings(request, probe, samples.n, accuracy, engine):
        result = request.run(samples, setting, engine, chunk)
        judged = _judged(request, result, setting, probe, accuracy)
        if judged.reached:
            break
    result.accuracy = judged
    cache[key] = fingerprint, setting, judged
    return result


def _probed(samples: Samples) -> Samples:
    """Samples to probe: some of those asked for; of few of them also what lies roundings beside.

    One sample alone may have none of the rounding that those next to it have.
    """
    index = samples.spread(PROBE)
    copies = math.ceil(PROBE / max(1, len(index)))
    few = samples.at(np.repeat(index, copies))
    perturbed = 1 + DOUBLE * np.tile(np.arange(copies), len(index))
    inputs = {n: few.inputs[n] * (perturbed if n[:2] == "q_" else 1.0) for n in few.inputs}
    return few if copies == 1 else replace(few, inputs=inputs)


def _decisions(mechanism: Compiled) -> dict[Any, tuple[bytes, Setting | None, Accuracy | None]]:
    """For each request its last samples, and what was chosen for them; there is none at first."""
    return {}


def _fingerprint(samples: Samples) -> bytes:
    """A word that is the same for the same samples only."""
    digest = hashlib.blake2b(repr(samples.clock).encode())
    for name, x in (*samples.inputs.items(), ("times", samples.times)):
        digest.update(name.encode())
        if x is not None:
            digest.update(np.asarray(x, float).tobytes())
    return digest.digest()


class _Request(NamedTuple):
    """What is asked of every run."""

    mechanism: Compiled
    want: Iterable[str] | str
    static: bool

    def run(
        self,
        samples: Samples,
        setting: Setting,
        engine: EngineName = "numpy",
        chunk: int | None = None,
    ) -> Result:
        """A run with a setting."""
        settings: Arguments = {"friction": setting.method, "static": self.static}
        return self.mechanism._answer(
            samples, self.want, settings, engine, setting.precision, chunk
        )


def look(request: _Request, few: Samples, accuracy: float = math.inf) -> Probe:
    """Probe a request at some samples.

    Where double precision will not do for the accuracy, the wider one is measured as well.
    The equations of friction amplify rounding, by no more than 1 / (1 - P): what double
    precision loses is measured with friction, where a wider number is at hand to tell.
    """
    double = request.run(few, Setting("newton"))
    rubs = bool(double._plan.reports["friction"])
    good = _known(double)
    smooth = request.run(few, Setting("none")) if rubs else double
    single = request.run(few, Setting("none", precision="complex64"))
    wide = request.run(few, Setting("none", precision="clongdouble")) if WIDER else None
    rounding, excluded = _rounding(single, smooth, wide, good)
    errors = reference_errors(double, double, good).without(excluded)
    bounds = double.quality.contraction.values()
    contraction = max((float(np.max(c[good], initial=0.0)) for c in bounds), default=0.0)
    share = errors.error(smooth) if rubs else 0.0
    signed = comparable(double, friction=True)  # elsewhere rounding decides which way friction is
    if not good.any():
        rounding = dict.fromkeys(rounding, math.inf)
    elif rubs and WIDER and signed.any():
        rubbed = request.run(few, Setting("newton", precision="clongdouble"))
        lost = reference_errors(rubbed, double, signed).without(excluded).error(double)
        for name in rounding.keys() - {"complex64"}:
            rounding[name] = max(rounding[name], lost * EPS_OF[name] / DOUBLE)
    elif rubs:
        rounding["complex128"] *= 1 + share / max(1 - contraction, DOUBLE)
    if wide is not None and SAFETY * rounding["complex128"] > accuracy / 2:
        settings = {"friction": "none", "static": request.static, "want": tuple(wide)}
        exact = reference_errors(wide, wide, good).without(excluded)
        rounding["clongdouble"] = max(
            rounding["clongdouble"], _kept_back(exact, request, few, settings)
        )
    return Probe(share, contraction, _least_margin(double, good), rounding, rubs, few, errors)


def _kept_back(
    exact: ReferenceErrors, request: _Request, few: Samples, settings: Arguments
) -> float:
    """What a wider number does not gain: kernels that iterate, lengths derived in double."""
    runs = [rotated_run]
    if request.mechanism.names is not None:  # made of a document
        runs.append(run_off_by_a_digit)
    return max(exact.error(run(request.mechanism, few, "clongdouble", settings)) for run in runs)


def _known(result: Result) -> NDArray[np.bool_]:
    """(n,) samples that are judged: those near a dead centre where there are no others.

    There precisions differ by more; beside others that would hide what is lost elsewhere.
    """
    good = comparable(result, friction=False)
    return good if good.any() else comparable(result, friction=False, near=True)


def _least_margin(result: Result, good: Array) -> float:
    margins = result.quality.margin.values()
    return min((float(np.min(m[good], initial=1.0)) for m in margins), default=1.0)


def _rounding(
    single: Result, double: Result, wide: Result | None, good: Array
) -> tuple[dict[Precision, float], tuple[str, ...]]:
    """Errors of the precisions on the probe, without friction, and outputs made of rounding.

    Where no wider number is at hand the error in double is inferred from the one in
    single precision: rounding is linear in the last digit.
    """
    if wide is not None:
        errors = reference_errors(wide, double, good)
        lost = max(errors.error(double), DOUBLE)
        rows: dict[Precision, float] = {"complex128": lost, "clongdouble": lost * LONG / DOUBLE}
    else:
        errors = reference_errors(double, single, good, unsure=1.0)
        rows = {"complex128": max(errors.error(single) * DOUBLE / SINGLE, DOUBLE)}
    return {"complex64": max(errors.error(single), SINGLE), **rows}, errors.left_out


def _settings(
    request: _Request, probe: Probe, n: int, accuracy: float, engine: EngineName
) -> Iterator[Setting]:
    """Settings to try, from the cheapest that does at the probe to the most exact."""
    narrow = n >= ENOUGH and not probe.rubs
    if narrow and engine == "auto":  # machine code is faster than NumPy's single precision
        plan = request.mechanism._plan_at(probe.few, request.want, static=request.static)
        narrow = request.mechanism._chosen(plan, n) != "llvm"
    allowed = {"complex128"}
    if engine in ("auto", "numpy"):
        allowed |= {"clongdouble", "complex64"} if narrow else {"clongdouble"}
    precisions = [p for p in probe.rounding if p in allowed]
    half = accuracy / 2  # for friction, the rest for rounding
    fine = [p for p in precisions if SAFETY * probe.rounding[p] <= half] or precisions[-1:]
    if probe.rubs and probe.contraction < CONTRACTS and probe.errors.good.any():
        for friction, count in FRICTION:
            setting = Setting(friction, count, fine[0])
            if SAFETY * probe.errors.error(request.run(probe.few, setting)) <= half:
                yield setting
                break
    yield from (Setting("newton", None, precision) for precision in fine)


def _judged(
    request: _Request, result: Result, setting: Setting, probe: Probe, accuracy: float
) -> Accuracy:
    """The estimate after the run, from its own residuals, contractions and margins."""
    good = _known(result)
    nearer = max(1.0, probe.margin / max(_least_margin(result, good), 1e-300))
    rounding = SAFETY * probe.rounding[setting.precision] * nearer**1.5
    rubbing, explanation = 0.0, f"{rounding:.1g} from rounding"
    if probe.rubs:
        rubbing = _friction_left(request, result, setting, probe, good)
        explanation += f", {rubbing:.1g} from friction"
    answered = np.array([word == "ok" for word in result.quality.status])
    unsure, excluded, bound = int((answered & ~good).sum()), probe.errors.left_out, 0.0
    if unsure:
        explanation += f"; at or near a dead centre, so by their margins: {unsure} samples"
    if excluded:
        explanation += f"; rounding alone, so by the margins: {listed(excluded, 3)}"
    if unsure or excluded:
        margin = max(_least_margin(result, answered), 1e-200)
        bound = SAFETY * EPS_OF[setting.precision] / margin**1.5
    return Accuracy(accuracy, max(rounding + rubbing, bound), *setting, explanation)


def _friction_left(
    request: _Request, result: Result, setting: Setting, probe: Probe, good: Array
) -> float:
    """Error that the solution of the friction equations leaves."""
    error, quality = 0.0, result.quality
    for block, residual in quality.residual.items():
        P = float(np.max(quality.contraction[block][good], initial=probe.contraction))
        if setting.friction == "newton":
            P = min(P, CONTRACTS)  # not what decides whether it converges
        worst = float(np.max(residual[good], initial=0.0))
        error += SAFETY * probe.share * worst / (1 - P) if P < 1 else math.inf
    if setting.friction == "newton":
        return error
    # Shares of several joints may cancel; errors need not.
    return max(error, SAFETY * probe.errors.error(request.run(probe.few, setting)))
