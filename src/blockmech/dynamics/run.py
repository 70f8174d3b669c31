"""A run: a motion under way, segment by segment, whatever integrates it.

    begin -> segment -> transition -> segment ... until one of them ends the run

A segment goes on with one smooth equation to the first event that ends it: a panel along the path,
steps in time between two transitions, a flight between two blows. What it ends by is one record
for all of them, and so is what a run leaves behind.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from blockmech.dynamics import ends
from blockmech.dynamics.ends import RunEnd
from blockmech.result.motion import Event, Motion, Status
from blockmech.typing import Real

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

INTEGRATORS = ("dop853", "radau")  # in time
EVALUATIONS = 500_000  # states, or steps, at most in a run of an integrator; some seconds
GUESSED_AT = EVALUATIONS / 16  # states by which it shows whether that is enough
REMEDY = 'ask for a shorter time, or for the steady motion, "steady"'
HOPELESS = 8  # times as many as allowed, by that guess: no other run is made


@dataclass
class Run(ABC):
    """A motion under way.

    Attributes
    ----------
    t : [s] reached
    over : why it is over, None while it goes on
    """

    system: System
    request: SimulationRequest
    t: float = field(init=False, default=0.0)
    over: RunEnd | None = field(init=False, default=None)
    standstills: int = field(init=False, default=0)
    events: list[Event] = field(init=False, default_factory=list)
    facts: dict[str, float] = field(init=False, default_factory=dict)
    notes: list[str] = field(init=False, default_factory=list)

    @abstractmethod
    def begin(self) -> RunEnd | None:
        """Leave the start; why the run is over where it cannot."""

    @abstractmethod
    def segment(self) -> RunEnd | None:
        """Go on to whatever ends a segment, and over it; why the run is over where it is."""

    def run(self) -> None:
        """Go on until something ends the run; what is done until then is kept."""
        try:
            self.over = self.begin()
            while self.over is None:
                self.system.budget.check()
                self.over = self.segment()
        except KeyboardInterrupt:
            self.over = RunEnd(ends.INTERRUPTED)
        except ends.BudgetSpent:
            self.over = RunEnd(ends.BUDGET, "unfinished", note=self.system.budget.advice)
        except ends.TooMany:
            self.over = RunEnd(ends.TOO_MANY, "failed")
        self.facts |= self.over.facts
        self.notes += [self.over.note] if self.over.note else []

    @property
    def end(self) -> str:
        """By what it is over, "" while it goes on."""
        return "" if self.over is None else self.over.end

    @property
    def now(self) -> float:
        """Time [s] of the motion."""
        return self.t

    def happened(self, kind: str, q: Real, qd: Real) -> None:
        """Something happened here."""
        self.events.append(Event(kind, self.now, q, qd))

    def stood(self) -> RunEnd | None:
        """Count a standstill; the end where it is the goal."""
        self.standstills += 1
        met = self.standstills >= self.request.standstills
        return RunEnd(self.request.until.goal, "reached") if met else None

    def short_of(self, end: str, remaining_time: float, status: Status = "ended") -> RunEnd:
        """The end at a singular place, so much time [s] ahead, with when that is."""
        is_timed = end in (ends.DEAD_CENTRE, ends.NO_INERTIA) and math.isfinite(remaining_time)
        name = f"{end.replace(' ', '_')}_time"
        facts = {name: self.now + remaining_time} if is_timed else {}
        return RunEnd(end, status, remaining_time, facts=facts)

    def result(self, **details: Any) -> Motion:
        """The motion of a run that is over; its error is not known yet."""
        end, status, remaining_time, *_ = self.over or RunEnd("")
        return self.request.standing.but(
            status=status,
            end=end,
            events=tuple(self.events),
            notes=tuple(self.notes),
            facts=dict(self.facts),
            error=math.inf,
            time_error=2 * remaining_time,
            **details,
        )
