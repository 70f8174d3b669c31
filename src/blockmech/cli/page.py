"""``blockmech page`` and ``report``: a mechanism as one page that moves, or is printed."""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.cli.export import written
from blockmech.cli.options import Friction, GraphFile, Poses, Static, Want, option

Page = Annotated[str, typer.Option("--output", "-o", metavar="PAGE", help="The page, PAGE.html.")]


def page(
    file: GraphFile,
    output: Page,
    poses: Poses,
    want: Want = None,
    slider: Annotated[
        list[str] | None,
        option("Numbers that have a slider at first; by default a few.", "NAMES"),
    ] = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Write one HTML page without a server: drawing, motion, curves, sliders for numbers.

    The page works everything out itself, with the numbers that blockmech has.
    """
    settings = {"slider": ",".join(slider) if slider else None, "friction": friction}
    written(file, output, "page", poses, want, static=static or None, **settings)


def report(
    file: GraphFile,
    output: Page,
    poses: Poses,
    want: Want = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Write one HTML page to be printed: drawing with dimensions, data, curves, forces."""
    written(file, output, "report", poses, want, friction=friction, static=static or None)
