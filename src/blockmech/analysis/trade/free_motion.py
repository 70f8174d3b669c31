"""The trade of a simulation: every method that applies, over its settings.

The reference is the finest method that applies and ends within its share of the budget; one
of another kind checks it, and what the two differ by is the floor. With joint friction all
methods solve its equations by Newton's method, and the other ones are settings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from blockmech.analysis.reference_errors import DOUBLE, ReferenceErrors, reference_errors
from blockmech.analysis.trade.measure import USELESS, Clock, Question, Reference, Setting
from blockmech.dynamics.ends import INTERRUPTED, TOO_MANY
from blockmech.dynamics.method_table import METHODS
from blockmech.dynamics.motion_outputs import SimulationResult
from blockmech.ground.errors import RequestError, refused
from blockmech.result.motion import Motion
from blockmech.result.result import Result
from blockmech.result.tables import ROWS
from blockmech.typing import Arguments, FixedStep, Successive

FINEST = (  # references and checks, best first; coarser ones where those do not end in time
    ("auto", 1e-14),
    ("dop853", 1e-13),
    ("radau", 1e-11),
    ("dop853", 1e-9),
    ("radau", 1e-8),
)
SHARE = 0.3  # of what is left, for each of them: two, and as much again for the settings
FIRST = 0.02  # of a motion without end, what is compared: methods differ a hundredfold in cost
TRIES = 2  # of that: by machine code they differ as much again
DOUBTFUL = 10.0  # times their own estimates by which reference and check may differ
MOTION = ("*.q", "*.rate")
FRICTIONS = (
    Setting("friction none", "", {"friction": "none"}),
    Setting("friction single", "", {"friction": "single"}),
    Setting("friction successive", "3 iterations", {"friction": Successive(iterations=3)}),
)


class FreeMotion(Question):
    """A simulation from a start until something ends it."""

    MEASURE = (
        "largest error of any output at any of these times, relative to the output's largest "
        "magnitude (angles in rad)"
    )
    COUNTED = (
        "states at which the equation of motion was evaluated, by kernels or by series kept of "
        "them; the arithmetic of an integrator's steps is not counted"
    )

    errors: ReferenceErrors
    best: SimulationResult
    mechanism: Any  # a `Mechanism`, which stands above the analyses

    def __init__(
        self,
        mechanism: Any,
        want: tuple[str, ...] | None,
        request: Arguments,
        clock: Clock,
    ) -> None:
        self.mechanism, self.clock = mechanism, clock
        self.request, self.times = {**request, "want": want or MOTION}, request.get("times")
        self.asked = f"simulate until {request.get('until') or 'its end'}"
        first, in_time = self._run({}, SHARE * clock.left)
        motion: Motion = first.motion
        finished = in_time and motion.end != TOO_MANY
        finest = (self._two_kinds if finished else self._of_its_begin)(motion, clock)
        if len(finest) < 2:
            return
        # The surer one is the reference, the other one its check.
        (method, self.best), (check_method, check) = sorted(
            finest, key=lambda run: run[1].motion.error
        )
        self.errors = _errors(self.best)
        apart, estimates = self.error(check)[0], [run.motion.error for _, run in finest]
        self.reference = Reference(method, check_method, max(apart, min(estimates), DOUBLE))
        names = tuple(self.best)
        outputs = ", ".join(names) if len(names) <= 3 else f"{len(names)} outputs"
        until = self.request.get("until")
        self.asked = f"simulate until {until or motion.end}: {outputs} at {self.best.n} times"
        if apart > DOUBTFUL * sum(estimates):
            self.notes += (
                f"reference and check differ by {apart:.1g}, more than they estimate of "
                f"themselves ({min(estimates):.1g} and {max(estimates):.1g})",
            )
        if self.reference.floor >= USELESS:
            self.notes += ("reference and check have nothing in common, so no error is claimed",)

    def _of_its_begin(self, motion: Motion, clock: Clock) -> list[tuple[str, SimulationResult]]:
        """Fine runs of a part of a motion that was not at its end in time."""
        seconds = f"{SHARE * clock.budget:.2g} s of computing"
        within = "the evaluations allowed" if motion.end == TOO_MANY else seconds
        computed = f"the motion did not end within {within}"
        come = f"by which it had come to t = {motion.t_end:.3g} s"
        span = motion.t_end - motion.t_start
        for _ in range(TRIES):
            if not (span := FIRST * span) > 0:
                break
            until = f"time={span:.2g}"
            self.request |= {"until": until, "times": self.times}
            self.notes = (f"{computed}, {come}: compared until {until} s",)
            if (shorter := self.run({}, SHARE * clock.left)) is None:
                break
            if len(finest := self._two_kinds(shorter.motion, clock)) == 2:
                return finest
        return []

    def _two_kinds(self, motion: Motion, clock: Clock) -> list[tuple[str, SimulationResult]]:
        """Fine runs of a motion at the times at which runs are compared, see `_finest`."""
        if motion.status == "failed":
            remedy = 'say until when, e.g. until="time=2"'
            why = "; ".join(motion.notes)
            raise refused("trade", motion.end, remedy, why, "no-motion")
        if self.times is None:
            self.request["times"] = motion.times(ROWS if motion.t_end > motion.t_start else 1)
        return self._finest(motion.method, clock)

    def _finest(self, automatic: str, clock: Clock) -> list[tuple[str, SimulationResult]]:
        """Two fine runs of different kinds, or fewer where they do not end in their time."""
        finest: dict[str, tuple[str, SimulationResult]] = {}
        refusal = None
        for method, accuracy in FINEST:
            kind = automatic if method == "auto" else method
            if kind in finest or len(finest) == 2:
                continue
            try:
                result = self.run({"method": method, "accuracy": accuracy}, SHARE * clock.left)
            except RequestError as error:
                refusal = error
                continue
            if result is not None and result.motion.status != "failed":
                finest[kind] = (f"{kind} at {accuracy:g}", result)
        if refusal is not None and not finest:
            raise refusal
        return list(finest.values())

    def settings(self) -> Iterator[Setting]:
        """The coarsest setting of every method first, so that a short budget sees them all.

        Those that are interpreted come last: machine code mostly takes far less.
        """
        rows = [list(self._row(method, "llvm")) for method in METHODS]
        if self.mechanism.frictional_joints and self.request.get("friction") is None:
            rows += [[setting] for setting in FRICTIONS]
        adaptive = [name for name, method in METHODS.items() if not method.fixed_steps]
        for some in (rows, [list(self._row(method, "scalar")) for method in adaptive]):
            for i in range(max(map(len, some))):
                yield from (row[i] for row in some if i < len(row))

    def _row(self, method: str, engine: str) -> Iterator[Setting]:
        """The settings of a method by an engine, from coarse to fine."""
        compared = METHODS[method].compared
        if not METHODS[method].fixed_steps:
            name = method if engine == "llvm" else f"{method} {engine}"
            for accuracy in compared:
                options = {"method": method, "accuracy": accuracy, "engine": engine}
                yield Setting(name, f"accuracy {accuracy:g}", options)
            return
        if len(self.mechanism.drivers) > 1:
            return
        motion: Motion = self.best.motion
        length, unit = motion.t_end - motion.t_start, "s"
        if method == "euler_q":
            length = float(np.abs(np.diff(motion.at(motion.times(201)).q)).sum())
            unit = self.mechanism.structure.driver_joint(self.mechanism.drivers[0]).coordinate_unit
        for count in compared:
            step = float(f"{length / count:.1e}")
            fixed = FixedStep(method, step)  # type: ignore[arg-type]
            yield Setting(method, f"step {step:g} {unit}", {"method": fixed})

    def run(self, options: Arguments, seconds: float) -> SimulationResult | None:
        """The simulation with a setting, through the public call; None if it took longer.

        Raises `KeyboardInterrupt` if the user stopped it: half a run cannot be compared.
        """
        result, in_time = self._run(options, seconds)
        return result if in_time else None

    def _run(self, options: Arguments, seconds: float) -> tuple[SimulationResult, bool]:
        """The simulation as far as it comes, and whether that is its end."""
        end = self.clock.now() + seconds

        def stop_late(what: str, done: float, whole: float | None) -> None:
            if self.clock.now() > end:
                raise KeyboardInterrupt  # by which a simulation is stopped

        arguments = {**self.request, **options, "progress": stop_late}
        result: SimulationResult = self.mechanism.simulate(**arguments)
        if result.motion.end != INTERRUPTED:
            return result, True
        if self.clock.now() <= end:
            raise KeyboardInterrupt
        return result, False

    def evaluations(self, result: Result) -> int:
        """States at which the equation of motion was evaluated."""
        assert isinstance(result, SimulationResult)
        cost = result.motion.cost
        return int(cost.samples + max(cost.singles, cost.states))

    def error(self, result: Result) -> tuple[float, str]:
        """Error of a run: of its outputs at the common times, and of its end.

        Where an event ends the run, its time counts, relative to the time of the run.
        """
        assert isinstance(result, SimulationResult)
        n, moved, reference = min(result.n, self.best.n), result.motion, self.best.motion
        by_event = reference.end != "time"
        if n == 0 or (n < self.best.n and not by_event):
            return math.inf, "time"
        errors = self.errors if n == self.best.n else _errors(self.best.isel(slice(n)))
        worst = errors.worst(result.isel(slice(n)))
        late, span = abs(moved.t_end - reference.t_end), reference.t_end - reference.t_start
        return max(worst, (late / span, "time")) if by_event and span > 0 else worst


def _errors(best: SimulationResult) -> ReferenceErrors:
    return reference_errors(best, best, np.ones(best.n, dtype=bool))
