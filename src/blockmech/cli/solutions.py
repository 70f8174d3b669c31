"""``blockmech solutions``: all solutions of the friction equations at given poses."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from blockmech.builders import compiled
from blockmech.cli.numbers import coordinates, row, times
from blockmech.cli.options import (
    AsJson,
    At,
    DegreesOfText,
    GraphFile,
    Samples,
    Static,
    Times,
    Want,
    names_of,
    one_of,
    option,
    si_only,
)
from blockmech.cli.output import check_places, csv_place, show_found
from blockmech.cli.terminal import NO_ANSWER, progress_bar, reading
from blockmech.told import DEGREES

Scale = Annotated[str, option("Factor of all friction, e.g. 1.5 or 0.5:3:51.", "NUMBERS")]
Csv = Annotated[str | None, option("Write all solutions (csv); - prints them.", "FILE")]
Plot = Annotated[str | None, option("Draw them over the driver (png, svg, pdf).", "FILE")]


def solutions(
    file: GraphFile,
    at: At = None,
    samples: Samples = None,
    at_times: Times = None,
    want: Want = None,
    scale: Scale = "1",
    static: Static = False,
    csv: Csv = None,
    plot: Plot = None,
    deg: DegreesOfText = DEGREES,
    json: AsJson = False,
) -> None:
    """List all solutions of the friction equations, and say whether that is proved.

    Where it is not proved at some pose the exit code is 1.
    """
    one_of(json=json, csv=csv is not None, plot=plot is not None)
    si_only(json, deg)
    with reading(file):
        mechanism = compiled(file)
    check_places(csv := csv_place(csv), plot)
    request: dict[str, Any] = {"samples": samples, "times": times(at_times), "static": static}
    request |= {"want": names_of(want) or None, "scale": row(f"--scale {scale}", scale, {"": 1.0})}
    poses = coordinates(mechanism, at or [])
    with progress_bar("searching"):
        report = mechanism.friction_solutions(poses, **request)
    show_found(file, report, report.text(degrees=deg), json, csv, plot)
    if not report.complete.all():
        raise typer.Exit(NO_ANSWER)
