"""The scalar engine: Python numbers, one pose at a time; fastest below some hundred poses.

Python raises where a kernel divides by zero (a group exactly at dead centre, B on D).
That sample is then computed again on arrays of one, where the division gives infinity
or NaN, so both engines lose the same values of it and no others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from blockmech.engines.binding import bind
from blockmech.engines.numpy import NumpyEngine, Planar
from blockmech.ground.plane import SCALAR_CONSTANTS, SCALAR_PRIMITIVES
from blockmech.plan.plan import Program
from blockmech.typing import Array, Record, Values


class ScalarEngine:
    """A program bound to Python numbers."""

    name = "scalar"

    def __init__(self, program: Program) -> None:
        self.program = program
        self.parameters = tuple(program.parameters.values())
        self._fast = bind(program, SCALAR_PRIMITIVES, SCALAR_CONSTANTS)
        self._arrays: NumpyEngine | None = None

    def one(self, inputs: Sequence[float]) -> Values:
        """Values of one sample: float or complex each, NaN or infinite where impossible."""
        try:
            return self._fast(*inputs, self.parameters)
        except (ArithmeticError, ValueError):
            return self._on_arrays(inputs)

    def run(self, inputs: Record, n: int) -> Values:
        """Values of n samples: Python numbers for one, lists of them for more."""
        columns = [inputs[name] for name in self.program.inputs]
        if n == 1:
            return self.one([float(c[0]) for c in columns])
        rows = [self.one([float(c[i]) for c in columns]) for i in range(n)]
        return tuple([row[k] for row in rows] for k in range(len(self.program.outputs)))

    def _on_arrays(self, inputs: Sequence[float]) -> Values:
        if self._arrays is None:
            self._arrays = NumpyEngine(self.program)
        columns = {n: np.array([x]) for n, x in zip(self.program.inputs, inputs, strict=True)}
        return tuple(_number(value) for value in self._arrays.run(columns, 1))


class AdaptiveEvaluator:
    """A program of real values: by Python's numbers for one sample, by NumPy's arrays for more."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self._one, self._many = ScalarEngine(program), NumpyEngine(program)

    def run(self, inputs: Record, n: int) -> Values:
        """Values (n,) of n samples."""
        if n > 1:
            return self._many.run(inputs, n)
        return tuple(np.array([x]) for x in self._one.run(inputs, n))


def _number(value: Array | Planar) -> complex | float | Array:
    """A batch of one as a Python number; of matrices the matrix."""
    if isinstance(value, Planar):
        return complex(value.real[0], value.imag[0])
    return value[0] if value.ndim > 1 else float(value[0])
