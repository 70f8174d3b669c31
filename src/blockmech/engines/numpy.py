"""The NumPy engine: batches in chunks, planar vectors as two real arrays.

A batch of vectors is a `Planar`: one array of x and one of y. Real arithmetic is
rounded the same way at every place of an array, so a sample's answer is the same
to the last bit alone, in any batch and in any chunk (NumPy's complex product is
not: its vector loop fuses multiply and add, its remainder loop does not). It is
also faster than complex arrays, because nothing is strided.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.engines import linear
from blockmech.engines.binding import bind
from blockmech.plan import Program
from blockmech.plane import REST_SHARE

PRECISIONS: dict[str, Any] = {
    "complex64": np.float32,
    "complex128": np.float64,
    "clongdouble": np.longdouble,
}
ROUNDING_AT_REST = 100.0  # ulps of the largest speed that a rate of zero may come out as
HEAP = 31 * 2**20  # [bytes] just below the largest threshold of glibc, see mallopt(3)
CHUNK = 8192  # samples that stay in cache together


class Planar:
    """A batch of planar vectors: arrays (or numbers) of x and y."""

    __slots__ = ("imag", "real")

    def __init__(self, real: Any, imag: Any) -> None:
        self.real = real
        self.imag = imag

    def __add__(self, other: Planar) -> Planar:
        return Planar(self.real + other.real, self.imag + other.imag)

    def __sub__(self, other: Planar) -> Planar:
        return Planar(self.real - other.real, self.imag - other.imag)

    def __mul__(self, other: Planar) -> Planar:
        return Planar(
            self.real * other.real - self.imag * other.imag,
            self.real * other.imag + self.imag * other.real,
        )

    def __neg__(self) -> Planar:
        return Planar(-self.real, -self.imag)


def cross(a: Planar, b: Planar) -> Any:
    """Component of ``a x b`` out of the plane."""
    return a.real * b.imag - a.imag * b.real


def dot(a: Planar, b: Planar) -> Any:
    """Scalar product."""
    return a.real * b.real + a.imag * b.imag


def mul(z: Planar, x: Any) -> Planar:
    """Vector times real."""
    return Planar(z.real * x, z.imag * x)


def imul(z: Planar, x: Any) -> Planar:
    """Vector turned by +90 degrees, times real."""
    return Planar(-z.imag * x, z.real * x)


def hyp(z: Planar) -> Any:
    """Length of a vector."""
    return np.sqrt(z.real * z.real + z.imag * z.imag)


def angle(a: Planar, b: Planar) -> Any:
    """Angle from a to b, in (-pi, pi]."""
    return np.arctan2(cross(a, b) + 0.0, dot(a, b))


def modulo(x: Any, period: Any) -> Any:
    """x less whole periods."""
    rest = np.fmod(x, period)
    return np.where(rest < 0.0, rest + period, rest)


def piecewise(x: Any, knots: Any, rows: Any) -> Any:
    """A piecewise polynomial; see `blockmech.plane.piecewise`."""
    inside = (knots[0] <= x) & (x <= knots[-1])
    k = np.minimum(np.searchsorted(knots, x, side="right"), len(knots) - 1) - 1
    k = np.where(inside, k, 0)
    s, total = x - knots[k], rows[0][k]
    for row in rows[1:]:
        total = total * s + row[k]
    return np.where(inside, total, np.nan)


def some(condition: Any) -> bool:
    """Whether the condition holds for any sample."""
    return bool(np.any(condition))


def repair(condition: Any, one: Any, given: Any, *data: Any) -> Any:
    """Run ``one`` on each sample where the condition holds; see `blockmech.plane.repair`."""
    mask = np.atleast_1d(condition)
    if not mask.any():
        return given
    whole = _whole(given, np.broadcast_shapes(mask.shape, *_shapes((given, data))))
    for index in zip(*np.nonzero(np.broadcast_to(mask, whole[0][0].shape)), strict=True):
        answer = one(_sample(whole, index), *(_sample(d, index) for d in data))
        _store(whole, index, answer)
    return whole


def each(function: Any, *x: Any) -> Any:
    """Ask a function sample by sample; see `blockmech.plane.each`."""
    columns = np.broadcast_arrays(*x)
    rows = zip(*(map(float, column.ravel()) for column in columns), strict=True)
    found = [function(*row) for row in rows]
    return np.array(found, columns[0].dtype).reshape(columns[0].shape)


def _shapes(value: Any) -> list[tuple[int, ...]]:
    if isinstance(value, tuple):
        return [shape for x in value for shape in _shapes(x)]
    if isinstance(value, Planar):
        return [np.shape(value.real), np.shape(value.imag)]
    return [np.shape(value)]


def _whole(value: Any, shape: tuple[int, ...]) -> Any:
    """A writable copy of a nested tuple of real batches, broadcast to one shape."""
    if isinstance(value, tuple):
        parts = [_whole(x, shape) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return np.array(np.broadcast_to(value, shape))


def _sample(value: Any, index: tuple[int, ...]) -> Any:
    if isinstance(value, tuple):
        parts = [_sample(x, index) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if isinstance(value, Planar):
        return complex(_sample(value.real, index), _sample(value.imag, index))
    if isinstance(value, bool):
        return value
    if np.ndim(value) == 0:
        return float(value)
    trimmed = tuple(
        i if d > 1 else 0 for i, d in zip(index[-np.ndim(value) :], value.shape, strict=True)
    )
    return float(value[trimmed])


def _store(whole: Any, index: tuple[int, ...], answer: Any) -> None:
    if isinstance(whole, tuple):
        for x, y in zip(whole, answer, strict=True):
            _store(x, index, y)
    else:
        whole[index] = answer


@cache
def primitives(dtype: Any) -> dict[str, Any]:
    """The primitives of the plane on arrays of one precision; see `blockmech.plane`."""

    def expi(t: Any) -> Planar:
        # Sine and cosine are taken in (at least) double before the cast.
        wide = np.asarray(t, dtype=np.promote_types(np.float64, dtype))
        return Planar(
            np.cos(wide).astype(dtype, copy=False), np.sin(wide).astype(dtype, copy=False)
        )

    def planar(x: Any, y: Any) -> Planar:
        return Planar(np.asarray(x, dtype), np.asarray(y, dtype))

    def matrix(rows: Any) -> NDArray[Any]:
        return linear.matrix(rows, dtype)

    return {
        "cross": cross,
        "dot": dot,
        "mul": mul,
        "imul": imul,
        "hyp": hyp,
        "expi": expi,
        "sqrt": np.sqrt,
        "sign": np.sign,
        "where": np.where,
        "minimum": np.minimum,
        "maximum": np.maximum,
        "angle": angle,
        "modulo": modulo,
        "piecewise": piecewise,
        "some": some,
        "EPS": float(np.finfo(dtype).eps),
        "repair": repair,
        "each": each,
        "planar": planar,
        "matrix": matrix,
        "solve": linear.solve,
        "solve_transposed": linear.solve_transposed,
        "spread": linear.spread,
    }


@cache
def keep_freed_memory() -> None:
    """Have the C library use freed memory again: new pages cost half as much as computing.

    glibc gives back what is larger than the largest block that was freed so far, up to 32 MB.
    This one is never written to; other libraries take no notice.
    """
    np.empty(HEAP, np.uint8)


class NumpyEngine:
    """A program bound to arrays of one precision."""

    name = "numpy"

    def __init__(self, program: Program, precision: str = "complex128") -> None:
        keep_freed_memory()
        self.program = program
        self.precision = precision
        self.dtype = PRECISIONS[precision]
        self.constants = {
            "ZERO": self._cast(0j),
            "ONE": self._cast(1 + 0j),
            "REST": max(REST_SHARE, ROUNDING_AT_REST * float(np.finfo(self.dtype).eps)),
        }
        self._program = bind(program, primitives(self.dtype), self.constants)
        self.parameters = tuple(self._cast(v) for v in program.parameters.values())

    def _cast(self, value: Any) -> Any:
        if isinstance(value, tuple):
            if hasattr(value, "_fields"):
                return type(value)(*(self._cast(x) for x in value))
            plain = all(isinstance(x, float) for x in value)
            return np.array(value, self.dtype) if plain else tuple(map(self._cast, value))
        if isinstance(value, complex):
            return Planar(self.dtype(value.real), self.dtype(value.imag))
        return self.dtype(value)

    def run(
        self, inputs: Mapping[str, NDArray[Any]], n: int, chunk: int = CHUNK
    ) -> tuple[Any, ...]:
        """Values of n samples: real arrays (n,) or `Planar` pairs of them."""
        columns = [self._rounded(name, inputs[name]) for name in self.program.inputs]
        with np.errstate(all="ignore"):
            if n <= chunk:
                return tuple(_full(v, n) for v in self._program(*columns, self.parameters))
            filled: tuple[Any, ...] = ()
            for start in range(0, n, chunk):
                part = slice(start, min(start + chunk, n))
                values = self._program(*(c[part] for c in columns), self.parameters)
                if not filled:
                    filled = _rooms(values, n)
                for room, value in zip(filled, values, strict=True):
                    _fill(room, part, value)
            return filled

    def _rounded(self, name: str, column: Any) -> NDArray[Any]:
        given: NDArray[Any] = np.asarray(column)  # one pose comes as a list
        # Angles stay in double until sine and cosine are taken.
        return given if name in self.program.angles else given.astype(self.dtype, copy=False)


def _rooms(values: tuple[Any, ...], n: int) -> tuple[Any, ...]:
    """Room for n samples of each value; all columns lie in one block."""
    parts = [x for v in values for x in ((v.real, v.imag) if isinstance(v, Planar) else (v,))]
    kinds = [x.dtype for x in parts if np.ndim(x)]
    free = {kind: iter(np.empty((kinds.count(kind), n), kind)) for kind in set(kinds)}

    def column(x: Any) -> Any:
        return next(free[x.dtype]) if np.ndim(x) else np.broadcast_to(x, (n,))

    return tuple(
        Planar(column(v.real), column(v.imag)) if isinstance(v, Planar) else column(v)
        for v in values
    )


def _fill(room: Any, part: slice, value: Any) -> None:
    if isinstance(room, Planar):
        _fill(room.real, part, value.real)
        _fill(room.imag, part, value.imag)
    elif room.flags.writeable:
        room[part] = value


def _full(value: Any, n: int) -> Any:
    if isinstance(value, Planar):
        return Planar(_full(value.real, n), _full(value.imag, n))
    # A matrix a sample is whole already.
    return value if np.shape(value)[:1] == (n,) else np.broadcast_to(value, (n,))
