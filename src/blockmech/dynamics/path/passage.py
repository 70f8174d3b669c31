"""What the parts of a conservative motion have in common.

A *passage* is the way from one place of the driver to another in the direction of
growing x, with its time. Conservative motion is the same forward and backward, so one
passage serves both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

from blockmech.dynamics.chebyshev import Floats

Known: TypeAlias = tuple[float, float]  # a place x [rad or m] and the kinetic energy there [J]
Allowed: TypeAlias = Callable[[Any], float]  # error of a passage's time that may remain [s]


class Place(NamedTuple):
    """Where a motion along growing x is at given times; arrays (m,)."""

    x: Floats  # [rad or m]
    rate: Floats  # [rad/s or m/s] >= 0


@dataclass(frozen=True)
class End:
    """One end of a passage.

    x : [rad or m] where
    K : [J] the kinetic energy if it is known there; 0 at a standstill
    free : a standstill found by integration, which may still move
    limit : a dead centre of the driver
    """

    x: float
    K: float | None = None
    free: bool = False
    limit: bool = False

    @property
    def reflects(self) -> bool:
        """Whether the motion turns back here."""
        return self.K == 0.0


class Passage(Protocol):
    """Motion along growing x between two ends."""

    @property
    def low(self) -> End:
        """The end with the smaller x."""
        ...

    @property
    def high(self) -> End:
        """The end with the larger x."""
        ...

    @property
    def total(self) -> float:
        """Time from end to end [s]."""
        ...

    @property
    def fastest(self) -> float:
        """Largest speed [rad/s or m/s]."""
        ...

    @property
    def error(self) -> float:
        """Error of the time at any place [s]."""
        ...

    @property
    def end_error(self) -> float:
        """Error of the standstills' places [rad or m]."""
        ...

    def place(self, time: Floats) -> Place:
        """Place and speed at times (m,) [s] from the low end."""
        ...

    def when(self, x: Floats) -> Floats:
        """Time [s] from the low end at places x (m,)."""
        ...
