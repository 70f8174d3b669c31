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
    known : repetitions with their energies, the last one or two that were asked for
    """

    t0: float
    panels: Panels
    step: float = 0.0
    gain: float = 0.0
    mirrored: bool = False
    starts: Floats | None = None
    known: dict[int, Panels] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def duration(self) -> float:
        """[s] of the first repetition."""
        return self.panels.t1

    def begins(self, k: int) -> float:
        """Time [s] at which repetition k begins."""
        since = k * self.duration if self.starts is None else float(self.starts[k])
        return self.t0 + since

    def compared_in(self, other: RepeatedSegment, t_end: float) -> list[int]:
        """Repetitions that begin before a time [s] and are compared: ends, and the worst."""
        if self.starts is None or other.starts is None:
            return sorted({0, max(math.ceil((t_end - self.t0) / self.duration) - 1, 0)})
        most = min(max(int(np.searchsorted(self.starts, t_end - self.t0)), 1), len(self.starts))
        worst = int(np.abs(self.starts[:most] - other.starts[:most]).argmax())
        return sorted({0, most - 1, worst})

    def beside(self, other: RepeatedSegment, t_end: float) -> list[Any]:
        """Rows of `_beside` of repetitions that are compared."""
        rows: list[Any] = []
        alike = None if self.gain or other.gain else _beside(self.panels, other.panels)
        for k in self.compared_in(other, t_end):
            apart = _beside(self.repetition(k), other.repetition(k)) if alike is None else alike
            row = apart.copy()
            if self.mirrored and k % 2:
                row[0], row[3] = self.duration - row[0], other.duration - self.duration - row[3]
                row[2] *= -1
            begin = self.begins(k)
            row[0] += begin
            row[1] += k * self.step
            row[3] += other.begins(k) - begin
            rows.append(row)
        return rows

    def repetition(self, k: int) -> Panels:
        """Its panels, with its energy; times and places as in the first."""
        if not (self.gain and k):
            return self.panels
        if k not in self.known:
            self.known.clear()
            self.known[k] = self.panels.taken_from(0.0, k * self.gain)
        return self.known[k]

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
        if not self.gain or (k == k[0]).all():
            q, qd = self.repetition(int(k[0])).state(rest)
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
        return self.begins(k) + self.repetition(k).at_place(q)

    def durations(self, energies: Floats) -> Floats:
        """Time [s] of a repetition with so much more kinetic energy (m,)."""
        parts = range(0, energies.size, AT_ONCE)
        some = (self.panels.lasting(energies[k : k + AT_ONCE]) for k in parts)
        return np.concatenate([np.empty(0), *some])


Leg: TypeAlias = Panels | RepeatedSegment  # a part of the track


class Lateness(NamedTuple):
    """How another run goes beside one, arrays (k,) in order of time.

    t, q, qd : states of the one [s], [rad or m] and rates, from its begin to beyond its end
    late, off : [s], [rad or m] by which the other is later there, and elsewhere
    """

    t: Floats
    q: Floats
    qd: Floats
    late: Floats
    off: Floats


def lateness(run: Sequence[Leg], other: Sequence[Leg], t_end: float) -> Lateness:
    """Of two runs over the same panels until a time [s].

    Both are read at the nodes, so that no time is inverted. Of what repeats the first and the
    last repetition count, and the one that is most apart.
    """
    rows: list[Any] = []
    for leg, same, end in zip(run, other, [*(x.t0 for x in run[1:]), t_end], strict=True):
        if isinstance(leg, RepeatedSegment):
            rows += leg.beside(same, end)  # type: ignore[arg-type]
        else:
            rows.append(_beside(leg, same))  # type: ignore[arg-type]
    columns = np.concatenate(rows, axis=1) if len(rows) > 1 else rows[0]
    columns = columns.take(np.argsort(columns[0], kind="stable"), axis=1)
    return Lateness(*columns[:, : int(np.searchsorted(columns[0], t_end)) + 1])


def _beside(one: Panels, other: Panels) -> Floats:
    """Columns (5, k) of `Lateness`."""
    t, q = one.known_times, one.known_places
    late, off = other.known_times - t, other.known_places - q
    return np.array([t, q, one.known_rates, late, off]).reshape(5, -1)


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
        if since.size == 1:
            return State(*self.legs[int(which[0])].state(since))
        q, qd = np.empty_like(since), np.empty_like(since)
        for i in set(which.tolist()):
            here = np.flatnonzero(which == i)
            for k in range(0, here.size, AT_ONCE):
                some = here[k : k + AT_ONCE]
                q[some], qd[some] = self.legs[i].state(since[some])
        return State(q, qd)
