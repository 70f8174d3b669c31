"""Laws of a coupling: the driven coordinate as a function of the driver's, twice differentiable.

Every law is one piecewise polynomial of the distance s from a knot plus a sine of it,

    F(x) = sum c_k s^k + a sin(w s + f),    s = x - knot,

of which any derivative is known; so one kernel serves rises, tables and dwells. A law that
repeats may advance by a step from one period to the next (an indexing wheel).

Source: Norton, Cam Design and Manufacturing Handbook, 2nd ed. 2009, ch. 2 and 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import accumulate
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from blockmech.couplings.contract import Transmission
from blockmech.functions.pieces import Knotted, Rows, derivatives, horner
from blockmech.ground.plane import always, apply, expi, modulo, piecewise
from blockmech.ground.tolerances import ROUNDING
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
)
from blockmech.typing import Real, Values

SHARES = 10_000  # largest number of indexing steps of a turn


class LawNumbers(NamedTuple):
    """Numbers of a law: rows hold one coefficient a piece, highest power first."""

    start: Real  # the first knot of a law that repeats, else 0
    period: Real  # 0 where it does not
    step: Real  # advance in a period, over the period
    phase: Real  # what is added to the coordinate
    knots: tuple[float, ...]
    rows: Rows  # of F, F' and F''
    slopes: Rows
    curves: Rows
    sines: Rows  # a, w, f and two rows that give s; empty where no piece has one
    shape: Values = ()  # what a contact reads beside the law


def value_at(u: Real, law: LawNumbers) -> Transmission:
    """The pieces at a place between the first knot and the last one."""
    parts = (piecewise(u, law.knots, rows) for rows in (law.rows, law.slopes, law.curves))
    return Transmission(*parts)


def with_sine(u: Real, law: LawNumbers) -> Transmission:
    """The same, with the sines of the pieces."""
    F = value_at(u, law)
    a, w, phase = (piecewise(u, law.knots, (row,)) for row in law.sines[:3])
    s = piecewise(u, law.knots, law.sines[3:])
    z = expi(w * s + phase)
    aw = a * w
    return Transmission(F.q + a * z.imag, F.slope + aw * z.real, F.curve - aw * w * z.imag)


def shifted(F: Transmission, law: LawNumbers) -> Transmission:
    """A law and its phase."""
    return F._replace(q=F.q + law.phase)


def once(x: Real, law: LawNumbers) -> Transmission:
    """A law that does not repeat: NaN outside."""
    return shifted(value_at(x, law), law)


def repeated(x: Real, law: LawNumbers) -> Transmission:
    """A law that repeats."""
    u = modulo(x - law.start, law.period)
    return advanced(value_at(u, law), x - law.start - u, law)


def repeated_with_sine(x: Real, law: LawNumbers) -> Transmission:
    """The same, with sines."""
    u = modulo(x - law.start, law.period)
    return advanced(with_sine(u, law), x - law.start - u, law)


def advanced(F: Transmission, periods: Real, law: LawNumbers) -> Transmission:
    """A law after whole periods."""
    return shifted(F._replace(q=F.q + law.step * periods), law)


def power_series(x: Real, law: LawNumbers) -> Transmission:
    """One polynomial everywhere."""
    rows = ([c for (c,) in row] for row in (law.rows, law.slopes, law.curves))
    q, slope, curve = (horner(x, row) for row in rows)
    return Transmission(q + law.phase, slope, curve)


# -- rises ------------------------------------------------------------------------------
#
# Of a rise by 1 over 1: coefficients of the polynomial from s^0 on, or pieces with a sine, each
# with its share of the length. Where a piece begins its sine's phase is 0, or as it is given.

POLYNOMIALS = {
    "dwell": (0.0,),
    "linear": (0.0, 1.0),
    "3-4-5": (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
    "4-5-6-7": (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0),
}
MODIFIED = 1 / (4 + math.pi)


class Piece(NamedTuple):
    """A part of a rise by 1 over 1: F = c_0 + c_1 s + a sin(w s + phase) from ``begin`` on."""

    begin: float
    c: tuple[float, ...]
    a: float = 0.0
    w: float = 0.0
    phase: float = 0.0


SINES = {
    "cycloidal": (Piece(0.0, (0.0, 1.0), -1 / math.tau, math.tau),),
    "harmonic": (Piece(0.0, (0.5,), -0.5, math.pi, math.pi / 2),),
    "modified_sine": (
        Piece(0.0, (0.0, math.pi * MODIFIED), -MODIFIED / 4, 4 * math.pi),
        Piece(
            1 / 8,
            (MODIFIED * (2 + math.pi / 8), math.pi * MODIFIED),
            -9 * MODIFIED / 4,
            4 * math.pi / 3,
            math.pi / 2,
        ),
        Piece(
            7 / 8,
            (MODIFIED * (4 + 7 * math.pi / 8), math.pi * MODIFIED),
            -MODIFIED / 4,
            4 * math.pi,
            3.5 * math.pi,
        ),
    ),
}
RISES = {**{n: (Piece(0.0, c),) for n, c in POLYNOMIALS.items()}, **SINES}


class Law(Knotted, StrictModel):
    """The driven coordinate as a function of x, twice differentiable."""

    kind_key: ClassVar[str] = "kind"

    def numbers(self, phase: Real) -> LawNumbers:
        """The law's numbers, as its kernel reads them."""
        raise TypeError(f"{type(self).__name__} declares no numbers")

    def kernel(self) -> Callable[[Real, LawNumbers], Transmission]:
        """The function of x and the numbers."""
        raise TypeError(f"{type(self).__name__} declares no kernel")

    @property
    def step(self) -> float:
        """By how much the driven coordinate is further on after a period."""
        return 0.0

    def advance(self, turns: Fraction) -> Fraction | None:
        """Turns of a driven link while x grows by so many turns; None if it never comes back."""
        periods = math.tau / self.whole if self.whole else 0.0
        if not periods or abs(periods - round(periods)) > ROUNDING * periods:
            return None
        share = Fraction(self.step * periods / math.tau).limit_denominator(SHARES)
        exact = abs(float(share) - self.step * periods / math.tau) <= ROUNDING
        return share * turns if exact else None


