"""The sheet: the document that a studio shows, with everything that was done to it.

A sheet always holds what could be saved and read again: a change that could not be is
refused as a whole, with the sentences of the reader, and leaves the sheet as it was. What a
mechanism still lacks (joints without wires, no frame) are its ``problems``. Nothing here
knows of widgets or browsers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import param

from blockmech.builders import Graph, Opened, from_data
from blockmech.draw.boxes import graph_of
from blockmech.ground.errors import GraphError, Problem
from blockmech.model.graph import Graph as Blocks
from blockmech.model.subgraph import Resolver, resolving
from blockmech.model.writing import canonical_text


class Step(NamedTuple):
    """A state of the sheet, and what was done to get there."""

    form: dict[str, Any]
    said: str


class Sheet(param.Parameterized):  # type: ignore[misc]  # param's own types say nothing of it
    """A document under work.

    Attributes (watch them with ``sheet.param.watch``; all change in one event)
    ----------
    form : what stands in the file, as plain data; as `Graph.to_data` writes it
    document : the `Graph` or `Linkage` of the form, complete or not
    graph : the same where it checks, else None
    mechanism : ``graph`` compiled, or None
    problems : everything that keeps the document from being a mechanism
    path : the file that the sheet stands for, None before it has one
    folder : no file outside of it is read or written
    saved : whether the file holds this form; an empty sheet counts as saved
    undoable, redoable : what `undo` and `redo` would take back or do again, "" for nothing
    """

    form = param.Dict(default={}, constant=True)
    document = param.Parameter(constant=True)
    graph = param.Parameter(constant=True)
    mechanism = param.Parameter(constant=True)
    problems = param.ClassSelector(class_=tuple, default=(), constant=True)
    path = param.ClassSelector(class_=Path, default=None, allow_None=True, constant=True)
    folder = param.ClassSelector(class_=Path, constant=True)
    saved = param.Boolean(default=True, constant=True)
    undoable = param.String(default="", constant=True)
    redoable = param.String(default="", constant=True)

    def __init__(self, document: Opened | None = None, folder: Path | None = None) -> None:
        super().__init__(folder=(folder or Path.cwd()).resolve())
        self._done: list[Step] = []
        self._undone: list[Step] = []
        self._in_file = ""
        self.begin(Graph() if document is None else document)

    def begin(self, document: Opened, path: Path | None = None) -> None:
        """Show a document as it stands in a file; what was done before is forgotten."""
        self._done = [Step(document.to_data(), "")]
        self._undone = []
        self._in_file = document.to_json()
        self._show(document, path)

    def change(self, form: dict[str, Any], said: str) -> None:
        """Take another form, as one step that can be undone; an equal one is no step.

        Raises `FormatError` or `GraphError` for a form that could not be read again, with
        all that is wrong; the sheet then stays as it is.
        """
        document = self._read(form)
        text = document.to_json()
        if text != canonical_text(self.form):
            self._done.append(Step(document.to_data(), said))
            self._undone.clear()
            self._show(document, self.path)

    def undo(self) -> str:
        """Take back the last change, if there is one; what it was."""
        return self._step(self._done, self._undone, 1)

    def redo(self) -> str:
        """Do again what was taken back last, if anything was; what it was."""
        return self._step(self._undone, self._done, 0)

    def keep(self, path: Path) -> None:
        """Note that the file at a path holds the form now."""
        self._in_file = self.text()
        with param.edit_constant(self):
            self.param.update(path=path, saved=True)

    @property
    def empty(self) -> bool:
        """Whether nothing is drawn yet: then a first step is said, and no problem."""
        return not (self.form.get("blocks") or self.form.get("links") or self.form.get("view"))

    @property
    def blocks(self) -> Blocks:
        """The document's blocks; of links and joints those that they become, or none."""
        if isinstance(self.document, Graph):
            return self.document
        return graph_of(self.mechanism._of_blocks) if self.mechanism else Graph()

    def text(self) -> str:
        """The file's text, as `Graph.save` writes it."""
        return canonical_text(self.form)

    def _read(self, form: dict[str, Any]) -> Opened:
        """The document of a form; of other files it takes those of the folder alone."""
        with resolving(Resolver(str(self.folder))):
            return from_data(form, self.path)

    def _step(self, back: list[Step], forth: list[Step], least: int) -> str:
        if len(back) <= least:
            return ""
        forth.append(back.pop())
        self._show(self._read(self._done[-1].form), self.path)
        return forth[-1].said

    def _show(self, document: Opened, path: Path | None) -> None:
        """Set what follows from the last step, in one event."""
        problems, mechanism = list[Problem](document.check()), None
        if not problems:
            try:
                mechanism = document.compile()
            except GraphError as error:
                problems = list(error.problems)
        form = self._done[-1].form
        with param.edit_constant(self):
            self.param.update(
                form=form,
                document=document,
                graph=None if problems else document,
                mechanism=mechanism,
                problems=tuple(problems),
                path=path,
                saved=canonical_text(form) == self._in_file,
                undoable=self._done[-1].said,
                redoable=self._undone[-1].said if self._undone else "",
            )
