"""``decompose``, and every other command on a file of links and joints."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import blockmech as bm
from blockmech.export import result_schema
from tests.model.documents import DOCUMENTS, linkage, slider_crank


@pytest.fixture
def joints(tmp_path):
    """A file of a slider-crank as links and joints, that expects two numbers of itself."""
    document = slider_crank()
    document["drivers"]["motor"].update({"from": 0.0, "to": 2 * math.pi})
    document["initial"] = {"motor": {"q": 0.3, "rate": 1.0}}
    document["expect"] = [
        {
            "source": "the crank's own motion, by hand",
            "at": {"motor": [0.0, math.pi / 2]},
            "want": {"link.rod.p": [[0.1, 0.0], [0.0, 0.1]], "driver.motor.rate": [3.0, 3.0]},
            "atol": 1e-12,
        }
    ]
    path = tmp_path / "crank.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.fixture
def locked(tmp_path):
    """A file whose coupler is pinned to the frame as well."""
    document = slider_crank()
    document["joints"]["X"] = {
        "type": "R",
        "links": ["frame", "rod"],
        "at": [[0.2, 0.1], [0.13, 0.06]],
    }
    path = tmp_path / "locked.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


# -- decompose ----------------------------------------------------------------------------


def test_decompose_prints_the_formula_and_what_became_of_links_and_joints(call, joints):
    said = call("decompose", joints)
    assert (said.code, said.err) == (0, "")
    lines = said.out.splitlines()
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
    said = call("decompose", joints, "-o", graph)
    assert (said.code, said.err) == (0, "")
    assert said.out.splitlines()[-1] == f"wrote {graph}"
    assert call("check", graph).code == 0
    one = bm.Graph.load(graph).run(samples=7)
    other = bm.Linkage.load(joints).run(samples=7)
    assert np.array_equal(one["motor.drive"], other["driver.motor.drive"])
    assert np.array_equal(one["rod_piston.S.N"], other["joint.S.N"])


@pytest.mark.parametrize("general", ["groups", "one"])
def test_decompose_makes_general_groups_where_they_are_asked_for(call, joints, tmp_path, general):
    graph = tmp_path / "graph.json"
    said = call("decompose", joints, "--general", general, "-o", graph)
    assert (said.code, said.err) == (0, "")
    blocks = json.loads(graph.read_text(encoding="utf-8"))["blocks"]
    types = {block["type"] for block in blocks.values()}
    assert types == {"frame", "driver.crank", "group.general", "load.force"}


def test_decompose_gives_data(call, joints):
    said = call("decompose", joints, "--json")
    found = json.loads(said.out)
    assert found["formation"] == "I(crank) -> II RRP(rod, piston)"
    assert found["links"]["rod"] == "rod_piston.i"
    assert found["joints"]["S"] == {"pairs": ["rod_piston.S"], "turned": False}
    assert found["drivers"]["motor"] == {"joint": "motor.A", "sign": 1, "offset": 0.0}
    assert found["mobility"] == 1


def test_decompose_writes_nothing_where_the_links_are_no_mechanism(call, locked, tmp_path):
    graph = tmp_path / "graph.json"
    said = call("decompose", locked, "-o", graph)
    assert said.code == 2
    assert str(locked) in said.err
    assert "rod" in said.err
    assert "Traceback" not in said.err
    assert not graph.exists()


# -- check --------------------------------------------------------------------------------


def test_check_tells_the_formation_sequence_and_the_mobility(call, joints):
    said = call("check", joints)
    assert (said.code, said.err) == (0, "")
    assert "I(crank) -> II RRP(rod, piston)" in said.out
    assert "mobility 1" in said.out
    facts = json.loads(call("check", joints, "--json").out)
    assert facts["formula"] == "I(crank) -> II RRP(rod, piston)"
    assert (facts["links"], facts["pairs"], facts["mobility"], facts["ok"]) == (3, 4, 1, True)


def test_a_slip_in_the_document_is_one_clear_message(call, joints):
    document = json.loads(joints.read_text(encoding="utf-8"))
    document["joints"]["A"]["links"][1] = "rodd"
    joints.write_text(json.dumps(document), encoding="utf-8")
    for command in ("check", "decompose", "run"):
        said = call(command, joints)
        assert said.code == 2
        assert "joints.A.links[1]" in said.err
        assert '"rod"' in said.err


# -- the other commands ---------------------------------------------------------------------


def test_run_takes_drivers_and_outputs_by_the_documents_names(call, joints):
    said = call("run", joints, "--at", "motor=0,90deg", "--want", "link.rod.p,joint.S.N", "--json")
    assert (said.code, said.err) == (0, "")
    found = json.loads(said.out)
    Draft202012Validator(result_schema()).validate(found)
    assert found["drivers"] == {"driver.motor.q": [0.0, math.pi / 2]}
    assert set(found["outputs"]) == {"link.rod.p", "joint.S.N"}
    assert (found["outputs"]["joint.S.N"]["by"], found["outputs"]["joint.S.N"]["on"]) == (
        "frame",
        "piston",
    )
    assert set(found["quality"]["margin"]) == {"rod_piston"}


def test_a_gap_names_the_group_with_its_links(call, joints):
    document = json.loads(joints.read_text(encoding="utf-8"))
    document["joints"]["S"]["at"][0] = [0.3, 0.25]  # the guide is out of reach half of the turn
    document["links"]["crank"]["pose"] = [0, 0, 1.5]
    document["links"]["rod"]["pose"] = [0.0, 0.1, 0.6]
    document["links"]["piston"]["pose"] = [0.26, 0.26, 0.1]
    joints.write_text(json.dumps(document), encoding="utf-8")
    said = call("run", joints, "--samples", "9", "--want", "link.piston.p")
    assert said.code == 1
    assert "no-assembly at rod_piston (rod, piston)" in said.out
    assert "driver.motor.q" in said.out


def test_limits_and_extremes_speak_of_the_documents_driver(call, joints):
    said = call("limits", joints)
    assert (said.code, said.out) == (0, "driver.motor.q: turns fully\n")
    said = call("limits", joints, "--driver", "motor", "--json")
    assert json.loads(said.out)["limits"][0]["driver"] == "driver.motor.q"
    said = call("extremes", joints, "link.piston.p.x", "joint.B.reaction")
    assert said.code == 0
    assert "link.piston.p.x  minimum" in said.out
    said = call("extremes", joints, "--stroke", "link.piston.p")
    assert "driver.motor.q" in said.out


@pytest.mark.parametrize("name", ["arm", "boom"])
def test_every_document_runs_and_verifies_from_the_command_line(call, tmp_path, name):
    path = tmp_path / f"{name}.json"
    linkage(DOCUMENTS[name]()).save(path)
    assert call("run", path, "--samples", "5").code == 0
    assert call("verify", path).code == 0
    assert call("draw", path, "-o", tmp_path / "picture.png", "--kind", "mechanism").code == 0
    assert call("draw", path, "-o", tmp_path / "diagram.png").code == 0
