"""The mechanism at poses as a picture: links, joints, loads, paths of markers."""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw import palette as ink
from blockmech.draw import shapes
from blockmech.draw.labels import Crowd, Label, Rect, Spot
from blockmech.draw.motion import Complex, Motion, marker_place, moves
from blockmech.draw.motion import Spot as LinkSpot
from blockmech.draw.palette import SIZES
from blockmech.draw.paper import new_figure, scaled_unit, shown_name, styled, wrapped
from blockmech.draw.shapes import Shape, Stage
from blockmech.draw.sketch import LoadMark, Sketch, shown_markers, sketch_of
from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.model.structure import MarkerRef

SWEEP = 241  # samples of a path
PATHS = 8  # that are drawn if none are named
CROWDED = 40  # joints from which they have no names
MANY = 9  # labels from which the picture is two columns wide
SOLID = {"line": 1.0, "area": 0.7, "disc": 3.0}  # how much a label shuns a shape
FAINT_POSES = (0.125, 0.375, 0.625, 0.875)  # of the range; the first is the main one

Paths = Mapping[str, Complex]


@dataclass
class Page:
    """Axes in metres at equal aspect, and how many metres a point of the page is."""

    corners: tuple[complex, complex]  # [m] of what is drawn
    wide: bool  # two columns
    figure: Any = None
    axes: Any = None

    @property
    def columns(self) -> float:
        """Width [pt] of the whole."""
        return 2 * ink.COLUMN + 14.0 if self.wide else ink.COLUMN

    @property
    def width(self) -> float:
        """Width [pt] of the axes."""
        return self.columns - SIZES.left - SIZES.right

    @property
    def unit(self) -> float:
        """[m/pt] so that the corners fit."""
        size, room = self.corners[1] - self.corners[0], self.width - 2 * SIZES.edge
        smallest = (max(size.real, size.imag) or 1.0) / room / 3
        return max(size.real / room, size.imag / (SIZES.heights[1] - 2 * SIZES.edge), smallest)

    @property
    def height(self) -> float:
        """Height [pt] of the axes."""
        size = self.corners[1] - self.corners[0]
        return float(np.clip(size.imag / self.unit + 2 * SIZES.edge, *SIZES.heights))

    @property
    def corner(self) -> complex:
        """Lower left corner [m] of the axes."""
        return sum(self.corners) / 2 - complex(self.width, self.height) * self.unit / 2

    def points(self, z: complex) -> complex:
        """A place [m] in points of the page, from the axes' lower left corner."""
        return (z - self.corner) / self.unit

    def metres(self, z: complex) -> complex:
        """The place [m] of a point of the page."""
        return z * self.unit + self.corner

    def lay_out(self, paths: Paths, lines: int) -> None:
        """Make the figure, with axes, the paths of markers and room for a caption."""
        columns = 4 if self.wide else 2
        rows = lines + math.ceil(len(paths) / columns)
        total = SIZES.bottom + self.height + SIZES.top + ink.ROW * rows
        self.figure = new_figure(self.columns, total)
        box = (
            SIZES.left / self.columns,
            SIZES.bottom / total,
            self.width / self.columns,
            self.height / total,
        )
        axes = self.axes = self.figure.add_axes(box)
        far = self.metres(complex(self.width, self.height))
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", adjustable="box")
        axes.set(xlim=(self.corner.real, far.real), ylim=(self.corner.imag, far.imag))
        axes.xaxis.labelpad, axes.yaxis.labelpad = 1.5, 1.0
        axes.locator_params(nbins=6)
        axes.grid(True, color=ink.PALE, lw=0.3)
        axes.set_axisbelow(True)
        for i, (name, path) in enumerate(paths.items()):
            colour, dashes = ink.curve_style(i)
            label = f"path of {shown_name(name)}"
            style = {"color": colour, "lw": 0.9, "zorder": 4.9, "label": label}
            (line,) = axes.plot(path.real, path.imag, **style)
            if dashes:
                line.set_dashes(dashes)
        if paths:
            above = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.1}
            tight = {"borderpad": 0.1, "labelspacing": 0.15, "columnspacing": 1.2}
            axes.legend(ncols=columns, handlelength=2.2, **above, **tight)

    def caption(self, lines: Sequence[str]) -> list[Any]:
        """Lines above the axes; their artists."""
        total = self.figure.get_size_inches()[1] * 72
        style = {"fontsize": ink.SMALL, "va": "top", "label": "caption"}
        return [
            self.figure.text(
                SIZES.left / self.columns,
                1 - (SIZES.top + ink.ROW * k) / total,
                line,
                **style,
            )
            for k, line in enumerate(lines)
        ]

    def draw(self, drawn: Iterable[Shape]) -> list[Any]:
        """Draw shapes; their artists."""
        return [self._artist(shape) for shape in drawn]

    def _artist(self, shape: Shape) -> Any:
        from matplotlib.lines import Line2D
        from matplotlib.patches import Polygon

        places = np.array([(z.real, z.imag) for z in shape.points])
        look: dict[str, Any] = {"zorder": shape.order, "label": shape.what}
        if shape.kind == "area":
            look |= {"fc": shape.fill, "ec": shape.stroke, "lw": shape.width}
            return self.axes.add_patch(Polygon(places, joinstyle="round", **look))
        if shape.kind == "disc":
            look |= {"marker": "o", "ms": 2 * shape.radius, "mew": shape.width, "ls": ""}
            look |= {"mfc": shape.fill, "mec": shape.stroke}
        else:
            look |= {"color": shape.stroke, "lw": shape.width}
            look["solid_capstyle"] = "round" if shape.rounded else "butt"
        line = Line2D(*places.T, **look)
        if shape.dash:
            line.set_dashes(shape.dash)
        return self.axes.add_line(line)

    def write(self, spot: Spot, frame: int = 0) -> Any:
        """Write a label at its place."""
        z, text = self.metres(spot.centre(frame)), spot.label.text
        style = {"fontsize": ink.SMALL, "color": spot.label.colour, "zorder": 9}
        middle = {"ha": "center", "va": "center", "linespacing": 1.1}
        return self.axes.text(z.real, z.imag, text, label="text", **middle, **style)


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
        page = Page(extent(motion, sketch, shown, paths), sketch.words > MANY)
        head = caption(motion, shown, degrees)
        lines = wrapped(head, ink.SMALL, page.width) if head else []
        page.lay_out(paths, len(lines))
        page.caption(lines)
        stage = Stage(sketch, motion, page.unit)
        picture = Picture(page.figure, page.axes, stage, shown)
        for k in shown[:0:-1]:
            page.draw([*shapes.links(stage, k, faint=True), *shapes.sliders(stage, k, True)])
        now = [*shapes.ground(stage, shown[0]), *shapes.pose(stage, shown[0])]
        page.draw(now)
        crowd = crowd_on(page, [now], paths)
        for spot in crowd.place(_labels(page, stage, shown[0])):
            page.draw(leader(page, spot))
            picture.labels.append(page.write(spot))
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
    return list(dict.fromkeys(int(good[round(f * (len(good) - 1))]) for f in FAINT_POSES))


