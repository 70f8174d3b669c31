"""From a file to plain data: bytes, text, JSON, with line and column of what is wrong.

The fast parser of the standard library reads; only where it meets something odd does a
slower scan of the same text find the places.
"""

from __future__ import annotations

import codecs
import json
import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from blockmech.errors import FormatError, Problem
from blockmech.model.problems import MOST, in_file, path_text

MEGABYTE = 1_000_000
LARGEST = 4 * MEGABYTE  # bytes; thousands of blocks, and read in a second or two
DEEPEST = 64  # nested objects and lists; a graph needs nine

MARKS = (  # the longer ones first
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)


def text_of(path: str | os.PathLike[str]) -> str:
    """The text of a file. Raises `FormatError` with file and, of bad text, line and column.

    UTF-8 with the mark that some editors put in front is read as well.
    """
    shown = os.fspath(path)
    try:
        return _decoded(_bytes_of(Path(path)))
    except FormatError as error:
        raise FormatError(in_file(error.problems, shown)) from error.__cause__
    except (OSError, ValueError) as error:
        raise FormatError(in_file([_not_opened(error)], shown)) from error


def _bytes_of(path: Path) -> bytes:
    if path.is_dir():
        raise FormatError(
            Problem("not-a-file", "", "it is a directory", "", "name a graph file in it")
        )
    with path.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        most = size or LARGEST  # what is no file on a disk tells no size
        raw = b"" if size > LARGEST else stream.read(most + 1)
    if size > LARGEST or len(raw) > LARGEST:
        found = f"{size / MEGABYTE:.0f} MB" if size > LARGEST else "endless"
        raise FormatError(
            Problem(
                "too-large",
                "",
                f"too large: {found}",
                f"a graph file has at most {LARGEST // MEGABYTE} MB",
                "check that it is a graph file",
            )
        )
    return raw


def _not_opened(error: OSError | ValueError) -> Problem:
    if isinstance(error, FileNotFoundError | NotADirectoryError | ValueError):  # null in the name
        return Problem("no-file", "", "no such file", "", "check the name and the folder")
    if isinstance(error, PermissionError):
        return Problem("no-permission", "", "you may not read it", "", "ask its owner")
    reason = error.strerror or str(error)
    return Problem("unreadable", "", f"it cannot be read: {reason.lower()}")


def _decoded(raw: bytes) -> str:
    for mark, name in MARKS:
        if raw.startswith(mark):
            raise FormatError(_not_utf8("line 1, column 1", f"the text is {name}"))
    if b"\x00" in raw[:4]:
        raise FormatError(_not_utf8("line 1, column 1", "not text, or UTF-16"))
    try:
        return raw.removeprefix(codecs.BOM_UTF8).decode()
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode(errors="replace")
        found = f"byte 0x{raw[error.start]:02x} is not UTF-8 text"
        raise FormatError(_not_utf8(place(before, len(before)), found)) from error


def _not_utf8(where: str, found: str) -> Problem:
    return Problem("wrong-encoding", where, found, "a graph file is UTF-8", "save it as UTF-8")


def place(text: str, offset: int) -> str:
    """Line and column, from 1, of an offset in a text."""
    line = text.count("\n", 0, offset) + 1
    return f"line {line}, column {offset - text.rfind(chr(10), 0, offset)}"


def data_of(text: str) -> tuple[dict[str, Any], list[Problem]]:
    """The object that a text holds, and what is wrong with single values in it.

    Raises `FormatError` where there is nothing to go on with.
    """
    if not text.strip():
        raise FormatError(
            Problem("empty-file", "", "it is empty", "", "start from a gallery graph")
        )
    odd: list[bool] = []
    try:
        data = _parsed(text, odd)
    except json.JSONDecodeError as error:
        raise FormatError(_syntax(text, error)) from error
    except RecursionError as error:
        raise FormatError(_TOO_DEEP) from error
    if _deeper(data, DEEPEST):
        raise FormatError(_TOO_DEEP)
    if not isinstance(data, dict):
        raise FormatError(
            Problem(
                "not-an-object",
                "line 1, column 1",
                "the file does not hold an object",
                'a graph file is {"format": "blockmech/graph", ...}',
            )
        )
    misfits = list(islice(_misfits(text), MOST + 1)) if odd else []
    if any(problem.code == "wrong-encoding" for problem in misfits):
        raise FormatError(misfits)  # half characters break what they are handed to
    return data, misfits


_TOO_DEEP = Problem(
    "too-deep", "", f"objects and lists are nested more than {DEEPEST} deep", "a graph needs nine"
)


def _parsed(text: str, odd: list[bool]) -> Any:
    """The data of a text; ``odd`` is filled where a scan of the text will find something."""

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(items)
        if len(found) != len(items):
            odd.append(True)
        return found

    def number(token: str) -> float:
        x = float(token)
        if not math.isfinite(x):
            odd.append(True)
        return x

    def whole(token: str) -> int | float:
        return int(token) if len(token) < 300 else number(token)

    if _half_characters(text) or "\\ud" in text or "\\uD" in text:
        odd.append(True)
    return json.loads(
        text, object_pairs_hook=pairs, parse_constant=number, parse_float=number, parse_int=whole
    )


