"""What a motion settles to: rest or a periodic motion, found without waiting for it.

| the loads follow                | looked for by                                           |
|---------------------------------|---------------------------------------------------------|
| the time, and repeat            | the state after a period of them: stroboscopic map      |
| place and rate, one driver      | the next standstill or turn: return map                 |
| states of signals, one driver   | the same of turns, of the rate and the states at once   |
| place and rate, several drivers | the equilibrium at which it comes to rest               |
| the place alone                 | every motion is its own                                 |

Both maps are Poincare maps of the same flow in time; their fixed points are found in
`blockmech.dynamics.periodic`, the first of them stands in `blockmech.dynamics.forcing`. With one
driver orbits cannot cross, so a motion moves along its return map in one direction, to the next
fixed point there: the map is sampled ahead, further and further, until it points back.

Sources: Guckenheimer & Holmes, Nonlinear Oscillations, 1983, sections 1.5 and 1.8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from blockmech.dynamics import ends, loads
from blockmech.dynamics.equation import Equation, typical_motion
from blockmech.dynamics.estimate import TARGET
from blockmech.dynamics.events import watched
from blockmech.dynamics.forcing import (
    COMMON,
    ELSEWHERE,
    INWARD,
    SETTLING,
    TIMES,
    MotionEnded,
    Orbit,
    Stroboscope,
    forcing_period,
    no_steady,
    unfound,
)
from blockmech.dynamics.path import along_path
from blockmech.dynamics.periodic import (
    FLOWS,
    NONE,
    QUOTIENT,
    Equilibrium,
    FixedPoint,
    equilibrium_near,
    fixed_point,
    repeated,
    resting,
)
from blockmech.dynamics.request import SimulationRequest, Start, Until, Watch
from blockmech.dynamics.rest import failed_start
from blockmech.dynamics.run import INTEGRATORS
from blockmech.dynamics.singular import what_is_ahead
from blockmech.dynamics.time import TimeIntegration, in_time
from blockmech.ground.errors import listed
from blockmech.result.motion import Floats, Motion

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

LOOSE = 1e-8  # tolerance of the flow by which a motion is followed
SMALL = 1e-4  # amplitude, relative to the span or to that of the start, that counts as rest
FAR = 1e4  # spans that a driver without turns may go without a standstill, or a search
OWN = "all loads depend on the coordinate alone, so every motion is its own, and none attracts"
FAMILY = (
    "no load dissipates, so every motion near by is periodic too: this is the one from the "
    "start, and disturbances neither grow nor fade"
)
TURNS_ALONE = "under signals only turns are looked for"
CYCLIC = (
    "nothing depends on the coordinate of a driver: its rate repeats, and the coordinate advances "
    "by what it advances in a period"
)


def steady_motion(system: System, request: SimulationRequest) -> Motion:
    """The steady state to which the motion from the start settles.

    Raises `RequestError` where none exists or none was found, with the reason.
    """
    depends, several = system.depends_on, len(system.drivers) > 1
    if depends <= {"q"} and system.friction is None and not several:
        if request.method not in ("auto", "energy"):
            raise no_steady(OWN, 'use method "auto" or "energy"')
        why = "all loads depend on the driver's coordinate alone"
        explained = replace(request, why=why)
        motion = failed_start(system, explained) or along_path(system, explained)
        return watched(_conserved(motion, request), request.watch)
    follow = sorted(depends - {"q"}) or ["joint friction"]
    request = replace(request, why=request.why or f"the loads depend on {listed(follow)}")
    flow = Flow(system, request)
    states = bool(flow.layout.initial)
    steady = _forced(flow) if "time" in depends else (_turning if states else _settled)(flow)
    if several and request.watch:
        note = "events are not looked for along the steady motion of several drivers"
        return replace(steady, notes=(*steady.notes, note))
    return steady if several else watched(steady, request.watch)


def _conserved(motion: Motion, request: SimulationRequest) -> Motion:
    """The motion by ``energy`` from the start, if it repeats: its first period."""
    if motion.status == "failed" or motion.end in ends.STOPPED:
        return motion
    if motion.regime == "rest":
        return replace(motion, status="reached", end="steady")
    period = motion.facts.get("period")
    if period is not None:
        last = motion.t_start + period
        q, qd = (float(x[0]) for x in motion.track.state(np.array([last])))
        turned = q - request.start.q if motion.regime == "rotation" else 0.0
        once = replace(motion, t_end=last, q_end=q, qd_end=qd)
        point = FixedPoint(np.array([q - turned, qd]), np.ones(1), 1.0)
        notes, facts = (*motion.notes, FAMILY), motion.facts
        shift = np.array([turned])
        steady = repeated(point, once, shift, request, motion.method, notes, **facts)
        events = tuple(e for e in motion.events if e.t <= last)
        return replace(steady, why=motion.why, regime=motion.regime, events=events)
    work = motion.facts.get("work_per_period")
    if work is not None:
        raise no_steady(
            f"{motion.regime}: over {motion.facts['period_of_loads']:.9g} rad the loads do a work "
            f"of {work:.9g} J, whatever the speed, so that changes from turn to turn",
            'add a damper or a motor curve, or ask for "time=<s>"',
        )
    raise no_steady(
        f"the motion from the start ends by itself ({motion.end}) after {motion.t_end:.9g} s, "
        "so nothing repeats"
    )


# -- flows ---------------------------------------------------------------------------------


class SectionReturn(NamedTuple):
    """A way to the next standstill, through a whole turn, or to rest under joint friction."""

    kind: str  # ends.STANDSTILL, ends.TURN or ends.REST
    x: Floats
    time: float


class Gone(Watch):
    """An event of our own, whose surface takes arrays."""

    arrays = True


@dataclass
class Flow:
    """Motions of a system from any state (2k,), without an estimate of their errors.

    Behind coordinates and rates stand those of signal blocks, where there are some.
    """

    system: System
    request: SimulationRequest
    name: str = "return map"
    equation: Equation = field(init=False)

    def __post_init__(self) -> None:
        start, span = self.request.start, self.system.span
        self.k = len(self.system.drivers)
        self.period = _period(self.system)
        self.equation = Equation(self.system, start.q)
        self.layout = self.equation.layout
        self.x = self._parts(self.layout.start(start.q, start.rate))
        if self.system.friction is not None:
            self.equation.sides = self.system.friction.slipping(self.x[:1], np.ones(1))
        self.speed = typical_motion(self.equation, start.t, self._whole(self.x))[0]
        # of the parts of a state
        self.size = np.append(np.repeat([min(span, 1.0), self.speed], self.k), self._sizes(self.x))
        if not np.isfinite(self.acceleration(self.x)).all():
            why = what_is_ahead(self.equation, start.t, self._whole(self.x)).end
            raise no_steady(f"{why} at the start", "start elsewhere")

    def acceleration(self, x: Floats, later: float = 0.0) -> Floats:
        """q'' (k,) at a state, some time [s] after the start."""
        return self._slope(x, later)[self.layout.rate]

    def _slope(self, x: Floats, later: float = 0.0) -> Floats:
        slope = self.equation(self.request.start.t + later, self._whole(x))
        return np.asarray(slope, dtype=np.float64)

    def repeats(self, x: Floats, period: float) -> bool:
        """Whether signals do the same a period on, whatever they read."""
        here, there = (self._slope(x + at * (np.arange(x.size) < 1)) for at in (0.0, period))
        return bool(np.abs(there - here).max() <= NONE * np.abs(here).max())

    def _whole(self, x: Floats) -> Floats:
        """A state of the maps as one of the integration."""
        y = self.layout.start(*self.layout.motion(x))
        y[self.layout.signals] = x[self.layout.moving :]
        return y

    def _parts(self, y: Floats) -> Floats:
        """A state of the integration as one of the maps."""
        return np.append(y[: self.layout.moving], y[self.layout.signals])

    def _sizes(self, x: Floats) -> Floats:
        """Sizes (n,) of the states of signal blocks."""
        return np.maximum(np.abs(x[self.layout.moving :]), self.system.signals.sizes)

    def request_from(
        self, x: Floats, until: Until, watch: Sequence[Watch] = ()
    ) -> SimulationRequest:
        """A request for a motion from a state."""
        start = Start(*self.layout.motion(x), self.request.start.t)
        return replace(self.request, start=start, until=until, watch=tuple(watch), times=())

    def run(self, request: SimulationRequest, x: Floats, tolerance: float) -> Motion:
        """One integration from a state."""
        own = request.method in INTEGRATORS and tolerance > FLOWS
        method, rest = request.method if own else "dop853", SMALL * self.system.span
        run = TimeIntegration(self.system, request, method, tolerance, self.name, rest)
        run.y = self._whole(x)
        motion = run.motion()
        return _whole(motion)

    def after(self, x: Floats, time: float, tolerance: float = LOOSE) -> Floats:
        """The state some time [s] later."""
        if not (np.abs(x - self.x) <= FAR * self.size).all():  # a root search went astray
            raise MotionEnded("a way without end")
        motion = self.run(self.request_from(x, Until("time", time)), x, tolerance)
        if motion.end != "time":
            raise MotionEnded(motion.end, motion.t_end - motion.t_start)
        return np.append(motion.q_end, motion.qd_end)

    def passage(self, x: Floats, tolerance: float = LOOSE) -> SectionReturn:
        """The way of one driver to the next standstill or whole turn."""
        begin, period = float(x[0]), self.period
        stopped = any(map(math.isfinite, self.system.stops[0]))
        far = FAR * self.system.span if stopped or period is None else period

        def gone(t: Any, q: Any, qd: Any) -> Any:
            return np.abs(q - begin) - far

        request = self.request_from(x, Until("standstill"), [Gone(ends.TURN, gone)])
        motion = self.run(request, x, tolerance)
        time = motion.t_end - motion.t_start
        if motion.end == ends.TURN and far != period:
            raise MotionEnded("a way without end")
        if motion.end not in (ends.STANDSTILL, ends.TURN, ends.REST):
            raise MotionEnded(motion.end, time)
        there = np.array([motion.q_end, motion.qd_end, *motion.x_end])
        return SectionReturn(motion.end, there, time)

    def once(self, x: Floats, until: Until) -> Motion:
        """A period of a periodic motion, with its error."""
        request = self.request_from(x, until)
        own = request.method if request.method in INTEGRATORS else "dop853"
        finer = (request.accuracy or TARGET) / 10  # the gain of the map enlarges it
        system = self.system
        if self.layout.initial:
            system = replace(system, begin=tuple(x[self.layout.moving :].tolist()))
        motion = in_time(system, replace(request, accuracy=finer), own)
        return _whole(motion)


def _whole(motion: Motion) -> Motion:
    """A motion; what stopped it stops the search that asked for it."""
    if motion.end == ends.INTERRUPTED:
        raise KeyboardInterrupt
    if motion.end == ends.BUDGET:
        raise ends.BudgetSpent
    return motion


def _period(system: System) -> float | None:
    """Period of all that depends on the only driver's coordinate, but for signals."""
    structure = system.compiled.structure
    if system.period is not None or not structure.signals or len(system.drivers) > 1:
        return system.period
    elements = {
        name: element
        for name, element in structure.elements.items()
        if element.counted is None or element.counted.driver
    }
    return loads.period_of(replace(structure, elements=elements), system.drivers[0])


