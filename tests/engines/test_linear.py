"""Small linear systems: pivoting, extended precision, one sample's answer in any batch."""

from __future__ import annotations

import numpy as np
import pytest

from blockmech.engines import numpy as linear
from blockmech.ground.plane import SCALAR_PRIMITIVES

LONG = np.longdouble
EPS = float(np.finfo(LONG).eps)
SIZES = (1, 2, 5, 12)


def systems(size: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Well-conditioned matrices (count, size, size) that need their rows swapped."""
    chance = np.random.default_rng(size)
    turned = np.linalg.qr(chance.normal(size=(count, size, size)))[0]
    a = (turned + 0.1 * chance.normal(size=turned.shape)).astype(LONG)
    for k in range(0, count, 2):
        a[k, 0, 0] = 0.0 if size > 1 else 1.0
    return a, chance.normal(size=(count, size)).astype(LONG)


@pytest.mark.parametrize("size", SIZES)
def test_elimination_leaves_residuals_of_rounding_in_extended_precision(size: int) -> None:
    a, b = systems(size, 40)
    x = np.stack(linear.solve(a, b.T), axis=-1)
    residuals = np.abs(np.einsum("nij,nj->ni", a, x) - b).max(axis=-1)
    scale = np.abs(a).sum(axis=-1).max(axis=-1) * np.abs(x).max(axis=-1)
    # Wilkinson: the growth of entries with partial pivoting is seldom above 8 here.
    assert (residuals <= 8 * size * EPS * scale).all()


def test_an_eliminated_system_has_the_same_bits_alone_and_in_a_batch() -> None:
    a, b = systems(6, 259)
    batch = np.stack(linear.solve(a, b.T), axis=-1)
    for k in (0, 127, 258):
        alone = np.stack(linear.solve(a[k : k + 1], b[k : k + 1].T), axis=-1)
        assert (alone[0] == batch[k]).all()


def test_a_singular_matrix_costs_no_other_sample_its_answer() -> None:
    a, b = systems(3, 4)
    a[2] = 0.0
    with np.errstate(all="ignore"):
        x = np.stack(linear.solve(a, b.T), axis=-1)
    assert not np.isfinite(x[2]).any()
    assert np.isfinite(x[[0, 1, 3]]).all()


def test_a_matrix_takes_numbers_and_batches_side_by_side() -> None:
    column = np.array([1.0, 2.0, 3.0])
    result = linear.stacked_matrix([[column, 0.0], [0.5, np.float64(4.0)]], np.float64)
    assert result.tolist() == [[[x, 0.0], [0.5, 4.0]] for x in column]


def test_one_sample_without_a_pose_has_no_spread_either() -> None:
    assert np.isnan(SCALAR_PRIMITIVES["spread"](np.array([[1.0, np.nan], [0.0, 1.0]])))
