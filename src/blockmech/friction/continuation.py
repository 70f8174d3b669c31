"""Continuation from zero friction: what decides where no certificate does.

The physical solution is the one that starts at zero friction. Its path is followed in the
scale lambda of all friction factors, from 0 to 1, in the unknowns v = (n, eta, lambda) with
friction n / eta, so reactions that go to infinity are an ordinary point
(`blockmech.friction.equations.homogeneous`). It ends at lambda = 1 (solved), at eta = 0
(asymptote: reactions grow without bound whatever the loads) or where lambda turns back (fold:
no solution beyond). The last two are self-locking, and lambda there is the limit. Where a
solution exists for every load (`blockmech.friction.equations`) a fold is no end: the path turns
once more, and arrives.

A step goes along the tangent, and Newton comes back in the plane across it (pseudo-arclength);
it was too long if that fails or the tangent turns much. The direction of travel is told by
the sign of det [J; tangent], which is one along the whole path. Where a step passes an end,
Newton lands on it: its plane is then the end's. The load of a guide, max(|N|, 2 |C| / L), has
kinks where its contact changes: the path is followed to a kink with the contacts held, and
goes on with the new one.

All is one kernel, a correction of Newton, repeated: so each engine follows many samples side
by side, and none of them hangs on the others.

Source: Allgower & Georg, Introduction to Numerical Continuation Methods, SIAM 2003; the
homogeneous form and the ends are blockmech's own.
"""

from __future__ import annotations

import enum
from typing import NamedTuple

from blockmech.friction.equations import (
    SETTLED,
    Equations,
    along,
    chosen,
    coulomb,
    eliminate,
    homogeneous,
    largest_of,
    limits_of,
    loads,
    misfit,
    norms,
)
from blockmech.ground.plane import (
    EPS,
    NAN,
    maximum,
    minimum,
    mul,
    repeat,
    sign,
    sqrt,
    where,
)
from blockmech.ground.tolerances import DOUBLINGS, ROUNDED
from blockmech.typing import Real, Reals, Values

# [-] of the arc: unknowns are on the unit sphere, lambda ends at 1. The first step from zero
# friction and from a kink is short, as the path may bend there.
STEP, LARGEST = 0.05, 0.2
SHARPEST = 0.95  # cosine of the largest turn of the tangent in one step: 18 degrees
MOST = 1500  # corrections of a path, halved steps included: it takes some fifty


class Outcome(enum.IntEnum):
    """How the friction of a sample was settled."""

    CERTIFIED = 0
    BY_CONTINUATION = 1
    NOT_CONVERGED = 2
    FOLD = 3
    ASYMPTOTE = 4

    @property
    def solved(self) -> bool:
        """Whether there is an answer."""
        return self in (Outcome.CERTIFIED, Outcome.BY_CONTINUATION)


class StepTarget:
    """What a step goes to: some way ahead, or a place that the path passes."""

    FRESH = -1.0  # where it is: the tangent is unknown, at the start and behind a kink
    AHEAD = 0.0
    FOLD = 1.0
    FULL = 2.0  # all friction, lambda = 1
    POLE = 3.0  # eta = 0
    KINK = 4.0  # of a guide, and counted on: two for each


class ContinuationState(NamedTuple):
    """A path as far as it is followed, and the step that is tried."""

    v: tuple[Real, ...]  # last point: n, eta, lambda
    tangent: tuple[Real, ...]  # of unit length, in the direction of travel
    contacts: Values  # where guides are pressed, of +-N (x) and +-2 C / L (y)
    way: Real  # sign of det [J; tangent]; 0 before it is known
    bend: Real  # rate of the tangent's lambda along the arc before a fold; 0 where none is seen
    step: Real  # of arc
    aim: Real
    x: tuple[Real, ...]  # what Newton corrects, in the plane row @ x = level
    row: tuple[Real, ...]
    level: Real
    corrections: Real  # of this step
    count: Real  # of corrections on the whole path
    outcome: Real
    solvable: Real  # whether a solution exists for every load: then a fold is no end
    beyond: Real  # whether a fold was passed
    going: Real


class Corrected(NamedTuple):
    """What a correction finds."""

    x: tuple[Real, ...]
    tangent: tuple[Real, ...]
    way: Real
    corrections: Real
    settled: Real  # whether x is a point of the path
    lost: Real  # whether it is none, and no more is tried


class Path(NamedTuple):
    """End of a path."""

    t: tuple[Real, ...]  # friction; NaN without a solution
    g: tuple[Real, ...]  # [N] loads on the pairs; NaN without a solution
    residual: Real  # relative
    outcome: Real
    limit: Real  # scale of the friction factors up to which a solution exists
    corrections: Real


