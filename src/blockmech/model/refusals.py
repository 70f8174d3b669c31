"""Data against a model: the model, or pydantic's refusal in the trade's words.

One problem per mistake, each with its path in the JSON document.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import islice
from typing import Any, TypeAlias, TypeVar

from pydantic import BaseModel, ValidationError

from blockmech.errors import Problem, close_match, listed
from blockmech.model.problems import FILE_CODES, MOST, Path, path_text, unknown_key
from blockmech.model.schema import model_schema
from blockmech.values import shown

Model = TypeVar("Model", bound=BaseModel)

FLOOD = 10 * MOST  # mistakes; of more, the first are looked for in a part of the data


def validated(
    model: type[Model], raw: Any, what: str, at: Path = ()
) -> tuple[Model | None, list[Problem]]:
    """The data as a model, or one problem per mistake.

    Parameters
    ----------
    model : what the data should be
    raw : the data
    what : what the data is called, e.g. "dyad.rrr"
    at : path of the data in the document
    """
    try:
        return model.model_validate(raw), []
    except ValidationError as error:
        return None, _problems(error, model, raw, model_schema(model), what, at)


def problems_of(error: ValidationError, model: type[BaseModel], given: Any) -> list[Problem]:
    """What is wrong with a model made in Python, where keys are the names of its fields."""
    name = model.__name__
    return _problems(error, model, given, model_schema(model, by_alias=False), name, (name,))


def _problems(
    error: ValidationError, model: type[BaseModel], raw: Any, schema: Any, what: str, at: Path
) -> list[Problem]:
    found = list[Problem]()
    for line in _lines(error, model, raw):
        path = _path_in(raw, line["loc"], line["type"])
        place = _Place(schema, raw, path, what, at)
        found += _SENTENCES.get(line["type"], _other)(place, line)
    return list(_united(found))


def _lines(error: ValidationError, model: type[BaseModel], raw: Any) -> Iterator[Any]:
    """The first of pydantic's messages, soon even where there are a million."""
    whole = error
    for most in (10, FLOOD, 20 * FLOOD):
        if error.error_count() <= FLOOD:
            break
        try:
            model.model_validate(_beginning(raw, most))
        except ValidationError as shorter:
            error = shorter
    lines = error.errors(include_url=False)
    true = [line for line in lines if error is whole or not _comes_later(raw, line)]
    return iter((true or whole.errors(include_url=False))[: MOST + 1])


def _beginning(raw: Any, most: int) -> Any:
    """The first items of every object and list."""
    if isinstance(raw, dict):
        return {key: _beginning(item, most) for key, item in islice(raw.items(), most)}
    return [_beginning(item, most) for item in raw[:most]] if isinstance(raw, list) else raw


def _comes_later(raw: Any, line: Any) -> bool:
    """Whether a key is missing only because the beginning of an object was looked at."""
    path = _path_in(raw, line["loc"], line["type"])
    for part in path[:-1]:
        raw = raw[part]
    return line["type"] == "missing" and path[-1] in raw


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
            said = problem.found.replace(types[0], " or ".join(dict.fromkeys(types)), 1)
            yield replace(problem, found=said)


class _Place:
    """A place in refused data: what stands there, and what its schema says."""

    def __init__(
        self, schema: Mapping[str, Any], raw: Any, path: list[str | int], what: str, at: Path
    ) -> None:
        self.where = path_text([*at, *path])
        self.path = path
        self.owner = what if len(path) < 2 else path_text([*at, *path[:-1]])
        self.root = schema
        self.parent = _schema_at(schema, raw, path[:-1])
        self.here = _schema_at(schema, raw, path)

    @property
    def name(self) -> str:
        """How a sentence calls the value."""
        tail = self.path[-2:] if self.path and isinstance(self.path[-1], int) else self.path[-1:]
        return path_text(tail) or self.owner

    @property
    def unit(self) -> str:
        """The unit, with a space in front, or nothing."""
        units = [m["unit"] for m in _members(self.root, self.here) if "unit" in m]
        return f" {units[0]}" if units else ""

    @property
    def keys(self) -> list[str]:
        """The keys of the object around the value."""
        keys = [k for m in _members(self.root, self.parent) for k in m.get("properties", ())]
        return list(dict.fromkeys(keys))


Sentence: TypeAlias = Callable[[_Place, Any], Iterator[Problem]]


def _missing(place: _Place, line: Any) -> Iterator[Problem]:
    unit = f" [{place.unit.strip()}]" if place.unit else ""
    found = f'{place.owner} needs "{place.name}"{unit}'
    yield Problem("missing-key", place.where, found, "", "add it")


def _unknown(place: _Place, line: Any) -> Iterator[Problem]:
    key = str(place.path[-1])
    yield unknown_key(place.where, place.owner, key, place.keys)


def _must(code: str, rule: str) -> Sentence:
    """A sentence of the form: name must be something, got something else."""

    def sentence(place: _Place, line: Any) -> Iterator[Problem]:
        limits = {k: f"{x:g}" for k, x in line.get("ctx", {}).items() if isinstance(x, int | float)}
        unit = place.unit
        text = rule.format(unit=unit, in_unit=f" in{unit}" if unit else "", **limits)
        yield Problem(code, place.where, f"{place.name} must be {text}, got {shown(line['input'])}")

    return sentence


