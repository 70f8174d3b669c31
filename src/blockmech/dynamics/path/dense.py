"""Dense output of a quadrature: place and speed at any time, time at any place."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import (
    Floats,
    angle,
    crossing,
    half_integral,
    half_waves,
    integral,
    rule,
    series,
)
from blockmech.dynamics.path.passage import Place
from blockmech.dynamics.path.quadrature import Quadrature

NEWTON_STEPS = 8
NEXT_IS_EXACT = 1e-8  # relative step of Newton's method after which the next is rounding
AT_END, FADED = 1e-9, 1e-7  # share of the panel that is left; dt/dv there, of the largest
CHUNK = 8192  # outputs at once


def place(quad: Quadrature, time: Floats, shift: Floats | None = None) -> Place:
    """Place and speed at times [s] from the low end.

    ``shift`` (m,) [J] is added to the kinetic energy: a later turn of a secular motion.
    """
    if time.size == 1 and shift is None:
        x, rate = place_one(quad, float(time[0]))
        return Place(np.array([x]), np.array([rate]))
    if time.size > CHUNK:
        parts = [
            place(quad, time[i : i + CHUNK], None if shift is None else shift[i : i + CHUNK])
            for i in range(0, time.size, CHUNK)
        ]
        return Place(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    if shift is None:
        start, panel, duration = _panel_at(quad.clock, time)
    else:
        start, panel, duration = _shifted_panel_at(quad, time, shift)
    mirrored, ended = quad.mirrored[panel], quad.ended[panel]
    local = np.where(mirrored, start + duration - time, time - start)
    F = _speeds(quad, panel, shift)
    return _walked(quad, panel, F, local, mirrored, ended)


def place_one(quad: Quadrature, time: float) -> tuple[float, float]:
    """`place` at one time, without the overhead of arrays of one."""
    clock = quad.clock
    p = min(max(int(clock.searchsorted(time, side="right")) - 1, 0), quad.mesh.panels - 1)
    mirrored, ended = bool(quad.mirrored[p]), bool(quad.ended[p])
    local = float(clock[p + 1]) - time if mirrored else time - float(clock[p])
    F, L = quad.F[p], float(quad.mesh.length[p])
    r, n = rule(F.size), F.size - 1
    weight = math.sqrt(L) if ended else L
    table = weight / 2 * (F @ (r.integrate_half if ended else r.integrate))
    j = int(table.searchsorted(local))
    nodes = r.root if ended else r.low
    t0, w0 = (float(table[j - 1]), float(nodes[j - 1])) if j else (0.0, 0.0)
    t1, w1 = (float(table[j]), float(nodes[j])) if j < F.size else (float(quad.duration[p]), 1.0)
    rises = weight * float(F[max(j - 1, 0)]), weight * float(F[min(j, n)])
    w = crossing((t0 - local, t1 - local), (w0, w1), rises)
    c = F @ r.cosine
    s = half_waves(c) if ended else F @ r.sine
    for _ in range(NEWTON_STEPS):
        phi = 2 * math.asin(w if ended else math.sqrt(w))
        slope = float(np.cos(r.k * phi) @ c)
        if slope == 0.0:
            break
        if ended:
            t = weight / 2 * float(np.sin((r.k + 0.5) * phi) @ s)
        else:
            t = weight * float(np.sin(r.k_next * (phi / 2)) ** 2 @ s)
        new = min(max(w + (local - t) / (weight * slope), 0.0), 1.0)
        done = abs(new - w) <= NEXT_IS_EXACT * w
        w = new
        if done:
            break
    part = w * w if ended else w
    slope = float(np.cos(r.k * (2 * math.asin(math.sqrt(part)))) @ c)
    low, high = float(quad.mesh.edges[p]), float(quad.mesh.edges[p + 1])
    from_low = 1 - part if mirrored else part
    from_high = part if mirrored else 1 - part
    at_high = bool(quad.mesh.limits[1]) and p == quad.mesh.panels - 1
    at_low = bool(quad.mesh.limits[0]) and p == 0
    left = from_high if at_high else from_low if at_low else 1.0
    if left <= AT_END and abs(slope) <= FADED * float(np.abs(F).max()):
        rate = _finite(F, L, part)
        return (high - (L * from_high) ** 2 if at_high else low + (L * from_low) ** 2), rate
    rate = (2 * math.sqrt(L * part) if ended else 1.0) / slope if slope else math.inf
    if at_high:
        return high - (L * from_high) ** 2, 2 * L * from_high * rate
    if at_low:
        return low + (L * from_low) ** 2, 2 * L * from_low * rate
    return (high - L * part if mirrored else low + L * part), rate


def when(quad: Quadrature, x: Floats, shift: Floats | None = None) -> Floats:
    """Time [s] from the low end at places x (m,)."""
    edges = quad.mesh.edges
    panel = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, quad.mesh.panels - 1)
    low, high = edges[panel], edges[panel + 1]
    from_low = (x - low) / (high - low)
    from_high = (high - x) / (high - low)
    limited_high, limited_low = _limited(quad, panel)
    from_low, from_high = (
        np.where(
            limited_high, 1 - np.sqrt(from_high), np.where(limited_low, np.sqrt(from_low), from_low)
        ),
        np.where(
            limited_high,
            np.sqrt(from_high),
            np.where(limited_low, 1 - np.sqrt(from_low), from_high),
        ),
    )
    mirrored, ended = quad.mirrored[panel], quad.ended[panel]
    phi = angle(np.where(mirrored, from_high, from_low))
    F = _speeds(quad, panel, shift)
    local = _elapsed(quad, panel, F, phi, ended)
    if shift is None:
        start, duration = quad.clock[panel], quad.duration[panel]
    else:
        clocks = _shifted_clocks(quad, shift)
        start = np.take_along_axis(clocks, panel[:, None], 1)[:, 0]
        duration = np.take_along_axis(clocks, panel[:, None] + 1, 1)[:, 0] - start
    return np.asarray(start + np.where(mirrored, duration - local, local))


def _panel_at(clock: Floats, time: Floats) -> tuple[Floats, NDArray[np.intp], Floats]:
    panel = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, clock.size - 2)
    return clock[panel], panel, clock[panel + 1] - clock[panel]


def _shifted_panel_at(
    quad: Quadrature, time: Floats, shift: Floats
) -> tuple[Floats, NDArray[np.intp], Floats]:
    clocks = _shifted_clocks(quad, shift)
    panel = np.clip((clocks <= time[:, None]).sum(axis=1) - 1, 0, quad.mesh.panels - 1)
    start = np.take_along_axis(clocks, panel[:, None], 1)[:, 0]
    stop = np.take_along_axis(clocks, panel[:, None] + 1, 1)[:, 0]
    return start, panel, stop - start


def _shifted_clocks(quad: Quadrature, shift: Floats) -> Floats:
    """Times at the edges with more energy: (m, p + 1). Regular panels only."""
    unique, back = np.unique(shift, return_inverse=True)
    clocks = np.zeros((unique.size, quad.mesh.panels + 1))
    r = rule(quad.J.shape[1])
    for i, extra in enumerate(unique.tolist()):
        F = np.sqrt(quad.J / (2 * (quad.K + extra)))
        clocks[i, 1:] = np.cumsum(quad.mesh.length / 2 * (F @ r.total))
    return np.asarray(clocks[back])


def _speeds(quad: Quadrature, panel: NDArray[np.intp], shift: Floats | None) -> Floats:
    if shift is None:
        return np.asarray(quad.F[panel])
    return np.asarray(np.sqrt(quad.J[panel] / (2 * (quad.K[panel] + shift[:, None]))))


def _elapsed(
    quad: Quadrature, panel: NDArray[np.intp], F: Floats, phi: Floats, ended: NDArray[np.bool_]
) -> Floats:
    """Time since the panel's own beginning, at the angles phi."""
    r = rule(F.shape[1])
    L = quad.mesh.length[panel]
    if not ended.any():
        return np.asarray(L / 2 * integral(F @ r.sine, phi))
    if ended.all():
        return np.asarray(np.sqrt(L) / 2 * half_integral(F @ r.cosine, phi))
    out = np.empty_like(phi)
    for mask in (ended, ~ended):
        out[mask] = _elapsed(quad, panel[mask], F[mask], phi[mask], ended[mask])
    return out


