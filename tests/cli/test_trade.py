"""``blockmech trade`` on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from blockmech.cli import main
from tests.gallery import GRAPHS

pytestmark = pytest.mark.usefixtures("one_repeat")
RUIZ, CRANK = str(GRAPHS / "ruiz_fourbar.json"), str(GRAPHS / "slider_crank.json")
QUICK = ("--samples", "51", "--budget", "5s")


def test_a_trade_is_printed_with_its_recommendation(capsys) -> None:
    assert main(["trade", RUIZ, "--target", "1e-6", *QUICK]) == 0
    text = capsys.readouterr().out
    assert "ruiz_fourbar, run: 100 outputs at 51 samples" in text
    assert "the floor" in text
    assert text.strip().splitlines()[-1].startswith("for 1e-6, ")


def test_a_trade_is_json(capsys) -> None:
    assert main(["trade", CRANK, "--json", *QUICK]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["format"] == "blockmech/trade"
    assert data["points"]
    assert data["recommended"]


def test_a_folder_gets_table_data_and_picture(tmp_path: Path, capsys) -> None:
    out = tmp_path / "trade"
    assert main(["trade", CRANK, "--out", str(out), *QUICK]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["trade.csv", "trade.json", "trade.png"]
    assert "wrote" in capsys.readouterr().out


def test_requests_are_compared(capsys) -> None:
    call = ["trade", RUIZ, "--want", "crank.drive", "--want", "*.p,*.v", *QUICK]
    assert main(call) == 0
    text = capsys.readouterr().out
    assert "requests compared" in text
    assert "run: crank.drive at 51 samples: " in text.split("requests compared")[1]


def test_run_to_an_accuracy_says_what_was_chosen(capsys) -> None:
    call = ["run", RUIZ, "--accuracy", "1e-6", "--want", "crank.drive", "--samples", "5"]
    assert main(call) == 0
    assert "accuracy 1e-06: friction successive" in capsys.readouterr().err
    assert main([*call, "--friction", "none"]) == 2
    assert "give the accuracy or the setting" in capsys.readouterr().err
