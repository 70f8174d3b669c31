"""How far a conservative motion goes: the first standstill, end stop or dead centre.

Only the effort is needed: the kinetic energy ahead is K0 plus its integral. The
standstill is a root of the integrated *series*, found without further kernel calls,
and panels are refined until that root, and every place where the motion nearly stops,
is decided by the series to within its own error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats, rule
from blockmech.dynamics.mesh import Mesh, View, bisected, places, sampled
from blockmech.dynamics.quadrature import EPS, MOST_PANELS, ROUNDING
from blockmech.dynamics.standstills import (
    Dip,
    Energies,
    energies,
    first_panel_too_long,
    first_zero,
)

PANELS = 4  # a turn, to begin with
WINDOWS = 60  # spans looked at where the scene is not periodic (they double along a guide)
LEVELS = 40  # of bisection

Kind = Literal["standstill", "end stop", "dead centre", "endless", "open"]


@dataclass(frozen=True)
class Reach:
    """Outcome of looking ahead from x = 0.

    Attributes
    ----------
    kind : what ends the motion; "endless" in a periodic scene that never stops it,
        "open" where the horizon ended the search
    x : [rad or m] where; the end of the mesh if nothing ends it
    mesh : panels from 0 up to at least x, or one period
    turn : periods between the mesh and x (braking: the stop lies on a later turn)
    gain : [J] net work over one period
    slow : [J] energy where the motion nearly stops, or just does; else inf
    slow_x : [rad or m] where
    doubt : [J] error of the energy there
    """

    kind: Kind
    x: float
    mesh: Mesh
    turn: int = 0
    gain: float = 0.0
    slow: float = math.inf
    slow_x: float = math.nan
    doubt: float = 0.0


class Horizon(NamedTuple):
    """Beyond which time [s] or distance [rad or m] nobody asks."""

    time: float = math.inf
    distance: float = math.inf


NOWHERE = Horizon()


def look_ahead(
    view: View,
    K0: float,
    tolerance: float,
    horizon: Horizon = NOWHERE,
    image: Mesh | None = None,
) -> Reach:
    """Follow the motion from x = 0 with energy K0 [J] to whatever ends it.

    ``tolerance`` [-] is the truncation error of the energy wanted, relative to the work
    turned over; ``horizon`` ends the search in a scene without a period; ``image`` is
    the next period, where it has been sampled before.
    """
    bound, name = _bound(view)
    period = view.meter.system.period
    if bound <= 0:
        empty = sampled(view, np.array([0.0, 1e-9 * view.meter.system.span]))
        return Reach(name, 0.0, empty)
    if period is not None and bound > period and math.isinf(bound):
        return _one_period(view, K0, tolerance, period, image)
    return _windows(view, K0, tolerance, horizon, bound, name)


def _bound(view: View) -> tuple[float, Kind]:
    """Distance to the nearest known end ahead, and its kind."""
    system = view.meter.system
    low, high = system.bounds
    side = 1 if view.sign > 0 else 0
    bound = (high - view.origin) if side else (view.origin - low)
    stopped = system.stops[side] == (low, high)[side]
    return bound, "end stop" if stopped else "dead centre"


def _one_period(
    view: View, K0: float, tolerance: float, period: float, image: Mesh | None
) -> Reach:
    mesh = image or sampled(view, panel_edges(view, 0.0, period, PANELS))
    if not mesh.possible.all():
        return _up_to_gap(view, K0, tolerance, mesh)
    mesh, first, slow, known = _resolved(view, mesh, K0, tolerance)
    if not mesh.possible.all():
        return _up_to_gap(view, K0, tolerance, mesh)
    nearly = _slowest(slow, known)
    gain = float(known.edges[-1] - K0)
    if abs(gain) <= 4 * float(known.lost[-1] + known.rounding[-1]):
        gain = 0.0
    if first is not None:
        return Reach("standstill", first, mesh, 0, gain, *nearly)
    if gain >= 0:
        return Reach("endless", period, mesh, 0, gain, *nearly)
    least = min(float(known.nodes.min()), nearly[0], float(known.edges.min()))
    turn = int(least / -gain)
    for later in range(max(turn, 1), turn + 3):
        x, _ = first_zero(mesh, energies(mesh, K0 + later * gain))
        if x is not None:
            return Reach("standstill", x, mesh, later, gain)
    return Reach("endless", period, mesh, 0, gain, *nearly)


def _windows(
    view: View, K0: float, tolerance: float, horizon: Horizon, bound: float, name: Kind
) -> Reach:
    """Scenes without a period or with ends: look window by window."""
    system = view.meter.system
    width = system.period or (2 * math.pi if system.kind == "rotation" else system.span)
    if math.isfinite(bound):
        width = min(width, bound)
    end, mesh = 0.0, None
    for _ in range(WINDOWS):
        start, end = end, end + width
        if system.kind == "translation":
            width *= 2
        last = end >= bound * (1 - 1e-9)
        end = min(end, bound)
        added = panel_edges(view, start, end, PANELS)
        edges = added if mesh is None else np.concatenate([mesh.edges, added[1:]])
        limits = (False, last and name == "dead centre")
        mesh = sampled(view, edges, mesh, limits)
        if not mesh.possible.all():
            return _up_to_gap(view, K0, tolerance, mesh)
        mesh, first, slow, known = _resolved(view, mesh, K0, tolerance)
        if not mesh.possible.all():
            return _up_to_gap(view, K0, tolerance, mesh)
        nearly = _slowest(slow, known)
        if first is not None:
            return Reach("standstill", first, mesh, 0, 0.0, *nearly)
        if last:
            return Reach(name, bound, mesh, 0, 0.0, *nearly)
        if end > horizon.distance or _duration(mesh, known) > horizon.time:
            break
    assert mesh is not None
    return Reach("open", end, mesh, 0, 0.0)


def _duration(mesh: Mesh, known: Energies) -> float:
    """Time over a mesh, roughly from below (a standstill start is left out) [s]."""
    r = rule(mesh.J.shape[1])
    F = np.sqrt(mesh.J / (2 * known.nodes))
    return float(mesh.length / 2 @ (F @ r.total))


def panel_edges(view: View, low: float, high: float, panels: int) -> Floats:
    """Edges of equal panels, cut at the knots of the loads as well."""
    edges = np.linspace(low, high, panels + 1)
    system = view.meter.system
    if not system.knots:
        return edges
    knots = view.sign * (np.array(system.knots) - view.origin)
    if system.period is not None:
        turns = np.arange(math.floor(low / system.period) - 1, high / system.period + 1)
        first = np.mod(knots, system.period)
        knots = (first[:, None] + turns * system.period).ravel()
    tiny = 1e-12 * (high - low)
    knots = knots[(knots > low + tiny) & (knots < high - tiny)]
    merged = np.sort(np.concatenate([edges, knots]))
    keep = np.concatenate([[True], np.diff(merged) > 1e-9 * (high - low)])
    # a knot wins over an equal division beside it
    for i in np.flatnonzero(~keep):
        if merged[i] in knots and i > 1:
            keep[i], keep[i - 1] = True, False
    return np.asarray(merged[keep])


def _resolved(
    view: View, mesh: Mesh, K0: float, tolerance: float
) -> tuple[Mesh, float | None, list[Dip], Energies]:
    """Refine panels until the first standstill and every dip before it are decided."""
    before = math.inf
    for _ in range(LEVELS):
        known = energies(mesh, K0)
        near = first_panel_too_long(mesh, known)
        if near:
            mesh = sampled(view, np.sort(np.append(mesh.edges, near)), mesh, mesh.limits)
            continue
        first, dips = first_zero(mesh, known)
        last = mesh.panels if first is None else int(np.searchsorted(mesh.edges, first))
        wanted = tolerance * float(known.rounding[last]) / ROUNDING
        for dip in dips:
            if known.rounding[dip.panel + 1] < known.lost[dip.panel + 1]:
                wanted = min(wanted, 0.1 * abs(dip.K))
        wanted = max(wanted, float(known.rounding[last]))
        tails = known.tails[:last]
        if tails.sum() <= wanted or mesh.panels > MOST_PANELS:
            break
        if tails.sum() > 0.5 * before and tails.sum() < 1e-9 * known.rounding[last] / ROUNDING:
            break  # it is noise
        before = float(tails.sum())
        bad = np.zeros(mesh.panels, dtype=bool)
        bad[:last] = tails > wanted / (2 * last)
        if np.diff(mesh.edges)[bad].min() < 16 * EPS * (abs(view.origin) + mesh.edges[-1]):
            break
        mesh = sampled(view, bisected(mesh.edges, bad), mesh, mesh.limits)
        if not mesh.possible.all():
            break
    return mesh, first, dips, known


def _slowest(dips: list[Dip], known: Energies) -> tuple[float, float, float]:
    if not dips:
        return math.inf, math.nan, 0.0
    dip = min(dips, key=lambda d: abs(d.K))
    error = known.lost[dip.panel + 1] + known.rounding[dip.panel + 1]
    return dip.K, dip.x, float(error)


def _up_to_gap(view: View, K0: float, tolerance: float, mesh: Mesh) -> Reach:
    """The driver meets a dead centre: find it, then look up to there only."""
    x = gap(view, mesh)
    width = x / PANELS
    edges = panel_edges(view, 0.0, x, PANELS) if width > 0 else np.array([0.0, x])
    bounded = sampled(view, edges, None, (False, True))
    if not bounded.possible.all():
        inner = gap(view, bounded)
        if inner < x * (1 - 1e-9) and inner > 0:
            return _up_to_gap(view, K0, tolerance, bounded)
        return Reach("dead centre", x, bounded)
    bounded, first, slow, known = _resolved(view, bounded, K0, tolerance)
    nearly = _slowest(slow, known)
    if first is not None:
        return Reach("standstill", first, bounded, 0, 0.0, *nearly)
    return Reach("dead centre", x, bounded, 0, 0.0, *nearly)


def gap(view: View, mesh: Mesh) -> float:
    """Last place before the first impossible sample at which the mechanism closes."""
    x = places(mesh.edges[:-1], mesh.edges[1:], mesh.limits, mesh.J.shape[1]).ravel()
    bad = int(np.argmin(mesh.possible.ravel()))
    low, high = (float(x[bad - 1]) if bad else 0.0), float(x[bad])
    for _ in range(80):
        middle = (low + high) / 2
        if not low < middle < high:
            break
        one = view.meter.one(view.origin + view.sign * middle)
        if one.margin > 0 and one.J > 0 and math.isfinite(one.J):
            low = middle
        else:
            high = middle
    return low
