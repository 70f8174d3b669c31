"""The trade of a simulation: every method that applies, over its settings.

The methods are those of `blockmech.dynamics`; the reference is the finest of them and
is checked by one of another kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.errors import RequestError
from blockmech.judge.trade.errors import Yardstick, yardstick
from blockmech.judge.trade.points import Point, Reference, Skipped, Trade
from blockmech.judge.trade.timing import FEWEST, RAN_OUT, Clock, once, timed
from blockmech.result import Result

if TYPE_CHECKING:
    from blockmech.dynamics.motion import Motion
    from blockmech.mechanism import Mechanism

Said = Callable[[str, int, int], None]

MOTION = ("*.q", "*.rate")
TIMES = 21  # at which runs are compared, where none are named
FINEST = (("energy", 1e-15), ("spectral", 1e-14), ("dop853", 1e-13))  # references, best first
CHECKS = {"energy": ("dop853", 1e-13), "spectral": ("dop853", 1e-13), "dop853": ("radau", 1e-11)}
CHEAPER = ("lsoda", 1e-12)  # check where that one would not fit the budget, or does not apply
CHECK_COSTS, SHARE = 5.0, 0.3  # of a check, in times of the reference; of the budget it may take
ADAPTIVE = {
    "energy": (1e-3, 1e-6, 1e-9, 1e-12),
    "spectral": (1e-3, 1e-6, 1e-9, 1e-12),
    "lsoda": (1e-3, 1e-5, 1e-7, 1e-9),
    "dop853": (1e-3, 1e-6, 1e-9, 1e-11),
    "radau": (1e-3, 1e-6),
}
PARTS = {"rk4": (100, 200, 400, 800), "euler_q": (100, 1000, 10_000)}  # steps of a run
DEARER = 3.0  # the next finer setting of a method against the last one
IMPLICIT = 10.0  # radau's coarsest setting against that of dop853; measured 8 to 14


class Candidate(NamedTuple):
    """One setting: how it is named and how it is run."""

    method: str
    setting: str
    options: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Method and setting in words."""
        return f"{self.method}, {self.setting}"


class Question(NamedTuple):
    """A simulation that is asked for: until when, what is wanted, from where."""

    mechanism: Mechanism
    request: Mapping[str, Any]
    want: tuple[str, ...]

    def run(self, **options: Any) -> Result:
        """The simulation with some settings, through the public call.

        Raises `KeyboardInterrupt` where it was interrupted: half a run cannot be compared.
        """
        given = dict(self.request)
        until = given.pop("until", None)
        result = self.mechanism.simulate(until, want=self.want, **given, **options)
        if _motion(result).end == "interrupted":
            raise KeyboardInterrupt
        return result


def trade_motion(
    mechanism: Mechanism,
    want: tuple[str, ...] | None,
    clock: Clock,
    request: Mapping[str, Any],
    say: Said,
) -> Trade:
    """Measure the settings of `Mechanism.simulate` for one request; see `trade`."""
    given = dict(request)
    notes: tuple[str, ...] = ()
    if any(b.friction for b in mechanism.structure.blocks.values()):
        given.setdefault("friction", "none")
        notes = ("joint friction is left out of the motion",)
    question = Question(mechanism, given, want or MOTION)
    say("reference", 0, 0)
    (best, method), seconds = once(lambda: _finest(question))
    if _motion(best).status == "failed":
        raise RequestError(_no_motion(best))
    if given.get("times") is None:
        times = np.linspace(_motion(best).t_start, _motion(best).t_end, TIMES)
        question = question._replace(request=given | {"times": times})
        best = question.run(method=method, accuracy=dict(FINEST)[method])
    fits = CHECK_COSTS * seconds <= SHARE * clock.left
    reference, stick, doubts = _reference(question, best, method, fits)
    candidates = _coarse_first(_candidates(best, len(mechanism.drivers)))
    points, skipped = _measured(question, candidates, reference, stick, best, clock, say)
    names = ", ".join(best) if len(best) <= 3 else f"{len(best)} outputs"
    goal = given.get("until") or f"{_motion(best).end}"
    return Trade(
        mechanism.name,
        f"simulate until {goal}: {names} at {best.n} times",
        "largest error of any output at any of these times, relative to the output's largest "
        "magnitude (angles in rad)",
        "samples of the reduced inertia and load, in batches or single",
        reference,
        points,
        skipped,
        notes + doubts,
    )


def _motion(result: Result) -> Motion:
    assert result.motion is not None  # it comes from a simulation
    return result.motion


def _no_motion(best: Result) -> Any:
    from blockmech.errors import Problem

    remedy = 'say until when, e.g. until="time=2"'
    return Problem("no-motion", "trade", _motion(best).end, "; ".join(_motion(best).notes), remedy)


def _finest(question: Question) -> tuple[Result, str]:
    """The run by the finest method that applies."""
    refusals = []
    for method, accuracy in FINEST:
        try:
            return question.run(method=method, accuracy=accuracy), method
        except RequestError as error:
            refusals.append(error)
    raise refusals[-1]


