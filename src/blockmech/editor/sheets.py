"""Sheets: documents under work with their steps, and the files that they stand for.

Nothing outside of the folder that the studio was started in is read or written, and nothing here
knows of servers or browsers.

A document in an address stands behind ``#``, which a browser sends to no server: whoever opens it
has the sheet. What moves it goes with it, so that a page of `blockmech page` shows it without
Python. The text is deflated (RFC 1951) and written in the letters of base 64 that addresses allow
(RFC 4648, 5).
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import os
import secrets
import zlib
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from blockmech.builders import Graph, Linkage, Opened, from_data, opened, read_text
from blockmech.editor.revision import Revision, Step
from blockmech.exchange.formats import Order
from blockmech.exchange.page.files import Link, contents_of
from blockmech.figures.paper import rendered
from blockmech.ground.errors import BlockmechError, FormatError, refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.form import canonical_text
from blockmech.model.reading import LARGEST, text_of
from blockmech.model.subgraph import Resolver, resolving
from blockmech.testing.graph_files import gallery
from blockmech.typing import Data, Record

if TYPE_CHECKING:
    from blockmech.editor.revision import Revision


def inside(folder: Path, name: str | os.PathLike[str]) -> Path:
    """The place that a name means in a folder, links followed.

    Raises `RequestError` for a place that is not in it, and for what is no JSON file.
    """
    path = Path(os.path.realpath(folder / name)) if "\0" not in str(name) else Path()
    if not path.is_relative_to(os.path.realpath(folder)):
        remedy = "start the studio in the folder of the file"
        fault = "it is outside of the folder that the studio was started in"
        raise refused(str(name), fault, remedy, code="not-inside")
    if path.suffix != ".json":
        remedy = "end its name in .json"
        raise refused(str(name), "it is no JSON file", remedy, code="not-a-file")
    return path


def files_of(folder: Path) -> list[str]:
    """Names of the JSON files of a folder and those one below, as `read_into` takes them."""
    paths = [*folder.glob("*.json"), *folder.glob("[!.]*/*.json")]
    return sorted(path.relative_to(folder).as_posix() for path in paths)


class Sheet:
    """A document under work.

    It always holds what could be saved and read again: a change that could not be is refused as a
    whole, with the sentences of the reader, and leaves the sheet as it was. What a mechanism still
    lacks (joints without wires, no frame) are the ``problems`` of its revision.

    Attributes
    ----------
    now : the `Revision` that it shows
    path : the file that the sheet stands for, None before it has one
    stamp : of that file as it was last read or written; what somebody else changed since is not
        overwritten without a word
    folder : no file outside of it is read or written
    lock : who changes the sheet holds it
    """

    def __init__(self, document: Opened | None = None, folder: Path | None = None) -> None:
        self.folder = (folder or Path.cwd()).resolve()
        self.lock, self._count = Lock(), 0
        self.path: Path | None = None
        self.stamp = ""
        self._done: list[Step] = []
        self._undone: list[Step] = []
        self._in_file: Data = {}
        self.now: Revision
        self.begin(Graph() if document is None else document)

    def begin(self, document: Opened, path: Path | None = None) -> None:
        """Show a document as it stands in a file; what was done before is forgotten."""
        self._in_file = document.to_data()
        self._done, self._undone = [Step(self._in_file, "")], []
        self._show(document, path)

    def change(self, form: Data, label: str) -> None:
        """Take another form, as one step that can be undone; an equal one is no step.

        Raises `FormatError` or `GraphError` for a form that could not be read again, with
        all that is wrong; the sheet then stays as it is.
        """
        document = self.read(form)
        if (changed := document.to_data()) != self.form:
            self._done.append(Step(changed, label))
            self._undone.clear()
            self._show(document, self.path)

    def open(self, name: str) -> None:
        """Show a file of the folder. Raises `FormatError`, `GraphError`, `RequestError`."""
        path = inside(self.folder, name)
        with resolving(Resolver(str(self.folder))):
            document = opened(path)
        self.stamp = _stamp(path)
        self.begin(document, path)

    def save(self, name: str, replace: bool = False) -> None:
        """Write the file as `Graph.save` does.

        Raises `RequestError` for a place outside of the folder and, without ``replace``, for
        a file that is not as this sheet knows it.
        """
        path = inside(self.folder, name)
        stamp = self.stamp if path == self.path else ""
        if not replace and _stamp(path) not in ("", stamp):
            fault = "the file is there, and is not the one on this sheet"
            if path == self.path:
                fault = "the file was changed by somebody else since it was read"
            remedy = "choose another name, or replace it"
            raise refused(path.name, fault, remedy, code="changed-file")
        document: Opened = self.now.document
        document.save(path)
        self.stamp = _stamp(path)
        moved = document.in_folder(str(path.parent))
        if moved.to_data() != self.form:  # paths to files inside are others there
            with resolving(Resolver(str(self.folder))):
                self.begin(opened(path), path)
        self._in_file, self.path = self.form, path

    def undo(self) -> str:
        """Take back the last change, if there is one; what it was."""
        return self._step(self._done, self._undone, 1)

    def redo(self) -> str:
        """Do again what was taken back last, if anything was; what it was."""
        return self._step(self._undone, self._done, 0)

    @property
    def form(self) -> Data:
        """The content of the file."""
        return self.now.form

    @property
    def saved(self) -> bool:
        """Whether the file holds this form; an empty sheet counts as saved."""
        return self.form == self._in_file

    @property
    def undoable(self) -> str:
        """What `undo` would take back, "" for nothing."""
        return self._done[-1].said

    @property
    def redoable(self) -> str:
        """What `redo` would do again, "" for nothing."""
        return self._undone[-1].said if self._undone else ""

    def data(self) -> Data:
        """Its file and its steps, for the page."""
        return {
            "file": self.path.relative_to(self.folder).as_posix() if self.path else "",
            "saved": self.saved,
            "undoable": self.undoable,
            "redoable": self.redoable,
        }

    def text(self) -> str:
        """The file's text, as `Graph.save` writes it."""
        return canonical_text(self.form)

    def changed(self, form: Data) -> Revision:
        """What the sheet would show of another form."""
        document = self.read(form)
        return Revision(self.now.number, document.to_data(), document)

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


