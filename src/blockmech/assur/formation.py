"""The formation sequence: links and pairs taken apart into drivers and Assur groups.

Every condition of a pair (two, three of a driven one) is given to a link that it places,
three to a link: a maximum matching. Links that wait for each other, the strongly connected
sets, are exactly the drivers and the minimal Assur groups, whichever matching was found
(Dulmage-Mendelsohn; [S11] calls it a pebble game). Linear for chains of dyads.

Source: [S11] Sljoka, Shai & Whiteley, Checking mobility and decomposition of linkages via
pebble game algorithm, ASME IDETC 2011.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import accumulate, chain
from typing import NamedTuple, TypeAlias

import networkx as nx
import numpy as np

from blockmech.assur.groups import DYADS, Pair, Unit, classify, joined, sorted_parts
from blockmech.assur.rigidity import TooTangledError, rigidity

Edge: TypeAlias = tuple[int | None, int | None, int]
"""Two nodes by number, None for all earlier links, and how many conditions join them."""


@dataclass(frozen=True)
class Formation:
    """Units in formation order, and the links that could not be placed.

    A unit comes as soon as the links that it waits for are there; of several, drivers
    first, then by the name of the first link.

    Attributes
    ----------
    units : drivers and groups in order
    rest : links that are not placed, sorted: over-constrained, loose, or waiting for such
    spare : pairs with a condition that no link is left to take, sorted
    """

    units: tuple[Unit, ...]
    rest: tuple[str, ...] = ()
    spare: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Every link is placed and no pair is left over."""
        return not self.rest and not self.spare

    def __str__(self) -> str:
        return " -> ".join(map(str, self.units))


