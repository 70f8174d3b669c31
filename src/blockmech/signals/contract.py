"""What a signal block is: numbers in, numbers out, and perhaps states of its own.

Signals are real numbers. What a block computes are kernels, pure functions of primitives as
those of loads, so that they belong to the same traced program as the mechanism.

 1. A kernel's parameters are named after what it reads: an input port, ``x_integral`` for the
    state "integral", ``t`` for the time [s]; ``inputs`` and ``states`` are all of them as tuples;
    the last parameter are the block's numbers.
 2. ``output`` gives one value per output. The inputs that it reads reach the outputs at once
    (feedthrough), and that alone decides the order of evaluation; an input that only
    ``rates`` or ``update`` read closes no algebraic loop.
 3. ``rates`` gives dx/dt of each state, of a block in continuous time.
 4. A block with a ``sample`` [s] is discrete. At the instants k sample, and at none
    between, ``update`` gives the states from then on and ``output`` the outputs, which are
    held until the next instant. All blocks that are due at an instant read the values before
    it, and then switch together; those without inputs switch first.
 5. ``kinks`` gives numbers whose change of sign is a kink of what the block computes: a step of
    the integration ends there, for a kink inside a step costs the order of the method.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

from blockmech.blocks.block import Block
from blockmech.ground.plane import EPS
from blockmech.typing import Kernel, Parameters

HELD = "held_"  # before the name of an output: the state of a discrete block that holds it


def at_once(instant: float, t: float) -> bool:
    """Whether two times [s] are one but for rounding: 3 times 0.1 s is 0.3 s."""
    return abs(instant - t) <= 4 * EPS * max(abs(t), abs(instant)) < math.inf


class State(NamedTuple):
    """A state of a block: where it begins, and its unit (of signals ``""``).

    >>> bm.signals.State(initial=1.0, unit="rad")
    State(initial=1.0, unit='rad')
    """

    initial: float = 0.0
    unit: str = ""


@functools.cache
def arguments(kernel: Kernel) -> tuple[str, ...]:
    """What a kernel reads, by the names of its parameters without the numbers; see rule 1."""
    return tuple(inspect.signature(kernel).parameters)[:-1]


class Signal(Block):
    """A block of the signal path. Concrete classes register under ``signal.<kind>``.

    ``outputs`` are names of the output ports with their units.

    >>> bm.signals.Gain(k=2.0).ports
    ('y',)
    """

    _called: ClassVar[str] = "a signal block such as Gain(k=2.0)"
    outputs: ClassVar[Mapping[str, str]] = {"y": ""}

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the input ports."""
        return ("u",)

    @property
    def block_states(self) -> Mapping[str, State]:
        """The states that `rates` or `update` move, by name."""
        return {}

    @property
    def interval(self) -> float | None:
        """Time [s] from one instant to the next of a discrete block; None in continuous time."""
        return getattr(self, "sample", None)

    def output(self) -> Kernel:
        """The kernel of the outputs; see rule 2."""
        raise TypeError(f"{type(self).__name__} declares no output")

    def rates(self) -> Kernel:
        """The kernel of rule 3."""
        raise TypeError(f"{type(self).__name__} declares no rates of its states")

    def update(self) -> Kernel:
        """The kernel of rule 4."""
        raise TypeError(f"{type(self).__name__} declares no update of its states")

    def kinks(self) -> tuple[Kernel, int]:
        """The kernel of rule 5, and how many numbers it gives."""
        return self.output(), 0

    def numbers(self) -> Parameters:
        """The block's numbers, the last argument of its kernels."""
        return self.parameters()

    def instant(self, t: float, after: bool = False) -> float:
        """The first instant [s] at or after a time, or strictly after it; see rule 4."""
        if self.interval is None:
            return math.inf
        k = round(t / self.interval)
        if at_once(k * self.interval, t):
            return (k + after) * self.interval
        return math.ceil(t / self.interval) * self.interval

    def initial_output(self) -> float:
        """What a discrete block holds until its first instant."""
        return 0.0

    def next_kink(self, t: float) -> float:
        """The first time [s] after t at which a signal of the time has a kink."""
        return math.inf

    # -- what follows ----------------------------------------------------------

    @property
    def discrete(self) -> bool:
        """Whether its outputs are held between instants."""
        return self.interval is not None

    @property
    def states(self) -> Mapping[str, State]:
        """All states in order: its own, and of a discrete block the outputs that it holds."""
        first = self.initial_output() if self.discrete else 0.0
        held = {HELD + y: State(first, unit) for y, unit in self.outputs.items()}
        return {**self.block_states, **(held if self.discrete else {})}

    @property
    def feedthrough(self) -> tuple[str, ...]:
        """The inputs that reach an output at once."""
        return () if self.discrete else self.read_by(self.output())

    def read_by(self, kernel: Kernel) -> tuple[str, ...]:
        """The input ports that a kernel reads."""
        names = arguments(kernel)
        if "inputs" in names:
            return self.inputs
        return tuple(name for name in self.inputs if name in names)

    def port_unit(self, name: str) -> str:
        """Unit of an output or state."""
        return self.outputs[name] if name in self.outputs else self.block_states[name].unit

    @property
    def ports(self) -> tuple[str, ...]:
        """Everything of it that can be read: outputs, then states."""
        return tuple(dict.fromkeys((*self.outputs, *self.block_states)))
