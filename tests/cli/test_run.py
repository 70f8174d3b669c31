"""``blockmech run``: the same numbers as Python, and files written whole or not at all."""

from __future__ import annotations

import csv
import json
import math
import os

import numpy as np
import pytest

import blockmech as bm
from blockmech.result.tables import table

DEGREES = math.pi / 180


def computed(file, **request):
    """What Python computes, as JSON data."""
    return bm.Graph.load(file).compile().run(on_gap="mark", **request).to_dict()


def test_run_alone_prints_a_table_and_writes_nothing(call, ruiz, tmp_path):
    outcome = call("run", ruiz)
    assert outcome.code == 0
    assert outcome.out == table(bm.Graph.load(ruiz).run()) + "\n"
    assert outcome.err == ""
    assert os.listdir(tmp_path) == ["ruiz.json"]


def test_run_alone_computes_what_it_prints(call, ruiz, monkeypatch):
    expected = []
    monkeypatch.setattr(
        "blockmech.cli.output.table",
        lambda result, of, **settings: expected.append((len(result), len(of))) or "",
    )
    assert [call("run", ruiz).code, call("run", ruiz, "--want", "*").code] == [0, 0]
    (few, named), (all_, _) = expected
    assert few < 0.25 * named
    assert named == all_ == len(bm.Graph.load(ruiz).compile().outputs)


REQUESTS = [
    ([], {}),
    (["--at", "0,1,60deg"], {"at": [0.0, 1.0, 60 * DEGREES]}),
    (["--at", "crank=1e0rad"], {"at": [1.0]}),
    (["--at", "0:90deg:4"], {"at": np.linspace(0, 90 * DEGREES, 4)}),
    (["--at", "0..90deg", "--samples", "4"], {"at": np.linspace(0, 90 * DEGREES, 4)}),
    (["--at", "5,0:2:3"], {"at": [5.0, 0.0, 1.0, 2.0]}),
    (["--times", "0:0.5:11"], {"times": np.linspace(0, 0.5, 11)}),
    (["--times", "0.1s,200ms"], {"times": [0.1, 0.2]}),
    (["--engine", "scalar"], {"engine": "scalar"}),
    (["--friction", "single"], {"friction": "single"}),
    (
        ["--friction", "successive", "--iterations", "2"],
        {"friction": bm.friction.Successive(iterations=2)},
    ),
    (
        ["--friction", "successive", "--tolerance", "1e-9"],
        {"friction": bm.friction.Successive(tolerance=1e-9)},
    ),
    (["--friction", "successive"], {"friction": "successive"}),
    (["--want", "crank.drive,*.reaction"], {"want": ["crank.drive", "*.reaction"]}),
    (["--want", "dyad.C.p", "--want", "dyad.margin"], {"want": ["dyad.C.p", "dyad.margin"]}),
    (["--static"], {"static": True}),
    (["--engine", "scalar", "--samples", "3"], {"engine": "scalar", "samples": 3}),
    (
        ["--precision", "complex64", "--samples", "3"],
        {"precision": "complex64", "samples": 3},
    ),
]


@pytest.mark.parametrize(("arguments", "request_"), REQUESTS, ids=lambda x: " ".join(x))
def test_json_equals_the_run_in_python(call, ruiz, arguments, request_):
    outcome = call("run", ruiz, "--json", *arguments)
    assert (outcome.code, outcome.err) == (0, "")
    assert json.loads(outcome.out) == computed(ruiz, **request_)


def test_several_drivers_are_given_by_name(call, fivebar):
    outcome = call("run", fivebar, "--at", "right=2,2.5", "--at", "left=20deg", "--json")
    assert outcome.code == 0
    at = {"left": [20 * DEGREES], "right": [2.0, 2.5]}
    assert json.loads(outcome.out) == computed(fivebar, at=at)


