"""Trade: speed against accuracy, measured on the user's own mechanism and question."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

from blockmech.analysis.trade.measure import (
    USELESS,
    Clock,
    Point,
    Question,
    Reference,
    Skipped,
    front,
    measured,
)
from blockmech.analysis.trade.report import Trade
from blockmech.analysis.trade.sweep import Sweep
from blockmech.dynamics.request import Until
from blockmech.ground.errors import (
    Problem,
    RequestError,
    among,
    as_names,
    listed,
)
from blockmech.ground.units import number_in_si
from blockmech.typing import Arguments, Coordinates, FrictionMethod, Numbers, Quantity

__all__ = ["Point", "Reference", "Skipped", "Trade", "front", "trade"]

REQUESTS = {
    "run": ("at", "samples", "times", "rates", "accelerations", "static"),
    "simulate": ("until", "times", "start", "friction"),
}
BUDGET = 30.0  # [s]
UNITS = {"budget": ("s",), "target": ("rad", "m", ""), "within": ("s",)}


def trade(
    mechanism: Any,
    question: Literal["run", "simulate"] = "run",
    want: Iterable[str] | str | None = None,
    budget: Quantity = BUDGET,
    *,
    target: Quantity | None = None,
    within: Quantity | None = None,
    say: Callable[[str, int, int], None] | None = None,
    at: Coordinates | None = None,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    static: bool | None = None,
    until: str | Until | None = None,
    start: Mapping[str, tuple[float, float]] | None = None,
    friction: FrictionMethod | None = None,
) -> Trade:
    """Measure time and error of all settings for one request.

    Settings run from cheap to expensive until the budget is exhausted; the rest are listed.

    Parameters
    ----------
    mechanism : a `Mechanism`
    question : "run" for a sweep (with friction, where the mechanism has it), "simulate"
    want : outputs whose error counts; by default all for a sweep, except those of friction alone,
        and the motion of the drivers for a simulation
    budget : processor time [s] in all, after which no further setting is started
    target : largest acceptable error [- or rad]
    within : longest acceptable processor time of one run [s]
    say : called with the setting being measured, its number and the number of settings
    at, samples, times, rates, accelerations, static : of a sweep, as in a run
    until, times, start, friction : of a simulation

    Returns
    -------
    Trade: points, reference and floor, Pareto front, recommendation

    Raises
    ------
    RequestError for an unknown question or output, or settings that do not fit

    >>> trade = mech.trade(want="dyad.C.p", budget=0.5)
    >>> trade.recommended in trade.points
    True
    """
    settings: Arguments = {"at": at, "samples": samples, "times": times, "rates": rates}
    settings |= {"accelerations": accelerations, "static": static, "until": until}
    settings |= {"start": start, "friction": friction}
    request = {name: x for name, x in settings.items() if x is not None}
    sizes = {"budget": budget, "target": target, "within": within}
    limits = {n: number_in_si(x, *UNITS[n]) for n, x in sizes.items() if x is not None}
    wrong = {n: sizes[n] for n, x in limits.items() if not 0 < x < math.inf}
    _refuse_mistakes(question, wrong, request)
    names = None if want is None else as_names("want", want)
    clock, report = Clock(limits["budget"]), say or (lambda *_: None)
    report("reference", 0, 0)
    trial: Question
    if question == "run":
        trial = Sweep(mechanism, names, request)
    else:
        from blockmech.analysis.trade.free_motion import FreeMotion  # loads SciPy

        trial = FreeMotion(mechanism, names, request, clock)
    if trial.reference.floor < USELESS:
        points, skipped = measured(trial, clock, report)
    else:
        why = f"the budget of {clock.budget:g} s is too small for a reference and its check"
        points, skipped = (), (Skipped("all settings", trial.notes[-1] if trial.notes else why),)
    asked = (trial.asked, trial.MEASURE, trial.COUNTED, trial.reference)
    about = (limits.get("target"), limits.get("within"), clock.spent)
    return Trade(mechanism.name, *asked, points, skipped, trial.notes, *about)


def _refuse_mistakes(question: str, limits: Mapping[str, object], names: Iterable[str]) -> None:
    """Refuse an unknown question, ``limits`` that are none, and what a question does not take."""
    among(REQUESTS, "question", question, "unknown-question", "question")
    problems = [
        Problem("bad-value", name, f"must be > 0, got {value}", "", "")
        for name, value in limits.items()
    ]
    valid = f"it takes: {listed(REQUESTS[question])}"
    for name in (name for name in names if name not in REQUESTS[question]):
        asked_by = next(q for q in REQUESTS if name in REQUESTS[q])
        remedy = f"leave it out, or ask the question {asked_by}"
        message = f"the question {question} does not take it"
        problems.append(Problem("useless-setting", name, message, valid, remedy))
    RequestError.raise_for(problems)
