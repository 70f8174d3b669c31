"""The sheet: the document that a studio shows, with everything that was done to it.

A sheet always holds what could be saved and read again: a change that could not be is
refused as a whole, with the sentences of the reader, and leaves the sheet as it was. What a
mechanism still lacks (joints without wires, no frame) are its ``problems``. Nothing here
knows of servers or browsers.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from blockmech.builders import Graph, Opened, from_data
from blockmech.compiled import Compiled
from blockmech.draw.boxes import graph_of
from blockmech.ground.errors import GraphError, Problem
from blockmech.model.graph import Graph as Blocks
from blockmech.model.subgraph import Resolver, resolving
from blockmech.model.writing import canonical_text
from blockmech.typing import Data


class Step(NamedTuple):
    """A state of the sheet, and what was done to get there."""

    form: Data
    said: str


class Revision:
    """A document as it stands between two changes; what follows from it is found once.

    Attributes
    ----------
    number : which of the sheet's states it is; none comes twice
    form : what stands in the file, as plain data; as `Graph.to_data` writes it
    document : the `Graph` or `Linkage` of the form, complete or not
    """

    def __init__(self, number: int, form: Data, document: Opened) -> None:
        self.number, self.form, self.document = number, form, document

    @cached_property
    def _compiled(self) -> tuple[tuple[Problem, ...], Compiled | None, str]:
        document = self.document
        try:
            if isinstance(document, Graph):
                mechanism: Compiled = document.compile()
                return (), mechanism, mechanism.structure.formula
            decomposition = document.decompose()
            return (), decomposition.compile(), str(decomposition.formation)
        except GraphError as error:
            return error.problems, None, ""

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Everything that keeps the document from being a mechanism."""
        return self._compiled[0]

    @property
    def mechanism(self) -> Compiled | None:
        """The document compiled, None where it has problems."""
        return self._compiled[1]

    @property
    def formation(self) -> str:
        """Its drivers and groups in formation order, "" where it is no mechanism."""
        return self._compiled[2]

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


class Sheet:
    """A document under work.

    Attributes
    ----------
    now : the `Revision` that it shows
    path : the file that the sheet stands for, None before it has one
    folder : no file outside of it is read or written
    lock : who changes the sheet holds it
    """

    def __init__(self, document: Opened | None = None, folder: Path | None = None) -> None:
        self.folder = (folder or Path.cwd()).resolve()
        self.lock, self._count = Lock(), 0
        self.path: Path | None = None
        self._done: list[Step] = []
        self._undone: list[Step] = []
        self._in_file = ""
        self.now: Revision
        self.begin(Graph() if document is None else document)

    def begin(self, document: Opened, path: Path | None = None) -> None:
        """Show a document as it stands in a file; what was done before is forgotten."""
        self._done = [Step(document.to_data(), "")]
        self._undone = []
        self._in_file = document.to_json()
        self._show(document, path)

    def change(self, form: Data, label: str) -> None:
        """Take another form, as one step that can be undone; an equal one is no step.

        Raises `FormatError` or `GraphError` for a form that could not be read again, with
        all that is wrong; the sheet then stays as it is.
        """
        document = self.read(form)
        text = document.to_json()
        if text != self.text():
            self._done.append(Step(document.to_data(), label))
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
        self._in_file, self.path = self.text(), path

    @property
    def form(self) -> Data:
        """The content of the file."""
        return self.now.form

    @property
    def saved(self) -> bool:
        """Whether the file holds this form; an empty sheet counts as saved."""
        return self.text() == self._in_file

    @property
    def undoable(self) -> str:
        """What `undo` would take back, "" for nothing."""
        return self._done[-1].said

    @property
    def redoable(self) -> str:
        """What `redo` would do again, "" for nothing."""
        return self._undone[-1].said if self._undone else ""

    def text(self) -> str:
        """The file's text, as `Graph.save` writes it."""
        return canonical_text(self.form)

    def read(self, form: Data) -> Opened:
        """The document of a form; of other files it takes those of the folder alone."""
        with resolving(Resolver(str(self.folder))):
            return from_data(form, self.path)

    def _step(self, source: list[Step], target: list[Step], minimum: int) -> str:
        if len(source) <= minimum:
            return ""
        target.append(source.pop())
        self._show(self.read(self._done[-1].form), self.path)
        return target[-1].said

    def _show(self, document: Opened, path: Path | None) -> None:
        """Show what the last step made."""
        self._count += 1
        self.path, self.now = path, Revision(self._count, self._done[-1].form, document)
