"""What a links-and-joints document loses before any engine starts: its lengths.

A document gives places, and the lengths of its links are made of them in double precision.
So they are known to its last digit, in whatever precision a run then is.
"""

from __future__ import annotations

from itertools import cycle

from blockmech.analysis.reference_errors import DOUBLE
from blockmech.compiled import Compiled
from blockmech.engines.numpy import NumpyEngine, each_part
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Arguments, Data


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
