"""A mapping whose names say whom they belong to, made owner by owner when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from typing import Any, Generic, Protocol, TypeAlias, TypeVar


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

    >>> from blockmech.values import Axis
    >>> from typing import NamedTuple
    >>> class Item(NamedTuple):
    ...     name: str
    >>> items = ByOwner([("crank", lambda: [Item("crank.q"), Item("crank.rate")], ())])
    >>> list(items)
    ['crank.q', 'crank.rate']
    """

    def __init__(self, parts: Iterable[Part[N]]) -> None:
        """An owner may have several parts, in any order; the order of all is that of items."""
        self._parts = list(parts)
        self._made: dict[int, dict[str, N]] = {}
        self._of: dict[str, list[int]] = {}
        for i, (owner, _, _) in enumerate(self._parts):
            self._of.setdefault(owner, []).append(i)

    def _part(self, i: int) -> dict[str, N]:
        made = self._made.get(i)
        if made is None:
            _, make, arguments = self._parts[i]
            made = self._made[i] = {item.name: item for item in make(*arguments)}
        return made

    def of(self, owner: str) -> Iterator[str]:
        """Names of the items of an owner."""
        return chain.from_iterable(self._part(i) for i in self._of.get(owner, ()))

    def beginning(self, start: str) -> Iterator[str]:
        """Names, among them all that begin so."""
        parts = (
            self._part(i)
            for i, (owner, _, _) in enumerate(self._parts)
            if owner.startswith(start) or start.startswith(owner)
        )
        return chain.from_iterable(parts)

    def _found(self, name: object) -> N | None:
        owner = str(name)
        while owner:
            owner = owner.rpartition(".")[0]
            if owner in self._of:
                for i in self._of[owner]:
                    if name in (part := self._part(i)):
                        return part[name]
                return None
        return None

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
