"""The canonical text of a document: one layout for one content, byte for byte.

The document and its sections are always open, one item a line. What fits on a line
stands on it; what does not is opened, one key a line down to the keys of a block, and
filled like a paragraph further in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from blockmech.ground.errors import FormatError, Problem, path_text
from blockmech.ground.report import WIDTH
from blockmech.ground.validation_errors import field_order
from blockmech.ground.values import StrictModel
from blockmech.loads.functions import Function
from blockmech.typing import Record

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
