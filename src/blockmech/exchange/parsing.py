"""Reading what others wrote: numbers that are numbers, XML that defines nothing, data of JSON."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn
from xml.parsers import expat

from blockmech.ground.errors import FormatError, Problem, shown
from blockmech.ground.limits import DEEPEST, MOST, read_integer

ROUNDED = 1e-4  # of a size, or of an axis: what drawing programs round to


def wrong(where: str, message: str, valid: str = "", remedy: str = "") -> FormatError:
    """The error for what a file of another tool has wrong."""
    return FormatError(Problem("bad-drawing", where, message, valid, remedy))


def number(raw: Any, where: str, default: float | None = None) -> float:
    """A finite number. Raises `FormatError` for anything else."""
    if (raw is None or raw == "") and default is not None:
        return default
    try:
        x = math.nan if isinstance(raw, bool) else float(raw)
    except (TypeError, ValueError):
        x = math.nan
    if not math.isfinite(x) or abs(x) > 1e100:
        raise wrong(where, f"{shown(raw)} is not a number", "a finite number")
    return x


def json_of(text: str, where: str) -> Any:
    """The data in JSON text. Raises `FormatError` with line and column."""

    def refused(word: str) -> NoReturn:
        raise wrong(where, f"{word} is not a number", "finite numbers")

    try:
        return json.loads(text, parse_constant=refused, parse_int=read_integer)
    except json.JSONDecodeError as error:
        at = f"line {error.lineno}, column {error.colno}"
        raise wrong(where, f"{at}: {error.msg.lower()}", "JSON") from None
    except RecursionError:
        raise wrong(where, "lists and objects too deep in each other") from None


@dataclass
class Record:
    """A part of a file, from which its reader takes what it knows; what is left can be told.

    A field is an attribute, or the text of a part inside, whatever a format calls it.
    """

    tag: str
    fields: dict[str, str]
    inner: list[Record]
    where: str
    text: str = ""
    consumed: set[str] = field(default_factory=set)

    def get(self, key: str, default: str = "") -> str:
        """The text of a field."""
        self.consumed.add(key)
        if key in self.fields:
            return self.fields[key]
        part = next((part for part in self.inner if part.tag == key), None)
        if part is None:
            return default
        part.consumed.update(line.tag for line in part.inner)
        return part.text

    def number(self, key: str, default: float | None = None) -> float:
        """A field that is a number. Raises `FormatError` for any other."""
        return number(self.get(key).strip(), f"{self.where}, {key}", default)

    def numbers(self, key: str, count: int, default: str = "") -> list[float]:
        """A field of so many numbers. Raises `FormatError` for any other."""
        text = self.get(key) or default
        numbers = [number(word, f"{self.where}, {key}") for word in text.split()]
        if len(numbers) != count:
            raise wrong(f"{self.where}, {key}", f'"{text[:40]}"', f"{count} numbers")
        return numbers

    def all(self, *tags: str) -> list[Record]:
        """The parts inside of these names."""
        self.consumed.update(tags)
        return [part for part in self.inner if part.tag in tags]

    def below(self, tag: str) -> list[Record]:
        """What is inside of the parts of a name."""
        outers = self.all(tag)
        for outer in outers:
            outer.consumed.update(part.tag for part in outer.inner)
        return [part for outer in outers for part in outer.inner]

    def first(self, tag: str) -> Record:
        """The first part of a name, an empty one where there is none."""
        return next(iter(self.all(tag)), Record(tag, {}, [], f"{self.where}, {tag}"))

    def walk(self) -> Iterator[Record]:
        """The part itself and all in it."""
        yield self
        for part in self.inner:
            yield from part.walk()

    def skip(self) -> None:
        """Take all of it: what it is has been told."""
        for part in self.walk():
            part.consumed.update(part.fields, (inner.tag for inner in part.inner))

    def _unread(self, looks: set[str]) -> Iterator[str]:
        yield from (f"{self.tag} {key}" for key in self.fields if key not in self.consumed | looks)
        for part in self.inner:
            if part.tag in self.consumed:
                yield from part._unread(looks)
            elif part.tag not in looks:
                yield f"{part.tag} {part.get('name') or part.get('Name')}".strip()

    def unread(self, looks: Iterable[str]) -> list[str]:
        """A sentence for each kind of thing that nobody took, but for how parts are drawn."""
        counts = Counter(self._unread(set(looks)))
        return [f"{x}: left out" + f" ({n} times)" * (n > 1) for x, n in counts.items()]


class _Reader:
    """Builds the records of a text; refuses what could grow or reach outside."""

    def __init__(self, where: str) -> None:
        self.where, self.count = where, 0
        self.open: list[tuple[Record, list[str]]] = [(Record("", {}, [], where), [])]
        self.parser = expat.ParserCreate("utf-8")  # of a text, whatever its head says
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.data
        self.parser.StartDoctypeDeclHandler = self.declared
        self.parser.EntityDeclHandler = self.declared

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self.count += 1
        if len(self.open) > DEEPEST or self.count > MOST:
            raise wrong(self.where, "too many elements, or too deep in each other")
        tag = name.rpartition("}")[2].rpartition(":")[2]
        fields = {key: text for key, text in attributes.items() if not key.startswith("xmlns")}
        label = f"{self.where}, {tag} {attributes.get('name', '')}".rstrip()
        record = Record(tag, fields, [], label)
        self.open[-1][0].inner.append(record)
        self.open.append((record, []))

    def data(self, text: str) -> None:
        """A piece of text in an element, which counts before the first one inside."""
        record, pieces = self.open[-1]
        if not record.inner:
            pieces.append(text)

    def end(self, name: str) -> None:
        """An element ends."""
        record, pieces = self.open.pop()
        record.text = "".join(pieces).strip()

    def declared(self, name: str, *details: Any) -> None:
        """A document type: harmless by itself, but the place where entities are defined."""
        if len(details) > 3 or (details and details[-1]):
            raise wrong(self.where, "the XML defines entities of its own", "elements alone")


def xml_of(text: str, where: str) -> Record:
    """The root of XML text, names without namespace; comments are left out.

    Raises `FormatError` for what is no XML, and for entities, which may stand for anything.
    """
    reader = _Reader(where)
    try:
        reader.parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        at = f"line {error.lineno}, column {error.offset + 1}"
        message = expat.errors.messages.get(error.code, "not well-formed")
        raise wrong(where, f"{at}: {message}", "XML") from None
    return reader.open[0][0].inner[0]


def record_of_json(raw: object, tag: str, where: str) -> Record:
    """A value of JSON as a record: numbers and texts in it are fields, all else parts.

    Each item of a list is a part of the list's name.
    """
    if not isinstance(raw, dict):
        return Record(tag, {}, [], where, _text_of(raw))
    label = f"{where}, {tag} {raw['id']}" if "id" in raw else where
    inner, fields = list[Record](), dict[str, str]()
    for key, x in raw.items():
        if isinstance(x, dict | list):
            inner += [
                record_of_json(part, key, label) for part in (x if isinstance(x, list) else [x])
            ]
        elif x is not None:
            fields[key] = _text_of(x)
    return Record(tag, fields, inner, label)


def _text_of(raw: object) -> str:
    """A number or text of JSON as it stands there; "" for anything else."""
    if isinstance(raw, bool):
        return str(raw).lower()
    return raw if isinstance(raw, str) else repr(raw) if isinstance(raw, int | float) else ""
