"""What a study keeps of its designs, in memory or in a folder of parts.

Parts are Parquet files that are written whole or not at all, so a study that was interrupted does
the missing designs only. A part that does not hold what its name says is done again: it carries a
digest of its columns, and the numbers of its designs are compared. Names begin with a fingerprint
of the question: parts of another one are refused.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from blockmech.ground.errors import needed, refused
from blockmech.ground.files import AnyPath, cannot_write, folder, writing
from blockmech.result.columns import components
from blockmech.result.quality import WORDS
from blockmech.studies.reductions import POSES, Wanted
from blockmech.studies.sampling import Designs
from blockmech.typing import Array

Span = tuple[int, int]  # the first design of some, and the first one behind them
SUFFIX = ".parquet"
DIGEST = b"digest"  # key of a table's metadata
WITHOUT = "to_csv needs nothing"
NO_MOTION, ENDED_EARLY, NO_NUMBER = "no-motion", "ended-early", "no-number"
COARSE = "coarse"  # an extreme that was not found to the end
REASONS = (*WORDS, NO_MOTION, ENDED_EARLY, NO_NUMBER, COARSE)  # what designs are; the first: ok
WHY = ("status", "block", "pose", "poses")  # columns of why designs have no answer


class Rows(NamedTuple):
    """What a study keeps of m designs.

    values : column's label -> (m,), or (m, n) of poses
    word : (m,) index in `REASONS`: why a design has no answer, 0 if it has
    place : (m,) the block of the mechanism that fails first; of a motion what ended it
    pose : (m,) the first pose without an answer, -1 without one
    poses : (m,) number of such poses
    """

    values: dict[str, Array]
    word: Array
    place: Array
    pose: Array
    poses: Array

    def without_numbers(self) -> Rows:
        """Themselves, with the word for designs that have an answer but lack one of the numbers."""
        word, culprit = self.word.copy(), self.place.copy()
        for label, x in self.values.items():
            lacking = (word == 0) & np.isnan(x if x.ndim == 1 else x[:, 0])
            word[lacking], culprit[lacking] = REASONS.index(NO_NUMBER), label
        return self._replace(word=word, place=culprit)

    @staticmethod
    def joined(blocks: list[Rows]) -> Rows:
        """All their designs, one after the other."""
        labels = blocks[0].values
        values = {label: np.concatenate([b.values[label] for b in blocks]) for label in labels}
        return Rows(values, *map(np.concatenate, zip(*(b[1:] for b in blocks), strict=True)))


@dataclass(frozen=True)
class Parts:
    """The parts of a study in a folder; their numbers are read when they are asked for.

    Attributes
    ----------
    place : the folder
    question : fingerprint of what is asked
    want : what is kept
    spans : the designs of the parts
    damaged : names of the files that stood for parts and were none, and are done again
    """

    place: Path
    question: str
    want: tuple[Wanted, ...]
    spans: tuple[Span, ...] = ()
    damaged: tuple[str, ...] = ()

    def path(self, span: Span) -> Path:
        """Where a part is: in the order of names the order of designs."""
        start, stop = span
        return self.place / f"{self.question}-{start:012d}-{stop:012d}{SUFFIX}"

    @property
    def _names(self) -> list[str]:
        """Names of all columns but those of the designs' own numbers."""
        return [*(name for w in self.want for name in _names_of(w)), *WHY]

    def existing(self, chosen: Designs) -> Parts:
        """Those in the folder; files that only stand in their places are removed.

        The folder is made where it is not. Raises `RequestError` where it cannot be, or where it
        holds parts of another question.
        """
        with folder(self.place):
            pass
        names = sorted(path.name for path in self.place.glob(f"*{SUFFIX}"))
        if foreign := [name for name in names if not name.startswith(f"{self.question}-")]:
            message = f"it holds parts of another question, or of another version: {foreign[0]}"
            raise cannot_write(str(self.place), message, "choose another folder, or empty this one")
        spans, damaged = [(0, 0)], list[str]()
        for name in names:
            span = re.fullmatch(rf"-(\d+)-(\d+){SUFFIX}", name.removeprefix(self.question))
            start, stop = map(int, span.groups() if span else (0, 0))
            if start < spans[-1][1] or stop <= start:  # another process did these as well
                continue
            if self._holds((start, stop), chosen.columns(start, stop)):
                spans.append((start, stop))
                continue
            damaged.append(name)
            with suppress(OSError):  # writing says what cannot be removed
                (self.place / name).unlink()
        return replace(self, spans=tuple(spans[1:]), damaged=tuple(damaged))

    def missing(self, count: int) -> list[Span]:
        """The designs of so many that are in no part."""
        ends = pairwise([(0, 0), *self.spans, (count, count)])
        return [(start, stop) for (_, start), (stop, _) in ends if start < stop]

    def _holds(self, span: Span, vary: Mapping[str, Array]) -> bool:
        """Whether a file is the part of these designs, whole and unharmed."""
        try:
            table = self._table(span)
        except (OSError, needed("pyarrow", "out", "study", WITHOUT).ArrowException):
            return False
        complete = {*self._names} <= {*table.column_names}
        complete &= (table.schema.metadata or {}).get(DIGEST) == _digest(table)
        return complete and all(np.array_equal(table[a].to_numpy(), x) for a, x in vary.items())

    def _table(self, span: Span, names: Sequence[str] | None = None) -> Any:
        """Some columns of a part, by default all."""
        parquet = needed("pyarrow.parquet", "out", "study", WITHOUT)
        with self.path(span).open("rb") as stream:
            return parquet.ParquetFile(stream, page_checksum_verification=True).read(names)

    def write(self, span: Span, vary: Mapping[str, Array], results: Rows) -> None:
        """Write a part: its numbers and results, then why designs have no answer.

        Raises `RequestError` if the path cannot be written.
        """
        arrow = needed("pyarrow", "out", "study", WITHOUT)
        columns: list[tuple[str, Any, str | None]] = [(a, x, None) for a, x in vary.items()]
        for w in self.want:
            parts = components(w.label, results.values[w.label]).items()
            columns += [(name, x, w.unit or None) for name, x in parts]
        status = arrow.DictionaryArray.from_arrays(arrow.array(results.word), list(REASONS))
        block = arrow.array(results.place.tolist(), arrow.string()).dictionary_encode()
        columns += [("status", status, None), ("block", block, None)]
        columns += [("pose", results.pose, None), ("poses", results.poses, None)]
        write_parquet(self.path(span), columns, "out")

    @cached_property
    def found(self) -> Rows:
        """What was kept of the designs."""
        table = self._read()
        values = {w.label: _column(w, table) for w in self.want}
        word = np.array([REASONS.index(x) for x in table["status"].to_pylist()], np.int8)
        return Rows(values, word, *(table[name].to_numpy() for name in ("block", "pose", "poses")))

    def _read(self) -> Any:
        """The columns of all parts but the designs' own numbers, one part after the other.

        Raises `RequestError` where a part was removed or harmed since the study was made.
        """
        arrow = needed("pyarrow", "out", "study", WITHOUT)
        try:
            return arrow.concat_tables([self._table(span, self._names) for span in self.spans])
        except (OSError, arrow.ArrowException) as error:
            message = f"a part cannot be read any more: {str(error).splitlines()[0]}"
            remedy = "ask the study again: it does the parts that are missing"
            raise refused(str(self.place), message, remedy, code="cannot-read") from error


