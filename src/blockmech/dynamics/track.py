"""The track of a path run: panels one after the other, and patterns that repeat."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.compiled_path import PathCode
from blockmech.dynamics.estimate import ROUNDING
from blockmech.dynamics.panel_nodes import AT_ONCE
from blockmech.dynamics.panels import Panels
from blockmech.dynamics.path_loops import HIGHEST, LOWEST, STEP
from blockmech.result.motion import State
from blockmech.typing import Floats

FEW = 3  # times that are not kept, and turns that are looked at first


@dataclass(frozen=True)
class RepeatedSegment:
    """Panels that follow each other again and again from t0 on.

    panels : of one repetition, their times counted from t0
    step : [rad or m] by which the driver advances in one; 0 for swings to and fro
    gain : [J] by which the kinetic energy grows in one
    mirrored : whether every other one runs backwards: a swing and the swing back
    starts : (n + 1,) [s] since t0 of the repetitions, where they do not last equally long
    cache : repetitions with their energies, the last one or two that were asked for
    """

    t0: float
    panels: Panels
    step: float = 0.0
    gain: float = 0.0
    mirrored: bool = False
    starts: Floats | None = None
    cache: dict[int, Panels] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def duration(self) -> float:
        """[s] of the first repetition."""
        return self.panels.t1

    def begins(self, k: int) -> float:
        """Time [s] at which repetition k begins."""
        since = k * self.duration if self.starts is None else float(self.starts[k])
        return self.t0 + since

    def compared_in(self, second: RepeatedSegment, t_end: float) -> list[int]:
        """Repetitions that begin before a time [s] and are compared: ends, and the worst."""
        if self.starts is None or second.starts is None:
            return sorted({0, max(math.ceil((t_end - self.t0) / self.duration) - 1, 0)})
        count = min(max(int(np.searchsorted(self.starts, t_end - self.t0)), 1), len(self.starts))
        worst = int(np.abs(self.starts[:count] - second.starts[:count]).argmax())
        return sorted({0, count - 1, worst})

    def repetition(self, k: int) -> Panels:
        """Its panels, with its energy; times and places as in the first."""
        if not (self.gain and k):
            return self.panels
        if k not in self.cache:
            self.cache.clear()
            self.cache[k] = self.panels.started_at(0.0, k * self.gain)
        return self.cache[k]

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
            ends, indices = np.cumsum(durations, axis=1)[which], np.arange(rest.size)
            i = np.minimum((ends <= rest[:, None]).sum(axis=1), durations.shape[1] - 1)
            remaining = ends[indices, i] - rest
            since = np.where(panels.backward[i], remaining, durations[which, i] - remaining)
            q, qd = panels.some(i, k * self.gain).state_in(indices, since)
        return q + k * self.step, np.where(back, -qd, qd)

    def time_at_travel(self, travel: float) -> float:
        """Time [s] at which the driver has advanced by so much since t0."""
        k = math.floor(travel / self.step)
        q = self.panels.begin + (travel - k * self.step)
        return self.begins(k) + self.repetition(k).at_place(q)

    def durations(self, energies: Floats) -> Floats:
        """Time [s] of a repetition with so much more kinetic energy (m,)."""
        parts = range(0, energies.size, AT_ONCE)
        some = (self.panels.durations_with(energies[k : k + AT_ONCE]).sum(axis=1) for k in parts)
        return np.concatenate([np.empty(0), *some])


Leg: TypeAlias = Panels | RepeatedSegment  # a part of the track


def second_run(run: Sequence[Leg]) -> list[Leg]:
    """The run beside one, over the same panels and patterns."""
    legs, t = list[Leg](), 0.0
    for leg, following in zip(run, [*run[1:], None], strict=True):
        if isinstance(leg, Panels):
            panels = leg.second.started_at(t)
            legs.append(panels)
            t = panels.t1
            continue
        panels = leg.panels.second.started_at(0.0)
        segment = replace(leg, t0=t, panels=panels, gain=panels.gain if leg.gain else 0.0, cache={})
        if leg.starts is not None:
            energies = np.arange(len(leg.starts) - 1) * np.float64(segment.gain)
            starts = np.append(0.0, np.cumsum(segment.durations(energies)))
            segment = replace(segment, starts=starts)
        legs.append(segment)
        if isinstance(following, Panels):
            t = segment.begins(round((following.begin - leg.panels.begin) / leg.step))
    return legs


def compared(
    run: Sequence[Leg], second: Sequence[Leg], t_end: float
) -> Iterator[tuple[Panels, Panels, int, float, float, float]]:
    """Panels of two runs over the same ones, until a time [s] since their start, in its order.

    With them -1 where they run backwards, else 1; when both begin [s], or end where they run
    backwards, beside their own times; and what is added to places. Of what repeats the first and
    the last repetition count, and the one that is most apart.
    """
    for leg, second_leg, end in zip(run, second, [*(x.t0 for x in run[1:]), t_end], strict=True):
        if isinstance(leg, Panels) or isinstance(second_leg, Panels):
            yield leg, second_leg, 1, 0.0, 0.0, 0.0  # type: ignore[misc]
            continue
        for k in leg.compared_in(second_leg, end):
            back = leg.mirrored and k % 2
            begins = leg.begins(k + back), second_leg.begins(k + back)
            yield leg.repetition(k), second_leg.repetition(k), 1 - 2 * back, *begins, k * leg.step


class Apart(NamedTuple):
    """How far another run is from one over the same panels.

    q, rounding : [rad or m] how far, and how far rounding may take both, at most
    low, high, fastest : places between which it goes, and the largest rate
    t, late : [s] the last time that counts, and by how much the other is later there
    unsure : whether rates change so fast that rounding is to be judged otherwise
    """

    q: float
    rounding: float
    low: float
    high: float
    fastest: float
    t: float
    late: float
    unsure: float


def apart(
    code: PathCode,
    run: Sequence[Leg],
    second: Sequence[Leg],
    t_start: float,
    t_end: float,
    share: float,
) -> Apart:
    """How far apart two runs over the same panels are, from one time [s] to another.

    ``share``: what rounding leaves unknown of times, relative.
    """
    at = np.array([0.0, 0.0, 0.0, t_end, t_start, share, ROUNDING])
    totals = np.zeros(len(Apart._fields))
    totals[LOWEST], totals[HIGHEST] = math.inf, -math.inf
    for panels, second_panels, sign, begin, second_begin, step in compared(
        run, second, t_end - t_start
    ):
        time, late = begin + sign * panels.before, second_begin + sign * second_panels.before
        at[: STEP + 1] = t_start + time, t_start + late, step
        many, back = len(panels.records), int(sign < 0)
        code.compare(panels.records, second_panels.records, many, back, at, totals)
    return Apart(*totals.tolist())


@dataclass(frozen=True)
class PathTrack:
    """Dense output of a path run, from t_start [s] on."""

    legs: tuple[Leg, ...]
    t_start: float = 0.0
    _cache: list[Floats] = field(default_factory=list, repr=False, compare=False)

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]; that at many is kept, as runs are compared where they end."""
        if t.size <= FEW:
            return self._state(t)
        if not (self._cache and np.array_equal(t, self._cache[0])):
            self._cache[:] = t.copy(), *self._state(t)
        _, q, qd = self._cache
        return State(q.copy(), qd.copy())

    def _state(self, t: Floats) -> State:
        since, begins = t - self.t_start, [leg.t0 for leg in self.legs[1:]]
        which = np.searchsorted(begins, since, "right")
        q, qd = np.empty_like(since), np.empty_like(since)
        for i in set(which.tolist()):
            indices = np.flatnonzero(which == i)
            for k in range(0, indices.size, AT_ONCE):
                some = indices[k : k + AT_ONCE]
                q[some], qd[some] = self.legs[i].state(since[some])
        return State(q, qd)
