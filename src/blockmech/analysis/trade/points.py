"""Measured settings, what they are measured against, and which of them are worth having."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

UNSURE = 1.0  # floor from which on nothing is claimed
NEARLY = 1.5  # counts of evaluations within this factor are left to the stopwatch
ALIKE = 1.25  # quickest runs within this factor are as quick


@dataclass(frozen=True)
class Point:
    """One setting, measured.

    Attributes
    ----------
    method, setting : names, e.g. "successive", "3 iterations"
    seconds, low, high, repeats : median of the warm repeats [s], fastest, slowest, how many
    evaluations : kernel evaluations of one run, see `Trade.counted`
    error : measured error [-] or [rad], never below the floor
    options : arguments that run this setting again
    below : whether the measured difference lay below the floor
    """

    method: str
    setting: str
    seconds: float
    low: float
    high: float
    repeats: int
    evaluations: int
    error: float
    options: Mapping[str, Any] = field(default_factory=dict)
    below: bool = False

    @property
    def label(self) -> str:
        """Method and setting in words."""
        return f"{self.method}, {self.setting}" if self.setting else self.method


@dataclass(frozen=True)
class Skipped:
    """A setting that was not measured, and why."""

    label: str
    why: str


@dataclass(frozen=True)
class Reference:
    """What errors are measured against.

    Attributes
    ----------
    method : how it was computed
    check : the second method that confirms it
    floor : the larger of its own estimate and the disagreement of the two: no error
        below it is claimed; infinite where there is none, see `NOTHING`
    """

    method: str
    check: str
    floor: float


NOTHING = Reference("nothing", "nothing", math.inf)  # where the budget holds no reference


def as_fast(points: Sequence[Point]) -> list[Point]:
    """The fastest point, and those that the stopwatch cannot tell from it.

    One slow run of the fastest does not make everything as fast as it: what never took
    less than 1.5 times its median is slower.
    """
    fastest = min(points, key=lambda p: p.seconds, default=None)
    if fastest is None:
        return []
    bound = min(fastest.high, NEARLY * fastest.seconds)
    return [p for p in points if p.low <= bound]


def front(points: Iterable[Point], cost: str) -> tuple[Point, ...]:
    """Points that no other beats in both cost and error."""
    found: list[Point] = []
    for point in sorted(points, key=lambda p: (getattr(p, cost), p.error)):
        if math.isfinite(point.error) and (not found or point.error < found[-1].error):
            found.append(point)
    return tuple(found)


def order(points: Sequence[Point], steps: Sequence[float], floor: float = 0.0) -> float:
    """Observed order of a refining method: slope of log error over log step.

    Only errors ten times above the floor count. NaN with fewer than two of them.
    """
    kept = [
        (math.log(h), math.log(p.error))
        for p, h in zip(points, steps, strict=True)
        if 10 * floor < p.error < math.inf
    ]
    if len(kept) < 2:
        return math.nan
    mx = sum(x for x, _ in kept) / len(kept)
    my = sum(y for _, y in kept) / len(kept)
    return sum((x - mx) * (y - my) for x, y in kept) / sum((x - mx) ** 2 for x, _ in kept)
