"""The mechanism at poses as a picture: links, joints, loads, names, paths of markers.

Centrodes are where the instant centre of a link goes, on the frame and on the link itself; the
moving one, drawn in the first pose, rolls on the fixed one.

Source: Hunt, Kinematic Geometry of Mechanisms, 1978, ch. 2 (centrodes).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.instant_centres import instant_centre
from blockmech.compiled import Compiled
from blockmech.draw import shapes
from blockmech.draw.labels import Label
from blockmech.draw.motion import Motion, moves
from blockmech.draw.page import Page, Paths, unit_of
from blockmech.draw.shapes import Stage
from blockmech.draw.sketch import LoadMark, Sketch, shown_markers, sketch_of, user_markers
from blockmech.figures import palette as ink
from blockmech.figures.curves import reach
from blockmech.figures.palette import MOST, SIZES
from blockmech.figures.paper import UNBROKEN, amount, shown_name, styled
from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import among
from blockmech.model.joints.dimensions import AngleOfLines, Dimension, Length
from blockmech.model.spots import marker_place
from blockmech.model.structure import MarkerRef
from blockmech.result.remarks import missing_turns
from blockmech.result.result import Result
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.typing import Coordinates, Vectors

if TYPE_CHECKING:
    from matplotlib.text import Text

MANY = 9  # labels from which the picture is two columns wide
TILE, ROOM = 2.4, 1.3  # [in] side of a tile; of the mechanism's size that it holds
POSES = (0.125, 0.375, 0.625, 0.875)  # of the range; the first is the main one, others faint


@dataclass
class Picture:
    """A drawn mechanism. Labels of artists tell what they are: ``link:``, ``pin:``, ``load:``."""

    page: Page
    stage: Stage
    labels: list[Text] = field(default_factory=list)

    @property
    def figure(self) -> Any:
        """matplotlib's figure."""
        return self.page.figure

    @property
    def axes(self) -> Any:
        """Its axes, in metres or in the unit of length that is displayed."""
        return self.page.axes


def draw_mechanism(
    mechanism: Compiled,
    at: Coordinates | None = None,
    trace: Iterable[str] | None = None,
    curves: Paths | None = None,
    *,
    display: Iterable[str] = (),
    named: bool = True,
    sheet: bool = False,
) -> Picture:
    """Draw a mechanism at poses: the first in full, the others faintly.

    Parameters
    ----------
    at : float or (n,) [rad or m], or a mapping driver -> (n,)
        Driver coordinates; by default four poses over the range of the laws of motion.
    trace : names of markers whose paths are drawn, where the range is known; by
        default the user's markers, or inner joints if there are none
    curves : name -> places (n,) [m] to be drawn in place of paths
    display : units of lengths and angles, see `Result.to`
    named : with names and a caption: the title of the document, poses and gravity
    sheet : on a sheet that has the title: with lengths of links in its place

    Raises `RequestError` where the range is not known and no pose is named, and the
    errors of `Compiled.run` where the first pose cannot be reached.
    """
    swept = at is None or all(d in mechanism.scene.drive for d in mechanism.drivers)
    sweep = moves(mechanism, samples=DEFAULT_SAMPLES) if swept else None
    motion = moves(mechanism, at) if at is not None or sweep is None else sweep
    motion = motion.only(_poses(motion, named=at is not None)).to(*display)
    sketch = sketch_of(sweep if sweep is not None and sweep.feasible.any() else motion)
    motion = motion if sketch.shows_poses else motion.only([0])
    paths = paths_of(sweep, trace) if sweep is not None and sweep.result.n > 1 else {}
    paths = worded(paths) if curves is None else curves
    title = mechanism.document.title if mechanism.document and not sheet else ""
    text = _heading(title, motion, sweep if paths else None) if named else ""
    with styled():
        page = page_of(sketch, motion, paths, [text] * bool(text))
        stage = Stage(sketch, motion, page.unit)
        picture = Picture(page, stage)
        page.write_caption(text)
        faint = [*shapes.links(stage, faint=True), *shapes.sliders(stage, faint=True)]
        for k in range(len(motion.samples) - 1, 0, -1):
            for shape in faint:
                page.draw(shape, k)
        main_shapes = shapes.shapes_of(stage)
        for shape in main_shapes:
            page.draw(shape)
        if not named:
            return picture
        crowd = page.crowd(main_shapes, paths)
        lengths = side_lengths(page, stage) if sheet else ()
        for position in map(crowd.place, (*_labels(page, stage), *lengths)):
            page.draw(page.leader(position))
            picture.labels.append(page.write(position))
    return picture


