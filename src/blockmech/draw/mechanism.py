"""The mechanism at poses as a picture: links, joints, loads, paths of markers."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw import palette as ink
from blockmech.draw import shapes
from blockmech.draw.labels import Crowd, Label, Rect
from blockmech.draw.motion import Motion, moves
from blockmech.draw.paper import new_figure, scaled_unit, shown_name, styled, wrapped
from blockmech.draw.paths import Paths, paths_of
from blockmech.draw.shapes import Shape, Stage, stage_of
from blockmech.draw.sketch import LoadMark, Sketch, Spot, sketch_of

SWEEP = 241  # samples of a path
CROWDED = 40  # joints from which they have no names
MANY = 9  # labels from which the picture is two columns wide
PAGE = 2 * ink.COLUMN + 14.0  # [pt] width of two columns
LEFT, RIGHT, BOTTOM, TOP = 41.0, 8.0, 27.0, 8.0  # [pt] around the axes
LINE = 10.5  # [pt] height of a line of the caption
LOWEST, TALLEST = 110.0, 330.0  # [pt] height of the axes
EDGE = 16.0  # [pt] free inside the axes
BESIDE = 5.0  # [pt] of a link's name from the middle of the link
SOLID = {"line": 1.0, "area": 0.7, "disc": 3.0}  # how much a label shuns a shape


@dataclass
class Scale:
    """Axes in metres at equal aspect, and how many metres a point of the page is."""

    figure: Any
    axes: Any
    unit: float  # [m/pt]
    corner: complex  # [m] lower left
    width: float  # [pt]
    height: float  # [pt]

    def points(self, z: complex) -> complex:
        """A place [m] in points of the page, from the axes' lower left corner."""
        return (z - self.corner) / self.unit

    def metres(self, z: complex) -> complex:
        """The place [m] of a point of the page."""
        return z * self.unit + self.corner


@dataclass
class Picture:
    """A drawn mechanism. Labels of artists tell what they are: ``link:``, ``pin:``, ``load:``."""

    figure: Any
    axes: Any
    stage: Stage
    shown: list[int]
    labels: list[Any] = field(default_factory=list)


def draw_mechanism(
    mechanism: Compiled, at: Any = None, trace: Iterable[str] | None = None, degrees: bool = True
) -> Picture:
    """Draw a mechanism at poses: the first in full, the others faintly.

    Parameters
    ----------
    at : float or (n,) [rad or m], or a mapping driver -> (n,)
        Driver coordinates; by default four poses over the range of the laws of motion.
    trace : names of markers whose paths are drawn, where the range is known; by
        default the user's markers, or inner joints if there are none
    degrees : angles in the caption in degrees

    Raises `RequestError` where the range is not known and no pose is named, and the
    errors of `Compiled.run` where the first pose cannot be reached.
    """
    swept = at is None or all(d in mechanism.scene.drive for d in mechanism.drivers)
    sweep = moves(mechanism, samples=SWEEP) if swept else None
    motion = moves(mechanism, at) if at is not None or sweep is None else sweep
    shown = _poses(motion, named=at is not None)
    sketch = sketch_of(sweep or motion)
    paths = paths_of(sweep, trace) if sweep is not None and sweep.n > 1 else {}
    with styled():
        many = len(sketch.pins) + len(sketch.sliders) + len(sketch.loads) > MANY
        head = caption(motion, shown, degrees)
        corners = extent(motion, sketch, shown, paths)
        lines = wrapped(head, ink.SMALL, sizes(corners, many)[1]) if head else []
        scale = paper(corners, paths, lines, many)
        stage = stage_of(sketch, motion, scale.unit)
        picture = Picture(scale.figure, scale.axes, stage, shown)
        crowd = Crowd(Rect(2, 2, scale.width - 2, scale.height - 2))
        for path in paths.values():
            crowd.add_line([scale.points(z) for z in path], 0.4)
        for k in shown[:0:-1]:
            draw(scale, [*shapes.links(stage, k, faint=True), *shapes.sliders(stage, k, True)])
        now = [*shapes.ground(stage, shown[0]), *shapes.pose(stage, shown[0])]
        draw(scale, now)
        for shape in now:
            _stands(crowd, scale, shape)
        for label, spot in crowd.place(_labels(scale, stage, shown[0])):
            if spot.leader:
                line = tuple(map(scale.metres, spot.leader))
                draw(scale, [Shape("leader", "line", line, 8, label.colour, width=0.4)])
            picture.labels.append(write(scale, label.text, spot.rect.centre, label.colour))
    return picture


# -- choice and caption ------------------------------------------------------------------


def _poses(motion: Motion, named: bool) -> list[int]:
    """Samples to draw, the main one first."""
    good = np.flatnonzero(motion.feasible)
    if not len(good) or (named and not motion.feasible[0]):
        motion.refuse(0)
    if named:
        return [int(k) for k in good]
    if len(motion.q) == 1:  # by coordinate, so that a motion to and fro shows no pose twice
        (q,) = motion.q.values()
        _, first = np.unique(np.round(q[good] / (np.ptp(q[good]) or 1.0), 6), return_index=True)
        good = good[first]
    picks = [good[round(f * (len(good) - 1))] for f in (0.125, 0.375, 0.625, 0.875)]
    return list(dict.fromkeys(int(k) for k in picks))


