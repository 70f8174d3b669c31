"""A sparse matrix by its entries, and systems of equations with it, square or not."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DENSE = 180  # unknowns up to which matrices are full
LEAST_SQUARES = 180  # unknowns up to which a system that is not square is solved
SINGULAR = 1e-7  # [-] of the largest singular value; below, a direction is left alone
LARGE_STEP = 3.0  # [-] a solution that is larger comes from a singular matrix: take a short one


@dataclass(frozen=True)
class Matrix:
    """A sparse matrix by its entries; those at one place add."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    value: Floats
    shape: tuple[int, int] = (0, 0)

    @classmethod
    def empty(cls) -> Matrix:
        """No entries."""
        return cls(np.zeros(0, int), np.zeros(0, int), np.zeros(0))

    def plus(self, other: Matrix) -> Matrix:
        """The entries of both."""
        return Matrix.joined([self, other], self.shape)

    def below(self, rows: int) -> Matrix:
        """The same further down."""
        return Matrix(self.row + rows, self.column, self.value)

    @classmethod
    def joined(cls, parts: Sequence[Matrix], shape: tuple[int, int]) -> Matrix:
        """The entries of several."""
        return cls(
            np.concatenate([p.row for p in parts]),
            np.concatenate([p.column for p in parts]),
            np.concatenate([p.value for p in parts]),
            shape,
        )

    def full(self) -> Floats:
        """As an array."""
        found = np.zeros(self.shape)
        np.add.at(found, (self.row, self.column), self.value)
        return found

    def solve(self, rhs: Floats) -> Floats:
        """The solution of a square system; the shortest nearly so where it is singular."""
        rows, columns = self.shape
        if rows == columns > DENSE:
            found = self._sparse(rhs)
            if found is not None:
                return found
        if rows == columns <= DENSE:
            with suppress(np.linalg.LinAlgError):
                step = np.asarray(np.linalg.solve(self.full(), rhs), float)
                if np.isfinite(step).all() and np.abs(step).max(initial=0.0) < LARGE_STEP:
                    return step
        return self.shortest(rhs)

    def shortest(self, rhs: Floats) -> Floats:
        """The shortest of those that are nearest to a solution; 0 where it would take long."""
        if self.shape[1] > LEAST_SQUARES:
            return np.zeros(self.shape[1])
        return np.asarray(np.linalg.lstsq(self.full(), rhs, rcond=SINGULAR)[0], float)

    def _sparse(self, rhs: Floats) -> Floats | None:
        """The solution of a large square system, None where it is singular."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        try:
            matrix = csc_array((self.value, (self.row, self.column)), shape=self.shape)
            found: Floats = splu(matrix).solve(rhs)
        except RuntimeError:  # exactly singular
            return None
        return found if np.isfinite(found).all() else None
