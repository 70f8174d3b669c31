"""What a simulation is asked for, read and checked before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.ends import SECONDS, STANDSTILL
from blockmech.dynamics.roles import Roles, RolesGiven, located, roles_of
from blockmech.dynamics.source import Source
from blockmech.ground.errors import RequestError, among, close_match, listed, refused
from blockmech.ground.units import NoQuantity, in_si, number_in_si, quantity, unit_behind
from blockmech.model.reading import HIGHEST
from blockmech.model.scene import Scene
from blockmech.result.motion import Event, Motion, Still
from blockmech.typing import (
    FixedStep,
    FixedStepName,
    Floats,
    MotionMethod,
    MotionName,
    Numbers,
    Quantity,
    Real,
)

Goal: TypeAlias = Literal["standstill", "swings", "turns", "time", "angle", "steady", "event"]
Surface: TypeAlias = Callable[[float, Real, Real], float]  # (t, q, q') -> value
Pairs: TypeAlias = Mapping[str, tuple[float, float]]


class GoalNumber(NamedTuple):
    """What number a goal takes: how it is written, in words, and which ones fit."""

    spelled: str
    valid: str = "no number"
    is_valid: Callable[[float], bool] = math.isfinite


GOALS = {
    "standstill": GoalNumber("standstill"),
    "swings": GoalNumber(
        "swings=<count>", "a whole number from 1 on", lambda x: x >= 1 and x == round(x)
    ),
    "turns": GoalNumber("turns=<count>", "a number above 0", lambda x: x > 0),
    "time": GoalNumber("time=<s>", "a number from 0 on", lambda x: x >= 0),
    "angle": GoalNumber("angle=<rad or m>, or 60deg", "a number"),
    "steady": GoalNumber(
        "steady, steady=<s>, the period of the loads",
        "the period of the loads [s] or nothing",
        lambda x: x > 0,
    ),
    "event": GoalNumber("event (a Watch of yours)"),
}
NAMES: tuple[str, ...] = get_args(MotionName)
FIXED: tuple[str, ...] = get_args(FixedStepName)
ENGINES = ("auto", "scalar", "llvm")
WATCHED = ("time", "angle", "turns")  # goals that an event can be
OUTPUTS = 201  # output times where none are named
PAIRS = "give them by driver, like {pairs}"
WATCH = 'blockmech.Watch("name", lambda t, q, rate: ...)'
NO_PAIRS: Pairs = {}
START, STOPS = '{"crank": (0.0, 0.0)}', '{"crank": (-1.0, 2.0)}'


class Start(NamedTuple):
    """Where a run begins: coordinate [rad or m], rate, time [s]; arrays (k,) with k drivers."""

    q: Real
    rate: Real = 0.0
    t: float = 0.0


@dataclass(frozen=True)
class Watch:
    """A user's event: where ``surface(t, q, q')`` changes sign.

    ``q`` and ``q'`` are numbers with one driver, arrays (k,) in the order of ``mech.drivers`` with
    several.
    With ``direction`` +1 only where it rises, with -1 only where it falls, with 0 both;
    ``terminal`` says whether the run ends there. ``then`` is driver -> the role that it has from
    there on, "free", "prescribed" (by its law of motion, which must be where the driver is) or
    "locked" (where it is): with it the run goes on.

    >>> half = bm.Watch("half", lambda t, q, rate: q - 0.5)
    >>> mech.simulate("time=1", start={"crank": (0.0, 5.0)}, watch=[half]).motion.end
    'half'
    """

    name: str
    surface: Surface
    direction: int = 0
    terminal: bool = True
    then: Mapping[str, str] = field(default_factory=dict)


_UNITS = {"time": ("s",), "steady": ("s",), "angle": ("rad", "m")}  # of a slide it is a length


@dataclass(frozen=True)
class Until:
    """The condition that ends a motion.

    ``standstill``; ``swings`` (that many standstills after the start); ``turns`` of the
    driver; ``time`` [s] after the start; ``angle``: the driver coordinate reaches it
    [rad or m]; ``steady``: what the motion settles to, a periodic motion or rest;
    ``event``: the first terminal event.

    ``forcing`` [s] is the period of loads of the time whose law does not tell it, for ``steady``.

    >>> Until.parse("swings=3")
    Until(goal='swings', value=3.0)
    """

    goal: Goal
    value: float = 1.0
    forcing: float = field(default=0.0, repr=False)

    @staticmethod
    @lru_cache
    def parse(text: str) -> Until:
        """Read ``standstill``, ``steady``, ``event`` or ``<goal>=<number>``.

        ``steady=<s>`` names the period of the loads, and a time with its unit alone, ``2s`` or
        ``500ms``, is the time.
        """
        phrase = f"time={text}" if unit_behind(text) else text
        name, _, number = phrase.partition("=")
        value = math.nan
        with suppress(NoQuantity):
            value = quantity(number, *_UNITS.get(name, ("",))) if number else 1.0
        if name not in GOALS:
            raise _no_end(text, close_match(name, tuple(GOALS)))
        takes = "=" in GOALS[name].spelled
        if (takes is not bool(number) and name != "steady") or not _is_valid_goal(name, value):
            raise _no_end(text, _takes(name))
        if name == "steady":
            return Until("steady", forcing=value if number else 0.0)
        return Until(name, value)  # type: ignore[arg-type]

    def checked(self) -> Until:
        """The condition itself, if it is valid.

        Raises `RequestError` for a time before the start, or an invalid count.
        """
        if not _is_valid_goal(self.goal, self.value):
            raise _no_end(f"{self.goal}={self.value:g}", _takes(self.goal))
        return self


def _is_valid_goal(goal: str, value: float) -> bool:
    """Whether there is such a goal, with such a number."""
    return goal in GOALS and math.isfinite(value) and GOALS[goal].is_valid(value)


def _takes(goal: str) -> str:
    return f'"{goal}" takes {GOALS[goal].valid}' if goal in GOALS else ""


@dataclass(frozen=True)
class SimulationRequest:
    """All that a run is asked for, read; end stops and progress are the `System`'s.

    Attributes
    ----------
    start : floats with one driver, arrays (k,) with k drivers
    accuracy : target for the error of q [rad or m], or None
    method : the name asked for, "auto" among them
    step : of ``rk4`` [s] and ``euler_q`` [rad or m]
    times : further times [s] at which the answer is wanted
    watch : the user's events
    stops : the lowest and the highest `Stop` of each driver, where one lets it bounce
    apex : [s] about the middle of a flight that begins at the start, so that no step is longer
    roles : of the drivers where the run begins, None where all are free at all times
    switched : [s] an instant at which discrete signal blocks have switched already
    alternatives : goals that are watched, too: the next is that of the run where it never comes
    seconds : processor time [s] after which the run ends
    why : why this method, recorded in the result
    """

    start: Start
    until: Until
    accuracy: float | None = None
    method: str = "auto"
    step: float | None = None
    times: tuple[float, ...] = ()
    watch: tuple[Watch, ...] = ()
    stops: tuple[Any, ...] = ()
    apex: float = math.inf
    roles: Roles | None = None
    switched: float = math.nan
    why: str = ""
    alternatives: tuple[Until, ...] = ()
    seconds: float = SECONDS

    @cached_property
    def standing(self) -> Motion:
        """The motion that stays at the start; others are this one but for what they know."""
        q, qd, t = self.start
        return Motion("none", self.why, t, t, q, qd, Still(q, qd), self.accuracy)

    @property
    def span(self) -> float:
        """Time [s] after the start at which the run ends; infinite without a goal in time."""
        return self.until.value if self.until.goal == "time" else math.inf

    @property
    def t_last(self) -> float:
        """Time [s] at which the run ends; infinite without a goal in time."""
        return self.start.t + self.span

    def remaining_goal(self, t: float, events: Iterable[Event]) -> Until:
        """What ends the run from a time [s] on, after some events."""
        if self.until.goal == "time":
            return replace(self.until, value=self.t_last - t)
        if self.until.goal == "swings":
            stood = sum(event.kind == STANDSTILL for event in events)
            return replace(self.until, value=self.until.value - stood)
        return self.until

    @property
    def standstills(self) -> float:
        """How many end the run; infinite where they are not asked for."""
        counts = {"standstill": 1.0, "swings": self.until.value}
        return counts.get(self.until.goal, math.inf)

    @property
    def goals(self) -> list[float]:
        """Coordinates [rad or m] of the only driver at which the goal is met."""
        value, q = self.until.value, self.start.q
        turned = [q + value * math.tau, q - value * math.tau]
        return {"angle": [value], "turns": turned}.get(self.until.goal, [])


# -- reading what a user gave --------------------------------------------------------------


def request_of(
    scene: Scene,
    drivers: Mapping[str, str],
    until: str | Until | None = None,
    method: MotionMethod = "auto",
    accuracy: Quantity | None = None,
    times: Numbers | None = None,
    start: Pairs | None = None,
    stops: Pairs | None = None,
    watch: Sequence[Watch] = (),
    roles: RolesGiven | None = None,
    budget: Quantity | None = None,
    engine: str = "auto",
) -> tuple[SimulationRequest, Pairs]:
    """What `simulate` is asked for, read, but for its end stops; and the starts.

    ``drivers`` : unit of each driver's coordinate

    Raises `RequestError` for what cannot be.
    """
    name, step = method_of(method)
    among(ENGINES, "engine", engine, "unknown-engine", "engine")
    output_times = times_of(times)
    goal, *alternatives = goals_of(until, output_times)
    if len(drivers) > 1 and any(x.goal != "time" for x in alternatives):
        raise _no_end(str(until), "beside another goal several drivers end at a time alone")
    events = watches_of(watch)
    last = goal.value if goal.goal == "time" else math.inf
    changes = {w.name: w.then for w in events if w.then}
    at_start, bound = roles_of(scene, drivers, roles, changes, last)
    starts = starts_of(scene, drivers, start, bound, located(roles))
    target = size_of("accuracy", accuracy)
    pairs_of("stops", stops, STOPS, drivers)  # where they are, the mechanism says: see `stops_of`
    if output_times is None:
        output_times = np.linspace(0.0, goal.value, OUTPUTS) if goal.goal == "time" else np.empty(0)
    begin = start_of(starts)
    events += tuple(_watch_for(x, begin) for x in alternatives)
    settings = goal, target, name, step, tuple(output_times.tolist()), events
    if at_start is not None:
        begin = Start(np.atleast_1d(begin.q), np.atleast_1d(begin.rate))
    seconds = seconds_of(budget)
    return SimulationRequest(
        begin, *settings, roles=at_start, alternatives=tuple(alternatives), seconds=seconds
    ), starts


def start_of(starts: Pairs) -> Start:
    """Where a run begins, from coordinate and rate of each driver."""
    if len(starts) == 1:
        return Start(*map(float, *starts.values()))
    return Start(*np.array([*starts.values()], dtype=float).T.copy())


def method_of(method: MotionMethod) -> tuple[str, float | None]:
    """Name of a method, and its step where that is fixed.

    Raises `RequestError` for a method that there is not.
    """
    name, step = (method.method, method.step) if isinstance(method, FixedStep) else (method, None)
    among(NAMES if step is None else FIXED, "method", name, "method", "method")
    return name, size_of("step", step)


def goals_of(until: object, times: Floats | None) -> list[Until]:
    """What ends the run, whichever is met first; without a word the last of the times asked for,
    or the standstill.

    The first is that of the methods, all others are events of time or place.
    """
    if until is None:
        return [Until("time", float(times.max())) if times is not None else Until("standstill")]
    if isinstance(until, Until):
        return [until.checked()]
    if isinstance(until, str):
        goals = [Until.parse(text.strip()) for text in until.split(",")]
        goals.sort(key=lambda x: (x.goal in WATCHED, x.goal != "time"))
        steady = goals[0].goal == "steady"  # which is searched for, and may come before it is
        if len(goals) == 1 or (not steady and all(x.goal in WATCHED for x in goals[1:])):
            return goals
        remedy = f'beside standstill, swings or event write {listed(WATCHED)}: "standstill, time=2"'
        raise _no_end(until, remedy)
    goal = f"time={until}" if isinstance(until, float | int) else "time=2"
    if isinstance(until, Sequence):
        goal = ", ".join(map(str, until))
    raise refused("until", f"{until!r} is no stopping condition", f'write for example "{goal}"')


def _watch_for(goal: Until, start: Start) -> Watch:
    """The event of a goal that stands beside another one."""

    def surface(t: float, q: Real, rate: Real) -> float:
        if goal.goal == "time":
            return float(t - start.t - goal.value)
        if goal.goal == "angle":
            return float(q - goal.value)
        return float(abs(q - start.q) - goal.value * math.tau)

    return Watch(goal.goal, surface)


def starts_of(
    scene: Scene,
    drivers: Mapping[str, str],
    start: object,
    bound: Pairs = NO_PAIRS,
    placed: Collection[str] = (),
) -> Pairs:
    """Driver -> (q [rad or m], rate) of every driver, in their order.

    ``drivers`` : unit of each driver's coordinate
    ``bound`` : those of drivers that are not free, with which others must agree, but for starts of
    the scene of drivers that the call itself has ``placed``
    """
    overridden = pairs_of("start", start, START, drivers, "/s") or {}
    initial = {d: (x.q, x.rate) for d, x in scene.initial.items()}
    states = initial | overridden
    for d, (q, rate) in bound.items():
        pair = states.get(d, (q, rate))
        if (d in overridden or d not in placed) and not np.allclose(
            pair, (q, rate), rtol=SETTLED, atol=SETTLED
        ):
            fault = f"({pair[0]:.9g}, {pair[1]:.9g}) contradicts its role in the motion"
            remedy = f"leave it out, or let it be ({q:.9g}, {rate:.9g})"
            where = f"start.{d}" if d in overridden else scene.address("initial", d)
            raise refused(where, fault, remedy, code="roles")
    states |= bound
    missing = [d for d in drivers if d not in states]
    unknown = [d for d in states if d not in drivers]
    if missing or unknown:
        fault = f"no start for: {listed(missing)}" if missing else f"unknown: {listed(unknown)}"
        example = START.replace("crank", next(iter(drivers)))
        remedy = f"give start={example}, on the command line --start, or call start() before"
        valid = f"drivers: {listed(drivers)}"
        raise refused(scene.address("initial"), fault, remedy, valid, "no-start")
    for d, pair in overridden.items():
        if not all(abs(x) <= HIGHEST for x in pair):
            fault = f"({pair[0]:g}, {pair[1]:g}) are not two numbers of at most {HIGHEST:g}"
            raise refused(f"start.{d}", fault, "give coordinate and rate")
    return {d: states[d] for d in drivers}


def refuse_no_inertia(mechanism: Source) -> None:
    """Refuse a mechanism with a driver that accelerates nothing that has mass."""
    structure, name = mechanism.structure, mechanism.name
    massive = {link.block for link in structure.links if structure.properties(link).massive}
    moved = frozenset().union(*(structure.upstream[name] for name in massive))
    without = [driver for driver in structure.drivers if driver not in moved]
    if without:
        fault = f"no link that {listed(without)} moves has mass or inertia"
        if not moved:
            fault = "no link has mass or inertia"
        remedy = 'give links "mass" and "inertia"'
        raise refused(name, f"{fault}, so loads cause no motion", remedy, code="no-inertia")


def pairs_of(
    where: str, value: object, example: str, units: Mapping[str, str] = {}, per: str = ""
) -> dict[str, tuple[float, float]] | None:
    """Two numbers for each driver, whose coordinate is in its unit: two, or one and its rate.

    A coordinate alone is one at rest.
    """
    if value is None:
        return None
    example = example.replace("crank", next(iter(units), "crank"))
    if not isinstance(value, Mapping):
        raise refused(where, f"{value!r} names no driver", PAIRS.format(pairs=example))
    pairs = {}
    for driver, numbers in value.items():
        pair = (numbers, 0.0) if per and isinstance(numbers, float | int | str) else numbers
        try:
            unit = units.get(driver, "")
            of_pair = zip(pair, (unit, unit + per), strict=True)
            first, second = (float(in_si(x, of)) for x, of in of_pair)
        except (TypeError, ValueError) as error:
            at, valid = f"{where}.{driver}", getattr(error, "valid", "")
            fault = getattr(error, "found", f"{pair!r} are not two numbers")
            raise refused(at, fault, PAIRS.format(pairs=example), valid) from None
        pairs[driver] = (first, second)
    return pairs


def size_of(where: str, value: object) -> float | None:
    """An accuracy or a step: a number above zero, or None."""
    if value is None:
        return None
    size = number_in_si(value, "rad", "m", "s")
    if not (math.isfinite(size) and size > 0):
        raise refused(where, f"{value!r} is not a number above zero", "leave it out, or give one")
    return size


def seconds_of(budget: Quantity | None) -> float:
    """Processor time of a request: a number [s] above zero, perhaps infinite."""
    seconds = SECONDS if budget is None else number_in_si(budget, "s")
    if not seconds > 0:
        raise refused("budget", f"{budget!r} is no time above zero", "give seconds, like 60")
    return seconds


def times_of(times: object) -> Floats | None:
    """(n,) output times [s], or None."""
    if times is None:
        return None
    try:
        column = np.atleast_1d(np.asarray(in_si(times, "s"), dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        raise refused("times", "not a row of numbers", "give times like 0:2:201") from None
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all() or column.min() < 0:
        raise refused("times", "not a row of finite times from 0 s on", "give times like 0:2:201")
    return column


def watches_of(events: object) -> tuple[Watch, ...]:
    """The user's events."""
    row = (events,) if isinstance(events, Watch) else events
    if not isinstance(row, Sequence) or not all(
        isinstance(x, Watch) and callable(x.surface) for x in row
    ):
        raise refused("watch", f"{events!r} are not events", f"give {WATCH}")
    return tuple(map(_checked, row))


