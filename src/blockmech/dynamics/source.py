"""What dynamics takes of a mechanism: its structure in its scene, and what is kept of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeVar

from blockmech.model.naming import Names
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.plan.plan import Output

T = TypeVar("T")


class Source(Protocol):
    """A mechanism, e.g. a `Compiled`."""

    structure: Structure
    scene: Scene
    name: str
    names: Names | None

    @property
    def outputs(self) -> Mapping[str, Output]:
        """All that can be asked of it, by name."""

    @property
    def drivers(self) -> tuple[str, ...]:
        """Drivers in formation order."""

    @property
    def _joint_names(self) -> Mapping[str, str]:
        """Joint of the graph -> its name in a joint-based document."""

    def _once(self, make: Callable[[Any], T]) -> T:
        """What is made of it, made once and kept."""
