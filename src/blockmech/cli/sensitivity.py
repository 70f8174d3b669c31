"""``blockmech sensitivity``: what each number of a mechanism does to its outputs."""

from __future__ import annotations

from typing import Annotated, Any

from blockmech.builders import compiled
from blockmech.cli.numbers import coordinates, times
from blockmech.cli.options import (
    AsJson,
    At,
    Friction,
    GraphFile,
    Samples,
    Static,
    Times,
    names_of,
    one_of,
    option,
)
from blockmech.cli.output import check_places, csv_place, show_found
from blockmech.cli.terminal import progress_bar, reading
from blockmech.runnable import EVERYTHING

Wants = Annotated[list[str], option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")]
To = Annotated[
    list[str] | None,
    option('Numbers or patterns, e.g. "dyad.l_*",crank.q; by default all numbers.', "A,B"),
]
Csv = Annotated[
    str | None, option("Write all derivatives at all samples (csv); - prints them.", "FILE")
]
Plot = Annotated[str | None, option("Draw the ranking (png, svg, pdf).", "FILE")]


def sensitivity(
    file: GraphFile,
    want: Wants,
    to: To = None,
    at: At = None,
    samples: Samples = None,
    at_times: Times = None,
    friction: Friction = None,
    static: Static = False,
    csv: Csv = None,
    plot: Plot = None,
    json: AsJson = False,
) -> None:
    """Rank the numbers of a mechanism by what they do to its outputs: exact derivatives."""
    with reading(file):
        mechanism = compiled(file)
    one_of(json=json, csv=csv is not None, plot=plot is not None)
    check_places(csv := csv_place(csv), plot)
    poses = coordinates(mechanism, at or [])
    request: dict[str, Any] = {"at": poses, "samples": samples, "times": times(at_times)}
    request |= {"to": names_of(to) or EVERYTHING, "friction": friction, "static": static}
    with progress_bar("differentiating"):
        report = mechanism.sensitivity(names_of(want), **request)
    show_found(file, report, report.text(), json, csv, plot)
