"""A mechanism in motion as columns for bokeh: the shapes of `blockmech.draw`, layer by layer.

Everything here is numbers and words; what looks how is declared in `blockmech.draw` alone.
All frames are computed at once, so that playing them is the browser's work.
"""

from __future__ import annotations

import colorsys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw import shapes
from blockmech.draw.animation import SEEN
from blockmech.draw.labels import DIRECTIONS, DISTANCES, LEADER, LINE, NEAR, cheapest
from blockmech.draw.mechanism import paths_of, places_of
from blockmech.draw.motion import Complex, Motion, Spot
from blockmech.draw.page import Paths, Shape
from blockmech.draw.palette import MOST, SIZES, SMALL
from blockmech.draw.paper import shown_name, text_width
from blockmech.draw.shapes import Stage, Vector
from blockmech.draw.sketch import Outline, Sketch, pin_spot, sketch_of
from blockmech.model.structure import JointRef, LinkRef

GLYPHS = {"area": "patches", "line": "multi_line", "disc": "scatter"}
SHOWN = ("paths", "names", "velocities", "reactions", "friction circles")
FONT = "DejaVu Sans, Verdana, sans-serif"
PIXELS = 12 / SMALL  # of the screen in a point of the page: words 12 px high


class Layer(NamedTuple):
    """Shapes of one glyph that lie on one another: places (frames or 1, p), and their looks.

    ``starts`` are where the points of each shape begin, and the end of the last.
    """

    glyph: str
    places: Complex
    starts: tuple[int, ...]
    looks: Mapping[str, list[Any]]

    def at(self, k: int) -> dict[str, Any]:
        """The columns of a bokeh source at frame k."""
        row = self.places[k if len(self.places) > 1 else 0]
        if self.glyph == "scatter":
            return {"x": row.real, "y": row.imag, **self.looks}
        pieces = np.split(row, self.starts[1:-1])
        return {"xs": [z.real for z in pieces], "ys": [z.imag for z in pieces], **self.looks}


@dataclass(frozen=True)
class Scene:
    """What can be shown of a mechanism at all frames, before the size of the window is known.

    ``result`` is the run that the frames are samples of; ``reactions`` and ``velocities``
    are vectors by name, ``radii`` those of friction circles [m].
    """

    motion: Motion
    sketch: Sketch
    paths: Paths
    reactions: Mapping[str, Vector]
    velocities: Mapping[str, Vector]
    radii: Mapping[str, tuple[Spot, float]]

    @property
    def bounds(self) -> tuple[complex, complex]:
        """Lower left and upper right corner [m] of all that moves."""
        z = places_of(self.sketch, self.motion, self.paths)
        return complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max())

    def magnified(self, unit: float) -> float:
        """The power of ten by which friction circles are drawn larger, so that they are seen."""
        largest = max((radius for _, radius in self.radii.values()), default=0.0)
        room = SIZES.couple * unit / largest if largest else 1.0
        return float(10.0 ** max(0, np.floor(np.log10(room))))

    def layers(self, unit: float, dark: bool = False) -> list[Layer]:
        """All shapes as layers, the lowest first; ``unit`` [m] is a point of the screen."""
        stage = Stage(self.sketch, self.motion, unit)
        many = self.magnified(unit)
        found = [
            *shapes.shapes_of(stage),
            *shapes.vectors(stage, self.velocities, ink.FORWARD),
            *shapes.vectors(stage, self.reactions, ink.BACK),
            *shapes.friction_circles(stage, {n: (s, many * r) for n, (s, r) in self.radii.items()}),
        ]
        found += [
            Shape(f"path:{name}", "line", path[:, None], 2, ink.curve_style(i)["color"])
            for i, (name, path) in enumerate(self.paths.items())
        ]
        found.sort(key=lambda shape: shape.order)
        return [
            _layer(GLYPHS[kind], list(together), dark)
            for (kind, _), together in groupby(found, key=lambda s: (s.kind, s.still))
        ]


