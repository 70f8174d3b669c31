"""``blocks`` and ``schema``: lists and schemas come from the registry."""

from __future__ import annotations

import json

from jsonschema import Draft202012Validator

import blockmech as bm
from blockmech.blocks import REGISTRY
from blockmech.plan.quantities import QUANTITIES
from tests.gallery import GRAPHS, JOINTS, mechanism
from tests.model.documents import DOCUMENTS


def test_blocks_lists_every_registered_type_with_its_joints(call):
    outcome = call("blocks")
    assert (outcome.code, outcome.err) == (0, "")
    described = {part.split()[0]: part for part in outcome.out.split("\n\n")}
    assert list(described) == list(REGISTRY)
    for name, text in described.items():
        if getattr(REGISTRY[name], "own_form", False):
            assert "  links       and pairs are the user's" in text
            continue
        for joint in REGISTRY[name].joints:
            assert f"  joint       {joint}: " in text


def test_blocks_gives_parameters_with_units_and_defaults(call):
    text = call("blocks").out
    rrr = next(part for part in text.split("\n\n") if part.startswith("dyad.rrr"))
    assert "  parameter   l_i [m]\n" in rrr
    assert "  parameter   branch = 1\n" in rrr
    crank = next(part for part in text.split("\n\n") if part.startswith("driver.crank"))
    assert "  parameter   length [m], optional\n" in crank
    assert "  parameter   offset [rad] = 0.0\n" in crank


def test_blocks_of_some_types_and_what_their_laws_are_functions_of(call):
    text = call("blocks", "load.thrust", "dyad.*").out
    types = [part.split()[0] for part in text.split("\n\n")]
    assert types == ["load.thrust", *(name for name in REGISTRY if name.startswith("dyad."))]
    assert "way from a to b along the direction" in text


def test_outputs_of_a_file_with_units_and_what_they_are(call, ruiz):
    outcome = call("outputs", ruiz)
    assert (outcome.code, outcome.err) == (0, "")
    head, *rows = outcome.out.splitlines()
    assert head.split() == ["output", "unit", "what"]
    outputs = mechanism("ruiz_fourbar").outputs
    assert [row.split()[0] for row in rows] == list(outputs)
    drive = next(row for row in rows if row.startswith("crank.drive "))
    assert drive.split(maxsplit=3)[1:3] == ["N", "m"]
    about = "driving moment or force of frame.frame on crank.crank, friction included"
    assert drive.endswith(about)


def test_some_outputs_as_data(call, ruiz):
    result = json.loads(call("outputs", ruiz, "*.reaction", "crank.q", "--json").out)["outputs"]
    assert result[-1] == {
        "name": "crank.q",
        "unit": "rad",
        "kind": "real",
        "about": "coordinate of the driver",
    }
    assert {(o["unit"], o["kind"]) for o in result[:-1]} == {("N", "vector")}
    wrong = call("outputs", ruiz, "crank.torque")
    assert (wrong.code, wrong.out) == (2, "")
    assert "unknown-output" in wrong.err


def test_every_quantity_is_said_in_words_and_none_that_there_is_not():
    graphs = [mechanism(path.stem) for path in GRAPHS.glob("*.json")]
    linkages = [bm.Linkage.load(path).compile() for path in JOINTS.glob("*.json")]
    law = bm.friction.LuGre(static=0.2, kinetic=0.1, stribeck_speed=1.0, stiffness=1e3, radius=0.01)
    bristles = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    fields = {"friction": {"B": law}, "clearance": {"B": 1e-5}}
    bristles.blocks["dyad"] = bristles.blocks["dyad"].model_copy(update=fields)
    graphs.append(bristles.compile())
    hoist = bm.Graph.load(GRAPHS / "planetary_hoist.json").replace({"mesh.efficiency": 0.98})
    graphs.append(hoist.compile())
    outputs = [o for mech in graphs + linkages for o in mech.outputs.values()]
    assert all(o.about for o in outputs)
    assert {o.name.rpartition(".")[2] for o in outputs} == set(QUANTITIES)


def test_a_printed_result_keeps_the_printed_schema(call, ruiz):
    schema = json.loads(call("schema", "result").out)
    result = json.loads(call("run", ruiz, "--samples", "5", "--json").out)
    assert list(Draft202012Validator(schema).iter_errors(result)) == []


def test_schema_of_links_and_joints_accepts_them(call):
    schema = json.loads(call("schema", "joints").out)
    Draft202012Validator.check_schema(schema)
    for make in DOCUMENTS.values():
        Draft202012Validator(schema).validate(make())
