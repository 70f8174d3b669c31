r"""The search for four-bars that do what is wanted: many shapes, the best refined together.

Where the coupler point is wanted at P_j, size, turn and place of a shape are linear,

    P_j = A c(theta_j) + B,    A, B complex,

so only the shape is sampled, by Sobol's points. The best are refined all at once with all numbers
free, and the crank's angles where no timing is given: Levenberg's and Marquardt's method on exact
derivatives.

Sources: Marquardt, SIAM J. Appl. Math. 11 (1963); Norton, Design of Machinery, 6th ed., ch. 4
(circuit, branch and order defects).
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS
from blockmech.ground.units import NoQuantity, in_si
from blockmech.result.samples import DEFAULT_SAMPLES, warn_of_degrees
from blockmech.synthesis.fourbar import SHAPE, angles_and_point, margin, pose
from blockmech.typing import Array, Floats, Numbers, Points, Progress, Vectors

STARTS = 2**14  # shapes that are tried
REFINED = 256  # of them are refined
ROUNDS = (12, 25, 50, 100, 400)  # steps of the refinement, after which the better half goes on
LOW, HIGH = math.log(0.15), math.log(6.0)  # of lengths by the crank's, where the search starts
LEAST, MOST = math.log(0.02), math.log(50.0)  # and where it ends
ASIDE, BENT = 0.1, 0.75  # of the acceleration: how far it looks, how much of a step it may be
STUCK, NOTHING = EPS**-0.5, EPS**2  # damping and mean square of a design that moves no more
FAR = 1e3  # residual of a pose that does not close


@dataclass(frozen=True)
class Task:
    """What a four-bar must do at n positions.

    Attributes
    ----------
    points : (n,) of the coupler point [m], or None
    turns : (n,) angles [rad] of the coupler from any zero, or None
    swings : (n,) angles [rad] of the rocker from any zero, or None
    angles : (n,) [rad] that the crank turns to, from any zero; None where it is free
    closed : whether a free crank makes one full turn from the first position to the last
    """

    points: Vectors | None = None
    turns: Floats | None = None
    swings: Floats | None = None
    angles: Floats | None = None
    closed: bool = False

    @property
    def n(self) -> int:
        """Positions."""
        return len(next(x for x in (self.points, self.turns, self.swings) if x is not None))

    @property
    def size(self) -> float:
        """Size of the wanted path [m]; 1 where only angles are wanted."""
        return 1.0 if self.points is None else size_of(self.points)

    @property
    def _columns(self) -> Array:
        """Which unknowns are free: shape, A and B, the zero of angles, and the crank's angles."""
        shape = [True] * SHAPE if self.points is not None else [True] * 4 + [False] * 2
        similarity = [self.points is not None] * 4
        zero = [self.turns is not None or self.swings is not None]
        crank = [self.angles is None] * self.n
        crank[0] = False  # where the crank's angle is counted from is the shape's turn
        if self.closed:
            crank[-1] = False
        return np.array([*shape, *similarity, *zero, *crank])

    def start(self, shape: Floats, theta: Floats, branch: Array) -> tuple[Floats, Floats]:
        """Unknowns (m, k) of shapes at crank angles (m, n), and their mean square residual (m,)."""
        c, coupler, rocker = angles_and_point(shape, theta, branch)
        x = np.zeros((len(shape), SHAPE + 5 + self.n))
        x[:, :SHAPE], x[:, SHAPE + 5 :] = shape, theta
        if self.points is not None:
            A, B = similar(c, self.points)
            x[:, SHAPE : SHAPE + 4] = np.column_stack([A.real, A.imag, B.real, B.imag])
        for angle, target in ((coupler, self.turns), (rocker, self.swings)):
            if target is not None:
                x[:, SHAPE + 4] = np.angle(np.exp(1j * (target - angle)).mean(axis=1))
        cost = (self.residual(x, branch) ** 2).mean(axis=1)
        return x, np.where(np.isnan(coupler).any(axis=1), np.inf, cost)

    def residual(self, x: Floats, branch: Array) -> Floats:
        """Residuals (m, r), each by the size of its kind."""
        shape, theta, zero = x[:, :SHAPE], x[:, SHAPE + 5 :], x[:, SHAPE + 4, None]
        c, coupler, rocker = angles_and_point(shape, theta, branch)
        rows = []
        if self.points is not None:
            z = (_complex(x, 0) * c + _complex(x, 2) - self.points) / self.size
            rows += [z.real, z.imag]
        for angle, wanted in ((coupler, self.turns), (rocker, self.swings)):
            if wanted is not None:
                rows.append(np.angle(np.exp(1j * (angle + zero - wanted))))
        closes = ~np.isnan(coupler)
        return np.concatenate([np.where(closes, y, FAR) for y in rows], axis=1)

    def slopes(self, x: Floats, branch: Array) -> Floats:
        """Derivatives (m, r, k) of the residuals by the free unknowns."""
        fourbar = pose(x[:, :SHAPE], x[:, SHAPE + 5 :], branch)
        (m, k), n = x.shape, self.n
        crank, rows = np.arange(n), []
        if self.points is not None:
            A = _complex(x, 0)
            dz = np.zeros((m, n, k), complex)
            dz[..., :SHAPE] = A[..., None] * fourbar.by_point[..., :SHAPE]
            dz[..., SHAPE], dz[..., SHAPE + 1] = fourbar.point, 1j * fourbar.point
            dz[..., SHAPE + 2], dz[..., SHAPE + 3] = 1.0, 1j
            dz[:, crank, SHAPE + 5 + crank] = A * fourbar.by_point[..., SHAPE]
            rows += [dz.real / self.size, dz.imag / self.size]
        for by, wanted in ((fourbar.by_coupler, self.turns), (fourbar.by_rocker, self.swings)):
            if wanted is not None:
                d = np.zeros((m, n, k))
                d[..., :SHAPE], d[..., SHAPE + 4] = by[..., :SHAPE], 1.0
                d[:, crank, SHAPE + 5 + crank] = by[..., SHAPE]
                rows.append(d)
        closes = ~np.isnan(fourbar.coupler)[..., None]
        J = np.concatenate([np.where(closes, d, 0.0) for d in rows], axis=1)
        return np.asarray(J[..., self._columns])

    def moved(self, x: Floats, step: Floats) -> Floats:
        """Unknowns a step (m, free) further, lengths within what can be built."""
        x = x.copy()
        x[:, self._columns] += step
        for i in (0, 2, 3):
            x[:, i] = np.clip(x[:, i], LEAST, MOST)
        x[:, 4:SHAPE] = np.clip(x[:, 4:SHAPE], -math.exp(MOST), math.exp(MOST))
        return x

    def sound(self, x: Floats, branch: Array) -> tuple[Array, Floats]:
        """Which designs (m,) have no defect of circuit, branch or order, and their margins (m,)."""
        theta = x[:, SHAPE + 5 :]
        steps = np.diff(theta, axis=1)
        way = np.linspace(theta[:, 0], theta[:, -1], DEFAULT_SAMPLES, axis=-1)
        least = margin(x[:, :SHAPE], way, branch).min(axis=1)
        ordered = (steps > 0).all(axis=1) | (steps < 0).all(axis=1)
        turns = np.abs(theta[:, -1] - theta[:, 0])
        return ordered & (least > 0) & (turns <= math.tau * (1 + 1e-12)), least


