"""The page of the studio: one sheet seen as diagram, form, mechanism and answers."""

from __future__ import annotations

import html
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import panel as pn

from blockmech.builders import Graph, Linkage, Opened, opened
from blockmech.draw.palette import ROW
from blockmech.errors import BlockmechError
from blockmech.loads.contract import Element
from blockmech.studio import edits
from blockmech.studio.answers import Answers
from blockmech.studio.diagram import Diagram
from blockmech.studio.fields import Shown
from blockmech.studio.files import Desk, Filed, files_of
from blockmech.studio.form import SCENE, Form
from blockmech.studio.gallery import gallery_page
from blockmech.studio.links import LinksSheet
from blockmech.studio.looks import begin, page
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.server import serve
from blockmech.studio.session import follow
from blockmech.testing.files import gallery

LEAVING = "window.onbeforeunload = cb_obj.value ? null : (e) => e.preventDefault();"
"""Whoever leaves a sheet that is not saved is asked by the browser."""

FORMULA = 52  # px above the canvas, which does not move when problems come and go
BELOW = 270  # px of form and answers; diagram and mechanism have the rest
ABOVE = {"min-height": "540px"}  # in a lower window each side scrolls


class Page:
    """One window on a sheet. Several may show the same sheet, which the server keeps."""

    def __init__(self, sheet: Filed) -> None:
        self.sheet = sheet
        self.status = pn.pane.HTML("", css_classes=["bm-status"], sizing_mode="stretch_width")
        self.formula = pn.pane.HTML("", height=FORMULA, sizing_mode="stretch_width")
        self.form = Form(sheet, self.say)
        self.diagram = Diagram(sheet, self.say, self.select)
        self._make_bar()
        self._make_wiring()
        follow(sheet, self.show, "form", "problems", "saved", "undoable", "redoable", "path")
        self.show()

    # -- parts ------------------------------------------------------------

    def _make_bar(self) -> None:
        self.file = pn.widgets.TextInput(label="File", width=190)
        self.save = pn.widgets.Button(name="Save", button_type="primary")
        self.replace = pn.widgets.Button(name="Replace the file", button_type="danger")
        self.replace.visible = False
        self.undo, self.redo = pn.widgets.Button(name="Undo"), pn.widgets.Button(name="Redo")
        self.layout = pn.widgets.Button(name="Lay out")
        self.copy = pn.widgets.Button(name="Duplicate")
        self.remove = pn.widgets.Button(name="Delete")
        self.length = pn.widgets.Select(label="Lengths", options=["m", "mm"], width=70)
        self.angle = pn.widgets.Select(label="Angles", options=["rad", "deg"], width=70)
        self.download = pn.widgets.FileDownload(
            callback=lambda: io.BytesIO(self.sheet.text().encode()), label="Download"
        )
        self.picture = pn.widgets.FileDownload(
            callback=self._picture, label="Picture", filename="diagram.svg"
        )
        self.kept = pn.widgets.Checkbox(name="saved", visible=False)
        self.kept.jscallback(value=LEAVING)
        self.save.on_click(lambda _: self._save(replace=False))
        self.replace.on_click(lambda _: self._save(replace=True))
        self.undo.on_click(lambda _: self.sheet.undo())
        self.redo.on_click(lambda _: self.sheet.redo())
        self.layout.on_click(lambda _: self.diagram.do(edits.laid_out(self.sheet.form), "laid out"))
        self.copy.on_click(lambda _: self._duplicate())
        self.remove.on_click(lambda _: self._remove())
        for widget in (self.length, self.angle):
            widget.param.watch(
                lambda _: self._show_in(Shown(self.length.value, self.angle.value)), "value"
            )

    def _make_wiring(self) -> None:
        self.block = pn.widgets.Select(label="Edit", width=96)
        self.source = pn.widgets.Select(label="Connect marker", width=96)
        self.target = pn.widgets.Select(label="to joint", width=96)
        self.wire = pn.widgets.Button(name="Connect")
        self.wires = pn.widgets.Select(label="Wires", width=110)
        self.cut = pn.widgets.Button(name="Remove wire")
        self.block.param.watch(lambda event: self.form.param.update(selected=event.new), "value")
        self.wire.on_click(
            lambda _: self.diagram.connect(self.source.value or "", self.target.value or "")
        )
        self.cut.on_click(
            lambda _: self.diagram.do(
                edits.without(self.sheet.form, (), [self.wires.value]),
                f"{self.wires.value} removed",
            )
        )

    def panel(self, dark: bool = False) -> Any:
        """The page."""
        self.diagram.flow.color_mode = "dark" if dark else "light"
        bar = pn.FlexBox(
            pn.pane.HTML("<h1>blockmech studio</h1>", margin=(8, 12)),
            *(self.file, self.save, self.replace, self.undo, self.redo, self.layout),
            *(self.copy, self.remove, self.download, self.picture, self.length, self.angle),
            self.kept,
            align_items="end",
            css_classes=["bm-bar"],
        )
        wiring = pn.FlexBox(
            *(self.block, self.source, self.target, self.wire, self.wires, self.cut),
            align_items="end",
            css_classes=["bm-wiring"],
        )
        self.view = MechanismView(self.sheet, dark)
        self.answers = Answers(self.sheet, self.view)
        self.links = LinksSheet(self.sheet, dark)
        self.diagram.wire_values = self.answers.wires
        self._show_in(self.form.shown)
        blocks = pn.Column(
            *(self.diagram.palette, self.formula, self.diagram.flow, wiring, self.status),
            sizing_mode="stretch_both",
        )
        drawn = pn.Tabs(
            ("Blocks", blocks),
            ("Links and joints", self.links.panel()),
            active=int(isinstance(self.sheet.document, Linkage)),
            sizing_mode="stretch_both",
            styles=ABOVE,
        )
        below = {"sizing_mode": "stretch_width", "height": BELOW, "scroll": "y-auto"}
        moving = self.view.panel()
        moving.styles = ABOVE
        sides = (
            (drawn, pn.Column(self.form.panel(), **below)),
            (moving, pn.Column(self.answers.panel(), **below)),
        )
        body = pn.Row(
            *(pn.Column(*parts, sizing_mode="stretch_both", scroll="y-auto") for parts in sides),
            sizing_mode="stretch_both",
            css_classes=["bm-body"],
        )
        return page([bar, body], dark)

    # -- what is shown ----------------------------------------------------

    def say(self, text: str) -> None:
        """Tell something in the line below the diagram, also to a screen reader."""
        self.status.object = f"<p role=status>{html.escape(text)}</p>"

    def _show_in(self, units: Shown) -> None:
        """Show lengths and angles in the units that the user chose; files stay SI."""
        self.form.shown = self.view.shown = units

    def select(self, name: str) -> None:
        """Show the form of a block, or of the scene."""
        blocks = {n: n for n in self.sheet.form.get("blocks", {})}
        self.block.param.update(options={"mechanism": SCENE, **blocks}, value=name)

    def show(self) -> None:
        """What the bar and the lines around the diagram say of the sheet."""
        sheet, graph = self.sheet, self.sheet.document
        at = sheet.path.relative_to(sheet.folder).as_posix() if sheet.path else ""
        self.file.value = at or self.file.value or f"{sheet.form['name']}.json"
        self.download.filename = f"{sheet.form['name']}.json"
        self.undo.param.update(disabled=not sheet.undoable, description=sheet.undoable or None)
        self.redo.param.update(disabled=not sheet.redoable, description=sheet.redoable or None)
        self.save.name = "Saved" if sheet.saved and sheet.path else "Save"
        self.kept.value = sheet.saved
        if isinstance(graph, Graph):
            markers = [
                f"{name}.{marker}"
                for name, block in graph.blocks.items()
                if hasattr(block, "all_markers") and not isinstance(block, Element)
                for marker in block.all_markers
            ]
            open_ends = [p.where for p in sheet.problems if p.code == "unwired-joint"]
            wires = [str(wire) for wire in graph.wires]
            for choice, options in (
                (self.source, markers),
                (self.target, open_ends),
                (self.wires, wires),
            ):
                value = choice.value if choice.value in options else next(iter(options), None)
                choice.param.update(options=options, value=value)
            self.select(self.form.selected if self.form.selected in graph.blocks else SCENE)
        if sheet.graph is not None and isinstance(graph, Graph):
            said = html.escape(graph.structure().formula.replace("->", "→"))
            self.formula.object = f"<p>{said}</p>"
        else:
            lines = "".join(f"<li>{html.escape(str(p))}</li>" for p in sheet.problems)
            self.formula.object = f"<ul aria-label=problems>{lines}</ul>"

    # -- what the user does -------------------------------------------------

    def _save(self, replace: bool) -> None:
        try:
            self.sheet.save(self.file.value, replace)
        except BlockmechError as error:
            self.say(str(error))
            self.replace.visible = error.problems[0].code == "changed-file"
            return
        self.replace.visible = False
        self.say(f"wrote {self.file.value}")

    def _duplicate(self) -> None:
        form, names = self.sheet.form, self._chosen()
        places = {
            edits.free_name(form, f"copy.{name}"): (x + 3 * ROW, y + 3 * ROW)
            for name in names
            for x, y in [self.diagram.places[name]]
        }
        made = edits.placed(edits.duplicated(form, names), {**self.diagram.places, **places})
        self.diagram.do(made, f"{', '.join(names)} duplicated")

    def _remove(self) -> None:
        names = self._chosen()
        self.diagram.do(edits.without(self.sheet.form, names), f"{', '.join(names)} deleted")

    def _chosen(self) -> list[str]:
        """Blocks that are selected on the canvas, or the one of the form."""
        form = [self.form.selected] if self.form.selected else []
        return [n for n in self.diagram.selected or form if n in self.sheet.form["blocks"]]

    def _picture(self) -> io.BytesIO:
        from blockmech.draw.diagram import draw_diagram
        from blockmech.draw.paper import rendered

        return io.BytesIO(rendered(draw_diagram(self.sheet.document).figure, ".svg"))


