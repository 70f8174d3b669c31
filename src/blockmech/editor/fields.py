"""The fields of a form, derived from the JSON Schema of what is edited.

A field is one line of the form: a number, a choice, a vector, or a text of JSON for whatever
has no shorter way. Values are SI in the file; a field shows and reads lengths and angles in the
units that the user chose.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from decimal import Decimal
from fractions import Fraction
from functools import cache, reduce
from itertools import chain, cycle
from operator import getitem
from typing import Any, NamedTuple

from blockmech.blocks.block import REGISTRY
from blockmech.ground.errors import BlockmechError
from blockmech.ground.units import PI, NoQuantity, quantity, si_of, unit_behind
from blockmech.model.schema import graph_schema, joints_schema
from blockmech.typing import Data, Record

Path = tuple[str, ...]
Schema = Record
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
COMMA = re.compile(r"([-+]?\d+),(\d+)(?![\d,.])")
ENTRIES = ("number", "place", "text")  # kinds of fields that stand in a list
DIGITS = sys.float_info.dig + 2  # 17, that tell every double from its neighbours


class Field(NamedTuple):
    """One line of a form.

    path : where its value is in the form of the document
    kind : number, pair, place, choice, text, json; list has several of its ``entries``; map is a
        section that takes new keys
    unit : of SI
    said : what the declaration says of it
    starter : of a map what a new item is, of a choice among kinds what each begins with
    beside : keys that stand beside it with one value only
    """

    path: Path
    kind: str
    unit: str = ""
    default: Any = None
    choices: tuple[Any, ...] = ()
    said: str = ""
    starter: Any = None
    beside: tuple[tuple[str, Any], ...] = ()
    entries: tuple[Any, ...] = ()


def schema_of(blocks: bool) -> Schema:
    """The schema of documents of blocks, or of links and joints; made once for known kinds."""
    return _schema(blocks, tuple(REGISTRY))


@cache
def _schema(blocks: bool, kinds: tuple[str, ...]) -> Schema:
    return graph_schema() if blocks else joints_schema()


def resolved(root: Schema, node: Schema) -> Data:
    """A schema with its reference followed, and what an optional value is if it is given."""
    while True:
        if "$ref" in node:
            overrides = {k: v for k, v in node.items() if k not in ("$ref", "properties")}
            target = reduce(getitem, node["$ref"].removeprefix("#/").split("/"), root)
            needed = [*target.get("required", ()), *overrides.get("required", ())]
            node = {**target, **overrides, **({"required": needed} if needed else {})}
        options = [o for o in node.get("anyOf", ()) if o.get("type") != "null"]
        if len(options) == 1:
            overrides = {k: v for k, v in node.items() if k != "anyOf"}
            node = {**options[0], **overrides}
        else:
            return dict(node)


def schema_at(root: Schema, path: Path) -> Data:
    """The schema of what stands at a path of a document."""
    node = dict(root)
    for key in path:
        item = node.get("properties", {}).get(key)
        node = resolved(root, node.get("additionalProperties", {}) if item is None else item)
    return node


def kinds_of(node: Schema) -> tuple[str, dict[str, Schema]]:
    """The key whose word tells which of some schemas holds, and these by word."""
    if "discriminator" in node:
        tags = node["discriminator"]
        return tags["propertyName"], {w: {"$ref": ref} for w, ref in tags["mapping"].items()}
    rules = [rule for rule in node.get("allOf", ()) if "properties" in rule["if"]]
    keys = {key for rule in rules for key in rule["if"]["properties"]}
    by_word = {r["if"]["properties"][k]["const"]: r["then"] for r in rules for k in keys}
    return "".join(keys), by_word


def starter(root: Schema, node: Schema) -> Any:
    """The simplest value that a schema allows: what is required, and nothing else."""
    node = resolved(root, node)
    key, kinds = kinds_of(node)
    if kinds:
        word, first = next(iter(kinds.items()))
        return {key: word, **starter(root, first)}
    if "const" in node:
        return node["const"]
    if "enum" in node:
        return node["enum"][0]
    if "anyOf" in node:
        return starter(root, node["anyOf"][0])
    if node.get("type") == "object":
        properties = node.get("properties", {})
        return {
            key: starter(root, properties[key]) for key in node.get("required", ()) if key != "type"
        }
    if node.get("type") == "array":
        items = node.get("prefixItems") or [node.get("items", {})] * node.get("minItems", 0)
        return [starter(root, item) for item in items]
    simplest = {"string": "", "boolean": False, "integer": node.get("minimum", 1)}
    return simplest.get(str(node.get("type")), 1.0)


def simplest(kind: str) -> dict[str, Any] | None:
    """The values with which a block of a kind begins: what is required, else one field more.

    None for kinds that need more than that.
    """
    root = schema_of(blocks=True)
    node = root["$defs"][kind]
    required = starter(root, node)
    extras = ((key, starter(root, item)) for key, item in node.get("properties", {}).items())
    fields = ({key: x} for key, x in extras if not isinstance(x, dict))
    for extra in chain(({},), fields):
        values = {**extra, **required}
        with suppress(BlockmechError):
            REGISTRY[kind](**values)
            return values
    return None


def fields_of(root: Schema, node: Schema, raw: Any, path: Path = ()) -> Iterator[Field]:
    """The fields of what a schema describes and what it holds, in the order of the schema."""
    node, raw = resolved(root, node), raw if isinstance(raw, dict) else {}
    key, kinds = kinds_of(node)
    if kinds:
        word = raw.get(key)
        starters = {w: {key: w, **starter(root, kind)} for w, kind in kinds.items()}
        choices = tuple(kinds) if word else ("", *kinds)
        yield Field((*path, key), "choice", choices=choices, starter=starters)
        rules = (rule for rule in node.get("allOf", ()) if "not" in rule["if"])  # without a word
        bare = next((rule["then"] for rule in rules), {"type": "object"})
        node = resolved(root, kinds.get(word, bare))
        node["properties"] = {k: v for k, v in node.get("properties", {}).items() if k != key}
    if "properties" in node and node.get("type") == "object":
        properties = {name: resolved(root, item) for name, item in node["properties"].items()}
        only = tuple((k, n["const"]) for k, n in properties.items() if "const" in n and k != "type")
        never = node.get("not", {}).get("required", ())
        for name, entry in properties.items():
            if "const" not in entry and name not in never:
                about = _description(str(node.get("description", "")), name)
                for field in fields_of(root, entry, raw.get(name), (*path, name)):
                    is_item = field.path == (*path, name)
                    yield (
                        field._replace(beside=only, said=field.said or about) if is_item else field
                    )
        return
    entries = node.get("additionalProperties")
    if isinstance(entries, dict) and node.get("type") == "object":
        yield Field(path, "map", starter=starter(root, entries))
        for name, item in raw.items():
            yield from fields_of(root, entries, item, (*path, name))
        return
    yield _leaf(root, node, path)


def _leaf(root: Schema, node: Schema, path: Path) -> Field:
    unit, about = (str(node.get(key, "")) for key in ("unit", "description"))
    leaf = Field(path, "json", unit, node.get("default"), said=about)
    if any("polar" in o.get("properties", {}) for o in node.get("anyOf", ())):
        return leaf._replace(kind="place", unit="m")
    if "enum" in node or node.get("type") == "boolean":
        return leaf._replace(kind="choice", choices=tuple(node.get("enum", (False, True))))
    if node.get("minItems") == node.get("maxItems") == 2:
        return leaf._replace(kind="pair")
    items = node.get("prefixItems") or filter(None, [node.get("items")])
    entries = tuple(_leaf(root, resolved(root, item), path) for item in items)
    if entries and all(entry.kind in ENTRIES for entry in entries):
        return leaf._replace(kind="list", unit=entries[0].unit, entries=entries)
    kinds = {"number": "number", "integer": "number", "string": "text"}
    return leaf._replace(kind=kinds.get(str(node.get("type")), "json"))


def _description(doc: str, name: str) -> str:
    """What a docstring says of a parameter, on one line."""
    match = re.search(rf"^[\w, ]*\b{re.escape(name)}\b[\w, ]* : (.*(?:\n    .*)*)", doc, re.M)
    return " ".join(match[1].split()) if match else ""


CHOICES = {
    "Lengths": ("m", "mm", "inch"),
    "Angles": ("rad", "deg"),
    "Rates": ("rad/s", "rpm"),
    "Forces": ("N", "kN", "lbf"),
}
"""Units that a user may choose, the SI unit first."""


class Units(dict[str, str]):
    """Units in which a form shows lengths, angles, rates and forces, by their SI units.

    What is in SI may be left out.
    """

    @classmethod
    def of(cls, choices: str) -> Units:
        """Units as a user's browser keeps them, ``"mm|deg|rpm|N"``; SI where it keeps others."""
        pairs = zip(choices.split("|"), CHOICES.values(), strict=False)
        return cls({units[0]: word for word, units in pairs if word in units})

    def unit(self, si: str) -> str:
        """The unit that is shown for one of SI."""
        return self.get(si, si)

    def _many(self, si: str) -> Fraction:
        """How many of the shown unit make one of SI; doubles are too few to go back."""
        return 1 / si_of(self.unit(si), si)

    def text(self, field: Field, value: Any) -> str:
        """A value as it stands in a field; nothing for one that is not given."""
        if value is None:
            return ""
        k = self._many(field.unit)
        if field.kind == "number" and _is_number(value):
            return _digits(value, k)
        if field.kind == "place" and isinstance(value, dict):
            r, angle = value["polar"]
            return f"{_digits(r, k)} @ {_digits(angle, self._many('rad'))}"
        if field.kind == "list" and isinstance(value, list):
            return "; ".join(map(self.text, cycle(field.entries), value))
        numbers = isinstance(value, list) and all(map(_is_number, value))
        if field.kind in ("place", "pair") and numbers:
            return ", ".join(_digits(x, k) for x in value)
        return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)

    def number(self, text: str, si: str) -> float | None:
        """A number as people type it, in the unit behind it or else the one shown.

        A comma may stand for the point, and fractions and multiples of pi are numbers:
        ``80 mm``, ``1,5``, ``1/2``, ``2*pi``, ``60 rpm``. None for anything else.
        """
        word = COMMA.sub(r"\1.\2", text.strip().replace("\N{MINUS SIGN}", "-"), count=1)
        plain = _value(word)
        if plain is not None:
            return float(plain / self._many(si))
        try:
            return quantity(word, si) if unit_behind(word) else None
        except NoQuantity:
            return None

    def value(self, field: Field, text: str) -> Any:
        """The value that a text means; a text that means none is itself, which is refused."""
        text = text.strip()
        if text == "":
            return None
        if field.kind == "number":
            x = self.number(text, field.unit)
            return text if x is None else x
        if field.kind in ("place", "pair"):
            return self._pair(field, text)
        if field.kind == "list" and text[0] != "[":
            return list(map(self.value, cycle(field.entries), text.split(";")))
        return _plain_data(text) if field.kind in ("json", "list") else text

    def _pair(self, field: Field, text: str) -> Any:
        """Two numbers, or a length at an angle; JSON for what else a pair may be."""
        inner = text.removeprefix("[").removesuffix("]")
        polar = "@" in inner
        for mark in "@" if polar else (";", ",", " "):
            parts = [part for part in inner.split(mark) if part.strip()]
            if len(parts) == 2:
                units = (field.unit, "rad" if polar else field.unit)
                x, y = (self.number(*of) for of in zip(parts, units, strict=True))
                if x is not None and y is not None:
                    return {"polar": [x, y]} if polar else [x, y]
        return _plain_data(text)


