"""Closing the joints: Newton on all conditions at once, from the poses that were given.

Unknowns are place and angle of every moving link; rows are two conditions for each pair and
one for each driver, which is held at its value in the given pose. Lengths are measured by the
size of the mechanism. Links and pairs stand in name order, so the order in the file changes
no bit of the result.

Source: Nikravesh, Computer-aided analysis of mechanical systems, 1988 (constraint equations
in absolute coordinates).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from blockmech.model.joints.connections import Connection, Connections
from blockmech.model.joints.contents import FRAME, LinkGiven
from blockmech.model.joints.matrix import SINGULAR, Matrix

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ITERATIONS = 80
FEW = 20  # iterations where drivers are free, to see whether lengths are special
LONGEST_STEP = 0.3  # [-] of any pose in one iteration: sizes, rad
CLOSED = 1e-10  # [-] of the size, rad: gaps that are left to rounding and conditioning
SETTLED = 1e-13  # [-] steps below which there is nothing to gain


@dataclass(frozen=True)
class Poses:
    """Where the links are: place (n,) [m] and angle (n,) [rad], in the order of ``links``."""

    links: tuple[str, ...]
    o: Complexes
    theta: Floats

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Number of each link."""
        return {link: k for k, link in enumerate(self.links)}

    def of(self, link: str) -> tuple[complex, float]:
        """Place and angle of a link; of the fixed one zero."""
        if link == FRAME:
            return 0j, 0.0
        k = self.index[link]
        return complex(self.o[k]), float(self.theta[k])

    def point(self, link: str, at: complex) -> complex:
        """Place [m] in ground axes of a place on a link."""
        o, _ = self.of(link)
        return o + self.direction(link, at)

    def direction(self, link: str, d: complex) -> complex:
        """A vector of a link's frame in ground axes."""
        _, theta = self.of(link)
        return d * complex(np.cos(theta), np.sin(theta))


def given_poses(links: Mapping[str, LinkGiven]) -> Poses:
    """The poses as the document gives them, links in name order."""
    names = tuple(sorted(name for name in links if name != FRAME))
    o, theta = zip(*(links[name].at for name in names), strict=True) if names else ((), ())
    return Poses(names, np.array(o, complex), np.array(theta, float))


def coordinate(poses: Poses, c: Connection) -> float:
    """Coordinate of a pair: angle [rad] of the second link less that of the first, or
    distance [m] from the first link's point to the second's along the guide."""
    if c.kind == "R":
        return poses.of(c.second)[1] - poses.of(c.first)[1]
    d = poses.point(c.second, c.at[1]) - poses.point(c.first, c.at[0])
    return (d * poses.direction(c.first, c.along[0]).conjugate()).real


@dataclass(frozen=True)
class Gap:
    """How far a joint is from closing: distance [m] and, of guides, angle [rad]."""

    pair: str
    distance: float
    turn: float


