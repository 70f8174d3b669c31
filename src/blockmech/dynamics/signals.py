"""Signal blocks in motion: where states begin, when they switch, what programs get of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from blockmech.dynamics.source import FRICTIONLESS, Source
from blockmech.engines.llvm import SingleEvaluator
from blockmech.passes import friction, signals
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.signals.contract import Signal


class SignalProgram(NamedTuple):
    """What signal blocks, and friction laws with a state, add to the programs of a system.

    The rates of all states stand in the program of the equation of motion, then the values of
    which a change of sign is a kink.

    Attributes
    ----------
    blocks : the signal blocks
    initial : states where a motion starts
    sizes : of states: 1, of friction laws the deflection in steady slip
    names : inputs of the states
    kinks : number of those values
    update : states that discrete blocks switch to at an instant; None without any
    updated : block and place of the state of each of its values
    """

    blocks: Mapping[str, Signal] = {}
    initial: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    names: tuple[str, ...] = ()
    kinks: int = 0
    update: SingleEvaluator | None = None
    updated: tuple[tuple[str, int], ...] = ()

    @property
    def values(self) -> int:
        """How many values they add."""
        return len(self.initial) + self.kinks

    def next_time(self, t: float) -> float:
        """The first instant of a discrete block, or kink in time, after a time [s]."""
        times = [x for b in self.blocks.values() for x in (b.next_kink(t), b.instant(t, True))]
        return min(times, default=math.inf)


NO_SIGNALS = SignalProgram()


def felt(compiled: Source) -> tuple[str, ...]:
    """Addresses of sensors that follow the friction of joints at once, as reactions do."""
    addresses, structure = [], compiled.structure
    for address, rule in structure.sensors.items():
        s = schedule(structure, compiled.scene, Friction(friction.GIVEN))
        inputs = s.program([rule(s)]).inputs
        if any(name.startswith("friction_") for name in inputs):
            addresses.append(address)
    return tuple(addresses)


def program_with_deflections(compiled: Source) -> SignalProgram:
    """The same, and the states of friction laws."""
    program = compiled._once(signal_program)
    structure, initial = compiled.structure, compiled.structure.initial_states
    laws = [structure.friction_law(ref) for ref in structure.remembering]
    bent = (abs(float(law.steady_kernel()(1.0, law.parameters()))) for law in laws)
    changes = {"initial": initial, "names": names_of(initial), "sizes": (*program.sizes, *bent)}
    return SignalProgram(**{**program._asdict(), **changes})


def names_of(initial: Sequence[float]) -> tuple[str, ...]:
    """Inputs of some states."""
    return tuple(f"{signals.STATE}{i}" for i in range(len(initial)))


def signal_program(compiled: Source) -> SignalProgram:
    """What the signal blocks of a mechanism add."""
    structure, s = compiled.structure, schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    updated = s.ask(signals.updated)
    initial = structure.initial_states
    initial = initial[: len(initial) - len(structure.remembering)]
    return SignalProgram(
        structure.signals,
        initial,
        (1.0,) * len(initial),
        names_of(initial),
        len(signals.kinks(schedule(structure, compiled.scene, FRICTIONLESS))),
        SingleEvaluator(s.program(updated.values())) if updated else None,
        tuple((ref.block, structure.states[ref]) for ref in updated),
    )
