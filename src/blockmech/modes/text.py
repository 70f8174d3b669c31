"""The modes of a mechanism as lines of text."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from blockmech.modes.arcs import GroupArc
from blockmech.modes.connection import DEAD, WHOLE, ArcEnd

if TYPE_CHECKING:
    from blockmech.modes.found import GroupMode, GroupModes, Modes

DEGREE = 180 / math.pi
TINY = 1e-12  # [rad or m] shown as zero


def lines(modes: Modes, degrees: bool) -> Iterator[str]:
    """All groups: modes by sample, then arcs."""
    for group in modes.groups:
        yield f"{group.group}  {group.kind}"
        if group.note:
            yield f"  {group.note}"
        for n, found in enumerate(group.samples):
            where = _where(modes, n, degrees)
            yield f"  {where}: {_count(found, group)}" if where else f"  {_count(found, group)}"
            for k, mode in enumerate(found, start=1):
                yield from _mode(k, mode, modes, degrees)
        if group.arcs:
            yield f"  along {modes.driver}.q:"
            yield from _arcs(group, modes, degrees)


def _where(modes: Modes, n: int, degrees: bool) -> str:
    places = []
    for driver, row in modes.drivers.items():
        unit = modes.units[driver]
        places.append(f"{driver}.q = {_coordinate(row[n], unit, degrees)}")
    return ", ".join(places)


def _count(found: tuple[GroupMode, ...], group: GroupModes) -> str:
    if not found:
        told = group.arcs or not group.note or any(group.samples)
        return "no mode: it cannot close" if told else "none listed"
    return f"{len(found)} mode{'s' if len(found) > 1 else ''}"


def _mode(number: int, mode: GroupMode, modes: Modes, degrees: bool) -> Iterator[str]:
    unit = DEGREE if degrees else 1.0
    angles = ", ".join(
        f"{link} {pose[2] * unit:.6g} {'deg' if degrees else 'rad'}"
        for link, pose in mode.links.items()
    )
    said = f"margin {mode.margin:.4g}"
    said += ", double: a dead centre" if mode.double else ""
    if mode.arc is not None:
        said += f", arc {mode.arc + 1}"
    if mode.reach is not None:
        low, high = (_coordinate(q, modes.units[modes.driver], degrees) for q in mode.reach)
        said += f" (here from {low} to {high})"
    if mode.after_turn not in (None, number - 1):
        said += f", after a turn it is mode {(mode.after_turn or 0) + 1}"
    said += ", the file's" if mode.chosen else ""
    yield f"    {number}  {angles}; {said}"
    if mode.put:
        yield f"       {json.dumps(mode.put)[1:-1]}"


def _arcs(group: GroupModes, modes: Modes, degrees: bool) -> Iterator[str]:
    for n, arc in enumerate(group.arcs, start=1):
        branch = "" if arc.branch is None else f" (branch {arc.branch:+d})"
        yield f"    arc {n}{branch}: {_span(arc, modes.units[modes.driver], degrees)}"
        for q in arc.change_points:
            yield f"      change point at {_coordinate(q, modes.units[modes.driver], degrees)}"


def _span(arc: GroupArc, unit: str, degrees: bool) -> str:
    if arc.start.how == WHOLE:
        turns = "turn" if arc.turns == 1 else f"{arc.turns} turns"
        return (
            f"the whole turn, back to itself after {'a' if arc.turns == 1 else ''} {turns}".replace(
                "  ", " "
            )
        )
    return f"from {_end(arc.start, unit, degrees)} to {_end(arc.end, unit, degrees)}"


def _end(end: ArcEnd, unit: str, degrees: bool) -> str:
    how = end.how if end.how != DEAD or end.other is None else f"merges with arc {end.other + 1}"
    return f"{_coordinate(end.q, unit, degrees)} ({how})"


def _coordinate(q: float, unit: str, degrees: bool) -> str:
    q = q if abs(q) > TINY else 0.0
    if degrees and unit == "rad":
        return f"{q * DEGREE:.9g} deg"
    return f"{q:.9g} {unit}"
