"""Where Coulomb's equations have no solution, or several: what is said, and whether it is true.

The judge is the independent multibody solver, which follows the friction from zero in all
joints at once; blockmech does it group by group.
"""

from collections import Counter

import numpy as np
import pytest

import blockmech as bm
from tests import machines
from tests.blocks.twin import Twin
from tests.machines import COEFFICIENT, ruiz
from tests.wiring import EPS, off

FORCES = 1e-11  # [-] near the limit the condition of the friction equations is below 100
LIMIT = 1e-8  # [-] the judge halves its steps down to 1e-12 and gives up a little before
STOP = 1e-3  # [N] where the paper stops successive approximations
PINS = ("B", "C", "D")


def rough(factor):
    """The Ruiz four-bar with f' r [m] at every pin."""
    return ruiz(radius=factor / COEFFICIENT).compile()


def limits(at, factor=3.0):
    """Self-locking limits f' r [m] at crank angles where that factor locks, and how it ends."""
    flags = rough(factor).run(at=at, want="crank.drive", on_gap="mark").quality.flags
    assert [f.sample for f in flags] == list(range(len(at)))
    return np.array([factor * f.value for f in flags]), [f.code for f in flags]


# ---- the limits --------------------------------------------------------------------------


def test_limits_are_those_of_the_independent_solver():
    at = [2.0, 5.76, 5.78, 5.8, 5.83, 6.0]
    found, codes = limits(at)
    judge = Twin(rough(3.0))
    scales = [judge.judge([q], [10.0], [0.0]).forces.scale for q in at]
    assert off(found / 3.0, scales, 1.0) <= LIMIT
    assert set(codes) == {"fold", "asymptote"}


def test_limits_of_the_papers_linkage():
    # f' r = 0.0030 m there: the linkage is a few hundred times smoother than it may be
    found, codes = limits([5.78, 6.0])
    assert found == pytest.approx([0.8277, 1.4308], abs=5e-5)
    assert codes == ["asymptote", "fold"]


def test_worst_crank_angle_is_where_asymptotes_and_folds_meet():
    at = np.linspace(5.78, 5.86, 33)
    found, codes = limits(at)
    worst = int(np.argmin(found))
    assert found[worst] == pytest.approx(0.80, abs=0.005)
    assert codes[:worst] == ["asymptote"] * worst
    assert codes[worst + 1 :] == ["fold"] * (len(at) - worst - 1)


def test_limit_does_not_depend_on_the_friction_it_is_found_with():
    at = [2.0, 5.8, 6.0]
    for factor in (1.5, 7.0):
        assert off(limits(at, factor)[0], limits(at)[0]) <= LIMIT


@pytest.mark.parametrize("q", [2.0, 5.8, 6.0])
def test_below_the_limit_there_is_an_answer_and_above_there_is_none(q):
    (limit,), _ = limits([q])
    below = rough(limit * (1 - 1e-6)).run(at=q, on_gap="mark")
    above = rough(limit * (1 + 1e-6)).run(at=q, on_gap="mark")
    assert below.quality.status == ("ok",)
    assert above.quality.status == ("self-locked",)
    assert np.isfinite(below["crank.drive"][0])
    assert np.isnan(above["crank.drive"][0])


# ---- answers beyond the certificate ------------------------------------------------------


@pytest.mark.parametrize("factor", [0.3, 0.7, 0.79, 1.0, 1.2])
def test_answers_beyond_the_certificate_are_those_of_the_independent_solver(factor):
    mech = rough(factor)
    judge, at = Twin(mech), [0.4, 1.2, 2.0, 2.9, 4.0, 4.8, 5.5, 6.0]
    r = mech.run(at=at, on_gap="mark")
    solved = 0
    for k, q in enumerate(at):
        verdict = judge.judge([q], [10.0], [0.0]).forces
        assert (r.quality.status[k] == "ok") == verdict.converged
        if not verdict.converged:
            continue
        solved += 1
        largest = max(abs(complex(*j.force)) for j in verdict.joints.values())
        for name, joint in verdict.joints.items():
            assert abs(r[f"{name}.reaction"][k] - complex(*joint.force)) <= FORCES * largest
            assert abs(r[f"{name}.friction"][k] - joint.friction) <= FORCES * largest * factor
    assert solved >= 5


@pytest.mark.parametrize(("q", "kind"), [(1.118, "fold"), (6.0, "fold"), (5.78, "asymptote")])
def test_just_below_a_limit_the_answer_lies_on_the_branch_from_zero_friction(q, kind):
    (limit,), codes = limits([q])
    assert codes == [kind]
    for below in (1e-2, 4e-4, 1e-5, 1e-8):
        mech = rough(limit * (1 - below))
        result = mech.run(at=q)
        above = bool(result.quality.existence["dyad"][0] > 1)
        assert above == (kind == "fold") or (kind == "fold" and below > 1e-4)
        other = ["other-solutions"] * above  # the one that it meets in the fold
        assert [f.code for f in result.quality.flags] == ["by-continuation", *other]
        expected = Twin(mech).judge([q], [10.0], [0.0]).forces.drivers["crank"]
        # the factor's rounding, over its distance from the limit
        assert abs(result["crank.drive"][0] - expected) <= abs(expected) * 10 * EPS / below


def test_certified_samples_carry_no_flag_and_a_contraction_below_one():
    r = rough(0.3).run(at=np.linspace(0.1, 6.1, 25))
    flagged = {f.sample for f in r.quality.flags if f.code == "by-continuation"}
    for k, bound in enumerate(r.quality.contraction["dyad"]):
        assert (k in flagged) == (bound >= 1)


# ---- successive approximations never pass off a wrong answer -----------------------------


