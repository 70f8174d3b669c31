"""Planar mechanisms as block diagrams, solved module by module through Assur groups."""

from blockmech.blocks import RRR, Crank, Frame, SlideDrive
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
from blockmech.loads import Couple, Force, Spring
from blockmech.model.graph import Graph
from blockmech.model.laws_of_motion import (
    ConstantRate,
    Cycloidal,
    Harmonic,
    RateAcceleration,
    Table,
)
from blockmech.values import Link, Marker

__all__ = [
    "RRR",
    "AssemblyError",
    "BlockmechError",
    "ConstantRate",
    "Coulomb",
    "Couple",
    "Crank",
    "Cycloidal",
    "Force",
    "FormatError",
    "Frame",
    "FrictionError",
    "Graph",
    "GraphError",
    "Harmonic",
    "Link",
    "Marker",
    "MissingEngineError",
    "Problem",
    "RateAcceleration",
    "RequestError",
    "SingularError",
    "SlideDrive",
    "Spring",
    "Table",
    "version__",
]

__version__ = "0.1.0"
