"""Signal blocks: controllers, filters, setpoints, motors."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from blockmech.signals.contract import Signal, State

if TYPE_CHECKING:
    from blockmech.signals.algebra import DeadZone, Gain, Product, Saturation, Sum
    from blockmech.signals.dynamic import (
        DCMotor,
        Delay,
        Integrator,
        Pid,
        StateSpace,
        TransferFunction,
    )
    from blockmech.signals.functions import Python
    from blockmech.signals.sources import Constant, Input, Step, Table

__all__ = [
    "Constant",
    "DCMotor",
    "DeadZone",
    "Delay",
    "Gain",
    "Input",
    "Integrator",
    "Pid",
    "Product",
    "Python",
    "Saturation",
    "Signal",
    "State",
    "StateSpace",
    "Step",
    "Sum",
    "Table",
    "TransferFunction",
]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in __all__:
            modules = import_module("blockmech.signals.kinds").MODULES
            return next(getattr(x, name) for x in modules if hasattr(x, name))
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
