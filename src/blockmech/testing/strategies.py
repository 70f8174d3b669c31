"""Random valid mechanisms, for hypothesis and for plain seeds.

A mechanism is made pose first: links are placed at random, joints are put on them,
and lengths, offsets and branches follow, so it closes in that pose with a margin of
at least ``least_margin``. Nothing here solves a mechanism.

    from hypothesis import given
    from blockmech.testing.strategies import mechanisms

    @given(mechanisms())
    def test_balance(case):
        assert case.graph.compile().verify(**case.request).ok
"""

from __future__ import annotations

import cmath
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar

from blockmech.blocks import REGISTRY
from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.frame import Frame
from blockmech.friction.laws import Coulomb
from blockmech.loads import Couple, Force, Spring
from blockmech.model.graph import Graph
from blockmech.model.structure import LinkRef
from blockmech.values import Link, Marker, Place, Vector

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

T = TypeVar("T")
AXES: tuple[Literal["ground", "link"], ...] = ("ground", "link")
KINDS = ("dyad.rrr", "dyad.rrp", "dyad.rpr", "dyad.prp", "dyad.rpp")


class Chance(Protocol):
    """Where random choices come from: hypothesis draws or a seeded generator."""

    def uniform(self, low: float, high: float) -> float:
        """A number between two bounds."""

    def integer(self, low: int, high: int) -> int:
        """A whole number between two bounds, both included."""

    def pick(self, choices: Sequence[T]) -> T:
        """One of several things."""