def formation(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> Formation:
    """Drivers and minimal Assur groups in formation order.

    Parameters
    ----------
    links : the moving links; earlier ones among them are passed over
    pairs : the pairs between links and earlier links
    earlier : the frame and everything already placed
    drivers : names of the driven pairs; one between two links of which neither is placed
        before the other is part of a group

    Notes
    -----
    If the structure is not sound, the units are those that can be placed all the same;
    `diagnose` says what is wrong with the rest. Counting finds the groups; each is then
    checked by the rank of its own conditions, and one that is over-constrained inside
    (3n = 2p all the same) goes to the rest with everything that waits for it.
    """
    moving, ordered = sorted_parts(links, pairs, earlier, drivers)
    index = {a: v for v, a in enumerate(moving)}
    edges: list[Edge] = [
        (index.get(p.first), index.get(p.second), 3 if p.name in drivers else 2) for p in ordered
    ]
    assignment = _assign_conditions([3] * len(moving), edges)
    parts = nx.condensation(assignment.waits)
    part_of: Mapping[int, int] = parts.graph["mapping"]
    pairs_of: dict[int, list[Pair]] = defaultdict(list)
    for pair, takers in zip(ordered, assignment.takers, strict=True):
        if takers:  # by both links: then they wait for each other and are one part
            pairs_of[part_of[min(takers)]].append(pair)
    crowded = {v for e in assignment.spare for v in edges[e][:2] if v is not None}
    unsound = crowded.union(assignment.short, *nx.bfs_layers(assignment.waits, crowded))
    units: dict[int, Unit] = {}
    for n, members in parts.nodes(data="members"):
        if not unsound.intersection(members):
            unit = classify([moving[v] for v in members], pairs_of[n], drivers)
            if _is_determinate(unit):
                units[n] = unit
    bad = set(parts) - set(units)
    parts.remove_nodes_from(set().union(*nx.bfs_layers(parts.reverse(copy=False), bad)))
    order = _toposort(parts, {n: (unit.number > 1, min(unit.links)) for n, unit in units.items()})
    placed = {a for n in order for a in units[n].links}
    return Formation(
        units=tuple(units[n] for n in order),
        rest=tuple(a for a in moving if a not in placed),
        spare=tuple(ordered[e].name for e in assignment.spare),
    )


class _Given(NamedTuple):
    """Which node takes the conditions of which edge."""

    waits: nx.DiGraph[int]  # from each node to those at the other side of what it takes
    takers: list[set[int]]  # per edge
    spare: list[int]  # edges with a condition that is left over
    short: list[int]  # nodes with less than they need


def _assign_conditions(need: Sequence[int], edges: Sequence[Edge]) -> _Given:
    """Give the conditions of edges to the nodes that they join, as many as these need.

    A maximum flow from a source by the edges and the nodes to a sink. (SciPy's bipartite
    matching takes minutes for a chain of 300 dyads.)
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_flow

    n, source = len(need), len(need) + len(edges)
    number = [number for *_, number in edges]
    ends = [sorted({v for v in edge[:2] if v is not None}) for edge in edges]
    # rows of the network: nodes into the sink, edges into their nodes, the source into edges
    heads = [*[source + 1] * n, *chain(*ends), *range(n, source)]
    capacities = [
        *need,
        *chain(*([k] * len(v) for k, v in zip(number, ends, strict=True))),
        *number,
    ]
    first = [0, *accumulate([*[1] * n, *map(len, ends), len(edges), 0])]
    # SciPy's flow takes 32-bit indices alone, and before 1.14 does not convert others.
    parts = tuple(np.array(x, np.int32) for x in (capacities, heads, first))
    flow = maximum_flow(csr_array(parts, shape=(source + 2, source + 2)), source, source + 1).flow
    waits: nx.DiGraph[int] = nx.DiGraph()
    waits.add_nodes_from(range(n))
    takers: list[set[int]] = [set() for _ in edges]
    surplus, lacking = number.copy(), list(need)
    first, heads, capacities = (x.tolist() for x in (flow.indptr, flow.indices, flow.data))
    for e in range(len(edges)):
        for k in range(first[n + e], first[n + e + 1]):
            v, amount = heads[k], capacities[k]
            if amount > 0:
                takers[e].add(v)
                surplus[e] -= amount
                lacking[v] -= amount
                waits.add_edges_from((v, w) for w in edges[e][:2] if w not in (None, v))
    spare, short = ([k for k, number in enumerate(rest) if number] for rest in (surplus, lacking))
    return _Given(waits, takers, spare, short)


def _toposort(parts: nx.DiGraph[int], rank: Mapping[int, object]) -> list[int]:
    """Parts after those that they wait for, the lowest rank first."""
    return list(
        nx.lexicographical_topological_sort(parts.reverse(copy=False), key=rank.__getitem__)
    )


def _is_determinate(unit: Unit) -> bool:
    """Whether the unit's own conditions place its links, for generic lengths.

    By their rank, unless they are so many that counting must do.
    """
    if unit.kind == "driver":
        return True
    axes = [(p.kind, p.axis) for p in unit.pairs if p.axis]
    if unit.kind in DYADS and len(axes) == len(set(axes)):
        return True
    supports = {a for p in unit.outer for a in p.links}.difference(unit.links)
    with suppress(TooTangledError):
        return rigidity(unit.links, unit.pairs, supports, unit.driven).determinate
    return True


# Pins of three links and more.


def reseat(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> tuple[Pair, ...]:
    """Seat every pin of three links and more on the link that is placed first.

    A pin of m links is m - 1 pairs of one axis, and which links they join is free; this choice
    leaves the smallest groups. A pair that joins the same links as before keeps its name,
    others take the names left over. Driven pairs stay. The force of the old pair from a to b
    is the sum over the new pairs across the cut that removing it leaves; a pin with friction
    is better left alone (give its pairs no axis).
    """
    moving, ordered = sorted_parts(links, pairs, earlier, drivers)
    index = {a: v for v, a in enumerate(moving)}
    pins = [pin for pin in _pins(ordered) if _is_tree(pin, earlier)]
    pinned = {p.name for pin in pins for p in pin}
    # a pin is a node of two degrees of freedom that each of its links holds in place
    edges: list[Edge] = []
    for p in ordered:
        number = (p.name not in pinned) * 2 + (p.name in drivers)
        edges.append((index.get(p.first), index.get(p.second), number))
    for v, pin in enumerate(pins, start=len(moving)):
        edges += [(index.get(a), v, 2) for a in sorted({a for p in pin for a in p.links})]
    assignment = _assign_conditions([3] * len(moving) + [2] * len(pins), edges)
    parts = nx.condensation(assignment.waits)
    members: Mapping[int, set[int]] = dict(parts.nodes(data="members"))
    order = _toposort(parts, {n: min(part) for n, part in members.items()})
    position = {v: k for k, n in enumerate(order) for v in members[n]}
    rank = {a: (position[v], a) for a, v in index.items()} | {a: (-1, a) for a in earlier}
    seated = [pair for pin in pins for pair in _seat(pin, rank, drivers)]
    return tuple(
        sorted([p for p in ordered if p.name not in pinned] + seated, key=lambda p: p.name)
    )


def _pins(pairs: Iterable[Pair]) -> list[list[Pair]]:
    """R pairs of one axis that join each other, two and more."""
    shared = [p for p in pairs if p.kind == "R" and p.axis]
    parts = joined(((p.axis, p.first), (p.axis, p.second)) for p in shared)
    pins: dict[int, list[Pair]] = defaultdict(list)
    at = {node: n for n, part in enumerate(parts) for node in part}
    for p in shared:
        pins[at[p.axis, p.first]].append(p)
    return [pin for pin in pins.values() if len(pin) > 1]


def _is_tree(pin: Sequence[Pair], earlier: Collection[str]) -> bool:
    """Whether the pairs of a pin are none too many."""
    joined = {a for p in pin for a in p.links}
    return len(pin) == len(joined) - 1 and len(joined.intersection(earlier)) < 2


def _seat(
    pin: Sequence[Pair], rank: Mapping[str, tuple[int, str]], drivers: Collection[str]
) -> list[Pair]:
    """The pairs of one pin, each link on the first but for driven pairs."""
    seated = [p for p in pin if p.name in drivers]
    remaining = [p for p in pin if p.name not in drivers]
    lumps = joined([*((a,) for p in pin for a in p.links), *(p.links for p in seated)])
    seat, *rest = sorted((min(part, key=rank.__getitem__) for part in lumps), key=rank.__getitem__)
    for a in sorted(rest, key=lambda a: not any({seat, a} == set(p.links) for p in remaining)):
        ends = {seat, a}
        p = min(remaining, key=lambda p: (ends != set(p.links), a not in p.links, p.name))
        remaining.remove(p)
        seated.append(p if ends == set(p.links) else replace(p, first=seat, second=a))
    return seated
