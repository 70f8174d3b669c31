"""Which links can move, which are determined, and which are held more than once.

Structure alone, no lengths: every link has three degrees of freedom, a pair (R or P) takes
two of them and a driver a third. Counting 3n - 2p is not enough, as one part may
be over-constrained while another is loose, so the *generic rank* of the velocity
conditions decides, exactly as it would for lengths chosen at random. For R pairs
on axes of their own it is what the (3, 3) pebble game on links counts, 2p' <= 3n' - 3
for every set of links ([T89]); counting is wrong for pins of three links and more
(their pairs share one axis) and for loops of P pairs (the relative turning is held
once too often), the rank is right for both.

The rank is that of sparse conditions in integers modulo a prime, without rounding and tolerance: a
chain of a hundred links has motions that differ by twenty powers of ten from its first link to its
last, so the rank of a matrix of floats is a guess there; here it is exact.

Coordinates are made from the names of the pairs, so the answer is the same in any order.
By the Schwartz-Zippel lemma a structure with N conditions is misjudged with a chance
below N^2 / 2^60. Linear for chains of dyads.

Sources: [T89] Tay, Linking (n-2)-dimensional panels in n-space II, Graphs Combin. 5
(1989); [J97] Jacobs & Hendrickson, The pebble game, J. Comput. Phys. 137 (1997).
"""

from __future__ import annotations

import hashlib
import heapq
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import networkx as nx

from blockmech.assur.groups import Pair, sorted_parts

PRIME = 2**61 - 1
"""Modulus of the arithmetic: a Mersenne prime that fits a machine word."""

Row: TypeAlias = dict[int, int]
"""A condition: column -> coefficient."""

MOST_WORK = 5_000_000
"""Steps of elimination that take about a second; a chain of 1,000 dyads takes 100,000."""


class TooTangledError(ValueError):
    """So many links in loops with each other that the rank would take too long."""


class Pivot(NamedTuple):
    """A condition solved for its first column: x[column] = -sum(row * x)."""

    row: Row  # without the pivot's own column, whose coefficient is 1
    source: int  # number of the condition that it came from
    scale: int  # what the reduced condition was multiplied by
    used: Row  # pivot that was taken away, by its column -> factor


class Echelon:
    """Conditions in echelon form modulo the prime.

    Columns are solved for in their order; neighbours near each other keep rows short. Raises
    `TooTangledError` after `MOST_WORK` steps.
    """

    def __init__(self, columns: int, conditions: Sequence[Row]) -> None:
        self.conditions = conditions
        self.left = MOST_WORK
        self.pivots: dict[int, Pivot] = {}  # by the column that each is solved for
        self.redundant: list[int] = []  # conditions that those before them imply
        for source, condition in enumerate(conditions):
            full = len(self.pivots) == columns
            row, used = ({}, {}) if full else self._reduce(condition)
            if row:
                lead = min(row)
                scale = pow(row.pop(lead), -1, PRIME)
                solved = {c: value * scale % PRIME for c, value in row.items()}
                self.pivots[lead] = Pivot(solved, source, scale, used)
            else:
                self.redundant.append(source)

    def _reduce(self, condition: Row) -> tuple[Row, Row]:
        """What is left of a condition, and the pivots taken away with their factors."""
        row, used = dict(condition), dict[int, int]()
        while row and (pivot := self.pivots.get(lead := min(row))):
            used[lead] = factor = row.pop(lead)
            self._spend_steps(1 + len(pivot.row))
            for c, value in pivot.row.items():
                rest = (row.get(c, 0) - factor * value) % PRIME
                if rest:
                    row[c] = rest
                else:
                    row.pop(c, None)
        return row, used

    def _spend_steps(self, steps: int) -> None:
        self.left -= steps
        if self.left < 0:
            raise TooTangledError

    def circuit(self, source: int) -> set[int]:
        """The conditions that a redundant one depends on, and itself."""
        weight, sources = self._reduce(self.conditions[source])[1], {source}
        waiting = [(-self.pivots[column].source, column) for column in weight]
        heapq.heapify(waiting)
        while waiting:  # later pivots first: they only use earlier ones
            column = heapq.heappop(waiting)[1]
            pivot = self.pivots[column]
            amount = weight[column] * pivot.scale % PRIME
            if amount:
                sources.add(pivot.source)
                self._spend_steps(4 * (1 + len(pivot.used)))  # a heap costs more than a row
                for earlier, factor in pivot.used.items():
                    if earlier not in weight:
                        heapq.heappush(waiting, (-self.pivots[earlier].source, earlier))
                    weight[earlier] = (weight.get(earlier, 0) - amount * factor) % PRIME
        return sources

    def solution(self, free: Sequence[int]) -> Sequence[int]:
        """Values of all columns that meet the conditions, as given where a column is free."""
        value = list(free)
        for column in sorted(self.pivots, reverse=True):
            value[column] = -sum(f * value[c] for c, f in self.pivots[column].row.items()) % PRIME
        return value


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
    """Links that still move, joined to each other, and the degrees of freedom they have left."""

    links: tuple[str, ...]
    freedom: int


@dataclass(frozen=True)
class Rigidity:
    """What a structure can do, its drivers held.

    Attributes
    ----------
    mobility : degrees of freedom left, for generic lengths
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


class Condition(NamedTuple):
    """A condition of a pair."""

    pair: Pair
    what: str  # "place" (R), "turn", "slide" (P) or "drive"
    row: Row


Twist: TypeAlias = tuple[int, int, int]
"""Velocity of a link's point at the common origin, and its rate."""