def _walked(
    quad: Quadrature,
    panel: NDArray[np.intp],
    F: Floats,
    local: Floats,
    mirrored: NDArray[np.bool_],
    ended: NDArray[np.bool_],
) -> Place:
    """Invert the time on each panel: table of the nodes, then Newton.

    The unknown w is v/L on a regular panel and sqrt(v/L) on an ended one: time is
    smooth in it with a slope that never vanishes.
    """
    r = rule(F.shape[1])
    L = quad.mesh.length[panel]
    weight = np.where(ended, np.sqrt(L), L)
    here = ended[:, None]
    table = weight[:, None] / 2 * np.where(here, F @ r.integrate_half, F @ r.integrate)
    grid = np.where(here, np.sqrt(r.low), r.low)
    whole = weight / 2 * np.where(ended, F @ r.total_half, F @ r.total)
    j = (table < local[:, None]).sum(axis=1)
    edge = np.zeros((local.size, 1))
    t_grid = np.concatenate([edge, table, whole[:, None]], axis=1)
    w_grid = np.concatenate([edge, grid, edge + 1], axis=1)
    rows = np.arange(local.size)
    t0, t1 = t_grid[rows, j], t_grid[rows, j + 1]
    w0, w1 = w_grid[rows, j], w_grid[rows, j + 1]
    w = w0 + (w1 - w0) * np.clip((local - t0) / (t1 - t0), 0.0, 1.0)
    c = F @ r.cosine
    phi = _phi(w, ended)
    for _ in range(NEWTON_STEPS):
        slope = weight * series(c, phi)
        step = (local - _elapsed(quad, panel, F, phi, ended)) / slope
        new = np.clip(w + step, 0.0, 1.0)
        change = np.abs(new - w)
        w = new
        phi = _phi(w, ended)
        if not (change > NEXT_IS_EXACT * w + 1e-300).any():
            break
    F_there = series(c, phi)
    speed = 1 / F_there
    part = np.sin(phi / 2) ** 2
    speed = np.where(ended, 2 * np.sqrt(L * part) * speed, speed)
    edges = quad.mesh.edges
    begin = np.where(mirrored, edges[panel + 1], edges[panel])
    x = begin + np.where(mirrored, -L, L) * part
    limited_high, limited_low = _limited(quad, panel)
    if limited_high.any() or limited_low.any():
        rest = np.cos(phi / 2) ** 2
        to_high = np.where(mirrored, part, rest)
        to_low = np.where(mirrored, rest, part)
        x = np.where(limited_high, edges[panel + 1] - (L * to_high) ** 2, x)
        x = np.where(limited_low, edges[panel] + (L * to_low) ** 2, x)
        speed = np.where(limited_high, 2 * L * to_high * speed, speed)
        speed = np.where(limited_low, 2 * L * to_low * speed, speed)
        left = np.where(limited_high, to_high, np.where(limited_low, to_low, 1.0))
        faded = (left <= AT_END) & (np.abs(F_there) <= FADED * np.abs(F).max(axis=1))
        for i in np.flatnonzero(faded).tolist():
            speed[i] = _finite(F[i], float(L[i]), float(part[i]))
    return Place(x, speed)


def _finite(F: Floats, L: float, part: float) -> float:
    """Rate at an end that the driver meets at a finite one: 0/0, by l'Hopital."""
    return 2 * L / abs(float(F @ rule(F.size).ends[:, 3 if part > 0.5 else 2]))


def _phi(w: Floats, ended: NDArray[np.bool_]) -> Floats:
    return np.asarray(2 * np.arcsin(np.where(ended, w, np.sqrt(w))))


def _limited(
    quad: Quadrature, panel: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each panel ends at a dead centre: at its high end, at its low end."""
    low, high = quad.mesh.limits
    return (panel == quad.mesh.panels - 1) & high, (panel == 0) & low