def _checked(watch: Watch) -> Watch:
    """The same, with mistakes of its surface reported as such; NaN where there is no state."""

    def surface(t: float, q: ArrayLike, qd: ArrayLike) -> float:
        if not (np.isfinite(q).all() and np.isfinite(qd).all()):
            return math.nan
        try:
            value = watch.surface(t, q, qd)
        except Exception as error:
            raise mistaken(f"{type(error).__name__}: {error}", t, q, qd) from error
        number = number_in_si(value)
        if math.isnan(number):
            raise mistaken(f"it gave {value!r}", t, q, qd)
        return number

    def mistaken(fault: str, t: float, q: object, qd: object) -> RequestError:
        at = f"at t = {t:.9g} s, q = {q}, rate = {qd}"
        kind = (
            "arrays, in the order of the drivers"
            if isinstance(q, np.ndarray)
            else "numbers, as of one driver"
        )
        remedy = f"q and rate are {kind}; give a number that changes its sign where the event is"
        return refused(f"watch.{watch.name}", f"{fault}, {at}", remedy, code="user-function")

    return replace(watch, surface=surface)


def _no_end(text: str, remedy: str) -> RequestError:
    fault = f'"{text}" is no stopping condition'
    valid = f"valid: {listed(g.spelled for g in GOALS.values())}"
    return refused("until", fault, remedy, valid, "until")
