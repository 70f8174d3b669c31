"""The numbered rules of a coupling, tested between two drivers of a rig.

The rules stand at the head of `blockmech.couplings.contract`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from blockmech.blocks.crank import Crank
from blockmech.blocks.frame import Frame
from blockmech.blocks.slide_drive import SlideDrive
from blockmech.couplings.contract import Coupling
from blockmech.friction.laws import Coulomb
from blockmech.ground.values import Link, Marker, Place, Vector
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.model.laws_of_motion import Harmonic
from blockmech.model.meshing import coupling_numbers, sides
from blockmech.model.structure import Structure
from blockmech.testing.rules import DERIVATIVE, TIMES, Checks, derivative
from blockmech.typing import Array, Kernel

COORDINATE = ("second.q", "second.rate", "second.acceleration")


class CouplingRules(Checks):
    """Rules 1 to 5 of a coupling, for the kinds of pairs that it takes."""

    def __init__(self, coupling: Coupling) -> None:
        super().__init__()
        self.rigs = [_rig(coupling, *pair) for pair in coupling.pairs]

    def transmission(self) -> Iterator[str]:
        """Slope and curve are the derivatives of the coordinate."""
        for rig in self.rigs:

            def run(t: float, rig: Mechanism = rig) -> dict[str, Array]:
                result = rig.run(times=TIMES + t, want=COORDINATE)
                return {name: result[name] for name in COORDINATE}

            values, slopes = run(0.0), derivative(run)
            for value, rate in pairwise(COORDINATE):
                scale = float(np.max(abs(values[rate]))) or 1.0
                yield from self.same(rate, slopes[value], values[rate], scale, DERIVATIVE)

    def contact(self) -> Iterator[str]:
        """Links balance, and what is taken from one link is given to the other."""
        for rig in self.rigs:
            for friction in ("none", "newton"):
                condition = f" with friction {friction!r}"
                yield from self.verified(rig.verify(times=TIMES, friction=friction), condition)

    def touch(self) -> Iterator[str]:
        """The speed at a contact that rubs is differentiated."""
        for rig in self.rigs:
            structure = rig.structure
            kernel = structure.couplings["coupling"].touch(structure.coupled_pair("coupling"))
            if kernel is None:
                continue
            touches = _touching(kernel, structure)  # times do for arguments
            slopes = touches(0.0)["slope"]
            rise, scale = derivative(touches)["slip"], float(np.max(abs(slopes))) or 1.0
            yield from self.same("slope of the slip", rise, slopes, scale, DERIVATIVE)

    def kernels(self) -> Iterator[str]:
        """Engines agree, and a sample does not depend on its neighbours."""
        for rig in self.rigs:
            yield from self.engines(rig.run, ("first.drive", *COORDINATE))

    rules = (transmission, contact, touch, kernels)


def _touching(kernel: Kernel, structure: Structure) -> Callable[[float], dict[str, Array]]:
    sides_at, p = sides(structure, "coupling"), coupling_numbers(structure, "coupling")

    def at(step: float) -> dict[str, Array]:
        rows = [kernel(sides_at(x + step), p) for x in TIMES]
        return {name: np.array([getattr(row, name) for row in rows]) for name in ("slip", "slope")}

    return at


def _rig(coupling: Coupling, lead: str, follow: str) -> Mechanism:
    """Two heavy drivers on the frame, with friction, the first one swinging."""
    graph = Graph("rig", gravity=Vector(-9.81j).z)
    markers = {"a": Marker(at=Place(0j), angle=0.3), "b": Marker(at=Place(1.3 + 0.4j), angle=1.1)}
    graph.add("frame", Frame(markers=markers))
    for name, kind, at in (("first", lead, "a"), ("second", follow, "b")):
        cls, joint = (Crank, "A") if kind == "R" else (SlideDrive, "S")
        (link,) = cls.link_names
        heavy = Link(mass=1.2, inertia=0.3, cm=Place(0.2 + 0.1j))
        rub = Coulomb(coefficient=0.05, radius=0.02 if kind == "R" else None)
        graph.add(name, cls(links={link: heavy}, friction={joint: rub}))
        graph.connect(f"frame.{at}", f"{name}.{joint}")
    size = 0.5 if lead == "R" else 0.05
    graph.drive("first", Harmonic(mean=size, amplitude=size, frequency=0.3, phase=0.4))
    graph.add("coupling", coupling.model_copy(update={"driver": "first", "driven": "second"}))
    return Mechanism._from_graph(graph)
