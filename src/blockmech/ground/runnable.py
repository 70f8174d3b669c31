"""What can be run: a graph, a linkage or a compiled mechanism, with one declaration of a run."""

from __future__ import annotations

from abc import ABC, ABCMeta, abstractmethod
from itertools import takewhile
from pkgutil import resolve_name
from types import MethodType
from typing import Any, Generic

from blockmech.ground.errors import Guided
from blockmech.typing import M

EVERYTHING = ("*",)


class LazyMethod:
    """A method that is defined as a function in a lower module, imported at its first use.

    The function is declared once, for `help`, type checkers and calls alike. For type checkers its
    path begins with ``blockmech``, as ``blockmech.draw.draw``.
    """

    def __init__(self, path: str) -> None:
        self._path = path

    def __getattr__(self, name: str) -> LazyMethod:
        if name.startswith("__"):
            raise AttributeError(name)  # Python asks whether it is abstract, wrapped ...
        return LazyMethod(f"{self._path}.{name}")

    def __set_name__(self, owner: type, name: str) -> None:
        self._owner, self._name = owner, name

    def __get__(self, instance: object, owner: type) -> Any:
        if isinstance(self._owner, ABCMeta) and "__abstractmethods__" not in vars(self._owner):
            return self  # the class is being made, and asks each name whether it is abstract
        *names, _ = self._path.split(".")
        module = ".".join(takewhile(str.islower, names))  # behind it a class may stand
        method = resolve_name(f"{module}:{self._path.removeprefix(module + '.')}")
        setattr(self._owner, self._name, method)
        return method if instance is None else MethodType(method, instance)


class Runnable(Guided, ABC, Generic[M]):
    """An object that compiles to a mechanism: graph, linkage or mechanism."""

    _called = "a graph, a linkage or a mechanism"
    _instead = "run it first: its run() gives a result"

    @abstractmethod
    def compile(self) -> M:
        """The mechanism that computes."""