def rigidity(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> Rigidity:
    """Mobility, over-constrained sets, loose links and rigid clusters.

    Parameters
    ----------
    links : the moving links; earlier ones among them are passed over
    pairs : the pairs between links and earlier links
    earlier : the frame and everything already placed, one body for this purpose
    drivers : names of the driven pairs

    Notes
    -----
    Rank, a random motion and the self-stresses of the generic velocity conditions.
    Whichever order the arguments have, the answer is the same. Raises `TooTangledError`
    where very many links stand in loops with each other.
    """
    moving, ordered = sorted_parts(links, pairs, earlier, drivers)
    # Order of elimination that keeps rows short: neighbours near each other.
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(moving)
    graph.add_edges_from(p.links for p in ordered if p.first in graph and p.second in graph)
    names = list(nx.utils.reverse_cuthill_mckee_ordering(graph))
    column = {a: 3 * k for k, a in enumerate(names)}
    conditions = [c for pair in ordered for c in _conditions(pair, column, pair.name in drivers)]
    system = Echelon(3 * len(names), [c.row for c in conditions])
    value = system.solution([_random_numbers(f"{k} of {a}")[0] for a in names for k in range(3)])
    twist = {a: (value[c], value[c + 1], value[c + 2]) for a, c in column.items()}
    free = {a: sum(c + k not in system.pivots for k in range(3)) for a, c in column.items()}
    return Rigidity(
        mobility=3 * len(moving) - len(system.pivots),
        counted=3 * len(moving) - len(conditions),
        overconstrained=_overconstrained(system, conditions),
        loose=_loose(twist, free, ordered),
        clusters=_clusters(twist, ordered),
    )


def _random_numbers(text: str) -> tuple[int, int]:
    """Two numbers of the field that look random but depend on the text only."""
    digest = hashlib.blake2b(text.encode(), digest_size=16).digest()
    return int.from_bytes(digest[:8], "big") % PRIME, int.from_bytes(digest[8:], "big") % PRIME


def _conditions(pair: Pair, column: Mapping[str, int], driven: bool) -> Iterator[Condition]:
    """The conditions of a pair on the twists of its links; two are welded if these are equal."""

    def difference(*coefficients: int) -> Row:
        row: Row = {}
        for link, sign in ((pair.first, 1), (pair.second, -1)):
            for k, value in enumerate(coefficients if link in column else ()):
                c = column[link] + k
                row[c] = (row.get(c, 0) + sign * value) % PRIME
        return {c: value for c, value in row.items() if value}

    # point of an R pair, normal of a P pair's direction
    x, y = _random_numbers(f"{pair.kind} axis {pair.axis}" if pair.axis else f"pair {pair.name}")
    if pair.kind == "R":
        yield Condition(pair, "place", difference(1, 0, -y))
        yield Condition(pair, "place", difference(0, 1, x))
    else:
        yield Condition(pair, "turn", difference(0, 0, 1))
        yield Condition(pair, "slide", difference(x, y, 0))
    if driven:
        yield Condition(
            pair, "drive", difference(0, 0, 1) if pair.kind == "R" else difference(-y, x, 0)
        )


def _overconstrained(
    system: Echelon, conditions: Sequence[Condition]
) -> tuple[Overconstraint, ...]:
    """Circuits that share a condition joined: the components of the matroid."""
    named = [(c.pair.name, c.what) for c in conditions]  # both of a place are one condition
    graph: nx.Graph[tuple[str, str]] = nx.Graph()
    for source in system.redundant:
        nx.add_star(graph, [named[source], *(named[k] for k in system.circuit(source))])
    excess = Counter(named[k] for k in system.redundant)
    first = dict(zip(named, conditions, strict=True))
    parts = []
    for part in nx.connected_components(graph):
        conditions = [first[name] for name in part]
        parts.append(
            Overconstraint(
                links=tuple(sorted({a for c in conditions for a in c.pair.links})),
                pairs=tuple(sorted({c.pair.name for c in conditions})),
                drivers=tuple(sorted(c.pair.name for c in conditions if c.what == "drive")),
                excess=sum(excess[name] for name in part),
                turning_only=all(c.what == "turn" for c in conditions),
            )
        )
    return tuple(sorted(parts, key=lambda o: (o.links, o.pairs)))


def _loose(
    twist: Mapping[str, Twist], free: Mapping[str, int], pairs: Iterable[Pair]
) -> tuple[Loose, ...]:
    """Links that a random motion moves, in sets that pairs join."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(a for a, motion in twist.items() if any(motion))
    graph.add_edges_from(p.links for p in pairs if p.first in graph and p.second in graph)
    parts = sorted(tuple(sorted(part)) for part in nx.connected_components(graph))
    return tuple(Loose(part, sum(free[a] for a in part)) for part in parts)


def _clusters(twist: Mapping[str, Twist], pairs: Iterable[Pair]) -> tuple[tuple[str, ...], ...]:
    """Links that a random motion moves alike."""
    bodies: dict[Twist, set[str]] = defaultdict(set)
    for a in {a for pair in pairs for a in pair.links}.union(twist):
        bodies[twist.get(a, (0, 0, 0))].add(a)
    return tuple(sorted(tuple(sorted(part)) for part in bodies.values() if len(part) > 1))
