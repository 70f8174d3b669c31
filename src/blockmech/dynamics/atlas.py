"""A motion over several charts: where one ends at a dead centre, another goes on.

    user's chart -> ends at its dead centre -> back to where another joint moves twice as much
                 -> hand over -> that joint's chart -> ... -> goal

Which joints lead from when on is found by the first walk; others, at a finer tolerance, keep to it,
so that two walks differ by the errors of all their integrations alone. What a user asks for is in
the coordinates of the user's drivers, which each chart reads as coordinates of joints.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.charts import Chart
from blockmech.dynamics.estimate import (
    TARGET,
    UNFINISHED,
    refined,
    stopped,
)
from blockmech.dynamics.impact import Chain, Move
from blockmech.dynamics.legs import Leg
from blockmech.dynamics.pair_stops import Counted, stopped_pairs
from blockmech.dynamics.request import SimulationRequest, Start, Surface, Until, Watch
from blockmech.dynamics.roles import FREE, Roles
from blockmech.dynamics.solvers import STEPPERS
from blockmech.dynamics.time import TimeIntegration
from blockmech.ground.errors import BlockmechError, GraphError, listed
from blockmech.ground.plane import EPS
from blockmech.model.joints.blocks import SaidByLinks
from blockmech.model.joints.layout import Poses
from blockmech.model.joints.linkage import Linkage
from blockmech.model.structure import COORDINATE
from blockmech.result.motion import Cost, Floats, Motion, RolesFrom

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.system import System
    from blockmech.model.graph import Graph

Prepare: TypeAlias = Callable[..., tuple["System", SimulationRequest]]

BETTER = 2.0  # times the volume that other joints must span for a chart to be left
SAME = 1e-9  # [rad] to which a coordinate that counts from elsewhere is off by whole turns
LOOKS = 32  # places over a leg at which charts are compared
HALVED = 26  # times that the way to its end is, for more of them
SCOUTING = 1e-7  # tolerance of the walk that finds which joints lead from when on
WHY = "other joints lead where the drivers' coordinates stand still"
FOLLOW = "it passes change points, where its dyads follow the motion"
ROUNDED = 2  # roundings by which two walks differ where the state is handed over


class Entry(NamedTuple):
    """From a time [s] on a chart leads, where the first walk had its joints."""

    t: float
    chart: Chart
    q: Mapping[str, float]


@dataclass
class Atlas:
    """A motion that changes charts, under way.

    Attributes
    ----------
    home : the user's chart, in which it starts
    prepare : a system of a chart's mechanism for a request, and the request with its end stops
    fixed : joints whose drivers stay, as they have a role or something else names them
    entries : which charts lead from when on, as the first walk finds it
    runs : of each leg, whose steps the walk by half of them halves
    """

    home: Chart
    request: SimulationRequest
    prepare: Prepare
    fixed: tuple[str, ...]
    method: str
    entries: list[Entry] = field(default_factory=list)
    runs: dict[int, TimeIntegration] = field(default_factory=dict)
    walks: int = 0

    def walk(self, tolerance: float, halves: bool = False) -> Motion:
        """Go on from chart to chart until something else than a dead centre ends the motion.

        It ``halves`` the steps of the walk before.
        """
        before = self.runs if halves else {}
        self.runs = {}
        legs, request, self.walks = list[Leg](), self.request, self.walks + 1
        chart, costs, users = self.home, list[Cost](), np.atleast_1d(request.start.q)
        while True:
            planned = len(legs) < len(self.entries)
            goal = self._left(legs, request.start.t)
            if planned:
                goal = Until("time", self.entries[len(legs)].t - request.start.t)
            asked = self._asked(chart, replace(request, until=goal), users)
            run = self._run(chart, asked, tolerance, before.get(len(legs)), not planned)
            motion, self.runs[len(legs)] = run.motion(), run
            costs.append(run.system.cost)
            leg = Leg(chart, motion, self._counted(chart, request.start.q, users))
            if not planned or motion.end in ends.CHART_ENDS:
                del self.entries[len(legs) :]
                if (entry := self.successor(leg, bool(legs))) is None:
                    return self._joined([*legs, leg], costs)
                self.entries.append(entry)
                leg = replace(leg, motion=until(motion, entry.t))
            elif motion.end != "time":
                return self._joined([*legs, leg], costs)
            entry = self.entries[len(legs)]
            legs.append(leg)
            users = np.atleast_1d(leg.state(np.array([leg.motion.t_end])).q[0])
            chart, start = entry.chart, self._start(leg, entry.chart.joints, entry.q)
            request = replace(self.request, start=start, roles=self._roles(leg))

    def _asked(self, chart: Chart, request: SimulationRequest, users: Floats) -> SimulationRequest:
        """A request in the words of a chart: its roles, events and places of the goal."""
        if chart is self.home:
            return request
        counted = self._counted(chart, request.start.q, users)
        assert counted is not None

        def read(surface: Surface) -> Surface:
            def value(t: float, q: Any, qd: Any) -> float:
                places = counted.at(np.atleast_1d(q))
                rates = counted.last[2] @ np.atleast_1d(qd)
                alone = len(places) == 1
                return surface(t, *((places[0], rates[0]) if alone else (places, rates)))

            return value

        until, watch = request.until, request.watch
        if place := replace(request, start=self.request.start).places:
            until = Until("event")
            watch += tuple(Watch(request.until.goal, partial(_beyond, x)) for x in place)
        roles = request.roles
        if roles is not None:
            of, drive = roles.by_driver(), chart.mechanism.scene.drive
            drivers = chart.mechanism.drivers
            each = tuple(of.get(d, FREE) for d in drivers), tuple(drive.get(d) for d in drivers)
            roles = Roles(drivers, *each)
        watch = tuple(replace(w, surface=read(w.surface)) for w in watch)
        return replace(request, until=until, watch=watch, roles=roles)

    def _roles(self, leg: Leg) -> Roles | None:
        """The roles with which a leg ends."""
        roles = self.request.roles
        if roles is None or not leg.motion.roles:
            return roles
        of = leg.motion.roles[-1].of
        return roles.but({d: role for d, role in of.items() if d in roles.drivers})

    def _left(self, legs: Sequence[Leg], t: float) -> Until:
        """What still ends the motion."""
        goal = self.request.until
        if goal.goal == "time":
            return replace(goal, value=self.request.t_last - t)
        if goal.goal == "swings":
            stood = (e.kind == ends.STANDSTILL for leg in legs for e in leg.motion.events)
            return replace(goal, value=goal.value - sum(stood))
        return goal

    def _run(
        self,
        chart: Chart,
        request: SimulationRequest,
        tolerance: float,
        before: TimeIntegration | None,
        scouts: bool,
    ) -> TimeIntegration:
        """The integration of a leg; where it ``scouts`` a dear chart is left for a better one."""
        target, leaves = self.request.accuracy or TARGET, None
        if scouts and chart.is_general:

            def leaves(q: Any) -> bool:
                return self.better(chart, *chart.poses(q[None, :])) is not None

        if before is None:
            q, rate, _ = request.start
            pairs = zip(np.atleast_1d(q), np.atleast_1d(rate), strict=True)
            starts = dict(zip(chart.mechanism.drivers, pairs, strict=True))
            system, request = self.prepare(chart.mechanism, request, starts)
        else:
            system = before.system
        how = self.method, tolerance, self.method, target, before
        return TimeIntegration(system, request, *how, leaves=leaves)

    def _counted(self, chart: Chart, q: Any, users: Floats) -> Counted | None:
        """Coordinates of the user's drivers in a chart, which are so much where it begins."""
        if chart is self.home:
            return None
        names = [f"{chart.in_outputs(joint=j)}.{COORDINATE}" for j in self.home.joints]
        pairs = stopped_pairs(chart.mechanism, names)
        at = np.array(np.atleast_1d(q), dtype=np.float64)
        apart = users - pairs.state(at, 0 * at)[0]
        turns = np.where(pairs.rotary, math.tau * np.round(apart / math.tau), 0.0)
        return Counted(pairs, at, np.where(np.abs(apart - turns) < SAME, turns, apart))

    def better(self, chart: Chart, poses: Poses) -> Floats | None:
        """The rates of all joints in poses where others should lead; None where none should."""
        if not all(math.isfinite(pose.theta) for pose in poses.values()):
            return None
        T = chart.tangent(poses)
        volume = chart.volume(T, chart.largest(T, self.fixed, ()))
        return T if volume > BETTER * chart.volume(T, chart.joints) else None

    def successor(self, leg: Leg, later: bool) -> Entry | None:
        """The chart that goes on from where the present one gets worse for good; None without."""
        motion, chart = leg.motion, leg.chart
        if motion.end not in ends.CHART_ENDS:
            return None
        span, looks = motion.t_end - motion.t_start, np.linspace(1.0, 0.0, LOOKS, endpoint=False)
        before = span * np.append(looks, 0.5 ** np.arange(1, HALVED))
        times = np.unique(np.maximum(motion.t_end - before, motion.t_start))
        poses = chart.poses(motion.at(times).q.reshape(len(times), -1))
        where = None
        for t, at in zip(times[::-1].tolist(), poses[::-1], strict=True):
            closes = all(math.isfinite(pose.theta) for pose in at.values())
            T = self.better(chart, at)
            if closes and T is None:
                break
            where = where if T is None else (t, at, T)
        if where is None or (later and where[0] == motion.t_start):
            return None
        t, at, T = where
        cut, without = replace(leg, motion=until(motion, t)), set[str]()
        least = BETTER * chart.volume(T, chart.joints)
        while chart.volume(T, joints := chart.largest(T, self.fixed, without)) > least:
            start = self._start(cut, joints, {})
            states = zip(np.atleast_1d(start.q), np.atleast_1d(start.rate), strict=True)
            starts = dict(zip(joints, states, strict=True))
            try:
                made = chart.led_by(starts, at)
            except GraphError:  # where poses tell no mode, or nothing follows from these joints
                without.add(joints[-1])
                continue
            return Entry(t, made, {joint: x for joint, (x, _) in starts.items()})
        return None

    def _start(self, leg: Leg, joints: Sequence[str], near: Mapping[str, float]) -> Start:
        """Coordinates and rates of joints where a leg ends; ``near`` tells the turns of angles."""
        end = leg.motion
        (poses,) = leg.chart.poses(np.reshape(end.q_end, (1, -1)))
        users = np.atleast_1d(leg.state(np.array([end.t_end])).q[0])
        counted = {**near, **dict(zip(self.home.joints, users.tolist(), strict=True))}
        places = leg.chart.coordinates(poses, joints)
        qd = np.atleast_1d(end.qd_end)
        rates = leg.chart.rates(poses, joints, qd)
        states = zip(np.atleast_1d(end.q_end), qd, strict=True)
        leading = dict(zip(leg.chart.joints, states, strict=True))
        off = (-1) ** self.walks * ROUNDED * EPS * leg.chart.conditioning(poses)
        for i, joint in enumerate(joints):
            if joint in counted and self.home.layout.pairs[joint].kind == "R":
                places[i] += math.tau * round((counted[joint] - places[i]) / math.tau)
            place, rate = leading.get(joint, (math.inf, 0.0))
            if abs(place - places[i]) < SAME:  # it leads on
                places[i], rates[i] = float(place), rate
            else:
                places[i], rates[i] = places[i] + off, rates[i] * (1.0 + off)
        if len(joints) == 1:
            return Start(places[0], float(rates[0]), end.t_end)
        return Start(np.array(places), rates, end.t_end)

    def _joined(self, legs: Sequence[Leg], costs: Sequence[Cost]) -> Motion:
        """The motion of all legs, in the coordinates of the user's drivers."""
        last = legs[-1].motion
        moving = [leg for leg in legs if leg.motion.t_end > leg.motion.t_start] or legs[-1:]
        track = Chain(np.array([leg.motion.t_start for leg in moving]), tuple(moving))
        end = legs[-1].state(np.array([last.t_end]))
        facts = dict(last.facts)
        for work in ("friction_work", "drive_work"):
            if parts := [x.motion.facts[work] for x in legs if work in x.motion.facts]:
                facts[work] = math.fsum(parts)
        balances = [x.motion.facts.get("energy_balance", 0.0) for x in legs]
        if "energy_balance" in facts:
            facts["energy_balance"] = max(balances)
        roles = list[RolesFrom]()
        for x in (x for leg in legs for x in leg.motion.roles):
            of = {d: x.of.get(d, FREE) for d in self.home.mechanism.drivers}
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
            track=track,
            events=tuple(events),
            roles=tuple(roles),
            slips=(),  # each leg has those of its own pairs
            notes=tuple(dict.fromkeys(note for leg in legs for note in leg.motion.notes)),
            facts=facts,
            legs=tuple(moving),
            charts=tuple((leg.motion.t_start, self.home.said(leg.chart.joints)) for leg in moving),
            cost=Cost(*map(sum, zip(*costs, strict=True))),
        )


