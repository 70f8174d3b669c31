"""Binding: the same kernel text on another number type.

A kernel is a function whose global names are the primitives of
`blockmech.ground.plane`. Binding copies the kernel's module namespace, puts an engine's
primitives in their place and re-makes the module's functions over the copy. The
text stays one; only the meaning of ``sqrt`` or ``mul`` changes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any, ClassVar

from blockmech.typing import Data, Kernel, Record, Values

OWN = f"{__name__.partition('.')[0]}."  # the package's own modules do not change while it runs

Space = Data


class Binder:
    """Re-makes functions so that they and what they call use an engine's primitives.

    The package's own modules are bound once for each set of primitives.
    """

    _modules: ClassVar[dict[int, tuple[Record, dict[str, Space]]]] = {}

    def __init__(self, primitives: Record) -> None:
        self.primitives = primitives
        _, self._own = self._modules.setdefault(id(primitives), (primitives, {}))
        self._others: dict[str, Space] = {}

    def __call__(self, function: Kernel) -> Any:
        if function.__name__ in self.primitives:
            return self.primitives[function.__name__]
        if not isinstance(function, FunctionType):
            return function  # a record, or a builtin such as abs
        space = self._namespace(function.__module__)
        local: Any = space.get(function.__name__)
        if isinstance(local, FunctionType) and local.__code__ is function.__code__:
            return local
        return _copy(function, space)  # a closure or a nested function

    def _namespace(self, module: str) -> Space:
        spaces = self._own if module.startswith(OWN) else self._others
        if module in spaces:
            return spaces[module]
        space = spaces[module] = dict(vars(sys.modules[module]))
        functions = {n: f for n, f in space.items() if isinstance(f, FunctionType)}
        for name, f in functions.items():
            if f.__module__ == module:
                space[name] = _copy(f, space)
            elif not {"cross", "exp", "mul"}.isdisjoint(vars(sys.modules[f.__module__])):
                # A kernel may use kernels of another module; those are bound as well.
                space[name] = self._namespace(f.__module__)[f.__name__]
        space.update({n: p for n, p in self.primitives.items() if n in space})
        return space


def bind_functions(functions: Mapping[str, Kernel], primitives: Record) -> dict[str, Kernel]:
    """Functions re-made so that they and what they call use these primitives."""
    binder = Binder(primitives)
    return {name: binder(f) for name, f in functions.items()}


def _copy(function: FunctionType, space: Space) -> FunctionType:
    copy = FunctionType(
        function.__code__, space, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__module__ = function.__module__
    return copy


def bind(
    program: Any,
    primitives: Record,
    constants: Record,
    foreign: Callable[[Any], Any] = lambda function: function,
) -> Callable[..., Values]:
    """A `plan.plan.Program` as a function of its inputs and parameters, on one number type.

    ``foreign`` says what stands for a function that is no kernel.
    """
    bound = bind_functions(program.functions, primitives)
    for name, f in program.functions.items():
        if bound[name] is f and not isinstance(f, FunctionType | type):
            bound[name] = foreign(f)
    space: Space = {**primitives, **constants, **bound}
    exec(program.code, space)
    run: Callable[..., Values] = space["program"]
    return run
