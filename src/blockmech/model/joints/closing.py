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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.model.joints.connections import Connection, Connections
from blockmech.model.joints.contents import FRAME, LinkGiven

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ITERATIONS = 80  # of Newton's method: 20 bring a link half a turn round, singular poses halve
LONGEST_STEP = 0.3  # [-] of any pose in one iteration: sizes, rad
CLOSED = 1e-10  # [-] of the size, rad: gaps that are left to rounding and conditioning
SINGULAR = 1e-7  # [-] of the largest singular value: between rounding and its square root
FEW = 180  # unknowns up to which a matrix is full and its singular values are found in 10 ms


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
        return self.of(link)[0] + self.direction(link, at)

    def direction(self, link: str, d: complex) -> complex:
        """A vector of a link's frame in ground axes."""
        _, theta = self.of(link)
        return d * complex(np.cos(theta), np.sin(theta))

    def moved(self, step: Floats, size: float) -> Poses:
        """The poses after a step (3n,) of places, over the size, and angles."""
        x, y, turn = step.reshape(-1, 3).T
        return Poses(self.links, self.o + (x + 1j * y) * size, self.theta + turn)


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


def _dot(a: Complexes, b: Complexes) -> Floats:
    found: Floats = (a * np.conj(b)).real
    return found


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
        self.pairs = tuple(pairs.values())
        self.size = size
        number = {link: k for k, link in enumerate((*links, FRAME))}
        self._ends = np.array([[number[a] for a in c.links] for c in self.pairs], int).reshape(
            -1, 2
        )
        self._at = np.array([c.at for c in self.pairs], complex).reshape(-1, 2)
        self._along = np.array([c.along for c in self.pairs], complex).reshape(-1, 2)
        self._guided = np.array([c.kind == "P" for c in self.pairs], bool)
        self._driven = np.array([c.name in driven for c in self.pairs], bool)

    def conditions(self, poses: Poses, hold: bool = False) -> tuple[Floats, Any]:
        """Values (m,) and their derivatives (m, 3n), with the drivers' where they are held.

        A pin: both distances. A guide: the distance across it, and the turn between its two
        directions. A driver: the turn, or the way along the guide. A matrix of many unknowns
        is sparse.
        """
        a, b = self._ends.T
        theta = np.append(poses.theta, 0.0)
        e_a, e_b = (np.exp(1j * theta[k]) for k in (a, b))
        o, arm_a, arm_b = np.append(poses.o, 0j), e_a * self._at[:, 0], e_b * self._at[:, 1]
        d = o[b] + arm_b - o[a] - arm_a
        u, w = e_a * self._along[:, 0], e_b * self._along[:, 1]

        def along(n: Complexes, turns: int) -> Floats:
            """Value, and derivatives by the places and by both angles; n may turn with a."""
            turn_a = turns * _dot(1j * n, d) - _dot(n, 1j * arm_a)
            rows = _dot(n, d), n.real * self.size, n.imag * self.size, turn_a, _dot(n, 1j * arm_b)
            return np.stack(rows) / self.size

        def turn(angle: Floats) -> Floats:
            return np.stack([angle, *np.outer([0.0, 0.0, -1.0, 1.0], np.ones(len(angle)))])

        one = np.ones(len(d), complex)
        rows = [
            np.where(self._guided, along(1j * u, 1), along(one, 0)),
            np.where(self._guided, turn(np.angle(w * np.conj(u))), along(1j * one, 0)),
        ]
        ends = [self._ends, self._ends]
        if hold:
            drive = np.where(self._guided, along(u, 1), turn(theta[b] - theta[a]))
            rows.append(drive[:, self._driven])
            ends.append(self._ends[self._driven])
        value, x, y, turn_a, turn_b = np.concatenate(rows, axis=1)
        entries = np.stack([-x, -y, turn_a, x, y, turn_b], axis=-1)
        columns = (3 * np.concatenate(ends)[..., None] + np.arange(3)).reshape(-1, 6)
        return value, _matrix(entries, columns, 3 * len(poses.links))

    def gaps(self, poses: Poses) -> list[tuple[Connection, float, float]]:
        """Distance [m] and, of guides, turn [rad] by which joints gape, the widest first."""
        first, second = self.conditions(poses)[0].reshape(2, -1)
        off = np.where(self._guided, np.abs(first), np.hypot(first, second))
        turn = np.where(self._guided, np.abs(second), 0.0)
        order = sorted(range(len(off)), key=lambda k: (-max(off[k], turn[k]), self.pairs[k].name))
        return [(self.pairs[k], float(off[k]) * self.size, float(turn[k])) for k in order]

    def closed(self, poses: Poses) -> bool:
        """Whether all joints close."""
        return bool(np.abs(self.conditions(poses)[0]).max(initial=0.0) <= CLOSED)

    def refine(self, poses: Poses, hold: bool = True) -> Poses:
        """The poses that close all joints near the given ones, as far as Newton gets.

        With ``hold`` drivers stay at their coordinates; without, and where the matrix is
        singular, each step is the shortest of those that are nearest to closing.
        """
        target = self.conditions(poses, hold)[0]
        target[: 2 * len(self.pairs)] = 0.0
        last, best = np.inf, poses
        for _ in range(ITERATIONS):
            values, matrix = self.conditions(poses, hold)
            values -= target
            gap = np.abs(values).max(initial=0.0)
            if gap <= last:
                best = poses
            if gap == 0.0 or not np.isfinite(gap) or (gap < CLOSED and gap >= last / 2):
                break
            step = _solution(matrix, -values)
            last = gap
            longest = np.abs(step).max(initial=LONGEST_STEP)
            poses = poses.moved(step * (LONGEST_STEP / longest), self.size)
        return best

    def singular(self, poses: Poses, links: Iterable[str]) -> bool:
        """Whether the conditions, drivers held, leave some links free to move, others fixed."""
        columns = [3 * poses.index[link] + k for link in links for k in range(3)]
        part = self.conditions(poses, hold=True)[1][:, columns]
        full = part if isinstance(part, np.ndarray) else part.toarray()
        return bool(np.linalg.matrix_rank(full, rtol=SINGULAR) < len(columns))

    def freedom(self, poses: Poses) -> tuple[int, Floats]:
        """Freedoms of the joints in these poses, and a motion (3n,) that they allow.

        Drivers are not held. Lengths are over the size.
        """
        free = _kernel(self.conditions(poses)[1])
        mix = np.cos(1.0 + np.arange(len(free)))  # no direction is left out
        return len(free), mix @ free

    def stressed(self, poses: Poses) -> tuple[str, ...]:
        """Joints that can press against each other."""
        idle = _kernel(self.conditions(poses)[1].T)
        share = np.abs(idle).max(axis=0, initial=0.0).reshape(2, -1).max(axis=0, initial=0.0)
        taking = share > SINGULAR * share.max(initial=0.0)
        return tuple(c.name for c, part in zip(self.pairs, taking, strict=True) if part)


