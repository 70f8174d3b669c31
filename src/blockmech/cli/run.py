"""``blockmech run``: compute a mechanism's outputs and show or write them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from blockmech.cli.graphs import At, GraphFile, compiled
from blockmech.cli.numbers import MOST, coordinates, times
from blockmech.cli.terminal import note, patience, pour, say
from blockmech.errors import Problem, RequestError
from blockmech.export import (
    csv_chunks,
    folder,
    gap_lines,
    json_chunks,
    table,
    write_csv,
    writing,
)
from blockmech.mechanism import EVERYTHING, Mechanism
from blockmech.result import Result


def _option(help: str, metavar: str | None = None, **more: Any) -> Any:
    return typer.Option(help=help, metavar=metavar, **more)


def _switch(name: str, help: str) -> Any:
    return typer.Option(f"--{name}", help=help)  # named, or typer adds --no-name


Samples = Annotated[int | None, _option("Samples of the file's range (361).", "N", min=1, max=MOST)]
Times = Annotated[
    str | None, typer.Option("--times", metavar="TIMES", help="Times [s], e.g. 0:2:201.")
]
Want = Annotated[
    list[str] | None, _option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")
]
Friction = Annotated[str, _option("none, single, successive or newton.", "METHOD")]
Tolerance = Annotated[float | None, _option("Stop of successive approximations (1e-3 N).", "X")]
Iterations = Annotated[int | None, _option("Fixed number of successive approximations.", "K")]
Static = Annotated[bool, _switch("static", "Leave inertia out.")]
Engine = Annotated[str, _option("auto, scalar or numpy.", "ENGINE")]
Precision = Annotated[str, _option("complex64, complex128 or clongdouble (numpy).", "TYPE")]
OnGap = Annotated[str, _option("Samples without an answer: mark, raise or stop.", "WHAT")]
Json = Annotated[bool, _switch("json", "Print the result as JSON.")]
Out = Annotated[str | None, _option("Write results.csv, result.json and the pictures.", "DIR")]
Csv = Annotated[str | None, _option("Write a CSV file; - prints it.", "FILE")]
Plot = Annotated[str | None, _option("Draw the wanted outputs (png, svg, pdf).", "FILE")]
Degrees = Annotated[bool, _switch("deg", "Angles in degrees in the table, CSV and plots.")]
Separator = Annotated[str, _option('Of CSV cells: "," ";" "|" or tab.', "SIGN")]
Decimal = Annotated[str, _option('Of CSV numbers: "." or ",".', "SIGN")]
Explain = Annotated[bool, _switch("explain", "Only show what would be computed.")]


def run(
    file: GraphFile,
    at: At = None,
    samples: Samples = None,
    at_times: Times = None,
    want: Want = None,
    friction: Friction = "newton",
    tolerance: Tolerance = None,
    iterations: Iterations = None,
    static: Static = False,
    engine: Engine = "auto",
    precision: Precision = "complex128",
    on_gap: OnGap = "mark",
    json: Json = False,
    out: Out = None,
    csv: Csv = None,
    plot: Plot = None,
    deg: Degrees = False,
    separator: Separator = ",",
    decimal: Decimal = ".",
    explain: Explain = False,
) -> None:
    """Compute a mechanism over its range and print a table.

    Without --json, --out, --csv or --plot nothing is written. Exit code 1 says that
    some sample has no answer.
    """
    _one_of(json=json, out=out is not None, csv=csv is not None, plot=plot is not None)
    if json and deg:
        raise _refused("--deg", "JSON results are in SI units", "leave it out")
    mechanism = compiled(file)
    names = tuple(n for part in want or () for n in part.split(",") if n)
    settings = {"friction": friction, "tolerance": tolerance, "iterations": iterations}
    plan: dict[str, Any] = {"want": names or EVERYTHING, "static": static, **settings}
    if explain:
        say(mechanism.explain(**plan))
        return
    given = coordinates(mechanism, at or [])
    taken = {"at": given, "samples": samples, "times": times(at_times)}
    how = {"engine": engine, "precision": precision}
    result, gaps = _computed(mechanism, {**plan, **taken, **how}, on_gap, deg)
    cells = {"tab": "\t"}.get(separator, separator)
    spelling: dict[str, Any] = {"separator": cells, "decimal": decimal, "degrees": deg}
    if json or csv == "-":
        pour(json_chunks(result) if json else csv_chunks(result, **spelling))
        note(*gaps)
    else:
        written = _written(result, spelling, out, csv, plot)
        say("\n".join([table(result, degrees=deg), *(f"wrote {path}" for path in written)]))
        if on_gap == "stop":  # the table does not reach them
            note(*gaps)
    if gaps:
        raise typer.Exit(1)


def _computed(
    mechanism: Mechanism, request: dict[str, Any], on_gap: str, degrees: bool
) -> tuple[Result, list[str]]:
    """The result, and lines about samples without an answer."""
    with patience("computing"):
        result = mechanism.run(**request, on_gap="mark")
        gaps = gap_lines(result, degrees)
        return (result if on_gap == "mark" else result.without_gaps(on_gap)), gaps


def _written(
    result: Result,
    spelling: dict[str, Any],
    out: str | None,
    csv: str | None,
    plot: str | None,
) -> list[Path]:
    """Write what is asked for; the paths written."""
    if csv is not None:
        with patience("writing"):
            write_csv(csv_chunks(result, **spelling), csv)
        return [Path(csv)]
    if plot is not None:
        from blockmech.draw import plot as plotted

        with patience("drawing"):
            return [plotted(result, plot, degrees=spelling["degrees"])]
    return [] if out is None else _folder(result, spelling, out)


def _folder(result: Result, spelling: dict[str, Any], out: str) -> list[Path]:
    """Write results.csv, result.json and the pictures, all or none."""
    from blockmech.draw import run_pictures

    with patience("writing and drawing"), folder(out) as draft:
        write_csv(csv_chunks(result, **spelling), draft / "results.csv")
        with writing(draft / "result.json") as stream:
            for chunk in json_chunks(result):
                stream.write(chunk.encode())
        run_pictures(result, draft, degrees=spelling["degrees"])
        names = sorted(path.name for path in draft.iterdir())
    return [Path(out) / name for name in names]


def _one_of(**given: bool) -> None:
    asked = [f"--{name}" for name, on in given.items() if on]
    if len(asked) > 1:
        raise _refused(" ".join(asked), "only one of them at a time", "--out writes all files")


def _refused(where: str, found: str, remedy: str) -> RequestError:
    return RequestError(Problem("bad-request", where, found, "", remedy))
