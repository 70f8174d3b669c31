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
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebval

from blockmech.dynamics import ends
from blockmech.dynamics.compiled_path import PathCode
from blockmech.dynamics.ends import RunEnd
from blockmech.dynamics.equation import time_left
from blockmech.dynamics.estimate import (
    PARTED,
    ROUNDING,
    TARGET,
    UNFINISHED,
    difference,
    judged,
    missed,
    rounding_share,
    same_motion_limit,
    stopped,
    with_rounding,
)
from blockmech.dynamics.panel_nodes import CLOSE, COARSE, END, FINE, KIND, PANEL, SHORT, TO_LIMIT, J
from blockmech.dynamics.panels import Panels, joined
from blockmech.dynamics.path_loops import (
    FAILED,
    HALVED,
    KINETIC,
    PLACE,
    ROOT,
    ROUNDED,
    SHORTER,
    STOP,
)
from blockmech.dynamics.path_mesh import PIECES, Course, PathMesh, Piece
from blockmech.dynamics.place_data import RESOLVED
from blockmech.dynamics.repetition import PeriodicContinuation, swings, turns
from blockmech.dynamics.rest import balanced, equilibrium
from blockmech.dynamics.run import EVALUATIONS, REMEDY, Run
from blockmech.dynamics.track import Leg, PathTrack, RepeatedSegment, apart, second_run
from blockmech.ground.plane import EPS
from blockmech.result.motion import Event, Motion, Still
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

MOST = EVALUATIONS // FINE  # panels of a run; ten seconds of work and more
# Panels in a row that cover less than a part of a piece of the path: it crawls. Panels crowd to
# where something is not smooth as powers of two, a score on either side.
CROWD, CRAWL = 6 * SHORT, 1 / SHORT**2


class Mark(NamedTuple):
    """Where a pattern may begin: the panel, time [s], coordinate and kinetic energy [J]."""

    panel: int
    t: float
    q: float
    K: float


