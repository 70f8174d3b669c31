"""What can be run: a graph, a linkage or a compiled mechanism, with one declaration of a run."""

from __future__ import annotations

from abc import ABC, ABCMeta, abstractmethod
from importlib import import_module
from types import MethodType
from typing import Any, Generic

from blockmech.typing import M

EVERYTHING = ("*",)


class LazyMethod:
    """A method that is a function of a lower file, loaded when it is first asked for.

    So the function is declared once: `help`, type checkers and calls read the same. It has the
    method's name unless another ``function`` is named.
    """

    def __init__(self, module: str, function: str = "") -> None:
        self.module, self.function = module, function

    def __set_name__(self, owner: type, name: str) -> None:
        self.owner, self.name = owner, name

    def __get__(self, instance: Any, owner: type) -> Any:
        if isinstance(self.owner, ABCMeta) and "__abstractmethods__" not in vars(self.owner):
            return self  # the class is being made, and asks each name whether it is abstract
        function = getattr(import_module(self.module), self.function or self.name)
        setattr(self.owner, self.name, function)
        return function if instance is None else MethodType(function, instance)


class Runnable(ABC, Generic[M]):
    """What can be compiled, and so be run."""

    _called = "a graph, a linkage or a mechanism"
    _instead = "run it first: its run() gives a result"

    @abstractmethod
    def compile(self) -> M:
        """The mechanism that computes."""
