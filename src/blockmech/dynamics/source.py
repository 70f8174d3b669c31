"""What dynamics takes of a mechanism: its structure in its scene, and how good its poses are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol, TypeVar

from blockmech.model.naming import Names
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.passes import forward
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Friction, Output, Schedule
from blockmech.plan.values import Value
from blockmech.typing import Real, Reals

T = TypeVar("T")
FRICTIONLESS = Friction("none")


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


def margins(s: Schedule) -> list[Value]:
    """Margins of the groups whose poses the schedule needs."""
    blocks = [e.block for e in s.entries if e.stage == "position"]
    return [s.ask(forward.margin, b) for b in blocks if s.structure.blocks[b].closes]


def by_name(
    q: Reals = (), qd: Reals = (), qdd: Reals = (), x: Iterable[Real] = ()
) -> dict[str, Real]:
    """Inputs of a program: coordinates, rates and accelerations of drivers, states of signals."""
    columns = ("q_", q), ("qd_", qd), ("qdd_", qdd), (STATE, x)
    return {f"{name}{i}": value for name, values in columns for i, value in enumerate(values)}
