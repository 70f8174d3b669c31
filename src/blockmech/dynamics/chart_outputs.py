"""Outputs along a motion over several charts: each leg is read in its own, by the user's names.

A document's links and joints have their names in all charts, and so have those that blocks are
said by: an output of blocks is that of the document which is read of it alone. A driver that does
not lead has the coordinate of its joint, x'' = r q'' + drift, and its drive gives nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.blocks.joints import Coordinate
from blockmech.dynamics import events
from blockmech.dynamics.motion_outputs import (
    STATIC,
    SimulationResult,
    result_in_chart,
    settings_along,
)
from blockmech.dynamics.pair_stops import Counted
from blockmech.ground.plane import within_half_turn
from blockmech.model.joints.linkage import Linkage
from blockmech.model.structure import COORDINATE
from blockmech.outputs.by_block import PARTS
from blockmech.outputs.by_link import readings
from blockmech.plan.settings import friction_asked
from blockmech.result.motion import Motion, State
from blockmech.result.quality import Flag, Quality
from blockmech.result.result import FREE
from blockmech.result.samples import Samples
from blockmech.typing import Array, Complex, Data, Floats, FrictionMethod, M

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.charts import Chart


@dataclass(frozen=True)
class Leg:
    """A motion in one chart, read in the coordinates of the user's drivers.

    chart : a `Chart`
    motion : in the chart's coordinates
    counted : those of the user's drivers, from where the leg begins; None where these lead
    """

    chart: Any
    motion: Motion
    counted: Counted | None

    def state(self, t: Floats) -> State:
        """State of the user's drivers at times (m,) [s] of the leg."""
        if self.counted is None:
            return self.motion.at(t)
        # Between some places over the leg turns are counted.
        times = np.union1d(t, self.motion.times(events.PARTS + 1))
        self.counted.again()
        states = [self.counted.state(*state) for state in zip(*self.motion.at(times), strict=True)]
        indices = np.searchsorted(times, t)
        return State(*(np.array(x)[indices] for x in zip(*states, strict=True)))

    def accelerations(self, t: Floats, qdd: Floats) -> Floats:
        """Those (m, k) of the user's drivers from those (m, k) of the chart's."""
        if self.counted is None:
            return qdd
        q, qd = (x.reshape(qdd.shape) for x in self.motion.at(t))
        rows = [self.counted.pairs.state(*state)[1:] for state in zip(q, qd, strict=True)]
        return np.array([R @ a + drift for (R, drift), a in zip(rows, qdd, strict=True)])

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        return self.motion.signal_states(t)


IDLE = ("drive", "drive_by_reduction", "power")  # of a driver that is free


class Source(NamedTuple):
    """An output of a document, and what of it an output of blocks is."""

    name: str
    sign: int = 1
    turn: float = 0.0  # [rad] less
    angle: bool = False  # between -pi and pi


def sources_of(blocks: Compiled, chart: Chart) -> dict[str, Source]:
    """Outputs of blocks in the document that says them, whose parts in the blocks names tell."""
    names, s, sources = chart.names, blocks.structure, dict[str, Source]()
    for _, make, arguments in readings(s, names, blocks.outputs.by_owner):
        for reading in make(*arguments, ""):
            if len(reading.parts) == 1 and not reading.wrapped:
                ((name, sign),) = reading.parts
                source = Source(reading.name, sign, reading.turn, bool(reading.turn))
                sources.setdefault(name, source)
    for name, pair in names.joints.items():
        if s.joint(pair.joint).rotary and not s.joint(pair.joint).driven:
            where, sign = f"{pair.joint}.coordinate", -1 if pair.flipped else 1
            sources[where] = Source(f"joint.{name}.coordinate", sign, angle=True)
    sources |= {f"{s.driven[d]}.{COORDINATE}": Source(f"driver.{d}.q") for d in s.followers}
    return sources


