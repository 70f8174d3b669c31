"""A result says what it holds, in which unit, how good it is, and what it does not hold."""

import json
import math
import pickle

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.extremes import extremes
from blockmech.analysis.reference_errors import WIDER
from blockmech.ground.errors import NotComputedError
from blockmech.ground.values import Vector
from tests import machines
from tests.gallery import GRAPHS
from tests.machines import arms, crank, load, ruiz, toggle, watt
from tests.wiring import EPS, off

EACH_ENGINE = pytest.mark.parametrize("engine", ["scalar", "numpy"])


# ---- labels, units, kinds ----------------------------------------------------------------

UNITS = {
    "": "dyad.margin mechanism.friction_efficiency",
    "rad": "crank.q crank.crank.angle dyad.transmission_angle",
    "rad/s": "crank.rate dyad.i.omega dyad.C.slip",
    "rad/s2": "crank.acceleration dyad.j.alpha",
    "m": "dyad.C.p",
    "m/s": "dyad.C.v",
    "m/s2": "dyad.C.a",
    "N": "dyad.C.reaction dyad.B.wrench_F weightlike.at.force mechanism.shaking_force",
    "N m": "crank.drive crank.drive_by_reduction crank.tau_red dyad.C.friction dyad.B.wrench_M"
    " couple.on.couple mechanism.shaking_moment",
    "W": "crank.power dyad.C.friction_power couple.power",
    "J": "mechanism.kinetic_energy",
    "kg m2": "crank.J_red dyad.J_red",
    "kg m2/rad": "crank.dJ_red",
}


@EACH_ENGINE
def test_every_output_has_its_unit_and_shape(engine):
    r = ruiz().run(at=[1.0, 2.0, 3.0], engine=engine)
    for unit, names in UNITS.items():
        assert {r.unit(name) for name in names.split()} == {unit}
    for name, values in r.items():
        kind = r._output(name).kind
        if kind == "number":
            assert isinstance(values, float)
            continue
        assert values.shape == (3,)
        assert np.iscomplexobj(values) == (kind == "vector"), name


def test_slide_drive_is_in_metres_and_newtons():
    r = toggle().run(at=0.3)
    drive = [r.unit(f"ram.{n}") for n in ("q", "rate", "drive", "J_red", "tau_red", "dJ_red")]
    assert drive == ["m", "m/s", "N", "kg", "N", "kg/m"]
    joint = [r.unit(f"ram.S.{n}") for n in ("reaction", "N", "C", "friction", "slip")]
    assert joint == ["N", "N", "N m", "N", "m/s"]
    n = 1j * np.exp(1j * r["ram.slider.angle"][0])
    assert r["ram.S.reaction"][0] == pytest.approx(r["ram.S.N"][0] * n, rel=1e-14)


ON_WHOM = [
    ("crank.A.reaction", "frame.frame", "crank.crank"),
    ("dyad.B.reaction", "crank.crank", "dyad.i"),
    ("dyad.C.reaction", "dyad.i", "dyad.j"),
    ("dyad.D.reaction", "frame.frame", "dyad.j"),
    ("dyad.B.wrench_F", "dyad.i", "crank.crank"),
    ("crank.drive", "frame.frame", "crank.crank"),
    ("weightlike.at.force", "weightlike", "dyad.i"),
]


def test_forces_say_who_acts_on_whom():
    outputs = ruiz().compile().outputs
    assert [(name, outputs[name].by, outputs[name].on) for name, *_ in ON_WHOM] == ON_WHOM