def course_from_zero(requested: Real, of: Equations, solvable: Real = False) -> ContinuationState:
    """The path of the frictionless solution to full friction, of the samples asked for.

    Where the equations are ``solvable`` for every load (`blockmech.friction.equations`) it is
    followed through folds: there it arrives.
    """
    zero = 0.0 * abs(of.k[0])
    v = (*(zero for _ in of.k), zero + 1.0, zero)
    row = (*(zero for _ in of.k), zero, zero + 1.0)
    contacts = tuple((zero + 1.0, zero) if edge else () for edge in of.edges)
    aim = zero + StepTarget.FRESH
    solvable = (zero == 0.0) & solvable
    rest = (*(zero,) * 4, solvable, zero > 0.0, requested)
    start = ContinuationState(v, v, contacts, zero, zero, zero, aim, v, row, *rest)
    if any(of.edges):
        start = repeat(pressed, start, 1, of)
    course: ContinuationState = repeat(follow, start, MOST, of)
    return course


def pressed(at: ContinuationState, of: Equations) -> ContinuationState:
    """The start with its contacts: where nothing presses yet, those that friction brings."""
    t = coulomb(of.k, norms(of.base, of.edges))
    growth = loads(t, [mul(f, 0.0) for f in of.base], of.rows)
    contacts = []
    for edge, f, added in zip(of.edges, of.base, growth, strict=True):
        empty = largest_of((f.real, f.imag)) == 0.0
        x, y = where(empty, added.real, f.real), where(empty, added.imag, f.imag)
        couple = abs(y) > abs(x)
        x, y = where(x < 0.0, -1.0, 1.0), where(y < 0.0, -1.0, 1.0)
        contacts.append((where(couple, 0.0, x), where(couple, y, 0.0)) if edge else ())
    return at._replace(contacts=tuple(contacts))


def follow(at: ContinuationState, of: Equations) -> ContinuationState:
    """One correction of Newton's method, and behind the last one of a step the next step.

    A corrected point is reached, and the path goes on from there; or a place is passed on the
    way to it, and Newton lands there; or a fold is, and by the secant of the tangent's lambda
    the step is shortened; or the point is bad, and the step is halved.
    """
    factor, load = _scales(of)
    k, rows = [kj / factor for kj in of.k], [[mul(R, factor) for R in row] for row in of.rows]
    scaled = Equations(k, of.edges, [mul(f, 1.0 / load) for f in of.base], rows)
    new = corrected(at, scaled)
    limits = limits_of(at.contacts, *scaled[1:])
    event, share, row, level = passed(at, new, limits)
    fresh = at.aim == StepTarget.FRESH
    gone = along(at.tangent, new.x) - along(at.tangent, at.v)
    smooth = (along(new.tangent, at.tangent) >= SHARPEST) & (gone > ROUNDED * EPS)
    good = new.settled & (fresh | smooth)
    event = where(fresh, StepTarget.AHEAD, event)
    landing, reached = good & (event > StepTarget.FOLD), good & (event == StepTarget.AHEAD)
    correcting = where(new.settled | new.lost, False, True)
    kinked = reached & (at.aim >= StepTarget.KINK)

    up = new.tangent[-1]
    folds = (good & (event == StepTarget.FOLD)) | (reached & (at.bend < 0.0))
    bent = (up - at.tangent[-1]) / where(gone > 0.0, gone, 1.0)
    bend = where(folds, bent, where(good & fresh, 0.0, at.bend))
    rate = where(bend < 0.0, -bend, 1.0)
    top = folds & (up * up <= 8.0 * EPS * rate)  # what lambda grows by yet is up^2 / (2 rate)
    turned = top | (reached & fresh & (up <= 0.0))
    passing = turned & at.solvable
    onward = reached | passing
    v, tangent = chosen(onward | top, new.x, at.v), chosen(onward, new.tangent, at.tangent)
    longer = where(folds, tangent[-1] / rate, where(fresh, STEP, 1.5 * at.step))
    longer, bend = where(passing, STEP, longer), where(passing, 0.0, bend)
    step = where(reached | folds, minimum(longer, LARGEST), 0.5 * at.step)
    step = where(kinked, 0.0, where(correcting | landing, at.step, step))

    count = at.count + 1.0
    exhausted = where(good | correcting, count >= MOST, step < ROUNDED * EPS)
    outcome = where(exhausted, float(Outcome.NOT_CONVERGED), at.outcome)
    pole = 0.0 * count + float(Outcome.ASYMPTOTE)
    pole = where(at.solvable, float(Outcome.NOT_CONVERGED), pole)
    outcome = where(reached & (at.aim == StepTarget.POLE), pole, outcome)
    outcome = where(reached & (at.aim == StepTarget.FULL), float(Outcome.BY_CONTINUATION), outcome)
    outcome = where(turned & where(at.solvable, False, True), float(Outcome.FOLD), outcome)
    next_point = tuple(a + step * b for a, b in zip(v, tangent, strict=True))
    landed = tuple(a + share * (b - a) for a, b in zip(at.v, new.x, strict=True))
    aim = where(kinked, StepTarget.FRESH, where(correcting, at.aim, StepTarget.AHEAD))
    return ContinuationState(
        v,
        tangent,
        switched(at, new.x, kinked, limits),
        new.way,
        bend,
        step,
        where(landing, event, aim),
        chosen(landing, landed, chosen(correcting, new.x, next_point)),
        chosen(landing, row, chosen(correcting, at.row, tangent)),
        where(landing, level, where(correcting, at.level, along(tangent, v) + step)),
        where(correcting, new.corrections, 0.0),
        count,
        outcome,
        at.solvable,
        at.beyond | passing,
        outcome == float(Outcome.CERTIFIED),
    )


