"""Places of a block diagram: boxes in layers, in an order with few crossings.

Columns are layers, from left to right; places within a column are whole *rows*, so
that wires are straight or clearly stepped. A wire that passes a layer holds a row
of its own there, so it never runs through a box.

Sources: Sugiyama, Tagawa & Toda 1981 (layers, barycentre); the rows minimise the
sum of steps, column by column, by isotonic regression with medians (Ayer et al.
1955; pooling adjacent violators).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

SWEEPS = 12  # more change nothing on diagrams of a hundred blocks
AIR = 1  # rows between two boxes of a layer


@dataclass(frozen=True)
class Box:
    """What the layout knows of a block.

    ``head`` rows stand above the first port, ``above`` rows over the box are kept
    free; ``ports`` are the names on the left edge; ``width`` is in points.
    """

    name: str
    width: float
    ports: tuple[str, ...] = ()
    head: int = 2
    above: int = 0
    first: bool = False  # stands in the first layer, alone


class Ends(NamedTuple):
    """A wire from a marker of one box to a port of another."""

    source: str
    marker: str
    target: str
    port: str


@dataclass
class Slot:
    """A place in a layer: a box, or the row of a wire that passes."""

    key: str
    box: Box | None = None
    height: int = 1
    row: int = 0  # of the first row, ``above`` included
    left: list[int] = field(default_factory=list)  # segments that come from the left
    right: list[int] = field(default_factory=list)  # and that leave to the right

    def pin(self, k: int) -> int:
        """Offset of the pin number k from the slot's first row."""
        return 0 if self.box is None else self.box.above + self.box.head + k


@dataclass
class Segment:
    """A wire's way between two neighbouring layers: pins of slots on both sides."""

    wire: int
    source: Slot
    target: Slot
    out: int = 0  # which pin on the source's right
    into: int = 0  # which pin on the target's left
    weight: int = 1

    @property
    def rows(self) -> tuple[int, int]:
        """Rows of its two ends."""
        return (
            self.source.row + self.source.pin(self.out),
            self.target.row + self.target.pin(self.into),
        )


@dataclass
class Layered:
    """Boxes in layers with rows, and the segments between the layers."""

    layers: list[list[Slot]]
    segments: list[Segment]
    backward: dict[int, tuple[int, int]]  # wire -> pins of its source and its target
    layer: Mapping[str, int]

    def slot(self, box: str) -> Slot:
        """The slot of a box."""
        return next(s for s in self.layers[self.layer[box]] if s.key == box)


def layers_of(boxes: Sequence[Box], wires: Sequence[Ends]) -> tuple[dict[str, int], set[int]]:
    """Layer of every box (topological generations), and the wires that go backward.

    Where blocks wait for each other, the earliest of ``boxes`` is taken first.
    """
    feeds: dict[str, set[str]] = {b.name: set() for b in boxes}
    for wire in wires:
        if wire.source != wire.target:
            feeds[wire.target].add(wire.source)
    lowest = 1 if any(b.first for b in boxes) else 0
    layer: dict[str, int] = {}
    waiting = list(boxes)
    while waiting:
        ready = [b for b in waiting if feeds[b.name] <= layer.keys()] or waiting[:1]
        for box in ready:
            above = [layer[s] for s in feeds[box.name] if s in layer]
            layer[box.name] = 0 if box.first else max([lowest, *(n + 1 for n in above)])
        waiting = [b for b in waiting if b.name not in layer]
    backward = {i for i, w in enumerate(wires) if layer[w.source] >= layer[w.target]}
    return layer, backward


def arrange(boxes: Sequence[Box], wires: Sequence[Ends]) -> Layered:
    """Lay out a diagram: layers, order, pins and rows. The same for the same input."""
    layer, backward = layers_of(boxes, wires)
    made = _slots(boxes, wires, layer, backward)
    _order(made)
    _pins(made, wires)
    for slots in made.layers:
        for slot in slots:
            if slot.box is not None:
                left = max(len(slot.box.ports), 1 + max(_into(made, wires, slot), default=-1))
                right = len(slot.right) + sum(wires[i].source == slot.key for i in backward)
                slot.height = slot.box.above + slot.box.head + max(left, right)
    _rows(made)
    return made


