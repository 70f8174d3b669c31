"""The report after the benchmarks, and --results to write it into a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from . import results


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--results", metavar="FILE", help="write the measured ratios as Markdown")


def pytest_terminal_summary(terminalreporter, exitstatus: int, config: pytest.Config) -> None:
    if results.ROWS:
        terminalreporter.write_line("\n" + results.table())
    path = config.getoption("--results")
    if path and exitstatus == 0:
        results.write(Path(path))
        terminalreporter.write_line(f"wrote {path}")
