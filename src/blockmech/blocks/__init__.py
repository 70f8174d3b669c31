"""The mechanics: one file a block, declarations and pure kernels.

Importing this package registers the built-in types.
"""

from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import AssurGroup, Block, DrivingLink
from blockmech.blocks.crank import Crank
from blockmech.blocks.cylinder import Cylinder
from blockmech.blocks.frame import Frame
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.prp import PRP
from blockmech.blocks.rpp import RPP
from blockmech.blocks.rpr import RPR
from blockmech.blocks.rrp import RRP
from blockmech.blocks.rrr import RRR
from blockmech.blocks.slide_drive import SlideDrive

__all__ = [
    "PRP",
    "REGISTRY",
    "RPP",
    "RPR",
    "RRP",
    "RRR",
    "AssurGroup",
    "Block",
    "Crank",
    "Cylinder",
    "DrivingLink",
    "Frame",
    "GeneralGroup",
    "SlideDrive",
]