def _too_short(place: _Place, line: Any) -> Iterator[Problem]:
    least, has = line["ctx"]["min_length"], line["ctx"]["actual_length"]
    found = f"{place.name} must have at least {least} values, has {has}"
    yield Problem("wrong-value", place.where, found)


def _choice(place: _Place, line: Any) -> Iterator[Problem]:
    said, allowed = line["input"], line["ctx"]["expected"].replace("'", '"')
    words = re.findall(r'"([^"]*)"', allowed)
    if line["loc"][-1] == "[key]":
        yield unknown_key(place.where, place.owner, str(said), words)
        return
    found = f"{place.name} must be {allowed}, got {shown(said)}"
    remedy = close_match(said, words) if isinstance(said, str) else ""
    yield Problem("wrong-value", place.where, found, "", remedy)


def _unknown_kind(place: _Place, line: Any) -> Iterator[Problem]:
    key, tags = _tags(place)
    said = line["input"].get(key)
    known = f"{key}s: {listed(tags)}"
    remedy = close_match(said, tags) if isinstance(said, str) else ""
    yield Problem("wrong-value", f"{place.where}.{key}", f"no {key} {shown(said)}", known, remedy)


def _no_kind(place: _Place, line: Any) -> Iterator[Problem]:
    key, tags = _tags(place)
    found = f'{place.where} needs "{key}"'
    yield Problem("missing-key", f"{place.where}.{key}", found, f"{key}s: {listed(tags)}", "add it")


def _tags(place: _Place) -> tuple[str, list[str]]:
    choice: Any = place.here.get("discriminator", {"propertyName": "law", "mapping": {}})
    return choice["propertyName"], list(choice["mapping"])


def _other(place: _Place, line: Any) -> Iterator[Problem]:
    """Mistakes that models name themselves, and whatever else pydantic may say."""
    said = line.get("ctx", {})
    code = str(line["type"]) if line["type"] in FILE_CODES else "wrong-value"
    plain = str(line["msg"]).removeprefix("Value error, ").removeprefix("Assertion failed, ")
    found = str(said.get("found", plain))
    if found.startswith("must "):
        found = f"{place.name} {found}"
    yield Problem(code, place.where, found, said.get("valid", ""), said.get("remedy", ""))


_SENTENCES: Mapping[str, Sentence] = {
    "missing": _missing,
    "extra_forbidden": _unknown,
    "greater_than": _must("wrong-value", "> {gt}{unit}"),
    "greater_than_equal": _must("wrong-value", ">= {ge}{unit}"),
    "less_than": _must("wrong-value", "< {lt}{unit}"),
    "less_than_equal": _must("wrong-value", "<= {le}{unit}"),
    "finite_number": _must("non-finite", "a finite number{in_unit}"),
    "float_type": _must("wrong-type", "a number{in_unit}"),
    "int_type": _must("wrong-type", "a whole number"),
    "string_type": _must("wrong-type", "a text"),
    "bool_type": _must("wrong-type", "true or false"),
    "dict_type": _must("wrong-type", "an object {{...}}"),
    "model_type": _must("wrong-type", "an object {{...}}"),
    "model_attributes_type": _must("wrong-type", "an object {{...}}"),
    "list_type": _must("wrong-type", "a list [...]"),
    "literal_error": _choice,
    "too_short": _too_short,
    "union_tag_invalid": _unknown_kind,
    "union_tag_not_found": _no_kind,
}


def _path_in(raw: Any, loc: Path, kind: str) -> list[str | int]:
    """Pydantic's location without what is not in the file: tags of unions and the like."""
    path: list[str | int] = []
    for k, part in enumerate(loc):
        missing = kind == "missing" and k == len(loc) - 1
        is_key = isinstance(raw, dict) and part in raw
        is_index = isinstance(raw, list) and isinstance(part, int) and part < len(raw)
        if is_key or is_index or missing:
            path.append(part)
        if is_key or is_index:
            raw = raw[part]
    return path


# A JSON Schema, followed along a path.


def _members(root: Mapping[str, Any], node: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """A schema, or its alternatives, with references resolved."""
    if "$ref" in node:
        return _members(root, root["$defs"][node["$ref"].rsplit("/", 1)[-1]])
    for key in ("anyOf", "oneOf"):
        if key in node:
            return [node] + [m for option in node[key] for m in _members(root, option)]
    return [node]


def _schema_at(root: Mapping[str, Any], raw: Any, path: Path) -> Mapping[str, Any]:
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


def _chosen(root: Mapping[str, Any], node: Mapping[str, Any], raw: Any) -> Mapping[str, Any]:
    """Of several kinds, the one that the data names."""
    if "discriminator" in node and isinstance(raw, dict):
        tag = raw.get(node["discriminator"]["propertyName"])
        option = node["discriminator"]["mapping"].get(tag) if isinstance(tag, str) else None
        if option:
            return _members(root, {"$ref": option})[0]
    return node


def _step(node: Mapping[str, Any], part: str | int) -> Mapping[str, Any]:
    if isinstance(part, int):
        found = node.get("items", {})
    else:
        found = node.get("properties", {}).get(part) or node.get("additionalProperties", {})
    return found if isinstance(found, dict) else {}
