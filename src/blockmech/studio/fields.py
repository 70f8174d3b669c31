"""The fields of a form, derived from the JSON Schema of what is edited.

A field is one line of the form: a number, a word of some, a yes or no, a vector, or a text of
JSON for whatever has no shorter way. Values are SI in the file; a field shows and reads
lengths and angles in the units that the user chose.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from blockmech.validation_errors import UNITS

Path = tuple[str, ...]
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
PAIR = re.compile(rf"\s*\[?\s*({NUMBER})\s*(,|@|\s)\s*({NUMBER})\s*\]?\s*")
DIGITS = 17  # that tell every double from its neighbours


class Field(NamedTuple):
    """One line of a form.

    kind : number, pair, place, choice, flag, text, json; map is a section that takes new keys
    """

    path: Path
    kind: str
    unit: str = ""  # SI
    default: Any = None
    choices: tuple[Any, ...] = ()
    said: str = ""  # what the declaration says of it
    required: bool = False
    starter: Any = None  # of a map: what a new item is
    beside: tuple[tuple[str, Any], ...] = ()  # keys that stand beside it with one value only

    @property
    def where(self) -> str:
        """Its address below what is edited, as in messages."""
        return ".".join(self.path)


def resolved(root: Mapping[str, Any], node: Mapping[str, Any]) -> dict[str, Any]:
    """A schema with its reference followed, and what an optional value is if it is given."""
    while True:
        if "$ref" in node:
            more = {k: v for k, v in node.items() if k not in ("$ref", "properties")}
            node = {**root["$defs"][node["$ref"].rsplit("/", 1)[-1]], **more}
        options = [o for o in node.get("anyOf", ()) if o.get("type") != "null"]
        if len(options) == 1:
            more = {k: v for k, v in node.items() if k != "anyOf"}
            node = {**options[0], **more}
        else:
            return dict(node)


def starter(root: Mapping[str, Any], node: Mapping[str, Any]) -> Any:
    """The simplest value that a schema allows: what is required, and nothing else."""
    node = resolved(root, node)
    if "const" in node:
        return node["const"]
    if "enum" in node:
        return node["enum"][0]
    options = node.get("oneOf") or node.get("anyOf")
    if options:
        tags = node.get("discriminator", {})
        key = {tags["propertyName"]: next(iter(tags["mapping"]))} if tags else {}
        made = starter(
            root, {"$ref": tags["mapping"][key[tags["propertyName"]]]} if tags else options[0]
        )
        return {**key, **made} if tags else made
    if node.get("type") == "object":
        known = node.get("properties", {})
        return {key: starter(root, known[key]) for key in node.get("required", ()) if key != "type"}
    if node.get("type") == "array":
        return [starter(root, node.get("items", {})) for _ in range(node.get("minItems", 0))]
    return {"string": "", "boolean": False}.get(str(node.get("type")), 1.0)


def fields_of(
    root: Mapping[str, Any], node: Mapping[str, Any], raw: Any, path: Path = ()
) -> Iterator[Field]:
    """The fields of what a schema describes and what it holds, in the order of the schema."""
    node = resolved(root, node)
    tags = node.get("discriminator", {}).get("mapping", {})
    if tags:
        key = node["discriminator"]["propertyName"]
        word = raw.get(key) if isinstance(raw, dict) else None
        yield Field((*path, key), "choice", choices=("", *tags) if word is None else tuple(tags))
        if word in tags:
            chosen = resolved(root, {"$ref": tags[word]})
            rest = {k: v for k, v in chosen["properties"].items() if k != key}
            yield from fields_of(root, {**chosen, "properties": rest}, raw, path)
        return
    if "properties" in node and node.get("type") == "object":
        required = node.get("required", ())
        known = {key: resolved(root, item) for key, item in node["properties"].items()}
        only = tuple((k, n["const"]) for k, n in known.items() if "const" in n and k != "type")
        for key, own in known.items():
            if "const" in own:
                continue
            inner = raw.get(key) if isinstance(raw, dict) else None
            for field in fields_of(root, own, inner, (*path, key)):
                mine = field.path == (*path, key)
                needed = key in required
                yield field._replace(required=needed, beside=only) if mine else field
        return
    more = node.get("additionalProperties")
    if isinstance(more, dict) and node.get("type") == "object":
        yield Field(path, "map", starter=starter(root, more))
        for key, item in (raw or {}).items():
            yield from fields_of(root, more, item, (*path, key))
        return
    yield _leaf(node, path)


def _leaf(node: Mapping[str, Any], path: Path) -> Field:
    said, default = str(node.get("description", "")).split("\n")[0], node.get("default")
    kind, unit = "json", str(node.get("unit", ""))
    polar = any("polar" in o.get("properties", {}) for o in node.get("anyOf", ()))
    if polar:
        kind, unit = "place", "m"
    elif "enum" in node:
        return Field(path, "choice", unit, default, tuple(node["enum"]), said)
    elif node.get("type") in ("number", "integer"):
        kind = "number"
    elif node.get("type") == "boolean":
        kind = "flag"
    elif node.get("type") == "string":
        kind = "text"
    elif node.get("minItems") == node.get("maxItems") == 2:
        kind = "pair"
    return Field(path, kind, unit, default, (), said)


class Shown(NamedTuple):
    """Units in which a form shows lengths and angles; files stay SI."""

    length: str = "m"
    angle: str = "rad"

    def unit(self, si: str) -> str:
        """The unit that is shown for one of SI."""
        return {"m": self.length, "rad": self.angle}.get(si, si)

    def factor(self, si: str) -> float:
        """How many of the units shown make one of SI."""
        return UNITS[self.unit(si)][1] if si in ("m", "rad") else 1.0

    def text(self, field: Field, value: Any) -> str:
        """A value as it stands in a field; nothing for one that is not given."""
        if value is None:
            return ""
        k = self.factor(field.unit)
        if field.kind == "number" and isinstance(value, int | float):
            return _digits(value, k)
        if field.kind == "place" and isinstance(value, dict):
            r, angle = value["polar"]
            return f"{_digits(r, k)} @ {_digits(angle, self.factor('rad'))}"
        if field.kind in ("place", "pair"):
            return ", ".join(_digits(x, k) for x in value)
        return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)

    def value(self, field: Field, text: str) -> Any:
        """The value that a text means; a text that means none is itself, which is refused."""
        text, k = text.strip(), self.factor(field.unit)
        if text == "":
            return None
        if field.kind == "number" and re.fullmatch(NUMBER, text):
            return _si(text, k)
        pair = PAIR.fullmatch(text) if field.kind in ("place", "pair") else None
        if pair and pair[2] == "@":
            return {"polar": [_si(pair[1], k), _si(pair[3], self.factor("rad"))]}
        if pair:
            return [_si(pair[1], k), _si(pair[3], k)]
        if field.kind == "json":
            try:
                return json.loads(text)
            except ValueError:
                return text
        return text


def _digits(value: float, k: float) -> str:
    """The shortest text of a value in units of which ``k`` make one, that reads as the same."""
    near = (float(f"{value * k:.{digits}g}") for digits in range(1, DIGITS + 1))
    texts = (repr(x).removesuffix(".0") for x in near)
    return next((text for text in texts if _si(text, k) == value), repr(value * k))


def _si(text: str, k: float) -> float:
    return float(text) if k == 1.0 else float(text) / k


def item_at(raw: Any, path: Path) -> Any:
    """The item at a path, None where there is none."""
    for key in path:
        raw = raw.get(key) if isinstance(raw, dict) else None
    return raw


def with_item(raw: Any, path: Path, value: Any) -> Any:
    """A copy with another item at a path; None takes it away, and objects left empty too."""
    if not path:
        return value
    held = dict(raw) if isinstance(raw, dict) else {}
    inner = with_item(held.get(path[0]), path[1:], value)
    held[path[0]] = inner
    gone = inner is None or (inner == {} and len(path) > 1)
    return {k: v for k, v in held.items() if k != path[0]} if gone else held
