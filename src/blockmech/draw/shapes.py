"""The shapes of one pose: lines, areas and discs, for any pen.

The printed picture, the GIF and the player in a browser draw the same list. Places
are in metres on the ground; widths, and radii of symbols, are in points of the page,
so links look the same whatever the size of the mechanism.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from blockmech.draw import palette as ink
from blockmech.draw.motion import Motion, Spot
from blockmech.draw.palette import SIZES
from blockmech.draw.sketch import LoadMark, Sketch, Slider

FAINT = ("#F1F1F1", "#BDBDBD")  # fill and edge of further poses


@dataclass(frozen=True)
class Shape:
    """A line, a filled area or a disc.

    Attributes
    ----------
    what : what it is, e.g. ``"link:dyad.i"``
    points : complex [m]; one for a disc
    order : shapes of higher order lie on lower ones
    """

    what: str
    kind: Literal["line", "area", "disc"]
    points: Sequence[complex]
    order: float
    stroke: str = ink.INK
    fill: str = ""
    width: float = 0.8  # [pt]
    radius: float = 0.0  # [pt]
    dash: tuple[float, ...] = ()
    rounded: bool = False  # round ends


@dataclass(frozen=True)
class Stage:
    """A mechanism ready to be drawn at any sample of a motion.

    ``unit`` [m/pt] is the size of a point of the page on the ground.
    """

    sketch: Sketch
    motion: Motion
    unit: float

    def place(self, spot: Spot, k: int) -> complex:
        """Place [m] of a spot at sample k."""
        return complex(self.motion.at(*spot)[k])

    @cached_property
    def efforts(self) -> Mapping[str, tuple[NDArray[Any], ...] | None]:
        """Forces [N] and couples [N m] of the elements, None where they are not known."""
        return {load.name: self.motion.efforts(load.name) for load in self.sketch.loads}

    @cached_property
    def largest(self) -> float:
        """The force [N] with the longest arrow."""
        every = [self.efforts[load.name] or () for load in self.sketch.loads if load.unit == "N"]
        sizes = [float(np.nanmax(np.abs(f), initial=0.0)) for forces in every for f in forces]
        return max(sizes, default=0.0) or 1.0


def pose(stage: Stage, k: int) -> list[Shape]:
    """All that moves, at sample k."""
    found = [*links(stage, k), *sliders(stage, k), *_centres(stage, k)]
    for pin in stage.sketch.pins:
        z = stage.place(pin.spot, k)
        found.append(
            Shape(f"pin:{pin.names[0]}", "disc", (z,), 6, fill=ink.PAPER, radius=SIZES.pin)
        )
    for load in stage.sketch.loads:
        found += _load(stage, load, k)
    for name, way in drive_ways(stage, k).items():
        found += arrow(way, ink.DRIVE, f"drive:{name}", stage.unit)
    return found


# -- links and joints ----------------------------------------------------------------------


def links(stage: Stage, k: int, faint: bool = False) -> list[Shape]:
    """Bars and plates of even thickness, in formation order."""
    found = []
    for body in stage.sketch.bodies:
        points = [stage.place(Spot(body.link, p), k) for p in body.outline]
        points = points if len(points) > 1 else points * 2
        fill, edge = _colours(body.number, faint)
        bar = SIZES.link * body.width
        order = 1.5 if faint else 4 + 0.01 * body.number
        if body.width != 1 and not faint:  # cylinders lie on plates, a rod goes into its barrel
            order = (4.9 if body.width > 1 else 4.85) + 1e-4 * body.number
        kind: Literal["area", "line"] = "area" if len(points) > 2 else "line"
        name = f"{'faint' if faint else 'link'}:{body.link}"
        # The edge is a wider copy below; so the corners of a plate are round as well.
        for what, height, ink_, width in (
            ("edge", order, edge, bar + 1.2),
            (name, order + 0.005, fill, bar),
        ):
            found.append(Shape(what, kind, points, height, ink_, ink_, width, rounded=True))
    return found


def sliders(stage: Stage, k: int, faint: bool = False) -> list[Shape]:
    """A block on its guide for each prismatic pair."""
    found = []
    for slider in stage.sketch.sliders:
        if slider.inside:
            continue
        z, u = stage.place(slider.point, k), along(stage, slider, k) * stage.unit
        a, b = SIZES.slider[0] * u, SIZES.slider[1] * 1j * u
        corners = (z + a + b, z - a + b, z - a - b, z + a - b)
        fill, edge = _colours(stage.motion.structure.links[slider.point.link], faint)
        name = f"{'faint' if faint else 'slider'}:{slider.name}"
        found.append(Shape(name, "area", corners, 1.6 if faint else 5, edge, fill, 0.7))
    return found


def along(stage: Stage, slider: Slider, k: int) -> complex:
    """Unit direction of a slider's guide on the ground."""
    return complex(stage.motion.axis[slider.guide.link][k] * slider.direction)


