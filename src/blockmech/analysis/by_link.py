"""Checks of a joint-based document: computed by blocks, told by links."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result import Result


def run_of_blocks(mechanism: Compiled, request: Mapping[str, Any]) -> Result:
    """A run whose outputs have the names of the graph, whoever asks for it."""
    return mechanism.of_blocks.run(**request)


def checks_said(mechanism: Compiled) -> dict[str, str]:
    """Name of a check of `verify` -> the same in the words of the document, if there is one."""
    if mechanism.names is None:
        return {}
    blocks = mechanism.structure.blocks
    found = {f"power through {b}": f"power through {mechanism.said(b)}" for b in blocks}
    for name, link in mechanism.names.links.items():
        found |= {f"{what} on {link.link}": f"{what} on {name}" for what in ("forces", "moments")}
    for name in mechanism.drivers:
        drive = mechanism.of_driver(name, "drive")
        found[f"two routes to {name}.drive"] = f"two routes to {drive}"
    return found
