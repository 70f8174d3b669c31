"""Candidates measured one after the other, as far as a budget goes.

What a run will cost is predicted from its kernel evaluations before it is made. What does
not fit what is left, with its repeats, is skipped and named; what turns out dearer than
it may be is stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from blockmech.analysis.trade.points import Point, Skipped
from blockmech.analysis.trade.timing import FEWEST, RAN_OUT, Clock, OutOfTime, once, timed
from blockmech.errors import RequestError
from blockmech.result import Result

Said = Callable[[str, int, int], None]  # what is measured now, its number, of how many
Measured = tuple[tuple[Point, ...], tuple[Skipped, ...]]
RUNS = FEWEST + 1  # of a setting: a cold one, and the fewest warm ones


class Candidate(NamedTuple):
    """One setting: how it is named, how it is run, and its steps if it has a number of them."""

    method: str
    setting: str
    options: Mapping[str, Any]
    steps: int = 0

    @property
    def label(self) -> str:
        """Method and setting in words."""
        return f"{self.method}, {self.setting}" if self.setting else self.method


class Bench(Protocol):
    """A question whose settings can be run, judged and foretold."""

    def expected(self, candidate: Candidate) -> float:
        """Time of one run [s] before it is made; 0 where nothing is known."""
        ...

    def run(self, candidate: Candidate, limit: float | None = None) -> Result:
        """One run; raises `OutOfTime` where it would take longer than a limit [s]."""
        ...

    def seen(self, candidate: Candidate, seconds: float, result: Result | None) -> None:
        """Learn what a run took [s]; no result where it was stopped."""
        ...

    def evaluations(self, result: Result) -> int:
        """Kernel evaluations of a run."""
        ...

    def error(self, result: Result) -> float:
        """Difference of a run to the reference [-]."""
        ...


def measured(
    bench: Bench, candidates: Sequence[Candidate], floor: float, clock: Clock, say: Said
) -> Measured:
    """Points of the candidates that apply and fit the budget; Ctrl-C keeps what is done."""
    points: list[Point] = []
    skipped: list[Skipped] = []
    refused: set[str] = set()
    for i, c in enumerate(candidates):
        if c.method in refused:
            continue
        try:
            say(c.label, i, len(candidates))
            found = _point(bench, c, floor, clock)
        except RequestError as refusal:
            refused.add(c.method)
            skipped.append(Skipped(c.method, f"does not apply: {refusal.problems[0].found}"))
        except KeyboardInterrupt:
            skipped += [Skipped(r.label, "interrupted") for r in candidates[i:]]
            break
        else:
            if isinstance(found, Point):
                points.append(found)
            else:
                skipped.append(Skipped(c.label, found))
    return tuple(points), tuple(skipped)


def _point(bench: Bench, c: Candidate, floor: float, clock: Clock) -> Point | str:
    """A candidate measured, or why it is skipped."""
    expected = RUNS * bench.expected(c)
    left = clock.left
    if expected > left or left <= 0:
        return clock.too_long(expected)
    limit = left / RUNS
    try:
        result, cold = once(lambda: bench.run(c, limit))
    except OutOfTime:
        bench.seen(c, limit, None)
        return f"takes longer than {limit:.2g} s, so six runs do not fit the budget"
    bench.seen(c, cold, result)
    if FEWEST * cold > clock.left:
        return clock.too_long(FEWEST * cold)
    took = timed(lambda: bench.run(c), clock)
    if took is None:
        return RAN_OUT
    bench.seen(c, took.seconds, result)
    error, count = bench.error(result), bench.evaluations(result)
    options = dict(c.options)
    return Point(c.method, c.setting, *took, count, max(error, floor), options, error < floor)
