"""A wrong call of any command is one sentence a mistake, exit code 2, and leaves nothing behind."""

from __future__ import annotations

import os

import pytest

from tests.gallery import GRAPHS

CALLS = {
    "run RUIZ": [
        ("--at abc", '--at abc: "abc" is not a number'),
        ("--at nan", '"nan" is not a number'),
        ("--at 60grad", '"60grad" has another kind of unit'),
        ("--at 0:1", '"0:1" is not a range'),
        ("--at 0:1:0", '"0" is not a count'),
        ("--at arm=1", 'no driver "arm"'),
        ("--at 1 --at crank=2", "crank is given twice"),
        ("--at 1 --samples 3", "name the samples in one way only"),
        ("--samples 0", "--samples"),
        ("--friction Newton", 'no friction method "Newton"'),
        ("--iterations 3", "iterations"),
        ("--friction successive --tolerance nan", "tolerance"),
        ("--want crank.drve", 'did you mean "crank.drive"?'),
        ("--engine quantum", 'no engine "quantum"'),
        ("--precision complex32", "complex32"),
        ("--on-gap skip", "on_gap"),
        ("--json --deg", "JSON results are in SI units"),
        ("--json --csv x.csv", "only one of them"),
        ("--csv - --separator x", "separator"),
        ("--frobnicate", "--frobnicate. there are --at, --samples"),
        ("--unit furlong", 'no unit "furlong"'),
        ("second.json", "second.json"),
    ],
    "simulate WATT": [
        ("--until sometime", "is no stopping condition"),
        ("--method magic", 'no method "magic"'),
        ("--times 1:0", "is not a range"),
        ("--json --plot x.png", "only one of them"),
    ],
    "trade RUIZ": [
        ("--question speed", "questions: run, simulate"),
        ("--budget soon", "is not a number"),
        ("--budget 0s", "budget: must be > 0, got 0"),
        ("--json --plot x.png", "only one of them"),
        ("--want *.p --want *.v --plot x.png", "give --want once"),
        ("--want crank.nothing", "no output has that name"),
        ("--want crank.q --want nosuch", "no output has that name"),
        ("--plot x.xyz", "cannot be written"),
        ("--until time=2", "ask the question simulate"),
        ("--question simulate --samples 5", "ask the question run"),
    ],
    "limits FIVEBAR": [
        ("", "nothing says where this driver is held"),
        ("--at left=0,1", "it names 2 places. give one number"),
    ],
    "limits SHORT": [
        ("--at 1", "this driver is the one that moves"),
        ("--json --deg", "JSON results are in SI units"),
        ("--driver crnk", 'did you mean "crank"?'),
    ],
    "modes SHORT": [
        ("--json --deg", "JSON results are in SI units"),
        ("--group dyd", 'did you mean "dyad"'),
    ],
    "extremes RUIZ": [
        ("dyad.C.q", "[unknown-output] dyad.C.q"),
        ("*.nothing", "*.nothing"),
        ("crank.q --json --deg", "JSON results are in SI units"),
        ("--want crank.q", "[OPTIONS] {FILE} {OUTPUT...}"),
    ],
    "stroke RUIZ": [("", 'did you mean "extremes"?')],
    "animate RUIZ": [("", 'did you mean "draw"?')],
    "conjure RUIZ": [("", "there are run, simulate, check")],
    "outputs RUIZ": [("crank.torque", "[unknown-output] crank.torque"), ("--deg", "--deg")],
    "sweep RUIZ --want max_abs(crank.drive)": [
        ("--vary dyad.l_i", "it names no values"),
        ("--vary dyad.l=6", 'did you mean "dyad.l_i"?'),
        ("--vary dyad.l_i=6 --vary blocks.dyad.l_i=7", "given twice"),
        ("--vary dyad.l_i=normal(6)", "normal has two"),
        ("--vary dyad.l_i=6deg", "has another kind of unit"),
        ("--vary dyad.l_i=6 --out study.xls", "a table is csv or parquet"),
        ("--vary dyad.l_i=6 --plot study.xls", "cannot be written"),
        ("--vary dyad.l_i=-6 --samples 9", "must be > 0 m, got -6"),
        ("--vary dyad.l_i=6 --dask nonsense", "--dask nonsense"),
    ],
    "sensitivity RUIZ --want crank.drive --at 1": [
        ("--to dyad.li", 'did you mean "dyad.l_i"?'),
        ("--to dyad.branch", "a whole number chooses, it does not grow"),
        ("--csv a.csv --json", "only one of them at a time"),
    ],
    "decompose RUIZ": [("", "graph of blocks already")],
    "blocks load.trust": [("", "load.thrust")],
    "schema wires": [("", "wires")],
    "studio RUIZ --no-browser": [("--port 99999", "--port")],
}
ROWS = [(f"{call} {words}", said) for call, rows in CALLS.items() for words, said in rows]


@pytest.mark.parametrize(("arguments", "message"), ROWS, ids=[arguments for arguments, _ in ROWS])
def test_a_wrong_call_is_one_sentence_and_leaves_nothing(
    call, ruiz, short, fivebar, tmp_path, monkeypatch, arguments, message
):
    monkeypatch.chdir(tmp_path)
    files = {"RUIZ": ruiz, "SHORT": short, "FIVEBAR": fivebar, "WATT": GRAPHS / "watt_sixbar.json"}
    before = sorted(os.listdir(tmp_path))
    outcome = call(*(files.get(word, word) for word in arguments.split()))
    assert (outcome.code, outcome.out) == (2, "")
    assert message in outcome.err
    assert "Traceback" not in outcome.err
    assert outcome.err.count("\n") == 1
    assert sorted(os.listdir(tmp_path)) == before
