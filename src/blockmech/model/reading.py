"""From a file to plain data: bytes, text, JSON, with line and column of what is wrong.

The parser of the standard library reads; a scan of the same text finds what it takes as it
comes.
"""

from __future__ import annotations

import codecs
import json
import math
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any

from blockmech.ground.errors import MOST, FormatError, Problem, in_file, path_text
from blockmech.ground.limits import DEEPEST, read_integer
from blockmech.ground.units import NoQuantity, in_si
from blockmech.typing import Data

LARGEST = 4_000_000  # bytes; thousands of blocks, and read in a second or two
HIGHEST = 1e75  # of a number: a term of mechanics is the product of at most four


def text_of(path: str | os.PathLike[str]) -> str:
    """The text of a file. Raises `FormatError` with file and, of bad text, line and column."""
    label = os.fspath(path)
    try:
        if os.path.isdir(path):
            remedy = "name a graph file in it"
            raise _refused(label, "not-a-file", "", "it is a directory", "", remedy)
        with open(path, "rb") as stream:
            raw = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        raise _refused(label, *_not_opened(error)) from error
    return decoded(raw, label)


def _not_opened(error: OSError | ValueError) -> tuple[str, ...]:
    """Code, place, what was found, what is valid, and what to do."""
    if isinstance(error, FileNotFoundError | NotADirectoryError | ValueError):  # null in the name
        return "no-file", "", "no such file", "", "check the name and the folder"
    if isinstance(error, PermissionError):
        return "no-permission", "", "you may not read it", "", "ask its owner"
    return "unreadable", "", f"it cannot be read: {(error.strerror or str(error)).lower()}"


def decoded(raw: bytes, label: str) -> str:
    """The text in the bytes of a file. Raises `FormatError` with file, line and column.

    UTF-8 with the mark that some editors put in front is read as well.
    """
    if len(raw) > LARGEST:
        message = f"too large: more than {LARGEST / 1e6:.0f} MB"
        valid, remedy = "a graph file is shorter", "check that it is a graph file"
        raise _refused(label, "too-large", "", message, valid, remedy)
    encoding = json.detect_encoding(raw)
    message, where = f"the text is {encoding[:6].upper()}", "line 1, column 1"
    try:
        if encoding.startswith("utf-8"):
            return raw.removeprefix(codecs.BOM_UTF8).decode()
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode(errors="replace")
        message = f"byte 0x{raw[error.start]:02x} is not UTF-8 text"
        where = position(before, len(before))
    valid, remedy = "a graph file is UTF-8", "save it as UTF-8"
    raise _refused(label, "wrong-encoding", where, message, valid, remedy)


def _refused(label: str, *problem: str) -> FormatError:
    return FormatError(in_file([Problem(*problem)], label))


def position(text: str, offset: int) -> str:
    """Line and column, from 1, of an offset in a text."""
    line = text.count("\n", 0, offset) + 1
    return f"line {line}, column {offset - text.rfind(chr(10), 0, offset)}"


def data_of(text: str) -> tuple[Data, list[Problem]]:
    """The object that a text holds, and what is wrong with single values in it.

    Raises `FormatError` where there is nothing to go on with.
    """
    if not text.strip():
        remedy = "start from a gallery graph"
        raise FormatError(Problem("empty-file", "", "it is empty", "", remedy))
    twice = False

    def as_object(items: list[tuple[str, Any]]) -> Data:
        nonlocal twice
        fields = dict(items)
        twice |= len(fields) < len(items)
        return fields

    try:
        data = json.loads(text, parse_int=read_integer, object_pairs_hook=as_object)
        plain = text.isascii() and "\\u" not in text  # no half of a character
        is_sound = plain and not twice and _is_within_bounds(data)
        misfits = [] if is_sound else list(islice(_misfits(text), MOST + 1))
    except json.JSONDecodeError as error:
        raise FormatError(_syntax(text, error)) from error
    except RecursionError as error:
        fields = f"objects and lists are nested more than {DEEPEST} deep"
        raise FormatError(Problem("too-deep", "", fields, "a graph needs nine levels")) from error
    if not isinstance(data, dict):
        fields = "the file does not hold an object"
        valid = 'a graph file is {"format": "blockmech/graph", ...}'
        raise FormatError(Problem("not-an-object", "line 1, column 1", fields, valid))
    if any(problem.code == "wrong-encoding" for problem in misfits):
        raise FormatError(misfits)  # half characters break what they are handed to
    return data, misfits


