"""The mechanism in motion: a GIF, or one HTML file with its own player.

Both draw the shapes of `blockmech.draw.shapes`, frame by frame. Axes and scale are
fixed over the whole motion. Only poses that close are frames; a motion that does not
end where it began is played to and fro.
"""

from __future__ import annotations

import html
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw import palette as ink
from blockmech.draw import shapes
from blockmech.draw.mechanism import (
    LINE,
    MANY,
    TOP,
    Scale,
    caption,
    draw,
    extent,
    load_text,
    paper,
    sizes,
    write,
)
from blockmech.draw.motion import closes, moves, moves_of_result
from blockmech.draw.paper import shown_name, styled, text_width, wrapped
from blockmech.draw.paths import Paths, paths_of
from blockmech.draw.shapes import Shape, Stage, stage_of
from blockmech.draw.sketch import Pin, Spot, sketch_of
from blockmech.errors import Problem, RequestError
from blockmech.result import Result

FRAMES = 72
SECONDS = 3.0  # [s] that one cycle lasts on the screen
GIF_DPI, WIDE_DPI = 150, 110  # of a picture one or two columns wide
TICK = 0.02  # [s] shortest time of a frame that browsers honour
COLOURS, APART = 255, 8  # of a GIF; smallest distance of two of them in one channel
NAMES = 12  # joints up to which all are named
GAP = 7.0  # [pt] from a joint or an arrow to its name


@dataclass(frozen=True)
class Reel:
    """An animation before it is drawn: the stage, the frames' samples, the paths."""

    stage: Stage
    order: tuple[int, ...]
    paths: Paths
    seconds: float
    degrees: bool
    width: float  # [pt] of the axes
    left: float = -math.inf  # [m] between which words stand
    right: float = math.inf

    @property
    def name(self) -> str:
        """Name of the mechanism."""
        return self.stage.motion.mechanism.name

    def caption(self, k: int) -> list[str]:
        """Lines at sample k: driver coordinates, time where it is known, loads."""
        parts = [caption(self.stage.motion, [k], self.degrees)]
        time = self.stage.motion.samples.time
        if time is not None and math.isfinite(time[k]):
            parts.append(f"t\u00a0=\u00a0{time[k]:.3f}\u00a0s")
        loads = [load_text(self.stage, load, k) for load in self.stage.sketch.loads]
        lines = wrapped("; ".join(parts), ink.SMALL, self.width)
        return lines + wrapped("; ".join(loads), ink.SMALL, self.width) if loads else lines


