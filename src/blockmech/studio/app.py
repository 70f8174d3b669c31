"""The page of the studio: one sheet seen as diagram, form, mechanism and answers."""

from __future__ import annotations

import html
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import panel as pn
import param

from blockmech.builders import Graph, Linkage, Opened, opened
from blockmech.errors import BlockmechError
from blockmech.graph_files import gallery
from blockmech.studio.answers import Answers
from blockmech.studio.component import Component, script
from blockmech.studio.diagram import Diagram
from blockmech.studio.exports import exported, kinds
from blockmech.studio.fields import CHOICES, Shown
from blockmech.studio.files import Desk, Filed, files_of
from blockmech.studio.form import MECHANISM, Form
from blockmech.studio.gallery import gallery_page
from blockmech.studio.links import LinksSheet
from blockmech.studio.looks import begin, beside, button, either, page
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.server import DRAWING, serve
from blockmech.studio.session import follow
from blockmech.studio.sharing import KEY, packed, unpacked

UNITS = "blockmech_units"  # the cookie in which the browser keeps the units that a user chose
SAID = 400  # letters of a message that an address carries

FIRST = "Add a frame and a crank, then wire the crank to a marker of the frame."
FORMULA = 36  # px above the canvas, which does not move when problems come and go
BARE = {"css_classes": ["bare"]}  # a field whose name only screen readers hear
BELOW = 250  # px of form and answers; diagram and mechanism have the rest
ABOVE = 480, 400  # px of either side; in a lower window it scrolls


class Browser(Component):
    """What the page asks of the browser itself: to copy a link, to save a file, to keep units.

    Whoever leaves a sheet that is not saved is asked.
    """

    saved = param.Boolean(default=True)
    units = param.String()

    _esm = script("browser.js")


class Page:
    """One window on a sheet. Several may show the same sheet, which the server keeps."""

    def __init__(self, sheet: Filed, dark: bool = False) -> None:
        self.sheet, self.dark = sheet, dark
        wide = {"sizing_mode": "stretch_width", "margin": (0, 4)}
        self.status = pn.pane.HTML("", css_classes=["bm-status"], **wide)
        self.formula = pn.pane.HTML("", height=FORMULA, styles={"overflow-y": "auto"}, **wide)
        self.view = MechanismView(sheet, dark)
        self.answers = Answers(sheet, self.view)
        self.form = Form(sheet, self.say)
        self.diagram = Diagram(sheet, self.say, self.select, self.answers.wires)
        self.file = pn.widgets.TextInput(label="File", width=170, css_classes=["line"])
        self.save = button("Save", lambda: self._save(False), button_type="primary")
        self.replace = button("Replace the file", lambda: self._save(True), visible=False)
        self.undo = button("Undo", lambda: self.say(f"Undo: {sheet.undo()}"))
        self.redo = button("Redo", lambda: self.say(f"Redo: {sheet.redo()}"))
        self.kind = pn.widgets.Select(label="Export as", groups=kinds(), width=130, **BARE)
        self.browser = Browser()
        kept = Shown.of(pn.state.cookies.get(UNITS, ""))
        self.units = [
            pn.widgets.Select(label=label, options=list(known), value=unit, width=66, **BARE)
            for (label, known), unit in zip(CHOICES.items(), kept, strict=True)
        ]
        for widget in self.units:
            widget.param.watch(lambda _: self._measure(), "value")
        self._measure()
        follow(sheet, self.show, "form", "problems", "saved", "undoable", "redoable", "path")
        self.show()

    def panel(self) -> Any:
        """The page."""
        bar = beside(
            pn.pane.HTML("<h1>blockmech</h1>"),
            *(self.file, self.save, self.replace, self.undo, self.redo),
            *(button("Copy link", self._share), self.kind, button("Export", self._export)),
            pn.layout.HSpacer(),
            *self.units,
            self.browser,
            css_classes=["bar"],
            sizing_mode="stretch_width",
        )
        flow = self.formula, self.diagram.flow
        ways = {
            "Links and joints": lambda: LinksSheet(self.sheet, self.dark, self.view).panel(),
            "Blocks": lambda: pn.Column(*flow, sizing_mode="stretch_both"),
        }
        drawn = either(ways, list(ways)[not isinstance(self.sheet.document, Linkage)])
        below = {
            "sizing_mode": "stretch_width",
            "height": BELOW,
            "scroll": "y-auto",
            "css_classes": ["drawer"],
        }
        left = drawn, self.status, pn.Column(self.form.page, **below)
        head = beside(self.answers.work.stop, self.answers.said, sizing_mode="stretch_width")
        right = self.view.panel(), either(self.answers.tabs(), "Curves", head)
        right[-1].param.update(**below)
        sides = [pn.Column(*s, sizing_mode="stretch_both", scroll="y-auto") for s in (left, right)]
        for side, least in zip(sides, ABOVE, strict=True):
            side[0].styles = {"min-height": f"{least}px"}
        return page([bar, pn.Row(*sides, sizing_mode="stretch_both")], self.dark)

    # -- what is shown ----------------------------------------------------

    def say(self, text: str) -> None:
        """Tell something in the line below the diagram, also to a screen reader."""
        self.status.object = f"<p role=status>{html.escape(text)}</p>"

    def _measure(self) -> None:
        """Show lengths and angles in the units that the user chose; files stay SI."""
        units = Shown(*(widget.value for widget in self.units))
        self.form.shown = self.view.shown = units
        self.browser.units = "|".join(units)

    def select(self, name: str) -> None:
        """Show the form of a block."""
        self.form.selected = ("blocks", name) if "blocks" in self.sheet.form else MECHANISM

    def show(self) -> None:
        """What the bar and the lines around the diagram say of the sheet."""
        sheet = self.sheet
        at = sheet.path.relative_to(sheet.folder).as_posix() if sheet.path else ""
        self.file.value = at or self.file.value or f"{sheet.form['name']}.json"
        self.undo.param.update(disabled=not sheet.undoable, description=sheet.undoable or None)
        self.redo.param.update(disabled=not sheet.redoable, description=sheet.redoable or None)
        self.save.label = "Saved" if sheet.saved and sheet.path else "Save"
        self.browser.saved = sheet.saved
        if isinstance(sheet.graph, Graph):
            formula = html.escape(sheet.graph.structure().formula.replace("->", "→"))
            self.formula.object = f"<p tabindex=0>{formula}</p>"  # so that keys scroll it
        else:
            problems = [FIRST] if sheet.empty else sheet.problems
            lines = "".join(f"<li>{html.escape(str(p))}</li>" for p in problems)
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

    def _share(self) -> None:
        """Pack the document into the link, which the browser then copies."""
        self.browser.tell(link=packed(self.sheet.text()))
        self.say("the link with the document is copied")

    def _export(self) -> None:
        """Write what is chosen, beside the page; the browser saves it."""
        kind = self.kind.value

        def task(report: Callable[..., None]) -> tuple[str, bytes]:
            report(f"{kind} ...")
            return exported(kind, self.sheet, self.view, self.answers)

        def done(file: tuple[str, bytes]) -> None:
            self.browser.tell(name=file[0], file=file[1])
            self.say(f"exported {kind}")

        self.answers.work.begin(task, done)


