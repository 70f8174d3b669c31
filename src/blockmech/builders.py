"""Graphs and linkages as users build them: those of the model, with doors to mechanisms.

Below this file a graph or a linkage knows nothing of what computes with it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias

from blockmech.errors import FormatError, GraphError, Problem, in_file
from blockmech.model import graph
from blockmech.model.joints import linkage
from blockmech.model.joints.contents import FORMAT
from blockmech.model.reading import data_of, text_of

if TYPE_CHECKING:
    from blockmech.assur.formation import Formation
    from blockmech.mechanism import Mechanism
    from blockmech.model.joints.closing import Poses
    from blockmech.model.naming import Names
    from blockmech.result import Result

General = Literal["", "groups", "one"]


class Graph(graph.Graph):
    __doc__ = graph.Graph.__doc__

    @classmethod
    def of(cls, made: graph.Graph) -> Self:
        """A graph that the model made, with the doors of this class."""
        found = cls.__new__(cls)
        vars(found).update(vars(made))
        return found

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a graph file. Raises `FormatError` with all problems of the file."""
        from blockmech.model.document import load

        return cls.of(load(path))

    @classmethod
    def from_json(cls, text: str, file: str = "") -> Self:
        """Read the text of a graph file; ``file`` is its name in messages."""
        from blockmech.model.document import loads

        return cls.of(loads(text, file))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the canonical graph file, atomically."""
        from blockmech.model.document import save

        save(self, path)

    def to_json(self) -> str:
        """The canonical text of the graph file."""
        from blockmech.model.document import dumps

        return dumps(self)

    def compile(self) -> Mechanism:
        """Check the graph and freeze it into a mechanism that computes.

        The mechanism is a snapshot: the graph may be edited and compiled again.
        Raises `GraphError` with all problems.
        """
        from blockmech.mechanism import Mechanism

        return Mechanism.of(self)

    def run(self, **request: Any) -> Result:
        """Compile and run; see `Mechanism.run`."""
        return self.compile().run(**request)

    def _repr_svg_(self) -> str:
        from blockmech.draw import diagram_svg

        return diagram_svg(self)


@dataclass(frozen=True)
class Decomposition:
    """A document as blocks.

    Attributes
    ----------
    data : the graph as it would stand in its file
    names : where the links, joints and drivers of the document are in the graph
    formation : drivers and groups in formation order, by the document's names
    poses : where the links are, refined
    """

    data: dict[str, Any]
    names: Names
    formation: Formation
    poses: Poses

    @cached_property
    def graph(self) -> Graph:
        """The block diagram; it can be saved, changed and compiled by itself."""
        from blockmech.model.joints.diagram import graph_of

        return Graph.of(graph_of(self.data))

    def compile(self) -> Mechanism:
        """A mechanism that computes, with the names of the document."""
        from blockmech.mechanism import Mechanism

        return Mechanism.of(self.graph, self.names)


class Linkage(linkage.Linkage):
    __doc__ = linkage.Linkage.__doc__

    @classmethod
    def of(cls, made: linkage.Linkage) -> Self:
        """A linkage that the model made, with the doors of this class."""
        found = cls.__new__(cls)
        vars(found).update(vars(made))
        return found

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a joint-based file. Raises `FormatError` with all problems of the file."""
        from blockmech.model.joints.document import load

        return cls.of(load(path))

    @classmethod
    def from_json(cls, text: str, file: str = "") -> Self:
        """Read the text of a joint-based file; ``file`` is its name in messages."""
        from blockmech.model.joints.document import loads

        return cls.of(loads(text, file))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the canonical file, atomically."""
        from blockmech.model.joints.document import save

        save(self, path)

    def to_json(self) -> str:
        """The canonical text of the file."""
        from blockmech.model.joints.document import dumps

        return dumps(self)

    def check(self) -> list[Problem]:
        """Everything that is wrong, as data; an empty list is a mechanism that works."""
        from blockmech.model.joints.decompose import decompose

        try:
            return decompose(self).graph.check()
        except GraphError as error:
            return list(error.problems)

    def decompose(self, general: General = "") -> Decomposition:
        """Drivers and Assur groups in formation order, as blocks.

        Parameters
        ----------
        general : "groups" makes every Assur group a general one, "one" puts all that is no
            driver in one general group; for comparison

        Raises `GraphError` with all problems.
        """
        from blockmech.model.joints.decompose import decompose

        found = decompose(self, general)
        return Decomposition(found.data, found.names, found.formation, found.poses)

    def compile(self) -> Mechanism:
        """Decompose the linkage and freeze it into a mechanism that computes.

        Its outputs have the names of the document. Raises `GraphError` with all problems.
        """
        return self.decompose().compile()

    def run(self, **request: Any) -> Result:
        """Compile and run; see `Mechanism.run`."""
        return self.compile().run(**request)

    def __repr__(self) -> str:
        pairs = sum(len(joint.links) - 1 for joint in self.joints.values())
        moving = len([name for name in self.links if name != "frame"])
        counts = f"{moving} moving links, {pairs} pairs, {len(self.drivers)} driver"
        counts += "s" * (len(self.drivers) != 1)
        try:
            formula = shortened(str(self.decompose().formation))
        except GraphError:
            formula = "not complete: see check()"
        return f"<Linkage {self.name}: {counts}; {formula}>"


def shortened(formula: str, most: int = 300) -> str:
    """A structural formula that fits a few lines."""
    return formula if len(formula) <= most else f"{formula[:most].rsplit(' -> ', 1)[0]} -> ..."


# -- files ---------------------------------------------------------------------------------

Opened: TypeAlias = Graph | Linkage
"""What a file of a mechanism holds."""


def opened(path: str | os.PathLike[str]) -> Opened:
    """The mechanism in a file, whose ``format`` says whether it has blocks or joints.

    Raises
    ------
    FormatError with all problems of the file
    GraphError if only the wiring of a graph is wrong
    """
    file, text = os.fspath(path), text_of(path)
    return (Linkage if _of_joints(text) else Graph).from_json(text, file)


def _of_joints(text: str) -> bool:
    """Whether the text says so, or, if it names no format, has joints and no blocks."""
    try:
        raw, _ = data_of(text)
    except FormatError:  # the readers say better what is wrong
        return False
    if "format" in raw:
        return bool(raw["format"] == FORMAT)
    return "joints" in raw and "blocks" not in raw


def problems_in(path: str | os.PathLike[str]) -> list[Problem]:
    """Everything wrong with a file, and what its mechanism lacks to be computed."""
    try:
        return in_file(opened(path).check(), os.fspath(path))
    except (FormatError, GraphError) as error:
        return list(error.problems)
