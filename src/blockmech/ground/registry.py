"""Classes by the names that files give them: those of blockmech, and those of installed packages.

The latter are defined by modules that the entry points of the group ``blockmech.blocks`` name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any

from blockmech.ground.errors import GraphError, Problem, close_match, listed


class Registry:
    """Classes by name: built-in ones, and those of installed packages.

    what : what one is called in messages, e.g. "block type"
    code : of the problem of an unknown one
    families : first part of a name -> module that registers the built-in ones with it, imported
        when one of them is first asked for
    """

    def __init__(
        self, what: str, code: str, families: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self.what, self.code, self.families = what, code, families
        self._types: dict[str, type[Any]] = {}
        self._outside_loaded = False

    def register(self, name: str, cls: type[Any]) -> None:
        """Add a class. A notebook cell may define its class again; two modules may not."""
        registered = self._types.get(name)
        if registered is not None and registered.__module__ != cls.__module__:
            raise TypeError(
                f"{self.what} {name!r} is defined twice: in {registered.__module__} "
                f"and in {cls.__module__}"
            )
        cls.type_name = name
        self._types[name] = cls

    def __getitem__(self, name: str) -> type[Any]:
        if name not in self._types:
            self._load_family(name.partition(".")[0])
        if name not in self._types:
            self._load_outside()
        return self._types[name]

    def get(self, name: str) -> type[Any] | None:
        """The class of a type, or None."""
        try:
            return self[name]
        except KeyError:
            return None

    def __contains__(self, name: str) -> bool:
        return self.get(name) is not None

    def __iter__(self) -> Iterator[str]:
        for family in self.families:
            self._load_family(family)
        self._load_outside()
        return iter(sorted(self._types))

    def unknown(self, name: str, where: str) -> Problem:
        """The problem that names an unknown type and its nearest relatives."""
        kind = self.what.split()[-1]
        message, valid = f'no {self.what} "{name}"', f"known {kind}s: {listed(self, 30)}"
        remedy = (
            close_match(name, self) or "import the file that defines it, or install its package"
        )
        return Problem(self.code, where, message, valid, remedy)

    def _load_family(self, family: str) -> None:
        if family in self.families:
            import_module(self.families[family])

    def _load_outside(self) -> None:
        if self._outside_loaded:
            return
        self._outside_loaded = True
        from importlib.metadata import entry_points

        for point in entry_points(group="blockmech.blocks"):
            try:
                point.load()
            except Exception as error:
                message = f"the block package {point.value} failed to load: {error}"
                wrong = Problem("broken-plugin", point.name, message, "", "repair or uninstall it")
                raise GraphError(wrong) from error