def test_several_drivers_have_a_mass_matrix():
    g = arms({"upper": 1.0, "lower": 1.0}, [bm.Link(mass=2.0, cm=(1.0, 0.0))] * 2)
    r = g.run(at={"upper": [0.2, 0.5], "lower": [0.3, -1.0]})
    # the double pendulum of textbooks: equal masses at the ends of equal rods
    M = r["mechanism.M"]
    assert M.shape == (2, 2, 2)
    for k, bend in enumerate((0.3, -1.0)):
        c = math.cos(bend)
        assert off(M[k], [[6 + 4 * c, 2 + 2 * c], [2 + 2 * c, 2]]) <= 4 * EPS
    q1 = np.array([0.2, 0.5])
    q12 = q1 + np.array([0.3, -1.0])
    g = 2.0 * 9.81
    expected = np.stack([-g * (2 * np.cos(q1) + np.cos(q12)), -g * np.cos(q12)], axis=-1)
    assert off(r["mechanism.Q"], expected) <= 4 * EPS
    assert "upper.dJ_red" not in r


# ---- reading what is there, and what is not ----------------------------------------------


def test_result_is_a_mapping_of_what_was_wanted():
    r = ruiz().run(at=1.0, want=["dyad.C.*", "crank.drive"])
    of_pin = ("p", "v", "a", "reaction", "friction", "coordinate", "slip", "friction_power")
    assert list(r) == [*(f"dyad.C.{quantity}" for quantity in of_pin), "crank.drive"]
    assert len(r) == 9
    assert "dyad.B.reaction" not in r
    assert r.get("dyad.B.reaction") is None
    assert dict(r)["crank.drive"] is r["crank.drive"]


def test_missing_output_is_a_key_error_that_helps():
    r = ruiz().run(at=1.0, want="crank.drive")
    with pytest.raises(KeyError):
        r["dyad.B.reaction"]
    with pytest.raises(NotComputedError) as caught:
        r["dyad.B.reaction"]
    assert str(caught.value) == (
        "[not-wanted] dyad.B.reaction: the run did not compute it. "
        "computed: crank.drive. name it in want=."
    )
    with pytest.raises(bm.RequestError, match=r'did you mean "crank\.drive"'):
        r["crank.drve"]


def test_parts_of_a_vector_are_read_by_their_names():
    run = ruiz().compile().run(at=[0.5, 1.0], want=["dyad.C.p", "crank.drive"])
    np.testing.assert_array_equal(run["dyad.C.p.x"], run["dyad.C.p"].real)
    np.testing.assert_array_equal(run["dyad.C.p.y"], run["dyad.C.p"].imag)
    assert list(run) == ["dyad.C.p", "crank.drive"]
    for name in ("crank.drive.x", "dyad.B.p.x", "dyad.C.p.z"):
        with pytest.raises(NotComputedError, match="the run did not compute it"):
            run[name]


def test_one_sample_and_many_read_alike():
    mech = ruiz().compile()
    single, many = mech.run(at=1.0), mech.run(at=[1.0, 2.0])
    for name in single:
        if np.ndim(many[name]):
            assert single[name].shape == (1,)
            assert single[name][0] == many[name][0]


def test_what_a_result_is_is_one_line():
    assert repr(ruiz().run(at=[1.0, 2.0], want="crank.drive", engine="scalar")) == (
        "<Result of ruiz_fourbar: 2 samples, 1 outputs, 8 kernel calls a sample, scalar engine>"
    )


# ---- comparing and running again ---------------------------------------------------------


def test_comparison_is_the_largest_difference_of_the_largest_size():
    mech = ruiz().compile()
    rough = mech.run(at=[1.0, 2.0], want=["crank.drive", "dyad.C.p"])
    smooth = mech.run(at=[1.0, 2.0], want=["crank.drive", "dyad.margin"], friction="none")
    difference = np.abs(rough["crank.drive"] - smooth["crank.drive"])
    expected = difference.max() / np.abs(rough["crank.drive"]).max()
    assert rough.compare(smooth) == {"crank.drive": expected}
    assert rough.compare(rough) == {"crank.drive": 0.0, "dyad.C.p": 0.0}
    assert rough.compare({}) == {}


def test_comparison_does_not_overlook_a_missing_answer():
    run = ruiz().run(at=[1.0, 2.0], want="crank.drive")
    half = {"crank.drive": np.array([run["crank.drive"][0], math.nan])}
    assert run.compare(half) == {"crank.drive": math.inf}
    gap = ruiz(radius=3.75).run(at=[1.0, 2.0], want="crank.drive", on_gap="mark")
    assert gap.compare(gap) == {"crank.drive": 0.0}


