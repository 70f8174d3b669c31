"""What comes of a motion that repeats: swings to and fro, and turns that gain or lose energy.

Nothing is computed again: the panels of one swing or turn serve all that follow, and tell when
the goal is met.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.ends import RunEnd
from blockmech.dynamics.panel_nodes import AT_ONCE
from blockmech.dynamics.request import SimulationRequest
from blockmech.dynamics.track import FEW, RepeatedSegment
from blockmech.functions.series import tail
from blockmech.typing import Floats

MOST_TURNS = 2 * AT_ONCE**2  # turns that gain energy, in a run: some seconds of work


class PeriodicContinuation(NamedTuple):
    """What comes of a pattern.

    facts : of the motion
    t : [s] to which it repeats, and why the run is over then: None where it goes on otherwise
    standstills : (time, place) of the standstills of its repetitions
    many : repetitions until it goes on otherwise
    """

    pattern: RepeatedSegment
    regime: str
    facts: Mapping[str, float]
    t: float
    over: RunEnd | None
    standstills: tuple[tuple[float, float], ...] = ()
    many: int = 0
    note: str = ""


def swings(
    swing: RepeatedSegment, request: SimulationRequest, earlier: int
) -> PeriodicContinuation:
    """From rest to rest: the motion goes to and fro for ever, as nothing takes energy.

    earlier : standstills until the end of the first swing
    """
    regime, span = "libration", swing.duration
    about = swing, regime, {"swing_time": span, "period": 2 * span}
    remaining = min(request.standstills - earlier, (request.span - swing.t0) / span - 1)
    if remaining == math.inf:
        return PeriodicContinuation(*about, swing.begins(2), RunEnd(f"{ends.NEVER}: {regime}"))
    last = int(remaining)
    standstills = swing.panels.end, swing.panels.begin
    listed = [*range(1, min(last, AT_ONCE)), last] if last else []
    listed_standstills = tuple((swing.begins(n + 1), standstills[n % 2]) for n in listed)
    t = request.span if request.span < math.inf else swing.begins(last + 1)
    note = f"of {last} further standstills {AT_ONCE} are listed" if last > AT_ONCE else ""
    over = RunEnd(request.until.goal, "reached")
    return PeriodicContinuation(*about, t, over, listed_standstills, note=note)


def turns(
    turn: RepeatedSegment, request: SimulationRequest, tolerance: float, progress: Any
) -> PeriodicContinuation | None:
    """A turn that is followed by others like it; None where the next one has to tell.

    tolerance : to which panels are resolved; told : called with the time [s] reached
    """
    begin, period, count = turn.panels.begin, abs(turn.step), math.inf
    if turn.gain:
        starts = _starts(turn, request, tolerance, progress)
        count = starts.size - 1
        if count < 2:
            return None
        turn = replace(turn, starts=starts)
        regime = "run-up" if turn.gain > 0 else "run-down"
        facts = {"work_per_period": turn.gain, "period_of_loads": period}
    else:
        regime = "rotation"
        facts = {"period": turn.duration, "mean_speed": period / turn.duration}
    ways = [x - begin for x in request.goals if turn.step * (x - begin) > 0]
    met = [(turn.time_at_travel(x), request.until.goal) for x in ways if x / turn.step <= count]
    t, goal = min([*met, (request.span, "time")])
    last = turn.begins(int(count)) if count < math.inf else math.inf
    if t <= last and t < math.inf:
        return PeriodicContinuation(turn, regime, facts, t, RunEnd(goal, "reached"))
    if turn.gain >= 0 and request.span == math.inf and not ways:
        about = turn, regime, facts, turn.begins(1)
        return PeriodicContinuation(*about, RunEnd(f"{ends.NEVER}: {regime}"))
    too_many = RunEnd(ends.TOO_MANY, "failed", note=f"{count} turns reach no further")
    over = too_many if turn.gain > 0 else None
    return PeriodicContinuation(turn, regime, facts, last, over, many=int(count))


def _starts(
    turn: RepeatedSegment, request: SimulationRequest, tolerance: float, progress: Any
) -> Floats:
    """When [s] turns like this one begin: while there is energy, or until the goal."""
    begin = turn.panels.begin
    ways = [abs(x - begin) for x in request.goals]
    if turn.gain < 0:
        count = _resolved(turn, tolerance)
    elif ways:
        count = min(math.ceil(max(ways) / abs(turn.step)) + 1, MOST_TURNS)
    else:
        count = MOST_TURNS if request.span < math.inf else 2
    starts, reached = [np.zeros(1)], turn.t0
    first, some = 0, FEW
    while first < count:  # twice as many each time, as most runs end soon
        energies = np.arange(first, min(first + some, count), dtype=np.float64) * turn.gain
        first, some = first + some, min(2 * some, AT_ONCE)
        starts.append(starts[-1][-1] + np.cumsum(turn.durations(energies)))
        reached = turn.t0 + float(starts[-1][-1])
        progress(reached)
        if reached >= request.span:
            break
    return np.concatenate(starts)


def _resolved(turn: RepeatedSegment, tolerance: float) -> int:
    """How many turns lose energy until they are slow somewhere, where panels do not resolve."""
    turns = range(1, int(float(turn.panels.K.min()) / -turn.gain) + 1)

    def slow(k: int) -> bool:
        return not (tail(turn.repetition(k).rate) <= tolerance).all()

    return bisect_left(turns, True, key=slow)
