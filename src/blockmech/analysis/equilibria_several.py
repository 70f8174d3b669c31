r"""Equilibria of several drivers: Newton's method from many places, then along balanced curves.

Where all drivers but one are balanced there are curves, along which the load that the one driver
would have to hold changes; where that is nothing, there is an equilibrium. So from each that
Newton's method has, the curves of each driver are followed both ways by prediction along the null
vector of K without its row and correction of least norm, and their zeros are found as well.
Nothing proves that none is missed; more ``starts`` look closer.

Sources: Allgower & Georg, Numerical Continuation Methods, ch. 2 and 6; Shabana, Dynamics of
Multibody Systems, 4th ed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.equilibrium import NONE, Equilibria, equilibrium_of
from blockmech.dynamics import loads
from blockmech.dynamics.system import System
from blockmech.dynamics.tangents import Tangents, tangents
from blockmech.plane import EPS
from blockmech.series import Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

STEPS = 60  # of Newton's method, from far away
SAME = 1e-7  # of the span: two equilibria are one
STRIDE = 0.02  # of the span: a step along a curve
LONG = 250  # steps along a curve
STRAY = 0.2  # of a step: a correction that is larger has left the curve
CLOSE = 1e-5  # of the span: a correction that is smaller is the last
STARTS = 64  # for each of several drivers


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

    def new(q: Floats, known: list[Floats]) -> list[Floats]:
        """Equilibria near some places that are not known."""
        kept = _apart([*known, *_newton(mechanism, q, span, t)], rotary, ends, span)[len(known) :]
        of = tangents(mechanism, np.reshape(kept, (-1, k)), t=t)
        good = (of.margin > 0) & (np.abs(of.effort) <= NONE * size).all(axis=1)
        return [x for x, sound in zip(kept, good.tolist(), strict=True) if sound]

    roots_: list[Floats] = []
    fresh = new(q[alive], roots_)
    while fresh:
        roots_ += fresh
        fresh = new(_crossings(mechanism, np.array(fresh), rotary, ends, t), roots_)
    names = [mechanism.of_driver(d, "q") for d in mechanism.drivers]
    units = {
        n: mechanism.driver_joint(d).coordinate_unit
        for n, d in zip(names, mechanism.drivers, strict=True)
    }
    of = tangents(mechanism, np.reshape(roots_, (-1, k)), t=t)
    rows = [
        equilibrium_of(dict(zip(names, x.tolist(), strict=True)), units, of, i)
        for i, x in enumerate(roots_)
    ]
    notes = [
        "Newton's method from many places, then along balanced curves: more starts look closer"
    ]
    if mechanism.frictional_joints:
        notes.append("friction of joints is left out")
    if "time" in system.depends_on:
        notes.append(f"loads follow the time, which is held at {t:.9g} s")
    return Equilibria(tuple(sorted(rows, key=lambda e: e.q.tolist())), notes=tuple(notes))


def _whole(of: Tangents) -> Any:
    """Which poses (n,) there are."""
    finite = np.isfinite(of.effort).all(axis=1) & np.isfinite(of.K).all((1, 2))
    return (of.margin > 0) & finite


def _newton(mechanism: Compiled, q: Floats, span: Floats, t: float) -> list[Floats]:
    """Where Newton's method from places (n, k) ends; steps are a tenth of the span at most."""
    done: list[Floats] = []
    for _ in range(STEPS):
        of = tangents(mechanism, q, t=t) if len(q) else None
        if of is None or not (good := _whole(of)).any():
            break
        q, effort, K = q[good], of.effort[good], of.K[good]
        step = -(np.linalg.pinv(K, rcond=EPS) @ effort[..., None])[..., 0]
        longest = (np.abs(step) / span).max(axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, 0.1 / np.maximum(longest, EPS))
        ready = longest[:, 0] <= 64 * EPS
        done += [*q[ready]]
        q = q[~ready]
    return done


def _crossings(mechanism: Compiled, roots: Floats, rotary: Any, ends: Floats, t: float) -> Floats:
    """Places (m, k) near further zeros along the balanced curves through equilibria (r, k)."""
    r, k = roots.shape
    span = ends[:, 1] - ends[:, 0]
    driver = np.tile(np.repeat(np.arange(k), 2), r)
    q = start = np.repeat(roots, 2 * k, axis=0)
    others = np.array([[j for j in range(k) if j != i] for i in range(k)])[driver]

    def along(K: Floats, others: Any) -> Floats:
        rows = np.take_along_axis(K * span, others[..., None], axis=1)
        return np.asarray(np.linalg.svd(rows)[2][:, -1])

    way = along(tangents(mechanism, q, t=t).K, others)
    way *= np.where(np.arange(len(q)) % 2, -1.0, 1.0)[:, None]
    held = np.zeros(len(q))
    crossings: list[Floats] = []
    for step in range(LONG):
        trial, strayed = q + STRIDE * way * span, np.zeros(len(q), bool)
        for _ in range(3):
            of = tangents(mechanism, trial, t=t)
            rows = np.take_along_axis(of.K * span, others[..., None], axis=1)
            gap = np.take_along_axis(of.effort, others, axis=1)
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
        crossings += [*((q + trial) / 2)[alive & (held * now < 0)]]
        alive &= ~back
        if not alive.any():
            break
        K = np.where(np.isfinite(of.K), of.K, 0.0)[alive]
        q, start, driver, others, held = (x[alive] for x in (trial, start, driver, others, now))
        old, way = way[alive], along(K, others)
        way *= np.where((old * way).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return np.reshape(crossings, (-1, k))


def _range(mechanism: Compiled, driver: str) -> tuple[float, float]:
    """Where a driver is looked for: between its stops, a turn, its law's range, or the size."""
    scene = mechanism.scene
    low, high = scene.stops[driver].bounds if driver in scene.stops else (-math.inf, math.inf)
    law: Any = scene.drive.get(driver)
    if mechanism.driver_joint(driver).rotary:
        near = (-math.pi, math.pi)
    elif law is not None and law.by_coordinate and law.travelled[0] != law.travelled[1]:
        near = (min(law.travelled), max(law.travelled))
    else:
        size = 2 * loads.largest_length(mechanism.structure)
        near = (-size, size)
    both = math.isfinite(low) and math.isfinite(high)
    return (low, high) if both else (max(low, near[0]), min(high, near[1]))


def _apart(known: list[Floats], rotary: Any, ends: Floats, span: Floats) -> list[Floats]:
    """Places that are not the same, angles within a turn from where they were looked for."""
    kept: list[Floats] = []
    for q in known:
        q = np.where(rotary, ends[:, 0] + np.mod(q - ends[:, 0], math.tau), q)
        q = np.where(rotary & (np.abs(q - ends[:, 0] - math.tau) < SAME), ends[:, 0], q)
        inside = (q >= ends[:, 0] - SAME * span) & (q <= ends[:, 1] + SAME * span)

        def gap(other: Floats, q: Floats = q) -> float:
            d = np.abs(other - q)
            return float((np.where(rotary, np.minimum(d, math.tau - d), d) / span).max())

        if inside.all() and all(gap(other) > SAME for other in kept):
            kept.append(q)
    return kept
