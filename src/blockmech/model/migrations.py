"""Graph files of older versions, brought up to date step by step.

Step k turns a document of version k + 1 into one of version k + 2. It is a pure
function: it returns a new document and leaves the one it gets alone. A file of the
old version goes to ``graphs/legacy`` and stays there for the tests.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from blockmech.errors import FormatError, Problem, shown

Document: TypeAlias = dict[str, Any]
Step: TypeAlias = Callable[[Mapping[str, Any]], Document]

MIGRATIONS: tuple[Step, ...] = ()
"""The steps from version 1 to the present one; none so far."""

VERSION = len(MIGRATIONS) + 1
"""The version of graph files that this blockmech writes."""


def migrate(data: Mapping[str, Any], steps: Sequence[Step] = MIGRATIONS) -> Document:
    """The document in the present version.

    Parameters
    ----------
    data : the document as read; it is not changed
    steps : the steps from version 1 on; their number makes the present version

    Raises `FormatError` if the version is missing, no version, or newer than the present.
    """
    problem = version_problem(data, len(steps) + 1)
    if problem is not None:
        raise FormatError(problem)
    document = dict(data)
    for k in range(data["version"] - 1, len(steps)):
        document = {**steps[k](document), "version": k + 2}
    return document


def version_problem(data: Mapping[str, Any], newest: int = VERSION) -> Problem | None:
    """What is wrong with the version of a document, if anything."""
    valid = "this blockmech reads version 1" + (f" to {newest}" if newest > 1 else "")
    if "version" not in data:
        found, remedy = "the file does not say its version", f'add "version": {newest}'
        return Problem("missing-version", "version", found, valid, remedy)
    version = data["version"]
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        found = f"version must be a whole number from 1, got {shown(version)}"
        return Problem("bad-version", "version", found, valid, f'write "version": {newest}')
    if version > newest:
        found = f"the file has version {version}, made by a newer blockmech"
        return Problem("newer-version", "version", found, valid, "update blockmech")
    return None
