"""Numbers with units as people type them: 60deg, 60°, 300rpm, 50mm, 2kN.

Files are in SI units and radians; this is the border where people write others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

DEGREE = math.pi / 180
UNITS: Mapping[str, Mapping[str, float]] = {
    "rad": {"rad": 1.0, "deg": DEGREE, "°": DEGREE, "turns": math.tau, "turn": math.tau},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "in": 0.0254},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "rad/s": {"rad/s": 1.0, "deg/s": DEGREE, "°/s": DEGREE, "rpm": math.tau / 60},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2},
    "rad/s2": {"rad/s2": 1.0, "deg/s2": DEGREE, "°/s2": DEGREE},
    "m/s2": {"m/s2": 1.0, "mm/s2": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3, "t": 1e3},
    "kg m2": {"kg m2": 1.0, "kgm2": 1.0, "g mm2": 1e-9, "kg mm2": 1e-6, "kg cm2": 1e-4},
    "N": {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3},
    "N m": {"N m": 1.0, "Nm": 1.0, "kN m": 1e3, "kNm": 1e3, "N mm": 1e-3, "Nmm": 1e-3},
    "N/m": {"N/m": 1.0, "N/mm": 1e3, "kN/m": 1e3},
    "J": {"J": 1.0, "kJ": 1e3},
    "W": {"W": 1.0, "kW": 1e3},
}
"""SI unit -> what may stand behind a number of it, and what that is."""


def units_of(unit: str) -> Mapping[str, float]:
    """What may stand behind a number in an SI unit: nothing, itself, others of its kind."""
    return {"": 1.0, **UNITS.get(unit, {unit: 1.0} if unit else {})}


def number_in(text: str, units: Mapping[str, float]) -> float | None:
    """A number times the unit behind it; None for anything else, and for what is not finite."""
    word = text.strip().replace("\N{MINUS SIGN}", "-")
    for unit in sorted((u for u in units if word.endswith(u)), key=len, reverse=True):
        try:
            x = float(word.removesuffix(unit)) * units[unit]
        except ValueError:
            continue
        return x if math.isfinite(x) else None
    return None


def has_unit(text: str, units: Mapping[str, float]) -> bool:
    """Whether a unit stands behind a number."""
    return any(unit and text.strip().endswith(unit) for unit in units)
