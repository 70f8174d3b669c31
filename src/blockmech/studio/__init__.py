"""The studio: a page in the browser on which mechanisms are wired, seen and saved.

``blockmech.studio(g)`` shows a graph in a notebook, or gives a page that `panel` serves.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from blockmech.errors import MissingEngineError, Problem


def needed() -> Any:
    """The page's module. Raises `MissingEngineError` where the extra is not installed."""
    for package in ("panel", "panel_reactflow", "bokeh"):
        if find_spec(package) is None:
            found = f"the package {package} is not installed"
            remedy = "pip install 'blockmech[studio]'"
            raise MissingEngineError(Problem("missing-package", "studio", found, "", remedy))
    return import_module("blockmech.studio.app")


class _Studio(ModuleType):
    """The package, which can be called."""

    def __call__(self, document: Any = None, dark: bool = False) -> Any:
        """The studio of a graph or linkage as a panel object; it shows itself in a notebook.

        ``document`` : Graph or Linkage, left as it is; without one the sheet is empty.
        Raises `MissingEngineError` where the extra ``studio`` is not installed.
        """
        shown: Any = needed().in_notebook(document, dark)
        return shown


sys.modules[__name__].__class__ = _Studio
