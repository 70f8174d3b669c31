"""The kinds of signal blocks; importing this module registers them."""

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
    "StateSpace",
    "Step",
    "Sum",
    "Table",
    "TransferFunction",
]
