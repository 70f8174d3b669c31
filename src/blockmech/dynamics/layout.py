"""Where what stands in the state y of an integration in time: one place that knows the order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from blockmech.result.motion import Event, Impact, Motion, State, Track
from blockmech.typing import Floats, Real

if TYPE_CHECKING:
    from blockmech.dynamics.roles import Roles
    from blockmech.engines.dense import Dense


@dataclass(frozen=True)
class StateLayout:
    """The parts of a state y = (q, q', W[, F][, D][, x]) as named slices.

    Coordinates and rates of the drivers come first, so that a state begins with those of the
    mechanism whatever else is integrated beside them.

    Attributes
    ----------
    drivers : number k of drivers
    rubs : whether the work F that joint friction takes stands there
    driven : whether the work D stands there that drives do which hold or prescribe
    initial : states x of signal blocks and friction laws where the motion starts

    >>> layout = StateLayout(drivers=2, rubs=False)
    >>> layout.rate, layout.work, layout.size
    (slice(2, 4, None), 4, 5)
    """

    drivers: int
    rubs: bool = False
    initial: tuple[float, ...] = ()
    driven: bool = False

    @cached_property
    def scalar(self) -> bool:
        """Whether coordinates are numbers: of one driver that is free at all times."""
        return self.drivers == 1 and not self.driven

    @cached_property
    def q(self) -> slice:
        """Coordinates [rad or m]."""
        return slice(0, self.drivers)

    @cached_property
    def rate(self) -> slice:
        """Their rates [rad/s or m/s]."""
        return slice(self.drivers, 2 * self.drivers)

    @property
    def work(self) -> int:
        """Work W of the loads [J], behind the 2k coordinates and rates."""
        return 2 * self.drivers

    @cached_property
    def works(self) -> slice:
        """All works."""
        return slice(self.work, self.work + 1 + self.rubs + self.driven)

    @cached_property
    def signals(self) -> slice:
        """States of signal blocks and of friction laws, in the order of `Structure.states`."""
        return slice(self.works.stop, self.size)

    @property
    def size(self) -> int:
        """Number of components."""
        return self.work + 1 + self.rubs + self.driven + len(self.initial)

    def start(self, q: Real, rate: Real) -> Floats:
        """The state (size,) from which a motion begins: no work is done yet."""
        y = np.zeros(self.size)
        y[self.q], y[self.rate], y[self.signals] = q, rate, self.initial
        return y

    def states(self, y: Floats) -> Floats | None:
        """States of signal blocks and of laws, None where there are none."""
        return y[self.signals] if self.initial else None

    def motion(self, y: Real) -> tuple[Real, Real]:
        """Coordinates and rates of a state: numbers if it is scalar, else arrays (k,)."""
        if self.scalar:
            return float(y[0]), float(y[1])
        return y[self.q], y[self.rate]


@dataclass(frozen=True)
class NumberTrack:
    """States of the only driver as numbers, of a track that has them as arrays."""

    track: Track

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        return State(*(x[..., 0] for x in self.track.state(t)))

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        states: Floats = self.track.signal_states(t)  # type: ignore[attr-defined]
        return states


def in_numbers(motion: Motion) -> Motion:
    """A motion of one driver, whose states are arrays where that has a role, by numbers."""
    events = (Event(e.kind, e.t, *(float(x[0]) for x in e[2:])) for e in motion.events)
    q, qd = (float(x[0]) for x in (motion.q_end, motion.qd_end))
    return motion.but(q_end=q, qd_end=qd, events=tuple(events), track=NumberTrack(motion.track))


def until(motion: Motion, t: float) -> Motion:
    """A motion up to a time [s]."""
    q, qd = (x[0] if x.ndim > 1 else float(x[0]) for x in motion.at(np.array([t])))
    return motion.but(
        t_end=t,
        q_end=q,
        qd_end=qd,
        x_end=tuple(motion.signal_states(np.array([t]))[0].tolist()),
        end="time",
        time_error=0.0,
        events=tuple(e for e in motion.events if e.t <= t),
    )


@dataclass(frozen=True)
class TimeTrack:
    """States at any time of a run, from dense output that joins its steps."""

    layout: StateLayout
    dense: Dense
    roles: tuple[tuple[float, Roles], ...] = ()  # from times [s] on
    jolts: tuple[Impact, ...] = ()
    standstills: tuple[float, ...] = ()  # [s] of the only driver

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]; of drivers with a law as that says, and after jolts."""
        y, at = self.dense(t), self.layout
        if at.scalar:
            still = np.isin(t, self.standstills) if self.standstills else False
            return State(y[0], np.where(still, 0.0, y[1]))
        q, rate = y[at.q].T, y[at.rate].T
        if self.roles:
            which = np.searchsorted([begin for begin, _ in self.roles], t, "right") - 1
            for i, (_, roles) in enumerate(self.roles):
                some = np.maximum(which, 0) == i
                q[some], rate[some] = roles.motion(q[some], rate[some], t[some])
            for jolt in self.jolts:
                rate[t == jolt.t] = jolt.after
        return State(q, rate)

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        return self.dense(t)[self.layout.signals].T
