"""A family of designs: one mechanism, some of whose numbers are turned.

All designs of a family run as one program wherever its plan is that of each of them: the
plan leaves out what is zero, so it is made for a design in which no varied number is. What
is found out before anything is planned cannot vary so: which way a driver counts, the mode
of a dyad, laws of motion, the path of a group without closed form and the change points of
a branch that follows. Then each design is made, checked and compiled by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from blockmech.compiled import Compiled
from blockmech.ground.errors import FormatError, GraphError, Problem, refused
from blockmech.ground.units import NoQuantity, in_si
from blockmech.model.graph import Graph
from blockmech.model.joints.varied import Varied
from blockmech.model.parameters import Parameter, Path, named, parameters_of
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.passes.forward import position
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.result.tables import aligned
from blockmech.studies.variation import (
    Variation,
    designed,
    graph_sections,
    is_sided,
    is_written_out,
    moves_drivers,
    of_links,
    planned_aside,
)
from blockmech.typing import Data, FrictionMethod


def in_si_by_address(mechanism: Compiled, values: Mapping[str, Any], argument: str) -> Data:
    """Address -> values in SI in place of texts with a unit, which must be one of the number's.

    Raises `RequestError` for addresses of nothing and other units.
    """
    in_si_values = dict(values)
    rows = {a: getattr(x, "texts", x) for a, x in values.items()}  # of a distribution its texts
    addresses = {a: a for a, row in rows.items() if isinstance(row, str | list | tuple)}
    try:
        for p, address in named(parameters(mechanism), addresses).items():
            row = in_si(rows[address], p.unit)
            in_si_values |= {} if hasattr(values[address], "texts") else {address: row}
    except NoQuantity as error:
        raise refused(f"{argument}.{address}", error.found, "", error.valid) from None
    return in_si_values


class Parameters(dict[str, Parameter]):
    """Every number of a mechanism by address, with value and unit."""

    def __repr__(self) -> str:
        rows = [(p.address, f"{p.value:.9g}", p.unit or "-") for p in self.values()]
        return "\n".join(aligned(("parameter", "value", "unit"), rows))


def parameters(mechanism: Compiled) -> Parameters:
    """All numbers of the mechanism's graph or linkage, by parameter path.

    >>> mech.parameters()["dyad.l_i"]
    Parameter(address='dyad.l_i', value=6.0, unit='m', path=('blocks', 'dyad', 'l_i'))
    """
    document = mechanism.document
    return Parameters(
        parameters_of(graph_sections(mechanism) if document is None else document.sections())
    )


def remade(mechanism: Compiled, values: Mapping[str, float]) -> Compiled:
    """The mechanism with other numbers, checked like a file and compiled.

    Raises `FormatError`, `GraphError` for numbers that do not fit.
    """
    assert mechanism.document is not None
    document: Any = mechanism.document.replace(values)
    if isinstance(document, Graph):
        return type(mechanism)._from_graph(document, mechanism.names)
    design: Compiled = document.compile()
    return design


class Family:
    """The designs of a mechanism in which some numbers vary.

    Attributes
    ----------
    mechanism : the design that they are made of
    parameters : what varies
    alone : why each design needs a program of its own; "" where one serves all
    general : a mechanism whose plans hold for every design, if one serves all
    """

    def __init__(
        self,
        mechanism: Compiled,
        addresses: Iterable[str],
        friction: FrictionMethod | None = "none",
    ) -> None:
        """Raises `RequestError` for addresses of nothing.

        ``friction`` is the method with which designs run, as that of a run.
        """
        self.mechanism = mechanism
        self._courses = friction != "none" and bool(mechanism.structure.remembering)
        self.parameters = tuple(named(parameters(mechanism), dict.fromkeys(addresses)))
        self._taken = {p: (p.value, p.value) for p in self.parameters}
        self.general = mechanism
        self.alone = self._why_alone()

    def problems(self, p: Parameter, x: float) -> Iterable[Problem]:
        """What the file says against a number by itself.

        What it takes are intervals, sometimes without zero; of whole numbers some.
        """
        low, high = self._taken[p]
        inside = low <= x <= high and x and not isinstance(p.value, int)
        if self.mechanism.document is None or inside:
            return ()
        try:
            self.mechanism.document.replace({p.address: document_value(p, x)})
        except (FormatError, GraphError) as error:
            return error.problems
        self._taken[p] = min(low, x), max(high, x)
        return ()

    def _why_alone(self) -> str:
        for p in self.parameters:
            sided = [is_sided(self.mechanism, path) for path in self.places[p]]
            if isinstance(p.value, int) or False in sided:
                return f"{p.address} chooses between structures"
            if any(map(moves_drivers, (p.path, *self.places[p]))):
                return f"{p.address} says how the drivers move"
            if not self.places[p]:
                return f"{p.address} belongs to the geometry of the document"
        numbers = {path: p.value for p in self.parameters for path in self.places[p]}
        self.general = planned_aside(self.mechanism, numbers)
        if self._courses:
            return "friction laws with a state have a course of their own in each design"
        return self._moved(self.general.structure)

    def _moved(self, general: Structure) -> str:
        """Which path or branch that is found before planning depends on what varies."""
        structure, plan = self.mechanism.structure, None
        for name, block in structure.blocks.items():
            if not (block.own_form or name in structure.followed or of_links(self.mechanism)):
                continue
            plan = plan or schedule(general, Scene(), Friction("none"))
            plan.ask(position, name)
            above = structure.ancestors(name)
            formulas_and_homes = [
                (
                    [formula(s, Scene()) for formula in plan.formulas.values()],
                    [getattr(s.blocks[b], "home", None) for b in sorted(above)],
                )
                for s in (structure, general)
            ]
            if formulas_and_homes[0] != formulas_and_homes[1]:
                if of_links(self.mechanism):  # poses tell the assembly mode
                    return f"what varies moves {name}, whose mode the document's poses tell"
                reason = "is followed from its home" if block.own_form else "has change points"
                return f"{name} {reason}, which what varies moves"
        return ""

    @cached_property
    def places(self) -> Mapping[Parameter, tuple[Path, ...]]:
        """Where each number of the document stands in the graph as it is; nowhere: ()."""
        return places_of(self.mechanism, self.parameters)

    def design(self, values: Mapping[Parameter, Any]) -> tuple[Structure, Scene]:
        """Structure and scene with other numbers, unchecked: of any type with arithmetic."""
        return designed(
            self.mechanism, {path: x for p, x in values.items() for path in self.places[p]}
        )


def places_of(
    mechanism: Compiled, parameters: tuple[Parameter, ...]
) -> Mapping[Parameter, tuple[Path, ...]]:
    """Where each number of the document stands in the graph as it is; nowhere: ()."""
    if of_links(mechanism) or is_written_out(mechanism):
        return _passed_on(mechanism, parameters)
    return {p: (p.path,) for p in parameters}


def _passed_on(
    mechanism: Compiled, parameters: tuple[Parameter, ...]
) -> dict[Parameter, tuple[Path, ...]]:
    """Where numbers of a document go in its graph, if they go there unchanged."""
    varied = [p for p in parameters if "pose" not in p.path and not moves_drivers(p.path)]
    try:
        variation = Variation.of(mechanism, varied)
    except GraphError:
        variation = Variation(mechanism, {})
    paths, paths_of_base = (
        parameters_of(graph_sections(m)).keys() for m in (mechanism, variation.base)
    )
    if (
        paths != paths_of_base and len(parameters) > 1
    ):  # some of them split what coincides by chance
        return {
            p: targets
            for single in parameters
            for p, targets in _passed_on(mechanism, (single,)).items()
        }
    followers: dict[Parameter, tuple[Path, ...]] = dict.fromkeys(parameters, ())
    for p, seed in zip(varied, np.eye(len(varied)), strict=True):
        follow = {path: x for path, x in variation.numbers.items() if (x.d @ seed).any()}
        same = all(x == Varied(p.value, seed) for x in follow.values())
        followers[p] = tuple(follow) if same and paths == paths_of_base else ()
    return followers


def document_value(p: Parameter, x: float) -> float:
    """A value of a number as its file has it: whole numbers are whole."""
    return int(x) if isinstance(p.value, int) and float(x).is_integer() else float(x)
