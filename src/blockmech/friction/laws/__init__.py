"""The friction laws of pairs, one file each; importing registers them.

Each file names its source; rules 1 to 7 of a law are in `contract`.
"""

from blockmech.friction.laws.contract import LAWS, AnyFriction, FrictionLaw, FrictionTerms
from blockmech.friction.laws.coulomb import Coulomb, DryFriction
from blockmech.friction.laws.dahl import Dahl
from blockmech.friction.laws.elasto_plastic import ElastoPlastic
from blockmech.friction.laws.hydrodynamic import Hydrodynamic
from blockmech.friction.laws.lugre import LuGre
from blockmech.friction.laws.preload import Preload
from blockmech.friction.laws.rolling_bearing import RollingBearing
from blockmech.friction.laws.stiction import Stiction
from blockmech.friction.laws.stribeck import Stribeck
from blockmech.friction.laws.viscous import Viscous

__all__ = [
    "LAWS",
    "AnyFriction",
    "Coulomb",
    "Dahl",
    "DryFriction",
    "ElastoPlastic",
    "FrictionLaw",
    "FrictionTerms",
    "Hydrodynamic",
    "LuGre",
    "Preload",
    "RollingBearing",
    "Stiction",
    "Stribeck",
    "Viscous",
]
