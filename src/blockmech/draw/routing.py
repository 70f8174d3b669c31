"""Ways of the wires of a block diagram: right-angled, each in tracks of its own.

Between two layers runs a *channel*; a wire that changes its row there climbs in a
track that it shares with no wire near it. Two wires that swap their rows would lie
on each other; one of them then climbs in two tracks. Wires that go backward (blocks
that wait for each other) run below all boxes.

Sources: Hashimoto & Stevens 1971 (left-edge rule), Deutsch 1976 (doglegs).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from blockmech.draw.layout import Ends, Layered, Slot

ROW = 11.0  # [pt] height of a row
TRACK = 8.0  # [pt] distance of two tracks
STUB = 13.0  # [pt] free way between a box and the nearest track, room for an arrowhead

Point = tuple[float, float]


class Rectangle(NamedTuple):
    """A box in points, y downward."""

    x: float
    y: float
    width: float
    height: float


@dataclass
class Climb:
    """A wire's change of row in a channel; None where it leaves to the lanes below."""

    wire: int
    start: float | None
    end: float | None
    lane: float = 0.0
    track: int = -1
    leg: int = 0  # 1 and 2 are the legs of a dogleg

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest row that it touches."""
        rows = [self.lane if r is None else r for r in (self.start, self.end)]
        return min(rows), max(rows)


@dataclass
class Placed:
    """The finished places: rectangles of boxes, and a way for every wire."""

    boxes: dict[str, Rectangle] = field(default_factory=dict)
    ports: dict[tuple[str, str], Point] = field(default_factory=dict)
    markers: dict[int, Point] = field(default_factory=dict)  # wire -> where it starts
    ways: dict[int, list[Point]] = field(default_factory=dict)
    backward: frozenset[int] = frozenset()  # wires of blocks that wait for each other
    width: float = 0.0
    height: float = 0.0


def place(made: Layered, wires: Sequence[Ends]) -> Placed:
    """Rectangles [pt] of the boxes and ways of the wires, from rows to points."""
    bottom = max((s.row + s.height for slots in made.layers for s in slots), default=0)
    lanes = {wire: float(bottom + 1 + k) for k, wire in enumerate(made.backward)}
    channels = [_climbs(made, wires, k, lanes) for k in range(-1, len(made.layers))]
    counts = [assign_tracks(climbs) for climbs in channels]
    height = (bottom + len(lanes) + bool(lanes)) * ROW
    placed = Placed(height=height, backward=frozenset(made.backward))
    tracks: list[float] = []  # x of the first track of each channel
    x = 0.0
    for k, count in enumerate(counts):
        inner = 0 < k < len(counts) - 1
        tracks.append(x + (STUB if inner else TRACK))
        if count:
            x += (count - 1) * TRACK + (2 * STUB if inner else STUB + TRACK)
        elif inner:
            x += 2 * STUB
        if k < len(made.layers):
            x = _place_layer(made.layers[k], x, placed)
    placed.width = x
    _place_pins(made, wires, placed)
    for i in range(len(wires)):
        placed.ways[i] = _way(made, wires, i, placed, channels, tracks, lanes)
    return placed


def _place_layer(slots: list[Slot], x: float, placed: Placed) -> float:
    """Put the boxes of a layer at x; the x of its right side."""
    width = max((s.box.width for s in slots if s.box is not None), default=0.0)
    for slot in slots:
        if slot.box is not None:
            top = (slot.row + slot.box.above) * ROW
            height = (slot.height - slot.box.above) * ROW
            left = x + (width - slot.box.width) / 2
            placed.boxes[slot.key] = Rectangle(left, top, slot.box.width, height)
    return x + width


def _place_pins(made: Layered, wires: Sequence[Ends], placed: Placed) -> None:
    def y(slot: Slot, k: int) -> float:
        return (slot.row + slot.pin(k) + 0.5) * ROW

    into: dict[tuple[str, str], int] = {}
    for s in made.segments:
        if s.target.box is not None:
            into[s.target.key, wires[s.wire].port] = s.into
        if s.source.box is not None:
            r = placed.boxes[s.source.key]
            placed.markers[s.wire] = (r.x + r.width, y(s.source, s.out))
    for i, (out, k) in made.backward.items():
        into[wires[i].target, wires[i].port] = k
        r = placed.boxes[wires[i].source]
        placed.markers[i] = (r.x + r.width, y(made.slot(wires[i].source), out))
    for slots in made.layers:
        for slot in slots:
            if slot.box is None:
                continue
            taken = {k for (box, _), k in into.items() if box == slot.key}
            free = iter(k for k in range(len(slot.box.ports)) if k not in taken)
            for port in slot.box.ports:
                k = into[slot.key, port] if (slot.key, port) in into else next(free)
                placed.ports[slot.key, port] = (placed.boxes[slot.key].x, y(slot, k))


def _climbs(
    made: Layered, wires: Sequence[Ends], channel: int, lanes: Mapping[int, float]
) -> list[Climb]:
    """What changes rows in the channel to the right of a layer; -1 is left of all."""
    found = []
    if 0 <= channel < len(made.layers):
        here = {id(slot) for slot in made.layers[channel]}
        for s in made.segments:
            if id(s.source) in here and s.rows[0] != s.rows[1]:
                start, end = s.rows
                found.append(Climb(s.wire, float(start), float(end)))
    for i, (out, into) in made.backward.items():
        source, target = made.slot(wires[i].source), made.slot(wires[i].target)
        if made.layer[wires[i].source] == channel:
            found.append(Climb(i, float(source.row + source.pin(out)), None, lanes[i]))
        if made.layer[wires[i].target] == channel + 1:
            found.append(Climb(i, None, float(target.row + target.pin(into)), lanes[i]))
    return found


# -- tracks --------------------------------------------------------------------------


def assign_tracks(climbs: list[Climb]) -> int:
    """Give every climb a track so that no two wires lie on each other; the number of tracks.

    A climb that ends in the row where another starts must lie to the right of it.
    Where that is impossible, one of them is replaced by two legs.
    """
    order: list[Climb] = []
    waiting = sorted(climbs, key=_preference)
    while waiting:
        ready = [c for c in waiting if not any(_left_of(o, c) for o in waiting if o is not c)]
        if not ready:
            whole = [c for c in waiting if not c.leg and None not in (c.start, c.end)]
            cut = max(whole, key=lambda c: c.span[1] - c.span[0])
            legs = _legs(cut, climbs)
            climbs[:] = [c for c in climbs if c is not cut] + legs
            waiting = sorted([c for c in waiting if c is not cut] + legs, key=_preference)
            continue
        order.append(ready[0])
        waiting.remove(ready[0])
    for k, climb in enumerate(order):
        track = max((o.track + 1 for o in order[:k] if _left_of(o, climb)), default=0)
        while any(o.track == track and _touch(o, climb) for o in order[:k]):
            track += 1
        climb.track = track
    return max((c.track + 1 for c in climbs), default=0)


def _preference(climb: Climb) -> tuple[float, ...]:
    """Order with few crossings: the outermost of those that go the same way come first."""
    start, end = climb.span if climb.start is None else (climb.start, climb.end)
    upward = end is not None and end < start
    return (upward, start if upward else -start, climb.leg, climb.wire)


def _left_of(a: Climb, b: Climb) -> bool:
    """Whether climb a must lie to the left of climb b."""
    if a.wire == b.wire:
        return a.leg == 1 and b.leg == 2
    return a.start is not None and a.start == b.end


def _touch(a: Climb, b: Climb) -> bool:
    return a.span[0] <= b.span[1] and b.span[0] <= a.span[1]


def _legs(cut: Climb, climbs: Sequence[Climb]) -> list[Climb]:
    """Two climbs with a step between them, in a row that is nobody's."""
    low, high = cut.span
    taken = {r for c in climbs for r in (c.start, c.end)}
    middle = (low + high) // 2 + 0.5
    while middle in taken:
        middle += 0.25 if middle % 1 else 0.5
    return [
        Climb(cut.wire, cut.start, middle, leg=1),
        Climb(cut.wire, middle, cut.end, leg=2),
    ]


