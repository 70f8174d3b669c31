"""Time on a machine that does other things as well: warm repeats, median and spread."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

FEWEST, MOST = 5, 25  # warm repeats
RAN_OUT = "the budget was spent before it had run five times"
LONG_ENOUGH = 0.1  # [s] of repeats after which more of them say little


class OutOfTime(Exception):
    """A run that was stopped, as it would not have ended within its limit."""


class Timing(NamedTuple):
    """Median of warm repeats [s], the fastest and the slowest of them."""

    seconds: float
    low: float
    high: float
    repeats: int


@dataclass
class Clock:
    """What is left of a budget.

    Attributes
    ----------
    budget : [s]
    begun : reading of the clock at the start
    """

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

    def too_long(self, seconds: float) -> str:
        """Why something that is expected to take so long [s] is left out."""
        left = self.left
        if left <= 0:
            return "the budget is spent"
        return f"would take about {seconds:.2g} s, {left:.2g} s of the budget are left"


class Guard:
    """Progress of a simulation that stops it where it would not end by its limit [s].

    A batch is not begun that would last longer than what is left, by what a sample of the
    quickest batch before took. ``tripped`` tells this stop from one by the user.
    """

    def __init__(self, limit: float) -> None:
        self.end = time.perf_counter() + limit
        self.tripped = False
        self._samples, self._batch, self._at = 0.0, 0.0, 0.0
        self._each = math.inf  # [s] a sample

    def __call__(self, what: str, done: float, whole: float | None) -> None:
        """Raise `KeyboardInterrupt` where the limit would not be kept."""
        now = time.perf_counter()
        ahead = 0.0
        if what == "sampling":  # told before each batch, which is counted already
            batch = done - self._samples
            if self._batch > 0:
                self._each = min(self._each, (now - self._at) / self._batch)
                ahead = batch * self._each
            self._samples, self._batch, self._at = done, batch, now
        if now + ahead > self.end:
            self.tripped = True
            raise KeyboardInterrupt


def once(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a function returns, and how long it took [s]."""
    start = time.perf_counter()
    found = run()
    return found, time.perf_counter() - start


def timed(run: Callable[[], Any], clock: Clock) -> Timing | None:
    """Time a function that has run before, at least five times; None if time runs out first."""
    times: list[float] = []
    while len(times) < FEWEST or (len(times) < MOST and sum(times) < LONG_ENOUGH):
        if clock.left <= 0:
            if len(times) < FEWEST:
                return None
            break
        times.append(once(run)[1])
    return Timing(median(times), min(times), max(times), len(times))
