"""Trade: speed against accuracy, measured on the user's own mechanism and question."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from blockmech.analysis.trade.measure import Clock
from blockmech.analysis.trade.points import Point, Reference, Skipped, front, order
from blockmech.analysis.trade.report import Trade
from blockmech.analysis.trade.run_settings import trade_run
from blockmech.errors import Problem, RequestError, close_match

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

__all__ = ["Point", "Reference", "Skipped", "Trade", "front", "order", "trade"]

REQUESTS = {
    "run": ("at", "samples", "times", "rates", "accelerations", "static"),
    "simulate": ("until", "times", "start", "friction"),
}
BUDGET = 30.0  # [s]


def trade(
    mechanism: Compiled,
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

    Settings are run from cheap to dear until the budget is spent; the rest is named.

    Parameters
    ----------
    question : "run" for a sweep (with friction, where the mechanism has it), "simulate"
    want : outputs that matter; by default all of them for a sweep, and the motion of the
        drivers for a simulation
    budget : time [s] for the whole, after which no other setting is begun
    target : error that is wanted [- or rad]
    within : longest time of one run that is wanted [s]
    static : a sweep without inertia
    say : called with what is measured now, its number and how many there are
    request : for a sweep ``at``, ``samples`` (3601, of a slow mechanism 361), ``times``,
        ``rates``, ``accelerations``; for a simulation ``until``, ``times``, ``start``,
        ``friction``

    Returns
    -------
    Trade: points, reference and floor, Pareto front, recommendation

    Raises
    ------
    RequestError for an unknown question or output, or settings that do not fit
    """
    given = request | ({"static": True} if static else {})
    _refuse_mistakes(question, {"budget": budget, "target": target, "within": within}, given)
    names = (want,) if isinstance(want, str) else None if want is None else tuple(want)
    clock, told = Clock.started(budget), say or (lambda *_: None)
    if question == "run":
        found = trade_run(mechanism, names or ("*",), clock, dict(request), static, told)
    else:
        from blockmech.analysis.trade.simulate_settings import trade_simulation  # loads SciPy

        found = trade_simulation(mechanism, names, clock, request, told)
    return replace(found, target=target, within=within, spent=clock.spent)


def _refuse_mistakes(
    question: str, limits: Mapping[str, float | None], given: Iterable[str]
) -> None:
    """Refuse an unknown question, limits that are none, and what a question does not take."""
    if question not in REQUESTS:
        raise RequestError(
            Problem(
                "unknown-question",
                "question",
                f'no question "{question}"',
                "questions: run, simulate",
                close_match(question, REQUESTS),
            )
        )
    problems = [
        Problem("bad-value", name, f"must be > 0, got {value}", "", "")
        for name, value in limits.items()
        if value is not None and not 0 < value < math.inf
    ]
    known = REQUESTS[question]
    problems += [
        Problem(
            "useless-setting",
            name,
            f"the question {question} does not take it",
            f"it takes: {', '.join(known)}",
            _elsewhere(name, question) or close_match(name, known) or "leave it out",
        )
        for name in given
        if name not in known
    ]
    if problems:
        raise RequestError(problems)


def _elsewhere(name: str, question: str) -> str:
    """The question that takes a setting, as a remedy."""
    other = [q for q, known in REQUESTS.items() if q != question and name in known]
    return f"leave it out, or ask the question {other[0]}" if other else ""
