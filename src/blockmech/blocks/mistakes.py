"""What a block refuses: names that it does not have, or that could not stand, and friction.

Each mistake has its own place in the model, so that all of them are told at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import LiteralString, TypeAlias

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from blockmech.errors import close_match, listed
from blockmech.values import NAME_RULE, Link, is_name, mistake

Mistake: TypeAlias = tuple[tuple[str, ...], PydanticCustomError]
"""Where in a model, and what is wrong there."""


def refuse(title: str, mistakes: Iterable[Mistake]) -> None:
    """Refuse a model with all its mistakes, each at its own place."""
    lines = [InitErrorDetails(type=error, loc=where, input=None) for where, error in mistakes]
    if lines:
        raise ValidationError.from_exception_data(title, lines)


def wrong_links(
    links: Mapping[str, Link], known: Iterable[str], built_in: Iterable[str]
) -> Iterator[Mistake]:
    """Links that the block does not have, and markers whose names cannot stand or are taken."""
    names = tuple(known)
    taken = {*built_in, *names}
    for link, properties in links.items():
        if link not in names:
            yield (link,), unknown_name("unknown-link", "link", link, names)
        for marker in properties.markers:
            where = (link, "markers", marker)
            if not is_name(marker):
                yield where, bad_name("marker", marker)
            elif marker in taken:
                found = f'the marker name "{marker}" is taken in this block'
                yield where, mistake("taken-name", found, f"taken: {listed(sorted(taken))}")
            taken.add(marker)


def unknown_name(
    code: LiteralString, what: str, name: str, valid: tuple[str, ...]
) -> PydanticCustomError:
    """A name that the block does not declare, with the declared ones and the nearest of them."""
    known = f"{what}s there: {listed(valid)}"
    return mistake(code, f'no {what} "{name}"', known, close_match(name, valid))


def bad_name(what: str, name: str) -> PydanticCustomError:
    """A name that could not stand in an address."""
    return mistake("bad-name", f'"{name}" is not a {what} name', NAME_RULE, "choose another name")
