"""The engine of derivatives: dual numbers in place of numbers, forward mode.

The kernels are the same, so every derivative is exact to rounding. Loops run on the values;
then one step of Newton's method on dual numbers differentiates the equations that they
solved, not the way to the solution (`blockmech.ground.plane.implicit`).

At a kink a tangent is the derivative in the direction of its seed: the opposite seed gives
the other side's. Seeds are changes of numbers by their own size, so that the tangents of a value
tell its rounding: nearer to a kink than that, a value is at it.

Source: Griewank & Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, ch. 3 (forward mode), 14
(directional derivatives at kinks) and 15 (implicit functions).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from blockmech.engines import numpy as plain
from blockmech.engines.binding import bind
from blockmech.engines.numpy import CHUNK, Planar, each_part
from blockmech.ground.errors import RequestError, refused
from blockmech.ground.plane import EPS, REST_SHARE, cross, dot, primitives_of, times
from blockmech.plan.plan import Program
from blockmech.typing import Array, Kernel, Nested, Real, Reals, Record, Values


class Dual(NDArrayOperatorsMixin):
    """Values (...) and their derivatives d (m, ...) in m directions, each of all samples.

    Sums, products, powers of arithmetic and NumPy's functions in `TANGENTS` carry them;
    comparisons are of the values.
    """

    __slots__ = ("d", "x")

    def __init__(self, x: Real, d: Real) -> None:
        self.x = x
        self.d = d

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *arguments: Real, **options: Any
    ) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        x = [value(v) for v in arguments]
        if ufunc in COMPARISONS:
            return ufunc(*x)
        if ufunc not in TANGENTS:
            return NotImplemented
        y = ufunc(*x)
        return Dual(y, TANGENTS[ufunc](y, *x, *map(slope, arguments)))

    def __getitem__(self, index: Any) -> Dual:
        return Dual(self.x[index], self.d[:, index])

    @property
    def real(self) -> Dual:
        """Itself: no component of a vector."""
        return self

    @property
    def imag(self) -> float:
        """Nothing."""
        return 0.0


def value(x: Real) -> Real:
    """A number without its tangents."""
    return x.x if isinstance(x, Dual) else x


def slope(x: Real) -> Real:
    """The tangents of a number; zero of a constant."""
    return x.d if isinstance(x, Dual) else 0.0


def values(nested: Nested) -> Any:
    """Nested tuples of numbers and vectors without their tangents."""
    return each_part(value, nested)


def is_rounding(size: Real, tangents: Real) -> Real:
    """Whether a size (...) is below what rounding of the numbers makes of it.

    tangents : (m, ...) sizes of its changes
    """
    return size <= 4 * EPS * np.sum(tangents, axis=0)


def _tied(
    a: Real, b: Real, da: Real, db: Real, first: Real, pick: Callable[[Real, Real], Real]
) -> Real:
    """Tangents of the smaller or larger of two: at a tie, those of the one that goes ahead."""
    tie = is_rounding(np.abs(a - b), np.abs(da - db))
    return np.where(tie, pick(da, db), np.where(first, da, db))


def _power(y: Real, a: Real, n: Real, da: Real, dn: Real) -> Real:
    """Tangents of a power; of a plain exponent none, and of zero none by its exponent."""
    by_base = np.where(da == 0.0, 0.0, n * a ** (n - 1) * da)  # steep at zero, but it stays there
    if np.ndim(dn) == 0:
        return by_base
    return by_base + np.where(a > 0.0, y * np.log(np.where(a > 0.0, a, 1.0)), 0.0) * dn


def _length(y: Real, a: Real, b: Real, da: Real, db: Real) -> Real:
    """Tangents of the length y of a vector; of none, the length of what it becomes."""
    grows = np.hypot(da, db)
    return np.where(is_rounding(y, grows), grows, (a * da + b * db) / y)


TANGENTS: dict[np.ufunc, Callable[..., Real]] = {
    np.positive: lambda y, a, da: da,
    np.negative: lambda y, a, da: -da,
    np.add: lambda y, a, b, da, db: da + db,
    np.subtract: lambda y, a, b, da, db: da - db,
    np.multiply: lambda y, a, b, da, db: da * b + a * db,
    np.divide: lambda y, a, b, da, db: (da - y * db) / b,
    np.power: lambda y, a, n, da, dn: _power(y, a, n, da, dn),
    np.rint: lambda y, a, da: 0.0 * da,  # does not change but for jumps
    np.sqrt: lambda y, a, da: 0.5 * da / y,
    np.absolute: lambda y, a, da: np.where(is_rounding(y, np.abs(da)), np.abs(da), np.sign(a) * da),
    np.sin: lambda y, a, da: np.cos(a) * da,
    np.cos: lambda y, a, da: -np.sin(a) * da,
    np.hypot: _length,
    np.arctan2: lambda y, a, b, da, db: (b * da - a * db) / (a * a + b * b),
    np.minimum: lambda y, a, b, da, db: _tied(a, b, da, db, np.less(a, b), np.minimum),
    np.maximum: lambda y, a, b, da, db: _tied(a, b, da, db, np.greater(a, b), np.maximum),
}
"""Function of NumPy -> tangents of its result, from the result, arguments and their tangents."""

COMPARISONS = {np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal}


def hyp(z: Planar) -> Real:
    """Length of a vector; of none, the length of what it becomes."""
    if not isinstance(z.real, Dual) and not isinstance(z.imag, Dual):
        return plain.hyp(z)
    y = plain.hyp(values(z))
    return Dual(y, TANGENTS[np.hypot](y, *map(value, parts(z)), *map(slope, parts(z))))


def parts(z: Planar) -> tuple[Real, Real]:
    """Components of a vector."""
    return z.real, z.imag


def expi(t: Real) -> Planar:
    """Unit vector at an angle."""
    return Planar(np.cos(t), np.sin(t))


def exp(x: Real) -> Real:
    """Exponential, its own derivative."""
    y = np.exp(value(x))
    return Dual(y, y * slope(x)) if isinstance(x, Dual) else y


def power(x: Real, y: Real) -> Real:
    """A number that is not negative to a power."""
    return np.power(where(value(x) >= 0.0, x, np.nan), y)


def where(condition: Real, a: Real, b: Real) -> Real:
    """One or the other, sample by sample."""
    y = np.where(condition, value(a), value(b))
    if isinstance(a, Dual) or isinstance(b, Dual):
        return Dual(y, np.where(condition, slope(a), slope(b)))
    return y


def sign(x: Real) -> Real:
    """-1, 0 or +1, which does not change but for jumps."""
    return np.sign(value(x))


def modulo(x: Real, period: Real) -> Real:
    """x less whole periods, whose number does not change but for jumps."""
    rest = plain.modulo(value(x), value(period))
    if not isinstance(x, Dual) and not isinstance(period, Dual):
        return rest
    return Dual(rest, slope(x) - np.round((value(x) - rest) / value(period)) * slope(period))


def stacked(numbers: Reals) -> Real:
    """Numbers as one array (k,), tangents (m, k)."""
    x = np.array([value(v) for v in numbers])
    if not any(isinstance(v, Dual) for v in numbers):
        return x
    columns = [np.atleast_1d(slope(v)) for v in numbers]
    m = max(map(len, columns))
    return Dual(x, np.stack([np.broadcast_to(c.ravel(), (m,)) for c in columns], axis=-1))


def piecewise(x: Real, knots: Reals, rows: Sequence[Reals]) -> Real:
    """A piecewise polynomial; at a knot, of the piece that x goes to."""
    at, last = np.asarray(values(knots)), len(knots) - 2
    inside = (at[0] <= value(x)) & (value(x) <= at[-1])
    k = np.clip(np.searchsorted(at, value(x), side="right") - 1, 0, last)
    starts, table = stacked(knots), [stacked(row) for row in rows]

    def piece(k: Real, s: Real) -> Real:
        total = table[0][k]
        for row in table[1:]:
            total = total * s + row[k]
        return total

    offset = x - starts[k]
    result = where(inside, piece(k, offset), np.nan)
    corner = inside & np.equal(value(x), at[k])
    if not (isinstance(offset, Dual) and np.any(corner)):
        return result
    before = np.where(k > 0, k - 1, last)  # of a table that repeats, the last piece
    previous = piece(before, Dual(at[before + 1] - at[before], offset.d))
    return Dual(result.x, np.where(corner & (offset.d < 0.0), slope(previous), result.d))


def repeat(step: Kernel, state: Values, cap: int, *data: Nested) -> Values:
    """The last state by value: what it solves is differentiated by `implicit`."""
    return plain.repeat(step, values(state), cap, *values(data))


def implicit(step: Kernel, state: Values, *data: Nested) -> Nested:
    """The state with its tangents: one step from its values."""
    return step(values(state), *data)


def each(function: Callable[..., float], *x: Real) -> Array:
    """Refused where an argument has tangents: nobody knows the derivative of a function."""
    if any(np.any(slope(v)) for v in x):
        raise underivable(function)
    return plain.each(function, *map(value, x))


def underivable(function: Callable[..., object]) -> RequestError:
    """The error of a derivative by what a user's function is a function of."""
    law = getattr(function, "__self__", function)
    name = getattr(getattr(law, "call", law), "__name__", "function")
    message = "a load's function of Python has no known derivative"
    return _no_derivative(name, message, "give the law as data: polynomial, table, fourier or dc")


