"""The form of what is selected: one field a line, derived from the declarations.

What a user types goes into a draft of the document. It is taken as soon as it is sound; until
then what is wrong stands under the fields, and the sheet stays as it was.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator
from functools import cache
from itertools import chain
from typing import Any, NamedTuple

import panel as pn
import param

from blockmech.blocks.registry import REGISTRY
from blockmech.builders import Graph
from blockmech.errors import BlockmechError, Problem
from blockmech.model.parameters import parameters_of
from blockmech.model.schema import graph_schema, joints_schema
from blockmech.studio.edits import markers_of, ports_of, renamed, wired
from blockmech.studio.fields import Field, Path, Shown, fields_of, item_at, schema_at, with_item
from blockmech.studio.looks import beside
from blockmech.studio.session import follow, together
from blockmech.studio.sheet import Sheet

MECHANISM: Path = ()
"""What is selected where no block is: the document and its scene."""

ITEMS = ("blocks", "links", "joints", "drivers", "loads")  # each of them has a form
ASIDE = (*ITEMS, "version", "wires", "view", "expect")  # in no form of the document
HINTS = {"place": "x, y or r @ angle", "pair": "x, y", "json": "JSON", "map": ""}
LINE = 148  # px of a field: three or four beside each other in half a window


class Row(NamedTuple):
    """A field on the page: where a value is typed, and what is wrong with it."""

    field: Field
    widget: Any
    wrong: Any
    panel: Any


class Form(param.Parameterized):  # type: ignore[misc]  # as the sheet
    """The form of the document or of a part of it; ``selected`` is the path to it."""

    selected = param.Parameter(default=MECHANISM)
    shown = param.Parameter(default=Shown())

    def __init__(self, sheet: Sheet, say: Callable[[str], None]) -> None:
        super().__init__()
        self.sheet, self.say = sheet, say
        self.draft: dict[str, Any] = {}
        self.rows: dict[Path, Row] = {}  # by path within what is selected
        self.headings: dict[str, Any] = {}
        self.edit = pn.widgets.Select(label="Edit", width=LINE)
        self.called = pn.widgets.TextInput(label="Name", width=LINE)
        self.about = pn.pane.HTML("", sizing_mode="stretch_width")
        self.head = pn.Row(self.edit, self.called, self.about, sizing_mode="stretch_width")
        self.body = beside(sizing_mode="stretch_width", margin=0)
        self.column = pn.Column(self.head, self.body, sizing_mode="stretch_width")
        self.edit.param.watch(lambda event: self.param.update(selected=event.new), "value")
        self.called.param.watch(lambda event: self._rename(event.new.strip()), "value")
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
        parts = [(part, name) for part in ITEMS for name in self.draft.get(part, ())]
        words = {at: at[1] if at[0] == "blocks" else f"{at[0][:-1]} {at[1]}" for at in parts}
        options = {"mechanism": MECHANISM, **{word: at for at, word in words.items()}}
        self.edit.param.update(options=options, value=self.selected)
        kind = (item_at(self.draft, self.selected) or {}).get("type", "") if self.selected else ""
        said = (getattr(REGISTRY.get(kind), "__doc__", None) or "").split("\n")[0]
        self.about.object = f"<h2>{html.escape(kind)}</h2><p>{html.escape(said)}</p>"
        self.called.visible = self.selected[:1] == ("blocks",)
        self.called.value = self.selected[-1] if self.selected else ""
        self._show()
        self._tell(self.sheet.problems)

    def _show(self) -> None:
        """Show the fields of the draft; those that were there stay, with what they hold now."""
        rows = {}
        for field in self._fields():
            own = _within(self.selected, field.path)
            row = self.rows.get(own)
            row = self._row(own, field) if row is None or row.field.kind != field.kind else row
            rows[own] = row._replace(field=field)
        old, self.rows = self.rows, rows
        for row in rows.values():
            self._set(row)
        if [row.panel for row in old.values()] != [row.panel for row in rows.values()]:
            lines: dict[str, list[Any]] = {}
            for own, row in rows.items():
                group = own[0] if own[1:] or row.field.kind == "map" else ""
                lines.setdefault(group, []).append(row.panel)
            self.headings = {name: self.headings.get(name) or _heading(name) for name in lines}
            parts = ((self.headings[name], *panels) for name, panels in lines.items())
            self.body.objects = list(chain(*parts))  # the page is laid out at each change

    def _fields(self) -> Iterator[Field]:
        """The fields of what is selected, and of the wires to a block."""
        graph, form, at = self.sheet.document, self.draft, self.selected
        root = _schema(isinstance(graph, Graph), tuple(REGISTRY))
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

    def _row(self, own: Path, field: Field) -> Row:
        kind = pn.widgets.Select if field.kind == "choice" else pn.widgets.TextInput
        wide = field.kind in ("text", "json") and len(own) == 1
        widget = kind(width=LINE * (1 + wide), margin=(2, 4))
        widget.param.watch(lambda event: self._typed(own, event.new), "value")
        wrong = pn.pane.HTML("", width=LINE, margin=(0, 4))
        line = pn.Row(widget, margin=0) if field.kind == "map" else widget
        return Row(field, widget, wrong, pn.Column(line, margin=0))

    def _set(self, row: Row) -> None:
        """Show what the draft holds for a field, in the chosen units."""
        field, value = row.field, self._value(row.field)
        unit, own = self.shown.unit(field.unit), _within(self.selected, field.path)
        label = _label(own, field.kind) + (unit and f" [{unit}]")
        if field.kind == "choice":
            empty = "" if field.default is None else f"{field.default} (default)"
            known = {str(c): c for c in field.choices}
            options = known if value is not None and not empty else {empty: "", **known}
            look = {"options": options, "value": "" if value is None else value}
        elif field.kind == "map":
            look = {"value": ""}
            keys, line = list(value or ()), row.panel[0]
            if [button.label for button in line[1:]] != [f"Remove {key}" for key in keys]:
                line.objects = [row.widget, *(self._removing(own, key) for key in keys)]
        else:
            default = self.shown.text(field, field.default) or HINTS.get(field.kind, "")
            look = {"value": self.shown.text(field, value), "placeholder": default}
        row.widget.param.update(label=label, description=field.said or None, **look)

    def _removing(self, own: Path, key: str) -> Any:
        """A button that takes an item of a section away."""
        button = pn.widgets.Button(label=f"Remove {key}", align="end", margin=(2, 4))
        button.on_click(lambda _: self._take((*self.rows[own].field.path, key), None))
        return button

    def _value(self, field: Field) -> Any:
        """What the draft holds for a field: of a joint, the marker that is wired to it."""
        if field.path[0] != "wires":
            return item_at(self.draft, field.path)
        return next((w["from"] for w in self.draft["wires"] if w["to"] == field.path[1]), None)

    def _tell(self, problems: tuple[Problem, ...]) -> list[Problem]:
        """Say under each field what is wrong with it; what is left."""
        left = list(problems)
        for row in self.rows.values():
            path = row.field.path
            where = path[1] if path[0] == "wires" else ".".join(path)
            words = [html.escape(_words(p)) for p in problems if p.where == where]
            row.wrong.object = "".join(f"<p role=alert>{said}</p>" for said in words)
            shown = [row.panel[0], row.wrong] if words else [row.panel[0]]
            if row.panel.objects != shown:  # a page is drawn the faster the less is on it
                row.panel.objects = shown
            left = [p for p in left if p.where != where]
        return left

    # -- what is done -----------------------------------------------------

    def _typed(self, own: Path, said: Any) -> None:
        """Something was typed or chosen; nothing is done where it is what the draft holds."""
        if own not in self.rows:
            return
        field = self.rows[own].field
        value = said if field.kind == "choice" else self.shown.value(field, said)
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
            self._show()
            self.say("; ".join(map(str, self._tell(error.problems)[:3])))

    def _rename(self, new: str) -> None:
        if not self.selected or new == self.selected[-1]:
            return
        old, (section, _) = self.selected[-1], self.selected
        try:
            self.sheet.change(renamed(self.sheet.form, old, new), f"{old} renamed to {new}")
            self.selected = (section, new)
        except BlockmechError as error:
            self.say(_words(error.problems[0]))


@cache
def _schema(of_blocks: bool, known: tuple[str, ...]) -> Any:
    """The schema of documents of blocks, or of links and joints, with the known kinds."""
    return graph_schema() if of_blocks else joints_schema()


def _heading(name: str) -> Any:
    """The heading of a part of the form, on a line of its own."""
    return pn.pane.HTML(f"<h3>{html.escape(name)}</h3>", styles={"flex": "0 0 100%"}, margin=0)


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
