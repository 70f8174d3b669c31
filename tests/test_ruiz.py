"""The paper's four-bar against reference rows that were made without Assur groups.

Source of the rows: tests/data/ruiz_fourbar.json (Ruiz, Durango & Calle 2010, Table 1).
"""

import numpy as np
import pytest

import blockmech as bm
from tests.machines import COEFFICIENT, ruiz
from tests.wiring import off, recorded

ROWS = recorded("ruiz_fourbar")["rows"]
CRANKS = [row["crank"] for row in ROWS]
LINKS = {"1": "crank.crank", "2": "dyad.i", "3": "dyad.j"}
JOINTS = {"A": "crank.A", "B": "dyad.B", "C": "dyad.C", "D": "dyad.D"}

MOTION = 1e-13  # [-] of the largest of its kind; margins here are above 0.2
FORCES = 1e-12  # [-] of its own size
STOP = 1e-3  # [N] the paper's stop of successive approximations
LOST = "mechanism.friction_power"
FACTOR = 0.003  # [m] f' r of every pin
DETERMINED = slice(1, None)  # at crank 0 the sense of joint C is undefined

EACH_ENGINE = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def run(engine="scalar", **request):
    return ruiz().run(at=CRANKS, engine=engine, **request)


def column(key, part):
    return np.array([row[key][part] for row in ROWS])


def vectors(key, part):
    return column(key, part)[:, :2] @ np.array([1, 1j])


def own_error(found, wanted):
    """Largest error of any number, relative to that number."""
    return np.max(np.abs(np.asarray(found) - wanted) / np.abs(wanted))


# ---- motion ------------------------------------------------------------------------------


@EACH_ENGINE
def test_links_move_as_in_the_reference(engine):
    r = run(engine)
    largest = {"p": max(np.abs(vectors("poses", link)).max() for link in LINKS)}
    for quantity in ("omega", "alpha"):
        largest[quantity] = max(np.abs(column(quantity, link)).max() for link in LINKS)
    for link, name in LINKS.items():
        assert off(r[f"{name}.p"], vectors("poses", link), largest["p"]) <= MOTION
        # Angles count turns in the reference, ours are in (-pi, pi]: compare directions.
        expected = np.exp(1j * column("poses", link)[:, 2])
        assert off(np.exp(1j * r[f"{name}.angle"]), expected) <= MOTION
        for quantity in ("omega", "alpha"):
            assert off(r[f"{name}.{quantity}"], column(quantity, link), largest[quantity]) <= MOTION


def test_coupler_point_moves_as_its_link_does():
    r = run(want=["dyad.S.*", "dyad.i.*"])
    arm = np.exp(1j * r["dyad.i.angle"]) * 2.5 * np.exp(1j * np.pi / 6)
    om, al = r["dyad.i.omega"], r["dyad.i.alpha"]
    assert off(r["dyad.S.p"], r["dyad.i.p"] + arm) <= MOTION
    assert off(r["dyad.S.v"], r["dyad.i.v"] + 1j * om * arm) <= MOTION
    assert off(r["dyad.S.a"], r["dyad.i.a"] + (1j * al - om**2) * arm) <= MOTION


# ---- forces ------------------------------------------------------------------------------


@EACH_ENGINE
def test_reactions_friction_and_lost_power_are_those_of_the_reference(engine):
    r = run(engine)
    assert r.quality.status == ("ok",) * len(ROWS)
    for joint, name in JOINTS.items():
        assert own_error(r[f"{name}.reaction"], vectors("reactions", joint)) <= FORCES
        assert off(r[f"{name}.friction"], column("friction_couples", joint)) <= FORCES
    assert r["dyad.C.friction"][0] == 0
    for name, key in (("crank.drive", "driving_moment"), (LOST, "friction_power")):
        assert own_error(r[name], [row[key] for row in ROWS]) <= FORCES


@EACH_ENGINE
def test_reactions_without_friction_are_those_of_the_reference(engine):
    r = run(engine, friction="none")
    for joint, name in JOINTS.items():
        assert own_error(r[f"{name}.reaction"], vectors("frictionless_reactions", joint)) <= FORCES
    expected = [row["frictionless_driving_moment"] for row in ROWS]
    for name in ("crank.drive", "crank.drive_by_reduction"):
        assert own_error(r[name], expected) <= FORCES


def test_friction_couples_have_the_size_of_coulomb_and_oppose_the_slip():
    r = run()
    for name in JOINTS.values():
        couple, slip = r[f"{name}.friction"][DETERMINED], r[f"{name}.slip"][DETERMINED]
        assert own_error(np.abs(couple), FACTOR * np.abs(r[f"{name}.reaction"])[1:]) <= FORCES
        assert np.all(np.sign(couple) == -np.sign(slip))


# ---- successive approximations -----------------------------------------------------------


