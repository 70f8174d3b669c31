"""Loads of the time that repeat: their common period, and the map over it with its fixed points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any, NamedTuple, NoReturn

import numpy as np

from blockmech.dynamics.flows import ELSEWHERE, Flow, MotionEnded, no_steady
from blockmech.dynamics.periodic import FLOWS, NONE, FixedPoint, fixed_point
from blockmech.ground.plane import EPS
from blockmech.loads.contract import Following
from blockmech.loads.laws import Polynomial
from blockmech.model.structure import Structure
from blockmech.result.motion import Floats

SETTLING = 30  # periods of flow before a root is looked for (numerics 14)
TIMES = 3  # as often
PERIODS = (1, 2, 4)  # of the loads in one of the motion that are tried: it doubles, if not one
INWARD = 0.6  # below 1: by it amplitudes or speeds are sampled ahead; outward by its inverse
COMMON = 1000  # periods of one load in the common one at most
GIVE = 'give the period of the loads: "steady=<s>"'


def forcing_period(structure: Structure, given: float) -> float:
    """The shortest time [s] after which all loads of the time repeat.

    ``given`` [s] is the period that the user names for loads whose law does not tell it.
    """
    whole, first = given, "steady"
    for name, element in structure.elements.items():
        law: Any = element.law if isinstance(element, Following) else None
        if law is None or "time" not in law.variables():
            continue
        if isinstance(law, Polynomial) and not any(law.coefficients[1:]):
            continue
        period = getattr(law, "whole", None)
        if period:
            whole, first = _common(whole, first, float(period), name), name
        elif period is not None or isinstance(law, Polynomial):
            raise no_steady(f"the load {name} follows the time and does not repeat")
        elif not given:
            raise no_steady(f"the load {name} follows the time by a law that tells no period", GIVE)
    if not whole:
        raise no_steady("the loads follow the time, and their period is not known", GIVE)
    return whole


def _common(one: float, first: str, other: float, second: str) -> float:
    """The least common multiple of two periods [s]; ``one`` may be 0: not known."""
    ratio = Fraction(other / one if one else 1.0).limit_denominator(COMMON)
    fits = 0 < ratio.numerator <= COMMON and abs(float(ratio) * one / other - 1) <= NONE
    if one and not fits:
        raise no_steady(
            f"the loads {first} and {second} repeat after {one:.9g} s and {other:.9g} s, "
            "which have no common multiple, so nothing repeats"
        )
    return one * ratio.numerator or other


class Orbit(NamedTuple):
    """A periodic motion under loads that repeat, from where a period of them begins."""

    point: FixedPoint
    periods: int  # of the loads in one of it
    seen: bool  # to come from the start


class Stroboscope:
    """The state after a period T of the loads, and its fixed points.

    cyclic : drivers on whose coordinates nothing depends; free : parts that must repeat
    """

    def __init__(self, flow: Flow, T: float) -> None:
        self.flow, self.T = flow, T
        self._check_period()
        self.cyclic = [i for i in range(flow.k) if self._is_cyclic(i)]
        self.free = [i for i in range(flow.layout.moving) if i not in self.cyclic]

    def _check_period(self) -> None:
        """Look whether the loads really are the same a period later."""
        flow, T = self.flow, self.T
        for t in np.linspace(0.0, 0.9 * T, SETTLING).tolist():
            here, later = flow.acceleration(flow.x, t), flow.acceleration(flow.x, t + T)
            largest = float(np.abs([here, later]).max()) + flow.speed**2
            if not np.abs(later - here).max() <= NONE * largest:
                raise no_steady(f"the loads are not the same again after {T:.9g} s", GIVE)

    def _is_cyclic(self, i: int) -> bool:
        flow, rate = self.flow, self.flow.layout.rate
        x = flow.x.copy()
        x[rate] += flow.size[rate]
        radian = flow.system.span / math.tau * np.eye(1, x.size, i)[0]  # or as much of a slide
        here = flow.acceleration(x)
        there = [flow.acceleration(x + j * radian) for j in (1, 2, 3)]
        return bool(np.abs(np.array(there) - here).max() <= NONE * (np.abs(here).max() + EPS))

    def away(self, x: Floats, other: Floats) -> float:
        """How far two states are apart, relative to a motion's size."""
        return float(np.abs(self.flow.wrapped(other - x) / self.flow.size)[self.free].max())

    def orbits(self) -> Iterator[Orbit]:
        """Orbits near the start and near what it settles to."""
        x = self.flow.x
        if self.away(x, self.flow.after(x, self.T, FLOWS)) <= NONE / 100:
            yield from self._near(x, (1,))
        for _ in range(TIMES):
            for _ in range(SETTLING):
                x = self.flow.after(x, self.T)
            x[self.cyclic] = self.flow.x[self.cyclic]
            yield from self._near(x, PERIODS)

    def _near(self, x: Floats, periods: Sequence[int]) -> Iterator[Orbit]:
        for n in periods:

            def change(x: Floats, n: int = n) -> Floats:
                return self.flow.wrapped(self.flow.after(x, n * self.T, FLOWS) - x)

            with suppress(MotionEnded):
                point = fixed_point(change, x, self.free, self.flow.size)
                if point is not None:
                    yield Orbit(point, n, self.away(x, point.x) <= INWARD)

    def orbit(self) -> Orbit:
        """The first orbit that stays, else the first. Raises `RequestError` where there is none."""
        best: Orbit | None = None
        for orbit in self.orbits():
            best = orbit if best is None or orbit.point.kind == "stable" else best
            if orbit.point.kind != "unstable":
                break
        return best or self._unfound()

    def _unfound(self) -> NoReturn:
        x, T, flow = self.flow.x, self.T, self.flow
        if flow.k == len(self.cyclic) == 1:
            gain = float(flow.after(x, T, FLOWS)[1] - x[1])
            why = f"in every {T:.9g} s the loads change the rate by {gain:.6g}, whatever it is"
            raise no_steady(why, "add a damper or a motor curve")
        raise no_steady(
            "no periodic motion was found; it may be chaotic, or have a period of its own beside "
            f"that of the loads; tried: {SETTLING * TIMES} periods of the motion from the start",
            ELSEWHERE,
        )
