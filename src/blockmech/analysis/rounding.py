"""Digits lost: how much of a result is rounding, where its numbers cancel.

The samples that a table shows are computed once more by the same program with longer numbers
(`numpy.longdouble`). What changes is rounding: it is told where it takes more than half of the
digits, relative to the output's own size, or to that of its unit where it is nothing beside the
others. What is rounding with the longer numbers too is zero: nothing of it is lost. Where the
machine has no longer numbers, nothing can be told.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from blockmech.analysis.reference_errors import DOUBLE, WIDER, comparable, reference_errors
from blockmech.result.quality import DIGITS_LOST, Flag
from blockmech.result.result import Result
from blockmech.result.tables import ROWS
from blockmech.typing import Precision


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
