"""A study keeps of each design what a run of it alone would say."""

import itertools
import re

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.extremes import extremes
from blockmech.figures.palette import SMALL
from blockmech.figures.paper import text_width
from blockmech.studies.family import remade
from blockmech.studies.runner import Runner
from tests.gallery import JOINTS, mechanism
from tests.machines import ruiz

TURN = {"crank": np.linspace(0.0, 2 * np.pi, 24, endpoint=False)}


@pytest.fixture(scope="module")
def fourbar():
    return mechanism("ruiz_fourbar")


def test_distributions_are_read_with_units(fourbar):
    length = bm.dist.Normal("6 m", "0.1 mm")
    assert (length.mean, length.deviation) == (6.0, 1e-4)
    assert length == bm.dist.Normal(6.0, 1e-4)
    assert bm.dist.Uniform("590 cm", 6.1) == bm.dist.Uniform(5.9, 6.1)
    mass = bm.dist.Normal("6 kg", "1 g")
    with pytest.raises(bm.RequestError, match=r'dyad\.l_i: "6 kg" has another kind of unit'):
        fourbar.tolerance({"dyad.l_i": mass}, "crank.drive", at=0.5)
    with pytest.raises(bm.RequestError, match="has another kind of unit"):
        fourbar.study({"dyad.l_i": mass}, want="max(crank.drive)", sampling=bm.dist.Sample(4))


def test_reductions_are_those_of_the_run(fourbar):
    want = {
        "crank.drive": ["min", "max", "max_abs", "range", "mean", "rms", f"at({TURN['crank'][3]})"],
        "dyad.C.reaction": ["max_abs", "rms", "mean", "poses"],
        "dyad.C.p.x": "max",
        "mechanism.friction_efficiency": "value",
    }
    study = fourbar.study({"dyad.l_i": [5.9, 6.1]}, at=TURN, want=want)
    for k, l_i in enumerate((5.9, 6.1)):
        run = remade(fourbar, {"dyad.l_i": l_i}).run(at=TURN, engine="numpy", want=[
            "crank.drive", "dyad.C.reaction", "dyad.C.p", "mechanism.friction_efficiency"
        ])  # fmt: skip
        tau, R = run["crank.drive"], run["dyad.C.reaction"]
        names = "crank.drive", "dyad.C.reaction", "dyad.C.p.x"
        drive, reaction, x = (extremes(run, name) for name in names)
        low, high = drive.minimum.value, drive.maximum.value
        assert study[f"at(crank.drive, {TURN['crank'][3]})"][k] == tau[3]
        np.testing.assert_array_equal(study["poses(dyad.C.reaction)"][k], R)
        expected = {
            "mean(crank.drive)": tau.mean(),
            "rms(crank.drive)": np.sqrt(np.mean(tau**2)),
            "min(crank.drive)": low,
            "max(crank.drive)": high,
            "max_abs(crank.drive)": max(-low, high),
            "range(crank.drive)": high - low,
            "max(dyad.C.p.x)": x.maximum.value,
            "max_abs(dyad.C.reaction)": reaction.maximum.value,
            "rms(dyad.C.reaction)": np.sqrt(np.mean(np.abs(R) ** 2)),
            "mean(dyad.C.reaction)": R.mean(),
            "mechanism.friction_efficiency": run["mechanism.friction_efficiency"],
        }
        for label, x in expected.items():
            np.testing.assert_allclose(study[label][k], x, rtol=24 * np.finfo(float).eps)


def test_a_design_that_does_not_assemble_is_a_row_with_its_reason(fourbar):
    lengths = np.linspace(3.5, 7.0, 8)
    study = fourbar.study(
        {"dyad.l_i": lengths}, at=TURN, want=["max_abs(crank.drive)", "min(dyad.margin)"]
    )
    for k, l_i in enumerate(lengths):
        run = remade(fourbar, {"dyad.l_i": l_i}).run(
            at=TURN, want=["crank.drive", "dyad.margin"], on_gap="mark", engine="numpy"
        )
        gaps = run.quality.gaps
        assert study.status[k] == (run.quality.status[gaps[0]] if gaps else "ok")
        assert study.found.poses[k] == len(gaps)
        assert np.isnan(study["max_abs(crank.drive)"][k]) == bool(gaps)
    first = study.reason(0)
    assert first.startswith("no-assembly at dyad: ")
    assert "of 24 poses, the first at crank.q = " in first
    assert study["min(dyad.margin)"][0] < 0


