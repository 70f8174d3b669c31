"""Where a conservative motion ends, how good it is, and what happened on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from blockmech.dynamics.chebyshev import rule
from blockmech.dynamics.ends import DEAD_CENTRE, END_STOP, IMPOSSIBLE, INTERRUPTED, NO_INERTIA
from blockmech.dynamics.motion import Event, Motion, Status
from blockmech.dynamics.path.conservative import Conservative
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.path.stretch import Stretch
from blockmech.dynamics.system.reduced import TURN, Metered
from blockmech.dynamics.until import Asked, Start, Until

MOST_EVENTS = 10_000
PLACED = 8  # roundings of a coordinate: on its panel, from the panel's edge, from the start
PLENTY = 1e-12  # [rad or m] error that is looked at more closely, where no target is given
UNDECIDED = 1e-3  # error of the time, relative to a passage, that is no longer a small one


@dataclass(frozen=True)
class Course:
    """A conservative motion before anyone asks where it should end."""

    regime: str
    track: Conservative
    fate: str  # what it ends in, if it ends: "end stop", "dead centre", NO_INERTIA, "search limit"
    doubts: tuple[str, ...]
    facts: dict[str, float]


def ended(meter: Metered, asked: Asked, course: Course) -> Motion:
    """Cut the course where it should end, and say how good it is."""
    start, until, accuracy = asked.start, asked.until, asked.accuracy
    track = replace(course.track, t0=start.t) if start.t else course.track
    wanted, met = goal_time(track, start, until)
    stop = track.end()
    status: Status = "reached"
    end: str = until.goal
    t_end = wanted
    if wanted > stop or (wanted == math.inf and stop < math.inf):
        t_end, status, end = stop, "ended", course.fate
    elif wanted == math.inf:
        t_end, status, end = _never(track, start), "ended", f"never reached: {course.regime}"
    if meter.interrupted:
        status, end = "ended", INTERRUPTED
    state = track.state(np.array([t_end]))
    q_end, qd_end = float(state.q[0]), float(state.qd[0])
    if met is not None and status == "reached":
        q_end = met
    seconds, angle = _errors(track, t_end - start.t)
    if course.fate == NO_INERTIA:
        angle += _unseen(track, t_end) + _moved(track, t_end, seconds)
    error = seconds * _fastest(track, t_end) + angle
    if error > (accuracy or PLENTY) and course.fate != NO_INERTIA:
        error = min(error, _on_the_way(track, t_end - start.t))
    error += PLACED * EPS * max(abs(start.q), abs(q_end), _farthest(track))
    notes = course.doubts
    if seconds > UNDECIDED * track.line.first.total and not notes:
        notes += (
            "it comes so near an equilibrium that the rounding of the data decides when, or "
            "whether, it goes on",
        )
    if accuracy is not None and error > accuracy:
        notes += (
            f"accuracy not reached: {error:.1e} instead of {accuracy:.1e}; "
            "the rest is rounding of the data, not of the method",
        )
    return Motion(
        method="energy",
        why=asked.why,
        regime=course.regime,
        status=status,
        end=end,
        t_start=start.t,
        t_end=t_end,
        q_end=q_end,
        qd_end=qd_end,
        track=track,
        events=_events(track, t_end, end),
        error=error,
        time_error=seconds,
        accuracy=accuracy,
        cost=meter.cost,
        notes=notes,
        facts=course.facts,
    )


def _on_the_way(track: Conservative, elapsed: float) -> float:
    """Error of the coordinate on a way that is less than the passage and back [rad or m].

    What lies ahead of where the run ends does not matter to it.
    """
    first, c0 = track.line.first, track.c0
    T, hand = first.total, c0 + track.heading * elapsed
    rounded = EPS * (elapsed + abs(track.t0)) * first.fastest
    if not isinstance(first, Stretch) or hand < 0:
        return math.inf
    if hand <= T:
        return first.missed(min(c0, hand), max(c0, hand), 1)[0] + rounded
    if track.turns_high and hand <= 2 * T:
        return first.missed(min(c0, 2 * T - hand), T, 2)[0] + rounded
    return math.inf


def _farthest(track: Conservative) -> float:
    """Largest coordinate of a way that does not go on for ever: its rounding is the largest."""
    if track.line.period:
        return 0.0
    view, first = track.line.view, track.line.first
    return abs(view.origin) + max(abs(first.low.x), abs(first.high.x))


def _unseen(track: Conservative, t_end: float) -> float:
    """Way after the last sample before a place without inertia [rad or m].

    The speed has no bound there, so an error of the time is none of the angle any more.
    """
    first = track.line.first
    if not isinstance(first, Stretch):
        return 0.0
    edges, share = first.quad.mesh.edges, float(rule(first.quad.mesh.nodes).low[0])
    panel, end = (0, 0) if track.turns_high else (-2, -1)
    way = share * float(edges[panel + 1] - edges[panel])
    last = float(edges[end]) + (way if track.turns_high else -way)
    return way if t_end >= track.end() - abs(_left(track, last, float(edges[end]))) else 0.0


def _moved(track: Conservative, t_end: float, seconds: float) -> float:
    """Way of the last so many seconds: the most that an error of the time makes [rad or m]."""
    q = track.state(np.array([t_end - seconds, t_end])).q
    return abs(float(q[1] - q[0]))


def _left(track: Conservative, x: float, end: float) -> float:
    """Time from a place to an end [s]."""
    clock = track.line.first.when(np.array([x, end]))
    return float(clock[1] - clock[0])


def goal_time(track: Conservative, start: Start, until: Until) -> tuple[float, float | None]:
    """Time at which a run should end [s] (inf if never), and the exact place if known."""
    goal, value = until.goal, until.value
    view = track.line.view
    if goal == "time":
        return start.t + value, None
    if goal in ("standstill", "swings"):
        n = 1 if goal == "standstill" else int(value)
        t = track.standstill(n)
        first = track.line.first
        at_high = (track.heading > 0) == (n % 2 == 1)
        x = first.high.x if at_high else first.low.x
        return t, float(view.q(np.array(x))) if t < math.inf else None
    if goal == "steady":
        return start.t + _period(track), None
    if goal == "turns":
        return _turns(track, start, value * TURN)
    if goal == "angle":
        x = view.sign * (value - view.origin)
        return track.reaches(x), value
    return math.inf, None


def _turns(track: Conservative, start: Start, angle: float) -> tuple[float, float | None]:
    view = track.line.view
    best, place = math.inf, None
    for way in (1.0, -1.0):
        q = start.q + way * angle
        t = track.reaches(view.sign * (q - view.origin))
        if t < best:
            best, place = t, q
    return best, place


def _period(track: Conservative) -> float:
    """Time after which the motion repeats [s], inf if it does not."""
    if track.turns_low and track.turns_high:
        return 2 * track.line.total
    if track.line.period and track.line.gain == 0:
        return track.line.first.total
    return math.inf


def _never(track: Conservative, start: Start) -> float:
    """End of a run whose goal is never met: one period, or one turn [s]."""
    period = _period(track)
    return start.t + (period if period < math.inf else track.line.first.total)


def _fastest(track: Conservative, t_end: float) -> float:
    """Largest speed up to the end [rad/s or m/s]."""
    line = track.line
    if line.later is None or line.starts is None:
        return line.first.fastest
    clock = max(track.c0, float(track.clock(np.array([t_end]))[0]))
    turn = max(int(np.searchsorted(line.starts, clock, side="right")) - 2, 0)
    K = line.later.K + turn * line.gain
    return max(line.first.fastest, float(np.sqrt(2 * (K / line.later.J).max())))


def _errors(track: Conservative, elapsed: float) -> tuple[float, float]:
    """Error of the clock at the end of the run [s], and of the standstills [rad or m]."""
    clock = track.c0
    if track.line.starts is not None:
        clock = max(clock, float(track.clock(np.array([track.t0 + elapsed]))[0]))
    seconds = track.line.error(clock, elapsed)
    return seconds + EPS * (elapsed + abs(track.t0)), track.line.first.end_error


def _events(track: Conservative, t_end: float, end: str) -> tuple[Event, ...]:
    """Standstills up to the end, and what ended the run."""
    view, first = track.line.view, track.line.first
    found = []
    for n in range(1, MOST_EVENTS + 1):
        t = track.standstill(n)
        if t > t_end:
            break
        at_high = (track.heading > 0) == (n % 2 == 1)
        x = first.high.x if at_high else first.low.x
        found.append(Event("standstill", t, float(view.q(np.array(x))), 0.0))
    if end in (END_STOP, DEAD_CENTRE, IMPOSSIBLE, NO_INERTIA):
        state = track.state(np.array([t_end]))
        found.append(Event(end, t_end, float(state.q[0]), float(state.qd[0])))
    return tuple(found)
