"""``blockmech page`` and ``report``: a mechanism as one page that moves, or is printed."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from blockmech.builders import opened
from blockmech.cli.options import Friction, GraphFile, Poses, Static, Want, names_of, option
from blockmech.cli.terminal import progress_bar, reading, say
from blockmech.ground.runnable import EVERYTHING

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
    _write(file, output, "page", poses, want, static=static or None, **settings)


def report(
    file: GraphFile,
    output: Page,
    poses: Poses,
    want: Want = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Write one HTML page to be printed: drawing with dimensions, data, curves, forces."""
    _write(file, output, "report", poses, want, friction=friction, static=static or None)


def _write(
    file: str, output: str, to: str, poses: Poses, want: list[str] | None, **settings: Any
) -> None:
    from blockmech.exchange.writing import write

    document = reading(file, opened)
    request = poses.of(document.compile()) | settings
    with progress_bar("writing"):
        (path,) = write(document, output, to, want=names_of(want) or EVERYTHING, **request)
    say(f"wrote {path}")