def scene_of(motion: Motion, show: Iterable[str] = ("paths",)) -> Scene:
    """The scene of a motion that closes somewhere; ``show`` are some of `SHOWN`."""
    sketch, s = sketch_of(motion), motion.structure
    refs = [JointRef(name, j) for name, block in s.blocks.items() for j in block.joints]
    sliders = (slider.point for slider in sketch.sliders)  # in the order of the refs
    found = {r: next(sliders) if s.joint(r).kind == "P" else pin_spot(s, r) for r in refs}
    spots = {ref: spot for ref, spot in found.items() if spot is not None}
    laws = {ref: s.blocks[ref.block].friction.get(ref.name) for ref in spots}
    radii = {str(r): (spots[r], law.factor) for r, law in laws.items() if law and law.radius}
    return Scene(
        motion,
        sketch,
        paths_of(motion, None) if "paths" in show and len(motion.samples) > 1 else {},
        _reactions(motion, spots) if "reactions" in show else {},
        _velocities(motion, sketch) if "velocities" in show else {},
        radii if "friction circles" in show else {},
    )


def _reactions(motion: Motion, spots: Mapping[JointRef, Spot]) -> dict[str, Vector]:
    """Forces of the earlier links on the later ones, friction included."""
    found = motion.result.with_friction("newton").inside(*(f"{ref}.reaction" for ref in spots))
    return {
        f"{r}.reaction": (at, found[f"{r}.reaction"][motion.samples]) for r, at in spots.items()
    }


def _velocities(motion: Motion, sketch: Sketch) -> dict[str, Vector]:
    """Velocities of the pins that move, and of the sliders."""
    fixed = motion.structure.frame_link
    spots = {pin.names[0]: pin.spot for pin in sketch.pins if not pin.grounded}
    spots |= {slider.name: slider.point for slider in sketch.sliders}
    spots = {name: spot for name, spot in spots.items() if spot.link != fixed}
    links = {spot.link for spot in spots.values()}
    found = motion.result.inside(*(f"{link}.{x}" for link in links for x in ("v", "omega")))

    def velocity(link: LinkRef, at: complex) -> Complex:
        v, omega = (found[f"{link}.{x}"][motion.samples] for x in ("v", "omega"))
        return np.asarray(v + 1j * omega * motion.axis[link] * at)

    return {f"{name}.v": (spot, velocity(*spot)) for name, spot in spots.items()}


def _layer(glyph: str, found: list[Shape], dark: bool) -> Layer:
    """Shapes of one glyph as one layer; what is not there in a frame is NaN."""
    rows = [np.where(np.isfinite(s.points).all(axis=0), s.points, np.nan).T for s in found]
    frames = max(map(len, rows))
    places = np.concatenate([np.broadcast_to(r, (frames, r.shape[1])) for r in rows], axis=1)
    starts = np.cumsum([0, *(len(s.points) for s in found)])
    stroke = [coloured(s.stroke, dark) for s in found]
    looks: dict[str, list[Any]] = {
        "line_width": [s.width * PIXELS for s in found],
        "line_color": stroke,
        "name": [s.what for s in found],
    }
    if glyph == "multi_line":
        looks["line_cap"] = ["round" if s.rounded else "butt" for s in found]
        looks["line_dash"] = [
            " ".join(f"{PIXELS * x:.0f}" for x in s.dash) or "solid" for s in found
        ]
    else:
        looks["fill_color"] = [coloured(s.fill, dark) if s.fill else "transparent" for s in found]
    if glyph == "scatter":
        looks["size"] = [2 * s.radius * PIXELS for s in found]
    return Layer(glyph, places, tuple(starts.tolist()), looks)


def coloured(colour: str, dark: bool) -> str:
    """A colour of the palette, or on a dark page the one in which ink and paper have swapped."""
    if not dark:
        return colour
    hue, lightness, saturation = _hls(colour)
    swapped = colorsys.hls_to_rgb(hue, 1 - lightness * (1 - _hls(ink.INK)[1]), saturation)
    return "#" + "".join(f"{round(255 * x):02X}" for x in swapped)


def _hls(colour: str) -> tuple[float, float, float]:
    return colorsys.rgb_to_hls(*(x / 255 for x in bytes.fromhex(colour[1:])))


