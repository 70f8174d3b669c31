"""Pebbles: every condition of a pair given to a link that it places.

A link needs so many conditions and takes them from its pairs, like pebbles that are moved
along chains of pairs until all fit. A link that takes a condition of a pair *waits* for the
link at its other side; links that wait for each other are placed together, and the sets of
them in the order in which they wait. Links are numbers here, and nothing is recursive.

Source: [S11] Sljoka, Shai & Whiteley, Checking mobility and decomposition of linkages via
pebble game algorithm, ASME IDETC 2011.
"""

from __future__ import annotations

import heapq
from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import networkx as nx

GROUND = -1
"""Number that stands for all earlier links together."""

Edge: TypeAlias = tuple[int, int, int]
"""Two links by number (or GROUND) and the conditions of the pair between them."""


class Pebbles(NamedTuple):
    """Which link takes how many conditions of each pair."""

    taken: list[list[int]]  # per pair: by its first and by its second link
    left: list[int]  # per pair: taken by none
    short: list[int]  # links with less than they need
    crowded: set[int]  # links among which there are more conditions than they can take


def place_pebbles(need: Sequence[int], edges: Sequence[Edge]) -> Pebbles:
    """Give every condition to a link of its pair, as many as fit.

    Pairs with one end full or on the ground go first, as they have no choice; where a
    condition is left over, others are moved along a chain of pairs to make room.
    """
    free = list(need)
    left = [number for *_, number in edges]
    taken = [[0, 0] for _ in edges]
    at: list[list[int]] = [[] for _ in need]
    for e, (a, b, _) in enumerate(edges):
        for v in {a, b} - {GROUND}:
            at[v].append(e)
    forced = [e for e, (a, b, _) in enumerate(edges) if GROUND in (a, b)]

    def room(v: int) -> int:
        return 0 if v == GROUND else free[v]

    def give(e: int, side: int, number: int) -> None:
        v = edges[e][side]
        taken[e][side] += number
        left[e] -= number
        free[v] -= number
        if not free[v]:
            forced.extend(other for other in at[v] if left[other])

    for e in range(len(edges)):
        while True:
            while forced:
                f = forced.pop()
                a, b, _ = edges[f]
                if room(a) and room(b):
                    continue
                side = 0 if room(a) else 1
                if number := min(left[f], room(edges[f][side])):
                    give(f, side, number)
            a, b, _ = edges[e]
            if not left[e] or not (room(a) or room(b)):
                break
            give(e, 0 if room(a) >= room(b) else 1, 1)

    crowded: set[int] = set()
    for e, number in enumerate(left):
        for _ in range(number):
            if not _make_room(e, edges, at, taken, free, crowded):
                break
            left[e] -= 1
    return Pebbles(taken, left, [v for v, number in enumerate(free) if number], crowded)


def _make_room(
    e: int,
    edges: Sequence[Edge],
    at: Sequence[Sequence[int]],
    taken: list[list[int]],
    free: list[int],
    crowded: set[int],
) -> bool:
    """Let a link of pair e take one condition more, moving others away; or find it crowded."""
    came: dict[int, tuple[int, int]] = {v: (GROUND, e) for v in edges[e][:2] if v != GROUND}
    queue = deque(came)
    while queue:
        v = queue.popleft()
        if v in crowded:
            continue
        if free[v]:
            free[v] -= 1
            while v != GROUND:
                u, f = came[v]
                taken[f][edges[f].index(v)] += 1
                if u != GROUND:
                    taken[f][edges[f].index(u)] -= 1
                v = u
            return True
        for f in at[v]:
            a, b, _ = edges[f]
            w = b if v == a else a
            if w != GROUND and w not in came and taken[f][0 if v == a else 1]:
                came[w] = (v, f)
                queue.append(w)
    crowded.update(came)
    return False


def waits_for(pebbles: Pebbles, edges: Sequence[Edge], number: int) -> Mapping[int, set[int]]:
    """For each link the links at the other side of the conditions that it takes."""
    waits: dict[int, set[int]] = {v: set() for v in range(number)}
    for (a, b, _), (at_a, at_b) in zip(edges, pebbles.taken, strict=True):
        if GROUND not in (a, b):
            if at_a:
                waits[a].add(b)
            if at_b:
                waits[b].add(a)
    return waits


def condense(waits: Mapping[int, set[int]]) -> tuple[list[list[int]], dict[int, set[int]]]:
    """Sets of links that wait for each other, and for each set those that it waits for."""
    parts = [sorted(part) for part in nx.strongly_connected_components(nx.DiGraph(waits))]
    part_of = {v: n for n, part in enumerate(parts) for v in part}
    ahead = {n: {part_of[w] for v in part for w in waits[v]} - {n} for n, part in enumerate(parts)}
    return parts, ahead


def in_order(ahead: Mapping[int, set[int]], rank: Mapping[int, tuple[bool, int]]) -> list[int]:
    """Topological order of the parts, the lowest rank first; what waits in vain is left out."""
    behind: dict[int, list[int]] = defaultdict(list)
    missing = {}
    for n, before in ahead.items():
        missing[n] = len(before)
        for m in before:
            behind[m].append(n)
    ready = [(rank[n], n) for n, number in missing.items() if not number]
    heapq.heapify(ready)
    order = []
    while ready:
        n = heapq.heappop(ready)[1]
        order.append(n)
        for m in behind[n]:
            missing[m] -= 1
            if not missing[m]:
                heapq.heappush(ready, (rank[m], m))
    return order
