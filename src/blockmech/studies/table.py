"""What a study found: a row a design, as arrays, tables and an `xarray.Dataset`."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from blockmech.ground.arguments import declared
from blockmech.ground.errors import held, listed, needed
from blockmech.ground.files import AnyPath
from blockmech.ground.pictured import Pictured
from blockmech.ground.report import DEGREES
from blockmech.model.parameters import Parameter
from blockmech.result.data import dataframe
from blockmech.result.exported import Column, CsvTable, aligned, counted
from blockmech.studies.reductions import POSES, Wanted, components
from blockmech.studies.rows import REASONS, WITHOUT, Parts, Rows, write_parquet
from blockmech.studies.sampling import Designs

if TYPE_CHECKING:
    from blockmech.studies.runner import Runner

Array = NDArray[Any]
ROWS = 12  # designs that are shown
T = TypeVar("T")


@dataclass(frozen=True, repr=False)
class Study(CsvTable, Pictured, Mapping[str, Array]):
    """Numbers of designs: ``study["max_abs(crank.drive)"]`` is an array (m,).

    Attributes
    ----------
    name : of the mechanism
    parameters : address -> what varied
    columns : what was kept
    designs : those that were asked for
    rows : what was kept of those that were run, and why not; in memory or in a folder
    poses : driver -> coordinates (n,) [rad or m]; of designs that move none
    alone : why each design was compiled by itself; "" where one program served all
    engine : the engine that was taken
    runner : what ran the designs, and can run them again
    """

    PICTURE = "blockmech.draw.study:study_figure"

    name: str
    parameters: Mapping[str, Parameter]
    columns: tuple[Wanted, ...]
    designs: Designs
    rows: Rows | Parts
    poses: Mapping[str, Array]
    alone: str
    engine: str
    runner: Runner

    # -- reading ----------------------------------------------------------------

    @cached_property
    def vary(self) -> Mapping[str, Array]:
        """Address -> its values (m,)."""
        return self.designs.columns(0, self.n)

    @property
    def found(self) -> Rows:
        """What was kept, and why designs have no answer."""
        return self.rows.found if isinstance(self.rows, Parts) else self.rows

    def __getitem__(self, name: str) -> Array:
        return self._known(name, {**self.vary, **self.found.values})

    def _known(self, name: str, known: Mapping[str, T]) -> T:
        return held(known, name, "the study did not keep it", "kept")

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
        return self.n < self.designs.count

    @cached_property
    def status(self) -> tuple[str, ...]:
        """A word a design: "ok", or why some pose has no answer."""
        return tuple(REASONS[k] for k in self.found.word)

    def reason(self, design: int) -> str:
        """Why a design has no answer, in words; "" where it has one."""
        word = self.status[design]
        if self.found.word[design] == 0:
            return ""
        place, count = self.found.place[design], int(self.found.poses[design])
        if not count:  # a motion, or what is kept of it
            return f"{word}: {place}"
        n, k = len(next(iter(self.poses.values()), ())), int(self.found.pose[design])
        at = ", ".join(f"{name} = {q[k]:.6g}" for name, q in self.poses.items())
        where = f" at {place}" if place else ""
        return f"{word}{where}: {count} of {n} poses, the first at {at}"

    def unit(self, name: str) -> str:
        """Unit of a column, empty where dimensionless."""
        units = {a: p.unit for a, p in self.parameters.items()}
        units |= {w.label: w.unit for w in self.columns}
        return self._known(name, units)

    def grid(self, name: str) -> Array:
        """A column as an array over the grid; NaN where the study did not get."""
        return self.filled(self[name], np.nan)

    def filled(self, values: Array, fill: Any) -> Array:
        """Values of the designs over the grid."""
        whole = np.full((self.designs.count, *values.shape[1:]), fill, values.dtype)
        whole[: self.n] = values
        return whole.reshape(*self.designs.shape, *values.shape[1:])

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
            rows += [Column(name, w.unit, x, w.label) for name, x in components(w.label, values)]
        return rows

    def csv_rows(self) -> tuple[list[str], Iterable[Iterable[Any]]]:
        """A row a design; the last column says why it has no answer."""
        rows = self.table()
        reasons = (self.reason(i) or "ok" for i in range(self.n))
        cells = zip(*(column.values.tolist() for column in rows), reasons, strict=True)
        return [*(column.head for column in rows), "status"], cells

    @declared
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
        """The study as an `xarray.Dataset` with units, also of designs that were not run.

        Dimensions are what varies over a grid, else "design"; poses have "pose" behind them.
        Raises `MissingEngineError` without xarray (extra ``study``).
        """
        xarray = needed("xarray", "to_xarray", "study", WITHOUT)
        designs, on_grid = self.designs, self.designs.sampling == "grid"
        dims = tuple(designs.vary) if on_grid else ("design",)
        axes = designs.vary if on_grid else designs.columns(0, designs.count)
        data: dict[str, Any] = {
            w.label: ((*dims, "pose") if w.how == POSES else dims, self.grid(w.label))
            for w in self.columns
        }
        over = self.filled(np.array(self.status, dtype=object), "not run")
        data["status"] = (dims, over.astype(str))
        coords = {a: ((a,) if on_grid else dims, values) for a, values in axes.items()}
        poses = json.dumps({k: len(q) for k, q in self.poses.items()})
        dataset = xarray.Dataset(data, coords, {"mechanism": self.name, "poses": poses})
        for name in (*self.parameters, *(w.label for w in self.columns)):
            dataset[name].attrs["units"] = self.unit(name)
        return dataset

    # -- for people -----------------------------------------------------------------

    def lines(self, degrees: bool = DEGREES) -> Iterator[str]:
        """Some designs as a table, then why others have no answer."""
        rows = self.table()
        step = max(1, -(-(self.n - 1) // (ROWS - 1)))
        shown = sorted({*range(0, self.n, step), *range(self.n)[-1:]})
        texts = [[f"{x + 0.0:.6g}" if x == x else "-" for x in c.values[shown]] for c in rows]
        cells = list(zip(*texts, (self.status[i] for i in shown), strict=True))
        yield from (self._title(), "", *aligned((*(c.head for c in rows), "status"), cells))
        if len(shown) < self.n:
            yield f"{len(shown)} of {self.n} designs shown"
        for word, k in Counter(self.status).items():
            if word != "ok":
                yield f"{word}: {counted(k, 'design')}"
        if isinstance(self.rows, Parts) and self.rows.damaged:
            damaged = counted(len(self.rows.damaged), "damaged part")
            yield f"{damaged} done again: {listed(self.rows.damaged, 3)}"
        if self.alone:
            yield f"each design compiled by itself: {self.alone}"

    def _title(self) -> str:
        count = f"{self.n} of " * self.interrupted + counted(self.designs.count, "design")
        varied = counted(len(self.vary), "number")
        return f"{self.name}: {count} {self.runner.words}, {varied} varied"