def _colours(number: int, faint: bool) -> tuple[str, str]:
    """Fill and edge of a link; 0 is the frame."""
    if faint:
        return FAINT
    fills = ink.LINK_FILLS
    return (fills[(number - 1) % len(fills)] if number else ink.FRAME_FILL), ink.INK


def _centres(stage: Stage, k: int) -> list[Shape]:
    """Centres of mass: a disc with two black quarters."""
    found = []
    for body in stage.sketch.bodies:
        if body.cm is None:
            continue
        z, name = stage.place(Spot(body.link, body.cm), k), f"cm:{body.link}"
        found.append(Shape(name, "disc", (z,), 5.5, fill=ink.PAPER, width=0.6, radius=SIZES.pin))
        for turn in (0.0, math.pi):
            quarter = (z, *arc(z, SIZES.pin * stage.unit, turn, math.pi / 2))
            found.append(Shape("quarter", "area", quarter, 5.6, fill=ink.INK, width=0.0))
    return found


# -- the frame -----------------------------------------------------------------------------


def ground(stage: Stage, k: int) -> list[Shape]:
    """Pivots and guides of the frame, on hatched ground."""
    found: list[Shape] = []
    unit = stage.unit
    frame = stage.motion.structure.frame_link
    for pin in stage.sketch.pins:
        if pin.grounded:
            z = stage.place(pin.spot, k)
            legs = (z, z - complex(6, 9) * unit, z + complex(6, -9) * unit)
            found.append(Shape("ground", "area", legs, 3, fill=ink.FRAME_FILL))
            found += _hatched(z - complex(9.5, 9) * unit, z + complex(9.5, -9) * unit, unit)
    for slider in stage.sketch.sliders:
        u = along(stage, slider, k)
        below, beyond = -1j * u * (SIZES.slider[1] + 0.4) * unit, (SIZES.slider[0] + 3) * unit
        if slider.guide.link == frame:
            ends = (slider.end(0, beyond), slider.end(1, beyond))
        elif slider.point.link == frame:
            z = stage.place(slider.point, k)
            ends = (z - beyond * u, z + beyond * u)
        else:
            continue
        found += _hatched(ends[0] + below, ends[1] + below, unit)
    return found


def _hatched(start: complex, end: complex, unit: float) -> list[Shape]:
    """A line with the strokes of solid ground on its right."""
    found = [Shape("ground", "line", (start, end), 3)]
    u = (end - start) / abs(end - start)
    n = max(2, round(abs(end - start) / unit / 3.2))
    for t in (np.arange(n) + 0.7) / n:
        foot = start + float(t) * (end - start)
        stroke = (foot, foot - (1 + 1j) * u * 2.6 * unit)
        found.append(Shape("hatch", "line", stroke, 3, width=0.5))
    return found


# -- loads and drives ------------------------------------------------------------------------


