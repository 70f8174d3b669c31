r"""Checks of blows: rates jump by the impulses that are told, and energy goes as is told.

From the masses of links and from their motion at unit rates of the drivers,

    M (q'+ - q'-) = sum n^T P + S^T T,    n q'+ = -e n q'-,    loss = K- - K+ + sum q'_c+ P_c

with the rows n of stops and of drivers c that are not free, S of pairs with friction. Where it
comes to lie against the stop that it strikes, e is 0: further bounces are summed up.

Source: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, ch. 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from blockmech.analysis.evidence import Residual
from blockmech.analysis.free_bodies import FreeBodies, unit_motions
from blockmech.dynamics.pair_stops import stopped_pairs
from blockmech.dynamics.roles import FREE
from blockmech.model.structure import JointRef
from blockmech.result.motion import Motion
from blockmech.typing import Array

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


def blows(mechanism: Compiled, motion: Motion) -> Iterator[Residual]:
    """Momentum, restitution and loss of the blows (m,) of a motion."""
    s, hits = mechanism.structure, motion.impacts
    q, before, after = (np.array([getattr(x, k) for x in hits]).T for k in ("q", "before", "after"))
    bodies, t = unit_motions(mechanism._of_blocks, q), np.array([hit.t for hit in hits])
    margins = [margin.reshape(q.shape) for margin in bodies.run.quality.margin.values()]
    condition = 1 / np.sqrt(np.min([0 * q + 1, *margins], axis=(0, 1)))
    speeds, jump = np.abs(before) + np.abs(after), after - before
    left, sizes = np.zeros((2, *q.shape))
    for link in s.links:
        own = s.properties(link)
        at = bodies.link(link).at(own.cm.z)
        for factor, rates in ((own.mass, at.v), (own.inertia, at.om)):
            v = rates.reshape(q.shape)
            left += factor * (np.conj(v) * np.sum(v * jump, axis=0)).real
            sizes += factor * np.abs(v) * np.sum(np.abs(v) * speeds, axis=0)
    energy, loss = np.sum(speeds * sizes, axis=0), np.array([hit.loss for hit in hits])
    loss += np.sum((before + after) * left, axis=0) / 2
    free = motion.role_at(t).T == FREE if motion.roles else np.ones(q.shape, bool)
    rows = _rows(mechanism, motion, bodies, q)
    acts = [{**hit.friction, **hit.pushes} for hit in hits]
    for name in dict.fromkeys(name for acting in acts for name in acting):
        impulse, n = np.array([acting.get(name, 0.0) for acting in acts]), rows[name]
        left, sizes = left - n * impulse, sizes + np.abs(n * impulse)
        held = ~free[s.drivers.index(name)] if name in s.drivers else np.zeros(len(hits), bool)
        loss -= np.where(held, impulse * np.sum(n * after, axis=0), 0.0)
        if name in mechanism.scene.stops:
            lies = np.isin(t, [x.begin for x in motion.lying if x.stop == name])
            bounces = np.array([hit.driver == name for hit in hits]) & ~lies
            e = np.where(bounces, mechanism.scene.stops[name].restitution or 0.0, 0.0)
            apart = np.sum(n * (after + e * before), axis=0)
            pushes = (impulse != 0) & ~held
            scale = condition * np.sum(np.abs(n) * speeds, axis=0)
            yield Residual("restitution of", name, np.where(pushes, apart, 0.0), scale)
    touches = [s.pair_name(mesh) for mesh in s.meshes if s.touches(mesh)]  # slip as nobody says
    told = np.array([not any(hit.friction.get(name) for name in touches) for hit in hits])
    for driver, momentum in zip(s.drivers, left * told, strict=True):
        yield Residual("blows on", driver, momentum, condition * np.max(sizes, axis=0))
    yield Residual("loss of", "blows", loss, condition * energy)


def _rows(mechanism: Compiled, motion: Motion, bodies: FreeBodies, q: Array) -> Mapping[str, Array]:
    """Rates (k, m) at unit rates of the drivers: of these, of pairs, couplings and stops."""
    s = mechanism.structure
    rows = dict(zip(s.drivers, np.eye(len(q))[..., None] + 0 * q, strict=True))
    for ref in (JointRef(name, x) for name, block in s.blocks.items() for x in block.joints):
        rows[str(ref)] = bodies.run[f"{ref}.slip"].reshape(q.shape)
    for mesh, driver in s.meshes.items():
        rows[s.pair_name(mesh)] = (1 - s.separates(mesh)) * bodies.argument(driver).reshape(q.shape)
    stops = stopped_pairs(mechanism, [name for hit in motion.impacts for name in hit.pushes])
    named = stops.by_name.items()
    return rows | {name: sense * rows[str(ref)] for name, (ref, sense) in named}
