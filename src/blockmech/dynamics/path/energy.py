r"""Method ``energy``: conservative scenes with one driver, by quadrature.

With loads that depend on the driver's coordinate alone, K = J q'^2 / 2 is an integral
of the effort and time is an integral of sqrt(J / 2K). Only J and tau are sampled: no
acceleration, no dJ/dq, no time stepping. The error is near rounding, and a run of a
hundred thousand turns costs what one turn costs.

    look ahead  ->  regime  ->  passages   ->  line  ->  clock  ->  motion
    (reach)         (here)      (stretch)      (line)   (conservative)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blockmech.dynamics.ends import DEAD_CENTRE, END_STOP, IMPOSSIBLE, NO_INERTIA
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.path.conservative import Conservative
from blockmech.dynamics.path.ending import Course, ended
from blockmech.dynamics.path.line import Line, turn_starts
from blockmech.dynamics.path.massless import NoInertia
from blockmech.dynamics.path.mesh import Mesh, View, joined, mirrored
from blockmech.dynamics.path.passage import End, Known, Passage
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.path.reach import NOWHERE, Horizon, Reach, gap, look_ahead
from blockmech.dynamics.path.stretch import Stretch, converged
from blockmech.dynamics.rest import nothing, resting, trouble
from blockmech.dynamics.system.reduced import TURN, Metered
from blockmech.dynamics.until import Asked

SURVEY = (1e-15, 1e-6)  # finest and coarsest relative error of a survey's series
FINEST = 1e-12  # target if none is given [rad or m]
AT_REST = 8 * EPS  # effort at a start from rest, relative to its contributions
PLAIN = 1e-3  # share of the largest effort above which it is no rounding, whatever cancels
RETREAT = 1e-3  # from an impossible pose: to this power, more of it every time one is found
GAPS = 4  # impossible poses discovered late, before a run is given up


def energy(meter: Metered, asked: Asked) -> Motion:
    """The motion of a conservative scene: one whose loads depend on q alone.

    The target of the error of q is 1e-12 rad (or m) if none is asked for.
    """
    with np.errstate(all="ignore"):
        empty: list[float] = []  # places without inertia found on the way
        while True:
            try:
                return _energy(meter, asked, GAPS, empty)
            except NoInertia as found:
                empty.append(found.q)
                low, high = meter.system.stops
                stops = (low, found.q) if found.q > asked.start.q else (found.q, high)
                meter.system = replace(meter.system, stops=stops)


def _energy(meter: Metered, asked: Asked, gaps: int, empty: list[float]) -> Motion:
    start = asked.start
    one = meter.pose(start.q, 0.0, start.t)
    reason = trouble(one)
    if reason:
        return nothing(meter, asked, "energy", reason)
    moving = start.rate != 0
    if not moving and one.tau == 0:
        return resting(meter, asked)
    view = View(meter, start.q, math.copysign(1.0, start.rate if moving else one.tau))
    K0 = one.J * start.rate**2 / 2
    planned = Planned(asked)
    ahead = look_ahead(view, K0, planned.survey, planned.horizon)
    if not moving and _balanced(meter, start.q, one.tau, ahead.mesh):
        return resting(meter, asked)
    course = _course(view, K0, ahead, planned)
    passage = course.track.line.first
    if isinstance(passage, Stretch) and not passage.complete:
        # the mechanism does not close somewhere between the samples of the survey
        if not gaps:
            return nothing(meter, asked, "energy", IMPOSSIBLE)
        bounded = _bounded(meter, course.track.line.view, passage, RETREAT**gaps)
        return _energy(bounded, asked, gaps - 1, empty)
    return ended(meter, asked, _named(course, empty))


def _named(course: Course, empty: list[float]) -> Course:
    """An end gets its own name where the driver has no inertia: a stop was put there."""
    first, view = course.track.line.first, course.track.line.view
    end = first.low if course.track.turns_high else first.high
    near = 1e-9 * max(1.0, abs(view.origin), first.high.x - first.low.x)
    q = view.origin + view.sign * end.x
    if course.fate != END_STOP or not any(abs(q - x) <= near for x in empty):
        return course
    regime = NO_INERTIA if course.regime == END_STOP else course.regime
    return replace(course, fate=NO_INERTIA, regime=regime)


def _bounded(meter: Metered, view: View, passage: Stretch, back: float) -> Metered:
    """The system, its driver kept on this side of an impossible pose just found.

    ``back``: share of the way by which it is kept away from it. Where rounding decides what is
    possible, the last possible pose is none the next time.
    """
    x = gap(view, passage.quad.mesh) * (1 - back)
    q = view.origin + view.sign * x
    low, high = meter.system.arc or (-math.inf, math.inf)
    arc = (low, min(high, q)) if view.sign * x > 0 else (max(low, q), high)
    meter.system = replace(meter.system, arc=arc)
    return meter


@dataclass(frozen=True)
class Planned:
    """What is asked of a run, as far as it bears on the work to do."""

    asked: Asked

    @property
    def horizon(self) -> Horizon:
        """Time and distance from the start that need not be exceeded."""
        goal, value = self.asked.until.goal, self.asked.until.value
        if goal == "time":
            return Horizon(time=value)
        if goal == "angle":
            return Horizon(distance=abs(value - self.asked.start.q))
        return Horizon(distance=value * TURN) if goal == "turns" else NOWHERE

    @property
    def survey(self) -> float:
        """Relative error of a survey's series that may remain [-]."""
        # the same for all targets but the finest: a looser one must not cost more later
        share = 0.5 * min(self.asked.accuracy or FINEST, FINEST) / TURN
        return min(max(share, SURVEY[0]), SURVEY[1])

    @property
    def first_stop(self) -> bool:
        """Whether only the way to the first standstill is asked for."""
        goal, value = self.asked.until.goal, self.asked.until.value
        return goal == "standstill" or (goal == "swings" and value == 1)

    def allowed(self, passage: Any) -> float:
        """Error of a passage's time that may remain [s]; errors of passages add up.

        They are stated as those of one more passage than are asked for, see `Line.error`.
        """
        goal, value = self.asked.until.goal, self.asked.until.value
        T = passage.total
        if not T > 0:
            return 0.0
        many = 1.0
        if goal == "time":
            many = value / T
        elif goal in ("swings", "turns"):
            many = value
        elif goal == "angle":
            many = abs(value - self.asked.start.q) / (passage.high.x - passage.low.x)
        return float((self.asked.accuracy or FINEST) / (passage.fastest * (1.0 + many)))


