"""A general group as a triad: its platform, its legs, and the places of all its links.

Links that a driven pair joins (barrel and rod of a cylinder) are one body while the
driver stands, so a platform on three cylinders is a triad too: `Outline` says which
bodies there are, and `Outline.at` gives the triad at the drivers' coordinates. A leg is
the part of a body between its two pairs: a length, or the offset of a pin from a guide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import networkx as nx

from blockmech.blocks.general import GeneralGroup, InnerPair
from blockmech.modes.triad import Leg, Support, Triad, place_of
from blockmech.plane import cross, expi
from blockmech.typing import LinkPosition
from blockmech.values import Marker


class Side(NamedTuple):
    """One side of a pair on a body: place [m] and unit direction."""

    at: complex
    along: complex


@dataclass(frozen=True)
class LegBody:
    """The body of a leg, seen from its first link; the platform's side from the platform's.

    Attributes
    ----------
    kinds : letters of the outer pair and of the pair at the platform
    foot, head : the outer pair and the pair at the platform, on this body
    seat : the pair at the platform, on the platform
    """

    kinds: str
    foot: Side
    head: Side
    seat: Side

    def leg(self) -> Leg:
        """The leg as the platform sees it."""
        if self.kinds == "RR":
            return Leg.rr(self.seat.at, abs(self.head.at - self.foot.at))
        if self.kinds == "RP":
            offset = cross(self.head.along, self.foot.at - self.head.at)
            return Leg.rp(self.seat.at, self.seat.along, offset)
        return Leg.pr(self.seat.at, cross(self.foot.along, self.head.at - self.foot.at))

    def place(self, support: Support, o: complex, e: complex) -> LinkPosition:
        """Where the body is, at a pose of the platform."""
        p, u = place_of(support)
        pin = o + e * self.seat.at
        if self.kinds == "RR":
            turned = (pin - p) / (self.head.at - self.foot.at)
        elif self.kinds == "RP":
            turned = e * self.seat.along / self.head.along
        else:
            turned = u / self.foot.along
        turned /= abs(turned)
        if self.kinds == "PR":
            return LinkPosition(pin - turned * self.head.at, turned)
        return LinkPosition(p - turned * self.foot.at, turned)


@dataclass(frozen=True)
class TriadOfLinks:
    """The triad that a group is at given coordinates of its own drivers.

    Attributes
    ----------
    legs : their bodies
    bodies : links of the platform, then of each leg -> their places on the body
    """

    legs: tuple[LegBody, LegBody, LegBody]
    bodies: tuple[Mapping[str, LinkPosition], ...]

    @property
    def triad(self) -> Triad:
        """The legs as the platform sees them."""
        one, two, three = (body.leg() for body in self.legs)
        return Triad((one, two, three))

    def places(
        self, supports: Sequence[Support], o: complex, e: complex
    ) -> dict[str, LinkPosition]:
        """Link -> its place, at a pose of the platform [m, -]."""
        stands = [LinkPosition(o, e)]
        stands += [leg.place(s, o, e) for leg, s in zip(self.legs, supports, strict=True)]
        return {
            link: LinkPosition(body.o + body.e * on.o, body.e * on.e)
            for body, links in zip(stands, self.bodies, strict=True)
            for link, on in links.items()
        }


@dataclass(frozen=True)
class Outline:
    """Which bodies of a general group are the platform and the legs of a triad.

    Attributes
    ----------
    group : the block
    platform : links of the platform, the first is its frame
    legs : links of each leg
    joints : the outer joint of each leg
    seats : the pair of each leg at the platform
    """

    group: GeneralGroup
    platform: tuple[str, ...]
    legs: tuple[tuple[str, ...], ...]
    joints: tuple[str, ...]
    seats: tuple[str, ...]

    def at(self, q: Sequence[float] = ()) -> TriadOfLinks:
        """The triad at coordinates [rad or m] of the group's own drivers, in their order."""
        driven = dict(zip((joint.name for joint in self.group.driven), q, strict=True))
        bodies = tuple(self._body(links, driven) for links in (self.platform, *self.legs))
        found = []
        for n, (foot, seat) in enumerate(zip(self.joints, self.seats, strict=True), start=1):
            kinds = self.group.pairs[foot].type + self.group.pairs[seat].type
            outer, head = self._side(foot, bodies[n]), self._side(seat, bodies[n])
            found.append(LegBody(kinds, outer, head, self._side(seat, bodies[0])))
        one, two, three = found
        return TriadOfLinks((one, two, three), bodies)

    def _side(self, pair: str, body: Mapping[str, LinkPosition]) -> Side:
        sides = self.group.pairs[pair].sides
        link = next(name for name in sides if name in body)
        on, marker = body[link], sides[link]
        return Side(on.o + on.e * marker.at.z, on.e * marker.direction)

    def _body(self, links: Sequence[str], driven: Mapping[str, float]) -> dict[str, LinkPosition]:
        """Places of the links of one body in the frame of its first link."""
        found = {links[0]: LinkPosition(0j, 1 + 0j)}
        while len(found) < len(links):
            for name, q in driven.items():
                pair = self.group.pairs[name]
                i, j = pair.sides
                if (i in found) == (j in found) or not {i, j} <= set(links):
                    continue
                step = _step(pair.sides[i], pair.sides[j], pair.type, q)
                if i in found:
                    o, e = found[i]
                    found[j] = LinkPosition(o + e * step.o, e * step.e)
                else:
                    o, e = found[j]
                    back = e / step.e
                    found[i] = LinkPosition(o - back * step.o, back)
        return found


