"""What a study found: a row a design, as arrays, tables and an `xarray.Dataset`."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import NotComputedError, Problem, close_match, listed, needed
from blockmech.export import Column, aligned, csv_of
from blockmech.export.data import dataframe
from blockmech.files import AnyPath
from blockmech.model.parameters import Parameter
from blockmech.quality import WORDS
from blockmech.studies.block import Block, Rows
from blockmech.studies.parts import WITHOUT, Parts, write_parquet
from blockmech.studies.reductions import POSES, Wanted, components

Array = NDArray[Any]
ROWS = 12  # designs that are shown
DESIGN = "design"


@dataclass(frozen=True)
class Study(Mapping[str, Array]):
    """Numbers of designs: ``study["max_abs(crank.drive)"]`` is an array (m,).

    Attributes
    ----------
    name : of the mechanism
    parameters : address -> what varied
    columns : what was kept
    rows : the designs, in memory or in a folder: what varied, what was kept and why not
    shape : sizes of the grid, or the number of designs asked for
    poses : driver -> coordinates (n,) [rad or m]
    sampling : how designs were made of values or distributions
    alone : why each design was compiled by itself; "" where one program served all
    """

    name: str
    parameters: Mapping[str, Parameter]
    columns: tuple[Wanted, ...]
    rows: Rows | Parts
    shape: tuple[int, ...]
    poses: Mapping[str, Array]
    sampling: str = "grid"
    alone: str = ""

    # -- reading ----------------------------------------------------------------

    @property
    def vary(self) -> Mapping[str, Array]:
        """Address -> its values (m,)."""
        return self.rows.vary

    @property
    def found(self) -> Block:
        """What was kept, and why designs have no answer."""
        return self.rows.found

    def __getitem__(self, name: str) -> Array:
        known: dict[str, Array] = {**self.vary, **self.found.values}
        if name not in known:
            found, kept = "the study did not keep it", f"kept: {listed(known)}"
            remedy = close_match(name, known)
            raise NotComputedError(Problem("not-wanted", name, found, kept, remedy))
        return known[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.vary, *self.found.values))

    def __len__(self) -> int:
        return len(self.vary) + len(self.found.values)

    @property
    def n(self) -> int:
        """Number of designs that were run."""
        return len(self.found.word)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C came before the last design."""
        return self.n < int(np.prod(self.shape))

    @cached_property
    def status(self) -> tuple[str, ...]:
        """A word a design: "ok", or why some pose has no answer."""
        return tuple(WORDS[k] for k in self.found.word)

    def reason(self, design: int) -> str:
        """Why a design has no answer, in words; "" where it has one."""
        word = self.status[design]
        if self.found.word[design] == 0:
            return ""
        place, count = self.found.place[design], int(self.found.poses[design])
        n, k = len(next(iter(self.poses.values()), ())), int(self.found.pose[design])
        at = ", ".join(f"{name} = {q[k]:.6g}" for name, q in self.poses.items())
        where = f" at {place}" if place else ""
        return f"{word}{where}: {count} of {n} poses, the first at {at}"

    def unit(self, name: str) -> str:
        """Unit of a column, empty where dimensionless."""
        if name in self.parameters:
            return self.parameters[name].unit
        return next(w.unit for w in self.columns if w.label == name)

    def grid(self, name: str) -> Array:
        """A column as an array over the grid; NaN where the study did not get."""
        return self._filled(self[name], np.nan)

    def _filled(self, values: Array, fill: Any) -> Array:
        """Values of the designs over the grid."""
        whole = np.full((int(np.prod(self.shape)), *values.shape[1:]), fill, values.dtype)
        whole[: self.n] = values
        return whole.reshape(*self.shape, *values.shape[1:])

    # -- tables -------------------------------------------------------------------

    def table(self) -> list[Column]:
        """Columns of real numbers: what varied, then what was kept, a vector as two.

        Poses are not in tables: they have two dimensions; see `to_xarray`.
        """
        rows = [Column(a, p.unit, self.vary[a], a) for a, p in self.parameters.items()]
        for w in self.columns:
            values = self.found.values[w.label]
            if w.how == POSES:
                continue
            rows += [Column(name, w.unit, x, w.label) for name, x in components(w, values)]
        return rows

    def to_csv(self, path: AnyPath | None = None) -> str:
        """CSV text, a row a design, units in the head, the last column says why it has no answer.

        Numbers read back to the last bit; a cell without one is empty. Written if a path is
        given. Raises `RequestError` where the place cannot be written.
        """
        rows = self.table()
        reasons = (self.reason(i) or "ok" for i in range(self.n))
        cells = zip(*(column.values.tolist() for column in rows), reasons, strict=True)
        return csv_of([*(column.head for column in rows), "status"], cells, path)

    def to_parquet(self, path: AnyPath) -> None:
        """Write the table as a Parquet file, units in the fields' metadata.

        Raises `MissingEngineError` without pyarrow (extra ``study``), `RequestError` where
        the place cannot be written.
        """
        columns: list[tuple[str, Any, str | None]]
        columns = [(c.name, c.values, c.unit) for c in self.table()]
        reasons = [self.reason(i) or "ok" for i in range(self.n)]
        write_parquet(path, [*columns, ("status", reasons, None)], "to_parquet")

    def to_dataframe(self) -> Any:
        """The table as a pandas DataFrame; raises `MissingEngineError` without pandas."""
        return dataframe(self.table(), self.status)

    def to_xarray(self) -> Any:
        """The study as an `xarray.Dataset` with units.

        Dimensions are what varies over a grid, else "design"; poses have "pose" behind them.
        Raises `MissingEngineError` without xarray (extra ``study``).
        """
        xarray = needed("xarray", "to_xarray", "study", WITHOUT)
        on_grid = self.sampling == "grid"
        dims: tuple[str, ...] = tuple(self.vary) if on_grid else (DESIGN,)
        data: dict[str, Any] = {}
        for w in self.columns:
            values = self.grid(w.label) if on_grid else self[w.label]
            own = (*dims, "pose") if w.how == POSES else dims
            data[w.label] = (own, values, {"units": w.unit})
        words = np.array(self.status, dtype=object)
        over = self._filled(words, "not run") if on_grid else words
        data["status"] = (dims, over.astype(str))
        coords: dict[str, Any] = {}
        for k, (address, p) in enumerate(self.parameters.items()):
            values = self._axis(k, address) if on_grid else self.vary[address]
            coords[address] = ((address,) if on_grid else (DESIGN,), values, {"units": p.unit})
        attrs = {
            "mechanism": self.name,
            "poses": json.dumps({k: len(q) for k, q in self.poses.items()}),
        }
        return xarray.Dataset(data, coords, attrs)

    def _axis(self, k: int, address: str) -> Array:
        """The values along a dimension of the grid."""
        return np.moveaxis(self.grid(address), k, 0).reshape(self.shape[k], -1)[:, 0]

    # -- for people -----------------------------------------------------------------

    def __repr__(self) -> str:
        rows = self.table()
        step = max(1, -(-(self.n - 1) // (ROWS - 1)))
        shown = sorted({*range(0, self.n, step), *range(self.n)[-1:]})
        cells = [(*(f"{c.values[i] + 0.0:.6g}" for c in rows), self.status[i]) for i in shown]
        lines = [self._title(), "", *aligned((*(c.head for c in rows), "status"), cells)]
        if len(shown) < self.n:
            lines.append(f"{len(shown)} of {self.n} designs shown")
        lines += [
            f"{word}: {k} designs" for word, k in Counter(self.status).items() if word != "ok"
        ]
        if self.alone:
            lines.append(f"each design compiled by itself: {self.alone}")
        return "\n".join(lines)

    def _title(self) -> str:
        asked = int(np.prod(self.shape))
        count = f"{self.n} of {asked}" if self.interrupted else f"{self.n}"
        n = len(next(iter(self.poses.values()), (0,)))
        return f"{self.name}: {count} designs at {n} poses, {len(self.vary)} numbers varied"
