"""Binding: the same kernel text on another number type.

A kernel is a function whose global names are the primitives of
`blockmech.plane`. Binding copies the kernel's module namespace, puts an engine's
primitives in their place and re-makes the module's functions over the copy. The
text stays one; only the meaning of ``sqrt`` or ``mul`` changes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any, NamedTuple

from blockmech.plan import Program

OWN = f"{__name__.partition('.')[0]}."  # the package's own modules do not change while it runs

Space = dict[str, Any]


class Spaces(NamedTuple):
    """Namespaces over one set of primitives: of the package's own modules, and of others."""

    own: dict[str, Space]
    others: dict[str, Space]

    def of(self, module: str) -> dict[str, Space]:
        """Where a module's namespace belongs."""
        return self.own if module.startswith(OWN) else self.others


_KEPT: dict[int, tuple[Mapping[str, Any], dict[str, Space]]] = {}
"""id of an engine's primitives -> these, and the package's own namespaces over them."""


def bind_functions(
    functions: Mapping[str, Callable[..., Any]], primitives: Mapping[str, Any]
) -> dict[str, Callable[..., Any]]:
    """Functions re-made so that they and what they call use these primitives."""
    return _bound(functions, primitives, Spaces({}, {}))


def _bound(
    functions: Mapping[str, Callable[..., Any]], primitives: Mapping[str, Any], spaces: Spaces
) -> dict[str, Callable[..., Any]]:
    return {name: _rebound(f, primitives, spaces) for name, f in functions.items()}


def _rebound(function: Any, primitives: Mapping[str, Any], spaces: Spaces) -> Any:
    if function.__name__ in primitives:
        return primitives[function.__name__]
    if not isinstance(function, FunctionType):
        return function  # a builtin such as abs
    space = _namespace(function.__module__, primitives, spaces)
    local: Any = space.get(function.__name__)
    if isinstance(local, FunctionType) and local.__code__ is function.__code__:
        return local
    return _copy(function, space)  # a closure or a nested function


def _namespace(module: str, primitives: Mapping[str, Any], spaces: Spaces) -> Space:
    rooms = spaces.of(module)
    if module in rooms:
        return rooms[module]
    space = rooms[module] = dict(vars(sys.modules[module]))
    for name, value in list(space.items()):
        if isinstance(value, FunctionType) and value.__module__ == module:
            space[name] = _copy(value, space)
    # A kernel may use kernels of another module; those are bound as well.
    for name, value in list(space.items()):
        foreign = isinstance(value, FunctionType) and value.__module__ != module
        if foreign and _is_kernel_module(value.__module__):
            space[name] = _namespace(value.__module__, primitives, spaces)[value.__name__]
    space.update({n: p for n, p in primitives.items() if n in space})
    return space


def _is_kernel_module(name: str) -> bool:
    return "cross" in vars(sys.modules[name]) or "mul" in vars(sys.modules[name])


def _copy(function: FunctionType, space: dict[str, Any]) -> FunctionType:
    copy = FunctionType(
        function.__code__, space, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__module__ = function.__module__
    return copy


def bind(
    program: Program, primitives: Mapping[str, Any], constants: Mapping[str, Any]
) -> Callable[..., tuple[Any, ...]]:
    """The program as a function of its inputs and parameters, on one number type.

    The package's own kernels are bound once for each set of primitives.
    """
    _, own = _KEPT.setdefault(id(primitives), (primitives, {}))
    space: Space = {**primitives, **constants}
    space.update(_bound(program.functions, primitives, Spaces(own, {})))
    exec(program.code, space)
    run: Callable[..., tuple[Any, ...]] = space["program"]
    return run
