"""Coulomb's law: friction in proportion to the load, at all speeds; and what dry laws share.

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 8-11, 16; prismatic pairs are the
future work of that paper.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.ground.plane import always
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Length, Maybe, NotNegative, default
from blockmech.typing import Data, Parameters


class DryFriction(FrictionLaw):
    """Friction that is a coefficient times the load on the pair.

    Revolute pair: couple = coefficient * radius * |R|  ([R10] Eq. 8), radius [m]
    of the pin. Prismatic pair: force = coefficient * |N|, or with the length [m]
    of the guide, whose two edges carry the couple C,
    coefficient * max(|N|, 2 |C| / guide_length).

    Its kernels read the radius, or 1 of a guide, as ``p.arm``.
    """

    drags: ClassVar[bool] = False

    radius: Maybe[Length] = default(None)
    guide_length: Maybe[Length] = default(None)

    @property
    def arm(self) -> Any:
        """Radius [m] of a pin; 1 of a guide."""
        return 1.0 if self.radius is None else self.radius

    def numbers(self) -> Data:
        """The law's coefficients and speeds, and its arm."""
        shape = ("radius", "guide_length")
        own = {name: x for name, x in super().numbers().items() if name not in shape}
        return own | {"arm": self.arm}

    def check_for(self, kind: str, joint: str) -> None:
        """Refuse a law that does not fit the kind of pair."""
        if kind == "R" and self.radius is None:
            found = f'{joint} is revolute and has no "radius"'
            remedy = "add the radius of the pin [m]"
        elif kind == "R" and self.guide_length is not None:
            found, remedy = f'{joint} is revolute and has a "guide_length"', "remove it"
        elif kind == "P" and self.radius is not None:
            found, remedy = f'{joint} is prismatic and has a "radius"', "remove it"
        else:
            return
        valid = '"radius" is for revolute pairs, "guide_length" for prismatic ones'
        raise mistake("friction-mismatch", found, valid, remedy)


def coulomb(p: Parameters) -> FrictionTerms:
    """f' r [m] or mu [-] at all speeds."""
    return FrictionTerms(p.factor, 0.0)


class Coulomb(DryFriction):
    """Coulomb friction of one pair, the same at all speeds.

    >>> Coulomb.from_material_coefficient(0.375, radius=0.0075).coefficient
    0.5
    """

    law: Literal["coulomb"] = "coulomb"
    coefficient: NotNegative

    @classmethod
    def from_material_coefficient(cls, coefficient: float, radius: float) -> Coulomb:
        """Friction of a worn-in dry bush, 4/3 of the materials' coefficient (Baranov, in [R10])."""
        return cls(coefficient=4.0 * coefficient / 3.0, radius=radius)

    @property
    def factor(self) -> Any:
        """Couple [N m] or force [N] per newton on the pair: f' r [m], or mu [-]."""
        return self.coefficient * self.arm

    def numbers(self) -> Data:
        """The factor."""
        return {"factor": self.factor}

    kernel = always(coulomb)
