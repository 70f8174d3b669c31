"""Collectors of graph files, loaded by `pytest_blockmech` where a folder is named.

    [pytest]
    blockmech_graphs = graphs

Each file in such a folder is a collector and each entry of its ``expect`` a test; a graph
without any is one test that it closes where its laws of motion begin. Files under
``broken`` and ``legacy`` are left out. The folders join every run of the whole suite;
``pytest graphs/watt.json`` and ``pytest "graphs/watt.json::expect[0]"`` run parts.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from blockmech.builders import Opened, opened
from blockmech.ground.errors import BlockmechError
from blockmech.testing.expectations import (
    check_closing,
    check_expectation,
    expectations_of,
    failure_table,
)
from blockmech.testing.graph_files import is_graph_of
from pytest_blockmech import FOLDERS

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism
    from blockmech.model.expect import Expectation


def join(config: pytest.Config) -> None:
    """Let the folders take part where the whole suite runs. Raises for a missing folder."""
    for folder in _folders(config):
        if not folder.is_dir():
            raise pytest.UsageError(f"{FOLDERS} names {folder}, which is not a folder")
        if _runs_all(config) and not any(folder.is_relative_to(path) for path in _named(config)):
            config.args.append(str(folder))


def _folders(config: pytest.Config) -> list[Path]:
    return [Path(_absolute(folder)) for folder in config.getini(FOLDERS)]


def _runs_all(config: pytest.Config) -> bool:
    """Whether the run is of all test paths, named or not, and not of some tests."""
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        return True
    suite = {_absolute(config.rootpath / p) for p in config.getini("testpaths")}
    return (suite or {_absolute(config.rootpath)}) <= set(_named(config))


def _named(config: pytest.Config) -> Iterator[str]:
    return (_absolute(config.invocation_params.dir / arg) for arg in config.args)


def _absolute(path: Path) -> str:
    return os.path.abspath(path)  # not resolve(): an argument may be "file::test", no path


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> GraphFile | None:
    """A collector for a graph file in one of the folders."""
    if any(is_graph_of(folder, file_path) for folder in _folders(parent.config)):
        collector: GraphFile = GraphFile.from_parent(parent, path=file_path)
        return collector
    return None


class GraphFile(pytest.File):  # type: ignore[misc]
    """A graph file; its tests are its expectations."""

    @cached_property
    def graph(self) -> Opened:
        """The graph, or the links and joints. Raises `FormatError` or `GraphError`."""
        return opened(self.path)

    @cached_property
    def mechanism(self) -> Mechanism:
        """The mechanism, compiled once for all entries."""
        return self.graph.compile()

    def collect(self) -> Iterable[GraphTest]:
        """One test for each entry; a wrong file is one failing test and stops no other."""
        try:
            expectations = expectations_of(self.graph)
        except BlockmechError as error:
            message = str(error)
            yield self._test("reads", lambda: message)
            return
        if not expectations:
            yield self._test("closes", lambda: check_closing(self.mechanism))
        for k, expectation in enumerate(expectations):
            yield self._test(f"expect[{k}]", partial(self._check, k, expectation))

    def _test(self, name: str, body: Callable[[], str | None]) -> GraphTest:
        item: GraphTest = GraphTest.from_parent(self, name=name, body=body)
        return item

    def _check(self, k: int, expectation: Expectation) -> str:
        """The table of the numbers that are not met."""
        outcomes = check_expectation(self.mechanism, expectation, k)
        failed = sum(not o.ok for o in outcomes)
        head = f"{failed} of {len(outcomes)} numbers are not met ({expectation.source})"
        return f"{head}\n\n{failure_table(outcomes)}" if failed else ""


class GraphTest(pytest.Item):  # type: ignore[misc]
    """One test of a graph file; ``body`` gives what is wrong, or raises it."""

    def __init__(self, *, body: Callable[[], str | None], **node: Any) -> None:
        super().__init__(**node)
        self._body = body

    def runtest(self) -> None:
        """Run it; what is wrong with the file or its numbers is told without a traceback."""
        try:
            wrong = self._body()
        except BlockmechError as error:
            wrong = str(error)
        if wrong:
            pytest.fail(f"{self.nodeid}\n{wrong}", pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where the test stands."""
        return self.path, None, f"{self.path.name}: {self.name}"
