"""The figure of a mechanism: layers that are put to a pose, and rings to take hold of joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from bokeh.events import RangesUpdate
from bokeh.models import ColumnDataSource, Label, PointDrawTool

from blockmech.draw.motion import Motion, Spot
from blockmech.draw.palette import INK
from blockmech.errors import BlockmechError
from blockmech.model.structure import Structure
from blockmech.studio.dragging import handles_of
from blockmech.studio.film import Layer, Scene, scene_of
from blockmech.studio.plots import FONT, PIXELS, coloured
from blockmech.studio.session import heard
from blockmech.studio.window import Window

ALWAYS: dict[str, dict[str, Any]] = {
    "patches": {"line_join": "round"},
    "multi_line": {"line_join": "round"},
    "scatter": {},
    "text": {
        "text_font": {"value": FONT}, "text_font_size": "12px", "text_align": "center",
        "text_baseline": "middle",
    },
}  # fmt: skip
"""Looks that all shapes of a glyph have."""
RING = {"size": 16, "fill_color": "transparent", "line_width": 1.5, "line_dash": "dotted"}
"""Looks of what can be taken hold of."""


class MechanismFigure(Window):
    """Axes with a mechanism in them; ``drag`` is called with what is dragged, and where to [m].

    ``unit`` [m] is a point of the screen, ``said`` why nothing can be shown, or "".
    """

    def __init__(self, dark: bool, drag: Callable[[str, complex], None]) -> None:
        super().__init__(dark, self._sized)
        self.dark, self.drag = dark, drag
        self.handles: dict[str, Spot] = {}
        self.unit, self.said = 0.0, ""
        self._scene: Scene | None = None
        self._pose, self._fresh = 0, False
        self._layers: list[tuple[Layer, Any]] = []
        self._words = Label(
            x=4, y=4, x_units="screen", y_units="screen", text="", text_font=FONT,
            text_font_size="12px", text_color=coloured(INK, dark),
        )  # fmt: skip
        self.figure.add_layout(self._words)
        self._pencil = PointDrawTool(add=False, description="Drag joints")
        self.figure.add_tools(self._pencil)
        self.figure.toolbar.active_drag = self._pencil
        zoomed = heard(self._zoomed)
        self.figure.on_event(RangesUpdate, lambda _: zoomed())

    def draw(self, motion: Motion | None, show: Iterable[str], whole: Structure | None) -> None:
        """Fit the window around a motion that closes somewhere; arguments as of `scene_of`.

        It is seen when a pose is put, after all words: bokeh paints at once where these need
        other room, and cannot paint sources whose number of shapes it is about to change.
        """
        self._scene, self.handles = None, {}
        if motion is not None:
            self._scene = scene_of(motion, show, whole)
            if motion.result.motion is None:
                self.handles = handles_of(motion, self._scene.sketch)
        self._fit()

    def put(self, pose: int) -> None:
        """Show a pose."""
        self._pose = pose
        for layer, source in self._layers:
            if self._fresh:
                source.data = {**layer.at(pose), **layer.looks}
            elif len(layer.places) > 1:
                columns = layer.at(pose).items()
                source.patch({name: [(slice(None), column)] for name, column in columns})
        self._fresh = False

    def _fit(self) -> None:
        """Fit the window around all that moves, at equal scales."""
        if self._scene is not None:
            self.fit(*self._scene.bounds)
        self._draw_at(self.scale * PIXELS)

    def _sized(self) -> None:
        self._fit()
        self.put(self._pose)

    def _zoomed(self) -> None:
        """Symbols keep their size on the screen."""
        unit = self.scale * PIXELS
        if not math.isclose(unit, self.unit, rel_tol=1 / self.size[0]):
            self._draw_at(unit)
            self.put(self._pose)

    def _draw_at(self, unit: float) -> None:
        """Compute the columns of all poses for a point of the screen [m]."""
        self.unit, self.said, self._fresh, layers = unit, "", True, []
        if self._scene is not None:
            try:
                layers = [*self._scene.layers(unit, self.dark), self._rings(self._scene.motion)]
                self._words.text = self._scene.words(unit)
            except BlockmechError as error:  # forces that follow a time nobody said
                self.said = str(error)
        sources = [source for _, source in self._layers]
        if [old.glyph for old, _ in self._layers] != [layer.glyph for layer in layers]:
            self.figure.renderers = []
            sources = [self._source(layer) for layer in layers]
            self._pencil.renderers = self.figure.renderers[-1:]
            if sources:
                sources[-1].on_change("data", self._dropped)
        self._layers = list(zip(layers, sources, strict=True))

    def _rings(self, motion: Motion) -> Layer:
        """Rings around what can be taken hold of."""
        names, n = list(self.handles), len(motion.samples)
        places = np.array([motion.at(*spot) for spot in self.handles.values()], complex)
        looks = {**RING, "line_color": coloured(INK, self.dark)}
        columns = {key: [value] * len(names) for key, value in looks.items()}
        return Layer("scatter", places.reshape(-1, n).T, {**columns, "name": names})

    def _source(self, layer: Layer) -> Any:
        """A source for a layer's columns, which are drawn."""
        source = ColumnDataSource({**layer.at(0), **layer.looks})
        own = {name: name for name in source.data if name != "name"}
        getattr(self.figure, layer.glyph)(source=source, **own, **ALWAYS[layer.glyph])
        return source

    def _dropped(self, attr: str, old: Any, new: Any) -> None:
        """A ring was dragged in the browser, or a pose is shown."""
        shown = self._layers[-1][0].at(self._pose)
        columns = (new["name"], shown["x"], shown["y"], new["x"], new["y"])
        for name, x0, y0, x, y in zip(*columns, strict=True):
            if abs(complex(x - x0, y - y0)) > self.unit:  # a click moves nothing
                self.drag(name, complex(x, y))
                return
