"""Loads that a machine has, as elements wired to markers; importing registers them."""

from blockmech.loads.contract import Element, Terminal
from blockmech.loads.couple import Couple
from blockmech.loads.force import Force
from blockmech.loads.spring import Spring

__all__ = ["Couple", "Element", "Force", "Spring", "Terminal"]
