"""What the analyses answer on the command line: the text and the data that Python gives."""

from __future__ import annotations

import json

import pytest

import blockmech as bm
from tests.modes import machines

TEXTS = {
    "verify RUIZ": lambda m: str(m.verify()),
    "limits SHORT": lambda m: str(m.limits()),
    "limits SHORT --deg": lambda m: m.limits().to("deg").text(),
    "modes SHORT": lambda m: str(m.modes()),
    "equilibria RUIZ": lambda m: str(m.equilibria()),
    "equilibria RUIZ --friction none --deg": lambda m: str(m.equilibria(friction="none").to("deg")),
    "linearize RUIZ --at 1 --rates 10": lambda m: str(m.linearize(1.0, rates=10.0)),
    "balance RUIZ --numbers dyad.links.j.mass --want crank.drive --at 0,1,2": lambda m: str(
        bm.design.balance(m, "dyad.links.j.mass", "crank.drive", at=[0.0, 1.0, 2.0])
    ),
    "extremes RUIZ crank.q --deg": lambda m: m.extremes("crank.q").to("deg").text(),
    "extremes RUIZ dyad.j.angle --stroke": lambda m: str(m.stroke("dyad.j.angle")),
}


def rows(report):
    """The rows of a verification as data."""
    return [{k: getattr(r, k) for k in ("name", "value", "allowed", "ok")} for r in report.rows]


def patterned(ask, outputs):
    """Answers for the outputs that have one, as data."""
    documents = []
    for name in outputs:
        try:
            documents.append(ask(name).to_dict())
        except bm.RequestError:
            continue  # not every output has a stroke
    return json.loads(json.dumps(documents))


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

    def asking(line):
        command, file, *options = line.split()
        return call(command, files[file], *options), bm.Graph.load(files[file]).compile()

    return asking


@pytest.mark.parametrize("line", TEXTS)
def test_the_text_is_that_of_python(ask, line):
    outcome, mechanism = ask(line)
    assert outcome == (0, f"{TEXTS[line](mechanism)}\n", "")


@pytest.mark.parametrize("line", DATA)
def test_the_data_are_those_of_python(ask, line):
    outcome, mechanism = ask(f"{line} --json")
    key, find = DATA[line]
    assert outcome.code == 0
    assert json.loads(outcome.out)[key] == find(mechanism) != []


def test_modes_say_what_merges_and_where_there_is_none(ask):
    assert "merges with arc 2" in ask("modes SHORT")[0].out
    assert "no mode: it cannot close" in ask("modes SHORT --at 90deg")[0].out


def test_each_driver_is_moved_with_the_others_held(call, fivebar):
    outcome = call("limits", fivebar, "--at", "left=0", "--at", "right=60deg", "--json")
    limits = json.loads(outcome.out)["limits"]
    assert [t["driver"] for t in limits] == ["left.q", "right.q"]
    assert limits[1]["held"] == {"left.q": 0.0}
    single = call("limits", fivebar, "--driver", "right", "--at", "left=0", "--json")
    assert json.loads(single.out)["limits"] == limits[1:]


def test_all_drivers_that_stand_nowhere_are_told(call, fivebar):
    assert call("modes", fivebar).err.count("nothing says where this driver stands") == 2


def test_a_pattern_is_for_the_command_line(ruiz):
    with pytest.raises(bm.RequestError, match="it is a pattern, which 28 outputs fit"):
        bm.Graph.load(ruiz).compile().extremes("crank.*")


def test_sensitivities_are_ranked_and_leave_as_data_picture_and_table(call, ruiz, tmp_path):
    arguments = ["sensitivity", ruiz, "--want", "crank.drive,dyad.C.p", "--at", "0:360deg:13"]
    lines = call(*arguments, "--to", "dyad.l_*,crank.q").out.splitlines()
    assert lines[0] == "crank.drive [N m]"
    assert [line.split()[0] for line in lines[2:5]] == ["crank.q", "dyad.l_i", "dyad.l_j"]
    data = json.loads(call(*arguments, "--to", "dyad.l_i", "--json").out)
    (row,) = data["sensitivity"]["crank.drive"]
    assert (row["number"], row["unit"]) == ("dyad.l_i", "N m/m")
    picture, table = tmp_path / "s.png", tmp_path / "s.csv"
    outcomes = [call(*arguments, "--plot", picture), call(*arguments, "--csv", table)]
    assert all("wrote" in outcome.out for outcome in outcomes)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert table.read_text("utf-8").startswith("output,unit,crank.q [rad],")
