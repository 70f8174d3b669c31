"""All assembly modes of groups at given positions of the links that hold them.

Of triads they are the roots of a polynomial. The directions from the elimination are starting
points; each mode is closed by Newton's method on the three conditions themselves, so its accuracy
does not depend on that of the polynomial. Near a dead centre two modes lie close together, and
Newton's method alone would be a matter of luck. There the conditions are relaxed by a multiple tau
of the force that is about to be lost (Lyapunov & Schmidt). Along the direction in which the
platform is loose tau is a parabola, and the sign of its extreme tells whether there are two modes
or none. Where rounding hides the sign, one pose is returned, a *double* one.

For groups of class IV and higher none is at hand: Newton's method goes from many poses, the same
ones every time, to poses that close, and finds perhaps not all.

Sources: `blockmech.modes.triad`; [GR84] Golubitsky & Schaeffer, Singularities and Groups in
Bifurcation Theory I, 1985, chapter VII, for the reduction; [G00] Govaerts, Numerical
Methods for Bifurcations of Dynamical Equilibria, 2000, chapter 3, for the bordered system.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.block import InnerPair
from blockmech.blocks.modes import Mode
from blockmech.functions.roots import LONGEST_STEP, NEWTON_STEPS
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.model.joints import layout
from blockmech.model.joints.closing import Closing
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.layout import Connection, Pose
from blockmech.modes.triad import Placed, Support, Triad, coefficients, directions, placed, shifts
from blockmech.typing import Floats, Guide, LinkPosition

CLOSED = 16 * EPS  # of the size: a pose that misses less has closed
NEAR = 1e-2  # ratio of singular values: a dead centre is near. A sixfold root is good to it
SAME = DOUBLE_ROOT  # poses nearer than this are one: rounding hides the gap of a parabola
CUSP = 4 * EPS ** (2 / 3)  # the ratio where three modes fall together, closed to rounding
DELTA = EPS ** (1 / 3)  # for differences of rates

System: TypeAlias = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""x (n, 3) and a parameter (n,) -> conditions (n, 3) and their rates (n, 3, 3) by x."""


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
    double : whether two modes (or more) coincide here within rounding: a dead centre; or
        the platform can move although the supports stand
    """

    o: complex
    e: complex
    residual: float
    margin: float
    sign: int
    double: bool = False

    @property
    def angle(self) -> float:
        """Angle [rad] of the platform in (-pi, pi]."""
        return math.atan2(self.e.imag, self.e.real)


class Poses(NamedTuple):
    """All k modes of a triad in the numbers of `Placed`, by rising angle."""

    x: Floats  # (k, 3) centre [sizes] and angle [rad]
    double: list[bool]


class Fold(NamedTuple):
    """A dead centre: where a parameter has its extreme along a curve of poses."""

    x: Floats  # (3,)
    parameter: float
    loose: Floats  # (3,) direction in which the platform is loose
    bend: float  # of what the third force misses, by the square of the way along it
    rate: float  # of the same, by the parameter

    def half(self, parameter: float) -> float:
        """How far from here either mode is at another value of the parameter; NaN: none is."""
        square = -2 * self.rate * (parameter - self.parameter) / self.bend
        return math.sqrt(square) if square >= 0 else math.nan


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
    placed_triad = placed(triad, supports)
    return modes_of(placed_triad, poses(placed_triad)[0])


def modes_of(placed: Placed, solutions: Poses) -> tuple[TriadMode, ...]:
    """Modes of one triad in SI units and the platform's own frame."""
    placed = placed.rows([0] * len(solutions.x))
    o, e = placed.pose(solutions.x)
    misses, rows = placed.conditions(solutions.x)
    signs = np.where(solutions.double, 0, np.sign(np.linalg.det(rows))).astype(int)
    numbers = (o, e, np.abs(misses).max(axis=1), looseness(rows) ** 2, signs)
    columns = (x.tolist() for x in numbers)
    return tuple(TriadMode(*m) for m in zip(*columns, solutions.double, strict=True))


