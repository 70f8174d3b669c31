"""The report after the benchmarks, and --results to write it into a file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from blockmech.engines import code_cache

from . import results


@pytest.fixture(scope="session", autouse=True)
def machine_code(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A folder of machine code of its own: what other programs keep pushes none of it out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(code_cache.FOLDER, str(tmp_path_factory.mktemp("machine_code")))
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--results", metavar="FILE", help="write the measured ratios as Markdown")


def pytest_terminal_summary(terminalreporter, exitstatus: int, config: pytest.Config) -> None:
    if results.ROWS:
        terminalreporter.write_line("\n" + results.table())
    path = config.getoption("--results")
    if path and exitstatus == 0:
        results.write(Path(path))
        terminalreporter.write_line(f"wrote {path}")