def each_by_difference(function: Callable[..., float], *x: Real) -> Dual | Array:
    """A user's function with its tangents by fourth-order differences, good to some 1e-12."""
    numbers = [np.asarray(value(v), float) for v in x]
    y = plain.each(function, *numbers)
    if not any(isinstance(v, Dual) for v in x):
        return y
    total: Real = 0.0
    for i, v in enumerate(x):
        if not np.any(slope(v)):
            continue
        step = EPS ** (1 / 5) * np.maximum(1.0, np.abs(numbers[i]))

        def moved(k: float, i: int = i, step: Array = step) -> Array:
            return plain.each(function, *numbers[:i], numbers[i] + k * step, *numbers[i + 1 :])

        rise = moved(-2.0) - moved(2.0) + 8.0 * (moved(1.0) - moved(-1.0))
        total = total + rise / (12.0 * step) * slope(v)
    return Dual(y, total)


def planar(x: Real, y: Real) -> Planar:
    """A planar vector from its components."""
    return Planar(x, y)


def matrix(rows: Sequence[Reals]) -> Dual | Array:
    """Square matrices (..., N, N), tangents (m, ..., N, N)."""
    x = plain.stacked_matrix([[value(v) for v in row] for row in rows], np.float64)
    slopes = [slope(v) for row in rows for v in row if isinstance(v, Dual)]
    if not slopes:
        return x
    d = np.zeros((*np.broadcast_shapes(*(np.shape(v) for v in slopes)), *x.shape[-2:]))
    for i, row in enumerate(rows):
        for j, v in enumerate(row):
            d[..., i, j] = slope(v)
    return Dual(x, d)