def test_comparison_of_different_samples_is_refused():
    run = ruiz().run(at=[1.0, 2.0])
    with pytest.raises(bm.RequestError, match=r"has shape \(2,\) here and \(3,\) there"):
        run.compare(ruiz().run(at=[1.0, 2.0, 3.0]))


@EACH_ENGINE
def test_rerun_gives_other_outputs_of_the_same_run(engine):
    settings = {"friction": bm.friction.Successive(iterations=2)}
    run = ruiz().run(at=[1.0, 2.0], want="crank.drive", engine=engine, **settings)
    again = run.rerun("dyad.C.reaction", "crank.drive")
    assert again.settings == run.settings
    assert again._engine == engine
    assert np.array_equal(again["crank.drive"], run["crank.drive"])
    direct = ruiz().run(at=[1.0, 2.0], engine=engine, **settings)
    assert np.array_equal(again["dyad.C.reaction"], direct["dyad.C.reaction"])


def test_rerun_marks_gaps_and_does_not_raise():
    run = ruiz(radius=3.75).run(at=[1.0, 2.0], want="dyad.C.p")
    assert run.quality.status == ("ok", "ok")
    again = run.rerun("crank.drive")
    assert again.quality.status[1] == "self-locked"
    assert np.isnan(again["crank.drive"][1])


# ---- wires -------------------------------------------------------------------------------


def test_wire_shows_motion_forward_and_force_back():
    r = ruiz().run(at=[1.0, 2.0])
    result = r.wire("crank.B", "dyad.B")
    forward = {"p": "B.p", "v": "B.v", "a": "B.a", "om": "crank.omega", "al": "crank.alpha"}
    for name, output in forward.items():
        assert np.array_equal(result[name], r[f"crank.{output}"])
    assert np.array_equal(result["F"], -r["dyad.B.reaction"])
    assert np.array_equal(result["M"], -r["dyad.B.friction"])


def test_wire_to_a_prismatic_pair_carries_its_couple():
    r = toggle().run(at=0.3)
    result = r.wire("frame.G", "ram.S")
    assert result["power"][0] == 0.0  # the frame does not move
    assert result["om"][0] == result["al"][0] == 0.0
    n = 1j * np.exp(0.2j)
    assert (result["F"] * np.conj(n)).real[0] == pytest.approx(-r["ram.S.N"][0], rel=1e-14)


def test_shares_of_blocks_add_up_to_what_is_reduced_to_the_driver():
    g = ruiz()
    r = g.run(at=[0.4, 2.0, 5.0])
    crank, dyad = r.wire("frame.A -> crank.A"), r.wire("crank.B -> dyad.B")
    for quantity in ("J_red", "tau_red"):
        assert np.array_equal(dyad[quantity], r[f"dyad.{quantity}"])
        total = r[f"crank.{quantity}"]
        assert crank[quantity] + dyad[quantity] == pytest.approx(total, rel=1e-14)
    link = g.blocks["crank"].links["crank"]  # turns about A: its share is J + m cm^2
    about_A = link.inertia + link.mass * abs(link.cm.z) ** 2
    assert crank["J_red"] == pytest.approx(np.full(3, about_A), rel=1e-12)


def test_unknown_wire_names_the_wires_there_are():
    r = ruiz().run(at=1.0)
    with pytest.raises(bm.RequestError) as caught:
        r.wire("crank.A", "dyad.B")
    assert caught.value.problems[0].code == "no-such-wire"
    assert "crank.B -> dyad.B" in str(caught.value)


# ---- gaps --------------------------------------------------------------------------------


def reaching():
    """A four-bar that closes only from -1.37 to 1.37 rad, as cos q > 0.2."""
    return machines.fourbar(1.0, 1.5, math.sqrt(4.2) - 1.5, 2.0, [None, bm.Link(mass=1.0)])