def started(folder: Path, file: str | None, port: int, told: Callable[[str], None]) -> Any:
    """A server of the studio; run its ``io_loop``. Raises like `Filed.open` for the file."""
    desk = Desk(folder)
    start = desk.open(file) if file else ""
    # schemas and modules that are made once are there when the first sheet is opened
    DRAWING.submit(Diagram, Filed(opened(gallery()["ruiz_fourbar"])), print, print, str)
    return serve(lambda: window(desk), start, port, told)


def window(desk: Desk) -> Any:
    """What a window shows: the sheet that its address names, or the gallery."""
    args = {key: values[0].decode() for key, values in pn.state.session_args.items()}
    dark = args.get("theme") == "dark"
    message, name = args.get("said", "")[:SAID], args.get("sheet", "")
    try:
        if "open" in args:
            name = desk.open(args["open"])
        elif "example" in args and args["example"] in gallery():
            name = desk.put(opened(gallery()[args["example"]]))
        elif "new" in args or "draw" in args:
            name = desk.put(Linkage() if "draw" in args else None)
    except BlockmechError as error:
        message = str(error)
    if name not in desk.sheets:
        if pn.state.location is not None:
            pn.state.location.param.watch(lambda event: shared(desk, event.new), "hash")
        return gallery_page(files_of(desk.folder), desk.put, message, dark)
    if pn.state.location is not None and args.get("sheet") != name:
        theme = "&theme=dark" if dark else ""
        pn.state.location.param.update(search=f"?sheet={name}{theme}", reload=False)
    return shown_of(desk.sheets[name], dark)


def shared(desk: Desk, fragment: str) -> None:
    """Open the document that stands in an address, in its window."""
    if not fragment.startswith(KEY):
        return
    try:
        search = f"?sheet={desk.put(unpacked(fragment))}"
    except BlockmechError as error:
        search = f"?said={quote(str(error)[:SAID])}"
    pn.state.location.param.update(hash="", search=search, reload=True)


def shown_of(sheet: Filed, dark: bool) -> Any:
    """A page of a sheet."""
    begin(dark)
    return Page(sheet, dark).panel()


def in_notebook(document: Opened | None, dark: bool) -> Any:
    """The page of a copy of a document, as a panel object."""
    pn.extension()
    return shown_of(Filed(None if document is None else document.snapshot()), dark)
