"""A document as counting and closing see it: links in poses, and pairs of two links.

A pin of m links is m - 1 pairs: of its first link with each other one. Which links the pairs
of a pin join is free as long as it has no friction, so pins are seated on the link that is
placed first (`seated`); the motion is the same, and forces are sums.
"""

from __future__ import annotations

import cmath
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.assur.formation import reseat
from blockmech.assur.groups import Pair, Side, axes, joined
from blockmech.friction.laws.contract import FrictionLaw
from blockmech.ground.errors import GraphError, Problem, path_text
from blockmech.model.joints.contents import FRAME, GuideGiven, WeldGiven
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.varied import phase, settled
from blockmech.typing import Complex


class Pose(NamedTuple):
    """Place [m] and angle [rad] of a link."""

    o: complex = 0j
    theta: float = 0.0

    def point(self, at: complex) -> complex:
        """Place [m] in ground axes of a place on the link."""
        return self.o + self.direction(at)

    def direction(self, d: complex) -> complex:
        """A vector of the link's frame in ground axes."""
        return d * cmath.rect(1.0, self.theta)


class LinkPlacement(NamedTuple):
    """Where a link of the document is: in a block of the graph, or on the link that carries it."""

    block: str
    link: str
    o: complex = 0j  # [m] origin of that link's frame, in the document's frame
    e: complex = 1 + 0j  # [-] its x axis

    def place(self, z: complex) -> complex:
        """A place [m] of the document's frame in that of the other link."""
        return self.direction(z - self.o)

    def direction(self, d: complex) -> complex:
        """A vector of the document's frame in that of the other link."""
        return d if self.e == 1 else d * self.e.conjugate()

    def inverse(self, link: str) -> LinkPlacement:
        """The placement of that other link on this one, whose name is given."""
        if self.e == 1:
            return LinkPlacement("", link, -self.o)
        return LinkPlacement("", link, -self.o * self.e.conjugate(), self.e.conjugate())

    def on(self, seat: LinkPlacement) -> LinkPlacement:
        """The placement on the link that carries the link which this one is on."""
        if self.e == 1:
            return LinkPlacement(seat.block, seat.link, self.o + seat.o, seat.e)
        return LinkPlacement(seat.block, seat.link, self.o + self.e * seat.o, self.e * seat.e)


@dataclass(frozen=True)
class Connection(Pair):
    """A pair with the place of each of its links; of a pin of many links ``"joint.link"``.

    Its links are those that carry the links of the document.

    Attributes
    ----------
    ends : (2,) the links of the document
    at : (2,) [m] place on each link, in its frame
    along : (2,) [-] unit direction on each: of the guide (P), or of the document's link (R)
    slider : which of the two carries the slider's point (P only)
    """

    ends: tuple[str, str] = ("", "")
    at: tuple[complex, complex] = (0j, 0j)
    along: tuple[complex, complex] = (1 + 0j, 1 + 0j)
    slider: int = 1
    friction: FrictionLaw | None = None
    clearance: float | None = None

    def on(self, link: str) -> complex:
        """Place [m] on one of the links."""
        return self.at[self.links.index(link)]

    def guide(self, link: str) -> complex:
        """Unit direction [-] on one of the links."""
        return self.along[self.links.index(link)]

    @property
    def turn(self) -> Complex:
        """Angle [rad] of the second direction less that of the first, each in its link's frame."""
        first, second = self.along
        return 0.0 if first == second else phase(second * first.conjugate())

    @property
    def owner(self) -> str:
        """The link that carries the slider's point."""
        return self.links[self.slider]


Connections: TypeAlias = Mapping[str, Connection]
Poses: TypeAlias = Mapping[str, Pose]
"""Where the links are, the fixed one among them."""


@dataclass(frozen=True)
class Layout:
    """Links, pairs and drivers of a document.

    Attributes
    ----------
    links : the moving links, by name; of links that are welded together the first
    welds : welded link -> its placement on the link that carries it, which is one of ``links``
        or the frame; carriers are on themselves
    given : the poses that the document gives
    pairs : the joints two by two, sorted, with the axes that they share
    drivers : driven pair -> driver
    size : a length [m] that says how large the mechanism is; 1 if all is in one point
    """

    links: tuple[str, ...]
    welds: Mapping[str, LinkPlacement]
    given: Poses
    pairs: Connections
    drivers: Mapping[str, str]
    size: float

    @classmethod
    def of(cls, linkage: Linkage) -> Layout:
        """The layout of a document. Raises `GraphError` for welds that say too much."""
        welds = _welds_of(linkage)
        links = tuple(name for name in sorted(linkage.links) if welds[name].link == name != FRAME)
        poses = {FRAME: Pose()} | {name: Pose(*linkage.links[name].at) for name in links}
        movable = [name for name, x in linkage.joints.items() if not isinstance(x, WeldGiven)]
        pairs = {c.name: c for name in movable for c in _pairs_of(linkage, name, welds)}
        if stiff := [c for c in pairs.values() if c.first == c.second]:
            raise GraphError(_stiff(c.name, *c.ends) for c in stiff)
        points: dict[str, list[complex]] = defaultdict(list)
        for name in links:
            points[""].append(poses[name].o)
        at_hand: Connections = settled(pairs)
        for c in at_hand.values():
            for link, at in zip(c.links, c.at, strict=True):
                points[link].append(at)
        spans = [
            [max(x) - min(x) for x in ([z.real for z in at], [z.imag for z in at])]
            for at in points.values()
        ]
        with np.errstate(over="ignore"):
            size = float(np.hypot(*np.reshape(spans, (-1, 2)).T).max(initial=0.0)) or 1.0
        axis = axes(
            (
                Side(c.name, link, c.kind, c.on(link) if c.kind == "R" else c.guide(link))
                for c in at_hand.values()
                for link in c.links
            ),
            size,
        )
        shared = {
            name: replace(c, axis=axis[name]) if axis[name] else c
            for name, c in sorted(pairs.items())
        }
        return cls(links, welds, poses, shared, linkage.driven, size)