class Segment(StrictModel):
    """A part of a law: by how much the driven coordinate rises over so much of x, and how.

    >>> Segment(motion="3-4-5", over=1.2, rise=0.01).rise
    0.01
    """

    motion: Literal["dwell", "linear", "3-4-5", "4-5-6-7", "cycloidal", "modified_sine", "harmonic"]
    over: Positive
    rise: Number = default(0.0)

    @model_validator(mode="after")
    def _dwells(self) -> Segment:
        if (self.motion == "dwell") != (self.rise == 0):
            message = f'"rise" is {self.rise:g} in a segment of the motion "{self.motion}"'
            raise mistake("wrong-value", message, "a dwell does not rise, all others do")
        return self

    def units(self, axis: Axis) -> Units:
        """Those of x and of the driven coordinate."""
        return {"over": axis.coordinate, "rise": axis.effort}

    def pieces(self, begin: float, level: float) -> Iterator[Piece]:
        """Its pieces from a place and a level on."""
        for piece in RISES[self.motion]:
            c = [self.rise * c / self.over**k for k, c in enumerate(piece.c)]
            at, c[0] = begin + piece.begin * self.over, c[0] + level
            yield Piece(at, tuple(c), self.rise * piece.a, piece.w / self.over, piece.phase)


class Segments(Law):
    """Rises and dwells one after another from ``start`` on; what is left of a period is a dwell.

    Without a ``period`` that of an angle, one turn. Where the rises do not add up to zero, the
    coordinate advances from one period to the next.

    >>> rise = Segment(motion="cycloidal", over=2.0, rise=0.1)
    >>> law = Segments(segments=[rise, {"motion": "cycloidal", "over": 2.0, "rise": -0.1}])
    >>> law.kernel()(1.0, law.numbers(0.0)).q
    0.05
    """

    kind: Literal["segments"] = "segments"
    segments: Annotated[list[Segment], Field(min_length=1)]
    start: Number = default(0.0)
    period: Maybe[Positive] = default(None)

    def units(self, axis: Axis) -> Units:
        """Places are in the unit of x."""
        return dict.fromkeys(("start", "period"), axis.coordinate)

    @model_validator(mode="after")
    def _within(self) -> Segments:
        total = math.fsum(s.over for s in self.segments)
        if total > self.whole * (1 + ROUNDING):
            message = f"the segments cover {total:.6g} of a period of {self.whole:.6g}"
            raise mistake("bad-table", message, "", 'shorten them, or give the "period"')
        return self

    @property
    def whole(self) -> float:
        """One turn, unless it is given."""
        return math.tau if self.period is None else self.period

    @property
    def step(self) -> float:
        """The sum of the rises."""
        return sum(s.rise for s in self.segments)

    def _pieces(self) -> list[Piece]:
        begins = list(accumulate((s.over for s in self.segments), initial=0.0))
        levels = list(accumulate((s.rise for s in self.segments), initial=0.0))
        pieces = [
            piece
            for s, at, level in zip(self.segments, begins, levels, strict=False)
            for piece in s.pieces(at, level)
        ]
        if np.any(begins[-1] < self.whole * (1 - ROUNDING)):  # of a column of designs, in any
            pieces.append(Piece(begins[-1], (levels[-1],)))
        return pieces

    def numbers(self, phase: Real) -> LawNumbers:
        """The pieces, one coefficient each a row."""
        pieces, knots = self._pieces(), [*(p.begin for p in self._pieces()), self.whole]
        sines: Rows = ()
        if self._with_sine:
            each = tuple(zip(*((p.a, p.w, p.phase) for p in pieces), strict=True))
            sines = (*each, (1.0,) * len(pieces), (0.0,) * len(pieces))
        rows = derivatives([p.c for p in pieces])
        step = self.step / self.whole
        return LawNumbers(self.start, self.whole, step, phase, tuple(knots), *rows, sines)

    @property
    def _with_sine(self) -> bool:
        return any(s.motion in SINES for s in self.segments)

    def kernel(self) -> Callable[[Real, LawNumbers], Transmission]:
        """With sines where a segment has one."""
        return repeated_with_sine if self._with_sine else repeated

    def knots(self) -> Sequence[float]:
        """The ends of the pieces."""
        return [self.start + p.begin for p in self._pieces()]


