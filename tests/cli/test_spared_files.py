"""No output takes the place of the file that a command reads, and none stays beside another's."""

from __future__ import annotations

import json
import os

import pytest

import blockmech as bm
from blockmech.cli.output import NUMBERS, PICTURES
from blockmech.draw import run_pictures
from blockmech.draw.simulation import simulation_pictures
from tests.gallery import GRAPHS, mechanism

WRITERS = {
    "a folder of numbers": (["run", "IN", "--samples", "3", "--out", "DIR"], "result.json"),
    "a table": (["run", "IN", "--samples", "3", "--csv", "DIR/x.csv"], "x.csv"),
    "a plot": (["run", "IN", "--samples", "3", "--plot", "DIR/x.png"], "x.png"),
    "a motion": (["simulate", "IN", "--until", "time=0.1", "--out", "DIR"], "results.csv"),
    "pictures of a motion": (
        ["simulate", "IN", "--until", "time=0.1", "--out", "DIR"],
        "phase.png",
    ),
    "a trade": (["trade", "IN", "--budget", "0.1s", "--out", "DIR"], "trade.json"),
    "a trade's picture": (["trade", "IN", "--budget", "0.1s", "--plot", "DIR/x.png"], "x.png"),
    "a diagram": (["draw", "IN", "-o", "DIR/x.svg"], "x.svg"),
    "an animation": (["draw", "IN", "-o", "DIR/x.gif", "--at", "0:1:3"], "x.gif"),
    "blocks": (["decompose", "IN", "-o", "DIR/x.json"], "x.json"),
}


@pytest.mark.parametrize("link", ["itself", "another spelling", os.symlink, os.link])
@pytest.mark.parametrize("name", WRITERS)
def test_no_writer_takes_the_place_of_the_input(call, tmp_path, name, link):
    arguments, target = WRITERS[name]
    folder = tmp_path / "out"
    folder.mkdir()
    output = folder / target
    source = tmp_path / "in.json" if callable(link) else output
    kind = "joints" if arguments[0] == "decompose" else ""
    text = (GRAPHS / kind / "watt_sixbar.json").read_bytes()
    source.write_bytes(text)
    if callable(link):
        link(source, output)
    into = os.path.join(tmp_path, "out", "..", "out") if link == "another spelling" else str(folder)
    outcome = call(*(w.replace("IN", str(source)).replace("DIR", into) for w in arguments))
    assert outcome.code == 2
    assert (
        f"[cannot-write] {os.path.join(into, target)}: it is the file that is read" in outcome.err
    )
    assert outcome.err.count("\n") == 1
    assert source.read_bytes() == output.read_bytes() == text
    assert [p.name for p in folder.iterdir()] == [target]


def test_a_library_saves_onto_its_own_file(ruiz):
    g = bm.Graph.load(ruiz)
    g.title = "changed"
    g.save(ruiz)
    assert json.loads(ruiz.read_text("utf-8"))["title"] == "changed"


@pytest.fixture
def unpainted(monkeypatch):
    """Pictures are written without being painted: which files there are is all that is asked."""
    monkeypatch.setattr("blockmech.draw.animation.Animation.gif", b"a film")
    monkeypatch.setattr("blockmech.draw.animation.Animation.html", "a film")
    monkeypatch.setattr("blockmech.figures.paper.rendered", lambda *_: b"a picture")


@pytest.mark.usefixtures("unpainted")
def test_pictures_of_an_earlier_run_do_not_stay_beside_new_numbers(call, ruiz, tmp_path):
    out = tmp_path / "out"
    assert call("run", ruiz, "--samples", "5", "--out", out).code == 0
    assert {p.name for p in out.iterdir()} > {*NUMBERS, "drive.png"}
    (out / "notes.txt").write_text("mine", "utf-8")
    again = call(
        "run", ruiz, "--samples", "5", "--friction", "none", "--want", "*.drive", "--out", out
    )
    assert again.code == 0
    assert {p.name for p in out.iterdir()} == {*NUMBERS, "drive.png", "mechanism.png", "notes.txt"}


@pytest.mark.usefixtures("unpainted")
def test_a_users_own_picture_stays_where_no_run_was_written(call, ruiz, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "energy.png").write_text("mine", "utf-8")
    assert call("run", ruiz, "--samples", "5", "--out", tmp_path / "out").code == 0
    assert (tmp_path / "out" / "energy.png").read_text("utf-8") == "mine"


@pytest.mark.usefixtures("unpainted")
def test_every_picture_of_a_folder_is_known(tmp_path):
    pictures = [
        *run_pictures(mechanism("ruiz_fourbar").run(samples=3), tmp_path),
        *run_pictures(mechanism("ruiz_fourbar").run(samples=3, want="*.p"), tmp_path),
        *simulation_pictures(mechanism("watt_sixbar").simulate("time=0.1"), tmp_path),
    ]
    assert len(pictures) > 7
    assert {path.name for path in pictures} <= set(PICTURES)


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "IN", "--samples", "3", "--csv", "LONG.csv"],
        ["run", "IN", "--samples", "3", "--out", "LONG"],
        ["run", "IN", "--samples", "3", "--plot", "LONG.png"],
        ["draw", "IN", "-o", "LONG.svg"],
        ["new", "ruiz_fourbar", "LONG.json"],
        ["check", "LONG.json"],
    ],
    ids=" ".join,
)
def test_a_name_that_is_too_long_is_one_message(call, ruiz, tmp_path, arguments):
    long = str(tmp_path / ("n" * 300))
    outcome = call(*(w.replace("IN", str(ruiz)).replace("LONG", long) for w in arguments))
    assert outcome.code == 2
    assert "file name too long" in outcome.err
    assert outcome.err.count("\n") == 1


def test_a_name_of_255_letters_is_written(call, ruiz, tmp_path):
    path = tmp_path / ("n" * 251 + ".csv")
    assert call("run", ruiz, "--samples", "3", "--csv", path).code == 0
    assert path.exists()