def arrow(way: Sequence[complex], colour: str, name: str, unit: float) -> list[Shape]:
    """A line with an arrowhead at its end."""
    z, before = way[-1], way[-2]
    u = (z - before) / abs(z - before) * unit
    head = (z, z - u * complex(6, 2.4), z - u * complex(6, -2.4))
    return [
        Shape(name, "line", (*way[:-1], z - 3 * u), 7, colour, width=1.3),
        Shape("arrowhead", "area", head, 7.1, colour, colour, 0.0),
    ]


def arc(centre: complex, radius: float, start: float, turn: float) -> list[complex]:
    """Places on an arc that turns by an angle [rad]."""
    n = max(4, math.ceil(abs(turn) / 0.2))
    return [centre + cmath.rect(radius, start + turn * t / n) for t in range(n + 1)]


def load_ways(stage: Stage, load: LoadMark, k: int) -> list[list[complex]]:
    """Arrows of forces, arcs of couples: one for each terminal where there is any."""
    values = stage.efforts[load.name]
    if values is None or load.kind == "spring":
        return []
    found = []
    for spot, column in zip(load.spots, values, strict=True):
        value = complex(column[k])
        if not cmath.isfinite(value) or value == 0:
            continue
        if load.unit == "N":
            z = stage.place(spot, k)
            length = max(SIZES.force[0], SIZES.force[1] * abs(value) / stage.largest) * stage.unit
            found.append([z, z + value / abs(value) * length])
        else:
            z = stage.place(_middle(stage.sketch, spot), k)
            turn = math.copysign(1.5 * math.pi, value.real)
            found.append(arc(z, SIZES.couple * stage.unit, -0.4 * turn, turn))
    return found


def _middle(sketch: Sketch, spot: Spot) -> Spot:
    """Where a couple on a link is drawn: the middle of the link."""
    outline = next((b.outline for b in sketch.bodies if b.link == spot.link), (spot.at,))
    return Spot(spot.link, sum(outline) / len(outline))


def _load(stage: Stage, load: LoadMark, k: int) -> list[Shape]:
    found: list[Shape] = []
    for way in load_ways(stage, load, k):
        found += arrow(way, ink.LOAD, f"load:{load.name}", stage.unit)
    if load.kind in ("spring", "strut"):
        a, b = (stage.place(spot, k) for spot in load.spots)
        spring = load.kind == "spring"
        line = zigzag(a, b, stage.unit) if spring else [a, b]
        dash = () if spring else (4.0, 2.0)
        name = f"{load.kind}:{load.name}"
        found.append(Shape(name, "line", line, 6.5, ink.SPRING, width=1.0, dash=dash))
    return found


def zigzag(a: complex, b: complex, unit: float) -> list[complex]:
    """A spring between two places; ``unit`` [m/pt]."""
    length = abs(b - a)
    if not length > 0:
        return [a, b]
    u = (b - a) / length
    ends = min(6.0 * unit, 0.2 * length)
    turns = 2 * min(max(round((length - 2 * ends) / unit / 5.0), 4), 16)
    step = (length - 2 * ends) / turns
    side = 3.2j * u * unit
    coil = [a + u * (ends + step * (n + 0.5)) + side * (-1) ** n for n in range(turns)]
    return [a, a + u * ends, *coil, b - u * ends, b]


def drive_ways(stage: Stage, k: int) -> dict[str, list[complex]]:
    """The senses in which the drivers move: driver -> an arc, or a line beside the slider."""
    found = {}
    for mark in stage.sketch.drives:
        sense = -1.0 if stage.motion.q_rate[mark.name][k] * mark.sense < 0 else 1.0
        z, e = stage.place(mark.spot, k), complex(stage.motion.axis[mark.driven][k])
        if mark.rotary:
            found[mark.name] = arc(
                z, (SIZES.couple + 3) * stage.unit, cmath.phase(e) + 0.45 * sense, 1.2 * sense
            )
        else:
            beside = z + 1j * e * (SIZES.slider[1] + 4) * stage.unit
            half = (SIZES.couple - 1) * sense * e * stage.unit
            found[mark.name] = [beside - half, beside + half]
    return found
