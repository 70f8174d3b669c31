"""The track of a path run: panels one after the other, and patterns that repeat."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from blockmech.dynamics.motion import State
from blockmech.dynamics.panels import Floats, P, Panels, joined, rule

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
        if self.gain:  # those that are asked for, one after the other
            asked, which = np.unique(k, return_inverse=True)
            panels = joined([self.repetition(int(index)) for index in asked])
            rest = rest + panels.times[:: len(self.panels.w)][which]
        q, qd = panels.state(rest)
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
        total = np.zeros(energies.shape)
        x, r = self.panels, rule(self.panels.w.shape[1])
        kind, way = x.spans.kind, np.abs(x.spans.way)[:, None]
        weights = r.average[-1] * r.powers[kind] * P[kind][:, None] * way * np.sqrt(x.J / 2)
        for first in range(0, energies.size, AT_ONCE):
            part = slice(first, first + AT_ONCE)
            for K, weight in zip(x.K[:, :-1], weights, strict=True):
                total[part] += (1 / np.sqrt(K + energies[part, None])) @ weight
        return total


Leg: TypeAlias = Panels | RepeatedSegment  # a part of the track


@dataclass(frozen=True)
class PathTrack:
    """Dense output of a path run, from t_start [s] on."""

    legs: tuple[Leg, ...]
    t_start: float = 0.0

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        since = t - self.t_start
        which = np.searchsorted([leg.t0 for leg in self.legs[1:]], since, "right")
        q, qd = np.empty_like(since), np.empty_like(since)
        for i in set(which.tolist()):
            here = np.flatnonzero(which == i)
            for k in range(0, here.size, AT_ONCE):
                some = here[k : k + AT_ONCE]
                q[some], qd[some] = self.legs[i].state(since[some])
        return State(q, qd)
