"""A result as columns of real numbers with a name and a unit: one per component."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from blockmech.ground.files import AnyPath
from blockmech.ground.report import Displayed
from blockmech.ground.tolerances import ROUNDING
from blockmech.ground.units import shown_in
from blockmech.plan.plan import Output
from blockmech.result.motion import Motion
from blockmech.result.quality import Accuracy, Quality
from blockmech.typing import Arguments, Array, Floats, Named, Real

__all__ = ["AnyPath", "Column", "Labelled", "columns", "driver_columns", "output_columns"]


class Labelled(Displayed, Mapping[str, Floats]):
    """Base class of results for exports: outputs by name, with their declarations.

    ``motion`` is that of a simulation, ``accuracy`` the settings chosen for a requested accuracy;
    both are None in other results. Their classes belong to higher packages, so only type checkers
    import them.
    """

    mechanism: Named
    settings: Arguments
    motion: Motion | None
    accuracy: Accuracy | None

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of samples."""

    @property
    @abstractmethod
    def time(self) -> Floats | None:
        """Times (n,) [s] of the samples, if the request defines them."""

    @property
    @abstractmethod
    def drivers(self) -> dict[str, Floats]:
        """Driver coordinates by name of the output."""

    @property
    @abstractmethod
    def quality(self) -> Quality:
        """Status of each sample, margins, friction reports and flags."""

    @property
    @abstractmethod
    def _judged(self) -> Quality:
        """The same with the flags that take a second computation, those of digits lost."""

    @abstractmethod
    def _output(self, name: str) -> Output:
        """Declaration of an output: unit, kind, and who acts on whom."""

    @abstractmethod
    def notes(self) -> list[str]:
        """Remarks on the model that are needed to interpret the numbers."""

    @property
    def friction_error(self) -> Floats | None:
        """Bound (n,) [-] on the error of a friction iteration that is cut short."""
        return None

    @abstractmethod
    def _unit_of_driver(self, name: str) -> str:
        """Unit of a driver coordinate."""

    def _known_time(self) -> Floats | None:
        """Times (n,) [s], or None where the request does not say them."""
        time = self.time
        return time if time is not None and np.isfinite(time).any() else None


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
    values: Floats
    output: str

    @property
    def head(self) -> str:
        """Name and unit as a heading, e.g. ``crank.drive [N m]``."""
        return f"{self.name} [{self.unit or '-'}]"

    def to(self, units: Iterable[str]) -> Column:
        """The same in the first of some units that is of its kind."""
        factor, unit = shown_in(self.unit, units)
        scaled = self.values if unit == self.unit else _scaled(self.values, factor)
        return replace(self, unit=unit, values=scaled)


def columns(result: Labelled) -> list[Column]:
    """All columns: driver coordinates, time if it is known, then the wanted outputs.

    A number of the whole run, e.g. an efficiency, is repeated at every sample. What is rounding
    beside the largest value of its unit is zero.
    """
    table = driver_columns(result)
    first = {column.output for column in table}
    for name in result:
        if name not in first:
            table += output_columns(result, name)
    return quiet_columns(table)


def quiet_columns(table: Sequence[Column]) -> list[Column]:
    """Columns in which what is rounding beside the largest value of their unit is zero."""
    largest: dict[str, float] = {}
    for c in table:
        finite = np.abs(c.values[np.isfinite(c.values)])
        largest[c.unit] = max(largest.get(c.unit, 0.0), float(finite.max(initial=0.0)))
    return [replace(c, values=without_noise(c.values, largest[c.unit])) for c in table]


def without_noise(values: Real, largest: float) -> Floats:
    """Values in which what is rounding beside the largest term is zero."""
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) < ROUNDING * largest, 0.0, values) + 0.0  # no -0


def unwrapped(angle: Floats) -> Floats:
    """An angle (n,) [rad] without jumps of 2 pi between consecutive samples; NaN stays NaN."""
    smooth, finite = np.array(angle, dtype=np.float64), np.isfinite(angle)
    smooth[finite] = np.unwrap(smooth[finite])
    return smooth


def driver_columns(result: Labelled) -> list[Column]:
    """Driver coordinates, and the time if the request says it."""
    table = [
        _column(result, name, result._unit_of_driver(name), q, name)
        for name, q in result.drivers.items()
    ]
    time = result._known_time()
    return table if time is None else [*table, _column(result, "time", "s", time, "time")]


def output_columns(result: Labelled, name: str) -> list[Column]:
    """The columns of one output: one, two of a vector, or all entries of a matrix."""
    unit = result._output(name).unit
    return [_column(result, part, unit, values, name) for part, values in _components(result, name)]


def components(name: str, values: Array) -> dict[str, Array]:
    """A column as columns of real numbers: those of a vector are two."""
    vector = np.iscomplexobj(values)
    return {f"{name}.x": values.real, f"{name}.y": values.imag} if vector else {name: values}


def _components(result: Labelled, name: str) -> Iterator[tuple[str, Array]]:
    values, kind = result[name], result._output(name).kind
    if kind == "matrix":
        drivers = result.mechanism.drivers
        for index in np.ndindex(values.shape[1:]):
            entry = ".".join(drivers[i] for i in index)
            yield f"{name}.{entry}", values[:, *index]
    else:
        column = np.full(result.n, float(values)) if kind == "number" else values
        yield from components(name, column).items()


def _column(result: Labelled, name: str, unit: str, values: Real, output: str) -> Column:
    return Column(name, unit, np.asarray(values, dtype=np.float64), output).to(result._display)


def _scaled(values: Floats, factor: float) -> Floats:
    """Values in another unit, to the 15 digits that the product keeps: 30 and not 29.999... deg."""
    with np.errstate(all="ignore"):
        digits = 10.0 ** (14 - np.floor(np.log10(np.abs(factor * values))))
        rounded = np.round(factor * values * digits) / digits
    return np.where(np.isfinite(rounded), rounded, factor * values)
