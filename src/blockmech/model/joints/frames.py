"""Blocks from links and joints: their frames, parameters and assembly modes.

Lengths and offsets are computed from the places on the links, exactly as the document gives
them; only the assembly mode is read off the pose. A guide of the block points as that of the
document, but for a driven slide whose links are named the other way round: it is turned, so
that its coordinate is the document's. Links of general groups keep their frames.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from blockmech.assur.groups import Unit
from blockmech.model.joints.closing import CLOSED, Poses
from blockmech.model.joints.connections import Connection, Connections
from blockmech.plane import cross, dot

GENERAL = "group.general"
DEAD = 1e-12
"""[-] Margin (a squared sine) below which a pose does not tell the assembly mode: Newton finds
a pose at a dead centre to half the digits only."""


class Seat(NamedTuple):
    """Where a link of the document is in the graph."""

    block: str
    link: str
    o: complex = 0j  # [m] origin of the block's link frame, in the document's frame
    e: complex = 1 + 0j  # [-] its x axis

    def place(self, z: complex) -> complex:
        """A place [m] of the document's frame in that of the block."""
        return self.direction(z - self.o)

    def direction(self, d: complex) -> complex:
        """A vector of the document's frame in that of the block."""
        return d if self.e == 1 else d * self.e.conjugate()


class End(NamedTuple):
    """A pair of the document as a joint of the block."""

    joint: str
    later: str  # the link of the document on which the block reports its reaction
    turned: bool = False


@dataclass(frozen=True)
class Made:
    """A block made from links and joints.

    Attributes
    ----------
    type, keys : its type and its own parameters
    seats : link of the document -> its place in the block, the block's name left out
    ends : pair -> joint of the block
    points : (link, place in the document's frame) of the markers that it brings -> marker
    drivers : driven pairs
    """

    type: str
    keys: dict[str, Any]
    seats: Mapping[str, Seat]
    ends: Mapping[str, End]
    points: Mapping[tuple[str, complex], str]
    drivers: tuple[str, ...] = ()


class DeadCentre(Exception):
    """A pose does not tell the assembly mode of a group; says why."""


def driving_link(c: Connection, own: str, pairs: Connections) -> Made:
    """``driver.crank`` or ``driver.slide`` for a link that a driven pair places.

    A crank with a pin ahead of it on its x axis gets that length.
    """
    at, flipped = c.on(own), c.first == own
    if c.kind == "R":
        keys, points = dict[str, Any](), {(own, at): "A"}
        pins = [d.on(own) for d in pairs.values() if d.kind == "R" and own in d.links]
        ahead = [pin for pin in pins if (pin - at).imag == 0 and (pin - at).real > 0]
        if ahead:
            keys, points[own, ahead[0]] = {"length": (ahead[0] - at).real}, "B"
        return Made(
            "driver.crank",
            keys | ({"sign": -1} if flipped else {}),
            {own: Seat("", "crank", at)},
            {c.name: End("A", own)},
            points,
            (c.name,),
        )
    u = c.guide(own)
    return Made(
        "driver.slide",
        {} if c.owner == own else {"slider": "earlier"},
        {own: Seat("", "slider", at, -u if flipped else u)},
        {c.name: End("S", own, flipped)},
        {(own, at): "S"},
        (c.name,),
    )


def closed_form(unit: Unit, pairs: Connections, poses: Poses) -> Made | None:
    """The closed-form block of a group, None where there is none for it.

    Raises `DeadCentre` where the pose does not tell the assembly mode.
    """
    if unit.kind == "cylinder":
        return _cylinder(unit, pairs, poses)
    make = {"RRR": _rrr, "RRP": _rrp, "RPR": _rpr, "PRP": _prp, "RPP": _rpp}.get(unit.kind)
    if make is None:
        return None
    i, j = unit.links
    first, second = (pairs[p.name] for p in unit.outer)
    return make(i, j, first, pairs[unit.inner[0].name], second, poses)


def _branch(det: float, length: float, why: str) -> int:
    """+1 or -1, the sign of a determinant that is a sine or cosine times a length."""
    if not det * det > DEAD * length * length:
        raise DeadCentre(why)
    return 1 if det > 0 else -1


def _unit(z: complex) -> complex:
    return z / abs(z) if z else 1 + 0j