def corrected(at: ContinuationState, of: Equations) -> Corrected:
    """A correction in the step's plane, and the tangent there in the direction of travel."""
    border = [*at.row, along(at.row, at.x) - at.level, 1.0]
    lines = homogeneous(at.x, at.contacts, of)
    (change, null), det = eliminate([*lines, border], pivoting=True)
    orientation = where(at.way == 0.0, sign(det), at.way)
    scale = orientation * sign(det) / sqrt(along(null, null))
    corrections = at.corrections + 1.0
    last = corrections > DOUBLINGS
    allowed = where(at.aim == StepTarget.FULL, where(last, sqrt(EPS), 0.0), SETTLED * EPS)
    settled = largest_of(change) < allowed
    x = tuple(a - d for a, d in zip(at.x, change, strict=True))
    return Corrected(x, tuple(scale * y for y in null), orientation, corrections, settled, last)


def passed(at: ContinuationState, new: Corrected, limits: list[list[Real]]) -> Reals:
    """What a step passes first, the share of it up to there, and the plane of that place.

    `Aim.AHEAD` where it passes nothing.
    """
    nothing = [0.0] * (len(at.v) - 2)
    full, pole = [*nothing, 0.0, 1.0], [*nothing, 1.0, 0.0]
    ends = [
        (StepTarget.FOLD, full, 0.0, at.tangent[-1], where(at.beyond, 1.0, new.tangent[-1]), 0.0),
        (StepTarget.FULL, full, 1.0, 1.0 - at.v[-1], 1.0 - new.x[-1], 0.0),
        (StepTarget.POLE, pole, 0.0, at.v[-2], new.x[-2], 0.0),
    ]
    for i, row in enumerate(limits):
        spare = along(row, at.v), along(row, new.x)
        ends.append((StepTarget.KINK + i, row, 0.0, *spare, -ROUNDED * EPS))
    event, share, plane, level = 0.0 * at.step, 0.0 * at.step + 2.0, at.row, at.level
    for aim, row, height, before, after, threshold in ends:
        after = where(at.aim == aim, before, after)
        part = before / where(before > after, before - after, 1.0)
        first = (after <= threshold) & (part < share)
        event, share = where(first, aim, event), where(first, part, share)
        plane, level = chosen(first, row, plane), where(first, height, level)
    return event, share, plane, level


def switched(at: ContinuationState, x: Reals, kinked: Real, limits: list[list[Real]]) -> Values:
    """The contacts behind a kink: a quarter turn further, or opposite where both limits end."""
    contacts, aims = [], iter([(StepTarget.KINK + i, row) for i, row in enumerate(limits)])
    for contact in at.contacts:
        if contact:
            (left_aim, left_row), (right_aim, right_row) = next(aims), next(aims)
            a, b = contact
            turns_left, turns_right = kinked & (at.aim == left_aim), kinked & (at.aim == right_aim)
            both = maximum(along(left_row, x), along(right_row, x)) <= ROUNDED * EPS
            switching = turns_left | turns_right
            turned = chosen(both, (-a, -b), chosen(turns_left, (-b, a), (b, -a)))
            contact = chosen(switching, turned, contact)
        contacts.append(contact)
    return tuple(contacts)


def end_of(course: ContinuationState, of: Equations) -> Path:
    """The friction at the end of a path, if that is a solution."""
    *n, eta, limit = course.v
    factor, load = _scales(of)
    solved = course.outcome == float(Outcome.BY_CONTINUATION)
    unit = where(solved, factor * load / where(solved, eta, 1.0), NAN)
    t = tuple(unit * y for y in n)
    g = norms(loads(t, of.base, of.rows), of.edges)
    residual = misfit(t, of.k, g)
    wrong = residual > SETTLED * EPS  # another solution, or none
    return Path(
        tuple(where(wrong, NAN, y) for y in t),
        tuple(where(wrong, NAN, y) for y in g),
        residual,
        where(wrong, float(Outcome.NOT_CONVERGED), course.outcome),
        where(solved, 1.0, limit),
        course.count,
    )


def _scales(of: Equations) -> tuple[Real, Real]:
    """The largest factor, and the largest component of a load [N]; one in the place of none."""
    factor, load = largest_of(of.k), largest_of([x for f in of.base for x in (f.real, f.imag)])
    return where(factor > 0.0, factor, 1.0), where(load > 0.0, load, 1.0)
