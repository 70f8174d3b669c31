"""The joints of a document as pairs of two links, with the places of both.

A pin of m links is m - 1 pairs: of its first link with each other one. Which links the pairs
of a pin join is free as long as it has no friction, so pins are seated on the link that is
placed first (`reseat`); the motion is the same, and forces are sums.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import networkx as nx

from blockmech.assur.formation import reseat
from blockmech.assur.pairs import Pair, Side, axes
from blockmech.friction.laws import Coulomb
from blockmech.model.joints.contents import FRAME, GuideGiven
from blockmech.model.joints.linkage import Linkage


@dataclass(frozen=True)
class Connection(Pair):
    """A pair with the place of each of its links; of a pin of many links ``"joint.link"``.

    Attributes
    ----------
    at : (2,) [m] place on each link, in its frame
    along : (2,) [-] unit direction of the guide on each (P only)
    slider : which of the two carries the slider's point (P only)
    """

    at: tuple[complex, complex] = (0j, 0j)
    along: tuple[complex, complex] = (1 + 0j, 1 + 0j)
    slider: int = 1
    friction: Coulomb | None = None

    def on(self, link: str) -> complex:
        """Place [m] on one of the links."""
        return self.at[self.links.index(link)]

    def guide(self, link: str) -> complex:
        """Unit direction [-] of the guide on one of the links."""
        return self.along[self.links.index(link)]

    @property
    def owner(self) -> str:
        """The link that carries the slider's point."""
        return self.links[self.slider]


Connections: TypeAlias = Mapping[str, Connection]


def connections(linkage: Linkage, size: float) -> dict[str, Connection]:
    """All pairs of a document by name, sorted, with the axes that they share."""
    found: dict[str, Connection] = {}
    for name, joint in linkage.joints.items():
        first, *others = joint.links
        start, *ends = (place.z for place in joint.at)
        for link, end in zip(others, ends, strict=True):
            pair = name if len(others) == 1 else f"{name}.{link}"
            made = Connection(
                pair, first, link, joint.type, at=(start, end), friction=joint.friction
            )
            if isinstance(joint, GuideGiven):
                made = replace(made, along=joint.directions, slider=joint.slider)
            found[pair] = made
    axis = axes(
        (
            Side(c.name, link, c.kind, c.on(link) if c.kind == "R" else c.guide(link))
            for c in found.values()
            for link in c.links
        ),
        size,
    )
    return {name: replace(found[name], axis=axis[name]) for name in sorted(found)}


def size_of(linkage: Linkage) -> float:
    """A length [m] that says how large the mechanism is; 1 if all joints are in one point."""
    places: dict[str, list[complex]] = defaultdict(list)
    for joint in linkage.joints.values():
        for link, place in zip(joint.links, joint.at, strict=True):
            places[link].append(place.z)
    clouds = [*places.values(), [k.at[0] for name, k in linkage.links.items() if name != FRAME]]
    spans = [
        math.hypot(_span(z.real for z in cloud), _span(z.imag for z in cloud)) for cloud in clouds
    ]
    return max(spans, default=0.0) or 1.0


def _span(numbers: Iterable[float]) -> float:
    known = list(numbers)
    return max(known) - min(known) if known else 0.0


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


def seated(pairs: Connections, drivers: Collection[str]) -> Seated:
    """Seat every frictionless pin of three links and more on the link that is placed first."""
    on_axis: dict[str, list[Connection]] = defaultdict(list)
    for c in pairs.values():
        if c.kind == "R" and c.axis:
            on_axis[c.axis].append(c)
    free = {axis: pin for axis, pin in on_axis.items() if _is_smooth(pin)}
    if not free:
        return Seated(pairs, {})
    links = {link for c in pairs.values() for link in c.links} - {FRAME}
    loose = [c if c.axis in free else replace(c, axis="") for c in pairs.values()]
    after = {p.name: p.links for p in reseat(links, loose, (FRAME,), drivers)}
    moved = dict(pairs)
    sums: dict[str, tuple[tuple[str, bool], ...]] = {}
    for pin in free.values():
        if all(after[c.name] == c.links for c in pin):
            continue
        at = {link: c.on(link) for c in pin for link in c.links}
        new = [
            replace(c, first=a, second=b, at=(at[a], at[b]))
            for c in pin
            for a, b in (after[c.name],)
        ]
        moved.update({c.name: c for c in new})
        sums.update({c.name: _cut(c, pin, new) for c in pin})
    return Seated(moved, sums)


def _is_smooth(pin: list[Connection]) -> bool:
    """Whether a pin has no friction, one place only on each link, and is not on the frame."""
    if len(pin) < 2 or any(c.friction for c in pin) or all(FRAME in c.links for c in pin):
        return False
    places = {(link, c.on(link)) for c in pin for link in c.links}
    return len(places) == len({link for link, _ in places})


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
