"""The mechanism in motion: a GIF, or one HTML file with its own player.

Both draw the shapes of `blockmech.draw.shapes`, frame by frame. Axes and scale are
fixed over the whole motion, and so are the places of names beside their joints. Only
poses that close are frames; a motion that does not end where it began is played to
and fro.
"""

from __future__ import annotations

import html
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from typing import Any

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw import palette as ink
from blockmech.draw import shapes
from blockmech.draw.labels import Spot
from blockmech.draw.mechanism import (
    MANY,
    Page,
    Paths,
    caption,
    crowd_on,
    extent,
    joint_labels,
    leader,
    load_text,
    paths_of,
)
from blockmech.draw.motion import moves, moves_of_result
from blockmech.draw.paper import scaled_unit, shown_name, styled, wrapped
from blockmech.draw.shapes import Shape, Stage
from blockmech.draw.sketch import sketch_of
from blockmech.errors import Problem, RequestError
from blockmech.result import Result

FRAMES = (2, 2000)  # fewest and most
DPI = {False: 150, True: 110}  # of a GIF one column wide, or two
TICK = 0.02  # [s] shortest time of a frame that browsers honour
NAMES = 12  # joints up to which all are named
SEEN = 8  # frames that show whether a name's place is free
FRICTION_POWER = "mechanism.friction_power"


@dataclass
class Reel:
    """An animation before it is drawn: the stage on its page, the frames' samples, the paths."""

    stage: Stage
    page: Page
    order: Sequence[int]
    paths: Paths
    seconds: float
    degrees: bool
    lines: int = 0  # of the caption
    spots: Sequence[Spot] = ()  # of the joints' names, one frame for each of ``order``

    @property
    def name(self) -> str:
        """Name of the mechanism."""
        return self.stage.motion.mechanism.name

    def caption(self, k: int) -> list[str]:
        """Lines at sample k: coordinates, time and friction where they are known, loads."""
        motion = self.stage.motion
        parts = [caption(motion, [k], self.degrees)]
        time, run = motion.result.known_time(), motion.result
        if time is not None and math.isfinite(time[k]):
            parts.append(f"t\u00a0=\u00a0{time[k]:.3f}\u00a0s")
        if FRICTION_POWER in run:
            power = float(run[FRICTION_POWER][k])
            factor, unit = scaled_unit("W", abs(power))
            parts.append(f"friction takes {power * factor:.4g}\u00a0{unit}")
        if time is not None and rests(run, time[k], [rate[k] for rate in motion.q_rate.values()]):
            parts.append("at rest")
        loads = [load_text(self.stage, load, k) for load in self.stage.sketch.loads]
        lines = wrapped("; ".join(parts), ink.SMALL, self.page.width)
        return lines + wrapped("; ".join(loads), ink.SMALL, self.page.width) if loads else lines

    def frame(self, number: int) -> list[Shape]:
        """What moves in a frame."""
        lines = [shape for spot in self.spots for shape in leader(self.page, spot, number)]
        return [*shapes.pose(self.stage, self.order[number]), *lines]


def rests(run: Result, time: float, rates: Sequence[float]) -> bool:
    """Whether friction holds a mechanism that moved: nothing moves after an event "rest"."""
    motion = run.motion
    stops = [] if motion is None else [e.t for e in motion.events if e.kind == "rest"]
    return bool(stops) and time >= min(stops) and not any(rates)


