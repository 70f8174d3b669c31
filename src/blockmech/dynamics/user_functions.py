"""Functions of a user in a motion: laws of loads, and blocks of Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from blockmech.dynamics.request import Pairs
from blockmech.dynamics.source import Source
from blockmech.functions.pieces import Function
from blockmech.ground.errors import refused
from blockmech.loads.contract import Following
from blockmech.signals.functions import Python

ELSEWHERE = 0.125  # [rad or m, per s, s] or of a signal: where they are evaluated besides


def user_functions(mechanism: Source) -> list[tuple[str, Function | Python, str]]:
    """Names, laws or blocks, and drivers of what functions of a user say."""
    structure = mechanism.structure
    loads = ((n, x) for n, x in structure.elements.items() if isinstance(x, Following))
    laws = ((n, x.law, x.driver or "") for n, x in loads if isinstance(x.law, Function))
    return [*laws, *((n, x, "") for n, x in structure.signals.items() if isinstance(x, Python))]


def refuse_memory(mechanism: Source, starts: Pairs) -> None:
    """Refuse functions of a user that answer the same question in two ways.

    A motion asks a law forth and back in time, and in several runs: what a function keeps from
    one call to the next would be of another run. Each is asked at the start, elsewhere, and at
    the start again.
    """
    first = next(iter(starts.values()), (0.0, 0.0))
    for name, law, driver in mechanism._once(user_functions):
        if isinstance(law, Function):
            at = starts.get(driver, first)
            variables = {"coordinate": at[0], "rate": at[1], "time": 0.0}
            inputs = [variables[x] for x in law.of]
        else:
            inputs = [law.memory.get(x, 0.0) for x in law.names]
        if not _same_again(law.call, inputs):
            fault = "its function gives another value when it is asked the same again"
            valid = "a law is a function of its arguments alone"
            remedy = "let a block signals.Python hold in its memory what it remembers"
            raise refused(name, fault, remedy, valid, "user-function")


def _same_again(call: Callable[..., ArrayLike], inputs: Sequence[float]) -> bool:
    """Whether a function gives the same twice, with another question in between."""
    answers = []
    with suppress(Exception):  # what it raises is reported where the motion calls it
        for step in (0.0, ELSEWHERE, 0.0):
            answers.append(np.asarray(call(*(x + step for x in inputs)), dtype=np.float64))
    return len(answers) < 3 or np.array_equal(answers[0], answers[2], equal_nan=True)
