"""Gear pair: two wheels that roll on each other's pitch circles.

      A ---- P ---- B       P divides AB as the teeth do: (P - A) = i (P - B)
      |r1    |   r2 |       i = -z1/z2 of two outer wheels, +z1/z2 of one in a ring

The pitch point is where both wheels have one velocity, so the common tangent there is square
to the line of centres. Teeth push along a line that is turned from it by the pressure angle,
to the side that pushes the wheels apart: a wheel is pushed away from the other one's centre,
in a ring towards it. No backlash: the sense of the effort says which flank carries.

Source: Niemann & Winter, Maschinenelemente II, 2003, ch. 21.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, NamedTuple

from pydantic import Field, StrictBool, model_validator

from blockmech.couplings.contract import (
    Curve,
    LossyCoupling,
    Meshing,
    Transmission,
    Where,
    circle,
    concentric,
)
from blockmech.ground.plane import always, apply, dot, imul, mul
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Angle, default, in_unit
from blockmech.typing import Load, Parameters, Real

Teeth = Annotated[int, Field(strict=True, ge=1)]


class GearNumbers(NamedTuple):
    """Numbers of a gear pair."""

    ratio: Real  # [-] turns of the driven wheel for one of the driver's
    phase: Real  # [rad]
    lean: Real  # [-] tangent of the pressure angle, with the sign of the radial part


def rolling(x: Real, p: GearNumbers) -> Transmission:
    """The driven wheel turns by the ratio, against the carrier of both centres."""
    return Transmission(p.ratio * x + p.phase, p.ratio, 0.0)


def tooth_force(pose: Meshing, effort: Real, sense: Real, p: GearNumbers) -> Load:
    """Force [N] through the pitch point; its arm about B is BP = BA / (1 - i)."""
    d = pose.b.p - pose.a.p
    k = effort * (p.ratio - 1.0) / dot(d, d)
    return Load(imul(d, k) + mul(d, sense * k * p.lean), effort)


class Gear(LossyCoupling, type="coupling.gear"):
    """Two gear wheels, the driver's and the driven one's, with their centres in their pins.

    teeth : (driver's, driven one's) numbers of teeth
    internal : whether the larger wheel is a ring with the teeth inside
    phase : [rad] angle of the driven link where the driver's has turned by nothing
    pressure_angle : [rad] of the tooth force; it loads the bearings, and moves nothing

    The centres keep their distance: both are on one link, the frame or a carrier.

    >>> Gear(driver="sun", driven="planet", teeth=(24, 18)).ratio
    -1.3333333333333333
    """

    pairs = ("RR",)
    sides = ("pressure_angle",)

    teeth: tuple[Teeth, Teeth]
    internal: StrictBool = False
    phase: Angle = default(0.0)
    pressure_angle: Annotated[Angle, Field(ge=0.0, lt=math.pi / 2), in_unit("rad")] = default(0.0)

    @model_validator(mode="after")
    def _check_teeth(self) -> Gear:
        if self.internal and self.teeth[0] == self.teeth[1]:
            message = f"a wheel of {self.teeth[0]} teeth cannot roll in a ring with the same number"
            raise mistake("bad-teeth", message, "a ring has more teeth than the wheel in it")
        return self

    @property
    def exact_ratio(self) -> Fraction:
        """Turns of the driven wheel per turn of the driver's, on a carrier at rest."""
        ratio = Fraction(*self.teeth)
        return ratio if self.internal else -ratio

    @property
    def ratio(self) -> float:
        """The same as a float."""
        return float(self.exact_ratio)

    @property
    def sided(self) -> bool:
        """True with a pressure angle: the radial tooth force always separates the wheels."""
        return self.pressure_angle > 0

    def parameters(self) -> GearNumbers:
        """Ratio, phase and lean, signed so that the tooth force separates the wheels."""
        slant = apply("expi", self.pressure_angle)
        lean = slant.imag / slant.real
        return GearNumbers(self.ratio, self.phase, lean if 0 < self.ratio < 1 else -lean)

    transmission = always(rolling)
    contact = always(tooth_force)

    faults = concentric

    def curves(self, pair: str, pose_at: Where, p: Parameters) -> Iterator[Curve]:
        """Both pitch circles."""
        ends = pose_at(0.0)
        span = abs(ends.b.p - ends.a.p) / abs(1 - self.ratio)
        yield Curve("driver", circle(span * abs(self.ratio)), chain=True)
        yield Curve("driven", circle(span), chain=True)

    def advance(self, turns: Fraction) -> Fraction:
        """By the ratio."""
        return self.exact_ratio * turns
