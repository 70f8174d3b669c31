"""The shapes of a mechanism at all samples of a motion: lines, areas and discs, for any pen.

The printed picture, the GIF and the player in a browser draw the same list. Places
are in metres on the ground; widths, and radii of symbols, are in points of the page,
so links look the same whatever the size of the mechanism.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from blockmech.draw.motion import Motion
from blockmech.draw.page import Shape
from blockmech.draw.sketch import LEAD, LoadMark, Sketch, Slider
from blockmech.figures import palette as ink
from blockmech.figures.palette import SIZES, TEXT
from blockmech.ground.tolerances import BLUR
from blockmech.model.joints.dimensions import Length
from blockmech.model.spots import Spot, pin_spot
from blockmech.typing import Arguments, Real, Vectors

Vector: TypeAlias = tuple[Spot, Vectors]
"""Where something acts, and its values (n,)."""
DISTANCE = 1.75 * TEXT  # [pt] of a dimension's line from what it measures
FAINT = ("#F1F1F1", "#BDBDBD")  # fill and edge of further poses


@dataclass(frozen=True)
class Stage:
    """A mechanism ready to be drawn; ``unit`` [m/pt] is the size of a point of the page."""

    sketch: Sketch
    motion: Motion
    unit: float

    @cached_property
    def largest(self) -> float:
        """The force [N] with the longest arrow."""
        efforts = (self.motion.efforts[load.name] for load in self.sketch.loads if load.unit == "N")
        sizes = [
            float(np.nanmax(np.abs(f), initial=0.0)) for forces in efforts for f in forces or ()
        ]
        return max(sizes, default=0.0) or 1.0

    def guide_direction(self, slider: Slider) -> Vectors:
        """Unit direction (n,) of a slider's guide on the ground."""
        return self.motion.axis[slider.guide.link] * slider.direction


def shapes_of(stage: Stage) -> list[Shape]:
    """All shapes of a mechanism."""
    shapes = [*_ground(stage), *links(stage), *sliders(stage), *_centres(stage)]
    diamond = 1.6 * SIZES.pin * 1j ** np.arange(4)[:, None] * stage.unit
    for pin in stage.sketch.pins:
        z, name = stage.motion.at(*pin.spot)[None], pin.names[0]
        if pin.welded:
            shapes.append(Shape(f"weld:{name}", "area", z + diamond, 6, fill=ink.INK))
        else:
            shapes.append(Shape(f"pin:{name}", "disc", z, 6, fill=ink.PAPER, radius=SIZES.pin))
    for point in stage.sketch.points:
        z = stage.motion.at(*point.spot)[None]
        shapes.append(
            Shape(f"marker:{point.name}", "disc", z, 6, fill=ink.INK, radius=SIZES.marker)
        )
    for name, line in dimension_lines(stage).items():
        for path in (line, line[::-1]) if len(line) > 1 else ():
            shapes += _arrow(path, ink.GREY, f"dimension:{name}", stage.unit, 0.6)
    for k, wheel in enumerate(sorted(stage.sketch.wheels, key=lambda x: -x.extent)):
        points, dash = stage.motion.at(wheel.link, np.array(wheel.points)), (9.0, 2.0, 2.0, 2.0)
        look: Arguments = {"width": 0.9, "dash": dash if wheel.chain else ()}
        shapes.append(Shape(f"wheel:{wheel.name}", "line", points, 4.7, ink.GREY, **look))
        if wheel.is_closed:  # a body, beneath all links; smaller ones lie on larger ones
            fill = _colours(stage.motion.structure.links[wheel.link], faint=False)[0]
            look = {"fill": fill, "width": 0.0}
            shapes.append(Shape(f"body:{wheel.name}", "area", points, 1 + 0.01 * k, **look))
    for load in stage.sketch.loads:
        shapes += _load(stage, load)
    for name, arc in drive_ways(stage).items():
        shapes += _arrow(arc, ink.DRIVE, f"drive:{name}", stage.unit)
    return shapes


# -- links and joints ----------------------------------------------------------------------


def links(stage: Stage, faint: bool = False) -> Iterator[Shape]:
    """Bars and plates of even thickness, in formation order."""
    for body in stage.sketch.bodies:
        points = stage.motion.at(body.link, np.array(body.outline))
        points = points if len(points) > 1 else np.repeat(points, 2, axis=0)
        fill, edge = _colours(body.number, faint)
        bar = SIZES.link * body.width
        order = 1.5 if faint else 4 + 0.01 * body.number
        if body.width != 1 and not faint:  # cylinders lie on plates, a rod goes into its barrel
            order = (4.9 if body.width > 1 else 4.85) + 1e-4 * body.number
        kind: Literal["area", "line"] = "area" if len(points) > 2 else "line"
        name = f"{'faint' if faint else 'link'}:{body.link}"
        # The edge is a wider copy below; so the corners of a plate are round as well.
        yield Shape("edge", kind, points, order, edge, edge, bar + 1.2, rounded=True)
        yield Shape(name, kind, points, order + 0.005, fill, fill, bar, rounded=True)


