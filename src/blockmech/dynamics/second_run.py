r"""The second run of a motion: the panels of the first from other place data, some roundings off.

How far two runs are apart is the estimate of a motion's error. The second one need not search for
its panels anew: it goes over those of the first, with place data that were sampled elsewhere, fewer
terms in its clock, and some roundings more in its start, its inertia and the work of each panel.
Where its energy is used up on a panel that holds no standstill it takes another path, and only a
run with panels of its own can say how far.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.estimate import ROUNDING
from blockmech.dynamics.panels import TO_LIMIT, TO_REST, Floats, Panels, Spans, rule
from blockmech.dynamics.path_equation import begin_energies, of_rate, solved
from blockmech.dynamics.path_mesh import PathMesh
from blockmech.dynamics.place_data import TAU, J
from blockmech.dynamics.track import Leg, RepeatedSegment

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

KEPT = 2 / 3  # of the terms of a clock


class Run(Protocol):
    """A run along the path that has ended, see `PathRun`."""

    system: System
    request: SimulationRequest
    mesh: PathMesh
    n: int
    rounding: float
    place_only: bool
    end: str
    regime: str

    @property
    def whole(self) -> list[Leg]:
        """All that it left behind."""


class AnotherPathError(Exception):
    """The second run does not go over the panels of the first."""


def second_run(run: Run, n: int) -> list[Leg] | None:
    """The second run, from place data of n nodes; None where it needs panels of its own.

    So it is with joint friction, and where the path ends by itself: at a dead centre, in
    equilibrium, where nothing is smooth.
    """
    named = run.end in ("time", END_STOP, run.request.until.goal)
    if not named and not run.end.startswith("never reached"):
        return None
    whole = [x.panels if isinstance(x, RepeatedSegment) else x for x in run.whole]
    dead_centre = any((x.spans.kind == TO_LIMIT).any() for x in whole)
    if run.system.friction is not None or run.regime == "rest" or dead_centre or not whole:
        return None
    try:
        return _SecondRun(run, n).legs()
    except AnotherPathError:
        return None


class _SecondRun:
    """Where the run is: time [s], energy [J], and by how much its place is off [rad or m]."""

    def __init__(self, run: Run, n: int) -> None:
        self.run, self.rounding = run, run.rounding
        q, rate = float(run.request.start.q), float(run.request.start.rate) * (1 + ROUNDING)
        self.t, self.off = 0.0, q * ROUNDING
        self.mesh = PathMesh(run.system, q, n, run.mesh.tolerance)
        if run.system.period is None:
            row = run.mesh.row
            self.mesh.row = self.mesh.over(np.union1d(row.low, row.high))
        if not self.mesh.row.pieces:
            raise AnotherPathError
        (inertia,) = self._rows(np.array([q + self.off]))[J]
        self.K = float(inertia) * rate**2 / 2

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
                way = float(following.spans.begin[0] - leg.panels.spans.begin[0])
                many = round(way / leg.step)
                self.K, self.t = K + many * gain, segment.begins(many)
        return legs

    def _panels(self, panels: Panels, t0: float) -> Panels:
        """Its panels where the first has some, from where it is on."""
        parts = [self._one_way(panels, some) for some in panels.one_way()]
        begin, end, energy, kind, w, K, inertia = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        lost = np.broadcast_to(0.0, w.shape)
        second = Panels(t0, Spans(begin, end, energy, kind), w, K, inertia, lost)
        second.rate[:, int(KEPT * self.run.n) :] = 0.0
        return second

    def _one_way(self, panels: Panels, some: slice) -> tuple[Any, ...]:
        """Spans, dK/dq, K and inertia of panels between two standstills."""
        lies, guess = panels.spans, panels.w[some]
        begin, end, kind = lies.begin[some].copy(), lies.end[some].copy(), lies.kind[some]
        begin[0] += self.off
        energy = np.zeros(len(kind))
        spans = Spans(begin, end, energy, kind)
        rows = self._rows(spans.places(rule(self.run.n).v))
        going = slice(len(kind) - int(kind[-1] == TO_REST))
        w, gains = guess.copy(), np.empty((len(kind), self.run.n + 1))
        w[going], gains[going] = self._solved(spans, rows, going, self.K, guess)
        left = self.K
        if going.stop:
            more = self.rounding * np.abs(spans.way[going]) * np.abs(w[going]).mean(axis=1)
            energy[going] = begin_energies(self.K, gains[going], more)
            left = float(energy[going][-1] + gains[going][-1, -1] + more[-1])
        self.K, self.off = left, 0.0
        if going.stop < len(kind):  # its end is moved until the energies fit
            last = slice(going.stop, None)
            w[last], gains[last] = self._solved(spans, rows, last, 0.0, guess)
            at_rest = float(w[-1] @ rule(self.run.n).to_series.T @ rule(self.run.n).at_zero)
            step = (left - float(gains[-1, -1])) / -at_rest
            if not abs(step) < abs(float(spans.way[-1])):
                raise AnotherPathError
            end[-1] += step
            spans = Spans(begin, end, energy, kind)
            moved = Spans(begin[last], end[last], energy[last], kind[last])
            rows[:, last] = self._rows(moved.places(rule(self.run.n).v))
            w[last], gains[last] = self._solved(spans, rows, last, 0.0, guess)
            self.K, self.off = 0.0, step
        K = energy[:, None] + gains
        if not K[:, :-1].min() > 0:
            raise AnotherPathError
        return begin, end, energy, kind, w, K, rows[J]

    def _solved(
        self, spans: Spans, rows: Floats, some: slice, K: float, guess: Floats
    ) -> tuple[Floats, Floats]:
        """dK/dq and gains of some panels that begin with an energy [J]."""
        lies = Spans(spans.begin[some], spans.end[some], spans.energy[some], spans.kind[some])
        if self.run.place_only or not len(lies.kind):
            return rows[TAU, some], lies.gains(rows[TAU, some])
        sign, rows, guess = (1 if lies.end[0] > lies.begin[0] else -1), rows[:, some], guess[some]
        acts = of_rate(self.run.system, lies.places(rule(self.run.n).v), rows, rows[J], sign)
        more = self.rounding * np.abs(lies.way) * np.abs(guess).mean(axis=1)
        w, gains, _, known = solved(acts, lies, guess, K, more)
        if known < len(w):
            raise AnotherPathError
        return w, gains

    def _rows(self, q: Floats) -> Floats:
        """Place data (r, ...) at places, NaN where there are none."""
        row = self.mesh.row
        rows = row.at(q.ravel(), self.rounding)
        return rows.reshape(-1, *q.shape)
