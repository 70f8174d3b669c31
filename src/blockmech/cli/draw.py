"""``blockmech draw``: a picture of the diagram, of the mechanism, or an animation."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from blockmech.builders import compiled_of, opened
from blockmech.cli.numbers import coordinates
from blockmech.cli.options import At, Degrees, GraphFile, names_of, option
from blockmech.cli.terminal import progress_bar, reading, say
from blockmech.ground.files import refuse_spared

Picture = Annotated[
    str,
    typer.Option(
        "--output", "-o", metavar="PICTURE", help="png, svg or pdf; gif or html for an animation."
    ),
]
Kind = Annotated[
    str | None, option('"list" tells the kinds; by default what the others say.', "KIND")
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
    deg: Degrees = None,
) -> None:
    """Draw the block diagram, the mechanism at poses, an animation, or a schedule of calls.

    Links and joints are drawn as the mechanism, blocks as their diagram, which may be drawn of an
    unfinished graph: joints without a wire are red.
    """
    from blockmech.draw import KINDS, default_kind

    if kind == "list":
        say("\n".join(f"{name}: {picture_kind.about}" for name, picture_kind in KINDS.items()))
        return
    document = reading(file, opened)
    posed = bool(at or trace) or deg is False
    kind = kind or default_kind(document, picture, posed)
    subject: Any = document if kind == "diagram" else compiled_of(document, file)
    refuse_spared(picture)
    poses: Any = at  # which a diagram refuses
    if at and "at" in KINDS.get(kind, KINDS["diagram"]).takes:
        poses = coordinates(subject, at, deg)
    with progress_bar("drawing"):
        subject.draw(
            *(picture, kind, poses),
            trace=names_of(trace) or None,
            unit=["rad"] * (deg is False),
            want=names_of(want) or "*",
        )
    say(f"wrote {picture}")
