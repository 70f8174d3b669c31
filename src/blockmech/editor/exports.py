"""A sheet as a file of any format: its document, pictures, numbers, programs."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path

import numpy as np

from blockmech.draw.animation import FRAME, Animation
from blockmech.draw.mechanism import draw_mechanism
from blockmech.editor.revision import Question
from blockmech.editor.turn import seconds_of, simulated_time
from blockmech.exchange.formats import WRITERS, Order
from blockmech.figures.paper import MOVING, STILL, rendered
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.form import canonical_text

NUMBERS = ("csv", "xlsx", "mat", "npz", "parquet", "json")
OUTLINES = ("dxf", "svg")


def formats() -> dict[str, list[str]]:
    """What can be written, in groups: each a word and a suffix, or the name of a format."""
    programs = [name for name in WRITERS if name not in (*NUMBERS, *OUTLINES)]
    return {
        "Sheet": ["document .json", *(f"diagram {suffix}" for suffix in STILL)],
        "Pictures": [f"pose {suffix}" for suffix in STILL] + [f"motion {s}" for s in MOVING],
        "Numbers": [f"numbers .{name}" for name in NUMBERS],
        "Programs": [f"outlines .{name}" for name in OUTLINES] + programs,
    }


def exported(kind: str, ask: Question) -> tuple[str, bytes]:
    """The name of a file, and its content; of several files a zip.

    Raises `RequestError` where nothing moves yet, and for what a format cannot say.
    """
    category, _, suffix = kind.partition(" ")
    form = ask.now.form
    name = re.sub(r"[^\w-]+", "_", form["name"])  # no name leads out of a folder
    if category == "document":
        return f"{name}.json", canonical_text(form).encode()
    if category == "diagram":
        from blockmech.draw.diagram import draw_diagram

        return f"diagram{suffix}", rendered(draw_diagram(ask.now.blocks).figure, suffix)
    if category == "pose":
        at = {driver: [x] for driver, x in ask.pose.items()}
        picture = draw_mechanism(ask.mechanism, at, display=ask.display)
        return f"mechanism{suffix}", rendered(picture.figure, suffix)
    if category == "motion":
        return f"mechanism{suffix}", _film(ask, suffix)
    return _written(suffix.lstrip(".") or category, name, ask)


def _film(ask: Question, suffix: str) -> bytes:
    """The motion, in the time in which it is played."""
    motion, played = ask.motion, seconds_of(ask.motion)
    every = max(1, round(len(motion.samples) * FRAME / played))
    if simulated_time(motion) is None:
        motion, every = motion.only(np.arange(0, len(motion.samples), every)), 0
    film = Animation(motion.to(*ask.display), played, every=every)
    return film.html.encode() if suffix == ".html" else bytes(getattr(film, suffix[1:]))


def _written(to: str, name: str, ask: Question) -> tuple[str, bytes]:
    """The file of a format of `blockmech.exchange`: outlines in the shown pose."""
    motion = ask.motion
    result = ask.result(ask.names) if ask.names else None
    at = ask.pose if to in OUTLINES else motion.q
    want = EVERYTHING if result is None else tuple(result)
    order = Order(motion.mechanism, want, {"at": at}, {"friction": ask.friction}, computed=result)
    with tempfile.TemporaryDirectory() as folder:
        outputs = Path(folder, "made")
        outputs.mkdir()
        paths = WRITERS[to].write(order, outputs / f"{name}{WRITERS[to].suffixes[0]}")
        if len(paths) > 1:
            paths = [Path(shutil.make_archive(f"{folder}/{name}-{to}", "zip", outputs))]
        return paths[0].name, paths[0].read_bytes()