def _beyond(place: float, t: float, q: Any, qd: Any) -> Any:
    """How far the only driver of the user is beyond a place [rad or m]."""
    return q - place


def until(motion: Motion, t: float) -> Motion:
    """A motion up to a time [s]."""
    q, qd = (x[0] for x in motion.at(np.array([t])))
    return motion.but(
        t_end=t,
        q_end=q,
        qd_end=qd,
        x_end=tuple(motion.signal_states(np.array([t]))[0].tolist()),
        end="time",
        events=tuple(e for e in motion.events if e.t <= t),
    )


def kept_charts(mechanism: Compiled) -> dict[str, Chart]:
    """Charts of a mechanism that were made, by their blocks."""
    return {}


def home_chart(mechanism: Compiled, q: Floats) -> Chart:
    """The user's chart: of blocks with the document that says them as links and joints.

    Raises `BlockmechError` where links and joints do not say them.
    """
    document, kept = mechanism.document, mechanism.once(kept_charts)
    if isinstance(document, Linkage):
        assert mechanism.names is not None
        joints = tuple(document.drivers[d].joint for d in mechanism.drivers)
        return Chart(mechanism, joints, document, mechanism.names, kept)
    s, fixed = mechanism.structure, mechanism.structure.frame_link
    links = [link for link in s.links if link != fixed]
    want = [f"{link}.{what}" for link in links for what in ("p", "angle")]
    at = dict(zip(mechanism.drivers, q.tolist(), strict=True))
    found = mechanism.run(at, rates=dict.fromkeys(at, 0.0), want=want, friction="none")
    poses = {
        x: (complex(found[f"{x}.p"][0]), cmath.rect(1.0, found[f"{x}.angle"][0])) for x in links
    }
    said = SaidByLinks(cast("Graph", document).flat().to_data(), s, {fixed: (0j, 1 + 0j), **poses})
    joints = tuple(said.joints[s.driven[d]] for d in mechanism.drivers)
    return Chart(mechanism, joints, Linkage.from_data(said.document()), said.names(), kept)


