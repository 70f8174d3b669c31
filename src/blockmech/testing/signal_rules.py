"""The numbered rules of a signal block, tested on a wheel whose motion it reads.

The rules stand at the head of `blockmech.signals.contract`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from blockmech.blocks.crank import Crank
from blockmech.blocks.frame import Frame
from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.ground.values import Link, Marker, Place
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.passes import signals
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.signals.contract import Signal, arguments
from blockmech.testing.rules import TIMES, Checks

SENSORS = ("wheel.q", "wheel.rate")
SAMPLES = len(TIMES)


class SignalRules(Checks):
    """Rules 1 to 5 of a signal block, each kernel as it is asked."""

    def __init__(self, block: Signal) -> None:
        super().__init__()
        self.block = block

    def names(self) -> Iterator[str]:
        """Kernels read inputs, states and the time."""
        block = self.block
        valid = {*block.inputs, *(f"x_{x}" for x in block.block_states), "t", "inputs", "states"}
        kink, count = block.kinks()
        kernels = [block.output(), *([kink] if count else [])]
        if block.block_states:
            kernels.append(block.update() if block.discrete else block.rates())
        for kernel in kernels:
            for name in arguments(kernel):
                if name not in valid:
                    yield f"{kernel.__name__} reads {name!r}, which is none of {sorted(valid)}"

    def values(self) -> Iterator[str]:
        """There is a number for each output, state and kink, alike in all engines."""
        mech = _rig(self.block)
        s = schedule(mech.structure, mech.scene, Friction("none"))
        values = {f"output {y}": s.ask(signals.output, "block", y) for y in self.block.ports}
        values |= {f"rate of {k}": value for k, value in enumerate(signals.rates(s))}
        values |= {f"next {ref.name}": value for ref, value in signals.updated(s).items()}
        values |= {f"kink {k}": value for k, value in enumerate(signals.kinks(s))}
        program = s.program(values.values())
        yield from self.arithmetic(program)
        chance = np.random.default_rng(1)
        inputs = {name: chance.uniform(0.1, 0.9, SAMPLES) for name in program.inputs}
        batch, scalar = (e(program).run(inputs, SAMPLES) for e in (NumpyEngine, ScalarEngine))
        single = {name: x[4:5] for name, x in inputs.items()}
        alone = NumpyEngine(program).run(single, 1)
        for label, b, c, a in zip(values, batch, scalar, alone, strict=True):
            wide = np.broadcast_to(np.asarray(b, dtype=float), SAMPLES)
            yield from self.alike(label, c, wide, a)

    rules = (names, values)


def _rig(block: Signal) -> Mechanism:
    """A wheel in the frame whose coordinate and rate the inputs read in turn."""
    graph = Graph("rig")
    graph.add("frame", Frame(markers={"A": Marker(at=Place(0j))}))
    graph.add("wheel", Crank(links={"crank": Link(inertia=1.0)}))
    graph.connect("frame.A", "wheel.A")
    graph.add("block", block)
    for k, port in enumerate(block.inputs):
        graph.connect(SENSORS[k % 2], f"block.{port}")
    return Mechanism._from_graph(graph)
