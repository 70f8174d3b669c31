"""The numbered rules of a load, tested between links that move in any way.

The rules stand at the head of `blockmech.loads.contract`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from blockmech.blocks.frame import Frame
from blockmech.ground.values import Link, Marker, Place
from blockmech.loads.contract import POSITION_READS, Element, Following
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.model.laws_of_motion import Harmonic
from blockmech.testing.rig import add_turntable
from blockmech.testing.rules import DERIVATIVE, TIMES, Checks, derivative
from blockmech.typing import Array


class ElementRules(Checks):
    """Rules 1 to 5 of a load."""

    def __init__(self, element: Element) -> None:
        super().__init__()
        self.element = element
        self.mechanism = _rig(element)
        self.loads = [
            f"load.{n}.{'force' if t.kind == 'point' else 'couple'}"
            for n, t in element.terminals.items()
        ]

    def _run(self, times: Array, want: Any, **settings: Any) -> Any:
        return self.mechanism.run(times=times, want=want, on_gap="mark", **settings)

    def terminals(self) -> Iterator[str]:
        """There is a finite force or couple at each terminal."""
        result = self._run(TIMES, self.loads)
        for name in self.loads:
            if not np.all(np.isfinite(result[name])):
                yield f"{name} is not finite"

    def readings(self) -> Iterator[str]:
        """What is read is declared at terminals that exist."""
        valid = {*self.element.terminals, "driver", "time"}
        for terminal, quantities in self.element.reads().items():
            if terminal not in valid:
                yield f"reads {quantities} at {terminal}, which is no terminal"

    def kernel(self) -> Iterator[str]:
        """Engines agree, a sample does not depend on its neighbours, powers balance."""
        yield from self.engines(partial(self._run, want=self.loads), self.loads)
        yield from self.verified(self.mechanism.verify(times=TIMES))

    def energy(self) -> Iterator[str]:
        """What the load gives to the links comes out of the stored energy, or is damped."""
        reads = {x for quantities in self.element.reads().values() for x in quantities}
        if self.element.energy() is None:
            return
        stored, power = "mechanism.potential_energy", self._run(TIMES, "load.power")["load.power"]
        rate = derivative(lambda t: {"V": self._run(TIMES + t, stored)[stored]})["V"]
        scale = float(np.max(abs(rate)) + np.max(abs(power))) or 1.0
        if reads <= set(POSITION_READS):
            yield from self.same("power from the stored energy", power, -rate, scale, DERIVATIVE)
        elif np.any(power + rate > DERIVATIVE * scale):
            yield "it gives more than it stores"

    rules = (terminals, readings, kernel, energy)


def _rig(element: Element) -> Mechanism:
    """Each terminal on a turntable that swings in all three ways."""
    graph = Graph("rig")
    graph.add("frame", Frame(markers={"x": Marker(at=Place(0j), angle=0.0)}))
    for k, terminal in enumerate(element.terminals):
        table = Link(mass=1.0, markers={"hand": Marker(at=Place(0.3 + 0.1j))})
        add_turntable(graph, terminal, table)
        for j, coordinate in enumerate(("x", "y", "turn")):
            law = Harmonic(
                mean=2.0 * k * (j == 0), amplitude=0.5, frequency=0.2 + 0.05 * j, phase=k + j
            )
            graph.drive(f"{coordinate}_{terminal}", law)
    if isinstance(element, Following) and element.driver is not None:
        element = element.model_copy(update={"driver": f"turn_{next(iter(element.terminals))}"})
    graph.add("load", element)
    for terminal, declared in element.terminals.items():
        source = "hand" if declared.kind == "point" else "crank"
        graph.connect(f"turn_{terminal}.{source}", f"load.{terminal}")
    return Mechanism._from_graph(graph)
