"""What a motion settles to: rest or a periodic motion, found without waiting for it.

| the loads follow                | looked for by                                           |
|---------------------------------|---------------------------------------------------------|
| the time, and repeat            | the state after a period of them: stroboscopic map      |
| place and rate, one driver      | the next standstill or turn: return map                 |
| place and rate, several drivers | the equilibrium at which it comes to rest               |
| the place alone                 | every motion is its own                                 |

Both maps are flows of the same integration in time; their fixed points are roots (`scipy`).
With one driver orbits cannot cross, so a motion moves along its return map in one direction, to
the next fixed point there: the map is sampled ahead, further and further, until it points back.

Sources: Guckenheimer & Holmes, Nonlinear Oscillations, 1983, sections 1.5 and 1.8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, root

from blockmech.dynamics import loads
from blockmech.dynamics.equation import Equation, scales
from blockmech.dynamics.events import STANDSTILL, watched
from blockmech.dynamics.motion import (
    DEAD_CENTRE,
    END_STOP,
    IMPOSSIBLE,
    INTERRUPTED,
    REST,
    Floats,
    Motion,
)
from blockmech.dynamics.path import along_path
from blockmech.dynamics.periodic import (
    NEUTRAL,
    QUOTIENT,
    Cycle,
    at_rest,
    equilibrium_near,
    repeated,
    resting,
    slope,
)
from blockmech.dynamics.request import SimulationRequest, Start, Until, Watch
from blockmech.dynamics.time import SOLVERS, TARGET, Run, in_time
from blockmech.errors import Problem, RequestError, listed
from blockmech.loads.contract import Following
from blockmech.loads.laws import Polynomial
from blockmech.model.structure import Structure
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

TURN = 2 * math.pi
FINE, LOOSE = 1e-13, 1e-8  # tolerances of flows: for fixed points, and to follow a motion
SETTLING = 30  # periods of flow before a root is looked for (numerics 14)
TIMES = 3  # as often
PERIODS = (1, 2, 4)  # of the loads in one of the motion that are tried
PASSAGES = 60  # standstills and turns that are followed, or sampled ahead
INWARD, OUTWARD = 0.6, 1.25  # factors by which amplitudes or speeds are sampled ahead
INNERMOST = 1e-4  # of an amplitude: beside the equilibrium within
AT_REST = 1e-4  # distance from a stable equilibrium, in spans, that counts as rest
SAME = 1e-9  # relative difference of periods, or of loads a period later, that is rounding
COMMON = 1000  # periods of one load in the common one at most
FAR = 1e4  # spans that a driver without turns may go without a standstill, or a search
TIMED = 'ask for "time=<s>" to see how it goes on'
ELSEWHERE = f"start elsewhere, or {TIMED}"
GIVE = 'give the period of the loads: "steady=<s>"'
OWN = "all loads depend on the coordinate alone, so every motion is its own, and none attracts"
FAMILY = (
    "no load dissipates, so every motion near by is periodic too: this is the one from the "
    "start, and disturbances neither grow nor fade"
)
CYCLIC = (
    "nothing depends on the coordinate of a driver: its rate repeats, and the coordinate advances "
    "by what it advances in a period"
)


class Lost(Exception):
    """A motion ended on the way, by something named: "dead centre", "end stop" ..."""

    def __init__(self, end: str, t: float) -> None:
        super().__init__(end)
        self.end, self.t = end, t

    @property
    def words(self) -> str:
        """What the motion ends in, and when."""
        name = {
            IMPOSSIBLE: "an impossible pose, or where a load has no value,",
            DEAD_CENTRE: f"a {DEAD_CENTRE}",
            END_STOP: f"an {END_STOP}",
        }.get(self.end, f"the {self.end}" if self.end.startswith(END_STOP) else self.end)
        when = f" after {self.t:.6g} s" if math.isfinite(self.t) else ""
        return f"the motion from the start ends in {name}{when}"


def no_steady(why: str, remedy: str = TIMED) -> RequestError:
    """The error that says why there is no steady state, or why none was found."""
    return RequestError(Problem("until", "until", f'"steady": {why}', "", remedy))


def steady_motion(system: System, request: SimulationRequest) -> Motion:
    """The steady state to which the motion from the start settles.

    Raises `RequestError` where none exists or none was found, with the reason.
    """
    depends, several = system.depends_on, len(system.drivers) > 1
    lossless = depends <= {"q"} and system.friction is None
    if lossless and not several:
        if request.method not in ("auto", "energy"):
            raise no_steady(OWN, 'use method "auto" or "energy"')
        why = "all loads depend on the driver's coordinate alone"
        return watched(_conserved(along_path(system, replace(request, why=why))), request.watch)
    follow = sorted(depends - {"q"}) or ["joint friction"]
    request = replace(request, why=request.why or f"the loads depend on {listed(follow)}")
    flow = Flow(system, request)
    if "time" in depends:
        found = _forced(flow)
    elif several:
        found = _rested(flow, lossless)
    else:
        found = _settled(flow)
    if several and request.watch:
        note = "events are not looked for along the steady motion of several drivers"
        return replace(found, notes=(*found.notes, note))
    return found if several else watched(found, request.watch)


def _conserved(motion: Motion) -> Motion:
    """The motion by ``energy`` from the start, if it repeats: its first period."""
    if motion.status == "failed" or motion.end == INTERRUPTED:
        return motion
    if motion.regime == "rest":
        return replace(motion, status="reached", end="steady")
    period = motion.facts.get("period")
    if period is not None:
        t_end = motion.t_start + period
        state = motion.track.state(np.array([t_end]))
        return replace(
            motion,
            status="reached",
            end="steady",
            t_end=t_end,
            q_end=float(state.q[0]),
            qd_end=float(state.qd[0]),
            events=tuple(e for e in motion.events if e.t <= t_end),
            facts={**motion.facts, "multiplier": 1.0},
            notes=(*motion.notes, FAMILY),
        )
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


@dataclass
class Flow:
    """Motions of a system from any state, without an estimate of their errors."""

    system: System
    request: SimulationRequest
    name: str = "return map"
    equation: Equation = field(init=False)
    speed: float = field(init=False)  # a typical one

    def __post_init__(self) -> None:
        start = self.request.start
        self.k = len(self.system.drivers)
        self.x = np.concatenate([np.atleast_1d(start.q), np.atleast_1d(start.rate)]).astype(float)
        self.equation = Equation(self.system, start.q)
        y = np.append(self.x, 0.0)
        if self.system.friction is not None:
            self.equation.sides = self.system.friction.sides(float(y[0]), 1)
        self.speed = scales(self.equation, start.t, y)[0]
        if not np.isfinite(np.asarray(self.equation(start.t, y), dtype=float)).all():
            raise no_steady(f"{IMPOSSIBLE} at the start", "start elsewhere")

    @property
    def method(self) -> str:
        """The integrator."""
        return self.request.method if self.request.method in SOLVERS else "dop853"

    def asked(self, x: Floats, until: Until, watch: Sequence[Watch] = ()) -> SimulationRequest:
        """A request for a motion from a state (2k,)."""
        q, qd = x[: self.k], x[self.k :]
        at: tuple[Any, Any] = (float(q[0]), float(qd[0])) if self.k == 1 else (q, qd)
        return SimulationRequest(
            Start(at[0], at[1], self.request.start.t),
            until,
            self.request.accuracy,
            self.method,
            watch=tuple(watch),
            why=self.request.why,
        )

    def run(self, asked: SimulationRequest, tolerance: float) -> Motion:
        """One integration; what stops it is raised."""
        rest = AT_REST * self.system.span
        method = "dop853" if tolerance == FINE else self.method
        motion = Run(
            self.system, asked, method, max(tolerance, 100 * EPS), self.name, rest
        ).motion()
        if motion.end == INTERRUPTED:
            raise KeyboardInterrupt
        return motion

    def after(self, x: Floats, span: float, tolerance: float) -> Floats:
        """The state (2k,) some time [s] later."""
        most = np.array([FAR * self.system.span] * self.k + [FAR * self.speed] * self.k)
        if not (np.abs(x - self.x) <= most).all():  # a root search went astray
            raise Lost("a way without end", math.nan)
        motion = self.run(self.asked(x, Until("time", span)), tolerance)
        if motion.end != "time":
            raise Lost(motion.end, motion.t_end - self.request.start.t)
        return np.concatenate([np.atleast_1d(motion.q_end), np.atleast_1d(motion.qd_end)])

    def steps(self) -> Floats:
        """Steps (2k,) of difference quotients."""
        k, span = self.k, min(self.system.span, 1.0)
        return np.array([QUOTIENT * span] * k + [QUOTIENT * self.speed] * k)


# -- loads of the time ---------------------------------------------------------------------


def forcing_period(structure: Structure, given: float) -> float:
    """The shortest time [s] after which all loads of the time repeat.

    ``given`` [s] is the period that the user names for loads whose law does not tell it.
    """
    periods: dict[str, float] = {"steady": given} if given else {}
    for name, element in structure.elements.items():
        law: Any = element.law if isinstance(element, Following) else None
        if law is None or "time" not in law.variables():
            continue
        if isinstance(law, Polynomial) and not any(law.coefficients[1:]):
            continue
        whole = getattr(law, "whole", None)
        if whole:
            periods[name] = float(whole)
        elif whole is not None or isinstance(law, Polynomial):
            raise no_steady(f"the load {name} follows the time and does not repeat")
        elif not given:
            raise no_steady(f"the load {name} follows the time by a law that tells no period", GIVE)
    return _common(periods)


def _common(periods: dict[str, float]) -> float:
    """The least common multiple of periods by the names of their loads; 0 of none."""
    whole, first = 0.0, ""
    for name, period in periods.items():
        if not whole:
            whole, first = period, name
            continue
        ratio = Fraction(period / whole).limit_denominator(COMMON)
        fits = ratio > 0 and abs(float(ratio) * whole / period - 1) <= SAME
        if not fits or ratio.numerator > COMMON:
            raise no_steady(
                f"the loads {first} and {name} repeat after {whole:.9g} s and {period:.9g} s, "
                "which have no common multiple, so nothing repeats"
            )
        whole *= ratio.numerator
    return whole


def _accelerations(flow: Flow, x: Floats, t: float) -> Floats:
    k = flow.k
    return np.asarray(flow.equation(t, np.append(x, 0.0)), dtype=np.float64)[k : 2 * k]


def _check_period(flow: Flow, period: float) -> None:
    """Look whether the loads really are the same a period later."""
    t0 = flow.request.start.t
    for share in np.linspace(0.0, 0.9, SETTLING):
        here, later = (_accelerations(flow, flow.x, t0 + share * period + d) for d in (0, period))
        size = float(np.abs(here).max() + np.abs(later).max()) + flow.speed**2
        if not np.abs(later - here).max() <= SAME * size:
            raise no_steady(f"the loads are not the same again after {period:.9g} s", GIVE)


def _turns(flow: Flow) -> Floats:
    """(k,) period [rad] of each driver's coordinate; 0 where there is none, or stops are."""
    structure, stops = flow.system.compiled.structure, flow.system.stops
    pairs = zip(flow.system.drivers, stops, strict=True)
    return np.array(
        [
            0.0 if any(map(math.isfinite, ends)) else loads.period_of(structure, d) or 0.0
            for d, ends in pairs
        ]
    )


