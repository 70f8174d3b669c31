"""The diagram: blocks dragged from a palette and wired, with what is wrong at its place.

React Flow draws and drags; what a block looks like, which ports it has and whether a wire
may be is read from the declarations, as `draw.diagram` does.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable
from typing import Any

import panel as pn
import param
from panel_reactflow import ReactFlow

from blockmech.blocks.contract import Block
from blockmech.blocks.registry import REGISTRY
from blockmech.draw.boxes import Content, DrawnBlock, content_of
from blockmech.draw.layout import Box, arrange
from blockmech.draw.palette import ROW, TEXT
from blockmech.draw.routing import place
from blockmech.errors import BlockmechError, Problem
from blockmech.loads.contract import Element
from blockmech.model import checks
from blockmech.model.diagram import Wire
from blockmech.model.graph import Graph
from blockmech.model.schema import graph_schema
from blockmech.studio import edits
from blockmech.studio.fields import starter
from blockmech.studio.session import follow
from blockmech.studio.sheet import Sheet

PIXELS = 13 / TEXT  # of the page for a point of a file's view: 13 px words in place of 8 pt ones
WIDER = 6 * ROW  # names of ports stand on both sides of the words, all markers are shown
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
        .chips { display: flex; flex-wrap: wrap; gap: 4px }
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
    schema, found = graph_schema(), []
    for kind in REGISTRY:
        try:
            made = REGISTRY[kind](**starter(schema, schema["$defs"][kind]))
        except BlockmechError:  # links and pairs of a group are more than one field each
            why = f"{kind} has no simplest values: draw links and joints, or open a file with one"
            found.append((kind, "group", kind.split(".")[-1], why))
            continue
        content = content_of(_alone(kind, made)).blocks[0]
        word = {"group": content.words, "frame": "frame"}.get(content.kind, kind.split(".")[-1])
        found.append((kind, content.kind, word.replace("_", " "), ""))
    order = ("frame", "driver", "group", "element")
    return sorted(found, key=lambda item: order.index(item[1]))


def _alone(name: str, block: Block) -> Graph:
    graph = Graph()
    graph.blocks[name] = block
    return graph


class Diagram:
    """The canvas of a sheet's block diagram, and what the user does on it."""

    def __init__(self, sheet: Sheet, say: Callable[[str], None], select: Callable[[str], None]):
        self.sheet, self.say, self.select = sheet, say, select
        self.places: dict[str, tuple[float, float]] = {}
        self.wire_values: Callable[[str], str] | None = None
        self.flow = ReactFlow(
            sizing_mode="stretch_both",
            min_height=240,
            editor_mode="side",
            display_side_bar=False,
            drop_types=[DRAGGED],
            popup_trigger="hover",
            min_zoom=0.1,
            max_zoom=1.2,
            default_node_editor=lambda *_, **__: None,
            default_edge_options={"type": "smoothstep"},
        )
        self.flow.add_connection_validator(self._refusal)
        self.flow.on("drop", self._dropped)
        self.flow.on("node_moved", self._moved)
        self.flow.on("edge_added", self._wired)
        self.flow.on("edge_deleted", lambda event: self._remove(wires=event))
        self.flow.on("node_deleted", lambda event: self._remove(blocks=event))
        self.flow.on("selection_changed", self._selected)
        self.flow.on("edge_hovered", self._hovered)
        self.flow.on("edge_unhovered", lambda _: self.flow.close_popup())
        self.palette = Palette(lambda kind: self.add(kind, None))
        follow(sheet, self.show, "form", "problems")
        self.show()

    @property
    def selected(self) -> list[str]:
        """Names of the blocks that are selected."""
        return list(self.flow.selection["nodes"])

    # -- what is shown ----------------------------------------------------

    def show(self) -> None:
        """Blocks, wires and problems of the sheet."""
        graph = self.sheet.document
        if not isinstance(graph, Graph):
            self.flow.param.update(nodes=[], edges=[])
            return
        content = content_of(graph, most=len(graph.blocks) + 1)
        wrong = {at: p.found for p in self.sheet.problems for at in _about(p, graph)}
        types = {b.name: _node_type(graph, b, wrong) for b in content.blocks}
        rows = {name: _rows(spec) for name, spec in types.items()}
        self.places = _places(content, rows, self.sheet.form.get("view", {}))
        bad = {at.partition(".")[0] for at in wrong}
        nodes = [self._node(b, types[b.name], b.name in bad) for b in content.blocks]
        edges = [_edge(wire.source, wire.target) for wire in graph.wires]
        kinds = {spec["type"]: spec for spec in types.values()}
        if kinds != self.flow.node_types:
            self.flow.node_types = kinds
        self.flow.param.update(nodes=nodes, edges=edges)

    def _node(self, block: DrawnBlock, spec: dict[str, Any], wrong: bool) -> dict[str, Any]:
        x, y = self.places[block.name]
        return {
            "id": block.name,
            "type": spec["type"],
            "label": f"{block.name}\n{block.words}",
            "position": {"x": x * PIXELS, "y": y * PIXELS},
            "data": {},
            "selected": block.name in self.flow.selection["nodes"],
            "className": f"bm-node bm-{block.kind}{' bm-bad' if wrong else ''}",
            "style": {"height": _rows(spec) * ROW * PIXELS},
        }

    # -- what the user does -------------------------------------------------

    def do(self, form: dict[str, Any], said: str) -> bool:
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
        form = self.sheet.form
        if kind not in REGISTRY or "blocks" not in form:
            return
        right = max((x for x, _ in self.places.values()), default=-10 * ROW)
        name = edits.free_name(form, kind)
        form = edits.placed(form, self.places)
        if self.do(edits.added(form, kind, name, at or (right + 14 * ROW, ROW)), f"{name} added"):
            self.select(name)

    def connect(self, source: str, target: str) -> None:
        """Wire a marker to a joint."""
        self.do(edits.wired(self.sheet.form, source, target), f"{source} -> {target}")

    def _dropped(self, event: dict[str, Any]) -> None:
        at = event["position"]
        self.add(str(event["data"]), (at["x"] / PIXELS, at["y"] / PIXELS))

    def _moved(self, event: dict[str, Any]) -> None:
        name, at = event["node_id"], event["position"]
        new = (at["x"] / PIXELS, at["y"] / PIXELS)
        if name in self.places and new != self.places[name]:
            form = edits.placed(self.sheet.form, {**self.places, name: new})
            self.do(form, f"{name} moved")

    def _refusal(self, ends: dict[str, Any]) -> str | None:
        """Why a wire cannot be, in the words of `Graph.connect`; None where it can."""
        graph = self.sheet.document
        wire = Wire(
            f"{ends['source']}.{ends['sourceHandle']}", f"{ends['target']}.{ends['targetHandle']}"
        )
        fed = next((w for w in graph.wires if w.target == wire.target), None)
        problems = list(checks.wire_problems(graph.blocks, wire, fed))
        return " ".join(map(str, problems)) or None

    def _wired(self, event: dict[str, Any]) -> None:
        edge = event.get("edge", event)
        reason = self._refusal(edge)
        if reason:
            self.say(reason)
            self.show()
            return
        self.connect(
            f"{edge['source']}.{edge['sourceHandle']}", f"{edge['target']}.{edge['targetHandle']}"
        )

    def _remove(self, blocks: Any = None, wires: Any = None) -> None:
        names = _ids(blocks, "node") if blocks else []
        cut = _ids(wires, "edge") if wires else []
        form = self.sheet.form
        there = {edits.wire_text(w) for w in form["wires"]}
        if set(names) & set(form["blocks"]) or set(cut) & there:
            said = f"{', '.join([*names, *cut])} deleted"
            self.do(edits.without(form, names, cut), said)

    def _selected(self, event: dict[str, Any]) -> None:
        names = event.get("nodes") or []
        if len(names) == 1:
            self.select(names[0])

    def _hovered(self, event: dict[str, Any]) -> None:
        if self.wire_values is not None:
            text = self.wire_values(event["edge_id"])
            if text:
                self.flow.show_popup(pn.pane.Str(text), event["position"])


