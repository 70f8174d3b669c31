"""Extremes of studies mean what `extremes` means: those of the range, whatever the samples."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.extremes import extremes
from blockmech.analysis.peaks import REMAINDER, Search
from tests.gallery import GRAPHS, mechanism
from tests.wiring import EPS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
EDGE = {"dyad.l_i": 6.106060606060606, "dyad.l_j": 2.608080808080808}
AT_EDGE = 146823.5030192  # N m, by 7,201 samples and golden section


def extreme(run, output, reduction):
    result = extremes(run, output)
    low, high = result.minimum.value, result.maximum.value
    every = {"min": low, "max": high, "max_abs": max(abs(low), abs(high)), "range": high - low}
    return every[reduction], max(abs(low), abs(high))


@pytest.mark.parametrize(
    ("samples", "engine"), [(72, "llvm"), (72, "numpy"), (19, "numpy"), (361, "llvm")]
)
def test_beside_a_change_point_samples_only_start_the_search(samples, engine):
    mech = RUIZ.compile()
    vary = {name: [value, value] for name, value in EDGE.items()}
    settings = {"sampling": "paired", "samples": samples, "engine": engine}
    study = mech.study(vary, want=["max_abs(crank.drive)", "range(crank.drive)"], **settings)
    assert study.status == ("ok", "ok")
    assert study["max_abs(crank.drive)"] == pytest.approx(AT_EDGE, rel=1e-9)
    expected, _ = extreme(RUIZ.replace(EDGE).compile().run(samples=72), "crank.drive", "range")
    assert study["range(crank.drive)"] == pytest.approx(expected, rel=1e-9)


def test_an_optimiser_and_a_tolerance_see_the_same_edge():
    mech = RUIZ.replace(EDGE).compile()
    f = mech.objective([*EDGE], want="max_abs(crank.drive)", samples=72)
    assert f(f.start) == pytest.approx(AT_EDGE, rel=1e-9)
    h = 1e-7
    for k, slope in enumerate(f.jacobian(f.start)):
        e = h * np.eye(2)[k]
        difference = (
            8 * (f(f.start + e) - f(f.start - e)) - f(f.start + 2 * e) + f(f.start - 2 * e)
        ) / 12
        assert slope == pytest.approx(difference / h, rel=1e-5)
    laws = {name: bm.dist.Normal(value, 1e-6) for name, value in EDGE.items()}
    bands = mech.tolerance(laws, want="max_abs(crank.drive)", samples=72, count=400)
    samples = bands.sampled["max_abs(crank.drive)"]
    assert samples.deviation[0] == pytest.approx(bands["max_abs(crank.drive)"][0], rel=0.15)


@pytest.mark.parametrize(
    ("graph", "address", "output"),
    [
        ("watt_sixbar", "second.l_i", "second.C.reaction"),
        ("stribeck_slider_crank", "crank.length", "crank.drive"),
        ("excavator", "", ""),
        ("valve_engine", "", ""),
        ("scotch_yoke", "", ""),
        ("stephenson_3", "", ""),
    ],
)
def test_designs_side_by_side_say_what_each_says_alone(graph, address, output):
    mech = mechanism(graph)
    lengths = [p.address for p in mech.parameters().values() if p.unit == "m" and p.value]
    address = address if address in lengths else lengths[-1]
    reals = [n for n, o in mech.outputs.items() if o.kind == "real" and not n.endswith("angle")]
    output = output if output in mech.outputs else reals[len(reals) // 2]
    vector = mech.outputs[output].kind == "vector"
    reductions = ["max_abs"] if vector else ["min", "max", "max_abs", "range"]
    values = mech.parameters()[address].value * np.array([1.0, 1.004, 0.993])
    study = mech.study(
        {address: values}, want=[f"{reduction}({output})" for reduction in reductions], samples=48
    )
    for (k, value), reduction in itertools.product(enumerate(values), reductions):
        if study.status[k] != "ok":
            continue
        run = mech.document.replace({address: float(value)}).compile().run(samples=48, want=output)
        expected, size = extreme(run, output, reduction)
        assert abs(study[f"{reduction}({output})"][k] - expected) <= 1e-9 * size


@pytest.mark.parametrize("engine", ["numpy", "llvm"])
@pytest.mark.parametrize("address", ["cam.law.segments[1].over", "cam.phase", "load.force.y"])
def test_designs_of_a_law_in_segments_say_what_each_says_alone(address, engine):
    """Tables of all designs were read as that of one: the objective ended in a ValueError."""
    mech = mechanism("couplings/indexing_table")
    start = mech.parameters()[address].value
    values = start * np.array([1.0, 1.3, 0.7, 1.1])
    label, output = "range(shaft.drive)", "shaft.drive"
    study = mech.study({address: values}, want=label, samples=48, engine=engine)
    for k, value in enumerate(values):
        run = mech.document.replace({address: float(value)}).compile().run(samples=48, want=output)
        expected, size = extreme(run, output, "range")
        assert abs(study[label][k] - expected) <= 1e-9 * size
    f = mech.objective([address], want=label, samples=48)
    assert f(f.start) == pytest.approx(study[label][0], rel=1e-9)


@pytest.mark.parametrize("graph", ["stephenson_3", "engine", "couplings/indexing_table"])
def test_all_outputs_of_a_machine_have_one_meaning_of_extremes(graph):
    """Corners, poles, and jumps at samples among them."""
    mech = mechanism(graph)
    length = next(p for p in mech.parameters().values() if p.unit == "m" and p.value)
    names = [
        n
        for n, o in mech.outputs.items()
        if o.kind == "real" and not n.endswith(("angle", "q", "rate", "acceleration"))
    ]
    want = [f"{reduction}({name})" for name in names for reduction in ("min", "max")]
    study = mech.study({length.address: [length.value]}, want=want, samples=73)
    assert study.status == ("ok",)
    for name in names:
        span = mech.extremes(name)
        low, high = span.minimum.value, span.maximum.value
        size = max(abs(low), abs(high), 1e-9)
        for reduction, value in (("min", low), ("max", high)):
            answer = study[f"{reduction}({name})"][0]
            assert answer == value or abs(answer - value) <= 1e-9 * size, (reduction, name)


def test_where_an_output_has_a_pole_it_has_no_largest_value_and_no_derivative():
    """The drive of an engine goes through zero, and its mechanical advantage through infinity."""
    mech, label = mechanism("engine"), "max(mechanism.mechanical_advantage)"
    span = mech.extremes("mechanism.mechanical_advantage")
    assert span.maximum.value == np.inf
    assert span.minimum.value == pytest.approx(0.22717736, rel=1e-7)
    f = mech.objective(["crank.length"], want=label, samples=73)
    assert f(f.start) == np.inf
    with pytest.raises(bm.RequestError, match="grows without bound"):
        f.jacobian(f.start)


def test_an_output_that_is_infinite_at_a_pose_is_no_number():
    mech = mechanism("slider_crank")
    label = "mean(mechanism.mechanical_advantage)"
    length = mech.parameters()["crank.length"].value
    study = mech.study({"crank.length": [length]}, want=[label], samples=73)
    assert study.status == ("no-number",)
    assert label in study.reason(0)


def test_a_design_at_its_change_point_has_no_number_and_one_word():
    edge = {"dyad.l_i": 5 + 79 * 1.5 / 99, "dyad.l_j": 2.6 + 12 * 0.8 / 99}
    want = ["max_abs(crank.drive)", "min(dyad.transmission_angle)", "at(dyad.i.angle, 0.0)"]
    vary = {name: [value] for name, value in edge.items()}
    study = RUIZ.compile().study(vary, want=want, samples=72, sampling="paired")
    mech = RUIZ.replace(edge).compile()
    assert study.status == ("dead-centre",)
    assert all(np.isnan(study[label]).all() for label in want)
    assert mech.limits().whole_turn
    with pytest.raises(bm.SingularError, match="dead-centre"):
        mech.run(at=0.0)
    assert mech.run(at=[0.0], on_gap="mark").quality.status == ("dead-centre",)


def test_where_no_range_leads_through_the_poses_an_extreme_is_coarse():
    several = mechanism("excavator")
    poses = {d: [0.0, 0.01, 0.03] for d in several.drivers}
    output = several._of_driver(several.drivers[0], "q")
    address = next(p.address for p in several.parameters().values() if p.unit == "m" and p.value)
    value = several.parameters()[address].value
    study = several.study({address: [value]}, want=f"max({output})", at=poses)
    assert study.status == ("coarse",)
    assert study[f"max({output})"][0] == 0.03
    assert "no range leads through the poses" in study.reason(0)


def test_a_gap_between_the_poses_leaves_no_number():
    """A four-bar whose crank passes a place that closes for no pose, between two samples."""
    design = {"dyad.l_i": 6.19697, "dyad.l_j": 2.695}
    assert not RUIZ.replace(design).compile().limits().whole_turn
    poses = np.linspace(0.05, 2 * np.pi - 0.05, 72)
    over = np.concatenate([[-0.05], poses])
    study = RUIZ.compile().study(
        {name: [x] for name, x in design.items()}, want="max_abs(crank.drive)", at=over,
        sampling="paired",
    )  # fmt: skip
    assert study.status == ("no-assembly",)
    assert np.isnan(study["max_abs(crank.drive)"][0])
    assert "dyad between the poses" in study.reason(0)


# -- the search itself ---------------------------------------------------------------------


def search(function, s, m, **options):
    y = function(np.arange(m), np.tile(s, (m, 1)))
    return Search(function, s, y, **options).largest()


def test_jumps_are_found_to_rounding():
    at = np.random.default_rng(1).uniform(0.1, 6.0, (60, 1))

    def steps(row, x):
        return np.where(x < at[row], x, x - 3.0)

    expected = np.maximum(at[:, 0], 3.2)
    for remainder, accuracy in ((EPS, 1e-13), (REMAINDER, 1e-10)):
        peaks = search(steps, np.linspace(0.0, 6.2, 40), 60, remainder=remainder)
        np.testing.assert_allclose(peaks.value, expected, rtol=accuracy)
        assert not peaks.error.any()


def test_what_happens_within_rounding_of_a_jump_is_no_extreme():
    """Two slips that reverse together do so one after the other, by rounding of the place."""
    jump = np.random.default_rng(6).uniform(0.1, 6.0, (60, 1))

    def friction(row, x):
        both = np.where(x < jump[row] * (1.0 + 1e-13), 3.0, 0.0)
        return np.where(x < jump[row], 2.0 + 0.01 * x, both)

    peaks = search(friction, np.linspace(0.0, 6.2, 72), 60)
    assert (np.abs(peaks.value - 2.0 - 0.01 * jump[:, 0]) < 1e-9).mean() > 0.9
    assert not peaks.error.any()


def test_poles_narrower_than_the_samples_are_found():
    """Peaks of half the spacing, away from the largest sample."""
    random = np.random.default_rng(2)
    width, at = random.uniform(0.04, 0.2, (80, 1)), random.uniform(2.5, 6.0, (80, 1))

    def peaks(row, x):
        return np.sin(x) + 3.0 * width[row] ** 2 / ((x - at[row]) ** 2 + width[row] ** 2)

    match = search(peaks, np.linspace(0.0, 6.2, 72), 80)
    for i in range(80):
        grid = at[i] + np.linspace(-1, 1, 20001) * width[i] / 4
        grid = np.append(grid, np.linspace(0.0, 6.2, 20001)).clip(0.0, 6.2)
        assert match.value[i] == pytest.approx(peaks(np.array([i]), grid[None]).max(), rel=1e-7)
        assert match.value[i] >= peaks(np.array([i]), grid[None]).max() * (1 - 1e-13)


def test_corners_are_found_to_rounding():
    random = np.random.default_rng(4)
    corner, rising, falling = random.uniform([0.1, 0.2, 0.2], [6.1, 3.0, 3.0], (300, 3)).T[
        ..., None
    ]

    def roofs(row, x):
        offset = x - corner[row]
        return 2.0 - np.where(offset < 0.0, -rising[row], falling[row]) * offset

    peaks = search(roofs, np.linspace(0.0, 6.2, 72), 300)
    assert np.abs(peaks.value - 2.0).max() <= 1e-10 * 18.0  # of the largest size, as a remainder is
    assert not peaks.error.any()


def test_at_a_pole_there_is_no_largest_value():
    at = np.random.default_rng(5).uniform(0.1, 6.1, (300, 1))

    @np.errstate(divide="ignore")
    def pole(row, x):
        return 1.0 / np.abs(x - at[row])

    peaks = search(pole, np.linspace(0.0, 6.2, 72), 300)
    assert (peaks.value == np.inf).all()
    np.testing.assert_allclose(peaks.place, at[:, 0], atol=1e-9)


@pytest.mark.parametrize("turn", [True, False])
def test_tops_at_the_seam_and_at_the_ends(turn):
    phase = np.linspace(0.0, 2 * np.pi, 41)[:, None]

    def waves(row, x):
        return np.cos(x - phase[row]) + 0.1 * np.cos(3 * (x - phase[row]))

    high = 2 * np.pi if turn else 3.0
    peaks = search(waves, np.linspace(0.0, high, 37), 41, turn=turn)
    fine = waves(np.arange(41), np.tile(np.linspace(0.0, high, 30001), (41, 1))).max(axis=1)
    np.testing.assert_allclose(peaks.value, fine, rtol=1e-7)
    assert (peaks.value >= fine - 1e-13).all()


def test_a_function_that_ends_between_its_samples_is_told():
    def root(row, x):
        with np.errstate(invalid="ignore"):
            return np.sqrt((x - 1.0) ** 2 - 1e-4) + 2.0 / (1e-2 + np.abs(x - 1.0))

    peaks = search(root, np.linspace(0.0, 2.03, 30), 1)
    assert np.isinf(peaks.error[0])


def test_noise_is_not_closed_in_on():
    random = np.random.default_rng(3)
    peaks = search(lambda row, x: random.standard_normal(x.shape), np.linspace(0.0, 1.0, 72), 2)
    assert not peaks.error.any()
