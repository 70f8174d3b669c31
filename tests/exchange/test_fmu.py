"""FMUs: FMPy's validation finds nothing, and its CVode moves them as `simulate` does."""

import shutil
import zipfile

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import mechanism

fmpy = pytest.importorskip("fmpy", reason="the outside judge of FMUs")
NEEDS_C = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="needs a C compiler"
)
AGREE = 1e-7

CASES = {  # graph -> how long [s]: one driver, several, a gear pair
    "watt_sixbar": 1.0,
    "fivebar_falling": 0.2,
    "andrews_squeezer": 0.02,
    "geared_fivebar": 0.2,
}
STEPS = {"watt_sixbar": 1e-3, "fivebar_falling": 1e-4, "andrews_squeezer": 1e-5}


@NEEDS_C
@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("name", [*CASES, "ruiz_fourbar", "stephenson_3_triad", "valve_engine"])
def test_fmpy_finds_no_problem(name, fmi, tmp_path):
    from fmpy.validation import validate_fmu

    (path,) = bm.write(mechanism(name), tmp_path / "m.fmu", fmi=fmi)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        assert {"sources/unit.h", f"sources/fmi{fmi}.c"} <= set(archive.namelist())
        assert any(n.startswith("binaries/") for n in archive.namelist())


@NEEDS_C
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_it_moves_as_simulate_does(name, kind, fmi, tmp_path):
    mech = mechanism(name)
    end = CASES[name]
    (path,) = bm.write(mech, tmp_path / "m.fmu", step=STEPS.get(name, 1e-4), fmi=fmi)
    times = np.linspace(0.0, end, 11)
    more = {"solver": "CVode", "relative_tolerance": 1e-11} if kind == "ModelExchange" else {}
    names = [mech.of_driver(d, "q") for d in mech.drivers]
    if not mech.scene.initial:
        more["start_values"] = dict.fromkeys(names, 0.5) | {
            mech.of_driver(d, "rate"): 2.0 for d in mech.drivers
        }
    found = fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=end, output_interval=end / 10, output=names, **more
    )
    start = dict.fromkeys(mech.drivers, (0.5, 2.0)) if "start_values" in more else None
    ours = mech.simulate(f"time={end}", times=times, want=names, accuracy=1e-10, start=start)
    for column in names:
        assert np.abs(np.interp(times, found["time"], found[column]) - ours[column]).max() < AGREE


@NEEDS_C
def test_friction_and_an_effort_count(tmp_path):
    mech = mechanism("ruiz_fourbar")
    want = ["crank.drive", "dyad.C.reaction"]
    (path,) = bm.write(mech, tmp_path / "m.fmu", want=want)
    effort = np.array([(0.0, 9000.0), (1.0, 9000.0)], [("time", float), ("crank.effort", float)])
    columns = ["crank.q", "crank.rate", "crank.acceleration", "crank.drive", "dyad.C.reaction.x"]
    start = {"crank.q": 0.3, "crank.rate": 10.0}
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=0.01,
        output_interval=0.005,
        start_values=start,
        input=effort,
        output=columns,
        fmi_type="ModelExchange",
        relative_tolerance=1e-10,
    )
    for row in found:
        again = mech.run(
            at=[row["crank.q"]],
            rates=[row["crank.rate"]],
            accelerations=[row["crank.acceleration"]],
            want=want,
        )
        assert again["crank.drive"][0] == pytest.approx(9000.0, abs=1e-6)
        assert row["crank.drive"] == pytest.approx(9000.0, abs=1e-6)
        assert row["dyad.C.reaction.x"] == pytest.approx(again["dyad.C.reaction"][0].real, rel=1e-9)


def test_without_a_compiler_the_sources_are_all(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    (path,) = bm.write(mechanism("watt_sixbar"), tmp_path / "m.fmu")
    with zipfile.ZipFile(path) as archive:
        assert not any(n.startswith("binaries/") for n in archive.namelist())


def test_a_version_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(bm.RequestError, match=r'fmi: got "1".*2 or 3'):
        bm.write(mechanism("watt_sixbar"), tmp_path / "m.fmu", fmi="1")