class Polynomial(Law):
    """``coefficients[0] + coefficients[1] x + coefficients[2] x^2 + ...``

    >>> law = Polynomial(coefficients=[1.0, 0.0, 2.0])
    >>> law.kernel()(3.0, law.numbers(0.0))
    Transmission(q=19.0, slope=12.0, curve=4.0)
    """

    kind: Literal["polynomial"] = "polynomial"
    coefficients: Annotated[NumbersGiven, Field(min_length=1)]

    def units(self, axis: Axis) -> Units:
        """The driven coordinate's over powers of x."""
        powers = range(len(self.coefficients))
        return {"coefficients": [axis.coefficient("coordinate", k) for k in powers]}

    def numbers(self, phase: Real) -> LawNumbers:
        """The coefficients, those of the derivatives too."""
        return LawNumbers(0.0, 0.0, 0.0, phase, (), *derivatives([self.coefficients]), ())

    kernel = always(power_series)

    def advance(self, turns: Fraction) -> Fraction | None:
        """Of a constant 0; what else comes back is not looked for."""
        return None if any(self.coefficients[1:]) else Fraction(0)


class Table(Law):
    """Values at growing arguments, joined by a spline of order 5 ("quintic") or 3 ("cubic").

    A quintic spline has four derivatives and needs six rows, a cubic one two. With ``period``
    the first value, and ``step`` more, is repeated one period after the first argument; without,
    the law is not defined outside.
    """

    kind: Literal["table"] = "table"
    arguments: Annotated[NumbersGiven, Field(min_length=4)]
    values: Annotated[NumbersGiven, Field(min_length=4)]
    period: Maybe[Positive] = default(None)
    advance_by: Annotated[Number, Field(alias="step")] = default(0.0)
    interpolation: Literal["quintic", "cubic"] = "cubic"
    model_config = {"populate_by_name": True}

    def units(self, axis: Axis) -> Units:
        """Those of x and of the driven coordinate."""
        own = dict.fromkeys(("values", "step", "advance_by"), axis.effort)
        return own | dict.fromkeys(("arguments", "period"), axis.coordinate)

    @model_validator(mode="after")
    def _ordered(self) -> Table:
        check_table("arguments", self.arguments, self.values, self.whole)
        if self.interpolation == "quintic" and len(self.arguments) < 6:
            message = f"{len(self.arguments)} rows for a quintic spline"
            raise mistake("bad-table", message, "six or more")
        return self

    @property
    def whole(self) -> float:
        """The period, if there is one."""
        return self.period or 0.0

    @property
    def step(self) -> float:
        """As it is given."""
        return self.advance_by

    def numbers(self, phase: Real) -> LawNumbers:
        """Knots and coefficients of the spline."""
        order = 5 if self.interpolation == "quintic" else 3
        return spline(self.arguments, self.values, order, self.whole, self.step, phase)

    def kernel(self) -> Callable[[Real, LawNumbers], Transmission]:
        """The form that repeats as the table does."""
        return repeated if self.period else once

    def knots(self) -> Sequence[float]:
        """The arguments, where the third derivative of a cubic spline jumps."""
        return self.arguments if self.interpolation == "cubic" else ()


