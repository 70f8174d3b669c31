"""Pairs of one axis, and the link on which a pin of three links and more is seated.

R pairs whose places on a common link coincide turn about one point for good, P pairs whose
guides on a common link are parallel slide in one direction; counting has to know it. A pin of
m links is m - 1 pairs of one axis, and which links these join is free as far as the motion
goes, but not for the formation sequence.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Literal, NamedTuple

import networkx as nx

from blockmech.model.pebbles import GROUND, Edge, condense, in_order, place_pebbles, waits_for
from blockmech.model.rigidity import Pair, check_names

SAME = 1e-9
"""[-] of the size, or rad: places and directions on one link that are nearer are one."""


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
    not known, coincides with nothing.
    """
    graph: nx.Graph[str] = nx.Graph()
    on_links: dict[tuple[str, str], list[tuple[str, complex]]] = defaultdict(list)
    for side in sides:
        graph.add_node(side.pair)
        # a direction and its opposite have the same square
        value = side.at if side.kind == "R" else side.at * side.at * size
        on_links[side.link, side.kind].append((side.pair, value))
    for members in on_links.values():
        graph.add_edges_from(_near(members, SAME * size))
    found = dict.fromkeys(graph, "")
    for part in nx.connected_components(graph):
        if len(part) > 1:
            found.update(dict.fromkeys(part, min(part)))
    return found


def _near(members: list[tuple[str, complex]], tolerance: float) -> Iterable[tuple[str, str]]:
    """Names whose values are nearer than the tolerance, each with the first of its place."""
    cells: dict[tuple[int, int], list[tuple[str, complex]]] = defaultdict(list)
    for name, z in members:
        x, y = math.floor(z.real / tolerance), math.floor(z.imag / tolerance)
        around = [cells.get((x + i, y + j), ()) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        near = [other for cell in around for other, w in cell if abs(z - w) <= tolerance]
        for other in near:
            yield other, name
        if not near:
            cells[x, y].append((name, z))


def carriers(pairs: Iterable[Pair], earlier: Collection[str]) -> set[str]:
    """Links that only carry a pin of others, which might as well sit on each other.

    All their pairs, which are taken as undriven, are R pairs of one axis, of which there is
    none too many. Earlier links are one body.
    """
    axes_on: dict[str, set[str]] = defaultdict(set)
    shared: dict[str, nx.MultiGraph[str]] = defaultdict(nx.MultiGraph)
    body: dict[str, str] = {}
    for p in pairs:
        body.update({a: "" if a in earlier else a for a in p.links})
        axis = p.axis if p.kind == "R" else ""
        for a in p.links:
            axes_on[body[a]].add(axis)
        shared[axis].add_edge(*(body[a] for a in p.links))
    trees = {axis for axis, graph in shared.items() if axis and nx.is_forest(graph)}
    return {a for a, b in body.items() if len(axes_on[b]) == 1 and axes_on[b] <= trees}


def reseat(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> tuple[Pair, ...]:
    """Seat every pin of three links and more on the link that is placed first.

    A pin of m links is m - 1 pairs of one axis, and which links they join is free: the
    motion is the same. A poor choice makes dyads wait for each other, as if they were a
    group of a higher class; this choice leaves the smallest groups. A pair that joins the
    same links as before keeps its name, others take the names left over. Driven pairs
    stay. The force of the old pair from a to b is the sum over the new pairs from the
    links at a's side to those at b's side, the old pair cut; friction belongs to the pairs
    as they were, so a pin with friction is better left alone (give its pairs no axis).
    """
    moving, ordered = sorted(set(links) - set(earlier)), sorted(pairs, key=lambda p: p.name)
    check_names(moving, ordered, earlier, drivers)
    pins = [pin for pin in _pins(ordered) if _is_tree(pin, earlier)]
    pinned = {p.name for pin in pins for p in pin}
    index = {a: k for k, a in enumerate(moving)}
    edges: list[Edge] = []
    for p in ordered:
        number = (p.name not in pinned) * 2 + (p.name in drivers)
        edges.append((index.get(p.first, GROUND), index.get(p.second, GROUND), number))
    for k, pin in enumerate(pins, start=len(moving)):
        edges += [(index.get(a, GROUND), k, 2) for a in sorted({a for p in pin for a in p.links})]
    need = [3] * len(moving) + [2] * len(pins)
    parts, ahead = condense(waits_for(place_pebbles(need, edges), edges, len(need)))
    order = in_order(ahead, {n: (False, part[0]) for n, part in enumerate(parts)})
    place = {v: k for k, n in enumerate(order) for v in parts[n]}
    rank = {a: (place[v], a) for a, v in index.items()} | {a: (-1, a) for a in earlier}
    seated = [pair for pin in pins for pair in _seat(pin, rank, drivers)]
    return tuple(
        sorted([p for p in ordered if p.name not in pinned] + seated, key=lambda p: p.name)
    )


def _pins(pairs: Iterable[Pair]) -> list[list[Pair]]:
    """R pairs of one axis that join each other, two and more."""
    graph: nx.Graph[tuple[str, str]] = nx.Graph()
    shared = [p for p in pairs if p.kind == "R" and p.axis]
    graph.add_edges_from(((p.axis, p.first), (p.axis, p.second)) for p in shared)
    found: dict[int, list[Pair]] = defaultdict(list)
    at = {node: n for n, part in enumerate(nx.connected_components(graph)) for node in part}
    for p in shared:
        found[at[p.axis, p.first]].append(p)
    return [pin for pin in found.values() if len(pin) > 1]


def _is_tree(pin: Sequence[Pair], earlier: Collection[str]) -> bool:
    """Whether the pairs of a pin are none too many."""
    joined = {a for p in pin for a in p.links}
    return len(pin) == len(joined) - 1 and len(joined.intersection(earlier)) < 2


def _seat(
    pin: Sequence[Pair], rank: Mapping[str, tuple[int, str]], drivers: Collection[str]
) -> list[Pair]:
    """The pairs of one pin, each link on the first but for driven pairs."""
    seated = [p for p in pin if p.name in drivers]
    left = [p for p in pin if p.name not in drivers]
    lumps: nx.Graph[str] = nx.Graph()
    lumps.add_nodes_from(a for p in pin for a in p.links)
    lumps.add_edges_from(p.links for p in seated)
    seat, *others = sorted(
        (min(part, key=lambda a: rank[a]) for part in nx.connected_components(lumps)),
        key=lambda a: rank[a],
    )
    for a in sorted(others, key=lambda a: not any({seat, a} == set(p.links) for p in left)):
        ends = {seat, a}
        p = min(left, key=lambda p: (ends != set(p.links), a not in p.links, p.name))
        left.remove(p)
        seated.append(p if ends == set(p.links) else Pair(p.name, seat, a, "R", p.axis))
    return seated