def test_the_engine_is_named_and_may_be_chosen(fourbar, fresh):
    pytest.importorskip("llvmlite", reason="the extra fast is not installed")
    request = {"at": TURN, "want": "poses(dyad.C.p)"}
    lengths = [5.9, 6.1]
    small = remade(fourbar, {}).study({"dyad.l_i": lengths}, **request)
    study = fourbar.study({"dyad.l_i": lengths}, engine="llvm", **request)
    assert (small.engine, study.engine) == ("numpy", "llvm")
    for k, l_i in enumerate(lengths):
        run = remade(fourbar, {"dyad.l_i": l_i}).run(at=TURN, want="dyad.C.p", engine="llvm")
        np.testing.assert_array_equal(study["poses(dyad.C.p)"][k], run["dyad.C.p"])
    with pytest.raises(bm.RequestError, match="the study did not keep it"):
        study.unit("dyad.C.p")


def test_self_locking_designs_say_so():
    fourbar = mechanism("ruiz_fourbar")
    values = {"dyad.friction.C.radius": [0.0075, 9.0]}
    study = fourbar.study(values, want="max_abs(crank.drive)", samples=9)
    locked = remade(fourbar, {"dyad.friction.C.radius": 9.0})
    run = locked.run(samples=9, want=["crank.drive"], on_gap="mark", engine="numpy")
    assert study.status == ("ok", run.quality.status[run.quality.gaps[0]])
    assert study.status[1] != "ok"


def test_a_grid_is_an_array_over_its_numbers(fourbar):
    vary = {"dyad.l_i": [5.8, 6.0, 6.2], "dyad.links.i.mass": [0.0, 30.0]}
    study = fourbar.study(vary, at=TURN, want="max_abs(crank.drive)")
    table = study.grid("max_abs(crank.drive)")
    assert table.shape == (3, 2)
    data = study.to_xarray()
    assert data["max_abs(crank.drive)"].dims == ("dyad.l_i", "dyad.links.i.mass")
    assert data["max_abs(crank.drive)"].attrs["units"] == "N m"
    cell = data["max_abs(crank.drive)"].sel({"dyad.l_i": 6.0, "dyad.links.i.mass": 30.0})
    assert float(cell) == table[1, 1] == study["max_abs(crank.drive)"][3]


def test_blocks_of_any_size_say_the_same(fourbar, monkeypatch):
    vary = {"dyad.l_i": np.linspace(5.8, 6.2, 11), "dyad.friction.C.coefficient": [0.0, 0.2]}
    request = {"at": TURN, "want": ["mean(crank.drive)", "poses(dyad.C.p)"]}
    study = fourbar.study(vary, **request)
    monkeypatch.setattr(Runner, "size", lambda self, n: 3)
    parts = fourbar.study(vary, **request)
    for label in study:
        np.testing.assert_array_equal(study[label], parts[label])


def test_after_an_interrupt_what_is_done_is_kept(fourbar, monkeypatch):
    monkeypatch.setattr(Runner, "size", lambda self, n: 2)
    calls = []

    def say(label, count, full):
        calls.append((label, count, full))
        if count == 4:
            raise KeyboardInterrupt

    lengths = np.linspace(5.8, 6.2, 9)
    options = {"at": TURN, "want": "max(crank.drive)", "engine": "numpy"}  # in blocks of that size
    study = fourbar.study({"dyad.l_i": lengths}, progress=say, **options)
    assert calls[0] == ("2 of 9 designs", 2, 9)
    assert study.interrupted
    assert study.n == 4
    full = fourbar.study({"dyad.l_i": lengths}, **options)
    np.testing.assert_array_equal(study["max(crank.drive)"], full["max(crank.drive)"][:4])
    assert np.isnan(study.grid("max(crank.drive)")[4:]).all()