# -- ways ----------------------------------------------------------------------------


def _way(
    made: Layered,
    wires: Sequence[Ends],
    i: int,
    placed: Placed,
    channels: Sequence[Sequence[Climb]],
    tracks: Sequence[float],
    lanes: Mapping[int, float],
) -> list[Point]:
    """The corners of one wire, from its marker to its port."""
    way = [placed.markers[i]]
    back = i in made.backward
    steps = [
        (k, climb)
        for k, climbs in enumerate(channels)
        for climb in sorted(climbs, key=lambda c: c.leg)
        if climb.wire == i
    ]
    # A backward wire first goes down on the right of its source, then up left of its target.
    for k, climb in sorted(steps, key=lambda s: -s[0]) if back else steps:
        x = tracks[k] + climb.track * TRACK
        for row in (climb.start, climb.end):
            way.append((x, (lanes[i] if row is None else row) * ROW + ROW / 2))
    way.append(placed.ports[wires[i].target, wires[i].port])
    return way


def way_between(
    start: Point, end: Point, k: int = 0, boxes: Iterable[Rectangle] = ()
) -> list[Point]:
    """A plain way between boxes that the user placed, through as few of them as it can.

    ``k`` sets wires side by side.
    """
    (x1, y1), (x2, y2) = start, end
    boxes, aside = list(boxes), (k % 3 - 1) * TRACK / 2
    out, into = x1 + STUB + aside, x2 - STUB + aside
    steps = [j / 8 for j in (4, 3, 5, 2, 6, 1, 7, 0, 8)]  # the middle first
    ways = []
    if x2 - x1 >= 2 * STUB:
        if y1 == y2:
            ways.append([start, end])
        for t in steps:
            x = out + (into - out) * t
            ways.append([start, (x, y1), (x, y2), end])
    edges = [y for r in boxes for y in (r.y - ROW + aside, r.y + r.height + ROW + aside)]
    for y in [(y1 + y2) / 2 + aside, *edges]:
        ways.append([start, (out, y1), (out, y), (into, y), (into, y2), end])
    return min(ways, key=lambda way: sum(_runs_through(way, r) for r in boxes))


def _runs_through(way: Sequence[Point], r: Rectangle) -> bool:
    near = STUB / 3  # so that ports beside the wire stay free
    return any(
        min(xa, xb) < r.x + r.width + near
        and max(xa, xb) > r.x - near
        and min(ya, yb) < r.y + r.height
        and max(ya, yb) > r.y
        for (xa, ya), (xb, yb) in pairwise(way)
    )
