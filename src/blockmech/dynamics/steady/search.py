"""Where to look for the steady state of a scene, and what to say if there is none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.integration.equation import (
    Equation,
    one_driver,
    several_drivers,
)
from blockmech.dynamics.integration.integrate import Method
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.rest import trouble
from blockmech.dynamics.steady.autonomous import RETURNS, collocated, settled
from blockmech.dynamics.steady.flow import Flow
from blockmech.dynamics.steady.forcing import GIVE, repeats
from blockmech.dynamics.steady.outcome import ELSEWHERE, Lost, Spent, an, no_steady
from blockmech.dynamics.steady.report import (
    cycle_in_words,
    named_others,
    of_cycle,
    of_rest,
)
from blockmech.dynamics.steady.settling import resting_place
from blockmech.dynamics.steady.shooting import Cycle
from blockmech.dynamics.steady.stroboscope import Stroboscope
from blockmech.dynamics.system.reduced import Metered, MeteredSystems, ReducedSystem, ReducedSystems
from blockmech.dynamics.until import Asked

TABLE = 1e-12  # error of the reduced table
MOST = {"table": 400_000, "kernels": 150_000}  # evaluations of a search
MORE = 1 / 3  # of them for other steady states, which are only named
UNWATCHED = "events are not looked for along the steady motion of several drivers"
STROBOSCOPE = "stroboscopic map"
OWN = "all loads depend on the coordinate alone, so every motion is its own, and none attracts"
CYCLIC = (
    "nothing depends on the coordinate of a driver: its rate repeats, and the coordinate advances "
    "by what it advances in a period"
)


def steady_motion(meter: Metered, asked: Asked, method: str = "auto") -> Motion:
    """The steady state of one driver: periodic, or at rest.

    Of several the one to which the motion from the start settles; others are named in
    the notes. ``method``: "auto", "spectral" (collocation only) or an integrator.

    Raises `RequestError` where none exists or none was found, with the reason.
    """
    start = asked.start
    reason = trouble(meter.one(start.q, start.rate, start.t))
    if reason:
        raise no_steady(f"{reason} at the start", "start elsewhere")
    if meter.system.depends_on <= {"q"}:
        raise no_steady(OWN, 'use method "auto" or "energy"')
    with np.errstate(all="ignore"):
        if method == "spectral":
            return collocated(meter, asked)
        forced = "time" in meter.system.depends_on
        how = STROBOSCOPE if forced else RETURNS
        span = _period_of(meter.system, asked) if forced else 0.0
        equation = one_driver(meter, start.q, start.rate, start.t, TABLE, span)
        flow = _flow(equation, meter.system, asked, method, how, meter.system.time_knots)
        found = _forced(meter, asked, flow) if forced else settled(meter, asked, flow, method)
    return replace(found, cost=meter.cost)


def steady_motions(
    meter: MeteredSystems, q0: Floats, qd0: Floats, asked: Asked, method: str = "auto"
) -> Motion:
    """The steady state of several drivers: a forced periodic motion, or rest."""
    systems = meter.systems
    forced = "time" in systems.depends_on
    with np.errstate(all="ignore"):
        equation = several_drivers(meter, q0, qd0, asked.start.t)
        how = STROBOSCOPE if forced else "equilibrium"
        flow = _flow(equation, None, asked, method, how, systems.time_knots)
        flow.ends = tuple(w for w in asked.watches if w.name.startswith(END_STOP))
        x = np.concatenate([q0, qd0])
        k = q0.size
        turns = np.array(k * (0.0,) if flow.ends else systems.periods or k * (0.0,))
        if forced:
            T = _period(flow, x, _period_of(systems, asked))
            seen = Stroboscope(flow, T, turns, (turns > 0).tolist(), 1.0)
            found = _stroboscoped(seen, x, (), asked, bool(flow.ends))
        else:
            lossless = systems.depends_on <= {"q"}
            found = _rested(flow, x, asked, lossless)
    if len(asked.watches) > len(flow.ends):
        found = replace(found, notes=(*found.notes, UNWATCHED))
    return replace(found, cost=meter.cost)


def _flow(
    equation: Equation,
    system: ReducedSystem | None,
    asked: Asked,
    method: str,
    how: str,
    knots: tuple[float, ...],
) -> Flow:
    integrator: Method = method if method in ("lsoda", "radau") else "dop853"  # type: ignore[assignment]
    most = MOST[equation.source]
    return Flow(equation, system, integrator, asked.start.t, knots, most, how, asked.progress)


# -- loads of the time -----------------------------------------------------------------------


def _period_of(system: ReducedSystem | ReducedSystems, asked: Asked) -> float:
    return system.time_period or asked.until.forcing


def _period(flow: Flow, x: Floats, period: float) -> float:
    """The period of the loads [s], looked at once more."""
    if not period:
        raise no_steady("the loads follow the time, and their period is not known", GIVE)
    y = np.append(x, 0.0)
    if not repeats(flow.equation, (y, y + 0.1), flow.t0, period):
        raise no_steady(f"the loads are not the same again after {period:.9g} s", GIVE)
    return period


def _forced(meter: Metered, asked: Asked, flow: Flow) -> Motion:
    start, system = asked.start, meter.system
    x = np.array([start.q, start.rate])
    rotary = system.kind == "rotation"
    stopped = any(map(math.isfinite, system.stops))
    turns = np.array([0.0 if stopped else system.period or 0.0])
    T = _period(flow, x, _period_of(system, asked))
    seen = Stroboscope(flow, T, turns, (rotary,), system.span)
    return _stroboscoped(seen, x, _other_starts(start.q, system, T), asked, stopped)


def _other_starts(q: float, system: ReducedSystem, T: float) -> list[Floats]:
    """At rest around a turn, or to both sides; and turning as fast as the loads repeat."""
    if not system.period:
        far = 0.2 * system.span
        return [np.array([q + way * far, 0.0]) for way in (-1, 1)]
    rest = [np.array([q + share * system.period, 0.0]) for share in (0.25, 0.5, 0.75)]
    fast = [np.array([q, way * system.period / T]) for way in (1, -1)]
    return [*rest, *fast]


def _advances(seen: Stroboscope, cycle: Cycle, stopped: bool) -> None:
    """Refuse a motion that goes on and on to where it is stopped."""
    far = max((abs(float(cycle.shift[i])) for i in seen.cyclic), default=0.0)
    if stopped and far > 10 * cycle.error:
        raise no_steady(
            f"the rate repeats, but the driver advances by {far:.6g} in every {cycle.period:.9g} s "
            "and comes to an end stop",
            ELSEWHERE,
        )


def _stroboscoped(
    seen: Stroboscope, x: Floats, starts: Sequence[Floats], asked: Asked, stopped: bool
) -> Motion:
    """The periodic motion from a start, else from other starts; the others in notes."""
    flow, lost, settled, ended = seen.flow, "", None, False
    try:
        settled = seen.found(x)
        if settled is None:
            lost = "the motion from the start was not seen to settle"
        elif not settled.cycle.stable and not settled.there:
            lost = "the motion from the start does not settle to it, nor to a stable one found"
        elif not settled.reached:
            lost = "the motion from the start was not seen to come to this one"
    except Lost as found:
        lost = _ended(found)
        ended = True
    except Spent:
        lost = f"the motion from the start was not seen to settle in {flow.most} evaluations"
    flow.most = flow.used + round(MORE * MOST[flow.equation.source])
    known = [settled.cycle] if settled is not None else []
    starts = () if seen.cyclic else starts
    others = seen.others(starts, known)
    if starts:
        seen.tried.append(f"{len(starts)} other starts")
    if ended and not others:
        more = f", and {len(starts)} other starts lead to none" if starts else ""
        raise no_steady(f"{lost}{more}", ELSEWHERE)
    if settled is None and not others:
        raise no_steady(
            f"no periodic motion was found; it may be chaotic, or have a period of its own beside "
            f"that of the loads; tried: {'; '.join(seen.tried)}",
            ELSEWHERE,
        )
    every = [*known, *others]
    stable = [cycle for cycle in every if cycle.stable]
    chosen: Cycle = every[0] if every[0].stable or not stable else stable[0]
    _advances(seen, chosen, stopped)
    told = [lost] if lost else ["the motion from the start settles to it"]
    if settled is not None and settled.there:
        told = ["the loads follow the time alone: this is the motion from the start"]
    if seen.cyclic:
        told.append(CYCLIC)
    if chosen is not every[0] or settled is None:
        told.append("found from another start")
    rest = [cycle_in_words(cycle) for cycle in every if cycle is not chosen]
    return of_cycle(chosen, asked, STROBOSCOPE, (*told, *named_others(rest)))


def _ended(lost: Lost) -> str:
    return f"the motion from the start ends in {an(lost.end)} after {lost.t:.6g} s"


# -- several drivers -------------------------------------------------------------------------


def _rested(flow: Flow, x: Floats, asked: Asked, lossless: bool) -> Motion:
    scale = np.ones(flow.drivers)
    try:
        rest = resting_place(flow, x, scale, wait=not lossless)
    except Lost as lost:
        raise no_steady(_ended(lost)) from None
    except Spent:
        raise no_steady(
            f"the motion from the start was not at rest after {flow.used} evaluations; with "
            "several drivers only rest, and motions under loads that repeat in time, are looked "
            "for"
        ) from None
    if rest is None:
        raise no_steady(
            "no load dissipates, and with several drivers a motion without losses does not repeat "
            "in general",
            'add a damper, or ask for "time=<s>"',
        )
    return of_rest(rest, asked, ())