@EACH_ENGINE
@pytest.mark.parametrize("k", [1, 2, 3])
def test_iterates_of_successive_approximations_are_the_papers(engine, k):
    r = run(engine, friction=bm.friction.Successive(iterations=k))
    expected = [row["iterates"][k] for row in ROWS]
    assert [w["k"] for w in expected] == [k] * len(ROWS)
    for joint, name in JOINTS.items():
        sizes = [w["magnitudes"][joint] for w in expected]
        assert own_error(np.abs(r[f"{name}.reaction"]), sizes) <= FORCES
    assert own_error(r["crank.drive"], [w["driving_moment"] for w in expected]) <= FORCES
    assert np.all(r.quality.iterations["dyad"] == k)


@EACH_ENGINE
def test_three_iterations_reach_a_thousandth_of_a_newton(engine):
    second = run(engine, friction=bm.friction.Successive(iterations=2))
    third = run(engine, friction=bm.friction.Successive(iterations=3))
    stopped = run(engine, friction="successive")
    for name in JOINTS.values():
        change = np.abs(third[f"{name}.reaction"]) - np.abs(second[f"{name}.reaction"])
        assert np.max(np.abs(change)) < STOP
    assert np.all(stopped.quality.iterations["dyad"] <= 3)
    assert stopped.quality.status == ("ok",) * len(ROWS)


def test_successive_approximations_tend_to_newtons_answer():
    newton = run()
    loose, tight = (run(friction=bm.friction.Successive(tolerance=x)) for x in (STOP, 0.0))
    for name in JOINTS.values():
        exact = newton[f"{name}.reaction"]
        assert np.max(np.abs(loose[f"{name}.reaction"] - exact)) < STOP
        assert own_error(tight[f"{name}.reaction"], exact) <= FORCES


def test_contraction_of_the_paper_s_linkage_is_small_and_reported():
    # numerics: P = 0.0026 to 0.0050 over the turn; rho of the iteration is below P
    newton = run().quality.contraction["dyad"]
    observed = run(friction=bm.friction.Successive(iterations=3)).quality.contraction["dyad"]
    assert np.all((newton > 0.002) & (newton < 0.006))
    assert np.all(observed <= newton)


# ---- zero relative speed -----------------------------------------------------------------


@EACH_ENGINE
def test_joint_C_is_at_rest_at_crank_zero_and_flagged_with_its_interval(engine):
    (flag,) = run(engine).quality.flags
    assert (flag.sample, flag.code, flag.where) == (0, "zero-relative-speed", "dyad.C")
    reach = FACTOR * abs(vectors("reactions", "C")[0])  # reactions of row 0 are those at t_C = 0
    assert np.allclose(flag.interval, (-reach, reach), rtol=FORCES, atol=0)
    assert [row["zero_relative_speed_joints"] for row in ROWS] == [["C"]] + [[]] * 6


@pytest.mark.parametrize("side", [-1, 1])
def test_one_sided_values_are_reached_from_either_side(side):
    step = 1e-7  # [rad] enough for a sense of slip at C; the motion changes by 2e-6 of itself
    r = ruiz().run(at=side * step)
    sense = int(np.sign(r["dyad.C.slip"][0]))
    expected = ROWS[0]["one_sided"][f"C:{sense:+d}"]
    assert r.quality.flags == ()
    assert abs(r["crank.drive"][0] - expected["driving_moment"]) < 1e-5 * abs(
        expected["driving_moment"]
    )
    for joint, name in JOINTS.items():
        force = complex(*expected["reactions"][joint])
        assert abs(r[f"{name}.reaction"][0] - force) < 1e-5 * abs(force)


# ---- self-locking ------------------------------------------------------------------------

LOCKED = ruiz(radius=1.5 / COEFFICIENT)  # f' r = 1.5 m


@EACH_ENGINE
def test_self_locking_is_reported_and_no_number_is_handed_out(engine):
    r = LOCKED.run(at=[2.0], engine=engine, on_gap="mark")
    assert r.quality.status == ("self-locked",)
    (flag,) = r.quality.flags
    assert flag.where == "dyad"
    assert flag.code in ("fold", "asymptote")
    assert 0 < flag.value < 1
    assert np.isnan(r["crank.drive"][0])
    result = r.to_dict()
    assert result["outputs"]["crank.drive"]["values"] == [None]
    assert result["outputs"]["dyad.C.reaction"]["values"] == [None]
    assert result["quality"]["status"] == ["self-locked"]


def test_self_locking_spoils_forces_only():
    r = LOCKED.run(at=[2.0], on_gap="mark")
    free = ruiz().run(at=[2.0])
    for name in ("dyad.C.p", "dyad.j.omega", "dyad.i.alpha", "dyad.margin"):
        assert r[name][0] == free[name][0]


@EACH_ENGINE
def test_self_locking_raises_a_friction_error_with_the_numbers(engine):
    with pytest.raises(bm.FrictionError) as caught:
        LOCKED.run(at=[1.0, 2.0, 2.5], engine=engine)
    failure = caught.value.failure
    assert failure.block == "dyad"
    assert 1 in failure.samples
    assert failure.drivers["crank.q"] == [1.0, 2.0, 2.5][failure.samples[0]]
    (problem,) = caught.value.problems
    assert problem.code == "self-locked"
    assert "dyad at crank.q = " in problem.where
    assert "times the friction" in problem.found
