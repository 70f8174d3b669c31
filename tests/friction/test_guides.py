"""Friction of guides, whose load max(|N|, 2 |C| / L) has kinks: all methods, jams, limits."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from blockmech.friction.continuation import Outcome
from blockmech.friction.solvers import newton
from tests.wiring import continue_from_zero

ROUNDING = 1e-11  # [-] of the largest friction: a 3 x 3 solve, condition below 1e4
SEEDS = range(30)


def random_group(seed, pairs, strength):
    """Factors, base loads and influences of guides, as a force pass would give them."""
    chance = np.random.default_rng(seed)

    def vectors(*shape):
        return chance.normal(size=shape) + 1j * chance.normal(size=shape)

    k = strength * chance.uniform(0.2, 1.0, pairs) * chance.choice((-1.0, 1.0), pairs)
    base = tuple(map(complex, vectors(pairs)))
    rows = tuple(tuple(map(complex, row)) for row in vectors(pairs, pairs))
    return tuple(map(float, k)), (True,) * pairs, base, rows


def load(z):
    return max(abs(z.real), abs(z.imag))


def press(z, direction):
    """Load along the direction of an edge."""
    return (z * np.conj(direction)).real


def loads(t, base, rows):
    return [
        f + sum(x * r for x, r in zip(t, row, strict=True))
        for f, row in zip(base, rows, strict=True)
    ]


def misfit(t, k, base, rows):
    """Largest residual of t = k g, relative to the largest friction."""
    g = [load(F) for F in loads(t, base, rows)]
    return max(abs(x - c * y) for x, c, y in zip(t, k, g, strict=True)) / max(map(abs, t))


def all_solutions(k, base, rows):
    """Every solution, by trying each edge of each guide: then the equations are linear."""
    m = len(k)
    found = []
    for contacts in itertools.product((1, -1, 1j, -1j), repeat=m):
        A = np.eye(m) - [
            [k[j] * press(rows[j][i], contacts[j]) for i in range(m)] for j in range(m)
        ]
        b = [k[j] * press(base[j], contacts[j]) for j in range(m)]
        t = np.linalg.solve(A, b)
        if all(
            press(F, w) >= load(F) * (1 - 1e-9)
            for F, w in zip(loads(t, base, rows), contacts, strict=True)
        ):
            found.append(t)
    return found


@pytest.mark.parametrize("pairs", [1, 2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_continuation_over_kinks_ends_at_a_solution_or_says_why_not(seed, pairs):
    k, edges, base, rows = random_group(seed, pairs, 0.5)
    path = continue_from_zero(k, edges, base, rows)
    solutions = all_solutions(k, base, rows)
    assert path.outcome != Outcome.NOT_CONVERGED
    if path.outcome == Outcome.BY_CONTINUATION:
        assert misfit(path.t, k, base, rows) <= ROUNDING
        assert any(np.allclose(path.t, t, rtol=1e-9, atol=1e-12) for t in solutions)
    else:
        assert 0 < path.limit < 1
        assert np.isnan(path.t).all()


@pytest.mark.parametrize("pairs", [1, 2, 3])
def test_limit_of_a_jam_is_where_it_begins(pairs):
    jams = 0
    for seed in SEEDS[::2]:
        k, edges, base, rows = random_group(seed, pairs, 1.5)
        path = continue_from_zero(k, edges, base, rows)
        if path.outcome == Outcome.BY_CONTINUATION:
            continue
        jams += 1
        less, more = ([x * path.limit * s for x in k] for s in (1 - 1e-6, 1 + 1e-6))
        below = continue_from_zero(less, edges, base, rows)
        assert below.outcome == Outcome.BY_CONTINUATION
        assert misfit(below.t, less, base, rows) <= 1e-7  # condition 1e6 so near the limit
        above = continue_from_zero(more, edges, base, rows)
        assert above.outcome in (Outcome.FOLD, Outcome.ASYMPTOTE)
    assert jams >= 5


def test_newton_with_a_certificate_finds_what_continuation_finds():
    certified = 0
    for seed in SEEDS:
        k, edges, base, rows = random_group(seed, 3, 0.15)
        result = newton(k, edges, base, rows)
        if result.contraction >= 1:
            continue
        certified += 1
        path = continue_from_zero(k, edges, base, rows)
        assert result.outcome == Outcome.CERTIFIED
        assert np.abs(np.subtract(result.t, path.t)).max() <= ROUNDING * np.abs(path.t).max()
    assert certified >= 10


def test_normal_force_may_change_its_sign_as_friction_grows():
    """Two guides, N_1 = -1 + t_2 and t_2 = 2 k_2: N_1 passes zero at k_2 = 0.5."""
    k, edges, base, rows = (0.5, 0.5), (True, True), (-1 + 0j, 2 + 0j), ((0j, 1 + 0j), (0j, 0j))
    path = continue_from_zero(k, edges, base, rows)
    assert path.outcome == Outcome.BY_CONTINUATION
    assert path.t == pytest.approx((0.0, 1.0), abs=1e-12)
    more = continue_from_zero((0.5, 0.9), edges, base, rows)
    assert more.t == pytest.approx((0.4, 1.8), rel=ROUNDING)
