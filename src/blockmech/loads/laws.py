"""Laws: the size of a force or moment as a function of a coordinate, a rate or time.

A law is typed data (``{"kind": "polynomial", ...}``), never evaluated text. ``of`` names the
argument: the "coordinate" [rad or m] or the "rate" of the element or its driver, or the "time"
[s]. Each kind has one pure kernel
``value(x, numbers)`` of the law's argument and its numbers.

Sources: [D14] Durango et al. 2014, section 2 (loads as functions of position and
velocity).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field, field_validator, model_validator

from blockmech.functions.pieces import Knotted, Rows, cubic, horner, straight
from blockmech.ground.plane import EPS, always, angle, expi, imul, modulo, mul, piecewise, where
from blockmech.ground.validation_errors import check_table, mistake
from blockmech.ground.values import (
    Axis,
    Maybe,
    Number,
    NumbersGiven,
    Positive,
    StrictModel,
    Units,
    default,
    in_unit,
)
from blockmech.typing import Argument, Parameters, Real

__all__ = ["DC", "Constant", "Fourier", "Polynomial", "Signal", "Table"]
__dir__ = __all__.copy  # completion shows these alone

Turns = Annotated[int, Field(strict=True, gt=0)]


class PolynomialNumbers(NamedTuple):
    """Numbers of a polynomial."""

    coefficients: tuple[float, ...]  # highest power first


class TableNumbers(NamedTuple):
    """Numbers of a table: a piecewise polynomial of the distance from ``start``."""

    start: Real  # the first argument of a table that repeats, else 0
    period: Real  # of the argument, 0 where the table does not repeat
    turns: Real  # whole turns [-] that it covers, 0 where it is not one of an angle
    knots: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]  # coefficients, highest power first


class FourierNumbers(NamedTuple):
    """Numbers of a Fourier series, highest harmonic first."""

    mean: Real
    period: Real
    turns: Real
    cosines: tuple[float, ...]
    sines: tuple[float, ...]


def constant(law: PolynomialNumbers) -> Real:
    """The same at all times."""
    return law.coefficients[0]


def polynomial(x: Real, law: PolynomialNumbers) -> Real:
    """Horner's scheme."""
    return horner(x, law.coefficients)


def table(x: Real, law: TableNumbers) -> Real:
    """The interpolant; NaN outside the table."""
    return piecewise(x, law.knots, law.rows)


def table_over_period(x: Real, law: TableNumbers) -> Real:
    """The interpolant of a table that repeats after a period."""
    return piecewise(modulo(x - law.start, law.period), law.knots, law.rows)


def table_over_turns(x: Real, law: TableNumbers) -> Real:
    """The same after whole turns, whose angle is told by sine and cosine: exact at any size."""
    part = angle(expi(law.start / law.turns), expi(x / law.turns))
    phase = where(part < 0.0, part + math.tau, part)
    return piecewise(phase * law.turns, law.knots, law.rows)


def fourier_over_period(x: Real, law: FourierNumbers) -> Real:
    """The series of a quantity that repeats after a period."""
    return harmonics(modulo(x, law.period) * (math.tau / law.period), law)


def fourier_over_turns(x: Real, law: FourierNumbers) -> Real:
    """The series of an angle that repeats after whole turns."""
    return harmonics(x / law.turns, law)


def harmonics(phase: Real, law: FourierNumbers) -> Real:
    """mean + sum of a_k cos k phase + b_k sin k phase, by Horner's scheme in exp(i phase)."""
    z = expi(phase)
    total = mul(z, law.cosines[0]) - imul(z, law.sines[0])
    for a, b in zip(law.cosines[1:], law.sines[1:], strict=True):
        total = total * z + mul(z, a) - imul(z, b)
    return law.mean + total.real


class Law(Knotted, StrictModel):
    """Size of a force [N] or moment [N m]. ``of`` is what it is a function of."""

    kind_key: ClassVar[str] = "kind"

    def variables(self) -> tuple[str, ...]:
        """What the law is a function of; nothing for a constant."""
        of = getattr(self, "of", None)
        return () if of is None else (of,)

    def numbers(self) -> Parameters:
        """The law's numbers, as its kernel reads them."""
        raise TypeError(f"{type(self).__name__} declares no numbers")

    def kernel(self) -> Callable[..., Real]:
        """The function of the law's argument and numbers; a polynomial unless said."""
        return polynomial


