"""``blockmech run``: compute a mechanism's outputs and show or write them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from blockmech.cli.numbers import coordinates, times
from blockmech.cli.options import (
    At,
    Csv,
    Decimal,
    Degrees,
    Explain,
    Friction,
    GraphFile,
    Iterations,
    Json,
    Out,
    Plot,
    Samples,
    Separator,
    Static,
    Times,
    Tolerance,
    Want,
    check_ways,
    compiled,
    names_of,
    option,
    spelled,
)
from blockmech.cli.terminal import note, patience, say, show
from blockmech.compiled import EVERYTHING
from blockmech.export import gap_lines
from blockmech.failures import without_gaps
from blockmech.mechanism import Mechanism
from blockmech.result import Result

Accuracy = Annotated[
    float | None, option("Wanted relative error; chooses friction method and precision.", "X")
]
Engine = Annotated[str, option("auto, scalar or numpy.", "ENGINE")]
Precision = Annotated[str | None, option("complex64, complex128 or clongdouble (numpy).", "TYPE")]
OnGap = Annotated[str, option("Samples without an answer: mark, raise or stop.", "WHAT")]


def run(
    file: GraphFile,
    at: At = None,
    samples: Samples = None,
    at_times: Times = None,
    want: Want = None,
    friction: Friction = None,
    tolerance: Tolerance = None,
    iterations: Iterations = None,
    accuracy: Accuracy = None,
    static: Static = False,
    engine: Engine = "auto",
    precision: Precision = None,
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
    check_ways(file, json, out, csv, plot, deg)
    mechanism = compiled(file)
    names = names_of(want)
    settings = {"friction": friction, "tolerance": tolerance, "iterations": iterations}
    plan: dict[str, Any] = {"want": names or EVERYTHING, "static": static, **settings}
    if explain:
        say(mechanism.explain(**plan | {"friction": friction or "newton"}))
        return
    given = coordinates(mechanism, at or [])
    taken = {"at": given, "samples": samples, "times": times(at_times)}
    how = {"engine": engine, "precision": precision, "accuracy": accuracy}
    result, gaps = _computed(mechanism, {**plan, **taken, **how}, on_gap, deg)
    if result.accuracy is not None:
        note(str(result.accuracy))
    ways: dict[str, Any] = {"json": json, "out": out, "csv": csv, "plot": plot}
    show(result, spelled(separator, decimal, deg), _pictures, **ways, gaps=gaps)
    if on_gap == "stop" and not (json or csv == "-"):  # the table does not reach them
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
        return without_gaps(result, on_gap, mechanism.feasible), gaps


def _pictures(result: Result, folder: Path, degrees: bool) -> None:
    from blockmech.draw import run_pictures

    run_pictures(result, folder, degrees=degrees)