def _cyclic(flow: Flow) -> list[int]:
    """Drivers on whose coordinates nothing depends."""
    found, t0 = [], flow.request.start.t
    x = flow.x.copy()
    x[flow.k :] += flow.speed
    here = _accelerations(flow, x, t0)
    for i in range(flow.k):
        there = []
        for j in (1, 2, 3):
            moved = x.copy()
            moved[i] += j * flow.system.span / TURN  # a radian, or as much of a slide
            there.append(np.abs(_accelerations(flow, moved, t0) - here).max())
        if max(there) <= SAME * (float(np.abs(here).max()) + EPS):
            found.append(i)
    return found


@dataclass
class Stroboscope:
    """The state after a period T of the loads, and its fixed points.

    turns : (k,) periods of the coordinates; free : indices of the state that must repeat
    """

    flow: Flow
    T: float
    turns: Floats
    cyclic: list[int]

    @property
    def free(self) -> list[int]:
        """Parts of the state that must repeat."""
        return [i for i in range(2 * self.flow.k) if i not in self.cyclic]

    def wrapped(self, step: Floats) -> Floats:
        """A change of the state (2k,), whole turns left out."""
        found = step.copy()
        for i, turn in enumerate(self.turns):
            if turn:
                found[i] = math.remainder(step[i], turn)
        return found

    def returns(self, x: Floats) -> bool:
        """Whether a state comes back after a period."""
        step = self.wrapped(self.flow.after(x, self.T, FINE) - x)
        return bool(np.abs((step / self.flow.steps())[self.free]).max() <= LOOSE)

    def found(self, x: Floats, n: int) -> Cycle | None:
        """The periodic motion of n periods of the loads near a state, or None."""
        flow, free, k = self.flow, self.free, self.flow.k

        def moved(z: Floats, tolerance: float = FINE) -> Floats:
            state = x.copy()
            state[free] = z
            return self.wrapped(flow.after(state, n * self.T, tolerance) - state)[free]

        try:
            steps = flow.steps()[free]
            begin = x[free]
            if np.abs(moved(begin) / steps).max() > LOOSE / 100:  # else it is one already
                begin = root(moved, begin, method="hybr", options={"xtol": 100 * EPS}).x
            left = moved(begin)
            jump = slope(moved, begin, steps)
        except Lost:
            return None
        if np.abs(left / steps).max() > LOOSE / QUOTIENT:
            return None
        at = x.copy()
        at[free] = begin
        asked = flow.asked(at, Until("time", n * self.T))
        asked = replace(asked, accuracy=(asked.accuracy or TARGET) / 10)  # `gain` enlarges it
        once = in_time(flow.system, asked, flow.method)
        if once.end == INTERRUPTED:
            raise KeyboardInterrupt
        shift = np.atleast_1d(once.q_end) - at[:k]
        for i in range(k):
            if i not in self.cyclic:
                whole = self.turns[i] * round(shift[i] / self.turns[i]) if self.turns[i] else 0.0
                shift[i] = whole
        values = np.linalg.eigvals(jump + np.eye(len(free)))
        sizes = np.linalg.svd(jump, compute_uv=False)
        gain = 1 + 1 / float(np.min(sizes[sizes > NEUTRAL], initial=1.0))
        order = np.argsort(-np.abs(values), kind="stable")
        return Cycle(at, once, shift, values[order], gain, n)


