r"""Motions of many designs side by side: machine code over all of them, decisions as arrays.

All designs of a structure share the right-hand side as machine code (`rates`), each with its own
numbers; no end stops are in their way. They go on together, some steps of each at a time; what
interrupts a step is looked at for all of them at once. Two things may: a standstill, after which
joint friction acts the other way or holds, and a goal in place. A design in which anything else
may happen (a margin or inertia that comes near to zero, a pair that reverses, a start near
equilibrium) is left out: who asked moves it by itself.

Two runs, the second by half the steps of the first, give the error of each motion, as of single
ones (`estimate`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics.batch_motions import (
    GOAL,
    REST,
    TIME,
    Bools,
    Counts,
    Designs,
    Motions,
    Piece,
    Track,
)
from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.ends import BudgetSpent
from blockmech.dynamics.equation import cached_rates
from blockmech.dynamics.estimate import (
    FINER,
    FLOOR,
    LOOSEST,
    ROUNDING,
    SMOOTH,
    TARGET,
    compared,
    rounding_share,
    spread,
)
from blockmech.dynamics.events import PARTS
from blockmech.dynamics.rates import LEAST_INERTIA
from blockmech.dynamics.run import EVALUATIONS
from blockmech.engines.compiled_rates import CompiledRhs, FleetSteps
from blockmech.engines.dense import Dense
from blockmech.engines.llvm import slots_of
from blockmech.engines.stages import BOUND, HIGH, LOW, THIRD, TRY, WEIGHT, scheme
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR as LEAST_MARGIN
from blockmech.result.motion import State
from blockmech.typing import Floats, Real

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

TOGETHER = 16  # steps of a design between two looks at it
FIRST = 3.0  # the first tolerance below that of single motions: one design misses for all
# What happens in a step: too much, nothing, a standstill, arrival at the first goal or another one.
SEVERAL, NOTHING, STANDS, ARRIVES = range(-1, 3)


def choose_rates(system: System, request: SimulationRequest) -> CompiledRhs | None:
    """The right-hand side that all designs share; None where motions go one by one."""
    structure, goal = system.compiled.structure, request.until.goal
    if request.method not in ("auto", "dop853", "energy") or system.engine == "scalar":
        return None
    if goal not in ("standstill", "swings", "time", "angle") or len(structure.drivers) > 1:
        return None
    if request.watch or structure.states or structure.signals or structure.followed:
        return None
    friction = system.friction
    if not system.depends_on <= {"q", "rate"} or system.knots:
        return None
    if friction and any(friction.guides):
        return None
    laws = [law for b in structure.blocks.values() for law in b.friction.values()]
    if friction and any(law.acts and law.kernel_at_rest() is not None for law in laws):
        return None
    return cached_rates(system)


def moved(
    system: System, request: SimulationRequest, rates: CompiledRhs, values: tuple[Real, ...], m: int
) -> Motions:
    """The motions of m designs, whose numbers of the program are ``values``, with their errors."""
    slots = slots_of(values)
    slots = np.ascontiguousarray(np.broadcast_to(slots, (m, slots.shape[1])))
    target = request.accuracy or TARGET
    tolerance = np.full(m, max(min(target, LOOSEST) / FIRST, FLOOR * FINER))
    coarse, best = _Run(system, request, rates, slots, tolerance).motions(), None
    open_ = ~coarse.alone
    while open_.any():
        off = np.full(m, np.nan) if best is None else best.error
        share = np.fmin(1 / FINER, 0.3 * target / np.where(off > 0, off, np.nan))
        following = np.maximum(tolerance * share, FLOOR)
        run = _Run(system, request, rates, slots, following, coarse.track, ~open_)
        fine = _judged(system, request, coarse, run.motions(), open_, run.spent)
        best = fine if best is None else best.merged(fine, open_)
        finished = (best.error <= target) | best.alone | (following <= FLOOR)
        coarse, tolerance = fine, following
        open_ = open_ & ~finished
    if best is None:
        return coarse
    if request.accuracy is not None:
        best.alone[best.error > target] = True
    return best


def _judged(
    system: System,
    request: SimulationRequest,
    coarse: Motions,
    fine: Motions,
    judged: Bools,
    spent: Floats,
) -> Motions:
    """The finer motions with their errors; those of which two runs disagree are alone.

    spent : (m,) states that the finer ones asked for
    """
    remainder = SMOOTH if system.smooth else 1.0
    same = ~coarse.alone & ~fine.alone & (coarse.end == fine.end)
    same &= coarse.standstills == fine.standstills
    same &= np.isnan(coarse.rest) == np.isnan(fine.rest)
    last, t0 = np.minimum(coarse.t, fine.t), request.start.t
    share = (spread(0.0, 1.0)[None, :]) * (last - t0)[:, None] + t0
    requested = np.array([t for t in request.times if t0 <= t], dtype=float)
    times = np.sort(np.hstack([share, np.minimum(requested[None, :], last[:, None])]), axis=1)
    times = np.where(same[:, None], times, t0)
    with np.errstate(invalid="ignore"):
        states = fine.track.state(times)
        a, b = (State(x[..., :1], x[..., 1:]) for x in (coarse.track.state(times), states))
        beyond = np.abs(coarse.q - fine.q)[:, None]
        apart = compared(b, a, (t0, fine.t, coarse.t), beyond, same, system.rotary)
        unknown = _rounding(system, request, times, states, spent)
        clock = np.where(fine.end == TIME, 0.0, remainder * apart.t + unknown[1])
    alone = fine.alone | (judged & ~apart.agree)
    error = apart.error_of_finer(remainder) + unknown[0]
    return fine._replace(alone=alone, error=error, time_error=clock)


def _rounding(
    system: System, request: SimulationRequest, t: Floats, states: Floats, many: Floats
) -> tuple[Floats, Floats]:
    """What rounding leaves unknown of places and of the end's time: see `with_rounding`.

    The start is that of all, and the effort by which they start from rest is of a size. ``many``
    are (m,) the states that the runs asked for.
    """
    steps = np.maximum(0.0, np.sqrt(many / 12) * EPS - ROUNDING)[:, None]
    late = (share_of_all(system, request) + steps) * np.abs(t)
    off = late * np.abs(states[..., 1]) + (ROUNDING + steps) * np.abs(states[..., 0])
    return np.fmax.reduce(off, axis=1), late[:, -1]


def share_of_all(system: System, request: SimulationRequest) -> float:
    """What rounding leaves unknown of the time of all designs that start there, relative."""
    return rounding_share(system, float(request.start.q), bool(request.start.rate), 0.0, 2.0)


class _Run:
    """One run of all designs, each at its tolerance (m,)."""

    def __init__(
        self,
        system: System,
        request: SimulationRequest,
        rates: CompiledRhs,
        slots: Floats,
        tolerance: Floats,
        coarser: Track | None = None,
        excluded: Bools | None = None,
    ) -> None:
        m, n = len(slots), rates.dimension
        self.system, self.request, self.rates, self.slots = system, request, rates, slots
        q, rate, t = request.start
        self.t, self.y = np.full(m, float(t)), np.zeros((m, n))
        self.y[:, 0], self.y[:, 1] = q, rate
        self.plan, self.m, self.n = Track.of((), m) if coarser is None else coarser, m, n
        self.alone = np.zeros(m, bool) if excluded is None else excluded.copy()
        self.over, self.end = np.zeros(m, bool), np.full(m, TIME)
        self.rest, self.standstills = np.full(m, np.nan), np.zeros(m, np.int64)
        self.spent, self.pieces = np.zeros(m), list[Piece]()
        pairs = rates.inputs - n - 4
        self.rubs = pairs > 0
        self.given = np.zeros((m, 3 + pairs))
        self.given[:, 1] = 1.0
        self._begin(tolerance)

    # -- the start ---------------------------------------------------------------------------

    def _begin(self, tolerance: Floats) -> None:
        """Usual inertia, directions of slip, scales of the tolerances and first steps."""
        every = np.arange(self.m)
        self.given[:, 3:] = 1.0
        q = self.y[:, 0].copy()
        around = self.system.span * np.linspace(0.0, 1.0, 8, endpoint=False)
        J = np.array([self._rows(every, q + x, 0.0)[:, self.n + 1] for x in around])
        with np.errstate(all="ignore"):
            usual = np.fmin.reduce(np.where(J > 0, J, np.nan), axis=0)
        self.given[:, 2] = LEAST_INERTIA * np.nan_to_num(usual, nan=1.0)
        rate = float(self.request.start.rate)
        if rate and self.rubs:
            self._slip(every, np.full(self.m, math.copysign(1.0, rate)))
        elif not rate:
            self._leave(every)
        row = self._rows(every, self.y[:, 0], self.y[:, 1])
        J, push = row[:, self.n + 1], np.abs(row[:, 1])
        good = (row[:, self.n] > LEAST_MARGIN) & (self.given[:, 2] < J) & np.isfinite(push)
        self.alone |= ~good
        speed = abs(rate) + np.sqrt(2 * push * min(self.system.span, 1.0))
        speed = np.where(speed > 0, speed, 1.0)
        work = 0.5 * J * speed**2
        self.tolerances = np.empty((self.m, 2, self.n))
        self.tolerances[:, 0] = np.maximum(tolerance, FLOOR)[:, None]
        self.tolerances[:, 0, 0] = FLOOR
        self.tolerances[:, 1] = tolerance[:, None]
        self.tolerances[:, 1, 1] *= speed
        self.tolerances[:, 1, 2:] *= np.where(work > 0, work, 1.0)[:, None]
        with np.errstate(all="ignore"):
            short = 0.1 * tolerance**0.125 * speed / push
        self.h = np.fmin(short, self.system.span / speed)

    def _rows(self, which: Designs, q: Floats, rate: Floats | float) -> Floats:
        """Rows (s, r) of the program of some designs at coordinates and rates."""
        y = self.y[which]
        y[:, 0], y[:, 1] = q, rate
        self.spent[which] += 1
        every = np.ones((len(which), 2, self.n))
        rows: Floats = self._fleet(which, y, np.zeros((len(which), 6)), every, 0).K[:, 0]
        return rows

    def _fleet(
        self, which: Designs, y: Floats, control: Floats, tolerances: Floats, count: int
    ) -> FleetSteps:
        """What machine code makes of states (s, n) of some designs: so many steps at most."""
        numbers, states = self.given[which], (self.t[which], y)
        slots, plan = self.slots[which], self.plan.plan(which, self.t[which], count + 1)
        return self.rates.fleet(slots, numbers, states, control, tolerances, count, *plan)

    def _slip(self, which: Designs, sense: Floats) -> Floats:
        """Set the directions of slip of designs that move in a direction; the row then."""
        row = self._rows(which, self.y[which, 0], 0.0)
        _, _, *slips, _ = row[:, -self.rates.watched :].T
        self.given[which, 3:] = (sense * np.sign(slips)).T
        self.alone[which] |= ~(np.abs(slips) > math.sqrt(EPS)).all(axis=0)
        return self._rows(which, self.y[which, 0], 0.0)

    def _leave(self, which: Designs) -> None:
        """From a standstill: the direction in which designs start; those that rest are over."""
        if not len(which):
            return
        if not self.rubs:
            row = self._rows(which, self.y[which, 0], 0.0)
            push = self.system.rounding(float(self.request.start.q)) / SETTLED
            self.alone[which] |= ~(np.abs(row[:, 1]) * row[:, self.n + 1] > push)
            return
        back = self._slip(which, np.full(len(which), -1.0))[:, 1]
        forward = self._slip(which, np.full(len(which), 1.0))[:, 1]
        threshold = SETTLED * (np.abs(back) + np.abs(forward))
        unsure = ~((np.abs(back) > threshold) & (np.abs(forward) > threshold))
        self.alone[which] |= unsure | ((forward > 0) & (back < 0))
        starts_back = which[back < 0]
        if len(starts_back):
            self._slip(starts_back, np.full(len(starts_back), -1.0))
        self._stay(which[(forward <= 0) & (back >= 0) & ~self.alone[which]])

    def _stay(self, which: Designs) -> None:
        """Designs that friction holds from now on."""
        self.rest[which], self.over[which] = self.t[which], True
        span = self.request.span
        self.end[which] = TIME if span < math.inf else REST
        if span < math.inf and len(which):
            until = np.full(len(which), self.request.start.t + span)
            series = np.zeros((8, len(which), 2))
            series[7, :, 0] = self.y[which, 0]
            self.pieces.append((which, self.t[which].copy(), until, series))
            self.t[which] = until

    # -- steps ---------------------------------------------------------------------------------

    def motions(self) -> Motions:
        """Go on until all are over, or alone."""
        while len(which := np.flatnonzero(~self.over & ~self.alone)):
            try:
                self.system.budget.check()
            except BudgetSpent:
                self.alone[which] = True
            else:
                self._round(which)
        track = Track.of(self.pieces, self.m)
        friction_work = self.y[:, 3] if self.rubs else np.zeros(self.m)
        state = self.end, self.t, self.y[:, 0], self.y[:, 1], self.rest, self.standstills
        none = np.zeros(self.m)
        return Motions(self.alone, *state, friction_work, none, none, track)

    def _steps(self, which: Designs, bound: Floats, h: Floats, count: int) -> FleetSteps:
        """Steps of designs from where they are."""
        q, control = self.y[which, 0], np.zeros((len(which), 6))
        control[:, TRY], control[:, BOUND] = h, bound
        control[:, LOW], control[:, HIGH] = -math.inf, math.inf
        control[:, WEIGHT] = THIRD if self.system.smooth else 0.0
        for x in self.request.goals:
            control[:, LOW] = np.where(x < q, np.maximum(control[:, LOW], x), control[:, LOW])
            control[:, HIGH] = np.where(x > q, np.minimum(control[:, HIGH], x), control[:, HIGH])
        return self._fleet(which, self.y[which], control, self.tolerances[which], count)

    def _round(self, which: Designs) -> None:
        """Some steps of designs, and what happens in the last of them."""
        bound = np.full(len(which), min(self.request.start.t + self.request.span, 1 / EPS))
        steps = self._steps(which, bound, self.h[which], TOGETHER)
        self.spent[which] += steps.tried * len(scheme().C)
        last = np.maximum(steps.number - 1, 0)
        row = np.arange(len(which))
        alone = (steps.number == 0) | (self.spent[which] > EVALUATIONS)
        series = _series(steps)
        K, y0, y1 = steps.K, steps.y[row, last], steps.y[row, last + 1]
        margin, _, *slips, _ = np.moveaxis(K[:, :, -self.rates.watched :], -1, 0)
        in_doubt = steps.doubtful & ~alone
        close = _may_dip(margin + LEAST_MARGIN) | _may_dip(K[:, :, self.n + 1])
        for slip in slips:  # that of the last stage is that of the end
            close |= (slip * slip[:, -1:] <= 0).any(axis=1)
        alone |= in_doubt & close
        share, kind = np.ones(len(which)), np.zeros(len(which), np.int64)
        for d in np.flatnonzero(in_doubt & ~alone).tolist():
            step = np.ascontiguousarray(steps.series[d, last[d], :, :2])
            share[d], kind[d] = self._event(step, y0[d], y1[d])
        alone |= kind == SEVERAL
        alone |= ~np.isfinite(steps.y[row, steps.number]).all(axis=1)
        self.alone[which] |= alone
        at_rest = (kind == STANDS) & ~alone
        self.standstills[which] += at_rest
        ends_step = self.rubs or self.request.standstills < math.inf
        hit = (at_rest & ends_step) | ((kind >= ARRIVES) & ~alone)
        keep = np.where(hit, last, steps.number)
        keep[alone] = 0
        self._keep(which, steps, series, keep)
        self.h[which] = steps.h
        h = steps.t[row, last + 1] - steps.t[row, last]
        self._met(which[hit], share[hit], h[hit], kind[hit])
        span = self.request.start.t + self.request.span
        finished = ~self.over[which] & (self.t[which] >= span * (1 - 2 * EPS))
        self.over[which[finished]], self.end[which[finished]] = True, TIME

    def _event(self, series: Floats, y0: Floats, y1: Floats) -> tuple[float, int]:
        """The share of a step (8, 2) from y0 to y1 at which something happens, and what."""
        step = Dense(np.zeros(1), np.ones(1), series[None])
        rate = y0[1] or float(step(1 / PARTS)[1])  # from a standstill on
        hits = [(x, STANDS) for x in step.crossings(1, 0.0, (rate, y1[1]), 0, PARTS)]
        for i, goal in enumerate(self.request.goals):
            off = y0[0] - goal, y1[0] - goal
            hits += [(x, ARRIVES + i) for x in step.crossings(0, goal, off, 0, PARTS)]
        return hits[0] if len(hits) == 1 else (1.0, SEVERAL if hits else NOTHING)

    def _keep(self, which: Designs, steps: FleetSteps, series: Floats, count: Counts) -> None:
        """Designs go on over their first steps."""
        d, s = np.nonzero(np.arange(steps.t.shape[1] - 1)[None, :] < count[:, None])
        if d.size:
            t0, t1 = steps.t[d, s], steps.t[d, s + 1]
            self.pieces.append((which[d], t0, t1, series[:, d, s]))
        row = np.arange(len(which))
        self.t[which], self.y[which] = steps.t[row, count], steps.y[row, count]

    def _met(self, which: Designs, share: Floats, h: Floats, kind: Counts) -> None:
        """Go on to what happens in a step: with steps that end there, and by Newton's rule."""
        if not len(which):
            return
        to, at_rest = share * h, kind == STANDS
        bound = self.t[which] + to
        steps = self._steps(which, bound, to, TOGETHER // 4)
        row, counts = np.arange(len(which)), steps.number
        reached = (counts > 0) & (steps.t[row, counts] >= bound)
        self.alone[which] |= ~reached
        self._keep(which, steps, _series(steps), np.where(reached, counts, 0))
        slope = self._rows(which, self.y[which, 0], self.y[which, 1])[:, : self.n]
        goal = np.append(self.request.goals, 0.0)[kind - ARRIVES]
        value = np.where(at_rest, self.y[which, 1], self.y[which, 0] - goal)
        rise = np.where(at_rest, slope[:, 1], slope[:, 0])
        with np.errstate(all="ignore"):
            late = -value / rise
        is_regular = np.abs(late) <= to / 8
        self.alone[which] |= ~is_regular
        late = np.where(is_regular, late, 0.0)
        self.t[which] += late
        self.y[which] += late[:, None] * slope
        stood = which[at_rest & ~self.alone[which]]
        self.y[stood, 1] = 0.0
        met = ~at_rest | (self.standstills[which] >= self.request.standstills)
        finished = which[met & ~self.alone[which]]
        self.over[finished], self.end[finished] = True, GOAL
        self._leave(stood[~self.over[stood]])


def _series(steps: FleetSteps) -> Floats:
    """Dense output (8, m, s, 2) of coordinate and rate, of all steps; of none that is not made."""
    return np.moveaxis(steps.series[..., :2], 2, 0)


def _may_dip(x: Floats) -> Bools:
    """Whether values (m, s) at the stages of steps may fall to zero between two of them.

    They cannot where they change by less than the least of them from there to its neighbours.
    """
    x = x[:, np.argsort(scheme().C, kind="stable")]
    lowest, row = x.argmin(axis=1), np.arange(len(x))
    neighbours = np.maximum(x[row, np.maximum(lowest - 1, 0)], x[row, (lowest + 1) % x.shape[1]])
    neighbours = np.where(lowest == x.shape[1] - 1, x[row, lowest - 1], neighbours)
    return np.asarray(~((x[row, lowest] > 0) & (neighbours < 2 * x[row, lowest])))
