"""A graph as a block of another graph: the block that stands for it, and where its file is found.

Blocks inside are addressed through it: ``knee.dyad.B``. What computes sees the blocks written
out (`blockmech.model.flat`); this one is what files, editors and diagrams show.

Source: Schiehlen, Multibody system dynamics: roots and perspectives, Multibody System Dynamics 1
(1997), section 6 (modular simulation, subsystems joined by their ports).
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import Field, PrivateAttr, WithJsonSchema, field_validator, model_validator

from blockmech.blocks.block import Block
from blockmech.ground.errors import BlockmechError, FormatError, GraphError, Problem
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Finite
from blockmech.model.versions import current
from blockmech.typing import Data

Content: TypeAlias = Any
"""The `blockmech.Graph` inside of a block, which is made of blocks itself."""

HEAD = ("format", "version")  # of a file, which a graph inside of another need not have
FOLDERS = "BLOCKMECH_PATH"  # environment variable: folders with libraries
LIBRARIES = "blockmech.libraries"  # group of entry points: name of a library -> package
NO_GRAPH = {"empty-file", "not-an-object", "syntax", "truncated", "wrong-encoding", "wrong-format"}
"""Codes of texts that are no graph: of one that a document names nothing is quoted."""

INLINE = {"type": "object", "required": ["blocks"]}  # what is inside, the whole schema says


class Subgraph(Block, type="graph"):
    """A graph as a block of another one, inline or from a file.

    Its unwired joints and its markers are ports of the outer graph:
    ``knee.dyad.B``. Gravity is that of the outer graph; drives, starts and stops of the subgraph
    apply unless the outer scene replaces them.

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

    _called: ClassVar[str] = "a graph"
    refers: ClassVar[tuple[str, ...]] = ("on",)

    file: str = ""
    graph: Annotated[Data | None, WithJsonSchema(INLINE)] = None
    on: Annotated[str, Field(json_schema_extra={"pattern": r"^[^./]+(\.[^./]+)+$"})] = ""
    given: dict[str, Finite] = Field(default={}, alias="parameters")

    _content: Content | None = PrivateAttr(None)
    _size: int = PrivateAttr(1)

    @field_validator("graph", mode="before")
    @classmethod
    def _as_data(cls, raw: Any) -> Any:
        data = raw.to_data() if hasattr(raw, "to_data") else raw
        own = isinstance(data, dict) and str(data.get("format", "")).startswith("blockmech/")
        return {k: x for k, x in current(data).items() if k not in HEAD} if own else data

    @model_validator(mode="after")
    def _one_source(self) -> Subgraph:
        if bool(self.file) == (self.graph is not None):
            raise mistake("wrong-value", 'a graph has either "file" or "graph"')
        return self

    @property
    def content(self) -> Content:
        """Content of the inner graph's file; None before it is read."""
        return self._content

    @property
    def size(self) -> int:
        """Number of blocks of the expanded graph."""
        return self._size

    def holding(self, content: Content) -> Subgraph:
        """The same block with its graph read."""
        block = self.model_copy()
        block._content, block._size = content, content.size
        return block

    def seen_from(self, old: str, new: str) -> Subgraph:
        """The same block in a document of another folder, with file paths relative to it."""
        if self.file:
            return self.model_copy(update={"file": moved(self.file, old, new)})
        data = copy.deepcopy(self.graph)
        _move_files(data, old, new)
        return self.model_copy(update={"graph": data})


