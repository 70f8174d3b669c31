"""The numbered rules of loads, couplings and signal blocks, each tested on a rig.

Loads act between links that move in any way, couplings between two drivers, and signal blocks read
the motion of a wheel. The rules stand at the heads of `blockmech.loads.contract`,
`blockmech.couplings.contract` and `blockmech.signals.contract`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from blockmech.blocks.crank import Crank
from blockmech.blocks.frame import Frame
from blockmech.blocks.slide_drive import SlideDrive
from blockmech.couplings.contract import Coupling
from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.friction.laws import Coulomb
from blockmech.ground.values import Link, Marker, Place, Vector
from blockmech.loads.contract import POSITION_READS, Element, Following
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.model.laws_of_motion import Harmonic
from blockmech.model.meshing import coupling_numbers, sides
from blockmech.model.structure import Structure
from blockmech.passes import signals
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.signals.contract import Signal, arguments
from blockmech.testing.rig import add_turntable
from blockmech.testing.rules import DERIVATIVE, TIMES, Checks, derivative
from blockmech.typing import Array, Kernel


class ElementRules(Checks):
    """Rules 1 to 5 of a load."""

    def __init__(self, element: Element) -> None:
        super().__init__()
        self.element = element
        self.mechanism = _turntables(element)
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


def _turntables(element: Element) -> Mechanism:
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


COORDINATE = ("second.q", "second.rate", "second.acceleration")


class CouplingRules(Checks):
    """Rules 1 to 5 of a coupling, for the kinds of pairs that it takes."""

    def __init__(self, coupling: Coupling) -> None:
        super().__init__()
        self.rigs = [_two_drivers(coupling, *pair) for pair in coupling.pairs]

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


def _two_drivers(coupling: Coupling, lead: str, follow: str) -> Mechanism:
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
        mech = _wheel(self.block)
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
        alone = NumpyEngine(program).run({name: x[4:5] for name, x in inputs.items()}, 1)
        for label, b, c, a in zip(values, batch, scalar, alone, strict=True):
            wide = np.broadcast_to(np.asarray(b, dtype=float), SAMPLES)
            yield from self.alike(label, c, wide, a)

    rules = (names, values)


def _wheel(block: Signal) -> Mechanism:
    """A wheel in the frame whose coordinate and rate the inputs read in turn."""
    graph = Graph("rig")
    graph.add("frame", Frame(markers={"A": Marker(at=Place(0j))}))
    graph.add("wheel", Crank(links={"crank": Link(inertia=1.0)}))
    graph.connect("frame.A", "wheel.A")
    graph.add("block", block)
    for k, port in enumerate(block.inputs):
        graph.connect(SENSORS[k % 2], f"block.{port}")
    return Mechanism._from_graph(graph)
