"""What a coupling is: one driver's coordinate as a function of another's.

A driver that is coupled is no freedom any more: where a motor would turn it, the coupling
does. The driven link stays what it is, so its motion, its share of what is reduced and its
force pass are those of any driver; only where its coordinate comes from is new, and where
its effort goes to.

 1. ``transmission(x, p)`` gives the coordinate of the driven pair with its first two
    derivatives by x. Of a coupling with teeth, a belt or a profile x is the angle by which
    the driver's link has turned against the link that carries the driven one, and both count
    counter-clockwise, whatever way the drivers count: so a wheel on a moving carrier needs
    nothing of its own. Else x is the driver's coordinate.
 2. ``contact(a, b, motion, effort, sense, p)`` gives what the driver's link does to the driven
    one, force and moment about the driven pair's marker: a and b are the guides of the two
    pairs' markers, ``effort`` is what must act along the driven coordinate, and ``sense`` its
    sign. It is linear in the effort. What acts on the driven link acts back on the driver's.
    A coupling without it is a black box between the drivers, whose housing stands on their
    supports.
 3. Both are kernels: pure, batch-transparent, of primitives alone.

Power balances by rule 1: the effort that the driver feels is the slope times the driven one's.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, ClassVar, Literal, NamedTuple

from blockmech.blocks.block import Block
from blockmech.typing import Real

ROUND = 72  # straight pieces of a drawn circle


class Transmission(NamedTuple):
    """Coordinate of a driven pair with its derivatives by the argument."""

    q: Real  # [rad or m]
    slope: Real
    curve: Real


class Curve(NamedTuple):
    """A line that turns with a link, about the centre of its pair.

    link : "driver", "driven", or "carrier" for what stays between them
    points : places [m] from the centre, along the link's axes
    chain : whether it is no edge of a body, but a pitch line
    """

    link: Literal["driver", "driven", "carrier"]
    points: Sequence[complex]
    chain: bool = False


def circle(radius: float) -> list[complex]:
    """A circle, and a mark on it from which its turning is seen."""
    round_ = [cmath.rect(radius, math.tau * k / ROUND) for k in range(ROUND + 1)]
    return [complex(0.85 * radius), *round_]


class Coupling(Block):
    """A relation that lets one driver follow another.

    driver : name of the driver that leads; of a wheel or cam that is fixed to some other link,
        the address ``"block.marker"`` of its centre
    driven : name of the driver that follows
    """

    called: ClassVar[str] = 'a coupling such as Gear(driver="a", driven="b", teeth=(20, 40))'
    leads: ClassVar[tuple[str, ...]] = ("R", "P")  # kinds of the driver's pair
    follows: ClassVar[tuple[str, ...]] = ("R", "P")  # and of the driven one
    meshes: ClassVar[bool] = True  # x is an angle between links, not the driver's coordinate
    contact: ClassVar[Callable[..., Any] | None] = None

    driver: str
    driven: str

    def transmission(self) -> Callable[..., Any]:
        """The kernel of rule 1."""
        raise TypeError(f"{type(self).__name__} declares no transmission")

    @property
    def sided(self) -> bool:
        """Whether `contact` asks for the sense of the effort."""
        return False

    def curves(self, ends: tuple[complex, complex], guide: complex) -> Iterator[Curve]:
        """What is drawn of it; ``ends`` [m] are the two centres in one pose, on the ground.

        ``guide`` is the unit direction of the driven pair's marker there.
        """
        yield from ()

    def advance(self, turns: Fraction) -> Fraction | None:
        """Turns of the driven link while x grows by so many; 0 where it comes back.

        None where no number of turns brings it back, or that is not known.
        """
        return None
