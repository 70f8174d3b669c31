"""Closing joints: Newton on the conditions of some pairs, from the poses that were given.

Unknowns are place and angle of the links that are to be placed, those of one group as a rule;
rows are two conditions for each pair and one for each driver, which is held at its value in
the given pose. Lengths are measured by the size of the mechanism.

Special lengths let links move that counting holds too often: a parallelogram with three equal
cranks has no mobility by count and one in fact. What counts is the rank of the velocity
conditions in the closed pose; that it is no dead centre, where a structure can move for a
moment only, is seen after a small step along the motion found.

Source: Nikravesh, Computer-aided analysis of mechanical systems, 1988 (constraint equations
in absolute coordinates).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from blockmech.assur.formation import formation
from blockmech.functions.roots import LONGEST_STEP, NEWTON_STEPS
from blockmech.ground.plane import dot
from blockmech.ground.tolerances import BLUR, DOUBLE_ROOT, ROUNDING
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.layout import Connection, Layout, Pose, Poses
from blockmech.model.joints.varied import phase
from blockmech.typing import Array, Floats

CLOSED = 100 * ROUNDING  # [-] of the size, rad: gaps that are left to rounding and conditioning


_Row: TypeAlias = tuple[float, float, float]
_Condition: TypeAlias = tuple[float, _Row, _Row]
"""A value, and its derivatives by x, y over the size and by the angle of both links."""
FORTH, BACK = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)  # how a turn counts the angles of its links


def _conditions(c: Connection, poses: Poses, size: float) -> tuple[_Condition, ...]:
    """What a pair holds, and last its coordinate.

    A pin: both distances; the turn. A guide: the distance across it, and the turn between its
    two directions; the way along it.
    """
    (o_a, theta_a), (o_b, theta_b) = poses[c.first], poses[c.second]
    e_a, e_b = cmath.rect(1.0, theta_a), cmath.rect(1.0, theta_b)
    arm_a, arm_b = e_a * c.at[0], e_b * c.at[1]
    d = o_b + arm_b - o_a - arm_a
    if c.kind == "R":
        a, b = arm_a / size, arm_b / size
        return (
            (d.real / size, (-1.0, 0.0, a.imag), (1.0, 0.0, -b.imag)),
            (d.imag / size, (0.0, -1.0, -a.real), (0.0, 1.0, b.real)),
            (theta_b - theta_a + c.turn, BACK, FORTH),
        )

    def distance_along(n: complex) -> _Condition:
        """The distance along n, which turns with the first link."""
        by_a = (dot(1j * n, d) - dot(n, 1j * arm_a)) / size
        by_b = dot(n, 1j * arm_b) / size
        return dot(n, d) / size, (-n.real, -n.imag, by_a), (n.real, n.imag, by_b)

    u, w = e_a * c.along[0], e_b * c.along[1]
    return distance_along(1j * u), (phase(w * u.conjugate()), BACK, FORTH), distance_along(u)


def coordinate(poses: Poses, c: Connection, size: float = 1.0) -> float:
    """Coordinate of a pair: angle [rad] of the second link less that of the first, or
    distance [m] from the first link's point to the second's along the guide, over the size."""
    return _conditions(c, poses, size)[2][0]


class Gap(NamedTuple):
    """By what a joint gapes: distance [m] and, of a guide, turn [rad]."""

    pair: Connection
    distance: float
    turn: float


def tolerance(poses: Poses, size: float) -> float:
    """Gaps, over the size, that closed joints may have: places far off are known to rounding."""
    reach = max(abs(pose.o) for pose in poses.values())
    return CLOSED + min(ROUNDING * reach / size, BLUR)


def gaps(poses: Poses, pairs: Iterable[Connection], size: float) -> list[Gap]:
    """Joints that gape by more than rounding, the widest first."""
    rows, limit = [], tolerance(poses, size)
    for c in pairs:
        (first, *_), (second, *_), _ = _conditions(c, poses, size)
        gap = (math.hypot(first, second), 0.0) if c.kind == "R" else (abs(first), abs(second))
        if not max(gap) <= limit:
            rows.append(Gap(c, *gap))
    rows.sort(key=lambda g: (-max(g[1:]), g.pair.name))
    return [gap._replace(distance=gap.distance * size) for gap in rows]


@dataclass(frozen=True)
class Closing:
    """The conditions of pairs on the poses of links; all other links stand still.

    Attributes
    ----------
    links : the links to be placed
    pairs : the pairs
    size : [m] what lengths are measured by
    held : driven pair -> its coordinate, over the size, for those that are held
    """

    links: Sequence[str]
    pairs: Sequence[Connection]
    size: float
    held: Mapping[str, float]

    @classmethod
    def of(cls, layout: Layout) -> Closing:
        """All of a document, no driver held."""
        return cls(layout.links, tuple(layout.pairs.values()), layout.size, {})

    def _rows(self, poses: Poses) -> Iterator[tuple[Connection, _Condition]]:
        for c in self.pairs:
            first, second, (value, by_a, by_b) = _conditions(c, poses, self.size)
            yield c, first
            yield c, second
            if c.name in self.held:
                yield c, (value - self.held[c.name], by_a, by_b)

    def conditions(self, poses: Poses) -> tuple[Floats, Floats]:
        """Values (m,) and their derivatives (m, 3n)."""
        column = {link: 3 * k for k, link in enumerate(self.links)}
        values, entries, zeros = list[float](), list[float](), [0.0] * (3 * len(self.links))
        for c, (value, by_first, by_second) in self._rows(poses):
            line = zeros.copy()
            if (k := column.get(c.first)) is not None:
                line[k : k + 3] = by_first
            if (k := column.get(c.second)) is not None:
                line[k : k + 3] = by_second
            values.append(value)
            entries += line
        matrix = np.array(entries).reshape(len(values), len(zeros))
        return np.array(values) + 0.0, matrix + 0.0  # no -0, whose sign LAPACK takes over

    def moved(self, poses: Poses, step: Floats) -> dict[str, Pose]:
        """The poses after a step (3n,): places, over the size, and angles."""
        steps = zip(self.links, step.reshape(-1, 3).tolist(), strict=True)
        return {
            **poses,
            **{
                link: Pose(poses[link].o + complex(x, y) * self.size, poses[link].theta + turn)
                for link, (x, y, turn) in steps
            },
        }

    def refine(self, poses: Poses, enough: float = 0.0) -> Poses:
        """The poses that close the joints near the given ones, as far as Newton gets.

        It ends where they gape by no more than is ``enough``, over the size. Where the matrix is
        singular each step is the shortest of those nearest to closing.
        """
        last, best, limit = math.inf, poses, tolerance(poses, self.size)
        for _ in range(NEWTON_STEPS):
            values, matrix = self.conditions(poses)
            gap = float(np.abs(values).max(initial=0.0))
            if gap <= last:
                best = poses
            if gap <= enough or not math.isfinite(gap) or (gap < limit and gap >= last / 2):
                break
            last = gap
            step: Array = np.linalg.lstsq(matrix, -values, rcond=DOUBLE_ROOT)[0]
            longest = np.abs(step).max(initial=LONGEST_STEP)
            poses = self.moved(poses, step * (LONGEST_STEP / longest))
        return best

    def closed(self, poses: Poses) -> bool:
        """Whether all joints close."""
        return not gaps(poses, self.pairs, self.size)

    def freedom(self, poses: Poses) -> tuple[int, Floats]:
        """Freedoms that the conditions leave, and a motion (3n,) that the joints allow."""
        ratios, directions = _near_kernel(self.conditions(poses)[1])
        free = np.array([
            direction
            for ratio, direction in zip(ratios, directions, strict=True)
            if ratio <= DOUBLE_ROOT * max(math.sqrt(self._bend(poses, direction)), DOUBLE_ROOT)
        ]).reshape(-1, 3 * len(self.links))  # fmt: skip
        mix = np.cos(1.0 + np.arange(len(free)))  # no direction is left out
        return len(free), mix @ free

    def _bend(self, poses: Poses, direction: Floats) -> float:
        """How fast conditions that hold a motion weakly change along it, at most 1.

        A pose is known to rounding over the singular value along the motion, so the singular
        value itself to this times as much: where it bends, as in a dyad near its dead centre,
        values below the root of rounding tell nothing. Guides that are nearly parallel hold
        equally weakly wherever the links stand, and that can be seen down to rounding.
        """
        step = math.sqrt(DOUBLE_ROOT)
        forward, backward = (
            self.conditions(self.moved(poses, side * direction))[1] @ direction
            for side in (step, -step)
        )
        return min(float(np.linalg.norm(forward - backward)) / (2 * step), 1.0)

    def stays_weak(self, poses: Poses, drivers: Iterable[str]) -> bool:
        """Whether the conditions hold some motion weakly at other places of driven pairs, too.

        Joints that close to `CLOSED` tell a double root to the square root of it.
        """
        at = {c.name: coordinate(poses, c, self.size) for c in self.pairs if c.name in {*drivers}}
        for shift in (LONGEST_STEP / 3, -LONGEST_STEP / 3):
            shifted = replace(self, held={name: q + shift for name, q in at.items()})
            shifted_poses = shifted.refine(poses)
            if shifted.closed(shifted_poses):
                weights = np.linalg.svd(shifted.conditions(shifted_poses)[1], compute_uv=False)
                return bool(weights.min() < 10 * math.sqrt(CLOSED) * weights.max())
        return False

    def stressed(self, poses: Poses) -> tuple[str, ...]:
        """Joints that can press against each other."""
        idle = np.abs(_near_kernel(self.conditions(poses)[1].T)[1]).max(axis=0, initial=0.0)
        taking = idle > DOUBLE_ROOT * idle.max(initial=0.0)
        rows = zip(self._rows(poses), taking, strict=True)
        return tuple(dict.fromkeys(c.name for (c, _), part in rows if part))


def _near_kernel(matrix: Floats) -> tuple[Floats, Floats]:
    """Directions (k, n) that a matrix (m, n) all but takes to nothing.

    Before them their singular values (k,) over the largest.
    """
    _, s, v = np.linalg.svd(matrix)
    largest = s.max(initial=0.0)
    rank = int((s > DOUBLE_ROOT * largest).sum())
    ratios = np.zeros(len(v))
    ratios[: len(s)] = s / (largest or 1.0)
    return ratios[rank:], v[rank:]


# Special lengths.


class Special(NamedTuple):
    """Links that move because of their lengths, against the count.

    freedom : degrees of freedom in the pose, drivers not held
    links : those that take part, by name
    spare : a link without which the rest is a mechanism as it should be, with its joints
    """

    freedom: int
    links: list[str]
    spare: tuple[str, tuple[str, ...]] | None


def special_geometry(layout: Layout, mobility: int) -> Special | None:
    """What is special, or None where links move no better than other lengths let them."""
    closing = Closing.of(layout)
    poses = closing.refine(layout.given)
    if not closing.closed(poses):
        return None
    freedom, motion = closing.freedom(poses)
    if freedom <= mobility or not _keeps_moving(closing, poses, motion, mobility):
        return None
    names = closing.stressed(poses)
    links = sorted({link for name in names for link in layout.pairs[name].links})
    return Special(freedom, links, _spare(links, layout))


def _keeps_moving(closing: Closing, poses: Poses, motion: Floats, mobility: int) -> bool:
    """Whether the degrees of freedom are there a step further on as well.

    The step's square, by which a structure at a dead centre gapes, is larger than what is
    taken for nothing.
    """
    step = motion * math.sqrt(BLUR) / np.abs(motion).max()
    farther = closing.refine(closing.moved(poses, step))
    travel = max(
        max(
            abs(farther[a].theta - poses[a].theta),
            abs(farther[a].o - poses[a].o) / closing.size,
        )
        for a in closing.links
    )
    if not travel > np.abs(step).max() / 10:
        return False
    return closing.closed(farther) and closing.freedom(farther)[0] > mobility


def _spare(links: list[str], layout: Layout) -> tuple[str, tuple[str, ...]] | None:
    """The last link without which, and without its joints, the rest can be put in sequence."""
    for link in sorted(set(links) - {FRAME}, reverse=True):
        joints_of_link = tuple(name for name, c in layout.pairs.items() if link in c.links)
        if layout.drivers.keys() & joints_of_link:
            continue
        remaining = [a for a in layout.links if a != link]
        rest = [c for name, c in layout.pairs.items() if name not in joints_of_link]
        if formation(remaining, rest, (FRAME,), layout.drivers).complete:
            return link, joints_of_link
    return None