def size_of(points: Vectors) -> float:
    """Size of a path [m]: how far its points are from their mean."""
    return float(np.abs(points - points.mean()).max())


def similar(c: Vectors, P: Vectors) -> tuple[Vectors, Vectors]:
    """The best A, B (m,) of P = A c + B for shapes c (m, n)."""
    middle, centre = c.mean(axis=-1, keepdims=True), P.mean()
    z, p = c - middle, P - centre
    with np.errstate(all="ignore"):
        A = (np.conj(z) * p).sum(axis=-1) / (np.abs(z) ** 2).sum(axis=-1)
    return A, centre - A * middle[..., 0]


def _complex(x: Floats, i: int) -> Vectors:
    """The unknown A (i = 0) or B (i = 2) of rows (m, k), as a column (m, 1)."""
    return np.asarray(x[:, SHAPE + i, None] + 1j * x[:, SHAPE + i + 1, None])


def refine(task: Task, x: Floats, branch: Array, steps: int) -> tuple[Floats, Floats]:
    """Least squares from many starts (m, k) at once, and the mean squares (m,) that are left.

    Steps follow the valley's bend: the second derivative along a step, from one more residual.
    Rows that do not move any more are left alone.
    """
    x = x.copy()
    cost = (task.residual(x, branch) ** 2).mean(axis=1)
    damping = np.full(len(x), 1e-3)
    going = np.arange(len(x))
    for _ in range(steps):
        going = going[(damping[going] < STUCK) & (cost[going] > NOTHING)]
        if not len(going):
            break
        here, side, shift = x[going], branch[going], damping[going]
        r, J = task.residual(here, side), task.slopes(here, side)
        size = np.sqrt(np.einsum("mri,mri->mi", J, J) + sys.float_info.min)
        rows = np.sqrt(shift)[:, None, None] * (size[:, :, None] * np.eye(size.shape[1]))
        Q, R = np.linalg.qr(np.concatenate([J, rows], axis=1))  # normal equations lose digits
        Q = Q[:, : r.shape[1]]

        def solved(y: Floats, Q: Floats = Q, R: Floats = R) -> Floats:
            return np.asarray(-np.linalg.solve(R, np.einsum("mri,mr->mi", Q, y)[..., None])[..., 0])

        step = solved(r)
        aside = task.residual(task.moved(here, ASIDE * step), side)
        bend = solved(((aside - r) / ASIDE - np.einsum("mri,mi->mr", J, step)) / ASIDE)
        straight = 2 * np.linalg.norm(bend, axis=1) < BENT * np.linalg.norm(step, axis=1)
        trial = task.moved(here, step + np.where(straight[:, None], bend, 0.0))
        cost1 = (task.residual(trial, side) ** 2).mean(axis=1)
        better = cost1 < cost[going]
        x[going] = np.where(better[:, None], trial, here)
        cost[going] = np.where(better, cost1, cost[going])
        damping[going] = np.clip(np.where(better, shift / 5, shift * 2), 1e-14, None)
    return x, cost