def _line(c: Connection, link: str, origin: complex) -> tuple[float, float]:
    """Place along a guide and offset from it [m] of its point on a link, from an origin."""
    arm = (c.on(link) - origin) * c.guide(link).conjugate()
    return arm.real, arm.imag


def _outer_owner(c: Connection, own: str) -> str:
    return "later" if c.owner == own else "earlier"


def _rrr(i: str, j: str, B: Connection, C: Connection, D: Connection, at: Poses) -> Made:
    arm_i, arm_j = C.on(i) - B.on(i), C.on(j) - D.on(j)
    b, d = at.point(i, B.on(i)), at.point(j, D.on(j))
    det = cross(d - b, at.direction(i, arm_i))
    branch = _branch(det, abs(arm_i) * abs(arm_j), f"{B.name}, {C.name}, {D.name} are in line")
    return Made(
        "dyad.rrr",
        {"l_i": abs(arm_i), "l_j": abs(arm_j), "branch": branch},
        {i: Seat("", "i", B.on(i), _unit(arm_i)), j: Seat("", "j", D.on(j), _unit(arm_j))},
        {B.name: End("B", i), C.name: End("C", j), D.name: End("D", j)},
        {(i, B.on(i)): "B", (i, C.on(i)): "C", (j, D.on(j)): "D", (j, C.on(j)): "Cj"},
    )


def _rrp(i: str, j: str, B: Connection, C: Connection, S: Connection, at: Poses) -> Made:
    arm, u = C.on(i) - B.on(i), S.guide(j)
    det = dot(at.direction(j, u), at.direction(i, arm))
    why = f"{B.name}{C.name} stands across the guide {S.name}"
    x_S, h = _line(S, j, C.on(j))
    keys: dict[str, Any] = {"l": abs(arm), "h": h, "branch": _branch(det, abs(arm), why)}
    return Made(
        "dyad.rrp",
        keys | _point(_outer_owner(S, j), x_S),
        {i: Seat("", "i", B.on(i), _unit(arm)), j: Seat("", "j", C.on(j), u)},
        {B.name: End("B", i), C.name: End("C", j), S.name: End("S", j)},
        {(i, B.on(i)): "B", (i, C.on(i)): "C", (j, C.on(j)): "Cj"},
    )


def _point(owner: str, x_S: float) -> dict[str, Any]:
    """The slider's point of a P joint that is the only one of its block."""
    return {"x_S": x_S} if owner == "later" else {"slider": owner}


def _rpr(i: str, j: str, B: Connection, S: Connection, D: Connection, at: Poses) -> Made:
    d = at.point(j, D.on(j)) - at.point(i, B.on(i))
    det = dot(at.direction(i, S.guide(i)), d)
    branch = _branch(det, abs(d), f"the guide {S.name} stands across {B.name} and {D.name}")
    (x_i, h_i), (x_j, h_j) = _line(S, i, B.on(i)), _line(S, j, D.on(j))
    keys: dict[str, Any] = {"h_i": h_i, "h_j": h_j, "branch": branch}
    keys |= {"x_S": x_j} if S.owner == j else {"x_S": x_i, "slider": "i"}
    return Made(
        "dyad.rpr",
        keys,
        {i: Seat("", "i", B.on(i), S.guide(i)), j: Seat("", "j", D.on(j), S.guide(j))},
        {B.name: End("B", i), S.name: End("S", j), D.name: End("D", j)},
        {(i, B.on(i)): "B", (j, D.on(j)): "D"},
    )


def _prp(i: str, j: str, S1: Connection, C: Connection, S2: Connection, at: Poses) -> Made:
    sine = cross(at.direction(i, S1.guide(i)), at.direction(j, S2.guide(j)))
    _branch(sine, 1.0, f"the guides {S1.name} and {S2.name} are parallel")
    (x_1, h_1), (x_2, h_2) = _line(S1, i, C.on(i)), _line(S2, j, C.on(j))
    keys: dict[str, Any] = {"h1": h_1, "h2": h_2, "x_S1": x_1, "x_S2": x_2}
    owners = {"S1": _outer_owner(S1, i), "S2": _outer_owner(S2, j)}
    return Made(
        "dyad.prp",
        keys | _owners(owners),
        {i: Seat("", "i", C.on(i), S1.guide(i)), j: Seat("", "j", C.on(j), S2.guide(j))},
        {S1.name: End("S1", i), C.name: End("C", j), S2.name: End("S2", j)},
        {(i, C.on(i)): "C", (j, C.on(j)): "Cj"},
    )