# -- loads of the time ---------------------------------------------------------------------


def _forced(flow: Flow) -> Motion:
    """A periodic motion under loads of the time, after some periods of flow."""
    flow.name = "stroboscopic map"
    forcing = flow.request.until.forcing
    map_ = Stroboscope(flow, forcing_period(flow.system.compiled.structure, forcing))
    best: Orbit | None = None
    try:
        for orbit in map_.orbits():
            best = orbit if best is None or orbit.point.kind == "stable" else best
            if orbit.point.kind != "unstable":
                break
    except MotionEnded as lost:
        raise lost.after(0.0) from None
    if best is None:
        raise unfound(map_)
    return _forced_motion(flow, map_, best)


def _forced_motion(flow: Flow, map_: Stroboscope, orbit: Orbit) -> Motion:
    """The motion of an orbit; a driver that goes on for ever must not come to a stop."""
    point = orbit.point
    once = flow.once(point.x, Until("time", orbit.periods * map_.T))
    step = np.append(once.q_end, once.qd_end) - point.x
    whole = step - map_.wrapped(step)
    whole[map_.cyclic] = step[map_.cyclic]
    shift = whole[: flow.k]
    for i in map_.cyclic:
        stopped = any(map(math.isfinite, flow.system.stops[i]))
        if stopped and abs(shift[i]) > 10 * point.gain * once.error:
            raise no_steady(
                f"the rate repeats, but the driver advances by {abs(shift[i]):.6g} in every "
                f"{once.t_end - once.t_start:.9g} s and comes to an end stop",
                ELSEWHERE,
            )
    settles = orbit.seen and point.kind == "stable"
    notes = [f"the motion from the start {'settles to it' if settles else 'was not seen there'}"]
    notes += [CYCLIC] if map_.cyclic else []
    periods = {"periods_of_the_loads": float(orbit.periods)}
    return repeated(point, once, shift, flow.request, flow.name, notes, **periods)


