"""What a motion settles to: rest or a periodic motion, found without waiting for it.

| the loads follow                | looked for by                                           |
|---------------------------------|---------------------------------------------------------|
| the time, and repeat            | the state after a period of them: stroboscopic map      |
| place and rate, one driver      | the next standstill or turn: return map                 |
| states of signals, one driver   | the same of turns, of the rate and the states at once   |
| place and rate, several drivers | the equilibrium at which it comes to rest               |
| the place alone                 | every motion is its own                                 |

Both maps are Poincare maps of the same flow in time; their fixed points are found in
`blockmech.dynamics.periodic`, the first of them stands in `blockmech.dynamics.flows`. With one
driver orbits cannot cross, so a motion moves along its return map in one direction, to the next
fixed point there: the map is sampled ahead, further and further, until it points back.

Sources: Guckenheimer & Holmes, Nonlinear Oscillations, 1983, sections 1.5 and 1.8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from blockmech.dynamics import ends
from blockmech.dynamics.estimate import LOOSE
from blockmech.dynamics.events import watched
from blockmech.dynamics.flows import (
    INWARD,
    SETTLING,
    SMALL,
    TIMES,
    Flow,
    MotionEnded,
    SectionReturn,
    Stroboscope,
)
from blockmech.dynamics.path import integrate_by_quadrature
from blockmech.dynamics.periodic import (
    COMMON,
    ELSEWHERE,
    FLOWS,
    QUOTIENT,
    Equilibrium,
    FixedPoint,
    equilibrium_near,
    fixed_point,
    forcing_period,
    no_steady,
    repeated,
    resting,
)
from blockmech.dynamics.request import SimulationRequest, Until
from blockmech.dynamics.rest import failed_start
from blockmech.dynamics.time import integrate
from blockmech.ground.errors import listed
from blockmech.result.motion import Motion
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

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
        explained = replace(request, why="all loads depend on the driver's coordinate alone")
        motion = failed_start(system, explained) or integrate_by_quadrature(system, explained)
        return watched(_conserved(motion, request), request.watch)
    follow = sorted(depends - {"q"}) or ["joint friction"]
    request = replace(request, why=request.why or f"the loads depend on {listed(follow)}")
    flow = Flow(system, request)
    search = _turning if flow.layout.initial else _settled
    steady = (_forced if "time" in depends else search)(flow)
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
        steady = repeated(point, once, np.array([turned]), request, motion.method, notes, **facts)
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


def _periodic(
    flow: Flow,
    point: FixedPoint,
    until: Until,
    *notes: str,
    cyclic: Sequence[int] = (),
    **facts: float,
) -> Motion:
    """The motion of a fixed point; a driver that goes on for ever must not come to a stop."""
    once = flow.once(point.x, until)
    step = flow.end_of(once) - point.x
    shift = step - flow.wrapped(step)
    shift[cyclic] = step[cyclic]
    for i in cyclic:
        stopped = np.isfinite(flow.system.stops[i]).any()
        if stopped and abs(shift[i]) > 10 * point.gain * once.error:
            raise no_steady(
                f"the rate repeats, but the driver advances by {abs(shift[i]):.6g} in every "
                f"{once.t_end - once.t_start:.9g} s and comes to an end stop",
                ELSEWHERE,
            )
    return repeated(point, once, shift[: flow.k], flow.request, flow.name, notes, **facts)


# -- loads of the time ---------------------------------------------------------------------


def _forced(flow: Flow) -> Motion:
    """A periodic motion under loads of the time, after some periods of flow."""
    flow.name, until = "stroboscopic map", flow.request.until
    map_ = Stroboscope(flow, forcing_period(flow.system.compiled.structure, until.forcing))
    try:
        point, periods, reached = map_.orbit()
    except MotionEnded as lost:
        raise lost.after(0.0) from None
    settles = reached and point.kind == "stable"
    notes = [f"the motion from the start {'settles to it' if settles else 'was not seen there'}"]
    notes += [CYCLIC] if map_.cyclic else []
    facts = {"periods_of_the_loads": float(periods)}
    until = Until("time", periods * map_.T)
    return _periodic(flow, point, until, *notes, cyclic=map_.cyclic, **facts)


# -- states of signals -------------------------------------------------------------------------


def _turning(flow: Flow) -> Motion:
    """What a driver under signals settles to that turns on and on.

    A turn maps rate and states to those after it: several numbers, so it is let settle before the
    root of what a turn changes is looked for.
    """
    x, clock, last, (period, *_) = flow.x, 0.0, math.inf, flow.periods
    if period is None or not flow.repeats(period):
        raise no_steady(f"nothing repeats after a turn; {TURNS_ALONE}")
    parts = flow.layout
    free = [1, *range(parts.signals.start, parts.size)]
    try:
        for _ in range(TIMES * SETTLING):
            passage = flow.passage(x)
            change = np.abs((passage.x - x) / flow.size)[free].max()
            x, clock, before = passage.x, clock + passage.time, last
            last = float(change) if passage.kind == ends.TURN else math.inf
            flow.measure(x)
            if passage.kind == ends.REST:
                raise MotionEnded(ends.REST)
            if last <= SMALL or before <= last < INWARD:  # settled, or as near as it comes
                x = flow.begin_of(x)
                point = fixed_point(flow.change(ends.TURN), x, free, flow.size)
                if point is not None:
                    return _turns(flow, point, period, x)
    except MotionEnded as lost:
        if lost.end != "time":
            raise lost.after(clock) from None
        raise no_steady(f"it turns no more after {clock:.6g} s; {TURNS_ALONE}", ELSEWHERE) from None
    why = f"the motion from the start has not settled after {clock:.6g} s"
    raise no_steady(f"{why}; {TURNS_ALONE}", ELSEWHERE)


def _turns(flow: Flow, point: FixedPoint, period: float, x: Floats) -> Motion:
    """The motion of a turn that was found from a state."""
    note = f"found from the speed {x[1]:.6g} at the start of a turn"
    return _periodic(flow, point, Until("turns", period / math.tau), note)


# -- loads of place and rate ---------------------------------------------------------------


def _settled(flow: Flow) -> Motion:
    """What loads of place and rate settle to: rest; with one driver also swings and turns."""
    x, several, clock = _leave_if_unstable(flow), flow.k > 1, 0.0
    try:
        for _ in range(2 * SETTLING):
            rest = _rest_at(flow, x)
            if rest is not None:
                return rest
            if several:
                time = flow.system.span / flow.speed * math.tau
                x, clock = flow.after(x, time), clock + time
                continue
            passage = flow.passage(x)
            steady = _friction_rest(flow, passage) or _cycle_from(flow, x, passage)
            if steady is not None:
                return steady
            x, clock = passage.x, clock + passage.time
    except MotionEnded as lost:
        raise lost.after(clock) from None
    remark = "; with several drivers only rest, and motions under loads that repeat in time, are"
    raise no_steady(
        f"the motion from the start has not settled after {clock:.6g} s"
        + (f"{remark} looked for" if several else ""),
        ELSEWHERE,
    )


def _leave_if_unstable(flow: Flow) -> Floats:
    """The start, or a state beside it if it is an unstable equilibrium."""
    equilibrium = _equilibrium(flow, flow.x)
    if flow.system.friction is not None or equilibrium is None or equilibrium.kind != "unstable":
        return flow.x
    if np.abs(flow.layout.start(equilibrium.q, 0.0) - flow.x).max() > 2 * equilibrium.error:
        return flow.x
    note = "started beside the unstable equilibrium of the start"
    flow.request = replace(flow.request, why=f"{flow.request.why}; {note}")
    return flow.x + QUOTIENT * flow.size * (np.arange(flow.x.size) < flow.k)


def _equilibrium(flow: Flow, x: Floats) -> Equilibrium | None:
    """The equilibrium near a state, signal blocks where they begin."""
    layout = flow.layout

    def acceleration(motion: Floats) -> Floats:
        return flow.acceleration(layout.start(*np.split(motion, 2)))

    return equilibrium_near(acceleration, x[layout.q], flow.size[: layout.work])


def _at_rest(flow: Flow, equilibrium: Equilibrium) -> Motion:
    facts, note = equilibrium.described()
    return resting(flow.request, equilibrium.q, equilibrium.error, "equilibrium", facts, note)


def _rest_at(flow: Flow, x: Floats) -> Motion | None:
    """Rest, if a state will stay at the equilibrium beside it; where no load dissipates, is it."""
    k, lossless = flow.k, flow.system.depends_on <= {"q"}
    if flow.system.friction is not None or (k == 1 and x[1] != 0):
        return None
    equilibrium = _equilibrium(flow, x)
    if equilibrium is not None and equilibrium.kind != "unstable":
        away = float(np.abs((flow.layout.start(equilibrium.q, 0.0) - x) / flow.size).max())
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
    motion = flow.once(flow.x, Until("standstill"), FLOWS)
    return equilibrium._replace(q=np.array([motion.q_end]), error=motion.error)


def _friction_rest(flow: Flow, passage: SectionReturn) -> Motion | None:
    """Where joint friction holds the driver, by the motion from the start itself."""
    swings_out = flow.system.friction is not None and flow.system.depends_on <= {"q"}
    if passage.kind != ends.REST and not (swings_out and passage.kind == ends.STANDSTILL):
        return None
    request = replace(flow.request, until=Until("swings", float(COMMON)), watch=())
    motion = integrate(flow.system, request, "dop853")
    if motion.end != ends.REST:
        return None
    facts = {name: x for name, x in motion.facts.items() if name.startswith("holding")}
    note = "at rest where joint friction holds it"
    return resting(flow.request, np.array([motion.q_end]), motion.error, motion.method, facts, note)


def _cycle_from(flow: Flow, x: Floats, passage: SectionReturn) -> Motion | None:
    """The fixed point of the return map to which a motion moves, as a motion; or None.

    Between standstills the map takes the place of one to the next on the same side, between
    turns the rate at the begin of one to that of the next.
    """
    swings = passage.kind == ends.STANDSTILL
    if swings != (x[1] == 0):
        return None
    begin, free, centre = x.copy(), 0 if swings else 1, None
    if swings:
        centre = _equilibrium(flow, (x + passage.x) / 2)
        if centre is None or not abs(passage.x[0] - x[0]) > abs(centre.q[0] - x[0]) > 0:
            return None
    else:
        begin = flow.begin_of(x)
    anchor = 0.0 if centre is None else float(centre.q[0])
    change = flow.change(passage.kind, 2 if swings else 1)

    def map_change(z: float) -> float:
        begin[free] = z
        return float(change(begin, LOOSE)[free])

    location = _scan_map(map_change, float(x[free]), anchor)
    if location is None:
        return None
    if location == anchor:
        return None if centre is None or centre.kind == "unstable" else _at_rest(flow, centre)
    begin[free] = location
    point = fixed_point(change, begin, [free], np.full(x.size, abs(location - anchor)))
    if point is None:
        return None
    if swings:
        return _periodic(flow, point, Until("swings", 2.0))
    return _turns(flow, point, flow.system.period or 0.0, begin)


def _scan_map(change: Callable[[float], float], z: float, anchor: float) -> float | None:
    """Near the fixed point to which a map moves z; the anchor if that is all there is.

    None where the map ends before, as swings become turns, or turns swings.
    """
    first = change(z)
    if abs(first) <= LOOSE * abs(z - anchor):
        return z
    inward = first * (z - anchor) < 0
    factor, end = (INWARD, SMALL) if inward else (1 / INWARD, 1 / SMALL)
    share, following, failure = 1.0, z, math.nan
    while (share > end) is inward:
        next_share = share * factor if math.isnan(failure) else (share + failure) / 2
        last, following = following, anchor + next_share * (z - anchor)
        try:
            value = change(following)
        except MotionEnded as lost:  # behind the end of a table, say: nearer
            following, failure = last, next_share
            lost.t = math.nan  # it is no time of the motion from the start
            if abs(failure - share) <= SMALL * share:
                raise
            continue
        if math.isnan(value):
            return None
        if value * first <= 0:
            return float(brentq(change, last, following, rtol=LOOSE))
        share = next_share
    if not inward:
        raise MotionEnded("swings or turns that grow without bound")
    return anchor
