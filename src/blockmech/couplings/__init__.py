"""Couplings: one driver's coordinate as a function of another's; importing registers them."""

from blockmech.couplings.belt import Belt
from blockmech.couplings.cam import Cam
from blockmech.couplings.contract import Coupling, Meshing, Reading, Transmission
from blockmech.couplings.gear import Gear
from blockmech.couplings.geneva import Geneva
from blockmech.couplings.rack import Rack
from blockmech.couplings.ratio import Ratio

__all__ = [
    "Belt",
    "Cam",
    "Coupling",
    "Gear",
    "Geneva",
    "Meshing",
    "Rack",
    "Ratio",
    "Reading",
    "Transmission",
]
