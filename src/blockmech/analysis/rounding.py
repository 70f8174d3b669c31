"""Digits lost: how much of a result is rounding, where its numbers cancel.

The samples that a table shows are computed once more by the same program with longer numbers
(`numpy.longdouble`). What changes is rounding: it is told where it takes more than half of the
digits, relative to the output's own size, or to that of its unit where it is nothing beside the
others. Where the machine has no longer numbers, nothing can be told.
"""

from __future__ import annotations

import math

import numpy as np

from blockmech.analysis.reference_errors import WIDER, comparable, reference_errors
from blockmech.export.tables import ROWS
from blockmech.quality import DIGITS_LOST, Flag
from blockmech.result import Result


@np.errstate(all="ignore")  # what is not finite is told by the quality
def digits_lost(result: Result) -> tuple[Flag, ...]:
    """Outputs of which more than half of the digits are rounding, the worst first.

    ``value`` of a flag is the relative error [-] at the sample where it is largest; at most 1,
    where nothing of the number is left.
    """
    if not (WIDER and result.n):
        return ()
    mechanism, index = result.mechanism, result.samples.spread(ROWS)
    short = result.at(index)
    values, engine = mechanism.evaluate(short.plan, short.samples, "numpy", "clongdouble")
    wide = Result(mechanism, short.plan, short.samples, values, engine, result.settings)
    good = comparable(short, friction=True) & comparable(wide, friction=True)
    found = []
    for name, each in reference_errors(wide, short, good, math.inf).each(short).items():
        lost = np.where(good, each, 0.0) if len(each) == len(good) else each
        i, half = int(lost.argmax()), math.sqrt(float(np.finfo(np.asarray(short[name]).dtype).eps))
        if lost[i] > half:
            found.append(Flag(int(index[i]), DIGITS_LOST, name, value=min(float(lost[i]), 1.0)))
    return tuple(sorted(found, key=lambda flag: (-(flag.value or 0.0), flag.where)))