def _column(w: Wanted, table: Any) -> Array:
    rows = [table[name].to_numpy() for name in _names_of(w)]
    if w.how == POSES:
        rows = [np.stack(column) for column in rows]
    return np.asarray(rows[0] if len(rows) == 1 else rows[0] + 1j * rows[1])


def _names_of(w: Wanted) -> list[str]:
    """Names of the columns of what is kept: two of a vector."""
    return list(components(w.label, np.empty(0, complex if w.kind == "vector" else float)))


def write_parquet(
    path: AnyPath, columns: Sequence[tuple[str, Any, str | None]], where: str
) -> None:
    """Write columns as a Parquet file: names, values, and units in the fields' metadata.

    Raises `MissingEngineError` without pyarrow, `RequestError` if the path cannot be written.
    """
    arrow = needed("pyarrow", where, "study", WITHOUT)
    parquet = needed("pyarrow.parquet", where, "study", WITHOUT)
    arrays = [_array(arrow, x) for _, x, _ in columns]
    fields = [
        arrow.field(name, array.type, metadata=None if unit is None else {"unit": unit})
        for (name, _, unit), array in zip(columns, arrays, strict=True)
    ]
    table = arrow.Table.from_arrays(arrays, schema=arrow.schema(fields))
    table = table.replace_schema_metadata({DIGEST: _digest(table)})
    with writing(path) as stream:
        parquet.write_table(table, stream, write_page_checksum=True)


def _digest(table: Any) -> bytes:
    """What tells the columns of a table from others, however they are stored."""
    sha = hashlib.sha256()
    for name, column in zip(table.column_names, table.columns, strict=True):
        sha.update(name.encode())
        lists = hasattr(column.type, "value_type") and not hasattr(column.type, "index_type")
        x = (column.combine_chunks().flatten() if lists else column).to_numpy()
        sha.update(x.tobytes() if x.dtype != object else repr(x.tolist()).encode())
    return sha.hexdigest().encode()


def _array(arrow: Any, x: Any) -> Any:
    """A column of numbers or words, or of rows of poses."""
    if np.ndim(x) == 1:
        return arrow.array(x)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(x.ravel()), x.shape[1])