def _deeper(data: Any, most: int) -> bool:
    level = [data]
    for _ in range(most + 1):
        level = [
            part
            for box in level
            if isinstance(box, dict | list)
            for part in (box.values() if isinstance(box, dict) else box)
        ]
        if not level:
            return False
    return True


def _half_characters(text: str) -> bool:
    """Whether a text has a lone half of a pair, which no file can hold."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return True
    return False


# Syntax, in words of our own, so that they are the same in every Python.

CUT_OFF = re.compile(r"[\d.eE+-]*|t|tr|tru|f|fa|fal|fals|n|nu|nul")
"""What the last value of a file can look like where the file breaks off."""


def _syntax(text: str, error: json.JSONDecodeError) -> Problem:
    end, at = len(text.rstrip()), error.pos
    extra = error.msg.startswith("Extra data")
    half = not extra and CUT_OFF.fullmatch(text, at, max(at, end))
    if half or error.msg.startswith("Unterminated string"):
        return Problem(
            "truncated",
            place(text, end),
            "the file ends in the middle",
            "every { [ and quotation mark is closed",
            "complete it, or fetch it again",
        )
    before = text[:at].rstrip()
    comma = text[at] == "," and text[at + 1 :].lstrip()[:1] in ("}", "]")
    if comma or (before.endswith(",") and text[at] in "}]"):
        at = at if comma else len(before) - 1
        return Problem("syntax", place(text, at), "a comma after the last item", "", "remove it")
    found, remedy = _slip(text, at, before, error.msg)
    return Problem("syntax", place(text, at), found, "", remedy)


def _slip(text: str, at: int, before: str, message: str) -> tuple[str, str]:
    """What stands at the place of a syntax error, and what to do about it."""
    word = re.match(r'"[^"\n]{,20}"?|\w{1,20}|.', text[at:], re.DOTALL)
    sign = word.group() if word else ""
    sign = sign if sign.startswith('"') else json.dumps(sign, ensure_ascii=False)
    if message.startswith("Extra data"):
        return f"{sign} after the end of the document", "a file holds one object: remove the rest"
    if "control character" in message:
        return "a text runs over the end of its line", 'close it, or write "\\n" for a new line'
    if "escape" in message:
        return "a backslash that starts no known sign", 'write "\\\\" for a backslash'
    if text[at] == "'":
        return "a single quotation mark", 'texts and keys stand in double ones: "..."'
    if text[at] == "/" or text[at] == "#":
        return "a comment", 'JSON has none: write it to "notes"'
    if "delimiter" in message:
        wanted = "colon" if "':'" in message else "comma"
        return f"{sign} where a {wanted} should stand", f"add the {wanted}"
    if before.endswith(("{", ",")) and "property name" in message:
        return f"{sign} where a key should stand", 'a key is a text in double quotes: "key"'
    return f"{sign} is not a value", 'a value is a number, "text", true, false, null, [..] or {..}'


# The slower scan: duplicate keys, numbers out of range, half characters.

TOKEN = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+', re.DOTALL)


@dataclass
class _Open:
    """An object or list that the scan is inside of."""

    key: str | int  # of the item at which the scan is
    keys: dict[str, int] | None = None  # of an object: where each was given
    expects_key: bool = True

    def next_item(self) -> None:
        """Go on after a comma."""
        if isinstance(self.key, int):
            self.key += 1
        self.expects_key = True


def _misfits(text: str) -> Iterator[Problem]:
    """What is wrong with single values of a text that is valid JSON otherwise."""
    inside: list[_Open] = []
    for token in TOKEN.finditer(text):
        sign = token.group()
        if sign == "{":
            inside.append(_Open("", {}))
        elif sign == "[":
            inside.append(_Open(0))
        elif sign in ("}", "]"):
            inside.pop()
        elif sign == ",":
            inside[-1].next_item()
        elif sign == ":":
            inside[-1].expects_key = False
        elif sign[0] == '"':
            yield from _text_misfits(text, token, inside)
        elif sign[0] not in "tfn" and not math.isfinite(float(sign)):
            yield Problem(
                "non-finite",
                _address(inside),
                f"{sign[:20]} is not a finite number ({place(text, token.start())})",
            )


def _text_misfits(text: str, token: re.Match[str], inside: list[_Open]) -> Iterator[Problem]:
    """Half characters of a text, and whether it is a key given before."""
    said = json.loads(token.group())
    at = token.start()
    here = inside[-1]
    if here.keys is not None and here.expects_key:
        here.key = said
        if said in here.keys:
            first = place(text, here.keys[said])
            yield Problem(
                "duplicate-key",
                _address(inside),
                f"the key is given twice: {first} and {place(text, at)}",
                "",
                "keep one of them",
            )
        here.keys.setdefault(said, at)
    if _half_characters(said):
        found = f"half of a character ({place(text, at)})"
        yield Problem("wrong-encoding", _address(inside), found, "", "write the whole character")


def _address(inside: list[_Open]) -> str:
    return path_text([box.key for box in inside])
