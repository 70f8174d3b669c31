"""The studio: a page in the browser to draw, wire, animate and save mechanisms.

``blockmech.studio(g)`` shows a copy of a graph or linkage in a notebook, in a frame of a server
of its own. Without ``g`` the sheet is empty. It raises `MissingEngineError` where the extra
``studio`` is not installed.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from blockmech.ground.errors import needed


def service() -> Any:
    """The server's module. Raises `MissingEngineError` where the extra is not installed."""
    for package in ("starlette", "uvicorn"):
        needed(package, "studio", "studio")
    return import_module("blockmech.studio.server")


class _Studio(ModuleType):
    """The package, which can be called."""

    def __call__(self, document: Any = None, height: int = 800) -> Any:
        """The studio of a copy of a graph or linkage, as what a notebook shows."""
        frame: Any = service().in_notebook(document, height)
        return frame


sys.modules[__name__].__class__ = _Studio