@dataclass
class PathRun(Run):
    """One run with another beside it, and what they left behind.

    t [s] counts from the start of the run; sign is the direction of the motion. A run
    ``perturbed`` starts some roundings off, and has rounding added to inertia and energies; so has
    the one beside a run of `FINE` nodes.

    runs : (2, 5) where both are, see `path_loops`
    """

    n: int
    code: PathCode
    perturbed: bool = False
    sign: int = 0
    runs: Floats = field(default_factory=lambda: np.zeros((2, 5)))
    panels: list[Panels] = field(default_factory=list)  # since the last leg
    legs: list[Leg] = field(default_factory=list)
    regime: str = "one way"
    count: int = 0  # of panels
    lately: list[float] = field(default_factory=list)  # ends of panels since a standstill
    mark: Mark | None = None

    def __post_init__(self) -> None:
        self.rounding = ROUNDING + 2 * self.system.noise  # relative, of work and inertia
        self.off = ROUNDING if self.perturbed else 0.0
        q, tolerance = float(self.request.start.q), RESOLVED + self.system.noise
        # At a dead centre the cosine of a pose, from squares of lengths, squared again, is 1.
        begin, off = q * (1 + self.off), 4 * self.off
        self.mesh = PathMesh(self.system, begin, self.n, tolerance, off, self.rounding)
        self.runs[:, PLACE] = begin, q * (1 + ROUNDING)
        self.runs[:, ROUNDED] = self.rounding if self.perturbed else 0.0, self.rounding

    # -- the run ------------------------------------------------------------

    @property
    def q(self) -> float:
        """[rad or m] reached."""
        return float(self.runs[0, PLACE])

    @property
    def K(self) -> float:
        """[J] kinetic energy there."""
        return float(self.runs[0, KINETIC])

    def begin(self) -> RunEnd | None:
        """Take the energy of the start, or leave a standstill."""
        rate = float(self.request.start.rate)
        self.runs[0, KINETIC] = self.inertia() * (rate * (1 + self.off)) ** 2 / 2
        if not self.K > 0:  # also of a rate whose square is below all numbers
            return self.leave()
        self.sign = 1 if rate > 0 else -1
        next_course = self.mesh.course(self.q, self.sign)
        if not isinstance(next_course, str):
            course, shift = next_course
            low, high, limit, *_ = course.bounds[0]
            share = (self.q - shift - low) / (high - low)
            inertia = float(chebval(2 * share - 1, course.blocks[course.which[0], 1, J]))
            self.runs[1, KINETIC] = self.K if limit else inertia * (rate * (1 + ROUNDING)) ** 2 / 2
        self.mark = self.at
        return None

    @property
    def now(self) -> float:
        """Time [s] of the motion."""
        return self.request.start.t + self.t

    @property
    def at(self) -> Mark:
        """The state."""
        return Mark(len(self.panels), self.t, self.q, self.K)

    @property
    def crawls(self) -> bool:
        """Whether panels stay so short that integration in time is quicker; then a note says so."""
        if len(self.lately) <= CROWD:
            return False
        period, begin = self.system.period or self.system.span, self.lately[-CROWD]
        if abs(self.q - begin) >= CRAWL * period / PIECES:
            return False
        distance = f"{abs(self.q - begin):.1e} from q = {begin:.9g} on"
        self.notes.append(f"{CROWD} consecutive panels cover {distance}: no progress")
        return True

    def report_progress(self, t: float) -> None:
        """Tell those who follow the progress how far it is [s], while there is budget."""
        self.system.budget.check()
        if self.system.progress is not None:
            span = self.request.span
            self.system.progress("moving", t, span if span < math.inf else None)

    def leave(self) -> RunEnd | None:
        """From a standstill: the direction in which the motion starts, or rest."""
        q, system = self.q, self.system
        self.runs[:, KINETIC] = 0.0
        q = q if self.count else float(self.request.start.q)
        if balanced(system, q):
            kind, facts, notes = equilibrium(system, q)
            self.facts.update(facts)
            self.notes += [kind, *notes]
            return self.rest(kind)
        self.sign = 1 if system.at(q).tau[0] > 0 else -1
        self.mark = self.at
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
        """Panels up to the next transition."""
        if self.count > MOST or self.crawls:
            return RunEnd(ends.TOO_MANY)
        stop = self.system.stops[0][self.sign > 0]
        beyond = self.sign * (self.q - stop) >= 0
        next_course = ends.END_STOP if beyond else self.mesh.course(self.q, self.sign)
        if isinstance(next_course, str):
            return self.arrive(next_course)
        goals = [stop, *self.request.goals]
        if self.mark is not None and self.system.period is not None:
            goals.append(self.turned(self.system.period))
        goals = [x for x in goals if self.sign * (x - self.q) > 0 and not self.is_at(x)]
        goal = min(goals, key=lambda x: self.sign * x, default=self.sign * math.inf)
        piece = next_course[0].pieces[0].shifted(next_course[1])
        if self.keep_clear(piece, goal):
            return None
        self.report_progress(self.t)
        before, last = self.runs.copy(), piece.obstacle(self.sign)
        outcome, piece, panels = self.pass_over(*next_course, goal)
        if panels is not None:
            panels.t0 = self.t
            if last == ends.DEAD_CENTRE and panels.t1 > self.request.span:
                coordinate = float(panels.state(np.array([self.request.span]))[0][0])
                after = self.runs.copy()
                self.runs[:] = before
                if self.keep_clear(piece, coordinate):
                    return None
                self.runs[:] = after
            self.take(panels)
        if outcome in (SHORTER, FAILED):
            return self.obstructed(outcome, piece)
        return self.passed(piece)

    def pass_over(
        self, course: Course, shift: float, goal: float
    ) -> tuple[int, Piece, Panels | None]:
        """Both runs over pieces to a standstill or a goal: how they leave the last, and panels."""
        many, counts = len(course.which), np.zeros(2, np.int64)
        records = np.empty((2 * HALVED + 2, PANEL, 2, self.n + 2))
        outcome = self.code.over_pieces(
            course.blocks, course.which, course.bounds, shift, goal, many, float(self.sign),
            self.mesh.tolerance, self.runs, records, counts,
        )  # fmt: skip
        count, last = counts.tolist()
        piece = course.pieces[last].shifted(shift)
        panels = Panels(records[:count].copy(), compiled=self.code.placed is not None)
        return outcome, piece, panels if count else None

    def keep_clear(self, piece: Piece, coordinate: float) -> bool:
        """Whether a way that ends before a dead centre got a piece that ends before it as well.

        The values of one that does not lose digits there, and its series lose them everywhere.
        """
        distance, length = abs(coordinate - self.q), abs(piece.end(self.sign) - self.q)
        dead_centre = piece.obstacle(self.sign) == ends.DEAD_CENTRE
        if not dead_centre or length - distance <= ROOT * distance:
            return False
        self.mesh.shorten(piece, self.q, self.sign, (length + distance) / 2)
        return True

    def obstructed(self, outcome: int, piece: Piece) -> RunEnd | None:
        """A shorter piece of the path where what happens asks for one, or the end."""
        distance = abs(float(self.runs[0, STOP]) - self.q)
        if outcome == SHORTER:
            if not self.keep_clear(piece, float(self.runs[0, STOP])):
                self.mesh.shorten(piece, self.q, self.sign, SHORT / 2 * distance)
            return None
        return RunEnd(ends.TOO_MANY, note=f"the loads are not smooth at q = {self.q:.12g}")

    def is_at(self, x: float) -> bool:
        """Whether a place is where the motion is, but for rounding."""
        return abs(x - self.q) <= CLOSE * max(abs(x), abs(self.q))

    def turned(self, period: float) -> float:
        """The place one period beyond the mark."""
        assert self.mark is not None
        return self.mark.q + self.sign * period

    def take(self, panels: Panels) -> None:
        """The motion goes over panels."""
        self.panels.append(panels)
        self.count += len(panels.records)
        self.t = panels.t1
        self.lately += panels.spans[END].tolist()

    def passed(self, piece: Piece) -> RunEnd | None:
        """What happens at the end of panels."""
        if self.t >= self.request.span:
            self.t = self.request.span
            return RunEnd("time", "reached")
        if self.K == 0:
            return self.stand()
        if any(map(self.is_at, self.request.goals)):
            return RunEnd(self.request.until.goal, "reached")
        if self.is_at(piece.end(self.sign)) and piece.obstacle(self.sign):
            return self.arrive(piece.obstacle(self.sign))
        period = self.system.period
        if self.mark is None or period is None or not self.is_at(self.turned(period)):
            return None
        # A turn without a standstill: it repeats, with more energy or less each time.
        if not self.mark.K:  # the next turn tells
            self.mark = self.at
            return None
        turn = self.since_mark(step=self.sign * period, gain=self.K - self.mark.K)
        lossless = self.system.lossless  # but for rounding of some panels
        lossless = lossless or abs(turn.gain) <= 16 * self.rounding * turn.panels.size
        turn = replace(turn, gain=0.0) if lossless and turn.gain else turn
        pattern = turns(turn, self.request, self.mesh.tolerance, self.report_progress)
        if pattern is not None:
            return self.repeat(pattern)
        self.mark = self.at  # the next turn tells
        return None

    def inertia(self) -> float:
        """[kg m2 or kg] where the motion is."""
        return float(self.system.at(self.q).J[0])

    def rate(self) -> float:
        """Rate of the driver: beyond any bound where energy is left and inertia ends."""
        inertia = self.inertia()
        return self.sign * (math.sqrt(2 * self.K / inertia) if inertia else math.inf)

    def stand(self) -> RunEnd | None:
        """A standstill: the goal, or on from there."""
        self.lately.clear()
        self.happened(ends.STANDSTILL, self.q, 0.0)
        if (over := self.stood()) is not None:
            self.regime = "to a standstill" if self.regime == "one way" else self.regime
            return over
        if self.mark is not None and self.mark.K == 0:
            swing = self.since_mark(mirrored=True)
            return self.repeat(swings(swing, self.request, self.standstills))
        # The time asked for is out of reach of swings that take work each, as these.
        if self.count > MOST / 8 and math.inf > self.request.span > self.t * MOST / self.count:
            note = f"{self.count} panels of {MOST} reach {self.t:.3g} s: {REMEDY}"
            return RunEnd(ends.TOO_MANY, "failed", note=note)
        return self.leave()

    def arrive(self, kind: str) -> RunEnd:
        """The end of the path."""
        rate = self.rate() if kind != ends.DEAD_CENTRE else 0.0
        self.regime = kind
        self.happened(kind, self.q, rate)
        if kind != ends.DEAD_CENTRE:
            return RunEnd(kind, "failed" if kind == ends.UNDECIDED else "ended")
        return self.short_of(kind, time_left(self.system, kind, self.q, rate) if rate else 0.0)

    # -- patterns ------------------------------------------------------------

    def since_mark(self, **options: Any) -> RepeatedSegment:
        """What was since the mark, with times counted from there, as a pattern."""
        assert self.mark is not None
        panels = joined(self.panels[self.mark.panel :]).started_at(0.0)
        return RepeatedSegment(self.mark.t, panels, **options)

    def repeat(self, by: PeriodicContinuation) -> RunEnd | None:
        """A pattern takes the place of its first repetition, and tells what follows."""
        assert self.mark is not None
        before = self.panels[: self.mark.panel]
        self.legs += [joined(before), by.pattern] if before else [by.pattern]
        self.panels, self.mark, self.regime, self.t = [], None, by.regime, by.t
        self.facts.update(by.facts)
        self.notes += [by.note] if by.note else []
        t0 = self.request.start.t
        self.events += [Event(ends.STANDSTILL, t0 + t, q, 0.0) for t, q in by.standstills]
        panels = by.pattern.panels
        for run, leg in zip(self.runs, (panels, panels.second) if by.many else (), strict=False):
            gain = leg.gain if by.pattern.gain else 0.0
            run[PLACE] = leg.begin + by.many * by.pattern.step
            run[KINETIC] = leg.energy + by.many * gain
        return by.over

    # -- the result ------------------------------------------------------------

    @property
    def all_legs(self) -> list[Leg]:
        """All that the run left behind."""
        return [*self.legs, joined(self.panels)] if self.panels else self.legs

    @property
    def ends_by_itself(self) -> bool:
        """Whether the run beside it needs panels of its own, or took another path.

        The first where the path ends by itself: at a dead centre, in equilibrium, where nothing is
        smooth; the other where its energy is used up on a panel that holds no standstill.
        """
        named = self.end in ("time", ends.END_STOP, self.request.until.goal)
        if self.regime == "rest" or not (named or self.end.startswith(ends.NEVER)):
            return True
        parts = [x.panels if isinstance(x, RepeatedSegment) else x for x in self.all_legs]
        limit = any((x.spans[KIND] == TO_LIMIT).any() for x in parts)
        return limit or not all(math.isfinite(x.second.t1) for x in parts)

    def motion(self) -> Motion:
        """The motion of a run that has ended; of one that moved the error is not known yet."""
        request, t0 = self.request, self.request.start.t
        legs = self.all_legs
        track = PathTrack(tuple(legs), t0) if legs else Still(self.q)
        if self.events and self.events[-1].t == self.now:
            q, qd = self.events[-1].q, self.events[-1].qd
        else:  # with the times wanted, which are asked for again
            times = np.array([*(t for t in request.times if t0 <= t < self.now), self.now])
            q, qd = (float(x[-1]) for x in track.state(times))
        if self.end == request.until.goal and any(map(self.is_at, self.request.goals)):
            q = self.q
        failed = self.over is not None and self.over.status == "failed"
        motion = self.result(
            method="energy",
            engine=self.code.engine,
            regime="none" if failed else self.regime,
            t_end=self.now,
            q_end=q,
            qd_end=qd,
            track=track,
        )
        return motion if legs else motion.but(error=0.0)


