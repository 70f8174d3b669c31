"""Geneva drive: a pin that takes a slotted wheel a step further once a turn.

             A  pin C at r = d sin(pi/n) about A, so that it enters a slot along the slot
            /
      B ---C      psi = atan(l sin th / (1 - l cos th)), l = sin(pi/n), th from the line of centres

While the pin is in a slot, |th| <= pi/2 - pi/n, the wheel turns by -psi; else it rests, held by
the lock, an arc about A. psi'' jumps where the pin enters and leaves. The force is square to the
slot, at rest that of the lock, whose line goes through A: the shortest that holds the effort.

A wheel that surrounds the pin's path turns with the driver: with -l in place of l and |th| <=
pi/2 + pi/n, th from where the pin is farthest from B.

Source: Norton, Design of Machinery, 5th ed. 2012, sec. 2.11; Bickford, Mechanisms for
Intermittent Motion, 1972.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Annotated, NamedTuple

from pydantic import Field, StrictBool

from blockmech.couplings.contract import (
    ROUND,
    Curve,
    LossyCoupling,
    Meshing,
    Transmission,
    Where,
    circle,
    concentric,
)
from blockmech.ground.plane import (
    always,
    angle,
    apply,
    dot,
    expi,
    imul,
    modulo,
    mul,
    planar,
    sign,
    where,
)
from blockmech.ground.values import Angle, default
from blockmech.typing import Load, Real

Slots = Annotated[int, Field(strict=True, ge=3)]


class GenevaNumbers(NamedTuple):
    """Numbers of a Geneva drive."""

    pin: Real  # [rad] angle of the driver with the pin on the line of centres
    phase: Real  # [rad] angle of the wheel there
    half: Real  # [rad] largest th in a slot
    step: Real  # [rad] of the wheel against a turn of the driver, half of it on either side
    arm: Real  # [-] radius of the pin's path over the distance of the centres; internal: negative


def pin_angle(x: Real, p: GenevaNumbers) -> Real:
    """Angle [rad] of the pin from the line of centres, between -pi and pi."""
    return modulo(x - p.pin + math.pi, math.tau) - math.pi


def stepping(x: Real, p: GenevaNumbers) -> Transmission:
    """The wheel turns while the pin is in a slot."""
    th = pin_angle(x, p)
    z = expi(th)
    a, b = 1.0 - p.arm * z.real, p.arm * z.imag
    d = a * a + b * b
    psi = angle(planar(a, -b), planar(a, b)) * 0.5
    slope = p.arm * (z.real - p.arm) / d
    curve = p.arm * z.imag * (p.arm * p.arm - 1.0) / (d * d)
    inside = abs(th) <= p.half
    part = where(inside, psi, 0.5 * sign(th) * p.step)
    turned = (x - p.pin - th) * (p.step / math.tau)
    still = 0.0 * th
    return Transmission(
        p.phase - part - turned, where(inside, -slope, still), where(inside, -curve, still)
    )


def push(pose: Meshing, effort: Real, sense: Real, p: GenevaNumbers) -> Load:
    """Force [N] of the pin on the slot, or of the lock on the wheel."""
    th, d = pin_angle(pose.x, p), pose.b.p - pose.a.p
    pin = mul(d * expi(th), p.arm) - d
    inside = abs(th) <= p.half
    arm = planar(where(inside, pin.real, -d.real), where(inside, pin.imag, -d.imag))
    return Load(imul(arm, effort / dot(arm, arm)), effort)


class Geneva(LossyCoupling, type="coupling.geneva"):
    """A driver with one pin and a wheel with ``slots`` slots, which turns the other way.

    slots : number of slots of the wheel, three or more
    internal : whether the slots open inward, so that the wheel turns with the driver
    pin : [rad] angle of the driver where the pin is on the line of centres
    phase : [rad] angle of the wheel there

    The pin's radius follows from the distance of the centres.

    >>> round(Geneva(driver="motor", driven="table", slots=6).parameters().step, 6)
    1.047198
    """

    pairs = ("RR",)
    fixed = True

    slots: Slots
    internal: StrictBool = False
    pin: Angle = default(0.0)
    phase: Angle = default(0.0)

    def parameters(self) -> GenevaNumbers:
        """Angles and the pin's arm."""
        half = math.pi / self.slots * (-1 if self.internal else 1)
        arm = apply("expi", half).imag
        return GenevaNumbers(self.pin, self.phase, math.pi / 2 - half, 2 * half, arm)

    faults = concentric

    transmission = always(stepping)
    contact = always(push)

    def knots(self, low: float, high: float) -> Iterable[float]:
        """Angles at which the pin enters and leaves a slot."""
        p = self.parameters()
        for k in range(math.floor(low / math.tau) - 1, math.ceil(high / math.tau) + 2):
            at = p.pin + math.tau * k
            yield from (x for x in (at - p.half, at + p.half) if low <= x <= high)

    def curves(self, pair: str, pose_at: Where, p: GenevaNumbers) -> Iterator[Curve]:
        """The pin's path and the pin, and the wheel with its slots."""
        at = pose_at(p.pin)
        d = at.b.p - at.a.p
        r, size = abs(d) * p.arm, abs(d)  # a negative radius turns the pin to the other side
        lead = cmath.exp(1j * p.pin) * pose_at(0.0).lead.u  # of the driver with its pin at the slot
        pin, slim = r * d / size / lead, 0.1 * r
        path = [pin * cmath.exp(2j * math.pi * k / ROUND) for k in range(ROUND + 1)]
        yield Curve("driver", path, chain=True)
        yield Curve(
            "driver", [0j, *(pin + slim * cmath.exp(1j * math.pi * k / 6) for k in range(13))]
        )
        rim, deep, slot = size * math.cos(math.pi / self.slots), size - r, -d / size / at.link.u
        outline = []
        for k in range(self.slots):
            e = slot * cmath.exp(1j * p.step * k)
            for radial, aside in ((rim, -slim), (deep, -slim), (deep, slim), (rim, slim)):
                outline.append(e * (radial + 1j * aside))
            lock = e * size * cmath.exp(0.5j * p.step)  # the driver's centre seen while it rests
            lock *= not self.internal  # whose lock is not drawn
            radius = abs(e * (rim + 1j * slim) - lock)
            begin, end = (
                cmath.phase(e * s * (rim + 1j * slim * w) - lock)
                for s, w in ((1, 1), (cmath.exp(1j * p.step), -1))
            )
            sweep = math.remainder(end - begin, math.tau)
            arc = (lock + cmath.rect(radius, begin + sweep * j / 8) for j in range(1, 8))
            outline += arc
        yield Curve("driven", [*outline, outline[0]])
        if self.internal:
            yield Curve("driven", circle(deep + 2 * abs(slim))[1:])

    def advance(self, turns: Fraction) -> Fraction:
        """One step per turn."""
        return (turns if self.internal else -turns) / self.slots
