"""All assembly modes of a triad at one position of the links that hold it.

The directions from the elimination are starting points; each mode is closed by Newton's
method on the three conditions themselves, so its accuracy does not depend on that of
the polynomial. Near a dead centre two modes lie close together, and Newton's method
alone would be a matter of luck. There the conditions are reduced to one equation
tau(s) = 0 along the direction in which the platform is loose (Lyapunov & Schmidt): tau
is a parabola near its extreme, and the sign of the extreme tells whether there are two
modes or none. Where rounding hides the sign, one pose is returned and marked *double*.

Cost: about a millisecond, most of it in some 30 steps of Newton's method.
Sources: `elimination`; [GR84] Golubitsky & Schaeffer, Singularities and Groups in
Bifurcation Theory I, 1985, chapter VII, for the reduction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from blockmech.modes.elimination import EPS, directions, shifts
from blockmech.modes.triad import Floats, Placed, Support, Triad, placed, residual
from blockmech.plane import angle, expi

STEPS = 40  # of Newton's method; halving its distance from a dead centre takes one each
LONGEST = 0.5  # step, in sizes and radians
CLOSED = 16 * EPS  # of the size: a pose that misses less has closed
NEAR_CIRCLE = 1.25  # larger directions are complex beyond doubt: a sixfold root is good to 1e-2
NEAR_DEAD = 1e-2  # ratio of extreme singular values below which a dead centre is looked for
LOCAL = 0.3  # how far the platform may be moved for that
SAME = 1e-7  # two poses nearer than this are one: rounding hides the gap of a parabola
MOST_HIDDEN = 2e-13  # miss of a double pose, whatever the parabola
NOISE = 64 * EPS  # over the ratio of singular values: how far a closed pose may be off
LOOSE = 1e-10  # the same ratio at a pose from which no parabola is seen: three modes or more
FREE = 1e-2  # how far a platform moves that is not held: three modes in one leave 1e-6 there
FLAT = 1e-6  # curvature of tau below which the platform moves instead of standing


@dataclass(frozen=True)
class TriadMode:
    """One assembly mode of a triad: a pose of the platform.

    Attributes
    ----------
    o : complex [m], place of the platform's own origin
    e : complex [-], direction of its x axis
    residual : largest miss of a leg's condition, relative to the triad's size [-]
    margin : squared ratio of the extreme singular values of the rates' matrix, lengths
        by the triad's size [-]; 0 at a dead centre
    sign : +1 or -1, of the determinant of the legs' unit forces (force x, y, moment);
        0 where it cannot be told. It keeps its value until a dead centre is passed.
    double : whether two modes (or more) coincide here within rounding: a dead centre
    movable : whether the platform can move here although the supports stand
    """

    o: complex
    e: complex
    residual: float
    margin: float
    sign: int
    double: bool = False
    movable: bool = False

    @property
    def angle(self) -> float:
        """Angle [rad] of the platform in (-pi, pi]."""
        return float(angle(1 + 0j, self.e))


class Pose(NamedTuple):
    """A mode in the numbers of `Placed`."""

    x: Floats  # (3,) o [sizes] and angle [rad]
    double: bool
    movable: bool
    within: float  # how far it may be off, in sizes and radians


class Fold(NamedTuple):
    """The extreme of tau near a pose: tau(s) = value + bend s^2 / 2 about it."""

    x: Floats  # (3,) pose of the extreme
    value: float  # tau there [-]
    bend: float  # second derivative of tau by s
    loose: Floats  # (3,) direction in which the platform is loose there
    sound: bool  # whether the extreme was found

    def hidden(self) -> float:
        """The value below which rounding hides whether there are two modes or none."""
        return max(CLOSED, min(abs(self.bend) * SAME**2, MOST_HIDDEN))


def triad_modes(triad: Triad, supports: Sequence[Support]) -> tuple[TriadMode, ...]:
    """All real assembly modes of a triad, by rising angle of the platform.

    Parameters
    ----------
    triad : its legs
    supports : a pivot [m] for each leg, a `Guide` for a leg PR

    Returns
    -------
    Up to six modes; none if the legs cannot reach

    Raises
    ------
    RequestError for supports that do not fit, or a triad that they do not hold anywhere

    >>> level = Triad.rrr(lengths=(4, 4, 4), pins=(0, 4, 3 + 4j))
    >>> [round(m.angle, 3) for m in triad_modes(level, (0, 5, 1 + 4j))]
    [-1.294, -0.083, 0.063, 0.539, 0.672, 1.98]
    """
    held = placed(triad, supports)
    return tuple(mode_of(triad, supports, held, pose) for pose in poses(held))


def poses(held: Placed) -> tuple[Pose, ...]:
    """All modes of a triad that is held, by rising angle."""
    found: list[Pose] = []
    for z in directions(held).tolist():
        if not 1 / NEAR_CIRCLE < abs(z) < NEAR_CIRCLE:
            continue
        e = z / abs(z)
        for o in shifts(held, e):
            start = np.array([o.real, o.imag, math.atan2(e.imag, e.real)])
            for x, double in _closed_from(held, start):
                within = min(SAME, NOISE / (looseness(held, x) or NOISE))
                pose = Pose(x, double, double and _moves(held, x), within)
                if not any(_same(pose, known) for known in found):
                    found.append(pose)
    return tuple(sorted(found, key=lambda p: (_wrapped(float(p.x[2])), p.x[0], p.x[1])))


def mode_of(triad: Triad, supports: Sequence[Support], held: Placed, pose: Pose) -> TriadMode:
    """A mode in SI units and the platform's own frame."""
    o, e = held.pose(pose.x)
    _, rows = held.conditions(pose.x)
    return TriadMode(
        o,
        e,
        residual(triad, supports, o, e),
        margin_of(rows),
        0 if pose.double else int(math.copysign(1, np.linalg.det(rows))),
        pose.double,
        pose.movable,
    )


