"""A result as CSV that spreadsheets open: one row a sample, one column a component."""

from __future__ import annotations

import csv
import io
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from pydantic_core import to_json

from blockmech.engines.numpy import CHUNK
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, printable
from blockmech.ground.files import writing
from blockmech.result.columns import AnyPath, Column, Labelled, columns

SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar"}
FORMULA = ("=", "+", "-", "@")  # with which a spreadsheet lets one begin
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@declared
def to_csv(
    result: Labelled, path: AnyPath | None = None, separator: str = ",", decimal: str = "."
) -> str:
    """CSV text: driver coordinates, time, wanted outputs, status; written if a path is given.

    For a friction iteration that is cut short, ``friction error [-]`` bounds its error.
    Columns are headed ``name [unit]``, a vector has two. Numbers read back to the
    last bit, rounding beside the largest of its unit is zero; a cell without an answer is empty
    and ``status``, the last column, says why. A name that a spreadsheet would read as a formula is
    preceded by a quotation mark.
    ``decimal=","`` with ``separator=";"`` suits spreadsheets of many countries.

    Raises `RequestError` for a separator that occurs in numbers, or a path that cannot be written.

    >>> text = result.to_csv("run.csv")
    >>> text[:20]
    'crank.q [rad],time ['
    """
    text = "".join(csv_chunks(result, separator, decimal))
    if path is not None:
        write_csv([text], path)
    return text


class CsvTable(ABC):
    """An answer that is a table, so that spreadsheets open it."""

    _instead = "its to_csv() writes it for a spreadsheet"

    @abstractmethod
    def csv_rows(self) -> tuple[Sequence[str], Iterable[Iterable[object]]]:
        """The head, names with units, and the rows."""

    @declared
    def to_csv(self, path: AnyPath | None = None, separator: str = ",", decimal: str = ".") -> str:
        """CSV text, units in the head; written if a path is given.

        Numbers read back to the last bit, rounding beside the largest of its unit is zero; a cell
        without a number is empty, words are no formulas.
        Raises `RequestError` for a separator that would tear numbers, and where the path cannot be
        written.
        """
        return csv_of(*self.csv_rows(), path, separator, decimal)


def csv_chunks(result: Labelled, separator: str = ",", decimal: str = ".") -> Iterator[str]:
    """The text of `to_csv` in pieces."""
    _check(separator, decimal)
    return _chunks(result, separator, decimal)


def _safe_cell(text: str) -> str:
    """A text as a cell that no spreadsheet takes for a formula or for the end of a row."""
    line = printable(text)
    return f"'{line}" if line.startswith(FORMULA) else line


def _number(x: object, decimal: str) -> str:
    return "" if x is None or x != x else str(x).replace(".", decimal)


def write_csv(chunks: Iterator[str] | list[str], path: AnyPath) -> None:
    """Write CSV text atomically; marked as UTF-8 for spreadsheets if it is not ASCII."""
    with writing(path) as stream:
        for i, chunk in enumerate(chunks):
            if i == 0 and not chunk.isascii():
                stream.write(BYTE_ORDER_MARK)
            stream.write(chunk.encode())


def csv_of(
    head: Sequence[str],
    rows: Iterable[Iterable[object]],
    path: AnyPath | None = None,
    separator: str = ",",
    decimal: str = ".",
) -> str:
    """CSV text of a table, written if a path is given; a cell without a number is empty.

    Numbers read back to the last bit, words are no formulas. Raises `RequestError` for a separator
    that occurs in numbers, or a path that cannot be written.
    """
    _check(separator, decimal)
    stream = io.StringIO(newline="")
    write = csv.writer(stream, delimiter=separator, lineterminator="\n")
    for row in (head, *rows):
        write.writerow(_safe_cell(x) if isinstance(x, str) else _number(x, decimal) for x in row)
    if path is not None:
        write_csv([stream.getvalue()], path)
    return stream.getvalue()


def _chunks(result: Labelled, separator: str, decimal: str) -> Iterator[str]:
    table, bound = columns(result), result.friction_error
    if bound is not None:
        table.append(Column("friction error", "", np.where(np.isfinite(bound), bound, np.nan), ""))
    yield csv_of([*(column.head for column in table), "status"], (), separator=separator)
    status = result.quality.status
    for start in range(0, result.n, CHUNK):
        part = slice(start, start + CHUNK)
        numbers = [column.values[part] for column in table]
        yield _rows(np.stack(numbers, axis=1).tolist(), status[part], separator, decimal)


def _rows(rows: list[list[float]], status: tuple[str, ...], separator: str, decimal: str) -> str:
    """Rows of numbers and a last word as text.

    A JSON array of arrays is the same text up to its brackets, and comes from a
    compiled writer: [[1.5,2.0,"ok"],[...]]. Numbers and words hold none of its signs.
    """
    lines = [[*row, word] for row, word in zip(rows, status, strict=True)]
    text = to_json(lines, inf_nan_mode="null").decode()
    text = text[2:-2].replace("],[", "\n").replace("null", "").replace('"', "") + "\n"
    if separator != ",":
        text = text.replace(",", separator)
    return text.replace(".", decimal) if decimal != "." else text


def _check(separator: str, decimal: str) -> None:
    problems = []
    if separator not in SEPARATORS:
        valid = "valid: " + ", ".join(f"{sign!r} ({name})" for sign, name in SEPARATORS.items())
        problems.append(Problem("bad-value", "separator", f"got {separator!r}", valid))
    if decimal not in (".", ","):
        problems.append(Problem("bad-value", "decimal", f"got {decimal!r}", 'valid: "." or ","'))
    elif decimal == separator:
        message, remedy = "is also the decimal sign", 'use separator=";" with decimal=","'
        problems.append(Problem("bad-value", "separator", f"{separator!r} {message}", "", remedy))
    RequestError.raise_for(problems)
