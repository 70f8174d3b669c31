"""What a simulation answers: a motion, how it was found and how good it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import listed
from blockmech.ground.plane import EPS
from blockmech.ground.report import Facts, Report, as_json
from blockmech.typing import Array, Data, Floats, Real

Status: TypeAlias = Literal["reached", "ended", "rest", "unfinished", "failed"]

FACT_UNITS: Mapping[str, str] = {
    "swing_time": "s",
    "period": "s",
    "work_per_period": "J",
    "friction_work": "J",
    "period_of_loads": "rad",
    "mean_speed": "{q}/s",
    "frequency": "rad/s",
    "decay_rate": "1/s",
    "rate": "1/s",
    "dead_centre_time": "s",
    "no_inertia_time": "s",
    "time_step": "s",
    "coordinate_step": "{q}",
    "holding_low": "{effort}",
    "holding_high": "{effort}",
    "impact_loss": "J",
    "drive_work": "J",
    "rest_time": "s",
    "contact": "{effort}",
}
"""Units of the facts that have one; ``{q}`` for that of the driver's coordinate."""
CYCLES = 6  # up to which a curve of a motion has no more times than usual
ANGLE = "_angle"  # what the names of facts end with that are angles [rad]


class Cost(NamedTuple):
    """What a run cost in kernel evaluations."""

    samples: int = 0  # samples in batches
    calls: int = 0  # batch calls
    singles: int = 0  # single states
    states: int = 0  # that integrators asked for, whether kernels or kept series answered

    @property
    def evaluations(self) -> int:
        """Samples and single states together."""
        return self.samples + self.singles


class State(NamedTuple):
    """Driver coordinate [rad or m] and rate: arrays (m,), or (m, k) with k drivers."""

    q: Floats
    qd: Floats


class Event(NamedTuple):
    """Something that happened: kind, time [s], driver coordinate and rate there."""

    kind: str
    t: float
    q: Real  # float, or array (k,) with several drivers
    qd: Real


class Impact(NamedTuple):
    """An impact on an end stop, or of a drive where a change of roles makes rates jump.

    t, q : time [s], coordinates (k,) of all drivers
    driver : name of the driver, or of the pair's coordinate, whose stop or drive acts
    before, after : rates (k,) of all drivers
    impulse : of the stop along its coordinate [N m s or N s]; for a summed sequence of bounces the
        total
    loss : kinetic energy lost [J], to joint friction included
    pushes : impulses of all stops in this impact, including those in contact before, and of the
        drives of drivers that are not free
    friction : impulses of joint friction along the coordinates of the pairs, on the later link
    """

    t: float
    driver: str
    q: Floats
    before: Floats
    after: Floats
    impulse: float
    loss: float
    pushes: Mapping[str, float] = {}
    friction: Mapping[str, float] = {}


class Slips(NamedTuple):
    """From a time [s] on: how each pair with friction slips, by its number.

    sides : +1 with its coordinate, -1 against it, 0 where it sticks
    """

    begin: float
    sides: tuple[int, ...]


class RolesFrom(NamedTuple):
    """From a time [s] on: driver -> "free", "prescribed" by its law of motion, or "locked"."""

    begin: float
    of: Mapping[str, str]


class Lying(NamedTuple):
    """A contact with an end stop of a driver or of a pair's coordinate.

    begin, end : [s]
    push : contact force at the beginning, along the coordinate [N m or N]
    pair : the pair of the coordinate, and +1 or -1, its sense; None for a driver
    """

    stop: str
    begin: float
    end: float
    push: float = 0.0
    pair: tuple[Any, int] | None = None


class Track(Protocol):
    """Dense output: the state at any time of the run."""

    def state(self, t: Floats) -> State:
        """State at times (m,) [s], in arrays of its own."""
        ...


def fact_unit(name: str, coordinate: str) -> str:
    """Unit of a fact or figure, "" where dimensionless; ``coordinate`` is the driver's unit."""
    unit = "rad" if name.endswith(ANGLE) else FACT_UNITS.get(name, "")
    effort = {"rad": "N m", "m": "N"}.get(coordinate, "N m or N")
    return unit.format(q=coordinate, effort=effort)


