"""States of a unit beside those of the drivers: of signal blocks and of friction laws.

Those of blocks in continuous time, and deflections of friction laws, are states of the unit; what
discrete blocks hold changes at events in time; what ``signal.input`` holds is an input.

Source: Functional Mock-up Interface 2.0, Modelica Association, 2014, section 3.2.2 (events).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from blockmech.compiled import Compiled
from blockmech.model.structure import JointRef
from blockmech.passes import friction, signals
from blockmech.plan.plan import Output, Schedule
from blockmech.plan.values import Value
from blockmech.signals.sources import Input


class Discrete(NamedTuple):
    """When a discrete block switches, and whether it reads others.

    Each ``period`` [s] or, where that is 0, once at a ``time`` [s].
    """

    period: float
    time: float
    reads: bool


class States:
    """The states of a mechanism's signal blocks and friction laws.

    Attributes
    ----------
    initial : where all begin, in the order of `Structure.states`
    continuous : name of a state that the unit integrates -> its place among all
    inputs : name of a block that is fed from outside -> the place of what it holds
    discrete : when the blocks that hold their outputs switch
    switched : (output that a state becomes, its place, number of its block)
    rates : those outputs, and the rates ``der(state)``
    outputs : names of all outputs of signal blocks
    """

    def __init__(self, mechanism: Compiled, method: str | None) -> None:
        structure, names = mechanism.structure, mechanism.names
        labels = {} if names is None else {block: name for name, block in names.signals.items()}
        self.initial = structure.initial_states
        self.continuous: dict[str, int] = {}
        self.inputs: dict[str, int] = {}
        self.discrete: list[Discrete] = []
        self.switched: list[tuple[str, int, int]] = []
        self.rates: dict[str, Output] = {}
        self.outputs: list[str] = []
        for block, signal in structure.signals.items():
            name = labels.get(block, block)
            self.outputs += [f"{name}.{port}" for port in signal.ports]
            indices = {x: structure.states[JointRef(block, x)] for x in signal.states}
            if isinstance(signal, Input):
                (self.inputs[name],) = indices.values()
                continue
            for x, i in indices.items():
                if signal.discrete:
                    self.switched.append((f"next({name}.{x})", i, len(self.discrete)))
                    self._add(f"next({name}.{x})", partial(_next, JointRef(block, x)))
                else:
                    self.continuous[f"{name}.{x}"] = i
                    self._add(f"der({name}.{x})", partial(_rate, i))
            if signal.discrete:
                time = 0.0 if signal.interval else signal.instant(0.0)
                self.discrete.append(Discrete(signal.interval or 0.0, time, bool(signal.inputs)))
        for ref in structure.remembering if method != "none" else ():
            name = f"{mechanism._joint_names.get(str(ref), str(ref))}.deflection"
            self.continuous[name] = structure.states[ref]
            self._add(f"der({name})", partial(friction.deflection_rate, ref=ref))

    def _add(self, name: str, rule: Callable[[Schedule], Value]) -> None:
        self.rates[name] = Output(name, "", "real", lambda s: (rule(s),), lambda x: x)


def _rate(i: int, s: Schedule) -> Value:
    return s.ask(signals.rates)[i]


def _next(ref: JointRef, s: Schedule) -> Value:
    return s.ask(signals.updated)[ref]
