"""The same plan in 60 digits: what the answers really are, and what noise in the data does.

The program of a plan is bound to mpmath numbers. Its parameters are the doubles of
the model, exactly, or moved by half a unit in the last place to see what rounding of
the data alone forces. The driver coordinate counts as exact.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import FunctionType
from typing import Any

import mpmath
import numpy as np

from blockmech.engines.binding import bind
from blockmech.ground import plane
from blockmech.mechanism import Mechanism
from blockmech.plan.plan import Plan

DIGITS = 60


def _complex(x: Any, y: Any) -> Any:
    return mpmath.mpc(x, y)


def _angle(a: Any, b: Any) -> Any:
    return mpmath.atan2(plane.cross(a, b), plane.dot(a, b))


def _modulo(x: Any, period: Any) -> Any:
    rest = mpmath.fmod(x, period)
    return rest if rest >= 0 else rest + period


def _implicit(step: Callable[..., Any], state: Any, *data: Any) -> Any:
    for _ in range(2):  # from 16 digits to more than `DIGITS`
        state = step(state, *data)
    return state


def _solve(a: Any, right: Any) -> tuple[Any, ...]:
    return tuple(mpmath.lu_solve(a, mpmath.matrix(list(right))))


def _spread(a: Any) -> Any:
    result = mpmath.svd_r(a, compute_uv=False)
    return min(result) / max(result)


PRIMITIVES: dict[str, Callable[..., Any]] = {
    **plane.SCALAR_PRIMITIVES,
    "mul": lambda z, x: _complex(z.real * x, z.imag * x),
    "imul": lambda z, x: _complex(-z.imag * x, z.real * x),
    "expi": lambda t: _complex(mpmath.cos(t), mpmath.sin(t)),
    "hyp": lambda z: mpmath.sqrt(z.real * z.real + z.imag * z.imag),
    "sqrt": lambda x: mpmath.sqrt(x) if x >= 0 else mpmath.nan,
    "exp": mpmath.exp,
    "power": lambda x, y: mpmath.power(x, y) if x >= 0 else mpmath.nan,
    "sign": mpmath.sign,
    "minimum": min,
    "maximum": max,
    "angle": _angle,
    "modulo": _modulo,
    "planar": _complex,
    "matrix": lambda rows: mpmath.matrix([list(map(mpmath.mpf, row)) for row in rows]),
    "solve": _solve,
    "solve_transposed": lambda a, right: _solve(a.T, right),
    "spread": _spread,
    "implicit": _implicit,
}


class _InDouble:
    """The path of a general group from home: a guess, which Newton's method refines."""

    def __init__(self, path: Any) -> None:
        self.path = path
        self.__name__ = path.__name__

    def __call__(self, q: tuple[Any, ...]) -> Any:
        links, share = self.path(tuple(map(float, q)))
        return tuple(tuple(map(mpmath.mpf, link)) for link in links), mpmath.mpf(share)


class Precise:
    """A plan bound to mpmath numbers."""

    def __init__(
        self, mechanism: Mechanism, want: Sequence[str], friction: str = "none", **how: Any
    ) -> None:
        self.plan: Plan = mechanism.plan(tuple(want), friction=friction, **how)
        constants = {"ZERO": mpmath.mpc(0), "ONE": mpmath.mpc(1), "REST": plane.REST_SHARE}
        program = self.plan.program
        functions = {
            name: f if isinstance(f, FunctionType | type) else _InDouble(f)
            for name, f in program.functions.items()
        }
        with mpmath.workdps(DIGITS):
            self._program = bind(replace(program, functions=functions), PRIMITIVES, constants)

    def run(self, inputs: Mapping[str, float], parameters: Sequence[Any]) -> tuple[Any, ...]:
        """All values of the program, of parameters in mpmath numbers."""
        arguments = [mpmath.mpf(inputs[name]) for name in self.plan.program.inputs]
        found: tuple[Any, ...] = self._program(*arguments, tuple(parameters))
        return found

    def values(
        self, inputs: Mapping[str, float], noise: Callable[[float], Any] = mpmath.mpf
    ) -> dict[str, list[Any]]:
        """Output -> its values; ``noise`` turns each number of the model into an mpmath one."""
        program = self.plan.program
        with mpmath.workdps(DIGITS):
            result = self.run(inputs, [moved(v, noise) for v in program.parameters.values()])
        return {n: [result[i] for i in self.plan.layout[n]] for n in self.plan.want}


def half_ulp(seed: int, dtype: Any = np.float64) -> Callable[[float], Any]:
    """Noise of half a unit in the last place of a precision; zero stays zero."""
    dice = random.Random(seed)
    half = float(np.finfo(dtype).eps) / 2

    def noise(x: float) -> Any:
        return mpmath.mpf(x) * (1 + mpmath.mpf(half) * dice.choice((-1, 1)))

    return noise


def rounded(dtype: Any) -> Callable[[float], Any]:
    """The number of the model as a precision holds it, exactly."""
    return lambda x: mpmath.mpf(float(dtype(x)))


def moved(value: Any, noise: Callable[[float], Any]) -> Any:
    if isinstance(value, tuple):
        parts = [moved(x, noise) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if isinstance(value, complex):
        return mpmath.mpc(noise(value.real), noise(value.imag))
    return noise(float(value))


def assert_encloses(bounds: Any, mechanism: Mechanism, friction: str) -> None:
    """Whether all bounds of an `Enclosure` hold the values in 60 digits."""
    precise = Precise(mechanism, tuple(bounds), friction)
    n = bounds.result.n
    columns = bounds.result.samples.given(precise.plan.program.inputs)
    for k in range(n):
        inputs = {name: float(np.broadcast_to(x, n)[k]) for name, x in columns.items()}
        with mpmath.workdps(DIGITS):
            for name, values in precise.values(inputs).items():
                low, high = bounds.low[name][k], bounds.high[name][k]
                if len(values) == 1:
                    z = mpmath.mpmathify(values[0])
                    assert low.real <= z.real <= high.real, (name, k)
                    assert low.imag <= z.imag <= high.imag, (name, k)
