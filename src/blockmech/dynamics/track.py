"""The track of a path run: panels one after the other, and patterns that repeat."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.motion import State
from blockmech.dynamics.panels import Floats, Panels

AT_ONCE = 1024  # turns, times or steps that are worked on together: a megabyte or two


@dataclass(frozen=True)
class RepeatedSegment:
    """Panels that follow each other again and again from t0 on.

    panels : of one repetition, their times counted from t0
    step : [rad or m] by which the driver advances in one; 0 for swings to and fro
    gain : [J] by which the kinetic energy grows in one
    mirrored : whether every other one runs backwards: a swing and the swing back
    starts : (n + 1,) [s] since t0 of the repetitions, where they do not last equally long
    """

    t0: float
    panels: Panels
    step: float = 0.0
    gain: float = 0.0
    mirrored: bool = False
    starts: Floats | None = None

    @cached_property
    def duration(self) -> float:
        """[s] of the first repetition."""
        return self.panels.t1

    def begins(self, k: int) -> float:
        """Time [s] at which repetition k begins."""
        since = k * self.duration if self.starts is None else float(self.starts[k])
        return self.t0 + since

    def compared(self, other: RepeatedSegment, t_end: float) -> list[Any]:
        """Rows of `_lateness_in` of some repetitions that begin before a time [s]."""
        if self.starts is None or other.starts is None:
            some = {0, max(math.ceil((t_end - self.t0) / self.duration) - 1, 0)}
        else:
            most = min(len(self.starts), len(other.starts)) - 1
            most = min(max(int(np.searchsorted(self.starts, t_end - self.t0)), 1), most)
            apart = np.abs(self.starts[:most] - other.starts[:most])
            some = {0, most - 1, int(apart.argmax())}
        rows: list[Any] = []
        for k in sorted(some):
            columns = _lateness_in(self.repetition(k), other.repetition(k))
            if columns is not None:
                if back := self.mirrored and k % 2 == 1:
                    whole = np.array([self.duration, 0.0, 0.0, other.duration - self.duration])
                    shape = np.array([-1.0, 1.0, -1.0, -1.0])
                    columns = tuple(
                        (whole + (shape * x.T)).T for x in (columns[::-1] if back else columns)
                    )
                begin = self.begins(k)
                shift = np.array([begin, k * self.step, 0.0, other.begins(k) - begin])
                columns = tuple((x.T + shift).T for x in columns)
            rows.append(columns)
        return rows

    def repetition(self, k: int) -> Panels:
        """Its panels, with its energy; times and places as in the first."""
        return self.panels.taken_from(0.0, k * self.gain) if self.gain and k else self.panels

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (m,) at times (m,) [s]."""
        since = t - self.t0
        if self.starts is None:
            k = np.floor(since / self.duration)
            rest = since - k * self.duration
        else:
            k = np.searchsorted(self.starts, since, "right") - 1.0
            k = np.clip(k, 0, self.starts.size - 1)
            rest = since - self.starts[k.astype(int)]
        back = (k % 2 == 1) & self.mirrored
        rest = np.where(back, self.duration - rest, rest)
        panels = self.panels
        if not self.gain:
            q, qd = panels.state(rest)
        else:
            numbers, which = np.unique(k, return_inverse=True)
            durations = panels.durations_with(numbers * self.gain)
            ends = np.cumsum(durations, axis=1)[which]
            i = np.minimum((ends <= rest[:, None]).sum(axis=1), len(panels.w) - 1)
            each = np.arange(rest.size)
            left = ends[each, i] - rest
            since = np.where(panels.spans.backward[i], left, durations[which, i] - left)
            q, qd = panels.state_in(i, since, k * self.gain)
        return q + k * self.step, np.where(back, -qd, qd)

    def taken(self, t: float) -> float:
        """Work [J] that friction has taken in it until a time [s]; none in one that gains."""
        k, rest = divmod(t - self.t0, self.duration)
        return k * self.panels.taken(self.duration) + self.panels.taken(rest)

    def at_way(self, way: float) -> float:
        """Time [s] at which the driver has advanced by so much since t0."""
        k = math.floor(way / self.step)
        q = float(self.panels.spans.begin[0]) + (way - k * self.step)
        return self.begins(k) + float(self.repetition(k).at_places(np.array([q]))[0])

    def durations(self, energies: Floats) -> Floats:
        """Time [s] of a repetition with so much more kinetic energy (m,)."""
        parts = range(0, energies.size, AT_ONCE)
        some = (self.panels.durations_with(energies[k : k + AT_ONCE]).sum(axis=1) for k in parts)
        return np.concatenate([np.empty(0), *some])


