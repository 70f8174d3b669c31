"""Signals that come from nowhere: a constant, a step in time, a table.

Source: Ogata, Modern Control Engineering, 2010, section 5-1 (test signals); tables as in `laws`.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from blockmech.ground.plane import always
from blockmech.ground.values import (
    Maybe,
    NotNegative,
    Number,
    NumbersGiven,
    Positive,
    default,
    in_unit,
)
from blockmech.loads import laws
from blockmech.loads.laws import table, table_over_period
from blockmech.signals.contract import Signal, at_once
from blockmech.typing import Kernel, Parameters, Real


def constant(p: Parameters) -> tuple[Real]:
    """The value."""
    return (p.value,)


class Source(Signal):
    """A signal whose value is one of its numbers, and that has no input."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """None."""
        return ()

    output = always(constant)


class Constant(Source, type="signal.constant"):
    """The same value always.

    >>> Constant(value=10.0).output()(Constant(value=10.0).numbers())
    (10.0,)
    """

    value: Number


class Input(Source, type="signal.input"):
    """An input from outside, set by a `stepper`; elsewhere ``value``.

    >>> Input().states
    {'held_y': State(initial=0.0, unit='')}
    """

    value: Number = default(0.0)

    @property
    def discrete(self) -> bool:
        """It changes between steps alone."""
        return True

    def initial_output(self) -> float:
        """The value."""
        return self.value


class Step(Source, type="signal.step"):
    """``before`` up to a time [s], ``value`` from then on.

    A discrete block with one instant: no step of the integration goes over the jump.

    >>> Step(value=10.0, time=0.5).instant(0.0)
    0.5
    """

    value: Number
    time: Annotated[NotNegative, in_unit("s")] = default(0.0)
    before: Number = default(0.0)

    @property
    def discrete(self) -> bool:
        """It switches once."""
        return True

    def instant(self, t: float, after: bool = False) -> float:
        """The time of the step, until it has passed."""
        ahead = self.time > t or at_once(self.time, t)
        return self.time if ahead and not (after and at_once(self.time, t)) else math.inf

    def initial_output(self) -> float:
        """The value before."""
        return self.before


def looked_up(u: Real, p: Parameters) -> tuple[Real]:
    """The interpolant; NaN outside the table."""
    return (table(u, p),)


def looked_up_over_period(u: Real, p: Parameters) -> tuple[Real]:
    """The interpolant of a table that repeats."""
    return (table_over_period(u, p),)


def in_time(t: Real, p: Parameters) -> tuple[Real]:
    """The interpolant at a time; NaN outside the table."""
    return (table(t, p),)


def in_time_over_period(t: Real, p: Parameters) -> tuple[Real]:
    """The interpolant of a table that repeats in time."""
    return (table_over_period(t, p),)


def knots(u: Real, p: Parameters) -> tuple[Real, ...]:
    """Zero where the argument passes a row of the table."""
    return tuple(u - knot for knot in p.knots)


class Table(Signal, type="signal.table"):
    """Values at growing arguments: of the time [s], or of the input with ``of: "input"``.

    Joined by a cubic spline or by straight lines; with ``period`` it repeats.

    >>> table = Table(arguments=[0.0, 1.0, 3.0], values=[0.0, 2.0, 0.0], interpolation="linear")
    >>> table.output()(2.0, table.numbers())
    (1.0,)
    """

    of: Literal["time", "input"] = "time"
    arguments: Annotated[NumbersGiven, Field(min_length=2)]
    values: Annotated[NumbersGiven, Field(min_length=2)]
    interpolation: Literal["cubic", "linear"] = "cubic"
    period: Maybe[Positive] = default(None)

    @model_validator(mode="after")
    def _is_a_table(self) -> Table:
        self.law()  # which checks the rows
        return self

    def law(self) -> laws.Table:
        """The same rows as a law of a load."""
        rows = ("arguments", "values", "interpolation", "period")
        return laws.Table(of="time", **{name: getattr(self, name) for name in rows})

    @property
    def inputs(self) -> tuple[str, ...]:
        """One, unless it is a table of the time."""
        return ("u",) if self.of == "input" else ()

    def numbers(self) -> Parameters:
        """Rows of the interpolant."""
        return self.law().numbers()

    def output(self) -> Kernel:
        """The form that repeats as the table does."""
        if self.of == "time":
            return in_time_over_period if self.period else in_time
        return looked_up_over_period if self.period else looked_up

    def kinks(self) -> tuple[Kernel, int]:
        """Rows of a table of the input; those of one that repeats are too many to watch."""
        watched = self.of == "input" and self.period is None
        return knots, len(self.arguments) if watched else 0

    def next_kink(self, t: float) -> float:
        """The next row of a table of the time."""
        return self.law().next_kink(t) if self.of == "time" else math.inf
