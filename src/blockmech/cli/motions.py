"""How a simulation went, as lines for people: events, what ended it, method and error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from blockmech.ground.units import shown_in

if TYPE_CHECKING:
    from blockmech.result.motion import Event
    from blockmech.result.result import Result

LINES = 8  # events shown
DIGITS = 12  # significant ones of a number


def motion_lines(result: Result) -> list[str]:
    """Lines about a simulation; none for another run."""
    motion = result.motion
    if motion is None:
        return []
    names = list(result.drivers)
    units = [result._unit_of_driver(name) for name in names]
    lines = [f"{e.kind} at {_state(e, names, units, result.units)}" for e in motion.events]
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"... {len(lines) - LINES} events more", lines[-1]]
    return [*lines, *motion.summary(units[0] if len(set(units)) == 1 else "rad or m")]


def _state(event: Event, names: list[str], units: list[str], outputs: tuple[str, ...]) -> str:
    parts = [f"{event.t:.{DIGITS}g} s"]
    for x, name, unit in zip(np.atleast_1d(event.q).tolist(), names, units, strict=True):
        factor, unit = shown_in(unit, outputs)
        parts.append(f"{name} = {factor * x:.{DIGITS}g} {unit}")
    return ", ".join(parts)