def _same(one: Pose, other: Pose) -> bool:
    if one.movable and other.movable:  # one of the poses between which the platform moves
        return True
    return apart(one.x, other.x) <= max(one.within, other.within)


def close(held: Placed, start: Floats, steps: int = STEPS) -> tuple[Floats, float]:
    """Newton's method from a pose: the best pose seen, and its largest miss [-]."""
    x, best, least = start, start, math.inf
    for _ in range(steps):
        f, rows = held.conditions(x)
        miss = float(np.abs(f).max())
        if miss < least:
            best, least = x, miss
        if miss == 0 or not math.isfinite(miss):
            break
        step = solved(rows, -f)
        if step is None:
            break
        longest = float(np.abs(step).max())
        if longest <= EPS:
            break
        x = x + step * min(1.0, LONGEST / longest)
    return best, least


def has_closed(x: Floats, miss: float) -> bool:
    """Whether a miss [-] is rounding at a pose; with guides it may be many sizes away."""
    return miss <= CLOSED * max(1.0, abs(complex(x[0], x[1])))


def fold(held: Placed, x: Floats) -> Fold:
    """The dead centre nearest to a pose, along the direction in which the platform is loose.

    The conditions but for one multiple tau of a fixed vector are kept, and the platform
    is moved by s along its loose direction to where tau(s) turns.
    """
    _, rows = held.conditions(x)
    left, _, right = np.linalg.svd(rows)
    w, n = left[:, 2], right[2]
    start, s, tau = x.copy(), 0.0, 0.0
    slope, bend, turn = 0.0, 0.0, n
    for _ in range(12):
        x, tau, turn, slope, bend = _reduced(held, start, x, tau, s, w, n)
        if not math.isfinite(tau) or abs(bend) < FLAT:
            break
        step = -slope / bend
        s += step
        if abs(s) > LOCAL:
            break
        x = x + turn * step
        if abs(step) <= 1e-11:
            x, tau, turn, slope, bend = _reduced(held, start, x, tau, s, w, n)
            return Fold(x, tau, bend, turn, True)
    return Fold(x, tau, bend, turn, False)


