"""What an answer gains by its picture: a file of it, and the same below its words in a notebook."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any

from blockmech.arguments import declared
from blockmech.draw.paper import rendered, suffix_of, write_figure
from blockmech.errors import BlockmechError
from blockmech.files import AnyPath


class Pictured(ABC):
    """An answer with its picture."""

    @abstractmethod
    def figure(self) -> Any:
        """matplotlib's figure. Raises `RequestError` where there is nothing to draw."""

    @declared
    def plot(self, path: AnyPath) -> Path:
        """Write the picture (png, svg or pdf).

        Raises `RequestError` for another suffix, before anything is drawn, and where there is
        nothing to draw.
        """
        suffix = suffix_of(path)
        return write_figure(self.figure(), path, suffix)

    def _repr_html_(self) -> str:
        shown = f"<pre>{html.escape(str(self))}</pre>"
        with suppress(BlockmechError):
            shown += rendered(self.figure(), ".svg").decode()
        return shown
