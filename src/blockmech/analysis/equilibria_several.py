r"""Equilibria of several drivers: Newton's method from many places, then along balanced curves.

Where all drivers but one are balanced there are curves, along which the load that the one driver
would have to hold changes; where that is nothing, there is an equilibrium. So from each that
Newton's method has, the curves of each driver are followed both ways by prediction along the null
vector of K without its row and correction of least norm, and their zeros are found as well.
Nothing proves that none is missed; more ``starts`` look closer. Coordinates that the loads
neither act on nor feel are free: they stay where they are, and an equilibrium is a family.

Sources: Allgower & Georg, Numerical Continuation Methods, ch. 2 and 6; Shabana, Dynamics of
Multibody Systems, 4th ed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.equilibria_one import SAME
from blockmech.analysis.equilibrium import Equilibria, equilibrium_of
from blockmech.dynamics import loads
from blockmech.dynamics.programs import Tangents, tangents
from blockmech.dynamics.system import System
from blockmech.functions.roots import NEWTON_STEPS
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import EQUAL
from blockmech.model.laws_of_motion import OverRange
from blockmech.typing import Array, Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

STRIDE = 0.02  # of the span: a step along a curve
LONG = 250  # steps along a curve
STRAY = 0.2  # of a step: a correction that is larger has left the curve
BETWEEN = 9  # places on a line between two equilibria, its ends among them
CLOSE = math.sqrt(EQUAL)  # of the span: a correction that is smaller is the last
STARTS = 64  # for each of several drivers


@dataclass(frozen=True)
class Search:
    """Where equilibria are looked for: in the coordinates on which the loads depend.

    at : (k,) coordinates of all drivers, at which those stay that are neutral
    live : places of the others, (m,) of what follows
    """

    mechanism: Compiled
    t: float
    at: Floats
    live: Array
    rotary: Array
    ends: Floats  # (m, 2)

    @property
    def span(self) -> Floats:
        """Width (m,) of the range of each."""
        return self.ends[:, 1] - self.ends[:, 0]

    def whole(self, q: Floats) -> Floats:
        """Coordinates (n, k) of all drivers."""
        coordinates = np.tile(self.at, (len(q), 1))
        coordinates[:, self.live] = q
        return coordinates

    def tangents(self, q: Floats) -> Tangents:
        """Effort (n, m), and its slopes (n, m, m)."""
        of = tangents(self.mechanism, self.whole(q), t=self.t)
        rows = np.ix_(np.arange(len(of.K)), self.live, self.live)
        return of._replace(effort=of.effort[:, self.live], K=of.K[rows])


def equilibria_of_several(mechanism: Compiled, system: System, t: float, starts: int) -> Equilibria:
    """Equilibria of several drivers."""
    from scipy.stats import qmc

    k, rotary = len(mechanism.drivers), np.array(system.rotary)
    ends = np.array([_range(mechanism, d) for d in mechanism.drivers])
    span = ends[:, 1] - ends[:, 0]
    points = qmc.Sobol(k, seed=np.random.default_rng(0)).random_base2(
        max(4, math.ceil(math.log2(starts * k)))
    )
    q = ends[:, 0] + points * span
    of = tangents(mechanism, q, t=t)
    alive = _whole(of)
    size = np.abs(of.effort[alive]).max(axis=0, initial=0.0)
    live = np.flatnonzero(~_neutral(of, alive, span))
    rest = np.where((ends[:, 0] <= 0.0) & (ends[:, 1] >= 0.0), 0.0, ends.mean(axis=1))
    search = Search(mechanism, t, rest, live, rotary[live], ends[live])

    def new(q: Floats, roots: list[Floats]) -> list[Floats]:
        """Equilibria near some places that are not known."""
        candidates = _apart([*roots, *_newton(search, q)], search)[len(roots) :]
        of = search.tangents(np.reshape(candidates, (-1, len(live))))
        good = (of.margin > 0) & (np.abs(of.effort) <= EQUAL * size[live]).all(axis=1)
        return [x for x, sound in zip(candidates, good.tolist(), strict=True) if sound]

    roots_: list[Floats] = [] if len(live) else [rest[:0]] * bool(alive.any())
    fresh = new(q[np.ix_(alive, live)], roots_) if len(live) else []
    while fresh:
        roots_ += fresh
        begins = _regular(search, fresh)
        if len(live) < 2 or not len(begins):  # no curves: of one coordinate all roots are roots
            break
        fresh = new(_crossings(search, begins), roots_)
    names = [mechanism._of_driver(d, "q") for d in mechanism.drivers]
    units = {
        n: mechanism.structure.driver_joint(d).coordinate_unit
        for n, d in zip(names, mechanism.drivers, strict=True)
    }
    families = _families(search, roots_, size[live])
    poses = search.whole(np.reshape(families, (len(families), len(live))))
    of = tangents(mechanism, poses, t=t)
    free = tuple(name for i, name in enumerate(names) if i not in live)
    rows = [
        equilibrium_of(dict(zip(names, x.tolist(), strict=True)), units, of, i, free=free)
        for i, x in enumerate(poses)
    ]
    notes = [
        "Newton's method from many places, then along balanced curves: more starts look closer"
    ]
    if mechanism.frictional_joints:
        notes.append("friction of joints is left out")
    if "time" in system.depends_on:
        notes.append(f"loads follow the time, which is held at {t:.9g} s")
    return Equilibria(tuple(sorted(rows, key=lambda e: e.q.tolist())), notes=tuple(notes))


def _neutral(of: Tangents, alive: Array, span: Floats) -> Any:
    """Which coordinates (k,) the loads neither act on nor feel, at all places (n,) that are alive.

    Efforts over the range of a coordinate are works [J], and so are slopes over those of two.
    """
    work = np.abs(of.effort[alive]).max(axis=0, initial=0.0) * span
    slopes = np.abs(of.K[alive]).max(axis=0, initial=0.0) * span * span[:, None]
    felt = np.maximum(slopes.max(axis=0), slopes.max(axis=1))
    largest = max(work.max(), slopes.max())
    return (work <= EQUAL * largest) & (felt <= EQUAL * largest)


def _regular(search: Search, roots: list[Floats]) -> Floats:
    """Those of some equilibria (r, m) that no direction leaves balanced: curves begin there."""
    q = np.array(roots)
    K = search.tangents(q).K * search.span * search.span[:, None]
    values = np.linalg.svd(K)[1]
    return np.asarray(q[values[:, -1] > EQUAL * values[:, 0]])


def _families(search: Search, roots: list[Floats], size: Floats) -> list[Floats]:
    """The equilibria, one of those that others lead to in a straight line of equilibria."""
    regular = {x.tobytes() for x in _regular(search, roots)} if roots and roots[0].size else set()
    families: list[Floats] = []
    for q in roots:
        if q.size and q.tobytes() not in regular:
            isolated = [x for x in families if x.tobytes() not in regular]
            if any(_joined(search, q, x, size) for x in isolated):
                continue
        families.append(q)
    return families


def _joined(search: Search, first: Floats, second: Floats, size: Floats) -> bool:
    """Whether two equilibria are ends of a line of equilibria, angles the nearer way round."""
    offset = second - first
    offset = np.where(search.rotary, np.remainder(offset + math.pi, math.tau) - math.pi, offset)
    of = search.tangents(first + np.linspace(0.0, 1.0, BETWEEN)[1:-1, None] * offset)
    return bool(_whole(of).all() and (np.abs(of.effort) <= math.sqrt(EQUAL) * size).all())


def _whole(of: Tangents) -> Any:
    """Which poses (n,) there are."""
    finite = np.isfinite(of.effort).all(axis=1) & np.isfinite(of.K).all((1, 2))
    return (of.margin > 0) & finite


def _newton(search: Search, q: Floats) -> list[Floats]:
    """Where Newton's method from places (n, m) ends; steps are a tenth of the span at most."""
    span = search.span
    roots: list[Floats] = []
    for _ in range(NEWTON_STEPS):
        of = search.tangents(q) if len(q) else None
        if of is None or not (good := _whole(of)).any():
            break
        q, effort, K = q[good], of.effort[good], of.K[good]
        step = -(np.linalg.pinv(K, rcond=EPS) @ effort[..., None])[..., 0]
        longest = (np.abs(step) / span).max(axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, 0.1 / np.maximum(longest, EPS))
        ready = longest[:, 0] <= 64 * EPS
        roots += [*q[ready]]
        q = q[~ready]
    return roots


