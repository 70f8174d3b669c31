"""What stands in a graph file, section by section."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from blockmech.model.expect import Expectation
from blockmech.model.migrations import VERSION
from blockmech.model.scene import Scene
from blockmech.values import Strictly

FORMAT = "blockmech/graph"
EXTRAS = ("view", "expect", "source", "notes")
"""Sections that travel with a graph and are not computed with."""


class WireEnds(Strictly):
    """From ``"block.marker"`` of an earlier link to ``"block.joint"`` of a later block."""

    source: str = Field(alias="from")
    target: str = Field(alias="to")


class GraphDocument(Strictly):
    """A mechanism as a block diagram, in SI units and radians."""

    format: Literal["blockmech/graph"]
    version: Annotated[int, Field(strict=True, ge=1, le=VERSION)]
    name: str = "mechanism"
    title: str = ""
    blocks: dict[str, Any]
    wires: list[WireEnds] = []
    scene: Scene = Scene()
    view: Annotated[dict[str, Any], Field(description="places on a canvas; not computed with")] = {}
    expect: list[Expectation] = []
    source: str = ""
    notes: str | list[str] = ""