def _forced(flow: Flow) -> Motion:
    """A periodic motion under loads of the time, after some periods of flow."""
    flow.name = "stroboscopic map"
    structure = flow.system.compiled.structure
    T = forcing_period(structure, flow.request.until.forcing)
    if not T:
        raise no_steady("the loads follow the time, and their period is not known", GIVE)
    _check_period(flow, T)
    seen = Stroboscope(flow, T, _turns(flow), _cyclic(flow))
    fallback: Cycle | None = None
    x = flow.x
    try:
        if seen.returns(x):
            fallback = seen.found(x, 1)
        for _ in range(TIMES):
            if fallback is not None and abs(fallback.largest - 1) <= NEUTRAL:
                break
            for _ in range(SETTLING):
                x = flow.after(x, T, LOOSE)
            x[seen.cyclic] = flow.x[seen.cyclic]
            for n in PERIODS:
                cycle = seen.found(x, n)
                if cycle is not None and cycle.stable:
                    return _told(seen, cycle, seen.wrapped(cycle.x - x))
                fallback = fallback or cycle
    except Lost as lost:
        raise no_steady(lost.words, ELSEWHERE) from None
    if fallback is None:
        raise _unfound(seen, x)
    return _told(seen, fallback, seen.wrapped(fallback.x - x))


