"""Machine code as in a new process without files: none is kept, and nothing was asked before."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def without_kept_code() -> Iterator[None]:
    """No machine code of before is taken, and none of this time is kept."""
    from blockmech.engines import code_cache, cost, llvm

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(code_cache.FOLDER, "")
        patch.setattr(llvm, "_CODES", {})
        cost._account.cache_clear()
        try:
            yield
        finally:
            cost._account.cache_clear()