def caption(motion: Motion, shown: Sequence[int], degrees: bool = True) -> str:
    """Driver coordinates of the poses, the main one first, and gravity."""
    parts = []
    for driver, q in motion.q.items():
        values = [coordinate(motion, driver, float(q[k]), degrees) for k in shown]
        faint = f" (faint: {', '.join(values[1:])})" if len(values) > 1 else ""
        name = motion.mechanism.of_driver(driver, "q")
        parts.append(f"{shown_name(name)}\u00a0= {values[0]}{faint}")
    g = motion.mechanism.scene.gravity.z
    if g:
        parts.append(f"gravity {abs(g):.4g}\u00a0m/s² {_pointing(g)}")
    return "; ".join(parts)


def coordinate(motion: Motion, driver: str, q: float, degrees: bool = True) -> str:
    """A driver coordinate with its unit."""
    unit = motion.mechanism.driver_joint(driver).coordinate_unit
    return f"{math.degrees(q):.4g}°" if unit == "rad" and degrees else f"{q:.4g}\u00a0{unit}"


def _pointing(g: complex) -> str:
    """A direction as an arrow, or as an angle if none fits."""
    eighths = math.degrees(cmath.phase(g)) / 45
    if abs(eighths - round(eighths)) < 1e-9:
        return "→↗↑↖←↙↓↘"[round(eighths) % 8]
    return f"at {math.degrees(cmath.phase(g)):.4g}°"


# -- the paper ---------------------------------------------------------------------------


def extent(
    motion: Motion, sketch: Sketch, shown: Sequence[int], paths: Paths
) -> tuple[complex, complex]:
    """Lower left and upper right corner [m] of what is drawn."""
    some = np.asarray(shown)
    spots = [Spot(body.link, z) for body in sketch.bodies for z in body.outline]
    spots += [Spot(body.link, body.cm) for body in sketch.bodies if body.cm is not None]
    spots += [pin.spot for pin in sketch.pins]
    spots += [Spot(s.guide.link, s.end(k)) for s in sketch.sliders for k in (0, 1)]
    spots += [spot for load in sketch.loads for spot in load.spots]
    places = [motion.at(*spot)[some] for spot in spots] + list(paths.values())
    z = np.concatenate([*places, np.zeros(0, complex)])
    z = z[np.isfinite(z)] if np.isfinite(z).any() else np.zeros(1, complex)
    return complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max())


def sizes(corners: tuple[complex, complex], wide: bool = False) -> tuple[float, float, float]:
    """Metres of a point of the page, width and height [pt] of axes that hold the corners."""
    width = (PAGE if wide else ink.COLUMN) - LEFT - RIGHT
    size = corners[1] - corners[0]
    smallest = (max(size.real, size.imag) or 1.0) / (width - 2 * EDGE) / 3
    unit = max(size.real / (width - 2 * EDGE), size.imag / (TALLEST - 2 * EDGE), smallest)
    return unit, width, min(max(size.imag / unit + 2 * EDGE, LOWEST), TALLEST)


def paper(
    corners: tuple[complex, complex], paths: Paths, lines: Sequence[str], wide: bool = False
) -> Scale:
    """A figure one or two columns wide, with axes that hold the corners at equal aspect."""
    page = PAGE if wide else ink.COLUMN
    unit, width, height = sizes(corners, wide)
    corner = (corners[0] + corners[1] - complex(width, height) * unit) / 2
    columns = 4 if wide else 2
    total = BOTTOM + height + TOP + LINE * (len(lines) + math.ceil(len(paths) / columns))
    figure = new_figure(page, total)
    axes = figure.add_axes((LEFT / page, BOTTOM / total, width / page, height / total))
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(corner.real, corner.real + width * unit)
    axes.set_ylim(corner.imag, corner.imag + height * unit)
    axes.set_xlabel("x [m]", labelpad=1.5)
    axes.set_ylabel("y [m]", labelpad=1.0)
    axes.locator_params(nbins=6)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)
    for k, line in enumerate(lines):
        y = (total - TOP - LINE * k) / total
        figure.text(LEFT / page, y, line, fontsize=ink.SMALL, va="top", label="caption")
    scale = Scale(figure, axes, unit, corner, width, height)
    _draw_paths(scale, paths, columns)
    return scale


def _draw_paths(scale: Scale, paths: Paths, columns: int) -> None:
    """The paths of markers over the range; gaps are gaps."""
    lines = []
    for i, (name, path) in enumerate(paths.items()):
        colour, dashes = ink.curve_style(i)
        label = f"path of {shown_name(name)}"
        (line,) = scale.axes.plot(
            path.real, path.imag, color=colour, lw=0.9, zorder=4.9, label=label
        )
        if dashes:
            line.set_dashes(dashes)
        lines.append(line)
    if lines:
        scale.axes.legend(
            handles=lines,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns,
            borderaxespad=0.1,
            borderpad=0.1,
            labelspacing=0.15,
            handlelength=2.2,
            columnspacing=1.2,
        )


