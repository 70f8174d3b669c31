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
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats, remainder, rule
from blockmech.dynamics.massless import refuse_no_inertia_inside
from blockmech.dynamics.mesh import RESOLVED, Mesh, View, cut, places, sampled
from blockmech.dynamics.quadrature import EPS, MOST_PANELS, ROUNDING
from blockmech.dynamics.standstills import (
    Dip,
    Energies,
    energies,
    first_panel_too_long,
    first_stop,
    first_zero,
    standstill,
)

PANELS = 4  # a turn, to begin with
WINDOWS = 60  # spans looked at where the scene is not periodic (they double along a guide)
LEVELS = 40  # of bisection
HALVED = 1.6  # power to which cutting a panel in two raises the end of its series
SURELY = 1.01  # times the time wanted: a motion that goes on for longer is beyond it
NOISE = 1e-9  # end of a series, relative, that is noise if cutting does not help

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
    edges : those of the mesh, and more where the time will need them
    turn : periods between the mesh and x (braking: the stop lies on a later turn)
    gain : [J] net work over one period
    slow : [J] energy where the motion nearly stops, or just does; else inf
    slow_x : [rad or m] where
    doubt : [J] error of the energy there
    """

    kind: Kind
    x: float
    mesh: Mesh
    edges: Floats
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

    Raises `NoInertia` at a place where the inertia of the driver is zero.
    """
    bound, name = _bound(view)
    period = view.meter.system.period
    if bound <= 0:
        empty = sampled(view, np.array([0.0, 1e-9 * view.meter.system.span]))
        return Reach(name, 0.0, empty, empty.edges)
    if period is not None and bound > period and math.isinf(bound):
        reach = _one_period(view, K0, tolerance, period, image)
    else:
        reach = _windows(view, K0, tolerance, horizon, bound, name)
    return _within(reach, K0, horizon.time)


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
    refuse_no_inertia_inside(view, mesh)
    mesh, edges, first, slow, known = _resolved(view, mesh, K0, tolerance)
    if not mesh.possible.all():
        return _up_to_gap(view, K0, tolerance, mesh)
    nearly = _slowest(slow, known)
    gain = float(known.edges[-1] - K0)
    if view.meter.system.lossless or abs(gain) <= 4 * float(known.lost[-1] + known.rounding[-1]):
        gain = 0.0
    if first is not None:
        return Reach("standstill", first, mesh, edges, 0, gain, *nearly)
    if gain == 0 and K0 == 0:  # it can come no further than to the start's image
        return Reach("standstill", period, mesh, edges, 0, gain, *nearly)
    if gain >= 0:
        return Reach("endless", period, mesh, edges, 0, gain, *nearly)
    least = min(float(known.nodes.min()), nearly[0], float(known.edges.min()))
    turn = int(least / -gain)
    for later in range(max(turn, 1), turn + 3):
        x, _ = first_zero(mesh, energies(mesh, K0 + later * gain))
        if x is not None:
            return Reach("standstill", x, mesh, edges, later, gain)
    return Reach("endless", period, mesh, edges, 0, gain, *nearly)


def _windows(
    view: View, K0: float, tolerance: float, horizon: Horizon, bound: float, name: Kind
) -> Reach:
    """Scenes without a period or with ends: look window by window."""
    system = view.meter.system
    width = system.period or (2 * math.pi if system.kind == "rotation" else system.span)
    if math.isfinite(bound):
        width = min(width, bound)
    end, mesh, wanted = 0.0, None, None
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
        refuse_no_inertia_inside(view, mesh)
        mesh, wanted, first, slow, known = _resolved(view, mesh, K0, tolerance)
        if not mesh.possible.all():
            return _up_to_gap(view, K0, tolerance, mesh)
        nearly = _slowest(slow, known)
        if first is not None:
            return Reach("standstill", first, mesh, wanted, 0, 0.0, *nearly)
        if last:
            return Reach(name, bound, mesh, wanted, 0, 0.0, *nearly)
        if end > horizon.distance or _duration(mesh, known) > horizon.time:
            break
    assert mesh is not None
    assert wanted is not None
    return Reach("open", end, mesh, wanted)


def _within(reach: Reach, K0: float, time: float) -> Reach:
    """Up to where the motion surely is at a time, if that is before the dead centre.

    The last bit of the way may be hard, or without end; nobody asks for it then.
    """
    if reach.kind != "dead centre" or math.isinf(time):
        return reach
    mesh = reach.mesh
    late = np.cumsum(_durations(mesh, energies(mesh, K0))) > SURELY * time
    i = int(late.argmax())
    if not late[i] or i + 1 >= mesh.panels:
        return reach
    end = float(mesh.edges[i + 1])
    return Reach("open", end, mesh, np.append(reach.edges[reach.edges < end], end))


def _duration(mesh: Mesh, known: Energies) -> float:
    """Time over a mesh, roughly from below [s]."""
    return float(_durations(mesh, known).sum())


def _durations(mesh: Mesh, known: Energies) -> Floats:
    """Time over each panel, roughly from below (a standstill start is left out) [s]."""
    F = np.sqrt(mesh.J / (2 * known.nodes))
    return np.asarray(mesh.length / 2 * (F @ rule(mesh.nodes).total))


