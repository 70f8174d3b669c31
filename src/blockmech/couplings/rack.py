"""Rack and pinion: a wheel that rolls on a straight line, either of them leading.

         A          pinion   turns about A, pitch radius r
      ---P------>   rack     slides along u, its pitch line goes through P
              u     P        A - i u r side, where both have one velocity

Teeth push as those of a gear pair do: along a line turned from the pitch line by the pressure
angle, to the side that pushes pinion and rack apart.

Source: Niemann & Winter, Maschinenelemente II, 2003, ch. 21.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from blockmech.couplings.contract import Curve, LossyCoupling, Meshing, Transmission, Where, circle
from blockmech.ground.plane import apply, cross, imul, mul
from blockmech.ground.values import Angle, Length, Number, default, in_unit, no_boolean
from blockmech.typing import Kernel, Load, Real

Side = Annotated[Literal[-1, 1], no_boolean(-1, 1)]


class RackNumbers(NamedTuple):
    """Numbers of a rack."""

    radius: Real  # [m] with the sign of the side
    side: Real
    phase: Real
    lean: Real  # [-] tangent of the pressure angle


def rolling(x: Real, p: RackNumbers) -> Transmission:
    """The rack goes by the arc that the pinion rolls."""
    return Transmission(p.radius * x + p.phase, p.radius, 0.0)


def turning(x: Real, p: RackNumbers) -> Transmission:
    """The pinion turns by the rack's way over the radius."""
    return Transmission(x / p.radius + p.phase, 1.0 / p.radius, 0.0)


def on_rack(pose: Meshing, effort: Real, sense: Real, p: RackNumbers) -> Load:
    """Force [N] of the pinion on the rack, through P."""
    u, point = pose.b.u, pose.a.p - imul(pose.b.u, p.radius)
    force = mul(u, effort) - imul(u, sense * effort * p.lean * p.side)
    return Load(force, cross(point - pose.b.p, force))


def on_pinion(pose: Meshing, effort: Real, sense: Real, p: RackNumbers) -> Load:
    """Force [N] of the rack on the pinion, through P, and its moment about A."""
    push = effort / p.radius
    apart = sense * effort / (p.radius * p.side)  # the size of what acts along the rack
    force = mul(pose.a.u, push) + imul(pose.a.u, apart * p.lean * p.side)
    return Load(force, effort)


class Rack(LossyCoupling, type="coupling.rack"):
    """A rack and a pinion: a slide drive and a crank, either of which leads.

    radius : [m] pitch radius of the pinion
    side : 1 where the rack moves along its guide while the pinion turns counter-clockwise, so
        that it passes right of the pinion's centre seen along the guide; -1 where it passes left
    phase : [m or rad] coordinate of the driven pair where the driver's is 0
    pressure_angle : [rad] of the tooth force

    >>> Rack(driver="pinion", driven="rack", radius=0.02).side
    1
    """

    pairs = ("RP", "PR")
    sides = ("pressure_angle",)
    fixed = True

    radius: Length
    side: Side = 1
    phase: Number = default(0.0)
    pressure_angle: Annotated[Angle, Field(ge=0.0, lt=math.pi / 2), in_unit("rad")] = default(0.0)

    @property
    def sided(self) -> bool:
        """True with a pressure angle: the tooth force always separates rack and pinion."""
        return self.pressure_angle > 0

    def parameters(self) -> RackNumbers:
        """Radius and side as one number, and the tangent of the pressure angle."""
        slant = apply("expi", self.pressure_angle)
        side = float(self.side)
        return RackNumbers(side * self.radius, side, self.phase, slant.imag / slant.real)

    def transmission(self, pair: str) -> Kernel:
        """`rolling`, or `turning` where the rack leads."""
        return rolling if pair == "RP" else turning

    def contact(self, pair: str) -> Kernel:
        """Force [N] on the driven link."""
        return on_rack if pair == "RP" else on_pinion

    def curves(self, pair: str, pose_at: Where, p: RackNumbers) -> Iterator[Curve]:
        """The pitch circle and as much of the pitch line as the circle rolls in a turn."""
        at = pose_at(0.0)
        pinion, rack = ("driver", "driven") if pair == "RP" else ("driven", "driver")
        centre, body, guide = (at.a.p, at.link, at.b) if pair == "RP" else (at.b.p, at.lead, at.a)
        foot = (centre - 1j * guide.u * p.radius - body.p) / body.u
        half = math.pi * abs(p.radius) * guide.u / body.u
        yield Curve(pinion, circle(abs(p.radius)), chain=True)  # type: ignore[arg-type]
        yield Curve(rack, [foot - half, foot + half], chain=True)  # type: ignore[arg-type]

    def advance(self, turns: Fraction) -> Fraction | None:
        """None: a rack does not return; 0 for no turns."""
        return None if turns else Fraction(0)
