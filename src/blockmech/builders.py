"""Graphs and linkages as users build them: those of the model, with doors to mechanisms.

Below this file a graph or a linkage knows nothing of what computes with it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Self, TypeAlias
from weakref import WeakKeyDictionary

from blockmech.ground.errors import FormatError, GraphError, Problem, in_file
from blockmech.ground.memory import uncollected
from blockmech.ground.runnable import LazyMethod, Runnable
from blockmech.model import document, graph
from blockmech.model.joints import linkage
from blockmech.model.naming import Names
from blockmech.model.reading import decoded, text_of
from blockmech.typing import Data

if TYPE_CHECKING:
    import blockmech.compiled
    import blockmech.draw
    from blockmech.assur.formation import Formation
    from blockmech.mechanism import Mechanism
    from blockmech.model.joints.decompose import General
    from blockmech.model.joints.dimensioned import Dimensions
else:
    blockmech = LazyMethod("blockmech")


class Uncompiled(Runnable["Mechanism"]):
    """A mechanism before compiling; its errors name the methods of a compiled one."""

    draw = blockmech.draw.draw
    run = blockmech.compiled.Compiled.run

    def check(self) -> list[Problem]:
        """All problems, as data, in the words of `compile`; an empty list is one that compiles.

        >>> g.check()
        []
        >>> g.add("weight", bm.Force(force=(0.0, -9.81)))
        >>> print(g.check()[0])
        [unwired-joint] weight.at: nothing is wired to it. every joint needs one wire. ...
        """
        try:
            self.compile()
        except GraphError as error:
            return list(error.problems)
        return []

    _homes = {
        "compile().{}": "blockmech.mechanism.Mechanism",
        "compile().structure.{}": "blockmech.model.structure.Structure",
        "run().{}": "blockmech.result.result.Result",
    }


class Graph(Uncompiled, graph.Graph):
    """A mechanism as a block diagram; it can be checked, compiled, run and saved.

    >>> import blockmech as bm
    >>> bm.Graph("fourbar").name
    'fourbar'
    """

    def compile(self) -> Mechanism:
        """Check the graph and freeze it into a mechanism that computes.

        The mechanism is a snapshot: the graph may be edited and compiled again.
        Raises `GraphError` with all problems.

        >>> g.compile()
        <Mechanism ruiz_fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II ...
        """
        from blockmech.mechanism import Mechanism

        return Mechanism._from_graph(self)

    def _repr_svg_(self) -> str:
        from blockmech.draw import svg

        return svg(self.draw(kind="diagram"))


@dataclass(frozen=True, repr=False)
class Decomposition:
    """A document as blocks.

    Attributes
    ----------
    data : the graph as it would stand in its file
    names : where the links, joints and drivers of the document are in the graph
    formation : drivers and groups in formation order, by the document's names
    document : what it was made of, if that tells it
    """

    data: Data
    names: Names
    formation: Formation
    document: linkage.Linkage | None = None

    def __repr__(self) -> str:
        return f"<Decomposition of {self.data['name']}: {self.formation}>"

    @cached_property
    def graph(self) -> Graph:
        """The block diagram; it can be saved, changed and compiled by itself."""
        return Graph.from_data(self.data)

    def compile(self) -> Mechanism:
        """A mechanism that computes, with the names of the document."""
        from blockmech.mechanism import Mechanism

        return Mechanism._from_graph(self.graph, self.names, self.document)


class Linkage(Uncompiled, linkage.Linkage):
    """A mechanism as links and joints; it can be checked, compiled, run and saved.

    >>> import blockmech as bm
    >>> bm.Linkage("crank_rocker").name
    'crank_rocker'
    """

    @uncollected()
    def decompose(self, general: General = "") -> Decomposition:
        """Drivers and Assur groups in formation order, as blocks.

        Parameters
        ----------
        general : "groups" makes every Assur group a general one, "one" puts all that is no
            driver in one general group; for comparison

        Raises `GraphError` with all problems.

        >>> m.decompose().graph
        <Graph slider_crank: 3 moving links, 4 pairs, mobility 1; I(motor: 0,1) -> II ...
        """
        blocks = self._as_blocks(general)
        return replace(blocks, data=deepcopy(blocks.data))

    def _as_blocks(self, general: General = "") -> Decomposition:
        """The same, made once as long as nothing of the document changes."""
        document = self.snapshot()  # what is kept must not hold the document that it is kept for
        now = {**vars(document), "general": general}
        then, blocks = _AS_BLOCKS.get(self, (None, None))
        if blocks is None or then != now:
            from blockmech.model.joints.decompose import decompose  # brings networkx

            blocks = Decomposition(*decompose(document, general))
            if document.wires:
                from blockmech.outputs.sensors_by_link import with_sensors_of_blocks

                blocks = replace(blocks, data=with_sensors_of_blocks(blocks.data, blocks.names))
            _AS_BLOCKS[self] = now, blocks
        return blocks

    def fit_dimensions(self) -> Dimensions:
        """What the dimensions determine: the drawing that fulfils them, and what remains free.

        Raises `GraphError` for dimensions that contradict each other, and for unknown names.

        >>> m.add_dimension("rod", "length", ["A", "B"], "250mm")
        >>> print(m.fit_dimensions())
        dimensions satisfied: 1; A moved most, by 0.0253 m
        degrees of freedom left: 3, of A, B
        """
        from blockmech.model.joints.dimensioned import fit_dimensions

        return fit_dimensions(self)

    def _fitted(self) -> Self:
        """The drawing that fulfils its dimensions; itself where it cannot."""
        from blockmech.model.joints.dimensioned import dimensioned

        try:
            return dimensioned(self)
        except GraphError:
            return self

    @uncollected()
    def compile(self) -> Mechanism:
        """Decompose the linkage and freeze it into a mechanism that computes.

        Its outputs have the names of the document. Raises `GraphError` with all problems.

        >>> m.compile()
        <Mechanism slider_crank: 3 moving links, 4 pairs, mobility 1; I(motor: 0,1) -> II ...
        """
        return self._as_blocks().compile()

    def _repr_svg_(self) -> str | None:
        return None if self.check() else self.compile()._repr_svg_()

    def __repr__(self) -> str:
        joints = [joint for joint in self.joints.values() if joint.type != "weld"]
        pairs = sum(len(joint.links) - 1 for joint in joints)
        moving = len([name for name in self.links if name != "frame"])
        counts = f"{moving} moving links, {pairs} pairs, {len(self.drivers)} driver"
        counts += "s" * (len(self.drivers) != 1)
        try:
            formula = str(self._as_blocks().formation)
        except GraphError:
            formula = "not complete: see check()"
        return f"<Linkage {self.name}: {counts}; {shorten(formula, 300, placeholder=' ...')}>"


_AS_BLOCKS: WeakKeyDictionary[Linkage, tuple[Data, Decomposition]] = WeakKeyDictionary()
"""Linkage -> what it was and the blocks that it became then."""


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
    return read_text(text_of(path), os.fspath(path))


def read_text(text: bytes | str, name: str) -> Opened:
    """The mechanism in a file's bytes or text, by its name in messages. Raises like `opened`."""
    kind: Callable[[Data], type[Opened]] = _kind
    return document.read(decoded(text, name) if isinstance(text, bytes) else text, name, kind)