def draw_result(result: Result, sheet: bool = False) -> Picture:
    """Draw the mechanism in some poses of a run; ``sheet`` is that of `draw_mechanism`.

    Paths of markers are drawn where laws of motion move it. Raises the errors of `draw_mechanism`.
    """
    good = np.setdiff1d(np.arange(result.n), result.quality.gaps)
    number = min(len(POSES), len(good))
    some = good[np.linspace(0, len(good), number, endpoint=False, dtype=int)]
    drivers = enumerate(result.mechanism.drivers)
    at = {driver: result.samples.coordinate(i)[some] for i, driver in drivers}
    return draw_mechanism(result.mechanism, at, display=result._display, sheet=sheet)


def draw_tile(mechanism: Compiled, at: Coordinates | None = None) -> Any:
    """A square figure of a mechanism without axes and words, one of many in a table.

    Arguments and errors are those of `draw_mechanism`.
    """
    picture = draw_mechanism(mechanism, at, named=False)
    figure, axes = picture.figure, picture.axes
    if (legend := axes.get_legend()) is not None:
        legend.remove()
    axes.set_axis_off()
    axes.set_position((0.0, 0.0, 1.0, 1.0))
    figure.set_size_inches(TILE, TILE)
    points = points_of(picture.stage.sketch, picture.stage.motion, {})
    low = complex(points.real.min(), points.imag.min())
    high = complex(points.real.max(), points.imag.max())
    span = max((high - low).real, (high - low).imag) or 1.0  # of a single point any will do
    half, middle = span * ROOM / 2, (low + high) / 2
    axes.set(xlim=(middle.real - half, middle.real + half))
    axes.set(ylim=(middle.imag - half, middle.imag + half))
    return figure


def page_of(sketch: Sketch, motion: Motion, paths: Paths, captions: Iterable[str]) -> Page:
    """A page for all that is drawn of a mechanism at all samples, arrows of forces too."""
    wide, points = sketch.words > MANY, points_of(sketch, motion, paths)
    stage = Stage(sketch, motion, unit_of(points, wide))
    ways = (shapes.load_ways(stage, load) for load in sketch.loads if load.unit == "N")
    arrows = [arrow for load in ways for arrow in load]
    ends = [points, *(z.ravel() for z in (*arrows, *shapes.dimension_lines(stage).values()))]
    z = np.concatenate(ends)
    return Page(z[np.isfinite(z)], wide, paths, captions, motion.display)


def points_of(sketch: Sketch, motion: Motion, paths: Paths) -> Vectors:
    """All places [m] that a picture has to hold; the origin if there are none."""
    points = [motion.at(*spot) for spot in sketch.spots] + list(paths.values())
    z = np.concatenate([*points, np.zeros(0)])
    return z[np.isfinite(z)] if np.isfinite(z).any() else np.zeros(1, complex)


def _poses(motion: Motion, named: bool) -> list[int]:
    """Samples to draw, the main one first."""
    good = np.flatnonzero(motion.feasible)
    if not len(good) or (named and good[0] != 0):
        motion.refuse()
    if named:
        return good.tolist()
    if len(motion.q) == 1:  # by coordinate, so that a motion to and fro shows no pose twice
        (q,) = motion.q.values()
        _, first = np.unique(np.round(q[good] / (np.ptp(q[good]) or 1.0), 6), return_index=True)
        good = good[first]
    return list(dict.fromkeys(int(good[round(f * (len(good) - 1))]) for f in POSES))


# -- captions ------------------------------------------------------------------------------


def _heading(title: str, motion: Motion, traced: Motion | None) -> str:
    """A title, the poses, and the turns that traced paths leave out."""
    poses = caption(motion, range(len(motion.samples)))
    notes = missing_turns(motion.mechanism, traced.result.samples.inputs) if traced else []
    return "\n".join(filter(None, [title, poses, *notes]))


