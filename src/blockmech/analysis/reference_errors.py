"""What rounding makes of a run: its error against a reference, and the digits that it loses.

The error is one number, relative, against a reference at the same samples.

The samples that a table shows are computed once more by the same program with longer numbers
(`numpy.longdouble`). What changes is rounding: it is told where it takes more than half of the
digits, relative to the output's own size, or to that of its unit where it is nothing beside the
others. What is rounding with the longer numbers too is zero: nothing of it is lost. Where the
machine has no longer numbers, nothing can be told.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.numpy import each_part
from blockmech.ground.tolerances import EQUAL
from blockmech.result.quality import DIGITS_LOST, Flag
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.result.tables import ROWS
from blockmech.typing import Arguments, Array, Data, Precision

DOUBLE = float(np.finfo(np.float64).eps)
LONG = float(np.finfo(np.longdouble).eps)
WIDER = LONG < DOUBLE
MOST_ITERATIONS = 6  # successive ones: beyond, Newton's method is cheaper
NATURAL = {
    "rad/s2": ("rad/s", "rad/s"),
    "m/s2": ("m/s", "rad/s"),
    "kg m2/rad": ("kg m2",),
    "W": ("N m", "rad/s"),
}
"""Unit -> the units whose product measures it: an acceleration that is zero throughout is
measured by the square of the rates, and not by its own rounding."""
UNSURE = 1e-3  # disagreement of the references above which an output has no sure value


@dataclass(frozen=True)
class ReferenceErrors:
    """Reference values of the compared outputs, and what errors are relative to.

    Attributes
    ----------
    values : output -> array of the reference, in its precision
    scale : output -> its unit of error: 1 for angles, else the largest magnitude
    good : (n,) samples that are compared
    left_out : outputs without a sure value
    """

    values: Mapping[str, Array]
    scale: Mapping[str, float]
    good: NDArray[np.bool_]
    left_out: tuple[str, ...] = ()

    def each(self, result: Result) -> dict[str, Array]:
        """Relative errors (n,) of every compared output; infinite where it has no answer."""
        return {
            name: _distance(result, name, values) / self.scale[name]
            for name, values in self.values.items()
        }

    def without(self, names: tuple[str, ...]) -> ReferenceErrors:
        """The same for fewer outputs."""
        values = {n: v for n, v in self.values.items() if n not in names}
        return replace(self, values=values, left_out=names)

    def worst(self, result: Result) -> tuple[float, str]:
        """The largest relative error over the compared outputs and samples, and of which."""
        each = self.each(result)
        errors = ((float(np.max(_at(e, self.good), initial=0.0)), n) for n, e in each.items())
        return max(errors, default=(0.0, ""), key=lambda row: row[0])

    def error(self, result: Result) -> float:
        """The largest relative error over the compared outputs and samples."""
        return self.worst(result)[0]


def reference_errors(
    reference: Result, check: Result, good: NDArray[np.bool_], unsure: float = UNSURE
) -> ReferenceErrors:
    """The errors against what two runs agree on.

    Parameters
    ----------
    reference, check : runs of the same samples
    good : (n,) samples that are compared
    unsure : disagreement from which an output is left out
    """
    values = {name: np.atleast_1d(reference[name]) for name in compared(reference)}
    scale = _scales(reference, values, good)
    apart = ReferenceErrors(values, scale, good).each(check)
    doubtful = (n for n, e in apart.items() if not np.max(_at(e, good), initial=0.0) < unsure)
    return ReferenceErrors(values, scale, good).without(tuple(doubtful))


def compared(result: Result) -> list[str]:
    """Outputs whose errors count.

    Ratios that have poles, and those of a whole run, count only where nothing else is
    wanted: over a cycle without net work they are zero over zero.
    """
    names = [n for n in result if result._output(n).kind != "matrix"]
    plain = [
        n
        for n in names
        if result._output(n).kind != "number" and not n.endswith("mechanical_advantage")
    ]
    return plain or names


def comparable(result: Result, friction: bool, near: bool = False) -> NDArray[np.bool_]:
    """(n,) samples with a sure answer, see `unsure_samples`; or those ``near`` a dead centre."""
    unsure = unsure_samples(result, friction)
    good = np.ones(result.n, dtype=bool)
    good[[i for i, why in unsure.items() if not (near and why == "near-dead-centre")]] = False
    return good


def unsure_samples(result: Result, friction: bool) -> dict[int, str]:
    """Sample without an answer, at a dead centre, or with friction between two signs -> why."""
    codes = ["dead-centre", "near-dead-centre", "change-point", "near-change-point"]
    codes += ["zero-relative-speed"] * friction
    flagged = {f.sample: f.code for f in result.quality.flags if f.code in codes}
    return flagged | {i: word for i, word in enumerate(result.quality.status) if word != "ok"}


def _scales(
    reference: Result, values: Mapping[str, Array], good: NDArray[np.bool_]
) -> dict[str, float]:
    """Output -> 1 for angles, else its largest magnitude, or of a tiny one that of its unit."""
    sizes = {n: _largest(_at(v, good)) for n, v in values.items()}
    inputs = reference.samples.inputs
    rates = [_largest(inputs[name]) for name in inputs if name[:3] == "qd_"]
    by_unit = {"rad/s": max(rates, default=0.0)}
    for name, size in sizes.items():
        by_unit[reference.unit(name)] = max(by_unit.get(reference.unit(name), 0.0), size)
    for unit, factors in NATURAL.items():
        product = float(np.prod([by_unit.get(f, 0.0) for f in factors]))
        by_unit[unit] = max(by_unit.get(unit, 0.0), product)
    scale = {}
    for name, size in sizes.items():
        top = by_unit[reference.unit(name)]
        measured = size if size > EQUAL * top else top
        scale[name] = 1.0 if _is_angle(reference, name) else measured or 1.0
    return scale


def _is_angle(result: Result, name: str) -> bool:
    output = result._output(name)
    return bool(output.unit == "rad" and output.kind == "real")


def _distance(result: Result, name: str, wanted: Array) -> Array:
    """Distance (n,) from the wanted values; of angles but coordinates, less whole turns."""
    values = np.atleast_1d(result[name])
    with np.errstate(invalid="ignore"):
        gap = values - wanted
        if _is_angle(result, name) and not name.endswith(".q"):
            turn = 8 * np.arctan(np.ones((), gap.dtype))
            gap = gap - turn * np.round(gap / turn)
        size = np.abs(gap)
    size = np.where(np.isfinite(size), size, np.inf)
    return np.where(~np.isfinite(values) & ~np.isfinite(wanted), 0.0, size)


def _at(values: Array, good: NDArray[np.bool_]) -> Array:
    """The values at the samples that are compared; a number of the whole run as it is."""
    return values[good] if len(values) == len(good) else values


def _largest(values: Array) -> float:
    size = np.abs(values)
    return float(np.max(size[np.isfinite(size)], initial=0.0))


def run_off_by_a_digit(
    mechanism: Compiled, samples: Samples, precision: str, settings: Arguments
) -> Result:
    """A run whose numbers are off by the last digit of double precision, up and down by turns.

    Columns are those of tables, which a document gives as they are.
    """
    plan = mechanism.plan(**settings)
    engine = NumpyEngine(plan.program, precision)
    factors = cycle((1 + engine.dtype(DOUBLE), 1 - engine.dtype(DOUBLE)))
    engine.parameters = each_part(lambda x: x if x.ndim else x * next(factors), engine.parameters)
    values = engine.run(samples.given(plan.program.inputs), samples.n)
    return Result(mechanism, plan, samples, values, "numpy", how(settings))


def how(settings: Arguments) -> Data:
    """The settings of a result that was run in a way of its own."""
    usual = {"friction": "newton", "static": False}
    return usual | {k: v for k, v in settings.items() if k != "want"}


@np.errstate(all="ignore")  # what is not finite is told by the quality
def digits_lost(result: Result) -> tuple[Flag, ...]:
    """Outputs of which more than half of the digits are rounding, the worst first.

    ``value`` of a flag is the relative error [-] at the sample where it is largest; at most 1,
    where nothing of the number is left.
    """
    if not (WIDER and result.n):
        return ()
    index = result.samples.spread(ROWS)
    short = result.isel(index)
    wide = _rerun(short, "clongdouble")
    good = comparable(short, friction=True) & comparable(wide, friction=True)
    flags = []
    for name, each in reference_errors(wide, short, good, math.inf).each(short).items():
        lost = np.where(good, each, 0.0) if len(each) == len(good) else each
        i, half = int(lost.argmax()), math.sqrt(float(np.finfo(np.asarray(short[name]).dtype).eps))
        if lost[i] > half:
            flags.append(Flag(int(index[i]), DIGITS_LOST, name, value=min(float(lost[i]), 1.0)))
    if flags:
        runs, at = (short, _rerun(short, "complex64")), list(index)
        flags = [f for f in flags if not _is_zero(f.where, at.index(f.sample), wide, runs)]
    return tuple(sorted(flags, key=lambda flag: (-(flag.value or 0.0), flag.where)))


def _rerun(result: Result, precision: Precision) -> Result:
    """The same samples by numbers of another length."""
    mechanism, plan, samples = result.mechanism, result._plan, result.samples
    values, engine = mechanism._evaluate(plan, samples, "numpy", precision)
    return Result(mechanism, plan, samples, values, engine, result.settings)


def _is_zero(name: str, i: int, wide: Result, shorter: Iterable[Result]) -> bool:
    """Whether a value is rounding with the longer numbers too, as shorter ones tell."""
    value, eps = wide[name][i], float(np.finfo(wide[name].dtype).eps)
    roundings = [np.abs(r[name][i] - value).max() / np.finfo(r[name].dtype).eps for r in shorter]
    return bool(np.abs(value).max() <= np.nanmax(roundings) * math.sqrt(eps * DOUBLE))
