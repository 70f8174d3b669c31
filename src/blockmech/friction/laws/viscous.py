"""Viscous friction: in proportion to the speed, whatever the load.

Source: Armstrong-Helouvry, Dupont & Canudas de Wit, Automatica 30 (1994), section 2.
"""

from __future__ import annotations

from typing import Literal

from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.ground.plane import always
from blockmech.ground.values import Axis, NotNegative, Units
from blockmech.typing import Parameters, Real


def viscous(speed: Real, p: Parameters) -> FrictionTerms:
    """In proportion to the speed."""
    return FrictionTerms(0.0 * speed, p.damping * speed)


class Viscous(FrictionLaw):
    """Viscous friction: ``damping`` times the relative rate.

    damping : [N m s/rad of a pin, N s/m of a guide]

    >>> Viscous(damping=0.5).at(4.0).drag
    2.0
    """

    law: Literal["viscous"] = "viscous"
    damping: NotNegative

    def units(self, axis: Axis) -> Units:
        """Of the effort over the rate."""
        return {"damping": axis.coefficient("rate")}

    kernel = always(viscous)