def _plain_data(text: str) -> Any:
    """What a text of JSON holds; a text that is none is itself."""
    with suppress(ValueError):
        return json.loads(text)
    return text


def _is_number(x: object) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _value(text: str) -> Fraction | None:
    """A product or quotient of two numbers, of which pi may be one, or a number."""
    for mark in "*/":
        if mark in text:
            a, _, b = text.partition(mark)
            x, y = _value(a), _value(b)
            if x is None or y is None or (mark == "/" and not y):
                return None
            return x * y if mark == "*" else x / y
    word = text.strip()
    if word in ("pi", "π", "-pi", "-π"):
        return -PI if word[0] == "-" else PI
    if not re.fullmatch(NUMBER, word) or not math.isfinite(float(word)):
        return None  # which ends at once where a number is written that is far too large
    return Fraction(word) if abs(float(word)) > 1e-300 else Fraction(0)


def _digits(value: float, many: Fraction) -> str:
    """The shortest text of a value in units of which ``many`` make one, that reads as the same."""
    exact = Fraction(value) * many
    for digits in range(1, DIGITS + 1):
        text = repr(float(f"{float(exact):.{digits}g}")).removesuffix(".0")
        if float(Fraction(text) / many) == value:
            return text
    return f"{Decimal(exact.numerator) / Decimal(exact.denominator):.{DIGITS + 1}g}"


def item_at(raw: Any, path: Path) -> Any:
    """The item at a path, None where there is none."""
    for key in path:
        raw = raw.get(key) if isinstance(raw, dict) else None
    return raw


def with_item(raw: Any, path: Path, value: Any) -> Any:
    """A copy with another item at a path; None takes it away, and objects left empty too."""
    if not path:
        return value
    copy = dict(raw) if isinstance(raw, dict) else {}
    inner = with_item(copy.get(path[0]), path[1:], value)
    copy[path[0]] = inner
    gone = inner is None or (inner == {} and len(path) > 1)
    return {k: v for k, v in copy.items() if k != path[0]} if gone else copy
