"""The joint-based file: strict when read and canonical when written.

A file is refused for what is wrong in it by itself, with all its problems at once: keys,
values, and names of links, joints and drivers that are not there. Whether the links and
joints make a mechanism is told by `Linkage.check`.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from blockmech.errors import MOST, FormatError, Problem, in_file, path_text, said_already, shown
from blockmech.model.document import FORMAT as GRAPH
from blockmech.model.joints.contents import (
    EXTRAS,
    FORMAT,
    LOADS,
    JointsDocument,
    Section,
    bad_name,
    sections,
    unknown_kind,
)
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.references import reference_problems
from blockmech.model.migrations import VERSION, version_problem
from blockmech.model.reading import data_of, text_of
from blockmech.model.writing import canonical_text, plain, write_checked
from blockmech.validation_errors import validated
from blockmech.values import is_name

SECTIONS = ("links", "joints", "drivers", "loads")


def load(path: str | os.PathLike[str]) -> Linkage:
    """Read a joint-based file. Raises `FormatError` with all problems of the file."""
    return loads(text_of(path), os.fspath(path))


def loads(text: str, file: str = "") -> Linkage:
    """Read the text of a joint-based file; ``file`` is its name in messages."""
    try:
        draft = _read(text)
    except FormatError as error:
        raise FormatError(in_file(error.problems, file)) from error.__cause__
    if draft.problems:
        raise FormatError(in_file(sorted(draft.problems, key=_section), file))
    draft.linkage.file = file
    return draft.linkage


def dumps(linkage: Linkage) -> str:
    """The canonical text of a document. Raises `FormatError` for values JSON does not know."""
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "name": linkage.name}
    if linkage.title:
        data["title"] = linkage.title
    if linkage.gravity.z:
        data["gravity"] = linkage.gravity.written
    data["links"] = _items(linkage.links, ("mass", "inertia", "cm", "pose", "markers"))
    order = ("type", "links", "at", "angle", "dir", "slider", "friction")
    data["joints"] = _items(linkage.joints, order)
    more = {
        "drivers": _items(linkage.drivers, ("joint", "law"), "law"),
        "loads": {name: load_data(load) for name, load in linkage.loads.items()},
        "initial": plain(linkage.initial),
        "stops": plain(linkage.stops),
        **{key: plain(linkage.extras.get(key)) for key in EXTRAS},
    }
    return canonical_text(data | {key: said for key, said in more.items() if said})


def save(linkage: Linkage, path: str | os.PathLike[str]) -> None:
    """Write the canonical file, whole or not at all.

    Raises
    ------
    FormatError for a document that could not be read again; nothing is written
    RequestError where the place cannot be written
    """
    write_checked(path, dumps(linkage), loads)


def load_data(load: Any) -> dict[str, Any]:
    """A load as its file says it, the links that it takes hold of first."""
    kind = {"type": type(load).type_name.removeprefix(LOADS)}
    return kind | _ordered(plain(load), ("link", "links", "joint", "at"))


def _items(parts: Mapping[str, Any], order: tuple[str, ...], tag: str = "") -> dict[str, Any]:
    found = {}
    for name, part in parts.items():
        data = plain(part, tag)
        if "type" in type(part).model_fields:
            data["type"] = part.type
        found[name] = _ordered(data, order)
    return found


def _ordered(data: Mapping[str, Any], order: tuple[str, ...]) -> dict[str, Any]:
    return {key: data[key] for key in order if key in data} | dict(data)


@dataclass
class _Draft:
    """A document while it is read, with what is wrong."""

    odd: list[Problem]  # found in the text
    problems: list[Problem]
    linkage: Linkage = field(default_factory=Linkage)

    def note(self, problems: Iterable[Problem]) -> None:
        """Add what is wrong, unless the text has said so already."""
        for problem in problems:
            if not said_already(problem, self.odd):
                self.problems.append(problem)


def _read(text: str) -> _Draft:
    raw, odd = data_of(text)
    draft = _Draft(odd, [*odd, *_identify(raw)])
    if any(p.code.endswith("-version") for p in draft.problems):
        raw = {**raw, "version": VERSION}
    given = {key: raw.get(key, {}) for key in SECTIONS}
    shell = {**raw, "format": FORMAT} | {key: {} for key in SECTIONS if key in raw}
    document, problems = validated(JointsDocument, shell, "a joint-based file")
    draft.note(problems)
    for key, said in given.items():
        if not isinstance(said, dict):
            found = f"{key} must be an object {{...}}, got {shown(said)}"
            draft.note([Problem("wrong-type", key, found)])
            given[key] = {}
    linkage = draft.linkage
    if document is not None:
        linkage.name, linkage.title = document.name, document.title
        linkage.gravity = document.gravity
        linkage.initial, linkage.stops = document.initial, document.stops
        for key in EXTRAS:
            if key in document.model_fields_set:
                linkage.extras[key] = getattr(document, key)
    for name, section in sections().items():
        for item, said in given[name].items():
            if len(draft.problems) > MOST:
                return draft
            part = _part(draft, (name, item), said, section)
            if part is not None:
                getattr(linkage, name)[item] = part
    draft.note(reference_problems(linkage, given))
    return draft


def _part(draft: _Draft, at: tuple[str, str], raw: Any, section: Section) -> Any:
    """One link, joint, driver or load, or None; what is wrong with it is noted."""
    where, what, key = path_text(at), at[0][:-1], section.key
    if not is_name(at[1]):
        draft.note([bad_name(what, at[1], where)])
    if not isinstance(raw, dict):
        found = f"a {what} must be an object {{...}}, got {shown(raw)}"
        draft.note([Problem("wrong-type", where, found)])
        return None
    model, said = section.plain, section.plain_said
    if (key and key in raw) or model is None:
        word = raw.get(key)
        model = section.models.get(word) if isinstance(word, str) else None
        said = section.said.format(word)
        if model is None:
            draft.note([_no_kind(raw, (*at, key), section)])
            return None
        if key not in model.model_fields:  # the kind of a load is not among its own keys
            raw = {k: item for k, item in raw.items() if k != key}
    part, problems = validated(model, raw, said, at)
    draft.note(problems)
    return part


def _no_kind(raw: dict[str, Any], at: tuple[str, str, str], section: Section) -> Problem:
    """The problem of an item that does not tell its kind."""
    name, _, key = at
    if key not in raw:
        return Problem("missing-key", path_text(at), f'a {name[:-1]} needs "{key}"', "", "add it")
    return unknown_kind(raw[key], path_text(at), section)


def _identify(raw: Mapping[str, Any]) -> Iterator[Problem]:
    """What is wrong with format and version. Raises if it is another document altogether."""
    said, valid = raw.get("format"), f'a joint-based file has "format": "{FORMAT}"'
    if said != FORMAT:
        found = f"the format is {shown(said)}" if "format" in raw else "the file names no format"
        remedy = "open it as a Graph" if said == GRAPH else ""
        problem = Problem("wrong-format", "format", found, valid, remedy)
        if "format" in raw or "joints" not in raw:
            raise FormatError(problem)
        yield replace(problem, remedy="add it")
    problem_of_version = version_problem(raw)
    if problem_of_version is not None:
        if problem_of_version.code == "newer-version":
            raise FormatError(problem_of_version)
        yield problem_of_version


def _section(problem: Problem) -> int:
    """Which section of the document a problem is in."""
    names = list(JointsDocument.model_fields)
    name = problem.where.split(".")[0].split("[")[0]
    return names.index(name) if name in names else len(names)
