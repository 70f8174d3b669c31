"""A result as columns of real numbers with a name and a unit: one per component."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from blockmech.export.labelled import Labelled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """One real component of an output.

    Attributes
    ----------
    name : the output's name, with ``.x`` and ``.y`` for the parts of a vector
    unit : ``""`` where dimensionless
    values : (n,) in ``unit``, NaN where a sample has no answer
    output : the output that the column is a part of
    """

    name: str
    unit: str
    values: Array
    output: str

    @property
    def head(self) -> str:
        """Name and unit as a heading, e.g. ``crank.drive [N m]``."""
        return f"{self.name} [{self.unit or '-'}]"


def columns(result: Labelled, degrees: bool = False) -> list[Column]:
    """All columns: driver coordinates, time if it is known, then the wanted outputs.

    A number of the whole run, e.g. an efficiency, is repeated at every sample.
    ``degrees`` gives angles in deg in place of rad.
    """
    found = driver_columns(result, degrees)
    first = {column.output for column in found}
    for name in result:
        if name not in first:
            found += output_columns(result, name, degrees)
    return found


def driver_columns(result: Labelled, degrees: bool = False) -> list[Column]:
    """Driver coordinates [rad or m], and time [s] if the request says it."""
    found = [
        _column(name, result.unit_of_driver(name), q, name, degrees)
        for name, q in result.drivers.items()
    ]
    time = known_time(result)
    if time is not None:
        found.append(_column("time", "s", time, "time", degrees))
    return found


def output_columns(result: Labelled, name: str, degrees: bool = False) -> list[Column]:
    """The columns of one output: one, two of a vector, or all entries of a matrix."""
    unit = result.unit(name)
    return [
        _column(part, unit, values, name, degrees) for part, values in _components(result, name)
    ]


def known_time(result: Labelled) -> Array | None:
    """Times (n,) [s], or None where the request does not say them."""
    time = result.time
    return time if time is not None and np.isfinite(time).any() else None


def _components(result: Labelled, name: str) -> Iterator[tuple[str, Any]]:
    values, kind = result[name], result.output(name).kind
    if kind == "vector":
        yield f"{name}.x", values.real
        yield f"{name}.y", values.imag
    elif kind == "matrix":
        drivers = result.mechanism.drivers
        for i, row in enumerate(drivers):
            if values.ndim == 2:
                yield f"{name}.{row}", values[:, i]
                continue
            for j, column in enumerate(drivers):
                yield f"{name}.{row}.{column}", values[:, i, j]
    elif kind == "number":
        yield name, np.full(result.n, float(values))
    else:
        yield name, values


def _column(name: str, unit: str, values: Any, output: str, degrees: bool) -> Column:
    real = np.asarray(values, dtype=np.float64)
    if degrees and unit == "rad":
        return Column(name, "deg", np.degrees(real), output)
    return Column(name, unit, real, output)