def read(source: Any, *, unit: str | None = None, format: str | None = None) -> Opened:
    """A mechanism from a file of blockmech, or from another tool.

    Parameters
    ----------
    source : a file's name, an address of PMKS+, a Pyslvs expression, or a live linkage of
        pylinkage
    unit : "m", "cm", "mm", "in" or "ft", of the lengths of a file that names none; default m
    format : the format's name; by default the text says it

    Returns
    -------
    A graph or linkage. ``extras["notes"]`` lists what was not imported, and how units and rates
    were interpreted.

    Raises
    ------
    FormatError with all problems of the file
    RequestError for a unit or format that does not exist

    >>> import blockmech as bm
    >>> fourbar = bm.read("M[J[R, P[0, 0], L[ground, a]], J[R, P[0, 1], L[a, b]], "
    ...     "J[R, P[3, 2], L[b, c]], J[R, P[3, 0], L[ground, c]]]", unit="cm")
    >>> fourbar.run(at=[0.0], want="joint.C.p")["joint.C.p"]
    array([0.03+0.02j])
    """
    from blockmech.exchange.reading import beyond, imported

    is_file = isinstance(source, str | os.PathLike) and os.path.isfile(source)
    if is_file and format is None and b'"blockmech/' in _head(source):
        return opened(source)

    def imported_linkage(rounded: bool = False) -> Linkage:
        return Linkage.from_data(imported(source, unit, format, rounded))

    linkage: Linkage = beyond(imported_linkage(), lambda: imported_linkage(True))
    return linkage


def _head(path: str | os.PathLike[str]) -> bytes:
    """The first bytes of a file; none of one that cannot be read."""
    try:
        with open(path, "rb") as stream:
            return stream.read(4096)
    except OSError:
        return b""


def from_data(data: Data, file: str | os.PathLike[str] | None = None) -> Opened:
    """The mechanism in the plain data of a file. Raises like `opened`."""
    return _kind(data).from_data(data, (), os.fspath(file) if file else "")


def _kind(raw: Data) -> type[Opened]:
    """What data say that they are, or, if they name no format, what they look like."""
    joints = "joints" in raw and "blocks" not in raw
    if "format" in raw:
        joints = raw["format"] == Linkage.form.format
    return Linkage if joints else Graph


def compiled(path: str | os.PathLike[str]) -> Mechanism:
    """The mechanism in a file. Raises `FormatError`, `GraphError` that name the file."""
    return compiled_of(opened(path), path)


def compiled_of(document: Opened, path: str | os.PathLike[str]) -> Mechanism:
    """The mechanism of an opened file. Raises `GraphError` that names the file."""
    try:
        return document.compile()
    except GraphError as error:
        raise GraphError(in_file(error.problems, os.fspath(path))) from error.__cause__


def problems_in(path: str | os.PathLike[str]) -> list[Problem]:
    """Everything wrong with a file, and what its mechanism lacks to be computed."""
    try:
        return in_file(opened(path).check(), os.fspath(path))
    except (FormatError, GraphError) as error:
        return list(error.problems)
