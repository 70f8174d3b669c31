"""Curves over the samples of a run as bokeh figures, with a cursor that goes with the pose."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import panel as pn
from bokeh.events import Tap
from bokeh.layouts import column
from bokeh.models import BoxAnnotation, ColumnDataSource, Label, Span
from bokeh.plotting import figure

from blockmech.draw.motion import Motion
from blockmech.figures import palette as ink
from blockmech.figures.curves import chosen_panels, without_friction
from blockmech.figures.panels import WITHOUT, Abscissa, Panel
from blockmech.figures.paper import scaled_unit, shown_name
from blockmech.result.result import Result
from blockmech.studio.plots import FONT, coloured, dress
from blockmech.studio.session import heard

CURVE = 192  # [px] height of a figure: one stands in the drawer as a whole
WIDE = {"sizing_mode": "stretch_width"}
Seek = Callable[[float], None]


def panels_of(result: Result, names: Iterable[str]) -> list[Panel]:
    """The named outputs by quantity and unit, forces without friction beside them.

    Raises `RequestError` where there are none, or too many for a picture.
    """
    bare: dict[tuple[str, str], Panel] = {}
    twin = without_friction(result)
    if twin is not None:
        bare = {(p.quantity, p.unit): p for p in chosen_panels(twin, twin)}
    panels = []
    for panel in chosen_panels(result, names):
        beside = bare.get((panel.quantity, panel.unit))
        panels.append(panel if beside is None else replace(panel, without=beside.curves))
    return panels


def margins_of(motion: Motion) -> Panel:
    """The margin of every group: 0 at a dead centre, below where it cannot close."""
    name_of = motion.mechanism._block_name
    return Panel("margin", "", {name_of(block): m for block, m in motion.quality.margin.items()})


class Plot:
    """The figure of a panel, with a cursor; it stays while the same curves are shown.

    ``seek`` is called with the place on the axis that somebody taps.
    """

    def __init__(self, panel: Panel, dark: bool, seek: Seek, **look: Any) -> None:
        self.dark, self.curves = dark, labels_of(panel)
        self.figure = figure(**WIDE, **look)
        self.figure.on_event(Tap, lambda tap: heard(lambda: seek(tap.x))())
        self.cursor = Span(dimension="height", line_color=coloured(ink.ALARM, dark), line_width=1)
        self.figure.add_layout(self.cursor)
        self.fixed = list(self.figure.center)
        styles = [ink.curve_style(i % len(panel.curves)) for i in range(len(self.curves))]
        self.source = ColumnDataSource(
            {
                **{axis: [[]] * len(styles) for axis in ("xs", "ys")},
                "name": self.curves,
                "line_color": [coloured(style["color"], dark) for style in styles],
                "line_dash": [" ".join(f"{4 * x:.0f}" for x in s["dashes"]) for s in styles],
                "line_width": [2] * len(panel.curves) + [1] * len(panel.without),
            }
        )
        looks = {name: name for name in self.source.data if name != "name"}
        if "tooltips" not in look:  # else a pointer on a curve is told its name
            looks["legend_field"] = "name"
        self.figure.multi_line(**looks, source=self.source)
        dress(self.figure, dark)

    def show(self, panel: Panel, along: Abscissa, gaps: Iterable[tuple[int, int]]) -> None:
        """Draw the values; gaps, first and last sample, are hatched, events named."""
        low, high = panel.shown
        factor, unit = scaled_unit(panel.unit, max(abs(low), abs(high)))
        rows = [factor * y for y in (*panel.curves.values(), *panel.without.values())]
        self.source.data = {**self.source.data, "xs": [along.values] * len(rows), "ys": rows}
        self.figure.xaxis.axis_label = along.words
        self.figure.yaxis.axis_label = f"{panel.quantity} [{unit or '–'}]"
        marks = [self._box(along.values, *gap) for gap in gaps]
        marks += [m for k, event in enumerate(along.events) for m in self._mark(*event, k % 3)]
        if marks or len(self.figure.center) > len(self.fixed):
            self.figure.center = [*self.fixed, *marks]

    def _box(self, x: Any, first: int, last: int) -> BoxAnnotation:
        ends = float(x[max(first - 1, 0)]), float(x[min(last + 1, len(x) - 1)])
        look = {"fill_alpha": 0.3, "hatch_pattern": "/", "hatch_alpha": 0.4, "line_dash": "dashed"}
        colours = {"fill_color": ink.PALE, "hatch_color": ink.GREY, "line_color": ink.ALARM}
        look |= {name: coloured(colour, self.dark) for name, colour in colours.items()}
        return BoxAnnotation(left=min(ends), right=max(ends), **look)

    def _mark(self, x: float, words: str, row: int) -> tuple[Span, Label]:
        """A dead centre: a line, and its name beside it; neighbours in rows of their own."""
        colour = coloured(ink.GREY, self.dark)
        line = Span(dimension="height", location=x, line_color=colour, line_dash="dotted")
        name = Label(
            x=x, y=2 + 13 * row, y_units="screen", text=words, x_offset=3, text_color=colour,
            text_font=FONT, text_font_size="11px",
        )  # fmt: skip
        return line, name


class Plots:
    """The figures of some panels, one below the other; arguments as of `Plot`."""

    def __init__(self, dark: bool, seek: Seek, **look: Any) -> None:
        self.dark, self.seek, self.look = dark, seek, {"height": CURVE, **look}
        self.drawn: list[Plot] = []
        self.pane = pn.pane.Bokeh(column(**WIDE), **WIDE)

    def show(self, panels: list[Panel], along: Abscissa, gaps: list[tuple[int, int]]) -> None:
        """Draw panels, in new figures only where there are other curves than before."""
        if [labels_of(panel) for panel in panels] != [plot.curves for plot in self.drawn]:
            self.drawn = [Plot(p, self.dark, self.seek, **self.look) for p in panels]
            self.pane.object = column(*(plot.figure for plot in self.drawn), **WIDE)
        for plot, panel in zip(self.drawn, panels, strict=True):
            plot.show(panel, along, gaps)
        self.pane.visible = bool(panels)

    def point(self, x: float) -> None:
        """Put all cursors to a place."""
        for plot in self.drawn:
            plot.cursor.location = float(x)


def labels_of(panel: Panel) -> list[str]:
    """The curves as a legend names them."""
    shown = [shown_name(name) or panel.quantity for name in panel.curves]
    return shown + [WITHOUT for _ in panel.without]  # thin lines, named once