def _slots(
    boxes: Sequence[Box], wires: Sequence[Ends], layer: Mapping[str, int], backward: set[int]
) -> Layered:
    layers: list[list[Slot]] = [[] for _ in range(max(layer.values(), default=0) + 1)]
    at = {b.name: Slot(b.name, b) for b in boxes}
    for box in boxes:
        layers[layer[box.name]].append(at[box.name])
    segments: list[Segment] = []
    for i, wire in enumerate(wires):
        if i in backward:
            continue
        chain = [at[wire.source]]
        for k in range(layer[wire.source] + 1, layer[wire.target]):
            chain.append(Slot(f"wire {i}"))
            layers[k].append(chain[-1])
        chain.append(at[wire.target])
        for a, b in pairwise(chain):
            passing = (a.box is None) + (b.box is None)
            segments.append(Segment(i, a, b, weight=(1, 2, 8)[passing]))
            a.right.append(len(segments) - 1)
            b.left.append(len(segments) - 1)
    return Layered(layers, segments, dict.fromkeys(sorted(backward), (0, 0)), layer)


# -- order ---------------------------------------------------------------------------


def _order(made: Layered) -> None:
    """Sort each layer by the mean place of its neighbours; keep the best of all sweeps."""
    best = [list(slots) for slots in made.layers]
    fewest = _crossings(made)
    for sweep in range(2 * SWEEPS):
        down = sweep % 2 == 0
        for slots in made.layers[1:] if down else reversed(made.layers[:-1]):
            place = _places(made)
            means = {}
            for k, slot in enumerate(slots):
                near = [
                    place[id(made.segments[s].source if down else made.segments[s].target)]
                    for s in (slot.left if down else slot.right)
                ]
                means[id(slot)] = sum(near) / len(near) if near else float(k)
            slots.sort(key=lambda s: means[id(s)])
        count = _crossings(made)
        if count < fewest:
            best, fewest = [list(slots) for slots in made.layers], count
        if fewest == 0:
            break
    made.layers[:] = best


def _places(made: Layered) -> dict[int, int]:
    return {id(slot): k for slots in made.layers for k, slot in enumerate(slots)}


def _crossings(made: Layered) -> int:
    """Pairs of segments that cross, whatever the order of pins on their boxes."""
    place = _places(made)
    between: dict[int, list[tuple[int, int]]] = {}
    depth = {id(slot): k for k, slots in enumerate(made.layers) for slot in slots}
    for s in made.segments:
        ends = (place[id(s.source)], place[id(s.target)])
        between.setdefault(depth[id(s.source)], []).append(ends)
    return sum(
        (a - c) * (b - d) < 0
        for ends in between.values()
        for k, (a, b) in enumerate(ends)
        for c, d in ends[:k]
    )


def _pins(made: Layered, wires: Sequence[Ends]) -> None:
    """Give the ends of segments their pins: ports as declared where the wires allow it."""
    place = _places(made)
    segments = made.segments
    for slots in made.layers:
        for slot in slots:
            if slot.box is None:
                continue
            ports = {name: k for k, name in enumerate(slot.box.ports)}
            last = len(ports)
            came = {wires[segments[s].wire].port: place[id(segments[s].source)] for s in slot.left}
            order = sorted(ports, key=lambda p: (came.get(p, last + len(place)), ports[p]))
            for s in slot.left:
                segments[s].into = order.index(wires[segments[s].wire].port)
            for i in made.backward:
                if wires[i].target == slot.key:
                    made.backward[i] = (made.backward[i][0], order.index(wires[i].port))
    for slots in made.layers:
        for slot in slots:
            slot.right.sort(key=lambda s: (place[id(segments[s].target)], segments[s].into))
            for k, s in enumerate(slot.right):
                segments[s].out = k
            back = [i for i in made.backward if wires[i].source == slot.key]
            for k, i in enumerate(back, start=len(slot.right)):
                made.backward[i] = (k, made.backward[i][1])


