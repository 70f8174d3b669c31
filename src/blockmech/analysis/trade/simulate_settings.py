"""The trade of a simulation: every method that applies, over its settings.

The reference is the finest method that applies and ends within its share of the budget; one
of another kind checks it, and what the two differ by is the floor. With joint friction all
methods solve its equations by Newton's method, and the other ones are settings.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.trade.measure import Candidate, Clock, Question, Said, measured
from blockmech.analysis.trade.points import NOTHING, UNSURE, Reference, Skipped
from blockmech.analysis.trade.reference_errors import DOUBLE, ReferenceErrors, reference_errors
from blockmech.analysis.trade.report import Trade
from blockmech.dynamics.simulation import simulate
from blockmech.errors import Problem, RequestError
from blockmech.result import Result

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.motion import Motion

FINEST = (  # references and checks, best first; coarser ones where those do not end in time
    ("energy", 1e-14),
    ("spectral", 1e-14),
    ("dop853", 1e-13),
    ("dop853", 1e-9),
    ("radau", 1e-11),
    ("lsoda", 1e-12),
    ("lsoda", 1e-8),
)
KINDS = {"energy": "path", "spectral": "path"}  # both are integrals over the coordinate
SHARE = 0.3  # of what is left, for the reference and for its check
COARSE = 1e-3  # accuracy of the run that says how long the motion lasts
TIMES = 21  # at which runs are compared, where none are named
DOUBTFUL = 10.0  # times their own estimates by which reference and check may differ
MOTION = ("*.q", "*.rate")
ADAPTIVE = {
    "energy": (1e-3, 1e-6, 1e-9, 1e-12),
    "spectral": (1e-3, 1e-6, 1e-9, 1e-12),
    "lsoda": (1e-3, 1e-5, 1e-7, 1e-9),
    "dop853": (1e-3, 1e-6, 1e-9, 1e-11),
    "radau": (1e-3, 1e-6),
}
STEPS = {"rk4": (100, 200, 400, 800), "euler_q": (100, 1000, 10_000)}  # of a run
FRICTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("none", {}),
    ("single", {}),
    ("successive", {"iterations": 3}),
)
COUNTED = "samples of the reduced inertia and load, in batches or single"
MEASURE = (
    "largest error of any output at any of these times, relative to the output's largest "
    "magnitude (angles in rad)"
)


class Asked(NamedTuple):
    """A simulation that is asked for: until when, what is wanted, from where."""

    mechanism: Compiled
    request: Mapping[str, Any]
    want: tuple[str, ...]

    def run(self, end: float, **options: Any) -> Result | None:
        """The simulation with some settings, through the public call; None if stopped at ``end``.

        Raises `KeyboardInterrupt` if the user stopped it: half a run cannot be compared.
        """
        given = dict(self.request) | options
        deadline = Deadline(end)
        until = given.pop("until", None)
        result = simulate(self.mechanism, until, want=self.want, progress=deadline, **given)
        if motion_of(result).end != "interrupted":
            return result
        if not deadline.passed:
            raise KeyboardInterrupt
        return None


class Deadline:
    """Progress of a simulation that stops it at a reading of the clock."""

    def __init__(self, end: float) -> None:
        self.end, self.passed = end, False

    def __call__(self, what: str, done: float, whole: float | None) -> None:
        """Raise `KeyboardInterrupt`, by which a simulation is stopped."""
        if time.perf_counter() > self.end:
            self.passed = True
            raise KeyboardInterrupt


def motion_of(result: Result) -> Motion:
    """How a simulation moved."""
    found: Motion = result.motion  # it comes from a simulation
    return found


def trade_simulation(
    mechanism: Compiled,
    want: tuple[str, ...] | None,
    clock: Clock,
    request: Mapping[str, Any],
    say: Said,
) -> Trade:
    """Measure the settings of `Compiled.simulate` for one request; see `trade`."""
    say("reference", 0, 0)
    asked, first, notes = _begun(mechanism, dict(request), want or MOTION, clock)
    text = (
        f"simulate until {request.get('until') or (motion_of(first).end if first else 'its end')}"
    )
    tried = None if first is None else _referred(asked, clock)
    if tried is None:
        why = f"the budget of {clock.budget:g} s is too small for a reference and its check"
        return _nothing(asked, text, NOTHING, why, (*notes, why))
    best, reference, errors, doubts = tried
    text += f": {', '.join(best) if len(best) <= 3 else f'{len(best)} outputs'} at {best.n} times"
    notes += doubts
    if reference.floor >= UNSURE:
        notes += ("reference and check have nothing in common, so no error is claimed",)
        why = "there is nothing to measure it against"
        return _nothing(asked, text, reference, why, notes)
    question = Question(
        lambda c, end: asked.run(end, **c.options),
        lambda run: motion_of(run).cost.evaluations,
        lambda run: distance(errors, run, best),
    )
    candidates = _coarse_first(settings_of(asked, best))
    points, skipped = measured(question, candidates, reference.floor, clock, say)
    order = list(dict.fromkeys([*ADAPTIVE, *STEPS, *(c.method for c in candidates)]))
    points = tuple(sorted(points, key=lambda p: order.index(p.method)))
    return Trade(mechanism.name, text, MEASURE, COUNTED, reference, points, skipped, notes)


def _nothing(
    asked: Asked, text: str, reference: Reference, why: str, notes: tuple[str, ...]
) -> Trade:
    skipped = tuple(Skipped(method, why) for method in (*ADAPTIVE, *STEPS))
    name = asked.mechanism.name
    return Trade(name, text, MEASURE, COUNTED, reference, (), skipped, notes)


def _begun(
    mechanism: Compiled, request: dict[str, Any], want: tuple[str, ...], clock: Clock
) -> tuple[Asked, Result | None, tuple[str, ...]]:
    """The question with times at which runs are compared, a coarse run of it, and notes."""
    asked = Asked(mechanism, request, want)
    end = clock.begun + clock.budget
    try:
        first = asked.run(end, accuracy=COARSE)
    except RequestError:
        if not mechanism.frictional_joints or "friction" in request:
            raise
        asked = Asked(mechanism, {**request, "friction": "none"}, want)
        first = asked.run(end, accuracy=COARSE)
    if first is None:
        return asked, None, ()
    moved = motion_of(first)
    if moved.status == "failed":
        remedy = 'say until when, e.g. until="time=2"'
        raise RequestError(Problem("no-motion", "trade", moved.end, "; ".join(moved.notes), remedy))
    if request.get("times") is None:
        times = moved.times(TIMES if moved.t_end > moved.t_start else 1)
        asked = asked._replace(request={**asked.request, "times": times})
    left_out = mechanism.frictional_joints and asked.request.get("friction") == "none"
    return asked, first, ("joint friction is left out of the motion",) if left_out else ()


def _referred(
    asked: Asked, clock: Clock
) -> tuple[Result, Reference, ReferenceErrors, tuple[str, ...]] | None:
    """The finest run that ends within its share of the budget, and one of another kind.

    Of the two that which is surer of itself is the reference, the other one its check.
    """
    refusals: list[RequestError] = []
    ended: list[tuple[str, str, Result]] = []
    for method, accuracy in FINEST:
        if any(KINDS.get(m, m) == KINDS.get(method, method) for m, _, _ in ended):
            continue  # no check of each other
        try:
            end = time.perf_counter() + SHARE * clock.left
            result = asked.run(end, method=method, accuracy=accuracy)
        except RequestError as error:
            refusals.append(error)
            continue
        if result is not None and motion_of(result).status != "failed":
            ended.append((method, f"{method} at {accuracy:g}", result))
        if len(ended) == 2:
            break
    if len(refusals) == len(FINEST):
        raise refusals[-1]
    if len(ended) < 2:
        return None
    (_, name, best), (_, other, check) = sorted(ended, key=lambda run: motion_of(run[2]).error)
    errors = reference_errors(best, best, np.ones(best.n, dtype=bool))
    apart = distance(errors, check, best)
    own = motion_of(best).error, motion_of(check).error
    doubts: tuple[str, ...] = ()
    if apart > DOUBTFUL * sum(own):
        doubts = (
            f"reference and check differ by {apart:.1g}, more than they estimate of themselves "
            f"({own[0]:.1g} and {own[1]:.1g})",
        )
    floor = max(apart, own[0], DOUBLE)
    return best, Reference(name, other, floor), errors, doubts


def distance(errors: ReferenceErrors, found: Result, best: Result) -> float:
    """Error of a run: of its outputs at the common times, and of its end.

    Where an event ends the run, its time counts, relative to the time of the run.
    """
    n = min(found.n, best.n)
    moved, wanted = motion_of(found), motion_of(best)
    by_event = wanted.end != "time"
    if n == 0 or (n < best.n and not by_event):
        return math.inf
    values = {k: v[:n] if len(v) == best.n else v for k, v in errors.values.items()}
    part = replace(errors, values=values, good=errors.good[:n])
    error = part.error(First(found, n))
    late, span = abs(moved.t_end - wanted.t_end), wanted.t_end - wanted.t_start
    return max(error, late / span) if by_event and span > 0 else error


class First:
    """The first samples of a result, for reading."""

    def __init__(self, result: Result, n: int) -> None:
        self.result, self.n = result, n

    def __getitem__(self, name: str) -> Any:
        return np.atleast_1d(self.result[name])[: self.n]

    def output(self, name: str) -> Any:
        """Declaration of an output."""
        return self.result.output(name)


def settings_of(asked: Asked, best: Result) -> Iterator[Candidate]:
    """Settings of every method, from coarse to fine, and of the friction methods."""
    for method, targets in ADAPTIVE.items():
        for accuracy in targets:
            options: dict[str, Any] = {"method": method, "accuracy": accuracy}
            yield Candidate(method, f"accuracy {accuracy:g}", options)
    mechanism = asked.mechanism
    if mechanism.frictional_joints and asked.request.get("friction") is None:
        for friction, more in FRICTIONS:
            options = {"friction": friction, **more}
            said = f"{more['iterations']} iterations" if more else ""
            yield Candidate(f"friction {friction}", said, options)
    if len(mechanism.drivers) > 1:
        return
    motion = motion_of(best)
    track = motion.at(motion.times(201)).q
    coordinate = mechanism.driver_joint(mechanism.drivers[0]).coordinate_unit
    for method, length, unit in (
        ("rk4", motion.t_end - motion.t_start, "s"),
        ("euler_q", float(np.abs(np.diff(track)).sum()), coordinate),
    ):
        for steps in STEPS[method]:
            step = float(f"{length / steps:.1e}")
            options = {"method": method, "step": step}
            yield Candidate(method, f"step {step:g} {unit}", options)


def _coarse_first(candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """The coarsest setting of every method first, so that a short budget sees all methods."""
    by_method: dict[str, list[Candidate]] = {}
    for c in candidates:
        by_method.setdefault(c.method, []).append(c)
    most = max(map(len, by_method.values()))
    return tuple(row[i] for i in range(most) for row in by_method.values() if i < len(row))