def _ids(event: dict[str, Any], what: str) -> list[str]:
    many = event.get(f"{what}_ids") or [event.get(f"{what}_id")]
    return [str(one) for one in many if one]


def _places(
    content: Content, rows: dict[str, int], view: dict[str, Any]
) -> dict[str, tuple[float, float]]:
    """Places [pt] of all blocks: the author's, and for others those that follow from the wires."""
    at = {name: (float(x), float(y)) for name, (x, y) in view.items() if name in rows}
    if len(at) == len(rows):
        return at
    wires, boxes = [wire.ends for wire in content.wires], []
    for block in content.blocks:
        pins = max(len(block.ports), len(block.markers))
        head, width = rows[block.name] - pins, block.box().width + WIDER
        ports = tuple(port.name for port in block.ports)
        boxes.append(Box(block.name, width, ports, head, first=block.kind == "frame"))
    made = place(arrange(boxes, wires)).boxes
    below = max((y + rows[name] * ROW for name, (_, y) in at.items()), default=0.0)
    return {name: at.get(name, (r.x, r.y + below)) for name, r in made.items()}


def _rows(spec: dict[str, Any]) -> int:
    """Rows of a block on the canvas: its words, or its handles and half a row around them."""
    return max(3, max(len(spec["inputs"]), len(spec["outputs"])) + 1)


def _node_type(graph: Graph, block: DrawnBlock, wrong: dict[str, str]) -> dict[str, Any]:
    """Handles of a block: joints and terminals on the left, markers and guides on the right."""
    inputs = []
    for port in block.ports:
        said = wrong.get(f"{block.name}.{port.name}")
        label = f"{port.name} ⚠ {said}" if said else port.name
        inputs.append({"id": port.name, "label": label, "type": port.pair or "load"})
    outputs = []
    known = graph.blocks.get(block.name)
    markers = (
        known.all_markers if isinstance(known, Block) and not isinstance(known, Element) else {}
    )
    for name, (_, marker) in markers.items():
        guide = getattr(marker, "angle", None) is not None or getattr(marker, "dir", None)
        outputs.append({"id": name, "label": name, "type": "guide" if guide else "marker"})
    # React Flow measures handles again where the type of a block changes: it says what they are
    kind = f"handles{zlib.crc32(json.dumps([inputs, outputs]).encode()):08x}"
    return {"type": kind, "label": "", "inputs": inputs, "outputs": outputs}


def _edge(source: str, target: str) -> dict[str, Any]:
    (a, marker), (b, port) = source.split("."), target.split(".")
    ends = {"source": a, "sourceHandle": marker, "target": b, "targetHandle": port}
    return {"id": f"{source} -> {target}", "type": "smoothstep", "data": {}, **ends}


def _about(problem: Problem, graph: Graph) -> list[str]:
    """The blocks and ports that a problem is about; of blocks in a loop, where they are fed."""
    names = problem.where.removeprefix("blocks.").split(", ")
    fed = [w for w in graph.wires if {w.source.split(".")[0], w.target.split(".")[0]} <= {*names}]
    return [*names, *(wire.target for wire in fed)]
