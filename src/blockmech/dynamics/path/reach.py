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
from blockmech.dynamics.ends import DEAD_CENTRE, END_STOP, IMPOSSIBLE, LEAST_MARGIN
from blockmech.dynamics.path.massless import SUSPECT, first_touch, refuse_no_inertia_inside
from blockmech.dynamics.path.mesh import Mesh, View, places, sampled
from blockmech.dynamics.path.standstills import Dip, Energies, energies, first_zero
from blockmech.dynamics.path.survey import panel_edges, resolved

PANELS = 4  # a turn, to begin with
WINDOWS = 60  # spans looked at where the scene is not periodic (they double along a guide)
SURELY = 1.01  # times the time wanted: a motion that goes on for longer is beyond it
POLE = 1e6  # inertia beside a dead centre, relative to that of its panel, that has no bound
NEAREST = 24  # halvings of the way to a place at infinity

Kind = Literal["standstill", "end stop", "dead centre", "impossible pose", "endless", "open"]


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
        reach = _one_period(view, K0, tolerance, horizon, period, image)
    else:
        reach = _windows(view, K0, tolerance, horizon, bound, name)
    return _within(reach, K0, horizon.time)


def _bound(view: View) -> tuple[float, Kind]:
    """Distance to the nearest known end ahead, and its kind."""
    system = view.meter.system
    low, high = system.bounds
    side = 1 if view.sign > 0 else 0
    bound = (high - view.origin) if side else (view.origin - low)
    if system.stops[side] == (low, high)[side]:
        return bound, END_STOP
    return bound, _end_of_range(view, bound)


def _end_of_range(view: View, x: float) -> Kind:
    """Whether the mechanism closes up to a place with less and less margin, or ends abruptly."""
    margin = view.meter.pose(view.origin + view.sign * x).margin if math.isfinite(x) else 0.0
    return IMPOSSIBLE if margin > LEAST_MARGIN else DEAD_CENTRE


def _one_period(
    view: View, K0: float, tolerance: float, horizon: Horizon, period: float, image: Mesh | None
) -> Reach:
    mesh = image or sampled(view, panel_edges(view, 0.0, period, PANELS))
    x = _first_dead_centre(view, mesh)
    if x is not None:
        return _up_to(view, K0, tolerance, horizon, x)
    refuse_no_inertia_inside(view, mesh)
    mesh, edges, first, slow, known = resolved(view, mesh, K0, tolerance)
    if not mesh.possible.all():
        return _up_to(view, K0, tolerance, horizon, gap(view, mesh))
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
        limits = (False, last and name == DEAD_CENTRE)
        mesh = sampled(view, edges, mesh, limits)
        x = _first_dead_centre(view, mesh)
        if x is not None:
            return _up_to(view, K0, tolerance, horizon, x)
        refuse_no_inertia_inside(view, mesh)
        mesh, wanted, first, slow, known = resolved(view, mesh, K0, tolerance)
        if not mesh.possible.all():
            return _up_to(view, K0, tolerance, horizon, gap(view, mesh))
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
    if reach.kind != DEAD_CENTRE or math.isinf(time):
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


def _slowest(dips: list[Dip], known: Energies) -> tuple[float, float, float]:
    if not dips:
        return math.inf, math.nan, 0.0
    dip = min(dips, key=lambda d: abs(d.K))
    error = known.lost[dip.panel + 1] + known.rounding[dip.panel + 1]
    return dip.K, dip.x, float(error)


def _first_dead_centre(view: View, mesh: Mesh) -> float | None:
    """Where the first samples say that the mechanism does not close, or touches a dead centre.

    Cost: none where the margin does not come near zero, else some 40 single poses.
    """
    closes = gap(view, mesh) if not mesh.possible.all() else math.inf
    x = places(mesh.edges[:-1], mesh.edges[1:], mesh.limits, mesh.nodes).ravel()
    pose = view.meter.pose

    def margin(at: float) -> float:
        return pose(view.origin + view.sign * at).margin

    touched = [
        at
        for at, left in first_touch(
            x, np.where(mesh.possible, mesh.margin, SUSPECT).ravel(), margin, SUSPECT
        )
        if left <= LEAST_MARGIN and at > 0
    ]
    first = min([closes, *touched])
    return first if math.isfinite(first) else None


def _up_to(view: View, K0: float, tolerance: float, horizon: Horizon, x: float) -> Reach:
    """There is no pose beyond x, mostly because of a dead centre: look up to there only."""
    kind = _end_of_range(view, x)
    width = x / PANELS
    edges = panel_edges(view, 0.0, x, PANELS) if width > 0 else np.array([0.0, x])
    bounded = sampled(view, edges, None, (False, kind == DEAD_CENTRE))
    if not bounded.possible.all():
        inner = gap(view, bounded)
        if inner < x * (1 - 1e-9) and inner > 0:
            return _up_to(view, K0, tolerance, horizon, inner)
        return Reach(kind, x, bounded, bounded.edges)
    if float(bounded.J[-1, -1]) > POLE * float(np.median(bounded.J[-1])):
        return _towards_pole(view, K0, tolerance, horizon, x)
    refuse_no_inertia_inside(view, bounded)
    bounded, wanted, first, slow, known = resolved(view, bounded, K0, tolerance)
    nearly = _slowest(slow, known)
    if first is not None:
        return Reach("standstill", first, bounded, wanted, 0, 0.0, *nearly)
    return Reach(kind, x, bounded, wanted, 0, 0.0, *nearly)


def _towards_pole(view: View, K0: float, tolerance: float, horizon: Horizon, x: float) -> Reach:
    """Up to near a place where a link is at infinity: each panel half of the way that is left.

    No motion comes there in any time, so the search ends with the horizon.
    """
    edges, mesh = np.array([0.0]), None
    while edges.size <= NEAREST:
        left = x - float(edges[-1])
        more = x - left / 2.0 ** np.arange(1, PANELS + 1)
        edges = np.concatenate([edges, more])
        mesh = sampled(view, edges if mesh is None else np.union1d(mesh.edges, edges), mesh)
        mesh, wanted, first, slow, known = resolved(view, mesh, K0, tolerance)
        nearly = _slowest(slow, known)
        end = float(edges[-1])
        if first is not None:
            return Reach("standstill", first, mesh, wanted, 0, 0.0, *nearly)
        if end > horizon.distance or _duration(mesh, known) > horizon.time:
            break
    assert mesh is not None
    return Reach("open", end, mesh, wanted)


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
        if one.margin > 0 and one.J > 0 and math.isfinite(one.J + one.tau):
            low = middle
        else:
            high = middle
    return low
