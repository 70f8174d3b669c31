"""The form of what is selected: one field a line, derived from the declarations.

What a user types is a draft of the block. It is taken as soon as it is sound; until then
what is wrong stands under the fields, and the sheet stays as it was.
"""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import panel as pn
import param

from blockmech.blocks.registry import REGISTRY
from blockmech.errors import BlockmechError, Problem
from blockmech.model.schema import graph_schema
from blockmech.studio.edits import renamed, with_block
from blockmech.studio.fields import Field, Shown, fields_of, item_at, with_item
from blockmech.studio.session import follow
from blockmech.studio.sheet import Sheet

SCENE = ""
"""What is selected where no block is: the document and its scene."""


LINE = 148  # px of a field: three or four beside each other in half a window


class Form(param.Parameterized):  # type: ignore[misc]  # as the sheet
    """The form of a block, or of the scene; ``selected`` says of which."""

    selected = param.String(default=SCENE)
    shown = param.Parameter(default=Shown())

    def __init__(self, sheet: Sheet, say: Callable[[str], None]) -> None:
        super().__init__()
        self.sheet, self.say = sheet, say
        self.schema = graph_schema()
        self.draft: dict[str, Any] = {}
        self.rows: dict[tuple[str, ...], tuple[Field, Any, Any]] = {}
        self.column = pn.Column(css_classes=["bm-form"], sizing_mode="stretch_width")
        self._taking = False
        self.param.watch(lambda *_: self.renew(), ["selected", "shown"])
        follow(sheet, self._follow, "form")
        self.renew()

    def panel(self) -> Any:
        """The form as it stands on the page."""
        return self.column

    # -- what is shown ----------------------------------------------------

    def renew(self) -> None:
        """Make the fields of what is selected."""
        form = self.sheet.form
        if "blocks" not in form:
            self.column.objects = []
            return
        if self.selected not in form["blocks"]:
            self.param.update(selected=SCENE) if self.selected else None
        self.draft = self._data()
        self.rows = {}
        parts: list[Any] = [self._head()]
        section, lines = "", pn.FlexBox(sizing_mode="stretch_width")
        for field in fields_of(self.schema, self._schema(), self.draft):
            group = field.path[0] if field.kind == "map" or len(field.path) > 1 else ""
            if group != section:
                section, lines = group, pn.FlexBox(sizing_mode="stretch_width")
                parts.append(pn.pane.HTML(f"<h3>{html.escape(group)}</h3>", margin=0))
            if lines not in parts:
                parts.append(lines)
            lines.append(self._adding(field) if field.kind == "map" else self._row(field))
        self.column.objects = parts

    def _follow(self) -> None:
        """Show the values that the sheet has now; other fields make another form."""
        if self._taking or "blocks" not in self.sheet.form:
            return
        if self.selected and self.selected not in self.sheet.form["blocks"]:
            self.selected = SCENE
            return
        draft, before = self._data(), set(self.rows)
        fields = [f for f in fields_of(self.schema, self._schema(), draft) if f.kind != "map"]
        if {f.path for f in fields} != before:
            self.renew()
            return
        self.draft = draft
        for path, (field, widget, wrong) in self.rows.items():
            self._set(widget, field, item_at(draft, path))
            wrong.object = ""

    def _data(self) -> dict[str, Any]:
        form = self.sheet.form
        if self.selected:
            return dict(form["blocks"][self.selected])
        return {"title": form.get("title", ""), **form.get("scene", {})}

    def _schema(self) -> dict[str, Any]:
        defs = self.schema["$defs"]
        if self.selected:
            kind = self.sheet.form["blocks"][self.selected]["type"]
            return dict(defs.get(kind, {"type": "object", "properties": {}}))
        scene = dict(defs["Scene"])
        properties = dict(scene["properties"])
        title = {"type": "string", "description": "title of the mechanism"}
        return {**scene, "properties": {"title": title, **properties}}

    def _head(self) -> Any:
        form = self.sheet.form
        kind = form["blocks"][self.selected]["type"] if self.selected else "mechanism"
        cls = REGISTRY.get(kind) if self.selected else None
        said = (cls.__doc__ or "").split("\n")[0] if cls else "gravity, drives, start and end stops"
        name = pn.widgets.TextInput(
            label="Name",
            value=self.selected or form.get("name", ""),
            sizing_mode="stretch_width",
        )
        name.param.watch(lambda event: self._rename(event.new), "value")
        heading = f"<h2>{html.escape(kind)}</h2><p>{html.escape(said)}</p>"
        return pn.Column(pn.pane.HTML(heading, margin=0), name, sizing_mode="stretch_width")

    def _row(self, field: Field) -> Any:
        value = item_at(self.draft, field.path)
        unit = self.shown.unit(field.unit)
        label = _label(field.path) + (f" [{unit}]" if unit else "")
        if field.kind in ("choice", "flag"):
            choices = field.choices or (False, True)
            options = {"" if c == "" else str(c): c for c in choices}
            if field.default is not None and not field.required:
                options = {f"{field.default} (default)": "", **options}
            widget: Any = pn.widgets.Select(label=label, options=options)
        else:
            hint = {"place": "x, y or r @ angle", "pair": "x, y", "json": "JSON"}.get(
                field.kind, ""
            )
            empty = hint if field.default is None else self.shown.text(field, field.default)
            widget = pn.widgets.TextInput(label=label, placeholder=empty)
        wide = field.kind in ("text", "json") and not field.path[1:]
        widget.param.update(width=LINE * 2 if wide else LINE, margin=(2, 4))
        self._set(widget, field, value)
        wrong = pn.pane.HTML("", width=LINE, margin=(0, 4))
        widget.param.watch(lambda event: self._typed(field, event.new), "value")
        self.rows[field.path] = (field, widget, wrong)
        return pn.Column(widget, wrong, margin=0)

    def _set(self, widget: Any, field: Field, value: Any) -> None:
        """Show a value without hearing of it."""
        if field.kind in ("choice", "flag"):
            known = list(widget.options.values())
            shown = value if value in known else known[0]
        else:
            shown = self.shown.text(field, value)
        if widget.value != shown:
            taking, self._taking = self._taking, True
            widget.value = shown
            self._taking = taking

    def _adding(self, field: Field) -> Any:
        """A line that adds an item, or takes one away, of a section with free keys."""
        held = item_at(self.draft, field.path) or {}
        name = pn.widgets.TextInput(label=f"new in {_label(field.path)}", width=LINE, margin=(2, 4))
        name.param.watch(lambda event: self._add(field, event.new.strip()), "value")
        gone = [pn.widgets.Button(name=f"Remove {key}", align="end", margin=(2, 4)) for key in held]
        for key, button in zip(held, gone, strict=True):
            button.on_click(lambda _, key=key: self._take((*field.path, key), None))
        return pn.Row(name, *gone, margin=0)

    # -- what is done -----------------------------------------------------

    def _typed(self, field: Field, said: Any) -> None:
        if not self._taking:
            value = said if field.kind in ("choice", "flag") else self.shown.value(field, said)
            if field.kind == "choice" and value == "":
                value = None
            self._take(field.path, value, redo=field.path[-1] in ("law", "kind"))

    def _add(self, field: Field, key: str) -> None:
        """Add an item with the simplest values; `Field.starter` has them."""
        if key and not self._taking:
            self._take((*field.path, key), field.starter, redo=True)

    def _take(self, path: tuple[str, ...], value: Any, redo: bool = False) -> None:
        """Put a value into the draft, and the draft, if it is sound, on the sheet."""
        beside = self.rows[path][0].beside if path in self.rows and value is not None else ()
        for key, only in beside:
            self.draft = with_item(self.draft, (*path[:-1], key), only)
        self.draft = with_item(self.draft, path, value)
        form, what = self.sheet.form, ".".join(path)
        if self.selected:
            made, prefix = with_block(form, self.selected, self.draft), f"blocks.{self.selected}."
            said = f"{self.selected}: {what}"
        else:
            scene = {key: part for key, part in self.draft.items() if key != "title"}
            made, prefix = {**form, "title": self.draft.get("title", ""), "scene": scene}, "scene."
            said = what
        problems: tuple[Problem, ...] = ()
        self._taking = True
        try:
            self.sheet.change(made, said)
        except BlockmechError as error:
            problems = error.problems
        finally:
            self._taking = False
        self._tell(problems, prefix)
        if not problems and (redo or value is None or set(self.rows) != self._paths()):
            self.renew()

    def _paths(self) -> set[tuple[str, ...]]:
        fields = fields_of(self.schema, self._schema(), self.draft)
        return {field.path for field in fields if field.kind != "map"}

    def _tell(self, problems: tuple[Problem, ...], prefix: str) -> None:
        """Say under each field what is wrong with it, and of the rest in one line."""
        here = [p for p in problems if p.where.startswith(prefix)]
        told = set()
        for field, _, wrong in self.rows.values():
            mine = [p for p in here if p.where.removeprefix(prefix) == field.where]
            told |= set(mine)
            wrong.object = "".join(f"<p role=alert>{html.escape(_words(p))}</p>" for p in mine)
        rest = [_words(p) for p in here or problems if p not in told]
        self.say("; ".join(rest[:3]))

    def _rename(self, new: str) -> None:
        form, old = self.sheet.form, self.selected
        if self._taking or new == (old or form.get("name", "")):
            return
        try:
            if old:
                made = renamed(form, old, new)
                self._taking = True
                self.sheet.change(made, f"{old} renamed to {new}")
                self._taking = False
                self.selected = new
            else:
                self.sheet.change({**form, "name": new}, "name")
        except BlockmechError as error:
            self.say(_words(error.problems[0]))
        finally:
            self._taking = False


def _label(path: tuple[str, ...]) -> str:
    """What a field is called: its path, without the section where names follow."""
    return " ".join(path[len(path) > 2 :])


def _words(problem: Problem) -> str:
    """A problem as a sentence, without its code."""
    return ". ".join(part for part in (problem.found, problem.valid, problem.remedy) if part)