def _unfound(seen: Stroboscope, x: Floats) -> RequestError:
    k = seen.flow.k
    if len(seen.cyclic) == k == 1:
        gain = float(seen.flow.after(x, seen.T, FINE)[1] - x[1])
        return no_steady(
            f"in every {seen.T:.9g} s the loads change the rate by {gain:.6g}, whatever it is",
            "add a damper or a motor curve",
        )
    return no_steady(
        "no periodic motion was found; it may be chaotic, or have a period of its own beside that "
        f"of the loads; tried: {SETTLING * TIMES} periods of the motion from the start",
        ELSEWHERE,
    )


def _told(seen: Stroboscope, cycle: Cycle, away: Floats) -> Motion:
    """The motion of a cycle; a driver that goes on for ever must not come to a stop."""
    flow = seen.flow
    stopped = [i for i in seen.cyclic if any(map(math.isfinite, flow.system.stops[i]))]
    far = max((abs(float(cycle.shift[i])) for i in stopped), default=0.0)
    period = cycle.once.t_end - cycle.once.t_start
    if far > 10 * cycle.gain * cycle.once.error:
        raise no_steady(
            f"the rate repeats, but the driver advances by {far:.6g} in every {period:.9g} s "
            "and comes to an end stop",
            ELSEWHERE,
        )
    near = np.abs(away[seen.free] / flow.steps()[seen.free]).max() * QUOTIENT <= INWARD
    notes = [
        "the motion from the start settles to it"
        if near and cycle.stable
        else "the motion from the start was not seen to come to this one"
    ]
    notes += [CYCLIC] if seen.cyclic else []
    return repeated(cycle, flow.request, flow.name, notes)


