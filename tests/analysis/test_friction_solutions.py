"""All Coulomb solutions of a mechanism, and what is said of them."""

import csv
import io
import os

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis import friction_solutions as module
from blockmech.friction import enumeration
from tests.gallery import GRAPHS
from tests.independent import dyads
from tests.machines import COEFFICIENT, ruiz, watt, wire

TREES = int(os.environ.get("BLOCKMECH_EXAMPLES", "10"))  # 100 is the full run, in 220 s
POSES = 0.05 + 0.1 * np.arange(63)
REFERENCE = {  # f' r [m] -> poses with 0, 1, 2 solutions, with c < 1: an independent search's
    0.3: ([0, 63, 0], 63),
    0.6: ([0, 63, 0], 63),
    0.8: ([0, 58, 5], 58),
    1.1: ([5, 54, 4], 54),
}


def rough(factor):
    """The Ruiz four-bar with f' r [m] at every pin."""
    return ruiz(radius=factor / COEFFICIENT).compile()


# ---- the paper's linkage -----------------------------------------------------------------


@pytest.mark.parametrize("factor", REFERENCE)
def test_counts_of_the_papers_linkage(factor):
    mech = rough(factor)
    solutions, (counts, below) = mech.friction_solutions(POSES), REFERENCE[factor]
    assert list(np.bincount(solutions.counts, minlength=3)) == counts
    assert solutions.complete.all()
    c = solutions.existence["dyad"]
    assert (c < 1).sum() == below
    total = np.zeros(63)
    np.add.at(total, solutions.pose, solutions.index["dyad"])
    assert np.array_equal(total == 1, c < 1)


@pytest.mark.parametrize("factor", [0.003, 0.6, 0.8, 1.1])
def test_the_connected_solution_is_the_answer_of_a_run(factor):
    mech = rough(factor)
    solutions = mech.friction_solutions(POSES, want=["crank.drive", "*.friction"])
    run = mech.run(at=POSES, want=["crank.drive", "*.friction"], on_gap="mark")
    ok = np.array(run.quality.status) == "ok"
    mine = np.flatnonzero(solutions.connected)
    assert np.array_equal(solutions.pose[mine], np.flatnonzero(ok))
    for name in run:
        size = np.abs(run[name][ok]).max()
        assert np.abs(solutions[name][mine] - run[name][ok]).max() <= 1e-10 * size


def test_a_scale_of_friction_is_that_of_its_coefficients():
    once, scaled = rough(1.1).friction_solutions(POSES), rough(0.55).friction_solutions(
        POSES, scale=[0.5, 2.0]
    )  # fmt: skip
    assert scaled.n == 2 * once.n
    twice = scaled.scale[scaled.pose] == 2.0
    assert np.array_equal(scaled.counts[63:], once.counts)
    assert np.allclose(scaled["crank.drive"][twice], once["crank.drive"], rtol=1e-9)
    assert np.allclose(scaled.existence["dyad"][63:], once.existence["dyad"], rtol=1e-12)


def test_of_another_law_the_connected_solution_is_the_answer_of_a_run_too():
    data = ruiz().to_data()
    law = {"law": "stribeck", "static": 0.5, "kinetic": 0.3, "stribeck_speed": 2.0, "radius": 2.0}
    for block, pins in (("crank", "A"), ("dyad", "BCD")):
        data["blocks"][block]["friction"] = {pin: law | {"viscous": 0.01} for pin in pins}
    mech = bm.Graph.from_data(data).compile()
    solutions = mech.friction_solutions(POSES, want=["crank.drive", "*.friction"])
    run = mech.run(at=POSES, want=["crank.drive", "*.friction"], on_gap="mark")
    ok = np.array(run.quality.status) == "ok"
    mine = np.flatnonzero(solutions.connected)
    assert np.array_equal(solutions.pose[mine], np.flatnonzero(ok))
    assert (solutions.counts > 1).any()
    for name in run:
        size = np.abs(run[name][ok]).max()
        assert np.abs(solutions[name][mine] - run[name][ok]).max() <= 1e-10 * size


# ---- trees of groups ---------------------------------------------------------------------


def whole(mech, q):
    """The equations of all pairs of a mechanism at one pose, as one system."""
    equations = module.Equations(mech, static=False)
    samples = equations.poses(mech.samples(q))
    m = len(equations.joints)
    t = np.vstack([np.zeros(m), np.eye(m)])
    values = equations.at(samples, np.zeros(m + 1, int), t)
    steps = equations.steps
    at = {j: i for s in steps for j, i in _loads(s)}
    k = {j: i for s in steps for j, i in _factors(s)}
    F = np.array([module._vector(values[at[j]], m + 1) for j in range(m)])
    factors = np.array([np.broadcast_to(values[k[j]], m + 1)[0] for j in range(m)])
    contacts = tuple(c for _, c in sorted(x for s in steps for x in _contacts(s)))
    return dyads.Groups(factors[None], contacts, F[None, :, 0], (F[:, 1:] - F[:, :1])[None])


