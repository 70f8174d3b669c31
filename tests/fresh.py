"""Programs and machine code as in a new process without files: none is kept or asked before."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def without_kept_code() -> Iterator[None]:
    """No program or machine code of before is taken, and none of this time is kept."""
    from blockmech.engines import code_cache, cost, llvm
    from blockmech.ground.memory import Recent
    from blockmech.passes import homotopy
    from blockmech.plan import recipes

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(code_cache.FOLDER, "")
        for module, cache in ((llvm, "_CODES"), (recipes, "_RECIPES"), (homotopy, "_PATHS")):
            patch.setattr(module, cache, Recent())
        cost._account.cache_clear()
        try:
            yield
        finally:
            cost._account.cache_clear()