def _balanced(meter: Metered, q: float, tau: float, mesh: Mesh) -> bool:
    """Whether the effort at a start from rest is nothing but rounding of its contributions."""
    usual = float(np.abs(mesh.tau).max())
    if abs(tau) > PLAIN * usual:
        return False
    size = meter.system.load_size
    return abs(tau) <= AT_REST * (size(q) if size is not None else usual)


def _course(view: View, K0: float, ahead: Reach, planned: Planned) -> Course:
    """From what lies ahead (and, turning back, behind) to the line of the motion."""
    doubts = _doubts(ahead, view)
    low = End(0.0, K0)
    inside = (0.0, K0)
    if ahead.kind == "standstill" and (ahead.turn or K0 > 0):
        return _turning_back(view, K0, ahead, planned, doubts)
    if ahead.kind == "standstill":
        high = End(ahead.x, 0.0, free=True)
        passage = converged(view, ahead.mesh, ahead.edges, low, high, None, planned.allowed)
        return _finite(view, passage, "libration", "", 1, doubts)
    if ahead.kind == "endless":
        return _endless(view, K0, ahead, planned, doubts)
    high = End(ahead.x, None, limit=ahead.kind == DEAD_CENTRE)
    passage = converged(view, ahead.mesh, ahead.edges, low, high, None, planned.allowed)
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
        way = converged(view, ahead.mesh, ahead.edges, End(0.0, K0), far, None, planned.allowed)
        return _finite(view, way, "to a standstill", "", 1, doubts)
    if ahead.turn or (ahead.gain < 0 and not _closes_behind(view, K0, ahead, planned)):
        return _braking(view, K0, ahead, planned, doubts)
    behind = _behind(view, K0, ahead, planned)
    doubts += _doubts(behind, view.mirrored)
    known = joined(mirrored(behind.mesh, 0.0), ahead.mesh)
    edges = np.concatenate([-behind.edges[::-1], ahead.edges[1:]])
    if behind.kind == "standstill":
        near = End(-behind.x, 0.0, free=True)
        passage = converged(view, known, edges, near, far, inside, planned.allowed)
        return _finite(view, passage, "libration", "", 1, doubts, inside)
    near = End(-behind.x, None, limit=behind.kind == DEAD_CENTRE)
    passage = converged(view, known, edges, near, far, inside, planned.allowed)
    fate = "search limit" if behind.kind == "open" else behind.kind
    return _finite(view, passage, "turning back", fate, 1, doubts, inside)


