"""A journal that runs in the middle of its oil film.

    couple = 2 pi viscosity radius^3 length / clearance * rate

holds for a light load or a high speed, where the journal is concentric; then the load does not
count. A film that carries a load needs the friction number f(S) by Sommerfeld's S, in which
friction is not linear in the load: that is another law, which is not here.

Source: Petroff, Friction in machines and the effect of the lubricant, 1883; as in Shigley's
Mechanical Engineering Design, ch. 12.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.typing import Real
from blockmech.values import Length, Number, in_unit, mistake

THICKEST = 0.01  # [-] of the radius: a film of journal bearings is a thousandth of it


def petroff(speed: Real, p: Any) -> FrictionTerms:
    """The shear stress of the film over the journal's surface, times its radius."""
    area = 2.0 * math.pi * p.radius * p.length
    stress = p.viscosity * (speed * p.radius / p.clearance)
    return FrictionTerms(0.0 * speed, stress * area * p.radius)


class Hydrodynamic(FrictionLaw):
    """A lightly loaded journal bearing, by Petroff's equation.

    viscosity : [Pa s] dynamic viscosity of the oil
    radius, length : [m] of the journal
    clearance : [m] radial

    >>> oil = Hydrodynamic(viscosity=0.02, radius=0.025, length=0.05, clearance=2.5e-5)
    >>> round(oil.at(100.0).drag, 6)
    0.392699
    """

    law: Literal["hydrodynamic"] = "hydrodynamic"
    kinds: ClassVar[tuple[str, ...]] = ("R",)
    viscosity: Annotated[Number, Field(gt=0), in_unit("Pa s")]
    radius: Length
    length: Length
    clearance: Length

    @model_validator(mode="after")
    def _thin(self) -> Hydrodynamic:
        if self.clearance > THICKEST * self.radius:
            found = f'"clearance" {self.clearance:g} m is {self.clearance / self.radius:.3g} radii'
            valid = f"Petroff's equation is for films up to {THICKEST:g} of the radius"
            raise mistake("bad-friction", found, valid, "give the radial clearance in m")
        return self

    def kernel(self) -> Callable[..., FrictionTerms]:
        """`petroff`."""
        return petroff