@pytest.mark.parametrize("sampling", ["latin", "sobol", "random"])
def test_points_of_distributions_are_the_same_for_a_seed(fourbar, sampling):
    vary = {"dyad.l_i": bm.dist.Normal(6.0, 0.01), "frame.D.x": bm.dist.Uniform(5.4, 5.6)}
    request = {"at": TURN, "want": "max(crank.drive)", "sampling": bm.dist.Sample(256, sampling)}
    study = fourbar.study(vary, **request)
    again = fourbar.study(vary, **request)
    second = {"sampling": bm.dist.Sample(256, sampling, seed=1)}
    np.testing.assert_array_equal(study["dyad.l_i"], again["dyad.l_i"])
    assert (study["dyad.l_i"] != fourbar.study(vary, **request | second)["dyad.l_i"]).any()
    spread = 4 / np.sqrt(256)  # four standard errors
    assert abs(study["dyad.l_i"].mean() - 6.0) < spread * 0.01
    assert abs(study["frame.D.x"].std() - 0.2 / np.sqrt(12)) < spread * 0.2
    assert 5.4 <= study["frame.D.x"].min() < study["frame.D.x"].max() <= 5.6


def test_what_a_program_cannot_vary_is_compiled_design_by_design(fourbar):
    study = fourbar.study({"dyad.branch": [1, -1]}, at=TURN, want="mean(dyad.C.p.y)")
    assert study.alone == "dyad.branch chooses between structures"
    assert study["mean(dyad.C.p.y)"][0] > 0 > study["mean(dyad.C.p.y)"][1]
    rates = fourbar.study({"scene.drive.crank.rate": [1.0, 2.0]}, at=TURN, want="max(dyad.i.omega)")
    assert rates["max(dyad.i.omega)"][1] == 2 * rates["max(dyad.i.omega)"][0]
    triad = mechanism("stephenson_3_triad")
    address = next(a for a in triad.parameters() if a.endswith(".at.x"))
    value = triad.parameters()[address].value
    moved = triad.study({address: [value, value + 50.0]}, want="max_abs(crank.drive)", samples=3)
    assert "is followed from its home" in moved.alone
    assert moved.status == ("ok", "no-assembly")


def test_the_law_of_a_driver_of_a_general_group_varies():
    document = bm.Linkage.load(JOINTS / "stephenson_3_triad.json")
    mech = document.compile()
    address = next(a for a in mech.parameters() if a.startswith("drivers.") and a.endswith(".rate"))
    out = f"driver.{mech.drivers[0]}.rate"
    rates = mech.study({address: [1.0, 2.0]}, want=f"max({out})", samples=3)
    assert (rates[f"max({out})"] == [1.0, 2.0]).all()


def test_numbers_of_a_linkage_that_go_into_its_graph_vary_in_one_program():
    plain = bm.Linkage.load(JOINTS / "ruiz_fourbar.json").compile()
    link = next(a for a in plain.parameters() if a.endswith(".mass"))
    out = f"driver.{plain.drivers[0]}.drive"
    study = plain.study({link: [1.0, 2.0]}, want=f"max({out})", samples=9)
    assert not study.alone
    variant = remade(plain, {link: 2.0})
    largest = extremes(variant.run(samples=9, want=[out]), out).maximum.value
    assert study[f"max({out})"][1] == pytest.approx(largest, rel=1e-12)
    address = next(a for a in plain.parameters() if a.startswith("joints.") and a.endswith(".x"))
    value = plain.parameters()[address].value
    moved = plain.study({address: [value, value + 1e-3]}, want=f"max({out})", samples=9)
    assert moved.alone.endswith("whose mode the document's poses tell")
    assert moved.status == ("ok", "ok")


