"""Opening a file: its ``format`` says whether it is a graph of blocks or links and joints."""

from __future__ import annotations

import os
from typing import TypeAlias

from blockmech.errors import FormatError, GraphError, Problem, in_file
from blockmech.model import document as graphs
from blockmech.model.graph import Graph
from blockmech.model.joints import document as linkages
from blockmech.model.joints.contents import FORMAT
from blockmech.model.joints.linkage import Linkage
from blockmech.model.reading import data_of, text_of

Opened: TypeAlias = Graph | Linkage
"""What a file of a mechanism holds."""


def opened(path: str | os.PathLike[str]) -> Opened:
    """The mechanism in a file: a graph, or links and joints.

    Raises
    ------
    FormatError with all problems of the file
    GraphError if only the wiring of a graph is wrong
    """
    file, text = os.fspath(path), text_of(path)
    return linkages.loads(text, file) if _of_joints(text) else graphs.loads(text, file)


def _of_joints(text: str) -> bool:
    """Whether the text says so, or, if it names no format, has joints and no blocks."""
    try:
        raw, _ = data_of(text)
    except FormatError:  # the readers say better what is wrong
        return False
    if "format" in raw:
        return bool(raw["format"] == FORMAT)
    return "joints" in raw and "blocks" not in raw


def problems_in(path: str | os.PathLike[str]) -> list[Problem]:
    """Everything wrong with a file, and what its mechanism lacks to be computed."""
    try:
        return in_file(opened(path).check(), os.fspath(path))
    except (FormatError, GraphError) as error:
        return list(error.problems)