@dataclass(frozen=True, repr=False)
class Motion(Facts, Report):
    """The motion of the drivers from the start to its end.

    Attributes
    ----------
    method, why : the method, and the reason for it
    regime : "libration", "rotation", "run-up", "run-down", "rest", ...
    status : "reached": the goal; "ended": before the goal, for the reason ``end``; "rest": nothing
        moves; "unfinished": budget exhausted or interrupted; "failed": no (further) motion could
        be computed
    end : the named reason: "time", "standstill", "end stop", "dead centre", "no inertia",
        "impossible pose", "undefined load", "interrupted", "budget", ...
    t_start, t_end : [s]
    q_end, qd_end : state at the end; floats, or arrays (k,) with k drivers
    track : dense output
    events : standstills and the user's events, in order
    impacts : impacts on end stops, in order
    lying : intervals of contact with end stops
    slips : with joint friction, the sticking and slipping pairs from each time on
    roles : role of each driver from each time on; empty if all are always free
    charts : joints whose coordinates describe the motion, from each time [s] on: the drivers', or
        others near dead centres of the drivers
    legs : its segment in each of several charts, in the coordinates of that chart
    error : estimated bound of the error of q over the run [rad or m]
    time_error : the same of ``t_end`` [s], where an event and not a time ends the run
    accuracy : target of ``error``, None without one
    reached : whether ``error`` is within the target
    cost : kernel evaluations
    engine : of single states, "scalar" or "llvm" in the end; along the path "numpy", or "llvm"
        where both runs went by machine code
    x_end, switched : states of signal blocks and friction laws at the end, and the last instant
        [s] at which discrete blocks switched
    notes : remarks for the reader: doubts, targets missed, limits
    facts : further numbers by name (period, work of a period, multiplier ...), see `fact_unit`
    unit : of the coordinates, as far as it is one
    """

    FACTS = (
        *("method", "why", "regime", "status", "end", "error", "time_error"),
        *("accuracy", "reached", "notes"),
    )

    method: str
    why: str
    t_start: float
    t_end: float
    q_end: Real
    qd_end: Real
    track: Track
    accuracy: float | None
    regime: str = "none"
    status: Status = "reached"
    end: str = "time"
    events: tuple[Event, ...] = ()
    impacts: tuple[Impact, ...] = ()
    lying: tuple[Lying, ...] = ()
    slips: tuple[Slips, ...] = ()
    roles: tuple[RolesFrom, ...] = ()
    charts: tuple[tuple[float, tuple[str, ...]], ...] = ()
    legs: tuple[Any, ...] = ()
    error: float = 0.0
    time_error: float = 0.0
    cost: Cost = field(default_factory=Cost)
    engine: str = "numpy"
    x_end: tuple[float, ...] = ()
    switched: float = math.nan
    notes: tuple[str, ...] = ()
    facts: Mapping[str, float] = field(default_factory=dict)
    unit: str = "rad or m"

    @property
    def reached(self) -> bool:
        """Whether the error estimate is within the target (True if there is none)."""
        return self.accuracy is None or self.error <= self.accuracy

    def but(self, **changes: Any) -> Motion:
        """A copy with some fields changed, ten times faster than `replace`."""
        motion = object.__new__(Motion)
        motion.__dict__.update(self.__dict__, **changes)
        return motion

    def reached_times(self, requested: Floats | Sequence[float]) -> Floats:
        """Requested times (n,) [s]; NaN outside the run.

        A time within rounding of the end is the end.
        """
        times = np.asarray(requested, dtype=np.float64)
        ending = np.abs(times - self.t_end) <= 64 * EPS * abs(self.t_end)
        inside = ending | ((times >= self.t_start) & (times <= self.t_end))
        return np.where(ending, self.t_end, np.where(inside, times, np.nan))

    def lines(self) -> list[str]:
        """End, method, error, figures and notes, one per line."""
        return [*self.summary(), *(f"note: {text}" for text in self.notes)]

    def to_dict(self) -> Data:
        """The motion as a JSON object."""
        end = {"end_time": self.t_end, "evaluations": self.cost.evaluations}
        return {**super().to_dict(), **as_json({**end, "facts": self.figures()})}

    def summary(self) -> list[str]:
        """Lines about its end, method, error and figures."""
        at_rest = self.status != "failed" and not np.any(self.qd_end)
        coordinates = listed(f"{q:.9g}" for q in np.atleast_1d(self.q_end))
        rest = f", at rest at {coordinates} {self.unit}" if at_rest else ""
        lines = [f"{self.status}: {self.end}, after {self.t_end:.12g} s{rest}".rstrip()]
        for begin, of in self.roles:
            since = f" from {begin:.6g} s on" if begin > self.t_start else ""
            lines.append(f"roles{since}: " + listed(f"{d} {role}" for d, role in of.items()))
        why = f" ({self.why})" if self.why else ""
        by = " by machine code" if self.engine == "llvm" else ""
        if len(self.charts) > 1:
            leads = (f"{listed(joints)} from {t:.6g} s on" for t, joints in self.charts)
            lines.append(f"joints that lead: {listed(leads)}")
        cost = f"{self.cost.evaluations} kernel evaluations{by}"
        lines.append(f"method {self.method}{why}, {cost}")
        if math.isfinite(self.error):
            clock = f", {self.time_error:.1e} s at the end" if self.time_error > 0 else ""
            lines.append(f"estimated error {self.error:.1e} {self.unit}{clock}")
        for name, x in self.figures().items():
            line = f"{name.replace('_', ' ')} {x:.12g} {fact_unit(name, self.unit)}"
            lines.append(line.rstrip())
        return lines

    def at(self, t: Real) -> State:
        """State at times t [s], of any shape; NaN outside the run."""
        times = np.asarray(t, dtype=np.float64)
        flat = times.ravel()
        last = flat == self.t_end  # where it is known exactly
        if np.count_nonzero(last) == flat.size > 0:
            return Still(self.q_end, self.qd_end).state(times)
        inside = (flat >= self.t_start) & (flat <= self.t_end)
        all_inside = np.count_nonzero(inside) == flat.size
        q, qd = self.track.state(flat if all_inside else np.where(inside, flat, self.t_start))
        q[last], qd[last] = self.q_end, self.qd_end
        if not all_inside:
            q[~inside] = qd[~inside] = np.nan
        shape = times.shape + q.shape[1:]
        return State(q.reshape(shape), qd.reshape(shape))

    def signal_states(self, t: Floats) -> Floats:
        """States (n, m) of signal blocks and friction laws at times (n,) [s] of the run.

        They are in the order of `Structure.states`; at an instant of a discrete block they
        are those before it.
        """
        if not self.x_end:
            return np.empty((*t.shape, 0))
        end = np.tile(np.array(self.x_end, dtype=np.float64), (*t.shape, 1))
        if (states := getattr(self.track, "signal_states", None)) is None:
            return end
        return np.where((t == self.t_end)[:, None], end, states(t))

    def sides(self, t: Floats) -> Floats:
        """Sense of slip (n, m) of each pair with friction at times (n,) [s]; see `slips`.

        NaN (n, 1) where it is unknown.
        """
        if not self.slips:
            return np.full((len(t), 1), np.nan)
        begins = [s.begin for s in self.slips]
        which = np.maximum(np.searchsorted(begins, t, "right") - 1, 0)
        return np.array([s.sides for s in self.slips])[which]

    def held(self, t: Floats, stops: Sequence[str]) -> Array:
        """Whether it is in contact with some stops at times (n,) [s]; (n, stops)."""
        in_contact = np.zeros((len(t), len(stops)), dtype=bool)
        for lain in self.lying:
            while_lying = (lain.begin <= t) & (
                (t < lain.end) | ((t == lain.end) & (lain.end == self.t_end))
            )
            in_contact[:, stops.index(lain.stop)] |= while_lying
        return in_contact

    def role_at(self, t: Floats) -> Array:
        """Role (n, k) of each driver at times (n,) [s]; see `roles`."""
        which = np.maximum(np.searchsorted([r.begin for r in self.roles], t, "right") - 1, 0)
        return np.array([[*r.of.values()] for r in self.roles])[which]

    def times(self, count: int) -> Floats:
        """That many times, equally spaced over the run [s]."""
        return np.linspace(self.t_start, self.t_end, count)

    def cycles(self, count: int) -> float:
        """Turns, or swings to and fro, of the driver that has most, as that many times tell."""
        q, qd = self.at(self.times(count))
        swings = np.count_nonzero(np.diff(np.sign(qd), axis=0), axis=0) / 2
        return float(np.max([np.abs(q[-1] - q[0]) / math.tau, swings]))

    def curve_times(self, count: int) -> Floats:
        """Times of a curve [s]: that many, equally spaced, with the corners between them.

        Times between these come in where the run has more than `CYCLES`, up to ``count`` of them.
        Corners are events, impacts and reversals of slip, the latter two also just before. One
        within a tenth of the spacing behind another is left out: bounces may pile up.
        """
        finer = max(1, math.ceil(min(self.cycles(count), count) / CYCLES))
        even = self.times((count - 1) * finer + 1)
        spacing = (self.t_end - self.t_start) / max(len(even) - 1, 1)
        leads = {event.t: 0.0 for event in self.events}
        leads |= {slips.begin: spacing / 1000 for slips in self.slips}  # there pairs still slip
        leads |= {impact.t: math.ulp(impact.t) for impact in self.impacts}
        corners = sorted(leads)
        corners = [t for s, t in pairwise([-math.inf, *corners]) if t - s > spacing / 10]
        corners += [t - leads[t] for t in corners]
        return np.union1d(even, np.clip(corners, self.t_start, self.t_end)) if corners else even

    def fluctuation(self, start: float, end: float) -> float:
        """Fluctuation of the speed between two times [s]: (w_max - w_min) / w_mean [-].

        The coefficient of fluctuation for sizing flywheels, of one driver; infinite if the driver
        does not advance.
        """
        t = np.linspace(start, end, SCANNED + 1)
        q, qd = self.track.state(t)
        advance = abs(float(q[-1] - q[0]))
        if advance == 0:
            return math.inf
        span = self._highest(t, qd, 1) + self._highest(t, qd, -1)
        return span * (end - start) / advance

    def figures(self) -> dict[str, float]:
        """`facts`, and of a rotation that repeats the fluctuation of its speed."""
        figures = dict(self.facts)
        if "mean_speed" in figures and np.ndim(self.q_end) == 0:
            end = self.t_start + figures["period"]
            figures["fluctuation"] = self.fluctuation(self.t_start, end)
        return figures

    def _highest(self, t: Floats, qd: Floats, sign: int) -> float:
        """The largest ``sign * qd``: the largest sample, or what lies beside it."""
        from scipy.optimize import minimize_scalar

        highest = float((sign * qd).max())
        for i in np.argsort(sign * qd)[-2:].tolist():  # both ends of a period may be the largest
            bracket = float(t[max(i - 1, 0)]), float(t[min(i + 1, t.size - 1)])
            best = minimize_scalar(
                lambda x: -sign * float(self.track.state(np.array([x])).qd[0]),
                bounds=bracket,
                method="bounded",
            )
            highest = max(highest, -float(best.fun))
        return highest


@dataclass(frozen=True)
class Still:
    """Dense output of a mechanism that does not move, or of one state only."""

    q: Real
    qd: Real = 0.0

    def state(self, t: Floats) -> State:
        """The same state at all times."""
        shape = t.shape + np.shape(self.q)
        return State(*(np.full(shape, x, dtype=np.float64) for x in (self.q, self.qd)))
