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
from itertools import pairwise, permutations
from typing import NamedTuple

import networkx as nx

from blockmech.draw.layout import Ends, Layered, Node
from blockmech.draw.palette import ROW, SIZES

Point = tuple[float, float]


class Rectangle(NamedTuple):
    """A box in points, y downward."""

    x: float
    y: float
    width: float
    height: float


@dataclass(eq=False)
class Climb:
    """A wire's change of row in a channel; ``leg`` 1 and 2 are the legs of a dogleg."""

    wire: int
    start: float
    end: float
    leg: int = 0
    track: int = -1

    @property
    def preference(self) -> tuple[float, ...]:
        """Order with few crossings: the outermost of those that go the same way come first."""
        upward = self.end < self.start
        return (upward, self.start if upward else -self.start, self.leg, self.wire)

    def left_of(self, other: Climb) -> bool:
        """Whether it must lie to the left of another climb, or their wires would overlap."""
        if self.wire == other.wire:
            return self.leg < other.leg
        return self.start == other.end

    def touches(self, other: Climb) -> bool:
        """Whether the two share a row."""
        low, high = sorted((self.start, self.end))
        return low <= max(other.start, other.end) and min(other.start, other.end) <= high


@dataclass
class Placed:
    """The finished places [pt]: boxes, pins as depths below the tops of boxes, ways of wires."""

    boxes: dict[str, Rectangle] = field(default_factory=dict)
    ports: dict[tuple[str, str], float] = field(default_factory=dict)
    markers: dict[int, float] = field(default_factory=dict)  # wire -> where it starts
    ways: dict[int, list[Point]] = field(default_factory=dict)
    backward: frozenset[int] = frozenset()  # wires of blocks that wait for each other
    corner: Point = (0.0, 0.0)  # upper left of all
    width: float = 0.0
    height: float = 0.0

    def port(self, box: str, port: str) -> Point:
        """A port on the left edge of its box."""
        r = self.boxes[box]
        return r.x, r.y + self.ports[box, port]

    def marker(self, wire: int, box: str) -> Point:
        """Where a wire leaves the right edge of its box."""
        r = self.boxes[box]
        return r.x + r.width, r.y + self.markers[wire]


def place(made: Layered, wires: Sequence[Ends]) -> Placed:
    """Rectangles [pt] of the boxes and ways of the wires, from rows to points."""
    bottom = max((made.row[n] + made.height(n) for layer in made.layers for n in layer), default=0)
    lanes = {wire: bottom + 1 + k for k, wire in enumerate(made.backward)}
    channels = [_climbs(made, wires, k, lanes) for k in range(-1, len(made.layers))]
    placed = Placed(backward=frozenset(lanes))
    placed.height = (bottom + len(lanes) + bool(lanes)) * ROW
    tracks: list[float] = []  # x of the first track of each channel
    x = 0.0
    for k, climbs in enumerate(channels):
        count = assign_tracks(climbs)
        inner = 0 < k < len(channels) - 1
        tracks.append(x + (SIZES.stub if inner else SIZES.track))
        if count:
            x += (count - 1) * SIZES.track + (2 * SIZES.stub if inner else SIZES.stub + SIZES.track)
        elif inner:
            x += 2 * SIZES.stub
        if k < len(made.layers):
            x = _place_layer(made, made.layers[k], x, placed)
    placed.width = x
    _place_pins(made, wires, placed)
    for i, wire in enumerate(wires):
        steps = [(k, c) for k, found in enumerate(channels) for c in found if c.wire == i]
        # A backward wire first goes down right of its source, then up left of its target.
        steps.sort(key=lambda at: (-at[0] if i in lanes else at[0], at[1].leg))
        placed.ways[i] = [
            placed.marker(i, wire.source),
            *(
                (tracks[k] + c.track * SIZES.track, (row + 0.5) * ROW)
                for k, c in steps
                for row in (c.start, c.end)
            ),
            placed.port(wire.target, wire.port),
        ]
    return placed


def _place_layer(made: Layered, nodes: Sequence[Node], x: float, placed: Placed) -> float:
    """Put the boxes of a layer at x; the x of its right side."""
    boxes = [made.boxes[n] for n in nodes if isinstance(n, str)]
    width = max((box.width for box in boxes), default=0.0)
    for box in boxes:
        top = (made.row[box.name] + box.above) * ROW
        height = (made.height(box.name) - box.above) * ROW
        left = x + (width - box.width) / 2
        placed.boxes[box.name] = Rectangle(left, top, box.width, height)
    return x + width


def _place_pins(made: Layered, wires: Sequence[Ends], placed: Placed) -> None:
    def depth(box: str, k: int) -> float:
        return (made.boxes[box].head + k + 0.5) * ROW

    for i, wire in enumerate(wires):
        placed.markers[i] = depth(wire.source, made.out[i])
        placed.ports[wire.target, wire.port] = depth(wire.target, made.into[i])
    for name, box in made.boxes.items():
        taken = {made.into[i] for i, wire in enumerate(wires) if wire.target == name}
        free = iter(k for k in range(len(box.ports)) if k not in taken)
        for port in box.ports:
            if (name, port) not in placed.ports:
                placed.ports[name, port] = depth(name, next(free))