def reel_of(
    subject: Compiled | Result,
    at: Any = None,
    *,
    frames: int = FRAMES,
    seconds: float = SECONDS,
    trace: Iterable[str] | None = None,
    degrees: bool = True,
) -> tuple[Reel, Scale]:
    """Prepare the animation of a mechanism over its range, or of the samples of a run.

    Raises `RequestError` where the range is not known or a number makes no sense, and
    the errors of `Compiled.run` where no pose closes.
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
    if len(good) > 1:
        round_trip = closes(motion, good[0], good[-1])
        good = good[:-1] if round_trip else good + good[-2:0:-1]
    sketch = sketch_of(motion)
    paths = paths_of(motion, trace) if motion.n > 1 else {}
    many = len(sketch.pins) + len(sketch.sliders) + len(sketch.loads) > MANY
    corners = extent(motion, sketch, good, paths)
    unit, width = sizes(corners, many)[:2]
    stage = stage_of(sketch, motion, unit)
    reel = Reel(stage, tuple(good), paths, seconds, degrees, width)
    lines = max(len(reel.caption(k)) for k in good)
    with styled():
        scale = paper(corners, paths, [""] * lines, many)
    ends = (scale.metres(complex(x, 0.0)).real for x in (0.0, scale.width))
    left, right = ends
    return replace(reel, left=left, right=right), scale


def _check(frames: int, seconds: float) -> None:
    wrong: list[tuple[str, object, str]] = []
    if not isinstance(frames, int) or not 2 <= frames <= 2000:
        wrong.append(("frames", frames, "a whole number from 2 to 2000"))
    if not isinstance(seconds, int | float) or not 0 < seconds < math.inf:
        wrong.append(("seconds", seconds, "a positive number of seconds"))
    if wrong:
        raise RequestError(
            Problem("bad-value", name, f"got {value!r}", f"valid: {valid}", "")
            for name, value, valid in wrong
        )


def _frame(reel: Reel, k: int) -> tuple[list[Shape], list[tuple[str, complex, str]]]:
    """Shapes of a frame, and its words: text, place [m], colour."""
    stage = reel.stage
    words: list[tuple[str, complex, str]] = []
    for pin in stage.sketch.pins if len(stage.sketch.pins) <= NAMES else ():
        text = ", ".join(map(shown_name, pin.names))
        words.append((text, _beside_pin(reel, pin, k, text), ink.INK))
    return shapes.pose(stage, k), words


def _beside_pin(reel: Reel, pin: Pin, k: int, text: str) -> complex:
    """A place [m] for a joint's name, on the side where its links are not, on the paper."""
    stage = reel.stage
    z = stage.place(pin.spot, k)
    bodies = [b for b in stage.sketch.bodies if b.link in pin.links]
    middles = [
        stage.place(Spot(b.link, p), k) for b in bodies for p in b.outline if len(b.outline) > 1
    ]
    away = z - sum(middles) / len(middles) if middles else 1 + 1j
    if pin.grounded and away.imag <= 0:  # below it is the ground
        away = complex(math.copysign(1.0, away.real), 0.0)
    gap = GAP / 2 if pin.grounded else 0.0
    places = [
        _beyond(z + math.copysign(gap, way.real) * stage.unit, way, text, stage.unit)
        for way in (away, complex(-away.real, away.imag), 1j)
    ]
    half = stage.unit * text_width(text, ink.SMALL) / 2
    inside = (p for p in places if reel.left <= p.real - half and p.real + half <= reel.right)
    return next(inside, places[0])


def _beyond(z: complex, direction: complex, text: str, unit: float) -> complex:
    """The middle [m] of a text that begins a little beyond a place."""
    u = direction / abs(direction) if abs(direction) > 0 else 1 + 0j
    wide, high = text_width(text, ink.SMALL) / 2, ink.SMALL / 2
    return z + unit * complex(u.real * (GAP + wide), u.imag * (GAP + high))


# -- GIF -----------------------------------------------------------------------------------