def solve(a: Dual | Array, right: Reals) -> tuple[Dual | Array, ...]:
    """Solution of a x = right: a dx = d right - da x."""
    x = plain.solve(value(a), [value(v) for v in right])
    if not isinstance(a, Dual) and not any(isinstance(v, Dual) for v in right):
        return x
    change = np.stack(x, axis=-1)[..., None]
    moved = (
        np.moveaxis((slope(a) @ change)[..., 0], -1, 0) if isinstance(a, Dual) else [0.0] * len(x)
    )
    rest = [slope(v) - x for v, x in zip(right, moved, strict=True)]
    return tuple(map(Dual, x, plain.solve(value(a), rest)))


def solve_transposed(a: Dual | Array, right: Reals) -> tuple[Dual | Array, ...]:
    """Solution of a^T x = right."""
    turned = np.swapaxes(value(a), -1, -2)
    if isinstance(a, Dual):
        turned = Dual(turned, np.swapaxes(a.d, -1, -2))
    return solve(turned, right)


def spread(a: Dual | Array) -> Dual | Array:
    """Ratio of the smallest to the largest singular value, each with tangent u . da v."""
    y = plain.spread(value(a))
    if not isinstance(a, Dual):
        return y
    good = np.isfinite(value(a)).all(axis=(-2, -1))
    u, s, v = np.linalg.svd(np.where(good[..., None, None], a.x, np.eye(a.x.shape[-1])))
    change = np.einsum("...ik,m...ij,...kj->m...k", u, a.d, v)
    return Dual(y, (change[..., -1] - y * change[..., 0]) / s[..., 0])


