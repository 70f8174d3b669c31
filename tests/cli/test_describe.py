"""``blocks`` and ``schema``: lists and schemas come from the registry."""

from __future__ import annotations

import json

from jsonschema import Draft202012Validator

from blockmech.blocks import REGISTRY
from tests.model.documents import DOCUMENTS


def test_blocks_lists_every_registered_type_with_its_joints(call):
    said = call("blocks")
    assert (said.code, said.err) == (0, "")
    described = {part.split()[0]: part for part in said.out.split("\n\n")}
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


def test_a_printed_result_keeps_the_printed_schema(call, ruiz):
    schema = json.loads(call("schema", "result").out)
    result = json.loads(call("run", ruiz, "--samples", "5", "--json").out)
    assert list(Draft202012Validator(schema).iter_errors(result)) == []


def test_schema_of_links_and_joints_accepts_them(call):
    schema = json.loads(call("schema", "joints").out)
    Draft202012Validator.check_schema(schema)
    for make in DOCUMENTS.values():
        Draft202012Validator(schema).validate(make())
