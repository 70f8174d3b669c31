"""Which files of a folder are graphs that are tests: every JSON file but under two folders."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import blockmech

LEFT_OUT = ("broken", "legacy")
"""Folders of graphs that are wrong on purpose, or of old versions."""


def is_graph_of(folder: Path, file: Path) -> bool:
    """Whether a file is a graph of a folder that is tested."""
    if file.suffix != ".json" or not file.is_relative_to(folder):
        return False
    return not set(LEFT_OUT) & set(file.relative_to(folder).parts[:-1])


def graphs_of(folder: Path) -> Iterator[Path]:
    """The graphs of a folder that are tested, in name order."""
    return (path for path in sorted(folder.rglob("*.json")) if is_graph_of(folder, path))


def gallery() -> dict[str, Path]:
    """Mechanisms that come with the package, by name; of a folder ``"folder/name"``."""
    package = Path(blockmech.__file__).parent
    # A wheel carries the graphs inside the package, a checkout has them at its top.
    for folder in (package / "graphs", package.parents[1] / "graphs"):
        if folder.is_dir():
            paths = graphs_of(folder)
            return {path.relative_to(folder).with_suffix("").as_posix(): path for path in paths}
    return {}
