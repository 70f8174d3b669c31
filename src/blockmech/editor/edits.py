"""What can be done to the form of a block diagram: each edit gives a new form.

A form is the plain data of a graph file. What an edit does not touch is shared with the
form before it; whether the new form is sound, the sheet finds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from blockmech.blocks.contract import Block, Moving
from blockmech.editor.fields import simplest, with_item
from blockmech.figures.palette import ROW
from blockmech.ground.errors import GraphError
from blockmech.ground.names import numbered_name
from blockmech.loads.contract import Element
from blockmech.model import checks, flat
from blockmech.model.diagram import Wire
from blockmech.model.graph import Graph
from blockmech.model.scene import PER_DRIVER
from blockmech.typing import Data, Record

Form = Data
Positions = Mapping[str, tuple[float, float]]  # [pt] of blocks on the canvas


def markers_of(block: Any) -> Data:
    """Markers of a block at which wires begin: name -> link and `Marker`; loads have none."""
    is_source = isinstance(block, Block) and not isinstance(block, Element)
    return dict(block.all_markers) if is_source else {}


def ports_of(block: Any) -> list[str]:
    """Joints and terminals of a block at which wires end."""
    if isinstance(block, Moving):
        return [joint.name for joint in block.joints.values() if joint.outer]
    return list(block.terminals) if isinstance(block, Element) else []


def added(form: Form, kind: str, name: str, at: tuple[float, float]) -> Form:
    """With a new block at a place, whose required values are the simplest that are valid."""
    block = {"type": kind, **(simplest(kind) or {})}
    return placed(with_item(form, ("blocks", name), block), {name: at})


def without(form: Form, blocks: Iterable[str], wires: Iterable[str] = ()) -> Form:
    """Without some blocks, all that hangs on them, and some wires (``"a.B -> c.D"``)."""
    gone, cut = set(blocks), set(wires)
    uncut = [
        wire
        for wire in form["wires"]
        if not gone & {wire["from"].split(".")[0], wire["to"].split(".")[0]}
        and f"{wire['from']} -> {wire['to']}" not in cut
    ]
    remaining = {name: block for name, block in form["blocks"].items() if name not in gone}
    changed = {**form, "blocks": remaining, "wires": uncut}
    return _by_block(changed, lambda name: None if name.split(".")[0] in gone else name)


def renamed(document: Graph, old: str, new: str) -> Form:
    """A diagram's form with another name of a block, wherever the block is named.

    Raises `GraphError` for a name that is taken or is none.
    """
    if problem := checks.name_problem(document.blocks, new, document.blocks[old]):
        raise GraphError(problem)

    def end(address: str) -> str:
        name, dot, rest = address.partition(".")
        return f"{new}{dot}{rest}" if name == old else address

    changed = document.snapshot()
    changed.blocks = {end(name): flat.renamed(x, end) for name, x in document.blocks.items()}
    changed.wires = [Wire(end(wire.source), end(wire.target)) for wire in document.wires]
    return _by_block(changed.to_data(), end)


def duplicated(form: Form, names: Iterable[str], positions: Positions) -> Form:
    """With a copy of each of some blocks beside it, not wired."""
    form = placed(form, positions)
    for name in names:
        copy, (x, y) = numbered_name(name, form["blocks"]), positions[name]
        form = with_item(form, ("blocks", copy), form["blocks"][name])
        form = placed(form, {copy: (x + 3 * ROW, y + 3 * ROW)})
    return form


def wired(form: Form, source: str | None, target: str) -> Form:
    """With a wire to a joint in the place of another one, or with none."""
    wires = [wire for wire in form["wires"] if wire["to"] != target]
    return {**form, "wires": [*wires, *([{"from": source, "to": target}] if source else [])]}


def placed(form: Form, positions: Positions) -> Form:
    """With places of blocks on the canvas, as far as they are there."""
    at = {n: [round(x, 1), round(y, 1)] for n, (x, y) in positions.items() if n in form["blocks"]}
    return {**form, "view": {**form.get("view", {}), **at}} if at else form


def _by_block(form: Form, rename: Callable[[str], str | None]) -> Form:
    """The sections that are keyed by a block or its driver, with other keys; None: without.

    A driver is called as its block, or by a joint of it (``scissors.cylinder``).
    """

    def keyed(part: Record) -> Data:
        return {new: item for old, item in part.items() if (new := rename(old)) is not None}

    scene = form.get("scene", {})
    scene = {key: keyed(part) if key in PER_DRIVER else part for key, part in scene.items()}
    changed = {**form, "scene": {key: part for key, part in scene.items() if part != {}}}
    if "view" in form:
        changed["view"] = keyed(form["view"])
    return changed
