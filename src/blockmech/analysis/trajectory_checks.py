"""Checks of a simulated motion: its states follow from one another, and the drives are idle.

A motion's dense output gives coordinates and rates by itself, and the force pass the accelerations
at which the drives have nothing to give. So over any stretch of time the coordinate must change by
the integral of the rate, the rate by that of the acceleration, and the state of a signal by that
of what its block says: whatever method made the motion, neither its steps nor its equation of
motion are asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from blockmech.analysis.evidence import Evidence, Residual, Stretches
from blockmech.analysis.signal_checks import RATES, integrated, sources
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.estimate import COMPARED, TARGET
from blockmech.dynamics.loads import largest_length
from blockmech.dynamics.roles import FREE, PRESCRIBED
from blockmech.model.structure import JointRef
from blockmech.result.motion import Motion
from blockmech.result.result import Result

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

ADVANCE = 1 / 64  # of a turn, or of the largest length, by which a stretch moves at most
LEAST, MOST = COMPARED, 16 * COMPARED  # stretches; of a longer motion as many, evenly spread


def idle(e: Evidence) -> Iterator[Residual]:
    """The drives of free drivers give nothing; against its own stop, what that pushes with.

    Accelerations solve M q'' = Q - c, so their rounding is a share of |M| |q''|: at a place without
    inertia that is far more than all forces, as what moves on is large there and cancels.
    """
    motion, t, drivers = e.run.motion, e.run.time, e.structure.drivers
    assert motion is not None
    assert t is not None
    lies = motion.held(t, (*drivers, *(x.stop for x in motion.lying)))
    free = motion.role_at(t) == FREE if motion.roles else np.ones_like(lies)
    M = e.run["mechanism.M" if len(drivers) > 1 else f"{drivers[0]}.J_red"]
    qdd = np.array([e.run[f"{driver}.acceleration"] for driver in drivers])
    inertial = np.einsum("nij,jn->in", np.abs(M).reshape(-1, *2 * qdd.shape[:1]), np.abs(qdd))
    for i, driver in enumerate(drivers):
        effort, q = e.run[f"{driver}.drive"], e.run[f"{driver}.q"]
        low, high = e.run.mechanism.scene.stops[driver].bounds if lies[:, i].any() else (0.0, 0.0)
        pulls = effort * np.where(q - low < high - q, 1, -1) < 0
        left = np.where(free[:, i] & (pulls | ~lies[:, i]), effort, 0.0)
        yield Residual("idle drive of", driver, left, e.efforts[driver] + inertial[i])


def trajectory(result: Result, motion: Motion) -> Iterator[tuple[str, float, float]]:
    """For each state of a signal and driver: a check, its relative error, and what is allowed.

    Two states, each known to the motion's stated error, may gape by twice that; a rate by as much
    as the coordinate does in a time of the motion. No error is stated of signals: they may be off
    by the share that rates are, or that was asked for.
    """
    if motion.t_end == motion.t_start:
        return
    blocks, over = result.mechanism._of_blocks, _stretches(result.mechanism, motion)
    s, t, off = blocks.structure, over.nodes, 2 * motion.error
    want = [f"{driver}.acceleration" for driver in s.drivers]
    want += [source for name in integrated(s) for source in sources(s, name)]
    how = {"friction": result.settings["friction"]}
    run = result_along(blocks, motion, t.ravel(), want, **how)
    states = motion.signal_states(t.ravel())
    rows, most = [], np.full(len(t), motion.accuracy or TARGET)
    for i, driver in enumerate(s.drivers):
        q, qd = (x.reshape(*t.shape, -1)[..., i] for x in motion.at(t))
        qdd = run[f"{driver}.acceleration"].reshape(t.shape)
        place, speed = over.size(q, qd), over.size(qd, qdd)
        haste = 1 / over.length + np.abs(qdd).max() / (np.abs(qd).max() or np.inf)  # [1/s]
        share = off * haste / speed
        rows.append((f"rate of {driver}", *over.worst(q, qd, place, off / place)))
        rows.append((f"acceleration of {driver}", *over.worst(qd, qdd, speed, share)))
        most = np.maximum(most, share)
    for name in integrated(s):
        block = s.signals[name]
        own = [states[:, s.states[JointRef(name, x)]] for x in block.block_states]
        slopes = RATES[type(block)](block, *(run[source] for source in sources(s, name)), *own)
        for x, value, slope in zip(block.block_states, own, slopes, strict=True):
            of_x, rate, terms = (y.reshape(t.shape) for y in (value, *slope))
            yield (
                f"state of {name}.{x}",
                *over.worst(of_x, rate, over.size(of_x, terms).max(), most),
            )
    yield from rows


def _instants(mechanism: Compiled, motion: Motion) -> Iterator[float]:
    """Times [s] at which something may change at once."""
    yield from (motion.t_start, motion.t_end)
    yield from (event.t for event in motion.events)
    yield from (blow.t for blow in motion.impacts)
    yield from (slips.begin for slips in motion.slips)
    for driver in {d for x in motion.roles for d, role in x.of.items() if role == PRESCRIBED}:
        yield from mechanism.scene.drive[driver].kinks
    for block in mechanism.structure.signals.values():
        t = motion.t_start
        while (t := min(block.instant(t, after=True), block.next_kink(t))) < motion.t_end:
            yield t


def _stretches(mechanism: Compiled, motion: Motion) -> Stretches:
    """Stretches of a motion, each of a small move and without an instant inside."""
    span, structure = motion.t_end - motion.t_start, mechanism.structure
    rates = motion.at(motion.times(LEAST)).qd.reshape(LEAST, -1)
    rotary = [structure.driver_joint(driver).rotary for driver in structure.drivers]
    moves = span * np.abs(rates).max(axis=0) / np.where(rotary, math.tau, largest_length(structure))
    times = motion.times(int(np.clip(moves.max() / ADVANCE, LEAST, MOST)))
    instants = np.unique([*_instants(mechanism, motion)])
    instants = instants[(instants >= motion.t_start) & (instants <= motion.t_end)]
    near = instants[np.minimum(np.searchsorted(instants, times + 1e-9 * span), len(instants)) - 1]
    ends = np.union1d(instants, times[times - near > 1e-9 * span])
    some = np.unique(np.linspace(0, len(ends) - 2, MOST).round().astype(int))
    return Stretches(ends[some], ends[some + 1])
