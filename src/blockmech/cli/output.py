"""How a result is shown: a table, data, a plot, or a folder with all of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from blockmech.cli.options import one_of, option, si_only, spare, switch
from blockmech.cli.terminal import note, pour, progress_bar, say
from blockmech.export import csv_chunks, json_chunks, table, write_csv
from blockmech.files import folder, writing
from blockmech.result import Result

Json = Annotated[bool, switch("json", "Print the result as JSON.")]
Out = Annotated[str | None, option("Write results.csv, result.json and the pictures.", "DIR")]
Csv = Annotated[str | None, option("Write a CSV file; - prints it.", "FILE")]
Plot = Annotated[str | None, option("Draw the wanted outputs (png, svg, pdf).", "FILE")]
Degrees = Annotated[bool, switch("deg", "Angles in degrees in the table, CSV and plots.")]
Separator = Annotated[str, option('Of CSV cells: "," ";" "|" or tab.', "SIGN")]
Decimal = Annotated[str, option('Of CSV numbers: "." or ",".', "SIGN")]

Pictures: TypeAlias = Callable[..., Any]  # (result, folder, degrees=) -> files drawn


@dataclass(frozen=True)
class Output:
    """The way of output that was asked for; without one a table, and nothing is written.

    Raises `RequestError` for ways that do not go together.
    """

    source: str  # the file that is read
    json: bool
    out: str | None
    csv: str | None
    plot: str | None
    degrees: bool
    separator: str
    decimal: str

    def __post_init__(self) -> None:
        asked = {name: getattr(self, name) is not None for name in ("out", "csv", "plot")}
        one_of(json=self.json, **asked)
        spare(self.source, self.csv, self.plot)
        si_only(self.json, self.degrees)

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
        pictures: Pictures,
        gaps: Sequence[str],
        lines: Sequence[str] = (),
        of: Collection[str] = (),
    ) -> None:
        """Print a result as data, with notes of its gaps; or write files, and print a table.

        ``pictures`` draws into a folder, ``lines`` follow the table, ``of`` are the names that
        it says there are.
        """
        if self.is_data:
            pour(json_chunks(result) if self.json else self._csv(result))
            note(*gaps)
            return
        files = [f"wrote {path}" for path in self._written(result, pictures)]
        say("\n".join([table(result, degrees=self.degrees, of=of), *lines, *files]))

    def _csv(self, result: Result) -> Any:
        cells = "\t" if self.separator == "tab" else self.separator
        return csv_chunks(result, separator=cells, decimal=self.decimal, degrees=self.degrees)

    def _written(self, result: Result, pictures: Pictures) -> list[Path]:
        """Write what is asked for."""
        if self.csv is not None:
            with progress_bar("writing"):
                write_csv(self._csv(result), self.csv)
            return [Path(self.csv)]
        if self.plot is not None:
            from blockmech.draw import plot

            with progress_bar("drawing"):
                return [plot(result, self.plot, degrees=self.degrees)]
        if self.out is None:
            return []
        with progress_bar("writing and drawing"), folder(self.out) as draft:  # all or none
            write_csv(self._csv(result), draft / "results.csv")
            with writing(draft / "result.json") as stream:
                for chunk in json_chunks(result):
                    stream.write(chunk.encode())
            pictures(result, draft, degrees=self.degrees)
            names = sorted(path.name for path in draft.iterdir())
        return [Path(self.out) / name for name in names]