def _into(made: Layered, wires: Sequence[Ends], slot: Slot) -> Iterable[int]:
    yield from (made.segments[s].into for s in slot.left)
    yield from (into for i, (_, into) in made.backward.items() if wires[i].target == slot.key)


# -- rows ----------------------------------------------------------------------------


def _rows(made: Layered) -> None:
    """Rows that keep wires straight: columns are fitted to their neighbours in turn."""
    for slots in made.layers:
        row = 0
        for slot in slots:
            slot.row, row = row, row + slot.height + AIR
    best: list[list[int]] = []
    least = float("inf")
    for sweep in range(SWEEPS):
        down = sweep % 2 == 0
        for slots in made.layers if down else reversed(made.layers):
            _fit(made, slots, down, both=sweep >= SWEEPS - 2)
        cost = sum(
            s.weight * abs(s.rows[0] - s.rows[1]) + 2 * (s.rows[0] != s.rows[1])
            for s in made.segments
        )
        if cost < least:
            best, least = [[slot.row for slot in slots] for slots in made.layers], cost
    top = min((row for rows in best for row in rows), default=0)
    for slots, rows in zip(made.layers, best, strict=True):
        for slot, row in zip(slots, rows, strict=True):
            slot.row = row - top


def _fit(made: Layered, slots: list[Slot], down: bool, both: bool) -> None:
    """Best rows of one column, its order and distances kept."""
    offsets, wishes = [], []
    offset = 0
    for k, slot in enumerate(slots):
        if k:
            two_boxes = slot.box is not None and slots[k - 1].box is not None
            offset += slots[k - 1].height + (AIR if two_boxes else 0)
        wish: list[tuple[int, int]] = []
        if down or both:
            near = [made.segments[i] for i in slot.left]
            wish += [(s.rows[0] - slot.pin(s.into) - offset, s.weight) for s in near]
        if not down or both:
            near = [made.segments[i] for i in slot.right]
            wish += [(s.rows[1] - slot.pin(s.out) - offset, s.weight) for s in near]
        offsets.append(offset)
        wishes.append(wish)
    for slot, offset, row in zip(slots, offsets, isotonic_medians(wishes), strict=True):
        slot.row = row + offset


def isotonic_medians(wishes: Sequence[Sequence[tuple[int, int]]]) -> list[int]:
    """Non-decreasing numbers with the least weighted sum of distances to wishes.

    Parameters
    ----------
    wishes : per number its (wish, weight) pairs; without any it follows its neighbour

    Returns
    -------
    list of int, each one of the wishes; 0 where there are none at all
    """
    pools: list[tuple[list[tuple[int, int]], int, int]] = []  # wishes, median, count
    waiting = 0  # numbers without wishes before the first pool
    for wish in wishes:
        pool, count = sorted(wish), 1 + waiting
        if not wish:
            if pools:
                pools[-1] = (*pools[-1][:2], pools[-1][2] + 1)
            else:
                waiting += 1
            continue
        waiting = 0
        while pools and pools[-1][1] > _median(pool):
            earlier, _, n = pools.pop()
            pool, count = sorted([*earlier, *pool]), count + n
        pools.append((pool, _median(pool), count))
    pools = pools or [([], 0, waiting)]
    return [median for _, median, count in pools for _ in range(count)]


def _median(wishes: list[tuple[int, int]]) -> int:
    total = sum(w for _, w in wishes)
    reached = 0
    for value, weight in wishes:
        reached += weight
        if 2 * reached >= total:
            return value
    return wishes[-1][0]
