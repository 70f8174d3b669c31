"""Loads that a machine has, as elements wired to markers; importing registers them."""

from blockmech.loads import laws
from blockmech.loads.contract import Element, Following, Terminal
from blockmech.loads.couple import Couple
from blockmech.loads.force import Force
from blockmech.loads.motor import Motor
from blockmech.loads.spring import Spring
from blockmech.loads.thrust import Thrust
from blockmech.loads.torsion_spring import TorsionSpring

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
