"""Ways of the wires of a block diagram: right-angled, each in a track of its own.

Between two layers runs a *channel*; a wire that changes its row there climbs in one of
its tracks. Two wires that swap their rows would lie on each other; one of them then
climbs in two tracks. Wires that go backward (blocks that wait for each other) run below
all boxes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, permutations
from typing import NamedTuple

import networkx as nx

from blockmech.draw.layout import Layered
from blockmech.figures.palette import ROW, SIZES

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

    @property
    def preference(self) -> tuple[float, ...]:
        """Order with few crossings: the outermost of those that go the same way come first."""
        upward = self.end < self.start
        return (upward, self.start if upward else -self.start, self.leg, self.wire)

    def precedes(self, climb: Climb) -> bool:
        """Whether it must lie to the left of another climb, or their wires would overlap."""
        return self.leg < climb.leg if self.wire == climb.wire else self.start == climb.end


@dataclass
class Placed:
    """The finished places [pt] of boxes and ways of wires."""

    made: Layered
    boxes: dict[str, Rectangle] = field(default_factory=dict)
    ways: dict[int, list[Point]] = field(default_factory=dict)
    corner: Point = (0.0, 0.0)  # upper left of all
    width: float = 0.0
    height: float = 0.0

    def port(self, box: str, port: str) -> Point:
        """A port on the left edge of its box."""
        r = self.boxes[box]
        return r.x, r.y + (self.made.boxes[box].head + self.made.ports[box, port] + 0.5) * ROW

    def ends(self, wire: int) -> tuple[Point, Point]:
        """The marker on the right edge of a box where a wire leaves, and the port where it ends."""
        source, _, target, port = self.made.wires[wire]
        r = self.boxes[source]
        depth = (self.made.boxes[source].head + self.made.out[wire] + 0.5) * ROW
        return (r.x + r.width, r.y + depth), self.port(target, port)


def lay_out(layout: Layered) -> Placed:
    """Rectangles [pt] of the boxes and ways of the wires, from rows to points."""
    bottom = max(
        (layout.row[n] + layout.height(n) for layer in layout.layers for n in layer), default=0
    )
    placed = Placed(layout, height=(bottom + len(layout.backward) + bool(layout.backward)) * ROW)
    climbs: dict[int, list[Point]] = {i: [] for i in range(len(layout.wires))}
    sides: list[Point] = []  # left and right of each layer
    for nodes in layout.layers:
        boxes = [layout.boxes[n] for n in nodes if isinstance(n, str)]
        left_edge, width = placed.width, max((box.width for box in boxes), default=0.0)
        sides.append((left_edge, left_edge + width))
        for box in boxes:
            top = (layout.row[box.name] + box.above) * ROW
            height = (layout.height(box.name) - box.above) * ROW
            x = left_edge + (width - box.width) / 2
            placed.boxes[box.name] = Rectangle(x, top, box.width, height)
        tracks = in_tracks(
            Climb(step[2], start, end)
            for step in layout.steps.out_edges(nodes, keys=True)
            for start, end in [layout.ends(step)]
            if start != end
        )
        placed.width += width
        if nodes is not layout.layers[-1]:
            for k, climb in enumerate(tracks):
                x = placed.width + SIZES.stub + k * SIZES.track
                climbs[climb.wire] += [(x, (row + 0.5) * ROW) for row in (climb.start, climb.end)]
            placed.width += 2 * SIZES.stub + max(len(tracks) - 1, 0) * SIZES.track
    if layout.backward:
        placed.corner, placed.width = (-SIZES.stub, 0.0), placed.width + 2 * SIZES.stub
    for lane, i in enumerate(layout.backward):  # down beside its source, up beside its target
        offset, y = SIZES.stub / 2 - lane, (bottom + 1.5 + lane) * ROW
        down = sides[layout.layer[layout.wires[i].source]][1] + offset
        up = sides[layout.layer[layout.wires[i].target]][0] - offset
        start, end = placed.ends(i)
        climbs[i] = [(down, start[1]), (down, y), (up, y), (up, end[1])]
    for i, between in climbs.items():
        start, end = placed.ends(i)
        placed.ways[i] = [start, *between, end]
    return placed


def in_tracks(climbs: Iterable[Climb]) -> list[Climb]:
    """Climbs from left to right, each in its own track, so that no two wires lie on each other.

    A climb that ends in the row where another starts must lie to the right of it.
    Where that is impossible, one of them is replaced by two legs.
    """
    climbs = list(climbs)
    while True:
        order = nx.DiGraph()
        order.add_nodes_from(climbs)
        order.add_edges_from((a, b) for a, b in permutations(climbs, 2) if a.precedes(b))
        if nx.is_directed_acyclic_graph(order):
            return list(nx.lexicographical_topological_sort(order, key=lambda c: c.preference))
        circle = [a for a, _ in nx.find_cycle(order)]
        cut = max(circle, key=lambda c: (abs(c.start - c.end), c.preference))
        used = {row for c in climbs for row in (c.start, c.end)}
        middle = (cut.start + cut.end) // 2 + 0.5  # a row that is nobody's
        while middle in used:
            middle += 0.25
        climbs.remove(cut)
        climbs += [Climb(cut.wire, cut.start, middle, 1), Climb(cut.wire, middle, cut.end, 2)]


# -- boxes at the author's places --------------------------------------------------------


def honour(placed: Placed, view: Mapping[str, Point]) -> None:
    """Move boxes to the author's places, the others below them; wires follow plainly."""
    old = placed.boxes
    x0, y0 = (min(at[k] for at in view.values()) for k in (0, 1))
    below = max(y - y0 + old[n].height for n, (_, y) in view.items()) + 2 * ROW
    top = min((r.y for n, r in old.items() if n not in view), default=0.0)
    room = max((box.above for box in placed.made.boxes.values()), default=0) * ROW
    for name, r in old.items():
        x, y = view.get(name, (r.x + x0, r.y - top + below + y0))
        placed.boxes[name] = r._replace(x=x - x0 + SIZES.stub, y=y - y0 + room)
    for i in placed.ways:
        placed.ways[i] = path_between(*placed.ends(i), i, placed.boxes.values())
    corners = [p for path in placed.ways.values() for p in path]
    corners += [(r.x + r.width, r.y + r.height) for r in placed.boxes.values()]
    placed.corner = (min(0.0, *(x - SIZES.stub / 2 for x, _ in corners)), 0.0)
    placed.width = max(x for x, _ in corners) - placed.corner[0] + SIZES.stub / 2
    placed.height = max(y for _, y in corners)


