"""The diagram: blocks dragged from a palette and wired, with what is wrong at its place.

React Flow draws and drags; what a block looks like, which ports it has and whether a wire
may be is read from the declarations, as `draw.diagram` does.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import panel as pn
import param
from panel_reactflow import ReactFlow

from blockmech.blocks.registry import REGISTRY
from blockmech.builders import Graph
from blockmech.draw.boxes import DrawnBlock, content_of, graph_of
from blockmech.draw.layout import Ends
from blockmech.draw.palette import ROW
from blockmech.errors import BlockmechError, Problem
from blockmech.model import graph
from blockmech.model.diagram import Wire
from blockmech.model.schema import graph_schema
from blockmech.studio import edits
from blockmech.studio.canvas import ENDS, PIXELS, Canvas
from blockmech.studio.edits import Form
from blockmech.studio.fields import starter
from blockmech.studio.looks import Plain
from blockmech.studio.session import follow, together
from blockmech.studio.sheet import Sheet

DRAGGED = "application/blockmech"  # what the palette gives to a drag

CHIPS = f"""
export function render({{ model }}) {{
  const box = document.createElement("div");
  box.className = "chips";
  for (const [kind, family, words, why] of model.kinds) {{
    const chip = document.createElement("button");
    chip.type = "button"; chip.draggable = true; chip.textContent = words;
    chip.title = why || kind; chip.disabled = Boolean(why);
    chip.className = family; chip.dataset.kind = kind;
    chip.setAttribute("aria-label", "Add " + words);
    chip.addEventListener("dragstart", e => e.dataTransfer.setData("{DRAGGED}", kind));
    chip.addEventListener("click", () => model.send_msg(kind));
    box.append(chip);
  }}
  return box;
}}
"""


class Palette(pn.custom.JSComponent):  # type: ignore[misc]  # as the sheet
    """Buttons of all kinds of blocks: dragged onto the canvas, or pressed."""

    kinds = param.List(default=[])

    _esm = CHIPS
    _stylesheets = [
        """
        :host { display: block }
        .chips { display: flex; flex-wrap: wrap; gap: 4px; max-height: 88px; overflow: auto }
        button { font: inherit; font-size: 12px; padding: 3px 9px; border-radius: 4px;
          border: 1px solid var(--bm-line); color: var(--bm-ink); cursor: grab;
          background: var(--bm-group) }
        button.frame { background: var(--bm-frame) }
        button.driver { background: var(--bm-driver) }
        button.element { background: var(--bm-element); border-style: dashed }
        button:disabled { color: var(--bm-grey); cursor: default }
        button:focus-visible { outline: 2px solid var(--bm-blue) }
        """
    ]

    def __init__(self, pressed: Callable[[str], None]) -> None:
        super().__init__(kinds=kinds())
        self._pressed = pressed

    def _handle_msg(self, msg: Any) -> None:
        self._pressed(str(msg))


def kinds() -> list[tuple[str, str, str, str]]:
    """Type, family and word of every kind of block, and why it cannot be begun here or ""."""
    return _kinds(tuple(REGISTRY))


@cache
def _kinds(known: tuple[str, ...]) -> list[tuple[str, str, str, str]]:
    schema, found = graph_schema(), []
    for kind in known:
        word, alone = kind.split(".")[-1], graph.Graph()
        try:
            alone.add(word, REGISTRY[kind](**starter(schema, schema["$defs"][kind])))
        except BlockmechError:  # links and pairs of a group are more than one field each
            family = kind.partition(".")[0]
            instead = "draw links and joints, or " if family == "group" else ""
            why = f"{kind} has no simplest values: {instead}open a file with one"
            found.append((kind, family, word.replace("_", " "), why))
            continue
        drawn, *_ = content_of(alone).blocks  # a coupling also names drivers, which are not here
        word = {"group": drawn.words}.get(drawn.kind, word)
        found.append((kind, drawn.kind, word.replace("_", " "), ""))
    order = {kind: k for k, kind in enumerate(("frame", "driver", "group", "coupling"))}
    return sorted(found, key=lambda item: order.get(item[1], len(order)))


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
        self.drawn: dict[str, Any] = {}  # what the canvas was told: blocks and wires by name
        self.flow = ReactFlow(
            sizing_mode="stretch_both",
            min_height=240,
            editor_mode="side",
            display_side_bar=False,
            drop_types=[DRAGGED],
            popup_trigger="hover",
            min_zoom=0.02,
            max_zoom=1.2,
            default_node_editor=lambda *_, **__: None,
            default_edge_editor=lambda *_, **__: None,
        )
        # What the library makes of a message is sent before what we make of it, and not after.
        self.flow._handle_msg = together(self.flow._handle_msg)
        self.flow._process_events = self._drawn_late(self.flow._process_events)
        self.flow.add_connection_validator(self._refusal)
        self.flow.on("drop", self._dropped)
        for event in ("node_moved", "node_deleted", "edge_added", "edge_deleted"):
            self.flow.on(event, lambda _: self._edited())
        self.flow.on("selection_changed", self._selected)
        self.flow.on("edge_hovered", self._hovered)
        self.flow.on("edge_unhovered", lambda _: self.flow.close_popup())
        self.palette = Palette(lambda kind: self.add(kind, None))
        follow(sheet, self.show, "form", "problems")
        self.show()

    # -- what is shown ----------------------------------------------------

    def show(self) -> None:
        """Blocks, wires and problems of the sheet."""
        shown, sheet = self.sheet.document, self.sheet
        ours = isinstance(shown, Graph)
        if not ours:
            shown = graph_of(sheet.mechanism.of_blocks) if sheet.mechanism else Graph()
        content = content_of(shown, most=len(shown.blocks) + 1)
        wrong = {at: p.found for p in sheet.problems if ours for at in _about(p, shown)}
        laid = Canvas.of(content, shown, wrong)
        self.places = {name: (r.x, r.y) for name, r in laid.boxes.items()}
        bad = {at.partition(".")[0] for at in wrong}
        nodes = [self._node(block, laid, block.name in bad) for block in content.blocks]
        edges = [laid.edge(i, wire.ends) for i, wire in enumerate(content.wires)]
        specs = {spec["type"]: spec for spec in laid.types.values()}
        self.drawn = {one["id"]: one.get("position") for one in (*nodes, *edges)}
        if specs != self.flow.node_types:
            self.flow.node_types = specs
        self.flow.param.update(nodes=nodes, edges=edges, editable=ours)
        self.palette.visible = ours

    def _node(self, block: DrawnBlock, laid: Canvas, bad: bool) -> dict[str, Any]:
        r = laid.boxes[block.name]
        return {
            "id": block.name,
            "type": laid.types[block.name]["type"],
            "label": "\n".join(laid.words[block.name]),
            "position": {"x": r.x * PIXELS, "y": r.y * PIXELS},
            "data": {},
            "selected": block.name in self.flow.selection["nodes"],
            "className": f"bm-node bm-{block.kind}{' bm-bad' if bad else ''}",
            "style": {
                "width": r.width * PIXELS,
                "height": r.height * PIXELS,
                "--bm-row": f"{ROW * PIXELS}px",
            },
        }

    # -- what the user does -------------------------------------------------

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

    def lay_out(self) -> None:
        """Forget all places, so that they follow from the wires."""
        self.do({**self.sheet.form, "view": {}}, "laid out")

    def duplicate(self, names: list[str]) -> None:
        """Put copies of some blocks beside them."""
        made = edits.duplicated(self.sheet.form, names, self.places)
        self.do(made, f"{', '.join(names)} duplicated")

    def remove(self, names: list[str]) -> None:
        """Delete some blocks."""
        self.do(edits.without(self.sheet.form, names), f"{', '.join(names)} deleted")

    def _edited(self) -> None:
        """Do to the sheet what was done to the canvas, all of it as one step."""
        at = {node["id"]: node["position"] for node in self.flow.nodes}
        wires = {_ends(edge): edge for edge in self.flow.edges}
        gone = [one for one in self.drawn if one not in at and one not in wires]
        new = [wire for wire in wires if wire not in self.drawn]
        moved = {name: _points(z) for name, z in at.items() if z != self.drawn.get(name)}
        form = edits.without(self.sheet.form, gone, gone)
        form = edits.placed(form, {**self.places, **moved} if moved else {})
        ends = (wire.split(" -> ") for wire in new)
        form = {**form, "wires": [*form["wires"], *({"from": a, "to": b} for a, b in ends)]}
        done = {"deleted": gone, "moved": moved, "": new}
        said = "; ".join(f"{', '.join(what)} {how}".strip() for how, what in done.items() if what)
        if said:
            self.do(form, said)

    def _drawn_late(self, take: Callable[[dict[str, Any]], None]) -> Callable[..., None]:
        """Take what the browser says of itself, but not what it says of blocks and wires.

        What the user did to them comes as messages. A list of them is what a browser drew late,
        written over a newer one that had come meanwhile: it is told the newer one again.
        """

        def taken(events: dict[str, Any]) -> None:
            late = [name for name in ("nodes", "edges") if name in events]
            take({name: value for name, value in events.items() if name not in late})
            self.flow.param.trigger(*late)

        return taken

    def _dropped(self, event: dict[str, Any]) -> None:
        self.add(str(event["data"]), _points(event["position"]))

    def _refusal(self, ends: dict[str, Any]) -> str | None:
        """Why a wire cannot be, in the words of `Graph.connect`; None where it can."""
        wire = Wire(*_ends(ends).split(" -> "))
        return " ".join(map(str, self.sheet.document.problems_of(wire))) or None

    def _selected(self, event: dict[str, Any]) -> None:
        if len(names := event.get("nodes") or []) == 1:
            self.select(names[0])

    def _hovered(self, event: dict[str, Any]) -> None:
        just_drawn = event["edge_id"] == self.sheet.undoable  # the pointer is there by itself
        if not just_drawn and (text := self.values(event["edge_id"])):
            self.flow.show_popup(Plain(text), event["position"])


def _points(at: dict[str, float]) -> tuple[float, float]:
    """A place of the canvas in points of a file's view."""
    return at["x"] / PIXELS, at["y"] / PIXELS


def _ends(edge: dict[str, Any]) -> str:
    """What a wire of the canvas is called."""
    return str(Ends(*(edge[end] for end in ENDS)))


def _about(problem: Problem, shown: graph.Graph) -> list[str]:
    """The blocks and ports that a problem is about; of blocks in a loop, where they are fed."""
    names = problem.where.removeprefix("blocks.").split(", ")
    fed = [w for w in shown.wires if {w.source.split(".")[0], w.target.split(".")[0]} <= {*names}]
    return [*names, *(wire.target for wire in fed)]
