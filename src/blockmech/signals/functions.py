"""A signal block that is a function of Python: whatever the others cannot say."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar

from pydantic import WithJsonSchema, field_validator, model_validator

from blockmech.functions.pieces import numbers_of, parameters_of
from blockmech.ground.plane import each
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Finite, Maybe, Positive, default, in_unit
from blockmech.signals.contract import Signal, State
from blockmech.typing import Kernel, Parameters, Real, Reals

TIME = "t"


class Python(Signal):
    """A function of Python, whose parameters are named after its input ports.

    call : the function; a parameter ``t`` is the time [s]
    memory : state -> initial value. Parameters of these names receive the states, and the function
        returns the output, then the rates of the states; a discrete block returns their next
        values
    sample : [s] of a discrete block

    The function is evaluated state by state, and it is not written to files. It must not store
    data of its own, because an integrator evaluates it forwards and backwards in time, and in
    several runs. Such data belong in ``memory``.

    >>> Python(call=lambda error: 2.0 * error).inputs
    ('error',)
    """

    type_name: ClassVar[str] = "signal.python"

    call: Annotated[Callable[..., Any], WithJsonSchema({"type": "object"})]
    memory: Mapping[str, Finite] = default({})
    sample: Maybe[Annotated[Positive, in_unit("s")]] = default(None)

    @field_validator("call")
    @classmethod
    def _names_its_inputs(cls, call: Callable[..., Any]) -> Callable[..., Any]:
        parameters = parameters_of(call)
        if parameters is None or any(
            p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD) for p in parameters
        ):
            found = "its parameters have no names"
            raise mistake("wrong-function", found, "parameters are named after input ports")
        return call

    @model_validator(mode="after")
    def _reads_its_memory(self) -> Python:
        unread = [name for name in self.memory if name not in self.names]
        if unread:
            found = f"no parameter is named after the state {unread[0]}"
            raise mistake("wrong-function", found, f"parameters: {', '.join(self.names)}")
        return self

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(p.name for p in parameters_of(self.call) or ())

    @property
    def inputs(self) -> tuple[str, ...]:
        """Parameters that are neither the time nor a state."""
        return tuple(n for n in self.names if n != TIME and n not in self.memory)

    @property
    def block_states(self) -> Mapping[str, State]:
        """The states in ``memory``."""
        return {name: State(float(x)) for name, x in self.memory.items()}

    def numbers(self) -> tuple[()]:
        """None: the function holds its numbers."""
        return ()

    def output(self) -> Kernel:
        """The first number that the function returns."""
        return self._kernel(slice(0, 1))

    def rates(self) -> Kernel:
        """The numbers that the function returns after the first."""
        return self._kernel(slice(1, None))

    def update(self) -> Kernel:
        """The numbers that the function returns after the first."""
        return self._kernel(slice(1, None))

    def _kernel(self, part: slice) -> Kernel:
        """Some of the numbers that the function returns, asked sample by sample."""
        places = range(1 + len(self.memory))[part]
        functions = [functools.partial(self._value, k) for k in places]

        def ordered(*readings: Real) -> list[Real]:
            names = (*self.inputs, *self.memory, TIME)
            values = dict(zip(names, readings, strict=False))  # time comes last, if at all
            return [values[name] for name in self.names]

        # Both ask by `each` themselves: engines put their own in what a program names.
        def timed(inputs: Reals, states: Reals, t: Real, p: Parameters) -> tuple[Real, ...]:
            x = ordered(*inputs, *states, t)
            return tuple([each(function, *x) for function in functions])

        def untimed(inputs: Reals, states: Reals, p: Parameters) -> tuple[Real, ...]:
            x = ordered(*inputs, *states)
            return tuple([each(function, *x) for function in functions])

        return timed if TIME in self.names else untimed

    def _value(self, place: int, *given: float) -> float:
        remedy = "return the output, and behind it one number for each state"
        return numbers_of(self.call, self.names, given, 1 + len(self.memory), remedy)[place]