def spline(
    x: Sequence[float], y: Sequence[float], order: int, period: float, step: float, phase: Real
) -> LawNumbers:
    """The spline through points, periodic apart from the step, or not-a-knot."""
    n = len(x)

    def coefficients(*numbers: float) -> tuple[float, ...]:
        import numpy as np
        from scipy.interpolate import PPoly, make_interp_spline

        xs, ys = list(numbers[:n]), list(numbers[n:])
        slope = step / period if period else 0.0
        if period:
            xs, ys = [*xs, xs[0] + period], [*ys, ys[0] + step]
        level = np.array(ys) - slope * (np.array(xs) - xs[0])
        if period:
            level[-1] = level[0]
        kind = "periodic" if period else None
        curve = PPoly.from_spline(make_interp_spline(xs, level, order, bc_type=kind))
        edges = [k for k in range(curve.c.shape[1]) if curve.x[k + 1] > curve.x[k]]
        edges = [k for k in edges if xs[0] <= curve.x[k] < xs[-1]]
        c = curve.c[:, edges]
        c[-2] += slope
        c[-1] += slope * (curve.x[edges] - xs[0])
        return (*map(float, curve.x[edges]), *map(float, c.ravel()))

    flat = apply("one_by_one", coefficients, *x, *y)
    count = len(flat) // (order + 2)
    start = x[0] if period else 0.0
    pieces = [flat[count * (order + 1 - k) :][:count] for k in range(order + 1)]
    knots = [k - start for k in flat[:count]] + [period or x[-1]]
    rows = derivatives(list(zip(*pieces, strict=True)))
    slope = step / period if period else 0.0
    return LawNumbers(start, period, slope, phase, tuple(knots), *rows, ())


AnyLaw = Annotated[Segments | Polynomial | Table, Field(discriminator="kind")]
