"""What a study found: a row a design, as arrays, tables and an `xarray.Dataset`."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from blockmech.analysis.equilibrium import CLEAR
from blockmech.figures import palette as ink
from blockmech.figures.paper import (
    Pictured,
    axis_label,
    panelled,
    picture_unit,
    scaled_unit,
    shown_name,
)
from blockmech.ground.arguments import declared
from blockmech.ground.errors import brief, held, listed, needed, refused
from blockmech.ground.files import AnyPath
from blockmech.ground.report import LINES
from blockmech.model.parameters import Parameter
from blockmech.result.columns import Column, components
from blockmech.result.data import dataframe, pint_unit
from blockmech.result.spreadsheet import CsvTable
from blockmech.result.tables import aligned, counted
from blockmech.studies.reductions import POSES, Wanted
from blockmech.studies.rows import REASONS, WITHOUT, Parts, Rows, write_parquet
from blockmech.studies.sampling import Designs
from blockmech.typing import Arguments, Array, Data, Real, Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

    from blockmech.studies.runner import Runner

T = TypeVar("T")
PANEL = 14.0 * ink.TEXT  # [pt] height of a panel of a picture
CELL = 11.0 * ink.TEXT  # [pt] size of a cell of a matrix
FOOT = 0.03  # of a panel's height: where designs without an answer are marked


@dataclass(frozen=True, repr=False)
class Study(CsvTable, Pictured, Mapping[str, Array]):
    """Numbers of designs: ``study["max_abs(crank.drive)"]`` is an array (m,).

    Attributes
    ----------
    name : of the mechanism
    parameters : address -> the varied number columns : the reductions designs : the requested
    designs rows : results and failures of the completed designs, in memory or in a folder
    poses : driver -> coordinates (n,) [rad or m]; empty for designs that move
    alone : reason why each design was compiled by itself; "" if one program served all
    engine : the engine used runner : the object that runs designs
    """

    _homes = {"numpy.{}": "numpy"}

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
        """The results, and the failures of designs without an answer."""
        return self.rows.found if isinstance(self.rows, Parts) else self.rows

    def __getitem__(self, name: str) -> Array:
        return self._known(name, {**self.vary, **self.found.values})

    def _known(self, name: str, columns: Mapping[str, T]) -> T:
        remedy = "why a design has no number is in its .status"
        return held(columns, name, "the study did not keep it", "kept", remedy)

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
        """Status of each design: "ok", or why some pose has no answer."""
        return tuple(REASONS[k] for k in self.found.word)

    def reason(self, design: int) -> str:
        """Why a design has no answer, in words; "" where it has one."""
        word = self.status[design]
        if self.found.word[design] == 0:
            return ""
        culprit, count = self.found.place[design], int(self.found.poses[design])
        if not count:  # a motion, or what is kept of it
            return f"{word}: {culprit}"
        n, k = len(next(iter(self.poses.values()), ())), int(self.found.pose[design])
        at = ", ".join(f"{name} = {q[k]:.6g}" for name, q in self.poses.items())
        where = f" at {culprit}" if culprit else ""
        return f"{word}{where}: {count} of {n} poses, the first at {at}"

    def unit(self, name: str) -> str:
        """Unit of a column, empty where dimensionless."""
        units = {a: p.unit for a, p in self.parameters.items()}
        units |= {w.label: w.unit for w in self.columns}
        return self._known(name, units)

    def grid(self, name: str) -> Array:
        """A column as an array over the grid; NaN for designs that were not run."""
        return self.filled(self[name], np.nan)

    @declared
    def best(self, name: str, where: Array | None = None, largest: bool = False) -> Record:
        """The design with the least value of a column: its numbers and results, by name.

        Parameters
        ----------
        name : the column
        where : (m,) which designs are feasible; by default all that have an answer
        largest : take the largest value instead

        Raises `RequestError` where no design is feasible, or ``where`` is no row of truths.

        >>> lengths = mech.study({"dyad.l_i": [5.9, 6.0, 6.1]}, want="max(crank.drive)", samples=13)
        >>> best = lengths.best("max(crank.drive)", where=lengths["dyad.l_i"] > 5.95)
        >>> float(best["dyad.l_i"])
        6.0
        """
        cost = -self[name] if largest else self[name]
        chosen = np.asarray(True if where is None else where)
        if chosen.dtype != bool or chosen.shape not in ((), cost.shape):
            remedy = 'give a truth for each design: where=study["min(dyad.margin)"] > 0.1'
            raise refused("where", f"got {brief(where)}", remedy)
        feasible = np.isfinite(cost) & chosen
        if not feasible.any():
            found = f"none of {counted(self.n, 'design')} fulfils it and has a {name}"
            raise refused("where", found, "allow more, or study other designs")
        row = np.where(feasible, cost, np.inf).argmin()
        return {column: values[row] for column, values in self.items()}

    def filled(self, values: Array, fill: Real) -> Array:
        """Values of the designs over the grid."""
        grid = np.full((self.designs.count, *values.shape[1:]), fill, values.dtype)
        grid[: self.n] = values
        return grid.reshape(*self.designs.shape, *values.shape[1:])

    # -- tables -------------------------------------------------------------------

    def table(self) -> list[Column]:
        """Columns of real numbers: varied numbers, then results; vectors take two columns.

        Poses are not in tables: they have two dimensions; see `to_xarray`.
        """
        rows = [Column(a, p.unit, self.vary[a], a) for a, p in self.parameters.items()]
        for w in self.columns:
            values = self.found.values[w.label]
            if w.how == POSES:
                continue
            rows += [
                Column(name, w.unit, x, w.label) for name, x in components(w.label, values).items()
            ]
        return [column.to(self._display) for column in rows]

    def csv_rows(self) -> tuple[list[str], Iterable[Iterable[object]]]:
        """One row per design; the last column says why it has no answer."""
        rows = self.table()
        reasons = (self.reason(i) or "ok" for i in range(self.n))
        cells = zip(*(column.values.tolist() for column in rows), reasons, strict=True)
        return [*(column.head for column in rows), "status"], cells

    @declared
    def to_parquet(self, path: AnyPath) -> None:
        """Write the table as a Parquet file, units in the fields' metadata.

        Raises `MissingEngineError` without pyarrow (extra ``study``), `RequestError` if the path
        cannot be written.
        """
        columns: list[tuple[str, Any, str | None]]
        columns = [(c.name, c.values, c.unit) for c in self.table()]
        reasons = [self.reason(i) or "ok" for i in range(self.n)]
        write_parquet(path, [*columns, ("status", reasons, None)], "to_parquet")

    def to_dataframe(self) -> DataFrame:
        """The table as a pandas DataFrame; raises `MissingEngineError` without pandas."""
        return dataframe(self.table(), self.status)

    def to_xarray(self) -> Any:
        """The study as an `xarray.Dataset` with units, also of designs that were not run.

        Dimensions are the varied numbers of a grid, else "design"; poses add "pose".
        Raises `MissingEngineError` without xarray (extra ``study``).
        """
        xarray = needed("xarray", "to_xarray", "study", WITHOUT)
        designs, on_grid = self.designs, self.designs.sampling == "grid"
        dims = tuple(designs.vary) if on_grid else ("design",)
        axes = designs.vary if on_grid else designs.columns(0, designs.count)
        data: Data = {
            w.label: ((*dims, "pose") if w.how == POSES else dims, self.grid(w.label))
            for w in self.columns
        }
        over = self.filled(np.array(self.status, dtype=object), "not run")
        data["status"] = (dims, over.astype(str))
        coords = {a: ((a,) if on_grid else dims, values) for a, values in axes.items()}
        poses = json.dumps({k: len(q) for k, q in self.poses.items()})
        dataset = xarray.Dataset(data, coords, {"mechanism": self.name, "poses": poses})
        for name in (*self.parameters, *(w.label for w in self.columns)):
            dataset[name].attrs["units"] = pint_unit(self.unit(name))
        return dataset

    # -- for people -----------------------------------------------------------------

    def figure(self, ax: Axes | None = None) -> Any:
        """Curves over one number, maps over two, a matrix of scatter and histograms over more.

        Designs without an answer are marked at the foot of a curve or scatter, and hatched in a
        map. Raises `RequestError` if the study has no numbers.
        """
        columns = [c.to([picture_unit(c.unit, self._display)[1]]) for c in self.table()]
        numbers, results = columns[: len(self.vary)], columns[len(self.vary) :][: ink.PANELS]
        if not results:
            message = "poses are arrays, and no other number was kept"
            raise refused("plot", message, "keep e.g. a max_abs as well")
        grid = len(self.vary) if self.designs.sampling == "grid" else 0
        mapped = grid == 2 and min(self.designs.shape) > 1
        missing, mark = self.n - self.status.count("ok"), "hatched" if mapped else "crosses"
        caption = f"{shown_name(self.name, 40)}: {self.n} designs over {listed(self.vary, 3)}"
        caption += f"; {missing} without an answer ({mark})." if missing else "."
        return (self._maps if mapped else self._matrix)(caption, results, numbers[: ink.PANELS], ax)

    def _maps(
        self, caption: str, results: Sequence[Column], numbers: Sequence[Column], ax: Axes | None
    ) -> Any:
        """Every result by colours over two numbers."""
        first, second = numbers
        x, y = (self.filled(c.values, np.nan) for c in numbers)
        columns = min(len(results), 2)
        rows = -(-len(results) // columns)
        layout: Arguments = {"width": columns * ink.COLUMN, "sharex": False, "ax": ax}
        height = rows * 1.25 * PANEL + ink.ROW / 2
        with panelled(caption, height, rows, columns, **layout) as panels:
            for axes in panels.flat[len(results) :]:
                axes.remove()
            for axes, column in zip(panels.flat, results, strict=False):
                finite = column.values[np.isfinite(column.values)]
                low, high = np.quantile(finite, [CLEAR, 1 - CLEAR]) if len(finite) else (0, 1)
                factor, unit = scaled_unit(column.unit, max(abs(low), abs(high)))
                z = factor * self.filled(column.values, np.nan)
                axes.patch.set(facecolor=ink.PAPER, hatch="////", edgecolor=ink.PALE)
                look: Arguments = {"cmap": "cividis", "shading": "nearest", "rasterized": True}
                mesh = axes.pcolormesh(x, y, z, vmin=factor * low, vmax=factor * high, **look)
                bar = axes.figure.colorbar(mesh, ax=axes, pad=0.02, extend="both")
                bar.set_label(axis_label(column.name, unit, PANEL), labelpad=2)
                axes.grid(False)
                axes.locator_params(axis="x", nbins=4)  # of a column beside its colours
                axes.set_xlabel(axis_label(first.name, first.unit, ink.COLUMN * 0.7), labelpad=1)
                axes.set_ylabel(axis_label(second.name, second.unit, PANEL), labelpad=2)
        return panels[0, 0].figure

    def _matrix(
        self, caption: str, results: Sequence[Column], numbers: Sequence[Column], ax: Axes | None
    ) -> Any:
        """Every result as a curve over the only number of a grid; else over every number, with a
        histogram."""
        curves = self.designs.sampling == "grid" and len(self.vary) == 1
        bad = np.array([word != "ok" for word in self.status])
        height, width = len(results) * PANEL, ink.COLUMN
        over, label_height = ink.COLUMN, PANEL * 0.8
        if not curves:
            height = len(results) * CELL + 3 * ink.TEXT
            width = max(ink.COLUMN, (len(numbers) + 1) * CELL + 5 * ink.TEXT)
            over = label_height = CELL * 0.9
        layout: Arguments = {"width": width, "sharey": "row", "ax": ax}
        count = len(numbers) + (not curves)
        with panelled(caption, height + ink.ROW / 2, len(results), count, **layout) as panels:
            for row, column in zip(panels, results, strict=True):
                sizes = np.abs(column.values[np.isfinite(column.values)])
                factor, unit = scaled_unit(column.unit, float(sizes.max(initial=0.0)))
                y = factor * column.values
                for axes, number in zip(row, numbers, strict=False):
                    dots: Arguments = {"color": ink.FORWARD, "marker": "." if self.n <= 1 else ""}
                    if curves:
                        axes.plot(number.values, y, **dots)
                    else:
                        dots = {"color": ink.FORWARD, "s": ink.DOT, "lw": 0, "rasterized": True}
                        axes.scatter(number.values, y, **dots)
                        axes.locator_params(nbins=4)
                        axes.locator_params(axis="x", nbins=3)
                        axes.ticklabel_format(axis="x", scilimits=(-2, 4))
                    foot, transform = np.full(bad.sum(), FOOT), axes.get_xaxis_transform()
                    style = {"marker": "x", "s": 8, "lw": 0.6, "color": ink.ALARM, "zorder": 3}
                    axes.scatter(number.values[bad], foot, transform=transform, **style)
                row[0].set_ylabel(axis_label(column.name, unit, label_height), labelpad=2)
                if not curves:
                    look: Arguments = {"bins": "auto", "color": ink.FORWARD}
                    row[-1].hist(y[np.isfinite(y)], orientation="horizontal", **look)
                    row[-1].locator_params(axis="x", nbins=3)
            panels[-1, -1].set_xlabel("designs", labelpad=1)  # under the histograms
            for axes, number in zip(panels[-1], numbers, strict=False):
                formatter = axes.xaxis.get_major_formatter()
                formatter.set_locs(axes.get_xticks())
                pad = 1 + ink.ROW * bool(formatter.get_offset())  # which stands below the ticks
                axes.set_xlabel(axis_label(number.name, number.unit, over), labelpad=pad)
        return panels[0, 0].figure

    def lines(self) -> Iterator[str]:
        """Some designs as a table, then why others have no answer."""
        rows = self.table()
        step = max(1, -(-(self.n - 1) // (LINES - 1)))
        selected = sorted({*range(0, self.n, step), *range(self.n)[-1:]})
        texts = [[f"{x + 0.0:.6g}" if x == x else "-" for x in c.values[selected]] for c in rows]
        cells = list(zip(*texts, (self.status[i] for i in selected), strict=True))
        yield from (self._title(), "", *aligned((*(c.head for c in rows), "status"), cells))
        if len(selected) < self.n:
            yield f"{len(selected)} of {self.n} designs shown"
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
