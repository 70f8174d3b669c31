"""Which links can move, which are determined, and which are held more than once.

Structure alone, no lengths: every link has three freedoms, a pair (R or P) takes
two of them and a driver a third. Counting 3n - 2p is not enough, as one part may
be over-constrained while another is loose, so the *generic rank* of the velocity
conditions decides, exactly as it would for lengths chosen at random. For R pairs
on axes of their own it is what the (3, 3) pebble game on links counts, 2p' <= 3n' - 3
for every set of links ([T89]); counting is wrong for pins of three links and more
(their pairs share one axis) and for loops of P pairs (the relative turning is held
once too often), the rank is right for both.

The rank is taken in integers modulo the prime 2^61 - 1, with coordinates made from
the names of the pairs: no rounding, no tolerance, the same answer in any order. By
the Schwartz-Zippel lemma a structure with N conditions is misjudged with a chance
below N^2 / 2^60. Cost: linear for chains of dyads (`elimination`).

Sources: [T89] Tay, Linking (n-2)-dimensional panels in n-space II, Graphs Combin. 5
(1989); [J97] Jacobs & Hendrickson, The pebble game, J. Comput. Phys. 137 (1997).
"""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import networkx as nx

from blockmech.model.elimination import PRIME, Echelon, Row, few_neighbours_first

Condition: TypeAlias = tuple[str, str]
"""Name of the pair and what it holds: "place" (R), "turn", "slide" (P), "drive"."""


@dataclass(frozen=True)
class Pair:
    """A kinematic pair between two links, without geometry.

    Attributes
    ----------
    name : name of the pair
    first, second : the two links
    kind : "R" or "P"
    axis : pairs of the same kind with the same non-empty axis coincide: R pairs turn
        about one point (a pin of m links is m - 1 pairs of one axis), P pairs slide in
        one direction. Empty: an axis of its own.
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


@dataclass(frozen=True)
class Overconstraint:
    """A smallest set of pairs that hold its links more often than needed.

    Attributes
    ----------
    links : links that these pairs join, earlier ones included, sorted
    pairs : the pairs, sorted; removing any of them takes away one redundant condition
    drivers : those of them whose drivers take part
    excess : number of redundant conditions
    turning_only : only the relative turning is held too often, as in a loop of P pairs
    """

    links: tuple[str, ...]
    pairs: tuple[str, ...]
    drivers: tuple[str, ...]
    excess: int
    turning_only: bool


@dataclass(frozen=True)
class Loose:
    """Links that still move, joined to each other, and the freedom they have left."""

    links: tuple[str, ...]
    freedom: int


@dataclass(frozen=True)
class Rigidity:
    """What a structure can do, its drivers held.

    Attributes
    ----------
    mobility : freedoms left, for generic lengths
    counted : the formula 3n - 2p - drivers; it is the mobility less the redundant conditions
    overconstrained : sets of links held too often, each with its pairs, ties by name
    loose : sets of links that still move; every other link is determined
    clusters : sets of two links or more that move as one body, earlier ones included
    """

    mobility: int
    counted: int
    overconstrained: tuple[Overconstraint, ...]
    loose: tuple[Loose, ...]
    clusters: tuple[tuple[str, ...], ...]

    @property
    def redundant(self) -> int:
        """Number of redundant conditions."""
        return self.mobility - self.counted

    @property
    def determinate(self) -> bool:
        """Nothing moves and nothing is held twice: links can be placed one way."""
        return self.mobility == 0 and self.counted == 0


def rigidity(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
    work: int | None = None,
) -> Rigidity:
    """Mobility, over-constrained sets, loose links and rigid clusters.

    Parameters
    ----------
    links : the moving links; earlier ones among them are passed over
    pairs : the pairs between links and earlier links
    earlier : the frame and everything already placed, one body for this purpose
    drivers : names of the driven pairs
    work : steps of elimination after which to give up with `TooTangledError`; None for never

    Notes
    -----
    Rank, a random motion and the self-stresses of the generic velocity conditions.
    Whichever order the arguments have, the answer is the same.
    """
    moving = sorted(set(links) - set(earlier))
    ordered = sorted(pairs, key=lambda p: p.name)
    check_names(moving, ordered, earlier, drivers)
    joined = (pair.links for pair in ordered)
    column = {a: 3 * k for k, a in enumerate(few_neighbours_first(moving, joined, work))}
    held = [(pair, part, row) for pair in ordered for part, row in _pair_rows(pair, column)]
    held += [(p, "drive", _drive_row(p, column)) for p in ordered if p.name in drivers]
    names: list[Condition] = [(pair.name, part) for pair, part, _ in held]
    system = Echelon(3 * len(moving), [row for _, _, row in held], work)
    twist = _twists(column, system)
    free = Counter(a for a, c in column.items() for k in range(3) if c + k not in system.pivots)
    return Rigidity(
        mobility=3 * len(moving) - len(system.pivots),
        counted=3 * len(moving) - len(held),
        overconstrained=_overconstrained(system, names, ordered, column),
        loose=_loose(twist, free, ordered),
        clusters=_clusters(twist, ordered),
    )


def check_names(
    moving: Sequence[str], pairs: Sequence[Pair], earlier: Collection[str], drivers: Collection[str]
) -> None:
    """Raise `ValueError` where pairs or drivers name what is not there, or a name is used twice."""
    known = set(moving) | set(earlier)
    unknown = sorted({a for pair in pairs for a in pair.links} - known)
    if unknown:
        raise ValueError(f"pairs name unknown links: {', '.join(unknown)}")
    names = Counter(pair.name for pair in pairs)
    twice = [name for name, number in names.items() if number > 1]
    if twice:
        raise ValueError(f"pairs of the same name: {', '.join(twice)}")
    strange = sorted(set(drivers) - set(names))
    if strange:
        raise ValueError(f"drivers name unknown pairs: {', '.join(strange)}")


# Conditions. The twist of a link is the velocity of its point at the common origin and
# its rate; two links are welded when their twists are equal.


def _random_numbers(text: str) -> tuple[int, int]:
    """Two numbers of the field that look random but depend on the text only."""
    digest = hashlib.blake2b(text.encode(), digest_size=16).digest()
    return int.from_bytes(digest[:8], "big") % PRIME, int.from_bytes(digest[8:], "big") % PRIME


def _axis_numbers(pair: Pair) -> tuple[int, int]:
    """Point of an R pair, normal of a P pair's direction."""
    return _random_numbers(
        f"{pair.kind} {'axis' if pair.axis else 'pair'} {pair.axis or pair.name}"
    )


