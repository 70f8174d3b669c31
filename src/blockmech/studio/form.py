"""The form of what is selected: one field a line, derived from the declarations.

What a user types goes into a draft of the document. It is taken as soon as it is sound; until
then what is wrong stands under the fields, and the sheet stays as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import param

from blockmech.blocks.registry import REGISTRY
from blockmech.builders import Graph
from blockmech.ground.errors import BlockmechError, Problem
from blockmech.model.parameters import parameters_of
from blockmech.studio.component import Component, script, style
from blockmech.studio.edits import markers_of, ports_of, renamed, wired
from blockmech.studio.fields import (
    Field,
    Path,
    Shown,
    fields_of,
    item_at,
    schema_at,
    schema_of,
    with_item,
)
from blockmech.studio.session import follow, together
from blockmech.studio.sheet import Sheet

MECHANISM: Path = ()
"""What is selected where no block is: the document and its scene."""

ITEMS = ("blocks", "links", "joints", "drivers", "loads")  # each of them has a form
ASIDE = (*ITEMS, "version", "wires", "view", "expect")  # in no form of the document
HINTS = {"place": "x, y or r @ angle", "pair": "x, y", "json": "JSON", "map": ""}
NOTHING = {"parts": [], "selected": 0, "name": None, "kind": "", "words": "", "groups": []}


class Fields(Component):
    """The form in the browser."""

    shown = param.Dict(default={})

    _esm = script("form.js")
    _stylesheets = [style("form.css")]


class Form(param.Parameterized):  # type: ignore[misc]  # as the sheet
    """The form of the document or of a part of it; ``selected`` is the path to it."""

    selected = param.Parameter(default=MECHANISM)
    shown = param.Parameter(default=Shown())

    def __init__(self, sheet: Sheet, say: Callable[[str], None]) -> None:
        super().__init__()
        self.sheet, self.say = sheet, say
        self.draft: dict[str, Any] = {}
        self.fields: dict[Path, Field] = {}  # by path within what is selected
        self.wrong: dict[Path, str] = {}
        self.parts: list[Path] = []
        self.page = Fields(self.meant, shown=NOTHING, sizing_mode="stretch_width")
        self.param.watch(lambda *_: self.renew(), ["selected", "shown"])
        follow(sheet, self.renew, "form", "problems")
        self.renew()

    # -- what is shown ----------------------------------------------------

    @together
    def renew(self) -> None:
        """Show what the sheet holds of what is selected; what was not sound is forgotten."""
        self.draft = self.sheet.form
        if self.selected and item_at(self.draft, self.selected) is None:
            self.selected = MECHANISM
            return
        self._show(self.sheet.problems)

    def _show(self, problems: Iterable[Problem]) -> list[Problem]:
        """Show the fields of the draft, with what is wrong under each; what is left of it."""
        self.parts = [MECHANISM, *((p, name) for p in ITEMS for name in self.draft.get(p, ()))]
        self.fields = {_within(self.selected, field.path): field for field in self._fields()}
        messages = [(p.where, _words(p)) for p in problems]
        groups: dict[str, list[dict[str, Any]]] = {}
        for own, field in self.fields.items():
            where = field.path[1] if field.path[0] == "wires" else ".".join(field.path)
            self.wrong[own] = " ".join(words for at, words in messages if at == where)
            group = own[0] if own[1:] or field.kind == "map" else ""
            groups.setdefault(group, []).append(self._row(own, field))
        kind = (item_at(self.draft, self.selected) or {}).get("type", "") if self.selected else ""
        parts = [name if of == "blocks" else f"{of[:-1]} {name}" for of, name in self.parts[1:]]
        self.page.shown = {
            "parts": ["mechanism", *parts],
            "selected": self.parts.index(self.selected),
            "name": self.selected[1] if self.selected[:1] == ("blocks",) else None,
            "kind": kind,
            "words": (getattr(REGISTRY.get(kind), "__doc__", None) or "").split("\n")[0],
            "groups": [{"name": name, "rows": rows} for name, rows in groups.items()],
        }
        return [p for p in problems if _words(p) not in self.wrong.values()]

    def _fields(self) -> Iterator[Field]:
        """The fields of what is selected, and of the wires to a block."""
        graph, form, at = self.sheet.document, self.draft, self.selected
        root = schema_of(isinstance(graph, Graph))
        units = {x.path: x.unit for x in parameters_of(graph.sections()).values()}
        node = schema_at(root, at)
        if not at:
            parts = node["properties"].items()
            node["properties"] = {key: part for key, part in parts if key not in ASIDE}
        for field in fields_of(root, node, item_at(form, at), at):
            if not (at[:1] == ("blocks",) and field.path == (*at, "type")):
                yield field._replace(unit=units.get(field.path, field.unit))
        if at[:1] == ("blocks",):
            markers = (f"{name}.{m}" for name, b in graph.blocks.items() for m in markers_of(b))
            ends = Field((), "choice", choices=("", *markers))  # "": not wired
            for port in ports_of(graph.blocks[at[1]]):
                yield ends._replace(path=("wires", f"{at[1]}.{port}"))

    def _row(self, own: Path, field: Field) -> dict[str, Any]:
        """A field as the browser shows it, in the chosen units."""
        value, unit, empty = self._value(field), self.shown.unit(field.unit), ""
        row = {
            "path": list(own),
            "kind": field.kind if field.kind in ("choice", "map") else "text",
            "label": _label(own, field.kind) + (unit and f" [{unit}]"),
            "about": field.said or "",
            "wrong": self.wrong[own],
            "wide": field.kind in ("text", "json") and len(own) == 1,
            "keys": list(value or ()) if field.kind == "map" else [],
        }
        if field.kind == "choice":
            empty = "" if field.default is None else f"{field.default} (default)"
            known = [(str(c), str(c)) for c in field.choices if c != ""]
            first = [] if value is not None and not empty else [("", empty)]
            return {**row, "options": first + known, "value": "" if value is None else str(value)}
        default = self.shown.text(field, field.default) or HINTS.get(field.kind, "")
        shown = "" if field.kind == "map" else self.shown.text(field, value)
        return {**row, "hint": default, "value": shown}

    def _value(self, field: Field) -> Any:
        """What the draft holds for a field: of a joint, the marker that is wired to it."""
        if field.path[0] != "wires":
            return item_at(self.draft, field.path)
        return next((w["from"] for w in self.draft["wires"] if w["to"] == field.path[1]), None)

    # -- what is done -----------------------------------------------------

    def meant(self, msg: dict[str, Any]) -> None:
        """Do what was done to the form."""
        own = tuple(msg.get("path", ()))
        if msg["act"] == "edit":
            self.selected = self.parts[msg["index"]]
        elif msg["act"] == "rename":
            self._rename(msg["value"].strip())
        elif own in self.fields and msg["act"] == "remove":
            self._take((*self.fields[own].path, msg["key"]), None)
        elif own in self.fields:
            self.typed(own, msg["value"])

    def typed(self, own: Path, said: str) -> None:
        """Something was typed or chosen; nothing is done where it is what the draft holds."""
        field = self.fields[own]
        value = self.shown.value(field, said)
        if field.kind == "choice":
            value = {str(choice): choice for choice in field.choices}.get(said)
        if field.kind == "map":
            if value:
                self._take((*field.path, value), field.starter)
        elif (value := None if value == "" else value) != self._value(field):
            for key, only in field.beside if value is not None else ():
                self.draft = with_item(self.draft, (*field.path[:-1], key), only)
            self._take(field.path, value, field.starter)

    def _take(self, path: Path, value: Any, kinds: Any = None) -> None:
        """Put a value into the draft, and the draft, if it is sound, on the sheet.

        Another of some ``kinds`` begins with what it needs, as far as there is none already.
        """
        before, what = self.sheet.form, " ".join(_within(self.selected, path))
        if path[0] == "wires":
            what = f"{value} -> {path[1]}" if value else f"{path[1]} not wired"
            self.draft = wired(self.draft, value, path[1])
        elif isinstance(kinds, dict) and path[-1] != value and value in kinds:
            held = item_at(self.draft, path[:-1]) or {}
            begun = {key: held.get(key, x) for key, x in kinds[value].items()} | {path[-1]: value}
            self.draft = with_item(self.draft, path[:-1], begun)
        else:
            self.draft = with_item(self.draft, path, value)
        try:
            self.sheet.change(self.draft, what)
            if self.sheet.form is before:
                self.renew()
        except BlockmechError as error:
            self.say("; ".join(map(str, self._show(error.problems)[:3])))

    def _rename(self, new: str) -> None:
        if not self.selected or new == self.selected[-1]:
            return
        old, (section, _) = self.selected[-1], self.selected
        try:
            self.sheet.change(renamed(self.sheet.form, old, new), f"{old} renamed to {new}")
            self.selected = (section, new)
        except BlockmechError as error:
            self.say(_words(error.problems[0]))


def _within(selected: Path, path: Path) -> Path:
    """A path from what is selected on; what is in the scene is the mechanism's own."""
    own = path if path[0] == "wires" else path[len(selected) :]
    return own[1:] if own[0] == "scene" else own


def _label(own: Path, kind: str) -> str:
    """What a field is called: its path, without the section where names follow."""
    if own[0] == "wires":
        return f"wire to {own[1]}"
    return "new in " * (kind == "map") + " ".join(own[len(own) > 2 :])


def _words(problem: Problem) -> str:
    """A problem as a sentence, without its code."""
    return ". ".join(part for part in (problem.found, problem.valid, problem.remedy) if part)
