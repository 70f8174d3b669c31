"""What ends or interrupts a motion: one table of events, one way to find them.

An event is a function of time and state whose sign matters. It is looked at at some times, a
change of sign is located by `brentq`. Margin and inertia may also dip and come back in between:
their smallest value counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from blockmech.dynamics import ends
from blockmech.dynamics.layout import StateLayout, until
from blockmech.dynamics.loads import SAME
from blockmech.dynamics.rates import LEAST_INERTIA, bearing
from blockmech.dynamics.request import SimulationRequest, Watch
from blockmech.engines.stages import FAR
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR as LEAST_MARGIN
from blockmech.result.motion import Event, Motion
from blockmech.typing import Floats, Real

if TYPE_CHECKING:
    from blockmech.dynamics.friction import PairProgram
    from blockmech.dynamics.system import System
    from blockmech.typing import Vectors

Value: TypeAlias = Callable[[Real, Floats], Real]

PARTS = 8  # of a step, at whose ends an event is looked at: steps take up to a swing
PER_SWING = 64  # samples of a swing or period among which a user's event is looked for


@dataclass(slots=True)
class EventFunction:
    """An event that may happen: where ``value(t, y)`` changes sign.

    direction : sign of the change that counts, 0 for both
    terminal : whether the integration stops there (to end, or to go on with another equation)
    parts : of a step that are looked at; 1: only its end, of values that cost kernels
    dips : whether it also happens where the value only dips below zero
    index : of the pair with friction that it is about
    component : of the state, of which ``value`` is what is above ``level``, or above zero
    level : [rad or m] of the only driver that it is about
    by_user : whether it is a user's
    """

    kind: str
    value: Value
    direction: int = 0
    terminal: bool = True
    parts: int = PARTS
    dips: bool = False
    index: int = -1
    component: int = -1
    level: float = math.nan
    by_user: bool = False


class EventHit(NamedTuple):
    """An event that happened."""

    rule: EventFunction
    t: float


# -- the table -----------------------------------------------------------------------------


def driver_at(kind: str, q: float, direction: int = 0, driver: int = 0) -> EventFunction:
    """A driver's coordinate reaches q [rad or m]."""
    return EventFunction(kind, lambda t, y: y[driver] - q, direction, component=driver, level=q)


