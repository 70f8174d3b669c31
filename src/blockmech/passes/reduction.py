"""The reduction pass: inertia and loads reduced straight to the drivers.

With the unit-rate motion of driver k (primes), over all links

    M_kl = sum m v_k'.v_l' + J om_k' om_l'        ([D14] Eqs. 5-6; J_red for one driver)
    Q_k  = sum F.v_k' + M om_k'                   ([D14] Eqs. 3-4; tau_red)
    c_k  = sum m v_k'.a + J om_k' al,  a at the actual rates and q'' = 0

and the driving effort is M q'' + c - Q. For one driver c = (dJ_red/dq) q'^2 / 2,
with dJ_red/dq = 2 sum m v'.a' + J om' al' from accelerations at unit rate.
Reducing straight to the driver needs no rate of a rocker as a divisor.
"""

from __future__ import annotations

from collections.abc import Callable

from blockmech.model.structure import LinkRef
from blockmech.passes.forward import BIAS, Moved, link_acceleration, link_velocity, moves
from blockmech.passes.loads import (
    cm_acceleration,
    cm_velocity,
    elements_on,
    inertia_of,
    mass_of,
    weight_on,
)
from blockmech.plan.plan import Schedule
from blockmech.plan.values import NOUGHT, TWO, Value, dot

Motion = tuple[Callable[..., Value], Callable[..., Moved]]
VELOCITY: Motion = (cm_velocity, link_velocity)
ACCELERATION: Motion = (cm_acceleration, link_acceleration)


def _products(s: Schedule, block: str, k: str, motion: Motion, mode: str) -> list[Value]:
    """m v_k'.x and J om_k' y of a block's links, x and y their motion in a mode."""
    at_cm, turning = motion
    terms = []
    for name in s.structure.blocks[block].link_names:
        link = LinkRef(block, name)
        properties = s.structure.properties(link)
        if properties.mass:
            v, x = s.ask(cm_velocity, link, k), s.ask(at_cm, link, mode)
            terms.append(s.line(s.ask(mass_of, link) * dot(v, x), f"{link}_J"))
        if properties.inertia:
            om, y = s.ask(link_velocity, link, k).scalar, s.ask(turning, link, mode).scalar
            terms.append(s.line(s.ask(inertia_of, link) * om * y, f"{link}_J"))
    return terms


def share_of_inertia(s: Schedule, block: str, k: str, m: str) -> Value:
    """A block's share of M_km."""
    if not (moves(s, block, k) and moves(s, block, m)):
        return NOUGHT
    return _share(s, block, k, _products(s, block, k, VELOCITY, m), "J_red")


def share_of_bias(s: Schedule, block: str, k: str, mode: str) -> Value:
    """A block's share of sum m v_k'.a + J om_k' al, accelerations in a mode."""
    if not moves(s, block, k):
        return NOUGHT
    return s.sum(_products(s, block, k, ACCELERATION, mode), f"{block}_bias")


def share_of_load(s: Schedule, block: str, k: str) -> Value:
    """A block's share of Q_k."""
    if not moves(s, block, k):
        return NOUGHT
    terms = []
    for name in s.structure.blocks[block].link_names:
        link = LinkRef(block, name)
        weight = s.ask(weight_on, link)  # at the centre of mass, whose velocity is known
        if weight:
            v = s.ask(cm_velocity, link, k)
            terms.append(s.line(dot(weight.forces[0], v), f"{link}_weight_Q"))
        load = s.ask(elements_on, link)
        if not load:
            continue
        v, om = s.ask(link_velocity, link, k)
        if not v.zero:
            terms.append(s.line(dot(s.sum(load.forces, f"{link}_applied_F"), v), f"{link}_Q"))
        terms.append(s.line(s.sum(load.moments, f"{link}_applied_M") * om, f"{link}_Q"))
    return _share(s, block, k, terms, "tau_red")


def _share(s: Schedule, block: str, k: str, terms: list[Value], quantity: str) -> Value:
    total = s.sum(terms, f"{block}_{quantity}")
    return total if total.zero else s.share(block, k, total)


def inertia(s: Schedule, k: str, m: str) -> Value:
    """M_km, for one driver J_red [kg m2 or kg]."""
    return s.sum((s.ask(share_of_inertia, b, k, m) for b in s.structure.blocks), f"M_{k}_{m}")


def reduced_load(s: Schedule, k: str) -> Value:
    """Q_k, for one driver tau_red [N m or N]."""
    return s.sum((s.ask(share_of_load, b, k) for b in s.structure.blocks), f"Q_{k}")


def inertia_slope(s: Schedule, k: str) -> Value:
    """dJ_red/dq of the only driver."""
    half = s.sum((s.ask(share_of_bias, b, k, k) for b in s.structure.blocks), f"half_dJ_{k}")
    return s.line(TWO * half, f"dJ_{k}")


def bias(s: Schedule, k: str) -> Value:
    """c_k."""
    if len(s.structure.drivers) > 1:
        return s.sum((s.ask(share_of_bias, b, k, BIAS) for b in s.structure.blocks), f"c_{k}")
    dJ, qd = s.ask(inertia_slope, k), s.input("qd", k)
    return s.line(dJ * qd * qd / TWO, f"c_{k}")


def drive_by_reduction(s: Schedule, k: str) -> Value:
    """Driving effort of a driver by reduction, M q'' + c - Q, without joint friction."""
    effort = (NOUGHT if s.static else s.ask(bias, k)) - s.ask(reduced_load, k)
    for m in () if s.static else s.structure.drivers:
        if not (M := s.ask(inertia, k, m)).zero:
            effort += M * s.input("qdd", m)
    return s.line(effort, f"{k}_drive_by_reduction")
