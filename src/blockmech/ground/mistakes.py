"""Mistakes in models, as pydantic reports them and a `Problem` tells them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import LiteralString

from pydantic_core import PydanticCustomError

from blockmech.ground.units import seem_degrees


def mistake(
    code: LiteralString, found: str, valid: str = "", remedy: str = ""
) -> PydanticCustomError:
    """A mistake in a model, with the parts of a `Problem`."""
    parts = {"found": found, "valid": valid, "remedy": remedy}
    message = "; ".join(filter(None, parts.values()))
    return PydanticCustomError(code, "{said}", {"said": message, **parts})


def check_table(
    what: str,
    x: Sequence[float],
    values: Sequence[float],
    period: float = 0.0,
    called: str = "values",
) -> None:
    """Refuse a table whose values are not one for each x, or whose x, called ``what``, fall.

    Of one that repeats the first value stands for the end of the period.
    """
    if len(x) != len(values):
        raise mistake("bad-table", f'"{what}" and "{called}" must have the same length')
    if any(b <= a for a, b in pairwise(x)):
        raise mistake("bad-table", f'"{what}" must increase')
    if period and x[-1] - x[0] >= period * (1 - 1e-12):
        message = f'"{what}" must cover less than one period'
        valid = "the first value is repeated by itself"
        remedy = "leave out the last row"
        if math.isclose(period, math.tau) and seem_degrees(x[0], x[-1]):
            remedy = f'these are radians; degrees are written "{x[-1]:g}deg"'
        raise mistake("bad-table", message, valid, remedy)
