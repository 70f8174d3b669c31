"""Checks of forces and of impacts: balances, powers, friction laws, reduction, jumps of rates.

At an impact rates jump by the impulses that are told, and energy goes as is told.
From the masses of links and from their motion at unit rates of the drivers,

    M (q'+ - q'-) = sum n^T P + S^T T,    n q'+ = -e n q'-,    loss = K- - K+ + sum q'_c+ P_c

with the rows n of stops and of drivers c that are not free, S of pairs with friction. Where it
comes to lie against the stop that it strikes, e is 0: further bounces are summed up.

Sources: [R10] Eqs. 2-16 (balances, friction), [D14] Eqs. 3-6 (reduction); Pfeiffer & Glocker,
Multibody Dynamics with Unilateral Contacts, 1996, ch. 8 (impacts).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from blockmech.analysis.evidence import Evidence, Residual, plain, total
from blockmech.analysis.free_bodies import FreeBodies, unit_motions
from blockmech.couplings.contract import LossyCoupling
from blockmech.dynamics.pair_stops import stopped_pairs
from blockmech.dynamics.roles import FREE
from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import primitives
from blockmech.ground.plane import EPS, REST_SHARE
from blockmech.model.structure import JointRef
from blockmech.result.motion import Motion
from blockmech.typing import Array, Kernel

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


def links(e: Evidence) -> Iterator[Residual]:
    """Force and moment balance of every moving link."""
    for link, (forces, moments, _) in e.balances.items():
        if link != e.structure.frame_link:
            condition, size = e.condition(link.block), e.sizes(link.block)
            yield Residual("forces on", link, total(forces).value, size.force * condition)
            yield Residual("moments on", link, total(moments).value, size.moment * condition)


def frame(e: Evidence) -> Iterator[Residual]:
    """What the mechanism does to the frame is the sum of what it transmits to it."""
    forces, moments, reach = e.balances[e.structure.frame_link]
    if forces:
        force, couple = total(forces), total(moments)
        residual = force.value - e.run["mechanism.shaking_force"]
        yield Residual("forces on", e.structure.frame, residual, force.size)
        residual = couple.value - e.run["mechanism.shaking_moment"]
        size = couple.size + force.size * reach
        yield Residual("moments on", e.structure.frame, residual, size)


def blocks(e: Evidence) -> Iterator[Residual]:
    """Power through every block: what wires bring is taken out, lost or stored."""
    for name in e.structure.blocks:
        scale = e.sizes(name).power * e.condition(name)
        yield Residual("power through", name, total(e.powers(name)).value, scale)


def couplings(e: Evidence) -> Iterator[Residual]:
    """Power through every coupling: what it takes from one link it gives to another, or loses.

    Of what goes in its efficiency comes out, whichever side drives; at rest nothing goes through.
    """
    for driver, follower in e.structure.followers.items():
        through, kind = total(e.through_coupling(driver)), e.structure.coupling_of(driver)
        lost = 1 - kind.efficiency if isinstance(kind, LossyCoupling) else kind.lost
        scale = through.size + e.sizes(e.structure.driven[driver].block).power
        loss = e.run[f"{follower.coupling}.loss"] if kind.lossy else 0.0
        yield Residual("power through", follower.coupling, through.value + loss, scale)
        if lost and e.exact.any():
            power = e.bodies.felt(driver) * e.bodies.argument(driver)
            larger = np.maximum(np.abs(power), np.abs(power + loss))
            residual = np.where(e.exact, loss - np.where(e.smooth, 0.0, lost) * larger, 0.0)
            yield Residual("efficiency of", follower.coupling, residual, scale)


def whole(e: Evidence) -> Iterator[Residual]:
    """Drive power + load power - friction power = rate of kinetic energy."""
    r = e.run
    terms = [plain(r[f"{d}.power"]) for d in e.structure.drivers]
    terms.append(plain(-np.asarray(r["mechanism.friction_power"])))
    terms += [plain(push * r[f"{ref}.slip"]) for ref, push in e.bodies.pushes.items()]
    for link in e.structure.links:
        terms += e.power_of_loads(link)
    yield Residual("power of", "the whole", total(terms).value, e.flow)


def friction(e: Evidence) -> Iterator[Residual]:
    """The law of a pair: the size from what it transmits and its slip, the sense against that.

    At rest it is no more than holds; in a motion a pair that starts to slip rubs from there on.
    Iterations that are cut short (``single``, ``successive``) keep the sense alone.
    """
    r = e.run
    moving = [e.bodies.link(link) for link in e.structure.links]
    speed = np.max(np.abs([body.v for body in moving]), axis=0)
    turning = np.max(np.abs([body.om for body in moving]), axis=0)
    threshold = math.sqrt(EPS) * _acceleration(e) if r.motion is not None else math.inf
    for name, block in e.structure.blocks.items():
        size = e.sizes(name)
        for joint, law in block.friction.items():
            ref = JointRef(name, joint)
            t, slip = r[f"{ref}.friction"], r[f"{ref}.slip"]
            slides = block.joints[joint].kind == "P"
            if not slides:
                load, terms = np.abs(r[f"{ref}.reaction"]), size.force
                arm = block.characteristic_length()
            else:
                edges = 2 / law.edge_distance if law.edge_distance else 0.0
                load = np.maximum(np.abs(r[f"{ref}.N"]), edges * np.abs(r[f"{ref}.C"]))
                terms, arm = size.force + edges * size.moment, 1.0
            if law.remembers:
                k, d = bound_kernel(law.kernel())(slip, r[f"{ref}.deflection"], law.parameters())
                scale = (np.abs(k) * terms + np.abs(d)) * e.condition(name)
                residual = t + np.where(e.smooth, 0.0, k * load + d)
                yield Residual("friction in", ref, np.where(e.exact, np.abs(residual), 0.0), scale)
                continue
            factor, drag = law.sliding(bound_kernel)(np.abs(slip), load)
            bound = np.where(e.smooth, 0.0, factor * load + drag)
            scale = (np.abs(factor) * terms + np.abs(drag)) * e.condition(name)
            # a thousand times: the solver measures speed and size of the group alone
            noise = REST_SHARE * np.maximum(speed, turning * arm)
            rests = np.abs(slip) * arm <= 1e3 * noise
            earlier, later = e.bodies.ends(ref)
            push = earlier.parting(later, slides)
            starts = rests & (np.abs(push) * arm > threshold)
            rests &= ~starts
            by_push = starts & ((slip * push >= 0) | (np.abs(slip) * arm <= noise))
            sense = np.where(by_push, np.sign(push), np.sign(slip))
            driven = np.where(rests, 0.0, np.maximum(t * sense, 0.0))
            yield Residual("friction in", ref, driven, scale)
            still = law.at_rest()
            capacity = np.where(e.smooth, 0.0, still.factor * load + still.drag)
            sliding, beyond = np.abs(np.abs(t) - bound), np.maximum(np.abs(t) - capacity, 0.0)
            residual = np.where(rests, np.minimum(beyond, sliding), sliding)
            yield Residual("friction in", ref, np.where(e.exact, residual, 0.0), scale)


def _acceleration(e: Evidence) -> Array:
    """Acceleration (n,) [m/s2] that all forces and moments would give to all masses at once."""
    blocks = e.structure.blocks
    properties = [e.structure.properties(link) for link in e.structure.links]
    reach = max(block.largest_length() for block in blocks.values()) or 1.0
    size = np.sum([e.sizes(name).force * reach + e.sizes(name).moment for name in blocks], axis=0)
    return np.asarray(size * reach / sum(x.mass * reach**2 + x.inertia for x in properties))


def bound_kernel(kernel: Kernel) -> Kernel:
    """A kernel of a law, for arrays (n,)."""
    return bind_functions({"kernel": kernel}, primitives(np.float64))["kernel"]


def reduction(e: Evidence) -> Iterator[Residual]:
    """Driving effort by reactions against the one by reduction, without friction."""
    r = e.run
    for driver in e.structure.drivers if e.smooth.any() else ():
        residual = r[f"{driver}.drive"] - r[f"{driver}.drive_by_reduction"]
        residual = np.where(e.smooth, residual, 0.0)
        yield Residual("two routes to", f"{driver}.drive", residual, e.efforts[driver])


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
