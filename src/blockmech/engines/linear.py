"""Small linear systems on batches: one matrix a sample, each solved by itself.

LAPACK factors every matrix of a stack alone, so a sample's answer does not depend on
its batch. In extended precision, which LAPACK does not know, elimination is written out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from blockmech.typing import Array, Reals

LAPACK = (np.float32, np.float64)


def matrix(rows: Sequence[Reals], dtype: Any) -> Array:
    """Rows of numbers or batches (...) as one array (..., N, N)."""
    filled = [
        (i, j, x)
        for i, row in enumerate(rows)
        for j, x in enumerate(row)
        if not isinstance(x, float) or x != 0.0
    ]
    shape = np.broadcast_shapes(*{np.shape(x) for _, _, x in filled})
    matrix_ = np.zeros((*shape, len(rows), len(rows)), dtype)
    for i, j, x in filled:
        matrix_[..., i, j] = x
    return matrix_


def solve(a: Array, right: Reals) -> tuple[Array, ...]:
    """Solutions of a x = right, N arrays (...); not finite where a matrix is singular."""
    shape = np.broadcast_shapes(a.shape[:-2], *(np.shape(x) for x in right))
    b = np.empty((*shape, len(right)), a.dtype)
    for i, x in enumerate(right):
        b[..., i] = x
    solution = np.ascontiguousarray(np.moveaxis(_solved(a, b), -1, 0))
    return tuple(solution)


def solve_transposed(a: Array, right: Reals) -> tuple[Array, ...]:
    """Solutions of a^T x = right."""
    return solve(np.swapaxes(a, -1, -2), right)


def _solved(a: Array, b: Array) -> Array:
    if a.dtype not in LAPACK:
        return _eliminated(np.broadcast_to(a, (*b.shape, b.shape[-1])), b)
    try:
        return np.asarray(np.linalg.solve(a, b[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return _solve_apart(a, b)


def _solve_apart(a: Array, b: Array) -> Array:
    """The rare batch with a singular matrix in it."""
    solutions = np.full(b.shape, np.nan, a.dtype)
    matrices = np.broadcast_to(a, (*b.shape, b.shape[-1]))
    for index in np.ndindex(b.shape[:-1]):
        try:
            solutions[index] = np.linalg.solve(matrices[index], b[index])
        except np.linalg.LinAlgError:
            continue
    return solutions


def _eliminated(a: Array, b: Array) -> Array:
    """Gaussian elimination with partial pivoting, samples side by side."""
    augmented = np.concatenate([a, b[..., None]], axis=-1)
    return np.moveaxis(_reduced(np.array(np.moveaxis(augmented, (-2, -1), (0, 1)))), 0, -1)


def _reduced(augmented: Array) -> Array:
    """Solutions (N, ...) of matrices with their right sides (N, N + 1, ...), which are lost."""
    n = len(augmented)
    for k in range(n):
        pivot = np.argmax(np.abs(augmented[k:, k]), axis=0) + k
        swapped = np.take_along_axis(augmented, pivot[None, None], axis=0)
        np.put_along_axis(augmented, pivot[None, None], augmented[k], axis=0)
        augmented[k] = swapped[0]
        factor = augmented[k + 1 :, k] / augmented[k, k]
        augmented[k + 1 :, k + 1 :] -= factor[:, None] * augmented[k, k + 1 :]
    for k in reversed(range(n)):
        augmented[k, n] /= augmented[k, k]
        augmented[:k, n] -= augmented[:k, k] * augmented[k, n]
    return augmented[:, n]


def spread(a: Array) -> Array:
    """Ratio of the smallest to the largest singular value; NaN of a matrix with a NaN in it."""
    plain = np.asarray(a, np.float64) if a.dtype not in LAPACK else a
    good = np.isfinite(plain).all(axis=(-2, -1))
    plain = np.where(good[..., None, None], plain, np.eye(plain.shape[-1], dtype=plain.dtype))
    values = np.linalg.svd(plain, compute_uv=False)
    ratio = np.where(good, values[..., -1] / values[..., 0], plain.dtype.type(np.nan))
    return np.asarray(ratio.astype(a.dtype))