# -- names ---------------------------------------------------------------------------------


class Name(NamedTuple):
    """A name beside a joint or a load: its text, colour and places (frames,) [m]."""

    text: str
    colour: str
    places: Complex


def names_of(scene: Scene, unit: float) -> list[Name]:
    """Names of joints and loads where the least of links and other names lies under them.

    Only where there are few enough to be read.
    """
    motion, sketch = scene.motion, scene.sketch
    wanted = [(" = ".join(map(shown_name, p.names)), ink.INK, p.spot) for p in sketch.pins]
    wanted += [(shown_name(s.name), ink.INK, s.point) for s in sketch.sliders]
    middles = {body.link: body.middle for body in sketch.bodies}
    for load in sketch.loads:
        spot = load.spots[0]
        spot = middles.get(spot.link, spot) if load.kind == "couple" else spot
        wanted.append((shown_name(load.name), ink.LOAD, spot))
    if len(wanted) >= MOST:
        return []
    frames = np.unique(np.linspace(0, len(motion.samples) - 1, SEEN).astype(int))
    solid = [_drawn(motion, body.link, body.outline)[:, frames] / unit for body in sketch.bodies]
    taken = [np.concatenate(solid or [np.full((1, len(frames)), np.nan + 0j)])]
    found = []
    for text, colour, spot in wanted:
        half = complex(text_width(text, SMALL), LINE) / 2
        reach = DISTANCES[:2, None] + SIZES.slider[1]
        c, up = DIRECTIONS.real, DIRECTIONS.imag
        x, y = c * (reach + half.real * np.sqrt(np.abs(c))), up * (reach + half.imag)
        offsets = (x + 1j * y).ravel()
        anchor = motion.at(*spot)
        centres = anchor[frames] / unit + offsets[:, None]
        room = half + (SIZES.link / 2) * (1 + 1j)
        apart = np.concatenate(taken) - centres[:, None]
        with np.errstate(invalid="ignore"):
            under = (np.abs(apart.real) < room.real) & (np.abs(apart.imag) < room.imag)
        _, way = cheapest(LEADER * under.sum(axis=1).T + NEAR * np.abs(offsets), offsets)
        every = np.interp(np.arange(len(anchor)), frames, offsets[way])
        grid = np.linspace(-1, 1, 5)[:, None] * half.real + 1j * half.imag * np.array([-1, 0, 1])
        taken.append(np.repeat(grid.ravel()[:, None] + anchor[frames] / unit + offsets[way], 4, 0))
        found.append(Name(text, colour, anchor + every * unit))
    return found


def _drawn(motion: Motion, link: LinkRef, outline: Outline) -> Complex:
    """Points (p, n) [m] that stand for a link in search of free places."""
    corners = np.array([*outline, outline[0]], complex)
    t = np.linspace(0, 1, len(DIRECTIONS))
    along = corners[:-1, None] + np.diff(corners)[:, None] * t
    return motion.at(link, np.asarray(along.ravel(), complex))


def dress(plot: Any, dark: bool) -> None:
    """Give a figure the colours of the palette."""
    line, paper, pale = (coloured(c, dark) for c in (ink.INK, ink.PAPER, ink.PALE))
    plot.background_fill_color = plot.border_fill_color = paper
    plot.outline_line_color = line
    plot.grid.grid_line_color = pale
    plot.axis.axis_line_color = plot.axis.major_tick_line_color = line
    plot.axis.minor_tick_line_color = None
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = line
    plot.axis.axis_label_text_font = plot.axis.major_label_text_font = FONT
    plot.axis.axis_label_text_font_style = "normal"
    plot.toolbar.logo, plot.toolbar.autohide = None, True
    if plot.legend:
        plot.legend.label_text_font = FONT
        plot.legend.background_fill_color = paper
        plot.legend.label_text_color = line
        plot.legend.border_line_color = None
        plot.legend.update(ncols=2, label_text_font_size="11px", padding=0, spacing=10, margin=2)
        plot.add_layout(plot.legend[0], "above")