def path_between(
    start: Point, end: Point, k: int = 0, boxes: Iterable[Rectangle] = ()
) -> list[Point]:
    """A plain way between boxes that the user placed, through as few of them as it can.

    Where the end is not to the right, it goes around below all; ``k`` sets wires side by side.
    """
    (x1, y1), (x2, y2) = start, end
    boxes, aside = list(boxes), (k % 3 - 1) * SIZES.track / 2
    out, into = x1 + SIZES.stub + aside, x2 - SIZES.stub + aside
    if out > into:
        y = max((r.y + r.height for r in boxes), default=max(y1, y2)) + ROW + aside
        return [start, (out, y1), (out, y), (into, y), (into, y2), end]
    ways = [[start, (x, y1), (x, y2), end] for x in ((out + into) / 2, out, into)]
    return min(ways, key=lambda path: sum(runs_through(path, r) for r in boxes))


def runs_through(path: Sequence[Point], r: Rectangle) -> bool:
    """Whether a way runs through a box, or too near beside it."""
    clearance = SIZES.stub / 3  # so that ports beside the wire stay free
    return any(
        min(xa, xb) < r.x + r.width + clearance
        and max(xa, xb) > r.x - clearance
        and min(ya, yb) < r.y + r.height
        and max(ya, yb) > r.y
        for (xa, ya), (xb, yb) in pairwise(path)
    )
