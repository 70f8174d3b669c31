"""Everything that a sheet is written as: document, pictures, numbers, and files of other programs.

The last are those of `blockmech.exchange`, with what is shown and ticked on the page.
"""

from __future__ import annotations

import base64
import io
import json
import re
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from blockmech.draw.animation import MOVING, Animation
from blockmech.draw.mechanism import draw_mechanism
from blockmech.draw.paper import STILL, rendered
from blockmech.draw.simulation import FRAME
from blockmech.errors import refused
from blockmech.exchange.formats import WRITERS, Order
from blockmech.runnable import EVERYTHING

NUMBERS = ("csv", "xlsx", "mat", "npz", "parquet", "json")
OUTLINES = ("dxf", "svg")
SAVE = """
if (!sent.text) return;
const [name, data] = JSON.parse(sent.text);
fetch(`data:application/octet-stream;base64,${data}`).then((file) => file.blob()).then((blob) => {
  const link = document.createElement("a");
  [link.href, link.download] = [URL.createObjectURL(blob), name];
  link.click();
  URL.revokeObjectURL(link.href);
});
"""
"""The browser saves what the text of ``sent`` holds, a name and base 64."""


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
        files = {f"{name}.json": sheet.text().encode()}
    elif what == "diagram":
        from blockmech.draw.diagram import draw_diagram

        files = {f"diagram{suffix}": rendered(draw_diagram(sheet.blocks).figure, suffix)}
    elif view.motion is None:
        raise refused(kind, "nothing moves on this sheet yet", "draw what moves first")
    elif what in ("pose", "motion"):
        files = {f"mechanism{suffix}": (_pose if what == "pose" else _film)(view, suffix)}
    else:
        files = _written(suffix.lstrip(".") or what, name, view, answers)
    if len(files) == 1:
        return next(iter(files.items()))
    return f"{name}-{what}.zip", _zipped(files)


def sent(file: tuple[str, bytes]) -> str:
    """A file as `SAVE` takes it."""
    return json.dumps([file[0], base64.b64encode(file[1]).decode()])


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


def _written(to: str, name: str, view: Any, answers: Any) -> dict[str, bytes]:
    """The files of a format of `blockmech.exchange`: outlines in the shown pose."""
    motion, result = view.motion, answers.result
    at = view.coordinates if to in OUTLINES else motion.q
    want = EVERYTHING if result is None else tuple(result)
    settings = {"friction": answers.friction.value}
    order = Order(motion.mechanism, want, {"at": at}, settings, computed=result)
    with tempfile.TemporaryDirectory() as folder:
        paths = WRITERS[to].write(order, Path(folder, name + WRITERS[to].suffixes[0]))
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def _zipped(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as whole:
        for name, data in files.items():
            whole.writestr(name, data)
    return buffer.getvalue()