def gif(reel: Reel, scale: Scale) -> bytes:
    """The animation as a GIF that repeats for ever."""
    from PIL import Image

    pictures = []
    with styled():
        wide = scale.figure.get_figwidth() * 72 > ink.COLUMN + 1
        scale.figure.set_dpi(WIDE_DPI if wide else GIF_DPI)
        canvas = scale.figure.canvas
        draw(scale, shapes.ground(reel.stage, reel.order[0]))
        canvas.draw()
        still = canvas.copy_from_bbox(scale.figure.bbox)
        for k in reel.order:
            canvas.restore_region(still)
            _draw_frame(reel, scale, k)
            pictures.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    palette = _palette(pictures[:: max(1, len(pictures) // 4)])
    frames = [
        Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures
    ]
    ticks = max(round(1000 * max(reel.seconds / len(frames), TICK), -1), 10)
    buffer = io.BytesIO()
    frames[0].save(
        buffer,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=int(ticks),
        loop=0,
        optimize=False,
    )
    return buffer.getvalue()


def _palette(pictures: Sequence[Any]) -> Any:
    """An image whose palette holds the commonest colours, the same for all frames."""
    from PIL import Image

    pixels = np.concatenate([p.reshape(-1, 3) for p in pictures]).astype(np.uint32)
    packed = pixels[:, 0] << 16 | pixels[:, 1] << 8 | pixels[:, 2]
    colours, counts = np.unique(packed, return_counts=True)
    common = colours[np.argsort(-counts.astype(np.int64), kind="stable")]
    rows = np.stack([common >> 16 & 255, common >> 8 & 255, common & 255], axis=1).astype(int)
    kept = rows[:1]
    for row in rows[1:]:
        # Pillow finds the nearest colour on a coarse grid: near ones would be mixed up.
        if np.abs(kept - row).max(axis=1).min() >= APART:
            kept = np.vstack([kept, row])
        if len(kept) == COLOURS:
            break
    image = Image.new("P", (1, 1))
    image.putpalette(kept.ravel().tolist())
    return image


def _draw_frame(reel: Reel, scale: Scale, k: int) -> None:
    """Draw the moving artists of one frame over the still picture, and take them away."""
    moving, words = _frame(reel, k)
    artists = draw(scale, moving)
    for text, z, colour in words:
        artists.append(write(scale, text, scale.points(z), colour))
    size = scale.figure.get_size_inches()[1] * 72
    style = {"fontsize": ink.SMALL, "va": "top"}
    left = scale.axes.get_position().x0
    for i, line in enumerate(reel.caption(k)):
        y = (size - TOP - LINE * i) / size
        artists.append(scale.figure.text(left, y, line, **style))
    for artist in sorted(artists, key=lambda a: a.get_zorder()):
        artist.draw(scale.figure.canvas.get_renderer())
    for artist in artists:
        artist.remove()


# -- HTML ----------------------------------------------------------------------------------


def page(reel: Reel, scale: Scale) -> str:
    """The animation as one HTML document that needs nothing else."""
    template = resources.files("blockmech.draw").joinpath("player.html").read_text("utf-8")
    data = json.dumps(player_data(reel, scale), ensure_ascii=True, separators=(",", ":"))
    data = data.replace("<", "\\u003c")  # no name can end the script
    return template.replace("__TITLE__", html.escape(reel.name)).replace("__DATA__", data)


def player_data(reel: Reel, scale: Scale) -> dict[str, Any]:
    """What the player draws: shapes in points of the page, y upward.

    Shapes that do not move are ``still``; of the others the places change from frame
    to frame, and the style is kept apart from them.
    """
    stage = reel.stage

    def places(points: Iterable[complex]) -> list[float]:
        return [round(x, 2) for z in map(scale.points, points) for x in (z.real, z.imag)]

    styles: dict[str, int] = {}
    frames = []
    for k in reel.order:
        moving, words = _frame(reel, k)
        rows = [
            [styles.setdefault(json.dumps(_style(s)), len(styles)), *places(s.points)]
            for s in sorted(moving, key=lambda s: s.order)
        ]
        texts = [[text, *places([z]), colour] for text, z, colour in words]
        frames.append({"shapes": rows, "texts": texts, "caption": "\n".join(reel.caption(k))})
    still = [
        [_style(s), *places(s.points)]
        for s in sorted(shapes.ground(stage, reel.order[0]), key=lambda s: s.order)
    ]
    return {
        "width": round(scale.width, 2),
        "height": round(scale.height, 2),
        "seconds": reel.seconds,
        "styles": [json.loads(s) for s in styles],
        "still": still,
        "paths": [_path(name, path, i, scale) for i, (name, path) in enumerate(reel.paths.items())],
        "ticks": [_ticks(scale.axes.get_xlim(), 7), _ticks(scale.axes.get_ylim(), 5)],
        "corner": [scale.corner.real, scale.corner.imag],
        "unit": scale.unit,
        "frames": frames,
    }


def _style(shape: Shape) -> dict[str, Any]:
    return {
        "kind": shape.kind,
        "stroke": shape.stroke,
        "fill": shape.fill,
        "width": shape.width,
        "radius": shape.radius,
        "dash": list(shape.dash),
        "round": shape.rounded,
    }


def _path(name: str, path: Any, number: int, scale: Scale) -> dict[str, Any]:
    """A marker's path: its pieces between gaps."""
    colour, dash = ink.curve_style(number)
    pieces: list[list[float]] = [[]]
    for z in path:
        if not np.isfinite(z):
            pieces.append([])
            continue
        p = scale.points(complex(z))
        pieces[-1] += [round(p.real, 2), round(p.imag, 2)]
    label = f"path of {shown_name(name)}"
    kept = [p for p in pieces if p]
    return {"label": label, "colour": colour, "dash": list(dash), "pieces": kept}


def _ticks(limits: tuple[float, float], most: int) -> list[float]:
    """Round numbers [m] between two limits."""
    from matplotlib.ticker import MaxNLocator

    values = MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]).tick_values(*limits)
    return [float(f"{v:.6g}") for v in values if limits[0] <= v <= limits[1]]
