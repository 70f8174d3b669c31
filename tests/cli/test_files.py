"""``check``, ``verify``, ``draw`` and ``new``: commands about a graph file."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.cli.new import gallery
from blockmech.testing.files import LEFT_OUT


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


def test_check_gives_facts_as_data(call, ruiz):
    said = call("check", ruiz, "--json")
    assert (said.code, said.err) == (0, "")
    assert json.loads(said.out) == {
        "file": str(ruiz),
        "ok": True,
        "graph": "ruiz_fourbar",
        "links": 3,
        "pairs": 4,
        "mobility": 1,
        "formula": "I(crank: 0,1) -> II RRR(dyad: 2,3)",
        "problems": [],
    }


def test_check_names_all_problems_at_once(call, ruiz, tmp_path):
    file = spoiled(ruiz, tmp_path / "bad.json", two_mistakes)
    said = call("check", file)
    assert said.code == 2
    assert said.out == ""
    for part in ("[unwired-joint]", "crank.A", "[unknown-joint]", "dyad.BB"):
        assert part in said.err
    data = call("check", file, "--json")
    assert data.code == 2
    assert data.err == ""
    found = json.loads(data.out)
    assert found["ok"] is False
    assert {(p["code"], p["where"]) for p in found["problems"]} >= {
        ("unwired-joint", "crank.A"),
        ("unwired-joint", "dyad.B"),
    }
    assert "\n".join(str(bm.Problem(**p)) for p in found["problems"]) + "\n" == said.err


# -- verify --------------------------------------------------------------------------------


def test_verify_shows_every_check(call, ruiz):
    said = call("verify", ruiz)
    assert (said.code, said.err) == (0, "")
    assert said.out == str(bm.Graph.load(ruiz).compile().verify()) + "\n"
    assert "two routes to crank.drive" in said.out


def test_verify_gives_its_rows_as_data(call, ruiz):
    said = call("verify", ruiz, "--at", "1,2", "--json")
    found = json.loads(said.out)
    assert (said.code, found["ok"]) == (0, True)
    rows = bm.Graph.load(ruiz).compile().verify(at=[1.0, 2.0]).rows
    assert found["rows"] == [
        {"name": r.name, "value": r.value, "allowed": r.allowed, "ok": r.ok} for r in rows
    ]


# -- new -----------------------------------------------------------------------------------


def test_new_copies_a_graph_of_the_gallery(call, tmp_path):
    target = tmp_path / "mine.json"
    assert call("new", "ruiz_fourbar", target) == (0, f"wrote {target}\n", "")
    assert target.read_bytes() == gallery()["ruiz_fourbar"].read_bytes()
    assert call("check", target).code == 0


def test_new_alone_lists_the_gallery(call):
    said = call("new")
    assert said.code == 0
    assert said.out.split() == list(gallery())
    assert "ruiz_fourbar" in said.out.split()


def test_the_wheel_leaves_out_what_the_gallery_leaves_out():
    root = Path(__file__).resolve().parents[2]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["exclude"] == [f"graphs/{name}" for name in LEFT_OUT]
    assert wheel["sources"]["graphs"] == "blockmech/graphs"  # where `gallery` looks


def test_new_keeps_an_existing_file_unless_forced(call, tmp_path):
    target = tmp_path / "mine.json"
    target.write_text("mine", encoding="utf-8")
    said = call("new", "ruiz_fourbar", target)
    assert said.code == 2
    assert "the file exists" in said.err
    assert target.read_text(encoding="utf-8") == "mine"
    assert call("new", "ruiz_fourbar", target, "--force").code == 0
    assert json.loads(target.read_text(encoding="utf-8"))["name"] == "ruiz_fourbar"


# -- draw ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "name", "start"),
    [
        ([], "x.svg", b"<?xml"),
        (["--kind", "diagram"], "x.png", b"\x89PNG"),
        (["--kind", "mechanism"], "x.pdf", b"%PDF"),
        (["--kind", "mechanism", "--at", "0,60deg"], "x.svg", b"<?xml"),
        (["--kind", "animation", "--at", "0:360deg:6"], "x.gif", b"GIF89a"),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else None,
)
def test_draw_writes_a_picture_of_the_kind_that_the_name_says(
    call, ruiz, tmp_path, words, name, start
):
    said = call("draw", ruiz, "-o", tmp_path / name, *words)
    assert said == (0, f"wrote {tmp_path / name}\n", "")
    assert (tmp_path / name).read_bytes().startswith(start)
