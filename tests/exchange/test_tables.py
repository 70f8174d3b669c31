"""Workbooks, MATLAB files and tables of a run: read back by the packages that others use."""

import shutil
from importlib import metadata

import numpy as np
import pytest

import blockmech as bm
from blockmech.cli import main
from blockmech.exchange.formats import Formats
from blockmech.exchange.tables import CSV, JSON
from blockmech.ground.errors import RequestError
from tests.gallery import mechanism

WANT = ["crank.drive", "dyad.C.reaction", "dyad.i.angle"]


@pytest.fixture
def run():
    return mechanism("ruiz_fourbar").run(samples=13, want=WANT)


def test_a_workbook_has_numbers_units_and_a_chart(run, tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the extra office")
    (path,) = bm.write(mechanism("ruiz_fourbar"), tmp_path / "a.xlsx", want=WANT, samples=13)
    book = openpyxl.load_workbook(path)
    sheet = book["results"]
    heads = [c.value for c in sheet[1]]
    assert heads[0] == "crank.q"
    assert [c.value for c in sheet[2]][heads.index("crank.drive")] == "N m"
    column = [row[heads.index("crank.drive")].value for row in sheet.iter_rows(min_row=3)]
    assert column == pytest.approx(run["crank.drive"].tolist(), rel=1e-15)  # of openpyxl's digits
    assert len(sheet._charts) == 1


def test_a_cell_without_an_answer_is_empty_and_no_name_is_a_formula(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="the extra office")
    from tests.analysis.linkages import short_fourbar

    graph = short_fourbar()
    data = graph.to_data() | {"name": "=1+1"}
    mech = bm.Graph.from_data(data).compile()
    (path,) = bm.write(mech, tmp_path / "a.xlsx", want="dyad.C.p", at=[0.0, 3.1])
    sheet = openpyxl.load_workbook(path)["results"]
    rows = list(sheet.iter_rows(min_row=3, values_only=True))
    lost = [row for row in rows if row[-1] != "ok"]
    assert lost
    assert all(x is None for row in lost for x in row[2:-1])
    about = openpyxl.load_workbook(path)["about"]
    assert about["B1"].value == "=1+1"
    assert about["B1"].data_type == "s"


def test_a_mat_file_has_arrays_names_and_units(run, tmp_path):
    from scipy.io import loadmat

    (path,) = bm.write(mechanism("ruiz_fourbar"), tmp_path / "a.mat", want=WANT, samples=13)
    result = loadmat(path, simplify_cells=True)["run"]
    keys = {name: key for key, name in result["names"].items()}
    assert np.array_equal(result["values"][keys["crank.drive"]], run["crank.drive"])
    assert np.array_equal(result["values"][keys["dyad.C.reaction"]], run["dyad.C.reaction"])
    assert result["units"][keys["dyad.C.reaction"]] == "N"


def test_parquet_and_csv_and_npz(run, tmp_path):
    pandas = pytest.importorskip("pandas", reason="the extra study")
    for name in ("a.parquet", "a.csv", "a.npz", "a.json"):
        bm.write(mechanism("ruiz_fourbar"), tmp_path / name, want=WANT, samples=13)
    frame = pandas.read_parquet(tmp_path / "a.parquet")
    column = next(c for c in frame.columns if "crank.drive" in str(c))
    assert frame[column].tolist() == run["crank.drive"].tolist()
    text = pandas.read_csv(tmp_path / "a.csv")
    assert text["crank.drive [N m]"].tolist() == run["crank.drive"].tolist()
    with np.load(tmp_path / "a.npz") as arrays:
        assert np.array_equal(arrays["crank.drive"], run["crank.drive"])


@pytest.mark.parametrize("suffix", ["xlsx", "mat", "csv", "fmu", "c"])
def test_nothing_is_written_over_the_input_or_into_nowhere(suffix, tmp_path, capsys):
    path = tmp_path / f"graph.{suffix}"
    shutil.copy(bm.__file__.replace("src/blockmech/__init__.py", "graphs/pump.json"), path)
    before = path.read_bytes()
    assert main(["export", str(path), "-o", str(path)]) == 2
    assert path.read_bytes() == before
    assert main(["export", "pump", "-o", str(tmp_path / "no" / f"x.{suffix}")]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_a_missing_package_is_named_with_its_extra(monkeypatch, tmp_path):
    import sys

    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(bm.MissingEngineError, match=r'pip install "blockmech\[office\]"'):
        bm.write(mechanism("pump"), tmp_path / "a.xlsx")


def test_a_package_adds_formats_and_replaces_none_that_is_built_in(monkeypatch):
    modules = {"csv": "no_such_module:WRITER", "other": "blockmech.exchange.tables:JSON"}
    points = [metadata.EntryPoint(key, x, "blockmech.writers") for key, x in modules.items()]
    scans = []
    monkeypatch.setattr(metadata, "entry_points", lambda group: scans.append(group) or points)
    writers = Formats("blockmech.writers", {"csv": "blockmech.exchange.tables:CSV"})
    assert writers.named("csv", "--to") is CSV
    assert scans == []
    assert list(writers) == ["csv", "other"]
    assert dict(writers) == {"csv": CSV, "other": JSON}


def test_what_cannot_be_imported_is_a_package_only_where_it_is_one(monkeypatch):
    points = [metadata.EntryPoint("other", "no_such_module:WRITER", "blockmech.writers")]
    monkeypatch.setattr(metadata, "entry_points", lambda group: points)
    writers = Formats("blockmech.writers", {"csv": "no_such_module:WRITER"})
    with pytest.raises(ModuleNotFoundError):
        writers["csv"]
    with pytest.raises(RequestError, match=r"broken-plugin.*repair or uninstall it"):
        writers["other"]


def test_a_result_is_written_in_its_units(tmp_path):
    result = mechanism("ruiz_fourbar").run(samples=3, want=["crank.drive", "dyad.C.p"])
    bm.write(result.to("mm", "deg"), tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text("utf-8") == result.to("mm", "deg").to_csv()
    openpyxl = pytest.importorskip("openpyxl", reason="the extra office")
    bm.write(result.to("mm"), tmp_path / "run.xlsx")
    book = openpyxl.load_workbook(tmp_path / "run.xlsx")
    units = {name.value: unit.value for name, unit in zip(*book["results"]["1:2"], strict=True)}
    assert units["dyad.C.p.x"] == "mm"
    with pytest.raises(bm.RequestError, match=r'no option "units".*none.*\.to\("mm"'):
        bm.write(mechanism("ruiz_fourbar"), tmp_path / "run.csv", units=["mm"])
