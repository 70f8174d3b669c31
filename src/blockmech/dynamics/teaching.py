r"""Two teaching aids: schemes of fixed steps as in the textbooks, for comparison.

``rk4``, steps of time, of the classical order 4:

    y = (q, q'),    y_{n+1} = y_n + h (k1 + 2 k2 + 2 k3 + k4) / 6

``euler_q``, steps of the driver's coordinate, of order 1, for loads of the place alone:

    xi_i = (tau_i - w_i^2 (J_{i+1} - J_i) / (2 d)) / J_i,    w_{i+1}^2 = w_i^2 + 2 xi_i d

A step at which nothing is defined is halved until it fits or is nothing. The error is told by
a second run with half the step.

Sources: [D14] Durango et al. 2014, Eq. 2 (euler_q).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq, minimize_scalar

from blockmech.dynamics.estimate import difference, missed
from blockmech.dynamics.events import LEAST_MARGIN
from blockmech.dynamics.motion import (
    DEAD_CENTRE,
    END_STOP,
    IMPOSSIBLE,
    INTERRUPTED,
    NO_INERTIA,
    REST,
    Event,
    Floats,
    Motion,
    State,
    Status,
    Still,
)
from blockmech.dynamics.request import SimulationRequest, bad
from blockmech.dynamics.time import typical_inertia

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

TURN = 2 * math.pi
STEPS = 200  # of a run in time without a step or a target
ANGLE_STEP = 1e-3  # [rad], or of the span, of euler_q without one
MOST_STEPS = 2_000_000  # in a run; half a minute
GIVEN_UP = 25_000  # steps after which a goal is perhaps never met, and a target is missed
BLOCK = 8192  # samples of euler_q in one batch
DOUBT = 4.0  # stated error over the difference of step and half step: order 1 differs by half
SHORTENED = 60  # steps, each half of the way that is left: a double has no more digits
SHORTEST = 2.0**-30  # of a step: where a halved one is nothing
NEAR_DEAD_CENTRE = 1e-2  # margin of the last pose at which a dead centre ends the steps


@dataclass
class Walk:
    """Steps taken so far: times, coordinates, rates, and how they end."""

    t: list[float] = field(default_factory=list)
    q: list[float] = field(default_factory=list)
    qd: list[float] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    status: Status = "reached"
    end: str = ""
    shortened: int = 0  # steps that did not fit as a whole

    def add(self, t: float, q: float, qd: float) -> None:
        """One more step."""
        self.t.append(t)
        self.q.append(q)
        self.qd.append(qd)

    def note(self, kind: str) -> None:
        """An event at the last step."""
        self.events.append(Event(kind, self.t[-1], self.q[-1], self.qd[-1]))

    def close(self, end: str) -> None:
        """What is named ends the walk."""
        if end != IMPOSSIBLE:
            self.note(end)
        self.stop(end)

    def stop(self, end: str, status: Status = "ended") -> None:
        """The last step was the last one."""
        self.end, self.status = end, status


@dataclass(frozen=True)
class StepTrack:
    """Dense output between steps: the cubic through coordinates and rates at both ends."""

    t: Floats
    q: Floats
    qd: Floats

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        spline = CubicHermiteSpline(self.t, self.q, self.qd)
        return State(spline(t), spline(t, 1))


class Goal:
    """What ends a walk: standstills, places, stops."""

    def __init__(self, system: System, request: SimulationRequest) -> None:
        goal, value, q0 = request.until.goal, request.until.value, float(request.start.q)
        self.name, self.t_last = goal, request.t_last
        self.standstills = {"standstill": 1, "swings": int(value)}.get(goal, 0)
        places = {"angle": [value], "turns": [q0 + value * TURN, q0 - value * TURN]}.get(goal, [])
        (low, high), way = system.stops[0], system.rotary[0]
        self.places: list[tuple[float, str]] = [(x, goal) for x in places if x != q0 or not way]
        self.places += [(x, END_STOP) for x in (low, high) if math.isfinite(x)]
        self.seen = 0

    def crossed(self, before: float, after: float) -> list[tuple[float, str]]:
        """Places passed between two coordinates, in order."""
        way = 1.0 if after >= before else -1.0
        inside = [p for p in self.places if 0 < way * (p[0] - before) <= way * (after - before)]
        return sorted(inside, key=lambda p: way * p[0])

    def stood(self, walk: Walk) -> None:
        """A standstill at the last step."""
        walk.note("standstill")
        self.seen += 1
        if self.seen == self.standstills:
            walk.stop(self.name, "reached")

    def came(self, walk: Walk, kind: str) -> None:
        """One of the places is reached at the last step."""
        if kind == END_STOP:
            walk.note(kind)
        walk.stop(kind, "ended" if kind == END_STOP else "reached")


# -- rk4 -----------------------------------------------------------------------------------


def rk4(system: System, request: SimulationRequest) -> Motion:
    """The motion by the classical scheme of Runge and Kutta."""
    whole = request.t_last - request.start.t
    step = request.step
    if step is None:
        step = whole / STEPS if math.isfinite(whole) else 1.0 / STEPS
    if math.isfinite(whole) and whole / step > MOST_STEPS:
        found = f"{step:.3g} s makes {whole / step:.3g} steps, at most {MOST_STEPS:,} can be made"
        raise bad("step", found, "give a larger one")
    return _judged(system, request, step, "rk4", lambda h: _rk4_walk(system, request, h))


def _rk4_walk(system: System, request: SimulationRequest, step: float) -> Walk:
    walk, goal = Walk(), Goal(system, request)
    q, qd, t = request.start
    walk.add(t, float(q), float(qd))
    most = MOST_STEPS if math.isfinite(goal.t_last) else GIVEN_UP
    try:
        while not walk.end:
            t = walk.t[-1]
            if t >= goal.t_last:
                walk.stop("time", "reached")
            elif len(walk.t) > most:
                walk.stop(f"{goal.name} is not met in {most} steps", "failed")
            else:
                _rk4_step(system, walk, goal, step)
            if system.progress is not None:
                known = math.isfinite(goal.t_last)
                whole = goal.t_last - request.start.t if known else None
                system.progress("rk4", walk.t[-1] - request.start.t, whole)
    except KeyboardInterrupt:
        walk.stop(INTERRUPTED)
    return walk


def _rk4_step(system: System, walk: Walk, goal: Goal, step: float) -> None:
    """One step, shorter where the whole one leads to where nothing is defined."""
    t, y = walk.t[-1], np.array([walk.q[-1], walk.qd[-1]])
    h = min(step, goal.t_last - t)
    shortened = False
    while True:
        after, margin = _runge_kutta(system, t, y, h)
        bounced = y[1] * after[1] < 0 and (shortened or _near_end(system, t, y, after))
        if np.isfinite(after).all() and not bounced:
            break
        walk.shortened += not shortened
        h, shortened = h / 2, True
        if h < SHORTEST * step or bounced or walk.shortened > SHORTENED:
            walk.close(_what_ends(system, float(y[0])))
            return
    if margin < NEAR_DEAD_CENTRE and _touches(system, float(y[0]), float(after[0])):
        walk.close(DEAD_CENTRE)
        return
    whole = not shortened and t + step >= goal.t_last
    _rk4_events(walk, goal, t, y, goal.t_last if whole else t + h, after)


def _what_ends(system: System, q: float) -> str:
    """What is ahead where no step leads on."""
    here = system.one(q)
    if not here.margin > NEAR_DEAD_CENTRE:
        return DEAD_CENTRE
    return NO_INERTIA if not NEAR_DEAD_CENTRE * typical_inertia(system, q) < here.J else IMPOSSIBLE


def _near_end(system: System, t: float, y: Floats, after: Floats) -> bool:
    """Whether a step that turns back does so beside a dead centre."""
    states = (y, after)
    margins = [system.acceleration(float(z[0]), float(z[1]), t)[1] for z in states]
    return not min(margins) > NEAR_DEAD_CENTRE


def _touches(system: System, before: float, after: float) -> bool:
    """Whether a margin touches zero between two places, and comes back."""
    ends = min(before, after), max(before, after)
    lowest = minimize_scalar(lambda q: system.one(float(q)).margin, bounds=ends, method="bounded")
    return not lowest.fun > LEAST_MARGIN


def _runge_kutta(system: System, t: float, y: Floats, h: float) -> tuple[Floats, float]:
    """The state a step later, NaN where there is none, and the margin there."""
    margin = math.nan

    def slope(s: float, z: Floats) -> Floats:
        nonlocal margin
        qdd, margin = system.acceleration(float(z[0]), float(z[1]), s)
        return np.array([z[1], qdd if margin > 0 else math.nan])

    k1 = slope(t, y)
    k2 = slope(t + h / 2, y + h / 2 * k1)
    k3 = slope(t + h / 2, y + h / 2 * k2)
    k4 = slope(t + h, y + h * k3)
    with np.errstate(invalid="ignore"):
        found: Floats = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    # the state itself must be possible too: the next step begins there
    possible = np.isfinite(slope(t + h, found)).all()
    return (found if possible else np.full(2, math.nan)), margin


def _rk4_events(walk: Walk, goal: Goal, t: float, y: Floats, last: float, after: Floats) -> None:
    """Standstills and places within a step, on the cubic between its ends."""
    q = CubicHermiteSpline([t, last], [y[0], after[0]], [y[1], after[1]])
    begins = t
    if y[1] * after[1] < 0:
        stands = float(brentq(q.derivative(), t, last))
        if _place(walk, goal, q, begins, stands):
            return
        walk.add(stands, float(q(stands)), 0.0)
        goal.stood(walk)
        if walk.end:
            return
        begins = stands
    if not _place(walk, goal, q, begins, last):
        walk.add(last, float(after[0]), float(after[1]))


def _place(walk: Walk, goal: Goal, q: Any, begins: float, ends: float) -> bool:
    """Whether a place ends the walk between two times."""
    crossed = goal.crossed(float(q(begins)), float(q(ends)))
    if not crossed:
        return False
    place, kind = crossed[0]
    at = float(brentq(lambda s: float(q(s)) - place, begins, ends))
    walk.add(at, place, float(q(at, 1)))
    goal.came(walk, kind)
    return True


# -- euler_q -------------------------------------------------------------------------------


def euler_q(system: System, request: SimulationRequest) -> Motion:
    """The motion by the scheme of the second paper: steps of the driver's coordinate."""
    step = request.step or ANGLE_STEP * (1.0 if system.rotary[0] else system.span)
    if request.until.goal in ("turns", "angle"):
        far = request.until.value
        way = far * TURN if request.until.goal == "turns" else abs(far - request.start.q)
        if way / step > MOST_STEPS:
            found = f"{step:.3g} makes {way / step:.3g} steps, at most {MOST_STEPS:,} can be made"
            raise bad("step", found, "give a larger one")
    return _judged(system, request, step, "euler_q", lambda h: _Euler(system, request, h).walked())


