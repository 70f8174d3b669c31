"""Stretches of a coordinate as bars, each with what ends it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from blockmech.figures import palette as ink
from blockmech.figures.panels import label_coordinate
from blockmech.figures.paper import panelled, picture_unit, shown_name
from blockmech.ground.errors import refused

if TYPE_CHECKING:
    from matplotlib.axes import Axes

THICK = 0.62  # of a row: a bar
LABEL = 56  # characters of a bar's label: what a column holds


class Bar(NamedTuple):
    """A stretch of a driver's coordinate [rad or m]: what ends it, and places that are marked."""

    name: str
    start: float
    end: float
    ends: tuple[str, str]
    marks: tuple[float, ...] = ()
    chosen: tuple[float, ...] = ()
    colour: int = 0


def bars_figure(
    bars: Sequence[Bar],
    name: str,
    unit: str,
    caption: str,
    display: Iterable[str],
    ax: Axes | None,
) -> Any:
    """Bars over a coordinate, a column wide. Raises `RequestError` where there is none."""
    if not bars:
        raise refused(shown_name(name), "there is no arc to draw", code="nothing-to-draw")
    scale, unit = picture_unit(unit, display)
    omitted = len(bars) - ink.MOST
    caption += f" {omitted} more are not drawn." if omitted > 0 else ""
    rows = 3 * len(bars[: ink.MOST]) + 4  # words, bar and air; axis
    with panelled(caption, rows * ink.ROW, ax=ax) as ((axes,),):
        axes.use_sticky_edges = False
        # What is shown: all finite ends; of bars that nothing ends a unit about zero.
        ends = [q for bar in bars for q in (bar.start, bar.end) if math.isfinite(q)] or [-1.0, 1.0]
        for y, bar in enumerate(bars[: ink.MOST]):
            _draw(axes, y, bar, (min(ends), max(ends)), scale)
        axes.set_ylim(len(bars[: ink.MOST]) - 1 + THICK, -1.0)
        axes.set_yticks([])
        label_coordinate(axes, f"{shown_name(name)} [{unit}]")
    return axes.figure


def _draw(axes: Axes, y: int, bar: Bar, span: tuple[float, float], scale: float) -> None:
    start, end = (min(max(q, span[0]), span[1]) * scale for q in (bar.start, bar.end))
    fill = ink.LINK_FILLS[bar.colour % len(ink.LINK_FILLS)]
    axes.barh(y, end - start, THICK / 2, start, color=fill, edgecolor=ink.INK, lw=0.6)
    axes.plot([q * scale for q in bar.marks], [y] * len(bar.marks), "|", color=ink.ALARM)
    axes.plot([q * scale for q in bar.chosen], [y] * len(bar.chosen), "o", ms=3, color=ink.INK)
    axes.annotate(
        shown_name(f"{bar.name}: {' to '.join(bar.ends)}", LABEL), (0, y - THICK / 4), (2, 1),
        xycoords=("axes fraction", "data"), textcoords="offset points", va="bottom",
        fontsize=ink.SMALL, in_layout=False,
    )  # fmt: skip
