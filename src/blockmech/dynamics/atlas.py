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
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.charts import Chart
from blockmech.dynamics.estimate import FINER, FLOOR, SHORTER, TARGET, refined, with_rounding
from blockmech.dynamics.impact import Chain, bounced
from blockmech.dynamics.pair_stops import Counted, stopped_pairs
from blockmech.dynamics.request import SimulationRequest, Start, Until
from blockmech.dynamics.time import TimeIntegration
from blockmech.errors import BlockmechError, GraphError
from blockmech.model.joints.blocks import SaidByLinks
from blockmech.model.joints.linkage import Linkage
from blockmech.model.structure import COORDINATE
from blockmech.motion import Cost, Floats, Motion, State

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.system import System
    from blockmech.model.graph import Graph

Prepare: TypeAlias = Callable[..., tuple["System", SimulationRequest]]

BETTER = 2.0  # times the volume that other joints must span for a chart to be left
SAME = 1e-9  # [rad] to which a coordinate that counts from elsewhere is off by whole turns
LOOKS = 96  # places over a leg at which charts are compared, and as many nearer and nearer its end
HALVED = 26  # times that the way to its end is


class Entry(NamedTuple):
    """From a time [s] on a chart leads, where the first walk had its joints."""

    t: float
    chart: Chart
    q: Mapping[str, float]


@dataclass(frozen=True)
class Leg:
    """A motion in one chart, read in the coordinates of the user's drivers.

    motion : in the chart's coordinates
    counted : those of the user's drivers, from where the leg begins; None where these lead
    """

    chart: Chart
    motion: Motion
    counted: Counted | None

    @cached_property
    def milestones(self) -> tuple[Floats, list[Any]]:
        """Times [s] over the leg, and what is counted there."""
        assert self.counted is not None
        times = self.motion.times(LOOKS + 1)
        self.counted.again()
        q = self.motion.at(times).q.reshape(len(times), -1)
        return times, [(self.counted.at(x), self.counted.last)[1] for x in q]

    def state(self, t: Floats) -> State:
        """State of the user's drivers at times (m,) [s] of the leg."""
        if self.counted is None:
            return self.motion.at(t)
        q, qd = (x.reshape(len(t), -1) for x in self.motion.at(t))
        times, last = self.milestones
        places, rates = np.empty_like(q), np.empty_like(q)
        nearest = np.maximum(np.searchsorted(times, t, "right") - 1, 0)
        for i, (x, rate, near) in enumerate(zip(q, qd, nearest.tolist(), strict=True)):
            self.counted.last = last[near]
            places[i] = self.counted.at(x)
            rates[i] = self.counted.last[2] @ rate
        alone = q.shape[1] == 1
        return State(places[:, 0], rates[:, 0]) if alone else State(places, rates)

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        return self.motion.signal_states(t)


