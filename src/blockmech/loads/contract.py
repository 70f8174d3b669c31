"""What a load is: an element wired to markers, without links of its own.

An element declares its terminals and what it reads there; one kernel gives the
force or couple at each terminal. The force pass, the reduction pass, energies,
pictures and files all read that one declaration.

 1. A "point" terminal takes a force [N] at the wired marker, a "link" terminal a
    couple [N m] on the link of the wired marker.
 2. ``reads`` names per terminal what the kernel gets: ``p`` place [m], ``v``
    velocity [m/s], ``e`` unit x axis of the link [-], ``om`` rate [rad/s].
 3. The kernel takes those, terminal after terminal, then the parameters, and
    returns one force or couple per terminal. It obeys the rules of kernels.
 4. ``energy``, if there is one, is the stored energy [J]; it may read ``p`` and
    ``e`` only, the position quantities that the kernel reads.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from blockmech.blocks.contract import Block

POSITION_READS = ("p", "e")
VELOCITY_READS = ("v", "om")


@dataclass(frozen=True)
class Terminal:
    """Where an element takes hold: at a marker's point, or on a marker's link."""

    kind: Literal["point", "link"]

    @property
    def unit(self) -> str:
        """Unit of what the element gives there."""
        return "N" if self.kind == "point" else "N m"


class Element(Block):
    """A load between links: force, couple, spring ... ``useful`` marks a work load."""

    terminals: ClassVar[Mapping[str, Terminal]] = {}

    useful: bool = False

    def reads(self) -> Mapping[str, tuple[str, ...]]:
        """What the kernel gets at each terminal; see rule 2."""
        return dict.fromkeys(self.terminals, ())

    def kernel(self) -> Callable[..., Any]:
        """The function that gives the force or couple at each terminal; see rule 3."""
        raise TypeError(f"{type(self).__name__} declares no kernel")

    def energy(self) -> Callable[..., Any] | None:
        """The stored energy, or None; see rule 4."""
        return None
