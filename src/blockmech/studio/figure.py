"""The figure of a mechanism: layers that are put to a pose, and rings to take hold of joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from bokeh.events import RangesUpdate
from bokeh.models import ColumnDataSource, PointDrawTool

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
        super().__init__(dark, self._fit)
        self.dark, self.drag = dark, drag
        self.handles: dict[str, Spot] = {}
        self.unit, self.said = 0.0, ""
        self._scene: Scene | None = None
        self._pose = 0
        self._layers: list[tuple[Layer, Any]] = []
        self._pencil = PointDrawTool(add=False, description="Drag joints")
        self.figure.add_tools(self._pencil)
        self.figure.toolbar.active_drag = self._pencil
        zoomed = heard(self._zoomed)
        self.figure.on_event(RangesUpdate, lambda _: zoomed())

    def draw(self, motion: Motion | None, show: Iterable[str], whole: Structure | None) -> None:
        """Fit the window around a motion that closes somewhere; arguments as of `scene_of`."""
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
            if len(layer.places) > 1:
                columns = layer.at(pose).items()
                source.patch({name: [(slice(None), column)] for name, column in columns})

    def _fit(self) -> None:
        """Fit the window around all that moves, at equal scales."""
        if self._scene is not None:
            self.fit(*self._scene.bounds)
        self._show_at(self.scale * PIXELS)

    def _zoomed(self) -> None:
        """Symbols keep their size on the screen."""
        unit = self.scale * PIXELS
        if not math.isclose(unit, self.unit, rel_tol=1 / self.size[0]):
            self._show_at(unit)

    def _show_at(self, unit: float) -> None:
        """Compute the columns of all poses for a point of the screen [m]."""
        self.unit, self.said, layers = unit, "", []
        if self._scene is not None:
            try:
                layers = [*self._scene.layers(unit, self.dark), self._rings(self._scene.motion)]
            except BlockmechError as error:  # forces that follow a time nobody said
                self.said = str(error)
        known = [(old.glyph, len(old.looks["name"])) for old, _ in self._layers]
        if known != [(layer.glyph, len(layer.looks["name"])) for layer in layers]:
            self.figure.renderers = []
            self._layers = [(layer, self._renderer(layer)) for layer in layers]
            self._pencil.renderers = self.figure.renderers[-1:]
            if layers:
                self._layers[-1][1].on_change("data", self._dropped)
        self._layers = [
            (new, source) for new, (_, source) in zip(layers, self._layers, strict=True)
        ]
        for layer, source in self._layers:
            source.data = {**layer.at(self._pose), **layer.looks}

    def _rings(self, motion: Motion) -> Layer:
        """Rings around what can be taken hold of."""
        names, n = list(self.handles), len(motion.samples)
        places = np.array([motion.at(*spot) for spot in self.handles.values()], complex)
        looks = {**RING, "line_color": coloured(INK, self.dark)}
        columns = {key: [value] * len(names) for key, value in looks.items()}
        return Layer("scatter", places.reshape(-1, n).T, {**columns, "name": names})

    def _renderer(self, layer: Layer) -> Any:
        """A source of a layer's columns, which are drawn."""
        columns = {**layer.at(0), **layer.looks}
        own = {name: name for name in columns if name != "name"}
        source = ColumnDataSource(columns)
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
