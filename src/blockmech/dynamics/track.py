"""The track of a path run: panels one after the other, and patterns that repeat."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.motion import State
from blockmech.dynamics.panels import SMALLEST, Floats, Panel, basis, rule
from blockmech.plane import EPS

AT_ONCE = 4096  # turns or times that are worked on together: some megabytes
HALVINGS = 60  # of an interval: a double has no more digits


class Leg(Protocol):
    """A part of the track: it begins at t0 [s]."""

    @property
    def t0(self) -> float:
        """When it begins [s]."""
        ...

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (m,) at times (m,) [s]."""
        ...

    def taken(self, t: float) -> float:
        """Work [J] that friction has taken in it until a time [s]."""
        ...


@dataclass(frozen=True)
class Row:
    """Panels that follow each other, evaluated together."""

    panels: tuple[Panel, ...]

    @property
    def t0(self) -> float:
        """When it begins [s]."""
        return self.panels[0].t0

    @cached_property
    def _columns(self) -> Floats:
        """(6, panels): t0, place at v = 0, way from there, p, whether backward, duration."""
        rows = []
        for x in self.panels:
            way = x.q1 - x.q0
            begin, way = (x.q1, -way) if x.backward else (x.q0, way)
            rows.append((x.t0, begin, way, x.p, x.backward, x.duration))
        return np.array(rows, dtype=np.float64).T

    @cached_property
    def _terms(self) -> Floats:
        """Coefficients (panels, 2, n + 1) of the time since v = 0 and of dt/dv."""
        return np.array([[x.clock, np.append(x.rate, 0.0)] for x in self.panels])

    @cached_property
    def _known(self) -> tuple[Floats, Floats]:
        """Rising arguments 2 i + (share of the time of panel i), and v there."""
        n = self._terms.shape[2] - 1
        v = np.concatenate([[0.0], rule(n).v, [1.0]])
        times = self._terms[:, 0] @ basis(v, n + 1).T
        share = np.maximum.accumulate(times, axis=1) / np.maximum(times[:, -1:], SMALLEST)
        before = 2.0 * np.arange(len(self.panels))[:, None]
        return (before + np.clip(share, 0.0, 1.0)).ravel(), np.tile(v, len(self.panels))

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (m,) at times (m,) [s]; after its end those of the end."""
        i = np.clip(np.searchsorted(self._columns[0], t, "right") - 1, 0, None)
        t0, begin, way, p, backward, duration = self._columns[:, i]
        since = np.clip(np.where(backward, t0 + duration - t, t - t0), 0.0, duration)
        v, slope = self._moved(i, since, duration)
        lead = np.where(p == 2, v, 1.0)
        with np.errstate(all="ignore"):
            speed = np.where(slope > 0, p * way * lead / slope, 0.0)
        return begin + way * v * lead, np.where(backward, -speed, speed)

    def taken(self, t: float) -> float:
        """Work [J] that friction has taken in it until a time [s]."""
        q = float(self.state(np.array([t]))[0][0])
        return sum(x.taken(x.q1 if x.t1 <= t else q) for x in self.panels if x.t0 < t)

    def _moved(self, i: NDArray[np.intp], since: Floats, duration: Floats) -> tuple[Floats, Floats]:
        """v and dt/dv at times since v = 0, by Newton's method kept within a bracket."""
        terms = self._terms[i]
        v = np.interp(2.0 * i + since / np.maximum(duration, SMALLEST), *self._known)
        low, high = np.zeros(since.shape), np.ones(since.shape)
        for _ in range(HALVINGS):
            found, slope = np.einsum("mk,mck->cm", basis(v, terms.shape[2]), terms)
            miss = found - since
            low, high = np.where(miss <= 0, v, low), np.where(miss >= 0, v, high)
            with np.errstate(all="ignore"):
                new = v - miss / slope
            new = np.where((new >= low) & (new <= high), new, (low + high) / 2)
            near = np.abs(new - v) <= math.sqrt(EPS) * v + EPS  # the next step is below rounding
            v = new
            if near.all():
                break
        return v, np.einsum("mk,mk->m", basis(v, terms.shape[2]), terms[:, 1])


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
        if self.gain:
            q, qd = np.empty_like(t), np.empty_like(t)
            for index in np.unique(k):
                here = k == index
                q[here], qd[here] = Row(self.repetition(int(index))).state(rest[here])
        else:
            q, qd = Row(self.panels).state(rest)
        return q + k * self.step, np.where(back, -qd, qd)

    def taken(self, t: float) -> float:
        """Work [J] that friction has taken in it until a time [s]; none in one that gains."""
        k, rest = divmod(t - self.t0, self.duration)
        row = Row(self.panels)
        return k * row.taken(self.duration) + row.taken(rest)

    def at_way(self, way: float) -> float:
        """Time [s] at which the driver has advanced by so much since t0."""
        k = math.floor(way / self.step)
        panels = self.repetition(k)
        q = self.panels[0].q0 + (way - k * self.step)
        ends = [abs(p.q1 - self.panels[0].q0) for p in panels]
        panel = panels[min(bisect.bisect_left(ends, abs(way - k * self.step)), len(panels) - 1)]
        return self.begins(k) + panel.at_place(q)

    def durations(self, energies: Floats) -> Floats:
        """Time [s] of a repetition with so much more kinetic energy (m,)."""
        total = np.zeros(energies.shape)
        for x in self.panels:
            r = rule(x.w.size)
            weights = r.average[1][-1] * x.p * r.v ** (x.p - 1) * np.sqrt(x.J / 2) * x.length
            for first in range(0, energies.size, AT_ONCE):
                part = slice(first, first + AT_ONCE)
                total[part] += (1 / np.sqrt(x.K + energies[part, None])) @ weights
        return total


@dataclass(frozen=True)
class PathTrack:
    """Dense output of a path run, from t_start [s] on."""

    legs: tuple[Leg, ...]
    t_start: float = 0.0

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        since = t - self.t_start
        starts = np.array([leg.t0 for leg in self.legs])
        which = np.clip(np.searchsorted(starts, since, "right") - 1, 0, None)
        q, qd = np.empty_like(since), np.empty_like(since)
        for i in np.unique(which).tolist():
            for here in np.split(np.flatnonzero(which == i), range(AT_ONCE, since.size, AT_ONCE)):
                q[here], qd[here] = self.legs[i].state(since[here])
        return State(q, qd)
