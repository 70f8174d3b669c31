"""The trade as data: measured points, what they are measured against, and the choice."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

USUAL = 1e-9  # target where neither a target nor a time limit is given
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


@dataclass(frozen=True)
class Trade:
    """Speed against accuracy for one question, measured.

    Attributes
    ----------
    mechanism : its name
    question : what was asked, in words
    measure : what the error is, in words
    counted : what the evaluations are, in words
    reference : what errors are measured against
    points : measured settings, method by method
    skipped : settings left out, with the reason
    notes : what a reader must know
    target, within : the wanted error, and the longest time of a run [s], or None
    spent : time that the whole took [s]
    judged : where errors are known, if not at all samples: "at 9 of the 361 samples"
    """

    mechanism: str
    question: str
    measure: str
    counted: str
    reference: Reference
    points: tuple[Point, ...]
    skipped: tuple[Skipped, ...] = ()
    notes: tuple[str, ...] = ()
    target: float | None = None
    within: float | None = None
    spent: float = 0.0
    judged: str = ""

    @property
    def pareto(self) -> tuple[Point, ...]:
        """Points that no other beats in both time and error, from fast to exact."""
        return front(self.points, "seconds")

    @property
    def pareto_by_evaluations(self) -> tuple[Point, ...]:
        """The same with kernel evaluations as the cost."""
        return front(self.points, "evaluations")

    def best(self, target: float | None = None, within: float | None = None) -> Point | None:
        """The setting to take for a target error, a time limit [s], or both; None without any.

        Within the target the fewest evaluations count, and among those within a factor
        1.5 of them the time, as far as it tells them apart: of those whose spreads overlap
        that of the fastest, the fewest evaluations again, then the smaller error if its
        quickest run is as quick. Without a target, 1e-9 is taken, or, if a time limit is
        given, the most exact setting; those within a factor 10 of it count as equal.
        """
        fit = [p for p in self.points if math.isfinite(p.error)]
        fit = [p for p in fit if within is None or p.seconds <= within]
        if target is None and within is None:
            target = USUAL
        if target is None:
            target = 10 * min((p.error for p in fit), default=math.inf)
        fit = [p for p in fit if p.error <= target]
        fewest = min((p.evaluations for p in fit), default=0)
        few = [p for p in fit if p.evaluations <= NEARLY * fewest]
        quickest = min((p.low for p in few), default=0.0)
        return min(
            _as_fast(few),
            key=lambda p: (p.evaluations, p.low > ALIKE * quickest, p.error),
            default=None,
        )

    @property
    def recommended(self) -> Point | None:
        """The setting to take for this trade's own target and time limit."""
        return self.best(self.target, self.within)

    @property
    def recommendation(self) -> str:
        """The choice in one sentence."""
        from blockmech.analysis.trade.report import sentence

        return sentence(self)

    def series(self) -> dict[str, list[Point]]:
        """Points by method, in the order measured."""
        found: dict[str, list[Point]] = {}
        for point in self.points:
            found.setdefault(point.method, []).append(point)
        return found

    def text(self) -> str:
        """The trade as a table with its recommendation."""
        from blockmech.analysis.trade.report import text

        return text(self)

    def to_dict(self) -> dict[str, Any]:
        """The trade as JSON data."""
        from blockmech.analysis.trade.report import to_dict

        return to_dict(self)

    def to_csv(self, path: str | os.PathLike[str] | None = None) -> str:
        """The points as CSV text, written to a file if a path is given."""
        from blockmech.analysis.trade.report import to_csv

        return to_csv(self, path)

    def plot(self, path: str | os.PathLike[str]) -> Path:
        """Draw the work-precision diagram (png, svg or pdf)."""
        from blockmech.draw.trade import draw_trade

        return draw_trade(self, path)

    def __str__(self) -> str:
        return self.text()


def _as_fast(points: Sequence[Point]) -> list[Point]:
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