def _difference(
    pair: Pair, column: Mapping[str, int], vx: int = 0, vy: int = 0, om: int = 0
) -> Row:
    """Coefficients of the first link's twist less that of the second."""
    row: Row = {}
    for link, sign in ((pair.first, 1), (pair.second, -1)):
        if link in column:
            for k, value in enumerate((vx, vy, om)):
                row[column[link] + k] = (row.get(column[link] + k, 0) + sign * value) % PRIME
    return {c: value for c, value in row.items() if value}


def _pair_rows(pair: Pair, column: Mapping[str, int]) -> Iterator[tuple[str, Row]]:
    """The two conditions of a pair, undriven."""
    x, y = _axis_numbers(pair)
    if pair.kind == "R":
        yield "place", _difference(pair, column, vx=1, om=-y)
        yield "place", _difference(pair, column, vy=1, om=x)
    else:
        yield "turn", _difference(pair, column, om=1)
        yield "slide", _difference(pair, column, vx=x, vy=y)


def _drive_row(pair: Pair, column: Mapping[str, int]) -> Row:
    """The third condition of a driven pair: no relative turning (R) or sliding (P)."""
    x, y = _axis_numbers(pair)
    if pair.kind == "R":
        return _difference(pair, column, om=1)
    return _difference(pair, column, vx=-y, vy=x)


Twists: TypeAlias = Mapping[str, tuple[int, int, int]]