def panel_edges(view: View, low: float, high: float, panels: int) -> Floats:
    """Edges of equal panels, cut at the knots of the loads as well."""
    edges = low + (high - low) / panels * np.arange(panels + 1.0)
    edges[-1] = high
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
) -> tuple[Mesh, Floats, float | None, list[Dip], Energies]:
    """Refine panels until the first standstill and every dip before it are decided.

    Returns the mesh, edges that the time will need besides, the standstill, dips, energies.
    """
    before = math.inf
    for level in range(LEVELS):
        known = energies(mesh, K0)
        near = first_panel_too_long(mesh, known)
        if near:
            mesh = sampled(view, np.sort(np.append(mesh.edges, near)), mesh, mesh.limits)
            continue
        stop, dips = first_stop(mesh, known)
        last = mesh.panels if stop is None else stop.panel + 1
        rounding = float(known.rounding[last])
        wanted = tolerance * rounding / ROUNDING
        for dip in dips:
            if known.rounding[dip.panel + 1] < known.lost[dip.panel + 1]:
                wanted = min(wanted, 0.1 * abs(dip.K))
        wanted = max(wanted, rounding)
        error = float(known.lost[last])
        pieces = _pieces(mesh, known, last, wanted, tolerance)
        noise = level > 2 and 0.5 * before < error < NOISE * rounding / ROUNDING
        if pieces is None or error <= wanted or noise or mesh.panels > MOST_PANELS:
            break
        before = error
        if np.diff(mesh.edges)[pieces > 1].min() < 16 * EPS * (abs(view.origin) + mesh.edges[-1]):
            break
        mesh = sampled(view, cut(mesh.edges, pieces), mesh, mesh.limits)
        if not mesh.possible.all():
            break
    x = None if stop is None else standstill(mesh, known, stop)
    dips = [dip for dip in dips if x is None or dip.x < x or dip.K <= 0]
    if pieces is None or pieces.size != mesh.panels:
        return mesh, mesh.edges, x, dips, known
    return mesh, cut(mesh.edges, pieces), x, dips, known


def _pieces(
    mesh: Mesh, known: Energies, last: int, wanted: float, tolerance: float
) -> NDArray[np.intp] | None:
    """Into how many pieces each panel should be cut: 1, 2 or 4; None if none should.

    Before the panel ``last``, the series of the effort must have ended, and that of the
    time's integrand sqrt(J/K) as well, so that no more samples are needed for the time.
    Cutting a panel in two raises the relative end of a series to the power 1.6, as a rule.
    """
    r = rule(mesh.nodes)
    flat = max(tolerance, RESOLVED)
    F = np.sqrt(mesh.J[:last] / known.nodes[:last])
    if known.edges[0] == 0 and not mesh.limits[0]:
        F[0] *= r.root
    bent = (remainder(F, r) / F.max(axis=1)).tolist()
    # where the motion stops on a panel, that series is none; J must do
    if not all(map(math.isfinite, bent)):
        instead = float(mesh.missed[0, last - 1] / mesh.J[last - 1].max())
        bent = [b if math.isfinite(b) else instead for b in bent]
    good = float(known.lost[last]) <= wanted
    if good and max(bent) <= flat:
        return None
    share = wanted / (2 * last)
    errors = known.tails[:last].tolist()
    largest = (mesh.length[:last] / 2 * np.abs(mesh.tau[:last]).max(axis=1)).tolist()
    pieces = np.ones(mesh.panels, dtype=np.intp)
    for i, (bend, error, most) in enumerate(zip(bent, errors, largest, strict=True)):
        if bend > flat or (error > share and not good):
            size = most + 1e-300
            still = (error / size) ** HALVED * size > share or bend**HALVED > flat
            pieces[i] = 4 if still else 2
    return pieces if np.any(pieces > 1) else None


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
        return Reach("dead centre", x, bounded, bounded.edges)
    refuse_no_inertia_inside(view, bounded)
    bounded, wanted, first, slow, known = _resolved(view, bounded, K0, tolerance)
    nearly = _slowest(slow, known)
    if first is not None:
        return Reach("standstill", first, bounded, wanted, 0, 0.0, *nearly)
    return Reach("dead centre", x, bounded, wanted, 0, 0.0, *nearly)


def gap(view: View, mesh: Mesh) -> float:
    """Last place before the first impossible sample ahead at which the mechanism closes.

    Where only the way behind the start has one it is the last place before that, below 0.
    """
    x = places(mesh.edges[:-1], mesh.edges[1:], mesh.limits, mesh.nodes).ravel()
    bad = ~mesh.possible.ravel()
    ahead = np.flatnonzero(bad & (x >= 0.0))
    first, back = (int(ahead[0]), -1) if ahead.size else (int(np.flatnonzero(bad)[-1]), 1)
    before = first + back
    low, high = (float(x[before]) if 0 <= before < x.size else 0.0), float(x[first])
    low = max(low, 0.0) if ahead.size else min(low, 0.0)
    for _ in range(80):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        one = view.meter.pose(view.origin + view.sign * middle)
        if one.margin > 0 and one.J > 0 and math.isfinite(one.J):
            low = middle
        else:
            high = middle
    return low
