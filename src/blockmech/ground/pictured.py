"""Answers with a picture: in a file, and below the words in a notebook."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError
from blockmech.ground.files import AnyPath
from blockmech.ground.report import DEGREES, Report


def drawing(function: str) -> Any:
    """A function ``"module:function"`` that draws, loaded when a picture is asked for.

    Pictures stand below the analyses, which are drawn and need no drawing themselves.
    """
    module, _, name = function.partition(":")
    return getattr(import_module(module), name)


class Pictured(Report):
    """What people read, with a picture.

    ``PICTURE`` names the function that draws it, which takes the answer and whether angles are
    shown in degrees: ``"my_package.pictures:spectrum"``.
    """

    PICTURE: ClassVar[str]

    def figure(self, degrees: bool = DEGREES) -> Any:
        """matplotlib's figure. Raises `RequestError` where there is nothing to draw."""
        return drawing(self.PICTURE)(self, degrees)

    @declared
    def plot(self, path: AnyPath, *, degrees: bool = DEGREES) -> Path:
        """Write the picture (png, svg or pdf).

        Raises `RequestError` for another suffix, before anything is drawn, and where there is
        nothing to draw.
        """
        suffix = drawing("blockmech.draw.paper:suffix_of")(path)
        written: Path = drawing("blockmech.draw.paper:write_figure")(
            self.figure(degrees), path, suffix
        )
        return written

    def _repr_html_(self) -> str:
        shown = super()._repr_html_()
        with suppress(BlockmechError):
            shown += drawing("blockmech.draw.paper:rendered")(self.figure(), ".svg").decode()
        return shown
