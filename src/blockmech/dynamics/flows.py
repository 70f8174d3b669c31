"""Motions of a system from any state, as maps from one state to another: for steady states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.dynamics import ends, loads
from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.equation import Equation, classify_obstacle, typical_motion
from blockmech.dynamics.estimate import LOOSE, TARGET
from blockmech.dynamics.periodic import ELSEWHERE, FLOWS, GIVE, FixedPoint, fixed_point, no_steady
from blockmech.dynamics.request import SimulationRequest, Start, Until, Watch
from blockmech.dynamics.run import INTEGRATORS
from blockmech.dynamics.time import TimeIntegration, integrate
from blockmech.dynamics.undefined import undefined_loads
from blockmech.ground.errors import RequestError, listed
from blockmech.ground.plane import EPS
from blockmech.result.motion import Motion
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

SMALL = math.sqrt(LOOSE)  # amplitude by the span, or by that of the start, that counts as rest
SETTLING = 30  # periods of flow before a root is looked for (numerics 14)
TIMES = 3  # as often
PERIODS = (1, 2, 4)  # of the loads in one of the motion that are tried: it doubles, if not one
INWARD = 0.6  # below 1: by it amplitudes or speeds are sampled ahead; outward by its inverse
FAR = 1 / SMALL  # spans that a driver without turns may go without a standstill, or a search


class MotionEnded(Exception):
    """A motion ended on the way, by something named: "dead centre", "end stop" ..."""

    def __init__(
        self, end: str, t: float = math.nan, loads: Callable[[], list[str]] = list
    ) -> None:
        super().__init__(end)
        self.end, self.t, self.loads = end, t, loads

    def after(self, clock: float) -> RequestError:
        """What ends the motion from the start, and when."""
        when = f" after {clock + self.t:.6g} s" if math.isfinite(self.t) else ""
        silent = self.loads()
        end = f"{listed(silent)} gives no value beyond" if silent else self.end
        return no_steady(f"the motion from the start ends{when}: {end}", ELSEWHERE)


class SectionReturn(NamedTuple):
    """A way to the next standstill, through a whole turn, or to rest under joint friction."""

    kind: str  # ends.STANDSTILL, ends.TURN or ends.REST
    x: Floats
    time: float


@dataclass
class Flow:
    """Motions of a system, without an estimate of their errors, from states of its `layout`.

    Attributes
    ----------
    x, size : (n,) the state at the start, and typical sizes of its parts
    turns : (n,) periods of the coordinates; 0 where there is none, or an end stop
    """

    system: System
    request: SimulationRequest
    name: str = "return map"
    equation: Equation = field(init=False)

    def __post_init__(self) -> None:
        start, system = self.request.start, self.system
        self.equation = Equation(system, start.q)
        self.layout, self.k = self.equation.layout, len(system.drivers)
        self.x = self.layout.start(start.q, start.rate)
        if system.friction is not None:
            self.equation.sides = system.friction.slipping(self.x[:1], np.ones(1))
        self.speed = typical_motion(self.equation, start.t, self.x)[0]
        self.size, self.turns = np.ones(self.layout.size), np.zeros(self.layout.size)
        self.size[self.layout.q], self.size[self.layout.rate] = min(system.span, 1.0), self.speed
        self.measure(self.x)
        self.periods = _periods(system)
        for i, (period, between) in enumerate(zip(self.periods, system.stops, strict=False)):
            self.turns[i] = 0.0 if np.isfinite(between).any() else period or 0.0
        if not np.isfinite(self.acceleration(self.x)).all():
            silent = undefined_loads(system.compiled, self.request.standing)
            why = f"{listed(silent)} gives no value" if silent else ""
            why = why or classify_obstacle(self.equation, start.t, self.x).end
            raise no_steady(f"{why} at the start", "start elsewhere")

    def measure(self, x: Floats) -> None:
        """Take the sizes of states of signal blocks from a state."""
        signals = self.layout.signals
        self.size[signals] = np.maximum(np.abs(x[signals]), self.system.signals.sizes)

    def slope(self, x: Floats, later: float = 0.0) -> Floats:
        """The rates (n,) of a state, some time [s] after the start."""
        return np.asarray(self.equation(self.request.start.t + later, x), dtype=np.float64)

    def acceleration(self, x: Floats, later: float = 0.0) -> Floats:
        """q'' (k,) at a state, some time [s] after the start."""
        return self.slope(x, later)[self.layout.rate]

    def repeats(self, period: float) -> bool:
        """Whether signals do the same a period on, whatever they read."""
        shifted = self.x + period * (np.arange(self.x.size) < 1)
        change = np.abs(self.slope(shifted) - (slope := self.slope(self.x)))
        return bool(change.max() <= SETTLED * np.abs(slope).max())

    def wrapped(self, step: Floats) -> Floats:
        """A change of the state (n,), whole turns left out."""
        return step - self.turns * np.round(step / np.where(self.turns, self.turns, 1.0))

    def begin_of(self, x: Floats) -> Floats:
        """A state, at the first turn of its driver: where the start is, if it can."""
        off = self.wrapped(x - self.x)[:1]
        return np.append(self.x[:1] + np.where(np.abs(off) > SETTLED, off, 0.0), x[1:])

    # -- ways ------------------------------------------------------------------------------

    def _request(self, x: Floats, until: Until, watch: Sequence[Watch] = ()) -> SimulationRequest:
        start = Start(*self.layout.motion(x), self.request.start.t)
        return replace(self.request, start=start, until=until, watch=tuple(watch), times=())

    def _run(self, x: Floats, tolerance: float, *goal: Any) -> Motion:
        """One integration from a state."""
        request = self._request(x, *goal)
        as_requested = request.method in INTEGRATORS and tolerance > FLOWS
        method, rest = request.method if as_requested else "dop853", SMALL * self.system.span
        run = TimeIntegration(self.system, request, method, tolerance, self.name, rest)
        run.y = x.copy()
        return _uninterrupted(run.motion())

    def end_of(self, motion: Motion) -> Floats:
        """The state at the end of a motion."""
        x = self.layout.start(motion.q_end, motion.qd_end)
        x[self.layout.signals] = motion.x_end
        return x

    def after(self, x: Floats, time: float, tolerance: float = LOOSE) -> Floats:
        """The state some time [s] later."""
        if not (np.abs(x - self.x) <= FAR * self.size).all():  # a root search went astray
            raise MotionEnded("a way without end")
        motion = self._run(x, tolerance, Until("time", time))
        if motion.end != "time":
            raise self._interruption(motion)
        return self.end_of(motion)

    def passage(self, x: Floats, tolerance: float = LOOSE) -> SectionReturn:
        """The way of one driver to the next standstill or whole turn."""
        begin, limit = float(x[0]), float(self.turns[0]) or FAR * self.system.span

        gone = Watch(ends.TURN, lambda t, q, qd: abs(q - begin) - limit)
        motion = self._run(x, tolerance, Until("standstill"), [gone])
        if motion.end == ends.TURN and not self.turns[0]:
            raise MotionEnded("a way without end")
        if motion.end not in (ends.STANDSTILL, ends.TURN, ends.REST):
            raise self._interruption(motion)
        return SectionReturn(motion.end, self.end_of(motion), motion.t_end - motion.t_start)

    def _interruption(self, motion: Motion) -> MotionEnded:
        loads = partial(undefined_loads, self.system.compiled, motion)
        return MotionEnded(motion.end, motion.t_end - motion.t_start, loads)

    def change(self, kind: str, ways: int = 1) -> Callable[..., Floats]:
        """The map that says what ways of a kind change of a state; NaN where it goes others."""

        def changed(x: Floats, tolerance: float = FLOWS) -> Floats:
            at = x
            for _ in range(ways):
                passage = self.passage(at, tolerance)
                if passage.kind != kind:
                    return np.full(x.size, math.nan)
                at = passage.x
            return at - x

        return changed

    def once(self, x: Floats, until: Until, accuracy: float | None = None) -> Motion:
        """The motion from a state with its error, by default as a period that is to repeat."""
        request = self._request(x, until)
        method = request.method if request.method in INTEGRATORS and not accuracy else "dop853"
        finer = accuracy or (request.accuracy or TARGET) / 10  # the gain of the map enlarges it
        system = self.system
        if self.layout.initial:
            system = replace(system, begin=tuple(x[self.layout.signals].tolist()))
        return _uninterrupted(integrate(system, replace(request, accuracy=finer), method))


def _uninterrupted(motion: Motion) -> Motion:
    """A motion; what stopped it stops the search that asked for it."""
    if motion.end == ends.INTERRUPTED:
        raise KeyboardInterrupt
    if motion.end == ends.BUDGET:
        raise ends.BudgetSpent
    return motion


def _periods(system: System) -> list[float | None]:
    """Period of all that depends on each driver's coordinate, of one but for signals."""
    structure, drivers = system.compiled.structure, system.drivers
    if len(drivers) == 1:
        if system.period is not None or not system.signals.blocks:
            return [system.period]
        elements = {
            name: element
            for name, element in structure.elements.items()
            if element.counted is None or element.counted.driver
        }
        structure = replace(structure, elements=elements)
    return [loads.period_of(structure, driver) for driver in drivers]


