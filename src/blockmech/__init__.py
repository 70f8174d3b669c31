"""Planar mechanisms as block diagrams, solved module by module through Assur groups."""

from blockmech import early as _early  # noqa: F401 (before all that takes time)
from blockmech.blocks import (
    PRP,
    RPP,
    RPR,
    RRP,
    RRR,
    Crank,
    Cylinder,
    Frame,
    GeneralGroup,
    SlideDrive,
)
from blockmech.builders import Graph, Linkage
from blockmech.errors import (
    AssemblyError,
    BlockmechError,
    FormatError,
    FrictionError,
    GraphError,
    MissingEngineError,
    Problem,
    RequestError,
    SingularError,
)
from blockmech.friction.laws import Coulomb
from blockmech.loads import Couple, Force, Motor, Spring, Thrust, TorsionSpring, laws
from blockmech.model.laws_of_motion import (
    ConstantRate,
    Cycloidal,
    Harmonic,
    RateAcceleration,
    Table,
)
from blockmech.values import Link, Marker

__all__ = [
    "PRP",
    "RPP",
    "RPR",
    "RRP",
    "RRR",
    "AssemblyError",
    "BlockmechError",
    "ConstantRate",
    "Coulomb",
    "Couple",
    "Crank",
    "Cycloidal",
    "Cylinder",
    "Force",
    "FormatError",
    "Frame",
    "FrictionError",
    "GeneralGroup",
    "Graph",
    "GraphError",
    "Harmonic",
    "Link",
    "Linkage",
    "Marker",
    "MissingEngineError",
    "Motor",
    "Problem",
    "RateAcceleration",
    "RequestError",
    "SingularError",
    "SlideDrive",
    "Spring",
    "Table",
    "Thrust",
    "TorsionSpring",
    "__version__",
    "laws",
]

__version__ = "0.1.0"
