"""Motion in which some pairs stick while others slip, in absolute coordinates.

Beside `rubbing`: several drivers, and pairs that stick. One that sticks is held by a further
condition, its relative acceleration is zero, and its friction is at most what its law allows at
rest.
Where the relative rate of a pair is zero it is tried in every way, sticking and in both senses, and
whatever contradicts itself is left out: by brute force over all pairs, none of the package's rules.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from tests.independent import multibody as mb
from tests.independent.rubbing import Law, resisting

TOLERANCE = 1e-12
STILL = 1e-9  # [-] of the sum of what makes a relative rate: below it it is zero
MISSED = 1e-7  # [-] by which a way may contradict itself where an event was located


class Instant(NamedTuple):
    """Accelerations (3n,), friction, what it may be at most, relative rates and accelerations."""

    acceleration: Any
    t: Any
    most: Any
    slip: Any
    rise: Any
    size: Any  # of the relative rates, by their terms


def instant(
    system: mb.System, poses: Any, rates: Any, laws: Mapping[str, Law], sides: Sequence[int]
) -> Instant:
    """One state with given senses of slip; 0: the pair sticks."""
    here = mb.Instant(system, poses, rates)
    held, n = 2 * len(system.joints), poses.size
    _, gradients, biases = here.rows()
    mass, remaining = here.inertia()
    rows = [here.coordinate(system.joints[name]) for name in laws]
    S, drift = np.array([r.gradient for r in rows]), np.array([r.bias for r in rows])
    stuck, slips = ([j for j, s in enumerate(sides) if (s == 0) == x] for x in (True, False))
    closed = np.vstack([gradients[:held], S[stuck]])
    c = len(closed)
    matrix = np.block([[mass, -closed.T], [closed, np.zeros((c, c))]])
    right = np.zeros((n + c, 1 + len(slips)))
    right[:n, 0] = here.applied() - remaining
    right[n:, 0] = -np.concatenate([biases[:held], drift[stuck]])
    right[:n, 1:] = S[slips].T
    solution = np.linalg.solve(matrix, right)
    places = [2 * list(system.joints).index(name) for name in laws]
    pins = [system.joints[name].type == "R" for name in laws]
    slip = S @ here.q_dot
    moving = [law(abs(float(w))) for law, w in zip(laws.values(), slip, strict=True)]
    standing = [law(0.0) for law in laws.values()]
    t = np.zeros(len(slips))
    for _ in range(500):
        last, x = t, solution[:, 0] + solution[:, 1:] @ t
        loads = [
            np.hypot(x[n + k], x[n + k + 1]) if pin else abs(x[n + k])
            for k, pin in zip(places, pins, strict=True)
        ]
        t = np.array([-sides[j] * resisting(moving[j], loads[j]) for j in slips])
        if np.abs(t - last).max(initial=0.0) <= 1e-15 * np.abs(t).max(initial=0.0):
            break
    else:
        raise mb.NoSolution("friction does not settle")
    whole = np.zeros(len(sides))
    whole[slips], whole[stuck] = t, x[n + held :]
    most = np.array([resisting(law, g) for law, g in zip(standing, loads, strict=True)])
    return Instant(x[:n], whole, most, slip, S @ x[:n] + drift, np.abs(S) @ np.abs(here.q_dot))


def settled(
    system: mb.System,
    poses: Any,
    rates: Any,
    laws: Mapping[str, Law],
    standing: Sequence[int] = (),
    but: Any = (),
) -> tuple[int, ...]:
    """The senses of slip that do not contradict themselves; ``but`` are not among them."""
    free, drivers = instant(system, poses, rates, laws, [1] * len(laws)), len(system.drivers)
    rows = enumerate(zip(free.slip, free.size, strict=True))
    zero = [j in standing or abs(w) <= STILL * max(s, 1e-300) for j, (w, s) in rows]
    choices = [
        (-1, 0, 1) if z else (int(np.sign(w)),) for z, w in zip(zero, free.slip, strict=True)
    ]
    found = []
    for sides in product(*choices):
        if sides == but or sides.count(0) > drivers:
            continue
        try:
            one = instant(system, poses, rates, laws, sides)
        except (np.linalg.LinAlgError, mb.NoSolution):
            continue
        size = np.abs(one.rise).max() + np.abs(one.acceleration).max()
        off = [
            abs(one.t[j]) / one.most[j] - 1 if s == 0 else -s * one.rise[j] / size
            for j, s in enumerate(sides)
            if zero[j]
        ]
        found.append((max(off, default=0.0), sides))
    off, sides = min(found)
    assert off <= MISSED, f"every way contradicts itself, by {off} at least"
    return sides


def moved(
    system: mb.System, poses: Any, rates: Any, laws: Mapping[str, Law], t_end: float
) -> tuple[Any, Any, list[tuple[float, tuple[int, ...]]]]:
    """Poses and rates (n, 3) after a time [s], and the senses of slip from when on."""
    shape = poses.shape
    y, t = np.concatenate([poses.ravel(), rates.ravel()]).astype(float), 0.0
    y = mb._project(system, y)

    def parts(y: Any) -> Any:
        return (part.reshape(shape) for part in np.split(y, 2))

    sides = settled(system, *parts(y), laws)
    history = [(t, sides)]
    while t < t_end:

        def slope(_: float, y: Any, sides: Any = sides) -> Any:
            q, qd = parts(y)
            return np.concatenate([qd.ravel(), instant(system, q, qd, laws, sides).acceleration])

        events = []
        for j, side in enumerate(sides):

            def turns(_: float, y: Any, j: int = j, side: int = side, sides: Any = sides) -> float:
                now = instant(system, *parts(y), laws, sides)
                return float(side * now.slip[j] if side else now.most[j] - abs(now.t[j]))

            turns.terminal, turns.direction = True, -1.0  # type: ignore[attr-defined]
            events.append(turns)
        leg = solve_ivp(
            slope, (t, t_end), y, "DOP853", events=events, rtol=TOLERANCE, atol=TOLERANCE / 10
        )
        t, y = float(leg.t[-1]), mb._project(system, leg.y[:, -1])
        if t >= t_end:
            break
        met = [j for j, times in enumerate(leg.t_events) if len(times)]
        standing = [j for j, side in enumerate(sides) if j in met or not side]
        q, qd = parts(y)
        turned = any(sides[j] for j in met)
        if turned:  # no rate but rounding is left
            qd = stopped(system, q, qd, laws, standing)
        y = np.concatenate([q.ravel(), qd.ravel()])
        sides = settled(system, q, qd, laws, standing, () if turned else sides)
        history.append((t, sides))
    poses, rates = parts(y)
    return poses, rates, history


def stopped(system: mb.System, poses: Any, rates: Any, laws: Mapping[str, Law], some: Any) -> Any:
    """The nearest rates with which some pairs stand."""
    here = mb.Instant(system, poses, rates)
    _, gradients, _ = here.rows()
    S = np.array([here.coordinate(system.joints[name]).gradient for name in laws])
    rows = np.vstack([gradients[: 2 * len(system.joints)], S[some]])
    off = np.linalg.lstsq(rows, rows @ here.q_dot, rcond=None)[0]
    return (here.q_dot - off).reshape(rates.shape)
