"""Trade: speed against accuracy, measured on the user's own mechanism and question."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from blockmech.errors import Problem, RequestError, close_match
from blockmech.judge.trade.points import Point, Reference, Skipped, Trade, front, order
from blockmech.judge.trade.timing import Clock

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism

__all__ = ["Point", "Reference", "Skipped", "Trade", "front", "order", "trade"]

QUESTIONS = ("run", "simulate")
BUDGET = 30.0  # [s]


def trade(
    mechanism: Mechanism,
    question: Literal["run", "simulate"] = "run",
    want: Iterable[str] | str | None = None,
    budget: float = BUDGET,
    *,
    target: float | None = None,
    within: float | None = None,
    static: bool = False,
    say: Callable[[str, int, int], None] | None = None,
    **request: Any,
) -> Trade:
    """Measure what settings cost and what they buy, for one question.

    Parameters
    ----------
    question : "run" for a sweep (with friction, where the mechanism has it), "simulate"
    want : outputs that matter; by default all of them for a sweep, and the motion of the
        drivers for a simulation
    budget : time [s] for the whole; settings that do not fit it are skipped and named, and
        where it does not hold the finest reference, or all samples, a coarser one or fewer
        of them are taken, and the notes say so
    target : error that is wanted [- or rad]
    within : longest time of one run that is wanted [s]
    static : a sweep without inertia
    say : called with what is measured now, its number and how many there are
    request : for a sweep ``at``, ``samples`` (3601), ``times``, ``rates``,
        ``accelerations``; for a simulation ``until``, ``times``, ``start``

    Returns
    -------
    Trade: points, reference and floor, Pareto front, recommendation

    Raises
    ------
    RequestError for an unknown question or output, or settings that do not fit
    """
    if question not in QUESTIONS:
        raise RequestError(
            Problem(
                "unknown-question",
                "question",
                f'no question "{question}"',
                "questions: run, simulate",
                close_match(question, QUESTIONS),
            )
        )
    for name, value in (("budget", budget), ("target", target), ("within", within)):
        if value is not None and not value > 0:
            raise RequestError(Problem("bad-value", name, f"must be > 0, got {value}", "", ""))
    names = (want,) if isinstance(want, str) else None if want is None else tuple(want)
    clock = Clock.started(budget)
    told = say or _silent
    if question == "run":
        from blockmech.judge.trade.sweep import trade_sweep

        found = trade_sweep(mechanism, names or ("*",), clock, dict(request), static, told)
    else:
        from blockmech.judge.trade.moving import trade_motion

        found = trade_motion(mechanism, names, clock, request, told)
    return replace(found, target=target, within=within, spent=clock.spent)


def _silent(what: str, number: int, count: int) -> None:
    pass
