"""Engines that run a program as it is: Python numbers one pose at a time, or arrays of NumPy.

Numbers are fastest below some hundred poses. Python raises where a kernel divides by zero (a group
exactly at dead centre, B on D). That sample is then computed again on arrays of one, where the
division gives infinity or NaN, so both engines lose the same values of it and no others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from blockmech.engines.binding import bind
from blockmech.engines.numpy import CHUNK, PRECISIONS, Planar, cast, each_part, leaves, primitives
from blockmech.ground.plane import REST_SHARE, SCALAR_CONSTANTS, SCALAR_PRIMITIVES
from blockmech.plan.plan import Program
from blockmech.typing import Array, Nested, Real, Reals, Record, Values


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
            if self._arrays is None:
                self._arrays = NumpyEngine(self.program)
            columns = {n: np.array([x]) for n, x in zip(self.program.inputs, inputs, strict=True)}
            return tuple(_number(value) for value in self._arrays.run(columns, 1))

    def run(self, inputs: Record, n: int) -> Values:
        """Values of n samples: Python numbers for one, lists of them for more."""
        columns = [inputs[name] for name in self.program.inputs]
        if n == 1:
            return self.one([float(c[0]) for c in columns])
        rows = [self.one([float(c[i]) for c in columns]) for i in range(n)]
        return tuple([row[k] for row in rows] for k in range(len(self.program.outputs)))


class NumpyEngine:
    """A program bound to arrays of one precision."""

    name = "numpy"
    designs_together = CHUNK  # samples of designs that are best run at once

    def __init__(self, program: Program, precision: str = "complex128") -> None:
        self.program = program
        self.precision = precision
        self.dtype = PRECISIONS[precision]
        self.constants = {
            "ZERO": self._cast(0j),
            "ONE": self._cast(1 + 0j),
            "REST": max(REST_SHARE, float(np.finfo(self.dtype).eps) ** 0.75),
        }
        self._program = bind(program, primitives(self.dtype), self.constants)
        self.parameters = tuple(self._cast(v) for v in program.parameters.values())

    def _cast(self, value: Nested) -> Nested:
        def column(x: Reals) -> Array:
            return np.array(np.broadcast_arrays(*x), self.dtype)  # (k,), of designs (k, D, 1)

        return cast(value, self.dtype, column)

    def run(self, inputs: Mapping[str, Array], n: int, chunk: int = CHUNK) -> Values:
        """Values of n samples: real arrays (n,) or `Planar` pairs of them."""
        columns = [self._rounded(name, inputs[name]) for name in self.program.inputs]
        rooms: Values = ()
        with np.errstate(all="ignore"):
            for k in range(0, max(n, 1), chunk):
                part = slice(k, min(k + chunk, n))
                values = self._program(*(c[part] for c in columns), self.parameters)
                if n <= chunk:
                    return tuple(each_part(lambda x: _column(x, n), values))
                rooms = rooms or self._rooms(values, n)
                for room, value in zip(leaves(rooms), leaves(values), strict=True):
                    if room.flags.writeable:
                        room[part] = value
        return rooms

    def numbers(self, values: Values) -> Values:
        """Numbers of designs as the engine takes them, of those of `Program.values`."""
        return tuple(map(self._cast, values))

    def run_designs(self, inputs: Mapping[str, Array], numbers: Values) -> Values:
        """Values of m designs at n samples each, as batches that broadcast to (m, n).

        ``numbers`` are those of designs, as columns (m, 1); inputs are (n,) or (m, n). A design's
        numbers are those that it has alone.
        """
        columns = [np.atleast_2d(self._rounded(n, inputs[n])) for n in self.program.inputs]
        with np.errstate(all="ignore"):
            return self._program(*columns, numbers)

    def _rooms(self, values: Values, n: int) -> Values:
        """Room for n samples of each value; columns of one block, whose memory is used again."""

        def plain(x: Real) -> bool:
            return np.ndim(x) == 1 and x.dtype == self.dtype

        block = iter(np.empty((sum(map(plain, leaves(values))), n), self.dtype))
        return tuple(each_part(lambda x: next(block) if plain(x) else _column(x, n, True), values))

    def _rounded(self, name: str, column: Reals | Array) -> Array:
        array: Array = np.asarray(column)  # one pose comes as a list
        # Angles stay in double until sine and cosine are taken.
        return array if name in self.program.angles else array.astype(self.dtype, copy=False)


def _column(x: Real, n: int, room: bool = False) -> Array:
    """A batch (n, ...) of a value, or room for one; a constant needs none."""
    if np.ndim(x) == 0:
        return np.broadcast_to(x, (n,))
    return np.empty((n, *x.shape[1:]), x.dtype) if room else x


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
