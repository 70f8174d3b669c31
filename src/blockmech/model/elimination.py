"""Sparse elimination in integers modulo a prime: the rank of conditions, without rounding.

Exact, so there is no tolerance, and the same answer comes in any order. Rows stay short
where links with few neighbours go first: linear for chains of dyads.
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

PRIME = 2**61 - 1
"""Modulus of the arithmetic: a Mersenne prime that fits a machine word."""

Row: TypeAlias = dict[int, int]
"""A condition on the twists (vx, vy, om) of the links: column -> coefficient."""

MOST_WORK = 5_000_000
"""Steps of elimination that take about a second; a chain of 1,000 dyads takes 100,000."""


class TooTangledError(ValueError):
    """So many links in loops with each other that the rank would take too long."""


def few_neighbours_first(
    links: Sequence[str], joined: Iterable[tuple[str, str]], work: int | None = None
) -> Iterator[str]:
    """Order of elimination that keeps rows short: least degree, ties by name."""
    left = math.inf if work is None else work
    near: dict[str, set[str]] = {a: set() for a in links}
    for a, b in joined:
        if a in near and b in near and a != b:
            near[a].add(b)
            near[b].add(a)
    heap = [(len(near[a]), a) for a in links]
    heapq.heapify(heap)
    while heap:
        degree, a = heapq.heappop(heap)
        if a not in near or degree != len(near[a]):
            continue
        yield a
        neighbours = near.pop(a)
        left -= len(neighbours) ** 2
        if left < 0:
            raise TooTangledError
        for b in neighbours:
            near[b] |= neighbours
            near[b] -= {a, b}
            heapq.heappush(heap, (len(near[b]), b))


class Pivot(NamedTuple):
    """A condition solved for its first column: twist[column] = -sum(row * twist)."""

    column: int
    row: Row  # without the pivot's own column, whose coefficient is 1
    source: int  # number of the condition that it came from
    scale: int  # what the reduced condition was multiplied by
    used: list[tuple[int, int]]  # earlier pivots taken away: column, factor


class Echelon:
    """Conditions on so many columns in echelon form modulo the prime."""

    def __init__(self, columns: int, conditions: Sequence[Row], work: int | None = None) -> None:
        self.conditions = conditions
        self.left = work
        self.pivots: dict[int, Pivot] = {}
        self.redundant: list[int] = []  # conditions that those before them imply
        for source, condition in enumerate(conditions):
            if len(self.pivots) == columns:
                self.redundant.append(source)
                continue
            row, used = self.reduce(condition)
            if row:
                lead = min(row)
                scale = pow(row.pop(lead), -1, PRIME)
                solved = {c: value * scale % PRIME for c, value in row.items()}
                self.pivots[lead] = Pivot(lead, solved, source, scale, used)
            else:
                self.redundant.append(source)

    def reduce(self, condition: Row) -> tuple[Row, list[tuple[int, int]]]:
        """What is left of a condition, and the pivots taken away with their factors."""
        row, used = dict(condition), list[tuple[int, int]]()
        while row:
            lead = min(row)
            pivot = self.pivots.get(lead)
            if pivot is None:
                break
            factor = row.pop(lead)
            used.append((lead, factor))
            if self.left is not None:
                self.left -= 1 + len(pivot.row)
                if self.left < 0:
                    raise TooTangledError
            for c, value in pivot.row.items():
                rest = (row.get(c, 0) - factor * value) % PRIME
                if rest:
                    row[c] = rest
                else:
                    row.pop(c, None)
        return row, used

    def stress(self, source: int) -> set[int]:
        """The conditions that a redundant one depends on, and itself."""
        weight: dict[int, int] = defaultdict(int)
        waiting: list[tuple[int, int]] = []
        found = {source}

        def owe(column: int, amount: int) -> None:
            if column not in weight:
                heapq.heappush(waiting, (-self.pivots[column].source, column))
            weight[column] = (weight[column] + amount) % PRIME

        for column, factor in self.reduce(self.conditions[source])[1]:
            owe(column, factor)
        while waiting:  # later pivots first: they only use earlier ones
            pivot = self.pivots[heapq.heappop(waiting)[1]]
            amount = weight[pivot.column] * pivot.scale % PRIME
            if amount:
                found.add(pivot.source)
                for column, factor in pivot.used:
                    owe(column, -amount * factor)
        return found