# -- states of signals -------------------------------------------------------------------------


def _turning(flow: Flow) -> Motion:
    """What a driver under signals settles to that turns on and on.

    A turn maps rate and states to those after it: several numbers, so it is let settle before the
    root of what a turn changes is looked for.
    """
    x, clock, last = flow.x, 0.0, math.inf
    period = flow.period
    if period is None or not flow.repeats(flow.x, period):
        raise no_steady(f"nothing repeats after a turn; {TURNS_ALONE}")
    try:
        for _ in range(TIMES * SETTLING):
            way = flow.passage(x)
            off = np.abs((way.x - x) / flow.size)[1:].max() if way.kind == ends.TURN else math.inf
            x, clock, before, last = way.x, clock + way.time, last, float(off)
            flow.size[flow.layout.moving :] = flow._sizes(x)
            if way.kind == ends.REST:
                raise MotionEnded(ends.REST)
            if last <= SMALL or before <= last < INWARD:  # settled, or as near as it comes
                shift = math.copysign(period, float(x[1]))
                x[0] = flow.x[0] + math.remainder(float(x[0] - flow.x[0]), period)
                if (point := _turn_of(flow, x, shift)) is not None:
                    once = flow.once(point.x, Until("turns", period / math.tau))
                    notes = (f"found from the speed {x[1]:.6g} at the start of a turn",)
                    return repeated(point, once, np.array([shift]), flow.request, flow.name, notes)
    except MotionEnded as lost:
        if lost.end != "time":
            raise lost.after(clock) from None
        raise no_steady(f"it turns no more after {clock:.6g} s; {TURNS_ALONE}", ELSEWHERE) from None
    why = f"the motion from the start has not settled after {clock:.6g} s"
    raise no_steady(f"{why}; {TURNS_ALONE}", ELSEWHERE)