def integrate_by_quadrature(system: System, request: SimulationRequest) -> Motion:
    """The motion by the path method, with its error (`estimate`).

    Where the run beside it takes another path, or ends by itself, a coarser run of its own says
    how far both are apart; it has fewer nodes and is some roundings off, in its start, its inertia
    and the work of each panel: where that matters, the data do not tell more.
    """
    fine = PathRun(system, request, FINE, code_of(system))
    fine.run()
    if (motion := judged_in_place(fine)) is not None:
        return motion
    run = PathRun(system, request, COARSE, PathCode.interpreted(COARSE), True)
    run.run()
    coarse, motion = run.motion(), fine.motion()
    unfinished = (ends.TOO_MANY,) if request.method == "auto" else ()
    if coarse.end in (*ends.STOPPED, *unfinished):
        return stopped(coarse, None)
    if not fine.all_legs:
        return motion
    if coarse.end == ends.TOO_MANY and coarse.t_end < motion.t_end:
        return stopped(coarse, replace(motion, notes=(*coarse.notes, *motion.notes)))
    by = difference(coarse, motion, system.rotary, request.times)
    motion = judged(coarse, motion, by, request.times)
    return with_rounding(system, motion, request.accuracy or TARGET, by)


def code_of(system: System) -> PathCode:
    """The loops: `auto` makes or loads machine code once it pays for motions of a mechanism."""
    code = None
    if system.engine != "scalar":
        motions = system.cache["motions"] = system.cache.get("motions", 0) + 1
        code = PathCode.compiled() if system.engine == "llvm" or PathCode.pays(motions) else None
    return code or PathCode.interpreted()


