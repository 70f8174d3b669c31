"""The block diagram as the page draws it: blocks and wires in their places, and what is wrong.

What a block looks like, which ports it has and whether a wire may be is read from the
declarations, as `draw.diagram` does. All markers of a block are shown, handles are a row from each
other on both sides, so that the layout of the printed diagram knows where the wires of the canvas
begin and end.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from blockmech.blocks.block import REGISTRY
from blockmech.draw.boxes import Content, DrawnBlock, content_of
from blockmech.draw.diagram import view_of
from blockmech.draw.layout import Box, arrange
from blockmech.draw.routing import Placed, Point, Rectangle, lay_out, path_between
from blockmech.editor.edits import markers_of
from blockmech.editor.fields import simplest
from blockmech.editor.revision import Revision
from blockmech.figures.palette import ROW, SIZES, SMALL, TEXT
from blockmech.figures.paper import text_width, wrapped
from blockmech.ground.errors import Problem
from blockmech.model import graph
from blockmech.model.diagram import Ends
from blockmech.model.graph import Graph
from blockmech.typing import Data

PIXELS = 13 / TEXT  # of the page for a point of a file's view: 13 px words in place of 8 pt ones


@dataclass(frozen=True)
class Canvas:
    """Words, handles and rectangles [pt] of blocks, and the ways of wires that were laid out."""

    words: Mapping[str, list[str]]
    handles: Mapping[str, dict[str, list[dict[str, str]]]]
    boxes: Mapping[str, Rectangle]
    ways: Mapping[int, list[Point]]

    @classmethod
    def of(cls, content: Content, graph: Graph, problems: Mapping[str, str]) -> Canvas:
        """Blocks where the author put them, others where they follow from the wires."""
        at, wires = view_of(graph), [wire.ends for wire in content.wires]
        labels, handles, boxes = {}, {}, []
        for block in content.blocks:
            spec = handles[block.name] = _handles(graph, block, problems, wires)
            ports, markers = (tuple(h["id"] for h in spec[s]) for s in ("inputs", "outputs"))
            margin = max((text_width(x, SMALL) for x in (*ports, *markers)), default=0.0)
            labels[block.name], width = _labels(block, problems.get(block.name))
            width += 2 * (margin + 2 * SIZES.pad)
            rows = max(len(ports), len(markers), len(labels[block.name])) + 1
            ends = (*ports, *map(str, range(len(ports), rows)))  # free below, for wires that pass
            boxes.append(Box(block.name, width, ends, 1, 0, block.kind == "frame", markers))
        sizes = {box.name: (box.width, len(box.ports) * ROW) for box in boxes}
        ways: dict[int, list[Point]] = {}
        if len(at) < len(boxes):
            layout = _laid_out(tuple(boxes), tuple(wires))
            below = max((y + sizes[name][1] for name, (_, y) in at.items()), default=0.0)
            at = {n: at.get(n, (r.x, r.y + below)) for n, r in layout.boxes.items()}
            ways = {} if view_of(graph) else layout.ways
        return cls(labels, handles, {n: Rectangle(*at[n], *sizes[n]) for n in at}, ways)

    def blocks(self, content: Content, wrong: Collection[str]) -> list[Data]:
        """The blocks as `diagram.js` draws them, in pixels."""
        return [
            {
                "id": block.name,
                "kind": block.kind,
                "bad": block.name in wrong,
                "lines": self.words[block.name],
                **self.handles[block.name],
                **{key: x * PIXELS for key, x in self.boxes[block.name]._asdict().items()},
            }
            for block in content.blocks
        ]

    def wire(self, k: int, ends: Ends) -> Data:
        """A wire and its way [px]: as it was laid out, or a plain one through few blocks."""
        boxes, sides = (self.boxes[ends.source], self.boxes[ends.target]), ("outputs", "inputs")
        at_ports = []
        for r, side, name, pin in zip(boxes, sides, ends[::2], ends[1::2], strict=True):
            row = [handle["id"] for handle in self.handles[name][side]].index(pin) + 1.5
            at_ports.append((r.x + r.width * (side == "outputs"), r.y + ROW * row))
        begin, end = at_ports
        route = self.ways.get(k) or path_between(begin, end, k, self.boxes.values())
        return {
            "id": str(ends),
            "from": [ends.source, ends.marker],
            "to": [ends.target, ends.port],
            "way": [[x * PIXELS, y * PIXELS] for x, y in route],
        }


@lru_cache(8)  # an undo, or another length, leaves the diagram as one that was there before
def _laid_out(boxes: tuple[Box, ...], wires: tuple[Ends, ...]) -> Placed:
    """Where blocks and wires are put that nobody has put anywhere; not to be changed."""
    return lay_out(arrange(boxes, wires))


def _labels(block: DrawnBlock, wrong: str | None) -> tuple[list[str], float]:
    """The lines on a block, and how wide it is [pt]."""
    lines = [line for line in (block.name, block.words, "  ".join(block.drive)) if line]
    inside = max(text_width(line, SMALL) for line in lines[1:] or ("",))
    inside = max(inside, text_width(block.name, TEXT, bold=True))
    return [*lines, *(wrapped(f"⚠ {wrong}", SMALL, inside) if wrong else ())], inside


def _handles(
    graph: Graph, block: DrawnBlock, problems: Mapping[str, str], wires: Iterable[Ends]
) -> dict[str, list[dict[str, str]]]:
    """Handles of a block: joints and terminals on the left, markers and guides on the right."""
    problem_at = {port.name: problems.get(f"{block.name}.{port.name}", "") for port in block.ports}
    inputs = [
        {"id": p.name, "kind": p.pair or "load", "said": problem_at[p.name]} for p in block.ports
    ]
    outputs = []
    markers = markers_of(graph.blocks.get(block.name))
    for name in dict.fromkeys((*markers, *(w.marker for w in wires if w.source == block.name))):
        _, marker = markers.get(name, ("", None))
        guide = getattr(marker, "angle", None) is not None or getattr(marker, "dir", None)
        outputs.append({"id": name, "kind": "guide" if guide else "marker", "said": ""})
    return {"inputs": inputs, "outputs": outputs}


def kinds() -> list[tuple[str, str, str, str]]:
    """Type, family and word of every kind of block, and why it cannot be begun here or ""."""
    return _kinds(tuple(REGISTRY))


@cache
def _kinds(types: tuple[str, ...]) -> list[tuple[str, str, str, str]]:
    kinds = []
    for kind in types:
        word, alone = kind.split(".")[-1], graph.Graph()
        values = simplest(kind)
        if values is None:  # as of a group, whose links and pairs are more than one field each
            family = kind.partition(".")[0]
            instead = "draw links and joints, or " if family == "group" else ""
            why = f"{kind} has no simplest values: {instead}open a file with one"
            kinds.append((kind, family, word.replace("_", " "), why))
            continue
        alone.add(word, REGISTRY[kind](**values))
        block, *_ = content_of(alone).blocks  # a coupling also names drivers, which are not here
        word = {"group": block.words}.get(block.kind, word)
        kinds.append((kind, block.kind, word.replace("_", " "), ""))
    order = {kind: k for k, kind in enumerate(("frame", "driver", "group", "coupling"))}
    return sorted(kinds, key=lambda item: order.get(item[1], len(order)))


def diagram_of(now: Revision) -> Data:
    """Blocks, wires and problems of a revision; of links and joints what follows from them."""
    blocks = now.blocks
    editable = blocks is now.document
    content = content_of(blocks, most=len(blocks.blocks) + 1)
    wrong = {at: p.found for p in now.problems if editable for at in _concerned_names(p, blocks)}
    laid = Canvas.of(content, blocks, wrong)
    return {
        "blocks": laid.blocks(content, {at.partition(".")[0] for at in wrong}),
        "wires": [laid.wire(k, wire.ends) for k, wire in enumerate(content.wires)],
        "editable": editable,
        "kinds": kinds() if editable else [],
        "row": ROW * PIXELS,
        "pixels": PIXELS,
    }


def _concerned_names(problem: Problem, blocks: graph.Graph) -> list[str]:
    """The blocks and ports that a problem is about; of blocks in a loop, where they are fed."""
    names = problem.where.removeprefix("blocks.").split(", ")
    fed = [w for w in blocks.wires if {w.source.split(".")[0], w.target.split(".")[0]} <= {*names}]
    return [*names, *(wire.target for wire in fed)]
