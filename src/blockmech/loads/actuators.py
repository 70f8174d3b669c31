"""Actuators, whose force or moment follows a law of their coordinate, its rate or time.

A thrust acts between two markers: its force on b points from a to b, or along a direction
that turns with the link of a; the opposite acts at a. A positive value pushes the markers
apart. A motor acts between two links: its moment is on b, the opposite on a,
counter-clockwise positive.

Sources: [D14] Durango et al. 2014, section 2 (loads and driving moment as functions of
position and velocity).
"""

from __future__ import annotations

from typing import Annotated

from blockmech.ground.plane import always, angle, dot, hyp, imul, mul, where
from blockmech.ground.values import DIRECTED, VectorOrNoneGiven, default
from blockmech.loads.contract import Following, LawGiven, Terminal
from blockmech.typing import Complex, Kernel, Real


def push(p_a: Complex, p_b: Complex, F: Real, p: Thrust) -> tuple[Complex, Complex]:
    """Forces [N] on a and on b along the line between them; NaN where they meet."""
    d = p_b - p_a
    f = mul(d, F / hyp(d))
    return -f, f


def push_along(e_a: Complex, F: Real, p: Thrust) -> tuple[Complex, Complex]:
    """Forces [N] on a and on b along the direction given on the link of a."""
    f = mul(e_a * p.direction, F / hyp(p.direction))
    return -f, f


def distance(p_a: Complex, p_b: Complex, p: Thrust) -> Real:
    """Distance [m] from a to b."""
    return hyp(p_b - p_a)


def tension(p_a: Complex, p_b: Complex, F: Complex, p: Thrust) -> Real:
    """What the force on a [N] pulls towards b; negative where it pushes, 0 where they meet."""
    d = p_b - p_a
    return dot(F, d) / where(dot(d, d) == 0.0, 1.0, hyp(d))


def tension_along(e_a: Complex, F: Complex, p: Thrust) -> Real:
    """What the force on a [N] pulls along the direction."""
    return dot(F, e_a * p.direction) / hyp(p.direction)


def distance_rate(p_a: Complex, v_a: Complex, p_b: Complex, v_b: Complex, p: Thrust) -> Real:
    """Rate [m/s] of that distance; NaN where a and b meet."""
    d = p_b - p_a
    return dot(v_b - v_a, d) / hyp(d)


def stroke(p_a: Complex, e_a: Complex, p_b: Complex, p: Thrust) -> Real:
    """Distance [m] from a to b along the direction."""
    return dot(p_b - p_a, e_a * p.direction) / hyp(p.direction)


def stroke_rate(
    p_a: Complex, v_a: Complex, e_a: Complex, om_a: Real, p_b: Complex, v_b: Complex, p: Thrust
) -> Real:
    """Rate [m/s] of that distance, as the link of a sees it."""
    velocity = v_b - v_a - imul(p_b - p_a, om_a)
    return dot(velocity, e_a * p.direction) / hyp(p.direction)


class Thrust(Following, type="load.thrust"):
    """A force [N] on marker b away from marker a, the opposite at a, by a law.

    ``direction`` [dx, dy] is in the axes of the link of a. Put a on the line of action; otherwise
    the two forces form a couple.

    The law's coordinate [m] is the way from a to b along ``direction`` (negative where b is
    behind a), without one the distance of a and b; its rate [m/s] is positive where b moves
    along ``direction``, or away from a. Turning ``direction`` round changes the sign of both
    and of the force. With ``driver`` they are that driver's (gas force over the crank angle).

    >>> Thrust(law={"kind": "constant", "value": 500.0}).reads()
    {'a': ('p',), 'b': ('p',)}
    """

    coordinate_text = "way from a to b along the direction; without one their distance [m]"
    coordinate_symbol = "a→b"
    terminals = {"a": Terminal("point"), "b": Terminal("point")}

    law: LawGiven
    direction: Annotated[VectorOrNoneGiven, DIRECTED] = default(None)

    @property
    def line(self) -> tuple[Kernel, Kernel]:
        """Its length, and its tension."""
        pull = tension if self.direction is None else tension_along
        return self.measure_kernel(rate=False), pull

    @property
    def link_vectors(self) -> tuple[str, ...]:
        """The direction."""
        return ("direction",)

    def measure_kernel(self, rate: bool) -> Kernel:
        """The distance from a to b along the force, or its rate."""
        if self.direction is None:
            return distance_rate if rate else distance
        return stroke_rate if rate else stroke

    def kernel(self) -> Kernel:
        """The forces."""
        return push if self.direction is None else push_along


def moments(M: Real, p: Motor) -> tuple[Real, Real]:
    """Moments [N m] on a and on b."""
    return -M, M


def relative_angle(e_a: Complex, e_b: Complex, p: Motor) -> Real:
    """Angle [rad] of b relative to a, in (-pi, pi]."""
    return angle(e_a, e_b)


def relative_rate(om_a: Real, om_b: Real, p: Motor) -> Real:
    """Rate [rad/s] of b relative to a."""
    return om_b - om_a


class Motor(Following, type="load.motor"):
    """A moment [N m] on link b, the opposite on link a, by a law.

    The law's coordinate is the angle [rad] of link b from link a, counter-clockwise, in
    (-pi, pi], and its rate [rad/s] that of b less that of a. With ``driver`` they are that
    driver's, which count turns.

    >>> Motor(law={"kind": "dc", "stall_moment": 2.0, "no_load_speed": 100.0}).reads()
    {'a': ('om',), 'b': ('om',)}
    """

    turning = True
    coordinate_text = "angle of b from a, counter-clockwise, in (-pi, pi] [rad]"
    coordinate_symbol = "∠ab"
    terminals = {"a": Terminal("link"), "b": Terminal("link")}

    law: LawGiven

    def measure_kernel(self, rate: bool) -> Kernel:
        """The angle of b relative to a, or its rate."""
        return relative_rate if rate else relative_angle

    kernel = always(moments)
