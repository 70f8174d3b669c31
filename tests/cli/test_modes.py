"""``blockmech modes``: the modes that Python finds, as text and as JSON."""

from __future__ import annotations

import json

import pytest

import blockmech as bm
from tests.modes import machines


def found(file, *at, **more):
    """What Python finds."""
    return bm.Graph.load(file).compile().modes(*at, **more)


@pytest.fixture
def triad(tmp_path):
    """A file of a crank and a triad."""
    path = tmp_path / "triad.json"
    path.write_text(json.dumps(machines.overturned()), encoding="utf-8")
    return path


def test_modes_prints_branches_arcs_and_what_merges(call, short):
    said = call("modes", short)
    assert said.code == 0
    assert said.out == f"{found(short)}\n"
    assert '"branch": -1' in said.out
    assert "no mode: it cannot close" in call("modes", short, "--at", "90deg").out
    assert "merges with arc 2" in said.out


def test_modes_as_json_are_those_of_python(call, triad):
    told = json.loads(call("modes", triad, "--at", "2.8,5", "--json").out)
    assert told == {"file": str(triad), **found(triad, [2.8, 5.0]).to_dict()}
    homes = [m["put"]["home"]["drivers"] for m in told["groups"][0]["samples"][0]]
    assert homes == [{"crank": 2.8}] * 4


def test_all_drivers_that_stand_nowhere_are_told(call, fivebar):
    assert call("modes", fivebar).err.count("nothing says where this driver stands") == 2