GAPPY = [0.5, 1.0, 1.5, 1.2, 3.0]


@EACH_ENGINE
def test_gap_raises_with_block_samples_drivers_and_margin(engine):
    with pytest.raises(bm.AssemblyError) as caught:
        reaching().run(at=GAPPY, rates=2.0, engine=engine)
    failure = caught.value.failure
    assert failure.block == "dyad"
    assert list(failure.samples) == [2, 4]
    assert failure.drivers == {"crank.q": 1.5}
    marked = reaching().run(at=GAPPY, rates=2.0, engine=engine, on_gap="mark")
    assert failure.margin == marked["dyad.margin"][2] < 0
    (problem,) = caught.value.problems
    assert problem.code == "no-assembly"
    assert problem.where == "dyad at crank.q = 1.5 rad (sample 2 of 5)"
    assert "2 of 5 samples affected" in problem.found
    assert 'on_gap="mark"' in problem.remedy


@EACH_ENGINE
def test_gap_is_marked_and_the_rest_is_kept(engine):
    r = reaching().run(at=GAPPY, rates=2.0, engine=engine, on_gap="mark")
    assert r.quality.status == ("ok", "ok", "no-assembly", "ok", "no-assembly")
    assert r.quality.gaps == (2, 4)
    assert np.isnan(r["dyad.C.p"]).tolist() == [False, False, True, False, True]
    assert np.isfinite(r["crank.B.p"]).all()
    assert "2 without an answer" in repr(r)


@EACH_ENGINE
@pytest.mark.parametrize(("at", "n"), [(GAPPY, 2), (GAPPY[2:], 0), (GAPPY[:2], 2)])
def test_run_stops_before_the_first_gap(at, n, engine):
    r = reaching().run(at=at, rates=2.0, engine=engine, on_gap="stop")
    assert r.n == n
    assert r["dyad.C.p"].shape == (n,)
    assert r.quality.status == ("ok",) * n
    assert r.drivers["crank.q"].tolist() == at[:n]
    assert str(r)
    assert r.to_dict()["samples"] == n


def test_errors_of_samples_can_be_sent_between_processes():
    with pytest.raises(bm.AssemblyError) as caught:
        reaching().run(at=GAPPY)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert copy.failure == caught.value.failure


def test_kinds_of_gaps_have_their_own_errors():
    assert issubclass(bm.AssemblyError, bm.BlockmechError)
    with pytest.raises(bm.FrictionError):
        ruiz(radius=3.75).run(at=2.0)
    g = reaching()
    g.blocks["crank"] = bm.Crank(length=0.5)
    g.blocks["dyad"] = bm.RRR(l_i=1.0, l_j=0.5, links={"i": bm.Link(mass=1.0)})
    with pytest.raises(bm.SingularError):  # stretched at crank 0: 0.5 + 1.0 + 0.5 = 2
        g.run(at=0.0, rates=1.0)


# ---- quality -----------------------------------------------------------------------------


@EACH_ENGINE
def test_quality_has_a_column_for_every_group_and_every_solved_friction(engine):
    q = watt(friction=True).run(at=[1.0, 2.0, 4.0], engine=engine).quality
    assert set(q.margin) == {"first", "last"}
    assert set(q.iterations) == set(q.residual) == set(q.contraction) == {"crank", "first", "last"}
    for columns in (q.margin, q.iterations, q.residual, q.contraction):
        assert all(np.shape(x) == (3,) for x in columns.values())
    assert np.all(q.residual["last"] < 1e-14)
    assert np.all(q.contraction["first"] < 1)


def test_quality_reports_only_what_was_computed():
    q = watt(friction=True).run(at=[1.0, 2.0], want="first.C.p").quality
    assert set(q.margin) == {"first"}
    assert not q.iterations


# ---- efficiency --------------------------------------------------------------------------

RADIUS, COEFFICIENT, FORCE = 0.05, 0.2, 100.0


