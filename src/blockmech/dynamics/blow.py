r"""An impact on end stops: the rates after it, and the impulses of stops and of joint friction.

Newton's law of restitution in the rows n of the stops that push, count positive away from them:

    M (q'+ - q'-) = sum n^T P + S^T T,     n q'+ = -e n q'-,    P >= 0,
    others part:  n q'+ >= -e n q'-,       T_j = -side_j c_j |R_j|

A stop that is lain against has n q'- = 0. With friction the impulses R in the joints, of which the
T are, follow from the jumps of the rates, from T and from P as loads do from accelerations, so all
is a state of joint friction without anything that lasts. The rates n q' of the stops go from before
to after in one sense; what is between is followed in stages (Routh): a pair whose slip ends within
the blow sticks from there on or slips in its new sense, by the same rule as at any standstill.

Sources: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, ch. 8; Routh,
Dynamics of a System of Rigid Bodies, 1905, ch. 5; Stronge, Impact Mechanics, 2000, ch. 5.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.contacts import (
    DEPENDENT,
    INSTANT,
    SETTLED,
    STILL,
    Constraints,
    constrained,
    free_of,
    pushing,
)
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.friction import Instant
from blockmech.dynamics.roles import Roles
from blockmech.dynamics.sticking import BALANCED, JointFriction
from blockmech.ground.errors import refused
from blockmech.result.motion import Impact
from blockmech.typing import Floats

SUDDEN = 2.0 ** -round(math.log2(INSTANT))  # [1/s], for laws that are not linear in the load


class Before(NamedTuple):
    """The state before an impact.

    t, q, rate : [s], coordinates and rates (k,)
    M : (k, k) inertia
    x : states of signal blocks and friction laws, None where there are none
    """

    t: float
    q: Floats
    rate: Floats
    M: Floats
    x: Floats | None


class Blow(NamedTuple):
    """What an impact does.

    after : (k,) rates
    pushes : (a,) impulses of the stops along their coordinates, then of drives that hold
    friction : (m,) of the pairs
    reverses : whether a slip ends or turns back before the blow does
    gained : [J] what stops gave back more than they took: restitution and friction are at odds
    solved : whether impulses satisfy the friction laws; else friction is left out
    """

    after: Floats
    pushes: Floats
    friction: Floats
    reverses: bool = False
    gained: float = 0.0
    solved: bool = True


def impact_of(
    solution: Blow,
    before: Before,
    names: Sequence[str],
    driven: Sequence[int],
    friction: JointFriction | None,
) -> tuple[Impact, float]:
    """The record of an impact, and what its drives work [J].

    names : of stops, the first one what was struck, then of the drivers at places ``driven`` that
        are not free: these go on at their rates, and what is missing is lost (Carnot's theorem)
    """
    (t, q, rate, M, _), after = before, solution.after
    pushes = dict(zip(names, solution.pushes.tolist(), strict=True))
    pairs = () if friction is None else friction.names
    rubbed = dict(zip(pairs, solution.friction.tolist(), strict=True))
    work = float(solution.pushes[len(names) - len(driven) :] @ after[list(driven)])
    loss = work - 0.5 * float((rate + after) @ M @ (after - rate))
    first = pushes[names[0]]
    return Impact(t, names[0], q, rate, after, first, loss, pushes, rubbed), work


def blow(
    state: Before,
    stops: Constraints,
    ways: Floats,
    restitution: Floats,
    friction: JointFriction | None = None,
    bound: Constraints | None = None,
) -> Blow:
    """The blow on stops (a,) that are struck or lain against.

    ``ways`` (a,) are +1 at the highest stop, -1 at the lowest. ``bound`` are drivers that are not
    free: their rates jump by its drifts, mostly not at all.
    """
    (t, q, before, M, x), at = state, None
    if friction is not None and (before.any() or (bound is not None and bound.drift.any())):
        at = friction.instant(q, before, t, x, None)
    rate = stops.rows @ before
    stops = stops if bound is None else stops.extended(bound)
    count, change = len(rate), (1 + restitution) * rate
    Z, alone = free_of(bound, len(before)), constrained(M, np.zeros(len(before)), bound)[0]
    change = change if bound is None else np.append(change, bound.drift)
    rows = -ways[:, None] * stops.rows[:count]
    apart = -ways * (change[:count] + stops.rows[:count] @ alone)
    sets = [[*some, *range(count, len(change))] for some in pushing(Z.T @ M @ Z, rows @ Z, apart)]
    if friction is not None and at is not None:
        for some in sets:
            rubbed = _rubbed(friction, at, stops, some, change, count)
            if rubbed is not None and _is_valid(rubbed, before, stops, ways, restitution):
                return rubbed
    chosen, pushes = sets[0], np.zeros(len(change))
    constraint = _of(stops, chosen, change[chosen])
    jump, pushes[chosen] = constrained(M, np.zeros(len(before)), constraint)
    none = np.zeros(0 if friction is None else len(friction.names))
    return Blow(before + jump, pushes, none, solved=friction is None or at is None)


def _of(stops: Constraints, some: list[int], drift: Floats) -> Constraints:
    return Constraints(stops.rows[some], drift, tuple(stops.pairs[i] for i in some))


def _is_valid(
    blown: Blow, before: Floats, stops: Constraints, ways: Floats, restitution: Floats
) -> bool:
    """Whether all stops push, and those that do not are left."""
    rows = stops.rows[: len(ways)]
    after, back = rows @ blown.after, restitution * (rows @ before)
    pushes, parted = -ways * blown.pushes[: len(ways)], -ways * (after + back)
    size = np.abs(rows) @ (np.abs(blown.after) + np.abs(before))
    return bool(
        (pushes >= -SETTLED * np.abs(pushes).max(initial=0.0)).all()
        and (parted >= -SETTLED * size).all()
    )


def _rubbed(
    friction: JointFriction,
    at: Instant,
    stops: Constraints,
    some: list[int],
    change: Floats,
    count: int,
) -> Blow | None:
    """The blow on some of the stops with joint friction; None where no impulses satisfy it.

    ``count`` : how many of all are stops, and no drivers that are not free
    """
    friction = copy.copy(friction)
    m = len(friction.names)
    friction.static = np.append(friction.static[:m], np.zeros(m))  # what lasts has no impulse
    law = np.append(at.law[:m], np.zeros(m))
    still = at._replace(push=0 * at.push, b=0 * at.b, f=0 * at.f, law=law)
    rate, zero = at.rate, friction.sticking_pairs(at, ())
    pushes, T, elapsed, gained, reverses = np.zeros(len(stops.rows)), np.zeros(m), 0.0, 0.0, False
    constraint = _of(stops, some, SUDDEN * change[some])
    loads = friction.pressed(at.q, constraint)
    for _ in range(BALANCED):  # stages, each of which ends with a slip
        w = at.S @ rate
        stage = still._replace(rate=rate, w=w).against(constraint, loads, lasting=False)
        settled = friction.settled(stage, zero)
        response = friction.respond(stage, settled.sides)
        if settled.end or not response.solved:
            return None
        jump = response.qdd / SUDDEN
        slips = np.setdiff1d(np.flatnonzero(~friction.signed), zero).astype(int)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = -w[slips] / (at.S @ jump)[slips]
        ends = np.where(share > 0, share, np.inf)  # when slips come to theirs
        step = min(1.0 - elapsed, float(ends.min(initial=np.inf)))
        P = step / SUDDEN * response.pushes
        pushes[some] += P
        T += step / SUDDEN * response.t
        is_stop = np.array(some) < count
        gained += float(P[is_stop] @ (constraint.rows[is_stop] @ (rate + step / 2 * jump)))
        rate, elapsed = rate + step * jump, elapsed + step
        if 1.0 - elapsed <= STILL:
            return Blow(rate, pushes, T, reverses, max(gained, 0.0))
        reverses = True
        zero = [*(j for j in zero if settled.sides[j] == 0), *slips[ends <= step * (1 + DEPENDENT)]]
    return None


# -- of drives ---------------------------------------------------------------------------


def jolt_of(
    equation: Equation, roles: Roles, watch: str, t: float, y: Floats
) -> tuple[Impact | None, float]:
    """The blow of the drives that new roles of an event bring about; None where no rate jumps.

    Beside it what the drives work [J], which go on at their rates: what is missing then is lost
    (Carnot's theorem).

    Raises `RequestError` where a driver is not where the law says that it is to follow.
    """
    system, (q, before) = equation.system, equation.layout.motion(y.copy())
    for i in roles.prescribed:
        coordinate = roles.law_at(i, t)[0]
        if not abs(coordinate - q[i]) <= SETTLED * max(1.0, abs(q[i])):
            name = roles.drivers[i]
            fault = f"at t = {t:.9g} s {name}.q is {q[i]:.9g}, and its law of motion says "
            fault += f"{coordinate:.9g}"
            remedy = "let the event be where the two meet, or lock the driver"
            raise refused(f"watch.{watch}.then.{name}", fault, remedy, code="roles")
    target = roles.constraint(t)
    assert target.speeds is not None
    jump = target.speeds - before[roles.bound]
    moving = np.abs(jump) > STILL * np.abs(before).max(initial=0.0)
    if not moving.any():
        return None, 0.0
    x = equation.layout.states(y)
    state = Before(t, q, before, system.terms(q, before, t, x).M, x)
    those, friction = sorted(system.contacts), system.friction
    stops, ways = system.pairs.constraints(q, before, those), [system.contacts[i] for i in those]
    bound = target._replace(drift=-jump, speeds=None)
    blown = blow(state, stops, np.array(ways), np.zeros(len(those)), friction, bound)
    blown.after[roles.bound] = target.speeds
    names = [*(system.stopped[i] for i in those), *(roles.drivers[i] for i in roles.bound)]
    record, work = impact_of(blown, state, names, roles.bound, friction)
    first = roles.drivers[roles.bound[int(np.argmax(np.abs(jump)))]]
    return record._replace(driver=first, impulse=record.pushes[first]), work