Leg: TypeAlias = Panels | RepeatedSegment  # a part of the track


class Lateness(NamedTuple):
    """How much later than a run another passes the places of it, arrays (k,) in order of time.

    t, q, qd : states of the run [s], [rad or m] and rates, from its begin to beyond its end
    late : [s]
    """

    t: Floats
    q: Floats
    qd: Floats
    late: Floats


def lateness(run: Sequence[Leg], other: Sequence[Leg], t_end: float) -> Lateness | None:
    """Of two runs that go the same way until a time [s]; None where they do not.

    Both clocks are read at the nodes of the first, so that no time is inverted. Of what repeats
    the first and the last repetition are compared, and the one that is most apart.
    """
    if not run or list(map(type, run)) != list(map(type, other)):
        return None
    rows: list[Any] = []
    ends = [*(leg.t0 for leg in run[1:]), t_end]
    for leg, same, end in zip(run, other, ends, strict=True):
        if isinstance(leg, RepeatedSegment) and isinstance(same, RepeatedSegment):
            pairs = leg.compared(same, end)
        else:
            pairs = [_lateness_in(leg, same)]  # type: ignore[arg-type]
        if any(pair is None for pair in pairs):
            return None
        rows += pairs
    first, last = (np.reshape(x, (4, -1)) for x in (rows[0][0], rows[-1][2]))
    t, q, qd, late = np.concatenate([first, *(x[1] for x in rows), last], axis=1)
    order = np.argsort(t, kind="stable")
    order = order[: np.searchsorted(t[order], t_end) + 1]
    return Lateness(t[order], q[order], qd[order], late[order])


def _lateness_in(one: Panels, other: Panels) -> tuple[Any, Any, Any] | None:
    """Columns t, q, qd, late of `Lateness`: at the begin, the nodes (4, k) and the end."""
    parts, others = one.one_way(), other.one_way()
    if len(parts) != len(others):
        return None
    t, q, qd = one.known_states()
    passed = [
        other.at_places(q[some].ravel(), there) for some, there in zip(parts, others, strict=True)
    ]
    rows = np.array([t, q, qd, np.concatenate(passed).reshape(t.shape) - t])
    begin, end = (-x.astype(int) for x in one.spans.backward[[0, -1]])
    return rows[:, 0, begin], rows[:, :, 1:-1].reshape(4, -1), rows[:, -1, -1 - end]


@dataclass(frozen=True)
class PathTrack:
    """Dense output of a path run, from t_start [s] on."""

    legs: tuple[Leg, ...]
    t_start: float = 0.0
    _kept: list[Floats] = field(default_factory=list, repr=False, compare=False)

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]; the last answer is kept, as runs are compared where they end."""
        if not (self._kept and np.array_equal(t, self._kept[0])):
            self._kept[:] = t.copy(), *self._state(t)
        _, q, qd = self._kept
        return State(q.copy(), qd.copy())

    def _state(self, t: Floats) -> State:
        since = t - self.t_start
        which = np.searchsorted([leg.t0 for leg in self.legs[1:]], since, "right")
        q, qd = np.empty_like(since), np.empty_like(since)
        for i in set(which.tolist()):
            here = np.flatnonzero(which == i)
            for k in range(0, here.size, AT_ONCE):
                some = here[k : k + AT_ONCE]
                q[some], qd[some] = self.legs[i].state(since[some])
        return State(q, qd)
