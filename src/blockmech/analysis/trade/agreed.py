"""The reference of a simulation: the finest method that applies, checked by another one.

Both get a share of the budget. What does not end in its share is stopped: refinement keeps
the finest run it has, with that run's own estimate, and that is the reference then. It is
coarser, its floor is higher, and the trade says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.trade.errors import Yardstick, yardstick
from blockmech.analysis.trade.points import Reference
from blockmech.analysis.trade.timing import Clock, Guard, OutOfTime, once
from blockmech.dynamics.simulation import simulate
from blockmech.errors import RequestError
from blockmech.result import Result

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.motion import Motion

FINEST = (("energy", 1e-14), ("spectral", 1e-14), ("dop853", 1e-13))  # references, best first
CHECKS = {"energy": ("dop853", 1e-13), "spectral": ("dop853", 1e-13), "dop853": ("radau", 1e-11)}
CHEAPER = ("lsoda", 1e-12)  # check where that one would not fit the budget, or does not apply
IMPLICIT = 10.0  # evaluations of radau against those of dop853 at the same accuracy; seen: 8 to 14
SHARE = 0.3  # of the budget for the reference, and for its check
LEAST = 100  # evaluations of the coarsest run that is of any use
UNSURE = 1.0  # floor from which on nothing is claimed


class Question(NamedTuple):
    """A simulation that is asked for: until when, what is wanted, from where."""

    mechanism: Compiled
    request: Mapping[str, Any]
    want: tuple[str, ...]

    def run(self, limit: float | None = None, **options: Any) -> Result:
        """The simulation with some settings, through the public call.

        Raises
        ------
        KeyboardInterrupt : it was interrupted; half a run cannot be compared
        OutOfTime : it would take longer than a limit [s]
        """
        result = self.within(limit, **options)
        if was_stopped(motion_of(result)):
            raise OutOfTime
        return result

    def within(self, limit: float | None, **options: Any) -> Result:
        """The same, but what was done within the limit is given back, its end "interrupted"."""
        given = dict(self.request)
        guard = None if limit is None else Guard(limit)
        until = given.pop("until", None)
        result = simulate(self.mechanism, until, want=self.want, progress=guard, **given, **options)
        if was_stopped(motion_of(result)) and not (guard and guard.tripped):
            raise KeyboardInterrupt
        return result


class Tried(NamedTuple):
    """A run that may be the reference, or its check; time in [s]."""

    method: str
    accuracy: float
    result: Result
    seconds: float
    whole: bool

    @property
    def error(self) -> float:
        """What it estimates of itself [rad or m]."""
        return float(motion_of(self.result).error)

    @property
    def stopped(self) -> bool:
        """Whether time ended it on its way to something finer."""
        return was_stopped(motion_of(self.result))

    @property
    def rate(self) -> float:
        """Seconds a kernel evaluation."""
        return self.seconds / max(1, motion_of(self.result).cost.evaluations)

    @property
    def name(self) -> str:
        """Method and accuracy in words."""
        if self.stopped:
            return f"{self.method}, stopped at an estimate of {self.error:.0e}"
        return f"{self.method} at {self.accuracy:g}"


class Agreed(NamedTuple):
    """A reference with its yardstick, and what it took.

    question : what was asked, with the times at which runs are compared
    rates : method -> seconds a kernel evaluation
    """

    question: Question
    best: Result
    reference: Reference
    stick: Yardstick
    notes: tuple[str, ...]
    rates: dict[str, float]


def was_stopped(motion: Motion) -> bool:
    """Whether a run was ended before it was as fine as asked for."""
    from blockmech.dynamics.motion import INTERRUPTED

    return motion.end == INTERRUPTED


def motion_of(result: Result) -> Motion:
    """How a simulation moved."""
    found: Motion = result.motion  # it comes from a simulation
    return found


def agreed(question: Question, count: int, clock: Clock) -> Agreed | str:
    """The reference of a question and its check, or why the budget holds none.

    Where no times are asked for, runs are compared at so many over the whole motion. Of the
    two runs that which is surer of itself is the reference, the other one its check.
    """
    from blockmech.dynamics.simulation import result_along

    first = _finest(question, clock)
    if first is None:
        return f"no run ends within {SHARE:.0%} of it"
    moved = motion_of(first.result)
    if question.request.get("times") is None:
        times = moved.times(count if moved.t_end > moved.t_start else 1)
        question = question._replace(request={**question.request, "times": times})
        again = result_along(question.mechanism, moved, times, question.want)
        first = first._replace(result=again)
    second = _checked(question, first, SHARE * clock.left)
    if second is None:
        return "no second method that checks the reference ends within it"
    best, check = sorted((first, second), key=lambda tried: tried.error)
    stick = yardstick(best.result, best.result, np.ones(best.result.n, dtype=bool))
    gap = distance(stick, check.result, best.result)
    floor = max(gap, best.error, float(np.finfo(float).eps))
    doubts = _stopped(best, check, clock)
    if gap > 10 * (best.error + check.error):
        doubts += (
            f"reference and check differ by {gap:.1g}, more than they estimate of themselves "
            f"({best.error:.1g} and {check.error:.1g})",
        )
    rates = {tried.method: tried.rate for tried in (best, check)}
    return Agreed(
        question, best.result, Reference(best.name, check.name, floor), stick, doubts, rates
    )


def _stopped(best: Tried, check: Tried, clock: Clock) -> tuple[str, ...]:
    """What was not carried to its end."""
    both = (("reference", best), ("check of the reference", check))
    stopped = [name for name, tried in both if tried.stopped]
    if not stopped:
        return ()
    return (f"the budget of {clock.budget:g} s holds no finer {' and no finer '.join(stopped)}",)


def _no_motion(best: Result) -> Any:
    from blockmech.errors import Problem

    remedy = 'say until when, e.g. until="time=2"'
    moved = motion_of(best)
    return Problem("no-motion", "trade", moved.end, "; ".join(moved.notes), remedy)


def _finest(question: Question, clock: Clock) -> Tried | None:
    """The run by the finest method that applies, as fine as its share of the budget allows."""
    refusals: list[RequestError] = []
    for method, accuracy in FINEST:
        try:
            tried = _tried(question, method, accuracy, SHARE * clock.left)
        except RequestError as error:
            refusals.append(error)
            continue
        if motion_of(tried.result).status == "failed":
            raise RequestError(_no_motion(tried.result))
        if tried.whole:
            return tried
    if len(refusals) == len(FINEST):
        raise refusals[-1]
    return None


def _tried(question: Question, method: str, accuracy: float, limit: float) -> Tried:
    result, seconds = once(lambda: question.within(limit, method=method, accuracy=accuracy))
    return Tried(method, accuracy, result, seconds, _whole(motion_of(result), question))


def _whole(motion: Motion, question: Question) -> bool:
    """Whether a motion is of any use, though it may have been stopped on its way to a finer one."""
    from blockmech.dynamics.request import Until

    if not was_stopped(motion):
        return True
    if motion.method == "none" or not math.isfinite(motion.error):
        return False
    until, times = (question.request.get(name) for name in ("until", "times"))
    goal = Until.parse(until) if isinstance(until, str) else until
    if goal is None and times is not None:
        return motion.t_end >= float(np.max(times))
    if goal is not None and goal.goal == "time":
        return motion.t_end >= motion.t_start + float(goal.value)
    return motion.method != "spectral"  # which goes along the way once, and stops there


def _checked(question: Question, first: Tried, limit: float) -> Tried | None:
    """The run that checks the first one, by another method."""
    other = CHECKS[first.method]
    dear = other[0] == "radau" and IMPLICIT * first.seconds > limit / 2
    for method, accuracy in (CHEAPER,) if dear else (other, CHEAPER):
        # What the first one does not end in, half of the time, would else be lost for both.
        own = limit if (method, accuracy) == CHEAPER else limit / 2
        try:
            tried = _tried(question, method, accuracy, own)
        except RequestError:  # several drivers, or loads that this one cannot follow
            continue
        if tried.whole:
            return tried
        limit -= tried.seconds
        if limit <= 0:
            break
    return None


def distance(stick: Yardstick, found: Result, best: Result) -> float:
    """Error of a run: of its outputs at the common times, and of its end.

    Where an event ends the run, its time counts, relative to the time of the run.
    """
    n = min(found.n, best.n)
    if n == 0:
        return math.inf
    values = {k: v[:n] if len(v) == best.n else v for k, v in stick.values.items()}
    part = replace(stick, values=values, good=stick.good[:n])
    error = part.error(Cut(found, n))
    moved, wanted = motion_of(found), motion_of(best)
    late, span = abs(moved.t_end - wanted.t_end), wanted.t_end - wanted.t_start
    if wanted.end != "time" and span > 0:
        error = max(error, late / span)
    return error if n == best.n or wanted.end != "time" else math.inf


class Cut:
    """The first samples of a result, for reading."""

    def __init__(self, result: Result, n: int) -> None:
        self.result, self.n = result, n

    def __getitem__(self, name: str) -> Any:
        return np.atleast_1d(self.result[name])[: self.n]

    def output(self, name: str) -> Any:
        """Declaration of an output."""
        return self.result.output(name)
