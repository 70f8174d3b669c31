"""``check``, ``draw`` and ``new``: commands about a graph file."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.cli.start import gallery
from blockmech.testing.graph_files import LEFT_OUT


def spoiled(file, path, change):
    """A copy of a graph file with a change to its data."""
    data = json.loads(file.read_text(encoding="utf-8"))
    change(data)
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def two_mistakes(data):
    data["wires"].pop(0)
    data["wires"][0]["to"] = "dyad.BB"


# -- check ---------------------------------------------------------------------------------


def test_check_says_in_one_line_what_the_mechanism_is(call, ruiz):
    line = (
        "<Graph ruiz_fourbar: 3 moving links, 4 pairs, mobility 1; "
        "I(crank: 0,1) -> II RRR(dyad: 2,3)>\n"
    )
    assert call("check", ruiz) == (0, line, "")


def test_check_names_all_problems_at_once(call, ruiz, tmp_path):
    file = spoiled(ruiz, tmp_path / "bad.json", two_mistakes)
    outcome = call("check", file)
    assert outcome.code == 2
    assert outcome.out == ""
    for part in ("[unwired-joint]", "crank.A", "[unknown-joint]", "dyad.BB"):
        assert part in outcome.err
    data = call("check", file, "--json")
    assert data.code == 2
    assert data.err == ""
    document = json.loads(data.out)
    assert document["ok"] is False
    assert {(p["code"], p["where"]) for p in document["problems"]} >= {
        ("unwired-joint", "crank.A"),
        ("unwired-joint", "dyad.B"),
    }
    assert "\n".join(str(bm.Problem(**p)) for p in document["problems"]) + "\n" == outcome.err


# -- new -----------------------------------------------------------------------------------


def test_new_copies_a_graph_of_the_gallery(call, tmp_path):
    target = tmp_path / "mine.json"
    assert call("new", "ruiz_fourbar", target) == (0, f"wrote {target}\n", "")
    assert target.read_bytes() == gallery()["ruiz_fourbar"].read_bytes()
    assert call("check", target).code == 0


def test_new_alone_lists_the_gallery(call):
    outcome = call("new")
    assert outcome.code == 0
    assert outcome.out.split() == list(gallery())
    assert "ruiz_fourbar" in outcome.out.split()


def test_the_wheel_leaves_out_what_the_gallery_leaves_out():
    root = Path(__file__).resolve().parents[2]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["exclude"] == [f"graphs/{name}" for name in LEFT_OUT]
    assert wheel["sources"]["graphs"] == "blockmech/graphs"  # where `gallery` looks


def test_new_keeps_an_existing_file_unless_forced(call, tmp_path):
    target = tmp_path / "mine.json"
    target.write_text("mine", encoding="utf-8")
    outcome = call("new", "ruiz_fourbar", target)
    assert outcome.code == 2
    assert "the file exists" in outcome.err
    assert target.read_text(encoding="utf-8") == "mine"
    assert call("new", "ruiz_fourbar", target, "--force").code == 0
    assert json.loads(target.read_text(encoding="utf-8"))["name"] == "ruiz_fourbar"


# -- draw ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "name", "start"),
    [
        ([], "x.svg", b"<?xml"),
        (["--kind", "diagram"], "x.png", b"\x89PNG"),
        (["--kind", "mechanism"], "x.pdf", b"%PDF"),
        (["--kind", "mechanism", "--at", "0,60deg"], "x.svg", b"<?xml"),
        (["--kind", "animation", "--at", "0:360deg:6"], "x.gif", b"GIF89a"),
        (["--at", "0:360deg:6"], "x.mp4", b"\0\0\0 ftypisom"),
        (["--trace", "dyad.C,dyad.B"], "x.svg", b"<?xml"),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else None,
)
def test_draw_writes_a_picture_of_the_kind_that_the_name_says(
    call, ruiz, tmp_path, arguments, name, start
):
    outcome = call("draw", ruiz, "-o", tmp_path / name, *arguments)
    assert outcome == (0, f"wrote {tmp_path / name}\n", "")
    assert (tmp_path / name).read_bytes().startswith(start)


def test_draw_traces_the_markers_that_are_named(call, ruiz, tmp_path):
    pictures = {}
    for traced in ("dyad.C", "dyad.B"):
        call("draw", ruiz, "-o", tmp_path / "x.svg", "--trace", traced)
        pictures[traced] = (tmp_path / "x.svg").read_bytes()
    assert pictures["dyad.C"] != pictures["dyad.B"]
    outcome = call("draw", ruiz, "-o", tmp_path / "x.svg", "--trace", "dyad.X")
    assert outcome.code == 2
    assert "[unknown-marker] dyad.X" in outcome.err
