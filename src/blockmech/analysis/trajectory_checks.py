"""Checks of a simulated motion: its states follow from one another, and the drives are idle.

A motion's dense output gives coordinates and rates by itself, and the force pass the accelerations
at which the drives have nothing to give. So over any stretch of time the coordinate must change by
the integral of the rate, and the rate by that of the acceleration: whatever method made the motion,
neither its steps nor its equation of motion are asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from blockmech.analysis.evidence import Evidence, Residual
from blockmech.analysis.free_bodies import Array
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.loads import largest_length
from blockmech.motion import Motion
from blockmech.plane import EPS
from blockmech.result import Result

NODES = 16  # of Gauss' quadrature over half a stretch: exact for degree 31
ADVANCE = 1 / 32  # of a turn, or of the largest length, by which a stretch moves at most
STRETCHES = 1024  # at most: of a longer motion as many, evenly spread
ROUNDINGS = 64.0  # of each term of a quadrature and of a dense output


class Stretches(NamedTuple):
    """Stretches of a motion without an event inside."""

    edges: Array  # (m, 2) [s]
    nodes: Array  # (m, 3, NODES) [s] over the whole stretch, and over each half of it
    weights: Array  # (m, 3, NODES) [s]

    def change(self, rate: Array) -> tuple[Array, Array]:
        """Integral (m,) of a rate (m, 3, NODES), and a bound of what the quadrature is off by.

        Rounding, but for a load with a kink inside a stretch: there the whole and its halves
        differ by about as much as either is wrong, so ten times that is a bound.
        """
        whole, *halves = np.moveaxis(np.sum(self.weights * rate, axis=2), 1, 0)
        return halves[0] + halves[1], 10 * np.abs(whole - halves[0] - halves[1])


def idle(e: Evidence) -> Iterator[Residual]:
    """The drives of free drivers give nothing, but for what holds them at a standstill."""
    motion, t = e.run.motion, e.run.time
    roles = motion.role_at(t) if motion is not None and motion.roles and t is not None else None
    for i, driver in enumerate(e.structure.drivers):
        effort, rate = e.run[f"{driver}.drive"], e.run[f"{driver}.rate"]
        free = 1.0 if roles is None else roles[:, i] == "free"
        yield Residual("idle drive of", driver, free * effort * rate, e.flow)


def trajectory(result: Result, motion: Motion) -> Iterator[tuple[str, float, float]]:
    """For each driver: a check in words, its relative error, and what is allowed.

    Two states, each known to the motion's stated error, may gape by twice that; a rate may by
    as much as the coordinate does in a time of the motion.
    """
    mechanism, over = result.mechanism, _stretches(result, motion)
    if not len(over.edges):
        return
    names = [mechanism.of_driver(driver, "acceleration") for driver in mechanism.drivers]
    how = {key: result.settings[key] for key in ("friction", "tolerance", "iterations")}
    pushed = result_along(mechanism, motion, over.nodes.ravel(), names, **how)
    blows = np.isin(over.edges, [blow.t for blow in motion.impacts]) & [False, True]
    before = np.where(blows, np.nextafter(over.edges, -np.inf), over.edges)
    ends, inside = motion.at(before), motion.at(over.nodes)
    for k, driver in enumerate(mechanism.drivers):
        alone = len(mechanism.drivers) == 1
        q, qd, rate = (x if alone else x[..., k] for x in (ends.q, ends.qd, inside.qd))
        acceleration = pushed[names[k]].reshape(over.nodes.shape)
        speed, push = float(np.abs(rate).max()), float(np.abs(acceleration).max())
        shortest = float(np.diff(over.edges).min())
        haste = 1 / shortest + (push / speed if speed else 0.0)  # [1/s] of errors of places
        place = float(np.abs(q).max()) + speed * shortest
        for what, state, slope, size, off in (
            ("rate", q, rate, place, 2 * motion.error),
            ("acceleration", qd, acceleration, speed + push * shortest, 2 * motion.error * haste),
        ):
            change, unsure = over.change(slope)
            gap = np.maximum(np.abs(np.diff(state)[:, 0] - change) - unsure, 0.0)
            allowed = off / size if size else 0.0
            error = float(gap.max()) / (size or 1.0)
            yield f"{what} of {driver}", error, allowed + ROUNDINGS * NODES * EPS


def _stretches(result: Result, motion: Motion) -> Stretches:
    """Stretches between output times and events, each of a small move."""
    structure = result.mechanism.structure
    times = [motion.t_start, *(event.t for event in motion.events), motion.t_end]
    ends = np.unique([*(() if result.time is None else result.time), *times])
    alike = np.diff(ends) <= 1e-9 * (ends[-1] - ends[0])  # of two but for rounding, an event counts
    first = alike & (np.diff(np.isin(ends, times).astype(int)) > 0)
    ends = ends[~(np.append(first, False) | np.append(False, alike & ~first))]
    if len(ends) < 2:
        return Stretches(np.empty((0, 2)), *(np.empty((0, 3, NODES)),) * 2)
    q, rate = (x.reshape(len(ends), -1) for x in motion.at(ends))
    rotary = [structure.driver_joint(driver).rotary for driver in structure.drivers]
    reach = [math.tau if turns else largest_length(structure) for turns in rotary]
    speeds = np.maximum(np.abs(rate[1:]), np.abs(rate[:-1])) * np.diff(ends)[:, None]
    moves = np.maximum(np.abs(np.diff(q, axis=0)), speeds) / (ADVANCE * np.array(reach))
    counts = np.maximum(np.ceil(moves.max(axis=1)), 1).astype(int)
    spans = zip(ends[:-1], ends[1:], counts, strict=True)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in spans]
    starts = np.concatenate([*pieces, ends[-1:]])
    edges = np.stack([starts[:-1], starts[1:]], axis=1)
    edges = edges[np.unique(np.linspace(0, len(edges) - 1, STRETCHES).round().astype(int))]
    start, end = edges.T
    middle = (start + end) / 2
    x, w = np.polynomial.legendre.leggauss(NODES)
    parts = [(start, end), (start, middle), (middle, end)]
    nodes = [(a + b)[:, None] / 2 + (b - a)[:, None] / 2 * x for a, b in parts]
    weights = [(b - a)[:, None] / 2 * w for a, b in parts]
    return Stretches(edges, np.stack(nodes, axis=1), np.stack(weights, axis=1))
