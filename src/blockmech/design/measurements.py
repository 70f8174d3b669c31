"""Records: what was measured on a machine, by what the mechanism calls it.

A record is a CSV file, a DataFrame or a mapping; its columns are called as outputs, and heads may
have a unit, ``crank.q [deg]``. Rows with gaps are left out.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from blockmech.analysis.extremes import number_of
from blockmech.compiled import Compiled
from blockmech.ground.errors import Problem, RequestError, listed, refused
from blockmech.result.samples import Samples
from blockmech.typing import Floats

HEAD = re.compile(r"(?P<name>[^\[\]]+?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*")
ANGLES = {"deg": math.pi / 180.0, "°": math.pi / 180.0, "mm": 1e-3}


class Record(NamedTuple):
    """What was measured.

    samples : coordinates, rates and accelerations of the drivers
    columns : output or part of it -> (n,) in SI units
    coordinate : (n,) of the first driver
    """

    samples: Samples
    columns: Mapping[str, Floats]
    coordinate: Floats


def read_columns(data: Any) -> dict[str, Floats]:
    """Columns by name in SI units: of a CSV file, a DataFrame or a mapping of arrays.

    Heads may have a unit, ``crank.q [deg]``. Raises `RequestError` for what is no number.
    """
    if isinstance(data, str | os.PathLike):
        raw = _of_csv(Path(data))
    else:
        names = getattr(data, "columns", None)
        raw = {str(n): data[n] for n in (data if names is None else names)}
    columns = {}
    for head, column in raw.items():
        match = HEAD.fullmatch(head)
        name, unit = (match["name"], match["unit"] or "") if match else (head, "")
        try:
            x = np.asarray(column, float)
        except (TypeError, ValueError):
            continue  # words, such as a status
        if x.ndim == 1 and len(x):
            columns[name.strip()] = x * ANGLES.get(unit, 1.0)
    if len({len(x) for x in columns.values()}) > 1 or not columns:
        raise refused(
            "data", "its columns are not equally long" if columns else "it has no columns"
        )
    return columns


def _of_csv(path: Path) -> dict[str, list[str]]:
    """Columns of a CSV file; cells apart by , ; or tabs, numbers with a point or a comma."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise refused(str(path), (error.strerror or "cannot be read").lower()) from None
    sign = max(",;\t", key=text.partition("\n")[0].count)
    rows = [row for row in csv.reader(text.splitlines(), delimiter=sign) if row]
    if len(rows) < 2 or len({len(row) for row in rows}) > 1:
        raise refused(str(path), "not a table with a header and rows of equal length")
    if sign != ",":
        rows[1:] = [[cell.replace(",", ".") for cell in row] for row in rows[1:]]
    return {head: list(column) for head, *column in zip(*rows, strict=True)}


def record_of(mechanism: Compiled, data: Any) -> Record:
    """What was measured, by what the mechanism calls it; rows with gaps are left out.

    Raises `RequestError` where a driver's coordinate is missing, or nothing was measured.
    """
    columns = read_columns(data)
    inputs: dict[str, dict[str, Floats]] = {"q": {}, "rate": {}, "acceleration": {}}
    for what, kept in inputs.items():
        for d in mechanism.drivers:
            name = mechanism._of_driver(d, what)
            if name in columns:
                kept[d] = columns.pop(name)
    missing = [mechanism._of_driver(d, "q") for d in mechanism.drivers if d not in inputs["q"]]
    if missing or not mechanism.drivers:
        raise refused(
            "data",
            f"a column is missing for {listed(missing)}",
            "give the coordinate of each driver",
        )
    measured: dict[str, Floats] = {}
    problems: list[Problem] = []
    for name, x in columns.items():
        if name in ("t", "time"):
            continue
        try:
            number_of(mechanism, name)
        except RequestError as error:
            problems += error.problems
            continue
        measured[name] = x
    RequestError.raise_for(problems)
    if not measured:
        raise refused("data", "no measured column beside the drivers", "e.g. a column crank.drive")
    rows = np.isfinite([*measured.values(), *(x for k in inputs.values() for x in k.values())])
    good = rows.all(axis=0)
    if not good.any():
        raise refused("data", "every row has a gap")
    given = {what: {d: x[good] for d, x in kept.items()} or None for what, kept in inputs.items()}
    q: Any = given["q"]
    samples = mechanism.samples(q, None, None, given["rate"], given["acceleration"])
    return Record(samples, {n: x[good] for n, x in measured.items()}, q[mechanism.drivers[0]])
