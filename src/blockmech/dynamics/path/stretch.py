"""A stretch of the path between two ends, refined until its time is known well enough.

Ends are exact where the start is, and where a stop or dead centre is; a standstill
found by integration is moved until the energies summed from both sides close. Every
level costs one batch call, and the levels are the same whatever is asked: a looser
target only stops earlier.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats, crawls, rule
from blockmech.dynamics.path.dense import place, when
from blockmech.dynamics.path.mesh import Mesh, View, bisected, sampled
from blockmech.dynamics.path.passage import Allowed, End, Known, Place
from blockmech.dynamics.path.quadrature import (
    EPS,
    MOST_PANELS,
    TIMED,
    Anchor,
    Quadrature,
    delay,
    quadrature,
    slow_begins,
)

LEVELS = 40
COARSE = 1e-6  # relative error of the time above which a series is looked at twice
LOOSE = 1e-9  # relative error that is no rounding, even beside a dead centre
FALLING, SLOWLY = 1e-11, 8.0  # relative error that is no rounding yet, and what it may really be
NOISY = 4.0  # what the error of a series is there, relative to what its end tells


@dataclass(frozen=True)
class Stretch:
    """A stretch with its converged quadrature.

    Attributes
    ----------
    low, high : its ends
    quad : energy and time on its panels
    reducible : [s] error of the crossing time that more samples would remove
    rounding : [s] error that the data's and the arithmetic's rounding leave
    end_error : [rad or m] error of the standstills' places
    end_times : [s] what part of the error of the time the places of the ends make, low and high
    complete : False where an impossible pose was met (the quadrature is then unusable)
    """

    low: End
    high: End
    quad: Quadrature
    reducible: float
    rounding: float
    end_error: float
    complete: bool = True
    end_times: tuple[float, float] = (0.0, 0.0)

    @property
    def error(self) -> float:
        """Error of the time at any place of the stretch [s]."""
        return self.reducible + self.rounding

    @property
    def total(self) -> float:
        """Time from end to end [s]."""
        return self.quad.total

    def missed(self, begin: float, end: float, passes: int) -> tuple[float, float]:
        """Error of the coordinate between two clock readings [rad or m], and of the time [s].

        Errors of the time add up from panel to panel; what one makes of the place is that
        at its speed, or at a neighbour's, if that is no farther away than the error is large.
        A standstill's place counts where the energy is summed from there.
        """
        quad, clock = self.quad, self.quad.clock
        if not math.isfinite(self.error):
            return math.inf, math.inf
        p = quad.mesh.panels
        first = min(max(int(clock.searchsorted(begin, side="right")) - 1, 0), p - 1)
        last = min(max(int(clock.searchsorted(end, side="left")) - 1, first), p - 1)
        there = slice(first, last + 1)
        each = quad.truncation + quad.doubted + TIMED * EPS * quad.duration
        seconds = passes * float(each[there].sum())
        moved = 0.0
        for edge, late in zip((0, p), self.end_times, strict=True):
            if (quad.owned[there] == edge).any():
                seconds, moved = seconds + passes * late, self.end_error
        a, b = clock.searchsorted((clock[first] - seconds, clock[last + 1] + seconds)).tolist()
        return seconds * float(quad.speeds()[max(a - 1, 0) : b].max()) + moved, seconds

    @property
    def fastest(self) -> float:
        """Largest speed [rad/s or m/s]."""
        return self.quad.fastest

    def place(self, time: Floats) -> Place:
        """Place and speed at times (m,) [s] from the low end."""
        return place(self.quad, time)

    def when(self, x: Floats) -> Floats:
        """Time [s] from the low end at places x (m,)."""
        return when(self.quad, x)


def converged(
    view: View,
    known: Mesh,
    edges: Floats,
    low: End,
    high: End,
    inside: Known | None,
    allowed: Allowed,
) -> Stretch:
    """Refine the panels between two ends until the time's error is what is ``allowed``.

    ``known`` has samples that can be reused, ``edges`` are those to begin with, ``inside``
    is a place between the ends where the energy is known as well: the start of a motion
    that starts moving.
    """
    edges = _edges_between(edges, low, high, inside)
    limits = (low.limit, high.limit)
    mesh = known
    tails: dict[tuple[float, float], float] = {}
    for level in range(LEVELS):
        try:
            mesh = sampled(view, edges, mesh, limits)
            stretch = _judged(view, mesh, low, high, inside)
        except KeyboardInterrupt:  # the level before has its own, larger error
            if level == 0:
                raise
            view.meter.interrupted = True
            break
        if not stretch.complete or level == LEVELS - 1 or mesh.panels > MOST_PANELS:
            break
        enough = stretch.rounding
        if stretch.reducible < np.inf:  # else the series leave undecided whether it passes at all
            enough = max(allowed(stretch) - enough, enough)
        low, high = stretch.low, stretch.high
        if stretch.reducible <= enough:
            break
        bad = _unresolved(stretch.quad, enough, tails, abs(view.origin))
        if not bad.any() and edges[0] == low.x and edges[-1] == high.x:
            break
        edges = bisected(edges, bad)
        edges[0], edges[-1] = low.x, high.x
    return stretch


def _edges_between(edges: Floats, low: End, high: End, inside: Known | None) -> Floats:
    """Edges of a survey that lie well inside, with the ends and the known place added."""
    start = inside[0] if inside else np.nan
    whole = [low.x, *(x for x in edges.tolist() if low.x < x < high.x), high.x]
    if inside and start not in whole:
        whole = sorted([*whole, start])
    # a sliver beside an end is worse than a longer panel
    a, b, c, *_ = *whole, math.inf
    *_, d, e, f = -math.inf, *whole
    slivers = [b] if b - a < 0.1 * (c - b) and b != start else []
    slivers += [e] if f - e < 0.1 * (e - d) and e != start else []
    if len(whole) > 3:
        whole = [x for x in whole if x not in slivers]
    if len(whole) == 2:
        whole.insert(1, (low.x + high.x) / 2)
    return np.array(whole)


def _judged(view: View, mesh: Mesh, low: End, high: End, inside: Known | None) -> Stretch:
    """The quadrature on a mesh, its errors, and where the standstills should be instead."""
    anchors = _anchors(mesh, low, high, inside)
    quad = quadrature(mesh, anchors, view.origin)
    T = quad.total
    if not math.isfinite(T):
        possible = bool(mesh.possible.all())
        return Stretch(low, high, quad, np.inf, 0.0, np.inf, possible)
    truncation = quad.truncation
    if low.limit or high.limit:
        # beside a dead centre the end of the series is rounding of the kernels, not its end
        noisy = np.ones(mesh.panels)
        noisy[[0, -1]] = np.where([low.limit, high.limit], NOISY, 1.0)
        truncation = truncation * noisy
        quad = quad._replace(truncation=truncation)
    # where it nearly stops, series fall more and more slowly, and not by their last ratio
    truncation = np.where(truncation > FALLING * T, SLOWLY * truncation, truncation)
    truncation = np.maximum(truncation, slow_begins(quad, anchors))
    quad = quad._replace(truncation=truncation)
    if truncation.max() > COARSE * T:
        hidden = crawls(quad.F, rule(mesh.nodes))
        truncation = np.where(hidden, np.maximum(truncation, quad.duration), truncation)
        quad = quad._replace(truncation=truncation)
    reducible = float(truncation.sum()) + quad.lost_time
    rounding = quad.rounded_time + TIMED * EPS * T
    ends, end_error, end_times = [low, high], 0.0, [0.0, 0.0]
    for side, end in enumerate(ends):
        if end.reflects and not end.free:
            # its place is exact; the samples beside it are taken at rounded coordinates
            late = EPS / 2 * (abs(view.origin) + abs(end.x)) * _at_end(quad, side)[1]
            rounding, end_times[side] = rounding + late, late
        if not end.free or len(anchors) < 2:
            continue
        near, far = (anchors[0], anchors[1]) if side == 0 else (anchors[-1], anchors[-2])
        between = slice(min(near.edge, far.edge), max(near.edge, far.edge))
        noise = float(quad.rounded[between].sum()) + EPS * far.K
        effort, slowing = _at_end(quad, side)
        if not effort > 0:
            reducible = np.inf
            continue  # and nothing is known
        # energy that is left at the end as summed from the far anchor
        left = -quad.closure[0] if side == 0 else quad.closure[-1]
        step = float(left) / effort if abs(left) > noise else 0.0
        step = _held(step, mesh, side)
        ends[side] = End(end.x + (step if side else -step), end.K, end.free, end.limit)
        reducible += abs(step) * slowing
        placed = noise / effort + EPS * (abs(view.origin) + abs(end.x))
        rounding += placed * slowing
        end_times[side] = (placed + abs(step)) * slowing
        end_error = max(end_error, placed + abs(step) + float(quad.lost[between].sum()) / effort)
    times = end_times[0], end_times[1]
    return Stretch(ends[0], ends[1], quad, reducible, rounding, end_error, end_times=times)


def _held(step: float, mesh: Mesh, side: int) -> float:
    """A step of an end that stays within half of its panel."""
    a, b = mesh.edges[-2:] if side else mesh.edges[:2]
    half = float(b - a) / 2
    return max(-half, min(half, step))


def _at_end(quad: Quadrature, side: int) -> tuple[float, float]:
    """At a standstill: effort [N m or N], and how much time its place makes [s/rad or s/m]."""
    p = quad.mesh.panels - 1 if side else 0
    ends = rule(quad.tau.shape[1]).ends
    effort, _, slope, _, _ = (quad.tau[p] @ ends).tolist()
    inertia = float(quad.J[p] @ ends[:, 0])
    span = float(quad.mesh.edges[-1] - quad.mesh.edges[0])
    return effort, delay(effort, slope / float(quad.mesh.length[p]), inertia, quad.total, span)


def _anchors(mesh: Mesh, low: End, high: End, inside: Known | None) -> list[Anchor]:
    found = []
    if low.K is not None:
        found.append(Anchor(0, low.K))
    if inside:
        found.append(Anchor(int(np.searchsorted(mesh.edges, inside[0])), inside[1]))
    if high.K is not None:
        found.append(Anchor(mesh.panels, high.K))
    return found


def _unresolved(
    quad: Quadrature, enough: float, tails: dict[tuple[float, float], float], origin: float
) -> NDArray[np.bool_]:
    """Panels to bisect: those with the largest share of the error that can still be reduced.

    ``tails`` remembers how well each panel was resolved: a half that is no better than
    the whole was is at its rounding already.
    """
    edges, L = quad.mesh.edges, quad.mesh.length
    bad = ~(quad.truncation <= enough / (2 * L.size))
    if not quad.lost_time <= enough / 2:
        bad |= quad.lost > quad.lost.sum() / (2 * L.size)
    bad &= np.diff(edges) > 64 * EPS * (origin + np.abs(edges[:-1]))
    weight = np.where(quad.ended, np.sqrt(L), L)
    # towards a dead centre the kernels' rounding grows: smaller panels would be worse
    bad[[0, -1]] &= ~np.array(quad.mesh.limits) | (quad.truncation[[0, -1]] > LOOSE * quad.total)
    tail = quad.truncation / (weight * np.abs(quad.F).max(axis=1))
    for i in np.flatnonzero(bad).tolist():
        a, b = float(edges[i]), float(edges[i + 1])
        here = float(tail[i])
        noisy = here < 1e-9 or (quad.mesh.limits[0] and i == 0)
        noisy |= quad.mesh.limits[1] and i == L.size - 1
        if here < 8 * EPS or (noisy and here > 0.3 * tails.get((a, b), np.inf)):
            bad[i] = False
        tails[(a, (a + b) / 2)] = tails[((a + b) / 2, b)] = here
    return np.asarray(bad)