def _refused(mechanism: Compiled, linkage: Linkage, request: SimulationRequest) -> str:
    """What a motion has that is not handed over from chart to chart; empty where all is."""
    reasons = {
        "it has couplings": linkage.couplings,
        "signals or friction laws have states": mechanism.structure.states,
        "signals read the drivers": linkage.signals or mechanism.structure.signal_wires,
        "end stops let it bounce": request.stops,
        "a steady state is looked for": request.until.goal == "steady",
        "its steps are fixed": request.method in STEPPERS,
    }
    return listed([why for why, so in reasons.items() if so])


def _followed(
    home: Chart, motion: Motion, request: SimulationRequest, prepare: Prepare, move: Move
) -> Motion:
    """A motion that ended at a change point, where no joints lead: its dyads then follow it."""
    if len(home.joints) > 1 or (made := home.following(motion, request.start)) is None:
        return motion
    q, rate, _ = request.start
    drivers = made.mechanism.drivers
    system, asked = prepare(made.mechanism, request, {drivers[0]: (q, rate)})
    through = move(system, asked)
    if not through.t_end > motion.t_end:
        return motion
    leads = (request.start.t, home.said(home.joints))
    return through.but(
        legs=(Leg(made, through, None),), charts=(leads,), notes=(*through.notes, FOLLOW)
    )