# Syntax, in words of our own, so that they are the same in every Python.

CUT_OFF = re.compile(r"[\d.eE+-]*|t|tr|tru|f|fa|fal|fals|n|nu|nul")
"""What the last value of a file can look like where the file breaks off."""


def _syntax(text: str, error: json.JSONDecodeError) -> Problem:
    end, at = len(text.rstrip()), error.pos
    extra = error.msg.startswith("Extra data")
    half = not extra and CUT_OFF.fullmatch(text, at, max(at, end))
    if half or error.msg.startswith("Unterminated string"):
        message, valid = "the file is incomplete", "every { [ and quotation mark is closed"
        remedy = "complete it, or fetch it again"
        return Problem("truncated", position(text, end), message, valid, remedy)
    before = text[:at].rstrip()
    comma = text[at] == "," and text[at + 1 :].lstrip()[:1] in ("}", "]")
    if comma or (before.endswith(",") and text[at] in "}]"):
        at = at if comma else len(before) - 1
        return Problem("syntax", position(text, at), "a comma after the last item", "", "remove it")
    message, remedy = _explanation(text, at, before, error.msg)
    return Problem("syntax", position(text, at), message, "", remedy)


VALUES = 'a value is a number, "text", true, false, null, [..] or {..}'
QUOTES = "'`\u2018\u2019\u201c\u201d\u201e"
RUN = re.compile(r'[^\s,:;\[\]{}"]([^,:;\[\]{}"\n]*[^\s,:;\[\]{}"])?')
"""What may be meant as one value: no sign of JSON is in it."""
OTHERS = {"True": "true", "False": "false", "None": "null"}
"""How other languages write a value -> how JSON does."""


def _as_json(value: str) -> str:
    """A value that is written as elsewhere, in JSON; empty for what is none."""
    for read in (float, lambda word: int(word, 0)):
        with suppress(ValueError):
            if math.isfinite(number := read(value)):
                return json.dumps(number)
    with suppress(NoQuantity):
        in_si(value)
        return json.dumps(value, ensure_ascii=False)
    return OTHERS.get(value, "")


def _not_closed(text: str) -> tuple[str, str]:
    """The bracket at the end of a text that is open, and its place."""
    inside: list[tuple[str, int]] = []
    for token in TOKEN.finditer(text):
        if token.group() in "{[":
            inside.append((token.group(), token.start()))
        elif token.group() in "}]":
            inside.pop()
    bracket, at = inside[-1]
    return bracket, position(text, at)


