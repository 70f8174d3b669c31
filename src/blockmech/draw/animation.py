"""The mechanism in motion: a GIF, a film, or one HTML file with its own player.

All show the shapes of `blockmech.draw.shapes`, frame by frame. Axes and scale are
fixed over the whole motion; names keep their places beside their joints while those are
free. Only poses that close are frames; a motion that does not end where it began is
played to and fro.
"""

from __future__ import annotations

import html
import io
import json
import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.draw.mechanism import caption, joint_labels, load_text, page_of, paths_of, worded
from blockmech.draw.motion import Motion
from blockmech.draw.page import Page, Shape, move
from blockmech.draw.shapes import Stage, shapes_of
from blockmech.draw.sketch import Sketch, sketch_of
from blockmech.figures import palette as ink
from blockmech.figures.paper import (
    MOVING,
    UNBROKEN,
    amount,
    new_figure,
    shown_name,
    styled,
    suffix_of,
)
from blockmech.ground.arguments import declared
from blockmech.ground.errors import needed, refused
from blockmech.ground.files import AnyPath, writing
from blockmech.result.result import Result
from blockmech.typing import Data, Vectors

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.axis import XAxis, YAxis

FRAME = 0.04  # [s] on the screen
RATE = round(1 / FRAME)  # frames of a second
NAMES = 12  # joints up to which all are named
FRICTION_POWER = "mechanism.friction_power"


