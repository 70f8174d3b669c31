"""``blockmech draw``: a picture of the diagram, of the mechanism, or an animation."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from blockmech.cli.numbers import coordinates
from blockmech.cli.graphs import At, GraphFile
from blockmech.cli.terminal import patience, say
from blockmech.model.graph import Graph


class Kind(StrEnum):
    """Kinds of pictures."""

    diagram = "diagram"
    mechanism = "mechanism"
    animation = "animation"


def draw(
    file: GraphFile,
    picture: Annotated[
        str, typer.Option("--output", "-o", metavar="PICTURE", help="png, svg, pdf, gif or html.")
    ],
    kind: Annotated[Kind | None, typer.Option(help="What to draw.")] = None,
    at: At = None,
) -> None:
    """Draw a graph file."""
    graph = Graph.load(file)
    raise NotImplementedError
