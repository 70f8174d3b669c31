"""The formation sequence: links and pairs taken apart into drivers and Assur groups.

Every pair (two conditions, a driven one three) is given to the links that it places,
three conditions a link: pebbles that are moved along chains of pairs until all fit. A
link that takes a condition of a pair *waits* for the link at its other side, and the
links that wait for each other, the strongly connected sets, are exactly the drivers and
the minimal Assur groups, whichever way the pebbles came to lie ([S11]). Linear for
chains of dyads. Nothing here is recursive.

Class of a group (after Artobolevsky): two links and three pairs are a dyad, class II. Else
the class is the number of pairs of its richest closed contour, which is either one link
with its inner pairs (a rigid contour: a ternary link gives class III, the triad) or a
closed loop of links, each inner pair counted by its shortest loop (four sides: class IV).
Driven pairs inside a group count as welded.

Sources: [S11] Sljoka, Shai & Whiteley, Checking mobility and decomposition of linkages via
pebble game algorithm, ASME IDETC 2011; [A88] Artobolevsky, Theory of mechanisms, 1988.
"""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict, deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import networkx as nx

from blockmech.model.rigidity import (
    MOST_WORK,
    Loose,
    Overconstraint,
    Pair,
    TooTangledError,
    check_names,
    rigidity,
)

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


@dataclass(frozen=True)
class Formation:
    """Units in formation order, and what could not be placed.

    A unit comes as soon as the links that it waits for are there; of several, drivers
    first, then by the name of the first link.

    Attributes
    ----------
    units : drivers and groups in order
    rest : links that are not placed, sorted: over-constrained, loose, or waiting for such
    spare : pairs with a condition that no link is left to take, sorted
    """

    units: tuple[Unit, ...]
    rest: tuple[str, ...]
    spare: tuple[str, ...]

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
    moving = sorted(set(links) - set(earlier))
    ordered = sorted(pairs, key=lambda p: p.name)
    check_names(moving, ordered, earlier, drivers)
    index = {a: k for k, a in enumerate(moving)}
    edges = [
        (index.get(p.first, GROUND), index.get(p.second, GROUND), 3 if p.name in drivers else 2)
        for p in ordered
    ]
    pebbles = _place_pebbles([3] * len(moving), edges)
    unplaceable = pebbles.crowded.union(pebbles.short)
    parts, ahead = _condense(_waits(pebbles, edges, len(moving)))
    part_of = {v: n for n, part in enumerate(parts) for v in part}
    own: list[list[Pair]] = [[] for _ in parts]
    for pair, (a, b, _), (at_a, at_b) in zip(ordered, edges, pebbles.taken, strict=True):
        if at_a or at_b:  # by both: then they wait for each other and are one part
            own[part_of[a if at_a else b]].append(pair)
    units: dict[int, Unit] = {}
    for n, part in enumerate(parts):
        if not unplaceable.intersection(part):
            unit = classify([moving[v] for v in part], own[n], drivers)
            if _holds(unit):
                units[n] = unit
    rank = {n: (unit.number > 1, parts[n][0]) for n, unit in units.items()}
    order = _in_order({n: ahead[n] for n in units}, rank)
    placed = {a for n in order for a in units[n].links}
    return Formation(
        units=tuple(units[n] for n in order),
        rest=tuple(a for a in moving if a not in placed),
        spare=tuple(p.name for p, n in zip(ordered, pebbles.left, strict=True) if n),
    )


@dataclass(frozen=True)
class Waiting:
    """What links that wait for each other are.

    Attributes
    ----------
    units : the groups that they are, if they can be placed: one Assur group as a rule
    overconstrained, loose : what is wrong otherwise
    text : the same as a sentence
    """

    units: tuple[Unit, ...]
    overconstrained: tuple[Overconstraint, ...]
    loose: tuple[Loose, ...]
    text: str

    @property
    def is_group(self) -> bool:
        """Whether the links are one Assur group."""
        return len(self.units) == 1