_OWN = (hyp, expi, exp, power, where, sign, modulo, piecewise, repeat, implicit, each, planar)
_PLAIN = (cross, dot, times, plain.mul, plain.imul, plain.angle, np.sqrt, np.minimum, np.maximum)
_SYSTEMS = (matrix, solve, solve_transposed, spread)
PRIMITIVES = {f.__name__: f for f in (*_OWN, *_PLAIN, *_SYSTEMS)} | {"EPS": EPS}
"""The primitives of the plane on dual numbers."""
WITH_DIFFERENCES = PRIMITIVES | {"each": each_by_difference}
"""The same, where users' functions of one number have tangents as well."""
CONSTANTS = {
    "ZERO": Planar(np.float64(0.0), np.float64(0.0)),
    "ONE": Planar(np.float64(1.0), np.float64(0.0)),
    "REST": REST_SHARE,
}


def one_by_one(function: Callable[..., tuple[float, ...]], *x: Real) -> tuple[Dual, ...]:
    """A function of numbers that is linear where they change; refused where it is not."""
    at, d = np.array([value(v) for v in x]), [np.ravel(slope(v)) for v in x]
    y = np.array(function(*at))
    columns = np.stack([np.broadcast_to(c, (max(map(len, d)),)) for c in d], axis=-1)
    tangents = [_linear(function, at, y, column) for column in columns]
    return tuple(map(Dual, y, np.array(tangents).T[..., None]))


def _linear(
    function: Callable[..., tuple[float, ...]], at: Array, y: Array, direction: Array
) -> Array:
    """Change of a function y along a straight direction, if it is the same ahead and behind."""
    if not direction.any():
        return np.zeros_like(y)
    size = np.abs(at).max() / np.abs(direction).max()
    try:
        forward, backward = (
            np.array(function(*(at + side * size * direction))) for side in (1.0, -1.0)
        )
    except ValueError:  # no knots in order
        forward = backward = np.full_like(y, np.nan)
    bend = np.abs(forward + backward - 2.0 * y).max()
    rounding = 1e3 * EPS * np.abs([forward, backward]).max()  # of a spline's system, condition < 10
    if not bend <= rounding:
        raise underivable_table()
    change: Array = (forward - backward) / (2.0 * size)
    return change


def underivable_table() -> RequestError:
    """The error of a derivative by what a cubic table is a function of."""
    message = "the arguments of a cubic table have no known derivative"
    return _no_derivative("table", message, "name its values")


def _no_derivative(where: str, message: str, remedy: str) -> RequestError:
    return refused(where, message, remedy, code="no-derivative")


@primitives_of.register(Dual)
def _of_derivatives(x: object) -> Record:
    return PRIMITIVES | {"one_by_one": one_by_one}


# -- the engine ----------------------------------------------------------------------------


class DualEngine:
    """A program bound to dual numbers, in double precision."""

    name = "dual"

    def __init__(self, program: Program, primitives: Record = PRIMITIVES) -> None:
        self.program = program
        # what is no kernel, such as a general group's path from home, is asked by value
        self._program = bind(program, primitives, CONSTANTS, lambda f: lambda *x: f(*values(x)))

    def run(self, inputs: Record, parameters: Values, n: int, m: int) -> Values:
        """Values of n samples with tangents (m, n): `Dual`, or `Planar` pairs of them.

        ``inputs`` are arrays or `Dual` (n,), ``parameters`` numbers or `Dual` with tangents
        (m, 1), in the order of the program's.
        """
        chunk = max(CHUNK // (m + 1), 1)
        numbers = each_part(lambda x: x if isinstance(x, Dual) else np.float64(x), parameters)
        arrays = [
            x if isinstance(x, Dual) else np.asarray(x)
            for x in map(inputs.get, self.program.inputs)
        ]
        chunks = []
        with np.errstate(all="ignore"):
            for k in range(0, max(n, 1), chunk):
                part = slice(k, min(k + chunk, n))
                columns = (column[part] for column in arrays)
                values = self._program(*columns, numbers)
                size = part.stop - part.start
                chunks.append(each_part(lambda x, size=size: _of_samples(x, m, size), values))
        return tuple(each_part(_joined, *columns) for columns in zip(*chunks, strict=True))


def _of_samples(x: Real, m: int, n: int) -> Dual:
    """A value as a dual number of n samples."""
    return Dual(np.broadcast_to(value(x), (n,)), np.broadcast_to(slope(x), (m, n)))


def _joined(*chunks: Dual) -> Dual:
    return Dual(np.concatenate([c.x for c in chunks]), np.concatenate([c.d for c in chunks], -1))
