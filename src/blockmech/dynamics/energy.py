r"""Method ``energy``: conservative scenes with one driver, by quadrature.

With loads that depend on the driver's coordinate alone, K = J q'^2 / 2 is an integral
of the effort and time is an integral of sqrt(J / 2K). Only J and tau are sampled: no
acceleration, no dJ/dq, no time stepping. The error is near rounding, and a run of a
hundred thousand turns costs what one turn costs.

    look ahead  ->  regime  ->  passages  ->  line  ->  clock  ->  motion
    (reach)         (here)      (swing or     (line)   (conservative)
                                 stretch)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blockmech.dynamics.conservative import Conservative
from blockmech.dynamics.line import Line, turn_starts
from blockmech.dynamics.mesh import Mesh, View, joined, mirrored
from blockmech.dynamics.motion import Event, Motion, Still
from blockmech.dynamics.passage import Allowed, End, Known, Passage
from blockmech.dynamics.quadrature import EPS
from blockmech.dynamics.reach import NOWHERE, Horizon, Reach, look_ahead
from blockmech.dynamics.reduced import TURN, Metered
from blockmech.dynamics.stretch import Stretch, converged
from blockmech.dynamics.swing import swing
from blockmech.dynamics.until import Start, Until

SURVEY = 1e-6  # truncation error of the survey's energies, relative to the work turned over
FINEST = 1e-12  # target if none is given [rad or m]
AT_REST = 8 * EPS  # effort at a start from rest, relative to its contributions
MOST_EVENTS = 10_000
NEAR_SADDLE = 200.0  # time changes this much faster with a standstill's place than with length


@dataclass(frozen=True)
class Course:
    """A conservative motion before anyone asks where it should end."""

    regime: str
    track: Conservative
    fate: str  # what the path ends in, if it ends: "end stop", "dead centre", "search limit"
    doubts: tuple[str, ...]
    facts: dict[str, float]


def energy(
    meter: Metered, start: Start, until: Until, accuracy: float | None = None, why: str = ""
) -> Motion:
    """The motion of a conservative scene.

    Parameters
    ----------
    meter : the reduced system; its loads depend on q alone
    start : driver coordinate, rate, time
    until : what ends the run
    accuracy : target for the error of q [rad or m]; 1e-12 if None
    why : recorded in the result
    """
    with np.errstate(all="ignore"):
        return _energy(meter, start, until, accuracy, why)


def _energy(
    meter: Metered, start: Start, until: Until, accuracy: float | None, why: str
) -> Motion:
    one = meter.one(start.q, 0.0, start.t)
    if not (one.margin > 0 and one.J > 0 and math.isfinite(one.tau)):
        reason = "impossible pose" if not one.margin > 0 else "no inertia"
        return _nothing(meter, start, accuracy, why, reason)
    moving = start.rate != 0
    if not moving and one.tau == 0:
        return resting(meter, start, until, accuracy, why)
    view = View(meter, start.q, math.copysign(1.0, start.rate if moving else one.tau))
    K0 = one.J * start.rate**2 / 2
    planned = Planned(until, accuracy or FINEST, start)
    ahead = look_ahead(view, K0, SURVEY, planned.horizon)
    if not moving and abs(one.tau) <= AT_REST * _load_size(meter, start.q, ahead.mesh):
        return resting(meter, start, until, accuracy, why)
    course = _course(view, K0, ahead, planned)
    return _ended(meter, start, until, accuracy, why, course)


@dataclass(frozen=True)
class Planned:
    """What is asked of a run, as far as it bears on the work to do."""

    until: Until
    accuracy: float
    start: Start

    @property
    def horizon(self) -> Horizon:
        """Time and distance from the start that need not be exceeded."""
        goal, value = self.until.goal, self.until.value
        if goal == "time":
            return Horizon(time=value)
        if goal == "angle":
            return Horizon(distance=abs(value - self.start.q))
        return Horizon(distance=value * TURN) if goal == "turns" else NOWHERE

    @property
    def first_stop(self) -> bool:
        """Whether only the way to the first standstill is asked for."""
        goal, value = self.until.goal, self.until.value
        return goal == "standstill" or (goal == "swings" and value == 1)

    def passages(self, T: float) -> float:
        """How many passages of duration T the error of one adds up over."""
        goal, value = self.until.goal, self.until.value
        many = value / T if goal == "time" else value if goal in ("swings", "turns") else 1.0
        return max(1.0, many)

    def allowed(self, passage: Any) -> float:
        """Error of a passage's time that may remain [s]."""
        T = passage.total
        return self.accuracy / (passage.fastest * self.passages(T)) if T > 0 else 0.0


