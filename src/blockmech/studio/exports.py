"""Everything that a sheet is written as: document, pictures, numbers, and files of other programs.

The last are those of `blockmech.exchange`, with what is shown and ticked on the page.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from blockmech.draw.animation import Animation
from blockmech.draw.mechanism import draw_mechanism
from blockmech.draw.simulation import FRAME
from blockmech.exchange.formats import WRITERS, Order
from blockmech.figures.paper import MOVING, STILL, rendered
from blockmech.ground.errors import refused
from blockmech.ground.runnable import EVERYTHING

NUMBERS = ("csv", "xlsx", "mat", "npz", "parquet", "json")
OUTLINES = ("dxf", "svg")


def kinds() -> dict[str, list[str]]:
    """What can be written, in groups: each a word and a suffix, or the name of a format."""
    others = [name for name in WRITERS if name not in (*NUMBERS, *OUTLINES)]
    return {
        "Sheet": ["document .json", *(f"diagram {suffix}" for suffix in STILL)],
        "Pictures": [f"pose {suffix}" for suffix in STILL] + [f"motion {s}" for s in MOVING],
        "Numbers": [f"numbers .{name}" for name in NUMBERS],
        "Programs": [f"outlines .{name}" for name in OUTLINES] + others,
    }


def exported(kind: str, sheet: Any, view: Any, answers: Any) -> tuple[str, bytes]:
    """The name of a file, and its content; of several files a zip.

    Raises `RequestError` where nothing moves yet, and for what a format cannot say.
    """
    what, _, suffix = kind.partition(" ")
    name = re.sub(r"[^\w-]+", "_", sheet.form["name"])  # no name leads out of a folder
    if what == "document":
        return f"{name}.json", sheet.text().encode()
    if what == "diagram":
        from blockmech.draw.diagram import draw_diagram

        return f"diagram{suffix}", rendered(draw_diagram(sheet.blocks).figure, suffix)
    if view.motion is None:
        raise refused(kind, "nothing moves on this sheet yet", "draw what moves first")
    if what in ("pose", "motion"):
        return f"mechanism{suffix}", (_pose if what == "pose" else _film)(view, suffix)
    return _written(suffix.lstrip(".") or what, name, view, answers)


def _pose(view: Any, suffix: str) -> bytes:
    """The shown pose."""
    at = {driver: [q] for driver, q in view.coordinates.items()}
    return rendered(draw_mechanism(view.motion.mechanism, at, degrees=view.degrees).figure, suffix)


def _film(view: Any, suffix: str) -> bytes:
    """The motion, in the time in which it is played."""
    motion = view.motion
    every = max(1, round(len(motion.samples) * FRAME / view.playing))
    if motion.result.motion is None:
        motion, every = motion.only(np.arange(0, len(motion.samples), every)), 0
    film = Animation(motion, view.playing, degrees=view.degrees, every=every)
    return film.html.encode() if suffix == ".html" else bytes(getattr(film, suffix[1:]))


def _written(to: str, name: str, view: Any, answers: Any) -> tuple[str, bytes]:
    """The file of a format of `blockmech.exchange`: outlines in the shown pose."""
    motion, result = view.motion, answers.result
    at = view.coordinates if to in OUTLINES else motion.q
    want = EVERYTHING if result is None else tuple(result)
    settings = {"friction": answers.friction.value}
    order = Order(motion.mechanism, want, {"at": at}, settings, computed=result)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, "made")
        made.mkdir()
        paths = WRITERS[to].write(order, made / f"{name}{WRITERS[to].suffixes[0]}")
        if len(paths) > 1:
            paths = [Path(shutil.make_archive(f"{folder}/{name}-{to}", "zip", made))]
        return paths[0].name, paths[0].read_bytes()