def _behind(view: View, K0: float, ahead: Reach, planned: Planned) -> Reach:
    """What lies behind the start; in a periodic scene the same samples tell."""
    return look_ahead(view.mirrored, K0, planned.survey, planned.horizon, _image(view, ahead))


def _image(view: View, ahead: Reach) -> Mesh | None:
    """The period ahead, seen looking back from its image behind the start."""
    period = view.meter.system.period
    if period is None or ahead.mesh.edges[-1] != period or any(ahead.mesh.limits):
        return None
    return mirrored(ahead.mesh, period)


def _closes_behind(view: View, K0: float, ahead: Reach, planned: Planned) -> bool:
    """Whether a motion against a net effort is stopped behind the start as well."""
    behind = look_ahead(view.mirrored, K0, planned.survey, NOWHERE, _image(view, ahead))
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
    edges = np.concatenate([-ahead.edges[::-1], period - ahead.edges[-2::-1]])
    high = End(period - ahead.x)
    first = converged(back, known, edges, low, high, inside, planned.allowed)
    line = _secular(back, first, gain, period, planned, float(ahead.turn))
    c0 = float(line.when(np.array([ahead.turn * period]))[0])
    line = _extended(line, c0, planned)
    regime = "secular braking" if ahead.turn else "turning back"
    facts = _repeating(ahead.gain, period)
    return Course(regime, Conservative(line, c0, -1), "", doubts, facts)


def _endless(
    view: View, K0: float, ahead: Reach, planned: Planned, doubts: tuple[str, ...]
) -> Course:
    """Nothing stops the motion: rotation, or secular with a net gain every turn."""
    period = ahead.x
    gain = ahead.gain
    low = End(0.0, K0)
    if gain == 0:
        high = End(period, K0)
        turn = converged(view, ahead.mesh, ahead.edges, low, high, None, planned.allowed)
        line = Line(view, turn, period)
        facts = {"period": turn.total, "mean_speed": period / turn.total}
        return Course("rotation", Conservative(line, 0.0, 1), "", doubts, facts)
    first = converged(view, ahead.mesh, ahead.edges, low, End(period), None, planned.allowed)
    line = _extended(_secular(view, first, gain, period, planned, 1.0), 0.0, planned)
    facts = _repeating(gain, period)
    return Course("secular", Conservative(line, 0.0, 1), "", doubts, facts)


def _repeating(gain: float, period: float) -> dict[str, float]:
    """The loads' work [J] along the motion, and the coordinate [rad] after which they repeat."""
    return {"work_per_period": gain, "period_of_loads": period}


def _secular(
    view: View, first: Stretch, gain: float, period: float, planned: Planned, turns: float
) -> Line:
    """A line whose later turns are copies with more energy each time."""
    K = (first.low.K or 0.0) + gain
    low, high = End(first.low.x, K), End(first.low.x + period)
    mesh = first.quad.mesh
    later = converged(view, mesh, mesh.edges, low, high, None, planned.allowed)
    starts = turn_starts(first.total, later.quad, gain, 0.0, int(turns) + 3)
    lost = float(later.quad.lost.sum() + later.quad.rounded.sum()) / gain
    return Line(view, first, period, later.quad, gain, starts, later.error, lost)


def _extended(line: Line, c0: float, planned: Planned) -> Line:
    """The line with turns enough for the time or angle asked for."""
    assert line.later is not None
    assert line.starts is not None
    goal, value = planned.asked.until.goal, planned.asked.until.value
    if goal == "time":
        clock, turns = c0 + value, 0
    elif goal == "angle":
        clock, turns = 0.0, int(abs(value - planned.asked.start.q) / line.period) + 3
    elif goal == "turns":
        clock, turns = 0.0, int(value * TURN / line.period) + 3
    else:
        return line
    behind = float(line.starts.size) if c0 else 0.0
    starts = turn_starts(line.first.total, line.later, line.gain, clock, turns + int(behind))
    return replace(line, starts=starts)


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