@pytest.mark.parametrize("address", ["joints.seam.angle[1]", "joints.B.at[1].y"])
def test_angles_of_a_design_are_counted_in_its_own_frames(address):
    m = bm.Linkage("bracket")
    m.add_link("crank", pose=(0.0, 0.0, 0.3))
    m.add_link("rod", pose=(0.1, 0.03, 0.1))
    m.add_link("ram", pose=(0.5, 0.0, 0.0))
    m.add_link("bracket", pose=(0.5, 0.0, 0.4))
    m.add_joint("A", "R", ["frame", "crank"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_joint("B", "R", ["crank", "rod"], at=[(0.1, 0.0), (0.0, 0.02)])
    m.add_joint("C", "R", ["rod", "ram"], at=[(0.4, 0.0), (0.0, 0.0)])
    m.add_joint("S", "P", ["frame", "ram"], at=[(0.0, 0.0), (0.0, 0.0)], angle=[0.0, 0.0])
    m.add_joint("seam", "weld", ["rod", "bracket"], at=[(0.4, 0.0), (0.0, 0.0)], angle=[0.4, 0.0])
    m.add_driver("motor", "A")
    names = [f"link.{link}.angle" for link in ("rod", "bracket")]
    request = {"want": [f"poses({name})" for name in names], "at": [0.3, 0.5]}
    study = m.compile().study({address: [0.1]}, **request)
    run = m.replace({address: 0.1}).run(at=[0.3, 0.5], want=names)
    for name in names:
        np.testing.assert_array_equal(study[f"poses({name})"][0], run[name])


def test_tables_leave_as_csv_parquet_and_frames(fourbar, tmp_path):
    study = fourbar.study(
        {"dyad.l_i": [4.0, 6.0]}, at=TURN, want=["max(crank.drive)", "mean(dyad.C.p)"]
    )
    head, bad, good = study.to_csv(tmp_path / "a.csv").splitlines()
    assert head.split(",")[:2] == ["dyad.l_i [m]", "max(crank.drive) [N m]"]
    assert head.endswith("mean(dyad.C.p).x [m],mean(dyad.C.p).y [m],status")
    assert bad.startswith("4.0,,,")
    assert float(good.split(",")[1]) == study["max(crank.drive)"][1]
    import pyarrow.parquet as parquet

    study.to_parquet(tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.column("max(crank.drive)").to_pylist()[1] == study["max(crank.drive)"][1]
    assert table.schema.field("dyad.l_i").metadata == {b"unit": b"m"}
    assert study.to_dataframe().attrs["units"]["mean(dyad.C.p).x"] == "m"


@pytest.mark.parametrize("module", ["xarray", "pyarrow"])
def test_a_missing_package_names_its_extra(fourbar, monkeypatch, tmp_path, module):
    import sys

    study = fourbar.study({"dyad.l_i": [6.0]}, at=TURN, want="max(crank.drive)")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(bm.MissingEngineError, match=r"blockmech\[study\]"):
        study.to_xarray() if module == "xarray" else study.to_parquet(tmp_path / "a.parquet")


NORMAL = {"dyad.l_i": bm.dist.Normal(6.0, 0.1)}


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"vary": {"dyad.l_i": [6.0, -1.0, -2.0]}}, "l_i must be > 0 m, got -2"),
        ({"vary": {"dyad.l": [6.0]}}, 'did you mean "dyad.l_i"'),
        ({"vary": {"dyad.l_i": ["a"]}}, "is not a number with a unit"),
        ({"vary": {"dyad.l_i": [np.nan]}}, "not a finite number"),
        ({"vary": {"dyad.l_i": [6.0], "dyad.l_j": bm.dist.Normal(3.0, 0.1)}}, "bm.dist.Uniform"),
        ({"vary": NORMAL}, "say how many designs"),
        ({"vary": NORMAL, "sampling": bm.dist.Sample(9, "sobol")}, "e.g. 16"),
        ({"vary": {"dyad.l_i": [1, 2], "dyad.l_j": [3]}, "sampling": "paired"}, "equally many"),
        ({"want": {"crank.drive": "maxabs"}}, 'did you mean "max_abs"'),
        ({"want": {"dyad.C.p": "min"}}, "it is a vector"),
        ({"want": {"crank.driv": "min"}}, "no output has that name"),
        ({"want": "at(crank.drive, 0.1)"}, "the study has no such pose"),
        ({"want": {}}, "nothing is wanted"),
        ({"want": []}, "want: got []. give a name, or several"),
        ({"want": None}, "want: got None. give a name, or several"),
        ({"want": {"crank.drive": 3}}, "want[crank.drive]: got 3"),
        ({"vary": {"dyad.branch": [-1, 0.5, 1]}}, 'must be -1, 1 or "follow", got 0.5'),
        ({"vary": {"dyad.l_i": [1.0, 0.0, 6.0]}}, "l_i must be > 0 m, got 0"),
        (
            {"vary": {"dyad.l_i": bm.dist.Normal(6.0, 9.0)}, "sampling": bm.dist.Sample(99)},
            "l_i must be > 0 m, got -",
        ),
        ({"vary": NORMAL, "sampling": bm.dist.Sample(9, seed=-1)}, "seed: got -1"),
        ({"engine": "scalar"}, "engines: auto, numpy, llvm"),
        ({"want": "crank.drive"}, "how it is reduced is not said"),
    ],
)  # fmt: skip
def test_mistakes_get_one_message(fourbar, request_, message):
    request = {"vary": {"dyad.l_i": [6.0]}, "want": "max(crank.drive)", "at": TURN} | request_
    with pytest.raises(bm.BlockmechError) as error:
        fourbar.study(request.pop("vary"), **request)
    assert message in str(error.value)