class Animation:
    """An animation; a notebook shows its player. ``path`` is its file, if there is one.

    Attributes
    ----------
    motion : the poses that are frames
    order : the frames in the order in which they are shown

    >>> film = bm.draw.animate(mech, frames=4)
    >>> film
    <Animation of ruiz_fourbar: 4 frames>
    """

    def __init__(
        self,
        motion: Motion,
        seconds: float = 3.0,
        trace: Iterable[str] | None = None,
        every: int = 0,
    ) -> None:
        """Lay out the frames of a motion.

        ``every`` takes each so many sample, played forward only; 0 takes all, to and fro
        where they do not return. Raises the errors of `Compiled.run` where no pose closes.
        """
        good = np.flatnonzero(motion.feasible)
        if not len(good):
            motion.refuse()
        sketch = sketch_of(motion)
        paths = paths_of(motion, trace) if motion.result.n > 1 else {}
        if every:
            good = good[good % every == 0] if (good % every == 0).any() else good[:1]
        round_again = len(good) > 1 and motion.only(good).returns
        if round_again and not every:
            good = good[:-1]
        back = () if round_again or every else range(len(good) - 2, 0, -1)
        self.order = [*range(len(good)), *back]
        self.motion = motion = motion.only(good)
        self.seconds = seconds
        self.path: Path | None = None
        self.captions = [_caption(motion, sketch, k) for k in range(len(good))]
        with styled():
            self.page = page_of(sketch, motion, worded(paths), self.captions)
        self.paths = paths
        stage = Stage(sketch, motion, self.page.unit)
        self.shapes = sorted(shapes_of(stage), key=lambda shape: shape.order)
        self.names = []
        if len(sketch.pins) <= NAMES:
            crowd = self.page.crowd(self.shapes, paths, range(0, len(good), -(-len(good) // RATE)))
            self.names = [*map(crowd.place, joint_labels(self.page, stage))]
            self.shapes += [self.page.leader(p, len(good)) for p in self.names if p.distant.any()]

    def __repr__(self) -> str:
        return f"<Animation of {self.motion.result.mechanism.name}: {len(self.order)} frames>"

    @cached_property
    def html(self) -> str:
        """The player as one self-contained HTML document."""
        template = resources.files("blockmech.draw").joinpath("player.html").read_text("utf-8")
        data = json.dumps(player_data(self), ensure_ascii=True, separators=(",", ":"))
        data = data.replace("<", "\\u003c")  # no name can end the script
        title = html.escape(self.motion.mechanism.name)
        return template.replace("__TITLE__", title).replace("__DATA__", data)

    @cached_property
    def pictures(self) -> list[Any]:
        """The frames as arrays (height, width, 3) of bytes, drawn once each.

        matplotlib's own writers draw the axes again for every frame, which takes four times as
        long.
        """
        page, figure = self.page, self.page.figure
        with styled():
            figure.set_dpi(110 if page.wide else 150)
            for shape in (shape for shape in self.shapes if shape.still):
                page.draw(shape)
            page.write_caption("")
            figure.canvas.draw()
            background = figure.canvas.copy_from_bbox(figure.bbox)
            moving = [(page.draw(shape), shape) for shape in self.shapes if not shape.still]
            names = [(page.write(position), position) for position in self.names]
            pictures = []
            for k, text in enumerate(self.captions):
                figure.canvas.restore_region(background)
                for artist, shape in moving:
                    move(artist, shape, k)
                for artist, position in names:
                    z = page.metres(position.centre(k))
                    artist.set_position((z.real, z.imag))
                for artist in [*(a for a, _ in [*moving, *names]), page.write_caption(text)]:
                    figure.draw_artist(artist)
                pictures.append(np.array(figure.canvas.buffer_rgba())[..., :3])
        return pictures

    @cached_property
    def gif(self) -> bytes:
        """A GIF that repeats for ever."""
        from PIL import Image

        pictures = self.pictures
        # One palette: with colours of its own each frame would flicker.
        some = pictures[:: math.ceil(len(pictures) / 4)]
        colours = Image.fromarray(np.concatenate(some)).quantize(method=Image.Quantize.MAXCOVERAGE)
        plain = [
            Image.fromarray(p).quantize(palette=colours, dither=Image.Dither.NONE) for p in pictures
        ]
        first, *rest = (plain[k] for k in self.order)
        # Tens of milliseconds; browsers honour no fewer than two of them.
        ticks = max(round(1000 * self.seconds / len(self.order), -1), 20)
        buffer = io.BytesIO()
        forever: Data = {"save_all": True, "loop": 0, "duration": int(ticks)}
        first.save(buffer, "GIF", append_images=rest, optimize=False, **forever)
        return buffer.getvalue()

    @cached_property
    def mp4(self) -> bytes:
        """A film in H.264, by an installed ffmpeg or that of the extra ``film``.

        Raises `MissingEngineError` without either.
        """
        import matplotlib

        program = matplotlib.rcParams["animation.ffmpeg_path"]
        if shutil.which(program) is None:
            instead = (
                "a film is written by ffmpeg, and none is on the PATH; .gif and .html need none"
            )
            program = needed("imageio_ffmpeg", "draw", "film", instead).get_ffmpeg_exe()
        # H.264 with the colours that every player knows needs an even number of rows and columns.
        frames = [p[: p.shape[0] // 2 * 2, : p.shape[1] // 2 * 2] for p in self.pictures]
        height, width, _ = frames[0].shape
        count = max(round(self.seconds * RATE), 1)
        indices = (self.order[k * len(self.order) // count] for k in range(count))
        with tempfile.TemporaryDirectory() as folder:
            video = Path(folder, "film.mp4")
            size, rate = f"{width}x{height}", f"{RATE}"
            raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate]
            coded = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
            command = [program, "-v", "error", "-y", *raw, "-i", "-", *coded, str(video)]
            completed = subprocess.run(
                command, input=b"".join(frames[k].tobytes() for k in indices), capture_output=True
            )
            if completed.returncode:
                message = completed.stderr.decode(errors="replace").strip()[:300]
                raise refused("draw", f"ffmpeg fails: {message}", "name the file .gif or .html")
            return video.read_bytes()

    def to_matplotlib(self) -> FuncAnimation:
        """The frames as matplotlib's `FuncAnimation`, with ``to_jshtml()`` and writers of films."""
        from matplotlib.animation import FuncAnimation

        height, width, _ = self.pictures[0].shape
        dpi = self.page.figure.dpi
        figure = new_figure(width * 72 / dpi, height * 72 / dpi, dpi=dpi)
        picture = figure.figimage(self.pictures[0])

        def show(k: int) -> tuple[Any]:
            picture.set_data(self.pictures[k])
            return (picture,)

        pause = 1000 * self.seconds / len(self.order)
        return FuncAnimation(figure, show, self.order, interval=pause, blit=True)

    @declared
    def save(self, path: AnyPath) -> Animation:
        """Write a .gif, .html or .mp4 file; raises the errors of `draw`."""
        suffix = suffix_of(path, "an animation", MOVING)
        content = {".gif": "gif", ".mp4": "mp4"}.get(suffix)
        data = self.html.encode() if content is None else getattr(self, content)
        with writing(path) as stream:
            stream.write(data)
        self.path = Path(path)
        return self

    def _repr_html_(self) -> str:
        inside = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{inside}" width="100%" height="560" frameborder="0"></iframe>'


# -- captions ------------------------------------------------------------------------------


def _caption(motion: Motion, sketch: Sketch, k: int) -> str:
    """Coordinates, time and friction where they are known, and the loads in a second line."""
    parts, time, run = [caption(motion, [k])], motion.time, motion.result
    if time is not None and math.isfinite(time[k]):
        parts.append(f"t\u00a0=\u00a0{time[k]:.3f}\u00a0s")
    if FRICTION_POWER in run:
        power = float(run[FRICTION_POWER][motion.samples[k]])
        loss = amount(power, "W", motion.display).translate(UNBROKEN)
        parts.append(f"friction takes {loss}")
    if time is not None and rests(run, time[k], [rate[k] for rate in motion.q_rate.values()]):
        parts.append("at rest")
    loads = "; ".join(load_text(motion, load, k) for load in sketch.loads)
    return "; ".join(parts) + (f"\n{loads}" if loads else "")


def rests(run: Result, time: float, rates: Iterable[float]) -> bool:
    """Whether friction holds a mechanism that moved: nothing moves after an event "rest"."""
    motion = run.motion
    stops = [] if motion is None else [e.t for e in motion.events if e.kind == "rest"]
    return bool(stops) and time >= min(stops) and not any(rates)


# -- GIF and film --------------------------------------------------------------------------


# -- HTML ----------------------------------------------------------------------------------


def player_data(film: Animation) -> Data:
    """What the player draws: shapes in points of the page, y upward.

    Shapes that do not move are ``still``; of the others the places change from frame
    to frame, and the style, by its number, is kept apart from them.
    """
    page = film.page
    moving = [shape for shape in film.shapes if not shape.still]
    styles = {json.dumps(_style(shape)): None for shape in moving}
    number = {style: i for i, style in enumerate(styles)}
    frames: list[Data] = []
    for k, text in enumerate(film.captions):
        rows = [
            [number[json.dumps(_style(shape))], *_numbers(page.points(shape.at(k)))]
            for shape in moving
            if len(shape.at(k))
        ]
        names = [
            [line, *_numbers([position.centre(k) + 1j * up]), position.label.colour]
            for position in film.names
            for line, up in position.lines
        ]
        frames.append({"shapes": rows, "texts": names, "caption": "\n".join(page.lines(text))})
    return {
        "width": round(page.width, 2),
        "height": round(page.height, 2),
        "seconds": film.seconds,
        "styles": [json.loads(style) for style in styles],
        "still": [[_style(s), *_numbers(page.points(s.at(0)))] for s in film.shapes if s.still],
        "paths": [_path(page, i, name, path) for i, (name, path) in enumerate(film.paths.items())],
        "ticks": [_ticks(page.axes.xaxis), _ticks(page.axes.yaxis)],
        "corner": [page.scale * page.corner.real, page.scale * page.corner.imag],
        "unit": page.scale * page.unit,
        "axes": [axis.get_label_text() for axis in (page.axes.xaxis, page.axes.yaxis)],
        "frames": [frames[k] for k in film.order],
    }


def _numbers(z: Sequence[complex] | Vectors) -> list[float]:
    """Places [pt] as x, y, x, y ..., to hundredths of a point."""
    flat: list[float] = np.round(np.stack([np.real(z), np.imag(z)], axis=-1), 2).ravel().tolist()
    return flat


def _style(shape: Shape) -> Data:
    names = ("kind", "stroke", "fill", "width", "radius", "dash", "rounded")
    return {name: getattr(shape, name) for name in names}


def _path(page: Page, i: int, name: str, path: Vectors) -> Data:
    """A marker's path: its pieces between gaps."""
    style = ink.curve_style(i)
    pieces = np.ma.clump_unmasked(np.ma.masked_invalid(path))  # type: ignore[no-untyped-call]
    return {
        "label": f"path of {shown_name(name)}",
        "colour": style["color"],
        "dash": list(style["dashes"]),
        "pieces": [_numbers(page.points(path[piece])) for piece in pieces],
    }


def _ticks(axis: XAxis | YAxis) -> list[float]:
    """Round numbers on an axis."""
    low, high = sorted(axis.get_view_interval())
    return [float(f"{v:.6g}") for v in axis.get_majorticklocs() if low <= v <= high]
