"""Friction of joints: from the load on a pair to the couple or force it resists with.

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 8-11, 16; prismatic pairs are the
future work of that paper.
"""

from __future__ import annotations

from typing import Literal

from blockmech.values import Length, NotNegative, Strictly, mistake


class Coulomb(Strictly):
    """Coulomb friction of one pair.

    Revolute pair: couple = coefficient * radius * |R|  ([R10] Eq. 8), radius [m]
    of the pin. Prismatic pair: force = coefficient * |N|, or with the length [m]
    of the guide, whose two edges carry the couple C,
    coefficient * max(|N|, 2 |C| / guide_length).

    >>> Coulomb.from_material_coefficient(0.375, radius=0.0075).coefficient
    0.5
    """

    law: Literal["coulomb"] = "coulomb"
    coefficient: NotNegative
    radius: Length | None = None
    guide_length: Length | None = None

    @classmethod
    def from_material_coefficient(cls, coefficient: float, radius: float) -> Coulomb:
        """Friction of a worn-in pin, 4/3 of the materials' coefficient (Baranov, in [R10])."""
        return cls(coefficient=4.0 * coefficient / 3.0, radius=radius)

    def check_for(self, kind: str, joint: str) -> None:
        """Refuse what does not fit the kind of pair."""
        if kind == "R" and self.radius is None:
            found, remedy = f'{joint} is revolute and has no "radius"', "give that of its pin [m]"
        elif kind == "R" and self.guide_length is not None:
            found, remedy = f'{joint} is revolute and has a "guide_length"', "take it away"
        elif kind == "P" and self.radius is not None:
            found, remedy = f'{joint} is prismatic and has a "radius"', "take it away"
        else:
            return
        valid = '"radius" is for revolute pairs, "guide_length" for prismatic ones'
        raise mistake("friction-mismatch", found, valid, remedy)

    @property
    def factor(self) -> float:
        """Couple [N m] or force [N] per newton on the pair: f' r [m], or mu [-]."""
        return self.coefficient * (self.radius if self.radius is not None else 1.0)
