"""The JSON graph: a mechanism as one file, strict when read and canonical when written.

A file is refused for what `Graph.add` and `Graph.connect` would refuse, with all its
problems at once. An unfinished mechanism (a joint without a wire, a block type that is
not installed) is read; `Graph.check` tells what it lacks.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

from pydantic import Field

from blockmech.blocks.registry import REGISTRY
from blockmech.errors import (
    MOST,
    FormatError,
    GraphError,
    Problem,
    in_file,
    listed,
    path_text,
    said_already,
    shown,
    unknown_key,
)
from blockmech.model import checks
from blockmech.model.diagram import AnyBlock, UnknownBlock, Wire
from blockmech.model.expect import Expectation
from blockmech.model.graph import Graph
from blockmech.model.migrations import VERSION, migrate, version_problem
from blockmech.model.reading import data_of, text_of
from blockmech.model.scene import Scene
from blockmech.model.writing import canonical_text, plain, write_checked
from blockmech.validation_errors import field_order, validated
from blockmech.values import Strictly

FORMAT = "blockmech/graph"
EXTRAS = ("view", "expect", "source", "notes")
"""Sections that travel with a graph and are not computed with."""


class WireEnds(Strictly):
    """From ``"block.marker"`` of an earlier link to ``"block.joint"`` of a later block."""

    source: str = Field(alias="from")
    target: str = Field(alias="to")


class GraphDocument(Strictly):
    """A mechanism as a block diagram, in SI units and radians."""

    format: Literal["blockmech/graph"]
    version: Annotated[int, Field(strict=True, ge=1, le=VERSION)]
    name: str = "mechanism"
    title: str = ""
    blocks: dict[str, Any]
    wires: list[WireEnds] = []
    scene: Scene = Scene()
    view: Annotated[dict[str, Any], Field(description="places on a canvas; not computed with")] = {}
    expect: list[Expectation] = []
    source: str = ""
    notes: str | list[str] = ""


SECTIONS = tuple(GraphDocument.model_fields)


def load(path: str | os.PathLike[str]) -> Graph:
    """Read a graph file.

    Raises
    ------
    FormatError with all problems of the file, those of its wiring included
    GraphError if only the wiring is wrong
    """
    return loads(text_of(path), os.fspath(path))


def loads(text: str, file: str = "") -> Graph:
    """Read the text of a graph file; ``file`` is its name in messages. Raises like `load`."""
    try:
        draft = _read(text)
    except FormatError as error:
        raise FormatError(in_file(error.problems, file)) from error.__cause__
    if draft.content or draft.wiring:
        content = sorted(draft.content, key=_section)
        problems = in_file([*content, *draft.wiring, *_lacking(draft)], file)
        raise FormatError(problems) if draft.content else GraphError(problems)
    draft.graph.file = file
    return draft.graph


def dumps(graph: Graph) -> str:
    """The canonical text of a graph. Raises `FormatError` for values that JSON does not know."""
    document: dict[str, Any] = {"format": FORMAT, "version": VERSION, "name": graph.name}
    if graph.title:
        document["title"] = graph.title
    document["blocks"] = {
        name: {"type": block.type, **block.raw}
        if isinstance(block, UnknownBlock)
        else {"type": block.type_name, **plain(block)}
        for name, block in graph.blocks.items()
    }
    document["wires"] = [{"from": wire.source, "to": wire.target} for wire in graph.wires]
    sections = {"scene": plain(graph.scene), **{key: graph.extras.get(key) for key in EXTRAS}}
    return canonical_text(document | {key: plain(said) for key, said in sections.items() if said})


def save(graph: Graph, path: str | os.PathLike[str]) -> None:
    """Write the canonical file, whole or not at all.

    Raises
    ------
    FormatError, GraphError for a graph that could not be read again; nothing is written
    RequestError where the place cannot be written
    """
    write_checked(path, dumps(graph), loads)


@dataclass
class _Draft:
    """A graph while it is read, with what is wrong."""

    odd: list[Problem]  # found in the text
    content: list[Problem]  # all that is wrong before the wiring
    wiring: list[Problem] = field(default_factory=list)
    graph: Graph = field(default_factory=Graph)
    unread: dict[str, Any] = field(default_factory=dict)  # block that is wrong -> its type
    refused: set[str] = field(default_factory=set)  # joints whose wire is wrong

    @property
    def full(self) -> bool:
        """Whether there are more problems than are shown, so that no more are looked for."""
        return len(self.content) + len(self.wiring) > MOST

    @property
    def no_blocks(self) -> bool:
        """Whether there is no section of blocks to be read."""
        return any(problem.where == "blocks" for problem in self.content)

    def note(self, problems: Iterable[Problem]) -> None:
        """Add what is wrong with the content, unless the text has said so already."""
        self.content += [p for p in problems if not said_already(p, self.odd)]


def _read(text: str) -> _Draft:
    """Read everything that can be read. Raises `FormatError` where that is nothing."""
    raw, odd = data_of(text)
    draft = _Draft(odd, [*odd, *_identify(raw)])
    if any(p.code.endswith("-version") for p in draft.content):
        raw = {**raw, "version": VERSION}
    document = _sections({**migrate(raw), "format": FORMAT}, draft)
    graph = draft.graph
    graph.name, graph.title, graph.scene = document.name, document.title, document.scene
    given = document.model_fields_set.intersection(EXTRAS)
    graph.extras.update((key, getattr(document, key)) for key in EXTRAS if key in given)
    for name, block in document.blocks.items():
        if not draft.full:
            _add(draft, name, block)
    fed: dict[str, Wire] = {}
    for ends in () if draft.no_blocks else document.wires:
        wire = Wire(ends.source, ends.target)
        problems = checks.wire_problems(graph.blocks, wire, fed.get(wire.target))
        if draft.full:
            break
        if found := list(problems):
            draft.wiring += found
            draft.refused |= {wire.target, wire.source}  # or the other way round
        else:
            graph.wires.append(wire)
            fed.setdefault(wire.target, wire)
    return draft


OTHER_DOCUMENTS = {
    "blockmech/joints": (
        "the file holds links and joints, not blocks",
        'read it with Linkage.load, or let "blockmech decompose" write its graph',
    ),
    "blockmech/result": (
        "the file is the result of a run, not a mechanism",
        "name the graph file that it was computed from",
    ),
}


def _identify(raw: Mapping[str, Any]) -> Iterator[Problem]:
    """What is wrong with format and version. Raises if it is another document altogether."""
    said, valid = raw.get("format"), f'a graph file has "format": "{FORMAT}"'
    if said != FORMAT:
        found = f"the format is {shown(said)}" if "format" in raw else "the file names no format"
        remedy = "" if "format" in raw else "add it"
        if isinstance(said, str) and said in OTHER_DOCUMENTS:
            found, remedy = OTHER_DOCUMENTS[said]
        problem = Problem("wrong-format", "format", found, valid, remedy)
        if "format" in raw or "blocks" not in raw:
            raise FormatError(problem)
        yield problem
    of_version = version_problem(raw)
    if of_version is not None:
        if of_version.code == "newer-version":
            raise FormatError(of_version)
        yield of_version


def _sections(data: dict[str, Any], draft: _Draft) -> GraphDocument:
    """The document; what is wrong in it is noted and left out."""
    document, problems = validated(GraphDocument, data, "a graph file")
    draft.note(problems)
    if document is not None:
        draft.note(_misnamed(document, data))
        return document
    nothing = {"format": FORMAT, "version": VERSION, "blocks": {}}
    sound, _ = validated(GraphDocument, nothing | _without(problems, data), "a graph file")
    return sound or GraphDocument.model_validate(nothing)


def _without(problems: list[Problem], data: Mapping[str, Any]) -> dict[str, Any]:
    """The sections in which nothing is wrong; of the wires, those that are not."""
    wrong = {_section(problem) for problem in problems}
    sound = {n: data[n] for k, n in enumerate(SECTIONS) if n in data and k not in wrong}
    if SECTIONS.index("wires") in wrong and isinstance(data["wires"], list):
        found = (re.match(r"wires\[(\d+)\]", problem.where) for problem in problems)
        places = {int(place[1]) for place in found if place}
        sound["wires"] = [w for k, w in enumerate(data["wires"]) if k not in places]
    return sound


def _section(problem: Problem) -> int:
    """Which section of the document a problem of its content is in."""
    name = re.split(r"[.\[]", problem.where, maxsplit=1)[0]
    return SECTIONS.index(name) if name in SECTIONS else len(SECTIONS)


def _misnamed(document: GraphDocument, data: Mapping[str, Any]) -> Iterator[Problem]:
    """Keys of laws that are names in Python only, such as ``start`` for ``from``."""
    for driver, law in document.scene.drive.items():
        fields = type(law).model_fields
        keys = [fields[name].alias or name for name in field_order(type(law))]
        for key in data["scene"]["drive"][driver]:
            if key not in keys:
                where = path_text(("scene", "drive", driver, key))
                problem = unknown_key(where, f"the law {law.law}", key, keys)
                yield replace(problem, remedy=f'did you mean "{fields[key].alias}"?')


def _add(draft: _Draft, name: str, raw: Any) -> None:
    """Add a block; for one that is wrong a stand-in, so that wires to it are no problem."""
    problems, block = _block(name, raw)
    draft.note(problems)
    if block is None:
        draft.unread[name] = raw.get("type") if isinstance(raw, dict) else None
        block = UnknownBlock("")
    problem = checks.name_problem(draft.graph.blocks, name, block)
    if problem is None:
        draft.graph.blocks[name] = block
    else:
        draft.note([replace(problem, where=path_text(("blocks", name)))])


def _block(name: str, raw: Any) -> tuple[list[Problem], AnyBlock | None]:
    """A block, or what is wrong with it."""
    where, types = path_text(("blocks", name)), f"types: {listed(REGISTRY, 30)}"
    if not isinstance(raw, dict):
        found = f"a block must be an object {{...}}, got {shown(raw)}"
        return [Problem("wrong-type", where, found)], None
    if "type" not in raw:
        found = 'a block needs "type"'
        return [Problem("missing-key", f"{where}.type", found, types, "add it")], None
    kind = raw["type"]
    if not isinstance(kind, str) or not kind:
        found = f"type must be the name of a block type, got {shown(kind)}"
        return [Problem("wrong-type", f"{where}.type", found, types)], None
    data = {key: said for key, said in raw.items() if key != "type"}
    cls = REGISTRY.get(kind)
    if cls is None:
        return [], UnknownBlock(kind, data)
    block, problems = validated(cls, data, kind, ("blocks", name))
    return problems, block


def _lacking(draft: _Draft) -> Iterator[Problem]:
    """What else `Graph.check` finds, but for what follows from blocks and wires left out."""
    if draft.full:
        return
    no_frame_read = any(kind in ("frame", None) for kind in draft.unread.values())
    for problem in draft.graph.check():
        follows = {
            "unknown-block": problem.where in draft.unread,
            "unwired-joint": problem.where in draft.refused,
            "unknown-driver": problem.where.rsplit(".", 1)[-1] in draft.unread,
            "no-frame": draft.no_blocks or no_frame_read,
        }
        if not follows.get(problem.code, False):
            yield problem
