"""Dual numbers: values and their tangents, for derivatives in forward mode.

At a kink a tangent is the derivative in the direction of its seed: the opposite seed gives
the other side's. Seeds are changes of numbers by their own size, so that the tangents of a value
tell its rounding: nearer to a kink than that, a value is at it.

Source: Griewank & Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, ch. 3 (forward mode)
and 14 (directional derivatives at kinks).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from blockmech.engines.numpy import each_part
from blockmech.ground.plane import EPS
from blockmech.typing import Nested, Real


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
