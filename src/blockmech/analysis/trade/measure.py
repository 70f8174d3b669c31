"""Settings measured one after the other, from cheap to dear, until a budget is spent."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from blockmech.ground.errors import BlockmechError
from blockmech.result.result import Result
from blockmech.typing import Arguments

FEWEST = 5  # warm repeats: of fewer the least time says little
COARSEST = 20 * time.get_clock_info("process_time").resolution  # [s] that can be told
NOISE = 0.05  # of a time, by which least times of alternating runs differ by chance
USELESS = 1.0  # error as large as the answer itself [- or rad]
SPENT = "the budget is spent"

Say = Callable[[str, int, int], None]  # what is measured now, its number, of how many


@dataclass(frozen=True)
class Setting:
    """A way to run: names such as "successive", "3 iterations", and arguments that run it."""

    method: str
    setting: str = ""
    options: Arguments = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Method and setting in words."""
        return f"{self.method}, {self.setting}" if self.setting else self.method


@dataclass(frozen=True, kw_only=True)
class Point(Setting):
    """One setting, measured.

    Attributes
    ----------
    seconds, slowest, repeats : least processor time [s] of the warm repeats, which alternate with
        those of other settings, the largest, and how many; of none it is that of the first run,
        which also plans and compiles
    evaluations : kernel evaluations of one run, see `Trade.counted`
    error : measured error [-] or [rad], never below the floor
    worst : the output that has it
    at_floor : whether the measured difference lay below the floor
    same : finer settings of the method that give the same answer at the same cost
    """

    seconds: float
    slowest: float
    repeats: int
    evaluations: int
    error: float
    worst: str = ""
    at_floor: bool = False
    same: tuple[str, ...] = ()

    @property
    def span(self) -> str:
        """The setting, to the finest one that gives the same."""
        finest = [last.split()[-1] for last in self.same[-1:]]
        return " to ".join(filter(None, (self.setting, *finest)))


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
        below it is claimed; infinite where there is none
    """

    method: str = "nothing"
    check: str = "nothing"
    floor: float = math.inf


class Clock:
    """What is left of a budget [s] of processor time that begins now.

    Processor time of this process: what else the machine does counts neither for the budget nor
    for a setting. ``now`` says it.
    """

    def __init__(self, budget: float, now: Callable[[], float] = time.process_time) -> None:
        self.budget, self.now, self.begun = budget, now, now()

    @property
    def spent(self) -> float:
        """Time since the start [s]."""
        return self.now() - self.begun

    @property
    def left(self) -> float:
        """What is left [s]; negative when the budget is spent."""
        return self.budget - self.spent


class Question(ABC):
    """What every setting is asked, and how its answer is judged.

    Attributes
    ----------
    asked : in words
    reference : what answers are judged against
    notes : remarks for the reader
    MEASURE, COUNTED : what the error is and what the evaluations are, in words
    """

    MEASURE: ClassVar[str]
    COUNTED: ClassVar[str]

    asked: str
    reference: Reference = Reference()
    notes: tuple[str, ...] = ()

    @abstractmethod
    def settings(self) -> Iterable[Setting]:
        """What is tried, from cheap to dear."""

    @abstractmethod
    def run(self, options: Arguments, seconds: float) -> Result | None:
        """The answer of a setting; None where it took longer than the seconds allowed."""

    @abstractmethod
    def evaluations(self, result: Result) -> int:
        """Kernel evaluations of a run."""

    @abstractmethod
    def error(self, result: Result) -> tuple[float, str]:
        """Difference of a run to the reference [- or rad], and the output that decides it."""


def measured(
    question: Question, clock: Clock, say: Say
) -> tuple[tuple[Point, ...], tuple[Skipped, ...]]:
    """Points of the settings that apply and fit the budget; Ctrl-C keeps what is done.

    Every setting is run, once more where that takes little, then all of them take turns while the
    budget lasts.
    """
    settings = tuple(question.settings())
    points: dict[tuple[Hashable, ...], Point] = {}  # by method, cost and answer
    skipped: list[Skipped] = []
    refused: set[str] = set()  # methods of which no finer setting is tried
    try:
        for i, setting in enumerate(settings):
            if setting.method in refused:
                continue
            rest = settings[i:]
            try:
                say(setting.label, i, len(settings))
                answer, seconds = _timed(question, setting, clock)
            except BlockmechError as refusal:
                refused.add(setting.method)
                why = f"does not apply: {refusal.problems[0].found}"
                skipped.append(Skipped(setting.method, why))
            else:
                if answer is None:
                    skipped.append(Skipped(setting.label, SPENT))
                    continue
                if seconds < clock.left:  # what is compiled once is no cost of a run
                    seconds = min(seconds, _timed(question, setting, clock)[1])
                (error, worst), floor = question.error(answer), question.reference.floor
                point = Point(
                    **vars(setting),
                    seconds=seconds,
                    slowest=seconds,
                    repeats=1,
                    evaluations=question.evaluations(answer),
                    error=max(error, floor),
                    worst=worst,
                    at_floor=error < floor,
                )
                key = point.method, point.evaluations, _digest(answer)
                if key in points:
                    coarser = points[key]
                    points[key] = replace(coarser, same=(*coarser.same, setting.setting))
                else:
                    points[key] = point
    except KeyboardInterrupt:
        skipped += [Skipped(unmeasured.label, "interrupted") for unmeasured in rest]
        return tuple(points.values()), tuple(skipped)
    return tuple(_repeated(question, list(points.values()), clock)), tuple(skipped)


def _digest(answer: Result) -> int:
    """A hash of all numbers of an answer."""
    return hash(b"".join(np.asarray(answer[name]).tobytes() for name in answer))


def _repeated(question: Question, points: list[Point], clock: Clock) -> list[Point]:
    """Points with the times of warm runs, as far as the budget lasts.

    Settings take turns, from cheap to dear, so that what disturbs one disturbs all.
    """
    times: list[list[float]] = [[] for _ in points]
    pending = sorted(range(len(points)), key=lambda i: points[i].seconds)
    with suppress(KeyboardInterrupt):  # what is measured so far stays
        while pending:
            for i in pending:
                again, seconds = _timed(question, points[i], clock)
                if again is None:
                    raise KeyboardInterrupt
                times[i].append(seconds)
            pending = [i for i in pending if not _is_settled(times[i])]
    return [
        replace(point, seconds=min(row), slowest=max(row), repeats=len(row)) if row else point
        for point, row in zip(points, times, strict=True)
    ]


def _is_settled(times: list[float]) -> bool:
    """Whether the least of some times is confirmed by the second least, within the noise."""
    least, second, *_ = sorted([*times, math.inf])
    return len(times) >= FEWEST and second <= (1 + NOISE) * least


def _timed(question: Question, setting: Setting, clock: Clock) -> tuple[Result | None, float]:
    """A run, None where the budget ends before it does, and the time [s] that it took.

    It is run again until the clock can tell.
    """
    start, runs, spent = clock.now(), 0, 0.0
    while spent <= COARSEST:
        allowed = clock.left
        answer = question.run(setting.options, allowed) if allowed > 0 else None
        runs, spent = runs + 1, clock.now() - start
        if answer is None:
            break
    return answer, spent / runs


def cheaper(a: Point, b: Point, cost: str = "seconds") -> bool:
    """Whether a point costs less than another: a time beyond the noise."""
    return bool(getattr(a, cost) < getattr(b, cost) * (1 - NOISE * (cost == "seconds")))


def front(points: Sequence[Point], cost: str) -> tuple[Point, ...]:
    """Points that no other beats in both cost and error, and whose error leaves an answer."""

    def beaten(p: Point) -> bool:
        return any(
            (q.error <= p.error and cheaper(q, p, cost))
            or (q.error < p.error and not cheaper(p, q, cost))
            for q in points
        )

    unbeaten = (p for p in points if p.error < USELESS and not beaten(p))
    return tuple(sorted(unbeaten, key=lambda p: (getattr(p, cost), p.error)))
