"""The file that a command is given: a graph of blocks, or links and joints."""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.builders import opened
from blockmech.errors import GraphError, in_file
from blockmech.mechanism import Mechanism

GraphFile = Annotated[
    str, typer.Argument(metavar="FILE", help="A graph of blocks, or links and joints (JSON).")
]


def compiled(file: str) -> Mechanism:
    """The mechanism in a file. Raises `FormatError`, `GraphError` that name the file."""
    found = opened(file)
    try:
        return found.compile()
    except GraphError as error:
        raise GraphError(in_file(error.problems, file)) from error.__cause__
