"""``group.general`` from links and joints: any Assur group, in the user's own frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from blockmech.model.assur import Unit
from blockmech.model.joints.connections import Connection, Connections, angle_of
from blockmech.model.joints.frames import End, Made, Seat

GENERAL = "group.general"


def general_group(unit: Unit, pairs: Connections) -> Made:
    """The general block of a unit; its ``home`` and the drivers' names are added later.

    Links keep their frames. A driven pair of an outer link whose links the document names
    the other way round is turned (P), or counts with the opposite sign (R).
    """
    own = set(unit.links)
    taken = set(unit.links)
    data: dict[str, Any] = {}
    ends: dict[str, End] = {}
    points: dict[tuple[str, complex], str] = {}
    drivers: list[str] = []
    for p in sorted(unit.pairs, key=lambda p: p.name):
        c = pairs[p.name]
        name = free_name(c.name.replace(".", "_"), taken)
        taken.add(name)
        driven = c.name in unit.driven
        inner = c.first in own and c.second in own
        later = c.second if inner or c.second in own else c.first
        turned = driven and c.kind == "P" and later == c.first
        data[name] = _inner(c) if inner else _outer(c, later, turned)
        if driven:
            data[name]["driven"] = True
            if c.kind == "R" and later == c.first:
                data[name]["sign"] = -1
            drivers.append(c.name)
        ends[c.name] = End(name, later, turned)
        marked = c.first if inner else later
        points.setdefault((marked, c.on(marked)), name)
    seats = {link: Seat("", link) for link in unit.links}
    points.update({(link, 0j): link for link in unit.links})
    return Made(GENERAL, {"pairs": data}, seats, ends, points, tuple(drivers))


def _inner(c: Connection) -> dict[str, Any]:
    data: dict[str, Any] = {"type": c.kind, "links": list(c.links)}
    data["at"] = [_xy(z) for z in c.at]
    if c.kind == "P":
        data["angle"] = [angle_of(u) for u in c.along]
        data["slider"] = "j" if c.slider else "i"
    return data


def _outer(c: Connection, own: str, turned: bool) -> dict[str, Any]:
    data: dict[str, Any] = {"type": c.kind, "link": own, "at": _xy(c.on(own))}
    if c.kind == "P":
        data["angle"] = angle_of(-c.guide(own) if turned else c.guide(own))
        data["slider"] = "later" if c.owner == own else "earlier"
    return data


def _xy(z: complex) -> list[float]:
    return [z.real + 0.0, z.imag + 0.0]  # no -0


def free_name(wish: str, taken: set[str] | Mapping[str, Any]) -> str:
    """The wished name, with underscores behind it until it is free."""
    while wish in taken:
        wish += "_"
    return wish
