r"""The path method: one driver, loads of the place alone, no joint friction.

With K = J q'^2 / 2, exactly

    dK/dq = tau            the work of all loads and of friction along the path
    dt/dq = sqrt(J / 2K)

so where tau depends on the place alone a motion is an integral along its path, with no steps in
time, and K is known before the motion.

    path ahead -> panel -> standstill? goal? end? -> next panel ... -> a pattern that repeats

Source of the identity: [D14] Eq. 1, in its integrated form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics import compiled_path, ends
from blockmech.dynamics.compiled_path import BothRuns, PathCode
from blockmech.dynamics.estimate import (
    PARTED,
    ROUNDING,
    TARGET,
    UNFINISHED,
    difference,
    judged,
    missed,
    one_motion,
    rounding_share,
    stopped,
    with_rounding,
)
from blockmech.dynamics.panel_builder import PanelBuilder, PathState
from blockmech.dynamics.panel_row import PanelRow
from blockmech.dynamics.panels import Panels, joined
from blockmech.dynamics.path_mesh import (
    CLOSE,
    COARSE,
    FINE,
    PIECES,
    LeftToArraysError,
    PathMesh,
    Piece,
)
from blockmech.dynamics.place_data import RESOLVED, J
from blockmech.dynamics.repetition import PeriodicContinuation, swings, turns
from blockmech.dynamics.rest import balanced, equilibrium
from blockmech.dynamics.run import Run, RunEnd
from blockmech.dynamics.second_run import second_run
from blockmech.dynamics.singular import time_left
from blockmech.dynamics.track import Leg, PathTrack, RepeatedSegment, apart
from blockmech.ground.plane import EPS
from blockmech.result.motion import Event, Motion, Still

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

MOST = 8_000  # panels of a run; ten seconds of work and more
# Panels in a row, one by one, that cover less than a part of a piece of the path: it crawls. Panels
# crowd to where something is not smooth as powers of two, a score on either side.
CROWD, CRAWL = 48, 1 / 64


@dataclass
class PathRun(Run):
    """One run: where the motion is, and what it left behind.

    t [s] counts from the start of the run; K [J]; sign is the direction of the motion. A run
    ``perturbed`` starts some roundings off, and has rounding added to inertia and energies.
    """

    n: int
    perturbed: bool = False
    q: float = 0.0
    K: float = 0.0
    sign: int = 0
    panels: list[Panels] = field(default_factory=list)  # since the last leg
    legs: list[Leg] = field(default_factory=list)
    regime: str = "one way"
    count: int = 0  # of panels
    alone: int = 0  # panels to be made one by one, where many at once were not resolved
    pause: int = 0  # how many the last time
    lately: list[float] = field(default_factory=list)  # ends of panels since a standstill
    mark: tuple[int, PathState] | None = None  # panel and state where a pattern may begin
    both: BothRuns | None = None  # this and the second run by machine code

    def __post_init__(self) -> None:
        self.rounding = ROUNDING + 2 * self.system.noise  # relative, of work and inertia
        self.off = ROUNDING if self.perturbed else 0.0
        q, tolerance = float(self.request.start.q), RESOLVED + self.system.noise
        self.q = q * (1 + self.off)
        # At a dead centre the cosine of a pose, from squares of lengths, squared again, is 1.
        self.mesh = PathMesh(self.system, self.q, self.n, tolerance, 4 * self.off, self.rounding)
        self.next = PanelBuilder(self.mesh, self.rounding if self.perturbed else 0.0)

    # -- the run ------------------------------------------------------------

    def begin(self) -> RunEnd | None:
        """Take the energy of the start, or leave a standstill."""
        rate = float(self.request.start.rate) * (1 + self.off)
        self.K, over = self.inertia() * rate**2 / 2, None
        if self.K > 0:  # not of a rate whose square is below all numbers
            self.sign = 1 if rate > 0 else -1
            self.mark = (0, self.at)
        else:
            over = self.leave()
        if self.both is not None:
            self.both.begin(self.q, self.K, self.beside())
        return over

    @property
    def now(self) -> float:
        """Time [s] of the motion."""
        return self.request.start.t + self.t

    @property
    def at(self) -> PathState:
        """The state."""
        return PathState(self.t, self.q, self.K, self.sign)

    @property
    def crawls(self) -> bool:
        """Whether panels stay so short that integration in time is quicker; then a note says so."""
        if len(self.lately) <= CROWD:
            return False
        period, way = self.system.period or self.system.span, self.q - self.lately[-CROWD]
        if abs(way) >= CRAWL * period / PIECES:
            return False
        from_q = f"from q = {self.lately[-CROWD]:.9g} on"
        self.notes.append(f"{CROWD} panels in a row cover {abs(way):.1e} {from_q}: it crawls")
        return True

    def told(self, t: float) -> None:
        """Tell those who follow the progress how far it is [s]."""
        if self.system.progress is not None:
            span = self.request.span
            self.system.progress("moving", t, span if span < math.inf else None)

    def leave(self) -> RunEnd | None:
        """From a standstill: the direction in which the motion starts, or rest."""
        q, system = self.q, self.system
        self.K = 0.0
        q = q if self.count else float(self.request.start.q)
        if balanced(system, q):
            kind, facts, notes = equilibrium(system, q)
            self.facts.update(facts)
            self.notes += [kind, *notes]
            return self.rest(kind)
        self.sign = 1 if system.at(q).tau[0] > 0 else -1
        self.mark = (len(self.panels), self.at)
        return None

    def rest(self, kind: str) -> RunEnd:
        """Stay at this place from now on."""
        self.happened(ends.REST, self.q, 0.0)
        self.regime = "rest"
        if self.request.span == math.inf:
            return RunEnd(kind, "ended" if self.panels or self.legs else "rest")
        self.t = self.request.span
        return RunEnd("time", "reached")

    def segment(self) -> RunEnd | None:
        """One panel further, or all of them at once up to the next transition."""
        if self.count > MOST or self.crawls:
            return RunEnd(ends.TOO_MANY)
        stop = self.system.stops[0][self.sign > 0]
        beyond = self.sign * (self.q - stop) >= 0
        piece = ends.END_STOP if beyond else self.mesh.ahead(self.q, self.sign)
        if isinstance(piece, str):
            return self.arrive(piece)
        end = piece.end(self.sign)
        if self.here(end):
            self.q = end
            if self.K > 0:
                return self.passed(piece)
            what = piece.what_ends(self.sign)
            return self.arrive(what) if what else None
        goals = [stop, *self.request.places]
        if self.mark is not None and self.system.period is not None:
            goals.append(self.turned(self.system.period))
        goals = [x for x in goals if self.sign * (x - self.q) > 0 and not self.here(x)]
        goal = min(goals, key=lambda x: self.sign * x, default=self.sign * math.inf)
        panel: Panels | RunEnd | None = self.at_once(goal)
        if panel is None:
            nearest = min(end, goal, key=lambda x: self.sign * x)
            panel = self.next.panel(self.at, piece, nearest)
        if isinstance(panel, RunEnd):
            return self.obstructed(panel) if panel.end else None
        ahead = piece.what_ends(self.sign) == ends.DEAD_CENTRE
        if ahead and (panel.t1 > self.request.span or float(panel.spans.end[-1]) == goal):
            way = abs(float(panel.state(np.array([self.request.span]))[0][0]) - self.q)
            if self.next.kept_clear(self.at, piece, way):
                return None
        self.take(panel)
        self.lately.append(self.q)
        return self.passed(piece)

    def at_once(self, goal: float) -> Panels | None:
        """All panels until a standstill or a goal; None where that is not for all at once."""
        if self.alone > 0:
            self.alone -= 1
            return None
        if self.both is not None:
            return self.both.over(self.mesh, self.at, goal)
        row = PanelRow.ahead(self.next, self.at, goal)
        panels = row.panels() if row else None
        self.pause = 0 if panels is not None or not row else 2 * self.pause + 1
        self.alone = self.pause
        return panels

    def obstructed(self, by: RunEnd) -> RunEnd | None:
        """A standstill, or the end, where no panel goes on."""
        if by.end == ends.STANDSTILL:
            self.K = 0.0
            return self.stand()
        over = self.arrive(by.end)
        return by._replace(status=over.status, left=over.left)

    def here(self, x: float) -> bool:
        """Whether a place is where the motion is, but for rounding."""
        return abs(x - self.q) <= CLOSE * max(abs(x), abs(self.q))

    def turned(self, period: float) -> float:
        """The place one period beyond the mark."""
        assert self.mark is not None
        return self.mark[1].q + self.sign * period

    def take(self, panel: Panels) -> None:
        """The motion goes over panels."""
        self.told(self.t)
        self.panels.append(panel)
        self.count += len(panel.w)
        self.t, (self.q, self.K) = panel.t1, panel.at_end()
        if self.perturbed and self.K > 0:
            self.K += self.rounding * panel.size

    def passed(self, piece: Piece) -> RunEnd | None:
        """What happens at the end of a panel."""
        if self.t >= self.request.span:
            self.t = self.request.span
            return RunEnd("time", "reached")
        if self.K == 0 and (over := self.stand()) is not None:
            return over
        if any(map(self.here, self.request.places)):
            return RunEnd(self.request.until.goal, "reached")
        if self.here(piece.end(self.sign)) and piece.what_ends(self.sign):
            return self.arrive(piece.what_ends(self.sign))
        period = self.system.period
        if self.mark is None or period is None or not self.here(self.turned(period)):
            return None
        return self.repeat_turn(period)

    def inertia(self) -> float:
        """[kg m2 or kg] where the motion is."""
        return float(self.system.at(self.q).J[0])

    def beside(self) -> float:
        """[J] with which the second run starts."""
        piece = self.mesh.ahead(self.q, self.sign) if self.K else ""
        if isinstance(piece, str):
            return 0.0
        rate = float(self.request.start.rate) * (1 + ROUNDING)
        inertia = piece.rows(np.array([self.q]))[len(piece.data.rows) + J, 0]
        return float(inertia) * rate**2 / 2

    def rate(self) -> float:
        """Rate of the driver."""
        return self.sign * math.sqrt(2 * self.K / self.inertia())

    def stand(self) -> RunEnd | None:
        """A standstill: the goal, or on from there."""
        self.lately.clear()
        self.happened(ends.STANDSTILL, self.q, 0.0)
        if (over := self.stood()) is not None:
            self.regime = "to a standstill" if self.regime == "one way" else self.regime
            return over
        if self.mark is not None and self.mark[1].K == 0:
            return self.repeat(
                swings(self.since_mark(mirrored=True), self.request, self.standstills)
            )
        if self.is_too_slow():
            note = (
                f"{self.count} panels reach {self.t:.3g} s, at most {MOST} are made: ask for a "
                'shorter time, or for what it settles to, "steady"'
            )
            return RunEnd(ends.TOO_MANY, "failed", note=note)
        return self.leave()

    def is_too_slow(self) -> bool:
        """Whether the time asked for is out of reach of swings that take work each, as these."""
        some = self.count > MOST / 8
        return some and math.inf > self.request.span > self.t * MOST / self.count

    def arrive(self, what: str) -> RunEnd:
        """The end of the path."""
        rate = self.rate() if what != ends.DEAD_CENTRE else 0.0
        self.regime = what
        self.happened(what, self.q, rate)
        if what != ends.DEAD_CENTRE:
            return RunEnd(what, "failed" if what == ends.UNDECIDED else "ended")
        return self.short_of(what, time_left(self.system, what, self.q, rate) if rate else 0.0)

    # -- patterns ------------------------------------------------------------

    def since_mark(self, **more: Any) -> RepeatedSegment:
        """What was since the mark, with times counted from there, as a pattern."""
        assert self.mark is not None
        first, at = self.mark
        return RepeatedSegment(at.t, joined(self.panels[first:]).taken_from(0.0), **more)

    def repeat(self, by: PeriodicContinuation) -> RunEnd | None:
        """A pattern takes the place of its first repetition, and tells what follows."""
        assert self.mark is not None
        first, start = self.mark
        before = self.panels[:first]
        self.legs += [joined(before), by.pattern] if before else [by.pattern]
        self.panels, self.mark, self.regime, self.t = [], None, by.regime, by.t
        self.facts.update(by.facts)
        self.notes += [by.note] if by.note else []
        t0 = self.request.start.t
        self.events += [Event(ends.STANDSTILL, t0 + t, q, 0.0) for t, q in by.stands]
        if by.many:
            self.q = start.q + by.many * by.pattern.step
            self.K = start.K + by.many * by.pattern.gain
        return by.over

    def repeat_turn(self, period: float) -> RunEnd | None:
        """A turn without a standstill: it repeats, with more energy or less each time."""
        assert self.mark is not None
        start = self.mark[1]
        if not start.K:  # the next turn tells
            self.mark = (len(self.panels), self.at)
            return None
        turn = self.since_mark(step=self.sign * period, gain=self.K - start.K)
        lossless = self.system.lossless  # but for rounding of some panels
        lossless = lossless or abs(turn.gain) <= 16 * self.rounding * turn.panels.size
        turn = replace(turn, gain=0.0) if lossless and turn.gain else turn
        pattern = turns(turn, self.request, self.mesh.tolerance, self.told)
        if pattern is not None:
            return self.repeat(pattern)
        self.mark = (len(self.panels), self.at)  # the next turn tells
        return None

    # -- the result ------------------------------------------------------------

    @property
    def whole(self) -> list[Leg]:
        """All that the run left behind."""
        return [*self.legs, joined(self.panels)] if self.panels else self.legs

    def motion(self) -> Motion:
        """The motion of a run that has ended; of one that moved the error is not known yet."""
        request, t0 = self.request, self.request.start.t
        legs = self.whole
        track = PathTrack(tuple(legs), t0) if legs else Still(self.q)
        if self.events and self.events[-1].t == self.now:
            q, qd = self.events[-1].q, self.events[-1].qd
        else:  # with the times wanted, which are asked for again
            times = np.array([*(t for t in request.times if t0 <= t < self.now), self.now])
            q, qd = (float(x[-1]) for x in track.state(times))
        if self.end == request.until.goal and any(map(self.here, self.request.places)):
            q = self.q
        failed = self.over is not None and self.over.status == "failed"
        motion = self.result(
            method="energy",
            regime="none" if failed else self.regime,
            t_end=self.now,
            q_end=q,
            qd_end=qd,
            track=track,
        )
        return motion if legs else motion.but(error=0.0)


def along_path(system: System, request: SimulationRequest) -> Motion:
    """The motion by the path method, with its error (`estimate`).

    Of two runs the coarser has fewer nodes and is some roundings off, in its start, its inertia
    and the work of each panel: where that matters, the data do not tell more.
    """
    if (code := worth_machine_code(system)) is not None:
        run = PathRun(system, request, FINE)
        run.both = BothRuns(code, run.rounding, run.mesh.tolerance)
        run.mesh.kept_only = True
        if (motion := judged_in_place(run)) is not None:
            return motion
    fine = PathRun(system, request, FINE)
    if (motion := judged_in_place(fine)) is not None:
        return motion
    run = PathRun(system, request, COARSE, True)
    run.run()
    coarse = run.motion()
    given_up = (ends.TOO_MANY,) if request.method == "auto" else ()
    if coarse.end in (*ends.STOPPED, *given_up):
        return stopped(coarse, None)
    if not fine.end:
        fine.run()
    motion = fine.motion()
    if fine.end in UNFINISHED:
        return stopped(motion, coarse if fine.end in ends.STOPPED else None)
    if not fine.whole:
        return motion
    if coarse.end == ends.TOO_MANY and coarse.t_end < motion.t_end:
        return stopped(coarse, replace(motion, notes=(*coarse.notes, *motion.notes)))
    by = difference(coarse, motion, system.rotary, request.times)
    motion = judged(coarse, motion, by, request.times)
    return with_rounding(system, motion, request.accuracy or TARGET, by)


def worth_machine_code(system: System) -> PathCode | None:
    """What moves both runs by machine code; None where there is none, or not yet.

    `auto` makes or loads some once the mechanism was moved so many times that it pays.
    """
    if system.period is None or system.engine == "scalar":
        return None
    motions = system.kept["motions"] = system.kept.get("motions", 0) + 1
    return PathCode.made() if system.engine == "llvm" or PathCode.pays(motions) else None


def judged_in_place(run: PathRun) -> Motion | None:
    """The motion of a run, its error by a second run over the same panels.

    None where that run takes another path, or both differ as two motions do.
    """
    try:
        run.run()
    except LeftToArraysError:
        return None
    if run.end in UNFINISHED:
        return stopped(run.motion(), None)
    if not run.whole:
        return run.motion()
    if (legs := second_run(run)) is None:
        return None
    system, start, whole, motion = run.system, run.request.start, run.whole, run.motion()
    share = rounding_share(system, float(start.q), bool(start.rate), start.t)
    look = apart if run.both is None else compiled_path.apart
    by = look(whole, legs, start.t, motion.t_end, share)
    late = 0.0 if motion.end == "time" else by.late
    size = max(abs(by.low), abs(by.high)) + abs(motion.t_end) * by.fastest
    within = one_motion(by.high - by.low, 1.0 if system.rotary[0] else math.inf, size)
    if not (by.q <= within and late <= PARTED * (motion.t_end - start.t)):
        return None
    engine, late = motion.engine if run.both is None else "llvm", motion.time_error + late
    motion = motion.but(error=by.q, time_error=late, engine=engine)
    target = run.request.accuracy or TARGET
    if by.unsure or (start.rate and abs(start.rate) <= EPS * by.fastest):  # as from rest
        return with_rounding(system, motion, target)
    unsure = 0.0 if motion.end == "time" else share * max(abs(by.t), by.t - start.t)
    error, time_error = motion.error + by.rounding, motion.time_error + unsure
    return missed(motion.but(error=error, time_error=time_error), target)
