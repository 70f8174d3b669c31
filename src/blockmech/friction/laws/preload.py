"""Friction of a preload: constant, whatever the load and the speed.

Source: Armstrong-Helouvry, Dupont & Canudas de Wit, Automatica 30 (1994), section 2.
"""

from __future__ import annotations

from typing import Literal

from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.ground.plane import always
from blockmech.ground.values import Axis, NotNegative, Units
from blockmech.typing import Parameters


def preload(p: Parameters) -> FrictionTerms:
    """Always the same."""
    return FrictionTerms(0.0, p.resistance)


class Preload(FrictionLaw):
    """A seal or a preloaded bearing, which resists with a constant couple or force.

    resistance : [N m of a pin, N of a guide]

    >>> Preload(resistance=0.2).at_rest().drag
    0.2
    """

    law: Literal["preload"] = "preload"
    resistance: NotNegative

    def units(self, axis: Axis) -> Units:
        """Of the effort."""
        return {"resistance": axis.effort}

    kernel = always(preload)
