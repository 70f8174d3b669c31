"""Pairs and Assur groups: what a driver or a minimal group is called, its kind and its class.

Class of a group (after Artobolevsky): two links and three pairs are a dyad, class II. Else
the class is the number of pairs of its richest closed contour, which is either one link
with its inner pairs (a rigid contour: a ternary link gives class III, the triad) or a
closed loop of links, each inner pair counted by its shortest loop (four sides: class IV).
Driven pairs inside a group count as welded.

Kinematic pairs are without lengths. R pairs whose places on a common link coincide turn about one
point, P pairs whose guides on a common link are parallel slide in one direction; counting has to
know it. A pin of m links is m - 1 pairs of one axis.

Source: [A88] Artobolevsky, Theory of mechanisms, 1988.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, TypeVar

import networkx as nx

from blockmech.ground.tolerances import EQUAL

T = TypeVar("T", bound=Hashable)


@dataclass(frozen=True)
class Pair:
    """A kinematic pair between two links, without geometry.

    Attributes
    ----------
    name : name of the pair
    first, second : the two links
    kind : "R" or "P"
    axis : pairs of the same kind with the same non-empty axis coincide: R pairs turn
        about one point, P pairs slide in one direction. Empty: an axis of its own.
    """

    name: str
    first: str
    second: str
    kind: Literal["R", "P"] = "R"
    axis: str = ""

    @property
    def links(self) -> tuple[str, str]:
        """Both links."""
        return self.first, self.second

    def other(self, link: str) -> str:
        """The link at the other side."""
        return self.second if link == self.first else self.first


def sorted_parts(
    links: Iterable[str], pairs: Iterable[Pair], earlier: Collection[str], drivers: Collection[str]
) -> tuple[list[str], list[Pair]]:
    """The moving links and the pairs by name, so that no answer depends on their order.

    Raises `ValueError` where pairs or drivers name what is not there, or a name is used twice.
    """
    moving, ordered = sorted(set(links) - set(earlier)), sorted(pairs, key=lambda p: p.name)
    names = Counter(pair.name for pair in ordered)
    wrong = {
        "pairs name unknown links": {a for p in ordered for a in p.links}.difference(
            moving, earlier
        ),
        "pairs of the same name": {name for name, number in names.items() if number > 1},
        "drivers name unknown pairs": set(drivers).difference(names),
    }
    for message, which in wrong.items():
        if which:
            raise ValueError(f"{message}: {', '.join(sorted(which))}")
    return moving, ordered


def joined(parts: Iterable[Iterable[T]]) -> list[set[T]]:
    """The items of parts, those in one set that parts with common items join.

    >>> [sorted(each) for each in joined([["a", "b"], ["c"], ["d", "b"]])]
    [['a', 'b', 'd'], ['c']]
    """
    of: dict[T, set[T]] = {}
    for part in parts:
        merged = set[T]()
        for x in part:
            if (joined_set := of.setdefault(x, merged)) is merged:
                merged.add(x)
            else:
                few, merged = sorted((merged, joined_set), key=len)
                merged |= few
                of.update(dict.fromkeys(few, merged))
    return list({id(s): s for s in of.values()}.values())


class Side(NamedTuple):
    """What one link of a pair has of it.

    pair, link : their names
    kind : "R" or "P"
    at : [m] place of an R pair, [-] unit direction of a P pair's guide, in the link's frame
    """

    pair: str
    link: str
    kind: Literal["R", "P"]
    at: complex


def axes(sides: Iterable[Side], size: float) -> dict[str, str]:
    """Pair -> the axis that it has in common with others for good, "" for one of its own.

    ``size`` [m] is that of the mechanism. A side that is left out, because its place is
    not known, coincides with nothing. Places, and directions, nearer than `EQUAL` are one, those
    three times as far apart are not: they fall into one cell of a grid or of one that is shifted
    by half a cell, so that near ones are never kept apart.
    """
    coincident: set[tuple[str, str]] = set()  # pairs that share a cell on a link
    first: dict[object, str] = {}  # cell -> a pair in it
    axis_of = {}
    for side in sides:
        axis_of[side.pair] = ""
        # a direction and its opposite have the same square
        z = side.at / size if side.kind == "R" else side.at * side.at
        for shift in (0, 0.5, 0.5j, 0.5 + 0.5j):
            w = z / (2 * EQUAL) + shift
            cell = (side.link, side.kind, shift, math.floor(w.real), math.floor(w.imag))
            if (first_pair := first.setdefault(cell, side.pair)) != side.pair:
                coincident.add((first_pair, side.pair))
    for names in joined(coincident):
        axis_of.update(dict.fromkeys(names, min(names)))
    return axis_of


DYADS = ("RRR", "RRP", "RPR", "PRP", "RPP")
"""Kinds of dyads in the letters outer, inner, outer; PPP leaves a link free to slide."""


@dataclass(frozen=True)
class Unit:
    """A driver or a minimal Assur group: one step of the formation sequence.

    Attributes
    ----------
    links : its links; of a dyad (i, j) as its kind says, of a cylinder (barrel, rod, j),
        of a triad the ternary link first; ties and the rest by name
    inner : pairs between its own links, by name
    outer : pairs to earlier links; of a dyad that of i, then that of j; else by name
    driven : names of the driven pairs among them; a driver has one, outer
    kind : "driver", a dyad's letters, "cylinder" (RRR whose link i has a driven length),
        "triad" (one ternary and three binary links) or "group"
    number : class, 1 for a driver
    """

    links: tuple[str, ...]
    inner: tuple[Pair, ...]
    outer: tuple[Pair, ...]
    driven: tuple[str, ...]
    kind: str
    number: int

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All its pairs: 3n = 2p + driven."""
        return self.inner + self.outer

    def __str__(self) -> str:
        letters = "" if self.kind in ("driver", "group") else f" {self.kind}"
        return f"{roman(self.number)}{letters}({', '.join(self.links)})"