NO_CENTRE = "welded links of which none has mass have no centre of mass: give one of them mass"


def massless_welds(linkage: Linkage) -> list[str]:
    """Moving links that are welded to others, none of which has mass."""
    carriers = {link: weld.link for link, weld in _welds_of(linkage).items() if weld.link != FRAME}
    massive = {carriers[link] for link in carriers if linkage.links[link].mass}
    sizes = Counter(carriers.values())
    return [x for x, carrier in carriers.items() if sizes[carrier] > 1 and carrier not in massive]


def _welds_of(linkage: Linkage) -> dict[str, LinkPlacement]:
    """Every link on the link that carries it: the frame, or the first of those welded together.

    Raises `GraphError` for welds of links that others hold together already.
    """
    steps: dict[str, list[tuple[str, str, LinkPlacement]]] = defaultdict(list)
    for name, joint in linkage.joints.items():
        if isinstance(joint, WeldGiven):
            sides = list(zip(joint.links, joint.at, joint.directions, strict=True))
            for (a, at_a, u_a), (b, at_b, u_b) in ((x, y) for x in sides[:1] for y in sides[1:]):
                e = 1 + 0j if u_a == u_b else u_b * u_a.conjugate()
                b_on_a = LinkPlacement("", a, at_b.z - at_a.z * e, e)
                steps[a].append((name, b, b_on_a))
                steps[b].append((name, a, b_on_a.inverse(b)))
    placed: dict[str, LinkPlacement] = {}
    used: set[tuple[str, str, str]] = set()
    for carrier in (FRAME, *sorted(linkage.links)):
        if carrier in placed:
            continue
        placed[carrier] = LinkPlacement("", carrier)
        queue = [carrier]
        for reached in queue:
            for name, link, step in steps[reached]:
                if link not in placed:
                    placed[link] = step.on(placed[reached])
                    queue.append(link)
                    used |= {(name, reached, link), (name, link, reached)}
                elif (name, reached, link) not in used:
                    raise GraphError(_stiff(name, reached, link))
    return placed


def _pairs_of(linkage: Linkage, name: str, welds: Mapping[str, LinkPlacement]) -> list[Connection]:
    joint: Any = linkage.joints[name]
    seats = [welds[link] for link in joint.links]
    first, *rest = joint.links
    start, *ends = (seat.place(at.z) for seat, at in zip(seats, joint.at, strict=True))
    guides = joint.directions if isinstance(joint, GuideGiven) else [1 + 0j] * len(seats)
    first_direction, *directions = (
        seat.direction(u) for seat, u in zip(seats, guides, strict=True)
    )
    names = [f"{name}.{link}" for link in rest] if len(rest) > 1 else [name]
    return [
        Connection(
            pair,
            seats[0].link,
            welds[link].link,
            joint.type,
            "",
            (first, link),
            (start, end),
            (first_direction, direction),
            slider=getattr(joint, "slider", 1),
            friction=joint.friction,
            clearance=getattr(joint, "clearance", None),
        )
        for pair, link, end, direction in zip(names, rest, ends, directions, strict=True)
    ]


def _stiff(joint: str, first: str, second: str) -> Problem:
    """The problem of a joint between links that are one."""
    message = f"{joint} joins {first} and {second}, which are welded together already"
    where = path_text(("joints", joint.partition(".")[0]))
    return Problem("over-constrained", where, message, "", f"remove {joint}, or a weld")


# Pins seated elsewhere.

Sums: TypeAlias = Mapping[str, tuple[tuple[str, bool], ...]]
"""Pair of the document -> pairs whose forces add to its own, each with whether it counts the
other way; only those that were seated elsewhere."""


def seated(pairs: Connections, drivers: Collection[str]) -> tuple[Connections, Sums]:
    """The pairs with frictionless pins of three links and more on the link that is placed first."""
    on_axis: dict[str, list[Connection]] = defaultdict(list)
    for c in pairs.values():
        if c.kind == "R" and c.axis:
            on_axis[c.axis].append(c)
    free = {axis: pin for axis, pin in on_axis.items() if _is_smooth(pin)}
    if not free:
        return pairs, {}
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
    return moved, sums


def _is_smooth(pin: list[Connection]) -> bool:
    """Whether a pin is free of laws, has one place only on each link, and is not on the frame."""
    ruled = any(c.friction or c.clearance is not None for c in pin)
    if len(pin) < 2 or ruled or all(FRAME in c.links for c in pin):
        return False
    points = {(link, c.on(link)) for c in pin for link in c.links}
    return len(points) == len({link for link, _ in points})


def _cut(
    c: Connection, old: list[Connection], new: list[Connection]
) -> tuple[tuple[str, bool], ...]:
    """New pairs between the two sides of an old one that is cut; the direct one first."""
    parts = joined([(c.first,), *(d.links for d in old if d.name != c.name)])
    (side,) = (part for part in parts if c.first in part)
    crossing = [d for d in new if (d.first in side) != (d.second in side)]
    crossing.sort(key=lambda d: (set(d.links) != set(c.links), d.name))
    return tuple((d.name, d.first not in side) for d in crossing)
