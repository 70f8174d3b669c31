"""Functions of one variable: polynomials, piecewise ones, their kinks and period; those of Python.

Coefficients of a piece are of powers of the distance from its knot.

A function of Python says by its parameters what it reads, which typed data cannot say. As a law one
depends on what its parameters are called, ``lambda rate: -0.3 * rate * abs(rate)``, and that alone
decides which methods apply. It is asked sample by sample and in double precision, and it is not
written to files.

Source: de Boor, A Practical Guide to Splines, 1978 (through SciPy's splines).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias, get_args

from blockmech.ground.errors import RequestError, close_match, refused, shown
from blockmech.ground.plane import apply, each
from blockmech.ground.validation_errors import mistake
from blockmech.typing import Argument, Real, Reals

Row: TypeAlias = tuple[float, ...]
Rows: TypeAlias = tuple[Row, ...]
"""One coefficient of each piece a row, highest power first."""


def horner(x: Real, coefficients: Sequence[Real]) -> Real:
    """A polynomial by its coefficients, highest power first."""
    total = coefficients[0] + 0.0 * x
    for c in coefficients[1:]:
        total = total * x + c
    return total


def straight(x: Sequence[float], y: Sequence[float]) -> Rows:
    """Rows of the straight lines through points."""
    rises = zip(pairwise(x), pairwise(y), strict=True)
    return tuple((d - c) / (b - a) for (a, b), (c, d) in rises), tuple(y[:-1])


def cubic(x: Sequence[float], y: Sequence[float], repeats: bool) -> Rows:
    """Rows of the cubic spline through points, not-a-knot or of one that repeats periodic."""

    def coefficients(*numbers: float) -> Row:
        from scipy.interpolate import CubicSpline

        ends = "periodic" if repeats else "not-a-knot"
        c = CubicSpline(numbers[: len(x)], numbers[len(x) :], bc_type=ends).c
        return tuple(map(float, c.ravel()))

    flat, n = apply("one_by_one", coefficients, *x, *y), len(x) - 1
    return tuple(flat[k : k + n] for k in range(0, len(flat), n))


def derivatives(pieces: Sequence[Reals]) -> tuple[Rows, Rows, Rows]:
    """Rows of pieces by their coefficients, from s^0 on, and of their first two derivatives."""
    n = max(3, *map(len, pieces))
    rows = []
    full = [[*c, *[0.0] * (n - len(c))] for c in pieces]
    for _ in range(3):
        rows.append(tuple(zip(*(reversed(c) for c in full), strict=True)))
        full = [[k * x for k, x in enumerate(c)][1:] for c in full]
    return rows[0], rows[1], rows[2]


class Knotted:
    """A function of one variable that is smooth between its knots; by default it has none."""

    @property
    def whole(self) -> float:
        """Period of the argument, 0 where nothing repeats."""
        return 0.0

    @property
    def covers_one_turn(self) -> bool:
        """Whether it repeats after a turn of its argument."""
        return False

    def knots(self) -> Sequence[float]:
        """Arguments at which it, or a derivative of it, jumps: rising, those of one period."""
        return ()

    def rows(self) -> Sequence[float]:
        """Knots; those of a periodic function with the end of the period."""
        knots = self.knots()
        return [*knots, float(knots[0] + self.whole)] if knots and self.whole else knots

    def within(self, low: float, high: float) -> Sequence[float]:
        """Knots from low to high, repeated for a periodic function."""
        knots = self.knots()
        if not knots or not self.whole:
            return [x for x in knots if low <= x <= high]
        first = math.floor((low - knots[-1]) / self.whole)
        last = math.ceil((high - knots[0]) / self.whole)
        repeated = (x + k * self.whole for k in range(first, last + 1) for x in knots)
        return [x for x in repeated if low <= x <= high]

    def next_kink(self, x: float) -> float:
        """The first knot after an argument; infinite for none."""
        last = x + 2 * self.whole if self.whole else math.inf
        return min((y for y in self.within(x, last) if y > x), default=math.inf)

    def kinks_of_angle(self) -> Sequence[float]:
        """Knots in [-pi, pi] of a function of an angle that jumps there."""
        return (*self.within(-math.pi, math.pi), *(() if self.covers_one_turn else (math.pi,)))


def parameters_of(call: Callable[..., float]) -> list[inspect.Parameter] | None:
    """The parameters of a function; None where nobody knows them, as of some builtins."""
    try:
        return list(inspect.signature(call).parameters.values())
    except (TypeError, ValueError):
        return None


def numbers_of(
    call: Callable[..., Any], names: Sequence[str], x: Sequence[float], count: int, remedy: str
) -> tuple[float, ...]:
    """The numbers that a function gives. Raises `RequestError` where they are not so many."""

    def refusal(message: str) -> RequestError:
        where = f"{getattr(call, '__name__', 'function')}({', '.join(names)})"
        at = ", ".join(f"{name} = {value:.9g}" for name, value in zip(names, x, strict=True))
        return refused(where, f"{message}, at {at}", remedy, code="user-function")

    try:
        answer = call(*x)
    except Exception as error:
        raise refusal(f"{type(error).__name__}: {error}") from error
    try:
        numbers = (float(answer),) if count == 1 else tuple(map(float, answer))
    except (TypeError, ValueError):
        raise refusal(f"it gave {shown(answer)}") from None
    if len(numbers) != count:
        raise refusal(f"it gave {len(numbers)} numbers, not {count}")
    return numbers


ARGUMENTS = get_args(Argument)
REMEDY = (
    f"give a number, or {math.nan} where there is no answer: "
    "a load is also asked where the motion may never come"
)
VALID = 'parameters named "coordinate", "rate" or "time"'


@dataclass(frozen=True)
class Function(Knotted):
    """Size of a force [N] or moment [N m] as ``call`` of the arguments in ``of``, in that order.

    >>> import math
    >>> law = Function(math.sin, of=("time",))
    >>> law.kernel()(0.0, law.numbers())
    0.0
    """

    call: Callable[..., float]
    of: tuple[Argument, ...]

    @classmethod
    def of_call(cls, call: Callable[..., float]) -> Function:
        """The law that a function is, by the names of its parameters.

        Raises pydantic's error for other names.
        """
        names = tuple(p.name for p in parameters_of(call) or ())
        if not names or not set(names) <= set(ARGUMENTS):
            message = f"a function of ({', '.join(names)})"
            hints = (close_match(name, ARGUMENTS) for name in names if name not in ARGUMENTS)
            remedy = next(filter(None, hints), "e.g. lambda rate: -0.3 * rate")
            raise mistake("wrong-function", message, VALID, remedy)
        return cls(call, names)  # type: ignore[arg-type]

    def variables(self) -> tuple[str, ...]:
        """What the law is a function of."""
        return self.of

    def numbers(self) -> tuple[()]:
        """None: the function holds its numbers."""
        return ()

    def kernel(self) -> Callable[..., Real]:
        """The function, asked sample by sample."""

        def function(*arguments: Real) -> Real:
            return each(self._value, *arguments[:-1])

        return function

    def _value(self, *arguments: float) -> float:
        return numbers_of(self.call, self.of, arguments, 1, REMEDY)[0]
