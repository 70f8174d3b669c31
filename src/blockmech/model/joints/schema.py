"""JSON Schema of joint-based files, made from the registry when it is asked for.

What a schema cannot say (a joint names links that exist, links and joints are a mechanism)
is left to reading and to `Linkage.check`.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from blockmech.model.joints.contents import FRAME, JointsDocument, Section, sections
from blockmech.model.schema import NAME
from blockmech.validation_errors import InWrittenOrder


def joints_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of a joint-based file, with every registered load and law."""
    items = sections()
    models: list[type[BaseModel]] = [JointsDocument]
    for section in items.values():
        models += [model for model in (section.plain, *section.models.values()) if model]
    places, shared = models_json_schema(
        [(model, "validation") for model in models], schema_generator=InWrittenOrder
    )
    parts = shared["$defs"]
    key = {model: places[model, "validation"]["$ref"].rsplit("/", 1)[-1] for model in models}
    for kind, model in items["loads"].models.items():  # the key that names the kind
        part = parts[key[model]]
        part["properties"] = {"type": {"const": kind}, **part["properties"]}
        part["required"] = ["type", *part.get("required", ())]
    document = parts.pop(key[JointsDocument])
    for name, section in items.items():
        item = _item(section, {model: {"$ref": f"#/$defs/{part}"} for model, part in key.items()})
        document["properties"][name] = {
            "type": "object",
            "propertyNames": NAME,
            "additionalProperties": item,
        }
    links = document["properties"]["links"]
    of_frame = links["additionalProperties"] | {"propertyNames": {"const": "markers"}}
    links["additionalProperties"] |= {"required": ["pose"]}
    links["properties"] = {FRAME: of_frame}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **document,
        "title": f"blockmech joints, version {document['properties']['version']['maximum']}",
        "$defs": parts,
    }


def _item(section: Section, ref: dict[Any, Any]) -> dict[str, Any]:
    """An item, whose schema depends on the key of its kind."""
    if not section.key:
        return dict(ref[section.plain])
    found: dict[str, Any] = {
        "type": "object",
        "properties": {section.key: {"enum": list(section.models)}},
    }
    cases: list[dict[str, Any]] = [
        {
            "if": {"properties": {section.key: {"const": word}}, "required": [section.key]},
            "then": ref[model],
        }
        for word, model in section.models.items()
    ]
    if section.plain is None:
        found["required"] = [section.key]
    else:
        cases.append({"if": {"not": {"required": [section.key]}}, "then": ref[section.plain]})
    return found | {"allOf": cases}
