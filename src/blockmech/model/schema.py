"""JSON Schema of graph files, made from the registry when it is asked for.

A block of an installed package appears by itself. What a schema cannot say (a wire
goes to a joint that exists, names of markers are free) is left to `Graph.check`.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.registry import REGISTRY
from blockmech.model.document import GraphDocument
from blockmech.validation_errors import InWrittenOrder

NAME = {"pattern": r"^[^./]+$"}
ADDRESS = {"type": "string", "pattern": r"^[^./]+\.[^./]+$"}


def graph_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of a graph file, with every registered block type."""
    types = {name: REGISTRY[name] for name in REGISTRY}
    models: list[type[BaseModel]] = [GraphDocument, *types.values()]
    places, shared = models_json_schema(
        [(model, "validation") for model in models], schema_generator=InWrittenOrder
    )
    parts = shared["$defs"]
    key = {model: places[model, "validation"]["$ref"].rsplit("/", 1)[-1] for model in models}
    document = parts.pop(key[GraphDocument])
    blocks = {name: _block_schema(name, cls, parts.pop(key[cls])) for name, cls in types.items()}
    document["properties"]["blocks"] = {
        "type": "object",
        "propertyNames": NAME,
        "additionalProperties": {"$ref": "#/$defs/block"},
    }
    parts["WireEnds"]["properties"] |= {"from": ADDRESS, "to": ADDRESS}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **document,
        "title": f"blockmech graph, version {document['properties']['version']['maximum']}",
        "$defs": {**parts, "block": _any_block(types), **blocks},
    }


def _any_block(types: dict[str, type[Block]]) -> dict[str, Any]:
    """A block by its type; of a type that is not installed everything is allowed."""
    return {
        "type": "object",
        "required": ["type"],
        "properties": {"type": {"type": "string", "minLength": 1, "examples": list(types)}},
        "allOf": [
            {
                "if": {"properties": {"type": {"const": name}}, "required": ["type"]},
                "then": {"$ref": f"#/$defs/{name}"},
            }
            for name in types
        ],
    }


def _block_schema(name: str, cls: type[Block], schema: dict[str, Any]) -> dict[str, Any]:
    keys = {"type": {"const": name}, **schema["properties"]}
    if issubclass(cls, Moving) and not cls.own_form:
        keys["links"] = _named({link: {"$ref": "#/$defs/Link"} for link in cls.link_names})
        keys["friction"] = _named({j.name: _friction_of(j.kind) for j in cls.joints.values()})
    if "markers" in keys:
        keys["markers"] = {**keys["markers"], "propertyNames": NAME}
    return {
        **schema,
        "title": name,
        "properties": keys,
        "required": ["type", *schema.get("required", ())],
    }


def _named(keys: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": keys, "additionalProperties": False}


def _friction_of(kind: str) -> dict[str, Any]:
    """Friction that fits a kind of pair."""
    foreign = "guide_length" if kind == "R" else "radius"
    own = {"required": ["radius"], "properties": {"radius": {"type": "number"}}}
    return {
        "$ref": "#/$defs/Coulomb",
        **(own if kind == "R" else {}),
        "not": {"required": [foreign], "properties": {foreign: {"type": "number"}}},
    }
