"""A general group as a triad: its platform, its legs, and the places of all its links.

Links that a driven pair joins (barrel and rod of a cylinder) are one body while the
driver stands, so a platform on three cylinders is a triad too: `Outline` says which
bodies there are, and `Outline.at` gives the triad at the drivers' coordinates. A leg is
the part of a body between its two pairs: a length, or the offset of a pin from a guide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from blockmech.assur.groups import classify
from blockmech.blocks.general import GeneralGroup, InnerPair
from blockmech.blocks.general.block import SUPPORTS
from blockmech.ground.plane import cross
from blockmech.modes.triad import LegKind, Support, Triad
from blockmech.typing import Guide, LinkPosition, Real, Reals, Record

Body = Mapping[str, LinkPosition]
"""Links of one body -> their places in the frame of the first."""


class LegBody(NamedTuple):
    """The body of a leg: places [m] and directions of its pairs."""

    kind: LegKind
    foot: LinkPosition  # its outer pair, on the body
    head: LinkPosition  # its pair at the platform, on the body
    seat: LinkPosition  # the same on the platform

    def reach(self) -> Real:
        """Its length, or the offset of its pin from the guide [m]."""
        arm = self.head.o - self.foot.o
        if self.kind == "RR":
            return abs(arm)
        return cross(self.head.e, -arm) if self.kind == "RP" else cross(self.foot.e, arm)

    def place(self, support: Support, o: complex, e: complex) -> LinkPosition:
        """Where the body is, at a pose of the platform."""
        pin = o + e * self.seat.o
        if isinstance(support, Guide):
            turned = support.u / self.foot.e
            return LinkPosition(pin - turned * self.head.o, turned)
        if self.kind == "RP":
            turned = e * self.seat.e / self.head.e
        else:
            turned = (pin - support) / (self.head.o - self.foot.o)
        turned /= abs(turned)
        return LinkPosition(support - turned * self.foot.o, turned)


class TriadOfLinks(NamedTuple):
    """The triad that a group is at given coordinates of its own drivers."""

    legs: tuple[LegBody, ...]
    bodies: tuple[Body, ...]  # the platform, then each leg

    @property
    def triad(self) -> Triad:
        """The legs as the platform sees them."""
        numbers = zip(*((leg.seat.o, leg.reach(), leg.seat.e) for leg in self.legs), strict=True)
        columns = (np.stack(np.broadcast_arrays(*row), axis=-1) for row in numbers)
        return Triad([leg.kind for leg in self.legs], *columns)

    def places(
        self, supports: Sequence[Support], o: complex, e: complex
    ) -> dict[str, LinkPosition]:
        """Link -> its place, at a pose of the platform [m, -]."""
        bodies = [LinkPosition(o, e)]
        bodies += [leg.place(s, o, e) for leg, s in zip(self.legs, supports, strict=True)]
        return {
            link: LinkPosition(body.o + body.e * on.o, body.e * on.e)
            for body, links in zip(bodies, self.bodies, strict=True)
            for link, on in links.items()
        }


@dataclass(frozen=True)
class Outline:
    """Which links of a general group are the platform and the legs of a triad."""

    group: GeneralGroup
    welded: nx.Graph[str]  # its links, joined by driven pairs
    platform: str  # the first link of the platform, which is its frame
    legs: tuple[str, ...]  # the first link of each
    joints: tuple[str, ...]  # the outer joint of each leg
    seats: tuple[str, ...]  # the pair of each leg at the platform

    def at(self, q: Reals = ()) -> TriadOfLinks:
        """The triad at coordinates [rad or m] of the group's own drivers; floats or (n,)."""
        driven = dict(zip((joint.name for joint in self.group.driven), q, strict=True))
        bodies = tuple(self._body(first, driven) for first in (self.platform, *self.legs))
        legs = []
        for body, foot, seat in zip(bodies[1:], self.joints, self.seats, strict=True):
            kind: Any = self.group.pairs[foot].type + self.group.pairs[seat].type
            sides = self._side(foot, body), self._side(seat, body), self._side(seat, bodies[0])
            legs.append(LegBody(kind, *sides))
        return TriadOfLinks(tuple(legs), bodies)

    def _side(self, pair: str, body: Body) -> LinkPosition:
        link, marker = next(
            side for side in self.group.pairs[pair].sides.items() if side[0] in body
        )
        on = body[link]
        return LinkPosition(on.o + on.e * marker.at.z, on.e * marker.direction)

    def _body(self, first: str, driven: Record) -> Body:
        """The links of one body, each seen over a driven pair from one already placed."""
        positions = {first: LinkPosition(0j, 1 + 0j)}
        for placed, link in nx.bfs_edges(self.welded, first):
            name = self.welded.edges[placed, link]["pair"]
            pair, q = self.group.pairs[name], driven[name]
            (i, first_side), (_, second_side) = pair.sides.items()
            e = first_side.direction / second_side.direction
            e = e * np.exp(1j * q) if pair.type == "R" else e
            pivot = first_side.at.z + (q * first_side.direction if pair.type == "P" else 0.0)
            o = pivot - e * second_side.at.z  # of the second link in the frame of the first
            if link == i:
                o, e = -o / e, 1 / e
            on = positions[placed]
            positions[link] = LinkPosition(on.o + on.e * o, on.e * e)
        return positions


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
    body_of = {SUPPORTS: SUPPORTS} | {
        link: min(part, key=group.link_names.index)
        for part in nx.connected_components(welded)
        for link in part
    }
    pairs = [
        replace(p, first=body_of[p.first], second=body_of[p.second])
        for p in group.structural
        if p.name not in welds
    ]
    unit = classify({*body_of.values()} - {SUPPORTS}, pairs)
    if unit.kind != "triad":
        return None
    platform, *legs = unit.links
    legs.sort(key=group.link_names.index)
    feet, seats = (
        [next(p for p in pairs if leg in p.links) for leg in legs]
        for pairs in (unit.outer, unit.inner)
    )
    if any(foot.kind == seat.kind == "P" for foot, seat in zip(feet, seats, strict=True)):
        return None
    joints, ends = (tuple(p.name for p in pairs) for pairs in (feet, seats))
    return Outline(group, welded, platform, tuple(legs), joints, ends)
