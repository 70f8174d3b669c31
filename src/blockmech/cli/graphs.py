"""Arguments that name a file and samples, and the mechanism in the file.

A file is a graph of blocks or links and joints; every command takes either.
"""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.builders import opened
from blockmech.errors import GraphError
from blockmech.mechanism import Mechanism
from blockmech.model.problems import in_file

GraphFile = Annotated[
    str, typer.Argument(metavar="FILE", help="A graph of blocks, or links and joints (JSON).")
]
At = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[DRIVER=]NUMBERS",
        help="Driver coordinates, e.g. 0,1,60deg or 0:360deg:37; once for each driver.",
    ),
]


def compiled(file: str) -> Mechanism:
    """The mechanism in a file. Raises `FormatError`, `GraphError` that name the file."""
    found = opened(file)
    try:
        return found.compile()
    except GraphError as error:
        raise GraphError(in_file(error.problems, file)) from error.__cause__
