"""What the analyses answer on the command line: the text and the data that Python gives."""

from __future__ import annotations

import json

import pytest

import blockmech as bm
from tests.modes import machines

TEXTS = {
    "verify RUIZ": lambda m: str(m.verify()),
    "limits SHORT": lambda m: str(m.limits()),
    "limits SHORT --deg": lambda m: m.limits().text(degrees=True),
    "modes SHORT": lambda m: str(m.modes()),
    "equilibria RUIZ": lambda m: str(m.equilibria()),
    "equilibria RUIZ --friction none --deg": lambda m: m.equilibria(friction="none").text(
        degrees=True
    ),
    "linearize RUIZ --at 1 --rates 10": lambda m: str(m.linearize(1.0, rates=10.0)),
    "balance RUIZ --numbers dyad.links.j.mass --want crank.drive --at 0,1,2": lambda m: str(
        bm.design.balance(m, "dyad.links.j.mass", "crank.drive", at=[0.0, 1.0, 2.0])
    ),
    "extremes RUIZ crank.q --deg": lambda m: m.extremes("crank.q").text(degrees=True),
    "extremes RUIZ dyad.j.angle --stroke": lambda m: str(m.stroke("dyad.j.angle")),
}


def rows(found):
    """The rows of a verification as data."""
    return [{k: getattr(r, k) for k in ("name", "value", "allowed", "ok")} for r in found.rows]


def patterned(ask, outputs):
    """Answers for the outputs that have one, as data."""
    found = []
    for name in outputs:
        try:
            found.append(ask(name).to_dict())
        except bm.RequestError:
            continue  # not every output has a stroke
    return json.loads(json.dumps(found))


DATA = {
    "verify RUIZ --at 1,2": ("rows", lambda m: rows(m.verify(at=[1.0, 2.0]))),
    "modes TRIAD --at 2.8,5": ("groups", lambda m: m.modes([2.8, 5.0]).to_dict()["groups"]),
    "equilibria RUIZ": (
        "equilibria",
        lambda m: json.loads(json.dumps(m.equilibria().to_dict()["equilibria"])),
    ),
    "extremes RUIZ crank.[qr]*": (
        "extremes",
        lambda m: patterned(m.extremes, ["crank.q", "crank.rate"]),
    ),
    "extremes RUIZ crank.[Bq]* --stroke": (
        "strokes",
        lambda m: patterned(m.stroke, m.outputs.match(["crank.[Bq]*"])),
    ),
}


@pytest.fixture
def ask(call, ruiz, short, tmp_path):
    """``ask("limits SHORT")``: what the command says, and the mechanism of its file."""
    triad = tmp_path / "triad.json"
    triad.write_text(json.dumps(machines.overturned()), encoding="utf-8")
    files = {"RUIZ": ruiz, "SHORT": short, "TRIAD": triad}

    def asking(words):
        command, file, *more = words.split()
        return call(command, files[file], *more), bm.Graph.load(files[file]).compile()

    return asking


@pytest.mark.parametrize("words", TEXTS)
def test_the_text_is_that_of_python(ask, words):
    said, mechanism = ask(words)
    assert said == (0, f"{TEXTS[words](mechanism)}\n", "")


@pytest.mark.parametrize("words", DATA)
def test_the_data_are_those_of_python(ask, words):
    said, mechanism = ask(f"{words} --json")
    key, find = DATA[words]
    assert said.code == 0
    assert json.loads(said.out)[key] == find(mechanism) != []


def test_modes_say_what_merges_and_where_there_is_none(ask):
    assert "merges with arc 2" in ask("modes SHORT")[0].out
    assert "no mode: it cannot close" in ask("modes SHORT --at 90deg")[0].out


def test_each_driver_is_moved_with_the_others_held(call, fivebar):
    outcome = call("limits", fivebar, "--at", "left=0", "--at", "right=60deg", "--json")
    told = json.loads(outcome.out)["limits"]
    assert [t["driver"] for t in told] == ["left.q", "right.q"]
    assert told[1]["held"] == {"left.q": 0.0}
    one = call("limits", fivebar, "--driver", "right", "--at", "left=0", "--json")
    assert json.loads(one.out)["limits"] == told[1:]


def test_all_drivers_that_stand_nowhere_are_told(call, fivebar):
    assert call("modes", fivebar).err.count("nothing says where this driver stands") == 2


def test_a_pattern_is_for_the_command_line(ruiz):
    with pytest.raises(bm.RequestError, match="it is a pattern, which 28 outputs fit"):
        bm.Graph.load(ruiz).compile().extremes("crank.*")


def test_sensitivities_are_ranked_and_leave_as_data_picture_and_table(call, ruiz, tmp_path):
    words = ["sensitivity", ruiz, "--want", "crank.drive,dyad.C.p", "--at", "0:360deg:13"]
    lines = call(*words, "--to", "dyad.l_*,crank.q").out.splitlines()
    assert lines[0] == "crank.drive [N m]"
    assert [line.split()[0] for line in lines[2:5]] == ["crank.q", "dyad.l_i", "dyad.l_j"]
    data = json.loads(call(*words, "--to", "dyad.l_i", "--json").out)
    (row,) = data["sensitivity"]["crank.drive"]
    assert (row["number"], row["unit"]) == ("dyad.l_i", "N m/m")
    picture, table = tmp_path / "s.png", tmp_path / "s.csv"
    said = [call(*words, "--plot", picture), call(*words, "--csv", table)]
    assert all("wrote" in one.out for one in said)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert table.read_text("utf-8").startswith("output,unit,crank.q [rad],")
