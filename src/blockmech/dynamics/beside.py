r"""The run beside another: the same panels from other place data, some roundings off.

What a motion leaves unknown is told by a second one. It need not find its way anew: it goes over
the panels of the first, with place data that were sampled elsewhere, fewer terms in its clock, and
some roundings more in its start, its inertia and the work of each panel. Where it would go another
way, to a standstill on a panel that has none, it says so, and a run of its own has to tell.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.estimate import ROUNDING
from blockmech.dynamics.panels import TO_LIMIT, TO_REST, Floats, Panels, Spans, rule
from blockmech.dynamics.place import TAU, J
from blockmech.dynamics.road import PathMesh
from blockmech.dynamics.stretch import begin_energies, solved
from blockmech.dynamics.track import Leg, RepeatedSegment
from blockmech.dynamics.work import of_rate

if TYPE_CHECKING:
    from blockmech.dynamics.path import PathRun


class Beside:
    """The run beside another.

    K : [J] kinetic energy reached; t : [s]; off : [rad or m] by which its place is off there
    shifted : [rad or m] the most by which a standstill was off
    """

    def __init__(self, run: PathRun, n: int, off: float) -> None:
        self.run, self.system, self.rounding = run, run.system, run.rounding
        q, rate = float(run.request.start.q), float(run.request.start.rate) * (1 + off)
        self.off, self.shifted, self.t, self.n = q * off, 0.0, 0.0, run.n
        road = PathMesh(self.system, q, n, run.road.tolerance)
        if self.system.period is None:
            row = run.road.row
            road.row = road.over(np.union1d(row.low, row.high))
        self.road, self.row = road, road.row
        self.K = float(self._rows(np.array([q + self.off]))[J, 0]) * rate**2 / 2

    def legs(self) -> list[Leg] | None:
        """What it leaves behind; None where it does not go the same way."""
        legs: list[Leg] = []
        whole = self.run.whole
        for leg, following in zip(whole, [*whole[1:], None], strict=True):
            repeated = isinstance(leg, RepeatedSegment)
            K, t = self.K, self.t
            panels = self._panels(leg.panels if repeated else leg, 0.0 if repeated else t)
            if panels is None:
                return None
            if not repeated:
                legs.append(panels)
                self.t = panels.t1
                continue
            gain = self.K - K if leg.gain else 0.0
            segment = RepeatedSegment(t, panels, leg.step, gain, leg.mirrored)
            if leg.starts is not None:
                energies = np.arange(len(leg.starts) - 1) * gain
                starts = np.append(0.0, np.cumsum(segment.durations(energies)))
                segment = RepeatedSegment(t, panels, leg.step, gain, leg.mirrored, starts)
            legs.append(segment)
            if following is not None:
                begin = (
                    x.panels if isinstance(x, RepeatedSegment) else x for x in (leg, following)
                )
                first, last = (float(x.spans.begin[0]) for x in begin)
                many = round((last - first) / leg.step)
                self.K, self.t = K + many * gain, segment.begins(many)
        return legs

    def _panels(self, panels: Panels, t0: float) -> Panels | None:
        """Panels beside others, from its state on."""
        parts = []
        for some in panels.one_way():
            part = self._one_way(panels.spans, some, panels.w[some])
            if part is None:
                return None
            parts.append(part)
        spans = Spans(
            *(
                np.concatenate([getattr(x[0], name) for x in parts])
                for name in ("begin", "end", "energy", "kind")
            )
        )
        w, K, inertia = (np.concatenate([x[i] for x in parts]) for i in (1, 2, 3))
        beside = Panels(t0, spans, w, K, inertia, np.broadcast_to(0.0, w.shape))
        rate = beside.rate
        rate[:, 2 * self.n // 3 :] = 0.0
        return beside if np.isfinite(rate).all() else None

    def _one_way(
        self, spans: Spans, some: slice, guess: Floats
    ) -> tuple[Spans, Floats, Floats, Floats] | None:
        """Spans, dK/dq, K and inertia of panels between two standstills."""
        begin, end, kind = spans.begin[some].copy(), spans.end[some].copy(), spans.kind[some]
        begin[0] += self.off
        stands = bool(kind[-1] == TO_REST)
        ahead = slice(len(kind) - stands)
        lies = Spans(begin[ahead], end[ahead], np.zeros(len(kind) - stands), kind[ahead])
        K = self.K
        parts = [self._over(lies, K, guess[ahead])] if len(lies.kind) else []
        if parts:
            K = float(parts[0][2][-1, -1]) + self.rounding * float(parts[0][4])
            self.off = 0.0
        if stands:
            for _ in range(2):  # to where the energies fit
                lies = Spans(begin[-1:], end[-1:], np.zeros(1), kind[-1:])
                last = self._over(lies, 0.0, guess[-1:])
                at_rest = float((last[1] @ rule(self.n).to_series.T @ rule(self.n).at_zero)[0])
                step = (K - float(last[2][0, -1])) / -at_rest
                end[-1] += step
                if not math.isfinite(step):
                    return None
            parts.append(last)
            K, self.off = 0.0, float(end[-1] - spans.end[some][-1])
            self.shifted = max(self.shifted, abs(self.off))
        whole = Spans(begin, end, np.concatenate([x[0].energy for x in parts]), kind)
        w, energy, inertia = (np.concatenate([x[i] for x in parts]) for i in (1, 2, 3))
        self.K = K
        return (whole, w, energy, inertia) if energy[:, :-1].min() > 0 else None

    def _over(
        self, spans: Spans, K: float, guess: Floats
    ) -> tuple[Spans, Floats, Floats, Floats, Any]:
        """The same, and the size of the work of the last, of panels that begin with an energy."""
        v, shape = rule(self.n).v, (len(spans.kind), self.n)
        q = spans.places(v)
        rows = self._rows(q.ravel()).reshape(-1, *shape)
        inertia = rows[J] + self.rounding * np.abs(rows[J]).max(axis=1)[:, None]
        w = rows[TAU]
        if self.run.place_only:
            gains = spans.gains(w)
        else:
            sign = 1 if spans.end[0] > spans.begin[0] else -1
            acts = of_rate(self.system, q, rows, inertia, sign)
            more = self.rounding * np.abs(spans.way) * np.abs(guess).mean(axis=1)
            w, gains, _, known = solved(acts, spans, guess, K, more)
            gains[known:] = math.nan
        size = np.abs(spans.way) * np.abs(w).mean(axis=1)
        energy = begin_energies(K, gains, self.rounding * size)
        spans = Spans(spans.begin, spans.end, energy, spans.kind)
        return spans, w, energy[:, None] + gains, inertia, size[-1]

    def _rows(self, q: Floats) -> Floats:
        """Place data (r, k) at places (k,), NaN where there are none."""
        return self.row.at(q, self.road.first if self.row.period else 0.0)


def beside(run: PathRun, n: int) -> tuple[Beside, list[Leg]] | None:
    """What goes beside a run, from place data of n nodes; None where that is a run of its own.

    So it is with joint friction, and where the path ends by itself: at a dead centre, in
    equilibrium, where nothing is smooth.
    """
    ends_by_itself = run.end not in ("time", END_STOP, run.request.until.goal)
    if ends_by_itself and not run.end.startswith("never reached"):
        return None
    whole = [x.panels if isinstance(x, RepeatedSegment) else x for x in run.whole]
    dead_centre = any((x.spans.kind == TO_LIMIT).any() for x in whole)
    if run.system.friction is not None or run.regime == "rest" or dead_centre or not whole:
        return None
    one = Beside(run, n, ROUNDING)
    legs = one.legs() if one.row.pieces else None
    return None if legs is None else (one, legs)