def caption(motion: Motion, samples: Sequence[int]) -> str:
    """Driver coordinates of the poses, the main one first, and gravity."""
    parts = []
    for driver, q in motion.q.items():
        unit = motion.mechanism._coordinate_units[driver]
        values = [amount(q[k], unit, motion.display).translate(UNBROKEN) for k in samples]
        faint = f" (faintly at {', '.join(values[1:])})" if len(values) > 1 else ""
        parts.append(f"{shown_name(driver)} at\u00a0{values[0]}{faint}")
    g = motion.mechanism.scene.gravity.z
    if g:
        size = amount(abs(g), "m/s2", motion.display).translate(UNBROKEN)
        parts.append(f"gravity {size} {_pointing(g, motion.display)}")
    return "; ".join(parts)


def _pointing(g: complex, display: Iterable[str]) -> str:
    """A direction as an arrow, or as an angle if none fits."""
    angle = cmath.phase(g)
    eighths = math.degrees(angle) / 45
    if math.isclose(eighths, round(eighths)):
        return "→↗↑↖←↙↓↘"[round(eighths) % 8]
    return f"at {amount(angle, 'rad', display)}"


# -- paths of markers ----------------------------------------------------------------------


def paths_of(motion: Motion, names: Iterable[str] | None) -> Paths:
    """Paths (n,) [m] of markers: those named, else the user's, else inner joints.

    Raises `RequestError` for names of no marker of a moving link.
    """
    moving = _markers(motion.mechanism)
    # The user's markers, else the inner revolute joints; the last ones are the outputs.
    blocks = motion.mechanism.structure.blocks
    named = {marker: name for name, marker in moving.items()}
    markers = [named[m] for m in shown_markers(motion.mechanism) if m in named]
    inner = [
        named[m]
        for name, block in blocks.items()
        for m in motion.mechanism.structure.markers(name)
        if (joint := block.joints.get(m.name)) is not None and m in named
        if joint.kind == "R" and not joint.outer
    ]
    names = (markers or inner)[-len(ink.SERIES) :] if names is None else names
    names = among(moving, "moving marker", names, "unknown-marker")
    return {n: motion.at(moving[n].on, marker_place(motion.structure, moving[n])) for n in names}


def worded(paths: Paths) -> Paths:
    """Paths of markers with the words of a legend."""
    return {f"path of {shown_name(name)}": path for name, path in paths.items()}


def _markers(mechanism: Compiled) -> dict[str, MarkerRef]:
    """Markers of moving links by name; a joint-based document has its own, and its pins."""
    s, names = mechanism.structure, mechanism.names
    every = {str(m): m for name in s.blocks for m in s.markers(name)}
    if names is None:
        return every
    markers = {f"link.{name}": ref for name, ref in user_markers(mechanism).items()}
    pins = {str(ref): name for ref, name in mechanism._joint_names.items()}
    return markers | {pins[key]: ref for key, ref in every.items() if key in pins}


# -- labels --------------------------------------------------------------------------------


def joint_labels(page: Page, stage: Stage) -> Iterator[Label]:
    """Names of the joints, which keep their places over all samples."""
    sketch = stage.sketch
    marks = [("\n".join(map(shown_name, x.names)), x.spot, SIZES.pin) for x in sketch.pins]
    marks += [(shown_name(x.name), x.spot, SIZES.marker) for x in sketch.points]
    marks += [(shown_name(x.name), x.point, SIZES.slider[1] + 2) for x in sketch.sliders]
    for text, spot, clearance in marks:
        yield Label(text, [page.points(stage.motion.at(*spot))], clearance=clearance)


