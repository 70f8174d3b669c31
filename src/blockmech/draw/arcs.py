"""Pictures of where a mechanism closes: the arcs of limits and of assembly modes as bars."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from blockmech.analysis.limits import Limits
from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, shown_name
from blockmech.draw.sensitivity import THICK
from blockmech.ground.errors import refused
from blockmech.modes.report import Arc, GroupModes, Modes


class Bar(NamedTuple):
    """A stretch of a driver's coordinate [rad or m]: what ends it, and places that are marked."""

    name: str
    start: float
    end: float
    ends: tuple[str, str]
    marks: tuple[float, ...] = ()
    chosen: tuple[float, ...] = ()
    colour: int = 0


def limits_figure(limits: Limits, degrees: bool) -> Any:
    """The feasible arcs as bars."""
    bars = [
        Bar(f"arc {n}", a.start.q, a.end.q, (str(a.start), str(a.end)), _places(a))
        for n, a in enumerate(limits.arcs, start=1)
    ]
    caption = f"{limits.sentence()}."
    return _figure(bars, limits._q(limits.driver), limits.unit, caption, degrees)


def modes_figure(modes: Modes, degrees: bool) -> Any:
    """The arcs of all groups as bars, those of a circuit in one colour."""
    bars = [bar for group in modes.groups for bar in _of_group(modes, group)]
    caption = "Modes of one colour connect through dead centres; the dot: the file's mode."
    unit = modes.units.get(modes.driver, "")
    return _figure(bars, f"{modes.prefix}{modes.driver}.q", unit, caption, degrees)


def _places(arc: Any) -> tuple[float, ...]:
    return tuple(point.q for point in arc.change_points)


def _of_group(modes: Modes, group: GroupModes) -> Iterator[Bar]:
    at = modes.drivers[modes.driver] if group.arcs else ()
    for n, arc in enumerate(group.arcs):
        branch = "" if arc.branch is None else f", branch {arc.branch:+d}"
        chosen = (
            q for q, modes_here in zip(at, group.samples, strict=True)
            if any(mode.chosen and mode.arc == n for mode in modes_here)
        )  # fmt: skip
        yield Bar(
            f"{shown_name(group.group)}: arc {n + 1}{branch}",
            arc.start.q,
            arc.end.q,
            (arc.start.how, arc.end.how),
            arc.change_points,
            tuple(_on(q, arc, modes.units[modes.driver] == "rad") for q in chosen),
            arc.circuit,
        )


def _on(q: float, arc: Arc, rotary: bool) -> float:
    """A coordinate where an arc passes it, which may be whole turns away."""
    middle = (arc.start.q + arc.end.q) / 2
    return q + math.tau * round((middle - q) / math.tau) if rotary else q


def _figure(bars: Sequence[Bar], name: str, unit: str, caption: str, degrees: bool) -> Any:
    """Bars over a coordinate, a column wide, each with what ends it."""
    if not bars:
        raise refused(shown_name(name), "there is no arc to draw", code="nothing-to-draw")
    turned = degrees and unit == "rad"
    scale, unit = (180 / math.pi, "°") if turned else (1.0, unit)
    more = len(bars) - ink.MOST
    caption += f" {more} more are not drawn." if more > 0 else ""
    rows = 3 * len(bars[: ink.MOST]) + 4  # words, bar and air; axis
    with captioned(caption, rows * ink.ROW) as figure:
        axes = figure.subplots()
        axes.use_sticky_edges = False
        # What is shown: all finite ends; of bars that nothing ends a unit about zero.
        ends = [q for bar in bars for q in (bar.start, bar.end) if math.isfinite(q)] or [-1.0, 1.0]
        low, high = min(ends), max(ends)
        for y, bar in enumerate(bars[: ink.MOST]):
            _draw(axes, y, bar, (low, high), scale)
        axes.set_ylim(len(bars[: ink.MOST]) - 1 + THICK, -1.0)
        axes.set_yticks([])
        axes.set_xlabel(f"{shown_name(name)} [{unit}]", labelpad=1)
        axes.grid(True, axis="x")
    return figure


def _draw(axes: Any, y: int, bar: Bar, shown: tuple[float, float], scale: float) -> None:
    start, end = (min(max(q, shown[0]), shown[1]) * scale for q in (bar.start, bar.end))
    fill = ink.LINK_FILLS[bar.colour % len(ink.LINK_FILLS)]
    axes.barh(y, end - start, THICK / 2, start, color=fill, edgecolor=ink.INK, lw=0.6)
    axes.plot([q * scale for q in bar.marks], [y] * len(bar.marks), "|", color=ink.ALARM)
    axes.plot([q * scale for q in bar.chosen], [y] * len(bar.chosen), "o", ms=3, color=ink.INK)
    axes.annotate(
        f"{bar.name}: {' to '.join(bar.ends)}", (0, y - THICK / 4), (2, 1),
        xycoords=("axes fraction", "data"), textcoords="offset points", va="bottom",
        fontsize=ink.SMALL,
    )  # fmt: skip
