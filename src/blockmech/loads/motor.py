"""A motor between two links: a moment that follows a law of angle, rate or time.

The moment is on b, the opposite on a, counter-clockwise positive.

Sources: [D14] Durango et al. 2014, section 2 (driving moment as a function of
position and velocity).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from blockmech.loads.contract import Following, Terminal
from blockmech.plane import angle
from blockmech.typing import Complex, Real


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

    own_coordinate = "angle of b from a, counter-clockwise, in (-pi, pi] [rad]"
    own_symbol = "∠ab"
    terminals = {"a": Terminal("link"), "b": Terminal("link")}

    def own_measure(self, rate: bool) -> Callable[..., Any]:
        """The angle of b relative to a, or its rate."""
        return relative_rate if rate else relative_angle

    def kernel(self) -> Callable[..., Any]:
        """The moments."""
        return moments
