"""Random valid mechanisms, for hypothesis and for plain seeds.

A mechanism is made pose first: links are placed at random, joints are put on them,
and lengths, offsets and branches follow, so it closes in that pose with a margin of
at least ``min_margin``. Nothing here solves a mechanism.

    from hypothesis import given
    from blockmech.testing.strategies import mechanisms

    @given(mechanisms())
    def test_balance(case):
        assert case.graph.compile().verify(**case.request).ok
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from random import Random
from typing import TYPE_CHECKING, Literal

from blockmech.blocks import REGISTRY
from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.frame import Frame
from blockmech.builders import Graph
from blockmech.friction.laws import Coulomb
from blockmech.ground.values import Link, Marker, Place, Vector
from blockmech.loads import Couple, Force, Spring, TorsionSpring
from blockmech.model.structure import LinkRef
from blockmech.testing.random_groups import PLACERS, SIZES, Placed, random_group, random_shape
from blockmech.typing import Arguments, Data

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

__all__ = [
    "EVERY",
    "KINDS",
    "Case",
    "Options",
    "Seeded",
    "mechanisms",
    "random_mechanism",
]

AXES: tuple[Literal["ground", "link"], ...] = ("ground", "link")
Seeded = Random
"""Choices from a seed; the same seed gives the same mechanism."""

KINDS = ("dyad.rrr", "dyad.rrp", "dyad.rpr", "dyad.prp", "dyad.rpp")
EVERY = (*KINDS, "driven.rrr", "group.general")


@dataclass(frozen=True)
class Options:
    """What a random mechanism may have.

    groups, drivers : least and greatest number of groups and of driving links
    kinds : block types of the groups: ``KINDS`` are the dyads, ``EVERY`` adds the cylinder
        and the general group
    sizes : numbers of links and of driven pairs that a general group may have
    masses, loads, springs, friction, gravity : whether they occur
    twists : whether torsion springs occur
    min_margin : smallest margin [-] of a dyad in the pose
    """

    groups: tuple[int, int] = (1, 5)
    drivers: tuple[int, int] = (1, 2)
    kinds: tuple[str, ...] = KINDS
    sizes: tuple[tuple[int, int], ...] = SIZES
    masses: bool = True
    loads: bool = True
    springs: bool = True
    twists: bool = False
    friction: bool = True
    gravity: bool = True
    min_margin: float = 0.02


@dataclass(frozen=True)
class Case:
    """A random mechanism and a request in whose pose it closes."""

    graph: Graph
    request: Arguments

    def __repr__(self) -> str:
        return f"Case(request={self.request!r}, graph={self.graph.to_json()})"


def random_mechanism(chance: Random, options: Options | None = None) -> Case:
    """A random valid mechanism; see the module's text.

    Parameters
    ----------
    chance : source of choices, e.g. ``Seeded(7)``
    options : what may occur

    Returns
    -------
    Case with the graph and a request (at, rates, accelerations) for `Mechanism.run`
    """
    return _Maker(chance, options or Options()).make()


def mechanisms(options: Options | None = None) -> SearchStrategy[Case]:
    """Hypothesis strategy of random valid mechanisms."""
    from hypothesis import strategies as st

    return st.builds(random_mechanism, st.randoms(use_true_random=False), st.just(options))


@dataclass
class _Draft:
    """A moving block on its way: parameters, link places, markers added later."""

    type: str
    numbers: Data
    poses: dict[str, tuple[complex, complex]]  # link -> origin, direction
    feeds: dict[str, str]  # joint -> "block.marker"
    drives: dict[str, float] = field(default_factory=dict)  # driver -> coordinate
    markers: dict[str, dict[str, Marker]] = field(default_factory=dict)


class _Maker:
    """Makes one mechanism, block by block in formation order."""

    def __init__(self, chance: Random, options: Options) -> None:
        self.chance = chance
        self.options = options
        self.drafts = {"frame": _Draft("frame", {}, {"frame": (0j, 1 + 0j)}, {})}
        self.at: dict[str, float] = {}
        self.count = 0

    def make(self) -> Case:
        for _ in range(self.chance.randint(*self.options.drivers)):
            self._driver()
        for _ in range(self.chance.randint(*self.options.groups)):
            self._group()
        graph = Graph("random", gravity=(0.0, -9.81) if self.options.gravity else (0.0, 0.0))
        elements = self._elements()
        for name, draft in self.drafts.items():
            graph.add(name, self._block(name, draft))
        for name, (element, wires) in elements.items():
            graph.add(name, element)
            for terminal, source in wires.items():
                graph.connect(source, f"{name}.{terminal}")
        for name, draft in self.drafts.items():
            for joint, source in draft.feeds.items():
                graph.connect(source, f"{name}.{joint}")
        request = {
            "at": self.at,
            "rates": {d: self._signed(0.5, 3.0) for d in self.at},
            "accelerations": {d: self.chance.uniform(-5.0, 5.0) for d in self.at},
        }
        return Case(graph, request)

    # -- places and markers -------------------------------------------------------

    def _links(self) -> list[LinkRef]:
        return [LinkRef(name, link) for name, d in self.drafts.items() for link in d.poses]

    def _two_links(self) -> tuple[LinkRef, LinkRef]:
        links = self._links()
        first = self.chance.choice(links)
        return first, self.chance.choice([link for link in links if link != first])

    def _marker(self, link: LinkRef, guide: bool) -> tuple[str, complex, complex]:
        """A marker on a link: its address, place and direction in the pose.

        Every third pin, where there is one, goes on a place that others use already.
        """
        shared = [] if guide else self._points(link)
        if shared and self.chance.randint(0, 2) == 0:
            return self.chance.choice(shared)
        return self._new_marker(link, guide)

    def _new_marker(self, link: LinkRef, guide: bool = False) -> tuple[str, complex, complex]:
        """A marker at a place of its own."""
        self.count += 1
        name = f"m{self.count}"
        at = cmath.rect(self.chance.uniform(0.2, 1.5), self.chance.uniform(-math.pi, math.pi))
        angle = self.chance.uniform(-math.pi, math.pi) if guide else None
        marker = Marker(at=Place(at), angle=angle)
        draft = self.drafts[link.block]
        draft.markers.setdefault(link.link, {})[name] = marker
        o, e = draft.poses[link.link]
        return f"{link.block}.{name}", o + e * at, e * marker.direction

    def _points(self, link: LinkRef) -> list[tuple[str, complex, complex]]:
        """Points that a link has so far, also those that its block brings.

        Not the outer joints of its own block: what hangs on one of them and on the link
        that carries it would be a rigid part of that link.
        """
        draft = self.drafts[link.block]
        cls, (o, e) = REGISTRY[draft.type], draft.poses[link.link]
        positions = {
            name: complex(draft.numbers[m.along] if m.along else 0.0)
            for name, m in cls.built_in.items()
            if m.link == link.link and not (name in cls.joints and cls.joints[name].outer)
        }
        markers = draft.markers.get(link.link, {})
        positions |= {n: m.at.z for n, m in markers.items() if m.angle is None and m.dir is None}
        return [(f"{link.block}.{name}", o + e * at, e) for name, at in positions.items()]

    def _signed(self, low: float, high: float) -> float:
        return self.chance.uniform(low, high) * self.chance.choice((-1, 1))

    # -- blocks ---------------------------------------------------------------------

    def _driver(self) -> None:
        moving = len(self.drafts) > 1 and self.chance.randint(0, 2) == 0
        link = self.chance.choice(self._links()) if moving else LinkRef("frame", "frame")
        slide = self.chance.randint(0, 2) == 0
        kind, joint = ("driver.slide", "S") if slide else ("driver.crank", "A")
        source, *spot = self._marker(link, guide=slide or bool(self.chance.randint(0, 1)))
        placed = PLACERS[kind](self.chance, 0.0, spot)
        assert placed is not None
        self._add(f"drive{len(self.at) + 1}", kind, placed, {joint: source})

    def _group(self) -> None:
        kind = self.chance.choice([k for k in self.options.kinds if k in REGISTRY])
        make = self._general if kind == "group.general" else self._dyad
        for _ in range(20):  # places that cannot close well enough are drawn again
            placed, feeds = make(kind)
            if placed is not None:
                name = f"group{len(self.drafts)}"
                self._add(name, kind, placed, feeds)
                if kind == "group.general":
                    placed.numbers["home"]["drivers"] = self._upstream(name)
                return
            self._forget(feeds.values())

    def _add(self, name: str, kind: str, placed: Placed, feeds: dict[str, str]) -> None:
        cls = REGISTRY[kind]
        assert issubclass(cls, Moving)
        drives = {f"{name}.{j}" if cls.own_form else name: q for j, q in placed.drives.items()}
        self.drafts[name] = _Draft(kind, placed.numbers, placed.poses, feeds, drives)
        self.at |= drives

    def _dyad(self, kind: str) -> tuple[Placed | None, dict[str, str]]:
        joints = [j for j in REGISTRY[kind].joints.values() if j.outer]
        ends = [
            (j.name, *self._marker(link, j.kind == "P"))
            for j, link in zip(joints, self._two_links(), strict=True)
        ]
        placed = PLACERS[kind](self.chance, self.options.min_margin, *(e[2:] for e in ends))
        return placed, {e[0]: e[1] for e in ends}

    def _general(self, kind: str) -> tuple[Placed | None, dict[str, str]]:
        shape = random_shape(self.chance, self.options.sizes)
        links = self._links()
        ends = {
            name: self._marker(self.chance.choice(links), tie.guided)
            for name, tie in shape.items()
            if not tie.first
        }
        spots = {name: (p, u) for name, (_, p, u) in ends.items()}
        placed = random_group(self.chance, self.options.min_margin, shape, spots)
        return placed, {name: address for name, (address, _, _) in ends.items()}

    def _upstream(self, name: str) -> dict[str, float]:
        """Coordinates of all drivers on which a block's pose depends."""
        draft = self.drafts[name]
        drives = dict(draft.drives)
        for address in draft.feeds.values():
            drives |= self._upstream(address.split(".")[0])
        return drives

    def _forget(self, addresses: Iterable[str]) -> None:
        """Take back markers that nothing else is wired to."""
        used = {address for d in self.drafts.values() for address in d.feeds.values()}
        for address in set(addresses) - used:
            block, name = address.split(".")
            for markers in self.drafts[block].markers.values():
                markers.pop(name, None)

    def _block(self, name: str, draft: _Draft) -> Block:
        cls = REGISTRY[draft.type]
        if not issubclass(cls, Moving):
            return Frame(markers=draft.markers.get(name, {}))
        links = {}
        for link in draft.poses:
            properties: Data = {"markers": draft.markers.get(link, {})}
            if self.options.masses and self.chance.randint(0, 3):
                properties["mass"] = self.chance.uniform(0.1, 5.0)
                properties["inertia"] = self.chance.uniform(0.01, 1.0)
                properties["cm"] = complex(self._signed(0.0, 0.8), self._signed(0.0, 0.5))
            links[link] = Link(**properties)
        block, friction = cls(**draft.numbers, links=links), {}
        for joint in block.joints.values():
            if self.options.friction and self.chance.randint(0, 1):
                law: Data = {"coefficient": self.chance.uniform(0.05, 0.3)}
                if joint.kind == "R":
                    law["radius"] = self.chance.uniform(0.005, 0.05)
                elif self.chance.randint(0, 1):
                    law["guide_length"] = self.chance.uniform(0.5, 1.5)
                friction[joint.name] = Coulomb(**law)
        return block.model_copy(update={"friction": friction})

    def _elements(self) -> dict[str, tuple[Block, dict[str, str]]]:
        elements: dict[str, tuple[Block, dict[str, str]]] = {}
        links = self._links()
        for i in range(self.chance.randint(0, 2) if self.options.loads else 0):
            where = self._marker(self.chance.choice(links[1:]), guide=False)[0]
            force = Vector(complex(self._signed(1.0, 500.0), self._signed(1.0, 500.0)))
            axes = self.chance.choice(AXES)
            elements[f"force{i}"] = (Force(force=force, axes=axes), {"at": where})
        if self.options.loads and self.chance.randint(0, 1):
            where = self._marker(self.chance.choice(links[1:]), guide=False)[0]
            elements["couple"] = (Couple(moment=self._signed(1.0, 200.0)), {"on": where})
        if self.options.springs and self.chance.randint(0, 1):
            a, b = self._two_links()
            spring = Spring(
                stiffness=self.chance.uniform(10.0, 1000.0),
                free_length=self.chance.uniform(0.0, 1.0),
                damping=self.chance.choice((0.0, 5.0)),
            )
            # Ends at new places: a spring without length has no direction.
            ends = {"a": self._new_marker(a)[0], "b": self._new_marker(b)[0]}
            elements["spring"] = (spring, ends)
        if self.options.twists and self.chance.randint(0, 1):
            a, b = self._two_links()
            twist = TorsionSpring(
                stiffness=self.chance.uniform(1.0, 100.0),
                rest_angle=self.chance.uniform(-1.0, 1.0),
                damping=self.chance.choice((0.0, 2.0)),
            )
            ends = {name: f"{link.block}.{link.link}" for name, link in (("a", a), ("b", b))}
            elements["twist"] = (twist, ends)
        return elements