def _load_size(meter: Metered, q: float, mesh: Mesh) -> float:
    size = meter.system.load_size
    return size(q) if size is not None else float(np.abs(mesh.tau).max())


def _course(view: View, K0: float, ahead: Reach, planned: Planned) -> Course:
    """From what lies ahead (and, turning back, behind) to the line of the motion."""
    doubts = _doubts(ahead, view)
    low = End(0.0, K0)
    inside = (0.0, K0)
    if ahead.kind == "standstill" and (ahead.turn or K0 > 0):
        return _turning_back(view, K0, ahead, planned, doubts)
    if ahead.kind == "standstill":
        passage = _swing(view, ahead, low, End(ahead.x, 0.0, free=True), None, planned.allowed)
        return _finite(view, passage, "libration", "", 1, doubts)
    if ahead.kind == "endless":
        return _endless(view, K0, ahead, planned, doubts)
    high = End(ahead.x, None, limit=ahead.kind == "dead centre")
    passage = converged(view, ahead.mesh, low, high, None, planned.allowed)
    fate = "search limit" if ahead.kind == "open" else ahead.kind
    regime = "one way" if ahead.kind == "open" else ahead.kind
    return _finite(view, passage, regime, fate, 1, doubts, inside)


def _finite(
    view: View,
    passage: Passage,
    regime: str,
    fate: str,
    heading: int,
    doubts: tuple[str, ...],
    inside: Known | None = None,
) -> Course:
    c0 = 0.0
    if inside and passage.low.x < 0:
        c0 = float(passage.when(np.array([0.0]))[0])
    track = Conservative(Line(view, passage), c0, heading)
    facts = {"swing_time": passage.total, "period": 2 * passage.total}
    return Course(regime, track, fate, doubts, facts if regime == "libration" else {})


def _turning_back(
    view: View, K0: float, ahead: Reach, planned: Planned, doubts: tuple[str, ...]
) -> Course:
    """A standstill ahead of a motion that starts moving: what lies behind decides."""
    far = End(ahead.x, 0.0, free=True)
    inside = (0.0, K0)
    if planned.first_stop and not ahead.turn:
        way = converged(view, ahead.mesh, End(0.0, K0), far, None, planned.allowed)
        return _finite(view, way, "to a standstill", "", 1, doubts)
    if ahead.turn or (ahead.gain < 0 and not _closes_behind(view, K0, ahead)):
        return _braking(view, K0, ahead, planned, doubts)
    behind = _behind(view, K0, ahead, planned)
    doubts += _doubts(behind, view.mirrored)
    known = joined(mirrored(behind.mesh, 0.0), ahead.mesh)
    if behind.kind == "standstill":
        near = End(-behind.x, 0.0, free=True)
        passage = _swing(view, ahead, near, far, inside, planned.allowed, known)
        return _finite(view, passage, "libration", "", 1, doubts, inside)
    near = End(-behind.x, None, limit=behind.kind == "dead centre")
    passage = converged(view, known, near, far, inside, planned.allowed)
    fate = "search limit" if behind.kind == "open" else behind.kind
    return _finite(view, passage, "turning back", fate, 1, doubts, inside)


def _behind(view: View, K0: float, ahead: Reach, planned: Planned) -> Reach:
    """What lies behind the start; in a periodic scene the same samples tell."""
    return look_ahead(view.mirrored, K0, SURVEY, planned.horizon, _image(view, ahead))


def _image(view: View, ahead: Reach) -> Mesh | None:
    """The period ahead, seen looking back from its image behind the start."""
    period = view.meter.system.period
    if period is None or ahead.mesh.edges[-1] != period or any(ahead.mesh.limits):
        return None
    return mirrored(ahead.mesh, period)


def _closes_behind(view: View, K0: float, ahead: Reach) -> bool:
    """Whether a motion against a net effort is stopped behind the start as well."""
    behind = look_ahead(view.mirrored, K0, SURVEY, NOWHERE, _image(view, ahead))
    return behind.kind != "endless"