def sliders(stage: Stage, faint: bool = False) -> Iterator[Shape]:
    """A block on its guide for each prismatic pair outside of cylinders."""
    a, b = SIZES.slider
    corners = np.array([complex(a, b), complex(-a, b), complex(-a, -b), complex(a, -b)])
    for slider in (s for s in stage.sketch.sliders if not s.inside):
        turned = stage.guide_direction(slider) * stage.unit
        points = stage.motion.at(*slider.point) + corners[:, None] * turned
        fill, edge = _colours(stage.motion.structure.links[slider.point.link], faint)
        name = f"{'faint' if faint else 'slider'}:{slider.name}"
        yield Shape(name, "area", points, 1.6 if faint else 5, edge, fill, 0.7)


def _colours(number: int, faint: bool) -> tuple[str, str]:
    """Fill and edge of a link; 0 is the frame."""
    if faint:
        return FAINT
    fills = ink.LINK_FILLS
    return (fills[(number - 1) % len(fills)] if number else ink.FRAME_FILL), ink.INK


def _centres(stage: Stage) -> Iterator[Shape]:
    """Centres of mass: a disc with two black quarters."""
    quarter = np.array([0, *_arc(SIZES.pin, 0.0, math.pi / 2)])[:, None] * stage.unit
    for body in stage.sketch.bodies:
        if body.cm is not None:
            z, name = stage.motion.at(body.link, body.cm), f"cm:{body.link}"
            yield Shape(name, "disc", z[None], 5.5, fill=ink.PAPER, width=0.6, radius=SIZES.pin)
            for part in (quarter, -quarter):
                yield Shape("quarter", "area", z + part, 5.6, fill=ink.INK, width=0.0)


def _ground(stage: Stage) -> Iterator[Shape]:
    """Pivots and guides of the frame, on hatched ground."""
    frame, unit = stage.motion.structure.frame_link, stage.unit
    for pin in (pin for pin in stage.sketch.pins if pin.grounded):
        z = stage.motion.at(*pin.spot)[:1]
        legs = z + np.array([0, -6 - 9j, 6 - 9j])[:, None] * unit
        yield Shape("ground", "area", legs, 3, fill=ink.FRAME_FILL)
        yield _hatched(z[0] - (9.5 + 9j) * unit, z[0] + (9.5 - 9j) * unit, unit)
    for slider in stage.sketch.sliders:
        u = stage.guide_direction(slider)[0]
        below, beyond = -1j * u * (SIZES.slider[1] + 0.4) * unit, (SIZES.slider[0] + 3) * unit
        if slider.guide.link == frame:
            yield _hatched(slider.end(0, beyond) + below, slider.end(1, beyond) + below, unit)
        elif slider.point.link == frame:
            z = slider.point.at + below
            yield _hatched(z - beyond * u, z + beyond * u, unit)


def _hatched(start: complex, end: complex, unit: float) -> Shape:
    """A line with the strokes of solid ground on its right, in one go."""
    u = (end - start) / abs(end - start)
    n = max(2, round(abs(end - start) / unit / 3.2))
    feet = start + (np.arange(n) + 0.7) / n * (end - start)
    strokes = np.stack([feet, feet - (1 + 1j) * u * 2.6 * unit, feet], axis=1).ravel()
    return Shape("ground", "line", np.array([start, *strokes, end])[:, None], 3, width=0.6)


# -- loads and drives ------------------------------------------------------------------------


def _arc(radius: float, start: float, turn: float) -> Vectors:
    """Places (p,) on an arc about 0 that turns by an angle [rad]."""
    n = math.ceil(turn / 0.2)
    arc: Vectors = radius * np.exp(1j * (start + turn * np.arange(n + 1) / n))
    return arc


def _mirrored(arc: Vectors, sense: Real) -> Vectors:
    """An arc (p, n) that turns the other way where ``sense`` (n,) is negative."""
    mirrored: Vectors = arc.real[:, None] + 1j * sense * arc.imag[:, None]
    return mirrored


def _arrow(
    path: Vectors, colour: str, name: str, unit: float, width: float = 1.3
) -> Iterator[Shape]:
    """A line (p, n) with an arrowhead at its end."""
    z, last = path[-1], path[-1] - path[-2]
    u = last * (unit / np.abs(last))
    yield Shape(name, "line", np.array([*path[:-1], z - 3 * u]), 7, colour, width=width)
    head = z - u * np.array([0, 6 + 2.4j, 6 - 2.4j])[:, None]
    yield Shape("arrowhead", "area", head, 7.1, colour, colour, 0.0)