def _twists(column: Mapping[str, int], system: Echelon) -> Twists:
    """A random motion that the conditions allow: generic, so zero only where all are."""
    value: Row = {}
    for a in reversed(list(column)):
        start = column[a]
        for k in (2, 1, 0):
            pivot = system.pivots.get(start + k)
            if pivot is None:
                value[start + k] = _random_numbers(f"motion {k} of {a}")[0]
            else:
                total = sum(f * value[c] for c, f in pivot.row.items())
                value[start + k] = -total % PRIME
    return {a: (value[c], value[c + 1], value[c + 2]) for a, c in column.items()}


def _sets(edges: Iterable[tuple[str, str]], nodes: Iterable[str]) -> list[tuple[str, ...]]:
    """Connected sets of nodes, each sorted, in sorted order."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from(edges)
    return sorted(tuple(sorted(part)) for part in nx.connected_components(graph))


def _loose(twist: Twists, free: Mapping[str, int], pairs: Iterable[Pair]) -> tuple[Loose, ...]:
    moving = {a for a, motion in twist.items() if any(motion)}
    joined = [p.links for p in pairs if p.first in moving and p.second in moving]
    parts = _sets(joined, moving)
    return tuple(Loose(part, sum(free[a] for a in part)) for part in parts)


def _clusters(twist: Twists, pairs: Sequence[Pair]) -> tuple[tuple[str, ...], ...]:
    still: dict[tuple[int, int, int], set[str]] = defaultdict(set)
    for a in {a for pair in pairs for a in pair.links} | set(twist):
        still[twist.get(a, (0, 0, 0))].add(a)
    return tuple(sorted(tuple(sorted(part)) for part in still.values() if len(part) > 1))


@dataclass
class _Part:
    """Conditions that depend on each other, and the links that they join."""

    rows: set[int]
    links: set[str]
    excess: int


def _overconstrained(
    system: Echelon, names: Sequence[Condition], pairs: Iterable[Pair], moving: Collection[str]
) -> tuple[Overconstraint, ...]:
    """Join dependencies that share a condition (the components of the matroid)."""
    by_name = {pair.name: pair for pair in pairs}
    body = {a: a if a in moving else "" for pair in by_name.values() for a in pair.links}
    parts: dict[int, _Part] = {}
    at: dict[Condition, int] = {}  # the part of each condition
    rigid: dict[str, set[int]] = defaultdict(set)  # the rigid parts on each link
    for source in system.redundant:
        first, second = (body[a] for a in by_name[names[source][0]].links)
        homes = rigid[first] & rigid[second] if first != second else set()
        rows = {source} if homes else system.stress(source)  # a rigid part implies it
        joined = sorted({at[names[k]] for k in rows if names[k] in at} | homes)
        home = joined[0] if joined else source
        part = parts.setdefault(home, _Part(set(), set(), 0))
        for n in joined[1:]:
            gone = parts.pop(n)
            at.update((names[k], home) for k in gone.rows)
            part.rows |= gone.rows
            part.links |= gone.links
            part.excess += gone.excess
            for a in gone.links:
                rigid[a] -= {n}
        at.update((names[k], home) for k in rows)
        part.rows |= rows
        part.links |= {body[a] for k in rows for a in by_name[names[k][0]].links}
        part.excess += 1
        is_rigid = len(part.rows) - part.excess == 3 * len(part.links) - 3
        if not homes or len(joined) > 1:
            for a in part.links:
                (rigid[a].add if is_rigid else rigid[a].discard)(home)
    found = [_named(part, names, by_name) for part in parts.values()]
    return tuple(sorted(found, key=lambda o: (o.links, o.pairs)))


def _named(part: _Part, names: Sequence[Condition], by_name: Mapping[str, Pair]) -> Overconstraint:
    conditions = {names[k] for k in part.rows}
    held = {name for name, _ in conditions}
    return Overconstraint(
        links=tuple(sorted({a for name in held for a in by_name[name].links})),
        pairs=tuple(sorted(held)),
        drivers=tuple(sorted(name for name, what in conditions if what == "drive")),
        excess=part.excess,
        turning_only=all(what == "turn" for _, what in conditions),
    )
