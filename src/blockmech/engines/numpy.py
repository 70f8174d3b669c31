"""Arrays of NumPy: the primitives of the plane on batches, planar vectors as two real arrays.

A batch of vectors is a `Planar`: one array of x and one of y. Real arithmetic is
rounded the same way at every place of an array, so a sample's answer is the same
to the last bit alone, in any batch and in any chunk (NumPy's complex product is
not: its vector loop fuses multiply and add, its remainder loop does not). It is
also faster than complex arrays, because nothing is strided.

Linear systems are one matrix a sample, each solved by itself: LAPACK factors every matrix of a
stack alone, so a sample's answer does not depend on its batch. In extended precision, which LAPACK
does not know, elimination is written out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.ground.plane import (
    cross,
    dot,
    has_arithmetic,
    implicit,
    primitives_of,
    times,
)
from blockmech.typing import Array, Complex, Data, Kernel, Nested, Real, Reals, Record, Values

PRECISIONS: Data = {
    "complex64": np.float32,
    "complex128": np.float64,
    "clongdouble": np.longdouble,
}
CHUNK = 8192  # samples that stay in cache together


class Planar:
    """A batch of planar vectors: arrays (or numbers) of x and y."""

    __slots__ = ("imag", "real")

    def __init__(self, real: Real, imag: Real) -> None:
        self.real = real
        self.imag = imag

    def __add__(self, z: Planar) -> Planar:
        return Planar(self.real + z.real, self.imag + z.imag)

    def __sub__(self, z: Planar) -> Planar:
        return Planar(self.real - z.real, self.imag - z.imag)

    def __mul__(self, z: Planar) -> Planar:
        return Planar(
            self.real * z.real - self.imag * z.imag, self.real * z.imag + self.imag * z.real
        )

    def __neg__(self) -> Planar:
        return Planar(-self.real, -self.imag)

    def __radd__(self, z: complex) -> Planar:
        return Planar(z.real + self.real, z.imag + self.imag)

    def __rsub__(self, z: complex) -> Planar:
        return Planar(z.real - self.real, z.imag - self.imag)

    def __abs__(self) -> Real:
        hypot = primitives_of(self).get("hypot", np.hypot)  # as Python has it of a complex number
        return hypot(self.real, self.imag)


class Whole(Values):
    """Values that are finite numbers throughout, as the engine saw when it made them."""

    __slots__ = ()


def batch_of(value: Real) -> Real | Planar:
    """An array (n,), or vectors, of what an engine answers: for one sample a number."""
    if isinstance(value, Planar | np.ndarray):
        return value
    numbers = value if isinstance(value, list) else [value]
    if any(isinstance(x, complex) for x in numbers):
        z = np.array([complex(x) for x in numbers])
        return Planar(z.real, z.imag)
    return np.array([float(x) for x in numbers])


def complex_array(z: Complex) -> Array:
    """Complex array of a batch of vectors; infinite becomes NaN."""
    x, y = np.asarray(z.real), np.asarray(z.imag)
    vectors = np.empty(np.broadcast_shapes(x.shape, y.shape), np.result_type(x.dtype, np.complex64))
    vectors.real, vectors.imag = x, y
    good = np.isfinite(vectors)
    if not good.all():
        vectors[~good] = complex("nan+nanj")
    return vectors


def real_part(batch: Real | Planar) -> Real:
    """Numbers of a batch that one engine holds as vectors."""
    return batch.real if isinstance(batch, Planar) else batch


def samples_of(batch: Real | Planar, index: NDArray[np.intp]) -> Real | Planar:
    """The samples of these indices."""
    if isinstance(batch, Planar):
        return Planar(batch.real[index], batch.imag[index])
    return batch[index]


def mul(z: Planar, x: Real) -> Planar:
    """Vector times real."""
    return Planar(z.real * x, z.imag * x)


def imul(z: Planar, x: Real) -> Planar:
    """Vector turned by +90 degrees, times real."""
    return Planar(-z.imag * x, z.real * x)


def hyp(z: Planar) -> Real:
    """Length of a vector."""
    return np.sqrt(z.real * z.real + z.imag * z.imag)


def power(x: Real, y: Real) -> Real:
    """A number that is not negative to a power."""
    return np.power(np.where(x >= 0.0, x, np.nan), y)


def angle(a: Planar, b: Planar) -> Real:
    """Angle from a to b, in (-pi, pi]."""
    return np.arctan2(cross(a, b) + 0.0, dot(a, b))


def modulo(x: Real, period: Real) -> Real:
    """x less whole periods."""
    rest = np.fmod(x, period)
    return np.where(rest < 0.0, rest + period, rest)


def piecewise(x: Real, knots: Reals, rows: Sequence[Reals]) -> Real:
    """A piecewise polynomial; see `blockmech.ground.plane.piecewise`.

    Tables of m designs have columns (k, m, 1), and are read one by one.
    """
    if any(np.ndim(column) > 1 for column in (knots, *rows)):
        columns = [np.reshape(column, (len(column), -1)).T for column in (knots, *rows)]
        m = max(map(len, columns))
        tables = zip(*(np.broadcast_to(c, (m, c.shape[1])) for c in columns), strict=True)
        arguments = np.broadcast_to(x, (m, np.shape(x)[-1]))
        return np.stack([piecewise(q, k, r) for q, (k, *r) in zip(arguments, tables, strict=True)])
    inside = (knots[0] <= x) & (x <= knots[-1])
    k = np.minimum(np.searchsorted(knots, x, side="right"), len(knots) - 1) - 1
    k = np.where(inside, k, 0)
    s, total = x - np.take(knots, k), np.take(rows[0], k)
    for row in rows[1:]:
        total = total * s + np.take(row, k)
    return np.where(inside, total, np.nan)


def repeat(step: Kernel, state: Values, cap: int, *data: Nested) -> Nested:
    """Step samples until each has stopped by itself; see `blockmech.ground.plane.repeat`.

    Those that go on do so apart from the others once they are few.
    """
    for k in range(cap):
        going = state[-1]
        active = np.count_nonzero(going)
        if not active:
            break
        if 4 * active <= np.size(going):  # gathering them costs some half a step of all
            return _apart(step, state, cap - k, data)
        following = step(state, *data)
        if active < np.size(going):
            following = each_part(lambda new, old, w=going: np.where(w, new, old), following, state)
        state = following
    return state


def _apart(step: Kernel, state: Values, cap: int, data: Values) -> Nested:
    """The state after the steps of the samples that go on."""
    shape = np.broadcast_shapes(*map(np.shape, leaves((state, data))))
    rows = np.nonzero(np.broadcast_to(state[-1], shape))

    def some(x: Real) -> Real:
        return x if np.ndim(x) == 0 else np.broadcast_to(x, shape)[rows]

    def merge(new: Real, old: Real) -> Array:
        merged = np.array(np.broadcast_to(old, shape), np.result_type(new, old))
        merged[rows] = new
        return merged

    final = repeat(step, each_part(some, state), cap, *each_part(some, data))
    return each_part(merge, final, state)


def each(function: Callable[..., float], *x: Real) -> Array:
    """Ask a function sample by sample; see `blockmech.ground.plane.each`."""
    columns = np.broadcast_arrays(*x)
    rows = zip(*(map(float, column.ravel()) for column in columns), strict=True)
    values = [function(*row) for row in rows]
    return np.array(values, columns[0].dtype).reshape(columns[0].shape)


def each_part(function: Callable[..., Nested], *values: Any, vector: type = Planar) -> Any:
    """A nested tuple of batches with a function of each real batch in it; a ``vector`` of two.

    Of several nested tuples, a function of the batches that stand at the same place.
    """
    first = values[0]
    if isinstance(first, tuple):
        parts = [each_part(function, *x, vector=vector) for x in zip(*values, strict=True)]
        return type(first)(*parts) if hasattr(first, "_fields") else tuple(parts)
    if isinstance(first, complex | Planar):
        return vector(function(*(z.real for z in values)), function(*(z.imag for z in values)))
    return first if isinstance(first, bool) else function(*values)


def leaves(value: Nested) -> list[Real]:
    """The real batches in a nested tuple of batches, those of a vector one after the other."""
    if isinstance(value, tuple):
        return [leaf for x in value for leaf in leaves(x)]
    return [value.real, value.imag] if isinstance(value, complex | Planar) else [value]


def cast(value: Nested, number: Callable[[Real], Real], column: Callable[[Reals], Real]) -> Nested:
    """A parameter in an engine's numbers; the columns of a table are arrays."""
    if isinstance(value, tuple):
        parts = (cast(x, number, column) for x in value)
        if hasattr(value, "_fields"):
            return type(value)(*parts)
        nested = any(isinstance(x, tuple | complex | Planar) for x in value)
        return tuple(parts) if nested else column(value)
    if isinstance(value, complex | Planar):
        return Planar(number(value.real), number(value.imag))
    return number(value)


