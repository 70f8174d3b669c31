r"""What the pairs of a general group demand: residuals, Jacobian rows, right sides.

A pair joins a place A on its earlier side (an own link, or a support) to a place B on
its later link. With d = B - A, u the direction of the earlier side and n = i u:

    R            d = 0                              two conditions
    P            n . d = 0,  directions equal       two conditions
    R driven     besides: angle of B's link = angle of u + q
    P driven     besides: u . d = q

Lengths are divided by the group's size, so all conditions and unknowns (place / size
and angle of each link) are of order one. Differentiated once and twice, with the
relative velocity w = d' - i om_a d seen from the earlier side:

    n . w = 0,   n . (d'' - i al_a d - 2 i om_a w + om_a^2 d) = 0     (along u alike)

Sources: [D14] section 2 (groups of higher class as future work); Nikravesh,
Computer-aided analysis of mechanical systems, 1988, ch. 4 (Cartesian coordinates).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from blockmech.plane import angle, cross, dot, expi, imul, mul
from blockmech.typing import Complex, LinkPosition, LinkVelocity, Real

Entries = dict[int, Real]
"""Entries of one row of the Jacobian: column -> number."""


class PairPlan(NamedTuple):
    """Where a pair's data are: numbers of links, inputs and parameters.

    ``earlier`` is the own link on the earlier side, or -1 for a support, whose reading
    is ``outer``; ``drive`` is the place of its coordinate among the driven ones, or -1.
    """

    prismatic: bool
    earlier: int
    later: int
    outer: int
    drive: int
    at: tuple[str, str]  # names of the places' parameters, earlier and later side
    along: tuple[str, str]  # names of the directions' parameters; "" is the x axis
    guided: bool  # whether a support gives direction and rate, not only a point

    @property
    def rows(self) -> int:
        """Number of conditions."""
        return 2 + (self.drive >= 0)


class Side(NamedTuple):
    """One side of a pair: arm from its link's origin, place, direction."""

    r: Complex  # (...) [m]
    P: Complex  # (...) [m]
    u: Complex  # (...) [-]


class Ends(NamedTuple):
    """Both sides of a pair at a pose, and B - A."""

    a: Side
    b: Side
    d: Complex  # (...) [m]


class Rates(NamedTuple):
    """Motion of a pair: rates of both links, velocity of B - A, as seen from A's link."""

    om_a: Real  # (...) [rad/s]
    om_b: Real  # (...) [rad/s]
    w: Complex  # (...) [m/s]


def side(link: LinkPosition, p: Any, at: str, along: str) -> Side:
    """A side on an own link."""
    r = link.e * getattr(p, at)
    return Side(r, link.o + r, link.e * getattr(p, along) if along else link.e)


def ends(pair: PairPlan, links: tuple[LinkPosition, ...], outer: tuple[Any, ...], p: Any) -> Ends:
    """Both sides of a pair; a support's arm is not needed and stands as its place."""
    b = side(links[pair.later], p, pair.at[1], pair.along[1])
    if pair.earlier >= 0:
        a = side(links[pair.earlier], p, pair.at[0], pair.along[0])
    elif pair.guided:
        reading = outer[pair.outer]
        a = Side(reading.p, reading.p, reading.u)
    else:
        a = Side(outer[pair.outer], outer[pair.outer], b.u)
    return Ends(a, b, b.P - a.P)


def residuals(pair: PairPlan, at: Ends, q: tuple[Real, ...], k: Real) -> list[Real]:
    """How far a pair's conditions are from zero; ``k`` is 1 / size."""
    a, b, d = at
    if pair.prismatic:
        found = [dot(imul(a.u, 1.0), d) * k, angle(a.u, b.u)]
        if pair.drive >= 0:
            found.append((dot(a.u, d) - q[pair.drive]) * k)
        return found
    found = [d.real * k, d.imag * k]
    if pair.drive >= 0:
        found.append(angle(a.u * expi(q[pair.drive]), b.u))
    return found


