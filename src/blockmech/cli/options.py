"""The arguments and options of all commands, what does not go together, and their file.

A file is a graph of blocks or links and joints; every command takes either.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from blockmech.builders import opened
from blockmech.cli.numbers import MOST
from blockmech.errors import GraphError, Problem, RequestError, in_file
from blockmech.mechanism import Mechanism


def option(help: str, metavar: str | None = None, **more: Any) -> Any:
    """An option with a value."""
    return typer.Option(help=help, metavar=metavar, **more)


def switch(name: str, help: str) -> Any:
    """An option without a value."""
    return typer.Option(f"--{name}", help=help)  # named, or typer adds --no-name


GraphFile = Annotated[
    str, typer.Argument(metavar="FILE", help="A graph of blocks, or links and joints (JSON).")
]
At = Annotated[
    list[str] | None,
    option(
        "Driver coordinates, e.g. 0,1,60deg or 0:360deg:37; once for each driver.",
        "[DRIVER=]NUMBERS",
    ),
]
Samples = Annotated[int | None, option("Samples of the file's range (361).", "N", min=1, max=MOST)]
Times = Annotated[
    str | None, typer.Option("--times", metavar="TIMES", help="Times [s], e.g. 0:2:201.")
]
Want = Annotated[
    list[str] | None, option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")
]
Friction = Annotated[str | None, option("none, single, successive or newton.", "METHOD")]
Tolerance = Annotated[float | None, option("Stop of successive approximations (1e-3 N).", "X")]
Iterations = Annotated[int | None, option("Fixed number of successive approximations.", "K")]
Static = Annotated[bool, switch("static", "Leave inertia out.")]
Explain = Annotated[bool, switch("explain", "Only show what would be computed.")]
AsJson = Annotated[bool, switch("json", "Print as JSON.")]
Json = Annotated[bool, switch("json", "Print the result as JSON.")]
Out = Annotated[str | None, option("Write results.csv, result.json and the pictures.", "DIR")]
Csv = Annotated[str | None, option("Write a CSV file; - prints it.", "FILE")]
Plot = Annotated[str | None, option("Draw the wanted outputs (png, svg, pdf).", "FILE")]
Degrees = Annotated[bool, switch("deg", "Angles in degrees in the table, CSV and plots.")]
DegreesOfText = Annotated[bool, switch("deg", "Angles in degrees in the text.")]
Separator = Annotated[str, option('Of CSV cells: "," ";" "|" or tab.', "SIGN")]
Decimal = Annotated[str, option('Of CSV numbers: "." or ",".', "SIGN")]


def compiled(file: str) -> Mechanism:
    """The mechanism in a file. Raises `FormatError`, `GraphError` that name the file."""
    found = opened(file)
    try:
        return found.compile()
    except GraphError as error:
        raise GraphError(in_file(error.problems, file)) from error.__cause__


def names_of(want: list[str] | None) -> tuple[str, ...]:
    """Outputs and patterns from the ``--want`` options."""
    return tuple(n for part in want or () for n in part.split(",") if n)


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
