"""The JSON Schema of graph files says what the reader says, as far as a schema can."""

from __future__ import annotations

import json

import jsonschema
import pytest

from blockmech.blocks.block import REGISTRY
from blockmech.ground.values import Length
from blockmech.loads import Element, Terminal
from blockmech.model.schema import graph_schema
from tests.gallery import GRAPHS

GOOD = sorted(GRAPHS.glob("*.json"))

NOT_JSON = {"comment", "empty_file", "missing_comma", "single_quotes", "trailing_comma"} | {
    "truncated",
    "utf_16",
    "wrong_encoding",
}
BEYOND_A_SCHEMA = {  # what a schema cannot say: how parts of a file fit each other
    *(
        "bad_direction",
        "group_conflicting",
        "group_locked",
        "group_turning_twice",
        "group_wrong_count",
        "bad_parameter",
        "graph_in_itself",
        "missing_graph",
        "no_law",
        "no_graph",
        "no_place_to_stand",
        "unknown_parameter",
        "unwired_inside",
        "bearing_of_no_catalogue",
        "bad_expectation",
        "bad_table",
        "cycle",
        "double_wire",
        "duplicate_key",
        "half_character",
    ),
    *("infinite_inertia", "inner_joint", "nan", "no_frame", "no_such_block", "not_a_marker"),
    *("static_below_kinetic", "thick_film", "film_not_from_rest"),
    *("pair_mismatch", "self_wire", "taken_name", "two_frames", "unknown_block"),
    *("unknown_driver", "unknown_joint", "unknown_marker", "unwired_joint"),
    *("many_drivers", "wrong_home"),
    *("bad_teeth", "coupling_mismatch", "coupled_twice", "coupled_driver", "coupling_loop"),
    *("undercut", "dead_face", "open_profile", "no_room", "rack_on_pin", "roller_too_large"),
    *("algebraic_loop", "no_pose", "no_sensor", "same_link", "signal_to_marker", "unknown_output"),
}


@pytest.fixture(scope="module")
def validator():
    schema = graph_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def content(path):
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", GOOD, ids=lambda path: path.stem)
def test_good_files_are_valid(path, validator):
    assert [e.message for e in validator.iter_errors(content(path))] == []


def test_broken_files_are_invalid_but_for_what_a_schema_cannot_say(validator):
    broken = [p for p in (GRAPHS / "broken").iterdir() if p.stem not in NOT_JSON]
    passed = {path.stem for path in broken if validator.is_valid(content(path))}
    assert passed == BEYOND_A_SCHEMA


def test_the_schema_is_plain_json():
    assert json.loads(json.dumps(graph_schema(), allow_nan=False)) == graph_schema()


def test_keys_stand_in_the_order_of_the_file():
    keys = list(graph_schema()["$defs"]["dyad.rrr"]["properties"])
    assert keys == ["type", "l_i", "l_j", "branch", "home", "links", "friction", "clearance"]


def test_units_are_said():
    parts = graph_schema()["$defs"]
    assert parts["dyad.rrr"]["properties"]["l_i"]["unit"] == "m"
    assert parts["Link"]["properties"]["inertia"]["unit"] == "kg m2"


def test_every_registered_type_is_there_and_a_new_one_appears_by_itself():
    class Pulley(Element, type="test.pulley"):
        """A load that somebody else made."""

        terminals = {"on": Terminal("link")}
        radius: Length

    try:
        schema = graph_schema()
    finally:
        REGISTRY._types.pop("test.pulley")
    assert set(REGISTRY) | {"test.pulley"} <= set(schema["$defs"])
    graph = content(GRAPHS / "ruiz_fourbar.json")
    graph["blocks"]["pulley"] = {"type": "test.pulley", "radius": -1.0}
    errors = list(jsonschema.Draft202012Validator(schema).iter_errors(graph))
    assert [list(e.absolute_path) for e in errors] == [["blocks", "pulley", "radius"]]


@pytest.mark.parametrize(
    ("block", "valid"),
    [
        ({"type": "acme.gear", "teeth": 17}, True),
        ({"type": ""}, False),
        ({"teeth": 17}, False),
        ({"type": "dyad.rrr", "l_i": 1.0, "l_j": 1.0, "links": {"k": {}}}, False),
        ({"type": "driver.crank", "friction": {"A": {"coefficient": 0.1}}}, False),
        ({"type": "driver.crank", "friction": {"A": {"coefficient": 0.1, "radius": 1}}}, True),
        ({"type": "driver.slide", "friction": {"S": {"coefficient": 0.1, "radius": 1}}}, False),
        ({"type": "driver.slide", "friction": {"S": {"coefficient": 0.1}}}, True),
        ({"type": "frame", "markers": {"a.b": {"at": [0, 0]}}}, False),
        ({"type": "frame", "markers": {"P": {"at": {"polar": [1, 2]}, "dir": [0, 1]}}}, True),
    ],
    ids=str,
)
def test_blocks_are_checked_by_their_type(block, valid, validator):
    graph = content(GRAPHS / "ruiz_fourbar.json")
    graph["blocks"]["new"] = block
    assert validator.is_valid(graph) == valid
