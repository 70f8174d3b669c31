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

from blockmech.model.structure import LinkRef
from blockmech.passes.forward import (
    BIAS,
    ZERO,
    link_acceleration,
    link_velocity,
    moves,
)
from blockmech.passes.loads import (
    cm_acceleration,
    cm_velocity,
    elements_on,
    inertia_of,
    mass_of,
    weight_on,
)
from blockmech.plan import Schedule
from blockmech.plane import dot
from blockmech.typing import Complex, Real


def squared(v: Complex, m: Real) -> Real:
    """m v.v"""
    return m * dot(v, v)


def product(v: Complex, w: Complex, m: Real) -> Real:
    """m v.w"""
    return m * dot(v, w)


def angular(om: Real, al: Real, J: Real) -> Real:
    """J times the product of two rates (or of a rate and an acceleration)."""
    return J * om * al


def moment_power(M: Real, om: Real) -> Real:
    """Power of a moment per unit driver rate."""
    return M * om


def doubled(x: Real) -> Real:
    """Twice a number."""
    return 2 * x


def effort(
    inertia: tuple[Real, ...], qdd: tuple[Real, ...], bias: Real, applied_load: Real
) -> Real:
    """Driving effort: M q'' + c - Q."""
    total = bias - applied_load
    for m, a in zip(inertia, qdd, strict=True):
        total = total + m * a
    return total


def centrifugal(dJ: Real, qd: Real) -> Real:
    """c for one driver: (dJ_red/dq) q'^2 / 2."""
    return dJ * qd * qd / 2


def share_of_inertia(s: Schedule, block: str, k: str, m: str) -> str:
    """A block's share of M_km."""
    if not (moves(s, block, k) and moves(s, block, m)):
        return "0.0"
    terms = []
    for name in s.structure.blocks[block].link_names:
        link = LinkRef(block, name)
        properties = s.structure.properties(link)
        if properties.mass:
            vk, vm = s.ask(cm_velocity, link, k), s.ask(cm_velocity, link, m)
            mass = s.ask(mass_of, link)
            if ZERO not in (vk, vm):
                pair = (squared, vk, mass) if k == m else (product, vk, vm, mass)
                terms.append(s.emit(*pair, name=f"{link}_J"))
        if properties.inertia:
            ok, om = s.ask(link_velocity, link, k).scalar, s.ask(link_velocity, link, m).scalar
            terms.append(s.emit(angular, ok, om, s.ask(inertia_of, link), name=f"{link}_J"))
    return s.share(block, k, s.sum(terms, f"{block}_J_red")) if terms else "0.0"


def share_of_load(s: Schedule, block: str, k: str) -> str:
    """A block's share of Q_k."""
    if not moves(s, block, k):
        return "0.0"
    terms = []
    for name in s.structure.blocks[block].link_names:
        link = LinkRef(block, name)
        weight = s.ask(weight_on, link)  # at the centre of mass, whose velocity is known
        if weight and (v := s.ask(cm_velocity, link, k)) != ZERO:
            terms.append(s.emit(dot, weight.forces[0], v, name=f"{link}_weight_Q"))
        load = s.ask(elements_on, link)
        if not load:
            continue
        v, om = s.ask(link_velocity, link, k)
        if load.forces and v != ZERO:
            force = s.sum(load.forces, f"{link}_applied_F")
            terms.append(s.emit(dot, force, v, name=f"{link}_Q"))
        if load.moments:
            moment = s.sum(load.moments, f"{link}_applied_M")
            terms.append(s.emit(moment_power, moment, om, name=f"{link}_Q"))
    return s.share(block, k, s.sum(terms, f"{block}_tau_red")) if terms else "0.0"


def share_of_bias(s: Schedule, block: str, k: str, mode: str) -> str:
    """A block's share of sum m v_k'.a + J om_k' al, accelerations in a mode."""
    if not moves(s, block, k):
        return "0.0"
    terms = []
    for name in s.structure.blocks[block].link_names:
        link = LinkRef(block, name)
        properties = s.structure.properties(link)
        if properties.mass:
            v, a = s.ask(cm_velocity, link, k), s.ask(cm_acceleration, link, mode)
            mass = s.ask(mass_of, link)
            if ZERO not in (v, a):
                terms.append(s.emit(product, v, a, mass, name=f"{link}_c"))
        if properties.inertia:
            om = s.ask(link_velocity, link, k).scalar
            al = s.ask(link_acceleration, link, mode).scalar
            terms.append(s.emit(angular, om, al, s.ask(inertia_of, link), name=f"{link}_c"))
    return s.sum(terms, f"{block}_bias") if terms else "0.0"


def inertia(s: Schedule, k: str, m: str) -> str:
    """M_km, for one driver J_red [kg m2 or kg]."""
    return _total(s, [s.ask(share_of_inertia, b, k, m) for b in s.structure.blocks], f"M_{k}_{m}")


def reduced_load(s: Schedule, k: str) -> str:
    """Q_k, for one driver tau_red [N m or N]."""
    return _total(s, [s.ask(share_of_load, b, k) for b in s.structure.blocks], f"Q_{k}")


def inertia_slope(s: Schedule, k: str) -> str:
    """dJ_red/dq of the only driver."""
    half = _total(s, [s.ask(share_of_bias, b, k, k) for b in s.structure.blocks], f"half_dJ_{k}")
    return half if half == "0.0" else s.emit(doubled, half, name=f"dJ_{k}")


def bias(s: Schedule, k: str) -> str:
    """c_k."""
    if len(s.structure.drivers) == 1:
        dJ = s.ask(inertia_slope, k)
        if dJ == "0.0":
            return "0.0"
        return s.emit(centrifugal, dJ, s.input("qd", k), name=f"c_{k}")
    return _total(s, [s.ask(share_of_bias, b, k, BIAS) for b in s.structure.blocks], f"c_{k}")


def drive_by_reduction(s: Schedule, k: str) -> str:
    """Driving effort of a driver by reduction, without joint friction."""
    drivers = s.structure.drivers
    if s.static:
        rows, rates, c = [], [], "0.0"
    else:
        rows = [s.ask(inertia, k, m) for m in drivers]
        rates = [s.input("qdd", m) for m in drivers]
        c = s.ask(bias, k)
    kept = [(m, a) for m, a in zip(rows, rates, strict=True) if m != "0.0"]
    inertias = "".join(f"{m}, " for m, _ in kept)
    accelerations = "".join(f"{a}, " for _, a in kept)
    q = s.ask(reduced_load, k)
    args = (f"({inertias})", f"({accelerations})", c, q)
    return s.emit(effort, *args, name=f"{k}_drive_by_reduction")


def _total(s: Schedule, shares: list[str], name: str) -> str:
    kept = [x for x in shares if x != "0.0"]
    return s.sum(kept, name) if kept else "0.0"
