"""What the page is told of a sheet: its document as drawing, motion, problems and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, cast

from blockmech.builders import Linkage
from blockmech.draw.motion import Motion
from blockmech.editor import drawing
from blockmech.editor.revision import Revision
from blockmech.editor.turn import motion_data
from blockmech.ground.errors import BlockmechError
from blockmech.model.joints.closing import coordinate
from blockmech.model.joints.layout import Layout
from blockmech.typing import Data

FIRST = {
    "joints": "Drag on the sheet to draw the first link.",
    "blocks": "Add a frame and a crank, then wire the crank to a marker of the frame.",
}
SENTENCES = 3  # problems that are said at once


class View:
    """What follows from a revision for the page; worked out once, when it is first asked for.

    ``motion`` is that of a turn of the drivers, or of one of them from where others were put.
    """

    def __init__(self, now: Revision, moved: str = "", at: Mapping[str, float] | None = None):
        self.now, self.said = now, ""
        self.motion: Motion | None = None
        if not now.empty:
            try:
                self.motion, self.said = now.shown_motion(moved, at)
            except BlockmechError as error:
                self.said = str(error)

    @cached_property
    def data(self) -> Data:
        """The drawing with its motion."""
        now, motion = self.now, self.motion
        links = isinstance(now.document, Linkage)
        picture: Data = {
            "kind": "joints" if links else "blocks",
            "drawing": drawing.of_links(now.form) if links else None,
            "motion": None,
            "said": self.said,
        }
        if motion is not None:
            if not links:
                picture["drawing"] = drawing.of_blocks(motion)
            picture["motion"] = motion_data(motion, self._home())
        return picture

    def _home(self) -> dict[str, float]:
        """Where the drivers are in the pose of the drawing."""
        document, motion = self.now.document, self.motion
        assert motion is not None
        if isinstance(document, Linkage):
            layout = Layout.of(document)
            return {d: float(coordinate(layout.given, layout.pairs[p]))
                    for p, d in layout.drivers.items()}  # fmt: skip
        return {driver: float(q[motion.clearest]) for driver, q in motion.q.items()}


def state_of(view: View) -> Data:
    """All that the page shows of a revision but answers."""
    now = view.now
    return {
        "revision": now.number,
        "name": now.form["name"],
        "title": now.form.get("title", ""),
        "problems": [problem.to_dict() for problem in now.problems],
        "status": status_of(now),
        "empty": now.empty,
        **view.data,
    }


def names_of(view: View) -> Data:
    """The outputs and the numbers that can be chosen."""
    mechanism = cast(Any, view.now.mechanism)
    numbers = {} if mechanism is None else mechanism.parameters()
    return {
        "outputs": [] if view.motion is None else list(view.motion.mechanism.outputs),
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