def _explanation(text: str, at: int, before: str, message: str) -> tuple[str, str]:
    """What stands at the place of a syntax error, and what to do about it."""
    word = re.match(r'"[^"\n]{,20}"?|\w{1,20}|.', text[at:], re.DOTALL)
    sign = word.group() if word else ""
    sign = sign if sign.startswith('"') else json.dumps(sign, ensure_ascii=False)
    line = text.rfind("\n", 0, at) + 1
    if text.startswith(("//", "/*", "#"), at):
        return "a comment", 'JSON has none: write it to "notes"'
    if text[at] in QUOTES:
        kind = "single" if text[at] == "'" else "typographic"
        return f"a {kind} quotation mark", 'texts and keys need double quotation marks: "..."'
    run = next((r for r in RUN.finditer(text, line) if r.end() > at), None)
    if run and (run.start() < at or (run.start() == at and message.startswith("Expecting value"))):
        correction, value = _as_json(run.group()), json.dumps(run.group()[:20], ensure_ascii=False)
        if correction or not re.search(r"\s", run.group()):
            return f"{value} is not a value", f"write {correction}" if correction else VALUES
    comma = re.search(r"\d,$", before)
    if comma and re.match(r"\d+\s*[,}]", text[at:]):
        return "a comma inside of a number", "numbers have a point: 2.0"
    if message.startswith("Extra data"):
        return f"{sign} after the end of the document", "a file holds one object: remove the rest"
    if "control character" in message:
        return "a text runs over the end of its line", 'close it, or write "\\n" for a new line'
    if "escape" in message:
        return "a backslash that starts no known sign", 'write "\\\\" for a backslash'
    if "delimiter" in message:
        bracket, opened = _not_closed(text[:at])
        closing = {"{": "}", "[": "]"}[bracket]
        if text[at] in "]}":
            return f'{sign} closes the "{bracket}" of {opened}', f'close it with "{closing}"'
        if text[at] == ":" and bracket == "[":
            return f"a key in the list that begins at {opened}", "keys stand in {...}"
        missing = "colon" if "':'" in message else "comma"
        return f"{sign} where a {missing} is expected", f"add the {missing}"
    if before.endswith(("{", ",")) and "property name" in message:
        return f"{sign} where a key is expected", 'a key is a text in double quotes: "key"'
    return f"{sign} is not a value", VALUES


# What the parser of the standard library takes as it comes: duplicate keys, numbers out of
# range, half characters, any depth.

TOKEN = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+', re.DOTALL)


@dataclass
class _Open:
    """An object or list that the scan is inside of."""

    key: str | int  # of the item at which the scan is
    keys: dict[str, int]  # of an object: where each was given
    expects_key: bool


def _is_within_bounds(data: Any) -> bool:
    """Whether no number of a document is out of range and nothing too deep, level by level.

    What does not fit is found by `_misfits`, which knows its place and takes ten times as long.
    """
    level = [data]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for x in level:
            kind = type(x)  # of JSON, so no subclass
            if kind is dict:
                below += x.values()
            elif kind is list:
                below += x
            elif (kind is float or kind is int) and not -HIGHEST <= x <= HIGHEST:
                return False
        if not below:
            return True
        level = below
    return False


def _misfits(text: str) -> Iterator[Problem]:
    """What is wrong with single values of a text that is valid JSON otherwise."""
    inside: list[_Open] = []

    def problem(code: str, message: str, remedy: str = "") -> Problem:
        return Problem(code, path_text([box.key for box in inside]), message, "", remedy)

    for token in TOKEN.finditer(text):
        sign, at = token.group(), token.start()
        if sign in ("{", "["):
            inside.append(_Open("" if sign == "{" else 0, {}, sign == "{"))
            if len(inside) > DEEPEST:
                raise RecursionError
        elif sign in ("}", "]"):
            inside.pop()
        elif sign == "," and isinstance(number := inside[-1].key, int):
            inside[-1].key = number + 1
        elif sign in (",", ":"):
            inside[-1].expects_key = sign == ","
        elif sign[0] == '"':
            if not inside:
                continue  # a text is no document, which its reader says
            key, current = json.loads(sign) if "\\" in sign else sign[1:-1], inside[-1]
            if current.expects_key:
                current.key = key
                first = current.keys.setdefault(key, at)
                if first != at:
                    twice = " and ".join(position(text, x) for x in (first, at))
                    message = f"the key is given twice: {twice}"
                    yield problem("duplicate-key", message, "keep one of them")
            if not key.isascii() and any("\ud800" <= c <= "\udfff" for c in key):
                message = f"an unpaired surrogate, half of a character ({position(text, at)})"
                yield problem("wrong-encoding", message, "write the whole character")
        elif sign[0] not in "tfn" and not abs(float(sign)) <= HIGHEST:
            large = math.isfinite(float(sign))
            message = (
                "so large that its products are not finite" if large else "not a finite number"
            )
            yield problem("non-finite", f"{sign[:20]} is {message} ({position(text, at)})")