def _loads(step):
    group = isinstance(step, module.Group)
    return zip(step.inputs, step.loads, strict=True) if group else [(step.input, step.load)]


def _factors(step):
    group = isinstance(step, module.Group)
    return zip(step.inputs, step.k, strict=True) if group else [(step.input, step.k)]


def _contacts(step):
    group = isinstance(step, module.Group)
    return zip(step.inputs, step.contacts, strict=True) if group else [(step.input, 0)]


@pytest.mark.parametrize("seed", range(TREES))
def test_trees_of_two_groups_are_the_solutions_of_all_pairs_at_once(seed):
    """Two dyads and a crank: seven pins in one system, searched by brute force."""
    chance = np.random.default_rng(seed)
    data = watt(friction=True, force=True).to_data()
    for block in data["blocks"].values():
        for pin in block.get("friction", {}).values():
            pin["radius"] = float(chance.uniform(0.3, 4.0))
    mech, q = bm.Graph.from_data(data).compile(), float(chance.uniform(-3.0, 3.0))
    solutions = mech.friction_solutions(q, want=["*.friction"])
    assert solutions.complete.all()
    groups = whole(mech, q)
    (judged,) = dyads.brute_force(groups, 4000, chance)
    joints = module.Equations(mech, static=False).joints
    mine = np.stack([solutions[f"{ref}.friction"] for ref in joints], axis=1)
    assert len(mine) == len(judged)
    for t in judged:
        off = np.abs(mine - t) / np.abs(groups.k[0])
        assert off.max(axis=1).min() <= 1e-6 * np.abs(t / groups.k[0]).max()


def test_six_pins_of_a_triad_are_followed_on_64_paths():
    data = bm.Graph.load(GRAPHS / "stephenson_3_triad.json").to_data()
    group = next(n for n, b in data["blocks"].items() if b["type"] == "group.general")
    joints = bm.Graph.from_data(data).structure().blocks[group].joints
    law = {"coefficient": 0.3, "radius": 0.3}
    data["blocks"][group]["friction"] = {n: law for n, j in joints.items() if j.kind == "R"}
    mech = bm.Graph.from_data(data).compile()
    driver = mech.drivers[0]
    q = float(mech.samples(None, 5).coordinate(0)[2])
    rates = None if driver in mech.scene.drive else 1.0
    solutions = mech.friction_solutions(q, rates=rates, want=["*.friction"])
    assert solutions.complete.all()
    (step,) = (s for s in module.Equations(mech, False).steps if isinstance(s, module.Group))
    assert enumeration.paths(step.contacts) == 2 ** len(step.contacts) >= 32
    groups = whole(mech, q)
    (judged,) = dyads.brute_force(groups, 4000, np.random.default_rng(1))
    assert len(solutions) == len(judged)


# ---- what is said ------------------------------------------------------------------------


def test_text_table_and_data_say_the_same():
    solutions = rough(0.8).friction_solutions([1.0, 6.0], want=["crank.drive"])
    assert solutions.number.tolist() == [1, 1, 2]
    assert solutions.connected.tolist() == [True, True, False]
    assert solutions.index["dyad"].tolist() == [1, 1, -1]
    text = str(solutions)
    assert "2 poses, 3 solutions" in text
    assert "2 of 2" in text
    assert "1 pose by contraction, 1 pose by count" in text
    rows = list(csv.DictReader(io.StringIO(solutions.to_csv())))
    assert [float(r["crank.drive [N m]"]) for r in rows] == list(solutions["crank.drive"])
    assert [r["connected"] for r in rows] == ["yes", "yes", "no"]
    poses = solutions.to_dict()["poses"]
    assert [len(p["solutions"]) for p in poses] == [1, 2]
    assert poses[1]["solutions"][1]["outputs"]["crank.drive"] == solutions["crank.drive"][2]
    assert "114.591559 deg" not in text
    assert "57.29578" in solutions.to("deg").text()


def test_a_pose_that_jams_has_none_and_that_is_proved():
    solutions = rough(1.1).friction_solutions(5.8)
    assert (solutions.counts.tolist(), solutions.complete.tolist()) == ([0], [True])
    assert "1 pose with no solution" in str(solutions)