def winch(rate=3.0, useful=True, start=0.0, end=6.0):
    """A rough crank of 1 m that works against a force turning with it."""
    graph = machines.crank(friction=bm.friction.Coulomb(coefficient=COEFFICIENT, radius=RADIUS))
    work = bm.Force(force=(0.0, -math.copysign(FORCE, rate)), axes="link", useful=useful)
    machines.load(graph, "work", work, at="crank.B")
    graph.drive("crank", bm.motion.ConstantRate(rate=rate, start=start, end=end))
    return graph


# drive = 100 N 1 m + f r |R| = 100 + 0.2 0.05 100 = 101 N m
EFFICIENCY = 100.0 / 101.0


@EACH_ENGINE
@pytest.mark.parametrize("rate", [3.0, -3.0])
@pytest.mark.parametrize(
    "samples", [{"samples": 7}, {"times": [0.0, 0.5, 1.5]}, {"at": [0.0, 1.0, 4.0]}]
)
def test_efficiency_is_useful_work_over_drive_work(samples, rate, engine):
    r = winch(rate).run(**samples, engine=engine)
    assert r["mechanism.efficiency"] == pytest.approx(EFFICIENCY, rel=10 * EPS)
    assert r["mechanism.friction_efficiency"] == pytest.approx(EFFICIENCY, rel=10 * EPS)
    assert np.allclose(np.abs(r["crank.drive"]), 101.0, rtol=10 * EPS, atol=0)
    assert np.allclose(r["mechanism.useful_power"], 300.0, rtol=10 * EPS, atol=0)


def test_efficiency_weighs_samples_by_their_time():
    # a rod against gravity: work of its weight between two angles, unevenly sampled
    g = winch(useful=False)
    g.blocks["crank"] = bm.Crank(length=1.0, links={"crank": bm.Link(mass=2.0, cm=(0.5, 0.0))})
    g.scene = g.scene.model_copy(update={"gravity": Vector(-9.81j)})
    g.blocks["work"] = g.blocks["work"].model_copy(update={"useful": True})
    q = np.sort(np.random.default_rng(1).uniform(0.0, 1.5, 4001))
    r = g.run(at=q)
    useful = FORCE * (q[-1] - q[0])
    drive = useful + 2.0 * 9.81 * 0.5 * (math.sin(q[-1]) - math.sin(q[0]))
    # trapezoids: (1.5 / 4000 * some)^2 / 12 of the second derivative
    assert r["mechanism.efficiency"] == pytest.approx(useful / drive, rel=1e-6)


def test_without_useful_load_there_is_only_the_friction_efficiency():
    r = winch(useful=False).run(samples=5)
    assert "mechanism.efficiency" not in r.mechanism.outputs
    assert r["mechanism.friction_efficiency"] == pytest.approx(EFFICIENCY, rel=10 * EPS)


@EACH_ENGINE
def test_friction_that_takes_all_the_work_of_a_turn_leaves_exactly_nothing(engine):
    # the powers of the turn are a hundred times larger than what is lost in it
    result = ruiz().run(samples=361, engine=engine)
    assert result["mechanism.friction_efficiency"] == 0.0
    # too few samples leave an error of the sum, and that is shown
    coarse = ruiz().run(samples=37, engine=engine)
    assert 1e-9 < abs(coarse["mechanism.friction_efficiency"]) < 1e-5


def test_where_the_drive_gives_rounding_alone_there_is_no_efficiency():
    g = bm.Graph.load(GRAPHS / "watt_sixbar.json")  # nothing rubs, and a turn ends as it began
    turn = g.run(at=np.linspace(0.0, math.tau, 720), rates=5.0)
    assert turn["mechanism.friction_efficiency"].why == "the drive does no work"


def test_no_efficiency_where_the_drive_does_no_positive_work():
    r = winch(3.0).run(at=[0.0, 1.0], rates=-3.0)  # the load now drives the crank
    assert math.isnan(r["mechanism.efficiency"])
    assert math.isnan(r["mechanism.friction_efficiency"])
    assert "mechanism.efficiency: not defined for this run: the drive takes" in str(r)
    assert r.to_dict()["outputs"]["mechanism.efficiency"]["values"] in (None, [None])


