"""The canonical text of a document: one layout for one content, byte for byte.

The document and its sections are always open, one item a line. What fits on a line
stands on it; what does not is opened, one key a line down to the keys of a block, and
filled like a paragraph further in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from blockmech.errors import FormatError, Problem, path_text
from blockmech.loads.functions import Function
from blockmech.validation_errors import field_order
from blockmech.values import Pair

WIDTH = 100  # characters of a line
SECTIONS = 2  # levels that are always open: the document and its sections
KEY_A_LINE = SECTIONS + 1  # levels that are opened one item a line: to the keys of a block


def plain(value: Any, tag: str = "") -> Any:
    """A model as JSON data: what the author gave, under the names of the file.

    ``tag`` is the key by which a reader tells the kind of the model; it is always written.
    """
    if isinstance(value, BaseModel):
        data = {}
        for name in field_order(type(value)):
            field, item = type(value).model_fields[name], getattr(value, name)
            given = name in value.model_fields_set and not (item is None and field.default is None)
            if given or name == tag:
                data[field.alias or name] = plain(item, _tag(field))
        return data
    if isinstance(value, Pair):
        return value.written
    if isinstance(value, Mapping):
        return {key: plain(item, tag) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, tag) for item in value]
    return value


def _tag(field: FieldInfo) -> str:
    """The key that tells the kinds of model in a field apart, or nothing."""
    inside: list[Any] = [field]
    while inside:
        part = inside.pop()
        if isinstance(part, FieldInfo) and isinstance(part.discriminator, str):
            return part.discriminator
        inside += get_args(part.annotation if part is field else part)
    return ""


def canonical_text(document: Mapping[str, Any]) -> str:
    """The text of a document, lines of up to 100 characters where words allow.

    Raises `FormatError` for values that JSON does not know.
    """
    _refuse_strange(document, ())
    return _text(document, 0, 0) + "\n"


def _refuse_strange(value: Any, path: tuple[str | int, ...]) -> None:
    if isinstance(value, Mapping):
        for key, item in value.items():
            if not isinstance(key, str):
                raise _strange("not-json", path, "a key must be a text", key)
            _refuse_strange(item, (*path, key))
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            _refuse_strange(item, (*path, k))
    elif isinstance(value, float) and not math.isfinite(value):
        raise _strange("non-finite", path, "must be a finite number", float(value))
    elif isinstance(value, Function):
        remedy = "say it as a table, a polynomial or a Fourier series"
        raise _strange("not-json", path, "a function of Python is not written", value.call, remedy)
    elif not isinstance(value, str | int | float | None):
        raise _strange("not-json", path, "must be JSON data", value)


def _strange(
    code: str, path: tuple[str | int, ...], rule: str, value: Any, remedy: str = ""
) -> FormatError:
    return FormatError(Problem(code, path_text(path), f"{rule}, got {value!r:.60}", "", remedy))


def _text(value: Any, column: int, depth: int, last: bool = True) -> str:
    """Text of a value that starts at a column; what is not last leaves room for a comma."""
    if not isinstance(value, Mapping | list | tuple) or not value:
        return _flat(value, math.inf) or ""
    room = WIDTH - column - (not last)
    section = depth < SECTIONS and not _is_vector(value)
    if not section and (flat := _flat(value, room)) is not None:
        return flat
    ends, heads, items = _parts(value)
    indent = " " * (2 * depth + 2)
    texts = [
        head + _text(item, len(indent) + len(head), depth + 1, k == len(items))
        for k, (head, item) in enumerate(zip(heads, items, strict=True), 1)
    ]
    lines = texts if depth < KEY_A_LINE else _filled(texts, WIDTH - len(indent))
    inside = f",\n{indent}".join(lines)
    return f"{ends[0]}\n{indent}{inside}\n{indent[2:]}{ends[1]}"


def _is_vector(value: Any) -> bool:
    """Whether a value is a list of numbers, such as the gravity of a document."""
    return not isinstance(value, Mapping) and all(isinstance(x, int | float) for x in value)


def _parts(value: Mapping[str, Any] | list[Any] | tuple[Any, ...]) -> tuple[str, list[str], Any]:
    """Brackets, what stands in front of each item, and the items."""
    if isinstance(value, Mapping):
        return "{}", [f"{_word(key)}: " for key in value], list(value.values())
    return "[]", [""] * len(value), value


def _filled(texts: list[str], room: int) -> list[str]:
    """Items joined to lines; one that is open itself stands alone."""
    lines: list[str] = []
    for text in texts:
        joined = f"{lines[-1]}, {text}" if lines else text
        if lines and "\n" not in joined and len(joined) < room:  # and a comma
            lines[-1] = joined
        else:
            lines.append(text)
    return lines


def _flat(value: Any, room: float) -> str | None:
    """A value on one line, or None where it needs more room."""
    if not isinstance(value, Mapping | list | tuple):
        text = _word(value)
        return text if len(text) <= room else None
    ends, heads, items = _parts(value)
    room -= 2 * max(1, len(items))  # the brackets, and ", " between the items
    texts: list[str] = []
    for head, item in zip(heads, items, strict=True):
        part = _flat(item, room - len(head))
        if part is None:
            return None
        room -= len(head) + len(part)
        texts.append(head + part)
    return ends[0] + ", ".join(texts) + ends[1]


def _word(value: Any) -> str:
    """A key, text, number, true, false or null."""
    if isinstance(value, float):
        return float.__repr__(value)  # the shortest that reads back the same
    return json.dumps(value, ensure_ascii=False)
