"""JSON Schemas of the documents, made from the registry when they are asked for.

A block or load of an installed package appears by itself. What a schema cannot say (a wire
goes to a joint that exists, a joint to links that do) is left to reading and checking.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from blockmech.blocks.contract import Moving
from blockmech.friction.laws.contract import LAWS, PLAIN, FrictionLaw
from blockmech.friction.laws.coulomb import DryFriction
from blockmech.ground.validation_errors import InWrittenOrder
from blockmech.model.diagram import GRAPH_FILE
from blockmech.model.form import Form, Section
from blockmech.model.joints.contents import FRAME, LINKAGE_FILE
from blockmech.model.subgraph import HEAD, Subgraph
from blockmech.typing import Data

NAME = {"pattern": r"^[^./]+$"}
OUTPUT = {"type": "string", "pattern": r"^[^./]+(\.[^./]+)+$"}


def graph_schema() -> Data:
    """JSON Schema (2020-12) of a graph file, with every registered block type."""
    schema = _schema(GRAPH_FILE)
    schema["$defs"]["WireEnds"]["properties"] |= {"from": OUTPUT, "to": OUTPUT}
    sections = {n: {"$ref": f"#/properties/{n}"} for n in schema["properties"] if n not in HEAD}
    schema["$defs"][Subgraph.type_name]["properties"]["graph"]["properties"] = sections
    return schema


def joints_schema() -> Data:
    """JSON Schema (2020-12) of a joint-based file, with every registered load and law."""
    schema = _schema(LINKAGE_FILE)
    schema["$defs"]["WireEnds"]["properties"] |= {"from": OUTPUT, "to": OUTPUT}
    links = schema["properties"]["links"]
    of_frame = links["additionalProperties"] | {"propertyNames": {"const": "markers"}}
    links["additionalProperties"] |= {"required": ["pose"]}
    links["properties"] = {FRAME: of_frame}
    return schema


def _schema(form: Form) -> Data:
    sections = form.items()
    models: list[type[BaseModel]] = [form.model]
    for section in sections.values():
        kinds = (section.kinds[word] for word in section.kinds)
        models += [model for model in (section.plain, *kinds) if model]
    places, shared = models_json_schema(
        [(model, "validation") for model in models], schema_generator=InWrittenOrder
    )
    parts = shared["$defs"]
    key = {model: places[model, "validation"]["$ref"].rsplit("/", 1)[-1] for model in models}
    document = parts.pop(key[form.model])
    for name, section in sections.items():
        document["properties"][name] = {
            "type": "object",
            "propertyNames": NAME,
            "additionalProperties": _item(section, parts, key),
        }
    version = document["properties"]["version"]["maximum"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **document,
        "title": f"{form.format.replace('/', ' ')}, version {version}",
        "$defs": parts,
    }


def _item(section: Section, parts: Data, key: dict[Any, str]) -> Data:
    """An item, whose schema depends on the word of its kind; those of kinds are made complete."""
    if not section.key:
        return {"$ref": f"#/$defs/{key[section.plain]}"}
    cases = []
    for word in section.kinds:
        model = section.kinds[word]
        name = key[model]
        if section.key not in model.model_fields:
            name = f"{section.prefix}{word}"
            parts[name] = _block_schema(section.key, word, model, parts.pop(key[model]))
        condition = {"properties": {section.key: {"const": word}}, "required": [section.key]}
        cases.append({"if": condition, "then": {"$ref": f"#/$defs/{name}"}})
    words: Data = {"enum": list(section.kinds)}
    if section.other is not None:  # of a kind that is not known here everything is allowed
        words = {"type": "string", "minLength": 1, "examples": list(section.kinds)}
    schema: Data = {"type": "object", "properties": {section.key: words}}
    if section.plain is None:
        schema["required"] = [section.key]
    else:
        plain = {"$ref": f"#/$defs/{key[section.plain]}"}
        cases.append({"if": {"not": {"required": [section.key]}}, "then": plain})
    return schema | {"allOf": cases}


def _block_schema(key: str, word: str, cls: type[Any], schema: Data) -> Data:
    """The schema of a block type, with what only the class knows of its links and joints."""
    keys = {key: {"const": word}, **schema["properties"]}
    if issubclass(cls, Moving) and not cls.own_form:
        keys["links"] = _object({link: {"$ref": "#/$defs/Link"} for link in cls.link_names})
        pins = {
            j.name: keys["clearance"]["additionalProperties"]
            for j in cls.joints.values()
            if j.rotary
        }
        keys["clearance"] = _object(pins)
        keys["friction"] = _object({j.name: _friction_of(j.kind) for j in cls.joints.values()})
    if "markers" in keys:
        keys["markers"] = {**keys["markers"], "propertyNames": NAME}
    required = [key, *schema.get("required", ())]
    return {**schema, "title": word, "properties": keys, "required": required}


def _object(keys: Data) -> Data:
    return {"type": "object", "properties": keys, "additionalProperties": False}


def _friction_of(kind: str) -> Data:
    """Friction that fits a kind of pair: one of the laws for it, the plain one if none is named."""
    laws = {name: law for name in LAWS if kind in (law := LAWS[name]).kinds}
    cases = []
    for name, law in laws.items():
        condition: Data = {"properties": {"law": {"const": name}}}
        condition |= {} if name == PLAIN else {"required": ["law"]}
        cases.append(
            {"if": condition, "then": {"$ref": f"#/$defs/{law.__name__}"} | _sizes(law, kind)}
        )
    return {"type": "object", "properties": {"law": {"enum": list(laws)}}, "allOf": cases}


def _sizes(law: type[FrictionLaw], kind: str) -> Data:
    """What a law of the load needs to know of a kind of pair, and what it must not say."""
    if not issubclass(law, DryFriction):
        return {}
    foreign = "guide_length" if kind == "R" else "radius"
    own = {"required": ["radius"], "properties": {"radius": {"type": "number"}}}
    return {
        **(own if kind == "R" else {}),
        "not": {"required": [foreign], "properties": {foreign: {"type": "number"}}},
    }
