"""The form of a value: what it is but for its numbers.

Of a number the form says whether it is zero, one or infinite, else only its sign: more no rule of
a plan looks at.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import fields, is_dataclass
from fractions import Fraction

from pydantic import BaseModel

from blockmech.ground.values import Pair

PACKAGE = f"{__name__.partition('.')[0]}."
SPECIAL = (0.0, 1.0, math.inf, -math.inf)


class _Unknown(Exception):
    """Something that the package does not know the inside of: a user's class or function."""


def form_of(value: object) -> Hashable | None:
    """The form of what a document was read into; None where a part of it is not the package's."""
    try:
        return _form_of(value)
    except _Unknown:
        return None


def _form_of(value: object) -> Hashable:
    if value is None or isinstance(value, str | int | Fraction):
        return value
    if isinstance(value, float):
        return (value if value in SPECIAL else math.copysign(2.0, value),)
    if isinstance(value, tuple | list):
        return tuple([_form_of(x) for x in value])
    if isinstance(value, Mapping):
        return tuple(value), tuple([_form_of(x) for x in value.values()])
    kind = type(value)
    if kind is complex:
        return _form_of(value.real), _form_of(value.imag)  # type: ignore[attr-defined]
    if isinstance(value, Pair):
        return _form_of(value.z)
    if not kind.__module__.startswith(PACKAGE):
        raise _Unknown
    if isinstance(value, BaseModel):
        names = tuple(kind.model_fields)  # type: ignore[attr-defined]
    elif is_dataclass(value):
        names = tuple(field.name for field in fields(value))
    else:
        raise _Unknown
    return kind, tuple([_form_of(getattr(value, name)) for name in names])
