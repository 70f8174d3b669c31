"""What motions of many designs leave behind: numbers in arrays, and states at any times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.dense import value
from blockmech.typing import Floats, Real

Bools: TypeAlias = NDArray[np.bool_]
Counts: TypeAlias = NDArray[np.int64]
Designs: TypeAlias = NDArray[np.intp]
Piece: TypeAlias = tuple[Designs, Floats, Floats, Floats]  # designs, from, to [s] and series
TIME, GOAL, REST = range(3)  # why a motion is over


class Motions(NamedTuple):
    """Motions of m designs, arrays (m,).

    alone : whether a design is to be moved by itself; the other columns then say nothing
    end : `TIME`, `GOAL` or `REST`
    rest : [s] when friction stopped it for good, NaN where it did not
    standstills : number of standstills
    friction_work : [J] work of joint friction
    error, time_error : [rad or m], [s], as those of a `Motion`
    track : states at any times
    """

    alone: Bools
    end: Counts
    t: Floats
    q: Floats
    rate: Floats
    rest: Floats
    standstills: Counts
    friction_work: Floats
    error: Floats
    time_error: Floats
    track: Track

    def merged(self, second: Motions, where: Bools) -> Motions:
        """These, and another's where it says so."""
        rows = zip(self[:-1], second[:-1], strict=True)
        track = Track.of((self.track.some(~where), second.track.some(where)), self.track.m)
        return Motions._make([*(np.where(where, b, a) for a, b in rows), track])


@dataclass(frozen=True)
class Track:
    """Dense output of all designs: steps in order of design, then of time.

    m : number of designs
    design, t0, t1 : (s,) whose, from and to [s]
    series : (8, s, 2) of coordinate and rate, see `blockmech.engines.dense`
    """

    m: int
    design: Designs
    t0: Floats
    t1: Floats
    series: Floats

    @classmethod
    def of(cls, pieces: Sequence[Piece], m: int) -> Track:
        """From pieces, those of a design in the order of time."""
        none = np.empty(0, np.intp), np.empty(0), np.empty(0), np.empty((8, 0, 2))
        design, t0, t1 = (np.concatenate([p[i] for p in (none, *pieces)]) for i in range(3))
        order = np.argsort(design, kind="stable")
        series = np.concatenate([p[3] for p in (none, *pieces)], axis=1)[:, order]
        return cls(m, design[order], t0[order], t1[order], series)

    def some(self, which: Bools) -> Piece:
        """The piece of some designs."""
        mask = which[self.design]
        return self.design[mask], self.t0[mask], self.t1[mask], self.series[:, mask]

    def state(self, t: Floats, of: Designs | None = None) -> Floats:
        """Coordinates and rates (m, p, 2) of designs, by default all, at times (m, p) [s]."""
        states = np.full((*t.shape, 2), np.nan)
        if not self.t0.size:
            return states
        some = np.bincount(self.design, minlength=self.m) > 0
        of = np.arange(self.m) if of is None else of
        indices = np.flatnonzero(some[of])
        rows, requested = of[indices], t[indices]
        i = self._steps_at(rows[:, None], requested)
        share: Real = (requested - self.t0[i]) / np.maximum(self.t1[i] - self.t0[i], 1e-300)
        values = np.asarray(value(self.series[:, i.ravel()], 1, share.ravel()[:, None]))
        states[indices] = values.reshape(*requested.shape, 2)
        return states

    def _steps_at(self, design: Designs, t: Floats) -> Designs:
        """In which steps designs are at times [s]; the first one before the start."""
        begin, span = self.t0.min(), np.ptp(np.append(self.t1, self.t0)) or 1.0

        def rank(design: Designs, at: Floats) -> Floats:
            """A number in the order of designs, and of a design's times."""
            return np.asarray(design + np.clip((at - begin) / span, 0.0, 1.0) / 2)

        i = rank(self.design, self.t0).searchsorted(rank(design, t), side="right") - 1
        return np.maximum(i, np.searchsorted(self.design, design))

    def plan(self, design: Designs, t: Floats, count_limit: int) -> tuple[Floats, Counts]:
        """Steps (m, most + 1) [s] of designs (m,) from times on, and how many these are."""
        if not self.t0.size:
            return np.zeros((len(design), count_limit + 1)), np.zeros(len(design), np.int64)
        first = np.searchsorted(self.design, design)
        i, after = self._steps_at(design, t), np.searchsorted(self.design, design, "right")
        count = np.where(after > first, np.clip(after - i, 0, count_limit), 0)
        indices = np.minimum(i[:, None] + np.arange(count_limit + 1), len(self.t0) - 1)
        last = self.t1[np.clip(i + count - 1, 0, len(self.t0) - 1)]
        within = np.arange(count_limit + 1) < count[:, None]
        return np.where(within, self.t0[indices], last[:, None]), count
