"""Loads that a machine has, as elements wired to markers; importing registers them."""

from blockmech.loads import laws
from blockmech.loads.actuators import Motor, Thrust
from blockmech.loads.applied import Couple, Force
from blockmech.loads.contract import Element, Following, Terminal
from blockmech.loads.springs import Spring, TorsionSpring

__all__ = [
    "Couple",
    "Element",
    "Following",
    "Force",
    "Motor",
    "Spring",
    "Terminal",
    "Thrust",
    "TorsionSpring",
    "laws",
]
