"""What pytest loads where blockmech is installed: one option, and nothing else until it is set.

It stands beside the package, because importing anything inside it would import blockmech,
and every pytest run of the environment would wait for that.
"""

from __future__ import annotations

import pytest

FOLDERS = "blockmech_graphs"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The ini line that switches graph tests on."""
    parser.addini(FOLDERS, "folders with blockmech graph files, each a test", "paths", [])


def pytest_configure(config: pytest.Config) -> None:
    """Load the collectors if a folder is named."""
    if config.getini(FOLDERS):
        from blockmech.testing import pytest_plugin

        config.pluginmanager.register(pytest_plugin, "blockmech-graphs")
        pytest_plugin.join(config)
