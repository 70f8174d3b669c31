"""What the page is told of a sheet: its document as drawing, motion, problems and numbers."""

from __future__ import annotations

from typing import Any, cast

from blockmech.builders import Linkage, Opened
from blockmech.draw.motion import Motion
from blockmech.editor import drawing
from blockmech.editor.revision import Question, Revision
from blockmech.editor.turn import motion_data
from blockmech.model.joints.closing import coordinate
from blockmech.model.joints.layout import Layout
from blockmech.typing import Data

FIRST = {
    "joints": "Drag on the sheet to draw the first link.",
    "blocks": "Add a frame and a crank, then wire the crank to a marker of the frame.",
}
SENTENCES = 3  # problems that are said at once


def picture_of(ask: Question) -> Data:
    """The drawing with its motion."""
    now, (motion, message) = ask.now, ask.outcome
    picture: Data = {"kind": "blocks", "drawing": None, "motion": None}
    picture["said"] = "" if now.empty else message
    if isinstance(now.document, Linkage):
        picture |= {"kind": "joints", "drawing": drawing.of_links(now.form)}
    elif motion is not None:
        picture["drawing"] = drawing.of_blocks(motion)
    if motion is not None:
        picture["motion"] = motion_data(motion, _home(now.document, motion))
    return picture


def _home(document: Opened, motion: Motion) -> dict[str, float]:
    """Where the drivers are in the pose of the drawing."""
    if isinstance(document, Linkage):
        layout = Layout.of(document)
        pairs = {d: layout.pairs[p] for p, d in layout.drivers.items()}
        return {d: float(coordinate(layout.given, pair)) for d, pair in pairs.items()}
    return {driver: float(q[motion.clearest]) for driver, q in motion.q.items()}


def state_of(ask: Question) -> Data:
    """All that the page shows of a revision but answers."""
    now, (motion, _) = ask.now, ask.outcome
    return {
        "revision": now.number,
        "name": now.form["name"],
        "problems": [problem.to_dict() for problem in now.problems],
        "status": status_of(now),
        "empty": now.empty,
        "names": [] if motion is None else ask.names or drives_of(motion),
        **picture_of(ask),
    }


def names_of(ask: Question) -> Data:
    """The outputs and the numbers that can be chosen."""
    mechanism, (motion, _) = cast(Any, ask.now.mechanism), ask.outcome
    numbers = {} if mechanism is None else mechanism.parameters()
    return {
        "outputs": [] if motion is None else list(motion.mechanism.outputs),
        "parameters": [name for name, x in numbers.items() if x.value],
    }


def status_of(now: Revision) -> str:
    """What the sheet is, or what comes next, in a line."""
    links = isinstance(now.document, Linkage)
    if now.empty:
        return FIRST["joints" if links else "blocks"]
    if now.problems:
        sentences = [". ".join(filter(None, (p.found, p.remedy))) for p in now.problems[:SENTENCES]]
        return "Next: " + " ".join(f"{p.where}: {x}." for p, x in zip(now.problems, sentences))  # noqa: B905
    return now.formation.replace("->", "→")


def drives_of(motion: Motion) -> list[str]:
    """What moves the drivers: the outputs that are shown where none are chosen."""
    m = motion.mechanism
    drives = (m._of_driver(d, "drive") for d in m.drivers)
    return [name for name in drives if name in m.outputs]
