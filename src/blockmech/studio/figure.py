"""The figure of a mechanism: layers of shapes at all poses, of which the browser shows one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import param

from blockmech.draw.motion import Motion
from blockmech.ground.errors import BlockmechError
from blockmech.ground.values import xy
from blockmech.model.spots import Spot
from blockmech.model.structure import Structure
from blockmech.studio.component import Component, script, style
from blockmech.studio.dragging import handles_of
from blockmech.studio.fields import Shown
from blockmech.studio.film import Layer, Scene, scene_of
from blockmech.studio.plots import PIXELS

SIZE = 560, 300  # [px] of the drawing before the browser says how large it is
SAME = 0.02  # of the scale, within which symbols count as large enough
RING = {"size": 16, "fill_color": "transparent", "line_width": 1.5, "line_dash": "2 2"}
"""Looks of what can be taken hold of."""
EMPTY = {"layers": [], "bounds": None, "samples": 0, "words": "", "unit": 1.0, "middle": [0.0, 0.0]}


class Picture(Component):
    """The mechanism in the browser, which plays it, with sliders and the words below."""

    drawing = param.Dict(default={})
    drivers = param.List(default=[])
    pose = param.Integer(default=0)
    said = param.List(default=[])

    _esm = script("mechanism.js")
    _stylesheets = [style("mechanism.css")]


class MechanismFigure:
    """A mechanism in a picture; ``meant`` gets what is done to it.

    ``unit`` [m] is a point of the screen, ``said`` why nothing can be shown, or "".
    """

    def __init__(self, dark: bool, meant: Callable[[dict[str, Any]], None]) -> None:
        self.dark, self.units = dark, Shown()
        self.handles: dict[str, Spot] = {}
        self.layers: list[Layer] = []
        self.unit, self.said, self.words = 1.0, "", ""
        self.scene: Scene | None = None
        self.seconds = 1.0
        self._scale = 0.0  # [px/m] of the browser, once it has said so
        self.picture = Picture(meant, drawing=self._drawing(), sizing_mode="stretch_both")

    def draw(self, motion: Motion | None, show: Iterable[str], whole: Structure | None) -> None:
        """Draw a motion that closes somewhere, in all its poses; arguments as of `scene_of`."""
        before = self.scene and self.scene.motion.mechanism.name
        self.scene, self.handles = None, {}
        if motion is not None:
            self.scene = scene_of(motion, show, whole)
            if motion.result.motion is None:
                self.handles = handles_of(motion, self.scene.sketch)
            if not self._scale or before != motion.mechanism.name:
                low, high = self.scene.bounds
                apart = (high - low).real / SIZE[0], (high - low).imag / SIZE[1]
                self._scale = 1 / (max(apart) or 1.0)
        self._draw_at(PIXELS / (self._scale or 1.0))

    def scaled(self, scale: float) -> None:
        """Symbols keep their size on a screen of so many pixels a metre."""
        self._scale = scale
        if not math.isclose(PIXELS / scale, self.unit, rel_tol=SAME):
            self._draw_at(PIXELS / scale)

    def _draw_at(self, unit: float) -> None:
        """Compute the shapes of all poses for a point of the screen [m]."""
        self.unit, self.said, self.words, self.layers = unit, "", "", []
        if self.scene is not None:
            try:
                self.layers = [*self.scene.layers(unit, self.dark), self._rings(self.scene.motion)]
                self.words = self.scene.words(unit)
            except BlockmechError as error:  # forces that follow a time nobody said
                self.said = str(error)
        self.picture.drawing = self._drawing()

    def _rings(self, motion: Motion) -> Layer:
        """Rings around what can be taken hold of."""
        names, n = list(self.handles), len(motion.samples)
        places = np.array([motion.at(*spot) for spot in self.handles.values()], complex)
        looks = {**RING, "line_color": "gray"}
        columns = {key: [value] * len(names) for key, value in looks.items()}
        return Layer("scatter", places.reshape(-1, n).T, {**columns, "name": names})

    def _points(self, places: Any) -> Any:
        """Places [m] as points of the screen, x and y in turn."""
        return (places / self.unit).astype(np.complex64, order="C").view("f4")

    def _drawing(self) -> dict[str, Any]:
        """What the browser draws; places are points of the screen around the middle."""
        scene = self.scene
        scales = {"factor": self.units.factor("m"), "length": self.units.length}
        if scene is None:
            return {**EMPTY, **scales, "seconds": 1.0, "forward": True, "held": False}
        low, high = scene.bounds
        middle, motion = (low + high) / 2, scene.motion
        return {
            "layers": [
                {
                    "glyph": layer.glyph,
                    "places": self._points(layer.places - middle),
                    "looks": dict(layer.looks),
                    "starts": list(layer.starts),
                    "offsets": layer.offsets is not None and self._points(layer.offsets),
                    "count": layer.places.shape[1],
                }
                for layer in self.layers
            ],
            "bounds": [xy(low), xy(high)],
            "middle": xy(middle),
            "unit": self.unit,
            "pixels": 1 / PIXELS,
            "samples": len(motion.samples),
            "words": self.words,
            "seconds": self.seconds,
            "forward": bool(motion.result.motion is not None or motion.returns),
            "held": bool(self.handles),
            **scales,
        }
