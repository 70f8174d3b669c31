r"""The LuGre law: bristles that bend and are damped, and Stribeck's curve where the pair slips.

    coefficient = stiffness z + damping z' + viscous w,      z' = w - stiffness |w| z / mu(|w|)
    mu(w) = kinetic + (static - kinetic) exp(-(w / stribeck_speed)^exponent)

z is the deflection of the bristles [rad or m], w the relative rate. Sliding on at one rate is
`Stribeck`'s law; beside it there are the spring and the damper of a pair that sticks, a lag
behind changes of the speed, and friction at the break that follows how fast the load rises.

Source: Canudas de Wit, Olsson, Astrom & Lischinsky, A new model for control of systems with
friction, IEEE Trans. Automatic Control 40 (1995), 419-425.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import model_validator

from blockmech.friction.laws.contract import FrictionTerms
from blockmech.friction.laws.coulomb import DryFriction
from blockmech.friction.laws.stiction import check_static
from blockmech.friction.laws.stribeck import falling
from blockmech.ground.plane import always, sign
from blockmech.ground.values import Axis, NotNegative, Positive, Units, default
from blockmech.typing import Parameters, Real


def bending(slip: Real, deflection: Real, p: Parameters) -> Real:
    """Rate of the deflection."""
    return slip - p.stiffness * abs(slip) * deflection / falling(abs(slip), p)


def bent(slip: Real, p: Parameters) -> Real:
    """Deflection of a pair that has slipped at a rate for long."""
    return sign(slip) * falling(abs(slip), p) / p.stiffness


def resisting(slip: Real, deflection: Real, rate: Real, p: Parameters) -> FrictionTerms:
    """Spring and damper of the bristles, and the film between them."""
    f = p.stiffness * deflection + p.damping * rate + p.viscous * slip
    return FrictionTerms(f * p.arm, 0.0 * slip)


def lugre(slip: Real, deflection: Real, p: Parameters) -> FrictionTerms:
    """`resisting`, as the bristles bend."""
    return resisting(slip, deflection, bending(slip, deflection, p), p)


def most(p: Parameters) -> FrictionTerms:
    """The largest friction that the bristles carry."""
    return FrictionTerms(p.static * p.arm, 0.0)


class BristleFriction(DryFriction):
    """Base class of the LuGre law and its variants."""

    remembers: ClassVar[bool] = True
    static: Positive
    kinetic: Positive
    stribeck_speed: Positive
    stiffness: Positive
    damping: NotNegative = default(0.0)
    exponent: Positive = default(2.0)
    viscous: NotNegative = default(0.0)

    def units(self, axis: Axis) -> Units:
        """By the pair's coordinate and rate."""
        per_rate = axis._replace(effort="").coefficient("rate").strip()
        return {
            "stribeck_speed": axis.argument("rate"),
            "stiffness": f"1/{axis.coordinate}",
            "damping": per_rate,
            "viscous": per_rate,
        }

    @model_validator(mode="after")
    def _holds_no_less(self) -> BristleFriction:
        check_static(self.static, self.kinetic)
        return self

    kernel_at_rest = always(most)
    steady_kernel = always(bent)


class LuGre(BristleFriction):
    """Friction by bristles with spring and damper, and Stribeck's curve where it slips.

    static, kinetic : [-] coefficients at rest and at speeds far above ``stribeck_speed``
    stribeck_speed : [rad/s or m/s] of the relative motion, at which 1/e of the fall remains
    stiffness : [1/rad of a pin, 1/m of a guide] slope of the coefficient over the deflection
    damping : [s/rad or s/m] slope of the coefficient over the rate of deflection
    exponent : [-] sharpness of the fall, usually 1 or 2
    viscous : [s/rad or s/m] rise of the coefficient with the speed

    >>> law = LuGre(static=0.3, kinetic=0.2, stribeck_speed=0.5, stiffness=1e3, radius=0.05)
    >>> round(law.at(0.5).factor / 0.05, 6)  # of a pair that slips at this rate for long
    0.236788
    """

    law: Literal["lugre"] = "lugre"

    kernel = always(lugre)
    rate_kernel = always(bending)