def _braking(
    view: View, K0: float, ahead: Reach, planned: Planned, doubts: tuple[str, ...]
) -> Course:
    """Against a net effort: turns until a standstill, then back and on for ever."""
    period = view.meter.system.period
    assert period is not None
    gain = -ahead.gain
    # the line runs away from the standstill; x = 0 is the start's image on its first turn
    origin = view.origin + view.sign * ahead.turn * period
    back = View(view.meter, origin, -view.sign)
    K_image = K0 - ahead.turn * gain
    low = End(-ahead.x, 0.0, free=True)
    inside = (0.0, K_image) if ahead.x > 0 else None
    known = joined(mirrored(ahead.mesh, 0.0), mirrored(ahead.mesh, period))
    first = converged(back, known, low, End(period - ahead.x), inside, planned.allowed)
    line = _secular(back, first, gain, period, planned, float(ahead.turn))
    c0 = float(line.when(np.array([ahead.turn * period]))[0])
    line = _extended(line, c0, planned)
    regime = "secular braking" if ahead.turn else "turning back"
    return Course(regime, Conservative(line, c0, -1), "", doubts, {"gain_per_turn": gain})


def _endless(
    view: View, K0: float, ahead: Reach, planned: Planned, doubts: tuple[str, ...]
) -> Course:
    """Nothing stops the motion: rotation, or secular with a net gain every turn."""
    period = ahead.x
    gain = ahead.gain
    low = End(0.0, K0)
    if gain == 0:
        high = End(period, K0)
        turn = converged(view, ahead.mesh, low, high, None, planned.allowed)
        line = Line(view, turn, period)
        facts = {"period": turn.total}
        return Course("rotation", Conservative(line, 0.0, 1), "", doubts, facts)
    first = converged(view, ahead.mesh, low, End(period), None, planned.allowed)
    line = _extended(_secular(view, first, gain, period, planned, 1.0), 0.0, planned)
    return Course("secular", Conservative(line, 0.0, 1), "", doubts, {"gain_per_turn": gain})


def _secular(
    view: View, first: Stretch, gain: float, period: float, planned: Planned, turns: float
) -> Line:
    """A line whose later turns are copies with more energy each time."""
    K = (first.low.K or 0.0) + gain
    low, high = End(first.low.x, K), End(first.low.x + period)
    later = converged(view, first.quad.mesh, low, high, None, planned.allowed)
    enough = max(turns, planned.until.value if planned.until.goal == "turns" else 0.0)
    starts = turn_starts(first.total, later.quad, gain, 0.0, int(enough) + 3)
    lost = float(later.quad.lost.sum() + later.quad.rounded.sum()) / gain
    return Line(view, first, period, later.quad, gain, starts, later.error, lost)


def _extended(line: Line, c0: float, planned: Planned) -> Line:
    """The line with turns enough for the time or angle asked for."""
    assert line.later is not None
    assert line.starts is not None
    goal, value = planned.until.goal, planned.until.value
    if goal == "time":
        clock, turns = c0 + value, 0
    elif goal == "angle":
        clock, turns = 0.0, int(abs(value - planned.start.q) / line.period) + 3
    elif goal == "turns":
        clock, turns = 0.0, int(value * TURN / line.period) + 3
    else:
        return line
    behind = float(line.starts.size) if c0 else 0.0
    starts = turn_starts(line.first.total, line.later, line.gain, clock, turns + int(behind))
    return replace(line, starts=starts)


def _swing(
    view: View,
    ahead: Reach,
    low: End,
    high: End,
    inside: Known | None,
    allowed: Allowed,
    known: Mesh | None = None,
) -> Passage:
    """A swing as one series where that serves, else on panels."""
    if not view.meter.system.knots and not _near_saddle(ahead, high):
        found = swing(view, low, high, inside, allowed)
        if found is not None:
            return found
    return converged(view, known or ahead.mesh, low, high, inside, allowed)


def _near_saddle(ahead: Reach, high: End) -> bool:
    """Whether the standstill ahead lies so near an equilibrium that one series crawls."""
    return math.isfinite(ahead.slow)


def _doubts(reach: Reach, view: View) -> tuple[str, ...]:
    """Say it where rounding decides whether the motion passes or turns back."""
    if not abs(reach.slow) <= reach.doubt:
        return ()
    q = view.origin + view.sign * reach.slow_x
    took = "turns back" if reach.kind == "standstill" and reach.x <= reach.slow_x else "passes"
    other = "passes" if took == "turns back" else "turns back"
    return (
        f"near q = {q:.12g} the kinetic energy is {reach.slow:.1e} J, its rounding "
        f"{reach.doubt:.1e} J: the data do not decide whether the motion {took} (taken here) "
        f"or {other}",
    )


