r"""The elasto-plastic law: bristles that give elastically alone up to a breakaway.

    coefficient = stiffness z + damping z' + viscous w
    z' = w (1 - a stiffness z sgn(w) / mu(|w|))

with mu of the LuGre law. The share a of the deflection that slips away is

    0     where stiffness |z| <= breakaway, or where z and w are of opposite sense
    1     where stiffness |z| >= mu
    (1 + sin(pi (stiffness |z| - (mu + breakaway) / 2) / (mu - breakaway))) / 2     between

so small oscillating loads do not make the pair creep, as they do by the LuGre law.

Source: Dupont, Hayward, Armstrong & Altpeter, Single state elastoplastic friction models, IEEE
Trans. Automatic Control 47 (2002), 787-792.
"""

from __future__ import annotations

import math
from typing import Literal

from pydantic import model_validator

from blockmech.friction.laws.contract import FrictionTerms
from blockmech.friction.laws.lugre import BristleFriction, resisting
from blockmech.friction.laws.stribeck import falling
from blockmech.ground.plane import always, expi, maximum, minimum, where
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Positive
from blockmech.typing import Parameters, Real


def slipping(slip: Real, deflection: Real, p: Parameters) -> Real:
    """The share of the motion that slips, of bristles that are fully bent."""
    top, f = falling(abs(slip), p), p.stiffness * abs(deflection)
    place = (f - 0.5 * (top + p.breakaway)) / (top - p.breakaway)
    share = 0.5 * (1.0 + expi(math.pi * maximum(minimum(place, 0.5), -0.5)).imag)
    return where(slip * deflection > 0.0, share, 0.0 * share)


def bending(slip: Real, deflection: Real, p: Parameters) -> Real:
    """Rate of the deflection."""
    lost = slipping(slip, deflection, p) * p.stiffness / falling(abs(slip), p)
    return slip - lost * abs(slip) * deflection


def elasto_plastic(slip: Real, deflection: Real, p: Parameters) -> FrictionTerms:
    """`resisting`, as the bristles bend."""
    return resisting(slip, deflection, bending(slip, deflection, p), p)


class ElastoPlastic(BristleFriction):
    """The LuGre law with a purely elastic range, so that a pair at rest does not creep.

    breakaway : [-] coefficient up to which bristles bend elastically, below ``kinetic``

    All others are those of `LuGre`.

    >>> law = ElastoPlastic(static=0.3, kinetic=0.2, breakaway=0.1, stribeck_speed=0.5,
    ...                     stiffness=1e3, radius=0.05)
    >>> round(law.at(0.5).factor / 0.05, 6)
    0.236788
    """

    law: Literal["elasto_plastic"] = "elasto_plastic"
    breakaway: Positive

    @model_validator(mode="after")
    def _breaks_below(self) -> ElastoPlastic:
        if not self.breakaway < self.kinetic:
            found = f'"breakaway" {self.breakaway:g} is not below "kinetic" {self.kinetic:g}'
            valid = "bristles break away before the pair slips"
            raise mistake("bad-friction", found, valid, "give a smaller one, mostly half of it")
        return self

    kernel = always(elasto_plastic)
    rate_kernel = always(bending)