def _climbs(
    made: Layered, wires: Sequence[Ends], channel: int, lanes: Mapping[int, int]
) -> list[Climb]:
    """What changes rows in the channel to the right of a layer; -1 is left of all."""
    found = []
    layer = made.layers[channel] if 0 <= channel < len(made.layers) else []
    for step in made.steps.out_edges(layer, keys=True):
        start, end = made.ends(step)
        if start != end:
            found.append(Climb(step[2], start, end))
    for i, lane in lanes.items():
        source, target = wires[i].source, wires[i].target
        if made.layer[source] == channel:
            found.append(Climb(i, made.row[source] + made.pin(source, made.out[i]), lane))
        if made.layer[target] == channel + 1:
            found.append(Climb(i, lane, made.row[target] + made.pin(target, made.into[i])))
    return found


def assign_tracks(climbs: list[Climb]) -> int:
    """Give every climb a track so that no two wires lie on each other; the number of tracks.

    A climb that ends in the row where another starts must lie to the right of it.
    Where that is impossible, one of them is replaced by two legs.
    """
    while True:
        left = nx.DiGraph()
        left.add_nodes_from(climbs)
        left.add_edges_from((a, b) for a, b in permutations(climbs, 2) if a.left_of(b))
        if nx.is_directed_acyclic_graph(left):
            break
        circle = [a for a, _ in nx.find_cycle(left)]
        cut = max(circle, key=lambda c: (abs(c.start - c.end), c.preference))
        climbs[:] = [c for c in climbs if c is not cut] + _legs(cut, climbs)
    done: list[Climb] = []
    for climb in nx.lexicographical_topological_sort(left, key=lambda c: c.preference):
        climb.track = max((other.track + 1 for other in left.predecessors(climb)), default=0)
        while any(o.track == climb.track and o.touches(climb) for o in done):
            climb.track += 1
        done.append(climb)
    return max((c.track + 1 for c in climbs), default=0)


def _legs(cut: Climb, climbs: Sequence[Climb]) -> list[Climb]:
    """Two climbs with a step between them, in a row that is nobody's."""
    taken = {r for c in climbs for r in (c.start, c.end)}
    middle = (cut.start + cut.end) // 2 + 0.5
    while middle in taken:
        middle += 0.25 if middle % 1 else 0.5
    return [Climb(cut.wire, cut.start, middle, 1), Climb(cut.wire, middle, cut.end, 2)]


# -- boxes at the author's places --------------------------------------------------------


def honour(placed: Placed, view: Mapping[str, Point], wires: Sequence[Ends], driven: bool) -> None:
    """Move boxes to the author's places, the others below them; wires follow plainly."""
    old = placed.boxes
    x0, y0 = (min(at[k] for at in view.values()) for k in (0, 1))
    below = max(y - y0 + old[n].height for n, (_, y) in view.items()) + 2 * ROW
    top = min((r.y for n, r in old.items() if n not in view), default=0.0)
    room = 2 * ROW if driven else 0.0
    placed.boxes = {
        name: r._replace(x=view[name][0] - x0 + SIZES.stub, y=view[name][1] - y0 + room)
        if name in view
        else r._replace(x=r.x + SIZES.stub, y=r.y - top + below + room)
        for name, r in old.items()
    }
    for i, wire in enumerate(wires):
        start, end = placed.marker(i, wire.source), placed.port(wire.target, wire.port)
        placed.ways[i] = way_between(start, end, i, placed.boxes.values())
    corners = [p for way in placed.ways.values() for p in way]
    corners += [(r.x + r.width, r.y + r.height) for r in placed.boxes.values()]
    placed.corner = (min(0.0, *(x - SIZES.stub / 2 for x, _ in corners)), 0.0)
    placed.width = max(x for x, _ in corners) - placed.corner[0] + SIZES.stub / 2
    placed.height = max(y for _, y in corners)


def way_between(
    start: Point, end: Point, k: int = 0, boxes: Iterable[Rectangle] = ()
) -> list[Point]:
    """A plain way between boxes that the user placed, through as few of them as it can.

    ``k`` sets wires side by side.
    """
    (x1, y1), (x2, y2) = start, end
    boxes, aside = list(boxes), (k % 3 - 1) * SIZES.track / 2
    out, into = x1 + SIZES.stub + aside, x2 - SIZES.stub + aside
    ways: list[list[Point]] = []
    if x2 - x1 >= 2 * SIZES.stub:
        if y1 == y2:
            ways.append([start, end])
        for j in (4, 3, 5, 2, 6, 1, 7, 0, 8):  # the middle first
            x = out + (into - out) * j / 8
            ways.append([start, (x, y1), (x, y2), end])
    edges = [y for r in boxes for y in (r.y - ROW + aside, r.y + r.height + ROW + aside)]
    for y in [(y1 + y2) / 2 + aside, *edges]:
        ways.append([start, (out, y1), (out, y), (into, y), (into, y2), end])
    return min(ways, key=lambda way: sum(_runs_through(way, r) for r in boxes))


def _runs_through(way: Sequence[Point], r: Rectangle) -> bool:
    near = SIZES.stub / 3  # so that ports beside the wire stay free
    return any(
        min(xa, xb) < r.x + r.width + near
        and max(xa, xb) > r.x - near
        and min(ya, yb) < r.y + r.height
        and max(ya, yb) > r.y
        for (xa, ya), (xb, yb) in pairwise(way)
    )
