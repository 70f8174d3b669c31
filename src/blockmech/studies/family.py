"""A family of designs: one mechanism, some of whose numbers are turned.

All designs of a family run as one program wherever its plan is that of each of them: the
plan leaves out what is zero, so it is made for a design in which no varied number is. What
is found out before anything is planned cannot vary so: which way a driver counts, the mode
of a dyad, laws of motion, the path of a group without closed form and the change points of
a branch that follows. Then each design is made, checked and compiled by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from blockmech.compiled import Compiled
from blockmech.errors import BlockmechError
from blockmech.export import aligned
from blockmech.model.graph import Graph
from blockmech.model.parameters import BLOCKS, Parameter, Path, named, parameters_of, replaced
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.passes.forward import position
from blockmech.passes.homotopy import schedule
from blockmech.plan import Friction
from blockmech.series import GOLDEN

ASIDE = 1e-6  # of a number, how far aside the design is planned that stands for all: not zero
BATCHED = ("gravity",)  # of the scene: the rest is laws of motion, starts and stops


class Parameters(Mapping[str, Parameter]):
    """Every number of a mechanism by address, with value and unit."""

    def __init__(self, found: Mapping[str, Parameter]) -> None:
        self._found = found

    def __getitem__(self, address: str) -> Parameter:
        return self._found[address]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        rows = [(p.address, f"{p.value:.9g}", p.unit or "-") for p in self.values()]
        return "\n".join(aligned(("parameter", "value", "unit"), rows))


def sections_of(mechanism: Compiled) -> dict[str, Any]:
    """The models that the user gave, of a graph or a linkage."""
    if mechanism.document is not None:
        return mechanism.document.sections()
    s = mechanism.structure
    return {BLOCKS: {s.frame: s.fixed, **s.blocks, **s.elements}, "scene": mechanism.scene}


def parameters(mechanism: Compiled) -> Parameters:
    """Every number of the mechanism's graph or linkage, as its file calls it."""
    return Parameters(parameters_of(sections_of(mechanism)))


def remade(mechanism: Compiled, values: Mapping[str, float]) -> Compiled:
    """The mechanism with other numbers, checked like a file and compiled.

    Raises `FormatError`, `GraphError` for numbers that do not fit.
    """
    assert mechanism.document is not None
    other: Any = mechanism.document.replace(values)
    if isinstance(other, Graph):
        return type(mechanism).of(other, mechanism.names)
    found: Compiled = other.compile()
    return found


class Family:
    """The designs of a mechanism in which some numbers vary.

    Attributes
    ----------
    mechanism : the design that they are made of
    parameters : what varies
    alone : why each design needs a program of its own; "" where one serves all
    general : a mechanism whose plans hold for every design, if one serves all
    """

    def __init__(self, mechanism: Compiled, addresses: Iterable[str]) -> None:
        """Raises `RequestError` for addresses of nothing."""
        self.mechanism = mechanism
        known = parameters_of(sections_of(mechanism))
        self.parameters = tuple(named(known, dict.fromkeys(addresses)))
        self.alone = ""
        self.general = mechanism
        self.alone = self._why_alone()

    def _why_alone(self) -> str:
        for p in self.parameters:
            if isinstance(p.value, int):
                return f"{p.address} chooses between structures"
            if not self._places[p]:
                return f"{p.address} goes through the geometry of the document"
            if any(path[0] == "scene" and path[1] not in BATCHED for path in self._places[p]):
                return f"{p.address} says how the drivers move"
        aside = {p: beside(p.value, k) for k, p in enumerate(self.parameters)}
        structure, scene = self.design(aside)
        m = self.mechanism
        self.general = type(m)(structure, scene, m.name, m.names, m.document)
        return self._moved(structure)

    def _moved(self, general: Structure) -> str:
        """Which path or branch that is found before planning depends on what varies."""
        own, made = self.mechanism.structure, None
        for name, block in own.blocks.items():
            if not (block.own_form or name in own.followed or self._of_links):
                continue
            made = made or schedule(general, Scene(), Friction("none"))
            made.ask(position, name)
            above = own.ancestors(name)
            kept = [
                (
                    [formula(s, Scene()) for formula in made.formulas.values()],
                    [getattr(s.blocks[b], "home", None) for b in sorted(above)],
                )
                for s in (own, general)
            ]
            if kept[0] != kept[1]:
                if self._of_links:  # poses tell the assembly mode
                    return f"what varies moves {name}, whose mode the document's poses tell"
                what = "is followed from its home" if block.own_form else "has change points"
                return f"{name} {what}, which what varies moves"
        return ""

    @cached_property
    def _places(self) -> Mapping[Parameter, tuple[Path, ...]]:
        """Where each number of the document stands in the graph as it is; nowhere: ()."""
        if self._of_links:
            return {p: self._passed_on(p) for p in self.parameters}
        return {p: (p.path,) for p in self.parameters}

    @property
    def _of_links(self) -> bool:
        """Whether the document is a linkage."""
        document = self.mechanism.document
        return document is not None and not isinstance(document, Graph)

    def _passed_on(self, p: Parameter) -> tuple[Path, ...]:
        """Where a number of a linkage goes in its graph, if it goes there unchanged."""
        value = beside(p.value, 0)
        own, other = (
            Family._numbers(mechanism)
            for mechanism in (self.mechanism, self._tried({p.address: value}))
        )
        if own.keys() != other.keys():
            return ()
        changed = [path for path, x in other.items() if own[path] != x]
        through = all(own[path] == p.value and other[path] == value for path in changed)
        return tuple(changed) if through else ()

    def _tried(self, values: Mapping[str, float]) -> Compiled | None:
        try:
            return remade(self.mechanism, values)
        except BlockmechError:  # what is wrong is said where the study asks for it
            return None

    @staticmethod
    def _numbers(mechanism: Compiled | None) -> dict[Path, float]:
        if mechanism is None:
            return {}
        s = mechanism.structure
        blocks = {s.frame: s.fixed, **s.blocks, **s.elements}
        found = parameters_of({BLOCKS: blocks, "scene": mechanism.scene})
        return {p.path: p.value for p in found.values()}

    def design(self, values: Mapping[Parameter, Any]) -> tuple[Structure, Scene]:
        """Structure and scene with other numbers, unchecked: of any type with arithmetic."""
        s, scene = self.mechanism.structure, self.mechanism.scene
        blocks = {s.frame: s.fixed, **s.blocks, **s.elements}
        numbers = {path: x for p, x in values.items() for path in self._places[p]}
        found = replaced({BLOCKS: blocks, "scene": scene}, numbers) if numbers else {}
        turned = found.get(BLOCKS, blocks)
        structure = replace(
            s,
            fixed=turned[s.frame],
            blocks={name: turned[name] for name in s.blocks},
            elements={name: turned[name] for name in s.elements},
        )
        return structure, found.get("scene", scene)


def beside(value: float, k: int) -> float:
    """A number near a value that is not zero, and other than those of other k."""
    return value + (abs(value) or 1.0) * ASIDE * (1.0 + (k * GOLDEN) % 1.0)


def as_said(p: Parameter, x: float) -> float:
    """A value of a number as its file has it: whole numbers are whole."""
    return int(x) if isinstance(p.value, int) and float(x).is_integer() else float(x)