READERS: Mapping[str, Callable[[str, Record], Opened]] = {
    "example": lambda name, _: opened(gallery()[name]),
    "text": lambda text, source: read_text(text, str(source.get("name", "the file"))),
    "link": lambda link, _: unpacked(link),
    "address": lambda address, _: _of_address(address),
    "new": lambda kind, _: Linkage() if kind == "joints" else Graph(),
}
"""What a new sheet is read from."""


def _of_address(address: str) -> Linkage:
    """The drawing that an address of PMKS+ holds; nothing is downloaded."""
    from blockmech.exchange.reading import imported

    if not address.lower().startswith("https://"):
        raise refused("address", f"{address[:60]} is no address", "paste one of PMKS+, https://...")
    return Linkage.from_data(imported(address))


class Desk:
    """The sheets that a server keeps, by name; that of a file goes by the file's."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.sheets: dict[str, Sheet] = {}

    def put(self, document: Opened | None = None, file: str = "") -> str:
        """A new sheet of a document, or of a file; its name. Raises like `Sheet.open`."""
        sheet, name = Sheet(document, self.folder), secrets.token_hex(4)
        if file:
            sheet.open(file)
        self.sheets[name] = sheet
        return name

    def create(self, source: Record) -> str:
        """A sheet of an example of the gallery, a file, a text, a link, or a new one; its name.

        Raises `RequestError` for anything else, and what reading raises.
        """
        if "file" in source:
            return self.open(str(source["file"]))
        key = next((key for key in READERS if key in source), "body")
        word = str(source.get(key, ""))
        if key == "body" or (key == "example" and word not in gallery()):
            raise refused(key, f"{word or 'nothing'} is no document", "choose another")
        return self.put(READERS[key](word, source))

    def open(self, file: str) -> str:
        """The sheet of a file of the folder. Raises like `Sheet.open`."""
        path = (self.folder / file).resolve()
        names = (name for name, sheet in self.sheets.items() if sheet.path == path)
        return next(names, "") or self.put(file=file)


def _stamp(path: Path) -> str:
    """What tells one content of a file from another, "" for no file."""
    try:
        return hashlib.sha256(text_of(path).encode()).hexdigest()
    except FormatError as error:
        return "" if error.problems[0].code == "no-file" else "unreadable"


KEY = "#doc="


def link_of(now: Revision, names: Iterable[str]) -> Link:
    """A revision, with programs of the named outputs, else of the drives."""
    page, why, text = None, "It is no mechanism yet.", canonical_text(now.form)
    if now.mechanism is not None:
        outputs = tuple(name for name in names if name in now.mechanism.outputs)
        try:
            page = contents_of(Order(now.mechanism, outputs or EVERYTHING))
        except BlockmechError as error:
            why = str(error)
    return Link(text, f"{now.form['name']}.json", page, why)


def packed(link: Link) -> str:
    """A link as what stands behind an address."""
    text = json.dumps(link._asdict(), allow_nan=False)
    maker = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    data = maker.compress(text.encode()) + maker.flush()
    return KEY + base64.urlsafe_b64encode(data).decode().rstrip("=")


def unpacked(fragment: str) -> Opened:
    """The document behind an address.

    Raises `RequestError` for what is none, or too large, and what reading a file raises.
    """
    text = fragment.removeprefix(KEY)
    try:
        data = base64.b64decode(text + "=" * (-len(text) % 4), b"-_", validate=True)
        maker = zlib.decompressobj(-zlib.MAX_WBITS)
        unpacked_bytes = maker.decompress(data, LARGEST)
        if maker.unconsumed_tail or not maker.eof:
            raise ValueError("it is cut, or larger than a document may be")
        document = str(json.loads(unpacked_bytes)["document"])
    except (ValueError, LookupError, TypeError, zlib.error, binascii.Error) as error:
        remedy = "copy the whole link again"
        raise refused("link", f"it holds no document: {error}", remedy, code="not-a-link") from None
    return read_text(document, "the link")


def picture_of(name: str) -> bytes:
    """The mechanism of a gallery graph as SVG."""
    from blockmech.draw.mechanism import draw_tile

    return rendered(draw_tile(opened(gallery()[name]).compile()), ".svg")


@cache
def title_of(name: str) -> str:
    """What a mechanism of the gallery is, in a line."""
    title: str = json.loads(gallery()[name].read_text("utf-8")).get("title", "")
    return title