class Closing:
    """The conditions of all pairs on the poses of all links.

    Parameters
    ----------
    links : the moving links in name order
    pairs : the pairs
    driven : names of pairs whose coordinate is held
    size : [m] what lengths are measured by
    """

    def __init__(
        self, links: Sequence[str], pairs: Connections, driven: Collection[str], size: float
    ) -> None:
        self.links = tuple(links)
        self.size = size
        number = {link: k for k, link in enumerate(links)} | {FRAME: -1}
        self.pins = [c for c in pairs.values() if c.kind == "R"]
        self.guides = [c for c in pairs.values() if c.kind == "P"]
        turning = [c for c in self.pins if c.name in driven]
        sliding = [c for c in self.guides if c.name in driven]
        self._pins, self._guides, self._turning, self._sliding = (
            _Table(cs, number) for cs in (self.pins, self.guides, turning, sliding)
        )

    def conditions(self, poses: Poses, held: Floats | None = None) -> tuple[Floats, Matrix]:
        """Values (m,) and their derivatives (m, 3n); with drivers where ``held`` is given."""
        rows = [
            self._coincidences(poses),
            self._alignments(poses),
        ]
        if held is not None:
            rows.append(self._coordinates(poses, held))
        values = np.concatenate([value for value, _ in rows])
        parts, start = [], 0
        for value, matrix in rows:
            parts.append(matrix.below(start))
            start += len(value)
        return values, Matrix.joined(parts, (start, 3 * len(self.links)))

    def held(self, poses: Poses) -> Floats:
        """Coordinates of the drivers, over the size where they are lengths."""
        values, _ = self._coordinates(poses, None)
        return values

    def _coincidences(self, poses: Poses) -> tuple[Floats, Matrix]:
        t = self._pins
        e_a, e_b, d = t.motion(poses)
        values = np.stack([d.real, d.imag], -1).ravel() / self.size
        rows = np.arange(2 * len(d)).reshape(-1, 2)
        m = Matrix.empty()
        for k, unit in enumerate((1.0 + 0j, 1j)):
            m = m.plus(t.row(rows[:, k], np.full(len(d), unit), e_a, e_b, self.size))
        return values, m

    def _alignments(self, poses: Poses) -> tuple[Floats, Matrix]:
        t = self._guides
        e_a, e_b, d = t.motion(poses)
        u, w = e_a * t.u_a, e_b * t.u_b
        n = 1j * u
        turn = np.angle(w * np.conj(u))
        values = np.stack([_dot(n, d) / self.size, turn], -1).ravel()
        rows = np.arange(2 * len(d)).reshape(-1, 2)
        m = t.row(rows[:, 0], n, e_a, e_b, self.size, more_a=_dot(-u, d))
        return values, m.plus(t.turn_row(rows[:, 1]))

    def _coordinates(self, poses: Poses, held: Floats | None) -> tuple[Floats, Matrix]:
        r, s = self._turning, self._sliding
        angles = r.angles(poses)
        e_a, e_b, d = s.motion(poses)
        u = e_a * s.u_a
        values = np.concatenate([angles, _dot(u, d) / self.size])
        m = r.turn_row(np.arange(len(angles)))
        rows = len(angles) + np.arange(len(d))
        m = m.plus(s.row(rows, u, e_a, e_b, self.size, more_a=_dot(1j * u, d)))
        return (values if held is None else values - held), m

    def gaps(self, poses: Poses) -> list[Gap]:
        """How far every joint is from closing, the widest first."""
        _, _, d = self._pins.motion(poses)
        found = [Gap(c.name, float(abs(x)), 0.0) for c, x in zip(self.pins, d, strict=True)]
        values, _ = self._alignments(poses)
        for c, (off, turn) in zip(self.guides, values.reshape(-1, 2), strict=True):
            found.append(Gap(c.name, float(abs(off)) * self.size, float(abs(turn))))
        return sorted(found, key=lambda g: (-max(g.distance / self.size, g.turn), g.pair))

    def closed(self, poses: Poses) -> bool:
        """Whether all joints close."""
        values, _ = self.conditions(poses)
        return bool(np.abs(values).max(initial=0.0) <= CLOSED)

    def refine(self, poses: Poses, hold: bool = True) -> Poses:
        """The poses that close all joints near the given ones, as far as Newton gets.

        With ``hold`` drivers stay at their coordinates; without, each step is the shortest of
        those that are nearest to closing.
        """
        held = self.held(poses) if hold else None
        last, best = np.inf, poses
        for _ in range(ITERATIONS if hold else FEW):
            values, matrix = self.conditions(poses, held)
            gap = np.abs(values).max(initial=0.0)
            if gap <= last:
                best = poses
            if gap == 0.0 or not np.isfinite(gap):
                break
            step = (matrix.solve if hold else matrix.shortest)(-values).reshape(-1, 3)
            change = np.abs(step).max(initial=0.0)
            if change <= SETTLED or (gap < CLOSED and gap >= last / 2):
                break
            last = gap
            step *= min(1.0, LONGEST_STEP / change)
            poses = Poses(
                poses.links,
                poses.o + (step[:, 0] + 1j * step[:, 1]) * self.size,
                poses.theta + step[:, 2],
            )
        return best

    def singular(self, poses: Poses, links: Iterable[str]) -> bool:
        """Whether the conditions, drivers held, leave some links free to move, others fixed."""
        _, matrix = self.conditions(poses, self.held(poses))
        columns = [3 * poses.index[link] + k for link in links for k in range(3)]
        s = np.linalg.svd(matrix.full()[:, columns], compute_uv=False)
        return len(s) < len(columns) or bool(s.min() <= SINGULAR * s.max())

    def freedom(self, poses: Poses) -> tuple[int, Floats]:
        """Freedoms of the joints in these poses, and a motion (3n,) that they allow.

        Drivers are not held. Lengths are over the size.
        """
        _, matrix = self.conditions(poses)
        full = matrix.full()
        _, s, v = np.linalg.svd(full, full_matrices=True)
        rank = int((s > SINGULAR * s.max(initial=0.0)).sum())
        free = v[rank:]
        mix = np.cos(1.0 + np.arange(len(free)))  # no direction is left out
        return len(free), mix @ free if len(free) else np.zeros(full.shape[1])


