"""Places of a block diagram: boxes in layers, in an order with few crossings.

Columns are layers, from left to right; places within a column are whole *rows*, so
that wires are straight or clearly stepped. A wire that passes a layer holds a row
of its own there, so it never runs through a box. The layout stays ours (networkx has
the generations, no routing): wires end on the ports of boxes, and the same graph must
always give the same picture.

Sources: Sugiyama, Tagawa & Toda 1981 (layers, barycentre); Gansner et al. 1993 (rows
with the least sum of steps, as a linear program).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import Any

import networkx as nx
import numpy as np

from blockmech.model.diagram import Ends

STRAIGHT = {0: 1, 1: 2, 2: 8}  # weight of a step, by how many of its ends only pass a layer

Node = str | tuple[int, int]
"""A box by its name, or a wire in a layer that it passes."""


@dataclass(frozen=True)
class Box:
    """What the layout knows of a block.

    ``head`` rows stand above the first port, ``above`` rows over the box are kept
    free; ``ports`` are the names on the left edge; ``width`` is in points. Where all
    ``markers`` stand on the right edge, no pin changes its place for its wire.
    """

    name: str
    width: float
    ports: tuple[str, ...] = ()
    head: int = 2
    above: int = 0
    first: bool = False  # stands in the first layer, alone
    markers: tuple[str, ...] | None = None


@dataclass
class Layered:
    """Boxes in layers with rows, and the steps of the wires between the layers.

    ``steps`` has an edge for each wire between neighbouring layers, its key the number of
    the wire. Pins count from the top of their edge of a box.
    """

    boxes: Mapping[str, Box]
    wires: Sequence[Ends]
    layers: list[list[Node]]
    layer: Mapping[str, int]
    backward: list[int]  # wires of blocks that wait for each other
    steps: Any
    ports: dict[tuple[str, str], int] = field(default_factory=dict)  # box, port -> pin
    out: dict[int, int] = field(default_factory=dict)  # wire -> pin where it leaves
    row: dict[Node, int] = field(default_factory=dict)

    def height(self, node: Node) -> int:
        """Rows of a box with its wires, what is free above it included."""
        if not isinstance(node, str):
            return 1
        box, leaving = self.boxes[node], [wire.source for wire in self.wires].count(node)
        right = leaving if box.markers is None else len(box.markers)
        return box.above + box.head + max(len(box.ports), right)

    def ends(self, step: tuple[Node, Node, int]) -> tuple[int, int]:
        """Rows of the two ends of a step."""
        source, target, wire = step
        start, end = self.row[source], self.row[target]
        if isinstance(source, str):
            start += self.boxes[source].above + self.boxes[source].head + self.out[wire]
        if isinstance(target, str):
            end += self.boxes[target].above + self.boxes[target].head
            end += self.ports[target, self.wires[wire].port]
        return start, end


def layers_of(boxes: Sequence[Box], wires: Sequence[Ends]) -> tuple[dict[str, int], list[int]]:
    """Layer of every box (topological generations), and the wires that go backward.

    Where blocks wait for each other, the earliest of ``boxes`` is taken first.
    """
    order = {b.name: k for k, b in enumerate(boxes)}
    first = [b.name for b in boxes if b.first]
    feeds = nx.DiGraph()
    feeds.add_nodes_from(order)
    feeds.add_edges_from((f, b) for f in first for b in order if b not in first)
    backward = []
    late = {i: order[w.source] >= order[w.target] for i, w in enumerate(wires)}
    for i in sorted(late, key=late.__getitem__):
        source, target = wires[i].source, wires[i].target
        if target in first or nx.has_path(feeds, target, source):
            backward.append(i)
        else:
            feeds.add_edge(source, target)
    generations = enumerate(nx.topological_generations(feeds))
    return {name: k for k, names in generations for name in names}, sorted(backward)


def arrange(boxes: Sequence[Box], wires: Sequence[Ends]) -> Layered:
    """Lay out a diagram: layers, order, pins and rows. The same for the same input."""
    layer, backward = layers_of(boxes, wires)
    layers: list[list[Node]] = [[] for _ in range(max(layer.values(), default=0) + 1)]
    steps = nx.MultiDiGraph()
    for box in boxes:
        layers[layer[box.name]].append(box.name)
        steps.add_node(box.name)
    for i, wire in enumerate(wires):
        if i not in backward:
            between = range(layer[wire.source] + 1, layer[wire.target])
            for a, b in pairwise([wire.source, *((i, k) for k in between), wire.target]):
                steps.add_edge(a, b, key=i)
            for k in between:
                layers[k].append((i, k))
    layout = Layered({b.name: b for b in boxes}, wires, layers, layer, backward, steps)
    _order(layout)
    _pins(layout)
    layout.row = dict.fromkeys((n for nodes in layers for n in nodes), 0)
    layout.row = _rows(layout)
    return layout


def _order(layout: Layered) -> None:
    """Sort each layer by the mean place of its neighbours, until orders repeat; keep the best."""
    layers, steps = layout.layers, layout.steps
    best, fewest = [list(nodes) for nodes in layers], _crossings(layout)
    visited, down = set[tuple[object, ...]](), True
    while fewest and (order := (down, *map(tuple, layers))) not in visited:
        visited.add(order)
        for nodes in layers[1:] if down else layers[-2::-1]:
            rank = _ranks(layers)
            neighbours = {
                n: list(steps.predecessors(n) if down else steps.successors(n)) for n in nodes
            }
            mean = {n: np.mean([rank[m] for m in neighbours[n] or [n]]) for n in nodes}
            nodes.sort(key=mean.__getitem__)
        count = _crossings(layout)
        if count < fewest:
            best, fewest = [list(nodes) for nodes in layers], count
        down = not down
    layers[:] = best


def _ranks(layers: Sequence[Sequence[Node]]) -> dict[Node, int]:
    return {node: k for nodes in layers for k, node in enumerate(nodes)}


def _crossings(layout: Layered) -> int:
    """Pairs of steps that cross, whatever the order of pins on their boxes."""
    rank = _ranks(layout.layers)
    count = 0
    for nodes in layout.layers:
        ends = [(rank[a], rank[b]) for a, b in layout.steps.out_edges(nodes)]
        count += sum((a - c) * (b - d) < 0 for (a, b), (c, d) in combinations(ends, 2))
    return count


def _pins(layout: Layered) -> None:
    """Give the wires their pins: ports as declared where the order of wires allows it."""
    rank, steps, wires = _ranks(layout.layers), layout.steps, layout.wires
    for name, box in layout.boxes.items():
        came = {wires[w].port: rank[a] for a, _, w in steps.in_edges(name, keys=True)}
        order = list(box.ports)
        if box.markers is None:
            order.sort(key=lambda port: came.get(port, len(rank)))
        layout.ports |= {(name, port): k for k, port in enumerate(order)}
    for name, box in layout.boxes.items():
        if box.markers is not None:
            mine = {i: wire.marker for i, wire in enumerate(wires) if wire.source == name}
            layout.out |= {i: box.markers.index(marker) for i, marker in mine.items()}
            continue
        leaving = sorted(
            (rank[to], layout.ports.get((to, wires[w].port), 0), w)
            for _, to, w in steps.out_edges(name, keys=True)
        )
        back = [i for i in layout.backward if wires[i].source == name]
        layout.out |= {w: k for k, w in enumerate([*(w for *_, w in leaving), *back])}


def _rows(layout: Layered) -> dict[Node, int]:
    """Rows that keep wires straight: the least weighted sum of steps, then of rows.

    The matrix holds differences of rows only, so the solution is in whole numbers.
    """
    from scipy.optimize import linprog
    from scipy.sparse import coo_array

    nodes = {node: k for k, node in enumerate(layout.row)}
    steps = list(layout.steps.edges(keys=True))
    limits: list[tuple[int, int, int, int | None]] = []  # row b is so far below a, but for a slack
    for layer in layout.layers:
        for a, b in pairwise(layer):
            air = 1 if isinstance(a, str) and isinstance(b, str) else 0
            limits.append((nodes[a], nodes[b], layout.height(a) + air, None))
    cost = np.ones(len(nodes) + len(steps))
    for k, (a, b, wire) in enumerate(steps, len(nodes)):
        start, end = layout.ends((a, b, wire))  # counted from the first rows of the two
        limits += [(nodes[a], nodes[b], start - end, k), (nodes[b], nodes[a], end - start, k)]
        passing = (not isinstance(a, str)) + (not isinstance(b, str))
        cost[k] = STRAIGHT[passing] * (len(nodes) + 1)
    if not limits:
        return layout.row
    entries = [(line, upper, 1.0) for line, (upper, _, _, _) in enumerate(limits)]
    entries += [(line, lower, -1.0) for line, (_, lower, _, _) in enumerate(limits)]
    entries += [(k, slack, -1.0) for k, (*_, slack) in enumerate(limits) if slack is not None]
    lines, columns, values = zip(*entries, strict=True)
    matrix = coo_array((values, (lines, columns)), (len(limits), len(cost))).tocsr()
    optimum = linprog(cost, matrix, [-distance for _, _, distance, _ in limits], method="highs-ds")
    return {node: round(optimum.x[k]) for node, k in nodes.items()}
