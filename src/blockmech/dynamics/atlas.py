"""A motion over several charts: where one ends at a dead centre, another goes on.

    user's chart -> ends at its dead centre -> back to where another joint moves twice as much
                 -> hand over -> that joint's chart -> ... -> goal

Which joints lead from when on is found by the first walk; others, at a finer tolerance, keep to it,
so that two walks differ by the errors of all their integrations alone. What a user asks for is in
the coordinates of the user's drivers, which each chart reads as coordinates of joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import takewhile
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.chart_outputs import Leg
from blockmech.dynamics.charts import Chart, home_chart
from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.ends import RunEnd, TurnsInTime
from blockmech.dynamics.estimate import LOOSE, TARGET, UNFINISHED, refined, stopped
from blockmech.dynamics.events import PER_SWING
from blockmech.dynamics.impact import Chain, Move
from blockmech.dynamics.layout import until
from blockmech.dynamics.pair_stops import HALVED, Counted
from blockmech.dynamics.request import (
    NO_PAIRS,
    Pairs,
    SimulationRequest,
    Surface,
    Until,
    Watch,
    start_of,
)
from blockmech.dynamics.roles import FREE
from blockmech.dynamics.solvers import STEPPERS
from blockmech.dynamics.time import TimeIntegration, repeats
from blockmech.ground.errors import BlockmechError, listed
from blockmech.ground.plane import EPS
from blockmech.model.scene import Stops
from blockmech.model.structure import COORDINATE
from blockmech.result.motion import Cost, Motion, RolesFrom
from blockmech.typing import Real

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.system import System

Prepare: TypeAlias = Callable[..., tuple["System", SimulationRequest]]

WHY = "other joints lead where the drivers' coordinates stand still"
NAMED = "no other joint leads on: loads, couplings, signals or roles name the drivers"
FOLLOW = "it passes change points, where its dyads follow the motion"
ROUNDED = 4  # roundings by which the coarser walk is off where the state is handed over


class Entry(NamedTuple):
    """From a time [s] on a chart leads, where the first walk had its joints."""

    t: float
    chart: Chart
    starts: Pairs


@dataclass
class Cycle:
    """Going round through charts: whether more of the kind follow for ever, by one place on it.

    target : [rad or m] of the error
    goals : [rad or m] of the user's driver
    conserves : whether loads are of places alone
    """

    target: float
    goals: Sequence[float]
    conserves: bool
    first: Leg | None = None  # that goes through the place
    passes: int = 0  # since one was looked at
    travel: float = 0.0  # [rad or m] of the joints that lead
    stood: bool = False
    unsure: float = 0.0  # of the energy, since a passage was looked at

    def closed(self, leg: Leg, later: bool) -> Motion | None:
        """The motion of a leg up to the place, if it is sure that more of the kind follow."""
        motion, times = leg.motion, leg.motion.times(PER_SWING)
        q = motion.at(times).q
        self.travel += abs(float(q[-1] - q[0]))
        self.unsure += motion.facts.get("energy_balance", 0.0)
        self.stood |= any(event.kind == ends.STANDSTILL for event in motion.events)
        if self.first is None and later and not leg.chart.is_general:
            t = float(times[PER_SWING // 2])
            self.first, (self.q, rate) = leg, motion.at(t)
            self.sense, self.user = np.sign(rate), leg.state(np.array([t])).q[0]
            self.turns = TurnsInTime(self.travel, t, float(rate) ** 2)
        elif self.first is not None and leg.chart is self.first.chart:
            return self._passed(leg)
        return None

    def _passed(self, leg: Leg) -> Motion | None:
        motion, times = leg.motion, leg.motion.times(PER_SWING)
        rotary = leg.chart.layout.pairs[leg.chart.joints[0]].kind == "R"

        def beyond(t: Real) -> Real:
            off = motion.at(t).q - self.q
            return self.sense * (off - math.tau * np.round(off / math.tau) if rotary else off)

        off = beyond(times)
        passed = np.flatnonzero((off[:-1] <= 0) & (off[1:] > 0) & (np.diff(off) < 1.0))
        self.passes += passed.size > 0
        ends_by_count = self.stood and not self.goals  # a count of standstills is reached
        if ends_by_count or not passed.size or self.passes < self.turns.many:
            return None
        from scipy.optimize import brentq

        t = float(brentq(beyond, *times[passed[0] : passed[0] + 2], xtol=EPS))
        self.passes, user = 0, leg.state(np.array([t])).q[0]
        rate, turns, before = float(motion.at(t).qd), self.turns, self.turns.t
        steady = abs(rate**2 - turns.square) <= 2 * self.unsure * rate**2
        alike = self.conserves and (self.stood or (turns.many == 1 and steady))
        over, self.unsure = turns.turned(t, self.travel, rate, self.target), 0.0
        if alike:  # it goes to and fro, or what changes is less than what errors of a way round do
            over = RunEnd(f"{ends.NEVER}: rotation", facts={"period": t - before})
        moved, self.user = user - self.user, user
        if over is None or any(abs(moved) > 1.0 and moved * (x - user) > 0 for x in self.goals):
            return None
        end = over.end.replace("rotation", "libration") if self.stood else over.end
        facts = {x: value for x, value in motion.facts.items() if not x.endswith("_time")}
        facts |= {"period": over.facts["period"]} if over.facts else {}
        return until(motion, t).but(end=end, status="ended", facts=facts)


@dataclass
class Atlas:
    """A motion that changes charts, under way.

    Attributes
    ----------
    home : the user's chart, in which it starts
    prepare : a system of a chart for a request, and the request with its end stops
    fixed : joints whose drivers stay, as they have a role or something else names them
    repeats : whether it goes the same way again from a place that it comes back to as fast
    conserves : whether loads are of places alone
    entries : which charts lead from when on, as the first walk finds it
    runs : of each leg, whose steps the walk by half of them halves
    systems : of all walks
    rounded : roundings by which a walk is off where the state is handed over
    offset : [rad or m] and relative, what that is in coordinates and rates
    """

    home: Chart
    request: SimulationRequest
    prepare: Prepare
    fixed: tuple[str, ...]
    method: str
    repeats: bool
    conserves: bool
    entries: list[Entry] = field(default_factory=list)
    runs: list[TimeIntegration] = field(default_factory=list)
    systems: list[System] = field(default_factory=list)
    rounded: int = 0
    offset: float = 0.0

    def walk(self, tolerance: float, halves: bool = False) -> Motion:
        """Go on from chart to chart until something else than a dead centre ends the motion.

        It ``halves`` the steps of the walk before.
        """
        before, self.runs, self.rounded = self.runs if halves else [], [], 0 if halves else ROUNDED
        cycle_options = max(tolerance, self.target), self.request.goals, self.conserves
        legs, cycle = list[Leg](), Cycle(*cycle_options) if self.repeats else None
        chart, request, users = self.home, self.request, np.atleast_1d(self.request.start.q)
        energy = math.nan  # [J] kinetic, where a leg begins by another joint's coordinate
        while True:
            events = [e for leg in legs for e in leg.motion.events]
            request = replace(request, until=self.request.remaining_goal(request.start.t, events))
            if planned := len(legs) < len(self.entries):
                wait = self.entries[len(legs)].t - request.start.t
                request = replace(request, until=Until("time", wait))
            counted = chart.counted(request.start.q, users)
            chart_request = self._chart_request(chart, request, counted)
            same = before[len(legs) : len(legs) + 1]
            run = self._run(chart, chart_request, tolerance, same, planned)
            energy = self._keep_energy(run, energy)
            leg = Leg(chart, run.motion(), counted)
            self.runs.append(run)
            if cycle is not None and (over := cycle.closed(leg, bool(legs))) is not None:
                return self._joined([*legs, replace(leg, motion=over)])
            if not planned or leg.motion.end in ends.CHART_ENDS:
                del self.entries[len(legs) :]
                if (entry := self.successor(leg, bool(legs))) is None:
                    return self._joined([*legs, leg])
                self.entries.append(entry)
                leg = replace(leg, motion=until(leg.motion, entry.t))
            elif leg.motion.end != "time":
                return self._joined([*legs, leg])
            entry = self.entries[len(legs)]
            legs.append(leg)
            users = np.atleast_1d(leg.state(np.array([leg.motion.t_end])).q[0])
            chart, starts = entry.chart, self._states(leg, entry.chart.joints, entry.starts)
            start = start_of(starts)._replace(t=entry.t)
            energy += run.net_work(entry.t)
            roles = run.roles[-1][1] if run.roles else None
            request = replace(self.request, start=start, roles=roles)

    @property
    def target(self) -> float:
        """[rad or m] of the error."""
        return self.request.accuracy or TARGET

    def _chart_request(
        self, chart: Chart, request: SimulationRequest, counted: Counted | None
    ) -> SimulationRequest:
        """A request in the words of a chart: its roles, events and places of the goal."""
        if request.roles is not None:
            request = replace(request, roles=request.roles.among(chart.drivers))
        until, watch = request.until, request.watch
        if chart is not self.home and (goals := request.goals):
            goals = self.request.goals
            until = Until("event")
            watch += tuple(Watch(request.until.goal, partial(_beyond, x)) for x in goals)
        if counted is not None:  # events are told in the user's coordinates

            def surface(of: Surface, t: float, *state: Real) -> float:
                return of(t, *counted.state(*state))

            watch = tuple(replace(w, surface=partial(surface, w.surface)) for w in watch)
        return replace(request, until=until, watch=watch)

    def _run(
        self,
        chart: Chart,
        request: SimulationRequest,
        tolerance: float,
        before: Sequence[TimeIntegration],
        planned: bool,
    ) -> TimeIntegration:
        """The integration of a leg; a dear chart is left for a better one."""
        leaves = None
        if chart.is_general and not planned:

            def leaves(q: Real) -> bool:
                return chart.better(chart.tangent(q), self.fixed)

        if before:
            system = before[0].system
        else:
            pairs = zip(*map(np.atleast_1d, request.start[:2]), strict=True)
            starts = dict(zip(chart.mechanism.drivers, pairs, strict=True))
            system, request = self.prepare(chart, request, starts)
            self.systems.append(system)
        settings = self.method, tolerance, self.method, self.target, before[0] if before else None
        run = TimeIntegration(system, request, *settings, leaves=leaves)
        run.equation.limit -= sum(earlier.equation.spent for earlier in self.runs)
        return run

    def successor(self, leg: Leg, later: bool) -> Entry | None:
        """The chart that goes on from where the present one gets worse for good; None without."""
        motion, chart = leg.motion, leg.chart
        if motion.end not in ends.CHART_ENDS:
            return None
        shares = np.linspace(1.0, 0.0, PER_SWING, endpoint=False), 0.5 ** np.arange(1, HALVED)
        before = (motion.t_end - motion.t_start) * np.concatenate(shares)
        times = np.unique(np.maximum(motion.t_end - before, motion.t_start))[::-1]
        q = motion.at(times).q.reshape(len(times), -1)
        looked = ((t, x, chart.tangent(x)) for t, x in zip(times.tolist(), q, strict=True))
        closing = (look for look in looked if np.isfinite(look[2]).all())
        worse = [*takewhile(lambda look: chart.better(look[2], self.fixed), closing)]
        if not worse or (later and worse[-1][0] == motion.t_start):
            return None
        t, x, _ = worse[-1]
        states = partial(self._states, replace(leg, motion=until(motion, t)))
        on = chart.successor(x, self.fixed, states)
        return None if on is None else Entry(t, *on)

    def _states(self, leg: Leg, joints: Sequence[str], references: Pairs = NO_PAIRS) -> Pairs:
        """Joint -> coordinate and rate where a leg ends; turns of angles as of ``references``."""
        chart, end = leg.chart, leg.motion
        q, qd = np.atleast_1d(end.q_end), np.atleast_1d(end.qd_end)
        users = np.atleast_1d(leg.state(np.array([end.t_end])).q[0])
        turns = {joint: x for joint, (x, _) in references.items()}
        turns |= zip(chart.users, users.tolist(), strict=True)
        weakest = chart.singular_values(chart.poses(q), chart.joints)[-1]
        self.offset = self.rounded * EPS / weakest
        leads = dict(zip(chart.joints, zip(q.tolist(), qd.tolist(), strict=True), strict=True))
        at, states = chart.states(q, qd), dict[str, tuple[float, float]]()
        for joint in joints:
            x, rate = at[joint]
            if joint in turns and chart.layout.pairs[joint].kind == "R":
                x += math.tau * round((turns[joint] - x) / math.tau)
            coordinate, _ = on = leads.get(joint, (math.inf, 0.0))
            states[joint] = on if abs(coordinate - x) < SETTLED else (x + self.offset, rate)
        return states

    def _keep_energy(self, run: TimeIntegration, energy: float) -> float:
        """Kinetic energy [J] with which a leg begins: after the first, that at the end before it.

        Poses near a dead centre are known to EPS / s, with s the least singular value, and so is
        the energy by work; rates that follow from such poses are known to EPS / s^2 alone.
        """
        present = run.equation.kinetic(run.y)
        if math.isnan(energy):
            return present
        roles, scale = run.request.roles, 1.0 + self.offset
        if present > 0 and energy > 0 and (roles is None or not roles.prescribed):
            scale *= math.sqrt(energy / present)
        run.y[run.layout.rate] *= scale
        return present * scale**2

    def _joined(self, legs: Sequence[Leg]) -> Motion:
        """The motion of all legs, in the coordinates of the user's drivers."""
        motions = [leg.motion for leg in legs]
        last, drivers = motions[-1], self.home.mechanism.drivers
        moving = [leg for leg in legs if leg.motion.t_end > leg.motion.t_start] or legs[-1:]
        end = legs[-1].state(np.array([last.t_end]))
        facts = dict(last.facts)
        for name, total in (
            ("friction_work", math.fsum),
            ("drive_work", math.fsum),
            ("energy_balance", max),
        ):
            if parts := [m.facts[name] for m in motions if name in m.facts]:
                facts[name] = total(parts)
        roles = list[RolesFrom]()
        for x in (x for m in motions for x in m.roles):
            of = {d: x.of.get(d, FREE) for d in drivers}
            if not roles or roles[-1].of != of:
                roles.append(RolesFrom(x.begin, of))
        events = []
        for leg in legs:
            for event in leg.motion.events:
                q, qd = (x[0] for x in leg.state(np.array([event.t])))
                events.append(event._replace(q=q, qd=qd))
        return last.but(
            t_start=self.request.start.t,
            error=math.inf,
            q_end=end.q[0],
            qd_end=end.qd[0],
            track=Chain(np.array([leg.motion.t_start for leg in moving]), tuple(moving)),
            events=tuple(events),
            roles=tuple(roles),
            slips=(),  # each leg has those of its own pairs
            notes=tuple(dict.fromkeys(note for m in motions for note in m.notes)),
            facts=facts,
            legs=tuple(moving),
            charts=tuple(
                (leg.motion.t_start, self.home.output_names(leg.chart.joints)) for leg in moving
            ),
            cost=Cost(*map(sum, zip(*(system.cost for system in self.systems), strict=True))),
        )


