"""Rank of sparse linear conditions in integers modulo a prime: no rounding, no tolerance.

A chain of a hundred links has motions that differ by twenty powers of ten from its first link
to its last, so the rank of a matrix of floats is a guess there; here it is exact.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

PRIME = 2**61 - 1
"""Modulus of the arithmetic: a Mersenne prime that fits a machine word."""

Row: TypeAlias = dict[int, int]
"""A condition: column -> coefficient."""

MOST_WORK = 5_000_000
"""Steps of elimination that take about a second; a chain of 1,000 dyads takes 100,000."""


class TooTangledError(ValueError):
    """So many links in loops with each other that the rank would take too long."""


def in_bands(nodes: Sequence[str], joined: Iterable[tuple[str, str]]) -> list[str]:
    """Order of elimination that keeps rows short: neighbours near each other (Cuthill-McKee)."""
    import numpy as np
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    index = {a: k for k, a in enumerate(nodes)}
    ends = [(index[a], index[b]) for a, b in joined if a in index and b in index]
    if not ends:
        return list(nodes)
    rows, columns = np.array([*ends, *(e[::-1] for e in ends)]).T
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(nodes), len(nodes)))
    return [nodes[k] for k in reverse_cuthill_mckee(graph.tocsr(), symmetric_mode=True)]


class Pivot(NamedTuple):
    """A condition solved for its first column: x[column] = -sum(row * x)."""

    row: Row  # without the pivot's own column, whose coefficient is 1
    source: int  # number of the condition that it came from
    scale: int  # what the reduced condition was multiplied by
    used: list[tuple[int, int]]  # earlier pivots taken away: column, factor


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
            row, used = ({}, []) if full else self._reduce(condition)
            if row:
                lead = min(row)
                scale = pow(row.pop(lead), -1, PRIME)
                solved = {c: value * scale % PRIME for c, value in row.items()}
                self.pivots[lead] = Pivot(solved, source, scale, used)
            else:
                self.redundant.append(source)

    def _reduce(self, condition: Row) -> tuple[Row, list[tuple[int, int]]]:
        """What is left of a condition, and the pivots taken away with their factors."""
        row, used = dict(condition), list[tuple[int, int]]()
        while row:
            lead = min(row)
            pivot = self.pivots.get(lead)
            if pivot is None:
                break
            factor = row.pop(lead)
            used.append((lead, factor))
            self._work(1 + len(pivot.row))
            for c, value in pivot.row.items():
                rest = (row.get(c, 0) - factor * value) % PRIME
                if rest:
                    row[c] = rest
                else:
                    row.pop(c, None)
        return row, used

    def _work(self, steps: int) -> None:
        self.left -= steps
        if self.left < 0:
            raise TooTangledError

    def circuit(self, source: int) -> set[int]:
        """The conditions that a redundant one depends on, and itself."""
        weight: dict[int, int] = defaultdict(int)
        waiting: list[tuple[int, int]] = []
        found = {source}

        def owe(column: int, amount: int) -> None:
            if column not in weight:
                heapq.heappush(waiting, (-self.pivots[column].source, column))
            weight[column] = (weight[column] + amount) % PRIME

        for column, factor in self._reduce(self.conditions[source])[1]:
            owe(column, factor)
        while waiting:  # later pivots first: they only use earlier ones
            column = heapq.heappop(waiting)[1]
            pivot = self.pivots[column]
            amount = weight[column] * pivot.scale % PRIME
            if amount:
                found.add(pivot.source)
                self._work(4 * (1 + len(pivot.used)))  # a heap costs more than a row
                for earlier, factor in pivot.used:
                    owe(earlier, -amount * factor)
        return found

    def solution(self, free: Sequence[int]) -> Sequence[int]:
        """Values of all columns that meet the conditions, as given where a column is free."""
        value = list(free)
        for column in sorted(self.pivots, reverse=True):
            value[column] = -sum(f * value[c] for c, f in self.pivots[column].row.items()) % PRIME
        return value
