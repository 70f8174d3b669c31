"""A mechanism in motion as columns: the shapes of `blockmech.draw`, layer by layer.

Everything here is numbers and words; what looks how is declared in `blockmech.draw` alone.
All samples are computed at once, so that a pose is a row of columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from blockmech.draw import shapes
from blockmech.draw.animation import SEEN
from blockmech.draw.labels import DIRECTIONS, DISTANCES, LEADER, LINE, NEAR, cheapest
from blockmech.draw.mechanism import paths_of, places_of
from blockmech.draw.motion import SAME_PLACE, Complex, Motion
from blockmech.draw.page import Paths, Shape
from blockmech.draw.shapes import Stage
from blockmech.draw.sketch import Outline, Sketch, sketch_of
from blockmech.figures import palette as ink
from blockmech.figures.palette import MOST, SIZES, SMALL
from blockmech.figures.paper import shown_name, text_width
from blockmech.model.spots import Spot, marker_place, pin_spot
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.studio.plots import PIXELS, coloured

MARK = 3  # points of a shape, more than which are worth to be sent once for all samples
PIVOT = -1j * np.array([4.0, 7.0, 10.0, 13.0])[:, None]  # [pt] places of a ground's below its pin
GLYPHS = {"area": "patches", "line": "multi_line", "disc": "scatter"}


def glyph_of(shape: Shape) -> str:
    """What a shape is drawn with; a bar with round ends is an area without width.

    So links of two pins and of more lie on one another within one layer.
    """
    return "patches" if shape.rounded else GLYPHS[shape.kind]


class Layer(NamedTuple):
    """Shapes of one glyph that lie on one another: places (samples or 1, p), and their looks.

    ``starts`` are where the points of each shape begin, and the end of the last; empty for
    glyphs of one point each. Shapes that never turn have one place each, and ``offsets`` (p,)
    of their points from it.
    """

    glyph: str
    places: Complex
    looks: Mapping[str, list[Any]]
    starts: tuple[int, ...] = ()
    offsets: Complex | None = None


@dataclass(frozen=True)
class Scene:
    """What is shown of a mechanism at all samples, before the size of the window is known.

    ``show`` are some of `SHOWN`; ``whole`` is the structure of which the motion is a part.
    """

    motion: Motion
    sketch: Sketch
    paths: Paths
    show: tuple[str, ...]
    whole: Structure

    @property
    def bounds(self) -> tuple[complex, complex]:
        """Lower left and upper right corner [m] of all that moves."""
        z = places_of(self.sketch, self.motion, self.paths)
        return complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max())

    def words(self, unit: float) -> str:
        """What is not as large as it is drawn."""
        if "friction circles" not in self.show:
            return ""
        stage = Stage(self.sketch, self.motion, unit)
        radii = _friction_radii(stage)
        many = shapes.friction_scale(stage, radii)
        return f"friction circles {many} times as large" if radii else "no pin has friction"

    def layers(self, unit: float, dark: bool = False) -> list[Layer]:
        """All shapes as layers, the lowest first; ``unit`` [m] is a point of the screen."""
        stage = Stage(self.sketch, self.motion, unit)
        shown = [*shapes.shapes_of(stage), *_gaps(self.motion, self.whole)]
        for name, shapes_for in ON_REQUEST.items():
            shown += shapes_for(stage) if name in self.show else ()
        shown += [
            Shape(f"path:{name}", "line", path[piece, None], 2, ink.curve_style(i)["color"])
            for i, (name, path) in enumerate(self.paths.items())
            for piece in np.ma.clump_unmasked(np.ma.masked_invalid(path))  # type: ignore[no-untyped-call]
        ]
        shown.sort(key=lambda shape: (shape.order, shape.still, glyph_of(shape)))
        kinds = groupby(shown, key=lambda s: (glyph_of(s), s.still, _carried(s)))
        layers = [_layer(*kind[::2], list(together), dark) for kind, together in kinds]
        return [*layers, names_of(stage, dark)] if "names" in self.show else layers


def scene_of(
    motion: Motion, show: Iterable[str] = ("paths",), whole: Structure | None = None
) -> Scene:
    """The scene of a motion that closes somewhere."""
    paths = paths_of(motion, None) if "paths" in show and len(motion.samples) > 1 else {}
    return Scene(motion, sketch_of(motion), paths, tuple(show), whole or motion.structure)


def _gaps(motion: Motion, whole: Structure) -> Iterator[Shape]:
    """Lines between the places that a group should join, in the poses in which it cannot."""
    for name in whole.blocks:
        ends = [m for ref, m in whole.feeds.items() if ref.block == name and m.on in motion.origin]
        if len(ends) > 1:
            points = np.array([motion.at(m.on, marker_place(whole, m)) for m in ends])
            own = [axis for link, axis in motion.axis.items() if link.block == name]
            points = np.where(np.isfinite(own).any(axis=0) if own else False, np.nan, points)
            if np.isfinite(points).all(axis=0).any():
                yield Shape(f"gap:{name}", "line", points, 8, ink.ALARM, width=1.5, dash=(3, 2))


def _joints(stage: Stage) -> dict[JointRef, Spot]:
    """Where the pairs are."""
    s, sliders = stage.motion.structure, (slider.point for slider in stage.sketch.sliders)
    refs = [JointRef(name, j) for name, block in s.blocks.items() for j in block.joints]
    spots = {r: next(sliders) if s.joint(r).kind == "P" else pin_spot(s, r) for r in refs}
    return {ref: spot for ref, spot in spots.items() if spot is not None}


def _reactions(stage: Stage) -> Iterator[Shape]:
    """Forces of the earlier links on the later ones, friction included."""
    motion, names = stage.motion, {f"{r}.reaction": spot for r, spot in _joints(stage).items()}
    outputs = motion.result.with_friction("newton")._inside(*names)
    forces = {name: (spot, outputs[name][motion.samples]) for name, spot in names.items()}
    return shapes.vectors(stage, forces, ink.BACK)


def _velocities(stage: Stage) -> Iterator[Shape]:
    """Velocities of the pins that move, and of the sliders."""
    motion, sketch = stage.motion, stage.sketch
    spots = {pin.names[0]: pin.spot for pin in sketch.pins if not pin.grounded}
    spots |= {slider.name: slider.point for slider in sketch.sliders}
    links = {spot.link for spot in spots.values()} - {motion.structure.frame_link}
    outputs = motion.result._inside(*(f"{link}.{x}" for link in links for x in ("v", "omega")))

    def velocity(link: LinkRef, at: complex) -> Complex:
        v, omega = (outputs[f"{link}.{x}"][motion.samples] for x in ("v", "omega"))
        return np.asarray(v + 1j * omega * motion.axis[link] * at)

    moving = {n: (spot, velocity(*spot)) for n, spot in spots.items() if spot.link in links}
    return shapes.vectors(stage, moving, ink.FORWARD)


def _friction_radii(stage: Stage) -> dict[str, tuple[Spot, float]]:
    """Pins with friction, and the radii of its circles [m]."""
    blocks, spots = stage.motion.structure.blocks, _joints(stage)
    laws = {ref: blocks[ref.block].friction.get(ref.name) for ref in spots}
    radii = {ref: law.at_rest().factor for ref, law in laws.items() if law}
    pins = (ref for ref in radii if blocks[ref.block].joints[ref.name].kind == "R")
    return {str(ref): (spots[ref], radii[ref]) for ref in pins if radii[ref]}


def _circles(stage: Stage) -> Iterator[Shape]:
    return shapes.friction_circles(stage, _friction_radii(stage))


ON_REQUEST = {"velocities": _velocities, "reactions": _reactions, "friction circles": _circles}
SHOWN = ("paths", "names", *ON_REQUEST)


def _carried(shape: Shape) -> bool:
    """Whether a shape of several points moves and never turns, as a mark does."""
    if shape.still or len(shape.points) <= MARK:
        return False
    offsets = _offsets(shape)
    apart = np.abs(shape.points - shape.points[0] - offsets[:, None])
    return not (apart > SAME_PLACE * np.abs(offsets).max()).any()


def _offsets(shape: Shape) -> Complex:
    """Points (p,) from the first one, in the first sample in which all are there."""
    k = np.isfinite(shape.points).all(axis=0).argmax()
    return np.asarray(shape.points[:, k] - shape.points[0, k])


def _layer(glyph: str, carried: bool, shown: list[Shape], dark: bool) -> Layer:
    """Shapes of one glyph as one layer; what is not there in a frame is NaN."""
    points = [s.points[: 1 if carried else None] for s in shown]
    rows = [np.where(np.isfinite(z).all(axis=0), z, np.nan).T for z in points]
    frames = max(map(len, rows))
    places = np.concatenate([np.broadcast_to(r, (frames, r.shape[1])) for r in rows], axis=1)
    starts = np.cumsum([0, *(len(s.points) for s in shown)])
    offsets = np.concatenate([*map(_offsets, shown)]) if carried else None
    looks: dict[str, list[Any]] = {
        "line_width": [s.width * PIXELS for s in shown],
        "line_color": [coloured(s.stroke, dark) for s in shown],
        "line_dash": [" ".join(f"{PIXELS * x:.0f}" for x in s.dash) or "solid" for s in shown],
        "name": [s.what for s in shown],
    }
    if glyph != "multi_line":
        looks["fill_color"] = [coloured(s.fill, dark) if s.fill else "transparent" for s in shown]
    if glyph == "scatter":
        looks["size"] = [2 * s.radius * PIXELS for s in shown]
    begin = () if glyph == "scatter" else tuple(starts.tolist())
    return Layer(glyph, places, looks, begin, offsets)


# -- names ---------------------------------------------------------------------------------


def names_of(stage: Stage, dark: bool = False) -> Layer:
    """Names of joints and loads where the least of links and other names lies under them.

    Only where there are few enough to be read.
    """
    motion, sketch, unit = stage.motion, stage.sketch, stage.unit
    wanted = [(" = ".join(map(shown_name, p.names)), ink.INK, p.spot) for p in sketch.pins]
    wanted += [(shown_name(s.name), ink.INK, s.point) for s in sketch.sliders]
    middles = {body.link: body.middle for body in sketch.bodies}
    for load in sketch.loads:
        spot = load.spots[0]
        spot = middles.get(spot.link, spot) if load.kind == "couple" else spot
        wanted.append((shown_name(load.name), ink.LOAD, spot))
    wanted = wanted if len(wanted) < MOST else []
    frames = np.unique(np.linspace(0, len(motion.samples) - 1, SEEN).astype(int))
    solid = [_drawn(motion, body.link, body.outline)[:, frames] / unit for body in sketch.bodies]
    solid += [motion.at(*p.spot)[frames] / unit + PIVOT for p in sketch.pins if p.grounded]
    taken = np.concatenate([np.full((1, len(frames)), np.nan + 0j), *solid])
    weights = np.ones(len(taken))
    places = np.zeros((len(motion.samples), len(wanted)), complex)
    for i, (text, _, spot) in enumerate(wanted):
        half = complex(text_width(text, SMALL), LINE) / 2
        reach = DISTANCES[:2, None] + SIZES.slider[1]
        c, up = DIRECTIONS.real, DIRECTIONS.imag
        x, y = c * (reach + half.real * np.sqrt(np.abs(c))), up * (reach + half.imag)
        offsets = (x + 1j * y).ravel()
        anchor = motion.at(*spot)
        room = half + (SIZES.link / 2) * (1 + 1j)
        under = _under(taken - anchor[frames] / unit, weights, offsets, room)
        _, way = cheapest(LEADER * under + NEAR * np.abs(offsets), offsets)
        every = np.interp(np.arange(len(anchor)), frames, offsets[way])
        grid = np.linspace(-1, 1, 5)[:, None] * half.real + 1j * half.imag * np.array([-1, 0, 1])
        own = grid.ravel()[:, None] + anchor[frames] / unit + offsets[way]
        taken, weights = np.concatenate([taken, own]), np.append(weights, np.full(len(own), 4.0))
        places[:, i] = anchor + every * unit
    texts, colours = [text for text, *_ in wanted], [coloured(c, dark) for _, c, _ in wanted]
    return Layer("text", places, {"text": texts, "text_color": colours, "name": texts})


def _under(taken: Complex, weights: Any, offsets: Complex, room: complex) -> Any:
    """What lies under a name at each of some offsets from its anchor: weights (frames, offsets).

    Of what is taken (p, frames), from the anchor, most is farther than any name reaches.
    """
    point, frame = np.nonzero(np.abs(taken) < np.abs(offsets).max() + abs(room))
    apart = taken[point, frame] - offsets[:, None]
    at, hit = np.nonzero((np.abs(apart.real) < room.real) & (np.abs(apart.imag) < room.imag))
    under = np.zeros((taken.shape[1], len(offsets)))
    np.add.at(under, (frame[hit], at), weights[point[hit]])
    return under


def _drawn(motion: Motion, link: LinkRef, outline: Outline) -> Complex:
    """Points (p, n) [m] that stand for a link in search of free places."""
    corners = np.array([*outline, outline[0]], complex)
    t = np.linspace(0, 1, len(DIRECTIONS))
    along = corners[:-1, None] + np.diff(corners)[:, None] * t
    return motion.at(link, np.asarray(along.ravel(), complex))