@pytest.mark.parametrize("text", ["0.1", "0.1m", "100mm"])
def test_a_slide_is_given_in_metres(call, slide, text):
    outcome = call("run", slide, "--at", text, "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out) == computed(slide, at=[0.1])


# -- gaps ------------------------------------------------------------------------------


def test_a_sample_without_an_answer_gives_exit_code_1_and_the_rest(call, short):
    outcome = call("run", short, "--at", "0.3,3,6", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out) == computed(short, at=[0.3, 3.0, 6.0])
    assert "no answer at 1 of 3 samples" in outcome.err
    assert "no-assembly at dyad, 1 sample: crank.q = 3 rad" in outcome.err


def test_gaps_can_be_refused_and_then_nothing_is_written(call, short, tmp_path):
    outcome = call("run", short, "--on-gap", "raise", "--csv", tmp_path / "x.csv")
    assert outcome.code == 1
    assert outcome.out == ""
    assert outcome.err.startswith("[no-assembly] dyad at crank.q = ")
    assert "Traceback" not in outcome.err
    assert os.listdir(tmp_path) == ["short.json"]


def test_a_run_can_stop_before_the_first_gap(call, short):
    outcome = call("run", short, "--at", "0.3,0.4,3,6", "--on-gap", "stop", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out) == computed(short, at=[0.3, 0.4])
    assert "no answer at 1 of 4 samples" in outcome.err


# -- files ------------------------------------------------------------------------------


def test_csv_is_that_of_python(call, ruiz, tmp_path):
    outcome = call("run", ruiz, "--samples", "9", "--csv", tmp_path / "x.csv")
    assert outcome.code == 0
    assert outcome.out.splitlines()[-1] == f"wrote {tmp_path / 'x.csv'}"
    text = bm.Graph.load(ruiz).run(samples=9).to_csv()
    assert (tmp_path / "x.csv").read_bytes() == text.encode()
    assert call("run", ruiz, "--samples", "9", "--csv", "-").out == text


def test_csv_can_be_spelled_for_other_spreadsheets(call, ruiz):
    arguments = ("--at", "1", "--want", "crank.drive", "--csv", "-")
    outcome = call("run", ruiz, *arguments, "--separator", ";", "--decimal", ",")
    assert outcome.out.splitlines() == [
        "crank.q [rad];time [s];crank.drive [N m];status",
        f"1,0;0,1;{bm.Graph.load(ruiz).run(at=1)['crank.drive'][0]};ok".replace(".", ","),
    ]
    outcome = call("run", ruiz, *arguments, "--separator", "tab")
    assert outcome.out.splitlines()[0].split("\t")[-1] == "status"


def test_degrees_are_named_in_the_units(call, ruiz):
    command = ("run", ruiz, "--at", "90deg", "--want", "dyad.i.angle", "--deg")
    assert "[deg]" in call(*command).out
    head, row = csv.reader(call(*command, "--csv", "-").out.splitlines())
    angle = bm.Graph.load(ruiz).run(at=math.pi / 2)["dyad.i.angle"][0]
    assert dict(zip(head, row, strict=True)) == {
        "crank.q [deg]": "90.0",
        "time [s]": repr(math.pi / 20),
        "dyad.i.angle [deg]": repr(float(f"{math.degrees(angle):.15g}")),
        "status": "ok",
    }


@pytest.mark.parametrize(
    ("bare", "written"),
    [
        ("0,60,120", "0,60deg,120deg"),
        ("0:360:5", "0:360deg:5"),
        ("0..360", "0..360deg"),
        ("1/2,1rad", "1/2deg,1rad"),
    ],
)
def test_coordinates_without_a_unit_are_degrees_where_angles_are(call, ruiz, bare, written):
    rest = ("--want", "crank.drive", "--deg", "--samples", "5", "--csv", "-")
    command = ("run", ruiz, "--at")
    rest = rest if ".." in bare else (*rest[:3], *rest[5:])
    assert call(*command, bare, *rest).out == call(*command, written, *rest).out
    assert call(*command, bare, *rest).err == ""


@pytest.mark.parametrize("option", ["--csv", "--plot", "--out"])
def test_a_place_that_cannot_be_written_leaves_nothing(call, ruiz, tmp_path, option):
    (tmp_path / "file").write_text("old", encoding="utf-8")
    path = {"--out": "file", "--csv": "missing/x.csv"}.get(option, "missing/x.svg")
    outcome = call("run", ruiz, "--samples", "9", option, tmp_path / path)
    assert outcome.code == 2
    assert outcome.out == ""
    assert outcome.err.startswith("[cannot-write]")
    assert str(tmp_path / path) in outcome.err
    assert outcome.err.count("\n") == 1
    assert sorted(os.listdir(tmp_path)) == ["file", "ruiz.json"]
    assert (tmp_path / "file").read_text(encoding="utf-8") == "old"


def test_out_writes_a_folder_of_results_and_pictures(call, ruiz, tmp_path):
    outcome = call("run", ruiz, "--samples", "25", "--out", tmp_path / "new" / "ruiz")
    assert outcome.code == 0
    target = tmp_path / "new" / "ruiz"
    names = sorted(os.listdir(target))
    assert {"results.csv", "result.json"} < set(names)
    assert [line for line in outcome.out.splitlines() if line.startswith("wrote ")] == [
        f"wrote {target / name}" for name in names
    ]
    result = bm.Graph.load(ruiz).run(samples=25)
    assert json.loads((target / "result.json").read_text(encoding="utf-8")) == result.to_dict()
    assert (target / "results.csv").read_text(encoding="utf-8") == result.to_csv()
    pictures = [name for name in names if not name.startswith("result")]
    assert pictures
    assert all((target / name).stat().st_size > 1000 for name in pictures)


# -- the call is wrong --------------------------------------------------------------------


def test_a_driver_without_a_law_asks_for_samples(call, fivebar):
    outcome = call("run", fivebar)
    assert outcome.code == 2
    assert "[no-law] scene.drive.left" in outcome.err
    assert "[no-law] scene.drive.right" in outcome.err


def test_explain_shows_the_plan_and_computes_nothing(call, ruiz):
    outcome = call("run", ruiz, "--explain", "--want", "dyad.C.p")
    assert outcome.code == 0
    assert outcome.out == bm.Graph.load(ruiz).compile().explain("dyad.C.p") + "\n"
    assert outcome.out.startswith("2 kernel calls for 1 output")


def test_run_does_not_write_over_the_file_that_it_reads(call, ruiz):
    before = ruiz.read_bytes()
    outcome = call("run", ruiz, "--csv", ruiz)
    assert outcome.code == 2
    assert "it is the file that is read" in outcome.err
    assert ruiz.read_bytes() == before


def test_tables_are_in_the_units_of_choice(call, ruiz):
    head = call("run", ruiz, "--csv", "-", "--unit", "mm,kN", "--unit", "deg").out.split("\n")[0]
    assert {"crank.q [deg]", "dyad.C.p.x [mm]", "dyad.C.reaction.y [kN]"} <= {*head.split(",")}
    assert " mm" in call("extremes", ruiz, "dyad.C.p.x", "--unit", "mm").out
    for wrong in (["--unit", "furlong"], ["--unit", "mm", "--json"]):
        assert call("run", ruiz, *wrong).code == 2
