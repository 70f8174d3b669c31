"""The form of a part of a document: one field a line, derived from the declarations.

What a user types is taken as soon as it is sound; until then the page keeps it, and what is
wrong stands under the fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from blockmech.blocks.block import REGISTRY
from blockmech.builders import Graph, Opened
from blockmech.editor.edits import Form, markers_of, ports_of, wired
from blockmech.editor.fields import (
    Field,
    Path,
    Units,
    fields_of,
    item_at,
    schema_at,
    schema_of,
    with_item,
)
from blockmech.ground.errors import Problem, refused
from blockmech.model.joints.contents import sections
from blockmech.model.parameters import parameters_of
from blockmech.typing import Data, Record

ITEMS = ("blocks", *sections())
"""Sections of which each item has a form."""

ASIDE = (*ITEMS, "version", "wires", "view", "expect")  # in no form of the document
HINTS = {"place": "x, y or r @ angle", "pair": "x, y", "list": "a; b"}


def parts_of(form: Form) -> list[Path]:
    """The parts of a document that have a form; the empty path is the document with its scene."""
    return [(), *((section, name) for section in ITEMS for name in form.get(section, ()))]


def form_of(
    document: Opened, form: Form, part: Path, units: Units, problems: Iterable[Problem]
) -> Data:
    """The fields of a part as the page shows them, with what is wrong under each."""
    part = part if item_at(form, part) is not None else ()
    messages = [(p.where, message_of(p)) for p in problems]
    groups: dict[str, list[Data]] = {}
    for local, field in fields_by_path(document, form, part).items():
        where = field.path[1] if field.path[0] == "wires" else ".".join(field.path)
        wrong = " ".join(message for at, message in messages if at == where)
        group = local[0] if local[1:] or field.kind == "map" else ""
        groups.setdefault(group, []).append(_row(local, field, _value(form, field), units, wrong))
    kind = (item_at(form, part) or {}).get("type", "") if part else ""
    return {
        "part": list(part),
        "parts": [list(path) for path in parts_of(form)],
        "kind": kind,
        "renamed": part[:1] == ("blocks",),
        "words": (getattr(REGISTRY.get(kind), "__doc__", None) or "").split("\n")[0],
        "groups": [{"name": name, "rows": rows} for name, rows in groups.items()],
    }


def fields_by_path(document: Opened, form: Form, part: Path) -> dict[Path, Field]:
    """The fields of a part, and of the wires to it, by their path within it."""
    return {_within(part, field.path): field for field in _fields(document, form, part)}


def typed(
    document: Opened, form: Form, part: Path, local: Path, text: str | None, units: Units
) -> Form:
    """The form in which what was typed stands in a field; None takes an item of a map away.

    Raises `RequestError` for a field that is not there, and a number that is none.
    """
    fields = fields_by_path(document, form, part)
    if text is None:
        return dict(with_item(form, (*fields[local[:-1]].path, local[-1]), None))
    if local not in fields:
        raise refused(".".join(local), "it has no such field", "choose the part again")
    field = fields[local]
    value = units.value(field, text)
    if field.kind == "number" and isinstance(value, str):
        unit = units.unit(field.unit)
        raise refused(".".join(field.path), f"{text!r} is no number", f"write one [{unit or '-'}]")
    if field.kind == "choice":
        value = {str(choice): choice for choice in field.choices}.get(text)
    if field.kind == "map":
        return dict(with_item(form, (*field.path, value), field.starter)) if value else form
    value = None if value == "" else value
    if value == _value(form, field):
        return form
    for key, only in field.beside if value is not None else ():
        form = dict(with_item(form, (*field.path[:-1], key), only))
    if field.path[0] == "wires":
        return wired(form, value, field.path[1])
    if isinstance(field.starter, dict) and field.path[-1] != value and value in field.starter:
        siblings = item_at(form, field.path[:-1]) or {}
        values = {key: siblings.get(key, x) for key, x in field.starter[value].items()}
        return dict(with_item(form, field.path[:-1], values | {field.path[-1]: value}))
    return dict(with_item(form, field.path, value))


def _fields(document: Opened, form: Form, part: Path) -> Iterator[Field]:
    root = schema_of(isinstance(document, Graph))
    units = {x.path: x.unit for x in parameters_of(document.sections()).values()}
    node = schema_at(root, part)
    if not part:
        sections = node["properties"].items()
        node["properties"] = {key: section for key, section in sections if key not in ASIDE}
    for field in fields_of(root, node, item_at(form, part), part):
        if not (part[:1] == ("blocks",) and field.path == (*part, "type")):
            entries = tuple(
                entry._replace(unit=units.get((*field.path, k), entry.unit))
                for k, entry in enumerate(field.entries)
            )
            yield field._replace(unit=units.get(field.path, field.unit), entries=entries)
    if isinstance(document, Graph) and part[:1] == ("blocks",):
        blocks = document.blocks
        markers = (f"{name}.{m}" for name, b in blocks.items() for m in markers_of(b))
        ends = Field((), "choice", choices=("", *markers))
        for port in ports_of(blocks[part[1]]):
            yield ends._replace(path=("wires", f"{part[1]}.{port}"))


def _row(local: Path, field: Field, value: Any, units: Units, wrong: str) -> Data:
    """A field as the page shows it, in the chosen units."""
    names, empty = [units.unit(x.unit) for x in field.entries or (field,)], ""
    unit = ", ".join(names if len({*names}) > 1 else names[:1])
    row = {
        "path": list(local),
        "kind": field.kind if field.kind in ("choice", "map") else "text",
        "label": _label(local, field.kind) + (unit and f" [{unit}]"),
        "about": field.said or "",
        "wrong": wrong,
        "wide": field.kind in ("text", "json") and len(local) == 1,
        "keys": list(value or ()) if field.kind == "map" else [],
    }
    if field.kind == "choice":
        empty = "" if field.default is None else f"{field.default} (default)"
        offered = [(str(c), str(c)) for c in field.choices if c != ""]
        first = [] if value is not None and not empty else [("", empty)]
        return {**row, "options": first + offered, "value": "" if value is None else str(value)}
    default = units.text(field, field.default) or HINTS.get(field.kind, "")
    return {
        **row,
        "hint": default,
        "value": "" if row["kind"] == "map" else units.text(field, value),
    }


def _value(form: Record, field: Field) -> Any:
    """What a form holds for a field: of a joint, the marker that is wired to it."""
    if field.path[0] != "wires":
        return item_at(form, field.path)
    return next((w["from"] for w in form["wires"] if w["to"] == field.path[1]), None)


def _within(part: Path, path: Path) -> Path:
    """A path from a part on; what is in the scene is the mechanism's own."""
    local = path if path[0] == "wires" else path[len(part) :]
    return local[1:] if local[0] == "scene" else local


def _label(local: Path, kind: str) -> str:
    """What a field is called: its path, without the section where names follow."""
    if local[0] == "wires":
        return f"wire to {local[1]}"
    return "new in " * (kind == "map") + " ".join(local[len(local) > 2 :])


def message_of(problem: Problem) -> str:
    """A problem as a sentence, without its code."""
    return ". ".join(part for part in (problem.found, problem.valid, problem.remedy) if part)