def _turn_of(flow: Flow, x: Floats, shift: float) -> FixedPoint | None:
    """The turn near a state that leaves rate and states as they are."""

    def change(state: Floats) -> Floats:
        passage = flow.passage(state, FLOWS)
        if passage.kind != ends.TURN:
            return np.full(state.size, math.nan)
        step = passage.x - state
        step[0] -= shift
        return step

    return fixed_point(change, x, range(1, x.size), flow.size)


# -- loads of place and rate ---------------------------------------------------------------


def _settled(flow: Flow) -> Motion:
    """What loads of place and rate settle to: rest; with one driver also swings and turns."""
    x, several, clock = _left_if_unstable(flow), flow.k > 1, 0.0
    try:
        for _ in range(2 * SETTLING):
            rest = _rest_at(flow, x)
            if rest is not None:
                return rest
            if several:
                time = flow.system.span / flow.speed * math.tau
                x, clock = flow.after(x, time), clock + time
                continue
            way = flow.passage(x)
            steady = _friction_rest(flow, way) or _cycle_from(flow, x, way)
            if steady is not None:
                return steady
            x, clock = way.x, clock + way.time
    except MotionEnded as lost:
        raise lost.after(clock) from None
    others = "; with several drivers only rest, and motions under loads that repeat in time, are"
    raise no_steady(
        f"the motion from the start has not settled after {clock:.6g} s"
        + (f"{others} looked for" if several else ""),
        ELSEWHERE,
    )


def _left_if_unstable(flow: Flow) -> Floats:
    """The start, or a state beside it if it is an unstable equilibrium."""
    equilibrium = equilibrium_near(flow.acceleration, flow.x[: flow.k], flow.size)
    if flow.system.friction is not None or equilibrium is None or equilibrium.kind != "unstable":
        return flow.x
    if np.abs(np.append(equilibrium.q, np.zeros(flow.k)) - flow.x).max() > 2 * equilibrium.error:
        return flow.x
    note = "started beside the unstable equilibrium of the start"
    flow.request = replace(flow.request, why=f"{flow.request.why}; {note}")
    return flow.x + QUOTIENT * flow.size * (np.arange(2 * flow.k) < flow.k)


def _at_rest(flow: Flow, equilibrium: Equilibrium) -> Motion:
    facts, note = equilibrium.described()
    return resting(flow.request, equilibrium.q, equilibrium.error, "equilibrium", facts, note)


def _rest_at(flow: Flow, x: Floats) -> Motion | None:
    """Rest, if a state will stay at the equilibrium beside it; where no load dissipates, is it."""
    k, lossless = flow.k, flow.system.depends_on <= {"q"}
    if flow.system.friction is not None or (k == 1 and x[1] != 0):
        return None
    equilibrium = equilibrium_near(flow.acceleration, x[:k], flow.size)
    if equilibrium is not None and equilibrium.kind != "unstable":
        away = float(np.abs((np.append(equilibrium.q, np.zeros(k)) - x) / flow.size).max())
        if away <= (2 * equilibrium.error if lossless else SMALL):
            return _at_rest(flow, _stopping(flow, x, equilibrium))
    if lossless:
        raise no_steady(
            "no load dissipates, and with several drivers a motion without losses does not "
            "repeat in general",
            'add a damper, or ask for "time=<s>"',
        )
    return None