@dataclass
class _Euler:
    """A walk in steps of the coordinate."""

    system: System
    request: SimulationRequest
    step: float
    walk: Walk = field(default_factory=Walk)

    def __post_init__(self) -> None:
        self.goal = Goal(self.system, self.request)

    def walked(self) -> Walk:
        """Steps until something ends them."""
        q, rate, t = self.request.start
        self.walk.add(t, float(q), float(rate))
        way = math.copysign(1.0, rate) if rate else math.copysign(1.0, self._push(float(q)))
        try:
            while not self.walk.end:
                self._block(way)
                way = -way if self.walk.qd[-1] == 0 else way
                if len(self.walk.t) > MOST_STEPS and not self.walk.end:
                    name = self.goal.name
                    self.walk.stop(f"{name} is not met in {MOST_STEPS} steps", "failed")
                if self.system.progress is not None:
                    self.system.progress("euler_q", self.walk.t[-1], None)
        except KeyboardInterrupt:
            self.walk.stop(INTERRUPTED)
        return self.walk

    def _push(self, q: float) -> float:
        return float(self.system.sample(np.array([q])).tau[0])

    def _block(self, way: float) -> None:
        """Steps in one direction, sampled at once, to a standstill or the end of the block."""
        q0, d = self.walk.q[-1], way * self.step
        q: Floats = q0 + d * np.arange(BLOCK + 1.0)
        found = self.system.sample(q)
        good = int(np.argmin(found.possible)) if not found.possible.all() else q.size
        J, tau = found.J.tolist(), found.tau.tolist()
        w2 = self.walk.qd[-1] ** 2
        for i in range(BLOCK):
            if i + 1 >= good:
                self.walk.close(_what_ends(self.system, float(q[i])))
                return
            near = min(found.margin[i], found.margin[i + 1]) < NEAR_DEAD_CENTRE
            if near and _touches(self.system, float(q[i]), float(q[i + 1])):
                self.walk.close(DEAD_CENTRE)
                return
            slope = 0.5 * w2 * (J[i + 1] - J[i]) / d
            xi = (tau[i] - slope) / J[i]
            if self._stepped(float(q[i]), d, w2, xi):
                if self.walk.end == REST:  # or it bounced off what is ahead
                    end = _what_ends(self.system, float(q[i]))
                    self.walk.stop(REST if end == IMPOSSIBLE else end)
                return
            w2 += 2 * xi * d

    def _stepped(self, q: float, d: float, w2: float, xi: float) -> bool:
        """One step of constant acceleration; whether the block ends with it."""
        walk, goal, t = self.walk, self.goal, self.walk.t[-1]
        way, after = math.copysign(1.0, d), w2 + 2 * xi * d
        end, stands = q + d, after <= 0
        if stands:
            end = q - w2 / (2 * xi) if xi else q
        crossed = goal.crossed(q, end)
        if crossed:
            end, stands = crossed[0][0], False
            after = max(w2 + 2 * xi * (end - q), 0.0)
        speed = math.sqrt(w2) + (0.0 if stands else math.sqrt(after))
        span = 2 * abs(end - q) / speed if speed else 0.0
        if t + span >= goal.t_last:
            left = goal.t_last - t
            rate = way * math.sqrt(w2) + xi * left
            walk.add(goal.t_last, q + way * math.sqrt(w2) * left + 0.5 * xi * left**2, rate)
            walk.stop("time", "reached")
            return True
        if span == 0.0 and stands:
            walk.stop(REST)
            return True
        walk.add(t + span, end, 0.0 if stands else way * math.sqrt(after))
        if stands:
            goal.stood(walk)
        elif crossed:
            goal.came(walk, crossed[0][1])
        return stands or bool(crossed)