def coordinates_of_drivers(mechanism: Compiled) -> dict[str, tuple[str, Coordinate]]:
    """Coordinates of driven pairs: name of the output -> driver, and how it follows."""
    document, s = mechanism.document, mechanism.structure
    if isinstance(document, Linkage):
        joints = {driver: f"joint.{x.joint}" for driver, x in document.drivers.items()}
        return {f"{joint}.{COORDINATE}": (d, Coordinate()) for d, joint in joints.items()}
    return {f"{ref}.{COORDINATE}": (d, s.coordinate(d)) for d, ref in s.driven.items()}


@dataclass
class LegOutputs:
    """Samples of a leg, and how the user's outputs are read there.

    at : which samples of the whole
    names : the user's outputs -> those of the chart
    result : what the chart says
    """

    of: Compiled
    leg: Leg
    at: Array
    names: Mapping[str, Source]
    result: SimulationResult[Any]

    @property
    def mechanism(self) -> Compiled:
        """The mechanism of the chart."""
        mechanism: Compiled = self.result.mechanism
        return mechanism

    def read(self, name: str) -> Any:
        """Values (n,) of one of the user's outputs."""
        driver, coordinate = self.of._once(coordinates_of_drivers).get(name, ("", None))
        if coordinate is not None and driver not in self.of.structure.followers:
            return coordinate.of_joint(self._of_driver(self.of._of_driver(driver, "q")))
        if (source := self.names.get(name)) is None:
            return self._of_driver(name)
        if self.of.outputs[name].kind == "matrix" and self.leg.counted is not None:
            return np.nan  # it is by drivers
        x = self.result[source.name]
        if coordinate is not None and source.name.endswith(".q"):
            return coordinate.of_joint(x)
        if source.angle:
            return within_half_turn(source.sign * (x - source.turn))
        return x if source.sign > 0 else np.negative(x)

    def _of_driver(self, name: str) -> Complex:
        """What is of a driver that does not lead; NaN of all else that the chart does not say."""
        head, _, quantity = name.rpartition(".")
        heads = [self.of._of_driver(d, "q")[:-2] for d in self.of.drivers]
        t, n = np.asarray(self.result.samples.time), len(self.at)
        if head not in heads or quantity not in (*IDLE, "q", "rate", "acceleration"):
            vector = self.of.outputs[name].kind == "vector"
            return complex(np.nan, np.nan) if vector else np.nan
        if quantity in IDLE:
            return 0.0
        if quantity != "acceleration":
            x = self.leg.state(t)[quantity == "rate"]
        else:
            names = [self.mechanism._of_driver(d, quantity) for d in self.mechanism.drivers]
            x = self.leg.accelerations(t, np.array([self.result[y] for y in names]).T)
        return x.reshape(n, -1)[:, heads.index(head)]


