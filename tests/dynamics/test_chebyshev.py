"""The spectral tools keep relative accuracy where integrals go to zero."""

from __future__ import annotations

import numpy as np
import pytest

from blockmech.dynamics.chebyshev import (
    angle,
    crawls,
    half_integral,
    integral,
    part_of,
    remainder,
    rule,
    series,
)

L = 0.7
SIZES = [16, 32, 64]


def grown(v):
    """exp(3 v) and its integral from 0."""
    return np.exp(3 * v), np.expm1(3 * v) / 3


@pytest.mark.parametrize("n", SIZES)
def test_integrals_to_the_nodes_are_exact_relative_to_themselves(n):
    r = rule(n)
    f, whole = grown(L * r.low)
    assert np.abs(L / 2 * (f @ r.integrate) / whole - 1).max() <= 4e-14
    assert L / 2 * (f @ r.total) == pytest.approx(grown(L)[1], rel=1e-14)


@pytest.mark.parametrize("n", SIZES)
def test_integrals_between_the_nodes_are_exact_relative_to_themselves(n):
    r = rule(n)
    z = np.array([1e-12, 1e-6, 0.1, 0.7, 1.0])
    s = np.repeat((grown(L * r.low)[0] @ r.sine)[None], z.size, axis=0)
    assert np.abs(L / 2 * integral(s, angle(z)) / grown(L * z)[1] - 1).max() <= 1e-13


def test_series_half_integrals_and_barycentric_values_agree_with_the_function():
    r = rule(32)
    f = grown(L * r.low)[0]
    z = np.array([0.01, 0.3, 0.9])
    c = np.repeat((f @ r.cosine)[None], z.size, axis=0)
    assert np.abs(series(c, angle(z)) - grown(L * z)[0]).max() <= 1e-13
    for start, share in ((0.5, 0.25), (0.0, 0.5), (0.12, 0.34)):
        wanted = grown(L * (start + share * r.low))[0]
        assert np.abs(part_of(f[None], r, start, share)[0] - wanted).max() <= 1e-13
    nodes = half_integral(np.repeat(c[:1], 32, axis=0), r.phi)
    assert np.abs(nodes - f @ r.integrate_half).max() <= 1e-13


def test_values_and_slopes_at_the_ends():
    r = rule(32)
    f = grown(L * r.low)[0]
    start, end, slope_start, slope_end, whole = f @ r.ends
    assert (start, end) == pytest.approx((1.0, np.exp(3 * L)), rel=1e-13)
    assert (slope_start, slope_end) == pytest.approx((3 * L, 3 * L * np.exp(3 * L)), rel=1e-10)
    assert whole == pytest.approx(f @ r.total)


@pytest.mark.parametrize("pole", [0.02, 0.1, 0.5])
def test_remainder_bounds_what_the_series_misses(pole):
    r = rule(32)
    v = r.low
    f = 1 / (v - 0.5 + 1j * pole)
    exact = np.log(0.5 + 1j * pole) - np.log(-0.5 + 1j * pole)
    missed = abs((f.real @ r.total) / 2 - exact.real)
    partial = np.abs(
        (f.real @ r.integrate) / 2 - np.log(np.abs((v - 0.5 + 1j * pole) / (-0.5 + 1j * pole)))
    )
    assert max(missed, partial.max()) <= remainder(f.real, r) / 2 + 1e-15


def test_something_narrower_than_the_nodes_is_noticed():
    r = rule(64)
    assert crawls(1 / np.sqrt(r.low + 1e-9), r)
    assert not crawls(np.exp(r.low), r)