def _labels(page: Page, stage: Stage) -> Iterator[Label]:
    """Names of joints, drivers and a document's links, names and sizes of loads; pins first."""
    if len(stage.sketch.pins) + len(stage.sketch.sliders) < MOST:
        yield from joint_labels(page, stage)
        for body in stage.sketch.bodies:
            if body.name:
                z = page.points(stage.motion.at(*body.middle))
                yield Label(shown_name(body.name), [z], ink.GREY, clearance=SIZES.label_gap)
    marks = {mark.name: mark.dimension for mark in stage.sketch.dimensions}
    for name, line in shapes.dimension_lines(stage).items():
        if np.isfinite(middle := page.points(line[:, :1].mean(axis=0))).all():
            yield Label(_dimension_text(marks[name], stage.motion.display), [middle], ink.GREY)
    drives = shapes.drive_ways(stage)
    for name, arc in drives.items():
        text = "q" if len(drives) == 1 else f"{shown_name(name)}.q"
        yield Label(text, page.points(arc[:: max(1, len(arc) // 2)]), ink.DRIVE)
    for load in stage.sketch.loads:
        yield from _load_label(page, stage, load)


def side_lengths(page: Page, stage: Stage) -> Iterator[Label]:
    """Lengths of bars and of the sides of plates, of sides that have room for them."""
    for body in stage.sketch.bodies:
        corners = [complex(stage.motion.at(body.link, z)[0]) for z in body.outline]
        for a, b in pairwise([*corners, *corners[: len(corners) > 2]]):
            if abs(b - a) > shapes.DISTANCE * page.unit:
                anchors = [page.points(np.array([a + (b - a) * t])) for t in (0.5, 0.35, 0.65)]
                length = f"{page.scale * abs(b - a):.4g}"
                yield Label(length, anchors, ink.GREY, clearance=SIZES.label_gap)


def _dimension_text(dimension: Dimension, display: Iterable[str]) -> str:
    """The sign of a dimension, and its value."""
    if isinstance(dimension, Length):
        return amount(dimension.value, "m", display)
    if not isinstance(dimension, AngleOfLines):
        return dimension.sign
    return f"{dimension.sign} {amount(dimension.value, 'rad', display)}"


def load_text(motion: Motion, load: LoadMark, k: int = 0) -> str:
    """Name and size of a load."""
    values, name = motion.efforts[load.name], shown_name(load.name)
    size = float(abs(values[0][k])) if values is not None else math.nan
    return f"{name} {amount(size, load.unit, motion.display)}" if math.isfinite(size) else name


def _load_label(page: Page, stage: Stage, load: LoadMark) -> Iterator[Label]:
    text = load_text(stage.motion, load)
    if load.is_line:
        a, b = (page.points(stage.motion.at(*spot)) for spot in load.spots)
        offset = np.exp(1j * np.angle(b - a)) * load.offset * 1j
        anchors = [a + offset + (b - a) * t for t in (0.5, 0.35, 0.65, 0.2, 0.8)]
        yield Label(text, anchors, ink.SPRING, clearance=4.0)
        return
    ways = [page.points(arrow) for arrow in shapes.load_ways(stage, load)]
    if not ways or not np.isfinite(ways[0][:, 0]).all():
        return
    if load.unit == "N":
        start, end = ways[0][0], ways[0][-1]
        yield Label(text, [end, start], ink.LOAD, cmath.phase(complex((end - start)[0])))
    else:
        yield Label(text, [ways[0].mean(axis=0)], ink.LOAD, clearance=SIZES.couple)


WINDOW = 2.0  # sizes of the mechanism, beyond which a centrode is not drawn
SWEEP = SCANNED + 1  # samples of the range


def centrodes(mechanism: Compiled, link: str, at: Any = None) -> Paths:
    """The fixed and the moving centrode (n,) of a link [m], the latter in the first pose.

    Parameters
    ----------
    at : coordinates of the driver [rad or m]; by default the range of its law of motion

    Raises `RequestError` for a link that there is not, or a mechanism of several drivers.
    """
    (driver,) = mechanism.drivers if len(mechanism.drivers) == 1 else ("",)
    if at is None and driver:
        at = mechanism.samples(None, SWEEP, None, None, None).inputs["q_0"]
    centre = instant_centre(mechanism, link, at=at)
    name = link if mechanism.names is None else f"link.{link}"
    run = mechanism.run(at=at, want=[f"{name}.p", f"{name}.angle"], on_gap="mark")
    o, e = run[f"{name}.p"], np.exp(1j * run[f"{name}.angle"])
    with np.errstate(invalid="ignore"):
        moving = o[0] + e[0] * np.conj(e) * (centre - o)
        in_window = np.abs(centre - np.nanmean(o)) <= WINDOW * reach(mechanism)
    return {
        "fixed centrode": np.where(in_window, centre, np.nan),
        "moving centrode": np.where(in_window, moving, np.nan),
    }
