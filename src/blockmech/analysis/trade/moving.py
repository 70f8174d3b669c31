"""The trade of a simulation: every method that applies, over its settings.

The methods are those of `blockmech.dynamics`; the reference is the finest of them and
is checked by one of another kind (`blockmech.analysis.trade.agreed`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.trade.agreed import (
    IMPLICIT,
    LEAST,
    UNSURE,
    Agreed,
    Question,
    agreed,
    distance,
    motion_of,
)
from blockmech.analysis.trade.measure import RUNS, Candidate, Said, measured
from blockmech.analysis.trade.points import NOTHING, Skipped, Trade
from blockmech.analysis.trade.timing import Clock, once
from blockmech.result import Result

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

MOTION = ("*.q", "*.rate")
TIMES = 21  # at which runs are compared, where none are named
ADAPTIVE = {
    "energy": (1e-3, 1e-6, 1e-9, 1e-12),
    "spectral": (1e-3, 1e-6, 1e-9, 1e-12),
    "lsoda": (1e-3, 1e-5, 1e-7, 1e-9),
    "dop853": (1e-3, 1e-6, 1e-9, 1e-11),
    "radau": (1e-3, 1e-6),
}
PARTS = {"rk4": (100, 200, 400, 800), "euler_q": (100, 1000, 10_000)}  # steps of a run
STAGES = {"rk4": 4, "euler_q": 1}  # evaluations of a step
GROWTH = {"energy": 2.0, "spectral": 2.0, "lsoda": 2.0, "dop853": 3.0, "radau": 5.0}
"""Evaluations at the next finer setting of a method against those at the last one."""
BATCHED = ("energy", "spectral", "euler_q")  # methods that evaluate many poses at once
COUNTED = "samples of the reduced inertia and load, in batches or single"
MEASURE = (
    "largest error of any output at any of these times, relative to the output's largest "
    "magnitude (angles in rad)"
)


@dataclass
class Moving:
    """A question with its reference, and what its runs were seen to cost.

    Attributes
    ----------
    rates : method -> seconds a kernel evaluation
    counts : method -> evaluations of its last run, and that run's number of steps
    """

    found: Agreed
    rates: dict[str, float]
    counts: dict[str, tuple[float, int]] = field(default_factory=dict)

    def expected(self, candidate: Candidate) -> float:
        """See `Bench`."""
        return self._rate(candidate.method) * self._count(candidate)

    def _rate(self, method: str) -> float:
        """Seconds a kernel evaluation, by this method or one of its kind."""
        if method in self.rates:
            return self.rates[method]
        kin = [r for m, r in self.rates.items() if (m in BATCHED) == (method in BATCHED)]
        return min(kin, default=min(self.rates.values()))

    def _count(self, candidate: Candidate) -> float:
        """Kernel evaluations of a run before it is made; 0 where nothing is known."""
        method, steps = candidate.method, candidate.steps
        if method in self.counts:
            last, before = self.counts[method]
            return last * (steps / before if steps else GROWTH[method])
        if steps:
            return STAGES[method] * steps
        if method == "radau" and "dop853" in self.counts:
            return IMPLICIT * self.counts["dop853"][0]
        return 0.0

    def run(self, candidate: Candidate, limit: float | None = None) -> Result:
        """See `Bench`."""
        return self.found.question.run(limit, **candidate.options)

    def seen(self, candidate: Candidate, seconds: float, result: Result | None) -> None:
        """See `Bench`."""
        count = self._stopped(candidate.method, seconds)
        if result is not None:
            count = max(1, motion_of(result).cost.evaluations)
            self.rates[candidate.method] = seconds / count
        self.counts[candidate.method] = count, candidate.steps

    def _stopped(self, method: str, seconds: float) -> float:
        """Evaluations of a run that was stopped after some time [s], at least."""
        return seconds / self._rate(method)

    def evaluations(self, result: Result) -> int:
        """See `Bench`."""
        return motion_of(result).cost.evaluations

    def error(self, result: Result) -> float:
        """See `Bench`."""
        return distance(self.found.stick, result, self.found.best)


def trade_motion(
    mechanism: Compiled,
    want: tuple[str, ...] | None,
    clock: Clock,
    request: Mapping[str, Any],
    say: Said,
) -> Trade:
    """Measure the settings of `Compiled.simulate` for one request; see `trade`."""
    given = dict(request)
    notes: tuple[str, ...] = ()
    if any(b.friction for b in mechanism.structure.blocks.values()):
        given.setdefault("friction", "none")
        notes = ("joint friction is left out of the motion",)
    question = Question(mechanism, given, want or MOTION)
    say("reference", 0, 0)
    single = _single(question)
    found: Agreed | str
    if single and LEAST * single > clock.left / RUNS:
        found = (
            f"one evaluation takes {single:.2g} s, the coarsest run about {LEAST} of them, and "
            "it is to be repeated"
        )
    else:
        found = agreed(question, TIMES, clock)
    if isinstance(found, str):
        return _nothing(question, f"the budget of {clock.budget:g} s is too small: {found}", notes)
    best = found.best
    what = f"{', '.join(best) if len(best) <= 3 else f'{len(best)} outputs'} at {best.n} times"
    asked = f"simulate until {given.get('until') or motion_of(best).end}: {what}"
    notes += found.notes
    if found.reference.floor >= UNSURE:
        notes += ("reference and check have nothing in common, so no error is claimed",)
        skipped = _unmeasured("there is nothing to measure it against")
        return Trade(mechanism.name, asked, MEASURE, COUNTED, found.reference, (), skipped, notes)
    bench = Moving(found, dict(found.rates))
    candidates = _coarse_first(settings_of(best))
    points, skipped = measured(bench, candidates, found.reference.floor, clock, say)
    order = [*ADAPTIVE, *PARTS]
    points = tuple(sorted(points, key=lambda p: order.index(p.method)))
    return Trade(mechanism.name, asked, MEASURE, COUNTED, found.reference, points, skipped, notes)


def _single(question: Question) -> float:
    """Time of one kernel evaluation [s]; 0 where the request does not say the start."""
    from blockmech.dynamics.change_points import system_of

    mechanism = question.mechanism
    starts = {d: (x.q, x.rate) for d, x in mechanism.scene.initial.items()}
    starts |= dict(question.request.get("start") or {})
    if set(starts) != set(mechanism.drivers):
        return 0.0  # which the run will refuse
    rows = np.array([starts[d] for d in mechanism.drivers], dtype=float)
    system = system_of(mechanism)
    if len(system.drivers) == 1:
        q, rate = rows[0].tolist()
        return min(once(lambda: system.one(q, rate, 0.0))[1] for _ in range(3))
    return min(once(lambda: system.terms(rows[:, 0], rows[:, 1], 0.0))[1] for _ in range(3))


def _nothing(question: Question, why: str, notes: tuple[str, ...]) -> Trade:
    """A trade that the budget does not hold."""
    until = question.request.get("until")
    asked = f"simulate until {until}" if until else "simulate"
    name, skipped = question.mechanism.name, _unmeasured(why)
    return Trade(name, asked, MEASURE, COUNTED, NOTHING, (), skipped, (*notes, why))


def _unmeasured(why: str) -> tuple[Skipped, ...]:
    return tuple(Skipped(method, why) for method in (*ADAPTIVE, *PARTS))


def settings_of(best: Result) -> Iterator[Candidate]:
    """Settings of every method, from coarse to fine."""
    mechanism = best.mechanism
    alone = len(mechanism.drivers) == 1
    for method, targets in ADAPTIVE.items():
        if not alone and method in ("energy", "spectral"):
            continue
        for accuracy in targets:
            yield Candidate(
                method, f"accuracy {accuracy:g}", {"method": method, "accuracy": accuracy}
            )
    if not alone:
        return
    rotary = mechanism.driver_joint(mechanism.drivers[0]).rotary
    units = {"rk4": "s", "euler_q": "rad" if rotary else "m"}
    motion = motion_of(best)
    span = motion.t_end - motion.t_start
    track = motion.at(motion.times(201)).q
    path = float(np.abs(np.diff(track)).sum())
    for method, length in (("rk4", span), ("euler_q", path)):
        for parts in PARTS[method]:
            step = _round(length / parts)
            options = {"method": method, "step": step}
            yield Candidate(method, f"step {step:g} {units[method]}", options, parts)


def _coarse_first(candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """The coarsest setting of every method first, so that a short budget sees all methods."""
    by_method: dict[str, list[Candidate]] = {}
    for c in candidates:
        by_method.setdefault(c.method, []).append(c)
    most = max(map(len, by_method.values()))
    return tuple(row[i] for i in range(most) for row in by_method.values() if i < len(row))


def _round(x: float) -> float:
    """A number to two digits."""
    return float(f"{x:.1e}")
