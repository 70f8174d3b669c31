"""The scene: gravity, the drivers' given motions, the start and the ends of a free motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import (
    Axis,
    Maybe,
    Number,
    StrictModel,
    Units,
    Vector,
    VectorGiven,
    default,
    in_unit,
)
from blockmech.model.laws_of_motion import AnyLaw, OverRange

PER_DRIVER = ("drive", "initial", "stops", "motion")
"""Sections of a scene with something of each driver."""


class Initial(StrictModel):
    """Start of a free motion: coordinate [rad or m] and rate [rad/s or m/s] of a driver."""

    q: Number = default(0.0)
    rate: Number = default(0.0)

    def units(self, axis: Axis) -> Units:
        """The driver's."""
        return {"q": axis.coordinate, "rate": axis.argument("rate")}


class Stops(StrictModel):
    """End stops of a driver or a pair in free motion: lowest and highest coordinate [rad or m].

    Either may be left out. A free motion ends at a stop, or bounces back where the stops have a
    ``restitution`` [-], rate after over rate before; a given motion is not bound by them.
    """

    low: Annotated[Maybe[Number], Field(alias="from")] = default(None)
    high: Annotated[Maybe[Number], Field(alias="to")] = default(None)
    restitution: Maybe[Annotated[Number, Field(ge=0.0, le=1.0)]] = default(None)

    def units(self, axis: Axis) -> Units:
        """The driver's."""
        return dict.fromkeys(("low", "high"), axis.coordinate)

    @model_validator(mode="after")
    def _in_order(self) -> Stops:
        low, high = self.bounds
        if math.isinf(low) and math.isinf(high):
            raise mistake("wrong-value", 'end stops have "from", "to" or both')
        if not low < high:
            raise mistake("wrong-value", f'"from" must be below "to", got {low:g} and {high:g}')
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest coordinate [rad or m], infinite where there is no stop."""
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high


class Locked(StrictModel):
    """A driver that stays at a coordinate [rad or m] in a free motion of the others."""

    locked: Number

    def units(self, axis: Axis) -> Units:
        """The driver's."""
        return {"locked": axis.coordinate}


Role: TypeAlias = Literal["free", "prescribed", "locked"] | Locked
"""What a driver does in a motion; ``"locked"``: it stays where it starts."""


class Scene(StrictModel):
    """What surrounds the mechanism. Gravity [m/s2] is off unless it is stated.

    ``drive`` gives the drivers' laws of motion; a free motion starts from ``initial`` and
    ends at the ``stops`` if it gets there: those of drivers, and of pairs by their coordinate,
    ``"rod.S.coordinate"``. ``motion`` says which drivers are not free in it: they follow their
    laws of motion, or are locked.
    """

    remade: ClassVar[str] = (
        "on a graph set gravity, and call drive(), start(), add_stop(), prescribe() and lock()"
    )

    gravity: Annotated[VectorGiven, in_unit("m/s2")] = default(Vector(0j))
    drive: dict[str, AnyLaw] = {}
    initial: dict[str, Initial] = {}
    stops: dict[str, Stops] = {}
    motion: dict[str, Role] = {}

    def begin(self, driver: str) -> float | None:
        """Coordinate [rad or m] where a driver's law by coordinate, or its start, begins."""
        law, initial = self.drive.get(driver), self.initial.get(driver)
        if isinstance(law, OverRange):
            return law.start
        return initial.q if initial else None

    def start_of(self, driver: str) -> tuple[float, float]:
        """Coordinate and rate of a driver where it starts, else where its law does, else zero."""
        initial, law = self.initial.get(driver), self.drive.get(driver)
        if initial is not None:
            return float(initial.q), float(initial.rate)
        q, rate = (float(getattr(law, x, 0.0) or 0.0) for x in ("start", "rate"))
        return q, rate

    def drivers(self) -> Iterator[tuple[str, str]]:
        """What is said of drivers, by pairs and all: sections, and in each the names."""
        return ((section, name) for section in PER_DRIVER for name in getattr(self, section))

    def address(self, section: str, driver: str = "") -> str:
        """Where a file says something of a driver: ``"scene.drive.crank"``."""
        return f"scene.{section}.{driver}".rstrip(".")


class SceneOfLinks(Scene):
    """The scene of a joint-based document, which says laws of motion with the drivers."""

    def address(self, section: str, driver: str = "") -> str:
        """Where the file says something of a driver: ``"drivers.motor"``."""
        return f"{'drivers' if section == 'drive' else section}.{driver}".rstrip(".")
