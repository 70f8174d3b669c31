"""``blockmech modes``: every way to assemble each group, and where each way exists."""

from __future__ import annotations

import json as text_of
from typing import Annotated

import typer

from blockmech.cli.check import AsJson
from blockmech.cli.graphs import At, GraphFile, compiled
from blockmech.cli.numbers import coordinates
from blockmech.cli.output import si_only
from blockmech.cli.terminal import patience, say


def modes(
    file: GraphFile,
    at: At = None,
    group: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this group; may be repeated.")
    ] = None,
    driver: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Along which arcs are sought; by default the only one."),
    ] = None,
    no_arcs: Annotated[
        bool, typer.Option("--no-arcs", help="Do not seek the arcs of each mode.")
    ] = False,
    deg: Annotated[bool, typer.Option("--deg", help="Angles in degrees in the text.")] = False,
    json: AsJson = False,
) -> None:
    """List all assembly modes of each group, what chooses them, and where they exist."""
    si_only(json, deg)
    mechanism = compiled(file)
    with patience("searching"):
        found = mechanism.modes(
            coordinates(mechanism, at or []), driver=driver, groups=group or None, arcs=not no_arcs
        )
    if json:
        say(text_of.dumps({"file": file, **found.to_dict()}, indent=2, allow_nan=False))
    else:
        say(found.text(degrees=deg))
