"""Blocks from links and joints: what the class of a block declares, read backwards.

A block's class says its links, joints and guide lines by names of parameters; here the
numbers are computed from the places on the links, exactly as the document gives them. Only the
assembly mode is read off the pose: it is the mode of the block that stands nearest. A guide of
the block points as that of the document, but for a driven slide whose links are named the
other way round: it is turned, so that its coordinate is the document's. Links of general
groups keep their frames.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, get_origin

from blockmech.assur.groups import DYADS, Unit
from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import AssurGroup, Joint
from blockmech.blocks.modes import branches, dyad_modes
from blockmech.ground.names import free_name
from blockmech.ground.plane import EPS, dot
from blockmech.ground.values import xy
from blockmech.model.joints.closing import CLOSED
from blockmech.model.joints.layout import Connection, Connections, LinkPlacement, Pose, Poses
from blockmech.model.joints.varied import phase, settled
from blockmech.typing import Complex, Data, Guide, Planars

GENERAL = "group.general"
DEAD = 64 * EPS
"""[-] Margin (a squared sine) below which a pose does not tell the assembly mode: rounding of the
supports and lengths is of this size, and Newton finds a pose there to half the digits only."""

CLEAR = 0.01
"""[-] Distance of a pose to the nearest mode, over that to the other one, from which Newton's
method is sure to go to the nearest: then the mode itself is the closed pose."""

DOUBTS: Mapping[str, str] = {
    "RRR": "{0}, {1}, {2} are in line",
    "RRP": "{0}{1} stands across the guide {2}",
    "RPR": "the guide {1} stands across {0} and {2}",
    "PRP": "the guides {0} and {2} are parallel",
    "RPP": "the guides {1} and {2} are parallel",
    "driven RRR": "{0}, {2}, {3} are in line",
}
"""Kind of block -> what its joints do at a dead centre."""


class End(NamedTuple):
    """A pair of the document as a joint of the block."""

    joint: str
    later: str  # the link of the document on which the block reports its reaction
    turned: bool = False


@dataclass(frozen=True)
class BlockDraft:
    """A block made from links and joints.

    Attributes
    ----------
    type, keys : its type and its own parameters
    seats : link of the document -> its place in the block, the block's name left out
    ends : pair -> joint of the block
    points : (link, place in the document's frame) of the markers that it brings -> marker
    drivers : driven pairs
    beyond : (pair, link) -> [m] how far along the block's guide the document's place on the link
        is from the block's; a length serves both links of a guide, so only one has its own
    doubt : why the pose does not tell the assembly mode, if it does not
    poses : the links in the mode of a dyad that was chosen; none where another may be meant
    """

    type: str
    keys: Data
    seats: Mapping[str, LinkPlacement]
    ends: Mapping[str, End]
    points: Mapping[tuple[str, complex], str]
    drivers: tuple[str, ...] = ()
    beyond: Mapping[tuple[str, str], float] = field(default_factory=dict)
    doubt: str = ""
    poses: Poses = field(default_factory=dict)


def driving_link(c: Connection, link: str, pairs: Connections) -> BlockDraft:
    """``driver.crank`` or ``driver.slide`` for a link that a driven pair places.

    A crank with a pin ahead of it on its x axis gets that length.
    """
    at, flipped = c.on(link), c.first == link
    if c.kind == "R":
        keys, points = dict[str, object](), {(link, at): "A"}
        pins = [d.on(link) for d in pairs.values() if d.kind == "R" and link in d.links]
        e = c.guide(link)
        arms = {pin: (pin - at) * e.conjugate() for pin in pins}
        on_axis = [pin for pin, arm in arms.items() if arm.imag == 0 and arm.real > 0]
        if on_axis:
            keys, points[link, on_axis[0]] = {"length": arms[on_axis[0]].real}, "B"
        return BlockDraft(
            "driver.crank",
            keys | ({"sign": -1} if flipped else {}),
            {link: LinkPlacement("", "crank", at, e)},
            {c.name: End("A", link)},
            points,
            (c.name,),
        )
    u = c.guide(link)
    return BlockDraft(
        "driver.slide",
        {} if c.owner == link else {"slider": "earlier"},
        {link: LinkPlacement("", "slider", at, -u if flipped else u)},
        {c.name: End("S", link, flipped)},
        {(link, at): "S"},
        (c.name,),
    )


def closed_form(
    unit: Unit, pairs: Connections, poses: Poses, plain: bool = False
) -> BlockDraft | None:
    """The closed-form block of a group; None where there is none for it.

    There is none for a cylinder whose driven line passes its pins. With
    ``plain`` no number varies.
    """
    if unit.kind not in (*DYADS, "cylinder"):
        return None
    cls = REGISTRY["driven.rrr" if unit.kind == "cylinder" else f"dyad.{unit.kind.lower()}"]
    link_of = dict(zip(cls.link_names, unit.links, strict=True))
    between = {frozenset(unit.links) & {*p.links}: pairs[p.name] for p in unit.pairs}
    at = {
        j: between[frozenset(link_of[a] for a in _links(joint))] for j, joint in cls.joints.items()
    }
    keys, seats, points = _seated(cls, link_of, at)
    sliding = [c for c in at.values() if c.name in unit.driven]
    reach, sense = 0.0, 1
    if sliding:  # barrel and rod point from pin to pin
        barrel, rod, _ = unit.links
        b, r = (poses[link].point(seats[link].o) for link in (barrel, rod))
        reach = dot(poses[barrel].direction(seats[barrel].e), r - b)
        sense = 1 if reach > 0 else -1
        seats |= {link: seats[link]._replace(e=sense * seats[link].e) for link in (barrel, rod)}
    feet = {  # of each guide line on a link: place of its point along it, and offset, as x + iy
        (joint, link): (c.on(link) - seats[link].o) * (sense * c.guide(link)).conjugate()
        for joint, c in at.items()
        for link in c.links
        if c.kind == "P" and link in seats
    }
    keys |= _lines(cls, at, seats, feet)
    for c in sliding:
        x, y = feet["S", barrel], feet["S", rod]
        off = x.imag, y.imag
        if off != settled(off) or max(map(abs, off)) > CLOSED * max(abs(x), abs(y), abs(reach)):
            return None
        keys["offset"] = x.real - y.real + 0.0  # no -0
        keys |= {"sign": -1} if (c.first == barrel) != (sense > 0) else {}
    beyond = {
        (at[j].name, link): foot.real - keys.get(cls.joints[j].lines[seats[link].link].along, 0.0)
        for (j, link), foot in feet.items()
    }
    ends = {
        c.name: End(joint, link_of[cls.joints[joint].later], c.kind == "P" and sense < 0)
        for joint, c in at.items()
    }
    numbers, stand, connections = (keys, seats, at) if plain else settled((keys, seats, at))
    branch, doubt, closed = _mode(cls.model_construct(**numbers), stand, connections, poses)
    drivers = tuple(c.name for c in sliding)
    return BlockDraft(
        cls.type_name, keys | branch, seats, ends, points, drivers, beyond, doubt, closed
    )


def _links(joint: Joint) -> list[str]:
    return [link for link in (joint.link, *joint.links) if link]


@cache
def _joints_on(cls: type[AssurGroup], link: str) -> list[Joint]:
    """Joints of a link of a block, outer ones first."""
    joints = [joint for joint in cls.joints.values() if link in _links(joint)]
    return sorted(joints, key=lambda joint: not joint.outer)


def _seated(
    cls: type[AssurGroup], link_of: Mapping[str, str], at: Mapping[str, Connection]
) -> tuple[Data, dict[str, LinkPlacement], dict[tuple[str, complex], str]]:
    """Lengths, frames and markers of the links.

    The origin is at the outer pin, else at the inner one, else at the outer slider's point; the
    x axis points along the outer guide, else along the inner one, else to the other pin.
    """
    keys = dict[str, Any]()
    seats = dict[str, LinkPlacement]()
    points = dict[tuple[str, complex], str]()
    for name, link in link_of.items():
        joints = _joints_on(cls, name)
        pins = [at[joint.name].on(link) for joint in joints if joint.kind == "R"]
        guides = [at[joint.name] for joint in joints if joint.kind == "P"]
        o, *rest = pins or [guides[0].on(link)]
        arm = rest[0] - o if rest else 0j
        e = guides[0].guide(link) if guides else arm / (abs(arm) or 1.0) or 1 + 0j
        seats[link] = LinkPlacement("", name, o, e)
        for marker, brought in cls.built_in.items():
            if brought.link == name:
                points[link, rest[0] if brought.along else o] = marker
                keys |= {brought.along: abs(arm)} if brought.along else {}
    return keys, seats, points


def _lines(
    cls: type[AssurGroup],
    at: Mapping[str, Connection],
    seats: Mapping[str, LinkPlacement],
    feet: Mapping[tuple[str, str], complex],
) -> Data:
    """Offsets and turns of the guide lines, and the sliders' points."""
    keys: Data = {}
    owners: dict[str, str] = {}
    for (name, link), foot in feet.items():
        c, joint, seat = at[name], cls.joints[name], seats[link]
        line = joint.lines[seat.link]
        if line.offset:
            keys[line.offset] = foot.imag
        if line.turn:
            keys[line.turn] = phase(c.guide(link) * seat.e.conjugate())
        if c.owner == link:
            keys[line.along] = foot.real + 0.0  # no -0
        elif seat.link == joint.later:
            owners[name] = "earlier" if joint.outer else "i"
    if owners:
        by_joint = get_origin(cls.model_fields["slider"].annotation) is dict
        keys["slider"] = owners if by_joint else next(iter(owners.values()))
    return keys


def _mode(
    block: AssurGroup,
    seats: Mapping[str, LinkPlacement],
    at: Mapping[str, Connection],
    poses: Poses,
) -> tuple[Data, str, Poses]:
    """The branch of the mode that stands nearest, or why the pose does not tell it; its poses."""
    supports: list[Complex] = []
    for name, c in at.items():
        joint = block.joints[name]
        if joint.outer:
            (link,) = {*c.links} - {*seats}
            origin, axis = poses[link].point(c.on(link)), poses[link].direction(c.guide(link))
            supports.append(origin if joint.kind == "R" else Guide(origin, axis))
    if block.driven:
        b, r, _ = (poses[link].point(seat.o) for link, seat in seats.items())
        supports.append(abs(r - b))
    directions = {seat.link: poses[link].direction(seat.e) for link, seat in seats.items()}
    modes = dyad_modes(block, supports)
    threshold = 0.0 if branches(block) == (None,) else DEAD  # one mode needs no pose that tells it
    if max((mode.margin for mode in modes), default=0.0) <= threshold:
        return {}, DOUBTS[block.kind].format(*(c.name for c in at.values())), {}
    away = [sum(abs(mode.links[link].e - e) for link, e in directions.items()) for mode in modes]
    nearest = modes[away.index(min(away))]
    closed: dict[str, Pose] = {}
    if not block.driven and min(away) < CLEAR * (max(away) if len(away) > 1 else 1.0):
        for link, seat in seats.items():
            o, e = nearest.links[seat.link]
            theta = poses[link].theta + cmath.phase(e * directions[seat.link].conjugate())
            closed[link] = Pose(o - seat.o * cmath.rect(1.0, theta), theta)
    return ({} if nearest.branch is None else {"branch": nearest.branch}), "", closed


def general_group(unit: Unit, pairs: Connections) -> BlockDraft:
    """The general block of a unit; its ``home`` and the drivers' names are added later.

    Links keep their frames. A driven pair of an outer link whose links the document names
    the other way round is turned (P), or counts with the opposite sign (R).
    """
    inside, used = set(unit.links), set(unit.links)
    data: Data = {}
    ends: dict[str, End] = {}
    points: dict[tuple[str, complex], str] = {}
    drivers: list[str] = []
    for p in sorted(unit.pairs, key=lambda p: p.name):
        c = pairs[p.name]
        name = free_name(c.name.replace(".", "_"), used)
        used.add(name)
        driven = c.name in unit.driven
        inner = c.first in inside and c.second in inside
        later = c.second if inner or c.second in inside else c.first
        turned = driven and c.kind == "P" and later == c.first
        data[name] = {"type": c.kind, "links": list(c.links), "at": [xy(z) for z in c.at]}
        guides: Planars = [phase(u) for u in c.along]
        owner = "j" if c.slider else "i"
        if not inner:
            data[name] = {"type": c.kind, "link": later, "at": xy(c.on(later))}
            guides = phase(-c.guide(later) if turned else c.guide(later))
            owner = "later" if c.owner == later else "earlier"
        if c.kind == "P":
            data[name] |= {"angle": guides, "slider": owner}
        if driven:
            data[name]["driven"] = True
            turn = c.turn if c.kind == "R" else 0.0
            if c.kind == "R" and later == c.first:
                data[name]["sign"], turn = -1, -turn
            if turn:
                data[name]["offset"] = -turn
            drivers.append(c.name)
        ends[c.name] = End(name, later, turned)
        marked = c.first if inner else later
        points.setdefault((marked, c.on(marked)), name)
    seats = {link: LinkPlacement("", link) for link in unit.links}
    points.update({(link, 0j): link for link in unit.links})
    return BlockDraft(GENERAL, {"pairs": data}, seats, ends, points, tuple(drivers))
