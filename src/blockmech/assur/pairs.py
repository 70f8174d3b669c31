"""Kinematic pairs between links, without lengths, and which of them share an axis for good.

R pairs whose places on a common link coincide turn about one point, P pairs whose guides on a
common link are parallel slide in one direction; counting has to know it. A pin of m links is
m - 1 pairs of one axis.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar

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
