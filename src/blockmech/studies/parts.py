"""Parts of a study in a folder: Parquet files that are written whole or not at all.

A part that exists is complete, so a study that was interrupted does the missing ones only.
Their names begin with a fingerprint of the question: parts of another one are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import needed
from blockmech.files import AnyPath, cannot_write, folder, writing
from blockmech.quality import WORDS
from blockmech.studies.block import Block
from blockmech.studies.reductions import POSES, Wanted, components

Array = NDArray[Any]
Span = tuple[int, int]  # the first design of a part, and the first one behind it
SUFFIX = ".parquet"
WITHOUT = "to_csv needs nothing"


@dataclass(frozen=True)
class Parts:
    """The parts of a study in a folder; their numbers are read when they are asked for.

    Attributes
    ----------
    place : the folder
    question : fingerprint of what is asked
    addresses : what varies
    want : what is kept
    spans : the designs of the parts
    """

    place: Path
    question: str
    addresses: tuple[str, ...]
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
            parts = components(w, found.values[w.label])
            columns += [(name, x, w.unit or None) for name, x in parts]
        status = arrow.DictionaryArray.from_arrays(arrow.array(found.word), list(WORDS))
        block = arrow.array(found.place.tolist(), arrow.string()).dictionary_encode()
        columns += [("status", status, None), ("block", block, None)]
        columns += [("pose", found.pose, None), ("poses", found.poses, None)]
        write_parquet(self.path(span), columns, "out")

    @cached_property
    def vary(self) -> Mapping[str, Array]:
        """Address -> its values (m,)."""
        return {a: self._read(a)[a].to_numpy() for a in self.addresses}

    @cached_property
    def found(self) -> Block:
        """What was kept of the designs."""
        values = {w.label: self._column(w) for w in self.want}
        table = self._read("status", "block", "pose", "poses")
        words = [
            np.array([WORDS.index(word) for word in chunk.dictionary.to_pylist()], np.int8)[
                chunk.indices.to_numpy()
            ]
            for chunk in table["status"].chunks
        ]
        place = table["block"].to_numpy()
        numbers = (table[name].to_numpy() for name in ("pose", "poses"))
        return Block(values, np.concatenate(words), place, *numbers)

    def _column(self, w: Wanted) -> Array:
        names = [name for name, _ in components(w, np.empty(0))]
        table = self._read(*names)
        if w.how == POSES:
            rows = [_rows(table[name]) for name in names]
        else:
            rows = [table[name].to_numpy() for name in names]
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


def _rows(column: Any) -> Array:
    """Rows of poses (m, n) of a column."""
    parts = [np.stack(chunk.to_numpy(zero_copy_only=False)) for chunk in column.chunks]
    return np.concatenate(parts)