def rows(pair: PairPlan, at: Ends, k: Real) -> list[Entries]:
    """Rows of the Jacobian; the columns of link j are 3j (x), 3j + 1 (y), 3j + 2 (angle)."""
    a, b, _ = at
    i, j = 3 * pair.earlier, 3 * pair.later
    turned: Entries = {j + 2: 1.0}
    if pair.earlier >= 0:
        turned[i + 2] = -1.0
    if not pair.prismatic:
        across: Entries = {j: 1.0, j + 2: -b.r.imag * k}
        upright: Entries = {j + 1: 1.0, j + 2: b.r.real * k}
        if pair.earlier >= 0:
            across |= {i: -1.0, i + 2: a.r.imag * k}
            upright |= {i + 1: -1.0, i + 2: -a.r.real * k}
        return [across, upright, turned] if pair.drive >= 0 else [across, upright]
    found = [_row(pair, at, imul(a.u, 1.0), k), turned]
    if pair.drive >= 0:
        found.append(_row(pair, at, a.u, k))
    return found


def _row(pair: PairPlan, at: Ends, t: Complex, k: Real) -> Entries:
    """Row of t . d = constant, t turning with the earlier side."""
    i, j = 3 * pair.earlier, 3 * pair.later
    found: Entries = {j: t.real, j + 1: t.imag, j + 2: cross(at.b.r, t) * k}
    if pair.earlier >= 0:
        reach = at.a.r + at.d
        found |= {i: -t.real, i + 1: -t.imag, i + 2: -cross(reach, t) * k}
    return found


def rates_wanted(
    pair: PairPlan, at: Ends, outer: tuple[Any, ...], qd: tuple[Real, ...], k: Real
) -> list[Real]:
    """Right sides of J x' = ...: what supports and drivers do to the conditions."""
    driven = qd[pair.drive] if pair.drive >= 0 else None
    if pair.earlier >= 0:
        zero = [0.0, 0.0]
        if driven is None:
            return zero
        return [*zero, driven * k if pair.prismatic else driven]
    reading = outer[pair.outer]
    v, om = (reading.v, reading.om) if pair.guided else (reading, 0.0)
    if not pair.prismatic:
        found = [v.real * k, v.imag * k]
        return found if driven is None else [*found, driven + om]
    carried = v + imul(at.d, om)
    found = [dot(imul(at.a.u, 1.0), carried) * k, om]
    return found if driven is None else [*found, (driven + dot(at.a.u, carried)) * k]


def slide(
    pair: PairPlan, at: Ends, links: tuple[LinkVelocity, ...], outer: tuple[Any, ...]
) -> Real:
    """Sliding rate [m/s] of a prismatic pair, later on earlier side; 0 of a revolute one."""
    if not pair.prismatic:
        return 0.0
    b = links[pair.later]
    v_b = b.v + imul(at.b.r, b.om)
    if pair.earlier >= 0:
        a = links[pair.earlier]
        v_a, om_a = a.v + imul(at.a.r, a.om), a.om
    else:
        v_a, om_a = outer[pair.outer].v, outer[pair.outer].om
    return dot(at.a.u, v_b - v_a - imul(at.d, om_a))


def rates_of(pair: PairPlan, at: Ends, links: tuple[LinkVelocity, ...], sliding: Real) -> Rates:
    """How a pair moves: a prismatic pair turns as one and slides along its guide."""
    om_b = links[pair.later].om
    om_a = links[pair.earlier].om if pair.earlier >= 0 else om_b
    return Rates(om_a, om_b, mul(at.a.u, sliding))


def accelerations_wanted(
    pair: PairPlan,
    at: Ends,
    moving: Rates,
    outer: tuple[Any, ...],
    qdd: tuple[Real, ...],
    k: Real,
) -> list[Real]:
    """Right sides of J x'' = ...: quadratic terms, supports and drivers."""
    driven = qdd[pair.drive] if pair.drive >= 0 else None
    centripetal = mul(at.b.r, moving.om_b * moving.om_b)
    al: Real = 0.0
    if pair.earlier >= 0:
        known = centripetal - mul(at.a.r, moving.om_a * moving.om_a)
    elif pair.guided:
        al = outer[pair.outer].al
        known = centripetal + outer[pair.outer].a
    else:
        known = centripetal + outer[pair.outer]
    if not pair.prismatic:
        found = [known.real * k, known.imag * k]
        return found if driven is None else [*found, driven + al]
    om = moving.om_a
    if pair.earlier < 0:
        known = known + imul(at.d, al)
    known = known + imul(moving.w, 2 * om) - mul(at.d, om * om)
    found = [dot(imul(at.a.u, 1.0), known) * k, al]
    return found if driven is None else [*found, (driven + dot(at.a.u, known)) * k]
