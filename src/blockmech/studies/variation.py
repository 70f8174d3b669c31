"""Designs near a mechanism: how the numbers of its graph follow those that a user varies.

Numbers of a graph are its own. Those of a document of links and joints go through its
decomposition, which carries their derivatives (`blockmech.model.joints.varied`): the graph is
the one that holds near by, where what coincides by chance in the document does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from blockmech.compiled import Compiled
from blockmech.engines.derivatives import Dual
from blockmech.functions.series import GOLDEN
from blockmech.ground.tolerances import BLUR
from blockmech.model.graph import Graph
from blockmech.model.joints.varied import Varied, settled
from blockmech.model.parameters import (
    BLOCKS,
    Parameter,
    Path,
    number_at,
    parameters_of,
    replaced,
    value_at,
)
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.outputs.by_block import Catalogue
from blockmech.passes.homotopy import path_of
from blockmech.typing import Array, Data

T = TypeVar("T")
GIVEN = "driver"  # first key of the path of a driver's coordinate, rate or acceleration
PER_DRIVER = ("drivers", "initial", "stops", "motion")  # sections of a document
CONTACTS = (BLOCKS, "couplings")  # sections of couplings in a graph and in a document
STOPS = ("scene", "stops")  # of pairs, they are the document's
BATCHED = ("gravity",)  # of the scene: the rest is laws of motion, starts and stops


def graph_sections(mechanism: Compiled) -> Data:
    """The models of a mechanism's graph, as its file has them."""
    s = mechanism.structure
    blocks = {s.frame: s.fixed, **s.blocks, **s.elements, **s.couplings, **s.signals}
    return {BLOCKS: blocks, "scene": mechanism.scene}


def of_links(mechanism: Compiled) -> bool:
    """Whether a mechanism was made of a document of links and joints."""
    return mechanism.document is not None and not isinstance(mechanism.document, Graph)


def is_written_out(mechanism: Compiled) -> bool:
    """Whether a mechanism was made of a graph with others inside."""
    document = mechanism.document
    return isinstance(document, Graph) and document.flat() is not document


def moves_drivers(path: Path) -> bool:
    """Whether a number says how the drivers move, or where they start and stop."""
    head, *rest = path
    return head in PER_DRIVER or (head == "scene" and rest[0] not in BATCHED)


def is_sided(mechanism: Compiled, path: Path) -> bool | None:
    """Whether a contact is sided where this number of it is above zero; None of other numbers.

    The plan of a sided contact serves one that is not, and not the other way round.
    """
    coupling = mechanism.structure.couplings.get(str(path[1])) if path[0] in CONTACTS else None
    if coupling is None or path[2] not in coupling.sides:
        return None
    return coupling.model_copy(update={path[2]: 1.0}).sided


def designed(mechanism: Compiled, numbers: Mapping[Path, Any]) -> tuple[Structure, Scene]:
    """Structure and scene with other numbers, unchecked: of any type with arithmetic."""
    s = mechanism.structure
    sections = replaced(graph_sections(mechanism), numbers)
    blocks = sections[BLOCKS]
    structure = replace(
        s,
        fixed=blocks[s.frame],
        blocks={name: blocks[name] for name in s.blocks},
        elements={name: blocks[name] for name in s.elements},
        couplings={name: blocks[name] for name in s.couplings},
        signals={name: blocks[name] for name in s.signals},
    )
    return structure, sections["scene"]


def planned_aside(mechanism: Compiled, numbers: Mapping[Path, float]) -> Compiled:
    """A mechanism beside this one: its plans hold for any values of these numbers."""
    aside = {  # not zero, and no two alike
        path: x + (abs(x) or 1.0) * BLUR * (1.0 + (k * GOLDEN) % 1.0)
        for k, (path, x) in enumerate(numbers.items())
    }
    m = mechanism
    return type(m)(*designed(m, aside), m.name, m.names, m.document)


