"""Friction of joints: the laws, and the solvers of a group's friction equations.

>>> import blockmech as bm
>>> crank = bm.Crank(length=2.0, friction={"A": bm.friction.Coulomb(coefficient=0.1, radius=0.01)})
"""

from blockmech.friction.laws import (
    Coulomb,
    Dahl,
    ElastoPlastic,
    FrictionLaw,
    Hydrodynamic,
    LuGre,
    Preload,
    RollingBearing,
    Stiction,
    Stribeck,
    Viscous,
)
from blockmech.typing import Successive

__all__ = [
    "Coulomb",
    "Dahl",
    "ElastoPlastic",
    "FrictionLaw",
    "Hydrodynamic",
    "LuGre",
    "Preload",
    "RollingBearing",
    "Stiction",
    "Stribeck",
    "Successive",
    "Viscous",
]
__dir__ = __all__.copy  # completion shows these alone