def classify(links: Iterable[str], pairs: Iterable[Pair], drivers: Collection[str] = ()) -> Unit:
    """Kind and class of a group whose links and pairs are known; it is not checked.

    The pairs are those between its links and to earlier ones, the driven ones included.
    """
    names = sorted(links)
    ordered = sorted(pairs, key=lambda p: p.name)
    inner = tuple(p for p in ordered if p.first in names and p.second in names)
    outer = tuple(p for p in ordered if p not in inner)
    driven = tuple(p.name for p in ordered if p.name in drivers)
    if len(names) == 1 and len(ordered) == len(driven) == 1:
        return Unit(tuple(names), inner, outer, driven, "driver", 1)
    feet = {a: p for p in outer for a in p.links if a in names}
    kind, arranged = (
        _as_dyad(names, inner, feet)
        or _as_cylinder(names, inner, feet, driven)
        or _as_triad(names, inner, feet)
        or ("group", names)
    )
    if kind in DYADS:
        return Unit(tuple(arranged), inner, tuple(feet[a] for a in arranged), driven, kind, 2)
    return Unit(tuple(arranged), inner, outer, driven, kind, _class_number(inner, driven))


Kind: TypeAlias = tuple[str, list[str]]


def _as_dyad(names: list[str], inner: Sequence[Pair], feet: Mapping[str, Pair]) -> Kind | None:
    """Two links, one inner pair, a foot each."""
    if len(names) != 2 or len(inner) != 1 or len(feet) != 2:
        return None
    for i, j in (names, names[::-1]):
        letters = feet[i].kind + inner[0].kind + feet[j].kind
        if letters in DYADS:
            return letters, [i, j]
    return None


def _as_cylinder(
    names: list[str], inner: Sequence[Pair], feet: Mapping[str, Pair], driven: Sequence[str]
) -> Kind | None:
    """Barrel on a pin, rod driven along it and pinned to a link j on another pin."""
    slides = [p for p in inner if p.name in driven and p.kind == "P"]
    pins = [p for p in inner if p.name not in driven and p.kind == "R"]
    if (len(names), len(inner), len(slides), len(pins), len(feet)) != (3, 2, 1, 1, 2):
        return None
    rod = next((a for a in slides[0].links if a in pins[0].links), "")
    barrel, j = slides[0].other(rod), pins[0].other(rod)
    if set(feet) != {barrel, j} or {p.kind for p in feet.values()} != {"R"}:
        return None
    return "cylinder", [barrel, rod, j]


def _as_triad(names: list[str], inner: Sequence[Pair], feet: Mapping[str, Pair]) -> Kind | None:
    """One link with three inner pairs to three links with a foot each."""
    if (len(names), len(inner), len(feet)) != (4, 3, 3):
        return None
    centre = next(a for a in names if a not in feet)
    if any(centre not in p.links for p in inner):
        return None
    return "triad", [centre, *(a for a in names if a != centre)]


def _class_number(inner: Iterable[Pair], driven: Collection[str]) -> int:
    """Pairs of the richest closed contour: a link's inner pairs, or a loop's sides."""
    inner = list(inner)
    welded = nx.utils.UnionFind(a for p in inner for a in p.links)
    for p in inner:
        if p.name in driven:
            welded.union(*p.links)
    joints = [(welded[p.first], welded[p.second]) for p in inner if p.name not in driven]
    joints_on = Counter(a for joint in joints for a in joint)
    graph: nx.MultiGraph[str] = nx.MultiGraph(joints)
    return max([2, *joints_on.values(), *(_shortest_loop(graph, *joint) for joint in joints)])


def _shortest_loop(graph: nx.MultiGraph[str], a: str, b: str) -> int:
    """Sides of the shortest loop through a pair of links a and b, 0 if there is none."""
    graph.remove_edge(a, b)
    try:
        return 1 + int(nx.shortest_path_length(graph, a, b))
    except nx.NetworkXNoPath:
        return 0
    finally:
        graph.add_edge(a, b)


def roman(number: int) -> str:
    """A class as it is written: I, II, III, IV ..."""
    text = ""
    for value, letters in ((10, "X"), (9, "IX"), (5, "V"), (4, "IV"), (1, "I")):
        text += letters * (number // value)
        number %= value
    return text
