r"""Stribeck's curve: from static to kinetic friction with the speed, and viscous friction.

    f(w) = kinetic + (static - kinetic) exp(-(|w| / stribeck_speed)^exponent) + viscous |w|

Sources: Stribeck, Die wesentlichen Eigenschaften der Gleit- und Rollenlager, VDI-Z. 46 (1902);
Bo & Pavelescu 1982 (the exponent), as in Armstrong-Helouvry, Dupont & Canudas de Wit 1994.
"""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from blockmech.friction.laws.contract import FrictionTerms
from blockmech.friction.laws.coulomb import DryFriction
from blockmech.friction.laws.stiction import check_static
from blockmech.ground.plane import always, exp, power
from blockmech.ground.values import Axis, NotNegative, Positive, Units, default
from blockmech.typing import Parameters, Real


def falling(speed: Real, p: Parameters) -> Real:
    """The coefficient at a speed without the viscous part."""
    left = exp(-power(speed / p.stribeck_speed, p.exponent))
    return p.kinetic + (p.static - p.kinetic) * left


def stribeck(speed: Real, p: Parameters) -> FrictionTerms:
    """The curve at a speed."""
    f = falling(speed, p) + p.viscous * speed
    return FrictionTerms(f * p.arm, 0.0)


class Stribeck(DryFriction):
    """Friction that falls from its static to its kinetic coefficient, and may rise again.

    static, kinetic : [-] coefficients at rest and at speeds far above ``stribeck_speed``
    stribeck_speed : [rad/s or m/s] of the relative motion, at which 1/e of the fall remains
    exponent : [-] sharpness of the fall, usually 1 or 2
    viscous : [s of a pin, s/m of a guide] rise of the coefficient with the speed

    >>> law = Stribeck(static=0.3, kinetic=0.2, stribeck_speed=0.5, viscous=0.01, radius=0.05)
    >>> law.at(0.0).factor == 0.3 * 0.05
    True
    """

    law: Literal["stribeck"] = "stribeck"
    static: NotNegative
    kinetic: NotNegative
    stribeck_speed: Positive
    exponent: Positive = default(2.0)
    viscous: NotNegative = default(0.0)

    def units(self, axis: Axis) -> Units:
        """Of speeds along the pair's coordinate."""
        per_rate = axis._replace(effort="").coefficient("rate").strip()
        return {"stribeck_speed": axis.argument("rate"), "viscous": per_rate}

    @model_validator(mode="after")
    def _holds_no_less(self) -> Stribeck:
        check_static(self.static, self.kinetic)
        return self

    @property
    def smooth(self) -> bool:
        """Not at rest, with a fractional exponent."""
        return self.exponent == round(self.exponent) or self.static == self.kinetic

    kernel = always(stribeck)