def caption(motion: Motion, shown: Sequence[int], degrees: bool = True) -> str:
    """Driver coordinates of the poses, the main one first, and gravity."""
    parts = []
    for driver, q in motion.q.items():
        unit = motion.mechanism.driver_joint(driver).coordinate_unit
        turned = unit == "rad" and degrees
        values = [
            f"{math.degrees(q[k]):.4g}°" if turned else f"{q[k]:.4g}\u00a0{unit}" for k in shown
        ]
        faint = f" (faint: {', '.join(values[1:])})" if len(values) > 1 else ""
        name = motion.mechanism.of_driver(driver, "q")
        parts.append(f"{shown_name(name)}\u00a0= {values[0]}{faint}")
    g = motion.mechanism.scene.gravity.z
    if g:
        parts.append(f"gravity {abs(g):.4g}\u00a0m/s² {_pointing(g)}")
    return "; ".join(parts)


def _pointing(g: complex) -> str:
    """A direction as an arrow, or as an angle if none fits."""
    eighths = math.degrees(cmath.phase(g)) / 45
    if math.isclose(eighths, round(eighths)):
        return "→↗↑↖←↙↓↘"[round(eighths) % 8]
    return f"at {math.degrees(cmath.phase(g)):.4g}°"


def extent(
    motion: Motion, sketch: Sketch, shown: Sequence[int], paths: Paths
) -> tuple[complex, complex]:
    """Lower left and upper right corner [m] of what is drawn."""
    spots = [LinkSpot(body.link, z) for body in sketch.bodies for z in body.outline]
    spots += [LinkSpot(body.link, body.cm) for body in sketch.bodies if body.cm is not None]
    spots += [pin.spot for pin in sketch.pins]
    spots += [LinkSpot(s.guide.link, s.end(k)) for s in sketch.sliders for k in (0, 1)]
    spots += [spot for load in sketch.loads for spot in load.spots]
    places = [motion.at(*spot)[list(shown)] for spot in spots] + list(paths.values())
    z = np.concatenate([*places, np.zeros(0, complex)])
    z = z[np.isfinite(z)] if np.isfinite(z).any() else np.zeros(1, complex)
    return complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max())


# -- paths of markers ----------------------------------------------------------------------


def paths_of(motion: Motion, names: Iterable[str] | None) -> Paths:
    """Paths (n,) [m] of markers: those named, else the user's, else inner joints.

    Raises `RequestError` for names of no marker of a moving link.
    """
    s = motion.structure
    moving = _markers(motion.mechanism)
    if names is None:
        named = {marker: name for name, marker in moving.items()}
        names = [named[m] for m in _usual_paths(motion.mechanism, named)]
    names = list(names)
    wrong = [n for n in names if n not in moving]
    if wrong:
        raise RequestError(
            Problem(
                "unknown-marker",
                n,
                "no marker of a moving link has that name",
                f"markers: {listed(moving, 16)}",
                close_match(n, moving),
            )
            for n in wrong
        )
    return {n: motion.at(moving[n].on, marker_place(s, moving[n])) for n in names}