def judged_in_place(run: PathRun) -> Motion | None:
    """The motion of a run, its error by the one beside it.

    None where that takes another path, or both differ as two motions do.
    """
    if run.end in UNFINISHED:
        return stopped(run.motion(), None)
    if not run.all_legs:
        return run.motion()
    if run.ends_by_itself:
        return None
    all_legs, legs = run.all_legs, second_run(run.all_legs)
    system, start, motion = run.system, run.request.start, run.motion()
    share = rounding_share(system, float(start.q), bool(start.rate), start.t)
    by = apart(run.code, all_legs, legs, start.t, motion.t_end, share)
    late = 0.0 if motion.end == "time" else by.late
    size = max(abs(by.low), abs(by.high)) + abs(motion.t_end) * by.fastest
    within = same_motion_limit(by.high - by.low, 1.0 if system.rotary[0] else math.inf, size)
    if not (by.q <= within and late <= PARTED * (motion.t_end - start.t)):
        return None
    motion = motion.but(error=by.q, time_error=motion.time_error + late)
    target = run.request.accuracy or TARGET
    if by.unsure or (start.rate and abs(start.rate) <= EPS * by.fastest):  # as from rest
        return with_rounding(system, motion, target)
    unsure = 0.0 if motion.end == "time" else share * max(abs(by.t), by.t - start.t)
    error, time_error = motion.error + by.rounding, motion.time_error + unsure
    return missed(motion.but(error=error, time_error=time_error), target)
