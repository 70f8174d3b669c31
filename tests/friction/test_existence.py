"""The number c: below 1 a dyad's friction has a solution for every load.

Groups are random, and come from the balances of two bodies (`tests.independent.dyads`).
"""

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import Planar, primitives
from blockmech.friction import equations, solvers
from blockmech.friction.continuation import Outcome
from tests.independent import dyads
from tests.machines import ruiz, wire

BOUND = bind_functions(
    {"existence": equations.existence, "newton": solvers.newton}, primitives(np.float64)
)
PLAIN = [(kind, None) for kind in dyads.KINDS]
KNOWN = [*PLAIN, ("RRP", 0.7), ("RPR", 0.7)]


def arguments(groups):
    """k, base and rows of groups as kernels take them."""

    def planar(z):
        return Planar(np.ascontiguousarray(z.real), np.ascontiguousarray(z.imag))

    pairs = range(groups.k.shape[1])
    k = tuple(np.ascontiguousarray(groups.k[:, j]) for j in pairs)
    base = tuple(planar(groups.base[:, j]) for j in pairs)
    return k, base, tuple(tuple(planar(groups.rows[:, j, m]) for m in pairs) for j in pairs)


@np.errstate(all="ignore")
def existence_of(groups):
    k, _, rows = arguments(groups)
    return BOUND["existence"](k, groups.contacts, rows)


@np.errstate(all="ignore")
def solved(groups, solvable=False):
    k, base, rows = arguments(groups)
    return BOUND["newton"](k, tuple(c > 0 for c in groups.contacts), base, rows, solvable)


@pytest.mark.parametrize(("kind", "guide_length"), KNOWN)
@pytest.mark.parametrize("arm", [0.05, 0.3, 1.0, 3.0])
def test_no_dyad_locks_itself_below_one(kind, guide_length, arm):
    n = 1500 if arm == 3.0 else 500  # of long arms one in a hundred is below
    groups = dyads.random_groups(kind, n, arm, np.random.default_rng(1), guide_length)
    c = existence_of(groups)
    result = solved(groups, c < 1)
    below = c < 1
    assert below.sum() > 10
    assert not np.isin(result.outcome[below], [Outcome.FOLD, Outcome.ASYMPTOTE]).any()
    if kind == "RRR":
        assert np.isin(result.outcome[below], [Outcome.CERTIFIED, Outcome.BY_CONTINUATION]).all()


def test_an_arc_that_folds_twice_is_followed_to_its_end():
    """Where it was taken for self-locking; nothing else moves by a bit."""
    folded = 0
    for arm in (0.3, 1.0, 3.0):
        groups = dyads.random_groups("RRR", 1500, arm, np.random.default_rng(2))
        c = existence_of(groups)
        before, after = solved(groups), solved(groups, c < 1)
        same = before.outcome <= Outcome.BY_CONTINUATION
        for a, b in zip(before.t, after.t, strict=True):
            assert np.array_equal(a[same], b[same])
        assert np.array_equal(before.outcome[c > 1], after.outcome[c > 1])
        twice = np.flatnonzero((c < 1) & (before.outcome == Outcome.FOLD))
        folded += len(twice)
        for i in twice:
            expected = dyads.brute_force(groups.of([i]), 2000, np.random.default_rng(3))[0]
            t = np.array([x[i] for x in after.t])
            assert (np.abs(expected - t).max(axis=1) <= 1e-8 * np.abs(t).max()).any()
    assert folded >= 3


def test_of_one_pair_it_is_the_gain_of_its_own_friction():
    k, R = 0.7, 1.2 - 0.5j
    assert equations.existence((k,), (0,), ((R,),)) == pytest.approx(k * abs(R))
    assert equations.existence((k,), (2,), ((1.2 + 0j,),)) == pytest.approx(k * 1.2)
    assert equations.existence((-k,), (4,), ((1.2 - 1.7j,),)) == pytest.approx(k * 1.7)


@pytest.mark.parametrize("a", [0.3, 1.0, 2.5])
def test_of_two_guides_it_is_an_eigenvalue_with_positive_loads(a):
    # N = |A N|, A = [[0, a], [a, 0]]: eigenvectors (1, 1) of a, (1, -1) of -a
    assert equations.of_two(0.0, a, a, 0.0) == pytest.approx(a)
    # alone each guide counts for itself; two above 1 are taken as a pair
    assert equations.of_two(a, 0.0, 0.0, 0.1) == pytest.approx(a)
    assert equations.of_two(a, 0.0, 0.0, a) == pytest.approx(0.0 if a > 1 else a)


def test_reactions_of_the_papers_linkage_grow_without_bound_at_one():
    """At 5.78 rad the friction arm at which they do is known: 0.8277 m."""
    limit = 0.8277
    for factor in (0.3, 0.8):
        result = ruiz(radius=factor / 0.4).compile().run(at=5.78)
        assert result.quality.existence["dyad"][0] == pytest.approx(factor / limit, rel=1e-4)
        assert result["dyad.existence"][0] == result.quality.existence["dyad"][0]


@pytest.mark.parametrize(
    ("factor", "below"), [(0.3, 63), (0.6, 63), (0.8, 58), (1.1, 54), (1.4, 29), (2.0, 6)]
)
def test_poses_of_the_papers_linkage_with_a_solution_for_every_load(factor, below):
    # counts of the independent search that friction-laws' trials made
    run = ruiz(radius=factor / 0.4).compile().run(
        at=0.05 + 0.1 * np.arange(63), want="crank.drive", on_gap="mark"
    )  # fmt: skip
    c, ok = run.quality.existence["dyad"], np.array(run.quality.status) == "ok"
    assert (c < 1).sum() == below
    assert ok[c < 1].all()
    flagged = [f.sample for f in run.quality.flags if f.code == "other-solutions"]
    assert flagged == list(np.flatnonzero(ok & (c > 1)))


def test_every_engine_says_the_same_number():
    mech = ruiz(radius=2.0).compile()
    by = [
        mech.run(at=[0.5, 2.0], want="dyad.existence", engine=e)
        for e in ("scalar", "numpy", "llvm")
    ]
    assert all(np.array_equal(x["dyad.existence"], by[0]["dyad.existence"]) for x in by)


def test_it_is_an_output_where_it_is_known_and_zero_without_friction():
    mech = ruiz().compile()
    assert mech.outputs["dyad.existence"].unit == ""
    assert mech.run(at=1.0, friction="none", want="dyad.existence")["dyad.existence"][0] == 0.0
    assert "crank.existence" not in mech.outputs
    data = mech.run(at=1.0).to_dict()["quality"]["existence"]
    assert math.isclose(data["dyad"][0], mech.run(at=1.0)["dyad.existence"][0])


def test_of_guides_with_a_length_in_pairs_it_is_not_known():
    guide = bm.friction.Coulomb(coefficient=0.1, guide_length=0.3)
    g = bm.Graph("trammel")
    markers = {"G": bm.Marker(at=(0.0, 0.0), angle=0.5 * math.pi), "O": (1.0, 0.0)}
    g.add("frame", bm.Frame(markers=markers))
    g.add("crank", bm.Crank(length=0.2))
    g.add("cross", bm.PRP(friction={"S1": guide, "S2": guide}))
    g.add("push", bm.Force(force=(-100.0, 5.0)))
    wire(g, "frame.O crank.A", "crank.B cross.S1", "frame.G cross.S2", "cross.C push.at")
    run = g.compile().run(at=0.3, rates=1.0)
    assert "cross.existence" not in run
    assert run.quality.existence == {}
