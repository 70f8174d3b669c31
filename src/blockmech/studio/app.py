"""The page of the studio: one sheet seen as diagram, form, mechanism and answers."""

from __future__ import annotations

import gc
import html
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, quote

import panel as pn
import param
from bokeh.models import Tooltip

from blockmech.builders import Graph, Linkage, Opened, opened, read_text
from blockmech.ground.errors import BlockmechError
from blockmech.studio.answers import Answers
from blockmech.studio.component import Component, script
from blockmech.studio.diagram import Diagram
from blockmech.studio.exports import exported, kinds
from blockmech.studio.fields import CHOICES, Shown
from blockmech.studio.files import Desk, Filed, files_of
from blockmech.studio.form import MECHANISM, Form
from blockmech.studio.gallery import gallery_parts
from blockmech.studio.links import LinksSheet
from blockmech.studio.looks import button, page, row, set_style, tabs
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.server import DRAWING, serve
from blockmech.studio.session import follow, together
from blockmech.studio.sharing import packed, unpacked
from blockmech.testing.graph_files import gallery

UNITS = "blockmech_units"  # the cookie in which the browser keeps the units that a user chose

FIRST = "Add a frame and a crank, then wire the crank to a marker of the frame."
FORMULA = 36  # px above the canvas, which does not move when problems come and go
BARE = {"css_classes": ["bare"]}  # a field whose name only screen readers hear
BELOW = 250  # px of form and answers; diagram and mechanism have the rest
ABOVE = 480, 400  # px of either side; in a lower window it scrolls


class Browser(Component):
    """What the page asks of the browser itself: to copy a link, to save a file, to keep units.

    Whoever leaves a sheet that is not saved is asked. ``address`` is of the sheet that a
    server shows, "" of the gallery: links, and a document behind ``#``, are opened on the page.
    """

    address = param.String(default=None)
    saved = param.Boolean(default=True)
    units = param.String()

    _esm = script("browser.js")


class Page:
    """One window on a sheet. Several may show the same sheet, which the server keeps."""

    def __init__(self, sheet: Filed, dark: bool = False, browser: Browser | None = None) -> None:
        self.sheet, self.dark, self.browser = sheet, dark, browser or Browser()
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
        tips = [Tooltip(content="", position="bottom") for _ in range(2)]
        self.undo = button("Undo", lambda: self.say(f"Undo: {sheet.undo()}"), description=tips[0])
        self.redo = button("Redo", lambda: self.say(f"Redo: {sheet.redo()}"), description=tips[1])
        self.kind = pn.widgets.Select(label="Export as", groups=kinds(), width=130, **BARE)
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

    def parts(self) -> list[Any]:
        """What the page shows, from above to below."""
        bar = row(
            pn.pane.HTML("<h1>blockmech</h1>"),
            *(self.file, self.save, self.replace, self.undo, self.redo),
            *(button("Copy link", self._share), self.kind, button("Export", self._export)),
            pn.layout.HSpacer(),
            *self.units,
            css_classes=["bar"],
            sizing_mode="stretch_width",
        )
        flow = self.formula, self.diagram.flow
        ways = {
            "Links and joints": lambda: LinksSheet(self.sheet, self.dark, self.view).panel(),
            "Blocks": lambda: pn.Column(*flow, sizing_mode="stretch_both"),
        }
        drawn = tabs(ways, list(ways)[not isinstance(self.sheet.document, Linkage)])
        below = {
            "sizing_mode": "stretch_width",
            "height": BELOW,
            "scroll": "y-auto",
            "css_classes": ["drawer"],
        }
        left = drawn, self.status, pn.Column(self.form.page, **below)
        head = row(self.answers.work.stop, self.answers.said, sizing_mode="stretch_width")
        right = self.view.panel(), tabs(self.answers.tabs(), "Curves", head)
        right[-1].param.update(**below)
        sides = [pn.Column(*s, sizing_mode="stretch_both", scroll="y-auto") for s in (left, right)]
        for side, least in zip(sides, ABOVE, strict=True):
            side[0].styles = {"min-height": f"{least}px"}
        return [bar, pn.Row(*sides, sizing_mode="stretch_both")]

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
        for step, what in ((self.undo, sheet.undoable), (self.redo, sheet.redoable)):
            step.disabled, step.description.content = not what, what or "nothing"
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
    DRAWING.submit(_prepare)
    return serve(lambda: Window(desk).root, start, port, told)


def _prepare() -> None:
    """Make what is made once before the first sheet is opened, and let nobody search it again.

    Python looks for what is no longer used among all that a program holds; modules and schemas
    are used until the end, and each search of them took longer than opening a four-bar.
    """
    for document in (opened(gallery()["ruiz_fourbar"]), Linkage()):
        Page(Filed(document)).parts()
    gc.collect()
    gc.freeze()


class Window:
    """What a window of the browser shows: the sheet that its address names, or the gallery.

    A sheet takes the gallery's place on the same page: its scripts are there already.
    """

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        args = {key: values[0].decode() for key, values in pn.state.session_args.items()}
        self.dark = args.get("theme") == "dark"
        set_style(self.dark)
        self.browser = Browser(self.meant, margin=0)
        self.root = page([self.browser], self.dark)
        self.open(args)

    @together
    def meant(self, msg: dict[str, Any]) -> None:
        """Open what a link of the page, or what stands behind ``#`` in the address, names."""
        self.open(dict(parse_qsl(msg["open"][1:], keep_blank_values=True)))

    @together
    def take(self, name: str, content: bytes) -> None:
        """Open a file that was uploaded."""
        self.show(lambda: self.desk.put(read_text(content, name)))

    def open(self, args: Mapping[str, str]) -> None:
        """Show the sheet that an address names, or the gallery."""
        desk, examples = self.desk, gallery()
        known: dict[str, Callable[[str], str]] = {
            "doc": lambda text: desk.put(unpacked(text)),
            "open": desk.open,
            "example": lambda name: desk.put(opened(examples[name])) if name in examples else "",
            "new": lambda _: desk.put(),
            "draw": lambda _: desk.put(Linkage()),
            "sheet": str,
        }
        key = next((key for key in known if key in args), "sheet")
        self.show(lambda: known[key](args.get(key, "")))

    def show(self, named: Callable[[], str]) -> None:
        """Show the sheet whose name is given, or the gallery, with what is wrong."""
        desk, message, name = self.desk, "", ""
        try:
            name = named()
        except BlockmechError as error:
            message = str(error)
        sheet = desk.sheets.get(name)
        self.browser.address = f"?sheet={name}{'&theme=dark' * self.dark}" if sheet else ""
        if sheet:
            parts = Page(sheet, self.dark, self.browser).parts()
        else:
            known = desk.sheets.items()
            left = {f"?sheet={key}": s.form["name"] for key, s in known if not s.saved}
            files = {f"?open={quote(name)}": name for name in files_of(desk.folder)}
            lists = {"Not saved": left, "In this folder": files}
            parts = gallery_parts(lists, self.take, message, self.dark)
        self.root[1:] = parts


def in_notebook(document: Opened | None, dark: bool) -> Any:
    """The page of a copy of a document, as a panel object."""
    pn.extension()
    set_style(dark)
    shown = Page(Filed(None if document is None else document.snapshot()), dark)
    return page([shown.browser, *shown.parts()], dark)
