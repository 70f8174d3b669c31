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
from typing import Any

from blockmech.blocks.registry import REGISTRY
from blockmech.errors import FormatError, GraphError, Problem, listed
from blockmech.model import checks
from blockmech.model.contents import EXTRAS, FORMAT, GraphDocument
from blockmech.model.diagram import AnyBlock, UnknownBlock, Wire
from blockmech.model.graph import Graph
from blockmech.model.migrations import VERSION, migrate, version_problem
from blockmech.model.problems import MOST, in_file, path_text, said_already, unknown_key
from blockmech.model.reading import data_of, text_of
from blockmech.model.refusals import validated
from blockmech.model.writing import canonical_text, field_order, plain, write_checked
from blockmech.values import shown


def load(path: str | os.PathLike[str]) -> Graph:
    """Read a graph file.

    Raises
    ------
    FormatError with all problems of the file, those of its wiring included
    GraphError if only the wiring is wrong
    """
    file = os.fspath(path)
    return loads(text_of(path), file)


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
    document["blocks"] = {name: _block_data(block) for name, block in graph.blocks.items()}
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


def _block_data(block: AnyBlock) -> dict[str, Any]:
    if isinstance(block, UnknownBlock):
        return {"type": block.type, **block.raw}
    return {"type": block.type_name, **plain(block)}


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

    def note(self, problems: Iterable[Problem]) -> None:
        """Add what is wrong with the content, unless the text has said so already."""
        for problem in problems:
            if not said_already(problem, self.odd):
                self.content.append(problem)


def _read(text: str) -> _Draft:
    """Read everything that can be read. Raises `FormatError` where that is nothing."""
    raw, odd = data_of(text)
    draft = _Draft(odd, [*odd, *_identify(raw)])
    if any(p.code.endswith("-version") for p in draft.content):
        raw = {**raw, "version": VERSION}
    document = _sections({**migrate(raw), "format": FORMAT}, draft)
    graph = draft.graph
    graph.name, graph.title, graph.scene = document.name, document.title, document.scene
    for key in EXTRAS:
        if key in document.model_fields_set:
            graph.extras[key] = getattr(document, key)
    for name, block in document.blocks.items():
        if not draft.full:
            _add(draft, name, block)
    fed: dict[str, Wire] = {}
    no_blocks = any(problem.where == "blocks" for problem in draft.content)
    for ends in () if no_blocks else document.wires:
        if not draft.full:
            _connect(draft, Wire(ends.source, ends.target), fed)
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
    problem_of_version = version_problem(raw)
    if problem_of_version is not None:
        if problem_of_version.code == "newer-version":
            raise FormatError(problem_of_version)
        yield problem_of_version


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
    names = list(GraphDocument.model_fields)
    wrong = {_section(problem) for problem in problems}
    sound = {n: data[n] for k, n in enumerate(names) if n in data and k not in wrong}
    if names.index("wires") in wrong and isinstance(data["wires"], list):
        found = (re.match(r"wires\[(\d+)\]", problem.where) for problem in problems)
        places = {int(place[1]) for place in found if place}
        sound["wires"] = [w for k, w in enumerate(data["wires"]) if k not in places]
    return sound


def _section(problem: Problem) -> int:
    """Which section of the document a problem of its content is in."""
    names = list(GraphDocument.model_fields)
    name = re.split(r"[.\[]", problem.where, maxsplit=1)[0]
    return names.index(name) if name in names else len(names)


def _misnamed(document: GraphDocument, data: Mapping[str, Any]) -> Iterator[Problem]:
    """Keys of laws that are names in Python only, such as ``start`` for ``from``."""
    for driver, law in document.scene.drive.items():
        fields = type(law).model_fields
        keys = [fields[name].alias or name for name in field_order(type(law))]
        for key in data["scene"]["drive"][driver]:
            if key not in keys:
                where = path_text(("scene", "drive", driver, key))
                said = fields[key].alias or ""
                problem = unknown_key(where, f"the law {law.law}", key, keys)
                yield replace(problem, remedy=f'did you mean "{said}"?')


def _add(draft: _Draft, name: str, raw: Any) -> None:
    """Add a block; for one that is wrong a stand-in, so that wires to it are no problem."""
    problems, block = _block(name, raw)
    draft.note(problems)
    if block is None:
        draft.unread[name] = raw.get("type") if isinstance(raw, dict) else None
        block = UnknownBlock("")
    problem = checks.name_problem(draft.graph, name, block)
    if problem is None:
        draft.graph.blocks[name] = block
    else:
        draft.note([replace(problem, where=path_text(("blocks", name)))])


def _block(name: str, raw: Any) -> tuple[list[Problem], AnyBlock | None]:
    """A block, or what is wrong with it."""
    where = path_text(("blocks", name))
    if not isinstance(raw, dict):
        found = f"a block must be an object {{...}}, got {shown(raw)}"
        return [Problem("wrong-type", where, found)], None
    kind, types = raw.get("type"), f"types: {listed(REGISTRY, 30)}"
    if "type" not in raw:
        found = 'a block needs "type"'
        return [Problem("missing-key", f"{where}.type", found, types, "add it")], None
    if not isinstance(kind, str) or not kind:
        found = f"type must be the name of a block type, got {shown(kind)}"
        return [Problem("wrong-type", f"{where}.type", found, types)], None
    data = {key: said for key, said in raw.items() if key != "type"}
    cls = REGISTRY.get(kind)
    if cls is None:
        return [], UnknownBlock(kind, data)
    block, problems = validated(cls, data, kind, ("blocks", name))
    return problems, block


def _connect(draft: _Draft, wire: Wire, fed: dict[str, Wire]) -> None:
    """Add a wire that `Graph.connect` would take; note what is wrong with another."""
    problems = list(checks.wire_problems(draft.graph, wire, fed.get(wire.target)))
    if problems:
        draft.wiring += problems
        draft.refused |= {wire.target, wire.source}  # or the other way round
    else:
        draft.graph.wires.append(wire)
        fed.setdefault(wire.target, wire)


def _lacking(draft: _Draft) -> Iterator[Problem]:
    """What else `Graph.check` finds, but for what follows from blocks and wires left out."""
    if draft.full:
        return
    no_blocks = any(problem.where == "blocks" for problem in draft.content)
    no_frame_read = no_blocks or any(kind in ("frame", None) for kind in draft.unread.values())
    for problem in draft.graph.check():
        follows = {
            "unknown-block": problem.where in draft.unread,
            "unwired-joint": problem.where in draft.refused,
            "unknown-driver": problem.where.rsplit(".", 1)[-1] in draft.unread,
            "no-frame": no_frame_read,
        }
        if not follows.get(problem.code, False):
            yield problem