@cache
def primitives(dtype: Any) -> Data:
    """The primitives of the plane on arrays of one precision; see `blockmech.ground.plane`."""

    def expi(t: Real) -> Planar:
        # Sine and cosine are taken in (at least) double before the cast.
        wide = np.asarray(t, dtype=np.promote_types(np.float64, dtype))
        return Planar(
            np.cos(wide).astype(dtype, copy=False), np.sin(wide).astype(dtype, copy=False)
        )

    def planar(x: Real, y: Real) -> Planar:
        return Planar(np.asarray(x, dtype), np.asarray(y, dtype))

    def matrix(rows: Sequence[Reals]) -> Array:
        return stacked_matrix(rows, dtype)

    arrays = (mul, imul, hyp, power, angle, modulo, piecewise, repeat, each, expi, planar, matrix)
    ufuncs = (np.sqrt, np.exp, np.sign, np.where, np.minimum, np.maximum)
    systems = (solve, solve_transposed, spread)
    functions = {f.__name__: f for f in (cross, dot, implicit, times, *arrays, *ufuncs, *systems)}
    return functions | {"EPS": float(np.finfo(dtype).eps)}


def one_by_one(function: Callable[..., tuple[float, ...]], *x: Real) -> tuple[Array, ...]:
    """A function of numbers, design after design; see `blockmech.ground.plane`."""
    columns = np.broadcast_arrays(*x)
    rows = zip(*(column.ravel().tolist() for column in columns), strict=True)
    values = np.array([function(*row) for row in rows])
    return tuple(column.reshape(columns[0].shape) for column in values.T)