def _beyond(goal: float, t: float, q: Real, qd: Real) -> Real:
    """How far the only driver of the user is beyond a place [rad or m]."""
    return q - goal


def _refused(home: Chart, request: SimulationRequest) -> str:
    """What a motion has that is not handed over from chart to chart; empty where all is."""
    reasons = {
        "signals or friction laws have states": home.mechanism.structure.states,
        "end stops let it bounce": request.stops,
        "a steady state is looked for": request.until.goal == "steady",
        "its steps are fixed": request.method in STEPPERS,
    }
    return listed([why for why, so in reasons.items() if so])


def _stops_of_pairs(home: Chart, stops: Pairs) -> dict[str, Stops]:
    """Stops that a call gives, all by the names of pairs in the document."""
    names = {driver: f"joint.{joint}.{COORDINATE}" for joint, driver in home.users.items()}
    block_pairs = home.names.of_joints.items() if home.mechanism.names is None else ()
    names |= {f"{ref}.{COORDINATE}": f"{joint}.{COORDINATE}" for ref, joint in block_pairs}
    sides = {x: zip(("from", "to"), between, strict=True) for x, between in stops.items()}
    finite = {x: {side: q for side, q in both if math.isfinite(q)} for x, both in sides.items()}
    return {names.get(x, x): Stops.model_validate(ends) for x, ends in finite.items() if ends}


