"""The friction equations of one group, t = k g(f + R t), as plain numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blockmech.friction import equations, solvers
from blockmech.friction.continuation import Outcome
from tests.wiring import EPS, continue_from_zero

REVOLUTE = (False,)
ROUNDING = 50 * EPS  # some ten operations, and the condition 1 / (1 - P) below 5


def lever(k, f, influence):
    """Closed form of t = k |f + R t| for one pin: the root that starts at zero friction.

    Squared it is (1 - k^2 |R|^2) t^2 - 2 k^2 (f.R) t - k^2 |f|^2 = 0 with t of k's sign.
    """
    a = 1 - k * k * abs(influence) ** 2
    b = k * k * (f.conjugate() * influence).real
    c = k * k * abs(f) ** 2
    return (b + math.copysign(math.sqrt(b * b + a * c), k)) / a


factors = st.floats(0.01, 0.8).flatmap(lambda x: st.sampled_from([x, -x]))
places = st.complex_numbers(min_magnitude=0.1, max_magnitude=1.0)


@given(k=factors, f=st.complex_numbers(min_magnitude=1.0, max_magnitude=1e4), influence=places)
def test_newton_solves_the_lever_in_closed_form(k, f, influence):
    result = solvers.newton((k,), REVOLUTE, (f,), ((influence,),))
    expected = lever(k, f, influence)
    assert abs(result.t[0] - expected) <= ROUNDING * abs(expected) / (1 - abs(k * influence)) ** 2
    assert result.outcome == Outcome.CERTIFIED
    assert result.contraction == pytest.approx(abs(k * influence), rel=1e-12)


@given(k=factors, f=st.complex_numbers(min_magnitude=1.0, max_magnitude=1e4), influence=places)
def test_successive_approximations_stop_within_the_bound_of_the_contraction(k, f, influence):
    tolerance = 1e-6
    result = solvers.successive((k,), REVOLUTE, (f,), ((influence,),), tolerance, None)
    rho = abs(k * influence)
    if result.outcome == Outcome.NOT_CONVERGED:
        assert rho**solvers.CAP * 2e4 > tolerance  # a hundred iterations were not enough
        assert math.isnan(result.t[0])
        return
    error = abs(result.t[0] - lever(k, f, influence))
    assert error <= abs(k) * tolerance / (1 - rho) * 1.001


@given(k=factors, f=st.complex_numbers(min_magnitude=1.0, max_magnitude=1e4), influence=places)
def test_continuation_finds_the_root_that_newton_certifies(k, f, influence):
    path = continue_from_zero((k,), REVOLUTE, (f,), ((influence,),))
    expected = lever(k, f, influence)
    assert path.outcome == Outcome.BY_CONTINUATION
    assert abs(path.t[0] - expected) <= ROUNDING * abs(expected) / (1 - abs(k * influence)) ** 2


def test_successive_approximations_are_the_papers_recurrence():
    k, f, R = 0.2, 100 + 40j, 0.5 - 0.3j
    t = 0.0
    for n in range(1, 6):
        t = k * abs(f + R * t)
        result = solvers.successive((k,), REVOLUTE, (f,), ((R,),), 0.0, n)
        assert result.t[0] == pytest.approx(t, rel=1e-15)
        assert result.iterations == n
    assert solvers.single((k,), REVOLUTE, (f,), ((R,),)).t[0] == k * abs(f)


def test_successive_approximations_stop_relative_to_the_loads():
    k, f, R = 0.4, 100 + 40j, 0.5 + 0.2j
    for scale in (1e-12, 1.0, 1e12):
        result = solvers.successive((k,), REVOLUTE, (scale * f,), ((R,),), None, None)
        assert result.iterations == 11
        assert result.t[0] == pytest.approx(scale * lever(k, f, R), rel=1e-6)


def test_observed_contraction_is_the_ratio_of_changes():
    k, f, R = 0.4, 100 + 40j, 0.5 + 0.2j
    g = [abs(f)]
    for _ in range(4):
        g.append(abs(f + R * k * g[-1]))
    result = solvers.successive((k,), REVOLUTE, (f,), ((R,),), 0.0, 4)
    assert result.contraction == pytest.approx((g[4] - g[3]) / (g[3] - g[2]), rel=1e-9)
    assert result.residual == pytest.approx(abs(g[4] - g[3]) / g[4], rel=1e-9)


@given(
    data=st.lists(st.just(0.0) | st.floats(1e-6, 2.0), min_size=9, max_size=9),
    k=st.lists(st.floats(0.01, 1.0), min_size=3, max_size=3),
)
def test_bound_of_the_contraction_is_never_below_the_spectral_radius(data, k):
    A = np.reshape(data, (3, 3))
    rows = tuple(tuple(complex(x) for x in row) for row in A)
    bound = equations.contraction_bound(tuple(k), (False,) * 3, rows)
    radius = np.abs(np.linalg.eigvals(np.array(k)[:, None] * A)).max()
    assert bound >= radius * (1 - 1e-9)
    assert bound <= (A * np.array(k)).sum(axis=1).max() * (1 + 1e-9)  # sharper than one power


@pytest.mark.parametrize("seed", range(20))
def test_elimination_with_pivoting_solves_any_system_and_tells_its_determinant(seed):
    chance = np.random.default_rng(seed)
    n = 2 + seed % 5
    M, B = chance.normal(size=(n, n)), chance.normal(size=(n, 2))
    M[0, 0] = 0.0  # no pivot where it stands
    found, det = equations.eliminate(np.column_stack([M, B]).tolist(), pivoting=True)
    assert np.allclose(
        np.transpose(found), np.linalg.solve(M, B), rtol=0, atol=1e3 * EPS * np.linalg.cond(M)
    )
    assert det == pytest.approx(np.linalg.det(M), rel=1e-10)


def test_elimination_of_a_singular_system_says_nothing():
    (x,), _ = equations.eliminate([[1.0, 2.0, 1.0], [2.0, 4.0, 1.0]], pivoting=True)
    assert np.isnan(x).all()


@pytest.mark.parametrize("sign", [-1, 1])
def test_folds_and_asymptotes_end_the_path_where_the_closed_form_does(sign):
    # |R| = 1: a = 1 - k^2 vanishes at k = 1; f.R > 0 sends t to infinity there (asymptote),
    # f.R < 0 with k > 0 keeps the root on the branch until the square root vanishes.
    f, R = 10 + 3j, sign * (1 + 0j)
    k = 4.0
    path = continue_from_zero((k,), REVOLUTE, (f,), ((R,),))
    if sign > 0:
        assert path.outcome == Outcome.ASYMPTOTE
        assert path.limit * k == pytest.approx(1.0, rel=1e-9)
    else:
        # k |f - t| = t with t > 0: |f| grows no more; a solution exists up to b^2 + a c = 0
        b = 10.0
        limit = abs(f) / math.sqrt(abs(f) ** 2 - b * b)
        assert path.outcome == Outcome.FOLD
        assert path.limit * k == pytest.approx(limit, rel=1e-9)
    assert math.isnan(path.t[0])


def test_pin_without_load_has_no_friction():
    zero = solvers.newton((0.3, 0.2), (False, False), (0j, 0j), ((1 + 0j, 0j), (0j, 1 + 0j)))
    assert zero.t == (0.0, 0.0)
    assert zero.outcome == Outcome.CERTIFIED


@pytest.mark.parametrize("edges", [(False, False), (True, True)])
@pytest.mark.parametrize("strength", [0.3, 1.0, 1.7, 40.0])
def test_without_load_there_is_no_friction_and_no_jam_whatever_its_factors(strength, edges):
    k, rows = (strength, -0.9 * strength), ((1 + 0.5j, 0.3j), (-0.4 + 0j, 1 - 0.2j))
    solution = solvers.newton(k, edges, (0j, 0j), rows)
    assert solution.t == (0.0, 0.0)
    certified = strength < 0.5
    assert solution.outcome == (Outcome.CERTIFIED if certified else Outcome.BY_CONTINUATION)
    repeated = solvers.successive(k, edges, (0j, 0j), rows, 1e-3, None)
    assert repeated.t == (0.0, 0.0)


def test_pair_at_rest_has_no_friction_and_loads_the_others_as_they_are():
    result = solvers.newton((0.0, 0.2), (False, False), (3 + 4j, 6 + 8j), ((1j, 1j), (1j, 0j)))
    assert result.t[0] == 0.0
    assert result.t[1] == pytest.approx(2.0, rel=1e-15)
    assert result.g[0] == pytest.approx(abs(3 + 6j), rel=1e-15)


def test_impossible_sample_is_left_alone_whatever_its_factors():
    nan = complex("nan+nanj")
    for k in (0.1, 5.0):
        for solve, more in ((solvers.newton, ()), (solvers.successive, (1e-3, None))):
            solution = solve((k,), REVOLUTE, (nan,), ((1 + 0j,),), *more)
            assert math.isnan(solution.t[0])
            assert not solution.outcome > 0


def test_guide_with_edges_is_pressed_by_the_larger_of_force_and_couple():
    assert equations.load_norm(3 - 4j, True) == 4.0
    assert equations.load_norm(3 - 4j, False) == 5.0
    # the two edge contacts of a guide: |N/2 + C/L| + |N/2 - C/L| = max(|N|, 2 |C| / L)
    for N, couple in ((3.0, 1.0), (-3.0, 4.0), (0.0, -2.0)):
        edges = abs(N / 2 + couple / 2) + abs(N / 2 - couple / 2)
        assert equations.load_norm(complex(N, couple), True) == edges