def waiting(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> Waiting:
    """Whether links that wait for each other are an Assur group, and if not why.

    Parameters as of `formation`: the links of a cycle of blocks, the pairs between them
    and to earlier links (of which only those that they are wired to matter).
    """
    moving, ordered = sorted(set(links) - set(earlier)), list(pairs)
    found = formation(moving, ordered, earlier, drivers)
    names = ", ".join(moving)
    if found.complete:
        text = f"the links can be placed in the order {found}"
        if len(found.units) == 1:
            unit = found.units[0]
            text = f"{names} are one Assur group of class {roman(unit.number)}"
            text += f" with {len(unit.links)} links and {len(unit.pairs)} pairs"
        return Waiting(found.units, (), (), text)
    state = rigidity(moving, ordered, earlier, drivers)
    reasons = [f"over-constrained: {', '.join(o.links)}" for o in state.overconstrained]
    reasons += [f"loose: {', '.join(part.links)}" for part in state.loose]
    text = f"{names} are no Assur group; {'; '.join(reasons)}"
    return Waiting((), state.overconstrained, state.loose, text)


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
    parts, ahead = _condense(_waits(_place_pebbles(need, edges), edges, len(need)))
    order = _in_order(ahead, {n: (False, part[0]) for n, part in enumerate(parts)})
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


GROUND = -1
"""Number that stands for all earlier links together."""

Edge: TypeAlias = tuple[int, int, int]
"""Two links by number (or GROUND) and the conditions of the pair between them."""


class _Pebbles(NamedTuple):
    """Which link takes how many conditions of each pair."""

    taken: list[list[int]]  # per pair: by its first and by its second link
    left: list[int]  # per pair: taken by none
    short: list[int]  # links with less than they need
    crowded: set[int]  # links among which there are more conditions than they can take


def _place_pebbles(need: Sequence[int], edges: Sequence[Edge]) -> _Pebbles:
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
    return _Pebbles(taken, left, [v for v, number in enumerate(free) if number], crowded)


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


def _waits(pebbles: _Pebbles, edges: Sequence[Edge], number: int) -> Mapping[int, set[int]]:
    """For each link the links at the other side of the conditions that it takes."""
    waits: dict[int, set[int]] = {v: set() for v in range(number)}
    for (a, b, _), (at_a, at_b) in zip(edges, pebbles.taken, strict=True):
        if GROUND not in (a, b):
            if at_a:
                waits[a].add(b)
            if at_b:
                waits[b].add(a)
    return waits


def _condense(waits: Mapping[int, set[int]]) -> tuple[list[list[int]], dict[int, set[int]]]:
    """Sets of links that wait for each other, and for each set those that it waits for."""
    parts = [sorted(part) for part in nx.strongly_connected_components(nx.DiGraph(waits))]
    part_of = {v: n for n, part in enumerate(parts) for v in part}
    ahead = {n: {part_of[w] for v in part for w in waits[v]} - {n} for n, part in enumerate(parts)}
    return parts, ahead


def _in_order(ahead: Mapping[int, set[int]], rank: Mapping[int, tuple[bool, int]]) -> list[int]:
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


# What a unit is called.


def classify(links: Iterable[str], pairs: Iterable[Pair], drivers: Collection[str] = ()) -> Unit:
    """Kind and class of a group whose links and pairs are known; it is not checked.

    The pairs are those between its links and to earlier ones, the driven ones included.
    """
    names = sorted(links)
    ordered = sorted(pairs, key=lambda p: p.name)
    inner = tuple(p for p in ordered if p.first in names and p.second in names)
    outer = tuple(p for p in ordered if not (p.first in names and p.second in names))
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
    number = _class_number(names, inner, driven)
    return Unit(tuple(arranged), inner, outer, driven, kind, number)


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


def _class_number(names: Iterable[str], inner: Sequence[Pair], driven: Collection[str]) -> int:
    """Pairs of the richest closed contour: a link's inner pairs, or a loop's sides."""
    welded: nx.Graph[str] = nx.Graph()
    welded.add_nodes_from(names)
    welded.add_edges_from(p.links for p in inner if p.name in driven)
    body = {a: min(part) for part in nx.connected_components(welded) for a in part}
    joints = [(body[p.first], body[p.second]) for p in inner if p.name not in driven]
    on_one = Counter(a for joint in joints for a in joint)
    near: dict[str, list[str]] = defaultdict(list)
    for a, b in joints:
        near[a].append(b)
        near[b].append(a)
    return max([2, *on_one.values(), *(_shortest_loop(near, a, b) for a, b in joints)])


def _shortest_loop(near: Mapping[str, Sequence[str]], a: str, b: str) -> int:
    """Sides of the shortest loop through a pair of links a and b, 0 if there is none."""
    if near[a].count(b) > 1:
        return 2
    reached, shell, sides = {a}, [c for c in near[a] if c != b], 2
    while shell:
        if b in shell:
            return sides
        reached.update(shell)
        shell = [d for c in shell for d in near[c] if d not in reached]
        sides += 1
    return 0


def _holds(unit: Unit) -> bool:
    """Whether the unit's own conditions place its links, for generic lengths.

    By their rank, unless they are so many that counting must do.
    """
    if unit.kind == "driver":
        return True
    axes = [(p.kind, p.axis) for p in unit.pairs if p.axis]
    if unit.kind in DYADS and len(axes) == len(set(axes)):
        return True
    others = {a for p in unit.outer for a in p.links}.difference(unit.links)
    with suppress(TooTangledError):
        return rigidity(unit.links, unit.pairs, others, unit.driven, MOST_WORK).determinate
    return True


def roman(number: int) -> str:
    """A class as it is written: I, II, III, IV ..."""
    text = ""
    for value, letters in ((10, "X"), (9, "IX"), (5, "V"), (4, "IV"), (1, "I")):
        text += letters * (number // value)
        number %= value
    return text
