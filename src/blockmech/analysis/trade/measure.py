"""Settings measured one after the other, from cheap to dear, until a budget is spent."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

from blockmech.analysis.trade.points import Point, Skipped
from blockmech.errors import RequestError
from blockmech.result import Result

FEWEST, MOST = 5, 25  # warm repeats
LONG_ENOUGH = 0.1  # [s] of repeats after which more of them say little
SPENT = "the budget is spent"

Said = Callable[[str, int, int], None]  # what is measured now, its number, of how many


class Candidate(NamedTuple):
    """One setting: how it is named, and how it is run."""

    method: str
    setting: str
    options: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Method and setting in words."""
        return f"{self.method}, {self.setting}" if self.setting else self.method


class Question(NamedTuple):
    """How a setting is run, counted and judged.

    Attributes
    ----------
    run : a setting and the moment of `Clock` that ends it -> its result; None where it was
        stopped
    evaluations : kernel evaluations of a run
    error : difference of a run to the reference [-]
    """

    run: Callable[[Candidate, float], Result | None]
    evaluations: Callable[[Result], int]
    error: Callable[[Result], float]


@dataclass
class Clock:
    """What is left of a budget [s], begun at a reading of the clock."""

    budget: float
    begun: float

    @classmethod
    def started(cls, budget: float) -> Clock:
        """A clock that starts now."""
        return cls(budget, time.perf_counter())

    @property
    def spent(self) -> float:
        """Time since the start [s]."""
        return time.perf_counter() - self.begun

    @property
    def left(self) -> float:
        """What is left [s]; negative when the budget is spent."""
        return self.budget - self.spent


def measured(
    question: Question, candidates: Sequence[Candidate], floor: float, clock: Clock, say: Said
) -> tuple[tuple[Point, ...], tuple[Skipped, ...]]:
    """Points of the settings that apply and fit the budget; Ctrl-C keeps what is done."""
    points: list[Point] = []
    skipped: list[Skipped] = []
    closed: set[str] = set()  # methods of which no finer setting is tried
    for i, c in enumerate(candidates):
        if c.method in closed:
            continue
        try:
            say(c.label, i, len(candidates))
            found = _point(question, c, floor, clock)
        except RequestError as refusal:
            closed.add(c.method)
            skipped.append(Skipped(c.method, f"does not apply: {refusal.problems[0].found}"))
        except KeyboardInterrupt:
            skipped += [Skipped(r.label, "interrupted") for r in candidates[i:]]
            break
        else:
            if found is None:
                skipped.append(Skipped(c.label, SPENT))
            else:
                points.append(found)
    return tuple(points), tuple(skipped)


def _point(question: Question, c: Candidate, floor: float, clock: Clock) -> Point | None:
    """A setting measured: a cold run, then warm ones; None where the budget ends before five."""
    end = clock.begun + clock.budget
    if clock.left <= 0:
        return None
    result = question.run(c, end)
    if result is None:
        return None
    times: list[float] = []
    while len(times) < FEWEST or (len(times) < MOST and sum(times) < LONG_ENOUGH):
        if clock.left <= 0:
            if len(times) < FEWEST:
                return None
            break
        begun = time.perf_counter()
        if question.run(c, end) is None:
            return None
        times.append(time.perf_counter() - begun)
    error, took = question.error(result), (median(times), min(times), max(times), len(times))
    count = question.evaluations(result)
    return Point(
        c.method, c.setting, *took, count, max(error, floor), dict(c.options), error < floor
    )
