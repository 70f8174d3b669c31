"""Linear systems of enclosed numbers, by the inverse of the matrix in their middle.

Source: Rump, Verification methods, Acta Numerica 19 (2010), section 10.7.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from blockmech.engines.enclosed.duals import Dual, dual, scaled
from blockmech.engines.enclosed.forms import Form, affine, form, unknown
from blockmech.engines.enclosed.rounding import ROUNDED_UP, TINY, ULP, below
from blockmech.ground.plane import EPS
from blockmech.typing import Array, Reals


def weighted_sum(weights: Iterable[float], forms: Sequence[Form]) -> Form:
    """The sum of forms times weights."""
    terms = [(w, x) for w, x in zip(weights, forms, strict=True) if w != 0.0 and x.magnitude > 0.0]
    at = sum(w * x.at for w, x in terms)
    if any(x.d is None for _, x in terms):
        total = form(0.0)
        for w, x in terms:
            total = total + x * w
        return Form(at, total.low, total.high)
    c = math.fsum(w * x.c for w, x in terms)
    magnitude = sum(abs(w) * (abs(x.c) + len(terms) * x.r) for w, x in terms)
    error = 4 * ULP * magnitude + (TINY if terms else 0.0)
    return affine(at, c, [(w, x.d) for w, x in terms if x.d is not None], error)


class Matrix:
    """A matrix of numbers, perhaps with derivatives, and the inverse of its middle."""

    def __init__(self, rows: Iterable[Reals]) -> None:
        self.rows = tuple(tuple(row) for row in rows)
        self.forms = [[dual(x).x for x in row] for row in self.rows]
        self.low, self.high = (
            np.array([[getattr(x, bound) for x in row] for row in self.forms])
            for bound in ("low", "high")
        )
        self.middle = 0.5 * (self.low + self.high)
        self.width = np.maximum(self.high - self.middle, self.middle - self.low) * ROUNDED_UP
        n = len(self.forms)
        self.inverse, self.residual = np.zeros((n, n)), np.full((n, n), math.inf)

    @property
    def bounded(self) -> bool:
        """Whether all entries have bounds."""
        return bool(np.isfinite(self.low).all() and np.isfinite(self.high).all())

    def invert(self) -> bool:
        """Whether every matrix within the bounds is regular: C A = 1 - residual, which is < 1."""
        if not self.bounded:
            return False
        try:
            self.inverse = C = np.linalg.inv(self.middle)
        except np.linalg.LinAlgError:
            return False
        n = len(C)
        error = abs(C) @ (self.width + (n + 2) * EPS * abs(self.middle)) * ROUNDED_UP
        self.residual = (abs(np.eye(n) - C @ self.middle) + error) * ROUNDED_UP + TINY
        return bool(self.residual.sum(axis=1).max() * ROUNDED_UP < 1.0)

    def error_beside(self, corrections: Array) -> Array:
        """Error of solutions whose corrections (n, ...) from those of the middle have bounds."""
        shares = self.residual.sum(axis=1)
        largest = corrections.max(axis=0) / (1.0 - shares.max() * ROUNDED_UP) * ROUNDED_UP
        error: Array = shares.reshape(-1, *[1] * (corrections.ndim - 1)) * largest * ROUNDED_UP
        return error


def solve(a: Matrix, right: Reals) -> tuple[Form | Dual, ...]:
    """Solution of a x = right: of the middle, then corrected by the residual there.

    With C the inverse of the middle and C a = 1 - E, x = x0 + C (right - a x0) + E (x - x0).
    """
    duals = any(isinstance(x, Dual) for row in (*a.rows, right) for x in row)
    forms = [dual(x).x for x in right]
    if not a.invert() or not all(x.magnitude < math.inf for x in forms):
        return tuple(Dual(unknown(), 0.0, math.inf) if duals else unknown() for _ in right)
    start = a.inverse @ np.array([0.5 * (x.low + x.high) for x in forms])
    residuals = [x - weighted_sum(start, row) for x, row in zip(forms, a.forms, strict=True)]
    corrections = [weighted_sum(row, residuals) for row in a.inverse]
    errors = a.error_beside(np.array([x.magnitude for x in corrections])).tolist()
    solution = [
        form(s) + correction.widened(error)
        for s, correction, error in zip(start.tolist(), corrections, errors, strict=True)
    ]
    return _with_slopes(a, right, solution) if duals else tuple(solution)


def _with_slopes(a: Matrix, right: Reals, solution: Sequence[Form]) -> tuple[Dual, ...]:
    """A solution with its derivatives: a dx = d right - da x."""
    change = [dual(v) for v in right]
    for i, row in enumerate(a.rows):
        for x, entry in zip(solution, row, strict=True):
            if isinstance(entry, Dual):
                change[i] = change[i] - Dual(form(0.0), *scaled(x, entry.d, entry.r))
    shape = np.broadcast_shapes(*(c.d.shape for c in change))
    d, r = (np.array([np.broadcast_to(getattr(c, k), shape) for c in change]) for k in "dr")
    if not np.isfinite(r).all():
        return tuple(Dual(x, 0.0 * d[0], np.full(shape, math.inf)) for x in solution)
    y = a.inverse @ d
    error = (abs(a.inverse) @ (r + (len(y) + 2) * EPS * abs(d))) * ROUNDED_UP + TINY
    error = (error + a.error_beside(abs(y) + error)) * ROUNDED_UP
    return tuple(map(Dual, solution, y, error))


def solve_transposed(a: Matrix, right: Reals) -> tuple[Form | Dual, ...]:
    """Solution of a^T x = right."""
    return solve(Matrix(zip(*a.rows, strict=True)), right)


def spread(a: Matrix) -> Form:
    """Ratio of extreme singular values: those of the middle, as far as its factors are right.

    Of U S V with U and V orthogonal but for errors e they are those of S but for a factor
    1 + e; and no further from those of a than it is from a (Weyl).
    """
    if not a.bounded:
        return unknown()
    u, s, v = np.linalg.svd(a.middle)
    n, identity = len(s), np.eye(len(s))
    tilt = sum(float(np.linalg.norm(x.T @ x - identity)) for x in (u, v)) + 8 * n * n * EPS
    apart = np.linalg.norm(a.middle - (u * s) @ v) + np.linalg.norm(a.width)
    error = (float(apart) + (4 * n * n * EPS + 2 * tilt) * float(s[0])) * ROUNDED_UP
    at, (highest, lowest) = float(s[-1] / s[0]), (float(s[0]), float(s[-1]))
    low = max(lowest - error, 0.0) / (highest + error)
    high = (lowest + error) / (highest - error) if highest > error else 1.0
    return Form(at, max(below(below(low)), 0.0), min(-below(below(-high)), 1.0))