def started(folder: Path, file: str | None, port: int, told: Callable[[str], None]) -> Any:
    """A server of the studio; run its ``io_loop``. Raises like `Filed.open` for the file."""
    desk = Desk(folder)
    start = desk.open(file) if file else ""
    return serve(lambda: window(desk), start, port, told)


def window(desk: Desk) -> Any:
    """What a window shows: the sheet that its address names, or the gallery."""
    args = {key: values[0].decode() for key, values in pn.state.session_args.items()}
    dark = args.get("theme") == "dark"
    said, name = "", args.get("sheet", "")
    try:
        if "open" in args:
            name = desk.open(args["open"])
        elif "example" in args and args["example"] in gallery():
            name = desk.put(opened(gallery()[args["example"]]))
        elif "new" in args:
            name = desk.put()
    except BlockmechError as error:
        said = str(error)
    if name not in desk.sheets:
        return gallery_page(files_of(desk.folder), desk.put, said, dark)
    if pn.state.location is not None and args.get("sheet") != name:
        theme = "&theme=dark" if dark else ""
        pn.state.location.param.update(search=f"?sheet={name}{theme}", reload=False)
    return shown_of(desk.sheets[name], dark)


def shown_of(sheet: Filed, dark: bool) -> Any:
    """A page of a sheet."""
    begin(dark)
    return Page(sheet).panel(dark)


def in_notebook(document: Opened | None, dark: bool) -> Any:
    """The page of a copy of a document, as a panel object."""
    pn.extension()
    return shown_of(Filed(None if document is None else document.snapshot()), dark)
