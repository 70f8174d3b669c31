"""``blockmech limits``: how far each driver can go, and which group ends it."""

from __future__ import annotations

import json as text_of
from typing import Annotated

import typer

from blockmech.cli.check import AsJson
from blockmech.cli.graphs import GraphFile, compiled
from blockmech.cli.numbers import coordinates
from blockmech.cli.output import refused, si_only
from blockmech.cli.terminal import patience, say


def limits(
    file: GraphFile,
    driver: Annotated[
        str | None, typer.Option(metavar="NAME", help="Only this driver; by default each.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[DRIVER=]NUMBER",
            help="Where another driver is held; by default where its law begins.",
        ),
    ] = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles in degrees in the text.")] = False,
    json: AsJson = False,
) -> None:
    """Find the arcs of each driver on which the mechanism closes."""
    si_only(json, deg)
    mechanism = compiled(file)
    held = {}
    for name, row in (coordinates(mechanism, at or []) or {}).items():
        if len(row) != 1:
            raise refused(f"--at {name}", f"it names {len(row)} places", "give one number")
        held[name] = row[0]
    moving = mechanism.drivers if driver is None else (driver,)
    for name in held:
        if moving == (name,):
            raise refused(f"--at {name}", "this driver is the one that moves", "hold another one")
    with patience("searching"):
        found = [
            mechanism.limits(moved, {d: q for d, q in held.items() if d != moved})
            for moved in moving or (None,)
        ]
    if json:
        rows = [f.to_dict() for f in found]
        say(text_of.dumps({"file": file, "limits": rows}, indent=2))
    else:
        say("\n".join(f.text(degrees=deg) for f in found))