# -- one driver, loads of place and rate ---------------------------------------------------


class Passage(NamedTuple):
    """A way to the next standstill, through a whole turn, or to rest under joint friction."""

    kind: str  # "standstill", "turn" or "rest"
    x: Floats
    time: float


def _passage(flow: Flow, x: Floats, tolerance: float = LOOSE) -> Passage:
    """The way from a state to the next standstill or whole turn."""
    begin, period = float(x[0]), flow.system.period
    if any(map(math.isfinite, flow.system.stops[0])):
        period = None  # no turn repeats for ever
    far = period or FAR * flow.system.span

    def gone(t: float, q: Any, qd: Any) -> float:
        return abs(float(q) - begin) - far

    ask = flow.asked(x, Until("standstill"), [Watch("turn", gone)])
    motion = flow.run(ask, tolerance)
    time = motion.t_end - motion.t_start
    state = np.array([motion.q_end, motion.qd_end], dtype=float)
    if motion.end == "turn" and period is None:
        raise Lost("a way without end", math.nan)
    if motion.end == REST:
        return Passage(REST, state, time)
    if motion.end not in (STANDSTILL, "turn"):
        raise Lost(motion.end, time)
    return Passage(motion.end, state, time)


def _settled(flow: Flow) -> Motion:
    """What one driver under loads of place and rate settles to."""
    if flow.x[1] == 0:
        rest = _start_at_rest(flow)
        if isinstance(rest, Motion):
            return rest
    x, clock = flow.x, 0.0
    try:
        for _ in range(PASSAGES):
            way = _passage(flow, x)
            if way.kind == REST:
                return _friction_rest(flow, way.x)
            near = _near_equilibrium(flow, way.x)
            if near is not None:
                return near
            if way.kind == "turn" and x[1] != 0:
                found = _turning(flow, x, way.x)
            elif way.kind == STANDSTILL and x[1] == 0:
                found = _swinging(flow, x, way)
            else:
                found = way.x
            if isinstance(found, Motion):
                return found
            clock += way.time
            x = found
    except Lost as lost:
        lost.t += clock
        raise no_steady(lost.words, ELSEWHERE) from None
    raise no_steady(f"none was found within {PASSAGES} swings or turns", ELSEWHERE)


def _start_at_rest(flow: Flow) -> Motion | None:
    """A start at an equilibrium; one that is unstable is left."""
    if flow.system.friction is not None:
        return None
    found = equilibrium_near(flow.system, flow.x[:1], flow.request.start.t, flow.speed)
    if found is None or abs(found.q[0] - flow.x[0]) > 2 * found.error:
        return None
    if found.kind != "unstable":
        return at_rest(found, flow.request, ())
    flow.x = flow.x + np.array([QUOTIENT * flow.system.span, 0.0])
    note = "started beside the unstable equilibrium of the start"
    flow.request = replace(flow.request, why=f"{flow.request.why}; {note}")
    return None


