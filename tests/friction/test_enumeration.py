"""All solutions of a group: counted against two searches that share no line with it.

The judges are many starts of Newton's method and, of pins, a polynomial of degree 8
(`tests.independent`). The campaign `tests.campaigns.friction` does the same with a thousand
groups each.
"""

import inspect

import numpy as np
import pytest

from blockmech.friction import enumeration
from tests.friction.test_existence import existence_of
from tests.independent import degree_eight, dyads
from tests.independent.kept import kept

KINDS = [*((kind, None) for kind in dyads.KINDS), ("RRP", 0.7), ("RPR", 0.7), ("PRP", 0.7)]


def enumerated(groups):
    return enumeration.enumerated(groups.k, groups.base, groups.rows, groups.contacts)


def sums(found, n):
    total = np.zeros(n)
    np.add.at(total, found.system, found.signs)
    return total


def ten_groups(kind, arm, guide_length):
    return dyads.random_groups(kind, 10, arm, np.random.default_rng(5), guide_length)


@kept(dyads, inspect.getsource(ten_groups))
def brute_force(kind, arm, guide_length):
    """All solutions of ten groups from 400 starts each."""
    groups = ten_groups(kind, arm, guide_length)
    return [t.tolist() for t in dyads.brute_force(groups, 400, np.random.default_rng(6))]


@pytest.mark.parametrize(("kind", "guide_length"), KINDS)
@pytest.mark.parametrize("arm", [0.05, 0.3, 1.0, 3.0])
def test_every_solution_is_one_and_none_is_missing(kind, guide_length, arm):
    groups = ten_groups(kind, arm, guide_length)
    result = enumerated(groups)
    expected = [np.array(t) for t in brute_force(kind, arm, guide_length)]
    F = groups.base[result.system] + np.einsum("sjm,sm->sj", groups.rows[result.system], result.t)
    load = dyads.norms(groups, F)
    off = np.abs(result.t / groups.k[result.system] - load)
    assert (off.max(axis=1) <= 1e-9 * load.max(axis=1)).all()
    for i, judged in enumerate(expected):
        mine = result.t[result.system == i]
        assert len(mine) == len(judged), i
        for t in judged:
            near = np.abs(mine - t).max(axis=1) / np.abs(t).max()
            assert near.min() <= 1e-6


def test_what_is_kept_of_the_search_is_found_again():
    again = brute_force.__wrapped__("RRR", 0.3, None)
    assert len(again) == 10
    for t, known in zip(again, brute_force("RRR", 0.3, None), strict=True):
        assert np.array(t) == pytest.approx(np.array(known), rel=1e-9)


@pytest.mark.parametrize("arm", [0.05, 0.3, 1.0, 3.0])
def test_pins_have_the_solutions_of_a_polynomial_of_degree_eight(arm):
    groups = dyads.random_groups("RRR", 60, arm, np.random.default_rng(7))
    result = enumerated(groups)
    for i in range(60):
        expected = degree_eight.solutions(groups.k[i], groups.base[i], groups.rows[i])
        assert np.sum(result.system == i) == len(expected), i


@pytest.mark.parametrize(("kind", "guide_length"), KINDS)
@pytest.mark.parametrize("arm", [0.05, 0.3, 1.0, 3.0])
def test_indices_sum_to_one_where_the_number_c_is_below_one(kind, guide_length, arm):
    groups = dyads.random_groups(kind, 40, arm, np.random.default_rng(8), guide_length)
    result = enumerated(groups)
    total = sums(result, 40)[result.complete]
    assert result.complete.mean() >= 0.97
    if guide_length is None:
        assert set(total) <= {0.0, 1.0}
    if (kind, guide_length) != ("PRP", 0.7):
        assert np.array_equal(total == 1, existence_of(groups)[result.complete] < 1)


def test_a_lever_has_the_roots_of_a_quadratic():
    # t = k |f + R t|: (1 - k^2 |R|^2) t^2 - 2 k^2 (f.R) t - k^2 |f|^2 = 0, t of k's sign
    k, f, R = 2.0, 10 + 3j, -1 + 0j
    a, b, c = 1 - k * k, k * k * -10.0, k * k * abs(f) ** 2
    root = np.sqrt(b * b + a * c + 0j)
    expected = sorted(
        x.real for x in ((b + root) / a, (b - root) / a) if x.imag == 0 and x.real > 0
    )
    groups = np.array([[k]]), np.array([[f]]), np.array([[[R]]]), (0,)
    result = enumeration.enumerated(*groups)
    assert sorted(result.t[:, 0]) == pytest.approx(expected, rel=1e-12)
    assert result.complete.all()


def test_where_rounding_hides_what_is_apart_exact_misfits_decide():
    """Groups of the campaign whose loads differ by so many digits that doubles prove nothing."""
    groups = dyads.random_groups("RRP", 250, 3.0, np.random.default_rng(1)).of(np.array([9, 156]))
    result = enumerated(groups)
    assert result.complete.all()
    total = np.zeros(2)
    np.add.at(total, result.system, result.signs)
    assert np.array_equal(total == 1, existence_of(groups) < 1)


def test_a_double_solution_is_undecided():
    """At the fold the two solutions of a lever meet: rounding cannot tell whether they are."""
    f, R = 10 + 3j, -1 + 0j
    k = abs(f) / np.sqrt(abs(f) ** 2 - 100.0)
    result = enumeration.enumerated(np.array([[k]]), np.array([[f]]), np.array([[[R]]]), (0,))
    assert not result.complete.any()
    apart = enumeration.enumerated(
        np.array([[k * 0.999]]), np.array([[f]]), np.array([[[R]]]), (0,)
    )
    assert apart.complete.all()
    assert len(apart.system) == 2


def test_pairs_without_load_have_no_friction_and_do_not_count():
    k, base = np.array([[0.3, 0.2]]), np.array([[0j, 2 + 1j]])
    rows = np.array([[[0j, 0j], [0.4 + 0j, 0.5 + 0j]]])
    result = enumeration.enumerated(k, base, rows, (0, 0))
    assert len(result.system) == 1
    assert result.t[0, 0] == 0.0
    assert result.complete.all()


def test_nothing_depends_on_the_units_of_load():
    groups = dyads.random_groups("RRR", 50, 1.0, np.random.default_rng(9))
    for scale in (1e-9, 1e12):
        scaled = groups._replace(base=scale * groups.base)
        a, b = enumerated(groups), enumerated(scaled)
        assert np.array_equal(a.system, b.system)
        assert b.t == pytest.approx(scale * a.t, rel=1e-7)
