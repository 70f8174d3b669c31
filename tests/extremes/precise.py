"""The same plan in 60 digits: what the answers really are, and what noise in the data does.

The program of a plan is bound to mpmath numbers. Its parameters are the doubles of
the model, exactly, or moved by half a unit in the last place to see what rounding of
the data alone forces. The driver coordinate counts as exact.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mpmath
import numpy as np

from blockmech import plane
from blockmech.engines.binding import bind
from blockmech.mechanism import Mechanism
from blockmech.plan import Plan

DIGITS = 60


def _complex(x: Any, y: Any) -> Any:
    return mpmath.mpc(x, y)


PRIMITIVES: dict[str, Callable[..., Any]] = {
    "cross": lambda a, b: a.real * b.imag - a.imag * b.real,
    "dot": lambda a, b: a.real * b.real + a.imag * b.imag,
    "mul": lambda z, x: _complex(z.real * x, z.imag * x),
    "imul": lambda z, x: _complex(-z.imag * x, z.real * x),
    "expi": lambda t: _complex(mpmath.cos(t), mpmath.sin(t)),
    "hyp": lambda z: mpmath.sqrt(z.real * z.real + z.imag * z.imag),
    "sqrt": lambda x: mpmath.sqrt(x) if x >= 0 else mpmath.nan,
    "sign": mpmath.sign,
    "where": lambda c, a, b: a if c else b,
    "minimum": lambda a, b: min(a, b),
    "maximum": lambda a, b: max(a, b),
    "planar": _complex,
    "repeat": plane.repeat,
    "repair": lambda c, one, given, *data: given,
}


class Precise:
    """A plan bound to mpmath numbers."""

    def __init__(self, mechanism: Mechanism, want: Sequence[str]) -> None:
        self.plan: Plan = mechanism.plan(tuple(want), friction="none")
        constants = {"ZERO": mpmath.mpc(0), "ONE": mpmath.mpc(1)}
        with mpmath.workdps(DIGITS):
            self._program = bind(self.plan.program, PRIMITIVES, constants)

    def values(
        self, inputs: Mapping[str, float], noise: Callable[[float], Any] = mpmath.mpf
    ) -> dict[str, list[Any]]:
        """Output -> its values; ``noise`` turns each number of the model into an mpmath one."""
        program = self.plan.program
        with mpmath.workdps(DIGITS):
            arguments = [mpmath.mpf(inputs[name]) for name in program.inputs]
            parameters = tuple(_moved(v, noise) for v in program.parameters.values())
            found = self._program(*arguments, parameters)
        return {n: [found[i] for i in self.plan.layout[n]] for n in self.plan.want}


def half_ulp(seed: int, dtype: Any = np.float64) -> Callable[[float], Any]:
    """Noise of half a unit in the last place of a precision; zero stays zero."""
    dice = random.Random(seed)
    half = float(np.finfo(dtype).eps) / 2

    def moved(x: float) -> Any:
        return mpmath.mpf(x) * (1 + mpmath.mpf(half) * dice.choice((-1, 1)))

    return moved


def rounded(dtype: Any) -> Callable[[float], Any]:
    """The number of the model as a precision holds it, exactly."""
    return lambda x: mpmath.mpf(float(dtype(x)))


def _moved(value: Any, noise: Callable[[float], Any]) -> Any:
    if isinstance(value, tuple):
        return type(value)(*(_moved(x, noise) for x in value))
    if isinstance(value, complex):
        return mpmath.mpc(noise(value.real), noise(value.imag))
    return noise(float(value))
