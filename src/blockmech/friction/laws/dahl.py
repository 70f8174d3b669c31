r"""Dahl's law: a pair gives elastically before it slips, on bristles that bend.

    coefficient = stiffness z,      z' = w - stiffness |w| z / kinetic

z is the deflection of the bristles [rad or m], w the relative rate. The coefficient goes to the
kinetic one, +-kinetic, in the sense of the motion as exp(-stiffness way / kinetic).

Source: Dahl, A solid friction model, The Aerospace Corporation TOR-158(3107-18), 1968, with the
exponent 1; as in Canudas de Wit, Olsson, Astrom & Lischinsky, IEEE Trans. Automatic Control 40
(1995), 419-425.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from blockmech.friction.laws.contract import FrictionTerms
from blockmech.friction.laws.coulomb import DryFriction
from blockmech.ground.plane import always, sign
from blockmech.ground.values import Axis, Positive, Units
from blockmech.typing import Parameters, Real


def bending(slip: Real, deflection: Real, p: Parameters) -> Real:
    """Rate of the deflection."""
    return slip - p.stiffness * abs(slip) * deflection / p.kinetic


def bent(slip: Real, p: Parameters) -> Real:
    """Deflection of a pair that has slipped at a rate for long."""
    return sign(slip) * p.kinetic / p.stiffness


def dahl(slip: Real, deflection: Real, p: Parameters) -> FrictionTerms:
    """The spring of the bristles."""
    return FrictionTerms(p.stiffness * deflection * p.arm, 0.0 * slip)


def most(p: Parameters) -> FrictionTerms:
    """The largest friction that the bristles carry."""
    return FrictionTerms(p.kinetic * p.arm, 0.0)


class Dahl(DryFriction):
    """Friction by bristles that bend before the pair slips.

    kinetic : [-] coefficient while the pair slips on
    stiffness : [1/rad of a pin, 1/m of a guide] slope of the coefficient over the deflection

    >>> law = Dahl(kinetic=0.2, stiffness=1e3, radius=0.05)
    >>> law.at(0.7).factor == 0.2 * 0.05
    True
    """

    law: Literal["dahl"] = "dahl"
    remembers: ClassVar[bool] = True
    kinetic: Positive
    stiffness: Positive

    def units(self, axis: Axis) -> Units:
        """By the pair's coordinate."""
        return {"stiffness": f"1/{axis.coordinate}"}

    kernel = always(dahl)
    kernel_at_rest = always(most)
    rate_kernel = always(bending)
    steady_kernel = always(bent)
