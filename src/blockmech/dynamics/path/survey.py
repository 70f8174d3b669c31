"""Panels of a look ahead, cut until they decide where the motion stops.

The standstill is a root of the integrated series of the effort: panels are cut until the
series up to there, and at every place where the motion nearly stops, have ended. The
series of the time's integrand must end as well, so that the time needs few samples more.
"""

from __future__ import annotations

import itertools
import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats, remainder, rule
from blockmech.dynamics.path.mesh import RESOLVED, Mesh, View, cut, sampled
from blockmech.dynamics.path.quadrature import EPS, MOST_PANELS, ROUNDING
from blockmech.dynamics.path.standstills import (
    Dip,
    Energies,
    energies,
    first_panel_too_long,
    first_stop,
    standstill,
)

LEVELS = 40  # of bisection
HALVED = 1.6  # power to which cutting a panel in two raises the end of its series
STUCK = 0.3  # what cutting a panel should leave of the end of its series at most
NOISE = 1e-9  # end of a series, relative, that is noise if cutting does not help

Tails: TypeAlias = dict[tuple[float, float], tuple[float, float]]


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


def resolved(
    view: View, mesh: Mesh, K0: float, tolerance: float
) -> tuple[Mesh, Floats, float | None, list[Dip], Energies]:
    """Refine panels until the first standstill and every dip before it are decided.

    Returns the mesh, edges that the time will need besides, the standstill, dips, energies.
    """
    before = math.inf
    tails: Tails = {}
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
        pieces = _pieces(mesh, known, last, wanted, tolerance, tails)
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
    mesh: Mesh, known: Energies, last: int, wanted: float, tolerance: float, tails: Tails
) -> NDArray[np.intp] | None:
    """Into how many pieces each panel should be cut: 1, 2 or 4; None if none should.

    Before the panel ``last``, the series of the effort must have ended, and that of the
    time's integrand sqrt(J/K) as well, so that no more samples are needed for the time.
    Cutting a panel in two raises the relative end of a series to the power 1.6, as a rule.
    ``tails`` remembers those ends: a part that is no better than the whole was is at the
    rounding of the kernels, which grows towards a dead centre.
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
        size, edges = most + 1e-300, mesh.edges[i : i + 2]
        whole = tails.get((float(edges[0]), float(edges[1])), (math.inf, math.inf))
        ends = (mesh.limits[0] and i == 0) or (mesh.limits[1] and i == mesh.panels - 1)
        noise = math.inf if ends else NOISE
        rough = noise > bend > STUCK * whole[0]
        missed = noise > error / size > STUCK * whole[1]
        if (bend > flat and not rough) or (error > share and not good and not missed):
            still = (error / size) ** HALVED * size > share or bend**HALVED > flat
            pieces[i] = 4 if still else 2
            for part in itertools.pairwise(cut(edges, pieces[i : i + 1]).tolist()):
                tails[part] = bend, error / size
    return pieces if np.any(pieces > 1) else None
