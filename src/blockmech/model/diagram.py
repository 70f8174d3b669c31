"""What a block diagram is made of besides blocks, and the sections of its file."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import Block, Joint, Moving
from blockmech.ground.errors import Problem, path_text, unknown_key
from blockmech.ground.names import split_address
from blockmech.ground.validation_errors import field_order
from blockmech.ground.values import StrictModel
from blockmech.model.expect import Expectation
from blockmech.model.form import Form, Section
from blockmech.model.scene import Scene
from blockmech.model.versions import VERSION
from blockmech.typing import Data, Record


@dataclass(frozen=True)
class UnknownBlock:
    """A block of a type that is not installed: kept verbatim, drawn, never computed."""

    type: str
    raw: Data = field(default_factory=dict)


class Ends(NamedTuple):
    """A wire from a marker or output of one block to a joint, terminal or input of another."""

    source: str
    marker: str
    target: str
    port: str

    def __str__(self) -> str:
        return f"{self.source}.{self.marker} -> {self.target}.{self.port}"


@dataclass(frozen=True)
class Wire:
    """From a marker of an earlier link to a joint of a later block, or to an element.

    A signal goes from an output to an input of a signal block or the law of an element.
    """

    source: str
    target: str

    @property
    def written(self) -> dict[str, str]:
        """As it stands in a file."""
        return {"from": self.source, "to": self.target}

    @property
    def ends(self) -> tuple[str, str]:
        """Source and target."""
        return self.source, self.target

    @property
    def turned(self) -> Wire:
        """The same the other way round."""
        return Wire(self.target, self.source)

    def split_ends(self, blocks: Container[str]) -> Ends:
        """The names of its blocks, and those behind them; empty where an address has none."""
        source, target = (split_address(str(end), blocks) for end in self.ends)
        return Ends(*source, *target)

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


AnyBlock = Block | UnknownBlock


def driven_joints(blocks: Mapping[str, AnyBlock]) -> dict[str, tuple[str, Joint]]:
    """Driver -> its block and the pair that it drives."""
    moving = ((n, b) for n, b in blocks.items() if isinstance(b, Moving))
    return {b.driver_name(n, j.name): (n, j) for n, b in moving for j in b.driven}


class WireEnds(StrictModel):
    """From ``"block.marker"`` of an earlier link to ``"block.joint"`` of a later block.

    A signal goes from ``"block.output"`` or an output's name to ``"block.input"``.
    """

    source: str = Field(alias="from")
    target: str = Field(alias="to")


class GraphDocument(StrictModel):
    """A mechanism as a block diagram, in SI units and radians."""

    format: Literal["blockmech/graph"]
    version: Annotated[int, Field(strict=True, ge=VERSION, le=VERSION)]
    name: str = "mechanism"
    title: str = ""
    blocks: Data
    wires: list[WireEnds] = []
    scene: Scene = Scene()
    parameters: Annotated[
        dict[str, str | list[str]],
        Field(description="numbers that a graph with this one inside sets by name: addresses"),
    ] = {}
    view: Annotated[Data, Field(description="places on a canvas; not computed with")] = {}
    expect: list[Expectation] = []
    source: str = ""
    notes: str | list[str] = ""


BLOCKS = Section("block", REGISTRY, "type", other=UnknownBlock)
ALWAYS = ("blocks", "wires")
GRAPH_FILE = Form(
    "blockmech/graph", "a graph file", GraphDocument, ALWAYS, lambda: {"blocks": BLOCKS}
)


def python_keys(scene: Scene, raw: Record) -> Iterator[Problem]:
    """Keys of laws that are names in Python only, such as ``start`` for ``from``."""
    for driver, law in scene.drive.items():
        fields = type(law).model_fields
        keys = [fields[name].alias or name for name in field_order(type(law))]
        for key in raw["scene"]["drive"][driver]:
            if key not in keys:
                where = path_text(("scene", "drive", driver, key))
                problem = unknown_key(where, f"the law {law.law}", key, keys)
                yield replace(problem, remedy=f'did you mean "{fields[key].alias}"?')