def planned_near(mechanism: Compiled, numbers: Mapping[Path, float]) -> Compiled:
    """A mechanism whose plans hold for all designs near by, on the same paths from home."""
    if not numbers:
        return mechanism
    general = planned_aside(mechanism, numbers)
    for block in (b for b, x in general.structure.blocks.items() if x.own_form):
        general.structure.paths[block] = path_of(mechanism.structure, block)
    return general


@dataclass(frozen=True)
class Variation:
    """A mechanism as it is when some numbers vary.

    Attributes
    ----------
    base : the mechanism, of the structure that holds near by
    numbers : those of its graph that follow, with their derivatives
    """

    base: Compiled
    numbers: Mapping[Path, Varied]

    @classmethod
    def of(
        cls,
        mechanism: Compiled,
        parameters: Iterable[Parameter],
        number: Callable[[float, Array], Varied] = Varied,
    ) -> Variation:
        """Of m numbers, those of drivers among them, which move nothing of the mechanism.

        ``number`` makes one of a value and its derivatives.

        Raises `GraphError` where no graph holds near by.
        """
        varied = list(parameters)
        seeds = zip(varied, np.eye(len(varied)), strict=True)
        numbers = {p.path: number(p.value, seed) for p, seed in seeds if p.path[0] != GIVEN}
        if not numbers or not (of_links(mechanism) or is_written_out(mechanism)):
            return cls(mechanism, numbers)
        base, numbers_of_graph = followers(mechanism, numbers)
        return cls(base, {path: x for path, x in numbers_of_graph.items() if x.d.any()})

    @cached_property
    def general(self) -> Compiled:
        """A mechanism whose plans hold for all designs near by, on the same paths from home."""
        return planned_near(self.base, {path: complex(x).real for path, x in self.numbers.items()})

    def design(self, seeds: Array) -> tuple[Structure, Scene]:
        """The design with tangents in k directions (k, m) of the numbers that vary."""
        return designed(self.base, _duals(self.numbers, seeds))

    def outputs(self, seeds: Array) -> Catalogue:
        """The outputs, which read the angles of a document's links with their tangents."""
        names = self.base.names
        if names is None:
            return self.base.outputs
        turns = _duals({name: at.turn for name, at in names.links.items()}, seeds)
        shifts = _duals({name: at.shift for name, at in names.joints.items()}, seeds)
        links = {name: replace(at, turn=turns[name]) for name, at in names.links.items()}
        joints = {name: replace(at, shift=shifts[name]) for name, at in names.joints.items()}
        return Catalogue(self.base.structure, replace(names, links=links, joints=joints))


def followers(
    mechanism: Compiled, numbers: Mapping[Path, Varied]
) -> tuple[Compiled, dict[Path, Varied]]:
    """The mechanism near a document of links, or of graphs inside, whose numbers vary.

    And those numbers of its graph that they go into.
    """
    document: Any = mechanism.document
    document = document.with_numbers(numbers)
    if is_written_out(mechanism):
        sections, graph = document.flat().sections(), graph_sections(mechanism)
        values = {path: value_at(sections, path) for _, _, _, path in parameters_of(graph).values()}
    else:
        blocks = document._as_blocks()
        plain = Graph.from_data(settled(blocks.data))
        mechanism = type(mechanism)._from_graph(plain, blocks.names, mechanism.document)
        paths = (p.path for p in parameters_of(plain.sections()).values())
        values = {path: number_at(blocks.data, path) for path in paths if path[:2] != STOPS}
    return mechanism, {path: x for path, x in values.items() if isinstance(x, Varied)}


def _duals(numbers: Mapping[T, Any], seeds: Array) -> dict[T, Any]:
    """Numbers with tangents in k directions (k, m) of those that vary; others as they are."""
    varied = {key: x for key, x in numbers.items() if isinstance(x, Varied)}
    rates = np.reshape([x.d.real for x in varied.values()], (len(varied), seeds.shape[-1]))
    tangents = zip(varied.items(), rates @ seeds.T, strict=True)
    return {
        **numbers,
        **{k: Dual(np.float64(complex(x).real), d[:, None]) for (k, x), d in tangents},
    }
