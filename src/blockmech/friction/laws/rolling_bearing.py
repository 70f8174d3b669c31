r"""A rolling bearing, by the method of makers' catalogues: a part by the load, a part by the oil.

With the speed n [1/min], the oil's kinematic viscosity nu [mm2/s], the mean diameter dm [mm] and
the load P1 [N],

    M1 = f1 P1 dm  [N mm]
    M0 = 1e-7 f0 (nu n)^(2/3) dm^3 [N mm]  where nu n >= 2000,    160e-7 f0 dm^3 below

P1 is the reaction of the pin. At rest M1 + M0 holds the bearing, by the same numbers: catalogues
say nothing of starting, which takes up to twice as much.

Source: Palmgren, Grundlagen der Waelzlagertechnik, 3rd ed. 1964; the same in Harris & Kotzalas,
Essential Concepts of Bearing Technology, 5th ed. 2007, ch. 10, with tables of f0 and f1, and in
the catalogues of INA and FAG.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.ground.plane import always, power, where
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Length, NotNegative, Number, in_unit
from blockmech.typing import Parameters, Real

SLOW = 2000.0  # nu n [mm2/s/min], below which the oil's part does not depend on the speed
SLOW_PART = 160.0  # and what stands for (nu n)^(2/3) there
PER_MINUTE = 30.0 / math.pi * 1e6  # of viscosity times speed, from SI to mm2/s/min
OIL = 0.1  # 1e-7 N mm/mm3 in SI
TABLES: dict[str, tuple[float, float]] = {"f0": (0.3, 24.0), "f1": (0.0, 0.01)}


def palmgren(speed: Real, p: Parameters) -> FrictionTerms:
    """The load's part as a factor, the oil's as a drag."""
    fast = PER_MINUTE * p.viscosity * speed
    oil = where(fast < SLOW, SLOW_PART, power(fast, 2.0 / 3.0))
    dm = p.mean_diameter
    return FrictionTerms(p.f1 * dm, OIL * p.f0 * oil * (dm * dm * dm))


class RollingBearing(FrictionLaw):
    """A ball or roller bearing in a pin, radially loaded.

    mean_diameter : [m] of bore and outer diameter
    f1 : [-] factor of the load, e.g. 0.0006 of a deep groove ball bearing under a third of its
        static load rating
    f0 : [-] factor of the oil, by bearing type and lubrication, e.g. 1.5 to 2 of a deep groove
        ball bearing with grease or in an oil bath
    viscosity : [m2/s] kinematic viscosity of the oil, or of a grease's base oil, as it runs:
        20e-6 for 20 mm2/s

    >>> ball = RollingBearing(mean_diameter=0.05, f1=0.0006, f0=2.0, viscosity=20e-6)
    >>> [round(x, 6) for x in ball.at(100.0)]  # factor [m], drag [N m]
    [3e-05, 0.017862]
    """

    law: Literal["rolling_bearing"] = "rolling_bearing"
    kinds: ClassVar[tuple[str, ...]] = ("R",)
    mean_diameter: Length
    f1: NotNegative
    f0: NotNegative
    viscosity: Annotated[Number, Field(ge=0), in_unit("m2/s")]

    @model_validator(mode="after")
    def _in_the_tables(self) -> RollingBearing:
        for name, (low, high) in TABLES.items():
            x = getattr(self, name)
            if x and not low <= x <= high:
                valid = f"catalogue values are {low:g} to {high:g}; 0 omits this part"
                found = f'"{name}" {x:g} is outside all catalogues'
                raise mistake("bad-friction", found, valid, "take the value of your bearing type")
        return self

    @property
    def smooth(self) -> bool:
        """Not at the speed at which the oil's part begins to depend on it."""
        return not (self.f0 and self.viscosity)

    kernel = always(palmgren)
