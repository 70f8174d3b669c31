"""``blockmech sensitivity`` on the command line."""

from __future__ import annotations

import json
from pathlib import Path

from blockmech.cli import main
from tests.gallery import GRAPHS

RUIZ = str(GRAPHS / "ruiz_fourbar.json")
ASKED = ["sensitivity", RUIZ, "--want", "crank.drive,dyad.C.p", "--at", "0:360deg:13"]


def test_numbers_are_ranked(capsys) -> None:
    assert main([*ASKED, "--to", "dyad.l_*,crank.q"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "crank.drive [N m]"
    assert [line.split()[0] for line in lines[2:5]] == ["crank.q", "dyad.l_i", "dyad.l_j"]


def test_derivatives_are_json(capsys) -> None:
    assert main([*ASKED, "--to", "dyad.l_i", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    (row,) = data["sensitivity"]["crank.drive"]
    assert row["number"] == "dyad.l_i"
    assert row["unit"] == "N m/m"


def test_a_picture_and_a_table_are_written(tmp_path: Path, capsys) -> None:
    picture, table = tmp_path / "s.png", tmp_path / "s.csv"
    assert main([*ASKED, "--plot", str(picture)]) == 0
    assert main([*ASKED, "--csv", str(table)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert table.read_text("utf-8").startswith("output,unit,crank.q [rad],")
    assert "wrote" in capsys.readouterr().out
