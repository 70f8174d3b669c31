"""Checks of couplings: the law between both coordinates, and the line along which links push.

Power and balances say what turns a wheel; what only loads its bearings is said here, from the
centres and the sense of the moment. Couplings of other packages, and subclasses of these, are
taken at their word; so are the coordinates of Geneva drives, segments and profiles of points,
whose derivatives are not, and the lines of action of cams that rub.

Source: Niemann & Winter, Maschinenelemente II, 2003, ch. 21, and III, 2004, ch. 27.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Polynomial as Series

from blockmech.analysis.evidence import Evidence, Residual, Stretches
from blockmech.analysis.force_checks import bound_kernel
from blockmech.analysis.free_bodies import Body
from blockmech.couplings.belt import Belt
from blockmech.couplings.cam import Cam
from blockmech.couplings.gear import Gear
from blockmech.couplings.laws import Polynomial, Table
from blockmech.couplings.rack import Rack
from blockmech.couplings.ratio import Ratio
from blockmech.model.meshing import coupling_numbers
from blockmech.model.spots import marker_place
from blockmech.model.structure import Follower
from blockmech.typing import Array, Real


class Contact(NamedTuple):
    """What acts on a driven link, and where both sides are; arrays (n,).

    lead, on : the leading pair's marker and the driven one's, with the pairs' directions
    link : the driven link
    F, M : force [N], and its moment [N m] about the driven marker
    force, moment, reach : sums of absolute forces [N] and moments [N m], of coordinates [m]
    slides : whether the leading pair is prismatic
    """

    lead: Body
    on: Body
    link: Body
    F: Array
    M: Array
    force: Array
    moment: Array
    reach: Array
    slides: bool

    def between(self) -> tuple[Array, Array]:
        """Distance [m] of the markers, and the part [N] of the force that pushes them apart."""
        d = self.on.p - self.lead.p
        return np.abs(d), (np.conj(d) * self.F).real / np.abs(d)

    def of_wheels(self, residual: Array, radius: Real) -> tuple[Array, Array]:
        """What is left [N], by forces, and moments at the radius of the driven wheel."""
        digits = 1 + self.reach / self.between()[0]
        return residual, (self.force + self.moment / radius) * digits


# -- the line of action: what is left, and its size -------------------------------------------


def _gear(kind: Gear, c: Contact) -> tuple[Array, Array]:
    """Outer wheels push each other apart; a ring and the wheel in it are pushed together."""
    distance, apart = c.between()
    driving, driven = kind.teeth
    radius = distance * driven / abs(driven - driving if kind.internal else driven + driving)
    radial = math.tan(kind.pressure_angle) * np.abs(c.M) / radius
    return c.of_wheels(apart + (radial if kind.internal else -radial), radius)


def _rack(kind: Rack, c: Contact) -> tuple[Array, Array]:
    """The rack passes right of its pinion where the side is 1; they push each other apart."""
    guide = c.lead.e if c.slides else c.on.e
    outward = -1j * kind.side * guide  # from the pinion to the rack
    push = c.M / kind.radius if c.slides else (np.conj(guide) * c.F).real
    apart = (np.conj(outward) * c.F).real * (-1 if c.slides else 1)
    residual = apart - math.tan(kind.pressure_angle) * np.abs(push)
    return residual, c.force + c.moment / kind.radius


def _belt(kind: Belt, c: Contact) -> tuple[Array, Array]:
    """Strands pull the wheels together: by twice the preload, or by what the tight side has."""
    distance, apart = c.between()
    driving, driven = kind.radii
    sine = (driven + driving if kind.crossed else driven - driving) / distance
    pull = 2 * kind.preload if kind.preload else np.abs(c.M) / driven
    return c.of_wheels(apart + np.sqrt(1 - sine**2) * pull, driven)


def _cam(kind: Cam, c: Contact) -> tuple[Array, Array]:
    """A flat face is pushed squarely; a roller's centre or an edge feels no couple."""
    if kind.follower == "flat":
        return (np.conj(c.link.e * np.exp(1j * kind.face)) * c.F).imag, c.force
    tip = c.link.at(kind.at.z).p
    residual = (np.conj(tip - c.on.p) * c.F).imag - c.M
    return residual, c.moment + c.force * (c.reach + np.abs(tip))


LINES: Mapping[type, Callable[[Any, Contact], tuple[Array, Array]]] = {
    Gear: _gear,
    Rack: _rack,
    Belt: _belt,
    Cam: _cam,
}


def lines_of_action(e: Evidence) -> Iterator[Residual]:
    """The part of a contact that the driven coordinate does not feel.

    Iterations of friction that are cut short have the sense of the effort before them.
    """
    s = e.structure
    for driver, (name, _, _, leader, centre) in s.followers.items() if e.exact.any() else ():
        kind, ref = s.couplings[name], s.driven[driver]
        if type(kind) not in LINES or kind.rubs:
            continue
        lead = e.bodies.link(centre.on).at(marker_place(s, centre))
        if leader is not None:
            lead = e.bodies.ends(leader)[0]
        on, link = e.bodies.ends(ref)[0], e.bodies.link(s.later_link(ref))
        size, reach = e.sizes(ref.block), np.abs(on.p) + np.abs(lead.p)
        F, M = e.run[f"{name}.force"], e.run[f"{name}.moment"]
        slides = leader is not None and not s.joint(leader).rotary
        c = Contact(lead, on, link, F, M, np.abs(F) + size.force, size.moment, reach, slides)
        residual, scale = LINES[type(kind)](kind, c)
        residual = np.where(e.exact, residual, 0.0)
        yield Residual("line of action of", name, residual, scale * e.condition(ref.block))