def _rpp(i: str, j: str, B: Connection, S1: Connection, S: Connection, at: Poses) -> Made:
    o = S.on(j)  # on the outer guide line, so that x_S is 0
    (x_i, h_i), (x_j, h_j) = _line(S1, i, B.on(i)), _line(S1, j, o)
    beta = cmath.phase(S1.guide(j) * S.guide(j).conjugate())
    own = S1.owner == j
    keys: dict[str, Any] = {"beta": beta, "h_i": h_i, "h_j": h_j, "x_S1": x_j if own else x_i}
    owners = {"S1": "later" if own else "i", "S": _outer_owner(S, j)}
    return Made(
        "dyad.rpp",
        keys | _owners(owners),
        {i: Seat("", "i", B.on(i), S1.guide(i)), j: Seat("", "j", o, S.guide(j))},
        {B.name: End("B", i), S1.name: End("S1", j), S.name: End("S", j)},
        {(i, B.on(i)): "B", (j, o): "O"},
    )


def _owners(owners: Mapping[str, str]) -> dict[str, Any]:
    said = {joint: owner for joint, owner in owners.items() if owner != "later"}
    return {"slider": said} if said else {}


def _cylinder(unit: Unit, pairs: Connections, at: Poses) -> Made | None:
    """``driven.rrr``, if the driven line goes through the pins of barrel and rod."""
    barrel, rod, j = unit.links
    S, C = sorted((pairs[p.name] for p in unit.inner), key=lambda c: c.kind != "P")
    outer = [pairs[p.name] for p in unit.outer]
    B, D = sorted(outer, key=lambda c: barrel not in c.links)
    b, c = at.point(barrel, B.on(barrel)), at.point(rod, C.on(rod))
    ahead = 1 if dot(at.direction(barrel, S.guide(barrel)), c - b) > 0 else -1
    (x_b, h_b), (x_r, h_r) = _line(S, barrel, B.on(barrel)), _line(S, rod, C.on(rod))
    if max(abs(h_b), abs(h_r)) > CLOSED * max(abs(x_b), abs(x_r), abs(c - b)):
        return None
    arm_j = C.on(j) - D.on(j)
    det = cross(at.point(j, D.on(j)) - b, c - b)
    why = f"{B.name}, {C.name}, {D.name} are in line"
    keys: dict[str, Any] = {"l_j": abs(arm_j)}
    keys["branch"] = _branch(det, abs(c - b) * abs(arm_j), why)
    own = S.owner == rod
    keys |= {"x_S": ahead * x_r} if own else {"x_S": ahead * x_b, "slider": "i"}
    keys["offset"] = ahead * (x_b - x_r) + 0.0  # no -0
    if (S.first == barrel) != (ahead > 0):
        keys["sign"] = -1
    return Made(
        "driven.rrr",
        keys,
        {
            barrel: Seat("", "barrel", B.on(barrel), ahead * S.guide(barrel)),
            rod: Seat("", "rod", C.on(rod), ahead * S.guide(rod)),
            j: Seat("", "j", D.on(j), _unit(arm_j)),
        },
        {
            B.name: End("B", barrel),
            S.name: End("S", rod, ahead < 0),
            C.name: End("C", j),
            D.name: End("D", j),
        },
        {
            (barrel, B.on(barrel)): "B",
            (rod, C.on(rod)): "C",
            (j, D.on(j)): "D",
            (j, C.on(j)): "Cj",
        },
        (S.name,),
    )


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
    data["at"] = [xy(z) for z in c.at]
    if c.kind == "P":
        data["angle"] = [cmath.phase(u) for u in c.along]
        data["slider"] = "j" if c.slider else "i"
    return data


def _outer(c: Connection, own: str, turned: bool) -> dict[str, Any]:
    data: dict[str, Any] = {"type": c.kind, "link": own, "at": xy(c.on(own))}
    if c.kind == "P":
        data["angle"] = cmath.phase(-c.guide(own) if turned else c.guide(own))
        data["slider"] = "later" if c.owner == own else "earlier"
    return data


def xy(z: complex) -> list[float]:
    """Two numbers as they stand in a file, without -0."""
    return [z.real + 0.0, z.imag + 0.0]


def free_name(wish: str, taken: set[str] | Mapping[str, Any]) -> str:
    """The wished name, with underscores behind it until it is free."""
    while wish in taken:
        wish += "_"
    return wish