def reel_of(
    subject: Compiled | Result,
    at: Any = None,
    *,
    frames: int = 72,
    seconds: float = 3.0,
    trace: Iterable[str] | None = None,
    degrees: bool = True,
    every: int = 0,
) -> Reel:
    """Prepare the animation of a mechanism over its range, or of the samples of a run.

    ``every`` takes each so many sample of a run, played forward only; 0 takes all, to and
    fro where they do not return. Raises `RequestError` where the range is not known or a
    number makes no sense, and the errors of `Compiled.run` where no pose closes.
    """
    _check(frames, seconds)
    if isinstance(subject, Result):
        motion = moves_of_result(subject)
    elif at is None:
        motion = moves(subject, samples=frames + 1)
    else:
        motion = moves(subject, at)
    good = [int(k) for k in np.flatnonzero(motion.feasible)]
    if not good:
        motion.refuse(0)
    if every:
        good = [k for k in good if k % every == 0] or good[:1]
    elif len(good) > 1:
        good = good[:-1] if motion.closes(good[0], good[-1]) else good + good[-2:0:-1]
    sketch = sketch_of(motion)
    paths = paths_of(motion, trace) if motion.n > 1 else {}
    page = Page(extent(motion, sketch, good, paths), sketch.words > MANY)
    reel = Reel(Stage(sketch, motion, page.unit), page, good, paths, seconds, degrees)
    reel.lines = max(len(reel.caption(k)) for k in good)
    with styled():
        page.lay_out(paths, reel.lines)
    if len(sketch.pins) <= NAMES:
        reel.spots = _spots(reel)
    return reel


def _check(frames: int, seconds: float) -> None:
    wrong: list[tuple[str, object, str]] = []
    if not isinstance(frames, int) or not FRAMES[0] <= frames <= FRAMES[1]:
        wrong.append(("frames", frames, f"a whole number from {FRAMES[0]} to {FRAMES[1]}"))
    if not isinstance(seconds, int | float) or not 0 < seconds < math.inf:
        wrong.append(("seconds", seconds, "a positive number of seconds"))
    if wrong:
        raise RequestError(
            Problem("bad-value", name, f"got {value!r}", f"valid: {valid}", "")
            for name, value, valid in wrong
        )


def _spots(reel: Reel) -> list[Spot]:
    """Places of the joints' names that are free in most frames."""
    page, stage = reel.page, reel.stage
    seen = reel.order[:: math.ceil(len(reel.order) / SEEN)]
    still = shapes.ground(stage, reel.order[0])
    drawn = [[*still, *shapes.pose(stage, k)] for k in seen]
    found = crowd_on(page, drawn, {}).place(joint_labels(page, stage, seen))
    labels = joint_labels(page, stage, reel.order)
    pairs = zip(found, labels, strict=True)
    return [Spot(label, s.anchor, s.offset, s.half, s.far) for s, label in pairs]


# -- GIF -----------------------------------------------------------------------------------


def gif(reel: Reel) -> bytes:
    """The animation as a GIF that repeats for ever.

    matplotlib's own writer draws the axes again for every frame, which takes four times as
    long, and gives each frame colours of its own, which flicker.
    """
    from PIL import Image

    pictures = []
    with styled():
        figure = reel.page.figure
        figure.set_dpi(DPI[reel.page.wide])
        canvas = figure.canvas
        reel.page.draw(shapes.ground(reel.stage, reel.order[0]))
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        for number in range(len(reel.order)):
            canvas.restore_region(still)
            _draw_frame(reel, number)
            pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
    some = pictures[:: math.ceil(len(pictures) / 4)]
    sheet = Image.fromarray(np.concatenate([np.asarray(p) for p in some]))
    colours = sheet.quantize(method=Image.Quantize.MAXCOVERAGE)
    frames = [p.quantize(palette=colours, dither=Image.Dither.NONE) for p in pictures]
    ticks = max(round(1000 * max(reel.seconds / len(frames), TICK), -1), 10)
    buffer = io.BytesIO()
    forever: dict[str, Any] = {"save_all": True, "loop": 0, "duration": int(ticks)}
    frames[0].save(buffer, "GIF", append_images=frames[1:], optimize=False, **forever)
    return buffer.getvalue()