def _reference(
    question: Question, best: Result, method: str, fits: bool
) -> tuple[Reference, Yardstick, tuple[str, ...]]:
    """The reference with its check, and doubts where they differ by more than both say.

    ``fits``: whether the better check is expected to fit the budget.
    """
    other, accuracy = CHECKS[method] if fits or method != "dop853" else CHEAPER
    good = np.ones(best.n, dtype=bool)
    try:
        check = question.run(method=other, accuracy=accuracy)
    except RequestError:  # several drivers, or loads that this one cannot follow
        other, accuracy = CHEAPER
        check = question.run(method=other, accuracy=accuracy)
    stick = yardstick(best, best, good)
    gap = distance(stick, check, best)
    estimate = float(_motion(best).error)
    floor = max(gap, estimate, float(np.finfo(float).eps))
    doubts: tuple[str, ...] = ()
    if gap > 10 * (estimate + float(_motion(check).error)):
        doubts = (
            f"reference and check differ by {gap:.1g}, more than they estimate of themselves "
            f"({estimate:.1g} and {_motion(check).error:.1g})",
        )
    return (
        Reference(f"{method} at its finest", f"{other} at {accuracy:g}", floor),
        stick,
        doubts,
    )


def distance(stick: Yardstick, found: Result, best: Result) -> float:
    """Error of a run: of its outputs at the common times, and of its end.

    Where an event ends the run, its time counts, relative to the time of the run.
    """
    n = min(found.n, best.n)
    if n == 0:
        return math.inf
    values = {k: v[:n] if len(v) == best.n else v for k, v in stick.values.items()}
    part = Yardstick(values, stick.scale, stick.good[:n])
    error = part.error(Cut(found, n))
    late = abs(_motion(found).t_end - _motion(best).t_end)
    span = _motion(best).t_end - _motion(best).t_start
    if _motion(best).end != "time" and span > 0:
        error = max(error, late / span)
    return error if n == best.n or _motion(best).end != "time" else math.inf


class Cut:
    """The first samples of a result, for reading."""

    def __init__(self, result: Result, n: int) -> None:
        self.result, self.n = result, n

    def __getitem__(self, name: str) -> Any:
        return np.atleast_1d(self.result[name])[: self.n]

    def output(self, name: str) -> Any:
        """Declaration of an output."""
        return self.result.output(name)


def _candidates(best: Result, drivers: int) -> Iterator[Candidate]:
    """Settings of every method, from coarse to fine."""
    for method, targets in ADAPTIVE.items():
        if drivers > 1 and method in ("energy", "spectral"):
            continue
        for accuracy in targets:
            yield Candidate(
                method, f"accuracy {accuracy:g}", {"method": method, "accuracy": accuracy}
            )
    if drivers > 1:
        return
    motion = _motion(best)
    span = motion.t_end - motion.t_start
    track = motion.at(motion.times(201)).q
    path = float(np.abs(np.diff(track)).sum())
    for method, length in (("rk4", span), ("euler_q", path)):
        for parts in PARTS[method]:
            step = _round(length / parts)
            unit = "s" if method == "rk4" else "rad"
            yield Candidate(method, f"step {step:g} {unit}", {"method": method, "step": step})


def _coarse_first(candidates: Iterator[Candidate]) -> tuple[Candidate, ...]:
    """The coarsest setting of every method first, so that a short budget sees all methods."""
    by_method: dict[str, list[Candidate]] = {}
    for c in candidates:
        by_method.setdefault(c.method, []).append(c)
    most = max(map(len, by_method.values()))
    return tuple(row[i] for i in range(most) for row in by_method.values() if i < len(row))


def _round(x: float) -> float:
    """A number to two digits."""
    return float(f"{x:.1e}")


def _measured(
    question: Question,
    candidates: Sequence[Candidate],
    reference: Reference,
    stick: Yardstick,
    best: Result,
    clock: Clock,
    say: Said,
) -> tuple[tuple[Point, ...], tuple[Skipped, ...]]:
    """Points of the candidates that apply and fit the budget; Ctrl-C keeps what is done."""
    points: list[Point] = []
    skipped: list[Skipped] = []
    refused: dict[str, str] = {}
    last: dict[str, float] = {}
    for i, c in enumerate(candidates):
        if c.method in refused:
            continue
        expected = (FEWEST + 1) * _expected(c.method, last)
        if expected > clock.left or clock.left <= 0:
            skipped.append(Skipped(c.label, _too_long(expected, clock)))
            continue
        try:
            say(c.label, i, len(candidates))
            run = _runner(question, c)
            found, cold = once(run)
            last[c.method] = cold
            if FEWEST * cold > clock.left:
                skipped.append(Skipped(c.label, _too_long(FEWEST * cold, clock)))
                continue
            took = timed(run, clock)
            if took is None:
                skipped.append(Skipped(c.label, RAN_OUT))
                continue
        except RequestError as refusal:
            refused[c.method] = refusal.problems[0].found
            skipped.append(Skipped(c.method, f"does not apply: {refused[c.method]}"))
            continue
        except KeyboardInterrupt:
            skipped += [Skipped(r.label, "interrupted") for r in candidates[i:]]
            break
        last[c.method] = took.seconds
        error = distance(stick, found, best)
        points.append(
            Point(
                c.method,
                c.setting,
                *took,
                _motion(found).cost.evaluations,
                max(error, reference.floor),
                dict(c.options),
                error < reference.floor,
            )
        )
    order = list(ADAPTIVE) + list(PARTS)
    points.sort(key=lambda p: order.index(p.method))
    return tuple(points), tuple(skipped)


def _expected(method: str, last: Mapping[str, float]) -> float:
    """Time of a run [s] that is expected before it is made; 0 where nothing is known."""
    if method == "radau" and method not in last:
        return IMPLICIT * last.get("dop853", 0.0)
    return DEARER * last.get(method, 0.0)


def _runner(question: Question, candidate: Candidate) -> Callable[[], Result]:
    return lambda: question.run(**candidate.options)


def _too_long(seconds: float, clock: Clock) -> str:
    left = clock.left
    if left <= 0:
        return "the budget is spent"
    return f"would take about {seconds:.2g} s, {left:.2g} s of the budget are left"
