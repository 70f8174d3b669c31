"""Series on panels against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blockmech.functions.series import (
    NODES,
    TOLERANCE,
    coefficients,
    fit,
    nodes,
    panels,
    tail,
    without_rounding,
)

EPS = float(np.finfo(float).eps)


def runge(x):
    return 1 / (1 + 25 * x**2)


def test_values_derivative_and_integral_of_a_function_that_needs_several_panels():
    result = fit(runge, panels(-1, 1, 1))
    x = np.linspace(-1, 1, 501)
    assert result.resolved.all()
    assert len(result.c) > 1
    assert np.abs(result(x) - runge(x)).max() <= TOLERANCE
    slope = -50 * x * runge(x) ** 2
    assert (
        np.abs(result.derivative()(x) - slope).max() <= TOLERANCE * NODES**2 / 0.125
    )  # over the half width
    area = (np.arctan(5 * x) + math.atan(5)) / 5
    assert np.abs(result.integral()(x) - area).max() <= 2 * TOLERANCE


def test_roots_and_extrema_are_those_of_the_sine():
    result = fit(np.sin, panels(0.5, 20.0, 6))
    assert np.abs(result.roots() - math.pi * np.arange(1, 7)).max() <= 8 * EPS * 20
    # Rounding of the values over the curvature 1, times coefficients^2 over the half width.
    assert np.abs(result.extrema() - math.pi * (np.arange(6) + 0.5)).max() <= 1e-13


@pytest.mark.parametrize("gap", [1e-3, 1e-6])
def test_a_pair_of_roots_far_closer_than_the_nodes_is_found(gap):
    result = fit(lambda x: np.cos(x) - math.cos(gap), panels(-1.0, 2.0, 2))
    assert np.abs(result.roots() - [-gap, gap]).max() <= 4 * EPS / gap


def test_a_root_on_the_edge_of_panels_is_found_once():
    for shift in (0.0, 1e-17, -1e-16):
        result = fit(lambda x, s=shift: np.tanh(x - s), panels(-1.0, 1.0, 2))
        assert len(result.roots()) == 1
        assert abs(result.roots()[0]) <= 8 * EPS


def test_panels_are_halved_towards_a_corner_and_say_that_it_is_not_resolved():
    result = fit(lambda x: np.abs(x - 0.3), panels(-1.0, 1.0, 1))
    (i,) = np.flatnonzero(~result.resolved)
    assert result.edges[i] <= 0.3 <= result.edges[i + 1]
    assert result.edges[i + 1] - result.edges[i] <= 1e-6
    assert abs(result.integral()(np.array([1.0]))[0] - (1.3**2 + 0.7**2) / 2) <= 1e-12


def test_what_has_no_series_is_not_halved_for_ever():
    chance = np.random.default_rng(1)
    result = fit(lambda x: chance.normal(size=len(x)), panels(0.0, 1.0, 4), most=64)
    assert len(result.c) <= 64
    assert not result.resolved.any()
    assert len(result.roots()) == 0


def test_values_that_do_not_exist_leave_the_rest_as_it_is():
    with np.errstate(invalid="ignore"):
        result = fit(lambda x: np.sqrt(x), panels(-1.0, 1.0, 4), levels=8)
    x = np.linspace(0.5, 1.0, 11)
    assert np.abs(result(x) - np.sqrt(x)).max() <= TOLERANCE
    assert not result.resolved[:2].any()


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_the_tail_of_a_smooth_function_is_rounding_whatever_its_size(size):
    assert tail(coefficients(size * np.exp(nodes(32)))) == 0.0
    assert tail(coefficients(size * runge(nodes(32)))) > 1e-3


def test_coefficients_that_are_rounding_are_cut_off():
    c = without_rounding(coefficients(np.exp(nodes(64))))
    assert np.count_nonzero(c) < 20
    assert np.abs(np.polynomial.chebyshev.chebval(0.4, c) - math.exp(0.4)) <= 4 * EPS
