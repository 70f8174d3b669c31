"""Planar mechanisms as block diagrams, solved module by module through Assur groups."""

from __future__ import annotations

from blockmech.ground import sigint as _sigint  # noqa: F401

# isort: split
from importlib import import_module
from typing import TYPE_CHECKING, Any

from blockmech.ground.garbage import grown_old, uncollected

with uncollected():  # all that is made here is kept
    from blockmech import signals as signals
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
    from blockmech.builders import Graph, Linkage, read
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
    from blockmech.ground.errors import (
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
    from blockmech.ground.values import Link, Marker
    from blockmech.loads import Couple, Force, Motor, Spring, Thrust, TorsionSpring, laws
    from blockmech.model.laws_of_motion import (
        ConstantRate,
        Cycloidal,
        Harmonic,
        RateAcceleration,
        Table,
    )
    from blockmech.model.subgraph import Subgraph
    from blockmech.studies.sampling import normal, uniform
    from blockmech.typing import Successive

    grown_old()

if TYPE_CHECKING:
    from blockmech import design, draw, studio, synthesis
    from blockmech.couplings.kinds import Belt, Cam, Gear, Geneva, Rack, Ratio
    from blockmech.design import shapes
    from blockmech.dynamics.motion_outputs import SimulationResult
    from blockmech.dynamics.request import Until, Watch
    from blockmech.exchange.writing import write
    from blockmech.mechanism import Mechanism
    from blockmech.result.result import Result

__all__ = [
    "PRP",
    "RPP",
    "RPR",
    "RRP",
    "RRR",
    "AssemblyError",
    "Belt",
    "BlockmechError",
    "Cam",
    "ConstantRate",
    "Coulomb",
    "Couple",
    "Crank",
    "Cycloidal",
    "Cylinder",
    "Dahl",
    "ElastoPlastic",
    "Force",
    "FormatError",
    "Frame",
    "FrictionError",
    "FrictionLaw",
    "Gear",
    "GeneralGroup",
    "Geneva",
    "Graph",
    "GraphError",
    "Harmonic",
    "Hydrodynamic",
    "Link",
    "Linkage",
    "LuGre",
    "Marker",
    "Mechanism",
    "MissingEngineError",
    "Motor",
    "Preload",
    "Problem",
    "Rack",
    "RateAcceleration",
    "Ratio",
    "RequestError",
    "Result",
    "RollingBearing",
    "SimulationResult",
    "SingularError",
    "SlideDrive",
    "Spring",
    "Stiction",
    "Stribeck",
    "Subgraph",
    "Successive",
    "Table",
    "Thrust",
    "TorsionSpring",
    "Until",
    "Viscous",
    "Watch",
    "__version__",
    "design",
    "draw",
    "laws",
    "normal",
    "read",
    "shapes",
    "signals",
    "studio",
    "synthesis",
    "uniform",
    "write",
]

__version__ = "0.1.0"

_LATER = {  # loaded when they are first asked for
    **dict.fromkeys(
        ("Belt", "Cam", "Gear", "Geneva", "Rack", "Ratio"), "blockmech.couplings.kinds"
    ),
    "Mechanism": "blockmech.mechanism",
    "Result": "blockmech.result.result",
    "SimulationResult": "blockmech.dynamics.motion_outputs",
    "Until": "blockmech.dynamics.request",
    "Watch": "blockmech.dynamics.request",
    "write": "blockmech.exchange.writing",
}


if not TYPE_CHECKING:  # which tells of names that are not there by itself

    def __getattr__(name: str) -> Any:
        if name in ("design", "draw", "studio", "synthesis"):
            return import_module(f"blockmech.{name}")
        if name == "shapes":
            return import_module("blockmech.design.shapes")
        if name in _LATER:
            return getattr(import_module(_LATER[name]), name)
        raise AttributeError(f"module 'blockmech' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