def _followed(
    home: Chart, motion: Motion, request: SimulationRequest, prepare: Prepare, move: Move
) -> Motion:
    """A motion that ended at a change point, where no joints lead: its dyads then follow it."""
    if len(home.joints) > 1 or (following := home.following(motion, request.start)) is None:
        return motion
    start = {following.mechanism.drivers[0]: request.start[:2]}
    through = move(*prepare(following.mechanism, request, start))
    if not through.t_end > motion.t_end:
        return motion
    leads = (request.start.t, home.output_names(home.joints))
    legs, notes = (Leg(following, through, None),), (*through.notes, FOLLOW)
    return through.but(legs=legs, charts=(leads,), notes=notes)


def beyond_dead_centres(
    motion: Motion,
    system: System,
    request: SimulationRequest,
    stops: Pairs | None,
    prepare: Prepare,
    move: Move,
) -> Motion:
    """A motion that ended at a dead centre of its drivers, through other charts; else itself.

    ``stops`` are those that a call gives, ``prepare`` gives the system of a mechanism for a
    request, starts by driver and stops, ``move`` the motion in one chart.
    """
    mechanism = cast("Compiled", system.compiled)
    try:
        home = home_chart(mechanism, np.atleast_1d(request.start.q))
    except BlockmechError as error:
        note = f"links and joints do not say these blocks, so no other joint leads on: {error}"
        return motion.but(notes=(*motion.notes, note))
    linkage, method = home.home, "radau" if request.method == "radau" else "dop853"
    if stops is not None:
        linkage.stops = _stops_of_pairs(home, stops)
    roles = {} if request.roles is None else request.roles.by_driver()
    named = {d for d, role in roles.items() if role != FREE}
    named |= {d for watch in request.watch for d in watch.then}
    sensors = (wire.source.split(".") for wire in linkage.wires)
    named |= {name[1] for name in sensors if name[0] == "driver"}
    followers = mechanism.structure.followers.values()  # their couplings read other drivers
    named |= {d for follower in followers for d, _ in follower.terms + follower.added}
    loads = {getattr(load, "driver", None) for load in linkage.loads.values()}
    fixed = tuple(j for j, d in home.users.items() if d in named or linkage.driven[j] in loads)
    if why := _refused(home, request):
        note = f"no other joint than the drivers' leads on: {why}"
        return motion.but(notes=(*motion.notes, note))
    chart_request = replace(request, why=WHY)

    def prepared(chart: Chart, *arguments: Any) -> tuple[System, SimulationRequest]:
        return prepare(chart.mechanism, *arguments, stops if chart.mechanism is mechanism else None)

    of = repeats(system, request), system.depends_on <= {"q"} and system.friction is None
    atlas = Atlas(home, chart_request, prepared, fixed, method, *of)
    if (entry := atlas.successor(Leg(home, motion, None), False)) is None:
        through = _followed(home, motion, request, partial(prepare, stops=stops), move)
        notes = (*motion.notes, NAMED) if len(fixed) == len(home.users) else motion.notes
        return motion.but(notes=notes) if through is motion else through
    atlas.entries.append(entry)
    scout = atlas.walk(max(atlas.target, LOOSE))
    if scout.end in UNFINISHED:  # no other walk would be stopped: it is said once
        return stopped(scout, None)
    # What rounding does where the state is handed over is not less by half the steps.
    return refined(atlas.walk, system, atlas.target, request.times, remainder=1.0)
