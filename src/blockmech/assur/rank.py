"""Rank of sparse linear conditions in integers modulo a prime: no rounding, no tolerance.

A chain of a hundred links has motions that differ by twenty powers of ten from its first link
to its last, so the rank of a matrix of floats is a guess there; here it is exact.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

import networkx as nx

PRIME = 2**61 - 1
"""Modulus of the arithmetic: a Mersenne prime that fits a machine word."""

Row: TypeAlias = dict[int, int]
"""A condition: column -> coefficient."""

MOST_WORK = 5_000_000
"""Steps of elimination that take about a second; a chain of 1,000 dyads takes 100,000."""


class TooTangledError(ValueError):
    """So many links in loops with each other that the rank would take too long."""


def in_bands(nodes: Sequence[str], joined: Iterable[tuple[str, str]]) -> list[str]:
    """Order of elimination that keeps rows short: neighbours near each other."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from((a, b) for a, b in joined if a in graph and b in graph)
    return list(nx.utils.reverse_cuthill_mckee_ordering(graph))


class Pivot(NamedTuple):
    """A condition solved for its first column: x[column] = -sum(row * x)."""

    row: Row  # without the pivot's own column, whose coefficient is 1
    source: int  # number of the condition that it came from
    scale: int  # what the reduced condition was multiplied by
    used: Row  # pivot that was taken away, by its column -> factor


class Echelon:
    """Conditions in echelon form modulo the prime.

    Columns are solved for in their order (`in_bands`). Raises `TooTangledError`
    after `MOST_WORK` steps.
    """

    def __init__(self, columns: int, conditions: Sequence[Row]) -> None:
        self.conditions = conditions
        self.left = MOST_WORK
        self.pivots: dict[int, Pivot] = {}  # by the column that each is solved for
        self.redundant: list[int] = []  # conditions that those before them imply
        for source, condition in enumerate(conditions):
            full = len(self.pivots) == columns
            row, used = ({}, {}) if full else self._reduce(condition)
            if row:
                lead = min(row)
                scale = pow(row.pop(lead), -1, PRIME)
                solved = {c: value * scale % PRIME for c, value in row.items()}
                self.pivots[lead] = Pivot(solved, source, scale, used)
            else:
                self.redundant.append(source)

    def _reduce(self, condition: Row) -> tuple[Row, Row]:
        """What is left of a condition, and the pivots taken away with their factors."""
        row, used = dict(condition), dict[int, int]()
        while row and (pivot := self.pivots.get(lead := min(row))):
            used[lead] = factor = row.pop(lead)
            self._spend_steps(1 + len(pivot.row))
            for c, value in pivot.row.items():
                rest = (row.get(c, 0) - factor * value) % PRIME
                if rest:
                    row[c] = rest
                else:
                    row.pop(c, None)
        return row, used

    def _spend_steps(self, steps: int) -> None:
        self.left -= steps
        if self.left < 0:
            raise TooTangledError

    def circuit(self, source: int) -> set[int]:
        """The conditions that a redundant one depends on, and itself."""
        weight, sources = self._reduce(self.conditions[source])[1], {source}
        waiting = [(-self.pivots[column].source, column) for column in weight]
        heapq.heapify(waiting)
        while waiting:  # later pivots first: they only use earlier ones
            column = heapq.heappop(waiting)[1]
            pivot = self.pivots[column]
            amount = weight[column] * pivot.scale % PRIME
            if amount:
                sources.add(pivot.source)
                self._spend_steps(4 * (1 + len(pivot.used)))  # a heap costs more than a row
                for earlier, factor in pivot.used.items():
                    if earlier not in weight:
                        heapq.heappush(waiting, (-self.pivots[earlier].source, earlier))
                    weight[earlier] = (weight.get(earlier, 0) - amount * factor) % PRIME
        return sources

    def solution(self, free: Sequence[int]) -> Sequence[int]:
        """Values of all columns that meet the conditions, as given where a column is free."""
        value = list(free)
        for column in sorted(self.pivots, reverse=True):
            value[column] = -sum(f * value[c] for c, f in self.pivots[column].row.items()) % PRIME
        return value
