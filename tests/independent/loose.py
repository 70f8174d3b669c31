"""A four-bar and a slider-crank with massless links in their pins, in fifty digits.

Each journal hangs in its bush on a massless link of length c. With the crank held, links and
massless links lie where their loads have the least potential; the loads are the weights, a
force that stays, and m a and J al of the ideal motion, all as dead loads. No reaction is worked
out here: a gap d_j that no couple holds points where the potential falls the most, and the
loop is closed again with all gaps in it, at clearances of finite size.

Source: the principle of least potential; the massless link after Earles & Wu 1973.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import mpmath as mp

DIGITS, STEP = 50, mp.mpf("1e-16")  # of differences in gaps and in time


class Body(NamedTuple):
    """A link: mass [kg], inertia [kg m2], centre of mass and a marker M in its own axes [m]."""

    mass: float
    inertia: float
    cm: complex
    M: complex


class Place(NamedTuple):
    """Origin and angle of a link."""

    o: Any
    angle: Any

    def at(self, arm: complex) -> Any:
        """A place of the link."""
        return self.o + mp.mpc(arm) * mp.expj(self.angle)


Closed = Callable[[Any, tuple[Any, ...]], tuple[Place, ...]]
"""Crank angle and gaps, each from the earlier link's place to the later one's -> places."""


def four_bar(l1: float, l2: float, l3: float, ground: float) -> Closed:
    """Crank A B, coupler B C, rocker D C; gaps of A, B, C (rocker behind coupler), D."""

    def close(q: Any, gaps: tuple[Any, ...]) -> tuple[Place, ...]:
        a, b, c, d = gaps
        crank, B = Place(a, q), a + l1 * mp.expj(q) + b
        D = ground + d
        span = D - B - c  # coupler and rocker meet but for the gap
        r = abs(span)
        along = (r**2 + mp.mpf(l2) ** 2 - mp.mpf(l3) ** 2) / (2 * r)
        u = span / r * mp.mpc(along, mp.sqrt(mp.mpf(l2) ** 2 - along**2))
        return crank, Place(B, mp.arg(u)), Place(D, mp.arg(B + u + c - D))

    return close


def slider_crank(l1: float, l2: float, height: float) -> Closed:
    """Crank A B, rod B C, slider on a level line at a height; gaps of A, B, C."""

    def close(q: Any, gaps: tuple[Any, ...]) -> tuple[Place, ...]:
        a, b, c = gaps
        B = a + l1 * mp.expj(q) + b
        rod = mp.asin((height - (B + c).imag) / l2)
        return Place(a, q), Place(B, rod), Place(B + l2 * mp.expj(rod) + c, mp.mpf(0))

    return close


def play(
    close: Closed,
    bodies: tuple[Body, ...],
    clearance: tuple[float, ...],
    q: float,
    rate: float,
    force: tuple[int, complex],
) -> list[complex]:
    """Displacement of each body's M per size of the clearances, as these go to nothing.

    Parameters
    ----------
    close : how the loop closes
    clearance : of each gap [m]
    q, rate : of the crank [rad], [rad/s]; the rate is constant
    force : number of a body, and the force at its M [N]
    """
    with mp.workdps(DIGITS):
        q, none = mp.mpf(q), tuple(mp.mpc(0) for _ in clearance)
        ideal = close(q, none)
        h = STEP
        after, before = close(q + h * rate, none), close(q - h * rate, none)
        loads = []
        for k, (body, now, one, two) in enumerate(zip(bodies, ideal, after, before, strict=True)):
            a = (one.at(body.cm) - 2 * now.at(body.cm) + two.at(body.cm)) / h**2
            al = (one.angle - 2 * now.angle + two.angle) / h**2
            weight = body.mass * mp.mpc(0, "-9.81")
            loads.append((weight - body.mass * a, -body.inertia * al, force[1] * (force[0] == k)))

        def potential(gaps: list[Any]) -> Any:
            total = mp.mpf(0)
            for body, load, place in zip(bodies, loads, close(q, tuple(gaps)), strict=True):
                F, moment, at_M = load
                total -= mp.re(mp.conj(F) * place.at(body.cm)) + moment * place.angle
                total -= mp.re(mp.conj(mp.mpc(at_M)) * place.at(body.M))
            return total

        def quotient(size: Any) -> list[Any]:
            gaps = list(none)
            for _ in range(12):  # the directions change by a share of the size at most
                slopes = [_slope(potential, gaps, j) for j in range(len(gaps))]
                each = zip(slopes, clearance, strict=True)
                gaps = [-c * size * slope / abs(slope) for slope, c in each]
            moved = close(q, tuple(gaps))
            rows = zip(bodies, moved, ideal, strict=True)
            return [(one.at(body.M) - two.at(body.M)) / size for body, one, two in rows]

        size = mp.mpf("1e-6")
        pairs = zip(quotient(size), quotient(size / 2), strict=True)
        return [complex(2 * fine - coarse) for coarse, fine in pairs]


def _slope(potential: Callable[[list[Any]], Any], gaps: list[Any], j: int) -> Any:
    """Gradient of the potential by one gap, as a complex number."""

    def moved(by: Any) -> Any:
        return potential([gap + by * (k == j) for k, gap in enumerate(gaps)])

    x = (moved(STEP) - moved(-STEP)) / (2 * STEP)
    y = (moved(STEP * 1j) - moved(-STEP * 1j)) / (2 * STEP)
    return mp.mpc(x, y)
