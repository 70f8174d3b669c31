"""Checks of loads: each gives what its declaration says, here said a second time, in NumPy.

Elements of other packages, and subclasses of these, are taken at their word.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from blockmech.analysis.evidence import (
    TOLERANCE,
    Evidence,
    Residual,
    Term,
    plain,
    power,
    table_of,
    total,
)
from blockmech.analysis.free_bodies import Body
from blockmech.functions.pieces import Function
from blockmech.loads import Couple, Element, Following, Force, Motor, Spring, Thrust, TorsionSpring
from blockmech.loads.contract import LAW
from blockmech.loads.laws import DC, Constant, Fourier, Polynomial, Signal, Table
from blockmech.model.structure import JointRef
from blockmech.typing import Array


def _fourier(law: Fourier, x: Array) -> Array:
    w = math.tau / law.period if law.period else 1 / (law.turns or 1)
    waves = [a * np.cos(k * w * x) for k, a in enumerate(law.cosines, start=1)]
    waves += [b * np.sin(k * w * x) for k, b in enumerate(law.sines, start=1)]
    return np.asarray(law.mean + np.sum([0 * x, *waves], axis=0))


LAWS: Mapping[type, Callable[[Any, Array], Array]] = {
    Constant: lambda law, x: law.value + 0 * x,
    Polynomial: lambda law, x: np.polynomial.polynomial.polyval(x, law.coefficients),
    Table: table_of,
    Fourier: _fourier,
    Signal: lambda law, x: x,
    DC: lambda law, x: law.stall_moment * (1 - x / law.no_load_speed),
}


Ends = Mapping[str, Body]


def _argument(e: Evidence, load: Following, variable: str, ends: Ends) -> tuple[Array, Array]:
    """An argument of a law (n,), and the size of what it is made of."""
    if variable == "signal":
        name = next(n for n, x in e.structure.elements.items() if x is load)
        value = e.run[e.structure.signal_wires[JointRef(name, LAW)]]
        return value, np.abs(value)
    if variable == "time":
        time = np.asarray(e.run.time)
        return time, np.abs(time)
    if load.driver is not None:
        value = e.run[f"{load.driver}.{'q' if variable == 'coordinate' else 'rate'}"]
        return value, np.abs(value)
    if isinstance(load, Force):
        at = ends["at"]
        speed = np.abs(at.v) + np.abs(at.om) * np.abs(at.p)
        vector, size = (at.p, np.abs(at.p)) if variable == "coordinate" else (at.v, speed)
        return (np.conj(_direction(load, at)) * vector).real, size
    a, b = ends["a"], ends["b"]
    if isinstance(load, Motor):
        if variable == "coordinate":
            return np.angle(b.e * np.conj(a.e)), np.ones(e.run.n)
        return b.om - a.om, np.abs(a.om) + np.abs(b.om)
    k = int(variable == "rate")
    u = _line(load, a, b)
    component = (np.conj(u) * a.seen(b)[k]).real
    return component, a.sizes(b)[k]


def _line(load: Any, a: Body, b: Body) -> Array:
    """Unit direction (n,) of a thrust on b."""
    if load.direction is None:
        return np.asarray((b.p - a.p) / np.abs(b.p - a.p))
    return np.asarray(a.e * load.direction.z / abs(load.direction.z))


def _law(e: Evidence, load: Following, ends: Ends) -> Term:
    """What a law says (n,), and by how much its arguments' rounding may change it."""
    pairs_read = [_argument(e, load, variable, ends) for variable in load.variables()]
    x = [value for value, _ in pairs_read]

    def of(*arguments: Array) -> Array:
        if isinstance(load.law, Function):
            return np.array([load.law.call(*map(float, row)) for row in np.transpose(arguments)])
        return LAWS[type(load.law)](load.law, *(arguments or (np.zeros(e.run.n),)))

    value = of(*x)
    size = np.abs(value)
    for i, (_, magnitude) in enumerate(pairs_read):
        for step in (-TOLERANCE, TOLERANCE):
            moved = of(*x[:i], x[i] + step * magnitude, *x[i + 1 :])
            size = np.fmax(size, np.abs(value) + np.abs(moved - value) / TOLERANCE)
    return Term(value, size)


def _force(e: Evidence, load: Force, ends: Ends) -> dict[str, Term]:
    if load.force is None:
        force = _law(e, load, ends)
        return {"at": force._replace(value=_direction(load, ends["at"]) * force.value)}
    turned = ends["at"].e if load.axes == "link" else 1.0 + 0 * ends["at"].e
    return {"at": plain(load.force.z * turned)}


def _direction(load: Any, at: Body) -> Array:
    """Unit direction (n,) of a force by a law."""
    turned = at.e if load.axes == "link" else 1.0 + 0 * at.e
    return np.asarray(turned * load.direction.z / abs(load.direction.z))


def _couple(e: Evidence, load: Couple, ends: Ends) -> dict[str, Term]:
    return {"on": plain(np.full(e.run.n, load.moment))}


