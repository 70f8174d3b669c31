"""Time on a machine that does other things as well: warm repeats, median and spread."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

FEWEST, MOST = 5, 25  # warm repeats
RAN_OUT = "the budget was spent before it had run five times"
LONG_ENOUGH = 0.1  # [s] of repeats after which more of them say little


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