class Constant(Law):
    """A constant force or moment.

    >>> Constant(value=5.0).variables()
    ()
    """

    kind: Literal["constant"] = "constant"
    value: Number

    def units(self, axis: Axis) -> Units:
        """The effort's."""
        return {"value": axis.effort}

    def numbers(self) -> PolynomialNumbers:
        """The value."""
        return PolynomialNumbers((self.value,))

    kernel = always(constant)


class Polynomial(Law):
    """``coefficients[0] + coefficients[1] x + coefficients[2] x^2 + ...``

    >>> law = Polynomial(of="rate", coefficients=[1.0, 0.0, 2.0])
    >>> law.kernel()(3.0, law.numbers())
    19.0
    """

    kind: Literal["polynomial"] = "polynomial"
    of: Argument = "coordinate"
    coefficients: Annotated[NumbersGiven, Field(min_length=1)]

    def units(self, axis: Axis) -> Units:
        """The effort's over powers of the argument's."""
        powers = range(len(self.coefficients))
        return {"coefficients": [axis.coefficient(self.of, k) for k in powers]}

    def numbers(self) -> PolynomialNumbers:
        """The coefficients, highest power first."""
        return PolynomialNumbers(tuple(reversed(self.coefficients)))


class _Repeating(Law):
    of: Argument = "coordinate"
    period: Maybe[Positive] = default(None)
    turns: Turns | None = None

    def units(self, axis: Axis) -> Units:
        """Values in the unit of the effort, knots in that of the argument."""
        values = dict.fromkeys(("values", "mean", "cosines", "sines"), axis.effort)
        return values | dict.fromkeys(("arguments", "period"), axis.argument(self.of))

    @model_validator(mode="after")
    def _check_period(self) -> _Repeating:
        if self.period is not None and self.turns is not None:
            raise mistake(
                "wrong-value", 'the period is given twice, by "period" and "turns"', "", "keep one"
            )
        if self.turns is not None and self.of != "coordinate":
            raise mistake("wrong-value", f'"turns" are of an angle, not of a {self.of}')
        return self

    @property
    def whole(self) -> float:
        """Length of the period [unit of the argument]; 0 where nothing repeats."""
        if self.turns:
            return math.tau * self.turns
        return 0.0 if self.period is None else self.period

    @property
    def covers_one_turn(self) -> bool:
        """Whether it covers one turn."""
        return self.turns == 1


class Table(_Repeating):
    """Values at growing arguments, joined by a cubic spline or by straight lines.

    With ``period``, or ``turns`` for an angle, the first value is repeated one period
    after the first argument, and the table covers everything; the spline is then
    periodic. Without, it is a not-a-knot spline, and the law is not defined outside.

    >>> law = Table(arguments=[0.0, 1.0, 3.0], values=[0.0, 2.0, 0.0], interpolation="linear")
    >>> law.kernel()(2.0, law.numbers())
    1.0
    """

    kind: Literal["table"] = "table"
    arguments: Annotated[NumbersGiven, Field(min_length=2)]
    values: Annotated[NumbersGiven, Field(min_length=2)]
    interpolation: Literal["cubic", "linear"] = "cubic"

    @model_validator(mode="after")
    def _ordered(self) -> Table:
        check_table("arguments", self.arguments, self.values, self.whole)
        return self

    def knots(self) -> Sequence[float]:
        """Its arguments."""
        start = self.arguments[0] if self.whole else 0.0
        return [float(start + (a - start)) for a in self.arguments]

    def numbers(self) -> TableNumbers:
        """The knots, and the coefficients of each piece by the distance from its knot.

        Knots of a table that does not repeat are the arguments: near one no digit is lost.
        """
        start = self.arguments[0] if self.whole else 0.0
        x = [a - start for a in self.arguments]
        y = list(self.values)
        if self.whole:
            x, y = [*x, self.whole], [*y, y[0]]
        lines = self.interpolation == "linear"
        rows = straight(x, y) if lines else cubic(x, y, repeats=bool(self.whole))
        if not self.whole:
            x, rows = widened(x, rows)
        return TableNumbers(start, self.whole, float(self.turns or 0), tuple(x), rows)

    def kernel(self) -> Callable[..., Real]:
        """The form that repeats as the table does."""
        if self.turns:
            return table_over_turns
        return table_over_period if self.period else table