def _stopping(flow: Flow, x: Floats, equilibrium: Equilibrium) -> Equilibrium:
    """An equilibrium; of indifferent ones the place where the motion from the start stops."""
    if equilibrium.kind != "indifferent" or (x == flow.x).all():
        return equilibrium
    if flow.k > 1:
        return equilibrium._replace(q=x[: flow.k], error=SMALL * flow.system.span)
    request = replace(flow.request_from(flow.x, Until("standstill")), accuracy=FLOWS)
    motion = in_time(flow.system, request, "dop853")
    return equilibrium._replace(q=np.array([motion.q_end]), error=motion.error)


def _friction_rest(flow: Flow, way: SectionReturn) -> Motion | None:
    """Where joint friction holds the driver, by the motion from the start itself."""
    swings_out = flow.system.friction is not None and flow.system.depends_on <= {"q"}
    if way.kind != ends.REST and not (swings_out and way.kind == ends.STANDSTILL):
        return None
    request = replace(flow.request, until=Until("swings", float(COMMON)), watch=())
    motion = in_time(flow.system, request, "dop853")
    if motion.end != ends.REST:
        return None
    facts = {name: x for name, x in motion.facts.items() if name.startswith("holding")}
    note = "at rest where joint friction holds it"
    return resting(flow.request, np.array([motion.q_end]), motion.error, motion.method, facts, note)


def _cycle_from(flow: Flow, x: Floats, way: SectionReturn) -> Motion | None:
    """The fixed point of the return map to which a motion moves, as a motion; or None.

    Between standstills the map takes the place of one to the next on the same side, between
    turns the rate at the begin of one to that of the next.
    """
    swings = way.kind == ends.STANDSTILL
    if swings != (x[1] == 0):
        return None
    begin, free, centre = x.copy(), 0 if swings else 1, None
    if swings:
        centre = equilibrium_near(flow.acceleration, (x[:1] + way.x[:1]) / 2, flow.size)
        if centre is None or not abs(way.x[0] - x[0]) > abs(centre.q[0] - x[0]) > 0:
            return None
    elif flow.system.period is not None:  # a turn begins where the start is, if it can
        off = math.remainder(float(x[0] - flow.x[0]), flow.system.period)
        begin[0] = flow.x[0] + (off if abs(off) > NONE else 0.0)
    anchor = 0.0 if centre is None else float(centre.q[0])

    def change(state: Floats, tolerance: float = FLOWS) -> Floats:
        at = state
        for _ in range(2 if swings else 1):
            passage = flow.passage(at, tolerance)
            if passage.kind != way.kind:
                return np.full(2, math.nan)
            at = passage.x
        return at - state

    def ahead(z: float) -> float:
        begin[free] = z
        return float(change(begin, LOOSE)[free])

    near = _ahead(ahead, float(x[free]), anchor)
    if near is None:
        return None
    if near == anchor:
        return None if centre is None or centre.kind == "unstable" else _at_rest(flow, centre)
    begin[free] = near
    point = fixed_point(change, begin, [free], np.full(2, abs(near - anchor)))
    if point is None:
        return None
    period = flow.system.period or 0.0
    until = Until("swings", 2.0) if swings else Until("turns", period / math.tau)
    shift = np.array([0.0 if swings else math.copysign(period, near)])
    notes = () if swings else (f"found from the speed {near:.6g} at the start of a turn",)
    return repeated(point, flow.once(point.x, until), shift, flow.request, flow.name, notes)


def _ahead(change: Callable[[float], float], z: float, anchor: float) -> float | None:
    """Near the fixed point to which a map moves z; the anchor if that is all there is.

    None where the map ends before, as swings become turns, or turns swings.
    """
    first = change(z)
    if abs(first) <= LOOSE * abs(z - anchor):
        return z
    inward = first * (z - anchor) < 0
    factor, end = (INWARD, SMALL) if inward else (1 / INWARD, 1 / SMALL)
    share, last = 1.0, z
    while (share > end) is inward:
        share *= factor
        following = anchor + share * (z - anchor)
        there = change(following)
        if math.isnan(there):
            return None
        if there * first <= 0:
            return float(brentq(change, last, following, rtol=LOOSE))
        last = following
    if not inward:
        raise MotionEnded("swings or turns that grow without bound")
    return anchor
