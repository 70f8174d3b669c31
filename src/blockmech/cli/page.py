"""``blockmech page``: a mechanism as one page that needs no server."""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.builders import opened
from blockmech.cli.options import Friction, GraphFile, Poses, Static, Want, names_of, option
from blockmech.cli.terminal import progress_bar, reading, say
from blockmech.runnable import EVERYTHING


def page(
    file: GraphFile,
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="PAGE", help="The page, PAGE.html.")
    ],
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
    from blockmech.exchange.writing import write

    document = reading(file, opened)
    mechanism = document.compile()
    request = poses.of(mechanism) | {"friction": friction, "static": static or None}
    request["slider"] = ",".join(slider) if slider else None
    with progress_bar("writing"):
        (path,) = write(document, output, "page", want=names_of(want) or EVERYTHING, **request)
    say(f"wrote {path}")
