"""Names of blocks and markers, and the addresses in which they stand."""

from __future__ import annotations

from collections.abc import Container
from itertools import chain, count

NAME_RULE = 'a name is not empty and has no "." or "/"'
"""The rule for names of blocks and markers, which stand in addresses."""

MECHANISM = "mechanism"
"""What names of outputs of the whole begin with, which therefore is no block's name."""


def is_name(name: str) -> bool:
    """Whether a name can stand in an address."""
    return bool(name) and "." not in name and "/" not in name


def free_name(name: str, used: Container[str]) -> str:
    """The name, with underscores behind it until it is free."""
    while name in used:
        name += "_"
    return name


def numbered_name(name: str, used: Container[str]) -> str:
    """The first of name, name_2, name_3, ... that is free."""
    return next(x for x in chain([name], (f"{name}_{i}" for i in count(2))) if x not in used)


def split_address(address: str, blocks: Container[str]) -> tuple[str, str]:
    """Block and port of an address: blocks inside of others have names with dots.

    Without such a block the name before the first dot, whatever that is.

    >>> split_address("leg.dyad.C", {"leg.dyad"})
    ('leg.dyad', 'C')
    """
    name, _, port = first = address.partition(".")
    while name not in blocks:
        if "." not in port:
            return first[0], first[2]
        inner, _, port = port.partition(".")
        name = f"{name}.{inner}"
    return name, port
