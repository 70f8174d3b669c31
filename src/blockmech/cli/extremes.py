"""``blockmech extremes``: smallest and largest values of outputs over the cycle, and strokes."""

from __future__ import annotations

import json as text_of
from typing import Annotated

import typer

from blockmech.cli.check import AsJson
from blockmech.cli.graphs import GraphFile, compiled
from blockmech.cli.terminal import patience, say


def extremes(
    file: GraphFile,
    names: Annotated[
        list[str], typer.Argument(metavar="OUTPUT...", help="Outputs, e.g. dyad.C.p.x crank.drive.")
    ],
    stroke: Annotated[
        bool, typer.Option("--stroke", help="Of each its stroke and the time ratio instead.")
    ] = False,
    json: AsJson = False,
) -> None:
    """Find extremes of outputs over the cycle, refined beyond the samples."""
    mechanism = compiled(file)
    with patience("searching"):
        found = [mechanism.stroke(n) if stroke else mechanism.extremes(n) for n in names]
    if json:
        what = "strokes" if stroke else "extremes"
        say(text_of.dumps({"file": file, what: [f.to_dict() for f in found]}, indent=2))
    else:
        say("\n".join(map(str, found)))
