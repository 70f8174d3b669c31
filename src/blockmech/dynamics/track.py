"""The track of a path run: panels one after the other, and patterns that repeat."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from blockmech.dynamics.motion import State, Still
from blockmech.dynamics.panels import Floats, Panel, rule

TURNS_AT_ONCE = 4096  # of which the times are summed together: some megabytes


class Leg(Protocol):
    """A part of the track: it begins at t0 [s]."""

    @property
    def t0(self) -> float:
        """When it begins [s]."""
        ...

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (m,) at times (m,) [s]."""
        ...


@dataclass(frozen=True)
class Standing:
    """A driver that stays where it is from t0 on."""

    t0: float
    q: float

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """The same state at all times."""
        found = Still(self.q).state(t)
        return found.q, found.qd


@dataclass(frozen=True)
class Pattern:
    """Panels that follow each other again and again from t0 on.

    panels : of one repetition, their times counted from t0
    step : [rad or m] by which the driver advances in one; 0 for swings to and fro
    gain : [J] by which the kinetic energy grows in one
    mirrored : whether every other one runs backwards: a swing and the swing back
    starts : (n + 1,) [s] since t0 of the repetitions, where they do not last equally long
    """

    t0: float
    panels: tuple[Panel, ...]
    step: float = 0.0
    gain: float = 0.0
    mirrored: bool = False
    starts: Floats | None = None

    @cached_property
    def duration(self) -> float:
        """[s] of the first repetition."""
        return self.panels[-1].t1

    def begins(self, k: int) -> float:
        """Time [s] at which repetition k begins."""
        since = k * self.duration if self.starts is None else float(self.starts[k])
        return self.t0 + since

    def repetition(self, k: int) -> tuple[Panel, ...]:
        """Its panels, with its energy; times and places as in the first."""
        if not self.gain or not k:
            return self.panels
        found, t = [], 0.0
        for panel in self.panels:
            found.append(panel.faster(k * self.gain, t))
            t = found[-1].t1
        return tuple(found)

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
        q, qd = np.empty_like(t), np.empty_like(t)
        for index in np.unique(k) if self.gain else [0.0]:
            here = k == index if self.gain else np.ones(k.shape, dtype=bool)
            q[here], qd[here] = along(self.repetition(int(index)), rest[here])
        return q + k * self.step, np.where(back, -qd, qd)

    def at_way(self, way: float) -> float:
        """Time [s] at which the driver has advanced by so much since t0."""
        k = math.floor(way / self.step)
        panels = self.repetition(k)
        place = self.panels[0].q0 + (way - k * self.step)
        ends = [abs(p.q1 - self.panels[0].q0) for p in panels]
        panel = panels[min(bisect.bisect_left(ends, abs(way - k * self.step)), len(panels) - 1)]
        return self.begins(k) + panel.at_place(place)


def durations(panels: Sequence[Panel], energies: Floats) -> Floats:
    """Time [s] that panels take together with so much more kinetic energy (m,)."""
    total = np.zeros(energies.shape)
    for panel in panels:
        r = rule(panel.w.size)
        weights = panel.p * r.v ** (panel.p - 1) * np.sqrt(panel.J / 2) * abs(panel.q1 - panel.q0)
        rows = r.whole[1] * weights
        for first in range(0, energies.size, TURNS_AT_ONCE):
            part = slice(first, first + TURNS_AT_ONCE)
            total[part] += (1 / np.sqrt(panel.K + energies[part, None])) @ rows
    return total


def along(legs: Sequence[Leg], t: Floats) -> tuple[Floats, Floats]:
    """The state at times (m,) [s] of parts that follow each other."""
    starts = np.array([leg.t0 for leg in legs])
    which = np.clip(np.searchsorted(starts, t, "right") - 1, 0, None)
    q, qd = np.empty_like(t), np.empty_like(t)
    for i in np.unique(which).tolist():
        here = which == i
        q[here], qd[here] = legs[i].state(t[here])
    return q, qd


@dataclass(frozen=True)
class PathTrack:
    """Dense output of a path run, from t_start [s] on."""

    legs: tuple[Leg, ...]
    t_start: float = 0.0

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        return State(*along(self.legs, t - self.t_start))
