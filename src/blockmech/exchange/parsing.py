"""Reading what others wrote: numbers that are numbers, XML that defines nothing, data of JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from blockmech.errors import FormatError, Problem, shown

DEEPEST = 100  # elements in each other
MOST = 100_000  # elements of a file
LONGEST = 300  # digits of a whole number, beyond which it is none of a drawing


def wrong(where: str, found: str, valid: str = "", remedy: str = "") -> FormatError:
    """The error for what a file of another tool has wrong."""
    return FormatError(Problem("bad-drawing", where, found, valid, remedy))


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


def items(raw: Any, where: str) -> list[Any]:
    """A list. Raises `FormatError` for anything else."""
    if not isinstance(raw, list):
        raise wrong(where, f"got {shown(raw)}", "a list")
    return raw


def fields(raw: Any, where: str) -> Mapping[str, Any]:
    """An object. Raises `FormatError` for anything else."""
    if not isinstance(raw, dict):
        raise wrong(where, f"got {shown(raw)}", "an object")
    return raw


def json_of(text: str, where: str) -> Any:
    """The data in JSON text. Raises `FormatError` with line and column."""

    def refused(word: str) -> NoReturn:
        raise wrong(where, f"{word} is not a number", "finite numbers")

    def whole(digits: str) -> int | float:
        return int(digits) if len(digits) < LONGEST else float(digits)

    try:
        return json.loads(text, parse_constant=refused, parse_int=whole)
    except json.JSONDecodeError as error:
        at = f"line {error.lineno}, column {error.colno}"
        raise wrong(where, f"{at}: {error.msg.lower()}", "JSON") from None
    except RecursionError:
        raise wrong(where, "lists and objects too deep in each other") from None


class _Reader:
    """Builds the tree of a text; refuses what could grow or reach outside."""

    def __init__(self, where: str) -> None:
        self.where, self.depth, self.count = where, 0, 0
        self.tree = TreeBuilder()
        self.parser = expat.ParserCreate("utf-8")  # of a text, whatever its head says
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.tree.data
        self.parser.StartDoctypeDeclHandler = self.declared
        self.parser.EntityDeclHandler = self.declared

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self.depth, self.count = self.depth + 1, self.count + 1
        if self.depth > DEEPEST or self.count > MOST:
            raise wrong(self.where, "too many elements, or too deep in each other")
        self.tree.start(tag.rpartition("}")[2].rpartition(":")[2], attributes)

    def end(self, tag: str) -> None:
        """An element ends."""
        self.depth -= 1
        self.tree.end(tag.rpartition("}")[2].rpartition(":")[2])

    def declared(self, name: str, *what: Any) -> None:
        """A document type: harmless by itself, but the place where entities are defined."""
        if len(what) > 3 or (what and what[-1]):
            raise wrong(self.where, "the XML defines entities of its own", "elements alone")


def xml_of(text: str, where: str) -> Element:
    """The root of XML text, names without namespace; comments are left out.

    Raises `FormatError` for what is no XML, and for entities, which may stand for anything.
    """
    reader = _Reader(where)
    try:
        reader.parser.Parse(text.encode(), True)
        root: Element = reader.tree.close()
    except expat.ExpatError as error:
        at = f"line {error.lineno}, column {error.offset + 1}"
        what = expat.errors.messages.get(error.code, "not well-formed")
        raise wrong(where, f"{at}: {what}", "XML") from None
    return root
