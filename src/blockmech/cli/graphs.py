"""Arguments that name a graph file and samples, and the mechanism in the file."""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.errors import GraphError
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.model.problems import in_file

GraphFile = Annotated[str, typer.Argument(metavar="FILE", help="A graph file (JSON).")]
At = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[DRIVER=]NUMBERS",
        help="Driver coordinates, e.g. 0,1,60deg or 0:360deg:37; once for each driver.",
    ),
]


def compiled(file: str) -> Mechanism:
    """The mechanism in a graph file. Raises `FormatError`, `GraphError` that name the file."""
    graph = Graph.load(file)
    problems = graph.check()
    if problems:
        raise GraphError(in_file(problems, file))
    return graph.compile()
