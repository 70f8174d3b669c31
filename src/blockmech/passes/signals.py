"""The signals pass: what signal blocks say, as values of the same program as the mechanism.

States are inputs ``x_0``, ``x_1``, ... in the order of `Structure.states`. What a block
reads of the mechanism is an output of it, answered by the same rule as anywhere else; so what
a signal depends on follows from the inputs of the program.

Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
"""

from __future__ import annotations

import re

from blockmech.ground.names import split_address
from blockmech.model.structure import JointRef
from blockmech.plan.plan import Schedule
from blockmech.plan.values import NOUGHT, Value, tuple_of
from blockmech.signals.contract import HELD, arguments
from blockmech.typing import Kernel

NO_NAME = re.compile(r"\W")
UNKNOWN = "signal_"  # before the name of an input that stands for a signal that is not known
STATE = "x_"  # before the number of a state


def signal(s: Schedule, address: str) -> Value:
    """The value of an output of a signal block, or of the mechanism."""
    name, port = split_address(address, s.structure.signals)
    if name in s.structure.signals:
        return s.ask(output, name, port)
    if address in s.structure.sensors:
        value: Value = s.structure.sensors[address](s)
        return value
    return s.unknown(UNKNOWN + NO_NAME.sub("_", address))


def state(s: Schedule, name: str, which: str) -> Value:
    """A state of a signal block."""
    return s.unknown(f"{STATE}{s.structure.states[JointRef(name, which)]}")


def output(s: Schedule, name: str, port: str) -> Value:
    """An output of a signal block, or one of its states."""
    block = s.structure.signals[name]
    if port not in block.outputs:
        return s.ask(state, name, port)
    if block.discrete:
        return s.ask(state, name, HELD + port)
    return s.ask(outputs, name)[list(block.outputs).index(port)]


def outputs(s: Schedule, name: str) -> Value:
    """The call of a block's output kernel."""
    return _call(s, name, s.structure.signals[name].output(), "output")


def rates(s: Schedule) -> list[Value]:
    """dx/dt of all states; those of discrete blocks rest between instants."""
    values = list[Value]()
    for name, block in s.structure.signals.items():
        if block.discrete or not block.states:
            values += [NOUGHT] * len(block.states)
            continue
        call = _call(s, name, block.rates(), "rates")
        values += [call[i] for i in range(len(block.states))]
    return values


def updated(s: Schedule) -> dict[JointRef, Value]:
    """State of a discrete block -> what it is from an instant on."""
    values: dict[JointRef, Value] = {}
    for name, block in s.structure.signals.items():
        if not block.discrete:
            continue
        if block.block_states:
            call = _call(s, name, block.update(), "update")
            values |= {JointRef(name, x): call[i] for i, x in enumerate(block.block_states)}
        call = s.ask(outputs, name)
        values |= {JointRef(name, HELD + y): call[i] for i, y in enumerate(block.outputs)}
    return values


def kinks(s: Schedule) -> list[Value]:
    """Values whose change of sign is a kink of a block in continuous time."""
    values = list[Value]()
    for name, block in s.structure.signals.items():
        kernel, count = block.kinks()
        if count and not block.discrete:
            call = _call(s, name, kernel, "kinks")
            values += [call[i] for i in range(count)]
    return values


def _call(s: Schedule, name: str, kernel: Kernel, stage: str) -> Value:
    block = s.structure.signals[name]

    def value(argument: str) -> Value:
        if argument == "t":
            return s.time()
        if argument == "inputs":
            return tuple_of(map(fed, block.inputs))
        if argument == "states":
            return tuple_of(s.ask(state, name, x) for x in block.block_states)
        if argument in block.inputs:
            return fed(argument)
        return s.ask(state, name, argument.removeprefix(STATE))

    def fed(port: str) -> Value:
        return s.ask(signal, s.structure.signal_wires[JointRef(name, port)])

    numbers = s.parameter(
        ("signal", name), lambda structure, _: structure.signals[name].numbers(), f"P_{name}"
    )
    args = [value(argument) for argument in arguments(kernel)]
    return s.emit(kernel, *args, numbers, name=f"{name}_{stage}")
