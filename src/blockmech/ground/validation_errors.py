"""Mistakes in data against a pydantic model, one problem each in the trade's words.

Pydantic says where and what kind; the model's JSON Schema knows units and keys there.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, LiteralString, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import ErrorDetails, PydanticCustomError

from blockmech.ground.errors import (
    MOST,
    Path,
    Problem,
    close_match,
    listed,
    path_text,
    shown,
    unknown_key,
)
from blockmech.ground.units import NoQuantity, quantity, seem_degrees
from blockmech.typing import Data, Record


def mistake(
    code: LiteralString, found: str, valid: str = "", remedy: str = ""
) -> PydanticCustomError:
    """A mistake in a model, with the parts of a `Problem`."""
    parts = {"found": found, "valid": valid, "remedy": remedy}
    message = "; ".join(filter(None, parts.values()))
    return PydanticCustomError(code, "{said}", {"said": message, **parts})


def check_table(
    what: str,
    x: Sequence[float],
    values: Sequence[float],
    period: float = 0.0,
    called: str = "values",
) -> None:
    """Refuse a table whose values are not one for each x, or whose x, called ``what``, fall.

    Of one that repeats the first value stands for the end of the period.
    """
    if len(x) != len(values):
        raise mistake("bad-table", f'"{what}" and "{called}" must have the same length')
    if any(b <= a for a, b in pairwise(x)):
        raise mistake("bad-table", f'"{what}" must increase')
    if period and x[-1] - x[0] >= period * (1 - 1e-12):
        message = f'"{what}" must cover less than one period'
        valid = "the first value is repeated by itself"
        remedy = "leave out the last row"
        if math.isclose(period, math.tau) and seem_degrees(x[0], x[-1]):
            remedy = f'these are radians; degrees are written "{x[-1]:g}deg"'
        raise mistake("bad-table", message, valid, remedy)


Model = TypeVar("Model", bound=BaseModel)

LAST = ("links", "markers", "friction", "clearance", "slider", "useful")
"""Fields that many blocks share; they follow the block's own, in this order."""


@functools.cache
def field_order(model: type[BaseModel]) -> tuple[str, ...]:
    """Names of a model's fields as they are written: its own, then inherited, then `LAST`."""
    names: list[str] = []
    for cls in model.__mro__:
        if issubclass(cls, BaseModel):
            inherited = {n for base in cls.__bases__ for n in getattr(base, "model_fields", ())}
            names += [n for n in cls.model_fields if n not in inherited and n not in names]
    return tuple(sorted(names, key=lambda n: LAST.index(n) if n in LAST else -1))


class InWrittenOrder(GenerateJsonSchema):
    """A JSON Schema whose keys stand in the order in which they are written."""

    def model_schema(self, schema: Any) -> Data:
        """The schema of a model, its properties in the order of the fields."""
        core_schema = super().model_schema(schema)
        if "properties" in core_schema:
            model = schema["cls"]
            names = [*field_order(model)]
            if self.by_alias:
                names = [model.model_fields[n].alias or n for n in names]
            core_schema["properties"] = {n: core_schema["properties"][n] for n in names}
        return core_schema


def validated(
    model: type[Model], raw: object, owner: str, at: Path = ()
) -> tuple[Model | None, list[Problem]]:
    """The data as a model, or one problem per mistake.

    Parameters
    ----------
    model : what the data should be
    raw : the data
    owner : what the data is called, e.g. "dyad.rrr"
    at : path of the data in the document
    """
    try:
        return model.model_validate(raw), []
    except ValidationError as error:
        return None, _problems(error, model, raw, owner, at)


def problems_of(error: ValidationError, model: type[BaseModel], data: object) -> list[Problem]:
    """What is wrong with a model made in Python, where keys are the names of its fields."""
    return _problems(error, model, data, model.__name__, (model.__name__,), by_alias=False)


def _problems(
    error: ValidationError,
    model: type[BaseModel],
    raw: object,
    owner: str,
    at: Path,
    by_alias: bool = True,
) -> list[Problem]:
    schema = model.model_json_schema(by_alias, schema_generator=InWrittenOrder)
    fields = {} if by_alias else {x.alias: name for name, x in model.model_fields.items()}
    problems = []
    for line in error.errors(include_url=False)[: MOST + 1]:
        path = _path_in(raw, line, fields)
        problems.append(_problem(_Place(schema, raw, path, owner, at), line))
    return list(_united(problems))


