"""Assembly modes: every pose in which a group closes, and how they connect."""

from blockmech.modes.closing import TriadMode, triad_modes
from blockmech.modes.connection import ArcEnd, Connections, ModeArc, connect
from blockmech.modes.dyad import DyadMode, dyad_modes
from blockmech.modes.triad import Leg, Triad

__all__ = [
    "ArcEnd",
    "Connections",
    "DyadMode",
    "Leg",
    "ModeArc",
    "Triad",
    "TriadMode",
    "connect",
    "dyad_modes",
    "triad_modes",
]
