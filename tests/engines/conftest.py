"""What tests of engines share."""

import pytest

from blockmech.engines import code_cache, cost, llvm


@pytest.fixture
def fresh(monkeypatch):
    """As in a new process without files: no code is there, and nothing was asked before."""
    monkeypatch.setenv(code_cache.FOLDER, "")
    monkeypatch.setattr(llvm, "_CODES", {})
    cost._account.cache_clear()
    yield
    cost._account.cache_clear()
