r"""The second run of a motion: the panels of the first from other place data, some roundings off.

How far two runs are apart is the estimate of a motion's error. The second one need not search for
its panels anew: it goes over those of the first, with place data that were sampled elsewhere (see
`PathMesh`), fewer terms in its clock, and some roundings more in its start, its inertia and the
work of each panel. A panel that begins or ends a little elsewhere has the same data, further along
their slopes.
Where its energy is used up on a panel that holds no standstill it takes another path, and only a
run with panels of its own can say how far.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.estimate import ROUNDING
from blockmech.dynamics.panels import (
    TO_LIMIT,
    TO_REST,
    Floats,
    P,
    Panels,
    Spans,
    begin_energies,
    joined,
    rule,
    to_and_fro,
)
from blockmech.dynamics.path_mesh import KEPT
from blockmech.dynamics.place_data import TAU, J
from blockmech.dynamics.track import Leg, RepeatedSegment

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System


class Run(Protocol):
    """A run along the path that has ended, see `PathRun`."""

    system: System
    request: SimulationRequest
    rounding: float
    regime: str

    @property
    def end(self) -> str:
        """By what it is over."""

    @property
    def whole(self) -> list[Leg]:
        """All that it left behind."""


class AnotherPathError(Exception):
    """The second run does not go over the panels of the first."""


def second_run(run: Run) -> list[Leg] | None:
    """The second run; None where it needs panels of its own.

    So it is where the path ends by itself: at a dead centre, in equilibrium, where nothing is
    smooth.
    """
    named = run.end in ("time", END_STOP, run.request.until.goal)
    if not named and not run.end.startswith("never reached"):
        return None
    whole = [x.panels if isinstance(x, RepeatedSegment) else x for x in run.whole]
    dead_centre = any(x.other is None and (x.spans.kind == TO_LIMIT).any() for x in whole)
    if run.regime == "rest" or dead_centre or not whole:
        return None
    try:
        return _SecondRun(run).legs()
    except AnotherPathError:
        return None


class _SecondRun:
    """Where the run is: time [s], energy [J], and by how much its place is off [rad or m]."""

    def __init__(self, run: Run) -> None:
        self.run, self.rounding = run, run.rounding
        q, rate = float(run.request.start.q), float(run.request.start.rate) * (1 + ROUNDING)
        self.t, self.off, self.K = 0.0, q * ROUNDING, 0.0
        first = run.whole[0]
        panels = first.panels if isinstance(first, RepeatedSegment) else first
        if rate and panels.other is not None:
            self.K = float(panels.other.spans.energy[0])
        elif rate:
            inertia = panels.second[0, J]  # at the nodes, and where it begins
            if panels.spans.backward[0]:
                inertia = rule(len(inertia) - 1).to_series.sum(axis=0) @ inertia[:-1, None]
            self.K = float(inertia[-1]) * rate**2 / 2

    @np.errstate(all="ignore")  # what is not finite takes another path
    def legs(self) -> list[Leg]:
        """What it leaves behind."""
        legs: list[Leg] = []
        whole = self.run.whole
        for leg, following in zip(whole, [*whole[1:], None], strict=True):
            if not isinstance(leg, RepeatedSegment):
                panels = self._panels(leg, self.t)
                self.t = panels.t1
                legs.append(panels)
                continue
            t, K = self.t, self.K
            panels = self._panels(leg.panels, 0.0)
            gain = self.K - K if leg.gain else 0.0
            segment = RepeatedSegment(t, panels, leg.step, gain, leg.mirrored)
            if leg.starts is not None:
                energies: Floats = np.arange(len(leg.starts) - 1) * np.float64(gain)
                starts = np.append(0.0, np.cumsum(segment.durations(energies)))
                segment = RepeatedSegment(t, panels, leg.step, gain, leg.mirrored, starts)
            legs.append(segment)
            if isinstance(following, Panels):
                way = float(following.begin - leg.panels.begin)
                many = round(way / leg.step)
                self.K, self.t = K + many * gain, segment.begins(many)
        return legs

    def _panels(self, panels: Panels, t0: float) -> Panels:
        """Its panels where the first has some, from where it is on."""
        if panels.other is not None:
            self.K = panels.other.left
            beside: Panels = panels.other.taken_from(t0)
            return beside
        second = joined([self._one_way(panels, some, t0) for some in panels.one_way()])
        second.rate[:, int(KEPT * second.w.shape[1]) :] = 0.0
        return second

    def _one_way(self, panels: Panels, some: slice, t0: float) -> Panels:
        """The same between two standstills."""
        n, lies, kind = panels.w.shape[1], panels.spans, panels.spans.kind[some]
        begin, end, energy = lies.begin[some].copy(), lies.end[some].copy(), np.zeros(len(kind))
        way, backward = lies.way[some][0], kind[0] >= TO_REST
        begin[0] += self.off
        r, rows, many = rule(n), panels.second[some, :, :-1].copy(), len(kind)
        shares = r.v * r.powers[kind[0]]
        by = self.off * (shares if backward else 1.0 - shares)
        rows[0] += self._further(rows[0], way, kind[0], by)
        spans, stands = Spans(begin, end, energy, kind), bool(kind[-1] == TO_REST)
        w = rows[:, TAU].copy()
        gains = spans.gains(w)
        more = self.rounding * to_and_fro(spans.way, w)
        energy[:] = begin_energies(self.K, gains, more)
        self.K, self.off = float(energy[-1]), 0.0
        if stands:  # its end is moved until the energies fit
            step = (self.K - float(gains[-1, -1])) / -float(r.at_zero @ r.to_series @ w[-1])
            if not abs(step) < abs(float(spans.way[-1])):
                raise AnotherPathError
            by = step * (1.0 - r.v * r.v)
            rows[-1] += self._further(rows[-1], spans.way[-1], TO_REST, by)
            end[-1] += step
            energy[-1], spans = 0.0, Spans(begin, end, energy, kind)
            last = slice(many - 1, None)
            w[last] = rows[last, TAU]
            gains[last] = spans.some(last).gains(w[last])
            self.K, self.off = 0.0, step
        else:
            self.K += float(gains[-1, -1] + more[-1])
        K = energy[:, None] + gains
        if not K[:, :-1].min() > 0:
            raise AnotherPathError
        return Panels(t0, spans, w, K, rows[:, J], panels.second[some])

    def _further(self, rows: Floats, way: float, kind: int, by: Floats) -> Floats:
        """What place data (s, n) of a panel change by, some way (n,) [rad or m] further on."""
        r = rule(rows.shape[1])
        return np.asarray(rows @ r.slopes.T * (by / (P[kind] * way * r.powers[kind])))