def test_no_efficiency_of_a_free_motion_whose_drive_is_idle():
    engine = bm.Graph.load(GRAPHS / "engine.json").compile().simulate("turns=2", want="mechanism.*")
    assert np.abs(engine["mechanism.drive_power"]).max() > 0  # rounding of large torques
    for name in ("efficiency", "friction_efficiency"):
        assert engine[f"mechanism.{name}"].why == "in a free motion the drives give nothing"
    assert np.isnan(engine["mechanism.mechanical_advantage"]).all()


def test_no_efficiency_where_other_loads_drive_as_well():
    """The gas gives work beside the drive, so their shares of the useful work are not known."""
    engine = bm.Graph.load(GRAPHS / "engine.json").compile().run(samples=73, want="mechanism.*")
    assert engine["mechanism.useful_power"].sum() > engine["mechanism.drive_power"].sum() > 0
    assert "other loads do work too" in engine["mechanism.efficiency"].why


def test_no_efficiency_of_a_single_sample():
    r = winch().run(at=1.0)
    assert math.isnan(r["mechanism.efficiency"])
    assert r.quality.status == ("ok",)


def test_mechanical_advantage_of_a_resting_drive_is_no_number_and_no_gap():
    pull = bm.Force(force=(5.0, 0.0), axes="link", useful=True)
    g = load(crank(), "pull", pull, at="crank.B")
    r = g.run(at=[0.0, 1.0], rates=1.0)
    assert r.quality.status == ("ok", "ok")
    assert np.isnan(r["mechanism.mechanical_advantage"]).all()


# ---- shaking force, energies -------------------------------------------------------------


def test_shaking_force_is_all_that_the_mechanism_does_to_the_frame():
    r = ruiz().run(at=[1.0, 2.5])
    expected = -(r["crank.A.reaction"] + r["dyad.D.reaction"])
    assert np.array_equal(r["mechanism.shaking_force"], expected)
    about = -(np.conj(5.5) * r["dyad.D.reaction"]).imag
    about = about - (r["crank.drive"] + r["crank.A.friction"] + r["dyad.D.friction"])
    assert off(r["mechanism.shaking_moment"], about) <= 10 * EPS


# ---- digits lost --------------------------------------------------------------------------


def origin_moved(x):
    """The tangent generator, its lever measured from another point of the lever's own line."""
    data = json.loads((GRAPHS / "joints" / "tangent_generator.json").read_text("utf-8"))
    data["joints"]["O"]["at"][1][0] = x
    return bm.Linkage.from_data(data).compile().run(samples=5)


def test_what_is_said_of_ordinary_sizes_is_nothing():
    result = origin_moved(0.0)
    assert result._lost_digits == ()
    assert "digits-lost" not in {flag["code"] for flag in result.to_dict()["quality"]["flags"]}


@pytest.mark.skipif(not WIDER, reason="this machine has no numbers longer than double")
def test_digits_that_coordinates_swallow_are_told_with_their_error():
    home, moved = origin_moved(0.0), origin_moved(1e10)
    flags = {flag.where: flag.value for flag in moved._lost_digits}
    for name in ("driver.motor.drive", "load.power", "mechanism.shaking_moment"):
        assert flags[name] == pytest.approx(off(moved[name], home[name]), rel=0.01)
    assert any(note.startswith("digits lost to rounding: ") for note in moved.notes())
    written = [f for f in moved.to_dict()["quality"]["flags"] if f["code"] == "digits-lost"]
    assert {flag["where"] for flag in written} == set(flags)


def test_a_motion_is_told_of_its_digits_without_accelerations_that_nobody_asked_for():
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    moved = graph.compile().simulate("time=0.1", start={"crank": (0.0, 5.0)}, want="crank.q")
    assert moved._lost_digits == ()
    assert "accelerations" not in vars(moved.samples.inputs)