def _path_in(raw: Any, line: ErrorDetails, fields: Mapping[Any, str]) -> list[str | int]:
    """Pydantic's location without what is not in the data: tags of unions and the like.

    ``fields`` is key in a file -> field, of a model made in Python.
    """
    path: list[str | int] = []
    for k, part in enumerate((fields.get(x, x) for x in line["loc"]), start=1):
        is_key = isinstance(raw, dict) and part in raw
        is_index = isinstance(raw, list) and isinstance(part, int) and part < len(raw)
        if is_key or is_index or (line["type"] == "missing" and k == len(line["loc"])):
            path.append(part)
        if is_key or is_index:
            raw = raw[part]
    return path


def _united(problems: list[Problem]) -> Iterator[Problem]:
    """Problems with one sentence where a value fits none of several types."""
    for problem in problems:
        if problem.code != "wrong-type":
            yield problem
            continue
        inside = (f"{problem.where}.", f"{problem.where}[")
        same = [p for p in problems if p.code == problem.code and p.where == problem.where]
        if problem is same[0] and not any(p.where.startswith(inside) for p in problems):
            types = [p.found.split(" must be ", 1)[-1].rsplit(", got ", 1)[0] for p in same]
            text = problem.found.replace(types[0], " or ".join(dict.fromkeys(types)), 1)
            yield replace(problem, found=text)


class _Place:
    """A place in data that do not fit: what stands there, and what its schema says."""

    def __init__(
        self, schema: Record, raw: object, path: list[str | int], owner: str, at: Path
    ) -> None:
        self.where = path_text([*at, *path])
        self.owner = owner if len(path) < 2 else path_text([*at, *path[:-1]])
        tail = path[-2:] if path and isinstance(path[-1], int) else path[-1:]
        self.name = path_text(tail) or self.owner  # as a sentence calls the value
        parent = _schema_at(schema, raw, path[:-1])
        self.keys = list(
            dict.fromkeys(k for m in _members(schema, parent) for k in m.get("properties", ()))
        )
        self.here = _schema_at(schema, raw, path)
        units = [m["unit"] for m in _members(schema, self.here) if "unit" in m]
        self.unit = units[0] if units else ""


MUST: Mapping[str, tuple[str, str]] = {
    "greater_than": ("wrong-value", "> {gt:g}{unit}"),
    "greater_than_equal": ("wrong-value", ">= {ge:g}{unit}"),
    "less_than": ("wrong-value", "< {lt:g}{unit}"),
    "less_than_equal": ("wrong-value", "<= {le:g}{unit}"),
    "finite_number": ("non-finite", "a finite number{in_unit}"),
    "float_type": ("wrong-type", "a number{in_unit}"),
    "int_type": ("wrong-type", "a whole number"),
    "string_type": ("wrong-type", "a text"),
    "bool_type": ("wrong-type", "true or false"),
    "dict_type": ("wrong-type", "an object {{...}}"),
    "model_type": ("wrong-type", "an object {{...}}"),
    "model_attributes_type": ("wrong-type", "an object {{...}}"),
    "list_type": ("wrong-type", "a list [...]"),
    "tuple_type": ("wrong-type", "a list [...]"),
}
"""Pydantic's type -> our code, and what a value must be."""


