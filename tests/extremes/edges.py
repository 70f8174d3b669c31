"""Limits, modes and steady states where numbers just decide, against closed forms in 60 digits.

A four-bar whose crank almost turns fully, or just does, and a wheel that a motor turns against
the friction of its pin.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp, mpf

import blockmech as bm
from tests.machines import wire

from .friction import SHAKES, moved
from .precise import DIGITS
from .scenes import fourbar

CRANK, ROD, ROCKER = 1.0, 3.0, 2.0  # [m]
STALL, FREE, ARM, RADIUS = 10.0, 100.0, 0.1, 0.01  # motor [N m], [rad/s]; wheel and pin [m]


@dataclass(frozen=True)
class Turning:
    """A four-bar that stretches a relative gap before its crank is round; below 0 it never does."""

    name: str
    gap: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """Crank, rod, rocker and distance of the pivots [m]."""
        return (CRANK, ROD, ROCKER, (ROD + ROCKER) / (1 - self.gap) - CRANK)

    @staticmethod
    def end(numbers: Sequence[Any]) -> Any:
        """Angle of the crank [rad] at which it ends, None where it turns fully."""
        a, b, c, d = numbers
        cosine = (a * a + d * d - (b + c) ** 2) / (2 * a * d)
        return mp.acos(cosine) if cosine > -1 else None


@dataclass(frozen=True)
class Ends:
    """What limits and modes say of a four-bar, and what is so.

    error, forced : [rad] of the ends of arcs; infinite where half an ulp in the data decides
    left_out : [rad] of a turn on each side of the place where it stretches; 0 if it turns fully
    told : whether it is told that it turns fully
    circuits : of the modes
    change_point : whether both tell that there is a change point
    """

    error: float
    forced: float
    left_out: float
    told: bool
    circuits: int
    change_point: bool


def turning() -> Iterator[Turning]:
    """Ever nearer the linkage that stretches just where its crank is round."""
    for k in (1, 2, 4, 6, 8, 10, 12, 14, 15):
        yield Turning(f"stretches 1e-{k} before the crank is round", 10.0**-k)
        yield Turning(f"is 1e-{k} short of stretching", -(10.0**-k))


def ends_of(case: Turning) -> Ends:
    """The ends of the arcs of a four-bar, by limits and by modes."""
    mech = fourbar(*case.numbers).compile()
    limits, (group,) = mech.limits("crank"), mech.modes(at={"crank": 0.3}).groups
    with mp.workdps(DIGITS):
        truth = case.end(moved(case.numbers, None, np.float64))
        shaken = [case.end(moved(case.numbers, seed, np.float64)) for seed in range(SHAKES)]
        left_out = 0.0 if truth is None else float(mp.pi - truth)
        error = forced = 0.0
        if any((x is None) != (truth is None) for x in shaken):
            forced = math.inf
        elif truth is not None:
            forced = max(float(abs(x - truth)) for x in shaken)
            arcs = [(a.start.q, a.end.q) for a in (*limits.arcs, *group.arcs)]
            error = max(float(abs(abs(mpf(q)) - truth)) for arc in arcs for q in arc)
    change = all(a.change_points for a in (*limits.arcs, *group.arcs))
    circuits = len({a.circuit for a in group.arcs})
    return Ends(error, forced, left_out, limits.whole_turn, circuits, change)


@dataclass(frozen=True)
class Wheel:
    """A wheel out of balance, which a motor turns; ``friction`` is the coefficient of its pin."""

    name: str
    friction: float

    @property
    def graph(self) -> bm.Graph:
        """The wheel as blocks."""
        g = bm.Graph("wheel")
        g.add("frame", bm.Frame(markers={"O": 0j}))
        body = bm.Link(mass=1.0, inertia=1.0, cm=(ARM, 0.0))
        law = (
            {"A": bm.friction.Coulomb(coefficient=self.friction, radius=RADIUS)}
            if self.friction
            else {}
        )
        g.add("crank", bm.Crank(length=1.0, links={"crank": body}, friction=law))
        g.add("motor", bm.Motor(law=bm.laws.DC(stall_moment=STALL, no_load_speed=FREE)))
        return wire(g, "frame.O crank.A", "frame.O motor.a", "crank.crank motor.b")

    @property
    def numbers(self) -> tuple[float, ...]:
        """What its speed is made of."""
        return (self.friction, RADIUS, ARM, STALL, FREE)

    @staticmethod
    def period(numbers: Sequence[Any]) -> Any:
        """Of a turn [s]: friction f r m e w^2 takes what the motor gives."""
        f, r, e, stall, free = numbers
        slope = stall / free
        return mp.pi * (slope + mp.sqrt(slope**2 + 4 * f * r * e * stall)) / stall


@dataclass(frozen=True)
class Steady:
    """Relative error of the period, what half an ulp forces, and what it says it is."""

    error: float
    forced: float
    estimate: float


def wheels() -> Iterator[Wheel]:
    """Friction from none to what all but stops the wheel."""
    for f in (0.0, 1e-16, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 30.0, 900.0):
        yield Wheel(f"wheel with friction {f:g}", f)


def steady_of(case: Wheel) -> Steady:
    """The period to which a wheel settles."""
    motion = case.graph.compile().simulate("steady", start={"crank": (0.3, 1.0)}).motion
    with mp.workdps(DIGITS):
        truth = case.period(moved(case.numbers, None, np.float64))
        error = abs(mpf(motion.facts["period"]) / truth - 1)
        shaken = (case.period(moved(case.numbers, seed, np.float64)) for seed in range(SHAKES))
        forced = max(abs(x / truth - 1) for x in shaken)
        said = motion.time_error / truth
    return Steady(float(error), float(forced), float(said))