class Orbit(NamedTuple):
    """A periodic motion under loads that repeat, from where a period of them begins."""

    point: FixedPoint
    periods: int  # of the loads in one of it
    reached: bool  # to come from the start


class Stroboscope:
    """The state after a period T of the loads, and its fixed points.

    cyclic : drivers on whose coordinates nothing depends; free : parts that must repeat
    """

    def __init__(self, flow: Flow, T: float) -> None:
        self.flow, self.T = flow, T
        for t in np.linspace(0.0, 0.9 * T, SETTLING).tolist():
            now, later = flow.acceleration(flow.x, t), flow.acceleration(flow.x, t + T)
            largest = float(np.abs([now, later]).max()) + flow.speed**2
            if not np.abs(later - now).max() <= SETTLED * largest:
                raise no_steady(f"the loads are not the same again after {T:.9g} s", GIVE)
        self.cyclic = [i for i in range(flow.k) if self._is_cyclic(i)]
        self.free = [i for i in range(flow.layout.work) if i not in self.cyclic]

    def _is_cyclic(self, i: int) -> bool:
        flow, rate = self.flow, self.flow.layout.rate
        x = flow.x.copy()
        x[rate] += flow.size[rate]
        radian = flow.system.span / math.tau * np.eye(1, x.size, i)[0]  # or as much of a slide
        acceleration = flow.acceleration(x)
        shifted = [flow.acceleration(x + j * radian) for j in (1, 2, 3)]
        return bool(
            np.abs(np.array(shifted) - acceleration).max()
            <= SETTLED * (np.abs(acceleration).max() + EPS)
        )

    def away(self, x: Floats, second: Floats) -> float:
        """How far two states are apart, relative to a motion's size."""
        return float(np.abs(self.flow.wrapped(second - x) / self.flow.size)[self.free].max())

    def orbits(self) -> Iterator[Orbit]:
        """Orbits near the start and near what it settles to."""
        x = self.flow.x
        if self.away(x, self.flow.after(x, self.T, FLOWS)) <= SETTLED / 100:
            yield from self._orbits_near(x, (1,))
        for _ in range(TIMES):
            for _ in range(SETTLING):
                x = self.flow.after(x, self.T)
            x[self.cyclic] = self.flow.x[self.cyclic]
            yield from self._orbits_near(x, PERIODS)

    def _orbits_near(self, x: Floats, periods: Sequence[int]) -> Iterator[Orbit]:
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
        if best is not None:
            return best
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