def outline(group: GeneralGroup) -> Outline | None:
    """The triad that a group is while its drivers stand; None if it is another group.

    None too for a leg with two guides, and a drive at an outer pair.
    """
    welds = [joint.name for joint in group.driven]
    if any(not isinstance(group.pairs[name], InnerPair) for name in welds):
        return None
    welded: nx.Graph[str] = nx.Graph()
    welded.add_nodes_from(group.link_names)
    welded.add_edges_from(tuple(group.pairs[name].sides) for name in welds)
    body_of: dict[str, str] = {}
    for part in nx.connected_components(welded):
        first = next(link for link in group.link_names if link in part)
        body_of |= dict.fromkeys(part, first)
    pairs = {
        name: [body_of[link] for link in pair.sides]
        for name, pair in group.pairs.items()
        if name not in welds
    }
    bodies = {
        first: tuple(link for link in group.link_names if body_of[link] == first)
        for first in group.link_names
        if body_of[first] == first
    }
    inner = {name: ends for name, ends in pairs.items() if len(ends) == 2}
    if len(bodies) != 4 or len(inner) != 3 or len(pairs) != 6:
        return None
    platform = next((b for b in bodies if all(b in ends for ends in inner.values())), None)
    if platform is None:
        return None
    legs, joints, seats = [], [], []
    for body in bodies:
        if body == platform:
            continue
        own = [name for name, ends in pairs.items() if body in ends]
        seat, *feet = sorted(own, key=lambda name: name not in inner)
        if len(feet) != 1 or feet[0] in inner:
            return None
        if group.pairs[feet[0]].type + group.pairs[seat].type == "PP":
            return None
        legs.append(bodies[body])
        joints.append(feet[0])
        seats.append(seat)
    return Outline(group, bodies[platform], tuple(legs), tuple(joints), tuple(seats))


def _step(first: Marker, second: Marker, kind: str, q: float) -> LinkPosition:
    """Place of the second link of a driven pair in the frame of the first."""
    if kind == "P":
        e = first.direction / second.direction
        return LinkPosition(first.at.z + q * first.direction - e * second.at.z, e)
    e = first.direction * expi(q) / second.direction
    return LinkPosition(first.at.z - e * second.at.z, e)
