"""What ends or interrupts a motion: names that all methods share, and what turns lead to."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from blockmech.dynamics import ends
from blockmech.result.motion import Status

STANDSTILL: Final = "standstill"
REST: Final = "rest"
TURN: Final = "turn"  # of a return map
END_STOP: Final = "end stop"
DEAD_CENTRE: Final = "dead centre"
IMPOSSIBLE: Final = "impossible pose"
NO_INERTIA: Final = "no inertia"
UNDEFINED_LOAD: Final = "undefined load"
INTERRUPTED: Final = "interrupted"  # by the user; what was done is kept
BUDGET: Final = "budget"  # its processor time is spent; what was done is kept
TOO_MANY: Final = "more evaluations than allowed"
SELF_LOCKED: Final = "self-locking in motion"  # no acceleration satisfies Coulomb's law
AMBIGUOUS: Final = "ambiguous start"  # from rest it may move either way
LEAVES_STOP: Final = "leaves its stop"
IMPACT: Final = "impact"
LAW_ENDS: Final = "law of motion ends"  # of a driver that is prescribed
NO_STEP: Final = "the solver's step became too small"
NEVER: Final = "never reached"  # how an end begins whose goal does not come
UNDECIDED: Final = "not decided"  # two runs that should agree end differently

# What an integration stops at, to go on with another equation or because its goal is met.
KINK, GOAL, WHOLE_TURN = "kink", "goal", "whole turn"
REVERSAL, GUIDE_SIDE = "joint reverses", "guide changes side"
DEFLECTION_KINK = "bristles turn"  # a pair reverses whose friction law has a state
STICKS, SLIPS, REVERSES = "sticking", "slipping", "reversal"  # of a pair, with several drivers
SIGNAL_KINK, RELEASED = "signal kink", "released"  # from joint friction, by a signal
KINKS = GUIDE_SIDE, SIGNAL_KINK, DEFLECTION_KINK  # over which it just goes on


STOPPED = INTERRUPTED, BUDGET  # by who asked
LEAVES_CHART: Final = "other joints lead better"
CHART_ENDS = (DEAD_CENTRE, IMPOSSIBLE, NO_STEP, LEAVES_CHART)  # others may lead beyond


class RunEnd(NamedTuple):
    """Why a run is over.

    end : its name, see above
    remaining_time : [s] to a singular place that the run stops short of
    note, facts : what else is known of it
    """

    end: str
    status: Status = "ended"
    remaining_time: float = 0.0
    note: str = ""
    facts: Mapping[str, float] = {}


class TooMany(Exception):
    """More evaluations than allowed: what ends a run by `TOO_MANY`."""


class BudgetSpent(Exception):
    """No processor time is left: what ends a run by `BUDGET`."""


SECONDS = 60.0  # [s] of processor time for a request where none is given


@dataclass
class Budget:
    """Processor time of a request [s], from when it is looked at first."""

    seconds: float = SECONDS
    deadline: float | None = None

    def check(self) -> None:
        """Raise `BudgetSpent`, once, where none is left: what is done is still looked at."""
        now = time.thread_time()
        if self.deadline is None:
            self.deadline = now + self.seconds
        elif now > self.deadline:
            self.deadline = math.inf
            raise BudgetSpent

    @property
    def advice(self) -> str:
        """What to do where it is spent."""
        remedy = "give more by budget= (--budget), or ask for a shorter time or a coarser accuracy"
        return f"{self.seconds:g} s of processor time are spent: {remedy}"


@dataclass
class TurnsInTime:
    """Turns without a standstill under loads of place and rate, of which some are looked at.

    Motions of one driver do not cross: one that begins a turn no slower than the last is nowhere
    slower in it. So turns that gain ever more never come to a standstill; nor do those whose
    changes fade out before they count.

    coordinate, t : [rad], [s] where the last one ended; square : [1/s2] of the rate there
    change : [1/s2] of the square in the last one, if that was looked at
    many, passed : turns to the next place to look at, and those before
    """

    coordinate: float
    t: float
    square: float
    change: float = math.nan
    many: int = 1
    passed: int = 0

    def turned(self, t: float, q: float, rate: float, target: float) -> RunEnd | None:
        """Go on to that place; why the run is over where more of the kind follow for ever.

        target : [rad] by which changes may move what follows a turn later
        """
        travel, last, duration = abs(q - self.coordinate), self.change, t - self.t
        change, small = rate**2 - self.square, 2 * travel * target / duration**2
        self.passed += self.many
        self.coordinate, self.t, self.square = q, t, rate**2
        if self.many > 1 or math.isnan(last):  # two in a row tell
            self.change, self.many = math.nan if self.many > 1 else change, 1
            return None
        self.change, self.many = math.nan, self.passed  # and others ever more rarely
        if change**2 <= (abs(last) - abs(change)) * small:  # all that follow, a geometric series
            facts = {"period": duration, "mean_speed": travel / duration}
            return RunEnd(f"{ends.NEVER}: rotation", facts=facts)
        run_up = change >= last > 0 and change > small
        return RunEnd(f"{ends.NEVER}: run-up") if run_up else None
