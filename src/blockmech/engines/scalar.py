"""The scalar engine: Python numbers, one pose at a time; fastest below some hundred poses.

A division by zero (a group exactly at dead centre, B on D) must become NaN, not
an exception. The fast program has no guards; only when it divides by zero is the
same program run again with a guard around every call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from blockmech.engines.binding import bind, bind_functions
from blockmech.plan import Program
from blockmech.plane import NAN, SCALAR_PRIMITIVES

CONSTANTS = {"ZERO": 0j, "ONE": 1 + 0j}
NAN_VECTOR = complex(NAN, NAN)


class ScalarEngine:
    """A program bound to Python numbers."""

    name = "scalar"

    def __init__(self, program: Program) -> None:
        self.program = program
        self.parameters = tuple(program.parameters.values())
        self._fast = bind(program, SCALAR_PRIMITIVES, CONSTANTS)
        self._guarded: Callable[..., tuple[Any, ...]] | None = None

    def one(self, inputs: Sequence[float]) -> tuple[Any, ...]:
        """Values of one sample: float or complex each, NaN where impossible."""
        try:
            return self._fast(*inputs, self.parameters)
        except (ZeroDivisionError, OverflowError):
            return self._with_guards()(*inputs, self.parameters)

    def run(self, inputs: Mapping[str, Any], n: int) -> tuple[Any, ...]:
        """Values of n samples: Python numbers for one, lists of them for more."""
        columns = [inputs[name] for name in self.program.inputs]
        if n == 1:
            return self.one([float(c[0]) for c in columns])
        rows = [self.one([float(c[i]) for c in columns]) for i in range(n)]
        return tuple([row[k] for row in rows] for k in range(len(self.program.outputs)))

    def _with_guards(self) -> Callable[..., tuple[Any, ...]]:
        if self._guarded is None:
            space: dict[str, Any] = dict(CONSTANTS)
            bound = bind_functions(self.program.functions, SCALAR_PRIMITIVES)
            space.update({name: _guard(f) for name, f in bound.items()})
            exec(compile(self.program.source, "<plan, guarded>", "exec"), space)
            self._guarded = space["program"]
        return self._guarded


class _Nothing:
    """NaN in every shape: a named tuple, a tuple, a vector or a number."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return NAN if name in ("real", "imag") else NOTHING

    def __getitem__(self, index: Any) -> Any:
        return NOTHING

    def _self(self, *others: Any) -> Any:
        return NOTHING

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = _self
    __truediv__ = __rtruediv__ = __neg__ = __abs__ = _self

    def __float__(self) -> float:
        return NAN

    def __complex__(self) -> complex:
        return NAN_VECTOR

    def _never(self, other: Any) -> bool:
        return False

    __lt__ = __le__ = __gt__ = __ge__ = _never


NOTHING = _Nothing()


def _guard(function: Callable[..., Any]) -> Callable[..., Any]:
    def guarded(*args: Any) -> Any:
        if any(_spoilt(a) for a in args):
            return NOTHING
        try:
            return function(*args)
        except (ZeroDivisionError, OverflowError):
            return NOTHING

    return guarded


def _spoilt(value: Any) -> bool:
    if value is NOTHING:
        return True
    return isinstance(value, tuple) and any(_spoilt(x) for x in value)
