"""What ends or interrupts an integration in time: one table of events, one way to find them.

An event is a function of time and state whose sign matters. Between the ends of a step it is
looked at on the integrator's dense output, a change of sign is located by `brentq`. Margin and
inertia (`closeness`) may also dip and come back within a step: their smallest value counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from blockmech.dynamics.motion import (
    DEAD_CENTRE,
    END_STOP,
    NO_INERTIA,
    Event,
    Floats,
    Motion,
)
from blockmech.dynamics.request import SimulationRequest, Watch
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

TURN = 2 * math.pi
Value: TypeAlias = Callable[[float, Floats], float]
Dense: TypeAlias = Callable[[Any], Any]

STANDSTILL, KINK, GOAL = "standstill", "kink", "goal"
REVERSAL, GUIDE_SIDE = "joint reverses", "guide changes side"

WITHIN = 8  # parts of a step at whose ends an event is looked at: steps take up to a swing
LEAST_MARGIN = 1e-6  # [-] at which a run is stopped: a dead centre is near (numerics 5, rule 6)
LEAST_INERTIA = 1e-9  # [-] of a typical one: beyond it the speed goes without bound
NEAR = 0.1  # margin, a transmission angle of 18 degrees, below which a dip within a step counts
ON = 1e-12  # relative distance within which a coordinate counts as on a kink
PER_SWING = 64  # samples of a swing or period among which a user's event is looked for
FEWEST, MOST = 257, 200_001  # such samples of a whole run


@dataclass(frozen=True)
class EventRule:
    """An event that may happen: where ``value(t, y)`` changes sign.

    direction : sign of the change that counts, 0 for both
    terminal : whether the integration stops there (to end, or to go on with another equation)
    within : parts of a step that are looked at; 1: only its end, of values that cost kernels
    dips : whether it also happens where the value only dips below zero
    index : of the pair with friction that it is about
    """

    kind: str
    value: Value
    direction: int = 0
    terminal: bool = True
    within: int = WITHIN
    dips: bool = False
    index: int = -1


class Hit(NamedTuple):
    """An event that happened."""

    rule: EventRule
    t: float


# -- the table -----------------------------------------------------------------------------


def driver_at(kind: str, q: float, direction: int = 0, driver: int = 0) -> EventRule:
    """A driver's coordinate reaches q [rad or m]."""
    return EventRule(kind, lambda t, y: float(y[driver]) - q, direction)


def general_rules(
    system: System, request: SimulationRequest, q0: float, closeness: Callable[[Any], Any]
) -> list[EventRule]:
    """The rules that hold all along a run; ``closeness``: y -> (margin, relative inertia)."""
    k = len(system.drivers)
    found = [_watched(w, k) for w in request.watch]
    margin = EventRule(
        DEAD_CENTRE, lambda t, y: float(closeness(y)[0]) - LEAST_MARGIN, -1, within=1, dips=True
    )
    inertia = EventRule(
        NO_INERTIA, lambda t, y: float(closeness(y)[1]) - LEAST_INERTIA, -1, within=1, dips=True
    )
    found += [margin, inertia] if k == 1 else [margin]
    for i, (driver, ends) in enumerate(zip(system.compiled.drivers, system.stops, strict=True)):
        kind = END_STOP if k == 1 else f"{END_STOP} of {driver}"
        pairs = zip(ends, (-1, 1), strict=True)
        found += [driver_at(kind, q, way, i) for q, way in pairs if math.isfinite(q)]
    if k > 1:
        return found
    goal, value = request.until.goal, request.until.value
    if goal == "angle":
        found.append(driver_at(GOAL, value))
    if goal == "turns":
        found += [driver_at(GOAL, q0 + way * value * TURN) for way in (1, -1)]
    ends_run = goal in ("standstill", "swings") or system.friction is not None
    return [*found, EventRule(STANDSTILL, lambda t, y: float(y[1]), terminal=ends_run)]


def kink_rules(q: float, knots: Sequence[float], period: float | None) -> list[EventRule]:
    """The next kinks in place above and below q, and the one it is on."""
    if period is not None:
        turn = math.floor(q / period)
        knots = [knot + period * (turn + n) for knot in knots for n in (-1, 0, 1)]
    near = ON * max(1.0, abs(q))
    above = [knot for knot in knots if knot > q + near]
    below = [knot for knot in knots if knot < q - near]
    here = [knot for knot in knots if abs(knot - q) <= near]
    chosen = [*sorted(above)[:1], *sorted(below)[-1:], *here[:1]]
    return [driver_at(KINK, knot) for knot in chosen]