def _ended(
    meter: Metered,
    start: Start,
    until: Until,
    accuracy: float | None,
    why: str,
    course: Course,
) -> Motion:
    """Cut the course where it should end, and say how good it is."""
    track = replace(course.track, t0=start.t)
    wanted, met = goal_time(track, start, until)
    stop = track.end()
    fate = course.fate if stop < math.inf else ""
    status, end = "reached", until.goal
    if wanted > stop or (wanted == math.inf and fate):
        t_end, status, end = stop, "ended", fate
    elif wanted == math.inf:
        t_end, status, end = _never(track, start), "ended", f"never reached: {course.regime}"
    else:
        t_end = wanted
    line = track.line
    state = track.state(np.array([t_end]))
    q_end, qd_end = float(state.q[0]), float(state.qd[0])
    if met is not None and status == "reached":
        q_end = met
    seconds, angle = _errors(track, t_end - start.t)
    notes = course.doubts
    error = seconds * _fastest(track, t_end) + angle + 4 * EPS * abs(q_end)
    target = accuracy
    if target is not None and error > target:
        notes += (f"accuracy not reached: {error:.1e} instead of {target:.1e}; "
                  "the rest is rounding of the data, not of the method",)
    if not getattr(line.first, "complete", True):
        notes += ("an impossible pose was met between the samples",)
        status, end = "failed", "impossible pose"
    return Motion(
        method="energy",
        why=why,
        regime=course.regime,
        status=status,  # type: ignore[arg-type]
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
    end = float(track.clock(np.array([track.t0 + elapsed]))[0])
    seconds = track.line.error(max(end, track.c0), elapsed)
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
    if end in ("end stop", "dead centre"):
        state = track.state(np.array([t_end]))
        found.append(Event(end, t_end, float(state.q[0]), float(state.qd[0])))
    return tuple(found)


def resting(
    meter: Metered, start: Start, until: Until, accuracy: float | None, why: str
) -> Motion:
    """A start at an equilibrium: it stays there; stable or not is said."""
    system = meter.system
    h = 2e-4 * (system.period or (TURN if system.kind == "rotation" else system.span))
    J = meter.one(start.q).J
    a, b, c, d = (meter.one(start.q + k * h).tau for k in (-2, -1, 1, 2))
    slope = (a - 8 * b + 8 * c - d) / (12 * h)
    scale = max(abs(a), abs(d))
    facts: dict[str, float] = {}
    notes: tuple[str, ...] = ()
    if not scale > 0:
        kind = "indifferent equilibrium"
    elif slope < 0:
        kind = "stable equilibrium"
        facts["frequency"] = math.sqrt(-slope / J)
    else:
        kind = "unstable equilibrium"
        facts["rate"] = math.sqrt(slope / J)
        notes = (
            "it stays there only in theory: any disturbance grows as "
            f"exp({facts['rate']:.6g} t)",
        )
    t_end = start.t + (until.value if until.goal == "time" else 0.0)
    return Motion(
        method="energy",
        why=why,
        regime="rest",
        status="reached" if until.goal == "time" else "rest",
        end="time" if until.goal == "time" else kind,
        t_start=start.t,
        t_end=t_end,
        q_end=start.q,
        qd_end=0.0,
        track=Still(start.q),
        events=(Event("rest", start.t, start.q, 0.0),),
        error=0.0,
        time_error=0.0,
        accuracy=accuracy,
        cost=meter.cost,
        notes=(kind, *notes),
        facts=facts,
    )


def _nothing(
    meter: Metered, start: Start, accuracy: float | None, why: str, reason: str
) -> Motion:
    """No motion at all: the start is no pose of the mechanism."""
    return Motion(
        method="energy",
        why=why,
        regime="none",
        status="failed",
        end=reason,
        t_start=start.t,
        t_end=start.t,
        q_end=start.q,
        qd_end=start.rate,
        track=Still(start.q),
        events=(),
        error=math.nan,
        time_error=math.nan,
        accuracy=accuracy,
        cost=meter.cost,
        notes=(f"{reason} at the start",),
    )


Runner = Callable[[Metered, Start, Until, float | None], Motion]
