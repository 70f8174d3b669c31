"""Numbers of a model that are written as text with a unit: "50mm", "300rpm", ["2kN", 0].

A model reads them when it is made. Units that hang on where it stands, as a rate on its driver,
are checked when the whole is compiled.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from types import UnionType
from typing import Any, TypeAlias

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from blockmech.ground.units import NoQuantity, in_si, quantity, unit_behind
from blockmech.typing import Record

Place: TypeAlias = tuple[str | int, ...]
"""Keys from a model to one of its numbers."""


def read_texts(
    model: type[BaseModel], raw: Record, dependent: bool
) -> tuple[Record, dict[Place, str]]:
    """What a model is made of, with numbers in place of texts, and the texts that were read.

    ``dependent`` says that units may be others than the fields declare, so any is read.
    """
    fields, texts = _numeric(model), dict[Place, str]()
    numbers = {
        key: _read(raw[key], *fields[key], dependent, texts)
        for key in fields.keys() & raw.keys()
        if type(raw[key]) in (str, list, tuple, dict)
    }
    return {**raw, **numbers}, texts


def _read(x: Any, path: Place, unit: str, dependent: bool, texts: dict[Place, str]) -> Any:
    if isinstance(x, str) and unit_behind(x):
        for units in ((unit,), ())[: 1 + dependent]:
            with suppress(NoQuantity):
                number, texts[path] = quantity(x, *units), x
                return number
    if type(x) in (list, tuple):
        items = enumerate(x)
        return type(x)(_read(item, (*path, k), unit, dependent, texts) for k, item in items)
    if isinstance(x, dict):
        return {k: _read(item, (*path, k), unit, dependent, texts) for k, item in x.items()}
    return x


@cache
def _numeric(model: type[BaseModel]) -> Mapping[str, tuple[Place, str]]:
    """Fields that hold numbers and never text, by name and alias: key in a file and unit."""
    fields = {n: f for n, f in model.model_fields.items() if _holds_numbers(f.annotation)}
    return {
        key: ((field.alias or name,), unit_of(field))
        for name, field in fields.items()
        for key in (name, field.alias)
        if key
    }


def _holds_numbers(kind: object) -> bool:
    origin, inside = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        return _holds_numbers(inside[0])
    if origin in (typing.Union, UnionType):
        return all(_holds_numbers(k) for k in inside if k is not type(None))
    if origin in (list, tuple, dict):
        return _holds_numbers(inside[-1])
    return kind is float or getattr(kind, "polar", None) is False  # a place reads its own


def in_metres(raw: Any) -> Any:
    """A place as it is written, with numbers for texts."""
    if isinstance(raw, dict) and isinstance(raw.get("polar"), list | tuple):
        r, *angle = raw["polar"] or [0.0]
        return {**raw, "polar": [in_si(r, "m"), *in_si(angle, "rad")]}
    return in_si(raw, "m")


def unit_of(declared: Any) -> str:
    """The unit that a field declares, or what it is made of."""
    if isinstance(declared, FieldInfo):
        extra = declared.json_schema_extra
        if isinstance(extra, dict) and "unit" in extra:
            return str(extra["unit"])
        return unit_of(declared.annotation)
    parts = (*getattr(declared, "__metadata__", ()), *typing.get_args(declared))
    return next((unit for part in parts if (unit := unit_of(part))), "")