def _draw_frame(reel: Reel, number: int) -> None:
    """Draw the moving artists of one frame over the still picture, and take them away."""
    page = reel.page
    artists = page.draw(reel.frame(number))
    artists += [page.write(spot, number) for spot in reel.spots]
    artists += page.caption(reel.caption(reel.order[number]))
    for artist in sorted(artists, key=lambda a: a.get_zorder()):
        artist.draw(page.figure.canvas.get_renderer())
    for artist in artists:
        artist.remove()


# -- HTML ----------------------------------------------------------------------------------


def player(reel: Reel) -> str:
    """The animation as one HTML document that needs nothing else."""
    template = resources.files("blockmech.draw").joinpath("player.html").read_text("utf-8")
    data = json.dumps(player_data(reel), ensure_ascii=True, separators=(",", ":"))
    data = data.replace("<", "\\u003c")  # no name can end the script
    return template.replace("__TITLE__", html.escape(reel.name)).replace("__DATA__", data)


def player_data(reel: Reel) -> dict[str, Any]:
    """What the player draws: shapes in points of the page, y upward.

    Shapes that do not move are ``still``; of the others the places change from frame
    to frame, and the style is kept apart from them.
    """
    page = reel.page
    styles: dict[str, int] = {}
    frames = []
    for number, k in enumerate(reel.order):
        moving = sorted(reel.frame(number), key=lambda s: s.order)
        rows = [
            [styles.setdefault(json.dumps(_style(s)), len(styles)), *_places(page, s.points)]
            for s in moving
        ]
        texts = [
            [line, round(z.real, 2), round(z.imag + down, 2), spot.label.colour]
            for spot in reel.spots
            for line, z, down in _lines(spot, number)
        ]
        frames.append({"shapes": rows, "texts": texts, "caption": "\n".join(reel.caption(k))})
    ground = sorted(shapes.ground(reel.stage, reel.order[0]), key=lambda s: s.order)
    return {
        "width": round(page.width, 2),
        "height": round(page.height, 2),
        "seconds": reel.seconds,
        "styles": [json.loads(s) for s in styles],
        "still": [[_style(s), *_places(page, s.points)] for s in ground],
        "paths": [_path(name, path, i, page) for i, (name, path) in enumerate(reel.paths.items())],
        "ticks": [_ticks(page.axes.xaxis), _ticks(page.axes.yaxis)],
        "corner": [page.corner.real, page.corner.imag],
        "unit": page.unit,
        "frames": frames,
    }


def _lines(spot: Spot, number: int) -> list[tuple[str, complex, float]]:
    """Lines of a label, its middle, and how far each lies above it [pt]."""
    lines = spot.label.text.split("\n")
    high = 2 * spot.half.imag / len(lines)
    middle = spot.centre(number)
    return [(line, middle, high * ((len(lines) - 1) / 2 - i)) for i, line in enumerate(lines)]


def _places(page: Page, points: Iterable[complex]) -> list[float]:
    return [round(x, 2) for z in map(page.points, points) for x in (z.real, z.imag)]


def _style(shape: Shape) -> dict[str, Any]:
    style = {**asdict(shape), "round": shape.rounded}
    return {k: style[k] for k in ("kind", "stroke", "fill", "width", "radius", "dash", "round")}


def _path(name: str, path: Any, number: int, page: Page) -> dict[str, Any]:
    """A marker's path: its pieces between gaps."""
    colour, dash = ink.curve_style(number)
    known = np.flatnonzero(np.isfinite(path))
    cuts = np.flatnonzero(np.diff(known) > 1) + 1
    pieces = [_places(page, path[piece]) for piece in np.split(known, cuts) if len(piece)]
    label = f"path of {shown_name(name)}"
    return {"label": label, "colour": colour, "dash": list(dash), "pieces": pieces}


def _ticks(axis: Any) -> list[float]:
    """Round numbers [m] on an axis."""
    low, high = sorted(axis.get_view_interval())
    return [float(f"{v:.6g}") for v in axis.get_majorticklocs() if low <= v <= high]