def poses(placed: Placed) -> list[Poses]:
    """All modes of n triads; none of one whose supports are not finite."""
    every = [directions(f) if np.isfinite(f).all() else f[:0] for f in coefficients(placed)]
    row, z = np.repeat(np.arange(len(every)), [len(e) for e in every]), np.concatenate(every)
    real = np.abs(np.log(np.abs(z))) <= LONGEST_STEP  # others are complex beyond doubt
    row, e = row[real], z[real] / np.abs(z[real])
    with np.errstate(divide="ignore", invalid="ignore"):
        o = shifts(placed.rows(row), e)
    start = np.stack([o.real, o.imag, np.broadcast_to(np.angle(e)[:, None], o.shape)], axis=-1)
    row, start = np.repeat(row, o.shape[1]), start.reshape(-1, 3)
    start, row = start[np.isfinite(start).all(axis=1)], row[np.isfinite(start).all(axis=1)]
    x, miss = newton(placed.rows(row).conditions, start)
    loose = looseness(placed.rows(row).conditions(x)[1])
    closed = has_closed(x, miss)
    rows_of_poses: list[list[_Known]] = [[] for _ in every]
    tried: list[list[_Known]] = [[] for _ in every]
    # Where tau is larger than at the distance that `NEAR` means, both modes were closed from
    # directions of their own, if there are any.
    for k in np.flatnonzero(closed | ((loose <= NEAR) & (miss <= NEAR**2))).tolist():
        poses_of_row, starts = rows_of_poses[row[k]], tried[row[k]]
        first = _Known(x[k], float(loose[k]))
        if any(map(first.same, starts)):
            continue
        starts.append(first)
        solutions: Iterable[_Known] = [first]
        if first.loose <= NEAR:
            solutions = _about_fold(placed.rows([row[k]]), first, bool(closed[k]))
        for pose in solutions:
            if not any(map(pose.same, poses_of_row)):
                poses_of_row.append(pose)
    return [_sorted(pose) for pose in rows_of_poses]


def newton(
    system: Callable[[Floats], tuple[Floats, Floats]], start: Floats
) -> tuple[Floats, Floats]:
    """Newton's method from n places at once: the best seen (n, k), and their misses (n,)."""
    x, best, smallest = start.copy(), start.copy(), np.full(len(start), np.inf)
    for _ in range(NEWTON_STEPS):
        f, rows = system(x)
        miss = np.abs(f).max(axis=1)
        better = miss < smallest
        best[better], smallest[better] = x[better], miss[better]
        step = solved(rows, -f)
        longest = np.abs(step).max(axis=1, initial=0.0)
        moves = (longest > EPS) & (better | (miss > CLOSED))  # not where there is no step: NaN
        if not moves.any():
            break
        x[moves] += step[moves] * np.minimum(1.0, LONGEST_STEP / longest[moves])[:, None]
    return best, smallest


def fold(system: System, x: Floats, parameter: float) -> Fold | None:
    """The dead centre near a pose (3,): conditions that hold, and rates that are singular.

    The rates are bordered so that the matrix stays regular; the last number g of what it
    gives to a unit right side is zero where they are singular. Solved by Newton's method.
    """
    left_vectors, _, right = np.linalg.svd(system(x[None], np.array([parameter]))[1][0])
    border = np.zeros((4, 4))
    border[:3, 3], border[3, :3] = left_vectors[:, 2], right[2]
    last = Fold(x, parameter, right[2], 0.0, 0.0)

    def singular(z: Floats) -> tuple[Floats, Floats]:
        nonlocal last
        steps = z + DELTA * np.concatenate([np.zeros((1, 4)), np.eye(4), -np.eye(4)])
        f, rows = system(steps[:, :3], steps[:, 3])
        border[:3, :3] = rows[0]
        v, w = (solved(m[None], np.eye(4)[3:])[0] for m in (border, border.T))
        turning = w[:3] @ ((rows[1:5] - rows[5:]) / (2 * DELTA)) @ v[:3]  # (4,)
        rate = (f[4] - f[8]) / (2 * DELTA)
        last = Fold(
            z[0, :3], float(z[0, 3]), v[:3], float(turning[:3] @ v[:3]), float(w[:3] @ rate)
        )
        matrix = np.vstack([np.column_stack([rows[0], rate]), -turning])
        return np.append(f[0], v[3])[None], matrix[None]

    z, miss = newton(singular, np.append(x, parameter)[None])
    singular(z)
    is_near = float(np.abs(z[0, :3] - x).max()) <= LONGEST_STEP and abs(last.bend) >= SAME
    return last if is_near and miss[0] <= SAME else None