def _near_equilibrium(flow: Flow, x: Floats) -> Motion | None:
    """Rest, if a state will stay at the stable equilibrium beside it."""
    if x[1] != 0 or flow.system.friction is not None:
        return None
    found = equilibrium_near(flow.system, x[:1], flow.request.start.t, flow.speed)
    if found is None or found.kind == "unstable":
        return None
    if not abs(float(found.q[0] - x[0])) <= AT_REST * flow.system.span:
        return None
    if found.kind == "indifferent":  # it stops where the motion from the start does
        asked = replace(flow.asked(flow.x, Until("standstill")), accuracy=FINE)
        motion = in_time(flow.system, asked, "dop853")
        found = replace(found, q=np.array([motion.q_end]), error=motion.error)
    return at_rest(found, flow.request, ())


def _friction_rest(flow: Flow, x: Floats) -> Motion:
    """Where joint friction holds the driver: the place of the motion from the start itself."""
    asked = replace(flow.request, until=Until("swings", float(COMMON)), watch=())
    motion = along_path(flow.system, asked)
    facts = {k: v for k, v in motion.facts.items() if k.startswith("holding")}
    q = np.array([motion.q_end], dtype=float)
    note = "at rest where joint friction holds it"
    return resting(flow.request, q, motion.error, motion.method, facts, (note,))


def _ahead(begin: float, inward: bool, least: float) -> Iterator[float]:
    """Sizes further and further inward or outward."""
    size = begin
    for _ in range(PASSAGES):
        size *= INWARD if inward else OUTWARD
        yield size
        if size < least * begin:
            return


def _turning(flow: Flow, x: Floats, after: Floats) -> Floats | Motion:
    """The next fixed point of the map of turns; a state where it is left."""
    q, way = float(x[0]), math.copysign(1.0, x[1])

    def change(w: float, tolerance: float = LOOSE) -> float | Floats:
        found = _passage(flow, np.array([q, way * w]), tolerance)
        return abs(float(found.x[1])) - w if found.kind == "turn" else found.x

    w0, w1 = abs(float(x[1])), abs(float(after[1]))
    if abs(w1 - w0) <= LOOSE * w0:
        return _rotation(flow, q, way, change, w0 * (1 - INNERMOST), w0 * (1 + INNERMOST))
    last = w0
    for w in _ahead(w0, w1 < w0, INNERMOST):
        found = change(w)
        if isinstance(found, np.ndarray):
            return after
        if found * (w1 - w0) <= 0:
            return _rotation(flow, q, way, change, last, w)
        last = w
    if w1 > w0:
        raise Lost("a speed that grows without bound", math.nan)
    return after


def _rotation(
    flow: Flow,
    q: float,
    way: float,
    change: Callable[[float, float], Any],
    low: float,
    high: float,
) -> Motion | Floats:
    """The rotation between two speeds, from the turn of the start."""
    period = flow.system.period
    assert period is not None
    start = float(flow.x[0])
    q -= period * round((q - start) / period)
    q = start if abs(q - start) <= SAME else q
    if change(low, FINE) * change(high, FINE) > 0:
        return np.array([q, way * high])
    w = float(brentq(lambda s: change(s, FINE), low, high, xtol=EPS * high, rtol=4 * EPS))
    begin = np.array([w])

    def later(z: Floats) -> Floats:
        return np.array([change(float(z[0]), FINE) + float(z[0])])

    mu = slope(later, begin, QUOTIENT * begin)[0]
    asked = flow.asked(np.array([q, way * w]), Until("turns", period / TURN))
    own = flow.request.method in SOLVERS
    once = in_time(flow.system, asked, flow.method) if own else along_path(flow.system, asked)
    once = replace(once, q_end=q + way * period)
    gain = 1 + 1 / max(abs(1 - float(mu[0])), NEUTRAL)
    cycle = Cycle(np.array([q, way * w]), once, np.array([way * period]), mu, gain)
    told = f"found from the speed {way * w:.6g} at the start of a turn"
    return _lasting(repeated(cycle, flow.request, "return map", (told,)), gain)