def beyond_dead_centres(
    motion: Motion, system: System, request: SimulationRequest, prepare: Prepare, move: Move
) -> Motion:
    """A motion that ended at a dead centre of its drivers, through other charts; else itself.

    ``prepare`` gives the system of a mechanism for a request and starts by driver, ``move`` the
    motion in one chart.
    """
    mechanism = cast("Compiled", system.compiled)
    try:
        home = home_chart(mechanism, np.atleast_1d(request.start.q))
    except BlockmechError as error:
        note = f"links and joints do not say these blocks, so no other joint leads on: {error}"
        return motion.but(notes=(*motion.notes, note))
    linkage, method = home.home, "radau" if request.method == "radau" else "dop853"
    if why := _refused(mechanism, linkage, request):
        return motion.but(
            notes=(*motion.notes, f"no other joint than the drivers' leads on: {why}")
        )
    loads = (getattr(load, "driver", None) for load in linkage.loads.values())
    named = {driver for driver in loads if driver}
    named |= {d for watch in request.watch for d in watch.then}
    if request.roles is not None:
        named |= {d for d, role in request.roles.by_driver().items() if role != FREE}
    fixed = tuple(linkage.drivers[d].joint for d in linkage.drivers if d in named)
    atlas = Atlas(home, replace(request, why=WHY), prepare, fixed, method)
    if (entry := atlas.successor(Leg(home, motion, None), False)) is None:
        return _followed(home, motion, request, prepare, move)
    atlas.entries.append(entry)
    target = request.accuracy or TARGET

    scout = atlas.walk(max(target, SCOUTING))
    if scout.end in UNFINISHED:  # no other walk would be stopped: it is said once
        return stopped(scout, None)
    # What rounding does where the state is handed over is not less by half the steps.
    return refined(atlas.walk, system, target, request.times, remainder=1.0)
