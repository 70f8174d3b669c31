"""Panels of a run, as records of the path method's loops: when they are where.

See `panel_nodes` for what they are, and `path_loops` for how they are made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TypeAlias

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from blockmech.dynamics.compiled_path import PathCode
from blockmech.dynamics.panel_nodes import (
    BEGIN,
    COARSE,
    END,
    ENERGY,
    FINE,
    GAINS,
    KIND,
    LEFT,
    PLAIN,
    RATE,
    SINCE,
    SLOPES,
    SPAN,
    TIME,
    TIME_AT_END,
    TO_REST,
    WORK,
    J,
    Nodes,
    basis,
    nodes,
)
from blockmech.dynamics.path_loops import DIGITS, ROOT, SMALLEST
from blockmech.ground.plane import EPS
from blockmech.typing import Floats

Ints: TypeAlias = NDArray[np.intp]


@dataclass(eq=False)
class Panels:
    """Panels of one run that follow each other: m of them, with n nodes each.

    records : (m, 7, 2, n + 2) of both runs, see `panel_nodes`
    of : which run, 0 or 1
    t0 : [s] when the first begins
    compiled : whether machine code reads them, where there is some
    """

    records: Floats
    of: int = 0
    t0: float = 0.0
    compiled: bool = False

    # -- where they lie ------------------------------------------------------------

    @property
    def n(self) -> int:
        """Nodes."""
        return int(self.records.shape[-1]) - 2

    @property
    def nodes(self) -> Nodes:
        """What they are read by."""
        return nodes(self.n, COARSE if self.n == FINE else self.n)

    @cached_property
    def spans(self) -> Floats:
        """Where they lie: (8, m)."""
        spans: Floats = self.records[:, SPAN, self.of, : TIME_AT_END + 1].T
        return spans

    @cached_property
    def lies(self) -> list[list[float]]:
        """The same as numbers (m, 8)."""
        lies: list[list[float]] = self.spans.T.tolist()
        return lies

    @cached_property
    def plain(self) -> NDArray[np.bool_]:
        """(m,) Whether v is the share of the way."""
        return np.asarray(self.spans[KIND] == PLAIN)

    @cached_property
    def backward(self) -> NDArray[np.bool_]:
        """(m,) Whether their anchors are where they end."""
        return np.asarray(self.spans[KIND] >= TO_REST)

    @property
    def begin(self) -> float:
        """[rad or m] where the first begins."""
        return self.lies[0][BEGIN]

    @property
    def energy(self) -> float:
        """[J] with which the first begins, unless it ends at a standstill or dead centre."""
        return self.lies[0][ENERGY]

    @property
    def end(self) -> float:
        """[rad or m] where the last ends."""
        return self.lies[-1][END]

    @property
    def gain(self) -> float:
        """[J] by which they raise it."""
        return self.lies[-1][LEFT] - self.energy

    @property
    def size(self) -> float:
        """[J] of all the work to and fro."""
        return math.fsum(lie[WORK] for lie in self.lies)

    @property
    def K(self) -> Floats:
        """(m, n) [J] at the nodes."""
        records = self.records[:, :, self.of]
        return np.asarray(records[:, SPAN, ENERGY, None] + records[:, GAINS, 1:-1])

    @cached_property
    def second(self) -> Panels:
        """Those of the second run."""
        return Panels(self.records, 1, float(self.records[0, SPAN, 1, TIME]), self.compiled)

    @property
    def code(self) -> PathCode:
        """The loops that read them."""
        code = PathCode.compiled() if self.compiled else None
        return code or PathCode.interpreted(self.n)

    # -- when ------------------------------------------------------------

    @property
    def rate(self) -> Floats:
        """Chebyshev coefficients (m, n) of dt/dv."""
        return self.records[:, RATE, self.of, :-2]

    @property
    def durations(self) -> Floats:
        """(m,) [s] that each takes."""
        return self.records[:, SINCE, self.of, -1]

    @property
    def before(self) -> float:
        """[s] from the time of the records to that of the panels."""
        return self.t0 - self.lies[0][TIME]

    @property
    def t1(self) -> float:
        """[s] when the last ends."""
        return self.t0 + (self.lies[-1][TIME_AT_END] - self.lies[0][TIME])

    @property
    def times(self) -> Floats:
        """(m + 1,) [s] when they begin, and when the last ends."""
        return self.t0 + np.append(0.0, self.durations.cumsum())

    @cached_property
    def _weights(self) -> Floats:
        """(m, n) What 1 / sqrt(K) at the nodes (m, n) counts in the durations."""
        matrices = self.nodes
        leads = matrices.leads[np.where(self.plain, 0, 1), 1:-1] * matrices.work[PLAIN, 1:-1, -1]
        lengths = np.abs(self.spans[END] - self.spans[BEGIN])[:, None]
        return np.asarray(lengths * leads * np.sqrt(self.records[:, self.of, J, 1:-1] / 2))

    def durations_with(self, energies: Floats) -> Floats:
        """(k, m) [s] that each takes with so much more kinetic energy (k,) [J]."""
        K = self.K + energies[:, None, None]
        return np.asarray(np.einsum("kmn,mn->km", 1 / np.sqrt(K), self._weights))

    def started_at(self, t0: float, energy: float = 0.0) -> Panels:
        """The same panels at another time and with more kinetic energy [J]."""
        if energy:
            records = self.records.copy()
            self.code.again(records, len(records), self.of, energy)
            return replace(self, records=records, t0=t0)
        panels = object.__new__(Panels)
        panels.__dict__.update(self.__dict__, t0=t0)
        return panels

    def some(self, i: Ints, energy: Floats) -> Panels:
        """Panels of indices (k,), each with more kinetic energy (k,) [J]."""
        records, matrices = self.records[i], self.nodes
        now = records[:, :, self.of]
        now[:, SPAN, ENERGY] += energy
        lead = matrices.leads[np.where(self.plain[i], 0, 1)] * matrices.inside
        lengths = np.abs(now[:, SPAN, END] - now[:, SPAN, BEGIN])[:, None]
        with np.errstate(all="ignore"):
            K = now[:, SPAN, ENERGY, None] + now[:, GAINS]
            slope = np.sqrt(records[:, self.of, J] / (2 * K))
        now[:, RATE] = np.where(lead > 0, lengths * slope * lead, 0.0) @ matrices.series[0]
        now[:, SINCE] = now[:, RATE] @ matrices.since
        now[:, SLOPES] = now[:, RATE] @ matrices.values
        return replace(self, records=records)

    # -- the state at a time -------------------------------------------------------

    @cached_property
    def _series(self) -> Floats:
        """Coefficients (m, 2, n + 1) of the time since v = 0 and of dt/dv."""
        rate = self.rate
        series = np.zeros((len(rate), 2, self.n + 1))
        series[:, 0], series[:, 1, :-1] = rate @ integral(self.n), rate
        return series

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (k,) at times (k,) [s]; after the end those of the end."""
        if (code := self.code).placed is not None:
            q, rate, times = np.empty(t.size), np.empty(t.size), t - self.before
            code.placed(self.records, len(self.records), self.of, times, t.size, q, rate)
            return q, rate
        times = self.times
        i = np.searchsorted(times[1:-1], t, "right")
        since = np.where(self.backward[i], times[i + 1] - t, t - times[i])
        return self.state_in(i, since)

    @np.errstate(all="ignore")
    def state_in(self, i: Ints, since: Floats) -> tuple[Floats, Floats]:
        """The same in panels i (k,), so long since or until their anchors.

        By Newton's method kept within a bracket, from cubics between nodes.
        """
        shares, indices = self.nodes.shares[0], np.arange(len(i))
        times, slopes = (self.records[i, row, self.of] for row in (SINCE, SLOPES))
        since = np.minimum(np.maximum(since, 0.0), times[:, -1])
        j = np.minimum((times[:, 1:-1] <= since[:, None]).sum(axis=1), self.n)
        first = times[indices, j]
        rates = np.maximum(slopes[indices[:, None], j[:, None] + (0, 1)], SMALLEST)
        h, dv = np.maximum(times[indices, j + 1] - first, SMALLEST), shares[j + 1] - shares[j]
        s, (slope_low, slope_high) = (since - first) / h, (h[:, None] / rates - dv[:, None]).T
        low, high = shares[j], shares[j + 1]
        v = low + s * (dv + (1 - s) * ((1 - s) * slope_low - s * slope_high))
        v = np.where(since > 0, np.fmin(np.fmax(v, low), high), 0.0)
        v = np.where(since < times[:, -1], v, 1.0)
        settled, series = (since == 0) | (v == 1), self._series[i]
        for _ in range(DIGITS):
            time, slope = (series @ basis(v, self.n + 1)[..., None])[..., 0].T
            if settled.all():
                break
            miss = time - since
            low, high = np.where(miss <= 0, v, low), np.where(miss > 0, v, high)
            new, tolerance = v - miss / slope, ROOT / 8 * v + EPS
            # But for rounding.
            inside = (slope > 0) & (new >= low - tolerance) & (new <= high + tolerance)
            new = np.where(inside, np.minimum(np.maximum(new, low), high), (low + high) / 2)
            moved, v = ~settled, np.where(settled, v, new)
            settled = settled | (inside & (np.abs(miss / slope) <= tolerance) & moved)
        begin, end = self.spans[BEGIN, i], self.spans[END, i]
        plain, backward, lengths = self.plain[i], self.backward[i], end - begin
        speed = np.where(slope > 0, lengths * np.where(plain, 1.0, 2 * v) / slope, 0.0)
        gone = lengths * np.where(plain, v, v * v)
        return np.where(backward, end - gone, begin + gone), speed

    def at_place(self, q: float) -> float:
        """Time [s] at which they pass a place."""
        begin, end = self.spans[:2]
        i = min(int(np.searchsorted(np.abs(end - self.begin), abs(q - self.begin))), len(end) - 1)
        backward = bool(self.backward[i])
        share = min(abs((q - (end if backward else begin)[i]) / (end - begin)[i]), 1.0)
        v = np.array([share if self.plain[i] else math.sqrt(share)])
        since = float((basis(v, self.n + 1) @ self._series[i, 0])[0])
        times = self.times
        return float(times[i + 1] - since if backward else times[i] + since)


@cache
def integral(n: int) -> Floats:
    """Coefficients (n,) of a series in 2 v - 1 -> those (n + 1,) of its integral from v = 0."""
    return np.asarray(chebyshev.chebint(np.eye(n), lbnd=-1, axis=1) / 2)


def joined(row: Sequence[Panels]) -> Panels:
    """Panels that follow each other as one."""
    if len(row) == 1:
        return row[0]
    return replace(row[0], records=np.concatenate([x.records for x in row]))
