"""The studio: a page in the browser on which mechanisms are wired, seen and saved.

``blockmech.studio(g, dark=False)`` shows a copy of a graph or linkage in a notebook; what it gives
is a panel object, which `panel` serves as well. Without ``g`` the sheet is empty. It raises
`MissingEngineError` where the extra ``studio`` is not installed.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from blockmech.ground.errors import needed


def page() -> Any:
    """The page's module. Raises `MissingEngineError` where the extra is not installed."""
    for package in ("panel", "bokeh"):
        needed(package, "studio", "studio")
    return import_module("blockmech.studio.app")


class _Studio(ModuleType):
    """The package, which can be called."""

    def __call__(self, document: Any = None, dark: bool = False) -> Any:
        """The studio of a copy of a graph or linkage, as a panel object."""
        shown: Any = page().in_notebook(document, dark)
        return shown


sys.modules[__name__].__class__ = _Studio
