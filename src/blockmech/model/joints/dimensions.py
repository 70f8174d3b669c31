"""Dimensions of a drawing: what lengths, angles and relations of its points are to be.

Points are joints, by name, and markers, by ``"link.marker"``. A dimension gives residuals of the
positions of its points, lengths over the size of the drawing, which are zero where it holds.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, get_args

from pydantic import Field

from blockmech.ground.plane import apply, cross, dot
from blockmech.ground.values import Angle, Place, Positive, StrictModel, in_unit
from blockmech.typing import Planars, Real


class Dimension(StrictModel):
    """What some points of the drawing are to fulfil."""

    _called: ClassVar[str] = "a dimension of a kind such as length"
    sign: ClassVar[str] = ""  # in pictures

    points: list[str]

    @abstractmethod
    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """Zero where it holds; z [m] are the positions of its points."""


class Length(Dimension):
    """The distance [m] of two points."""

    type: Literal["length"]
    points: Annotated[list[str], Field(min_length=2, max_length=2)]
    value: Annotated[Positive, in_unit("m")]

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """|AB| less the value."""
        yield (abs(z[1] - z[0]) - self.value) * (1 / size)


class AngleOfLines(Dimension):
    """An angle [rad]: of two points that of AB from the x axis, of three that from BA to BC."""

    sign = "∠"
    type: Literal["angle"]
    points: Annotated[list[str], Field(min_length=2, max_length=3)]
    value: Angle

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """What is left of the turn, between -pi and pi."""
        *first, corner, last = z if len(z) == 3 else (z[0] + 1.0, *z)
        yield apply("angle", apply("expi", self.value) * (first[0] - corner), last - corner)


class Parallel(Dimension):
    """The lines AB and CD are parallel."""

    sign = "∥"
    type: Literal["parallel"]
    points: Annotated[list[str], Field(min_length=4, max_length=4)]

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """Sine of the angle between them."""
        u, v = z[1] - z[0], z[3] - z[2]
        yield cross(u, v) / (abs(u) * abs(v))


class Perpendicular(Parallel):
    """The lines AB and CD are at right angles."""

    sign = "⊥"
    type: Literal["perpendicular"]  # type: ignore[assignment]

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """Cosine of the angle between them."""
        u, v = z[1] - z[0], z[3] - z[2]
        yield dot(u, v) / (abs(u) * abs(v))


class Equal(Parallel):
    """The distances AB and CD are equal."""

    sign = "="
    type: Literal["equal"]  # type: ignore[assignment]

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """|AB| less |CD|."""
        yield (abs(z[1] - z[0]) - abs(z[3] - z[2])) * (1 / size)


class InLine(Dimension):
    """Three points or more are in line."""

    sign = "…"
    type: Literal["in_line"]
    points: Annotated[list[str], Field(min_length=3)]

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """Distances from the line through the first and the last point."""
        line = z[-1] - z[0]
        for point in z[1:-1]:
            yield cross(line, point - z[0]) / (abs(line) * size)


class OnCircle(Dimension):
    """All points but the first are on a circle about the first."""

    sign = "○"
    type: Literal["on_circle"]
    points: Annotated[list[str], Field(min_length=3)]

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """Differences of neighbouring radii."""
        for a, b in pairwise(abs(point - z[0]) for point in z[1:]):
            yield (b - a) * (1 / size)


class Position(Dimension):
    """A point is at a place [m] of the drawing."""

    sign = "⊕"
    type: Literal["position"]
    points: Annotated[list[str], Field(min_length=1, max_length=1)]
    value: Place

    def residuals(self, z: Planars, size: float) -> Iterator[Real]:
        """How far it is off, in both directions."""
        deviation = (z[0] - self.value.z) * (1 / size)
        yield from (deviation.real, deviation.imag)


KINDS: dict[str, type[Dimension]] = {
    get_args(kind.model_fields["type"].annotation)[0]: kind
    for kind in (Length, AngleOfLines, Parallel, Perpendicular, Equal, InLine, OnCircle, Position)
}