@pytest.mark.parametrize(
    "make", [lambda: bm.dist.Normal(1.0, 0.0), lambda: bm.dist.Uniform(2.0, 1.0)]
)
def test_distributions_refuse_what_is_none(make):
    with pytest.raises(bm.RequestError):
        make()


# -- verified -------------------------------------------------------------------------------


@pytest.mark.parametrize("vary", [{"dyad.l_i": [5.5, 6.0, 6.5]}, {"crank.length": [1.8, 2.0, 9.0]}])
def test_a_study_is_verified_by_designs_made_again(vary):
    mech = ruiz().compile()
    study = mech.study(vary, want=["max_abs(crank.drive)", "rms(dyad.D.reaction)"], samples=25)
    checked = mech.verify(study)
    assert checked.ok, str(checked)
    assert [row.name for row in checked.rows] == [f"{w.label} made again" for w in study.columns]
    assert checked.samples == sum(word == "ok" for word in study.status)


def test_a_falsified_study_is_caught():
    mech = ruiz().compile()
    study = mech.study({"dyad.l_i": [5.5, 6.0, 6.5]}, want="max_abs(crank.drive)", samples=25)
    study.found.values["max_abs(crank.drive)"][1] *= 1 + 1e-9
    assert not mech.verify(study).ok


def test_a_study_of_another_mechanism_is_refused():
    study = ruiz().compile().study({"dyad.l_i": [6.0]}, want="max(crank.drive)", samples=5)
    with pytest.raises(bm.RequestError, match="another mechanism"):
        ruiz().replace({"dyad.l_j": 6.1}).compile().verify(study)
    assert ruiz().compile().verify(study).ok  # made again of the same document


def test_settings_of_a_motion_and_of_a_flywheel_are_read_with_units(fourbar):
    start = {"crank": ("30 deg", "10 rpm")}
    settings = {"accuracy": "0.001 deg", "budget": "10 s"}
    motion = fourbar.simulate("time=10 ms", start=start, want="crank.q", **settings).motion
    assert motion.t_end == 0.01
    engine = mechanism("engine")
    by_text = bm.design.flywheel(engine, speed="100 rad/s", fluctuation="2 %").inertia
    assert by_text == bm.design.flywheel(engine, speed=100.0, fluctuation=0.02).inertia


@pytest.mark.parametrize("count", [2, 3])
def test_words_of_ticks_stand_apart(tmp_path, count):
    numbers = {"crank.length": 0.05, "piston.l": 0.2, "piston.h": 0.001}
    vary = {k: np.linspace(x - 5e-4, x + 5e-4, 4) for k, x in [*numbers.items()][:count]}
    want, path = {"crank.drive": ["max_abs", "rms"]}, tmp_path / "study.svg"
    mechanism("slider_crank").study(vary, want=want, at=np.linspace(0.0, 6.0, 9)).plot(path)
    tick = r'text-anchor: middle" x="([\d.]+)" y="([\d.]+)"[^>]*>([\d.]+)<'
    ticks = re.findall(tick, path.read_text("utf-8"))
    rows = itertools.groupby(ticks, key=lambda word: word[1])
    assert ticks
    for _, row in rows:
        for (x, _, a), (y, _, b) in itertools.pairwise(row):
            width = (text_width(a, SMALL) + text_width(b, SMALL)) / 2
            assert abs(float(y) - float(x)) > width + 2
