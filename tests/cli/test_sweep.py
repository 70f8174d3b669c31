"""``blockmech sweep`` on the command line."""

import csv
import sys

from tests.gallery import GRAPHS

RUIZ = str(GRAPHS / "ruiz_fourbar.json")
WANT = ("--want", "max_abs(crank.drive)", "--want", "min(dyad.margin)", "--samples", "9")


def test_a_sweep_prints_a_table_and_writes_one_with_a_picture(call, tmp_path):
    out, plot = tmp_path / "study.csv", tmp_path / "study.png"
    outcome = call("sweep", RUIZ, "--vary", "dyad.l_i=4:6:5", *WANT, "--out", out, "--plot", plot)
    assert outcome.code == 0
    assert outcome.out.startswith("ruiz_fourbar: 5 designs at 9 poses")
    assert f"wrote {out}\nwrote {plot}\n" in outcome.out
    head, *rows = csv.reader(out.read_text("utf-8").splitlines())
    assert head == ["dyad.l_i [m]", "max_abs(crank.drive) [N m]", "min(dyad.margin) [-]", "status"]
    assert [row[0] for row in rows] == ["4.0", "4.5", "5.0", "5.5", "6.0"]
    assert rows[0][-1].startswith("no-assembly at dyad")
    assert rows[-1][-1] == "ok"
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_tables_and_pictures_of_designs_are_in_the_units_of_choice(call, tmp_path):
    out, plot = tmp_path / "study.csv", tmp_path / "study.svg"
    options = ("--unit", "mm,kN m", "--out", out, "--plot", plot)
    outcome = call("sweep", RUIZ, "--vary", "dyad.l_i=4:6:5", *WANT, *options)
    assert "dyad.l_i [mm]  max_abs(crank.drive) [kN m]" in outcome.out
    head, *rows = csv.reader(out.read_text("utf-8").splitlines())
    assert head[:2] == ["dyad.l_i [mm]", "max_abs(crank.drive) [kN m]"]
    assert [float(row[0]) for row in rows] == [4e3, 4.5e3, 5e3, 5.5e3, 6e3]
    assert "dyad.l_i [mm]" in plot.read_text("utf-8")


def test_numbers_scatter_by_distributions(call):
    options = ("--vary", "dyad.l_i=normal(6000mm,10mm)", "--vary", "frame.D.x=uniform(5.4,5.6)")
    outcome = call("sweep", RUIZ, *options, *WANT, "--count", "32", "--sampling", "sobol")
    assert outcome.code == 0
    assert "12 of 32 designs shown" in outcome.out


def test_a_folder_takes_parts_and_workers_do_them(call, tmp_path):
    out, options = tmp_path / "parts", ("--vary", "dyad.l_i=5.9:6.1:5")
    alone = call("sweep", RUIZ, *options, *WANT)
    parted = call("sweep", RUIZ, *options, *WANT, "--out", out, "--workers", "1")
    assert parted.code == 0
    assert parted.out == f"{alone.out}wrote {out}\n"
    assert len(list(out.glob("*.parquet"))) == 1
    refused = call("sweep", RUIZ, "--vary", "dyad.l_i=5", *WANT, "--out", out)
    assert refused.code == 2
    assert "parts of another question" in refused.err


def test_without_pyarrow_the_extra_is_named(call, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    outcome = call("sweep", RUIZ, "--vary", "dyad.l_i=6", *WANT, "--out", tmp_path / "a.parquet")
    assert outcome.code == 2
    assert 'pip install "blockmech[study]"' in outcome.err