def _spring(e: Evidence, load: Spring, ends: Ends) -> dict[str, Term]:
    """k (L - L0) + c L' from a to b; where the ends meet, along their relative velocity."""
    a, b = ends["a"], ends["b"]
    d, v = b.p - a.p, b.v - a.v
    length, meet = np.abs(d), d == 0
    u = np.where(meet, v, d) / np.where(meet, np.abs(v) + (v == 0), length)
    rest = np.where(meet & (load.free_length * load.stiffness != 0), math.nan, load.free_length)
    pull = u * (load.stiffness * (length - rest) + load.damping * (np.conj(u) * v).real)
    reach, speed, _ = a.sizes(b)
    apart = np.where(meet, 1.0, length)
    size = abs(load.stiffness) * (reach + load.free_length * (1 + reach / apart))
    size = size + load.damping * (speed + np.abs(v) * reach / apart)
    return {"a": Term(pull, size), "b": Term(-pull, size)}


def _torsion(e: Evidence, load: TorsionSpring, ends: Ends) -> dict[str, Term]:
    a, b = ends["a"], ends["b"]
    theta = np.angle(b.e * np.conj(a.e * np.exp(1j * load.rest_angle)))
    moment = load.stiffness * theta + load.damping * (b.om - a.om)
    size = math.pi * abs(load.stiffness) + load.damping * (np.abs(a.om) + np.abs(b.om))
    return {"a": Term(moment, size), "b": Term(-moment, size)}


def _motor(e: Evidence, load: Motor, ends: Ends) -> dict[str, Term]:
    moment = _law(e, load, ends)
    return {"a": moment._replace(value=-moment.value), "b": moment}


def _thrust(e: Evidence, load: Thrust, ends: Ends) -> dict[str, Term]:
    a, b = ends["a"], ends["b"]
    thrust = _law(e, load, ends)
    size = thrust.size
    if load.direction is None:
        size = size * (1 + a.sizes(b)[0] / np.abs(b.p - a.p))
    force = _line(load, a, b) * thrust.value
    return {"a": Term(-force, size), "b": Term(force, size)}


DECLARED: Mapping[type[Element], Callable[[Evidence, Any, Ends], dict[str, Term]]] = {
    Force: _force,
    Couple: _couple,
    Spring: _spring,
    TorsionSpring: _torsion,
    Motor: _motor,
    Thrust: _thrust,
}


def loads(e: Evidence) -> Iterator[Residual]:
    """Each load gives what it declares, and its power is what it gives times the motion."""
    for name, load in e.structure.elements.items():
        ends = {t: e.bodies.held(JointRef(name, t)) for t in load.terminals}
        efforts = {
            t: e.run[f"{name}.{t}.{'force' if terminal.kind == 'point' else 'couple'}"]
            for t, terminal in load.terminals.items()
        }
        if type(load) in DECLARED:
            with np.errstate(all="ignore"):
                declared = DECLARED[type(load)](e, load, ends)
            for t, term in declared.items():
                yield Residual("load of", name, efforts[t] - term.value, term.size)
        powers = [plain(-e.run[f"{name}.power"])]
        for t, end in ends.items():
            if load.terminals[t].kind == "point":
                link = e.bodies.link(e.structure.holds[JointRef(name, t)].on)
                size = np.abs(efforts[t]) * link.sizes(end)[1]  # its speed may cancel on its link
                powers.append(power(efforts[t], end.v)._replace(size=size))
            else:
                powers.append(plain(efforts[t] * end.om))
        balance = total(powers)
        yield Residual("load of", name, balance.value, balance.size)


def energies(e: Evidence) -> Iterator[Residual]:
    """Energies are those of the links and springs."""
    moving = [link for link in e.structure.links if link != e.structure.frame_link]
    kinetic, potential = [], []
    gravity = e.run.mechanism.scene.gravity.z
    for link in moving:
        properties = e.structure.properties(link)
        cm = e.bodies.link(link).at(properties.cm.z)
        kinetic += [
            plain(properties.mass * np.abs(cm.v) ** 2 / 2),
            plain(properties.inertia * cm.om**2 / 2),
        ]
        potential.append(power(np.full(e.run.n, -properties.mass * gravity), cm.p))
    elastic = [(n, x) for n, x in e.structure.elements.items() if x.energy() is not None]
    declared = all(type(load) in DECLARED for _, load in elastic)
    for name, load in elastic if declared else ():
        a, b = (e.bodies.held(JointRef(name, t)) for t in load.terminals)
        potential.append(_stored(load, a, b))
    for kind, terms in {"kinetic": kinetic, "potential": potential if declared else []}.items():
        if terms:
            reported = plain(-e.run[f"mechanism.{kind}_energy"])
            balance = total([reported, *terms])
            yield Residual(f"{kind} energy of", "the whole", balance.value, balance.size)


def _stored(load: Any, a: Body, b: Body) -> Term:
    """Energy [J] of a spring."""
    k = load.stiffness
    if isinstance(load, TorsionSpring):
        theta = np.angle(b.e * np.conj(a.e * np.exp(1j * load.rest_angle)))
        return Term(k * theta**2 / 2, abs(k) * math.pi**2 / 2 + 0 * theta)
    length, size = np.abs(b.p - a.p), a.sizes(b)[0] + load.free_length
    return Term(k * (length - load.free_length) ** 2 / 2, abs(k) * size**2 / 2)
