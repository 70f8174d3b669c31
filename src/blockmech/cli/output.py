"""What `run` and `simulate` share: options of output, and the files that they write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from blockmech.cli.terminal import patience
from blockmech.errors import Problem, RequestError
from blockmech.export import csv_chunks, json_chunks, write_csv
from blockmech.files import folder, writing
from blockmech.result import Result

Pictures: TypeAlias = Callable[..., Any]  # (result, folder, degrees=) -> files drawn


def option(help: str, metavar: str | None = None, **more: Any) -> Any:
    """An option with a value."""
    return typer.Option(help=help, metavar=metavar, **more)


def switch(name: str, help: str) -> Any:
    """An option without a value."""
    return typer.Option(f"--{name}", help=help)  # named, or typer adds --no-name


Times = Annotated[
    str | None, typer.Option("--times", metavar="TIMES", help="Times [s], e.g. 0:2:201.")
]
Want = Annotated[
    list[str] | None, option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")
]
Json = Annotated[bool, switch("json", "Print the result as JSON.")]
Out = Annotated[str | None, option("Write results.csv, result.json and the pictures.", "DIR")]
Csv = Annotated[str | None, option("Write a CSV file; - prints it.", "FILE")]
Plot = Annotated[str | None, option("Draw the wanted outputs (png, svg, pdf).", "FILE")]
Degrees = Annotated[bool, switch("deg", "Angles in degrees in the table, CSV and plots.")]
Separator = Annotated[str, option('Of CSV cells: "," ";" "|" or tab.', "SIGN")]
Decimal = Annotated[str, option('Of CSV numbers: "." or ",".', "SIGN")]


def names_of(want: list[str] | None) -> tuple[str, ...]:
    """Outputs and patterns from the ``--want`` options."""
    return tuple(n for part in want or () for n in part.split(",") if n)


def written(
    result: Result,
    spelling: dict[str, Any],
    out: str | None,
    csv: str | None,
    plot: str | None,
    pictures: Pictures,
) -> list[Path]:
    """Write what is asked for; the paths written. ``pictures`` draws into a folder."""
    if csv is not None:
        with patience("writing"):
            write_csv(csv_chunks(result, **spelling), csv)
        return [Path(csv)]
    if plot is not None:
        from blockmech.draw import plot as plotted

        with patience("drawing"):
            return [plotted(result, plot, degrees=spelling["degrees"])]
    return [] if out is None else _folder(result, spelling, out, pictures)


def _folder(result: Result, spelling: dict[str, Any], out: str, pictures: Pictures) -> list[Path]:
    """Write results.csv, result.json and the pictures, all or none."""
    with patience("writing and drawing"), folder(out) as draft:
        write_csv(csv_chunks(result, **spelling), draft / "results.csv")
        with writing(draft / "result.json") as stream:
            for chunk in json_chunks(result):
                stream.write(chunk.encode())
        pictures(result, draft, degrees=spelling["degrees"])
        names = sorted(path.name for path in draft.iterdir())
    return [Path(out) / name for name in names]


def check_ways(
    file: str, json: bool, out: str | None, csv: str | None, plot: str | None, degrees: bool
) -> None:
    """Refuse ways of output that do not go together."""
    one_of(json=json, out=out is not None, csv=csv is not None, plot=plot is not None)
    spare(file, csv, plot)
    si_only(json, degrees)


def si_only(json: bool, degrees: bool) -> None:
    """Refuse degrees in JSON."""
    if json and degrees:
        raise refused("--deg", "JSON results are in SI units", "leave it out")


def spelled(separator: str, decimal: str, degrees: bool) -> dict[str, Any]:
    """How numbers stand in a table and a CSV file; ``tab`` may be said for the separator."""
    cells = {"tab": "\t"}.get(separator, separator)
    return {"separator": cells, "decimal": decimal, "degrees": degrees}


def one_of(**given: bool) -> None:
    """Refuse two ways of output at a time."""
    asked = [f"--{name}" for name, on in given.items() if on]
    if len(asked) > 1:
        raise refused(" ".join(asked), "only one of them at a time", "--out writes all files")


def spare(source: str, *targets: str | None) -> None:
    """Refuse to write over the file that is read."""
    for target in targets:
        if target and Path(target).exists() and Path(target).samefile(source):
            raise refused(target, "it is the graph file itself", "give the output another name")


def refused(where: str, found: str, remedy: str, valid: str = "") -> RequestError:
    """The error of a call that makes no sense."""
    return RequestError(Problem("bad-request", where, found, valid, remedy))