class ChartedResult(SimulationResult[M]):
    """The result of a simulation over several charts.

    Outputs that are of a formation sequence alone, such as an inertia reduced to a driver, are NaN
    where another one leads.
    """

    def __getstate__(self) -> Data:
        return {name: x for name, x in super().__getstate__().items() if name != "parts"}

    @cached_property
    def parts(self) -> list[LegOutputs]:
        """Legs that have samples, each with the result in its chart."""
        legs, t = self.motion.legs, np.asarray(self.samples.time)
        which = np.maximum(np.searchsorted([leg.motion.t_start for leg in legs], t, "right") - 1, 0)
        some = ((leg, np.flatnonzero(which == i)) for i, leg in enumerate(legs))
        return [self._part(leg, at, t[at]) for leg, at in some if at.size]

    def _part(self, leg: Leg, at: Array, t: Floats) -> LegOutputs:
        """A leg with samples at times [s]."""
        of, chart = self._compiled, leg.chart.mechanism
        mechanism = of if chart.structure is of.structure else chart  # the user's drivers lead
        if mechanism is of or (of.names is None) == (mechanism.names is None):
            names = {x: Source(x) for x in self._plan.want}
        else:
            sources, names = sources_of(of, leg.chart), {}
            for x in self._plan.want:
                head, _, part = x.rpartition(".")
                if x in sources:
                    names[x] = sources[x]
                elif part in PARTS and head in sources:
                    names[x] = sources[head]._replace(name=f"{sources[head].name}.{part}")
        counted = () if leg.counted is None else {of._of_driver(d, "q") for d in of.drivers}
        names = {
            x: source
            for x, source in names.items()
            if source.name in mechanism.outputs and x not in counted
        }
        want = [source.name for source in names.values()]
        want += [mechanism._of_driver(d, "acceleration") for d in mechanism.drivers]
        settings = {key: x for key, x in self.settings.items() if key != "static"}
        arguments = mechanism, leg.motion, t, dict.fromkeys(want)
        result = result_in_chart(*arguments, engine=self._engine, **settings)
        return LegOutputs(of, leg, at, names, result)

    def _make(self, name: str) -> Any:
        kind = self._output(name).kind
        if kind == "number":
            return FREE  # efficiencies, which all are by drives
        values = [np.asarray(part.read(name)) for part in self.parts]
        rest = max((x.shape[1:] for x in values), key=len, default=())
        merged = np.full((self.n, *rest), complex(np.nan, np.nan) if kind == "vector" else np.nan)
        for part, x in zip(self.parts, values, strict=True):
            merged[part.at] = x
        return merged

    @cached_property
    def quality(self) -> Quality:
        """Status of each sample and flags, each by the chart that leads there."""
        status, blame = [""] * self.n, dict[int, str]()
        for part in self.parts:
            quality, at = part.result.quality, part.at.tolist()
            for i, word in zip(at, quality.status, strict=True):
                status[i] = word
            blame |= {at[i]: block for i, block in quality.blame.items()}
        flags = self._flags(lambda result: result.quality.flags)
        return Quality(tuple(status), blame, {}, {}, {}, {}, flags)

    @property
    def _lost_digits(self) -> tuple[Flag, ...]:
        """Those of the legs."""
        return self._flags(lambda result: result._lost_digits)

    def _flags(self, of: Callable[[Any], Iterable[Flag]]) -> tuple[Flag, ...]:
        flags = ((part.at, flag) for part in self.parts for flag in of(part.result))
        return tuple(replace(flag, sample=int(at[flag.sample])) for at, flag in flags)

    def _surely_whole(self) -> bool:
        """A cheap sufficient test that every sample has an answer."""
        return all(part.result._surely_whole() for part in self.parts)

    def _again(self, mechanism: Any, want: Sequence[str], settings: Any = None) -> Any:
        t = np.asarray(self.samples.time)
        return _charted(mechanism, self.motion, t, want, self._engine, settings or self.settings)


def result_along(
    mechanism: Compiled,
    motion: Motion,
    t: Floats,
    want: Iterable[str] | str,
    friction: FrictionMethod | None = None,
    engine: str = "auto",
    chunk: int | None = None,
) -> SimulationResult[Any]:
    """The wanted outputs at times (n,) [s] of a motion, see `motion_outputs.result_in_chart`."""
    if not motion.legs:
        options = friction, engine, chunk
        return result_in_chart(mechanism, motion, t, want, *options)
    return _charted(mechanism, motion, t, want, engine, settings_along(motion, friction) | STATIC)


def _charted(
    mechanism: Compiled, motion: Motion, t: Floats, want: Any, engine: str, settings: Any
) -> ChartedResult[Any]:
    plan = mechanism._plan_for(want, friction_asked(settings["friction"]))
    q, qd = (x.reshape(len(t), -1).T for x in motion.at(t))
    states = {f"q_{i}": x for i, x in enumerate(q)} | {f"qd_{i}": x for i, x in enumerate(qd)}
    return ChartedResult(mechanism, plan, Samples(len(t), states, t), (), engine, settings, motion)