# -- errors --------------------------------------------------------------------------------


def _judged(
    system: System,
    request: SimulationRequest,
    step: float,
    method: str,
    walked: Callable[[float], Walk],
) -> Motion:
    """The motion of the step that was asked for, else of one that meets the target."""
    name = "time_step" if method == "rk4" else "coordinate_step"

    def run(h: float) -> Motion:
        return _motion(system, request, method, walked(h), {name: h})

    motion, target = run(step), request.accuracy
    while motion.end != INTERRUPTED and motion.status != "failed":
        finer = run(step / 2)
        if finer.end == INTERRUPTED:
            note = "interrupted: the error is not judged by another run"
            motion = replace(motion, status="ended", end=INTERRUPTED, notes=(note,))
            break
        apart = difference(motion, finer, request.times)
        off = DOUBT * apart.q if apart.agree else math.inf
        late = 0.0 if motion.end == "time" else DOUBT * apart.t + (0.0 if apart.agree else math.inf)
        if motion.end in (DEAD_CENTRE, IMPOSSIBLE):  # it stopped within a step of it
            late += 2 * float(np.diff(walk_times(motion)).max(initial=0.0))
        if motion.end == NO_INERTIA:  # of steps at speeds without bound nothing is known
            off = late = math.inf
        motion = replace(motion, error=off, time_error=late)
        steps = (motion.t_end - motion.t_start) / step if method == "rk4" else BLOCK / step
        if request.step is not None or target is None or off <= target or steps > GIVEN_UP:
            break
        motion, step = finer, step / 2
    return motion if target is None else missed(motion, target)


def walk_times(motion: Motion) -> Floats:
    """Times [s] of the steps of a motion."""
    return motion.track.t if isinstance(motion.track, StepTrack) else np.empty(0)


def _motion(
    system: System,
    request: SimulationRequest,
    method: str,
    walk: Walk,
    facts: dict[str, float],
) -> Motion:
    t, kept = np.unique(walk.t, return_index=True)
    q, qd = np.array(walk.q)[kept], np.array(walk.qd)[kept]
    return Motion(
        method=method,
        why=request.why,
        regime="fixed steps",
        status=walk.status,
        end=walk.end,
        t_start=request.start.t,
        t_end=walk.t[-1],
        q_end=walk.q[-1],
        qd_end=walk.qd[-1],
        track=StepTrack(t, q, qd) if t.size > 1 else Still(walk.q[-1], walk.qd[-1]),
        events=tuple(walk.events),
        error=math.inf,
        time_error=math.inf,
        accuracy=request.accuracy,
        cost=system.cost,
        facts=facts,
    )
