"""What a study keeps of its designs, in memory or in a folder of parts.

Parts are Parquet files that are written whole or not at all: one that exists is complete, so a
study that was interrupted does the missing ones only. Their names begin with a fingerprint of
the question: parts of another one are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import needed
from blockmech.files import AnyPath, cannot_write, folder, writing
from blockmech.quality import WORDS
from blockmech.studies.reductions import POSES, Wanted, components

Array = NDArray[Any]
Span = tuple[int, int]  # the first design of some, and the first one behind them
SUFFIX = ".parquet"
WITHOUT = "to_csv needs nothing"


class Block(NamedTuple):
    """What a study keeps of m designs.

    values : column's label -> (m,), or (m, n) of poses
    word : (m,) index in `blockmech.quality.WORDS`: why a design has no answer, 0 if it has
    place : (m,) the block of the mechanism that fails first
    pose : (m,) the first pose without an answer, -1 without one
    poses : (m,) number of such poses
    """

    values: dict[str, Array]
    word: Array
    place: Array
    pose: Array
    poses: Array

    @staticmethod
    def joined(blocks: list[Block]) -> Block:
        """All their designs, one after the other."""
        labels = blocks[0].values
        values = {label: np.concatenate([b.values[label] for b in blocks]) for label in labels}
        rest = zip(*(b[1:] for b in blocks), strict=True)
        return Block(values, *map(np.concatenate, rest))


@dataclass(frozen=True)
class Parts:
    """The parts of a study in a folder; their numbers are read when they are asked for.

    Attributes
    ----------
    place : the folder
    question : fingerprint of what is asked
    want : what is kept
    spans : the designs of the parts
    """

    place: Path
    question: str
    want: tuple[Wanted, ...]
    spans: tuple[Span, ...]

    def path(self, span: Span) -> Path:
        """Where a part is: in the order of names the order of designs."""
        start, stop = span
        return self.place / f"{self.question}-{start:012d}-{stop:012d}{SUFFIX}"

    def missing(self) -> list[Span]:
        """The parts that are not there; the folder is made where it is not.

        Raises `RequestError` where it cannot be, or where it holds parts of another question.
        """
        with folder(self.place):
            pass
        here = {path.name for path in self.place.glob(f"*{SUFFIX}")}
        if others := sorted(name for name in here if not name.startswith(f"{self.question}-")):
            found = f"it holds parts of another question, or of another version: {others[0]}"
            raise cannot_write(str(self.place), found, "choose another folder, or empty this one")
        return [span for span in self.spans if self.path(span).name not in here]

    def write(self, span: Span, vary: Mapping[str, Array], found: Block) -> None:
        """Write a part: its numbers and results, then why designs have no answer.

        Raises `RequestError` where the place cannot be written.
        """
        arrow = needed("pyarrow", "out", "study", WITHOUT)
        columns: list[tuple[str, Any, str | None]] = [(a, x, None) for a, x in vary.items()]
        for w in self.want:
            parts = components(w.label, found.values[w.label])
            columns += [(name, x, w.unit or None) for name, x in parts]
        status = arrow.DictionaryArray.from_arrays(arrow.array(found.word), list(WORDS))
        block = arrow.array(found.place.tolist(), arrow.string()).dictionary_encode()
        columns += [("status", status, None), ("block", block, None)]
        columns += [("pose", found.pose, None), ("poses", found.poses, None)]
        write_parquet(self.path(span), columns, "out")

    @cached_property
    def found(self) -> Block:
        """What was kept of the designs."""
        values = {w.label: self._column(w) for w in self.want}
        table = self._read("status", "block", "pose", "poses")
        word = np.array([WORDS.index(x) for x in table["status"].to_pylist()], np.int8)
        return Block(values, word, *(table[name].to_numpy() for name in ("block", "pose", "poses")))

    def _column(self, w: Wanted) -> Array:
        kind = complex if w.kind == "vector" else float
        names = [name for name, _ in components(w.label, np.empty(0, kind))]
        table = self._read(*names)
        rows = [table[name].to_numpy() for name in names]
        if w.how == POSES:
            rows = [np.stack(column) for column in rows]
        return np.asarray(rows[0] if len(rows) == 1 else rows[0] + 1j * rows[1])

    def _read(self, *names: str) -> Any:
        """Some columns of all parts, one part after the other."""
        dataset = needed("pyarrow.dataset", "out", "study", WITHOUT)
        paths = [str(self.path(span)) for span in self.spans]
        return dataset.dataset(paths, format="parquet").to_table(columns=list(names))


def write_parquet(
    path: AnyPath, columns: Sequence[tuple[str, Any, str | None]], where: str
) -> None:
    """Write columns as a Parquet file: names, values, and units in the fields' metadata.

    Raises `MissingEngineError` without pyarrow, `RequestError` where the place cannot be
    written.
    """
    arrow = needed("pyarrow", where, "study", WITHOUT)
    parquet = needed("pyarrow.parquet", where, "study", WITHOUT)
    arrays = [_array(arrow, x) for _, x, _ in columns]
    fields = [
        arrow.field(name, array.type, metadata=None if unit is None else {"unit": unit})
        for (name, _, unit), array in zip(columns, arrays, strict=True)
    ]
    table = arrow.Table.from_arrays(arrays, schema=arrow.schema(fields))
    with writing(path) as stream:
        parquet.write_table(table, stream)


def _array(arrow: Any, x: Any) -> Any:
    """A column of numbers or words, or of rows of poses."""
    if np.ndim(x) == 1:
        return arrow.array(x)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(x.ravel()), x.shape[1])
