"""The editor of mechanisms in the browser: the studio, its server, documents and acts."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from blockmech.ground.errors import needed

if TYPE_CHECKING:
    from blockmech.builders import Graph, Linkage


class Framed:
    """A frame with the page of a sheet, as a notebook shows it."""

    def __init__(self, address: str, height: int) -> None:
        self.address, self.height = address, height

    def _repr_html_(self) -> str:
        look = f"width:100%;height:{self.height}px;border:0"
        return f'<iframe src="{self.address}" style="{look}" title="blockmech studio"></iframe>'


def service() -> Any:
    """The server's module. Raises `MissingEngineError` where the extra is not installed."""
    for package in ("starlette", "uvicorn"):
        needed(package, "studio", "studio")
    return import_module("blockmech.editor.server")


def studio(document: Graph | Linkage | None = None, height: int = 800) -> Framed:
    """The studio with a copy of a graph or linkage, for display in a notebook.

    The page is shown in a frame of ``height`` pixels; its server ends with the program. Without
    ``document`` the sheet is empty. Raises `MissingEngineError` where the extra
    ``studio`` is not installed.

    >>> frame = bm.studio(g, height=600)
    """
    return Framed(service().in_notebook(document), height)