def _matrix(entries: Floats, columns: NDArray[np.int64], width: int) -> Any:
    """The matrix of rows of six entries; columns of the frame, behind the others, are left out."""
    rows = np.repeat(np.arange(len(entries)), 6)
    shape = (len(entries), width + 3)
    if width > FEW:
        from scipy.sparse import csc_array

        return csc_array((entries.ravel(), (rows, columns.ravel())), shape=shape)[:, :width]
    full = np.zeros(shape)
    full[rows, columns.ravel()] = entries.ravel()
    return full[:, :width]


def _solution(matrix: Any, rhs: Floats) -> Floats:
    """The shortest of those that are nearest to a solution; of large systems a solution.

    0 where a large system has none.
    """
    if matrix.shape[1] <= FEW:
        return np.asarray(np.linalg.lstsq(matrix, rhs, rcond=SINGULAR)[0], float)
    from scipy.sparse.linalg import splu

    try:
        found = splu(matrix).solve(rhs)
    except (RuntimeError, ValueError):  # exactly singular, or not square
        return np.zeros(matrix.shape[1])
    return np.where(np.isfinite(found), found, 0.0)


def _kernel(matrix: Floats) -> Floats:
    """Directions (k, n) that a matrix (m, n) takes to nothing."""
    _, s, v = np.linalg.svd(matrix)
    found: Floats = v[int((s > SINGULAR * s.max(initial=0.0)).sum()) :]
    return found
