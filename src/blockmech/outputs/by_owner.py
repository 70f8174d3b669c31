"""A mapping whose names say whom they belong to, made owner by owner when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from blockmech.ground.errors import Problem, close_match, listed


class Named(Protocol):
    """An item that has a name."""

    @property
    def name(self) -> str:
        """Its name."""


N = TypeVar("N", bound=Named)
Part: TypeAlias = tuple[str, Callable[..., Iterable[N]], tuple[Any, ...]]
"""An owner, and what makes items whose names begin with it, with its arguments."""


class ByOwner(Mapping[str, N], Generic[N]):
    """Items by name, those of an owner made when one of them is first asked for.

    >>> from blockmech.ground.values import Axis
    >>> from typing import NamedTuple
    >>> class Item(NamedTuple):
    ...     name: str
    >>> items = ByOwner([("crank", lambda: [Item("crank.q"), Item("crank.rate")], ())])
    >>> list(items)
    ['crank.q', 'crank.rate']
    """

    def __init__(self, parts: Iterable[Part[N]], narrow: bool = False) -> None:
        """An owner may have several parts, in any order; the order of all is that of items.

        With ``narrow`` what makes items takes a last word of names as well: it makes those alone.
        """
        self._parts = list(parts)
        self._narrow = narrow
        self._made: dict[tuple[int, str], dict[str, N]] = {}  # by part and last word, "" for all
        self._of: dict[str, list[int]] = {}
        for i, (owner, _, _) in enumerate(self._parts):
            self._of.setdefault(owner, []).append(i)

    def _part(self, i: int, last: str = "") -> dict[str, N]:
        key = i, last if self._narrow else ""
        items_by_name = self._made.get(key)
        if items_by_name is None:
            _, make, arguments = self._parts[i]
            items = make(*arguments, last) if self._narrow else make(*arguments)
            items_by_name = self._made[key] = {item.name: item for item in items}
        return items_by_name

    def of(self, owner: str) -> Iterator[str]:
        """Names of the items of an owner."""
        return chain.from_iterable(self._part(i) for i in self._of.get(owner, ()))

    def beginning(self, start: str, last: str = "") -> Iterator[str]:
        """Names, among them all that begin so and, if one is given, have this last word."""
        parts = (
            self._part(i, last)
            for i, (owner, _, _) in enumerate(self._parts)
            if owner.startswith(start) or start.startswith(owner)
        )
        return chain.from_iterable(parts)

    def _found(self, name: object) -> N | None:
        name = str(name)
        owner, _, last = name.rpartition(".")
        while owner and owner not in self._of:
            owner = owner.rpartition(".")[0]
        parts = (self._part(i, last) for i in self._of.get(owner, ()))
        return next((part[name] for part in parts if name in part), None)

    def __getitem__(self, name: str) -> N:
        """An item by its name."""
        if (item := self._found(name)) is None:
            raise KeyError(name)
        return item

    def __contains__(self, name: object) -> bool:
        """Whether there is an item of that name."""
        return self._found(name) is not None

    def __iter__(self) -> Iterator[str]:
        return self.beginning("")

    def __len__(self) -> int:
        return sum(len(self._part(i)) for i in range(len(self._parts)))


def unknown_output(pattern: str, names: Iterable[str], candidates: Iterable[str] = ()) -> Problem:
    """No output has that name; there are those of the same block, link or joint, or all."""
    head, every = pattern.split(".")[0] + ".", list(names)
    siblings = [n for n in every if n.startswith(head)] or every
    valid = f"outputs there: {listed(siblings, 16)}"
    remedy = close_match(pattern.removesuffix(".x").removesuffix(".y"), candidates or siblings)
    return Problem("unknown-output", pattern, "no output has that name", valid, remedy)


def vector_sensor(name: str) -> Problem:
    """A signal would read a vector."""
    valid, remedy = "a signal is one number", f"take {name}.x or {name}.y"
    return Problem("no-sensor", name, "a vector cannot be a signal", valid, remedy)
