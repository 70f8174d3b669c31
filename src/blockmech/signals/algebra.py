"""Signals made of signals without a memory: sums, products, limits.

Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, Field, StrictBool

from blockmech.ground.plane import always, maximum, minimum, modulo
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Number, NumbersGiven
from blockmech.signals.contract import Signal
from blockmech.typing import Kernel, Parameters, Real

Signs = Annotated[str, Field(pattern=r"^[+-]+$", description="one + or - for each input")]


def in_order(limits: Any) -> Any:
    """Limits [low, high]. Raises pydantic's error where the second is not above the first."""
    if not limits[0] < limits[1]:
        found = f"[{limits[0]:g}, {limits[1]:g}]: the second must be above the first"
        raise mistake("wrong-value", found, "limits are [low, high]")
    return limits


Range = Annotated[NumbersGiven, Field(min_length=2, max_length=2), AfterValidator(in_order)]


class SumNumbers(NamedTuple):
    """Numbers of a sum."""

    signs: tuple[float, ...]


class Limits(NamedTuple):
    """Two limits.

    Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
    """

    low: Real
    high: Real


def added(inputs: tuple[Real, ...], p: SumNumbers) -> tuple[Real]:
    """The sum of inputs with signs."""
    total = p.signs[0] * inputs[0]
    for sign, u in zip(p.signs[1:], inputs[1:], strict=True):
        total = total + sign * u
    return (total,)


def added_angles(inputs: tuple[Real, ...], p: SumNumbers) -> tuple[Real]:
    """The sum of angles [rad], less whole turns: between -pi and pi."""
    (total,) = added(inputs, p)
    return (modulo(total + math.pi, math.tau) - math.pi,)


class Sum(Signal, type="signal.sum"):
    """Inputs u0, u1, ... added up, each with its sign; with ``wrap`` as an angle in (-pi, pi).

    >>> Sum(signs="+-").inputs
    ('u0', 'u1')
    >>> turn = Sum(signs="+-", wrap=True)
    >>> turn.output()((3.0, -3.0), turn.numbers())  # 6 rad less a turn
    (-0.28318530717958623,)
    """

    signs: Signs = "++"
    wrap: StrictBool = False

    @property
    def inputs(self) -> tuple[str, ...]:
        """One for each sign."""
        return tuple(f"u{k}" for k in range(len(self.signs)))

    def numbers(self) -> SumNumbers:
        """The signs as numbers."""
        return SumNumbers(tuple(1.0 if sign == "+" else -1.0 for sign in self.signs))

    def output(self) -> Kernel:
        """The sum."""
        return added_angles if self.wrap else added


def amplified(u: Real, p: Parameters) -> tuple[Real]:
    """k u."""
    return (p.k * u,)


class Gain(Signal, type="signal.gain"):
    """y = k u.

    >>> Gain(k=2.0).output()(3.0, Gain(k=2.0).numbers())
    (6.0,)
    """

    k: Number

    output = always(amplified)


def multiplied(u0: Real, u1: Real, p: Parameters) -> tuple[Real]:
    """u0 u1."""
    return (u0 * u1,)


class Product(Signal, type="signal.product"):
    """y = u0 u1.

    >>> Product().inputs
    ('u0', 'u1')
    """

    @property
    def inputs(self) -> tuple[str, ...]:
        """Two."""
        return ("u0", "u1")

    output = always(multiplied)


class Limited(Signal):
    """A block with a lower and an upper limit."""

    limits: Range

    def numbers(self) -> Limits:
        """Both limits.

        Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
        """
        return Limits(*self.limits)

    def kinks(self) -> tuple[Kernel, int]:
        """Where the input passes a limit."""
        return passes, 2


def clamped(u: Real, p: Limits) -> tuple[Real]:
    """The input between the limits.

    Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
    """
    return (maximum(p.low, minimum(p.high, u)),)


def passes(u: Real, p: Limits) -> tuple[Real, ...]:
    """Zero where the input passes a limit."""
    return u - p.low, u - p.high


class Saturation(Limited, type="signal.saturation"):
    """The input, kept between limits [low, high].

    >>> Saturation(limits=(-1.0, 1.0)).output()(3.0, Saturation(limits=(-1.0, 1.0)).numbers())
    (1.0,)
    """

    output = always(clamped)


def beyond(u: Real, p: Limits) -> tuple[Real]:
    """By how much the input is outside the limits.

    Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
    """
    return (u - maximum(p.low, minimum(p.high, u)),)


class DeadZone(Limited, type="signal.dead_zone"):
    """Zero between limits [low, high]; outside, the excess of the input.

    >>> DeadZone(limits=(-1.0, 1.0)).output()(3.0, DeadZone(limits=(-1.0, 1.0)).numbers())
    (2.0,)
    """

    output = always(beyond)
