"""How a simulation went, as lines for people: events, what ended it, method and error."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from blockmech.result.motion import Event
    from blockmech.result.result import Result

LINES = 8  # events shown
DIGITS = 12  # significant ones of a number


def motion_lines(result: Result, degrees: bool = False) -> list[str]:
    """Lines about a simulation; none for another run. ``degrees``: angles in deg."""
    motion = result.motion
    if motion is None:
        return []
    names = list(result.drivers)
    units = [result.unit_of_driver(name) for name in names]
    lines = [f"{e.kind} at {_state(e, names, units, degrees)}" for e in motion.events]
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"... {len(lines) - LINES} events more", lines[-1]]
    return [*lines, *motion.summary(units[0] if len(set(units)) == 1 else "rad or m")]


def _state(event: Event, names: list[str], units: list[str], degrees: bool) -> str:
    parts = [f"{event.t:.{DIGITS}g} s"]
    for x, name, unit in zip(np.atleast_1d(event.q).tolist(), names, units, strict=True):
        turned = degrees and unit == "rad"
        value = f"{math.degrees(x) if turned else x:.{DIGITS}g}"
        parts.append(f"{name} = {value} {'deg' if turned else unit}")
    return ", ".join(parts)