def solved(matrices: Floats, right: Floats) -> Floats:
    """Solutions (n, k) of systems (n, k, k), (n, k); NaN for one that has none."""
    regular = np.linalg.det(matrices) != 0  # the same pivots as `solve` has
    safe = np.where(regular[:, None, None], matrices, np.nan)
    return np.asarray(np.linalg.solve(safe, right[..., None])[..., 0])


def looseness(rows: Floats) -> Floats:
    """Ratios (n,) of the extreme singular values of rates' matrices (n, 3, 3)."""
    values = np.linalg.svd(rows, compute_uv=False)
    return np.asarray(values[:, 2] / values[:, 0])


def has_closed(x: Floats, miss: Floats) -> NDArray[np.bool_]:
    """Whether a miss (n,) is rounding at a pose; with guides it may be many sizes away."""
    return np.asarray(miss <= CLOSED * np.maximum(1.0, np.hypot(x[:, 0], x[:, 1])))


def apart(first: Floats, second: Floats) -> Floats:
    """Distances of poses (..., 3), in sizes and radians."""
    turned = np.abs(np.exp(1j * first[..., 2]) - np.exp(1j * second[..., 2]))
    return np.asarray(np.hypot(np.hypot(*np.moveaxis(first - second, -1, 0)[:2]), turned))


class _Known(NamedTuple):
    x: Floats
    loose: float
    double: bool = False
    flat: bool = False  # no parabola: three modes in one, or a platform that moves

    def same(self, pose: _Known) -> bool:
        if self.flat and pose.flat:  # one of the poses between which the platform moves
            return True
        loose = min(self.loose, pose.loose)
        within = SAME if self.double or pose.double else min(SAME, 4 * CLOSED / loose)
        return bool(apart(self.x, pose.x) <= within)


def _about_fold(placed: Placed, pose: _Known, closed: bool) -> Iterator[_Known]:
    """The modes found from one pose near a dead centre: none, one, or the two about it."""
    x = pose.x
    f, rows = placed.conditions(x[None])
    lost = np.linalg.svd(rows[0])[0][:, 2]  # the force that is about to be lost

    def relaxed(x: Floats, tau: Floats) -> tuple[Floats, Floats]:
        f, rows = placed.rows([0] * len(x)).conditions(x)
        return f - tau[:, None] * lost, rows

    dead_centre = fold(relaxed, x, float(f[0] @ lost))
    if dead_centre is None:  # three modes or more in one, or a platform that moves
        if closed:
            flat = pose.loose <= CUSP
            yield pose._replace(double=flat, flat=flat)
        return
    half, miss = dead_centre.half(0.0), abs(dead_centre.parameter)
    hidden = max(CLOSED, abs(dead_centre.bend) * SAME**2)
    distinct = closed and apart(x, dead_centre.x) > 4 * math.sqrt(hidden / abs(dead_centre.bend))
    if miss <= hidden or (math.isnan(half) and closed and not distinct):
        yield _Known(dead_centre.x, 0.0, double=True)
    elif not math.isnan(half):
        start = dead_centre.x + np.outer((half, -half), dead_centre.loose)
        y, misses = newton(placed.rows([0, 0]).conditions, start)
        ratios = looseness(placed.rows([0, 0]).conditions(y)[1])
        for k in np.flatnonzero(has_closed(y, misses)).tolist():
            yield _Known(y[k], float(ratios[k]))
    if distinct:
        yield pose


