r"""The scheme of the second paper, a teaching aid: steps d of the driver's coordinate.

For loads of the place alone, of order 1:

    xi_i = (tau_i - w_i^2 (J_{i+1} - J_i) / (2 d)) / J_i,    w_{i+1}^2 = w_i^2 + 2 xi_i d

Sources: [D14] Durango et al. 2014, Eq. 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from blockmech.dynamics.equation import typical_inertia
from blockmech.dynamics.events import GOAL, LEAST_MARGIN, STANDSTILL, goal_places
from blockmech.dynamics.fixed_steps import MOST_STEPS, STEP, checked_step, judged_by_half
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
from blockmech.dynamics.request import SimulationRequest

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

BLOCK = 8192  # samples in one batch
NEAR_DEAD_CENTRE = 1e-2  # margin below which a pose that is impossible is one


def euler_q(system: System, request: SimulationRequest) -> Motion:
    """The motion by the scheme of the second paper: steps of the driver's coordinate."""
    step = request.step or STEP * (1.0 if system.rotary[0] else system.span)
    ways = [abs(place - request.start.q) for place in goal_places(request)]
    checked_step(step, max(ways, default=0.0))

    def run(h: float) -> Motion:
        walk = EulerWalk(system, request, h)
        walk.go()
        return walk.motion()

    return judged_by_half(request, step, run)


