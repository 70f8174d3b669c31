"""What a block diagram is made of besides blocks: wires, and blocks nobody knows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from blockmech.blocks.contract import Block


@dataclass(frozen=True)
class UnknownBlock:
    """A block of a type that is not installed: kept verbatim, drawn, never computed."""

    type: str
    raw: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Wire:
    """From a marker of an earlier link to a joint of a later block, or to an element."""

    source: str
    target: str

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


AnyBlock = Block | UnknownBlock
