"""A graph as a block of another graph: the block that stands for it, and where its file is found.

Blocks inside are addressed through it: ``knee.dyad.B``. What computes sees the blocks written
out (`blockmech.model.flat`); this one is what files, editors and diagrams show.

Source: Schiehlen, Multibody system dynamics: roots and perspectives, Multibody System Dynamics 1
(1997), section 6 (modular simulation, subsystems joined by their ports).
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, ClassVar, Protocol, Self

from pydantic import Field, PrivateAttr, WithJsonSchema, field_validator, model_validator

from blockmech.blocks.block import Block
from blockmech.errors import FormatError, Problem
from blockmech.values import Number, mistake


class Content(Protocol):
    """What a block that is a graph needs of the graph inside; `blockmech.Graph` is one."""

    blocks: dict[str, Any]
    wires: list[Any]
    parameters: dict[str, str | list[str]]

    @property
    def scene(self) -> Any:
        """Gravity, drives, starts and stops."""

    def sections(self) -> dict[str, Any]:
        """What stands in its file between head and extras."""

    def with_numbers(self, numbers: Mapping[tuple[str | int, ...], Any]) -> Self:
        """A copy with other numbers at some paths, unchecked."""

    def flat(self) -> Self:
        """The same with the blocks of graphs inside written out."""


HEAD = ("format", "version")  # of a file, which a graph inside of another need not have
FOLDERS = "BLOCKMECH_PATH"  # environment variable: folders with libraries
ROOT: ContextVar[str] = ContextVar("root", default="")
LIBRARIES = "blockmech.libraries"  # group of entry points: name of a library -> package

INLINE = {"type": "object", "required": ["blocks"]}  # what is inside, the whole schema says


class Subgraph(Block, type="graph"):
    """A graph inside of another one, from a file or written here.

    Its joints that nothing feeds are ports of the outer graph, and so are its markers:
    ``knee.dyad.B``. Gravity is the outer graph's; drives, starts and stops are its own, unless
    the outer scene has others for them.

    Parameters
    ----------
    file : path from the folder of the document, else from a folder of the environment variable
        ``BLOCKMECH_PATH``, else of an installed library whose name is its first part
    graph : the graph itself, in place of a file
    on : marker ``"block.marker"`` on which its frame stands: at its place, along its direction;
        without it its frame is the outer frame
    parameters : numbers of it that differ [SI units], by the names that it gives them or by address

    >>> import blockmech as bm
    >>> leg = bm.Graph("leg")
    >>> leg.add("dyad", bm.RRR(l_i=0.4, l_j=0.4))
    >>> bm.Subgraph(graph=leg, parameters={"dyad.l_i": 0.5}).given
    {'dyad.l_i': 0.5}
    """

    called: ClassVar[str] = "a graph"
    refers: ClassVar[tuple[str, ...]] = ("on",)

    file: str = ""
    graph: Annotated[dict[str, Any] | None, WithJsonSchema(INLINE)] = None
    on: Annotated[str, Field(json_schema_extra={"pattern": r"^[^./]+(\.[^./]+)+$"})] = ""
    given: dict[str, Number] = Field(default={}, alias="parameters")

    _content: Content | None = PrivateAttr(None)

    @field_validator("graph", mode="before")
    @classmethod
    def _as_data(cls, raw: Any) -> Any:
        data = raw.to_data() if hasattr(raw, "to_data") else raw
        if isinstance(data, dict) and not str(data.get("format", "")).startswith("blockmech/"):
            return data
        return {k: x for k, x in data.items() if k not in HEAD} if isinstance(data, dict) else data

    @model_validator(mode="after")
    def _one_source(self) -> Subgraph:
        if bool(self.file) == (self.graph is not None):
            raise mistake("wrong-value", 'a graph has either "file" or "graph"')
        return self

    @property
    def content(self) -> Content | None:
        """The graph inside as its file has it; None before it is read."""
        return self._content

    def holding(self, content: Content) -> Subgraph:
        """The same block with its graph read."""
        block = self.model_copy()
        block._content = content
        return block

    def seen_from(self, old: str, new: str) -> Subgraph:
        """The same block in a document of another folder: paths to files lead there from it."""
        if self.file:
            return self.model_copy(update={"file": moved(self.file, old, new)})
        data = copy.deepcopy(self.graph)
        _move_files(data, old, new)
        return self.model_copy(update={"graph": data})


@contextmanager
def within(folder: str | os.PathLike[str]) -> Iterator[None]:
    """Inside, files of graphs are read from a folder and from libraries alone, links followed."""
    before = ROOT.set(os.path.realpath(folder))
    try:
        yield
    finally:
        ROOT.reset(before)


def found_file(file: str, folder: str, where: str) -> str:
    """Path of a graph's file. Raises `FormatError` with the places where it was looked for.

    Beside the document comes first, then the folders of ``BLOCKMECH_PATH``, then the packages
    whose entry points in ``blockmech.libraries`` have the first part of the path as their name.
    """
    places = [folder, *filter(None, os.environ.get(FOLDERS, "").split(os.pathsep))]
    beside, root = os.path.realpath(os.path.join(folder, file)), ROOT.get()
    if root and not Path(beside).is_relative_to(root):
        found = f'"{file}" is outside of the folder whose files are read'
        raise FormatError(Problem("not-inside", where, found, "", "put the file into the folder"))
    for path in (*(os.path.join(place, file) for place in places), *_in_packages(file)):
        if os.path.isfile(path):
            return os.path.normpath(path)
    found = f'there is no file "{file}"'
    nearby = "beside the document" if folder else "in the working folder"
    valid = f"looked for {nearby}, in the folders of {FOLDERS} and in installed libraries"
    raise FormatError(Problem("no-file", where, found, valid, "check the name and the folder"))


def _in_packages(file: str) -> Iterator[str]:
    from importlib.metadata import entry_points
    from importlib.resources import files

    library, _, rest = file.replace("\\", "/").partition("/")
    for point in entry_points(group=LIBRARIES, name=library):
        try:
            yield os.fspath(files(point.value).joinpath(rest))  # type: ignore[call-overload]
        except (ImportError, TypeError) as error:
            found = f"the library {point.value} failed to load: {error}"
            wrong = Problem("broken-plugin", library, found, "", "repair or uninstall it")
            raise FormatError(wrong) from error


def _move_files(data: Any, old: str, new: str) -> None:
    """Let the files of graphs in a graph's data be found from another folder."""
    blocks = data.get("blocks", {}) if isinstance(data, dict) else {}
    for raw in blocks.values():
        if isinstance(raw, dict) and raw.get("type") == Subgraph.type_name:
            if isinstance(raw.get("file"), str):
                raw["file"] = moved(raw["file"], old, new)
            _move_files(raw.get("graph"), old, new)


def moved(file: str, old: str, new: str) -> str:
    """A file's path from one document's folder, as it is from another one's."""
    if os.path.isabs(file) or not os.path.isfile(os.path.join(old, file)):
        return file  # of a library, which is found from anywhere
    target = os.path.abspath(os.path.join(old, file))
    try:
        return os.path.relpath(target, new or os.curdir).replace(os.sep, "/")
    except ValueError:  # another drive of Windows
        return target
