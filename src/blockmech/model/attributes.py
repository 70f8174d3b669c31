"""Attributes that are set from outside: a misspelt one is refused, not lost.

Python takes any attribute on an ordinary object. ``graph.gravty = ...`` would be kept there
and change nothing, and the numbers would be those of a mechanism without weight.
"""

from __future__ import annotations

import inspect
from typing import Any

from blockmech.errors import GraphError, Problem, close_match, listed


class KnownAttributes:
    """An object whose settable attributes are declared in its class body, or are properties."""

    def __setattr__(self, name: str, value: Any) -> None:
        cls = type(self)
        declared = [n for c in cls.__mro__ for n in vars(c).get("__annotations__", ())]
        known = [n for n in declared if not n.startswith("_")]
        known += [n for n, p in inspect.getmembers(cls) if isinstance(p, property) and p.fset]
        if name not in known:
            raise GraphError(_unknown(cls, name, known))
        super().__setattr__(name, value)


def _unknown(cls: type, name: str, known: list[str]) -> Problem:
    """The problem of an attribute that cannot be set."""
    methods = [n for n, m in inspect.getmembers(cls, callable) if not n.startswith("_")]
    found = f'there is no attribute "{name}" to set'
    if name in methods:
        found = f"{name}() is called, not set"
    elif hasattr(cls, name):
        found = f"{name} follows from the rest, and is not set"
    remedy = "" if hasattr(cls, name) else close_match(name, [*known, *methods])
    valid = f"attributes: {listed(sorted(known))}"
    return Problem("unknown-attribute", f"{cls.__name__}.{name}", found, valid, remedy)