def _dot(a: Complexes, b: Complexes) -> Floats:
    found: Floats = (a * np.conj(b)).real
    return found


class _Table:
    """Columns of so many pairs: numbers of links, places and directions."""

    def __init__(self, pairs: Sequence[Connection], number: Mapping[str, int]) -> None:
        self.a = np.array([number[c.first] for c in pairs], int)
        self.b = np.array([number[c.second] for c in pairs], int)
        self.z_a = np.array([c.at[0] for c in pairs], complex)
        self.z_b = np.array([c.at[1] for c in pairs], complex)
        self.u_a = np.array([c.along[0] for c in pairs], complex)
        self.u_b = np.array([c.along[1] for c in pairs], complex)

    def motion(self, poses: Poses) -> tuple[Complexes, Complexes, Complexes]:
        """Directions of both links, and the second's point less the first's [m]."""
        o = np.append(poses.o, 0j)  # number -1 is the frame
        e = np.append(np.exp(1j * poses.theta), 1.0 + 0j)
        e_a, e_b = e[self.a], e[self.b]
        return e_a, e_b, o[self.b] + e_b * self.z_b - o[self.a] - e_a * self.z_a

    def angles(self, poses: Poses) -> Floats:
        """Angle of the second link less that of the first [rad]."""
        theta = np.append(poses.theta, 0.0)
        found: Floats = theta[self.b] - theta[self.a]
        return found

    def row(
        self,
        rows: NDArray[np.int64],
        direction: Complexes,
        e_a: Complexes,
        e_b: Complexes,
        size: float,
        more_a: Floats | float = 0.0,
    ) -> Matrix:
        """Derivatives of the distance along a direction; ``more_a`` as it turns with a."""
        turn_b = _dot(direction, 1j * e_b * self.z_b) / size
        turn_a = (more_a - _dot(direction, 1j * e_a * self.z_a)) / size
        m = Matrix.empty()
        for link, sign, turn in ((self.b, 1.0, turn_b), (self.a, -1.0, turn_a)):
            moving = link >= 0
            for k, value in enumerate((sign * direction.real, sign * direction.imag, turn)):
                m = m.plus(Matrix(rows[moving], 3 * link[moving] + k, value[moving]))
        return m

    def turn_row(self, rows: NDArray[np.int64]) -> Matrix:
        """Derivatives of the relative angle."""
        m = Matrix.empty()
        for link, sign in ((self.b, 1.0), (self.a, -1.0)):
            moving = link >= 0
            m = m.plus(Matrix(rows[moving], 3 * link[moving] + 2, np.full(int(moving.sum()), sign)))
        return m