def widened(x: Sequence[float], rows: Rows) -> tuple[list[float], Rows]:
    """A table whose ends go on by some roundings: arguments are computed, ends are typed."""
    margin = 4 * EPS * (x[-1] - x[0])
    return [x[0] - margin, *x[:-1], x[-1] + margin], tuple((row[0], *row) for row in rows)


class Fourier(_Repeating):
    """``mean + sum of cosines[k-1] cos(k w x) + sines[k-1] sin(k w x)``.

    w = 2 pi / period, or 1 / turns for an angle [rad]; one turn by default.

    >>> law = Fourier(mean=1.0, cosines=[2.0])
    >>> law.kernel()(0.0, law.numbers())
    3.0
    """

    kind: Literal["fourier"] = "fourier"
    mean: Number = default(0.0)
    cosines: NumbersGiven = default([])
    sines: NumbersGiven = default([])

    @property
    def whole(self) -> float:
        """Period of the argument, one turn by default."""
        return super().whole or math.tau

    @property
    def covers_one_turn(self) -> bool:
        """Whether it is a series of one turn."""
        return self.period is None and (self.turns or 1) == 1

    @model_validator(mode="after")
    def _period_known(self) -> Fourier:
        if self.of != "coordinate" and self.period is None:
            raise mistake("missing-key", f'a series of a {self.of} needs "period"', "", "add it")
        return self

    def numbers(self) -> FourierNumbers:
        """Sine and cosine coefficients at one length, highest harmonic first."""
        n = max(len(self.cosines), len(self.sines), 1)
        a, b = (
            tuple(reversed([*row, *[0.0] * (n - len(row))])) for row in (self.cosines, self.sines)
        )
        return FourierNumbers(self.mean, self.period or 0.0, float(self.turns or 1), a, b)

    def kernel(self) -> Callable[..., Real]:
        """The form that repeats as the series does."""
        return fourier_over_period if self.period else fourier_over_turns


class DC(Law):
    """A direct-current motor: stall_moment [N m] at rest, none at no_load_speed [rad/s].

    >>> law = DC(stall_moment=2.0, no_load_speed=100.0)
    >>> law.kernel()(50.0, law.numbers())
    1.0
    """

    of: ClassVar[str] = "rate"
    kind: Literal["dc"] = "dc"
    stall_moment: Annotated[Number, in_unit("N m")]
    no_load_speed: Annotated[Number, in_unit("rad/s")]

    @field_validator("no_load_speed")
    @classmethod
    def _turns(cls, speed: float) -> float:
        if speed == 0:
            raise mistake("wrong-value", "must not be 0")
        return speed

    def units(self, axis: Axis) -> Units:
        """Those along the axis: of a thrust a force and a speed."""
        return {"stall_moment": axis.effort, "no_load_speed": axis.argument("rate")}

    def numbers(self) -> PolynomialNumbers:
        """The straight line from the stall moment to zero at the no-load speed."""
        return PolynomialNumbers((-self.stall_moment / self.no_load_speed, self.stall_moment))


def identity(x: Real, law: tuple[()]) -> Real:
    """The argument itself."""
    return x


class Signal(Law):
    """The signal or output that is wired to the port ``law`` of the load.

    >>> Signal().variables()
    ('signal',)
    """

    of: ClassVar[str] = "signal"
    kind: Literal["signal"] = "signal"

    def numbers(self) -> tuple[()]:
        """None."""
        return ()

    kernel = always(identity)


AnyLaw = Annotated[
    Constant | Polynomial | Table | Fourier | DC | Signal, Field(discriminator="kind")
]
