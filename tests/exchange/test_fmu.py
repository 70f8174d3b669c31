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

CASES = {  # graph -> how long [s]; frictionless, several drivers, joint friction
    "watt_sixbar": 1.0,
    "fivebar_falling": 0.2,
    "andrews_squeezer": 0.02,
}


@NEEDS_C
@pytest.mark.parametrize("name", [*CASES, "ruiz_fourbar", "stephenson_3_triad"])
def test_fmpy_finds_no_problem(name, tmp_path):
    from fmpy.validation import validate_fmu

    (path,) = bm.write(mechanism(name), tmp_path / "m.fmu")
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        assert sum(n.startswith("sources/") for n in archive.namelist()) == 3
        assert any(n.startswith("binaries/") for n in archive.namelist())


@NEEDS_C
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_it_moves_as_simulate_does(name, kind, tmp_path):
    mech = mechanism(name)
    end = CASES[name]
    step = {"watt_sixbar": 1e-3, "fivebar_falling": 1e-4, "andrews_squeezer": 1e-5}[name]
    (path,) = bm.write(mech, tmp_path / "m.fmu", step=step)
    times = np.linspace(0.0, end, 11)
    more = {"solver": "CVode", "relative_tolerance": 1e-11} if kind == "ModelExchange" else {}
    names = [mech.of_driver(d, "q") for d in mech.drivers]
    found = fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=end, output_interval=end / 10, output=names, **more
    )
    ours = mech.simulate(f"time={end}", times=times, want=names, accuracy=1e-10)
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


def test_coupled_drivers_are_refused(tmp_path):
    with pytest.raises(bm.RequestError, match=r"couplings"):
        bm.write(mechanism("geared_fivebar"), tmp_path / "m.fmu")
