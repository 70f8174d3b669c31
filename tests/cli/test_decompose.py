"""``decompose``, and ``check`` and ``run`` of a wrong file of links and joints."""

from __future__ import annotations

import json

import numpy as np
import pytest

import blockmech as bm
from tests.model.documents import linkage, slider_crank
from tests.model.joints.machines import pin


@pytest.fixture
def joints(tmp_path):
    """A file of a slider-crank as links and joints."""
    path = tmp_path / "crank.json"
    linkage(slider_crank()).save(path)
    return path


def test_decompose_prints_the_formula_and_what_became_of_links_and_joints(call, joints):
    outcome = call("decompose", joints)
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[:2] == [
        "slider_crank: I(crank) -> II RRP(rod, piston)",
        "3 moving links, 4 pairs, mobility 1",
    ]
    rows = [line.split() for line in lines]
    for row in (
        ["crank", "motor.crank"],
        ["rod", "rod_piston.i"],
        ["piston", "rod_piston.j"],
        ["A", "rod_piston.B", "R"],
        ["S", "rod_piston.S", "P"],
        ["motor", "motor.A", "motor.q"],
    ):
        assert row in rows


def test_decompose_writes_a_graph_that_computes_the_same(call, joints, tmp_path):
    graph = tmp_path / "graph.json"
    outcome = call("decompose", joints, "-o", graph)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.splitlines()[-1] == f"wrote {graph}"
    assert call("check", graph).code == 0
    result = bm.Graph.load(graph).run(samples=7)
    expected = bm.Linkage.load(joints).run(samples=7)
    assert np.array_equal(result["motor.drive"], expected["driver.motor.drive"])
    assert np.array_equal(result["rod_piston.S.N"], expected["joint.S.N"])


@pytest.mark.parametrize("general", ["groups", "one"])
def test_decompose_makes_general_groups_where_they_are_asked_for(call, joints, tmp_path, general):
    graph = tmp_path / "graph.json"
    outcome = call("decompose", joints, "--general", general, "-o", graph)
    assert (outcome.code, outcome.err) == (0, "")
    blocks = json.loads(graph.read_text(encoding="utf-8"))["blocks"]
    types = {block["type"] for block in blocks.values()}
    assert types == {"frame", "driver.crank", "group.general", "load.force"}


def test_decompose_gives_data(call, joints):
    outcome = call("decompose", joints, "--json")
    document = json.loads(outcome.out)
    assert document["formation"] == "I(crank) -> II RRP(rod, piston)"
    assert document["links"]["rod"] == "rod_piston.i"
    assert document["joints"]["S"] == {"pairs": ["rod_piston.S"], "turned": False}
    assert document["drivers"]["motor"] == {"joint": "motor.A", "sign": 1, "offset": 0.0}
    assert document["mobility"] == 1


def test_decompose_writes_nothing_where_the_links_are_no_mechanism(call, joints, tmp_path):
    document = slider_crank()
    document["joints"]["X"] = pin("frame", "rod", (0.2, 0.1), (0.13, 0.06))  # holds the rod
    joints.write_text(json.dumps(document), encoding="utf-8")
    outcome = call("decompose", joints, "-o", tmp_path / "graph.json")
    assert outcome.code == 2
    assert str(joints) in outcome.err
    assert "rod" in outcome.err
    assert "Traceback" not in outcome.err
    assert not (tmp_path / "graph.json").exists()


def test_check_tells_the_formation_sequence_and_the_mobility(call, joints):
    outcome = call("check", joints)
    assert "I(crank) -> II RRP(rod, piston)" in outcome.out
    facts = json.loads(call("check", joints, "--json").out)
    assert facts["formula"] == "I(crank) -> II RRP(rod, piston)"
    assert (facts["links"], facts["pairs"], facts["mobility"], facts["ok"]) == (3, 4, 1, True)


def test_a_slip_in_the_document_is_one_clear_message(call, joints):
    document = json.loads(joints.read_text(encoding="utf-8"))
    document["joints"]["A"]["links"][1] = "rodd"
    joints.write_text(json.dumps(document), encoding="utf-8")
    for command in ("check", "decompose", "run"):
        outcome = call(command, joints)
        assert outcome.code == 2
        assert "joints.A.links[1]" in outcome.err
        assert '"rod"' in outcome.err