def margin_of(rows: Floats) -> float:
    """Squared ratio of the extreme singular values of the rates' matrix (3, 3)."""
    values = np.linalg.svd(rows, compute_uv=False)
    return float((values[2] / values[0]) ** 2)


def looseness(held: Placed, x: Floats) -> float:
    """Ratio of the extreme singular values of the rates' matrix at a pose."""
    return math.sqrt(margin_of(held.conditions(x)[1]))


def _closed_from(held: Placed, start: Floats) -> Iterator[tuple[Floats, bool]]:
    """The modes found from one starting pose: none, one, or the two about a dead centre."""
    x, miss = close(held, start)
    if not miss <= LOCAL:
        return
    closed = [x] if has_closed(x, miss) else []
    if looseness(held, x) <= NEAR_DEAD:
        near = fold(held, x)
        if near.sound and abs(near.value) <= near.hidden():
            closed.append(near.x)
        elif near.sound and near.value * near.bend < 0:
            reach = math.sqrt(-2 * near.value / near.bend)
            beside = (close(held, near.x + side * near.loose) for side in (-reach, reach))
            closed += [y for y, left in beside if has_closed(y, left)]
    for y in closed:
        yield _judged(held, y)


def _judged(held: Placed, x: Floats) -> tuple[Floats, bool]:
    """A closed pose, or the double one that rounding cannot tell it from."""
    loose = looseness(held, x)
    if loose > NEAR_DEAD:
        return x, False
    near = fold(held, x)
    if not near.sound:
        return x, loose <= LOOSE
    within = 4 * math.sqrt(near.hidden() / abs(near.bend))
    none = near.value * near.bend > 0  # and yet it has closed: the miss is just hidden
    if (none or abs(near.value) <= near.hidden()) and apart(x, near.x) <= within:
        return near.x, True
    return x, False


def _reduced(
    held: Placed, start: Floats, x: Floats, tau: float, s: float, w: Floats, n: Floats
) -> tuple[Floats, float, Floats, float, float]:
    """Pose x(s), tau(s), and dx/ds, dtau/ds, d2tau/ds2 there."""
    matrix = np.zeros((4, 4))
    matrix[:3, 3], matrix[3, :3] = -w, n
    ahead = np.array([0.0, 0.0, 0.0, 1.0])
    bad = (x, math.nan, n, math.nan, math.nan)
    for _ in range(8):
        f, rows = held.conditions(x)
        matrix[:3, :3] = rows
        step = solved(matrix, -np.append(f - tau * w, n @ (x - start) - s))
        if step is None:
            return bad
        x, tau = x + step[:3], tau + float(step[3])
        if np.abs(step).max() <= 4 * EPS:
            break
    _, rows = held.conditions(x)
    matrix[:3, :3] = rows
    tangent = solved(matrix, ahead)
    if tangent is None:
        return bad
    turn, h = tangent[:3], 1e-5
    bent = (held.conditions(x + h * turn)[1] - held.conditions(x - h * turn)[1]) @ turn / (2 * h)
    second = solved(matrix, -np.append(bent, 0.0))
    if second is None:
        return bad
    return x, tau, turn, float(tangent[3]), float(second[3])


def _moves(held: Placed, x: Floats) -> bool:
    """Whether tau stays zero along the loose direction, not only at the pose."""
    left, _, right = np.linalg.svd(held.conditions(x)[1])
    w, n = left[:, 2], right[2]
    taus = [_reduced(held, x, x, 0.0, s, w, n)[1] for s in (-FREE, FREE)]
    return all(abs(tau) <= CLOSED for tau in taus)


def _wrapped(turned: float) -> float:
    return float(angle(1 + 0j, expi(turned)))


def apart(one: Floats, other: Floats) -> float:
    """Distance of two poses, in sizes and radians."""
    turned = abs(expi(float(one[2])) - expi(float(other[2])))
    return float(np.hypot(np.hypot(one[0] - other[0], one[1] - other[1]), turned))


def solved(matrix: Floats, right: Floats) -> Floats | None:
    """Solution of a square system; None if it has none."""
    try:
        x = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return None
    return np.asarray(x, dtype=float) if np.isfinite(x).all() else None
