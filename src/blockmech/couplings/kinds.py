"""The kinds of couplings; importing this module registers them."""

from blockmech.couplings.belt import Belt
from blockmech.couplings.cam import Cam
from blockmech.couplings.gear import Gear
from blockmech.couplings.geneva import Geneva
from blockmech.couplings.rack import Rack
from blockmech.couplings.ratio import Ratio

__all__ = [
    "Belt",
    "Cam",
    "Gear",
    "Geneva",
    "Rack",
    "Ratio",
]
