"""Belt or chain drive between two wheels, open or crossed.

      A ======= B      open      q2 = (r1 / r2) q1, strands on the same side of both wheels
      A ==><=== B      crossed   q2 = -(r1 / r2) q1, strands cross the line of centres

The strands are straight and massless, so each pulls both wheels with one force along one line.
Tensioned by T0 a strand the belt carries T0 + f/2 and T0 - f/2, f = effort / r2 the difference
that drives; a chain, T0 = 0, carries f in the tight side and nothing in the slack one.

Source: Niemann & Winter, Maschinenelemente III, 2004, ch. 27.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Annotated, NamedTuple

from pydantic import StrictBool

from blockmech.couplings.contract import (
    Curve,
    LossyCoupling,
    Meshing,
    Reading,
    Transmission,
    Where,
    circle,
)
from blockmech.couplings.laws import SHARES
from blockmech.ground.errors import Problem
from blockmech.ground.plane import always, dot, imul, mul, sqrt
from blockmech.ground.values import Angle, Lengths, NotNegative, default, in_unit
from blockmech.typing import Complex, Kernel, Load, Real


class BeltNumbers(NamedTuple):
    """Numbers of a belt."""

    ratio: Real  # [-] turns of the driven wheel for one of the driver's
    phase: Real  # [rad]
    radius: Real  # [m] of the driven wheel
    step: Real  # [m] radius of the driven wheel less that of the driver's, crossed: their sum
    preload: Real  # [N] tension of either strand
    slack: Real  # 1 for a chain, 0 for a belt under tension


def running(x: Real, p: BeltNumbers) -> Transmission:
    """Both wheels pass the same length of belt."""
    return Transmission(p.ratio * x + p.phase, p.ratio, 0.0)


def strand(pose: Meshing, side: float, p: BeltNumbers) -> Complex:
    """Unit direction from the driven wheel to the other of the strand on one side of it.

    On the side +1 the strand pulls the wheel counter-clockwise: it leaves where the wheel,
    turning so, would wind it up. Its distance from the driven centre is r2, and its direction
    makes with the line of centres the angle whose sine is (r2 -+ r1) / d.
    """
    d = pose.a.p - pose.b.p
    sine = p.step * p.step / dot(d, d)
    cosine = sqrt(1.0 - sine)
    unit = mul(d, 1.0 / sqrt(dot(d, d)))
    return mul(unit, cosine) + imul(unit, side * p.step / sqrt(dot(d, d)))


def pull(pose: Meshing, effort: Real, sense: Real, p: BeltNumbers) -> Load:
    """Forces [N] of both strands on the driven wheel, without the preload."""
    half = 0.5 * effort / p.radius
    bias = sense * half * p.slack
    force = mul(strand(pose, 1.0, p), half + bias) + mul(strand(pose, -1.0, p), bias - half)
    return Load(force, effort)


def preloading(pose: Meshing, p: BeltNumbers) -> Load:
    """The preload of both strands; it turns nothing."""
    both = strand(pose, 1.0, p) + strand(pose, -1.0, p)
    return Load(mul(both, p.preload), 0.0)


def slack_tension(pose: Meshing, load: Load, p: BeltNumbers) -> Real:
    """Tension [N] of the slack strand."""
    return p.preload - 0.5 * abs(load.M) / p.radius


class Belt(LossyCoupling, type="coupling.belt"):
    """A belt or chain over two wheels, the driver's and the driven one's.

    radii : [m] (driver's, driven one's) pitch radii
    crossed : whether the belt crosses itself, so that the wheels turn in opposite senses
    preload : [N] tension of either strand at rest; 0 is a chain, whose slack side hangs
    phase : [rad] angle of the driven link where the driver's has turned by nothing

    >>> Belt(driver="motor", driven="drum", radii=(0.03, 0.09)).ratio
    0.3333333333333333
    """

    pairs = ("RR",)
    sides = ("preload",)

    radii: Lengths
    crossed: StrictBool = False
    preload: Annotated[NotNegative, in_unit("N")] = default(0.0)
    phase: Angle = default(0.0)

    @property
    def ratio(self) -> float:
        """Turns of the driven wheel per turn of the driver's, on a carrier at rest."""
        ratio = self.radii[0] / self.radii[1]
        return -ratio if self.crossed else ratio

    @property
    def sided(self) -> bool:
        """True for a chain: its slack strand carries no force."""
        return not self.preload > 0

    def parameters(self) -> BeltNumbers:
        """Ratio, and radii that fix the lines of the strands."""
        first, second = self.radii
        step = second + first if self.crossed else second - first
        slack = 1.0 if self.sided else 0.0
        return BeltNumbers(self.ratio, self.phase, second, step, self.preload, slack)

    transmission = always(running)
    contact = always(pull)

    def tension(self) -> Kernel | None:
        """`preloading`, of a belt that has some."""
        return None if self.sided else preloading

    def readings(self, pair: str) -> Mapping[str, Reading]:
        """The remaining tension, for a belt with preload."""
        if self.sided:
            return {}
        return {"slack": Reading("N", slack_tension, of_load=True, flag="slack-belt")}

    def faults(self, where: str, pair: str, pose_at: Where, p: BeltNumbers) -> Iterator[Problem]:
        """Wheels that overlap."""
        at, (first, second) = pose_at(0.0), self.radii
        limit = first + second if self.crossed else abs(first - second)
        if (d := abs(at.b.p - at.a.p)) <= limit:
            message = f"the centres are {d:.6g} m apart, the wheels need more than {limit:.6g} m"
            yield Problem("no-room", where, message, "", "move the centres apart")

    def curves(self, pair: str, pose_at: Where, p: BeltNumbers) -> Iterator[Curve]:
        """Both pitch circles, and the strands."""
        at, (first, second) = pose_at(0.0), self.radii
        yield Curve("driver", circle(first), chain=True)
        yield Curve("driven", circle(second), chain=True)
        for side in (1.0, -1.0):
            e = strand(at, side, p)
            start = -1j * side * e * second
            length = math.sqrt(abs(at.a.p - at.b.p) ** 2 - p.step**2)
            yield Curve("carrier", [start, start + e * length])

    def advance(self, turns: Fraction) -> Fraction | None:
        """Turns by the ratio, if that is a fraction of small integers."""
        share = Fraction(self.ratio).limit_denominator(SHARES)
        return share * turns if abs(float(share) - self.ratio) <= 1e-14 else None
