"""What a document of links and joints is as blocks; see `decompose`, which finds it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from blockmech.model.document import Document
from blockmech.model.graph import Graph
from blockmech.model.naming import Names

if TYPE_CHECKING:
    from blockmech.assur.formation import Formation

General = Literal["", "groups", "one"]


@dataclass(frozen=True)
class Decomposition:
    """A document as blocks.

    Attributes
    ----------
    data : the graph as it would stand in its file
    names : where the links, joints and drivers of the document are in the graph
    formation : drivers and groups in formation order, by the document's names
    document : what it was made of, if that tells it
    """

    data: dict[str, Any]
    names: Names
    formation: Formation
    document: Document | None = None

    @cached_property
    def graph(self) -> Graph:
        """The block diagram; it can be saved, changed and compiled by itself."""
        return Graph.from_data(self.data)
