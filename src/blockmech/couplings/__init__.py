"""Couplings: one driver's coordinate as a function of another's; importing registers them."""

from blockmech.couplings.contract import Coupling, Transmission
from blockmech.couplings.gear import Gear

__all__ = ["Coupling", "Gear", "Transmission"]