@dataclass
class Resolver:
    """Where the files of graphs inside of graphs are, and how much of them is read, each once.

    Attributes
    ----------
    root : folder that files beside documents do not leave, links followed; "" is any
    depth : most graphs inside of one another
    blocks : most blocks of a document written out
    size : most bytes of all files
    """

    root: str = ""
    depth: int = 20
    blocks: int = 10_000
    size: int = 16_000_000
    documents: list[str] = field(default_factory=list)  # being read, the outermost first
    graphs: dict[str, Content | BlockmechError] = field(default_factory=dict)  # by `_one_file`

    @contextmanager
    def inside(self, document: str) -> Iterator[None]:
        """Inside, graphs are parts of a document. Raises `FormatError` for too many in a row."""
        if len(self.documents) == self.depth:
            message = f"graphs are nested more than {self.depth} deep"
            raise FormatError(Problem("too-deep", "blocks", message, "", "write some of them out"))
        self.documents.append(os.path.abspath(document) if document else "")
        try:
            yield
        finally:
            self.documents.pop()

    def read(self, file: str, where: str, load: Callable[[str], Content]) -> Content:
        """The graph in a file that the innermost document names there.

        Raises `FormatError`, `GraphError`.
        """
        path = self._path(file, os.path.dirname(self.documents[-1]), where)
        same = _one_file(path)
        if same in map(_one_file, filter(None, self.documents)):
            files = (*dict.fromkeys(filter(None, self.documents)), path)
            message = f"the graph contains itself: {' -> '.join(map(os.path.basename, files))}"
            raise FormatError(Problem("cycle", where, message, "a subgraph must be another graph"))
        if same not in self.graphs:
            try:
                self.graphs[same] = self._loaded(path, file, where, load)
            except (FormatError, GraphError) as error:
                self.graphs[same] = error
        if isinstance(graph := self.graphs[same], BlockmechError):
            raise graph
        return graph

    def _loaded(self, path: str, file: str, where: str, load: Callable[[str], Content]) -> Content:
        self.size -= os.path.getsize(path)
        if self.size < 0:
            message = "the files of graphs inside are too large together"
            raise FormatError(Problem("too-large", "blocks", message))
        try:
            return load(path)
        except FormatError as error:
            if NO_GRAPH.isdisjoint(p.code for p in error.problems):
                raise
            place, message = error.problems[0].where, f'"{file}" is no graph'
            message += f" ({place})" if place.startswith("line") else ""
            remedy = "open it by itself to see what is wrong"
            raise FormatError(Problem("no-graph", where, message, "", remedy)) from None

    def _path(self, file: str, folder: str, where: str) -> str:
        """Path of a graph's file. Raises `FormatError` with the places where it was looked for.

        Beside the document comes first, then the folders of ``BLOCKMECH_PATH``, then the packages
        whose entry points in ``blockmech.libraries`` have the first part of the path as their name.
        """
        places = [folder, *filter(None, os.environ.get(FOLDERS, "").split(os.pathsep))]
        beside = os.path.realpath(os.path.join(folder, file))
        if self.root and not Path(beside).is_relative_to(os.path.realpath(self.root)):
            message = f'"{file}" is outside of the folder whose files are read'
            remedy = "put the file into the folder"
            raise FormatError(Problem("not-inside", where, message, "", remedy))
        for path in chain((os.path.join(place, file) for place in places), _in_packages(file)):
            if os.path.isfile(path):
                return os.path.normpath(path)
        message = f'there is no file "{file}"'
        nearby = "beside the document" if folder else "in the working folder"
        valid = f"looked for {nearby}, in the folders of {FOLDERS} and in installed libraries"
        raise FormatError(
            Problem("no-file", where, message, valid, "check the name and the folder")
        )


_CURRENT: ContextVar[Resolver | None] = ContextVar("resolver", default=None)


@contextmanager
def resolving(resolver: Resolver | None = None) -> Iterator[Resolver]:
    """Inside, files are read by this resolver, without one by that of outside, or by a new one."""
    current = resolver or _CURRENT.get() or Resolver()
    token = _CURRENT.set(current)
    try:
        yield current
    finally:
        _CURRENT.reset(token)


def _one_file(path: str) -> str:
    """A path by which the same file is known, whatever links and capitals lead to it."""
    return os.path.normcase(os.path.realpath(path))


def _in_packages(file: str) -> Iterator[str]:
    from importlib.metadata import entry_points
    from importlib.resources import files

    library, _, rest = file.replace("\\", "/").partition("/")
    for point in entry_points(group=LIBRARIES, name=library):
        try:
            yield os.fspath(files(point.value).joinpath(rest))  # type: ignore[call-overload]
        except (ImportError, TypeError) as error:
            message = f"the library {point.value} failed to load: {error}"
            wrong = Problem("broken-plugin", library, message, "", "repair or uninstall it")
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
