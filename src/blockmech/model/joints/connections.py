"""The joints of a document as pairs of two links, with the places of both.

A pin of m links is m - 1 pairs: of its first link with each other one. Which links the pairs
of a pin join is free as long as it has no friction, so pins are seated on the link that is
placed first (`reseat`); the motion is the same, and forces are sums.
"""

from __future__ import annotations

import cmath
import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import networkx as nx

from blockmech.assur.formation import reseat
from blockmech.assur.pairs import Pair, Side
from blockmech.assur.pairs import axes as shared_axes
from blockmech.friction.laws import Coulomb
from blockmech.model.joints.contents import FRAME, GuideGiven
from blockmech.model.joints.linkage import Linkage


@dataclass(frozen=True)
class Connection:
    """A pair of two links with the place of each.

    Attributes
    ----------
    name : name of the joint; of a pin of three links and more ``"joint.link"``
    first, second : the two links
    at : (2,) [m] place on each, in its frame
    along : (2,) [-] unit direction of the guide on each (P only)
    slider : which of the two carries the slider's point (P only)
    """

    name: str
    kind: Literal["R", "P"]
    first: str
    second: str
    at: tuple[complex, complex]
    along: tuple[complex, complex] = (1 + 0j, 1 + 0j)
    slider: int = 1
    friction: Coulomb | None = None

    @property
    def links(self) -> tuple[str, str]:
        """Both links."""
        return self.first, self.second

    def on(self, link: str) -> complex:
        """Place [m] on one of the links."""
        return self.at[self.links.index(link)]

    def guide(self, link: str) -> complex:
        """Unit direction [-] of the guide on one of the links."""
        return self.along[self.links.index(link)]

    def other(self, link: str) -> str:
        """The link at the other side."""
        return self.second if link == self.first else self.first

    @property
    def owner(self) -> str:
        """The link that carries the slider's point."""
        return self.links[self.slider]


Connections: TypeAlias = Mapping[str, Connection]


def connections(linkage: Linkage) -> dict[str, Connection]:
    """All pairs of a document by name, sorted."""
    found: list[Connection] = []
    for name, joint in linkage.joints.items():
        first, *others = joint.links
        at_first, *at_others = (place.z for place in joint.at)
        if isinstance(joint, GuideGiven):
            found.append(
                Connection(
                    name,
                    "P",
                    first,
                    others[0],
                    (at_first, at_others[0]),
                    joint.directions,
                    joint.slider,
                    joint.friction,
                )
            )
            continue
        for link, at in zip(others, at_others, strict=True):
            pair = name if len(others) == 1 else f"{name}.{link}"
            found.append(
                Connection(pair, "R", first, link, (at_first, at), friction=joint.friction)
            )
    return {c.name: c for c in sorted(found, key=lambda c: c.name)}


def size_of(linkage: Linkage) -> float:
    """A length [m] that says how large the mechanism is; 1 if all joints are in one point."""
    arms: dict[str, list[complex]] = defaultdict(list)
    for joint in linkage.joints.values():
        for link, place in zip(joint.links, joint.at, strict=True):
            arms[link].append(place.z)
    spans = [math.hypot(_span(z.real for z in a), _span(z.imag for z in a)) for a in arms.values()]
    lengths = [link.at[0] for name, link in linkage.links.items() if name != FRAME]
    spans.append(math.hypot(_span(z.real for z in lengths), _span(z.imag for z in lengths)))
    return max(spans, default=0.0) or 1.0


def _span(numbers: Iterable[float]) -> float:
    known = list(numbers)
    return max(known) - min(known) if known else 0.0


# Pairs of one axis.


def axes(pairs: Connections, size: float) -> dict[str, str]:
    """Pair -> the axis that it has in common with others for good; see `shared_axes`."""
    sides = (
        Side(c.name, link, c.kind, c.on(link) if c.kind == "R" else c.guide(link))
        for c in pairs.values()
        for link in c.links
    )
    return shared_axes(sides, size)


def structural(pairs: Connections, axis: Mapping[str, str]) -> list[Pair]:
    """The pairs without geometry, for counting."""
    return [Pair(c.name, c.first, c.second, c.kind, axis[c.name]) for c in pairs.values()]


# Pins seated elsewhere.


@dataclass(frozen=True)
class Seated:
    """The pairs as the formation sequence takes them, and where those of the document went.

    Attributes
    ----------
    pairs : the pairs, sorted; those of frictionless pins of three links and more may join
        other links than in the document
    sums : pair of the document -> pairs whose forces add to its own, each with whether it
        counts the other way; only those that were seated elsewhere
    """

    pairs: Connections
    sums: Mapping[str, tuple[tuple[str, bool], ...]]


def seated(pairs: Connections, axis: Mapping[str, str], drivers: Collection[str]) -> Seated:
    """Seat every frictionless pin of three links and more on the link that is placed first."""
    on_axis: dict[str, list[Connection]] = defaultdict(list)
    for c in pairs.values():
        if c.kind == "R" and axis[c.name]:
            on_axis[axis[c.name]].append(c)
    free = {name: pin for name, pin in on_axis.items() if _is_smooth(pin)}
    if not free:
        return Seated(pairs, {})
    links = {link for c in pairs.values() for link in c.links} - {FRAME}
    loose = {c.name: axis[c.name] if axis[c.name] in free else "" for c in pairs.values()}
    before = [Pair(c.name, c.first, c.second, c.kind, loose[c.name]) for c in pairs.values()]
    after = {p.name: p for p in reseat(links, before, (FRAME,), drivers)}
    moved: dict[str, Connection] = dict(pairs)
    sums: dict[str, tuple[tuple[str, bool], ...]] = {}
    for pin in free.values():
        if all(after[c.name].links == c.links for c in pin):
            continue
        at = {link: c.on(link) for c in pin for link in c.links}
        new = [
            replace(c, first=p.first, second=p.second, at=(at[p.first], at[p.second]))
            for c in pin
            for p in (after[c.name],)
        ]
        moved.update({c.name: c for c in new})
        sums.update({c.name: _cut(c, pin, new) for c in pin})
    return Seated(moved, sums)


def _is_smooth(pin: list[Connection]) -> bool:
    """Whether a pin has no friction, one place only on each link, and is not on the frame."""
    if all(FRAME in c.links for c in pin):
        return False
    places: dict[str, set[complex]] = defaultdict(set)
    for c in pin:
        for link in c.links:
            places[link].add(c.on(link))
    one_place = all(len(at) == 1 for at in places.values())
    return one_place and len(pin) > 1 and not any(c.friction for c in pin)


def _cut(
    c: Connection, old: list[Connection], new: list[Connection]
) -> tuple[tuple[str, bool], ...]:
    """New pairs between the two sides of an old one that is cut; the direct one first."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(link for d in old for link in d.links)
    graph.add_edges_from(d.links for d in old if d.name != c.name)
    side = nx.node_connected_component(graph, c.first)
    crossing = [d for d in new if (d.first in side) != (d.second in side)]
    crossing.sort(key=lambda d: (set(d.links) != set(c.links), d.name))
    return tuple((d.name, d.first not in side) for d in crossing)


def angle_of(direction: complex) -> float:
    """Angle [rad] of a unit direction."""
    return cmath.phase(direction)
