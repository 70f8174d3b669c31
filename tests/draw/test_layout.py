"""Places of a block diagram: layers, order, rows and ways of the wires."""

from __future__ import annotations

import itertools
import random

import pytest

from blockmech.draw.layout import Box, arrange
from blockmech.draw.routing import Placed, Point, lay_out
from blockmech.model.diagram import Ends

TOLERANCE = 1e-9  # [pt] rounding of sums of a few hundred points


def boxes_of(*names: str, ports: int = 2) -> list[Box]:
    joints = tuple(f"p{k}" for k in range(ports))
    return [Box("frame", 40.0, first=True), *(Box(n, 50.0, joints) for n in names)]


def random_diagram(seed: int) -> tuple[list[Box], list[Ends]]:
    """A random diagram; every port is fed once, now and then by a later box."""
    r = random.Random(seed)
    n = r.randint(2, 14)
    names = [f"b{k}" for k in range(n)]
    boxes = [Box("frame", 40.0, first=True)]
    wires = []
    for k, name in enumerate(names):
        ports = tuple(f"p{j}" for j in range(r.randint(1, 4)))
        boxes.append(Box(name, r.uniform(30, 90), ports, r.choice((1, 2)), r.choice((0, 2))))
        earlier = ["frame", *names[:k]]
        for port in ports:
            later = r.random() < 0.05 and k + 1 < n
            source = r.choice(names[k + 1 :]) if later else r.choice([*earlier[-4:], "frame"])
            if r.random() > 0.1:
                wires.append(Ends(source, f"m{len(wires)}", name, port))
    return boxes, wires


def pieces(route: list[Point]) -> list[tuple[Point, Point]]:
    return [(a, b) for a, b in itertools.pairwise(route) if a != b]


def lie_on_each_other(first: tuple[Point, Point], second: tuple[Point, Point]) -> bool:
    """Whether two right-angled pieces share more than a point."""
    for across, axis in ((0, 1), (1, 0)):
        level = [p[across] for p in (*first, *second)]
        if max(level) - min(level) < TOLERANCE:
            a, b = sorted(p[axis] for p in first)
            c, d = sorted(p[axis] for p in second)
            return min(b, d) - max(a, c) > TOLERANCE
    return False


def crossings(placed: Placed) -> int:
    """Number of crossings of wires."""
    count = 0
    for first, second in itertools.combinations(placed.ways.values(), 2):
        for (a, b), (c, d) in itertools.product(pieces(first), pieces(second)):
            flat, upright = ((a, b), (c, d)) if a[1] == b[1] else ((c, d), (a, b))
            xs, ys = sorted(p[0] for p in flat), sorted(p[1] for p in upright)
            count += xs[0] < upright[0][0] < xs[1] and ys[0] < flat[0][1] < ys[1]
    return count


def test_boxes_that_are_named_in_a_bad_order_are_sorted_until_no_wires_cross():
    names = ["a", "b", "c", "d"]
    boxes = boxes_of(*names, *(f"{n}2" for n in reversed(names)), ports=1)
    wires = [Ends("frame", n, n, "p0") for n in names]
    wires += [Ends(n, "C", f"{n}2", "p0") for n in names]
    assert crossings(lay_out(arrange(boxes, wires))) == 0


@pytest.mark.parametrize("seed", range(20))
def test_in_random_diagrams_nothing_overlaps_and_wires_end_on_ports(seed):
    boxes, wires = random_diagram(seed)
    placed = lay_out(arrange(boxes, wires))
    for first, second in itertools.combinations(placed.boxes.values(), 2):
        apart_x = first.x + first.width < second.x or second.x + second.width < first.x
        apart_y = first.y + first.height < second.y or second.y + second.height < first.y
        assert apart_x or apart_y
    for i, wire in enumerate(wires):
        route = placed.ways[i]
        source, target = placed.boxes[wire.source], placed.boxes[wire.target]
        assert (route[0], route[-1]) == placed.ends(i)
        assert route[0][0] == pytest.approx(source.x + source.width, abs=TOLERANCE)
        assert route[-1][0] == pytest.approx(target.x, abs=TOLERANCE)
        assert source.y < route[0][1] < source.y + source.height
        assert target.y < route[-1][1] < target.y + target.height
        for (x1, y1), (x2, y2) in pieces(route):
            assert abs(x1 - x2) < TOLERANCE or abs(y1 - y2) < TOLERANCE, "right angles only"
            for r in placed.boxes.values():
                outside_x = (
                    max(x1, x2) <= r.x + TOLERANCE or min(x1, x2) >= r.x + r.width - TOLERANCE
                )
                outside_y = max(y1, y2) <= r.y or min(y1, y2) >= r.y + r.height
                assert outside_x or outside_y, f"wire {wire} runs through a box"
    for first, second in itertools.combinations(placed.ways.values(), 2):
        for a, b in itertools.product(pieces(first), pieces(second)):
            assert not lie_on_each_other(a, b)


def test_rows_have_the_least_sum_of_steps():
    """Three boxes in a column, their wires from places that they cannot all have."""
    wires = [Ends("frame", n, n, "p0") for n in "abc"]
    layout = arrange(boxes_of(*"abc", ports=1), wires)
    lengths = [abs(start - end) for start, end in map(layout.ends, layout.steps.edges(keys=True))]
    assert sum(lengths) == 2 * 3, "boxes of 3 rows stand 4 apart, their wires leave 1 apart"