def test_a_pose_that_does_not_close_is_no_pose():
    g = bm.Graph("short")
    law = bm.friction.Coulomb(coefficient=0.2, radius=0.05)
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (3.0, 0.0)}))
    g.add("crank", bm.Crank(length=1.0))
    g.add("dyad", bm.RRR(l_i=1.5, l_j=1.5, friction=dict.fromkeys("BCD", law)))
    g.add("push", bm.Force(force=(-100.0, 5.0)))
    wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D", "dyad.C push.at")
    solutions = g.compile().friction_solutions([0.3, 3.0], rates=1.0)
    assert solutions.proof == ("contraction", "no-assembly")
    assert solutions.counts.tolist() == [1, 0]
    assert not solutions.complete[1]
    assert "no-assembly: 1 pose, first crank.q = 3 rad" in str(solutions)


def test_without_friction_there_is_one_solution():
    mech = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    solutions = mech.friction_solutions([0.5, 1.0])
    run = mech.run(at=[0.5, 1.0], friction="none")
    assert solutions.counts.tolist() == [1, 1]
    assert np.allclose(solutions["crank.drive"], run["crank.drive"], rtol=1e-13)


def test_pairs_at_rest_are_told():
    solutions = ruiz().compile().friction_solutions(0.0)
    assert solutions.at_rest["dyad.C"].all()
    assert "at zero relative speed, friction there taken as 0: dyad.C" in str(solutions)


def test_a_document_of_links_and_joints_has_its_own_names():
    linkage = bm.Linkage.load(GRAPHS / "joints" / "ruiz_fourbar.json")
    mine = linkage.compile().friction_solutions(1.0)
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile().friction_solutions(1.0)
    (driver,) = (n for n in mine.answers if n.endswith(".drive"))
    assert driver.startswith("driver.")
    assert mine[driver] == pytest.approx(graph["crank.drive"], rel=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"want": ["crank.torque"]}, "no output has that name"),
        ({"scale": -1.0}, "not a row of numbers that are 0 or above"),
        ({"at": "up"}, "is not a number with a unit"),
    ],
)
def test_mistakes_are_one_message(options, message):
    with pytest.raises(bm.RequestError, match=message):
        ruiz().compile().friction_solutions(**{"at": 1.0, **options})


def test_a_tree_that_grows_out_of_hand_is_refused(monkeypatch):
    monkeypatch.setattr(module, "MOST", 5)
    with pytest.raises(bm.RequestError, match="multiply from group to group: 63 branches"):
        rough(0.3).friction_solutions(POSES)


# ---- pictures and the command ------------------------------------------------------------


def test_pictures_over_the_coordinate_and_over_friction(tmp_path):
    mech = rough(1.0)
    curves = mech.friction_solutions(np.linspace(5.5, 6.2, 12), scale=0.8)
    curves.plot(tmp_path / "curves.png")
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    (axes,) = curves.figure().axes
    ordinates = np.concatenate([line.get_ydata() for line in axes.lines])
    assert len(ordinates) == len(curves)
    grid = mech.friction_solutions(np.linspace(5.5, 6.2, 8), scale=[0.6, 0.8, 1.0])
    (axes,) = grid.figure().axes
    (mesh,) = axes.collections[:1]
    assert mesh.get_array().ravel().tolist() == grid.counts.tolist()
    with pytest.raises(bm.RequestError, match="give several poses of one driver"):
        mech.friction_solutions(1.0).figure()


def test_the_command_lists_them(call, tmp_path):
    file = tmp_path / "rough.json"
    ruiz(radius=2.0).save(file)
    text = call("solutions", file, "--at", "1,6", "--want", "crank.drive")
    assert text.code == 0
    assert "2 of 2" in text.out
    data = call("solutions", file, "--at", "6", "--json")
    assert data.code == 0
    assert '"connected": false' in data.out
    written = call("solutions", file, "--at", "5.5:6:4", "--csv", tmp_path / "all.csv")
    assert written.code == 0
    assert (tmp_path / "all.csv").read_text("utf-8").startswith("pose,crank.q [rad],solution,")
    outcome = call("solutions", file, "--at", "5.5:6:4", "--plot", tmp_path / "all.png")
    assert outcome.code == 0
    assert call("solutions", file, "--at", "1", "--scale", "two").code == 2


def test_a_pose_whose_loads_are_undefined_has_no_solution():
    """Its drive was nan, and the pose one with one solution, proved."""
    mech = bm.Graph.load(GRAPHS / "motions/gas_crank.json").replace({"piston.l": 2.0}).compile()
    answer = mech.friction_solutions({"crank": [0.0, 0.1]})
    assert len(answer) == 0
    assert answer.proof == ("no-assembly",) * 2
    assert "nan" not in str(answer)