class Candidates(NamedTuple):
    """Refined four-bars (m) without a defect, and how many had one.

    x : (m, k) unknowns: shape, A, B, zero of angles, crank angles
    branch : (m,) of the dyad
    margin : (m,) least on the way
    left_out : four-bars that change circuit or branch on the way, or the order of positions
    """

    x: Floats
    branch: Array
    margin: Floats
    left_out: int


def search(task: Task, count: int, starts: int, seed: int, progress: Progress | None) -> Candidates:
    """Four-bars that come nearest to a task, at least four times as many as ``count``."""
    from scipy.stats import qmc

    if not (isinstance(starts, int) and starts >= 2):
        raise refused("starts", f"got {starts!r}", "give a whole number, 2 or more")
    draw = qmc.Sobol(8, seed=np.random.default_rng(seed)).random_base2(
        math.ceil(math.log2(starts))
    )[:starts]
    lengths = LOW + (HIGH - LOW) * draw[:, [0, 2, 3]]
    uv = 6.0 * draw[:, 4:6] - 3.0
    shape = np.column_stack([lengths[:, 0], math.tau * draw[:, 1], lengths[:, 1:], uv])
    branch = np.where(draw[:, 6] < 0.5, 1, -1)
    x, cost = task.start(shape, _timing(task, draw[:, 7]), branch)
    order = np.argsort(cost, kind="stable")[:REFINED]
    order = order[np.isfinite(cost[order])]
    x, branch = x[order], branch[order]
    for i, steps in enumerate(ROUNDS):
        if progress is not None:
            progress(f"{len(x)} designs refined", i, len(ROUNDS))
        x, cost = refine(task, x, branch, steps)
        sound, least = task.sound(x, branch)
        order = np.argsort(cost, kind="stable")
        seats = max(4 * count, len(x) // 2)  # one in two for designs without a defect
        keep = np.union1d(order[sound[order]][: seats // 2], order[: seats - seats // 2])
        x, branch, sound, least = x[keep], branch[keep], sound[keep], least[keep]
    return Candidates(x[sound], branch[sound], least[sound], int((~sound).sum()))


def _timing(task: Task, draw: Floats) -> Floats:
    """Crank angles (m, n); where they are free in proportion to the way along the positions."""
    if task.angles is not None:
        return np.tile(task.angles, (len(draw), 1))
    wanted = task.points if task.points is not None else task.turns
    assert wanted is not None
    along = np.append(0.0, np.cumsum(np.abs(np.diff(wanted))))
    direction = np.where(draw < 0.5, 1.0, -1.0)
    part = 1.0 if task.closed else 0.15 + 0.83 * ((draw * 2) % 1)
    return np.asarray((direction * part)[:, None] * math.tau * along / along[-1] + 0.0)  # no -0


def numbers_in_si(name: str, values: object, remedy: str, *units: str) -> Array:
    """Numbers, or rows of one for each unit, texts with units among them, in SI.

    Raises `RequestError` for what is none, with what to give.
    """
    try:
        rows: Any = values.tolist() if isinstance(values, np.ndarray) else values
        if len(units) > 1:
            rows = [[in_si(x, unit) for x, unit in zip(row, units, strict=True)] for row in rows]
        array = np.asarray(in_si(rows, *units[:1]))
        if np.isfinite(array).all():
            if units == ("rad",) and array.size:
                warn_of_degrees(name, float(array.min()), float(array.max()))
            return array
    except NoQuantity as error:
        raise refused(name, error.found, remedy, error.valid) from None
    except (TypeError, ValueError):
        pass
    raise refused(name, f"got {values!r:.60}", remedy)


def monotonic(name: str, angles: Numbers, n: int) -> Floats:
    """Angles (n,) that rise or fall. Raises `RequestError` for others."""
    remedy = "one for each position, rising or falling"
    theta = numbers_in_si(name, angles, remedy, "rad")
    steps = np.diff(theta, axis=0) if theta.ndim else theta
    if theta.shape != (n,) or not ((steps > 0).all() or (steps < 0).all()):
        raise refused(name, f"got {angles!r:.60}", remedy)
    return theta


def points_of(name: str, points: object, remedy: str) -> Vectors:
    """Points (n,) of complex numbers or rows x, y [m]. Raises `RequestError` for what is none."""
    P = numbers_in_si(name, points, remedy, "m")
    P = P[:, 0] + 1j * P[:, 1] if P.ndim == 2 and P.shape[1] == 2 else P.astype(complex)
    if P.ndim != 1:
        raise refused(name, f"got {points!r:.60}", remedy)
    return P


def path_of(points: Points, angles: Numbers | None) -> tuple[Vectors, Floats | None]:
    """Points and angles of a request. Raises `RequestError` for what is none."""
    P = points_of("points", points, "give complex numbers, or rows x, y")
    if len(P) < 3 or not np.ptp(np.abs(P - P[0])) > 0:
        raise refused("points", f"got {points!r:.60}", "give three points or more")
    return P, None if angles is None else monotonic("angles", angles, len(P))