def test_iterations_of_friction_that_are_cut_short_say_how_far_off_they_are():
    """Beside the numbers: as text, as a column of a spreadsheet, as data; of a motion too."""
    mech = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()
    run = mech.run(at=[1.0, 2.0], friction="single", want="crank.drive")
    exact = mech.run(at=[1.0, 2.0], want=["crank.drive", "dyad.*.friction"])
    largest = np.max([np.abs(exact[f"dyad.{joint}.friction"]) for joint in "BCD"], axis=0)
    single = mech.run(at=[1.0, 2.0], friction="single", want="dyad.*.friction")
    for joint in "BCD":
        off = np.abs(single[f"dyad.{joint}.friction"] - exact[f"dyad.{joint}.friction"])
        assert (off <= run.friction_error * largest).all()
    assert "friction error [-]" in run.to_csv().partition("\n")[0]
    assert "friction error" not in exact.to_csv().partition("\n")[0]
    assert max(run.to_dict()["quality"]["friction_error"]["dyad"]) == run.friction_error.max()
    options = {"start": {"crank": (1.0, 10.0)}, "times": [0.0, 0.1], "want": "crank.q"}
    moved = mech.simulate("time=0.1", friction="single", **options)
    assert moved.friction_error[0] == moved.motion.facts["friction_misfit"] > 1e-6
    assert f"{moved.friction_error[0]:.1e}" in str(moved)


def test_a_stroke_and_extremes_of_a_result_are_told_in_its_units():
    crank = bm.read(GRAPHS / "joints" / "slider_crank.json").run(samples=37).to("mm", "deg")
    text = str(crank.stroke("link.piston.p"))
    assert text.startswith("link.piston.p  stroke 100 mm, from driver.motor.q = 180 deg to ")
    assert crank.stroke("link.piston.p").length == pytest.approx(0.1)
    lines = str(extremes(crank, "link.piston.p.x")).splitlines()
    assert lines[1] == "link.piston.p.x  maximum 250 mm at driver.motor.q = 0 deg"


def test_a_mass_without_a_cm_is_at_the_origin_and_a_note_says_so():
    m = bm.Linkage("drawing")
    m.add_link("crank", mass=1.0)
    m.add_link("slide", mass=1.0)
    m.add_joint("A", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("B", "R", ["crank", "slide"], point=(1.0, 0.0))
    m.add_driver("motor", "A", bm.motion.ConstantRate(rate=1.0))
    m.add_driver("wrist", "B", bm.motion.ConstantRate(rate=1.0))
    (note,) = [note for note in m.run(samples=3).notes() if "origin" in note]
    assert note.startswith("slide: no cm")  # the crank turns about its origin


def test_what_a_call_leaves_out_is_noted_and_what_a_table_shows_is_read():
    m = bm.Linkage("arm")
    m.add_link("a", mass=1.0, cm=(0.5, 0.0))
    m.add_joint("O", "R", ["frame", "a"], point=(0.0, 0.0))
    m.add_driver("motor", "O")
    m.add_load("f", "force", link="a", force=(0, -1))
    statics = m.run(at=[0.5], want="driver.motor.drive")
    assert "f: no at, so it acts at the origin of its link's axes" in statics.notes()
    assert statics["driver.motor.q"] == [0.5]
    assert [*statics.rerun(friction="none")] == ["driver.motor.drive"]
    (note,) = m.run(at=[0.5], want="link.a.omega").notes()
    assert note == "motor: no law of motion, so the rate is 0; give rates="
    assert m.run(at=[0.5], rates={"motor": 1.0}, want="link.a.omega").notes() == []
    assert m.compile().simulate("time=0.1", start={"motor": 0.0}).motion.unit == "rad"


def test_a_run_at_one_pose_prints_no_figure_of_a_whole_run():
    mech = ruiz().compile()
    assert "efficiency" in str(mech.run(samples=5))
    assert "efficiency" not in str(mech.run(at=1.0))
    assert "efficiency" in str(mech.run(at=1.0, want="mechanism.friction_efficiency"))
