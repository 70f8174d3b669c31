r"""What the pairs of a general group demand: residuals, Jacobian rows, right sides.

A pair joins a place A on its earlier side (an own link, or a support) to a place B on
its later link. With d = B - A, u the direction of the earlier side and n = i u:

    R            d = 0                              along x and along y
    P            n . d = 0,  directions equal
    R driven     besides: angle of B's link = angle of u + q
    P driven     besides: u . d = q

So a pair prescribes t . d along some directions t, and then perhaps a relative angle.
Lengths are divided by the group's size, so all conditions and unknowns (place / size
and angle of each link) are of order one. Differentiated once and twice, with the
relative velocity w = d' - i om_a d seen from the earlier side:

    t . w = 0,   t . (d'' - i al_a d - 2 i om_a w + om_a^2 d) = 0

Sources: [D14] section 2 (groups of higher class as future work); Nikravesh,
Computer-aided analysis of mechanical systems, 1988, ch. 4 (Cartesian coordinates).
"""

from __future__ import annotations

from typing import NamedTuple

from blockmech.blocks.motion import acceleration_at, velocity_at
from blockmech.ground.plane import angle, cross, dot, expi, imul, mul, planar
from blockmech.typing import (
    Complex,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Parameters,
    Real,
    Values,
)


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
    def driven(self) -> bool:
        """Whether its coordinate is an input."""
        return self.drive >= 0

    @property
    def turns(self) -> bool:
        """Whether it prescribes the relative angle; the last of its conditions."""
        return self.prismatic or self.driven

    @property
    def rows(self) -> int:
        """Number of conditions."""
        return 2 + self.driven


class Side(NamedTuple):
    """One side of a pair: arm from its link's origin, place, direction."""

    r: Complex  # (...) [m]
    P: Complex  # (...) [m]
    u: Complex  # (...) [-]


class Ends(NamedTuple):
    """Both sides of a pair at a pose, B - A, and the directions along which that is prescribed."""

    a: Side
    b: Side
    d: Complex  # (...) [m]
    t: tuple[Complex, ...]  # (...) [-] n and, where driven, u of a guide; x and y of a pin


def side(link: LinkPosition, p: Parameters, at: str, along: str) -> Side:
    """A side on an own link."""
    r = link.e * getattr(p, at)
    return Side(r, link.o + r, link.e * getattr(p, along) if along else link.e)


def ends(pair: PairPlan, links: tuple[LinkPosition, ...], outer: Values, p: Parameters) -> Ends:
    """Both sides of a pair; a support's arm is not needed and stands as its place."""
    b = side(links[pair.later], p, pair.at[1], pair.along[1])
    if pair.earlier >= 0:
        a = side(links[pair.earlier], p, pair.at[0], pair.along[0])
    elif pair.guided:
        reading = outer[pair.outer]
        a = Side(reading.p, reading.p, reading.u)
    else:
        a = Side(outer[pair.outer], outer[pair.outer], b.u)
    if pair.prismatic:
        t = (imul(a.u, 1.0), a.u)[: 1 + pair.driven]
    else:
        t = planar(1.0, 0.0), planar(0.0, 1.0)
    return Ends(a, b, b.P - a.P, t)


def residuals(pair: PairPlan, at: Ends, q: tuple[Real, ...], k: Real) -> list[Real]:
    """How far a pair's conditions are from zero; ``k`` is 1 / size."""
    gaps = [dot(t, at.d) for t in at.t]
    u = at.a.u
    if pair.driven and pair.prismatic:
        gaps[1] = gaps[1] - q[pair.drive]
    elif pair.driven:
        u = u * expi(q[pair.drive])
    gaps = [x * k for x in gaps]
    return [*gaps, angle(u, at.b.u)] if pair.turns else gaps


def rows(pair: PairPlan, at: Ends, columns: int, k: Real) -> list[list[Real]]:
    """Rows of the Jacobian; the columns of link j are 3j (x), 3j + 1 (y), 3j + 2 (angle)."""
    i, j = 3 * pair.earlier, 3 * pair.later
    reach = at.a.r + at.d if pair.prismatic else at.a.r  # a guide turns with its link
    filled: list[list[Real]] = []
    for t in at.t:
        row: list[Real] = [0.0] * columns
        row[j], row[j + 1], row[j + 2] = t.real, t.imag, cross(at.b.r, t) * k
        if i >= 0:
            row[i], row[i + 1], row[i + 2] = -t.real, -t.imag, -cross(reach, t) * k
        filled.append(row)
    if pair.turns:
        row = [0.0] * columns
        row[j + 2] = 1.0
        if i >= 0:
            row[i + 2] = -1.0
        filled.append(row)
    return filled


def _right(
    pair: PairPlan, at: Ends, motion: Complex, turn: Real, drive: tuple[Real, ...], k: Real
) -> list[Real]:
    """Right sides for a known motion of A against B, the support's turning and the drivers'."""
    sides = [dot(t, motion) for t in at.t]
    if pair.driven and pair.prismatic:
        sides[1] = sides[1] + drive[pair.drive]
    elif pair.driven:
        turn = turn + drive[pair.drive]
    return [x * k for x in sides] + [turn] * pair.turns


def rates_wanted(
    pair: PairPlan, at: Ends, outer: Values, qd: tuple[Real, ...], k: Real
) -> list[Real]:
    """Right sides of J x' = ...: what supports and drivers do to the conditions."""
    if pair.earlier >= 0:
        return _right(pair, at, planar(0.0, 0.0), 0.0, qd, k)
    if not pair.guided:
        return _right(pair, at, outer[pair.outer], 0.0, qd, k)
    support: LinkVelocity = outer[pair.outer]
    return _right(pair, at, velocity_at(support, at.d), support.om, qd, k)


def slide(pair: PairPlan, at: Ends, links: tuple[LinkVelocity, ...], outer: Values) -> Real:
    """Sliding rate [m/s] of a prismatic pair, later on earlier side; 0 of a revolute one."""
    if not pair.prismatic:
        return 0.0
    if pair.earlier >= 0:
        v_a = velocity_at(links[pair.earlier], at.a.r + at.d)
    else:
        v_a = velocity_at(outer[pair.outer], at.d)
    return dot(at.a.u, velocity_at(links[pair.later], at.b.r) - v_a)


def accelerations_wanted(
    pair: PairPlan,
    at: Ends,
    links: tuple[LinkVelocity, ...],
    sliding: Real,
    outer: Values,
    qdd: tuple[Real, ...],
    k: Real,
) -> list[Real]:
    """Right sides of J x'' = ...: quadratic terms, supports and drivers."""
    om = links[pair.later].om
    relative = mul(at.b.r, om * om)
    al: Real = 0.0
    if pair.earlier >= 0:
        om_a = links[pair.earlier].om
        relative = relative - mul(at.a.r, om_a * om_a)
    elif pair.guided:
        support: LinkAcceleration = outer[pair.outer]
        relative, al = relative + support.a, support.al
    else:
        relative = relative + outer[pair.outer]
    if pair.prismatic:  # both sides turn as one
        frame = LinkAcceleration(relative, al)
        relative = acceleration_at(frame, om, at.d) + imul(at.a.u, 2 * om * sliding)
    return _right(pair, at, relative, al, qdd, k)