def _sorted(modes: list[_Known]) -> Poses:
    """By rising angle in (-pi, pi]."""
    for k in modes:
        k.x[2] = math.atan2(math.sin(k.x[2]), math.cos(k.x[2]))
    modes = sorted(modes, key=lambda k: (k.x[2], k.x[0], k.x[1]))
    return Poses(np.array([k.x for k in modes]).reshape(-1, 3), [k.double for k in modes])


STARTS = 60  # poses from which is searched: ten for each of a triad's six modes
NOTE = f"what Newton's method finds from {STARTS} poses, dead centres left out: there may be more"


def searched(
    group: GeneralGroup, supports: Mapping[str, Support], q: Sequence[float], first: layout.Poses
) -> list[Mode]:
    """Modes of a group that are found, the one nearest to ``first`` poses first.

    Parameters
    ----------
    supports : outer joint -> place [m], or place and direction, of the earlier link
    q : coordinates [rad or m] of the group's driven joints, in their order
    first : poses of the links from which the search begins; NaN where they are not known

    Cost: a step of Newton's for each start and iteration, a second for five links.
    """
    size, names = group.largest_length() or 1.0, group.link_names
    values, driven = {}, [joint.name for joint in group.driven]
    pairs = list(_pairs(group, supports))
    for joint, x in zip(driven, q, strict=True):
        (c,) = (pair for pair in pairs if pair.name == joint)
        turn = cmath.phase(c.along[0]) - cmath.phase(c.along[1])
        values[joint] = x / size if c.kind == "P" else x + turn
    closing, chance = Closing(names, pairs, size, values), np.random.default_rng(0)
    middle = np.mean([s.p if isinstance(s, Guide) else s for s in supports.values()])
    every: list[layout.Poses] = []
    for k in range(STARTS):
        spot = size * chance.normal(size=(len(names), 2)) @ (1, 1j)
        chosen = zip(names, spot, chance.uniform(-math.pi, math.pi, len(names)), strict=True)
        start = {name: Pose(complex(middle + o), float(angle)) for name, o, angle in chosen}
        start = (
            dict(first) if k == 0 and all(cmath.isfinite(x.o) for x in first.values()) else start
        )
        poses = closing.refine({FRAME: Pose(), **start})
        if closing.closed(poses) and all(
            _apart(poses, previous, names, size) > SAME for previous in every
        ):
            every.append(poses)
    return [mode for poses in every if not (mode := _mode(closing, poses)).double]


def _pairs(group: GeneralGroup, supports: Mapping[str, Support]) -> Iterator[Connection]:
    """The pairs of a group, with its supports on the fixed link."""
    for name, pair in group.pairs.items():
        sides = [(m.at.z, m.direction) for m in pair.sides.values()]
        if isinstance(pair, InnerPair):
            first, second = pair.links
        else:
            first, second, support = FRAME, pair.link, supports[name]
            guide = support if isinstance(support, Guide) else Guide(support, sides[0][1])
            sides.insert(0, (complex(guide.p), complex(guide.u)))
        (a, u), (b, w) = sides
        yield Connection(name, first, second, pair.type, at=(a, b), along=(u, w))


def _apart(first: layout.Poses, second: layout.Poses, names: Sequence[str], size: float) -> float:
    """How far two sets of poses are apart [-], by the size and in directions."""
    distances = [abs(first[n].o - second[n].o) / size for n in names]
    return max(*distances, *(abs(first[n].direction(1) - second[n].direction(1)) for n in names))


def _mode(closing: Closing, poses: layout.Poses) -> Mode:
    """A mode: its places, margin and sign by the Jacobian of the closing."""
    matrix = closing.conditions(poses)[1]
    s = np.linalg.svd(matrix, compute_uv=False)
    margin, double = float((s[-1] / s[0]) ** 2), bool(s[-1] <= SAME * s[0])
    sign = 0 if double else int(np.sign(np.linalg.det(matrix)))
    links = {n: LinkPosition(poses[n].o, poses[n].direction(1)) for n in closing.links}
    return Mode(links, margin, sign, double)
