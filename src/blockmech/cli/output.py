"""How a result is shown: a table, data, a plot, or a folder with all of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from blockmech.cli.options import (
    AsJson,
    Degrees,
    DisplayUnits,
    at_most_one,
    names_of,
    option,
)
from blockmech.cli.terminal import (
    UNDRAWN,
    Interrupted,
    T,
    answer,
    note,
    pour,
    progress_bar,
    reading,
    saving,
    say,
)
from blockmech.ground.errors import refused
from blockmech.ground.files import folder, refuse_spared
from blockmech.ground.report import Displayed, Facts, Report, as_json
from blockmech.result.data import json_chunks
from blockmech.result.spreadsheet import csv_chunks, write_csv
from blockmech.result.tables import table
from blockmech.typing import Data

if TYPE_CHECKING:
    from blockmech.result.result import Result

AnyAnswer = TypeVar("AnyAnswer", bound=Displayed)

NUMBERS = ("results.csv", "result.json")
PICTURES = (
    *("drive.png", "friction_power.png", "reactions.png", "kinematics.png", "motion.png"),
    *("mechanism.png", "energy.png", "phase.png", "phase_slides.png"),
    *("animation.gif", "animation.html"),
)
"""What `run` and `simulate` draw into a folder: those of an earlier run do not stay."""


TEXTS = (".csv", ".tsv", ".txt", ".dat", "")


def csv_place(path: str | None) -> str | None:
    """Where CSV text goes: in a folder to results.csv, "-" is standard output.

    Raises `RequestError` for a name that says another format than CSV.
    """
    if path is None or path == "-":
        return path
    if os.path.isdir(path):
        return str(Path(path) / NUMBERS[0])
    suffix = Path(path).suffix.lower()
    refuse_spared(path)
    if suffix not in TEXTS and (os.path.isfile(path) or not os.path.exists(path)):
        remedy = f"name it .csv; blockmech export list says what is written as {suffix}"
        raise refused(f"--csv {path}", f"CSV is not written to {suffix}", remedy)
    return path


def check_places(table: str | None, plot: str | None) -> None:
    """Raise `RequestError`, before anything is computed, where files cannot be written."""
    from blockmech.figures.paper import suffix_of

    refuse_spared(*(x for x in (table, plot) if x not in (None, "-")))
    if plot is not None:
        suffix_of(plot)


def write_answer(answer: Any, table: str | None, plot: str | None) -> None:
    """Write the table (csv, parquet) and the picture of an answer."""
    if table is not None:
        is_parquet = Path(table).suffix.lower() == ".parquet"
        (getattr(answer, "to_parquet", answer.to_csv) if is_parquet else answer.to_csv)(table)
        say(f"wrote {table}")
    if plot is not None:
        with progress_bar("drawing"):
            answer.plot(plot)
        say(f"wrote {plot}")


def fill_folder(
    out: Path,
    numbers: Mapping[str, Iterable[str]],
    outdated: Collection[str],
    draw: Callable[[], list[Path]] = list,
) -> list[Path]:
    """Write the files of a folder: texts by name, without an earlier one's pictures; then draw.

    What was in the folder is outdated where the last of these files is there.
    """
    names = list(numbers)
    outdated = outdated if os.path.exists(out / names[-1]) else ()
    with progress_bar("writing"), saving() as saved, folder(out, outdated) as draft:
        for name, pieces in numbers.items():
            write_csv(saved(pieces), draft / name)
    try:
        with progress_bar("drawing"):
            return sorted([*(out / name for name in names), *draw()])
    except KeyboardInterrupt:
        raise Interrupted(UNDRAWN) from None


@dataclass(frozen=True)
class Display:
    """How an answer is shown: as text or as JSON."""

    deg: Degrees = None
    json: AsJson = False
    unit: DisplayUnits = None

    def __post_init__(self) -> None:
        chosen = {name: vars(self).get(name) is not None for name in ("out", "csv", "plot")}
        at_most_one(json=self.json, **chosen)
        if self.json and (self.deg or self.unit):
            where = "--deg" if self.deg else "--unit"
            raise refused(where, "JSON results are in SI units", "leave it out")

    def in_units(self, result: AnyAnswer) -> AnyAnswer:
        """An answer in the units that texts, tables, CSV and pictures have."""
        angle = {None: (), True: ("deg",), False: ("rad",)}[self.deg]
        return result.to(*names_of(self.unit), *angle)

    def files(self) -> tuple[str | None, str | None]:
        """Where the table and the picture go. Raises `RequestError` where they cannot."""
        table, plot = csv_place(vars(self).get("csv")), vars(self).get("plot")
        check_places(table, plot)
        return table, plot

    def answer_command(
        self, file: str, reader: Callable[[str], T], doing: str, question: Callable[[T], Any]
    ) -> Any:
        """Answer a question about what a file holds: show the answer, write it, and return it.

        Raises `RequestError`, before anything is computed, where the answer cannot be written.
        """
        model = reading(file, reader)
        table, plot = self.files()
        with progress_bar(doing):
            report = question(model)
        displayed = self.in_units(report)
        if table == "-":
            pour([displayed.to_csv()])
        else:
            answer(file, self.json, report.to_dict(), displayed.text())
            write_answer(displayed, table, plot)
        return report


@dataclass(frozen=True)
class PlotDisplay(Display):
    """The same, or as a picture."""

    plot: Annotated[str | None, option("Draw the answer (png, svg, pdf).", "FILE")] = None


@dataclass(frozen=True)
class TableDisplay(PlotDisplay):
    """The same, or as a table."""

    csv: Annotated[
        str | None, option("Write a CSV file, or results.csv into a folder; - prints it.", "FILE")
    ] = None


@dataclass(frozen=True)
class Reports(Facts, Report):
    """Answers of one kind, e.g. the limits of each driver."""

    kind: str
    reports: Sequence[Any]

    def lines(self) -> Iterator[str]:
        """The lines of all."""
        yield from (report.to(*self._display).text() for report in self.reports)

    def to_dict(self) -> Data:
        """All under the name of their kind."""
        return {self.kind: as_json(self.reports)}


@dataclass(frozen=True)
class Output(TableDisplay):
    """The way of output that was asked for; without one a table, and nothing is written."""

    out: Annotated[
        str | None, option("Write results.csv, result.json and the pictures.", "DIR")
    ] = None
    separator: Annotated[str, option('Between CSV cells: "," ";" "|" or tab.', "SIGN")] = ","
    decimal: Annotated[str, option('Decimal sign of CSV numbers: "." or ",".', "SIGN")] = "."

    def read(self, file: str, reader: Callable[[str], T]) -> T:
        """What ``reader`` reads; raises `RequestError` if no answer could be written."""
        model = reading(file, reader)
        inside = (Path(self.out or "") / name for name in (*NUMBERS, *PICTURES))
        targets = csv_place(self.csv), self.plot
        refuse_spared(*filter(None, targets), *(inside if self.out else ()))
        return model

    @property
    def is_table(self) -> bool:
        """Whether nothing but a table is made."""
        return not (self.json or self.out or self.csv or self.plot)

    @property
    def is_data(self) -> bool:
        """Whether standard output takes the numbers and nothing else."""
        return self.json or self.csv == "-"

    def show(
        self,
        result: Result,
        gaps: Sequence[str],
        lines: Sequence[str] = (),
        of: Collection[str] = (),
    ) -> None:
        """Print a result as data, with notes of its gaps; or write files, and print a table.

        ``lines`` follow the table, ``of`` are the names that it says there are.
        """
        if self.is_data:
            pour(json_chunks(result) if self.json else self._csv(result))
            note(*gaps)
            return
        files = [f"wrote {path}" for path in self._write(result)]
        say("\n".join([table(result, of=of), *lines, *files]))

    def _csv(self, result: Result) -> Any:
        cells = "\t" if self.separator == "tab" else self.separator
        return csv_chunks(result, separator=cells, decimal=self.decimal)

    def _write(self, result: Result) -> list[Path]:
        """Write what is asked for."""
        table = csv_place(self.csv)
        if table is not None:
            with progress_bar("writing"):
                write_csv(self._csv(result), table)
            return [Path(table)]
        if self.plot is not None:
            with progress_bar("drawing"):
                result.plot(self.plot)
            return [Path(self.plot)]
        return [] if self.out is None else self._fill(Path(self.out), result)

    def _fill(self, out: Path, result: Result) -> list[Path]:
        """Fill a folder with a result; of an interrupted simulation the numbers alone."""
        numbers = dict(zip(NUMBERS, (self._csv(result), json_chunks(result)), strict=True))
        if result.motion is not None and result.motion.end == "interrupted":
            return fill_folder(out, numbers, PICTURES)
        from blockmech.draw import run_pictures
        from blockmech.draw.simulation import simulation_pictures

        pictures = run_pictures if result.motion is None else simulation_pictures
        return fill_folder(out, numbers, PICTURES, partial(pictures, result, out))