# -- the law: coordinate and two derivatives, with what each is made of -------------------------

Law: TypeAlias = tuple[tuple[Real, Real, Real], tuple[Real, Real, Real]]


def _polynomial(law: Polynomial, x: Array) -> Law:
    F, sizes = Series(law.coefficients), Series(np.abs(law.coefficients))
    of, by = [F.deriv(k)(x) for k in range(3)], [sizes.deriv(k)(np.abs(x)) for k in range(3)]
    return (of[0], of[1], of[2]), (by[0], by[1], by[2])


def _table(law: Table, x: Array) -> Law:
    """The spline itself; a period's step is a straight line beside it."""
    from scipy.interpolate import make_interp_spline

    at, y, slope = np.array(law.arguments), np.array(law.values), 0.0
    u, first = x, at[0]
    if law.period:
        slope = law.step / law.period
        at, y = np.append(at, first + law.period), np.append(y, y[0] + law.step)
        u = first + (x - first) % law.period
    level = y - slope * (at - first)
    level[-1] = level[0] if law.period else level[-1]
    order, ends = (5 if law.interpolation == "quintic" else 3), "periodic" if law.period else None
    F = make_interp_spline(at, level, order, bc_type=ends)
    step = np.diff(at).min()
    largest = max(np.max(np.abs(y)), np.max(np.abs(F.c)))
    size = largest * (1 + (np.abs(x) + np.max(np.abs(at))) / step)
    value = F(u) + slope * (x - first), F(u, 1) + slope, F(u, 2)
    return value, (size, size / step, size / step**2)


def _linear(slope: float, x: Array) -> Law:
    return (slope * x, slope, 0.0), (abs(slope) * np.abs(x), abs(slope), 0.0)


def _law(kind: Any, x: Array, slides: bool) -> Law | None:
    """The law of a coupling; None where it is taken at its word."""
    if type(kind) is Gear:
        return _linear(kind.teeth[0] / kind.teeth[1] * (1 if kind.internal else -1), x)
    if type(kind) is Belt:
        return _linear(kind.radii[0] / kind.radii[1] * (-1 if kind.crossed else 1), x)
    if type(kind) is Rack:
        return _linear((kind.side * kind.radius) ** (-1 if slides else 1), x)
    if type(kind) in (Cam, Ratio):
        if type(kind.law) is Polynomial:
            return _polynomial(kind.law, x)
        if type(kind.law) is Table:
            return _table(kind.law, x)
    return None


def laws(e: Evidence) -> Iterator[Residual]:
    """Driven coordinate, rate and acceleration by the coupling's law, and what the carrier adds."""
    s = e.structure
    for driver, follower in s.followers.items():
        kind, leader = s.couplings[follower.coupling], follower.leader
        coordinates, rates, accelerations = (
            _counted(e, driver, follower, quantity) for quantity in ("q", "rate", "acceleration")
        )
        (q, x, carried), (qd, xd, spin), (qdd, xdd, push) = coordinates, rates, accelerations
        judged = _law(kind, x, leader is not None and not s.joint(leader).rotary)
        if judged is None:
            continue
        (F, slope, curve), (F_size, slope_size, curve_size) = judged
        bent = slope_size * np.abs(xdd) + curve_size * xd**2
        for terms, size in (
            ((q, -F, -kind.phase, -carried), F_size),
            ((qd, -slope * xd, -spin), slope_size * np.abs(xd)),
            ((qdd, -slope * xdd, -curve * xd**2, -push), bent),
        ):
            scale = size + np.sum([np.abs(t) + 0 * x for t in terms], axis=0)
            yield Residual("law of", follower.coupling, sum(terms, 0 * x), scale)


def derivatives(e: Evidence) -> Iterator[Residual]:
    """The first and second derivative of each law are those of its coordinate."""
    s = e.structure
    for driver, follower in s.followers.items():
        name, kind = follower.coupling, s.couplings[follower.coupling]
        _, x, _ = _counted(e, driver, follower, "q")
        low, high = float(np.nanmin(x)), float(np.nanmax(x))
        over = Stretches.between(low, high, kind.knots(low, high), e.run.n)
        law = bound_kernel(kind.transmission(s.coupled_pair(name)))
        motion = law(over.nodes, coupling_numbers(s, name))
        q, slope, curve = (value + 0 * over.nodes for value in motion)
        for value, rate in ((q, slope), (slope, curve)):
            yield Residual("slope of", name, over.gap(value, rate), over.size(value, rate))


def _counted(e: Evidence, driver: str, f: Follower, quantity: str) -> tuple[Array, Array, Array]:
    """The driven value, the argument's, and the carrier's share; counter-clockwise of a mesh."""
    meshes = e.structure.couplings[f.coupling].meshes

    def of(name: str) -> Array:
        sign = e.structure.coordinate(name).sign if meshes else 1.0
        return np.asarray(sign * e.run[f"{name}.{quantity}"])

    x, add = (sum((k * of(d) for d, k in terms), 0 * of(driver)) for terms in (f.terms, f.added))
    return of(driver), x, add
