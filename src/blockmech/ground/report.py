"""Answers of analyses: facts as `Facts`, for JSON, and lines for people as a `Report`.

What an answer holds is declared once, on its class; text, notebook and JSON follow from it.
"""

from __future__ import annotations

import html
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from numbers import Complex, Integral, Real
from typing import Any, ClassVar, Self

from blockmech.ground.errors import Guided, refused
from blockmech.ground.units import NoQuantity, quantity, shown_in
from blockmech.typing import Data

WIDTH = 100  # characters of a line
LINES = 12  # of a list, the first ones, where it is longer
REMARKS = LINES // 3  # of each of several lists beside the answer itself


def with_unit(x: float, unit: str, display: Iterable[str] = ()) -> str:
    """A number to nine digits in the first of the units of its kind that are displayed."""
    factor, unit = shown_in(unit, display)
    return f"{factor * x:.9g} {unit}".rstrip()


def places(at: Mapping[str, float], units: Mapping[str, str], display: Iterable[str] = ()) -> str:
    """Coordinates by name as words, e.g. ``crank.q = 30 deg, slide.q = 0.1 m``."""
    coordinates = {name: with_unit(q, units[name], display) for name, q in at.items()}
    return ", ".join(f"{name} = {text}" for name, text in coordinates.items())


def sections(parts: Iterable[Iterable[str]]) -> Iterator[str]:
    """Parts of a text with an empty line between them; those without lines are left out."""
    yield "\n\n".join(filter(None, map("\n".join, parts)))


def as_json(x: Any) -> Any:
    """Anything that an answer holds as JSON data; null stands for what is not finite.

    Arrays are lists, complex numbers ``[re, im]``, records and tuples with names objects, where
    pydantic's ``to_jsonable_python`` writes texts and lists, without calling its ``fallback``.
    """
    if isinstance(x, str | int | None):
        return x
    if isinstance(x, Integral):
        return int(x)
    if isinstance(x, Real):  # also NumPy's long ones, which have no like in Python
        return float(x) if math.isfinite(x) else None
    if isinstance(x, Complex):
        return [as_json(x.real), as_json(x.imag)]
    if isinstance(x, Facts):
        return x.to_dict()
    if hasattr(x, "tolist"):  # of NumPy
        return as_json(x.tolist())
    if hasattr(x, "to_data"):  # a document
        return x.to_data()
    if hasattr(x, "_asdict"):
        return as_json(x._asdict())
    if is_dataclass(x):
        return {f.name: as_json(getattr(x, f.name)) for f in fields(x)}
    if isinstance(x, Mapping):
        return {key: as_json(value) for key, value in x.items()}
    return [as_json(part) for part in x]


class Facts:
    """Facts with names.

    ``FACTS`` are the attributes and properties that are written as JSON; for a dataclass by
    default all its fields.
    """

    FACTS: ClassVar[tuple[str, ...]] = ()

    def to_dict(self) -> Data:
        """The facts as a JSON object, in SI units; null stands for what is not finite."""
        names = self.FACTS or tuple(f.name for f in fields(self))  # type: ignore[arg-type]
        return {name: as_json(getattr(self, name)) for name in names}


class Displayed(Guided):
    """What is shown in units of the user's choice: its numbers stay in SI."""

    _display: ClassVar[tuple[str, ...]] = ()

    def to(self, *units: str) -> Self:
        """The same answer, displayed in other units: deg, rpm, mm, kN.

        Texts, tables, CSV, pictures, data frames of pandas and xarray follow; numbers by name, JSON
        and npz stay in SI. ``result.to("deg", "mm").to_csv("turn.csv")``. Raises `RequestError` for
        what is no unit.

        >>> print(result.to("deg", "kN").to_csv()[:40])
        crank.q [deg],time [s],crank.rate [rad/s
        >>> print(mech.extremes("crank.q").to("deg"))
        crank.q  minimum 0 deg at crank.q = 0 deg
        crank.q  maximum 360 deg at crank.q = 360 deg
        """
        for unit in units:
            try:
                quantity(f"1 {unit}")
            except NoQuantity as error:
                raise refused("to", error.found, 'e.g. to("deg", "rpm", "mm")') from None
        copy = object.__new__(type(self))  # a copy would be made as one is pickled: without plan
        vars(copy).update(vars(self), _display=units)
        return copy


class Report(Displayed, ABC):
    """Base class of printed results: ``print`` shows all lines, `repr` one, a notebook HTML."""

    @abstractmethod
    def lines(self) -> Iterable[str]:
        """The printed lines."""

    def text(self) -> str:
        """The lines as one text."""
        return "\n".join(self.lines())

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        first, *rest = self.text().split("\n")
        return f"<{type(self).__name__}: {first}{' ...' if rest else ''}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text())}</pre>"
