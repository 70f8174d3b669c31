"""JSON Schema of joint-based files, made from the registry when it is asked for.

What a schema cannot say (a joint names links that exist, links and joints are a mechanism)
is left to reading and to `Linkage.check`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from blockmech.blocks.registry import REGISTRY
from blockmech.loads.contract import Element
from blockmech.model.joints.contents import (
    FRAME,
    LAWS,
    LOADS,
    GuideGiven,
    JointsDocument,
    LinkGiven,
    PinGiven,
    driver_model,
    load_kinds,
    load_model,
)
from blockmech.model.schema import NAME
from blockmech.validation_errors import InWrittenOrder


def joints_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of a joint-based file, with every registered load and law."""
    kinds: dict[str, type[BaseModel]] = {"R": PinGiven, "P": GuideGiven}
    laws: dict[str, type[BaseModel]] = {word: driver_model(word) for word in LAWS}
    loads: dict[str, type[BaseModel]] = {
        kind: load_model(cls)
        for kind in load_kinds()
        if issubclass(cls := REGISTRY[f"{LOADS}{kind}"], Element)
    }
    models: list[type[BaseModel]] = [JointsDocument, LinkGiven, driver_model()]
    models += [*kinds.values(), *laws.values(), *loads.values()]
    places, shared = models_json_schema(
        [(model, "validation") for model in models], schema_generator=InWrittenOrder
    )
    parts = shared["$defs"]
    ref = {model: places[model, "validation"]["$ref"] for model in models}
    for kind, model in loads.items():
        _tagged(parts[_key(ref[model])], "type", kind)
    document = parts.pop(_key(ref[JointsDocument]))
    link = {"$ref": ref[LinkGiven]}
    without_law = {"$ref": ref[driver_model()]}
    document["properties"] |= {
        "links": _named(link | {"required": ["pose"]})
        | {"properties": {FRAME: link | {"propertyNames": {"const": "markers"}}}},
        "joints": _named(_chosen("type", {k: ref[m] for k, m in kinds.items()})),
        "drivers": _named(_chosen("law", {k: ref[m] for k, m in laws.items()}, without_law)),
        "loads": _named(_chosen("type", {k: ref[m] for k, m in loads.items()})),
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **document,
        "title": f"blockmech joints, version {document['properties']['version']['maximum']}",
        "$defs": parts,
    }


def _key(ref: str) -> str:
    return ref.rsplit("/", 1)[-1]


def _tagged(schema: dict[str, Any], key: str, word: str) -> None:
    """Add the key that names the kind."""
    schema["properties"] = {key: {"const": word}, **schema["properties"]}
    schema["required"] = [key, *schema.get("required", ())]


def _named(item: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "propertyNames": NAME, "additionalProperties": item}


def _chosen(
    key: str, refs: Mapping[str, str], otherwise: dict[str, Any] | None = None
) -> dict[str, Any]:
    """An object whose schema depends on one of its keys, which may be left out if so said."""
    found: dict[str, Any] = {"type": "object", "properties": {key: {"enum": list(refs)}}}
    cases: list[dict[str, Any]] = [
        {"if": {"properties": {key: {"const": word}}, "required": [key]}, "then": {"$ref": ref}}
        for word, ref in refs.items()
    ]
    if otherwise is None:
        found["required"] = [key]
    else:
        cases.append({"if": {"not": {"required": [key]}}, "then": otherwise})
    return found | {"allOf": cases}