class Seeded:
    """Choices from a seed; the same seed gives the same mechanism."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def uniform(self, low: float, high: float) -> float:
        """A number between two bounds."""
        return self._random.uniform(low, high)

    def integer(self, low: int, high: int) -> int:
        """A whole number between two bounds."""
        return self._random.randint(low, high)

    def pick(self, choices: Sequence[T]) -> T:
        """One of several things."""
        return self._random.choice(choices)


@dataclass(frozen=True)
class Options:
    """What a random mechanism may have.

    groups, drivers : least and greatest number of dyads and of driving links
    kinds : block types of the dyads
    slides : whether slide drives occur
    moving_drives : whether drivers may sit on moving links
    masses, loads, springs, friction, gravity : whether they occur
    least_margin : smallest margin [-] of a dyad in the pose
    """

    groups: tuple[int, int] = (1, 5)
    drivers: tuple[int, int] = (1, 2)
    kinds: tuple[str, ...] = KINDS
    slides: bool = True
    moving_drives: bool = True
    masses: bool = True
    loads: bool = True
    springs: bool = True
    friction: bool = True
    gravity: bool = True
    least_margin: float = 0.02


@dataclass(frozen=True)
class Case:
    """A random mechanism and a request in whose pose it closes."""

    graph: Graph
    request: dict[str, Any]

    def __repr__(self) -> str:
        return f"Case(request={self.request!r}, graph={self.graph.to_json()})"


def random_mechanism(chance: Chance, options: Options | None = None) -> Case:
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

    class Drawn:
        def __init__(self, draw: Callable[..., Any]) -> None:
            self._draw = draw

        def uniform(self, low: float, high: float) -> float:
            # Round numbers: they shrink well and print short.
            steps = 10_000
            return low + (high - low) * float(self._draw(st.integers(0, steps))) / steps

        def integer(self, low: int, high: int) -> int:
            return int(self._draw(st.integers(low, high)))

        def pick(self, choices: Sequence[T]) -> T:
            found: T = self._draw(st.sampled_from(choices))
            return found

    @st.composite  # type: ignore[untyped-decorator]  # hypothesis is not installed for users
    def cases(draw: Callable[..., Any]) -> Case:
        return random_mechanism(Drawn(draw), options)

    return cases()


@dataclass
class _Draft:
    """A moving block on its way: parameters, link places, markers added later."""

    type: str
    numbers: dict[str, Any]
    places: dict[str, tuple[complex, complex]]  # link -> origin, direction
    feeds: dict[str, str]  # joint -> "block.marker"
    markers: dict[str, dict[str, Marker]] = field(default_factory=dict)


class _Maker:
    """Makes one mechanism, block by block in formation order."""

    def __init__(self, chance: Chance, options: Options) -> None:
        self.chance = chance
        self.options = options
        self.frame: dict[str, Marker] = {}
        self.drafts: dict[str, _Draft] = {}
        self.at: dict[str, float] = {}
        self.count = 0

    def make(self) -> Case:
        for _ in range(self.chance.integer(*self.options.drivers)):
            self._driver()
        for _ in range(self.chance.integer(*self.options.groups)):
            self._dyad()
        graph = Graph("random", gravity=(0.0, -9.81) if self.options.gravity else (0.0, 0.0))
        elements = self._elements()
        graph.add("frame", Frame(markers=self.frame))
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
        moving = [LinkRef(n, link) for n, d in self.drafts.items() for link in d.places]
        return [LinkRef("frame", "frame"), *moving]

    def _place(self, link: LinkRef) -> tuple[complex, complex]:
        return (0j, 1 + 0j) if link.block == "frame" else self.drafts[link.block].places[link.link]

    def _marker(self, link: LinkRef, guide: bool) -> tuple[str, complex, complex]:
        """A new marker on a link: its address, place and direction in the pose."""
        self.count += 1
        name = f"m{self.count}"
        at = cmath.rect(self.chance.uniform(0.2, 1.5), self.chance.uniform(-math.pi, math.pi))
        angle = self.chance.uniform(-math.pi, math.pi) if guide else None
        marker = Marker(at=Place(at), angle=angle)
        if link.block == "frame":
            self.frame[name] = marker
        else:
            self.drafts[link.block].markers.setdefault(link.link, {})[name] = marker
        o, e = self._place(link)
        return f"{link.block}.{name}", o + e * at, e * marker.direction

    def _signed(self, low: float, high: float) -> float:
        return self.chance.uniform(low, high) * self.chance.pick((-1, 1))

    # -- blocks ---------------------------------------------------------------------

    def _driver(self) -> None:
        moving = self.options.moving_drives and self.drafts and self.chance.integer(0, 2) == 0
        link = self.chance.pick(self._links()) if moving else LinkRef("frame", "frame")
        slide = self.options.slides and self.chance.integer(0, 2) == 0
        name = f"drive{len(self.at) + 1}"
        source, p, u = self._marker(link, guide=slide or bool(self.chance.integer(0, 1)))
        if slide:
            q = self._signed(0.2, 1.5)
            place = {"slider": (p + q * u, u)}
            self.drafts[name] = _Draft("driver.slide", {}, place, {"S": source})
        else:
            q = self.chance.uniform(-math.pi, math.pi)
            numbers = {"length": self.chance.uniform(0.3, 1.5)}
            place = {"crank": (p, u * cmath.rect(1.0, q))}
            self.drafts[name] = _Draft("driver.crank", numbers, place, {"A": source})
        self.at[name] = q

    def _dyad(self) -> None:
        kind = self.chance.pick([k for k in self.options.kinds if k in REGISTRY])
        for _ in range(20):  # places that cannot close well enough are drawn again
            ends = []
            joints = [j for j in REGISTRY[kind].joints.values() if j.outer]
            links = self._links()
            first = self.chance.pick(links)
            second = self.chance.pick([k for k in links if k != first])
            ends = [
                (j.name, *self._marker(link, j.kind == "P"))
                for j, link in zip(joints, (first, second), strict=True)
            ]
            made = PLACERS[kind](self.chance, self.options.least_margin, *(e[2:] for e in ends))
            if made is not None:
                numbers, places = made
                feeds = {e[0]: e[1] for e in ends}
                self.drafts[f"group{len(self.drafts) + 1}"] = _Draft(kind, numbers, places, feeds)
                return
            self._forget(e[1] for e in ends)

    def _forget(self, addresses: Any) -> None:
        for address in addresses:
            block, marker = address.split(".")
            groups = [self.frame] if block == "frame" else self.drafts[block].markers.values()
            for markers in groups:
                markers.pop(marker, None)

    def _block(self, name: str, draft: _Draft) -> Block:
        cls = REGISTRY[draft.type]
        links = {}
        for link in draft.places:
            properties: dict[str, Any] = {"markers": draft.markers.get(link, {})}
            if self.options.masses and self.chance.integer(0, 3):
                properties["mass"] = self.chance.uniform(0.1, 5.0)
                properties["inertia"] = self.chance.uniform(0.01, 1.0)
                properties["cm"] = complex(self._signed(0.0, 0.8), self._signed(0.0, 0.5))
            links[link] = Link(**properties)
        friction = {}
        assert issubclass(cls, Moving)
        for joint in cls.joints.values():
            if self.options.friction and self.chance.integer(0, 1):
                law: dict[str, Any] = {"coefficient": self.chance.uniform(0.05, 0.3)}
                if joint.kind == "R":
                    law["radius"] = self.chance.uniform(0.005, 0.05)
                elif self.chance.integer(0, 1):
                    law["guide_length"] = self.chance.uniform(0.5, 1.5)
                friction[joint.name] = Coulomb(**law)
        return cls(**draft.numbers, links=links, friction=friction)

    def _elements(self) -> dict[str, tuple[Block, dict[str, str]]]:
        found: dict[str, tuple[Block, dict[str, str]]] = {}
        links = self._links()
        for i in range(self.chance.integer(0, 2) if self.options.loads else 0):
            where = self._marker(self.chance.pick(links[1:]), guide=False)[0]
            force = Vector(complex(self._signed(1.0, 500.0), self._signed(1.0, 500.0)))
            axes = self.chance.pick(AXES)
            found[f"force{i}"] = (Force(force=force, axes=axes), {"at": where})
        if self.options.loads and self.chance.integer(0, 1):
            where = self._marker(self.chance.pick(links[1:]), guide=False)[0]
            found["couple"] = (Couple(moment=self._signed(1.0, 200.0)), {"on": where})
        if self.options.springs and self.chance.integer(0, 1):
            a = self.chance.pick(links)
            b = self.chance.pick([k for k in links if k != a])
            spring = Spring(
                stiffness=self.chance.uniform(10.0, 1000.0),
                free_length=self.chance.uniform(0.0, 1.0),
                damping=self.chance.pick((0.0, 5.0)),
            )
            ends = {"a": self._marker(a, guide=False)[0], "b": self._marker(b, guide=False)[0]}
            found["spring"] = (spring, ends)
        return found


# -- one placer a dyad: from the ends' places to parameters and link places ------------

Spot = tuple[complex, complex]
Placed = tuple[dict[str, Any], dict[str, Spot]] | None


def _rrr(chance: Chance, least: float, B: Spot, D: Spot) -> Placed:
    b, d = B[0], D[0]
    side = chance.pick((-1, 1))
    c = b + (d - b) * complex(chance.uniform(-0.3, 1.3), side * chance.uniform(0.2, 2.0))
    u, w = c - b, c - d
    if abs(d - b) < 0.1 or _sine2(u, w) < least:
        return None
    numbers = {"l_i": abs(u), "l_j": abs(w), "branch": side}
    return numbers, {"i": (b, u / abs(u)), "j": (d, w / abs(w))}


def _rrp(chance: Chance, least: float, B: Spot, S: Spot) -> Placed:
    b, (g, u) = B[0], S
    h, x = chance.uniform(-0.4, 0.4), chance.uniform(-1.5, 1.5)
    c = g + x * u - 1j * u * h
    w = c - b
    along = (w * u.conjugate()).real
    if abs(w) < 0.1 or (along / abs(w)) ** 2 < least:
        return None
    numbers = {"l": abs(w), "h": h, "branch": 1 if along > 0 else -1}
    numbers["x_S"] = chance.uniform(-0.3, 0.3)
    return numbers, {"i": (b, w / abs(w)), "j": (c, u)}


def _rpr(chance: Chance, least: float, B: Spot, D: Spot) -> Placed:
    b, d = B[0], D[0]
    u = cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
    s, h = ((d - b) * u.conjugate()).real, ((d - b) * u.conjugate()).imag
    if abs(d - b) < 0.1 or (s / abs(d - b)) ** 2 < least:
        return None
    h_j = chance.uniform(-0.4, 0.4)
    numbers = {"h_i": h + h_j, "h_j": h_j, "branch": 1 if s > 0 else -1}
    numbers["x_S"] = chance.uniform(-0.3, 0.3)
    return numbers, {"i": (b, u), "j": (d, u)}


def _prp(chance: Chance, least: float, S1: Spot, S2: Spot) -> Placed:
    (g1, u1), (g2, u2) = S1, S2
    if _sine2(u1, u2) < least:
        return None
    h1, h2 = chance.uniform(-0.4, 0.4), chance.uniform(-0.4, 0.4)
    base1, base2 = g1 - 1j * u1 * h1, g2 - 1j * u2 * h2
    x = _cross(base2 - base1, u2) / _cross(u1, u2)
    c = base1 + x * u1
    if abs(c) > 20:
        return None
    numbers = {"h1": h1, "h2": h2, "x_S1": chance.uniform(-0.3, 0.3)}
    return numbers, {"i": (c, u1), "j": (c, u2)}


def _rpp(chance: Chance, least: float, B: Spot, S: Spot) -> Placed:
    b, (g, u2) = B[0], S
    beta = chance.uniform(0.3, 2.8) * chance.pick((-1, 1))
    if math.sin(beta) ** 2 < least:
        return None
    u1 = u2 * cmath.rect(1.0, beta)
    h_i, h_j = chance.uniform(-0.4, 0.4), chance.uniform(-0.4, 0.4)
    n1 = 1j * u1
    x = (((b - g) * n1.conjugate()).real + h_i - h_j) / _cross(u1, u2)
    numbers = {"beta": beta, "h_i": h_i, "h_j": h_j, "x_S": chance.uniform(-0.3, 0.3)}
    return numbers, {"i": (b, u1), "j": (g + x * u2, u2)}


def _cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag


def _sine2(a: complex, b: complex) -> float:
    return (_cross(a, b) / (abs(a) * abs(b))) ** 2


PLACERS: dict[str, Callable[..., Placed]] = {
    "dyad.rrr": _rrr,
    "dyad.rrp": _rrp,
    "dyad.rpr": _rpr,
    "dyad.prp": _prp,
    "dyad.rpp": _rpp,
}
"""Block type -> how one is placed at random."""
