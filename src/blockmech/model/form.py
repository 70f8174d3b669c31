"""Kinds of documents as data, and the reading of any of them.

A document is read in one way: format and version, the sections by a pydantic model, then the
named items of a section (blocks, links, loads ...) one by one by the model of their kind. All
that is wrong is reported at once.

A document is written in one layout, byte for byte. It and its sections are always open, one item
a line. What fits on a line stands on it; what does not is opened, one key a line down to the keys
of a block, and filled like a paragraph further in.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from pydantic.fields import FieldInfo

from blockmech.functions.pieces import Function
from blockmech.ground.errors import (
    MOST,
    FormatError,
    GraphError,
    Path,
    Problem,
    close_match,
    listed,
    path_text,
    said_already,
    shown,
)
from blockmech.ground.names import NAME_RULE, is_name
from blockmech.ground.report import WIDTH
from blockmech.ground.validation_errors import field_order, validated
from blockmech.ground.values import StrictModel
from blockmech.model.versions import VERSION
from blockmech.typing import Data, Record

SECTIONS = 2  # levels that are always open: the document and its sections
KEY_A_LINE = SECTIONS + 1  # levels that are opened one item a line: to the keys of a block


def plain(value: Any) -> Any:
    """A model as JSON data: what the author gave, under the names of the file.

    The key by which a reader tells the kind of a model is always written, but for the kind that
    data without it are.
    """
    if isinstance(value, StrictModel):
        data = {}
        for name in field_order(type(value)):
            field, item = type(value).model_fields[name], getattr(value, name)
            given = name in value.model_fields_set and not (item is None and field.default is None)
            if given or (name == value.kind_key and item != value.plain_kind):
                data[field.alias or name] = plain(item)
        return data
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return getattr(value, "written", value)


def canonical_text(document: Record) -> str:
    """The text of a document, lines of up to 100 characters where words allow.

    Raises `FormatError` for values that JSON does not know.
    """
    _check_json(document, ())
    return _text(document, 0, 0) + "\n"


def _check_json(value: object, path: tuple[str | int, ...]) -> None:
    if isinstance(value, Mapping):
        for key, item in value.items():
            if not isinstance(key, str):
                raise _error("not-json", path, "a key must be a text", key)
            _check_json(item, (*path, key))
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            _check_json(item, (*path, k))
    elif isinstance(value, float) and not math.isfinite(value):
        raise _error("non-finite", path, "must be a finite number", float(value))
    elif isinstance(value, Function):
        remedy = "say it as a table, a polynomial or a Fourier series"
        raise _error("not-json", path, "a function of Python is not written", value.call, remedy)
    elif callable(value):
        raise _error("not-json", path, "a function of Python is not written", value)
    elif not isinstance(value, str | int | float | None):
        raise _error("not-json", path, "must be JSON data", value)


def _error(
    code: str, path: tuple[str | int, ...], rule: str, value: object, remedy: str = ""
) -> FormatError:
    return FormatError(Problem(code, path_text(path), f"{rule}, got {value!r:.60}", "", remedy))


def _text(value: Any, column: int, depth: int, last: bool = True) -> str:
    """Text of a value that starts at a column; what is not last leaves room for a comma."""
    inside = isinstance(value, Mapping | list | tuple) and bool(value)
    if not inside or depth >= SECTIONS or _is_vector(value):
        flat = json.dumps(value, ensure_ascii=False)
        if not inside or len(flat) <= WIDTH - column - (not last):
            return flat
    if isinstance(value, Mapping):
        ends = "{}"
        items = [(f"{json.dumps(key, ensure_ascii=False)}: ", value[key]) for key in value]
    else:
        ends, items = "[]", [("", item) for item in value]
    indent = " " * (2 * depth + 2)
    lines: list[str] = []
    for k, (head, item) in enumerate(items, 1):
        text = head + _text(item, len(indent) + len(head), depth + 1, k == len(items))
        joined = f"{lines[-1]}, {text}" if lines and depth >= KEY_A_LINE else "\n"
        if "\n" not in joined and len(joined) < WIDTH - len(indent):  # and a comma
            lines[-1] = joined
        else:
            lines.append(text)
    inner = f",\n{indent}".join(lines)
    return f"{ends[0]}\n{indent}{inner}\n{indent[2:]}{ends[1]}"


def _is_vector(value: Any) -> bool:
    """Whether a value is a list of numbers, such as the gravity of a document."""
    return not isinstance(value, Mapping) and all(isinstance(x, int | float) for x in value)


HEAD = ("format", "version", "name", "title")
EXTRAS = ("view", "expect", "source", "notes")
"""Sections that travel with a document and are not computed with."""

FORMATS = {
    "blockmech/graph": ("the file holds blocks, not links and joints", "open it as a Graph"),
    "blockmech/joints": (
        "the file holds links and joints, not blocks",
        'read it with Linkage.load, or let "blockmech decompose" write its graph',
    ),
    "blockmech/result": (
        "the file is the result of a run, not a mechanism",
        "name the graph file that it was computed from",
    ),
}
"""What files of blockmech hold, and what to do with one that is not the one wanted."""


class Section(NamedTuple):
    """What the named items of a section are.

    what : what one is called, e.g. "block"
    kinds : word of the file -> model of that kind
    key : the key that holds this word; "" where all items are ``plain``
    said : what an item of a kind is called in messages, "{}" for its word
    plain, plain_said : model of items without the key, and what they are called
    first : keys that are written first, in this order
    prefix : what the file leaves out of the names of block types
    other : what stands for an item of an unknown kind; without it such an item is wrong
    """

    what: str
    kinds: Any
    key: str = ""
    said: str = "{}"
    plain: type[StrictModel] | None = None
    plain_said: str = ""
    first: tuple[str, ...] = ()
    prefix: str = ""
    other: Callable[[str, Data], Any] | None = None

    def unknown_kind(self, word: object, where: str) -> Problem:
        """The problem that names an unknown kind of an item and its nearest relatives."""
        remedy = close_match(word, self.kinds) if isinstance(word, str) else ""
        if self.prefix:  # kinds that are registered, also by a file of the user's
            remedy = remedy or "import the file that defines it"
        return Problem("wrong-value", where, f"no {self.key} {shown(word)}", self.words, remedy)

    @property
    def words(self) -> str:
        """The kinds in a sentence."""
        return f"{self.key}s: {listed(self.kinds, 30)}"

    def word(self, item: StrictModel) -> str:
        """The kind of an item in a file; "" of one that is of no kind."""
        kind = getattr(item, "type_name", "").removeprefix(self.prefix)
        return kind or (str(getattr(item, self.key, "")) if self.key else "")

    def foreign(self, items: Record, path: str) -> Iterator[Problem]:
        """Items that somebody put into the section and that are none of its kinds."""
        models = tuple({*self.kinds.values(), *filter(None, [self.plain])})
        for name, item in items.items():
            if not isinstance(item, models):
                message = f"{shown(type(item).__name__)} is no {self.what} of this document"
                remedy = f'write add_{self.what}("{name}", ...)'
                yield Problem("wrong-type", f"{path}.{name}", message, "", remedy)

    def data(self, item: Any) -> Data:
        """An item as its file says it."""
        if self.other and not isinstance(item, StrictModel | Mapping):
            return {self.key: item.type, **item.raw}  # of an unknown kind: word for word
        fields: Data = plain(item)
        if (word := self.word(item)) and self.key not in fields:
            fields = {self.key: word} | fields
        return {key: fields[key] for key in self.first if key in fields} | fields


@dataclass(frozen=True)
class Form:
    """A kind of document.

    Attributes
    ----------
    format : what its files name
    said : what such a file is called
    model : its sections; those of named items hold any object
    always : sections that are written even when they are empty; the first tells such a file
        that does not name its format
    items : the sections of named items
    """

    format: str
    said: str
    model: type[StrictModel]
    always: tuple[str, ...]
    items: Callable[[], Mapping[str, Section]]

    @cached_property
    def sections(self) -> dict[str, FieldInfo]:
        """Fields of the model between head and extras."""
        fields = self.model.model_fields
        return {name: fields[name] for name in fields if name not in (*HEAD, *EXTRAS)}

    def written(self, sections: Record) -> Data:
        """What stands in a file: all sections but for those that say nothing."""
        named, data = self.items(), {"format": self.format, "version": VERSION}
        for key, declared in self.model.model_fields.items():
            content, items = sections.get(key), named.get(key)
            value = plain(content)
            if items and content is not None:
                value = {name: items.data(x) for name, x in content.items()}
            always = value is not None and key in ("name", *self.always)
            if always or (value and value != plain(declared.default)):
                data[key] = value
        return data


def bad_name(what: str, name: object, where: str = "") -> Problem:
    """The problem of a name that could not stand in an address."""
    where = where or str(name) or '""'
    return Problem("bad-name", where, f"not a {what} name", NAME_RULE, "choose another name")


def _identified(form: Form, raw: Record) -> Iterator[Problem]:
    """What is wrong with format and version. Raises if it is another document altogether."""
    declared, valid = raw.get("format"), f'{form.said} has "format": "{form.format}"'
    if "format" not in raw:
        problem = Problem("wrong-format", "format", "the file has no format", valid, "add it")
        if form.always[0] not in raw:
            raise FormatError(problem)
        yield problem
    elif declared != form.format:
        foreign = f"the format is {shown(declared)}", ""
        message, remedy = FORMATS.get(declared, foreign) if isinstance(declared, str) else foreign
        raise FormatError(Problem("wrong-format", "format", message, valid, remedy))
    version, valid = raw.get("version"), f"this blockmech reads versions 1 to {VERSION}"
    if "version" not in raw:
        message, remedy = "the file has no version", f'add "version": {VERSION}'
        yield Problem("missing-version", "version", message, valid, remedy)
    elif isinstance(version, bool) or not isinstance(version, int) or version < 1:
        message = f"version must be a whole number from 1, got {shown(version)}"
        yield Problem("bad-version", "version", message, valid, f'write "version": {VERSION}')
    elif version > VERSION:
        message = f"the file has version {version}, made by a newer blockmech"
        raise FormatError(Problem("newer-version", "version", message, valid, "update blockmech"))


@dataclass
class Draft:
    """What a file says as far as it can be read, and what is wrong with it."""

    form: Form
    raw: Data  # the data of the file
    odd: list[Problem]  # found in the text
    content: list[Problem] = field(default_factory=list)  # of the sections by themselves
    fit: list[Problem] = field(default_factory=list)  # of how they fit each other
    said: Any = None  # the sections without those that are wrong
    wrong: set[str] = field(default_factory=set)  # names of these

    def __post_init__(self) -> None:
        self.content += [*self.odd, *_identified(self.form, self.raw)]
        if any(problem.code.endswith("-version") for problem in self.content):
            self.raw = {**self.raw, "version": VERSION}
        self.raw = raw = {**self.raw, "format": self.form.format}
        model = self.form.model
        self.said, problems = validated(model, raw, self.form.said)
        self.note(problems)
        if self.said is None:
            self.wrong = {re.split(r"[.\[]", problem.where)[0] for problem in problems}
            fields = model.model_fields
            sound: Data = {n: {} for n in fields if fields[n].is_required()}
            sound |= {"format": self.form.format, "version": VERSION}
            more = {n: raw[n] for n in fields if n in raw and n not in self.wrong}
            again, _ = validated(model, sound | more, "")
            self.said = again or model.model_validate(sound)

    @property
    def doubled(self) -> bool:
        """Whether an item is given twice, so that nothing can be said of how they fit."""
        twice = {p.where for p in self.odd if p.code == "duplicate-key"}
        return any(
            path_text((name, item)) in twice
            for name in self.form.items()
            for item in getattr(self.said, name)
        )

    def note(self, problems: Iterable[Problem]) -> None:
        """Add what is wrong with the content, unless the text has said so already."""
        self.content += [p for p in problems if not said_already(p, self.odd)]

    def items(self, name: str) -> Iterator[tuple[str, Any]]:
        """The items of a section; None for one that is wrong, which is noted."""
        section = self.form.items()[name]
        for item, raw in getattr(self.said, name).items():
            if len(self.content) > MOST:
                return
            part, problems = self._item(section, (name, item), raw)
            if is_name(item):
                yield item, part
            else:
                self.note([bad_name(section.what, item, path_text((name, item)))])
            self.note(problems)

    def _item(self, section: Section, path: tuple[str, str], raw: Any) -> tuple[Any, list[Problem]]:
        """One item, and what is wrong with it."""
        key, what = section.key, section.what

        def wrong(code: str, where: Path, message: str, *rest: str) -> tuple[None, list[Problem]]:
            return None, [Problem(code, path_text(where), message, *rest)]

        if not isinstance(raw, dict):
            message = f"a {what} must be an object {{...}}, got {shown(raw)}"
            return wrong("wrong-type", path, message)
        model: Any = section.plain
        plain_field = section.plain_said
        if key and (model is None or key in raw):
            where, word = (*path, key), raw.get(key)
            if key not in raw:
                return wrong(
                    "missing-key", where, f'a {what} needs "{key}"', section.words, "add it"
                )
            if not isinstance(word, str) or not word:
                message = f"{key} must be the name of a {what} {key}, got {shown(word)}"
                return wrong("wrong-type", where, message, section.words)
            model, plain_field = section.kinds.get(word), section.said.format(word)
            if key not in getattr(model, "model_fields", ()):  # it is not among the model's keys
                raw = {k: item for k, item in raw.items() if k != key}
            if model is None:
                unknown = [section.unknown_kind(word, path_text(where))]
                return (section.other(word, raw), []) if section.other else (None, unknown)
        return validated(model, raw, plain_field, path)

    def finish(self) -> None:
        """Raise what was noted, section by section."""
        sections = list(self.form.model.model_fields)

        def order(problem: Problem) -> int:
            name = re.split(r"[.\[]", problem.where)[0]
            return sections.index(name) if name in sections else len(sections)

        if self.content:
            raise FormatError([*sorted(self.content, key=order), *self.fit])
        if self.fit:
            raise GraphError(self.fit)