def friction_rules(
    slips: Callable[[float], Floats], loads: Callable[[float, Floats], Any], guides: Sequence[bool]
) -> list[EventRule]:
    """Reversals of pairs with friction, and guides whose load goes over to the other side."""
    found = []

    def slip(j: int) -> Value:
        return lambda t, y: float(slips(float(y[0]))[j])

    def load(j: int, part: Callable[[complex], float]) -> Value:
        return lambda t, y: part(complex(loads(t, y)[j]))

    for j, guide in enumerate(guides):
        found.append(EventRule(REVERSAL, slip(j), within=WITHIN // 2, index=j))
        if guide:  # of its load N + 2i C/L the larger part counts: kinks where either changes
            found += [
                EventRule(GUIDE_SIDE, load(j, part), within=1, index=j) for part in (_side, _larger)
            ]
    return found


def _side(load: complex) -> float:
    """Changes sign with the side on which a guide bears."""
    return load.real if abs(load.real) >= abs(load.imag) else load.imag


def _larger(load: complex) -> float:
    """Changes sign where force and couple are as large as one another."""
    return abs(load.real) - abs(load.imag)


def _watched(watch: Watch, k: int) -> EventRule:
    def value(t: float, y: Any) -> float:
        if k == 1:
            return watch.surface(t, float(y[0]), float(y[1]))
        return watch.surface(t, y[:k], y[k : 2 * k])

    return EventRule(watch.name, value, watch.direction, watch.terminal)


# -- finding them in a step ----------------------------------------------------------------


@dataclass
class Looking:
    """Looks for the events of a table in one step after the other."""

    rules: Sequence[EventRule]
    values: list[float]  # at the end of the last step

    @classmethod
    def at(
        cls, rules: Sequence[EventRule], t: float, y: Floats, fired: EventRule | None = None
    ) -> Looking:
        """Before the first step; what just happened counts as on its surface still."""
        values = [r.value(t, y) for r in rules]
        if fired is not None:
            near = ON * max(1.0, float(np.abs(y[0])))
            for i, r in enumerate(rules):
                again = r.kind == fired.kind and r.index == fired.index and r.kind != KINK
                if again or (r.kind == fired.kind and abs(values[i]) <= near):
                    values[i] = 0.0
        return cls(rules, values)

    def in_step(self, t0: float, t1: float, y1: Floats, dense: Dense) -> list[Hit]:
        """Events of a step in order, up to the first that stops the integration."""
        found: list[Hit] = []
        t = np.linspace(t0, t1, WITHIN + 1)
        inner = np.asarray(dense(t[1:-1])).T
        for i, rule in enumerate(self.rules):
            before, after = self.values[i], rule.value(t1, y1)
            self.values[i] = after
            parts = rule.within
            if rule.dips and min(before, after) < NEAR:
                parts = max(parts, WITHIN // 2)
            each = WITHIN // parts
            between = zip(t[each:-1:each], inner[each - 1 :: each], strict=False)
            values = [before, *(rule.value(float(s), y) for s, y in between), after]
            found += _changes(rule, t[::each], values, dense)
        found.sort(key=lambda hit: hit.t)
        for i, hit in enumerate(found):
            if hit.rule.terminal:
                return found[: i + 1]
        return found


def _changes(rule: EventRule, t: Floats, values: Sequence[float], dense: Dense) -> list[Hit]:
    """Changes of sign of one rule between times at which its values are known."""

    def value(s: float) -> float:
        return rule.value(s, dense(s))

    if rule.dips and min(values) > 0:
        return _dip(rule, t, values, value)
    return [
        Hit(rule, float(b) if high == 0 else _root(value, float(a), float(b)))
        for a, b, low, high in zip(t, t[1:], values, values[1:], strict=False)
        if turned(low, high, rule.direction)
    ]


def turned(low: float, high: float, direction: int) -> bool:
    """Whether a value changes its sign in a direction that counts; it may end on zero."""
    rises, falls = low < 0 <= high, low > 0 >= high
    return (rises and direction >= 0) or (falls and direction <= 0)


def _root(value: Callable[[float], float], low: float, high: float) -> float:
    """Where a value changes sign; rounding may put that at an end."""
    if value(low) * value(high) > 0:
        return high
    return float(brentq(value, low, high, xtol=EPS, rtol=4 * EPS))


def _dip(
    rule: EventRule, t: Floats, values: Sequence[float], value: Callable[[float], float]
) -> list[Hit]:
    """A value that is positive at all samples and falls below zero between them."""
    i = int(np.argmin(values))
    if values[i] >= NEAR:
        return []
    near = (float(t[max(i - 1, 0)]), float(t[min(i + 1, t.size - 1)]))
    lowest = minimize_scalar(value, bounds=near, method="bounded")
    if not lowest.fun < 0:
        return []
    return [Hit(rule, _root(value, near[0], float(lowest.x)))]


# -- events of a user on a motion that is known --------------------------------------------


def watched(motion: Motion, watches: Sequence[Watch]) -> Motion:
    """The motion of one driver with the watches' events, cut at the first terminal one."""
    if motion.t_end <= motion.t_start or not watches:
        return motion
    swing = motion.facts.get("swing_time") or motion.facts.get("period") or 0.0
    span = motion.t_end - motion.t_start
    many = PER_SWING * span / swing if swing else FEWEST
    t = motion.times(int(min(max(many, FEWEST), MOST)))
    states = motion.track.state(t)
    found = []
    for watch in watches:
        rule = _watched(watch, 1)

        def value(s: float, rule: EventRule = rule) -> float:
            state = motion.track.state(np.array([s]))
            return rule.value(s, np.array([state.q[0], state.qd[0]]))

        rows = zip(t.tolist(), states.q.tolist(), states.qd.tolist(), strict=True)
        values = [watch.surface(*row) for row in rows]
        for a, b, low, high in zip(t, t[1:], values, values[1:], strict=False):
            if turned(low, high, watch.direction):
                found.append(Hit(rule, _root(value, float(a), float(b))))
    found.sort(key=lambda hit: hit.t)
    last = next((hit for hit in found if hit.rule.terminal), None)
    t_end = motion.t_end if last is None else last.t
    kept = [_event(motion, hit) for hit in found if hit.t <= t_end]
    events = sorted([*(e for e in motion.events if e.t <= t_end), *kept], key=lambda e: e.t)
    if last is None:
        return replace(motion, events=tuple(events))
    end = _event(motion, last)
    return replace(
        motion,
        events=tuple(events),
        t_end=t_end,
        q_end=end.q,
        qd_end=end.qd,
        status="reached",
        end=end.kind,
    )


def _event(motion: Motion, hit: Hit) -> Event:
    state = motion.track.state(np.array([hit.t]))
    return Event(hit.rule.kind, hit.t, float(state.q[0]), float(state.qd[0]))