def _crossings(search: Search, roots: Floats) -> Floats:
    """Places (n, m) near further zeros along the balanced curves through equilibria (r, m)."""
    (r, k), span, ends, rotary = roots.shape, search.span, search.ends, search.rotary
    driver = np.tile(np.repeat(np.arange(k), 2), r)
    q = start = np.repeat(roots, 2 * k, axis=0)
    constrained = np.array([[j for j in range(k) if j != i] for i in range(k)])[driver]

    def along(K: Floats, constrained: Any) -> Floats:
        rows = np.take_along_axis(K * span, constrained[..., None], axis=1)
        return np.asarray(np.linalg.svd(rows)[2][:, -1])

    tangent = along(search.tangents(q).K, constrained)
    tangent *= np.where(np.arange(len(q)) % 2, -1.0, 1.0)[:, None]
    residual = np.zeros(len(q))
    crossings: list[Floats] = []
    for step in range(LONG):
        trial, strayed = q + STRIDE * tangent * span, np.zeros(len(q), bool)
        for _ in range(3):
            of = search.tangents(trial)
            rows = np.take_along_axis(of.K * span, constrained[..., None], axis=1)
            gap = np.take_along_axis(of.effort, constrained, axis=1)
            rows, gap = (np.where(np.isfinite(x), x, 0.0) for x in (rows, gap))
            move = -(np.linalg.pinv(rows, rcond=EPS) @ gap[..., None])[..., 0]
            strayed |= np.abs(move).max(axis=1) > STRAY * STRIDE
            trial = trial + move * span
            if np.abs(move[~strayed]).max(initial=0.0) < CLOSE:
                break
        rest = np.einsum("mij,mj->mi", of.K, move * span) + of.effort  # after the last correction
        now = np.take_along_axis(rest, driver[:, None], axis=1)[:, 0]
        inside = (rotary | ((trial >= ends[:, 0]) & (trial <= ends[:, 1]))).all(axis=1)
        gone = np.where(rotary, np.remainder(trial - start + math.pi, math.tau) - math.pi,
                        trial - start)  # fmt: skip
        back = (step > 3) & (np.abs(gone / span).max(axis=1) < STRIDE)
        alive = _whole(of) & ~strayed & inside
        crossings += [*((q + trial) / 2)[alive & (residual * now < 0)]]
        alive &= ~back
        if not alive.any():
            break
        K = np.where(np.isfinite(of.K), of.K, 0.0)[alive]
        q, start, driver, constrained, residual = (
            x[alive] for x in (trial, start, driver, constrained, now)
        )
        old, tangent = tangent[alive], along(K, constrained)
        tangent *= np.where((old * tangent).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return np.reshape(crossings, (-1, k))


def _range(mechanism: Compiled, driver: str) -> tuple[float, float]:
    """Where a driver is looked for: between its stops, a turn, its law's range, or the size."""
    scene = mechanism.scene
    low, high = scene.stops[driver].bounds if driver in scene.stops else (-math.inf, math.inf)
    law = scene.drive.get(driver)
    if mechanism.structure.driver_joint(driver).rotary:
        bounds = (-math.pi, math.pi)
    elif isinstance(law, OverRange) and law.travelled[0] != law.travelled[1]:
        bounds = (min(law.travelled), max(law.travelled))
    else:
        size = 2 * loads.largest_length(mechanism.structure)
        bounds = (-size, size)
    both = math.isfinite(low) and math.isfinite(high)
    return (low, high) if both else (max(low, bounds[0]), min(high, bounds[1]))


def _apart(roots: list[Floats], search: Search) -> list[Floats]:
    """Places that are not the same, angles within a turn from where they were looked for."""
    rotary, ends, span = search.rotary, search.ends, search.span
    distinct: list[Floats] = []
    for q in roots:
        q = np.where(rotary, ends[:, 0] + np.mod(q - ends[:, 0], math.tau), q)
        q = np.where(rotary & (np.abs(q - ends[:, 0] - math.tau) < SAME), ends[:, 0], q)
        inside = (q >= ends[:, 0] - SAME * span) & (q <= ends[:, 1] + SAME * span)

        def gap(root: Floats, q: Floats = q) -> float:
            d = np.abs(root - q)
            return float((np.where(rotary, np.minimum(d, math.tau - d), d) / span).max())

        if inside.all() and all(gap(root) > SAME for root in distinct):
            distinct.append(q)
    return distinct
