"""Documents of older versions, brought to the current one before anything is checked.

Version 2: the law of motion "table" is a "trajectory", and outputs of couplings begin with the
coupling's name among links and joints as among blocks: "mesh.force", not "coupling.mesh.force".
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from blockmech.ground.names import MECHANISM, free_name
from blockmech.typing import Data

VERSION = 2
"""The version of files that this blockmech writes; it reads all up to this one."""
OWNERS = ("driver", "link", "joint", MECHANISM)
"""What outputs of links and joints begin with, beside names of couplings, loads and signals."""
COUPLING = "coupling."
"""What the names of couplings' outputs began with among links and joints in version 1."""


def current(document: Data) -> Data:
    """A document of the current version: a copy where its own is older."""
    version = document.get("version")
    if type(version) is not int or version != 1:  # 1.0 and true are none
        return document
    document = {**copy.deepcopy(document), "version": VERSION}
    _name_trajectories(document)
    _shorten_outputs(document)
    return document


def _at(data: Any, *keys: str) -> Data:
    """The object at a place in a document; an empty one where there is none."""
    for key in keys:
        data = data.get(key) if isinstance(data, dict) else None
    return data if isinstance(data, dict) else {}


def _objects(data: Any) -> Iterator[Data]:
    """The objects among the items of an object or list."""
    items = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    yield from (item for item in items if isinstance(item, dict))


def _name_trajectories(document: Data) -> None:
    """Rename the law of motion "table", also of graphs inside of this one."""
    for section in (_at(document, "drivers"), _at(document, "scene", "drive")):
        for law in _objects(section):
            if law.get("law") == "table":
                law["law"] = "trajectory"
    for block in _objects(_at(document, "blocks")):
        _name_trajectories(_at(block, "graph"))


def _shorten_outputs(document: Data) -> None:
    """Name outputs of couplings after these alone; one named like a load or signal is renamed."""
    couplings = _at(document, "couplings")
    taken = {*_at(document, "loads"), *_at(document, "signals"), *OWNERS}
    used, names = taken | couplings.keys(), dict[str, str]()
    for x in couplings:
        names[x] = free_name(x, used) if x in taken else x
        used.add(names[x])
    if couplings:
        document["couplings"] = {names[x]: item for x, item in couplings.items()}

    def renamed(output: Any) -> Any:
        if not isinstance(output, str) or not output.startswith(COUPLING):
            return output
        name, dot, quantity = output.removeprefix(COUPLING).partition(".")
        return names.get(name, name) + dot + quantity

    for expectation in _objects(document.get("expect")):
        if outputs := _at(expectation, "want"):
            expectation["want"] = {renamed(output): x for output, x in outputs.items()}
    for wire in _objects(document.get("wires")):
        if "from" in wire:
            wire["from"] = renamed(wire["from"])