# -- ink -----------------------------------------------------------------------------------


def draw(scale: Scale, drawn: Iterable[Shape]) -> list[Any]:
    """Draw shapes; their artists."""
    return [_artist(scale, shape) for shape in drawn]


def _artist(scale: Scale, shape: Shape) -> Any:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    x, y = [z.real for z in shape.points], [z.imag for z in shape.points]
    common: dict[str, Any] = {"zorder": shape.order, "label": shape.what}
    if shape.kind == "area":
        patch = Polygon(
            list(zip(x, y, strict=True)),
            facecolor=shape.fill,
            edgecolor=shape.stroke,
            lw=shape.width,
            joinstyle="round",
            **common,
        )
        return scale.axes.add_patch(patch)
    if shape.kind == "disc":
        line = Line2D(
            x,
            y,
            ls="",
            marker="o",
            ms=2 * shape.radius,
            mfc=shape.fill,
            mec=shape.stroke,
            mew=shape.width,
            **common,
        )
    else:
        line = Line2D(
            x,
            y,
            color=shape.stroke,
            lw=shape.width,
            solid_capstyle="round" if shape.rounded else "butt",
            **common,
        )
        if shape.dash:
            line.set_dashes(shape.dash)
    return scale.axes.add_line(line)


def write(scale: Scale, text: str, centre: complex, colour: str) -> Any:
    """Write a label around a point of the page."""
    z = scale.metres(centre)
    style = {"fontsize": ink.SMALL, "color": colour, "zorder": 9, "linespacing": 1.1}
    return scale.axes.text(z.real, z.imag, text, ha="center", va="center", label="text", **style)


# -- labels --------------------------------------------------------------------------------


def _stands(crowd: Crowd, scale: Scale, shape: Shape) -> None:
    """Tell the crowd that a shape is drawn."""
    points = [scale.points(z) for z in shape.points]
    weight = SOLID[shape.kind]
    if shape.kind == "disc":
        crowd.add_disc(points[0], shape.radius + 1, weight)
        return
    closed = [*points, points[0]] if shape.kind == "area" else points
    half = shape.width / 2 if shape.width > 2 else 0.0
    for shift in dict.fromkeys((-half, 0.0, half)):
        crowd.add_line([p + shift * (1 + 1j) for p in closed], weight)


def _labels(scale: Scale, stage: Stage, k: int) -> list[Label]:
    """Names of joints, drivers and a document's links, names and sizes of loads; pins first."""
    found = []
    joints = len(stage.sketch.pins) + len(stage.sketch.sliders)
    for pin in stage.sketch.pins if joints < CROWDED else ():
        text = "\n".join(map(shown_name, pin.names))
        found.append(Label(text, (scale.points(stage.place(pin.spot, k)),), clearance=shapes.PIN))
    for slider in stage.sketch.sliders if joints < CROWDED else ():
        z = scale.points(stage.place(slider.point, k))
        found.append(Label(shown_name(slider.name), (z,), clearance=shapes.BLOCK[1] + 2))
    for body in stage.sketch.bodies if joints < CROWDED else ():
        if body.name:
            ends = [scale.points(stage.place(Spot(body.link, z), k)) for z in body.outline]
            middle = sum(ends) / len(ends)
            found.append(Label(shown_name(body.name), (middle,), ink.GREY, clearance=BESIDE))
    for name, way in shapes.drive_ways(stage, k).items():
        text = "q" if len(stage.sketch.drives) == 1 else f"{shown_name(name)}.q"
        anchors = tuple(scale.points(z) for z in way[:: max(1, len(way) // 2)])
        found.append(Label(text, anchors, ink.DRIVE))
    for load in stage.sketch.loads:
        found += _load_label(scale, stage, load, k)
    return found


def load_text(stage: Stage, load: LoadMark, k: int) -> str:
    """Name and size of a load."""
    values = stage.efforts[load.name]
    size = float(abs(values[0][k])) if values is not None else math.nan
    name = shown_name(load.name)
    if not math.isfinite(size):
        return name
    factor, unit = scaled_unit(load.unit, size)
    return f"{name} {size * factor:.4g} {unit}"


def _load_label(scale: Scale, stage: Stage, load: LoadMark, k: int) -> list[Label]:
    text = load_text(stage, load, k)
    ways = [[scale.points(z) for z in way] for way in shapes.load_ways(stage, load, k)]
    if load.kind in ("spring", "strut"):
        a, b = (scale.points(stage.place(spot, k)) for spot in load.spots)
        anchors = tuple(a + (b - a) * t for t in (0.5, 0.35, 0.65, 0.2, 0.8))
        return [Label(text, anchors, ink.SPRING, clearance=4.0)]
    if not ways:
        return []
    way = ways[0]
    if load.unit == "N":
        turn = cmath.phase(way[-1] - way[0])
        return [Label(text, (way[-1], way[0]), ink.LOAD, prefer=turn)]
    middle = sum(way) / len(way)
    return [Label(text, (middle,), ink.LOAD, clearance=shapes.ARC)]