def dimension_lines(stage: Stage) -> dict[str, Vectors]:
    """Lines (p, n) of lengths, beside their points; of other dimensions the middle (1, n).

    NaN where a dimension of the drawing does not hold in the pose.
    """
    lines = {}
    for mark in stage.sketch.dimensions:
        z = [stage.motion.at(*spot) for spot in mark.spots]
        size = float(np.nanmax(np.abs(z))) or 1.0
        off = np.abs([*mark.dimension.residuals(z, size)]).max(axis=0)
        line = np.mean(z, axis=0, keepdims=True)
        if isinstance(mark.dimension, Length):
            u = (z[1] - z[0]) / np.abs(z[1] - z[0])
            line = np.array(z) + 1j * u * np.where(u.real < 0, -1, 1) * DISTANCE * stage.unit
        lines[mark.name] = np.where(off <= BLUR, line, np.nan)
    return lines


def load_ways(stage: Stage, load: LoadMark) -> list[Vectors]:
    """Arrows (p, n) of forces, arcs of couples: one for each terminal, NaN where it is zero."""
    values = stage.motion.efforts[load.name]
    if values is None or load.is_passive:
        return []
    ways = []
    for spot, value in zip(load.spots, values, strict=True):
        if load.unit == "N":
            ways.append(_force_arrow(stage, stage.motion.at(*spot), value, stage.largest))
        else:
            bodies = (b.middle for b in stage.sketch.bodies if b.link == spot.link)
            z = stage.motion.at(*next(bodies, spot))
            arc = _arc(SIZES.couple * stage.unit, -0.6 * math.pi, 1.5 * math.pi)
            ways.append(z + _mirrored(arc, value.real / _size(value)))
    return ways


def _size(value: Vectors) -> Real:
    """Magnitudes (n,); NaN where there is nothing to show."""
    return np.where(np.isfinite(value) & (value != 0), np.abs(value), np.nan)


def _force_arrow(stage: Stage, z: Vectors, value: Vectors, largest: float) -> Vectors:
    """An arrow (2, n) from places; its length is that of the value (n,) beside the largest."""
    size = _size(value)
    length = np.maximum(SIZES.force[0], SIZES.force[1] * size / largest) * stage.unit
    return np.array([z, z + value * (length / size)])


def vectors(stage: Stage, values: Mapping[str, Vector], colour: str) -> Iterator[Shape]:
    """Vectors (n,) of one quantity at their spots as arrows, by name, on one scale."""
    sizes = [float(np.nanmax(np.abs(value), initial=0.0)) for _, value in values.values()]
    for name, (spot, value) in values.items():
        arrow = _force_arrow(stage, stage.motion.at(*spot), value, max(sizes) or 1.0)
        yield from _arrow(arrow, colour, name, stage.unit)


def _load(stage: Stage, load: LoadMark) -> Iterator[Shape]:
    for arrow in load_ways(stage, load):
        yield from _arrow(arrow, ink.LOAD, f"load:{load.name}", stage.unit)
    if load.is_line:
        a, b = (stage.motion.at(*spot) for spot in load.spots)
        # The sign (p, n) of a load between two places (n,), of as many turns at every length.
        unit = stage.unit
        length = np.abs(b - a)
        u = np.divide(b - a, length, out=np.zeros_like(a), where=length > 0)
        point = np.minimum(unit, length / 30.0)  # signs of short loads are shorter
        turns = int(np.clip(np.nanmean(length - 2 * LEAD * point) / unit / 5.0, 4, 16))
        share, x, y = load.line(turns).T[:, :, None]
        line: Vectors = a + (b - a) * share + u * (x * point + 1j * y * unit)
        dash, name = (4.0, 2.0) if load.kind == "strut" else (), f"{load.kind}:{load.name}"
        yield Shape(name, "line", line, 6.5, ink.SPRING, width=1.0, dash=dash)


def drive_ways(stage: Stage) -> dict[str, Vectors]:
    """The senses in which the drivers move: an arc (p, n), or a line beside the slider."""
    ways = {}
    motion, s = stage.motion, stage.motion.structure
    for name in s.drivers:
        ref = s.driven[name]
        link, spot = s.later_link(ref), pin_spot(s, ref)
        e = motion.axis[link] * stage.unit
        sense = np.where(motion.q_rate[name] * s.coordinate(name).sign < 0, -1, 1)
        if not s.joint(ref).rotary:
            z = motion.at(link, s.blocks[ref.block].slider_place(ref.name, link.link))
            middle, half = z + 1j * e * (SIZES.slider[1] + 4), (SIZES.couple - 1) * sense * e
            ways[name] = np.array([middle - half, middle + half])
        elif spot is not None:
            ways[name] = motion.at(*spot) + e * _mirrored(_arc(SIZES.couple + 3, 0.45, 1.2), sense)
    return ways