def _markers(mechanism: Compiled) -> dict[str, MarkerRef]:
    """Markers of moving links by name; a joint-based document has its own, and its pins."""
    s, names = mechanism.structure, mechanism.names
    every = {str(m): m for name in s.blocks for m in s.markers(name)}
    if names is None:
        return every
    found = {
        f"link.{link}.{marker}": ref
        for link, name in names.links.items()
        for marker, ref in name.markers.items()
        if ref.on != s.frame_link
    }
    pins = {str(ref): name for ref, name in mechanism.joint_names.items()}
    return found | {pins[place]: ref for place, ref in every.items() if place in pins}


def _usual_paths(mechanism: Compiled, named: Collection[MarkerRef]) -> list[MarkerRef]:
    s = mechanism.structure
    own = [m for m in shown_markers(mechanism) if m in named]
    inner = [
        m
        for name, block in s.blocks.items()
        for m in s.markers(name)
        if m.name in block.joints and not block.joints[m.name].outer
        if block.joints[m.name].kind == "R" and m in named
    ]
    return (own or inner)[-PATHS:]  # the last ones are the mechanism's outputs


# -- labels --------------------------------------------------------------------------------


def crowd_on(page: Page, frames: Sequence[Sequence[Shape]], paths: Paths) -> Crowd:
    """What labels on a page must spare: the shapes of each frame, and the paths."""
    crowd = Crowd(Rect(2, 2, page.width - 2, page.height - 2), len(frames))
    for f, drawn in enumerate(frames):
        for path in paths.values():
            crowd.add_line([page.points(z) for z in path], 0.4, f)
        for shape in drawn:
            points, weight = [page.points(z) for z in shape.points], SOLID[shape.kind]
            if shape.kind == "disc":
                crowd.add_disc(points[0], shape.radius + 1, weight, f)
                continue
            closed = [*points, points[0]] if shape.kind == "area" else points
            half = shape.width / 2 if shape.width > 2 else 0.0
            for shift in dict.fromkeys((-half, 0.0, half)):
                crowd.add_line([p + shift * (1 + 1j) for p in closed], weight, f)
    return crowd


def leader(page: Page, spot: Spot, frame: int = 0) -> list[Shape]:
    """The line from what a label names to the label, if that stands far off."""
    line = [page.metres(z) for z in spot.leader(frame)]
    return [Shape("leader", "line", line, 8, spot.label.colour, width=0.4)] if line else []


def joint_labels(page: Page, stage: Stage, frames: Sequence[int]) -> list[Label]:
    """Names of the joints, which keep their places over all frames."""
    sketch = stage.sketch
    named = [("\n".join(map(shown_name, pin.names)), pin.spot, SIZES.pin) for pin in sketch.pins]
    named += [(shown_name(s.name), s.point, SIZES.slider[1] + 2) for s in sketch.sliders]
    return [
        Label(text, [[page.points(stage.place(at, k)) for k in frames]], clearance=size)
        for text, at, size in named
    ]


def _labels(page: Page, stage: Stage, k: int) -> list[Label]:
    """Names of joints, drivers and a document's links, names and sizes of loads; pins first."""
    found = []
    if len(stage.sketch.pins) + len(stage.sketch.sliders) < CROWDED:
        found += joint_labels(page, stage, [k])
        for body in stage.sketch.bodies:
            if body.name:
                middle = sum(body.outline) / len(body.outline)
                z = page.points(stage.place(LinkSpot(body.link, middle), k))
                found.append(Label(shown_name(body.name), [[z]], ink.GREY, clearance=SIZES.beside))
    for name, way in shapes.drive_ways(stage, k).items():
        text = "q" if len(stage.sketch.drives) == 1 else f"{shown_name(name)}.q"
        anchors = [[page.points(z)] for z in way[:: max(1, len(way) // 2)]]
        found.append(Label(text, anchors, ink.DRIVE))
    for load in stage.sketch.loads:
        found += _load_label(page, stage, load, k)
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


def _load_label(page: Page, stage: Stage, load: LoadMark, k: int) -> list[Label]:
    text = load_text(stage, load, k)
    if load.kind in ("spring", "strut"):
        a, b = (page.points(stage.place(spot, k)) for spot in load.spots)
        anchors = [[a + (b - a) * t] for t in (0.5, 0.35, 0.65, 0.2, 0.8)]
        return [Label(text, anchors, ink.SPRING, clearance=4.0)]
    ways = shapes.load_ways(stage, load, k)
    if not ways:
        return []
    way = [page.points(z) for z in ways[0]]
    if load.unit == "N":
        return [Label(text, [[way[-1]], [way[0]]], ink.LOAD, cmath.phase(way[-1] - way[0]))]
    return [Label(text, [[sum(way) / len(way)]], ink.LOAD, clearance=SIZES.couple)]
