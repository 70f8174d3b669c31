"""The block diagram as the page draws it: blocks and wires in their places, and what is wrong.

What a block looks like, which ports it has and whether a wire may be is read from the
declarations, as `draw.diagram` does.
"""

from __future__ import annotations

from functools import cache

from blockmech.blocks.registry import REGISTRY
from blockmech.draw.boxes import content_of
from blockmech.editor.canvas import PIXELS, Canvas
from blockmech.editor.fields import simplest
from blockmech.editor.revision import Revision
from blockmech.figures.palette import ROW
from blockmech.ground.errors import Problem
from blockmech.model import graph
from blockmech.typing import Data


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
