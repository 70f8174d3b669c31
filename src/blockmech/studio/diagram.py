"""The diagram: blocks dragged from a palette and wired, with what is wrong at its place.

`diagram.js` draws and drags; what a block looks like, which ports it has and whether a wire
may be is read from the declarations, as `draw.diagram` does.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import param

from blockmech.blocks.registry import REGISTRY
from blockmech.draw.boxes import content_of
from blockmech.figures.palette import ROW
from blockmech.ground.errors import BlockmechError, Problem
from blockmech.model import graph
from blockmech.model.diagram import Wire
from blockmech.studio import edits
from blockmech.studio.canvas import PIXELS, Canvas
from blockmech.studio.component import Component, script, style
from blockmech.studio.edits import Form
from blockmech.studio.fields import schema_of, starter
from blockmech.studio.session import follow
from blockmech.studio.sheet import Sheet


class Flow(Component):
    """The diagram in the browser, with its palette.

    ``chosen`` are blocks and wires. It is told a ``text`` to show ``at`` a place [px], or of a
    ``wire`` that is being dragged what is ``said`` against it, or "".
    """

    drawing = param.Dict(default={"blocks": [], "wires": [], "editable": False, "row": 0.0})
    chosen = param.List(default=[])
    kinds = param.List(default=[])

    _esm = script("diagram.js")
    _stylesheets = [style("diagram.css")]


def kinds() -> list[tuple[str, str, str, str]]:
    """Type, family and word of every kind of block, and why it cannot be begun here or ""."""
    return _kinds(tuple(REGISTRY))


@cache
def _kinds(known: tuple[str, ...]) -> list[tuple[str, str, str, str]]:
    schema, kinds = schema_of(blocks=True), []
    for kind in known:
        word, alone = kind.split(".")[-1], graph.Graph()
        try:
            alone.add(word, REGISTRY[kind](**starter(schema, schema["$defs"][kind])))
        except BlockmechError:  # links and pairs of a group are more than one field each
            family = kind.partition(".")[0]
            instead = "draw links and joints, or " if family == "group" else ""
            why = f"{kind} has no simplest values: {instead}open a file with one"
            kinds.append((kind, family, word.replace("_", " "), why))
            continue
        drawn, *_ = content_of(alone).blocks  # a coupling also names drivers, which are not here
        word = {"group": drawn.words}.get(drawn.kind, word)
        kinds.append((kind, drawn.kind, word.replace("_", " "), ""))
    order = {kind: k for k, kind in enumerate(("frame", "driver", "group", "coupling"))}
    return sorted(kinds, key=lambda item: order.get(item[1], len(order)))


class Diagram:
    """The canvas of a sheet's block diagram, and what the user does on it.

    ``values`` tells what travels on a wire. Of links and joints the diagram that follows is
    shown, and cannot be edited.
    """

    def __init__(
        self,
        sheet: Sheet,
        say: Callable[[str], None],
        select: Callable[[str], None],
        values: Callable[[str], str],
    ) -> None:
        self.sheet, self.say, self.select, self.values = sheet, say, select, values
        self.places: dict[str, tuple[float, float]] = {}
        self.flow = Flow(self.meant, kinds=kinds(), sizing_mode="stretch_both", min_height=240)
        follow(sheet, self.show, "form", "problems", first=True)
        self.show()

    # -- what is shown ----------------------------------------------------

    def show(self) -> None:
        """Blocks, wires and problems of the sheet."""
        shown, sheet = self.sheet.blocks, self.sheet
        ours = shown is sheet.document
        content = content_of(shown, most=len(shown.blocks) + 1)
        wrong = {at: p.found for p in sheet.problems if ours for at in _about(p, shown)}
        laid = Canvas.of(content, shown, wrong)
        self.places = {name: (r.x, r.y) for name, r in laid.boxes.items()}
        wires = [laid.wire(k, wire.ends) for k, wire in enumerate(content.wires)]
        self.flow.drawing = {
            "blocks": laid.blocks(content, {at.partition(".")[0] for at in wrong}),
            "wires": wires,
            "editable": ours,
            "row": ROW * PIXELS,
        }

    # -- what the user does -------------------------------------------------

    def meant(self, msg: dict[str, Any]) -> None:
        """Do what a gesture means."""
        act = msg["act"]
        if act == "add":
            self.add(msg["kind"], msg["at"] and _points(msg["at"]))
        elif act == "select":
            self.select(msg["name"])
        elif act == "hover":
            self.flow.tell(text=self.values(msg["wire"]), at=msg["at"])
        elif act in ("undo", "redo"):
            getattr(self.sheet, act)()
        elif "blocks" in self.sheet.form:
            self._edit(act, msg)

    def _edit(self, act: str, msg: dict[str, Any]) -> None:
        """Do to the sheet what was done to the canvas, as one step."""
        form, names = self.sheet.form, msg.get("names", [])
        if "names" in msg and not names:
            self.say("choose blocks first: click them in the diagram")
        elif act == "lay out":
            self.do({**form, "view": {}}, "laid out")  # places then follow from the wires
        elif act == "move":
            moved = {name: _points(z) for name, z in msg["at"].items()}
            self.do(edits.placed(form, {**self.places, **moved}), f"{', '.join(moved)} moved")
        elif act == "may":
            wire = Wire(msg["from"], msg["to"])
            self.flow.tell(wire=str(wire), said=self._refusal(wire))
        elif act == "wire":
            wire = Wire(msg["from"], msg["to"])
            if refusal := self._refusal(wire):
                self.say(refusal)
            else:
                self.do(edits.wired(form, *wire.ends), str(wire))
        elif act == "delete":
            self.do(edits.without(form, names, names), f"{', '.join(names)} deleted")
        elif act == "duplicate":
            blocks = [name for name in names if name in form["blocks"]]
            made = edits.duplicated(form, blocks, self.places)
            self.do(made, f"{', '.join(blocks)} duplicated")

    def do(self, form: Form, said: str) -> bool:
        """Change the sheet; a refusal is told, and the canvas shows the sheet again."""
        try:
            self.sheet.change(form, said)
        except BlockmechError as error:
            self.say("; ".join(map(str, error.problems)))
            self.show()
            return False
        self.say(said)
        return True

    def add(self, kind: str, at: tuple[float, float] | None) -> None:
        """Add a block of a kind at a place [pt], or to the right of all."""
        if kind not in REGISTRY or "blocks" not in self.sheet.form:
            return
        form = edits.placed(self.sheet.form, self.places)
        right = max((x for x, _ in self.places.values()), default=-10 * ROW)
        name = edits.free_name(form, kind.rsplit(".", 1)[-1])
        if self.do(edits.added(form, kind, name, at or (right + 14 * ROW, ROW)), f"{name} added"):
            self.select(name)

    def _refusal(self, wire: Wire) -> str:
        """Why a wire cannot be, in the words of `Graph.connect`; "" where it can."""
        return " ".join(map(str, self.sheet.document.problems_of(wire)))


def _points(at: dict[str, float]) -> tuple[float, float]:
    """A place of the canvas in points of a file's view."""
    return at["x"] / PIXELS, at["y"] / PIXELS


def _about(problem: Problem, shown: graph.Graph) -> list[str]:
    """The blocks and ports that a problem is about; of blocks in a loop, where they are fed."""
    names = problem.where.removeprefix("blocks.").split(", ")
    fed = [w for w in shown.wires if {w.source.split(".")[0], w.target.split(".")[0]} <= {*names}]
    return [*names, *(wire.target for wire in fed)]