def test_successive_approximations_agree_with_continuation_or_say_that_they_failed():
    at, seen = np.linspace(0.05, 6.25, 21), Counter()
    for factor in (0.3, 0.7, 0.85, 1.0, 1.2, 1.44, 2.0):
        mech = rough(factor)
        exact = mech.run(at=at, on_gap="mark")
        result = mech.run(at=at, on_gap="mark", friction=bm.friction.Successive(tolerance=STOP))
        for k in range(len(at)):
            how = result.quality.status[k]
            seen[exact.quality.status[k], how] += 1
            if exact.quality.status[k] != "ok":
                assert how == exact.quality.status[k]
            if how != "ok":
                assert np.isnan(result["crank.drive"][k])
                continue
            rho = min(result.quality.contraction["dyad"][k], 1 - 1e-9)
            reach = STOP * max(1.0, rho / (1 - rho))
            for pin in PINS:
                mine, best = (abs(x[f"dyad.{pin}.reaction"][k]) for x in (result, exact))
                # the contraction is observed at the end: it may still have grown a little
                assert abs(mine - best) <= 10 * reach + FORCES * best
    assert seen["ok", "ok"] > 50
    assert seen["ok", "not-converged"] > 0  # solutions that the iteration cannot reach
    assert seen["self-locked", "self-locked"] > 10


def test_not_converged_raises_a_friction_error_that_says_so():
    with pytest.raises(bm.FrictionError, match="successive approximations did not converge"):
        rough(1.0).run(
            at=np.linspace(0.05, 6.25, 21), friction=bm.friction.Successive(tolerance=1e-8)
        )


@pytest.mark.parametrize(
    "settings", [{"friction": "single"}, {"friction": bm.friction.Successive(iterations=3)}]
)
def test_an_unfinished_iteration_is_an_answer_only_where_its_bound_says_so(settings):
    at, answers = np.linspace(0.05, 6.25, 21), 0
    for factor in (0.01, 0.3, 0.8, 1.5):
        mech = rough(factor)
        exact = mech.run(at=at, on_gap="mark")
        result = mech.run(at=at, on_gap="mark", **settings)
        for k, how in enumerate(result.quality.status):
            if how == "ok":
                answers += 1
                P = exact.quality.contraction["dyad"][k]
                bound = result.quality.residual["dyad"][k] / (1 - P)
                assert P < 1
                assert bound < 1
                mine, best = (
                    np.array([abs(x[f"dyad.{pin}.friction"][k]) for pin in PINS])
                    for x in (result, exact)
                )
                assert np.abs(mine - best).max() <= 2 * bound * mine.max()  # P is no norm
            elif exact.quality.status[k] == "ok":
                assert how == "not-converged"
    assert answers > 20


@pytest.mark.parametrize("friction", ["newton", "successive"])
def test_films_without_a_certificate_are_told_from_iterations_that_fail(friction):
    film = {"viscosity": 0.05, "radius": 0.02, "length": 0.02, "clearance": 2e-5}
    table = {"sommerfeld": [0.0, 0.1, 1.0], "friction_variable": [9e4, 3.0, 20.0]}
    g = slider_crank(0.1)
    g.blocks["dyad"] = bm.RRP(
        l=2.0, h=0.0, friction={"C": bm.friction.Hydrodynamic(**film, **table)}
    )
    run = g.compile().run
    marked = run(at=1.0, rates=50.0, friction=friction, on_gap="mark")
    certificate = marked.quality.contraction["dyad"][0]
    assert certificate >= 1
    with pytest.raises(bm.FrictionError, match="no proof that there is one solution") as caught:
        run(at=1.0, rates=50.0, friction=friction)
    why = "friction of dyad.C is not linear in the load"
    assert f"{why}, certificate {certificate:.4g}" in str(caught.value)
    g.blocks["crank"] = bm.Crank(length=1.0, links={"crank": bm.Link(inertia=2.0)})
    motion = g.compile().simulate("time=0.1", start={"crank": (1.0, 50.0)}, friction=friction)
    assert motion.motion.end == "self-locking in motion"
    assert motion.motion.notes[-1].startswith(why)


# ---- prismatic pairs ---------------------------------------------------------------------


def slider_crank(mu, guide_length=None, height=0.0):
    law = bm.friction.Coulomb(coefficient=mu, guide_length=guide_length)
    graph = machines.slider_crank(1.0, 2.0, height, friction={"S": law})
    return machines.load(graph, "push", bm.Force(force=(-100.0, 0.0)), at="dyad.j")


def test_slider_jams_where_the_rod_stands_within_the_friction_angle():
    # the crank pulls the slider against the push: it locks at tan(angle of the rod) = 1 / mu
    at = 2.0
    rod = np.arcsin(np.sin(at) / 2.0)
    limit = 1 / np.tan(rod)
    for mu, status in ((limit * (1 - 1e-6), "ok"), (limit * (1 + 1e-6), "jammed")):
        for rate in (1.0, -1.0):
            r = slider_crank(mu).run(at=at, rates=rate, on_gap="mark")
            pushed = r["dyad.S.slip"][0] > 0  # against the load, which points to -x
            assert r.quality.status == ((status,) if pushed else ("ok",))
    r = slider_crank(2 * limit).run(at=at, rates=-1.0, on_gap="mark")
    (flag,) = r.quality.flags
    assert flag.value == pytest.approx(0.5, rel=1e-9)


def test_jammed_slider_raises_a_friction_error_with_the_reach():
    with pytest.raises(bm.FrictionError, match=r"\[jammed\] dyad at .*solvable up to 0\.\d+ times"):
        slider_crank(5.0).run(at=2.0, rates=-1.0)
