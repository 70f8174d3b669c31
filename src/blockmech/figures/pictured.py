"""Answers with a picture: in a file, in the axes of a user, and below the words in a notebook."""

from __future__ import annotations

from abc import abstractmethod
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from blockmech.figures.paper import rendered, suffix_of, write_figure
from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError
from blockmech.ground.files import AnyPath
from blockmech.ground.report import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Pictured(Report):
    """What people read, with a picture."""

    @abstractmethod
    def figure(self, ax: Axes | None = None) -> Any:
        """matplotlib's figure, in place of the axes ``ax`` if they are given.

        Raises `RequestError` where there is nothing to draw.
        """

    @declared
    def plot(self, path: AnyPath | None = None, *, ax: Axes | None = None) -> Any:
        """The picture as matplotlib's figure; with a path it is written (png, svg or pdf).

        ``ax`` are axes to draw in, which are shared out among several panels; units are those of
        `to`, of angles degrees by default. Raises `RequestError` for another suffix, before
        anything is drawn, and where there is nothing to draw.
        """
        suffix = "" if path is None else suffix_of(path)
        figure = self.figure(ax)
        if path is not None:
            write_figure(figure, path, suffix)
        return figure

    def _repr_html_(self) -> str:
        text = super()._repr_html_()
        with suppress(BlockmechError):
            text += rendered(self.figure(), ".svg").decode()
        return text
