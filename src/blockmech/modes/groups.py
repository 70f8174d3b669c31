"""A general group as a triad: its platform, its legs, and the places of all its links.

Links that a driven pair joins (barrel and rod of a cylinder) are one body while the
driver stands, so a platform on three cylinders is a triad too: `Outline` says which
bodies there are, and `Outline.at` gives the triad at the drivers' coordinates. A leg is
the part of a body between its two pairs: a length, or the offset of a pin from a guide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from blockmech.blocks.general import GeneralGroup, InnerPair
from blockmech.modes.triad import Leg, LegKind, Support, Triad, place_of
from blockmech.plane import cross
from blockmech.typing import LinkPosition

Body = Mapping[str, LinkPosition]
"""Links of one body -> their places in the frame of the first."""


class Side(NamedTuple):
    """One side of a pair on a body: place [m] and unit direction."""

    at: Any
    along: Any


class LegBody(NamedTuple):
    """The body of a leg: its outer pair, and both sides of its pair at the platform."""

    kind: LegKind
    foot: Side
    head: Side
    seat: Side  # on the platform

    def leg(self) -> Leg:
        """The leg as the platform sees it."""
        arm = self.head.at - self.foot.at
        if self.kind == "RR":
            return Leg("RR", self.seat.at, abs(arm))
        if self.kind == "RP":
            return Leg("RP", self.seat.at, cross(self.head.along, -arm), self.seat.along)
        return Leg("PR", self.seat.at, cross(self.foot.along, arm))

    def place(self, support: Support, o: complex, e: complex) -> LinkPosition:
        """Where the body is, at a pose of the platform."""
        p, u = place_of(support)
        pin = o + e * self.seat.at
        if self.kind == "RR":
            turned = (pin - p) / (self.head.at - self.foot.at)
        elif self.kind == "RP":
            turned = e * self.seat.along / self.head.along
        else:
            turned = u / self.foot.along
        turned /= abs(turned)
        at = pin - turned * self.head.at if self.kind == "PR" else p - turned * self.foot.at
        return LinkPosition(at, turned)


@dataclass(frozen=True)
class TriadOfLinks:
    """The triad that a group is at given coordinates of its own drivers.

    Attributes
    ----------
    legs : their bodies
    bodies : the platform, then each leg
    """

    legs: tuple[LegBody, ...]
    bodies: tuple[Body, ...]

    @property
    def triad(self) -> Triad:
        """The legs as the platform sees them."""
        return Triad(tuple(body.leg() for body in self.legs))

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
    """Which links of a general group are the platform and the legs of a triad.

    Attributes
    ----------
    group : the block
    welded : its links, joined by driven pairs
    platform : the first link of the platform, which is its frame
    legs : the first link of each leg
    joints : the outer joint of each leg
    seats : the pair of each leg at the platform
    """

    group: GeneralGroup
    welded: nx.Graph[str]
    platform: str
    legs: tuple[str, ...]
    joints: tuple[str, ...]
    seats: tuple[str, ...]

    def at(self, q: Sequence[Any] = ()) -> TriadOfLinks:
        """The triad at coordinates [rad or m] of the group's own drivers; floats or (n,)."""
        driven = dict(zip((joint.name for joint in self.group.driven), q, strict=True))
        bodies = tuple(self._body(first, driven) for first in (self.platform, *self.legs))
        legs = []
        for body, foot, seat in zip(bodies[1:], self.joints, self.seats, strict=True):
            kind: Any = self.group.pairs[foot].type + self.group.pairs[seat].type
            sides = self._side(foot, body), self._side(seat, body), self._side(seat, bodies[0])
            legs.append(LegBody(kind, *sides))
        return TriadOfLinks(tuple(legs), bodies)

    def _side(self, pair: str, body: Body) -> Side:
        link, marker = next(
            side for side in self.group.pairs[pair].sides.items() if side[0] in body
        )
        on = body[link]
        return Side(on.o + on.e * marker.at.z, on.e * marker.direction)

    def _body(self, first: str, driven: Mapping[str, Any]) -> Body:
        """The links of one body, each seen over a driven pair from one already placed."""
        found = {first: LinkPosition(0j, 1 + 0j)}
        for known, link in nx.bfs_edges(self.welded, first):
            name = self.welded.edges[known, link]["pair"]
            pair, q = self.group.pairs[name], driven[name]
            (i, one), (_, other) = pair.sides.items()
            e = one.direction / other.direction
            e = e * np.exp(1j * q) if pair.type == "R" else e
            along = one.at.z + (q * one.direction if pair.type == "P" else 0.0)
            o = along - e * other.at.z  # of the second link in the frame of the first
            if link == i:
                o, e = -o / e, 1 / e
            on = found[known]
            found[link] = LinkPosition(on.o + on.e * o, on.e * e)
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
    welded.add_edges_from((*group.pairs[name].sides, {"pair": name}) for name in welds)
    body_of = {
        link: min(part, key=group.link_names.index)
        for part in nx.connected_components(welded)
        for link in part
    }
    pairs = {
        name: [body_of[link] for link in pair.sides]
        for name, pair in group.pairs.items()
        if name not in welds
    }
    seats = {name: ends for name, ends in pairs.items() if len(ends) == 2}
    platform = set.intersection(*map(set, seats.values())) if seats else set()
    feet = {ends[0]: name for name, ends in pairs.items() if len(ends) == 1}
    bodies = list(dict.fromkeys(body_of[link] for link in group.link_names))
    if len(bodies) != 4 or len(pairs) != 6 or len(seats) != 3 or len(platform) != 1:
        return None
    (center,) = platform
    legs = [body for body in bodies if body != center]
    seat_of = {body: name for name, ends in seats.items() for body in ends if body != center}
    if set(feet) != set(legs) or set(seat_of) != set(legs):
        return None
    found = Outline(
        group,
        welded,
        center,
        tuple(legs),
        tuple(feet[body] for body in legs),
        tuple(seat_of[body] for body in legs),
    )
    kinds = zip(found.joints, found.seats, strict=True)
    twice = any(group.pairs[a].type + group.pairs[b].type == "PP" for a, b in kinds)
    return None if twice else found
