"""The engine of any library whose arrays keep the array API standard.

``xp`` is its namespace: ``numpy``, ``array_api_strict``, ``jax.numpy`` (`blockmech.engines.jax`).
On ``numpy`` the numbers are those of `blockmech.engines.numpy`, but for linear systems, which are
eliminated as machine code does it.

Source: Python array API standard 2024.12.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from types import ModuleType
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from blockmech.engines import trace
from blockmech.engines.binding import bind, bind_functions
from blockmech.engines.derivatives import underivable_table
from blockmech.engines.numpy import Planar, cast, each_part, imul, leaves, mul
from blockmech.engines.numpy import each as each_of
from blockmech.ground.plane import (
    REST_SHARE,
    cross,
    dot,
    has_arithmetic,
    implicit,
    primitives_of,
    times,
)
from blockmech.plan.plan import Output, Program
from blockmech.typing import Data, Kernel, Nested, Real, Reals, Record, Values

ARITHMETIC = ("sqrt", "exp", "sign", "hypot", "where", "minimum", "maximum")
STANDARD_NAMES = {"absolute": "abs", "arctan2": "atan2", "rint": "round"}  # of NumPy's functions


def piecewise(xp: ModuleType, x: Real, knots: Real, rows: Sequence[Real]) -> Real:
    """See `blockmech.ground.plane.piecewise`."""
    inside = (knots[0] <= x) & (x <= knots[-1])
    k = xp.searchsorted(knots, x, side="right")
    k = xp.where(inside, xp.clip(k, None, knots.shape[0] - 1) - 1, xp.zeros_like(k))

    def entry(row: Real) -> Real:
        return xp.reshape(xp.take(row, xp.reshape(k, (-1,)), axis=0), k.shape)

    s, total = xp.where(inside, x - entry(knots), xp.zeros_like(x)), entry(rows[0])
    for row in rows[1:]:
        total = total * s + entry(row)
    return xp.where(inside, total, xp.full_like(total, math.nan))


def spread(xp: ModuleType, a: Sequence[Reals]) -> Real:
    """See `blockmech.ground.plane.spread`."""
    entries = xp.broadcast_arrays(*map(xp.asarray, chain.from_iterable(a)))
    stacked = xp.reshape(xp.stack(entries, axis=-1), (*entries[0].shape, len(a), len(a)))
    good = xp.all(xp.isfinite(stacked), axis=(-2, -1))
    plain = xp.where(good[..., None, None], stacked, xp.eye(len(a), dtype=stacked.dtype))
    values = xp.linalg.svdvals(plain)
    return xp.where(good, values[..., -1] / values[..., 0], xp.full_like(values[..., 0], math.nan))


def primitives(xp: ModuleType, dtype: Any) -> Data:
    """The primitives of the plane on arrays of a namespace, of one precision."""

    def array(x: Real) -> Real:
        plain = isinstance(x, float | int) and not isinstance(x, bool)
        return xp.asarray(x, dtype=dtype) if plain else xp.asarray(x)

    def on_arrays(function: Callable[..., Real]) -> Callable[..., Real]:
        return lambda *x: function(*map(array, x))

    arithmetic = {name: on_arrays(getattr(xp, name)) for name in ARITHMETIC}
    where = arithmetic["where"]

    def hyp(z: Planar) -> Real:
        return arithmetic["sqrt"](z.real * z.real + z.imag * z.imag)

    def expi(t: Real) -> Planar:
        x = array(t)  # angles may be of more precision
        parts = map(array, (xp.cos(x), xp.sin(x)))  # NumPy 2.0 casts no scalars
        return Planar(*(xp.astype(part, dtype) for part in parts))

    def angle(a: Planar, b: Planar) -> Real:
        return xp.atan2(cross(a, b) + 0.0, dot(a, b))

    def power(x: Real, y: Real) -> Real:
        return xp.pow(where(x >= 0.0, x, math.nan), array(y))

    def modulo(x: Real, period: Real) -> Real:
        return xp.remainder(array(x), array(period))

    def repeat(step: Kernel, state: Values, cap: int, *data: Nested) -> Values:
        for _ in range(cap):
            going = array(state[-1])
            if not xp.any(going):
                break
            following = step(state, *data)
            state = each_part(lambda new, old, w=going: where(w, new, old), following, state)
        return state

    def each(function: Callable[..., float], *x: Real) -> Real:
        return xp.asarray(each_of(function, *map(np.asarray, x)), dtype=dtype)

    def one_by_one(function: Callable[..., float], *x: Real) -> NoReturn:
        raise underivable_table()

    def planar(x: Real, y: Real) -> Planar:
        return Planar(array(x), array(y))

    flat = (trace.matrix, trace.solve, trace.solve_transposed)
    systems = bind_functions({f.__name__: f for f in flat}, {"where": where})
    functions = (
        hyp,
        expi,
        angle,
        power,
        modulo,
        piecewise,
        repeat,
        spread,
        each,
        planar,
        one_by_one,
    )
    kernels = (mul, imul, cross, dot, implicit, times)
    named = {f.__name__: f for f in (*functions, *kernels)}
    of_arrays = {"piecewise": partial(piecewise, xp), "spread": partial(spread, xp)}
    return {**arithmetic, **systems, **named, **of_arrays, "EPS": float(xp.finfo(dtype).eps)}


class Number(NDArrayOperatorsMixin):
    """An array of a namespace to functions of NumPy, by which outputs are read."""

    def __init__(self, xp: ModuleType, array: Real) -> None:
        self.xp, self.array = xp, array
        self.real, self.imag = self, 0.0

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *arguments: Real, **options: Any
    ) -> Number:
        function = getattr(self.xp, STANDARD_NAMES.get(ufunc.__name__, ufunc.__name__))
        return Number(self.xp, function(*(getattr(x, "array", x) for x in arguments)))


class ArrayEngine:
    """A program bound to arrays of a namespace, of double or single precision."""

    name = "arrays"

    def __init__(self, program: Program, xp: ModuleType, dtype: Any) -> None:
        self.program, self.xp, self.dtype = program, xp, dtype
        self.meaning = meaning = self.primitives()
        planar, rest = meaning["planar"], max(REST_SHARE, meaning["EPS"] ** 0.75)
        constants = {"ZERO": planar(0.0, 0.0), "ONE": planar(1.0, 0.0), "REST": rest}
        self._program = bind(program, meaning, constants, self.foreign)
        if not has_arithmetic(zero := self.array(0.0)):
            primitives_of.register(type(zero), lambda _: meaning)

    def primitives(self) -> Record:
        """The primitives of the plane on these arrays."""
        return primitives(self.xp, self.dtype)

    def foreign(self, function: Callable[..., Nested]) -> Callable[..., Nested]:
        """What stands for a function that is no kernel: the guess of a group's pose."""

        def answer(*x: Nested) -> Nested:
            return each_part(self.array, function(*each_part(np.asarray, x)))

        return answer

    def array(self, x: Real) -> Real:
        """An array of the engine's precision."""
        return self.xp.asarray(x, dtype=self.dtype)

    def run(self, inputs: Record, parameters: Values) -> Values:
        """Values of samples, arrays or `Planar` pairs; ``parameters`` are `Program.values`."""
        columns = (self.xp.asarray(inputs[name]) for name in self.program.inputs)
        with np.errstate(all="ignore"):
            return self._program(*columns, self._slots(parameters))

    def _slots(self, parameters: Values) -> Values:
        def column(x: Reals) -> Real:
            return self.xp.stack(self.xp.broadcast_arrays(*map(self.array, x))) if x else x

        return tuple(map(partial(cast, number=self.array, column=column), parameters))

    def read(self, output: Output, columns: Values, shape: tuple[int, ...]) -> Real:
        """An output (...) of its values: real, or complex x + iy; NaN where it is not finite."""
        xp = self.xp
        columns = each_part(lambda x: xp.broadcast_to(self.array(x), shape), columns)
        if output.kind == "matrix":
            return xp.stack(columns, axis=-1)
        value = output.read(*each_part(lambda x: Number(xp, x), columns))
        parts: list[Real] = [getattr(x, "array", x) for x in leaves(value)]
        good = xp.all(xp.stack(list(map(xp.isfinite, parts))), axis=0)
        parts = [xp.where(good, x, self.array(math.nan)) for x in parts]
        return parts[0] if len(parts) == 1 else parts[0] + 1j * parts[1]