def _turned(t: Real) -> Planar:
    """Sine and cosine of the scalar engine: in a batch a design has the numbers it has alone."""
    return Planar(*one_by_one(lambda x: (math.cos(x), math.sin(x)), t))


@primitives_of.register(Planar)
def _of_vectors(x: Planar) -> Record:
    part = next(filter(has_arithmetic, (x.real, x.imag)), None)
    return _of_designs(x) if part is None else primitives_of(part)


@primitives_of.register(np.ndarray)
def _of_designs(x: object) -> Record:
    return primitives(np.float64) | {"expi": _turned, "one_by_one": one_by_one}


LAPACK = (np.float32, np.float64)


def stacked_matrix(rows: Sequence[Reals], dtype: Any) -> Array:
    """Rows of numbers or batches (...) as one array (..., N, N)."""
    filled = [
        (i, j, x)
        for i, row in enumerate(rows)
        for j, x in enumerate(row)
        if not isinstance(x, float) or x != 0.0
    ]
    shape = np.broadcast_shapes(*{np.shape(x) for _, _, x in filled})
    matrix_ = np.zeros((*shape, len(rows), len(rows)), dtype)
    for i, j, x in filled:
        matrix_[..., i, j] = x
    return matrix_


def solve(a: Array, right: Reals) -> tuple[Array, ...]:
    """Solutions of a x = right, N arrays (...); not finite where a matrix is singular."""
    shape = np.broadcast_shapes(a.shape[:-2], *(np.shape(x) for x in right))
    b = np.empty((*shape, len(right)), a.dtype)
    for i, x in enumerate(right):
        b[..., i] = x
    solution = np.ascontiguousarray(np.moveaxis(_solved(a, b), -1, 0))
    return tuple(solution)


def solve_transposed(a: Array, right: Reals) -> tuple[Array, ...]:
    """Solutions of a^T x = right."""
    return solve(np.swapaxes(a, -1, -2), right)


def _solved(a: Array, b: Array) -> Array:
    if a.dtype not in LAPACK:
        return _eliminated(np.broadcast_to(a, (*b.shape, b.shape[-1])), b)
    try:
        return np.asarray(np.linalg.solve(a, b[..., None])[..., 0])
    except np.linalg.LinAlgError:
        # The rare batch with a singular matrix in it.
        solutions = np.full(b.shape, np.nan, a.dtype)
        matrices = np.broadcast_to(a, (*b.shape, b.shape[-1]))
        for index in np.ndindex(b.shape[:-1]):
            try:
                solutions[index] = np.linalg.solve(matrices[index], b[index])
            except np.linalg.LinAlgError:
                continue
        return solutions


def _eliminated(a: Array, b: Array) -> Array:
    """Gaussian elimination with partial pivoting, samples side by side."""
    augmented = np.concatenate([a, b[..., None]], axis=-1)
    return np.moveaxis(_reduced(np.array(np.moveaxis(augmented, (-2, -1), (0, 1)))), 0, -1)


def _reduced(augmented: Array) -> Array:
    """Solutions (N, ...) of matrices with their right sides (N, N + 1, ...), which are lost."""
    n = len(augmented)
    for k in range(n):
        pivot = np.argmax(np.abs(augmented[k:, k]), axis=0) + k
        swapped = np.take_along_axis(augmented, pivot[None, None], axis=0)
        np.put_along_axis(augmented, pivot[None, None], augmented[k], axis=0)
        augmented[k] = swapped[0]
        factor = augmented[k + 1 :, k] / augmented[k, k]
        augmented[k + 1 :, k + 1 :] -= factor[:, None] * augmented[k, k + 1 :]
    for k in reversed(range(n)):
        augmented[k, n] /= augmented[k, k]
        augmented[:k, n] -= augmented[:k, k] * augmented[k, n]
    return augmented[:, n]


def spread(a: Array) -> Array:
    """Ratio of the smallest to the largest singular value; NaN of a matrix with a NaN in it."""
    plain = np.asarray(a, np.float64) if a.dtype not in LAPACK else a
    good = np.isfinite(plain).all(axis=(-2, -1))
    plain = np.where(good[..., None, None], plain, np.eye(plain.shape[-1], dtype=plain.dtype))
    values = np.linalg.svd(plain, compute_uv=False)
    ratio = np.where(good, values[..., -1] / values[..., 0], plain.dtype.type(np.nan))
    return np.asarray(ratio.astype(a.dtype))
