"""Planar mechanisms as block diagrams, solved module by module through Assur groups.

Examples in docstrings begin with `numpy` as ``np`` and these:

>>> import blockmech as bm
>>> g = bm.read("graphs/ruiz_fourbar.json")  # a `Graph`
>>> m = bm.read("graphs/joints/slider_crank.json")  # a `Linkage`
>>> mech = g.compile()
>>> result = mech.run(at=[0.5, 1.0])
"""

from __future__ import annotations

from blockmech.ground import sigint as _sigint  # noqa: F401

# isort: split
from importlib import import_module
from typing import TYPE_CHECKING, Any

from blockmech.ground.memory import promote_to_oldest, uncollected

with uncollected():  # all that is made here is kept
    from blockmech import friction as friction
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
    from blockmech.ground.errors import (
        EVERYWHERE,
        AssemblyError,
        BlockmechError,
        FormatError,
        FrictionError,
        GraphError,
        MissingEngineError,
        Problem,
        RequestError,
        SingularError,
        close_match,
        elsewhere,
    )
    from blockmech.ground.values import Link, Marker
    from blockmech.loads import Couple, Force, Motor, Spring, Thrust, TorsionSpring, laws
    from blockmech.model import laws_of_motion as motion
    from blockmech.model.subgraph import Subgraph
    from blockmech.typing import FixedStep

    promote_to_oldest()

if TYPE_CHECKING:
    from blockmech import design, draw, synthesis
    from blockmech.couplings.kinds import Belt, Cam, Gear, Geneva, Rack, Ratio
    from blockmech.dynamics.motion_outputs import SimulationResult
    from blockmech.dynamics.request import Until, Watch
    from blockmech.editor import studio
    from blockmech.exchange.formats import write
    from blockmech.mechanism import Mechanism
    from blockmech.result.result import Result
    from blockmech.studies import distributions as dist

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
    "Couple",
    "Crank",
    "Cylinder",
    "FixedStep",
    "Force",
    "FormatError",
    "Frame",
    "FrictionError",
    "Gear",
    "GeneralGroup",
    "Geneva",
    "Graph",
    "GraphError",
    "Link",
    "Linkage",
    "Marker",
    "Mechanism",
    "MissingEngineError",
    "Motor",
    "Problem",
    "Rack",
    "Ratio",
    "RequestError",
    "Result",
    "SimulationResult",
    "SingularError",
    "SlideDrive",
    "Spring",
    "Subgraph",
    "Thrust",
    "TorsionSpring",
    "Until",
    "Watch",
    "__version__",
    "design",
    "dist",
    "draw",
    "friction",
    "laws",
    "motion",
    "read",
    "signals",
    "studio",
    "synthesis",
    "write",
]

__version__ = "0.2.0"

_NAMESPACES = {  # loaded when they are first asked for, as are the names below
    "design": "blockmech.design",
    "dist": "blockmech.studies.distributions",
    "draw": "blockmech.draw",
    "synthesis": "blockmech.synthesis",
}
_LATER = {
    **dict.fromkeys(
        ("Belt", "Cam", "Gear", "Geneva", "Rack", "Ratio"), "blockmech.couplings.kinds"
    ),
    "Mechanism": "blockmech.mechanism",
    "Result": "blockmech.result.result",
    "SimulationResult": "blockmech.dynamics.motion_outputs",
    "Until": "blockmech.dynamics.request",
    "Watch": "blockmech.dynamics.request",
    "studio": "blockmech.editor",
    "write": "blockmech.exchange.formats",
}


if not TYPE_CHECKING:  # which tells of names that are not there by itself

    def __getattr__(name: str) -> Any:
        if name in _NAMESPACES:
            return import_module(_NAMESPACES[name])
        if name in _LATER:
            return getattr(import_module(_LATER[name]), name)
        message = f"module 'blockmech' has no attribute {name!r}"
        if not name.startswith("_"):
            hint = elsewhere(name, EVERYWHERE)
            message += hint or f". {close_match(name, __all__)}".rstrip(". ")
        raise AttributeError(message, name=name)


def __dir__() -> list[str]:
    return __all__
