"""``blockmech test``: compute the numbers that graph files expect, and compare."""

from __future__ import annotations

import json as text_of
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from blockmech.builders import opened
from blockmech.cli.options import AsJson, names_of, option
from blockmech.cli.terminal import NO_ANSWER, WRONG, note, progress_bar, say
from blockmech.ground.errors import BlockmechError, Problem, in_file
from blockmech.model.expect import Expectation
from blockmech.model.form import plain
from blockmech.result.tables import counted
from blockmech.testing.graph_files import LEFT_OUT, graphs_of
from blockmech.typing import Data

if TYPE_CHECKING:
    from blockmech.testing.expectations import Outcome

Record = Annotated[
    str | None, option("Write what these outputs are now into the files' expect.", "A,B")
]


@dataclass
class Tested:
    """A graph file and what became of its expectations."""

    file: str
    graph: str = ""
    problems: list[Problem] = field(default_factory=list)
    entries: list[tuple[int, Expectation, list[Outcome]]] = field(default_factory=list)

    @property
    def failed(self) -> bool:
        """Whether some number is not met."""
        return any(not o.ok for *_, outcomes in self.entries for o in outcomes)

    def to_dict(self) -> Data:
        """As JSON data."""
        entries = [
            {
                "entry": k,
                "source": expectation.source,
                "ok": all(o.ok for o in outcomes),
                "outcomes": [o.to_dict() for o in outcomes],
            }
            for k, expectation, outcomes in self.entries
        ]
        return {
            "file": self.file,
            "graph": self.graph,
            "ok": not (self.problems or self.failed),
            "problems": [p.to_dict() for p in self.problems],
            "entries": entries,
        }

    def lines(self) -> Iterator[str]:
        """One line for each entry, with a table below one that fails."""
        from blockmech.testing.expectations import failure_table

        for k, expectation, outcomes in self.entries:
            failed = sum(not o.ok for o in outcomes)
            count = f"{failed} of " * bool(failed) + counted(len(outcomes), "number")
            word = "FAILS" if failed else "ok   "
            yield f"{word}  {self.file} expect[{k}]: {count} ({expectation.source})"
            if failed:
                yield from (f"       {line}" for line in failure_table(outcomes).splitlines())
        if self.problems:
            yield f"wrong  {self.file}"
        elif not self.entries:
            yield f"-      {self.file}: no expectations"


def test(
    paths: Annotated[
        list[str], typer.Argument(metavar="PATH...", help="Graph files, or folders of them.")
    ],
    record: Record = None,  # noqa: PT028 (a command, no test of pytest's)
    json: AsJson = False,  # noqa: PT028
) -> None:
    """Compute the numbers that graph files expect, and compare.

    In a folder all graphs are tested except those under broken and legacy. Exit code 1 means that
    a number deviates, 2 that a file is invalid. With --record nothing is compared: today's outputs
    are added to the expect of each file.
    """
    if record is not None:
        from blockmech.testing.expectations import recorded

        for file in [file for path in paths for file in _files(Path(path))]:
            document = opened(file)
            entries = [plain(e) for e in recorded(document.compile(), names_of([record]))]
            document.extras["expect"] = [*(document.extras.get("expect") or ()), *entries]
            document.save(file)
            say(f"{file}: {len(entries)} recorded")
        return
    with progress_bar("testing"):
        tested = list(_runs(paths))
    wrong, failed = any(t.problems for t in tested), any(t.failed for t in tested)
    if json:
        files = [t.to_dict() for t in tested]
        say(text_of.dumps({"ok": not (wrong or failed), "files": files}, indent=2))
    else:
        for t in tested:
            say("\n".join(t.lines()))
            note(*map(str, t.problems))
        say(_summary(tested))
    if wrong or failed:
        raise typer.Exit(WRONG if wrong else NO_ANSWER)


def _runs(paths: list[str]) -> Iterator[Tested]:
    """Every graph file that paths name, each once; a path without any is noted."""
    visited: set[str] = set()
    for path in paths:
        files = _files(Path(path))
        if not files:
            valid = f"graph files end in .json; those under {' and '.join(LEFT_OUT)} are left out"
            problem = Problem("no-file", "", "no graph file in this folder", valid, file=path)
            yield Tested(path, problems=[problem])
        for file in (f for f in files if f not in visited):
            visited.add(file)
            yield _test(file)


def _files(path: Path) -> list[str]:
    """The graph files of a folder, or the file itself."""
    return [os.fspath(p) for p in graphs_of(path)] if path.is_dir() else [os.fspath(path)]


def _test(file: str) -> Tested:
    """Run every expectation of a file; what is wrong with the file is noted."""
    from blockmech.testing.expectations import check_expectation, expectations_of

    tested = Tested(file)
    try:
        graph = opened(file)
        tested.graph = graph.name
        expectations = expectations_of(graph)
        mechanism = graph.compile()
    except BlockmechError as error:
        tested.problems = in_file(error.problems, file)
        return tested
    for k, expectation in enumerate(expectations):
        try:
            tested.entries.append((k, expectation, check_expectation(mechanism, expectation, k)))
        except BlockmechError as error:
            tested.problems += in_file(error.problems, file)
    return tested


def _summary(tested: list[Tested]) -> str:
    entries = [outcomes for t in tested for *_, outcomes in t.entries]
    failed = sum(any(not o.ok for o in outcomes) for outcomes in entries)
    silent = sum(not t.entries and not t.problems for t in tested)
    wrong = sum(bool(t.problems) for t in tested)
    parts = [f"{len(entries) - failed} ok", f"{failed} failed"]
    for count, label in ((silent, "without expectations"), (wrong, "wrong")):
        if count:
            parts.append(f"{counted(count, 'file')} {label}")
    return ", ".join(parts)