@dataclass
class Atlas:
    """A motion that changes charts, under way.

    Attributes
    ----------
    home : the user's chart, in which it starts
    prepare : a system of a chart's mechanism for a request, and the request with its end stops
    fixed : joints whose drivers stay, as they have a role or something else names them
    entries : which charts lead from when on, as the first walk finds it
    """

    home: Chart
    request: SimulationRequest
    prepare: Prepare
    fixed: tuple[str, ...]
    method: str
    entries: list[Entry] = field(default_factory=list)
    longest: dict[int, float] = field(default_factory=dict)  # [s] step in each leg of a walk

    def walk(self, tolerance: float) -> Motion:
        """Go on from chart to chart until something else than a dead centre ends the motion."""
        legs, request = list[Leg](), self.request
        chart, costs, users = self.home, list[Cost](), np.atleast_1d(request.start.q)
        while True:
            planned = len(legs) < len(self.entries)
            goal = self._left(legs, request.start.t)
            if planned:
                goal = Until("time", self.entries[len(legs)].t - request.start.t)
            system, asked = self._prepared(chart, replace(request, until=goal))
            motion = self._integrated(system, asked, tolerance, len(legs))
            costs.append(system.cost)
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
            request = replace(self.request, start=start)

    def _prepared(self, chart: Chart, request: SimulationRequest) -> Any:
        q, rate, _ = request.start
        pairs = zip(np.atleast_1d(q), np.atleast_1d(rate), strict=True)
        starts = dict(zip(chart.mechanism.drivers, pairs, strict=True))
        return self.prepare(chart.mechanism, request, starts)

    def _left(self, legs: Sequence[Leg], t: float) -> Until:
        """What still ends the motion."""
        goal = self.request.until
        if goal.goal == "time":
            return replace(goal, value=self.request.t_last - t)
        if goal.goal == "swings":
            stood = (e.kind == ends.STANDSTILL for leg in legs for e in leg.motion.events)
            return replace(goal, value=goal.value - sum(stood))
        return goal

    def _integrated(
        self, system: System, request: SimulationRequest, tolerance: float, n: int
    ) -> Motion:
        target = self.request.accuracy or TARGET
        limit = SHORTER * self.longest.get(n, math.inf)

        def move(system: System, request: SimulationRequest) -> Motion:
            one = TimeIntegration(
                system, request, self.method, tolerance, self.method, target, max_step=limit
            )
            motion = one.motion()
            self.longest[n] = max(self.longest.get(n, 0.0), one.longest)
            return motion

        return bounced(system, request, move) if request.stops else move(system, request)

    def _counted(self, chart: Chart, q: Any, users: Floats) -> Counted | None:
        """Coordinates of the user's drivers in a chart, which are so much where it begins."""
        if chart is self.home:
            return None
        names = [f"{chart.in_outputs(joint=j)}.{COORDINATE}" for j in self.home.joints]
        pairs = stopped_pairs(chart.mechanism, names)
        assert pairs is not None
        at = np.array(np.atleast_1d(q), dtype=np.float64)
        apart = users - pairs.places(at)
        turns = np.where(pairs.rotary, math.tau * np.round(apart / math.tau), 0.0)
        return Counted(pairs, at, np.where(np.abs(apart - turns) < SAME, turns, apart))

    def successor(self, leg: Leg, later: bool) -> Entry | None:
        """The chart that goes on from where the present one gets worse for good; None without."""
        motion, chart = leg.motion, leg.chart
        if motion.end not in ends.CHART_ENDS:
            return None
        span = motion.t_end - motion.t_start
        times = motion.t_end - span * np.append(
            np.linspace(1, 0, LOOKS + 1)[:-1], 0.5 ** np.arange(1, HALVED)
        )
        times = np.unique(times)
        poses = chart.poses(motion.at(times).q.reshape(len(times), -1))
        worse = None
        for t, at in zip(times[::-1].tolist(), poses[::-1], strict=True):
            if not all(math.isfinite(pose.theta) for pose in at.values()):
                continue
            T = chart.tangent(at)
            joints = chart.largest(T, self.fixed, ())
            if not chart.volume(T, joints) > BETTER * chart.volume(T, chart.joints):
                break
            worse = t, at, T
        if worse is None or (later and worse[0] == motion.t_start):
            return None
        t, at, T = worse
        cut, failed = replace(leg, motion=until(motion, t)), set[str]()
        while chart.volume(
            T, joints := chart.largest(T, self.fixed, failed)
        ) > BETTER * chart.volume(T, chart.joints):
            start = self._start(cut, joints, {})
            states = zip(np.atleast_1d(start.q), np.atleast_1d(start.rate), strict=True)
            starts = dict(zip(joints, states, strict=True))
            try:
                made = chart.led_by(starts, at)
            except GraphError:
                failed.add(joints[-1])
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
        for i, joint in enumerate(joints):
            if joint in counted and self.home.layout.pairs[joint].kind == "R":
                places[i] += math.tau * round((counted[joint] - places[i]) / math.tau)
        rates = leg.chart.rates(poses, joints, np.atleast_1d(end.qd_end))
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
        events = []
        for leg in legs:
            for event in leg.motion.events:
                q, qd = (x[0] for x in leg.state(np.array([event.t])))
                events.append(event._replace(q=q, qd=qd))
        return last.but(
            t_start=self.request.start.t,
            q_end=end.q[0],
            qd_end=end.qd[0],
            track=track,
            events=tuple(events),
            notes=tuple(dict.fromkeys(note for leg in legs for note in leg.motion.notes)),
            facts=facts,
            legs=tuple(moving),
            charts=tuple((leg.motion.t_start, self.home.said(leg.chart.joints)) for leg in moving),
            cost=Cost(*map(sum, zip(*costs, strict=True))),
        )


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


def beyond_dead_centres(
    motion: Motion, system: System, request: SimulationRequest, prepare: Prepare
) -> Motion:
    """A motion that ended at a dead centre of its drivers, through other charts; else itself.

    ``prepare`` gives the system of a mechanism for a request and starts by driver.
    """
    mechanism = cast("Compiled", system.compiled)
    try:
        home = home_chart(mechanism, np.atleast_1d(request.start.q))
    except BlockmechError as error:
        note = f"links and joints do not say these blocks, so no other joint leads on: {error}"
        return motion.but(notes=(*motion.notes, note))
    linkage = home.home
    if request.until.goal not in ("time", "event"):
        return motion
    if linkage.couplings or linkage.signals or request.roles is not None or request.stops:
        return motion
    method = "radau" if request.method == "radau" else "dop853"
    followed = {load.driver for load in linkage.loads.values() if load.driver}
    fixed = tuple(x.joint for d, x in linkage.drivers.items() if d in followed)
    atlas = Atlas(home, request, prepare, fixed, method)
    if (entry := atlas.successor(Leg(home, motion, None), False)) is None:
        return motion
    atlas.entries.append(entry)
    target = request.accuracy or TARGET

    def finer(tolerance: float, apart: float) -> float | None:
        if tolerance <= FLOOR:
            return None
        share = min(1 / FINER, 0.3 * target / apart) if 0 < apart < math.inf else 1 / FINER
        return max(tolerance * share, FLOOR)

    first = max(target / 10, FLOOR * FINER)
    whole, apart = refined(atlas.walk, first, finer, target, system.rotary, request.times)
    return with_rounding(system, whole, target, apart)
