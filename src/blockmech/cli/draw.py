"""``blockmech draw``: a picture of the diagram, of the mechanism, or an animation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from blockmech.builders import compiled, opened
from blockmech.cli.numbers import coordinates
from blockmech.cli.options import At, GraphFile, names_of, option, switch
from blockmech.cli.terminal import progress_bar, reading, say
from blockmech.ground.files import refuse_spared
from blockmech.ground.report import DEGREES
from blockmech.ground.runnable import EVERYTHING

Picture = Annotated[
    str,
    typer.Option(
        "--output", "-o", metavar="PICTURE", help="png, svg or pdf; gif or html for an animation."
    ),
]
Kind = Annotated[
    str | None,
    option(
        "diagram, mechanism, animation, schedule, structure, centrodes or tile; by default what "
        "the others say.",
        "KIND",
    ),
]


Want = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAMES",
        help="Outputs of a schedule, patterns allowed; default all. Links of centrodes.",
    ),
]


def draw(
    file: GraphFile,
    picture: Picture,
    kind: Kind = None,
    at: At = None,
    trace: Annotated[
        list[str] | None, option("Markers and pins whose paths are drawn.", "NAMES")
    ] = None,
    want: Want = None,
    deg: Annotated[bool, switch("deg", "Angles in degrees in the picture.")] = DEGREES,
) -> None:
    """Draw the block diagram, the mechanism at poses, an animation, or a schedule of calls.

    A diagram may be drawn of an unfinished graph: joints without a wire are red.
    """
    from blockmech.draw import draw as drawn
    from blockmech.draw.animation import MOVING

    if kind is None:
        moving = Path(picture).suffix.lower() in MOVING
        kind = "animation" if moving else "mechanism" if at or trace else "diagram"
    subject: Any = reading(file, opened if kind == "diagram" else compiled)
    refuse_spared(picture)
    given: Any = at  # which a diagram refuses
    if kind in ("mechanism", "animation") or (kind in ("centrodes", "tile") and at):
        given = coordinates(subject, at)
    with progress_bar("drawing"):
        request: dict[str, Any] = {"kind": kind, "at": given, "degrees": deg}
        request |= {"trace": names_of(trace) or None, "want": names_of(want) or EVERYTHING}
        path = drawn(subject, picture, **request)
    say(f"wrote {path}")