@dataclass
class EulerWalk:
    """Steps of the coordinate taken so far: times, coordinates, rates, and how they end."""

    system: System
    request: SimulationRequest
    step: float
    t: list[float] = field(default_factory=list)
    q: list[float] = field(default_factory=list)
    qd: list[float] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    status: Status = "reached"
    end: str = ""

    def __post_init__(self) -> None:
        q0, rate, t0 = self.request.start
        self.add(t0, float(q0), float(rate))
        places = [x for x in goal_places(self.request) if x != q0 or not self.system.rotary[0]]
        stops = [x for x in self.system.stops[0] if math.isfinite(x)]
        self.places = [*((x, GOAL) for x in places), *((x, END_STOP) for x in stops)]
        goal, value = self.request.until.goal, self.request.until.value
        self.wanted = {"standstill": 1, "swings": int(value)}.get(goal, 0)

    def add(self, t: float, q: float, qd: float) -> None:
        """One more step."""
        self.t.append(t)
        self.q.append(q)
        self.qd.append(qd)

    def stop(self, end: str, status: Status = "ended") -> None:
        """The last step was the last one; what ends it before the goal is an event."""
        if status == "ended" and end not in (IMPOSSIBLE, REST, INTERRUPTED):
            self.events.append(Event(end, self.t[-1], self.q[-1], self.qd[-1]))
        self.end, self.status = end, status

    def go(self) -> None:
        """Steps until something ends them."""
        push = float(self.system.sample(np.array([self.q[0]])).tau[0])
        way = math.copysign(1.0, self.qd[0] or push)
        try:
            while not self.end:
                self.block(way)
                way = -way if self.qd[-1] == 0 else way
                if len(self.t) > MOST_STEPS and not self.end:
                    goal = self.request.until.goal
                    self.stop(f"{goal} is not met in {MOST_STEPS} steps", "failed")
                if self.system.progress is not None:
                    self.system.progress("euler_q", self.t[-1], None)
        except KeyboardInterrupt:
            self.stop(INTERRUPTED)

    def block(self, way: float) -> None:
        """Steps in one direction, sampled at once, to a standstill or the end of the block."""
        d = way * self.step
        q: Floats = self.q[-1] + d * np.arange(BLOCK + 1.0)
        found = self.system.sample(q)
        good = int(np.argmin(found.possible)) if not found.possible.all() else q.size
        J, tau, w2 = found.J.tolist(), found.tau.tolist(), self.qd[-1] ** 2
        for i in range(BLOCK):
            if i + 1 >= good:
                return self.stop(self.what_is_ahead(float(q[i])))
            near = min(found.margin[i], found.margin[i + 1]) < NEAR_DEAD_CENTRE
            if near and self.touches(float(q[i]), float(q[i + 1])):
                return self.stop(DEAD_CENTRE)
            xi = (tau[i] - 0.5 * w2 * (J[i + 1] - J[i]) / d) / J[i]
            if self.ends_with(float(q[i]), d, w2, xi):
                if self.end == REST:  # or it bounced off what is ahead
                    end = self.what_is_ahead(float(q[i]))
                    self.stop(REST if end == IMPOSSIBLE else end)
                return None
            w2 += 2 * xi * d
        return None

    def ends_with(self, q: float, d: float, w2: float, xi: float) -> bool:
        """Take a step of constant acceleration; whether the block ends with it."""
        t, t_last = self.t[-1], self.request.t_last
        way, after, end = math.copysign(1.0, d), w2 + 2 * xi * d, q + d
        stands = after <= 0
        if stands:
            end, after = q - w2 / (2 * xi) if xi else q, 0.0
        place = self.first_place(q, end)
        if place is not None:
            end, stands = place[0], False
            after = max(w2 + 2 * xi * (end - q), 0.0)
        speed = math.sqrt(w2) + math.sqrt(after)
        span = 2 * abs(end - q) / speed if speed else 0.0
        if t + span >= t_last:
            rate, left = way * math.sqrt(w2), t_last - t
            self.add(t_last, q + rate * left + 0.5 * xi * left**2, rate + xi * left)
            self.stop("time", "reached")
        elif span == 0.0 and stands:
            self.stop(REST)
        else:
            self.add(t + span, end, way * math.sqrt(after))
            if stands:
                self.stand()
            elif place is not None:
                goal = place[1] == GOAL
                self.stop(self.request.until.goal if goal else END_STOP, ("ended", "reached")[goal])
        return stands or bool(self.end)

    def first_place(self, before: float, after: float) -> tuple[float, str] | None:
        """The first of the goals and stops between two coordinates."""
        way = 1.0 if after >= before else -1.0
        inside = [p for p in self.places if 0 < way * (p[0] - before) <= way * (after - before)]
        return min(inside, key=lambda p: way * p[0], default=None)

    def stand(self) -> None:
        """A standstill at the last step."""
        self.events.append(Event(STANDSTILL, self.t[-1], self.q[-1], 0.0))
        self.wanted -= 1
        if self.wanted == 0:
            self.stop(self.request.until.goal, "reached")

    def what_is_ahead(self, q: float) -> str:
        """What is ahead where no step leads on."""
        here = self.system.one(q)
        if not here.margin > NEAR_DEAD_CENTRE:
            return DEAD_CENTRE
        heavy = NEAR_DEAD_CENTRE * typical_inertia(self.system, q) < here.J
        return IMPOSSIBLE if heavy else NO_INERTIA

    def touches(self, before: float, after: float) -> bool:
        """Whether a margin touches zero between two places, and comes back."""
        ends = min(before, after), max(before, after)
        lowest = minimize_scalar(
            lambda q: self.system.one(float(q)).margin, bounds=ends, method="bounded"
        )
        return not lowest.fun > LEAST_MARGIN

    def motion(self) -> Motion:
        """The motion; it stopped within a step of what it could not reach."""
        t, kept = np.unique(self.t, return_index=True)
        q, qd = np.array(self.q)[kept], np.array(self.qd)[kept]
        before = self.end in (DEAD_CENTRE, IMPOSSIBLE)
        return Motion(
            method="euler_q",
            why=self.request.why,
            regime="fixed steps",
            status=self.status,
            end=self.end,
            t_start=self.request.start.t,
            t_end=self.t[-1],
            q_end=self.q[-1],
            qd_end=self.qd[-1],
            track=StepTrack(t, q, qd) if t.size > 1 else Still(self.q[-1], self.qd[-1]),
            events=tuple(self.events),
            error=math.inf,
            time_error=2 * float(np.diff(t).max(initial=0.0)) if before else 0.0,
            accuracy=self.request.accuracy,
            cost=self.system.cost,
            facts={"coordinate_step": self.step},
        )


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