def pair_at(system: System, kind: str, level: float, direction: int, i: int) -> EventFunction:
    """A pair with end stops reaches a coordinate [rad or m]; i is its place among all of them."""

    def value(t: float, y: Floats) -> float:
        return float(system.coordinates(y[: len(system.drivers)])[i] - level)

    return EventFunction(kind, value, direction, parts=PARTS // 2, index=i)


def general_rules(
    system: System,
    request: SimulationRequest,
    closeness: Callable[[Floats], tuple[float, float]],
    stop_force: Callable[..., float],
) -> list[EventFunction]:
    """The rules that hold all along a run; ``closeness``: y -> (margin, relative inertia).

    ``stop_force`` : (place among the stops, t, y) -> what that pushes with
    """
    k = len(system.drivers)
    rules = [user_rule(w, StateLayout(k)) for w in request.watch]
    limits = ((ends.DEAD_CENTRE, LEAST_MARGIN), (ends.NO_INERTIA, LEAST_INERTIA))
    for i, (kind, threshold) in enumerate(limits if system.scalar else limits[:1]):

        def above(t: float, y: Floats, i: int = i, threshold: float = threshold) -> float:
            return closeness(y)[i] - threshold

        rules.append(EventFunction(kind, above, -1, parts=1, dips=True))
    for i, between in enumerate(system.stops):
        kind = system.end_at(i)
        if i in system.contacts:

            def push(t: float, y: Floats, i: int = i, side: int = system.contacts[i]) -> float:
                return -side * stop_force(i, t, y)

            rules.append(EventFunction(ends.LEAVES_STOP, push, -1, index=i, parts=1))
            continue
        rule = driver_at if i < k else partial(pair_at, system)
        pairs = zip(between, (-1, 1), strict=True)
        rules += [rule(kind, q, side, i) for q, side in pairs if math.isfinite(q)]
    if k > 1:
        return rules
    rules += [driver_at(ends.GOAL, q) for q in request.goals]
    ends_run = request.standstills < math.inf or system.friction is not None
    still = EventFunction(ends.STANDSTILL, lambda t, y: y[1], terminal=ends_run, component=1)
    return [*rules, still]


def kink_rules(q: float, knots: Sequence[float], period: float | None) -> list[EventFunction]:
    """The next kinks in place above and below q, and the one it is on."""
    if period is not None:
        turn = math.floor(q / period)
        knots = [knot + period * (turn + n) for knot in knots for n in (-1, 0, 1)]
    tolerance = SAME * max(1.0, abs(q))
    above = [knot for knot in knots if knot > q + tolerance]
    below = [knot for knot in knots if knot < q - tolerance]
    coincident = [knot for knot in knots if abs(knot - q) <= tolerance]
    chosen = [*sorted(above)[:1], *sorted(below)[-1:], *coincident[:1]]
    return [driver_at(ends.KINK, knot) for knot in chosen]


def friction_rules(
    slips: Callable[[Floats], Sequence[float] | Floats],
    loads: Callable[[float, Floats], Sequence[complex] | Vectors],
    pairs: PairProgram,
    sides: Sequence[int],
    alone: bool,
) -> list[EventFunction]:
    """Reversals of pairs that slip, and guides whose load goes over to the other side.

    The friction of a pair whose law has a state goes on through a reversal, but has a kink there.
    ``sides`` : senses in which pairs slip; 0: it sticks
    ``alone`` : whether slips are per unit rate of the only driver, so that their signs say nothing
    """
    rules = []

    def slip(j: int) -> Value:
        return lambda t, y: slips(y)[j]

    def side(j: int, part: int) -> Value:
        return lambda t, y: bearing(complex(loads(t, y)[j]))[part]

    for j in np.flatnonzero(sides).tolist():
        remembers = pairs.remembers[j]
        kind = ends.DEFLECTION_KINK if remembers else ends.REVERSAL
        direction = 0 if remembers or alone else -sides[j]
        rules.append(EventFunction(kind, slip(j), direction, parts=PARTS // 2, index=j))
        if pairs.guides[j]:
            kind = ends.GUIDE_SIDE
            rules += [EventFunction(kind, side(j, part), parts=1, index=j) for part in range(2)]
    return rules


def signal_rules(
    kinks: Callable[[float, Floats], Sequence[float]], count: int
) -> list[EventFunction]:
    """Kinks of signal blocks, such as a limit that is reached."""

    def value(i: int) -> Value:
        return lambda t, y: float(kinks(t, y)[i])

    return [
        EventFunction(ends.SIGNAL_KINK, value(i), parts=PARTS // 2, index=i) for i in range(count)
    ]


def user_rule(watch: Watch, layout: StateLayout) -> EventFunction:
    """A user's event, of states of a layout."""

    def value(t: Real, y: Real) -> Real:
        return watch.surface(t, *layout.motion(y))

    options = watch.direction, watch.terminal or bool(watch.then)
    return EventFunction(watch.name, value, *options, by_user=True)


# -- finding them --------------------------------------------------------------------------


@dataclass
class EventDetector:
    """Looks for the events of a table in one step after the other.

    parts : of a step that are looked at, at most
    spans : (k,) coordinates over which things change [rad or m], a turn of angles
    t : [s] at the end of the last step, or before the first one
    happened : what did so before the first one (kind, index), and is on its surface still
    values : of the rules at the end of the last step
    """

    rules: Sequence[EventFunction]
    parts: int
    spans: Sequence[float]
    t: float
    happened: Collection[tuple[str, int]] = ()
    values: list[float] | None = None

    def _before(self, t: float, y: Floats) -> list[float]:
        """The rules' values where a step begins; what came before it may not be looked at."""
        if t == self.t and self.values is not None:
            return self.values
        values = [rule.value(t, y) for rule in self.rules]
        tolerance = SAME * max(1.0, float(np.abs(y[0])))
        for i, r in enumerate(self.rules if t == self.t else ()):
            if (r.kind, r.index) in self.happened:
                values[i] = 0.0 if r.kind != ends.KINK or abs(values[i]) <= tolerance else values[i]
        return values

    def of(self, kind: str) -> EventDetector:
        """That of events of a kind alone."""
        return replace(self, rules=[rule for rule in self.rules if rule.kind == kind], t=math.nan)

    def free_range(self, q: float) -> tuple[float, float]:
        """The next places of the first driver, below and above one, at which there are events.

        Who begins at one of them, as after an impact, has no room: its first step may return.
        """
        levels = [rule.level for rule in self.rules if rule.component == 0]
        below, above = (p for p in levels if p <= q), (p for p in levels if p >= q)
        return max(below, default=-math.inf), min(above, default=math.inf)

    def within(self, steps: Floats, states: Floats, dense: Any) -> list[EventHit]:
        """Events within steps, in no order: of one, or of some if all rules are a user's.

        steps : (m + 1,) [s], states : (m + 1, n) where they begin, and where the last ends
        """
        if not self.rules:
            return []
        t0, t1, y0, y1 = float(steps[0]), float(steps[-1]), states[0], states[-1]
        values = self._before(t0, y0)
        self.t, self.values = t1, (ends_at := [rule.value(t1, y1) for rule in self.rules])
        ways = [abs(a - b) / s for a, b, s in zip(y1, y0, self.spans, strict=False)]
        # No margin falls by more on so short a way.
        threshold = min(FAR, PARTS * math.tau * max(ways))
        quiet = (
            not turned(a, b, rule.direction) and not (rule.dips and min(a, b) < threshold)
            for rule, a, b in zip(self.rules, values, ends_at, strict=True)
        )
        of_driver = (r.parts == 1 or not (r.by_user or r.index >= 0) for r in self.rules)
        simple = len(self.spans) == 1 and all(of_driver)  # rules of more than ends are its own
        alike = self.parts == 1 or (simple and self._steady(t1 - t0, y0, y1))
        if alike and all(quiet):
            return []
        hits, open_ = list[EventHit](), [*zip(self.rules, values, ends_at, strict=True)]
        for rule, *end_values in (x for x in open_ if x[0].component >= 0):
            level = 0.0 if math.isnan(rule.level) else rule.level
            times = dense.crossings(rule.component, level, end_values, rule.direction, self.parts)
            hits += [EventHit(rule, min(s, t1)) for s in times]
        open_ = [x for x in open_ if x[0].component < 0]
        if not open_:
            return hits
        begins, shares = steps[:-1, None], np.arange(self.parts) / self.parts
        t = np.array([*(begins + (steps[1:, None] - begins) * shares).flat, t1])
        inner = t[1:-1], np.asarray(dense(t[1:-1]))
        for rule, low, high in open_:
            dips = rule.dips and min(low, high) < threshold
            parts = min(max(rule.parts, PARTS // 2 if dips else 1), self.parts)
            stride = self.parts // parts
            some = (x[..., stride - 1 :: stride].T for x in inner)
            between = [rule.value(float(s), y) for s, y in zip(*some, strict=True)]
            row = np.array([low, *between, high], dtype=np.float64)
            if (row.min() > 0 or row.max() < 0) and not dips:
                continue

            def value(s: float, rule: EventFunction = rule) -> float:
                return float(rule.value(s, dense(s)))

            times = crossings(rule.direction, t[::stride], row, value)
            if dips and not times:
                times = _dip(t[::stride], row, value)
            hits += [EventHit(rule, s) for s in times]
        return hits

    @staticmethod
    def _steady(h: float, y0: Floats, y1: Floats) -> bool:
        """Whether nothing turns within a step: rates at both ends and between are alike."""
        a, b, mean = float(y0[1]), float(y1[1]), float(y1[0] - y0[0]) / h
        low, high = min(a, b, mean), max(a, b, mean)
        return 0 < high < 2 * low or 0 > low > 2 * high


def until_terminal(hits: list[EventHit]) -> list[EventHit]:
    """Events in order of time, up to the first terminal one."""
    hits = sorted(hits, key=lambda hit: hit.t)
    last = next((i for i, hit in enumerate(hits) if hit.rule.terminal), len(hits))
    return hits[: last + 1]


def crossings(
    direction: int, t: Floats, samples: ArrayLike, value: Callable[[float], float]
) -> list[float]:
    """Times at which a value changes its sign, between times at which it is known."""
    values = np.asarray(samples, dtype=np.float64)
    return [
        float(t[i + 1]) if values[i + 1] == 0 else _root(value, float(t[i]), float(t[i + 1]))
        for i in np.flatnonzero(turned(values[:-1], values[1:], direction))
    ]


def turned(low: Real, high: Real, direction: Real) -> Real:
    """Whether values change their sign in a direction that counts; they may end on zero."""
    rises, falls = (low < 0) & (high >= 0), (low > 0) & (high <= 0)
    return (rises & (direction >= 0)) | (falls & (direction <= 0))


def _root(value: Callable[[float], float], low: float, high: float) -> float:
    """Where a value leaves its side, by zero or as no number; rounding may put that at an end."""
    from scipy.optimize import brentq

    first, last = value(low), value(high)
    if first * last > 0:
        return high

    def side(t: float) -> float:
        x = value(t)
        return last if math.isnan(x) else x

    return float(brentq(side, low, high, xtol=EPS, rtol=4 * EPS))


def _dip(t: Floats, values: Floats, value: Callable[[float], float]) -> list[float]:
    """Where a value that is positive at all times given falls below zero between them.

    It cannot where it changes by less than itself from the least of them to its neighbours.
    """
    i = int(np.argmin(values))
    first, last = max(i - 1, 0), min(i + 1, t.size - 1)
    if max(values[first], values[last]) < 2 * values[i]:
        return []
    from scipy.optimize import minimize_scalar

    low, high = float(t[first]), float(t[last])
    lowest = minimize_scalar(value, bounds=(low, high), method="bounded")
    return [_root(value, low, float(lowest.x))] if lowest.fun < 0 else []


# -- events of a user on a motion that is known --------------------------------------------


def watched(motion: Motion, watches: Sequence[Watch]) -> Motion:
    """The motion of one driver with the watches' events, cut at the first terminal one."""
    if motion.t_end <= motion.t_start or not watches:
        return motion
    span = motion.t_end - motion.t_start
    swing = motion.facts.get("swing_time") or motion.facts.get("period") or span
    t = motion.times(PER_SWING // PARTS * max(4, math.ceil(span / swing)) + 1)

    def dense(s: float | Floats) -> Floats:
        values: Floats = np.array(motion.track.state(np.ravel(s)))
        return values if np.ndim(s) else values[:, 0]

    states = dense(t).T
    rules = [user_rule(w, StateLayout(1)) for w in watches]
    lookout = EventDetector(rules, PARTS, [math.inf], motion.t_start)
    hits = until_terminal(lookout.within(t, states, dense))
    events = [Event(hit.rule.kind, hit.t, *map(float, dense(hit.t))) for hit in hits]
    if not (hits and hits[-1].rule.terminal):
        return replace(motion, events=tuple(sorted((*motion.events, *events), key=attrgetter("t"))))
    end = events[-1]
    events = sorted([*(e for e in motion.events if e.t <= end.t), *events], key=attrgetter("t"))
    reached = {"status": "reached", "end": end.kind, "time_error": motion.time_error}
    return until(motion, end.t).but(events=tuple(events), **reached)