def _problem(position: _Place, line: ErrorDetails) -> Problem:
    """One of pydantic's mistakes as a problem."""
    kind, value, context = line["type"], line["input"], line.get("ctx", {})
    where, name = position.where, position.name
    if kind in MUST:
        code, rule = MUST[kind]
        unit = f" {position.unit}" if position.unit else ""
        text = rule.format(unit=unit, in_unit=unit and f" in{unit}", **context)
        valid, remedy = _quantity(value, position.unit) if kind == "float_type" else ("", "")
        if "discriminator" in position.here and kind.startswith(("model", "dict")):
            key, tags = _choice(position)
            word = value if value in tags else tags[0]
            remedy = f'write {{"{key}": "{word}", ...}}; {key}s: {listed(tags)}'
        return Problem(code, where, f"{name} must be {text}, got {shown(value)}", valid, remedy)
    if kind == "missing":
        unit = f" [{position.unit}]" if position.unit else ""
        return Problem("missing-key", where, f'{position.owner} needs "{name}"{unit}', "", "add it")
    if kind == "extra_forbidden":
        key = str(line["loc"][-1])
        if key == "rpm" and "rate" in position.keys:
            remedy = f'write "rate": "{value}rpm"'
            return replace(unknown_key(where, position.owner, key, position.keys), remedy=remedy)
        return unknown_key(where, position.owner, key, position.keys)
    if kind in ("too_short", "too_long"):
        bound = f"at most {context.get('max_length')}"
        bound = f"at least {context['min_length']}" if kind == "too_short" else bound
        message = f"{name} must have {bound} values, has {context['actual_length']}"
        return Problem("wrong-value", where, message)
    if kind == "literal_error":
        allowed = context["expected"].replace("'", '"')
        options = re.findall(r'"([^"]*)"', allowed)
        if line["loc"][-1] == "[key]":
            return unknown_key(where, position.owner, str(value), options)
        remedy = close_match(value, options) if isinstance(value, str) else ""
        message = f"{name} must be {allowed}, got {shown(value)}"
        return Problem("wrong-value", where, message, "", remedy)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _no_such_kind(position, line)
    # mistakes that models name themselves have a hyphen; then whatever else pydantic may say
    plain = str(line["msg"]).removeprefix("Value error, ").removeprefix("Assertion failed, ")
    message = str(context.get("found", plain))
    message = f"{name} {message}" if message.startswith("must ") else message
    code = kind if "-" in kind else "wrong-value"
    return Problem(code, where, message, context.get("valid", ""), context.get("remedy", ""))


def _quantity(value: object, unit: str) -> tuple[str, str]:
    """What is valid in place of a text that is no quantity, and what to write for a bare number."""
    if not isinstance(value, str):
        return "", ""
    try:
        return "", f"write {quantity(value, unit)!r}"
    except NoQuantity as error:
        return error.valid if unit else error.found, ""


def _choice(position: _Place) -> tuple[str, list[str]]:
    """The key by which kinds are told there, and their words."""
    choice = position.here.get("discriminator", {"propertyName": "law", "mapping": {}})
    return choice["propertyName"], list(choice["mapping"])


def _no_such_kind(position: _Place, line: ErrorDetails) -> Problem:
    """The problem of a value that says its kind wrongly or not at all."""
    key, tags = _choice(position)
    where, valid = f"{position.where}.{key}", f"{key}s: {listed(tags)}"
    if line["type"] == "union_tag_not_found":
        return Problem("missing-key", where, f'{position.where} needs "{key}"', valid, "add it")
    data = line["input"]
    value = data.get(key) if isinstance(data, dict) else data
    remedy = close_match(value, tags) if isinstance(value, str) else ""
    return Problem("wrong-value", where, f"no {key} {shown(value)}", valid, remedy)


# A JSON Schema, followed along a path.


def _members(root: Record, node: Record) -> list[Record]:
    """A schema, or its alternatives, with references resolved."""
    if "$ref" in node:
        return _members(root, root["$defs"][node["$ref"].rsplit("/", 1)[-1]])
    for key in ("anyOf", "oneOf"):
        if key in node:
            return [node] + [m for option in node[key] for m in _members(root, option)]
    return [node]


def _schema_at(root: Record, raw: Any, path: Path) -> Record:
    """The schema of the value at a path, {} where it says nothing."""
    node = _chosen(root, root, raw)
    for part in path:
        within = [_step(m, part) for m in _members(root, node)]
        node = next((n for n in within if n), {})
        try:
            raw = raw[part]
        except (LookupError, TypeError):
            raw = None
        node = _chosen(root, node, raw)
    return node


def _chosen(root: Record, node: Record, raw: object) -> Record:
    """Of several kinds, the one that the data names."""
    if "discriminator" in node and isinstance(raw, dict):
        tag = raw.get(node["discriminator"]["propertyName"])
        option = node["discriminator"]["mapping"].get(tag) if isinstance(tag, str) else None
        if option:
            return _members(root, {"$ref": option})[0]
    return node


def _step(node: Record, part: str | int) -> Record:
    if isinstance(part, int):
        schema = node.get("items", {})
    else:
        schema = node.get("properties", {}).get(part) or node.get("additionalProperties", {})
    return schema if isinstance(schema, dict) else {}