def _swinging(flow: Flow, x: Floats, there: Passage) -> Floats | Motion:
    """The next fixed point of the map of standstills; a state where it is left."""
    a, b = float(x[0]), float(there.x[0])
    back = _passage(flow, there.x)
    if back.kind != STANDSTILL:
        return back.x
    c = float(back.x[0])
    centre = _between(flow, a, b)

    def change(r: float, tolerance: float = LOOSE) -> float | Floats:
        """By how much an amplitude grows in a swing to and fro; a state where it turns round."""
        at = np.array([centre + math.copysign(r, a - centre), 0.0])
        for _ in range(2):
            found = _passage(flow, at, tolerance)
            if found.kind != STANDSTILL:
                return found.x
            at = found.x
        return abs(float(at[0]) - centre) - r

    r0, inward = abs(a - centre), abs(c - centre) < abs(a - centre)
    if abs(c - a) <= LOOSE * r0:
        return _libration(flow, centre, a, change, r0 * (1 - INNERMOST), r0 * (1 + INNERMOST))
    last = r0
    for r in _ahead(r0, inward, INNERMOST):
        if r > INWARD * FAR * flow.system.span / SETTLING:
            break
        found = change(r)
        if isinstance(found, np.ndarray):
            return back.x
        if (found > 0) == inward:
            return _libration(flow, centre, a, change, last, r)
        last = r
    if not inward:
        raise Lost("swings that grow without bound", math.nan)
    rest = equilibrium_near(flow.system, np.array([centre]), flow.request.start.t, flow.speed)
    return back.x if rest is None else at_rest(rest, flow.request, ())


def _between(flow: Flow, a: float, b: float) -> float:
    """The equilibrium nearest to a on the way to b."""
    t0 = flow.request.start.t

    def push(q: float) -> float:
        return float(_accelerations(flow, np.array([q, 0.0]), t0)[0])

    q = np.linspace(a, b, PASSAGES)[1:-1].tolist()
    values = [push(x) for x in q]
    for x, y, f, g in zip(q, q[1:], values, values[1:], strict=False):
        if f * g <= 0:
            return float(brentq(push, x, y, xtol=EPS, rtol=4 * EPS))
    return (a + b) / 2


def _libration(
    flow: Flow,
    centre: float,
    a: float,
    change: Callable[[float, float], Any],
    low: float,
    high: float,
) -> Motion | Floats:
    """The swing between two amplitudes."""
    way = math.copysign(1.0, a - centre)
    if change(low, FINE) * change(high, FINE) > 0:
        return np.array([centre + way * high, 0.0])
    r = float(brentq(lambda s: change(s, FINE), low, high, xtol=EPS * high, rtol=4 * EPS))
    begin = np.array([r])

    def later(z: Floats) -> Floats:
        return np.array([change(float(z[0]), FINE) + float(z[0])])

    mu = slope(later, begin, QUOTIENT * begin)[0]
    x = np.array([centre + way * r, 0.0])
    once = in_time(flow.system, flow.asked(x, Until("swings", 2.0)), flow.method)
    gain = 1 + 1 / max(abs(1 - float(mu[0])), NEUTRAL)
    cycle = Cycle(x, once, np.zeros(1), mu, gain)
    return _lasting(repeated(cycle, flow.request, "return map", ()), gain)


def _lasting(motion: Motion, gain: float) -> Motion:
    """With the error of the period, which follows that of the state."""
    return replace(motion, time_error=gain * motion.time_error)


# -- several drivers -----------------------------------------------------------------------


def _rested(flow: Flow, lossless: bool) -> Motion:
    """The equilibrium at which several drivers come to rest."""
    flow.name = "equilibrium"
    x, k, t0 = flow.x, flow.k, flow.request.start.t
    span = flow.system.span / flow.speed * TURN
    for _ in range(PASSAGES):
        found = equilibrium_near(flow.system, x[:k], t0, flow.speed)
        if found is not None and found.kind != "unstable":
            away = np.concatenate([found.q - x[:k], x[k:] / flow.speed])
            if np.abs(away).max() <= (found.error if lossless else AT_REST):
                return at_rest(found, flow.request, ())
        if lossless:
            raise no_steady(
                "no load dissipates, and with several drivers a motion without losses does not "
                "repeat in general",
                'add a damper, or ask for "time=<s>"',
            )
        try:
            x = flow.after(x, span, LOOSE)
        except Lost as lost:
            raise no_steady(lost.words, ELSEWHERE) from None
    raise no_steady(
        f"the motion from the start was not at rest after {PASSAGES * span:.6g} s; with several "
        "drivers only rest, and motions under loads that repeat in time, are looked for"
    )
