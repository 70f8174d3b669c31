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
 2. ``contact(pose, effort, sense, p)`` gives what the driver's link does to the driven one,
    force and moment about the driven pair's marker: ``pose`` is a `Meshing`, ``effort`` is what
    must act along the driven coordinate, and ``sense`` its sign. It is linear in either; of a
    coupling that is not ``sided`` it is the same for all. Where friction may turn the effort, what
    the sense adds is a row among those of friction: a force that is there in either sense.
    What acts on the driven link acts back on the driver's. A coupling without it is a black box
    between the drivers, whose housing stands on their supports.
 3. ``tension(pose, p)`` gives a load of the same kind that acts without any effort, and does no
    work along the coordinates: the tension of a belt.
 4. ``touch(pose, p)`` gives the one place where both links touch, a `Touch`. Then the contact is
    a push along its normal, readings are of the touch in place of ``pose`` and ``p``, and there
    may be friction, ``rubs``: Coulomb's, of the normal force that the effort needs.
 5. All are kernels: pure, batch-transparent, of primitives alone.

Power balances by rule 1: the effort that the driver feels is the slope times the driven one's.

Losses. Of a `LossyCoupling` the driver feels more while power goes to the driven link, less while
it comes back: the smaller of both powers is the ``efficiency`` times the larger one. With f1 the
effort that is felt and F' f2 what it would be without losses, that is Coulomb's law of a guide,
whose load is the larger one of two,

    f1 = F' f2 - t,    t = -sgn(x') (1 - efficiency) max(|F' f2|, |f1|)

so the sense of power decides by itself, a mesh at rest holds as teeth do, and solvers, motions and
certificates of friction know it. What is lost acts on both links, or of a black box on the
leading one alone.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias

from pydantic import Field

from blockmech.blocks.block import Block
from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import Problem
from blockmech.ground.plane import cross, dot, hyp, imul, mul, where
from blockmech.ground.values import Axis, Number, Units, default, in_unit
from blockmech.typing import Complex, Guide, Kernel, Load, Parameters, Real

ROUND = SCANNED // 10  # straight pieces of a drawn circle


class Transmission(NamedTuple):
    """Coordinate of a driven pair with its derivatives by the argument."""

    q: Real  # [rad or m]
    slope: Real
    curve: Real


class Meshing(NamedTuple):
    """Where the two sides of a coupling are."""

    a: Guide  # the marker of the pair that leads, or the centre of a wheel that is fixed to a link
    b: Guide  # the marker of the driven pair
    lead: Guide  # origin and x axis of the leading link
    link: Guide  # the same of the driven link
    x: Real  # [rad or m] argument of the transmission
    motion: Transmission


Where: TypeAlias = Callable[[float], Meshing]
"""Both sides at an argument of the transmission, in the axes of what carries both."""


class Reading(NamedTuple):
    """A number that a coupling shows as one more output, under the coupling's name.

    unit : of the number
    kernel : of (pose, p), or where it is of the forces of (pose, load, p); see rule 4
    of_load : whether it is of the forces
    flag : code of the remark where the number is below zero; "" for none
    about : what it is, in words, where its name is none of `blockmech.plan.quantities`
    """

    unit: str
    kernel: Kernel
    of_load: bool = False
    flag: str = ""
    about: str = ""


class Touch(NamedTuple):
    """How the links of a coupling touch, where they rub on each other.

    point : [m] of the contact
    n : unit normal, from the leading link to the driven one
    motion : velocity there of the driven link for a unit of its rate
    slip : velocity of the driven link there against the leading one, along i n, per unit of x'
    slope : its derivative by x
    pressure : [rad] angle from the driven link's motion to n
    radius : [m] of curvature of the leading link's profile, positive where it is convex
    """

    point: Complex
    n: Complex
    motion: Complex
    slip: Real
    slope: Real
    pressure: Real = 0.0
    radius: Real = 0.0


def pushed(touch: Touch, b: Complex, effort: Real) -> Load:
    """Load along n that does as much as an effort along the driven coordinate."""
    force = mul(touch.n, effort / dot(touch.n, touch.motion))
    return Load(force, cross(touch.point - b, force))


def pressing(touch: Touch, load: Load) -> Real:
    """Normal force [N] of the contact, positive where it presses."""
    return dot(load.F, touch.n)


def pressure(touch: Touch) -> Real:
    """Angle [rad] from the driven link's motion to the push."""
    return touch.pressure


def curvature(touch: Touch) -> Real:
    """Radius of curvature [m] of the leading link's profile."""
    return touch.radius


def relief(touch: Touch) -> Real:
    """Normal force [-] that a unit of friction along i n takes from the contact, at one effort."""
    return dot(imul(touch.n, 1.0), touch.motion) / dot(touch.n, touch.motion)


def rubbed(touch: Touch, b: Complex, t: Real) -> Load:
    """Load of friction t [N] along i n with the normal force that leaves the effort as it is."""
    force = imul(touch.n, t) - mul(touch.n, t * relief(touch))
    return Load(force, cross(touch.point - b, force))


def so_much(unit: Load, force: Real) -> Load:
    """A load of which the force is so large [N]; nothing of one without a force."""
    size = hyp(unit.F)
    share = force / where(size > 0.0, size, 1.0)
    return Load(mul(unit.F, share), share * unit.M)


class Curve(NamedTuple):
    """A line that turns with a link, about the centre of its pair.

    link : "driver", "driven", or "carrier" for what stays between them
    points : places [m] along the link's axes, from the centre of its pair; of a slider from its
        origin, of the carrier in the axes in which both sides are given, from the driven centre
    chain : whether it is no edge of a body, but a pitch line
    """

    link: Literal["driver", "driven", "carrier"]
    points: Sequence[complex]
    chain: bool = False


def circle(radius: float) -> list[complex]:
    """A circle, and a mark on it from which its turning is seen."""
    round_ = [cmath.rect(radius, math.tau * k / ROUND) for k in range(ROUND + 1)]
    return [complex(0.85 * radius), *round_]


def concentric(
    coupling: Coupling, where: str, pair: str, pose_at: Where, p: Parameters
) -> Iterator[Problem]:
    """Wheels on one centre, which touch nowhere."""
    at = pose_at(0.0)
    if abs(at.b.p - at.a.p) <= 1e-12 * max(abs(at.a.p), abs(at.b.p), 1e-300):
        yield Problem("no-room", where, "both wheels have one centre", "", "move the centres apart")


# -- what losses do to both links ------------------------------------------------------------
#
# For one unit of what the driver feels more the load on the driven link about its marker, which
# changes nothing of its effort; the opposite acts on the driver's link. It moves the line of
# action of the teeth along the line of centres, or of the rack across its guide.


def between_wheels(pose: Meshing) -> Load:
    """A force through the driven centre, across the line of centres."""
    d = pose.b.p - pose.a.p
    return Load(imul(d, 1.0 / dot(d, d)), 0.0)


def on_slide(pose: Meshing) -> Load:
    """A couple, which the guide takes."""
    return Load(mul(pose.b.u, 0.0), 1.0)


def by_slide(pose: Meshing) -> Load:
    """A force along the leading guide, through the driven centre."""
    return Load(mul(pose.a.u, 1.0), 0.0)


LOSSES: Mapping[str, Kernel] = {
    "RR": between_wheels,
    "RP": on_slide,
    "PR": by_slide,
}
"""Pair of the driver and of the driven one -> the kernel of what losses do."""


class Coupling(Block):
    """A relation that lets one driver follow another.

    driver : name of the driver that leads; of a wheel or cam that is fixed to some other link,
        the address ``"block.marker"`` of its centre
    driven : name of the driver that follows
    """

    _called: ClassVar[str] = 'a coupling such as Gear(driver="a", driven="b", teeth=(20, 40))'
    pairs: ClassVar[tuple[str, ...]] = ("RR", "RP", "PR", "PP")  # of the driver and the driven one
    refers: ClassVar[tuple[str, ...]] = ("driver", "driven")
    meshes: ClassVar[bool] = True  # x is an angle between links, not the driver's coordinate
    fixed: ClassVar[bool] = False  # whether both pairs must have their markers on one link
    sides: ClassVar[tuple[str, ...]] = ()  # numbers by which, above zero, `sided` is another

    driver: str
    driven: str

    def axis(self, outside: Axis) -> Axis:
        """Units of the argument and, in the field ``effort``, of the driven coordinate."""
        argument, driven = (outside.known.get(d, Axis()) for d in (self.driver, self.driven))
        return outside._replace(coordinate=argument.coordinate, effort=driven.coordinate)

    def units(self, axis: Axis) -> Units:
        """A phase is in the unit of the driven coordinate."""
        return {"phase": axis.effort}

    def transmission(self, pair: str) -> Kernel:
        """The kernel of rule 1; ``pair`` is one of `pairs`."""
        raise TypeError(f"{type(self).__name__} declares no transmission")

    def contact(self, pair: str) -> Kernel | None:
        """The kernel of rule 2, of links that touch `pushed`; None for a black box."""
        return None if self.touch(pair) is None else pushed

    def tension(self) -> Kernel | None:
        """The kernel of rule 3; None where nothing is tensioned."""
        return None

    def readings(self, pair: str) -> Mapping[str, Reading]:
        """Additional outputs by name, for couplings with a contact."""
        return {}

    def numbers(self, pair: str, at_zero: Callable[[], Meshing]) -> Parameters:
        """Parameters ``p`` of the kernels; ``at_zero`` gives both sides with all drivers at 0."""
        return self.parameters()

    def knots(self, low: float, high: float) -> Iterable[float]:
        """Arguments between two others at which the curve of the transmission jumps."""
        return ()

    def faults(self, where: str, pair: str, pose_at: Where, p: Parameters) -> Iterator[Problem]:
        """Problems with the positions of the links; ``where`` is the coupling's name."""
        yield from ()

    def touch(self, pair: str) -> Kernel | None:
        """The kernel of rule 4; None unless both links touch at exactly one point."""
        return None

    @property
    def rubs(self) -> Real:
        """Coefficient of friction where both links touch, 0 for none."""
        return 0.0

    @property
    def lost(self) -> Real:
        """Share of the larger power that a mesh loses, 0 for none."""
        return 0.0

    @property
    def lossy(self) -> bool:
        """Whether it takes power."""
        return bool(self.lost or self.rubs)

    @property
    def sided(self) -> bool:
        """Whether `contact` depends on the sign of the generalised force."""
        return False

    def curves(self, pair: str, pose_at: Where, p: Parameters) -> Iterator[Curve]:
        """What is drawn of it."""
        yield from ()

    def placed(self) -> Mapping[str, str]:
        """Fields that are places or angles on a link: on the "driver" or on the "driven" one."""
        return {}

    def advance(self, turns: Fraction) -> Fraction | None:
        """Turns of the driven link while x grows by these turns; 0 where it returns.

        None where no number of turns returns it, or where that is not known.
        """
        return None


class LossyCoupling(Coupling):
    """A coupling that loses a share of the power that it transmits.

    efficiency : [-] power that comes out over power that goes in, whichever side drives
    """

    efficiency: Annotated[Number, Field(gt=0.0, le=1.0), in_unit("")] = default(1.0)

    @property
    def lost(self) -> Real:
        """The loss: 1 minus the efficiency."""
        return 1.0 - self.efficiency
