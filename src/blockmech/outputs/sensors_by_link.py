"""Sensors of a joint-based document: its outputs, read of the blocks that it became.

What a document calls ``joint.C.reaction.x`` is an output of a block, perhaps with the other
sign, or a sum of several: then a block ``signal.sum`` gives it.
"""

from __future__ import annotations

from collections.abc import Mapping

from blockmech.ground.errors import GraphError, Problem
from blockmech.ground.names import free_name, split_address
from blockmech.model.graph import Graph
from blockmech.model.joints.varied import settled
from blockmech.model.naming import Names
from blockmech.outputs.by_block import PARTS, Catalogue
from blockmech.outputs.by_link import Reading, readings
from blockmech.outputs.by_owner import ByOwner, unknown_output, vector_sensor
from blockmech.typing import Data, Record

IDLE = {"kind": "constant", "value": 0.0}


def with_sensors_of_blocks(data: Data, names: Names) -> Data:
    """The data of a graph whose wires read outputs of its blocks in place of the document's.

    Raises `GraphError` with what is read and is no output of the document, or no number that
    blocks give.
    """
    blocks, signals = dict(data["blocks"]), set(names.signals.values())
    structure = Graph.from_data(_without_signals(settled(data), signals)).structure()
    catalogue = Catalogue(structure)
    table = ByOwner(readings(structure, names, catalogue.by_owner), narrow=True)
    wires, sources, problems = [], dict[str, str](), list[Problem]()
    for wire in data["wires"]:
        source, target = wire["from"], wire["to"]
        to_signal = _of_signals(blocks, signals, target)
        if not to_signal or split_address(source, signals)[0] in signals:
            wires.append(wire)
            continue
        if source not in sources:
            reading = _reading(table, catalogue, source)
            if isinstance(reading, Problem):
                problems.append(reading)
                continue
            sources[source], added = _block_output(blocks, source, reading)
            wires += added
        wires.append({"from": sources[source], "to": target})
    GraphError.raise_for(problems)
    return {**data, "blocks": blocks, "wires": wires}


def _of_signals(blocks: Record, signals: set[str], target: str) -> bool:
    """Whether a wire ends at a signal block or a law."""
    name, port = split_address(target, blocks)
    return name in signals or (port == "law" and "law" in blocks[name])


def _without_signals(data: Data, signals: set[str]) -> Data:
    """The same mechanism, with loads that do nothing where they follow signals."""
    blocks = {
        name: {**block, "law": IDLE} if block.get("law") == {"kind": "signal"} else block
        for name, block in data["blocks"].items()
        if name not in signals
    }
    wires = [w for w in data["wires"] if not _of_signals(data["blocks"], signals, w["to"])]
    return {**data, "blocks": blocks, "wires": wires}


def _reading(table: Mapping[str, Reading], catalogue: Catalogue, source: str) -> Reading | Problem:
    """How an output of the document is read of blocks; the parts of a vector are numbers."""
    vector, _, part = source.rpartition(".")
    ends = ""
    reading = table.get(source)
    if reading is None and part in PARTS and vector in table:
        reading, ends = table[vector], f".{part}"
    parts = [] if reading is None else [(n + ends, s) for n, s in reading.parts]
    if reading is None or not all(name in catalogue for name, _ in parts):
        return unknown_output(source, table)
    if catalogue[parts[0][0]].kind == "vector":
        return vector_sensor(source)
    return reading._replace(parts=tuple(parts))


def _block_output(blocks: Data, source: str, reading: Reading) -> tuple[str, list[dict[str, str]]]:
    """An output of a block that is a reading, and the wires to a block that is added for it."""
    parts = list(reading.parts)
    offset = reading.turn or reading.shift
    if len(parts) == 1 and parts[0][1] > 0 and not offset:
        return parts[0][0], []
    name = free_name(source.replace(".", "_"), blocks)
    if offset:
        constant = free_name(f"{name}_{'turn' if reading.turn else 'shift'}", blocks)
        blocks[constant] = {"type": "signal.constant", "value": offset}
        parts.append((f"{constant}.y", 1))
    signs = "".join("+" if sign > 0 else "-" for _, sign in parts)
    blocks[name] = {"type": "signal.sum", "signs": signs}
    if reading.wrapped or reading.turn:
        blocks[name]["wrap"] = True
    wires = [{"from": n, "to": f"{name}.u{k}"} for k, (n, _) in enumerate(parts)]
    return f"{name}.y", wires
