"""What stands where on the canvas of a block diagram: blocks, their handles, and the wires.

All markers of a block are shown, handles are a row from each other on both sides, so that the
layout of the printed diagram knows where the wires of the canvas begin and end.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from blockmech.draw.boxes import Content, DrawnBlock
from blockmech.draw.diagram import view_of
from blockmech.draw.layout import Box, Ends, arrange
from blockmech.draw.palette import ROW, SIZES, SMALL, TEXT
from blockmech.draw.paper import text_width, wrapped
from blockmech.draw.routing import Point, Rectangle, place, runs_through, way_between
from blockmech.model.graph import Graph
from blockmech.studio.edits import markers_of

PIXELS = 13 / TEXT  # of the page for a point of a file's view: 13 px words in place of 8 pt ones
ENDS = ("source", "sourceHandle", "target", "targetHandle")  # of a wire, in React Flow's words


@dataclass(frozen=True)
class Canvas:
    """Words, handles and rectangles [pt] of blocks, and the ways of wires that were laid out."""

    words: Mapping[str, list[str]]
    types: Mapping[str, dict[str, Any]]
    boxes: Mapping[str, Rectangle]
    ways: Mapping[int, list[Point]]

    @classmethod
    def of(cls, content: Content, shown: Graph, wrong: Mapping[str, str]) -> Canvas:
        """Blocks where the author put them, others where they follow from the wires."""
        at, wires = view_of(shown), [wire.ends for wire in content.wires]
        words, types, boxes = {}, {}, []
        for block in content.blocks:
            spec = types[block.name] = _node_type(shown, block, wrong, wires)
            ports, markers = (tuple(h["id"] for h in spec[s]) for s in ("inputs", "outputs"))
            beside = max((text_width(x, SMALL) for x in (*ports, *markers)), default=0.0)
            words[block.name], width = _words(block, wrong.get(block.name))
            width += 2 * (beside + 2 * SIZES.pad)
            rows = max(len(ports), len(markers), len(words[block.name])) + 1
            ends = (*ports, *map(str, range(len(ports), rows)))  # free below, for wires that pass
            boxes.append(Box(block.name, width, ends, 1, 0, block.kind == "frame", markers))
        sizes = {box.name: (box.width, len(box.ports) * ROW) for box in boxes}
        ways: dict[int, list[Point]] = {}
        if len(at) < len(boxes):
            made = place(arrange(boxes, wires))
            below = max((y + sizes[name][1] for name, (_, y) in at.items()), default=0.0)
            at = {n: at.get(n, (r.x, r.y + below)) for n, r in made.boxes.items()}
            ways = {} if view_of(shown) else made.ways
        return cls(words, types, {n: Rectangle(*at[n], *sizes[n]) for n in at}, ways)

    def edge(self, wire: int, ends: Ends) -> dict[str, Any]:
        """A wire as React Flow draws it: right-angled, with one climb, through few blocks."""
        a, b, free = self.boxes[ends.source], self.boxes[ends.target], SIZES.stub / 2
        rows = (
            [handle["id"] for handle in self.types[name][side]].index(pin) + 1
            for name, side, pin in ((*ends[:1], "outputs", ends[1]), (ends[2], "inputs", ends[3]))
        )
        left, right = a.x + a.width, b.x
        y, y2 = (r.y + ROW * row for r, row in zip((a, b), rows, strict=True))
        way = self.ways.get(wire) or way_between((left, y), (right, y2), wire, self.boxes.values())
        climbs = [x for (x, _), (x2, _) in pairwise(way) if x == x2] or [(left + right) / 2]

        def met(x: float) -> int:
            tried = (left, y), (x, y), (x, y2), (right, y2)
            return sum(runs_through(tried, r) for r in self.boxes.values())

        x = min(climbs, key=met) if len(climbs) > 1 else climbs[0]
        at = (x - left - free) / (right - left - 2 * free) if right > left + 2 * free else 0.5
        return {
            "id": str(ends),
            "type": "smoothstep",
            "data": {},
            **dict(zip(ENDS, ends, strict=True)),
            "pathOptions": {"offset": free * PIXELS, "stepPosition": at},
        }


def _words(block: DrawnBlock, wrong: str | None) -> tuple[list[str], float]:
    """The lines on a block, and how wide it is [pt]."""
    lines = [line for line in (block.name, block.words, "  ".join(block.drive)) if line]
    inside = max(text_width(line, SMALL) for line in lines[1:] or ("",))
    inside = max(inside, text_width(block.name, TEXT, bold=True))
    return [*lines, *(wrapped(f"⚠ {wrong}", SMALL, inside) if wrong else ())], inside


def _node_type(
    shown: Graph,
    block: DrawnBlock,
    wrong: Mapping[str, str],
    wires: Iterable[Ends],
) -> dict[str, Any]:
    """Handles of a block: joints and terminals on the left, markers and guides on the right."""
    inputs = []
    for port in block.ports:
        said = wrong.get(f"{block.name}.{port.name}")
        label = f"{port.name} ⚠ {said}" if said else port.name
        inputs.append({"id": port.name, "label": label, "type": port.pair or "load"})
    outputs = []
    known = markers_of(shown.blocks.get(block.name))
    for name in dict.fromkeys((*known, *(w.marker for w in wires if w.source == block.name))):
        _, marker = known.get(name, ("", None))
        guide = getattr(marker, "angle", None) is not None or getattr(marker, "dir", None)
        outputs.append({"id": name, "label": name, "type": "guide" if guide else "marker"})
    # React Flow measures handles again where the type of a block changes: it says what they are
    kind = f"handles{zlib.crc32(json.dumps([inputs, outputs]).encode()):08x}"
    return {"type": kind, "label": "", "inputs": inputs, "outputs": outputs}
