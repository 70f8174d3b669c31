r"""The path method: one driver, loads without time.

With K = J q'^2 / 2, exactly

    dK/dq = tau            the work of all loads and of friction along the path
    dt/dq = sqrt(J / 2K)

so a motion is an integral along its path, with no steps in time. Where tau depends on the
place alone (method ``energy``) K is a plain integral; where rates or joint friction enter
(method ``spectral``) the two are solved together on each panel.

    road ahead -> panel -> standstill? goal? end? -> next panel ... -> a pattern that repeats

Source of the identity: [D14] Eq. 1, in its integrated form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics.estimate import (
    Difference,
    difference,
    judged,
    missed,
    stated,
    stopped,
)
from blockmech.dynamics.motion import (
    AMBIGUOUS,
    DEAD_CENTRE,
    INTERRUPTED,
    REST,
    SELF_LOCKED,
    TOO_MANY,
    Event,
    Motion,
    Status,
)
from blockmech.dynamics.panels import (
    EPS,
    Floats,
    Panel,
    basis,
    final_energy,
    roots,
    rule,
)
from blockmech.dynamics.request import Start
from blockmech.dynamics.rest import equilibrium, start_failure
from blockmech.dynamics.road import CLOSE, SLIPS, Piece, Road
from blockmech.dynamics.track import Leg, PathTrack, Pattern, Standing, durations
from blockmech.dynamics.work import STEPS, OfFriction, OfPlace, OfRate, Span, Work, settled
from blockmech.series import tail

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

TURN = 2 * math.pi
NODES, MORE = 32, 16  # of a panel, and more of a finer one
FINEST = 16 * EPS  # what series of that length leave of rounding; asked for without a target
BESIDE = 4  # ulps of start and work by which a run beside is off: a sum of some ten terms
MOST = 8_000  # panels of a run; ten seconds of work and more
SHORT = 8  # a piece is made anew if what happens in it needs no more than this part of it


@dataclass
class PathRun:
    """One run: where the motion is, and what it left behind.

    t [s] counts from the start of the run; K [J]; sign is the direction of the motion. A run
    ``beside`` has rounding of its own added to the energy of each panel.
    """

    system: System
    request: SimulationRequest
    n: int
    tolerance: float
    beside: bool = False
    road: Road = field(init=False)
    t: float = 0.0
    q: float = 0.0
    K: float = 0.0
    sign: int = 0
    legs: list[Leg] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    status: Status = "reached"
    end: str = ""
    regime: str = "one way"
    notes: list[str] = field(default_factory=list)
    facts: dict[str, float] = field(default_factory=dict)
    standstills: int = 0
    mark: tuple[int, float, float, float] | None = None  # leg, t, q, K where a pattern may begin
    lost: float = 0.0  # [J] by friction

    def __post_init__(self) -> None:
        self.tolerance += self.system.noise
        self.road = Road(self.system, self.n, self.tolerance)
        self.place_only = self.system.depends_on <= {"q"} and self.system.friction is None

    @property
    def rounding(self) -> float:
        """Relative error of the work of a panel that nobody can see."""
        return BESIDE * EPS + 2 * self.system.noise

    # -- the run ------------------------------------------------------------

    def run(self) -> None:
        """Go on until something ends the run."""
        start = self.request.start
        self.q = float(start.q)
        failure = start_failure(self.system, self.q, float(start.rate))
        if failure:
            self.stop(failure, "failed")
            return
        try:
            if start.rate:
                J = float(self.system.sample(np.array([self.q])).J[0])
                self.sign, self.K = (1 if start.rate > 0 else -1), J * start.rate**2 / 2
                self.mark = (0, 0.0, self.q, self.K)
            else:
                self.leave()
            while not self.end:
                self.advance()
                if len(self.legs) > MOST:
                    self.stop(TOO_MANY, "ended")
        except KeyboardInterrupt:
            self.stop(INTERRUPTED, "ended")

    def stop(self, end: str, status: Status) -> None:
        """End the run by a name."""
        self.end, self.status = end, status

    @property
    def t_goal(self) -> float:
        """Time [s] since the start at which the run ends; infinite without one."""
        until = self.request.until
        return until.value if until.goal == "time" else math.inf

    def goal_places(self) -> list[float]:
        """Driver coordinates at which the run ends."""
        until = self.request.until
        if until.goal == "angle":
            return [until.value]
        if until.goal == "turns":
            return [self.request.start.q + s * until.value * TURN for s in (1, -1)]
        return []

    def leave(self) -> None:
        """From a standstill: the direction in which the motion starts, or rest."""
        q, system = self.q, self.system
        size = system.load_size(q)
        if system.friction is not None:
            found = system.friction.rest(q, 0.0, size)
            if found.ambiguous:
                self.stop(AMBIGUOUS, "ended")
            elif found.rests:
                self.facts.update(holding_low=found.holding[0], holding_high=found.holding[1])
                self.rest(REST)
            self.sign = found.moves
        else:
            tau = float(system.sample(np.array([q])).tau[0])
            if abs(tau) <= 8 * EPS * size:
                kind, facts, notes = equilibrium(system, q)
                self.facts.update(facts)
                self.notes += [kind, *notes]
                self.rest(kind)
            self.sign = 1 if tau > 0 else -1
        self.K = 0.0
        if not self.end:
            self.repeat_swing()
            self.mark = (len(self.legs), self.t, q, 0.0)

    def rest(self, kind: str) -> None:
        """Stay at this place from now on."""
        self.legs.append(Standing(self.t, self.q))
        self.events.append(Event(REST, self.t, self.q, 0.0))
        self.regime = "rest"
        if self.t_goal < math.inf:
            self.t = self.t_goal
            self.stop("time", "reached")
        else:
            self.stop(kind, "rest")

    def advance(self) -> None:
        """One panel further."""
        piece = self.road.ahead(self.q, self.sign)
        if isinstance(piece, str):
            self.arrive(piece)
            return
        ahead = [*piece.cuts, *self.goal_places(), piece.end(self.sign)]
        if self.mark is not None and self.system.period is not None:
            ahead.append(self.turned(self.system.period))
        ahead = [x for x in ahead if self.sign * (x - self.q) > 0 and not self.here(x)]
        if not ahead:  # but for rounding it is at the end of the piece
            self.q = piece.end(self.sign)
            self.passed(piece)
            return
        end = min(ahead, key=lambda x: self.sign * x)
        panel = self.panel(piece, end)
        if panel is not None:
            self.take(panel)
            self.passed(piece)

    def here(self, x: float) -> bool:
        """Whether a place is where the motion is, but for rounding."""
        return abs(x - self.q) <= CLOSE * max(abs(x), abs(self.q))

    def turned(self, period: float) -> float:
        """The place one period beyond the mark."""
        assert self.mark is not None
        return self.mark[2] + self.sign * period

    def take(self, panel: Panel) -> None:
        """The motion goes over a panel."""
        self.legs.append(panel)
        self.t, self.q, self.K = panel.t1, panel.q1, max(panel.K1, 0.0)
        if self.beside and self.K > 0:
            self.K += self.rounding * abs(panel.q1 - panel.q0) * float(np.abs(panel.w).mean())
        if self.system.progress is not None:
            self.system.progress("moving", self.t, self.t_goal if self.t_goal < math.inf else None)

    def passed(self, piece: Piece) -> None:
        """What happens at the end of a panel."""
        if self.t >= self.t_goal:
            self.t = self.t_goal
            self.stop("time", "reached")
        elif self.K == 0:
            self.stand()
        elif any(map(self.here, self.goal_places())):
            self.stop(self.request.until.goal, "reached")
        elif self.here(piece.end(self.sign)) and piece.what_ends(self.sign):
            self.arrive(piece.what_ends(self.sign))
        elif self.system.friction is not None and any(map(self.here, piece.cuts)):
            self.events.append(Event("joint reverses", self.t, self.q, self.rate()))
        period = self.system.period
        repeats = not self.end and self.mark is not None
        if repeats and period is not None and self.here(self.turned(period)):
            self.repeat_turn(period)

    def rate(self) -> float:
        """Rate of the driver."""
        J = float(self.system.sample(np.array([self.q])).J[0])
        return self.sign * math.sqrt(2 * self.K / J)

    def stand(self) -> None:
        """A standstill: the goal, or on from there."""
        self.events.append(Event("standstill", self.t, self.q, 0.0))
        self.standstills += 1
        until = self.request.until
        wanted = {"standstill": 1.0, "swings": until.value}.get(until.goal, math.inf)
        if self.standstills >= wanted:
            if self.regime == "one way":
                self.regime = "to a standstill"
            self.stop(until.goal, "reached")
        else:
            self.leave()

    def arrive(self, what: str) -> None:
        """The end of the road."""
        if what == DEAD_CENTRE:
            self.facts["dead_centre_time"] = self.request.start.t + self.t
        self.regime = what
        rate = 0.0 if what == DEAD_CENTRE else self.rate()
        self.events.append(Event(what, self.t, self.q, rate))
        self.stop(what, "ended")

    # -- patterns ------------------------------------------------------------

    def repeat_swing(self) -> None:
        """From rest to rest: the motion goes to and fro for ever, if nothing takes energy."""
        if not self.place_only or self.mark is None or self.mark[3] != 0:
            return
        first, t, _, _ = self.mark
        panels = tuple(replace(p, t0=p.t0 - t) for p in self.legs[first:] if isinstance(p, Panel))
        if not panels:
            return
        swing = Pattern(t, panels, mirrored=True)
        self.legs[first:] = [swing]
        self.regime = "libration"
        self.facts.update(swing_time=swing.duration, period=2 * swing.duration)
        until = self.request.until
        more, status = 0.0, "ended"
        if until.goal in ("standstill", "swings"):
            more, status = until.value - self.standstills, "reached"
        elif self.t_goal < math.inf:
            more, status = math.floor((self.t_goal - t) / swing.duration) - 1, "reached"
        places = self.q, panels[0].q0
        for k in range(int(more)):
            when = swing.begins(k + 2)
            if when <= self.t_goal:
                self.events.append(Event("standstill", when, places[(k + 1) % 2], 0.0))
        self.finish(swing, until.value if status == "reached" else math.inf, 1.0 + more)

    def repeat_turn(self, period: float) -> None:
        """A turn without a standstill: it repeats, with more energy or less each time.

        Loads of the rate and friction repeat once the energy is what it was a turn before.
        """
        assert self.mark is not None
        first, t, q, K = self.mark
        panels = tuple(replace(p, t0=p.t0 - t) for p in self.legs[first:] if isinstance(p, Panel))
        turned = (len(self.legs), self.t, self.q, self.K)
        if K == 0:  # the next turn tells
            self.mark = turned
            return
        size = sum(abs(p.q1 - p.q0) * float(np.abs(p.w).mean()) for p in panels)
        gain = self.K - K
        if self.system.lossless or abs(gain) <= 16 * self.rounding * size:  # of some panels
            gain = 0.0
        if gain != 0 and not self.place_only:  # what the rate takes changes from turn to turn
            self.mark = turned
            return
        turn = Pattern(t, panels, self.sign * period, gain)
        if gain == 0:
            self.regime = "rotation"
            self.facts.update(period=turn.duration, mean_speed=period / turn.duration)
        else:
            self.regime = "secular" if gain > 0 else "secular braking"
            self.facts.update(work_per_period=gain, period_of_loads=period)
            count = self.turns_ahead(turn)
            if count < 2:
                self.mark = turned
                return
            energies: Floats = np.arange(count, dtype=np.float64) * gain
            starts = np.concatenate([[0.0], np.cumsum(durations(panels, energies))])
            turn = replace(turn, starts=starts)
        self.legs[first:] = [turn]
        self.go_round(turn, q, K)

    def turns_ahead(self, turn: Pattern) -> int:
        """How many turns may follow like this one: while there is energy, or until the goal."""
        if turn.gain < 0:
            least = min(float(p.K.min()) for p in turn.panels)
            low, high = 0, int(least / -turn.gain)
            while high - low > 0:  # later turns are slow somewhere, where panels do not resolve
                middle = (low + high + 1) // 2
                fits = all(tail(p.rate) <= self.tolerance for p in turn.repetition(middle))
                low, high = (middle, high) if fits else (low, middle - 1)
            return low
        count, until = 1, self.request.until
        ways = [abs(x - turn.panels[0].q0) for x in self.goal_places()]
        if ways:
            return math.ceil(max(ways) / abs(turn.step)) + 1
        if self.t_goal == math.inf:
            return 2 if until.goal != "steady" else 0
        reached = turn.t0
        while reached < self.t_goal:
            block: Floats = np.arange(count, 2 * count, dtype=np.float64) * turn.gain
            reached += float(durations(turn.panels, block).sum())
            count *= 2
        return count

    def go_round(self, turn: Pattern, q: float, K: float) -> None:
        """The end of a motion that turns for ever, or where it goes on otherwise."""
        places = [x for x in self.goal_places() if turn.step * (x - q) > 0]
        count = math.inf if turn.starts is None else turn.starts.size - 1
        way = min((abs(x - q) for x in places), default=math.inf)
        last = turn.begins(int(count)) if count < math.inf else math.inf
        there = math.inf
        if way < math.inf and way <= count * abs(turn.step):
            there = turn.at_way(math.copysign(way, turn.step))
        if there < self.t_goal:
            self.t = there
            self.stop(self.request.until.goal, "reached")
        elif self.t_goal <= last and self.t_goal < math.inf:
            self.t = self.t_goal
            self.stop("time", "reached")
        elif turn.gain < 0:
            self.t, self.q = last, q + count * turn.step
            self.K = K + count * turn.gain
            self.mark = None
        else:
            self.t = turn.t0 + turn.duration
            self.stop(f"never reached: {self.regime}", "ended")

    def finish(self, pattern: Pattern, value: float, count: float) -> None:
        """The end of a motion that repeats for ever."""
        goal = self.request.until.goal
        if value == math.inf:
            self.t = pattern.begins(2)
            self.stop(f"never reached: {self.regime}", "ended")
        elif goal == "time":
            self.t = self.t_goal
            self.stop("time", "reached")
        else:
            self.t = pattern.begins(int(count))
            self.standstills = int(value)
            self.stop(goal, "reached")

    # -- panels ------------------------------------------------------------

    def panel(self, piece: Piece, end: float) -> Panel | None:
        """The next panel towards a place; None where the run came to its end instead."""
        q, sign = self.q, self.sign
        while True:
            length = abs(end - q)
            if length <= CLOSE * max(abs(q), abs(end)):
                self.too_short(piece, end)
                return None
            at_limit = bool(piece.data.limit == sign and end == piece.end(sign)) and self.K > 0
            span = Span(q, length, 1 if self.K else 2, False, False, self.K)
            if at_limit:
                span = Span(end, length, 2, True, True, self.K)
            work, J = self.work(piece, span)
            w, K = settled(work, span, self.n)
            if np.isfinite(w).all():
                stop = self.standstill_ahead(span, w, K)
                if stop is not None:
                    if self.shortened(piece, stop):
                        return None
                    found = self.to_standstill(piece, stop)
                    if found is not None or self.K == 0 < span.energy or self.end:
                        return found
                    end = q + sign * min(0.5 * abs(stop - q), 0.5 * length)
                    continue
                panel = self.made(span, end, w, K, J)
                if (K > 0).all() and self.resolved(panel, work) and self.starts(piece, panel):
                    return self.until_guide_turns(piece, panel, work)
            end = q + sign * 0.5 * length
            if J.min() < piece.data.rows[0].max() / SHORT**2 and self.shortened(piece, end):
                return None

    def too_short(self, piece: Piece, end: float) -> None:
        """No panel is short enough: friction has no solution, or the motion is at its end."""
        span = Span(self.q, abs(end - self.q), 1, False, False, self.K)
        work, _ = self.work(piece, span)
        if isinstance(work, OfFriction) and not np.isfinite(work(np.full(self.n, self.K))).all():
            self.facts["friction_limit"] = float(np.min(work.limit))
            self.arrive(SELF_LOCKED)
        else:
            self.notes.append(f"the loads are not smooth at q = {self.q:.12g}")
            self.arrive(TOO_MANY)

    def work(self, piece: Piece, span: Span) -> tuple[Work, Floats]:
        """What gives dK/du at the nodes of a panel, and the inertia there."""
        q = span.places(rule(self.n).v, self.sign) - piece.shift
        rows = piece.data.at(q)
        if self.beside:  # a series is as exact as its largest value
            rows[0] += self.rounding * float(piece.data.rows[0].max())
        friction = self.system.friction
        if friction is not None:
            middle = span.places(np.array([0.5]), self.sign) - piece.shift
            slips = piece.data.at(middle)[SLIPS : SLIPS + len(friction.names), 0]
            sides = tuple(int(x) for x in self.sign * np.sign(slips))
            return OfFriction(friction, q, rows, self.sign, sides), rows[0]
        if self.place_only:
            return OfPlace(rows, self.sign), rows[0]
        return OfRate(self.system, q, rows, self.sign), rows[0]

    def made(self, span: Span, end: float, w: Floats, K: Floats, J: Floats) -> Panel:
        """The panel of a solution."""
        n, p, known = self.n, span.p, span.energy
        last = final_energy(n, p, span.length, span.backward, span.limit, known, w)
        return Panel(self.t, self.q, end, self.K, last, p, span.backward, w, K, J)

    def resolved(self, panel: Panel, work: Work) -> bool:
        """Whether time and work of a panel are smooth enough for its nodes."""
        if not tail(panel.rate) <= self.tolerance:
            return False
        return not work.follows_energy or bool(
            tail(rule(self.n).to_series @ panel.w) <= self.tolerance
        )

    def starts(self, piece: Piece, panel: Panel) -> bool:
        """Whether a panel's series begins with the rate that is known: no thin layer is missed."""
        if panel.p != 1:
            return True
        J = float(piece.data.at(np.array([panel.q0 - piece.shift]))[0, 0])
        known = abs(panel.q1 - panel.q0) * math.sqrt(J / (2 * panel.K0))
        size = np.abs(panel.rate)
        found = float((basis(np.zeros(1), self.n) @ panel.rate)[0])
        left = max(float(size[-self.n // 4 :].max()), self.tolerance * float(size.max()))
        return abs(found - known) <= self.n * left

    def standstill_ahead(self, span: Span, w: Floats, K: Floats) -> float | None:
        """The first place of a panel at which K is zero, roughly; None where there is none.

        Where K only comes near zero between the nodes, the time is not resolved and the panel
        is made shorter.
        """
        n, known = self.n, span.energy
        last = final_energy(n, span.p, span.length, span.backward, span.limit, known, w)
        if K.min() > 0 and last > 0:
            near = math.sqrt(EPS) * span.length
            if span.limit or last > -float(w[-1]) * near:
                return None  # but a standstill that is at the end but for rounding is in it
            return span.anchor + self.sign * (span.length - last / float(w[-1]))
        if span.limit:
            return 0.5 * (self.q + span.anchor)  # closer first
        v = np.concatenate([[0.0], rule(n).v, [1.0]])
        values = np.concatenate([[known], K, [last]])
        below = values <= 0
        i = max(int(np.argmax(below[1:])) + 1, 1)
        share = values[i - 1] / (values[i - 1] - values[i]) if values[i - 1] > values[i] else 1.0
        return float(span.places(v[i - 1 : i] + share * (v[i] - v[i - 1]), self.sign)[0])

    def to_standstill(self, piece: Piece, guess: float) -> Panel | None:
        """The panel that ends at a standstill; None where it is not resolved.

        Its end is moved until the energy at its other end is that of the motion. From rest
        there is a panel in between first.
        """
        q, sign = self.q, self.sign
        if self.K == 0:
            return None
        last, n = math.inf, self.n
        before: Floats | None = None
        for _ in range(STEPS):
            length = sign * (guess - q)
            if length <= CLOSE * max(abs(q), 1.0) and 1e3 * EPS * self.largest_energy() >= self.K:
                self.K = 0.0
                self.stand()
                return None
            if length <= 0 or sign * (guess - piece.end(sign)) > math.sqrt(EPS) * length:
                return None
            span = Span(guess, length, 2, True, False, 0.0)
            work, J = self.work(piece, span)
            w, K = settled(work, span, n, before)
            at_rest = float((basis(np.zeros(1), n) @ rule(n).to_series @ w)[0])
            if not (np.isfinite(w).all() and at_rest < 0):
                return None
            start = final_energy(n, 2, length, True, False, 0.0, w)
            step = sign * (self.K - start) / -at_rest
            if abs(step) <= EPS * abs(guess) or abs(step) >= last:
                break
            last, guess, before = abs(step), guess + step, w
        panel = replace(self.made(span, guess, w, K, J), K1=0.0)
        good = (K > 0).all() and self.resolved(panel, work)
        return self.until_guide_turns(piece, panel, work) if good else None

    def shortened(self, piece: Piece, stop: float) -> bool:
        """Whether a swing that is short against its piece of the road got one of its own size."""
        way = abs(stop - self.q)
        if not CLOSE * abs(self.q) < way < piece.data.length / SHORT:
            return False
        self.road.replace(piece, self.q, self.sign, 2 * way)
        return True

    def largest_energy(self) -> float:
        """The largest kinetic energy [J] of the run so far."""
        return max((p.K0 for p in self.legs if isinstance(p, Panel)), default=self.K)

    def until_guide_turns(self, piece: Piece, panel: Panel, work: Work) -> Panel | None:
        """The panel, or the part of it up to where a guide is pressed by its other side."""
        if not isinstance(work, OfFriction):
            return panel
        turn = self.first_turn(panel, work)
        if turn is not None and abs(turn - self.q) > math.sqrt(EPS) * abs(panel.q1 - panel.q0):
            return self.panel(piece, turn)
        r = rule(self.n)
        self.lost += abs(panel.q1 - panel.q0) * float(r.whole[panel.p] @ work.lost)
        return panel

    def first_turn(self, panel: Panel, work: OfFriction) -> float | None:
        """Where the load of a guide has a kink inside a panel: another side or edge presses."""
        friction = self.system.friction
        assert friction is not None
        found = []
        for j, guide in enumerate(friction.guides):
            if not guide:
                continue
            N, C = work.loads[:, j].real, work.loads[:, j].imag
            for series in (N + C, N - C) if np.abs(C).max() > 0 else (N,):
                v = roots(rule(self.n).to_series @ series)
                v = v[(v > math.sqrt(EPS)) & (v < 1 - math.sqrt(EPS))]
                way = (panel.q1 - panel.q0) * v**panel.p
                found += (panel.q1 - way if panel.backward else panel.q0 + way).tolist()
        return min(found, key=lambda x: self.sign * x) if found else None


def along_path(system: System, request: SimulationRequest) -> Motion:
    """The motion by the path method, with its error (`estimate`).

    Of two runs the coarser has fewer nodes and is some ulps beside, in its start and in the
    work of each panel: where that matters, the data do not tell more. What it leaves
    unresolved is looked at by finer panels once.
    """
    target = request.accuracy or FINEST
    resting = _at_rest(system, request, FINEST)
    if resting is not None:
        return stated(resting, Difference(0.0, 0.0, True))
    best = None
    for n in (NODES, NODES + MORE // 2):
        coarse = _run(system, _beside(request), n, FINEST, True)
        if coarse.end in (INTERRUPTED, TOO_MANY):
            return stopped(coarse, best)
        fine = _run(system, request, n + MORE, FINEST, False)
        if fine.end in (INTERRUPTED, TOO_MANY) and fine.t_end < coarse.t_end:
            return stopped(fine, best or coarse)
        apart = difference(coarse, fine, request.times)
        found = judged(coarse, fine, apart, request.times)
        best = found if best is None or found.error < best.error else best
        if best.error <= target and best.status != "failed":
            break
    assert best is not None
    return best if request.accuracy is None else missed(best, request.accuracy)


def _run(
    system: System, request: SimulationRequest, n: int, tolerance: float, beside: bool
) -> Motion:
    """One run with n nodes a panel, its series resolved to a relative tolerance."""
    path = PathRun(system, request, n, tolerance, beside)
    path.run()
    return path_motion(path)


def _beside(request: SimulationRequest) -> SimulationRequest:
    """The same from some ulps beside."""
    q, rate, t = request.start
    start = Start(q + BESIDE * math.ulp(q), rate * (1 + BESIDE * EPS), t)
    return replace(request, start=start)


def _at_rest(system: System, request: SimulationRequest, tolerance: float) -> Motion | None:
    """The motion of a start from which nothing moves; else None."""
    path = PathRun(system, request, NODES, tolerance)
    path.q = float(request.start.q)
    if request.start.rate or start_failure(system, path.q, 0.0):
        return None
    path.leave()
    return path_motion(path) if path.end else None


def path_motion(run: PathRun) -> Motion:
    """The motion of a run that has ended; its error is not known yet."""
    request, system = run.request, run.system
    start = request.start
    legs: tuple[Leg, ...] = tuple(run.legs) or (Standing(0.0, run.q),)
    track = PathTrack(legs, start.t)
    state = track.state(np.array([start.t + run.t]))
    standing = bool(run.events) and run.events[-1].t == run.t
    q, qd = float(state.q[0]), float(state.qd[0])
    if standing:
        q, qd = run.events[-1].q, run.events[-1].qd
    elif run.end == request.until.goal and any(map(run.here, run.goal_places())):
        q = run.q
    events = tuple(e._replace(t=start.t + e.t) for e in run.events)
    facts = dict(run.facts)
    if system.friction is not None:
        facts["friction_work"] = run.lost
    return Motion(
        method="energy" if run.place_only else "spectral",
        why=request.why,
        regime=run.regime if run.status != "failed" else "none",
        status=run.status,
        end=run.end,
        t_start=start.t,
        t_end=start.t + run.t,
        q_end=q,
        qd_end=qd,
        track=track,
        events=events,
        error=math.nan,
        time_error=0.0,
        accuracy=request.accuracy,
        cost=system.cost,
        notes=tuple(run.notes),
        facts=facts,
    )
