"""Motion with free, prescribed and locked drivers, friction and stops, in absolute coordinates.

A driver that is not free is one more condition of the coordinates of all links, and its drive the
multiplier of that. Friction is as in `sticking`; a stop that a driver meets turns its rate round by
Newton's law of restitution, which is one linear system in the rates of all links.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from tests.independent import multibody as mb

TOLERANCE = 1e-12
STILL = 1e-9  # [-] of the sum of what makes a relative rate: below it is zero
MISSED = 1e-7  # [-] by which a choice of senses may contradict itself where an event was located
PASSED = 1e-9  # [rad or m] beyond a stop
FOLLOWED = 12  # events at most: bounces may pile up

Drive = Callable[[float], tuple[float, float, float]]  # time -> coordinate, rate, acceleration


class Machine(NamedTuple):
    """Links and joints, and what is known of their drivers and pairs.

    drives : place of a driver that is not free -> its coordinate by the time
    factors : joint with friction -> friction per load, coefficient times radius
    stops : place of a driver -> lowest and highest coordinate, restitution
    """

    system: mb.System
    drives: Mapping[int, Drive]
    factors: Mapping[str, float]
    stops: Mapping[int, tuple[float, float, float]]


class Instant(NamedTuple):
    """Accelerations (3n,), friction (m,), its limits (m,), slips (m,), their rates and sizes."""

    acceleration: Any
    friction: Any
    limits: Any
    slips: Any
    slip_rates: Any
    sizes: Any


def conditions(machine: Machine, state: mb.Instant) -> tuple[Any, Any, Any]:
    """Values, gradients and biases of closed joints, then of drivers that are not free."""
    closed = 2 * len(machine.system.joints)
    rows = [*range(closed), *(closed + i for i in machine.drives)]
    values, gradients, biases = state.rows()
    return values[rows], gradients[rows], biases[rows]


def driven(machine: Machine, t: float, order: int) -> Any:
    """Coordinates, rates or accelerations of drivers that are not free."""
    return np.array([drive(t)[order] for drive in machine.drives.values()])


def instant(machine: Machine, t: float, poses: Any, rates: Any, senses: Sequence[int]) -> Instant:
    """One state with given senses of slip; 0: the pair sticks."""
    system, state, n = machine.system, mb.Instant(machine.system, poses, rates), poses.size
    closed = 2 * len(system.joints)
    _, gradients, biases = conditions(machine, state)
    target = np.append(-biases[:closed], driven(machine, t, 2) - biases[closed:])
    mass, gyroscopic = state.inertia()
    pairs = [state.coordinate(system.joints[name]) for name in machine.factors]
    S = np.array([row.gradient for row in pairs]).reshape(-1, n)
    drift = np.array([row.bias for row in pairs])
    stuck, slipping = ([j for j, s in enumerate(senses) if (s == 0) is x] for x in (True, False))
    rows = np.vstack([gradients, S[stuck]])
    c = len(rows)
    matrix = np.block([[mass, -rows.T], [rows, np.zeros((c, c))]])
    right = np.zeros((n + c, 1 + len(slipping)))
    right[:n, 0] = state.applied() - gyroscopic
    right[n:, 0] = np.append(target, -drift[stuck])
    right[:n, 1:] = S[slipping].T
    solution = np.linalg.solve(matrix, right)
    columns = [n + 2 * list(system.joints).index(name) for name in machine.factors]
    pins = [system.joints[name].type == "R" for name in machine.factors]
    factors = np.array(list(machine.factors.values()))
    signs = -np.array([senses[j] for j in slipping], dtype=float) * factors[slipping]
    friction = np.zeros(len(slipping))
    for _ in range(500):
        before, x = friction, solution[:, 0] + solution[:, 1:] @ friction
        loads = np.array(
            [
                np.hypot(*x[k : k + 2]) if pin else abs(x[k])
                for k, pin in zip(columns, pins, strict=True)
            ]
        )
        friction = signs * loads[slipping]
        if np.abs(friction - before).max(initial=0.0) <= 1e-15 * np.abs(friction).max(initial=0.0):
            break
    else:
        raise mb.NoSolution("friction does not settle")
    total = np.zeros(len(senses))
    total[slipping], total[stuck] = friction, x[n + len(target) :]
    sizes = np.abs(S) @ np.abs(state.q_dot)
    return Instant(x[:n], total, factors * loads, S @ state.q_dot, S @ x[:n] + drift, sizes)


def settled(
    machine: Machine, t: float, poses: Any, rates: Any, still: Sequence[int], but: Any = None
) -> tuple[int, ...]:
    """The senses of slip that do not contradict themselves; ``but`` are not among them."""
    first = instant(machine, t, poses, rates, [1] * len(machine.factors))
    zero = [
        j in still or abs(w) <= STILL * max(size, 1e-300)
        for j, (w, size) in enumerate(zip(first.slips, first.sizes, strict=True))
    ]
    choices = [
        (-1, 0, 1) if z else (int(np.sign(w)),) for z, w in zip(zero, first.slips, strict=True)
    ]
    free, candidates = len(machine.system.drivers) - len(machine.drives), []
    for senses in product(*choices):
        if senses == but or senses.count(0) > free:
            continue
        try:
            now = instant(machine, t, poses, rates, senses)
        except (np.linalg.LinAlgError, mb.NoSolution):
            continue
        size = np.abs(now.slip_rates).max(initial=0.0) + np.abs(now.acceleration).max()
        misses = [
            abs(now.friction[j]) / now.limits[j] - 1 if s == 0 else -s * now.slip_rates[j] / size
            for j, s in enumerate(senses)
            if zero[j]
        ]
        candidates.append((max(misses, default=0.0), senses))
    (miss, senses), *_ = sorted(candidates)
    if miss > MISSED:
        raise mb.NoSolution(f"every choice of senses contradicts itself, by {miss} at least")
    return senses


def projected(machine: Machine, t: float, y: Any) -> Any:
    """The nearest state that meets all conditions, and whose rates keep them met."""
    q, rate = np.split(y, 2)
    closed = 2 * len(machine.system.joints)
    for _ in range(3):
        values, gradients, _ = conditions(machine, mb.Instant(machine.system, q.reshape(-1, 3)))
        misfit = np.append(values[:closed], values[closed:] - driven(machine, t, 0))
        q = q - np.linalg.lstsq(gradients, misfit, rcond=None)[0]
    _, gradients, _ = conditions(machine, mb.Instant(machine.system, q.reshape(-1, 3)))
    misfit = gradients @ rate - np.append(np.zeros(closed), driven(machine, t, 1))
    return np.concatenate([q, rate - np.linalg.lstsq(gradients, misfit, rcond=None)[0]])


def coordinates(machine: Machine, y: Any) -> tuple[Any, Any]:
    """Coordinates and rates (d,) of the drivers."""
    q, rate = (part.reshape(-1, 3) for part in np.split(y, 2))
    state = mb.Instant(machine.system, q, rate)
    rows = [state.coordinate(driver) for driver in machine.system.drivers.values()]
    return np.array([r.value for r in rows]), np.array([r.gradient @ state.q_dot for r in rows])


def struck(machine: Machine, y: Any, driver: int, restitution: float) -> Any:
    """The state after an impact of a driver on its stop, without friction."""
    q, rate = (part.reshape(-1, 3) for part in np.split(y, 2))
    state = mb.Instant(machine.system, q, rate)
    _, gradients, _ = conditions(machine, state)
    mass, _ = state.inertia()
    stop = state.coordinate([*machine.system.drivers.values()][driver]).gradient
    rows = np.vstack([gradients, stop])
    jumps = np.append(np.zeros(len(gradients)), -(1 + restitution) * (stop @ state.q_dot))
    weighted = np.linalg.solve(mass, rows.T)
    jump = weighted @ np.linalg.lstsq(rows @ weighted, jumps, rcond=None)[0]
    return np.concatenate([q.ravel(), state.q_dot + jump])


def moved(
    machine: Machine, poses: Any, rates: Any, t_end: float, tolerance: float = TOLERANCE
) -> tuple[Any, Any, list[str]]:
    """Coordinates and rates (d,) of the drivers after a time [s], and what happened until then."""
    t, y = 0.0, np.concatenate([poses.ravel(), rates.ravel()]).astype(float)
    y, events = projected(machine, t, y), list[str]()

    def split(y: Any) -> Any:
        return (part.reshape(poses.shape) for part in np.split(y, 2))

    senses = settled(machine, t, *split(y), ())
    while t < t_end:

        def slope(t: float, y: Any, senses: Any = senses) -> Any:
            q, rate = split(y)
            now = instant(machine, t, q, rate, senses)
            return np.concatenate([rate.ravel(), now.acceleration])

        rules = []
        for j, sense in enumerate(senses):

            def turns(t: float, y: Any, j: int = j, s: int = sense, senses: Any = senses) -> float:
                now = instant(machine, t, *split(y), senses)
                return float(s * now.slips[j] if s else now.limits[j] - abs(now.friction[j]))

            rules.append(turns)
        for i, (low, high, _) in machine.stops.items():
            for level, sign in ((low, 1.0), (high, -1.0)):

                def room(t: float, y: Any, i: int = i, x: float = level, s: float = sign) -> float:
                    return float(s * (coordinates(machine, y)[0][i] - x))

                rules.append(room)
        for rule in rules:
            rule.terminal, rule.direction = True, -1.0  # type: ignore[attr-defined]
        leg = solve_ivp(
            slope, (t, t_end), y, "DOP853", events=rules, rtol=tolerance, atol=tolerance / 10
        )
        t, y = float(leg.t[-1]), projected(machine, float(leg.t[-1]), leg.y[:, -1])
        q, _ = coordinates(machine, y)
        for i, (low, high, _) in machine.stops.items():
            if not low - PASSED <= q[i] <= high + PASSED:
                raise mb.NoSolution(f"a stop was passed before {t:.9g} s: bounces too low to see")
        if t >= t_end:
            break
        met = [j for j, times in enumerate(leg.t_events) if len(times)]
        if met[0] >= len(senses):
            driver = [*machine.stops][(met[0] - len(senses)) // 2]
            y = struck(machine, y, driver, machine.stops[driver][2])
            events.append(f"impact {t:.9g}")
            if len(events) > FOLLOWED:
                raise mb.NoSolution(f"bounces pile up before {t:.9g} s")
            senses = settled(machine, t, *split(y), ())
            continue
        still = [j for j, s in enumerate(senses) if j in met or not s]
        turned = any(senses[j] for j in met)
        if turned:  # no rate but rounding remains
            y = stopped(machine, t, y, still)
        senses = settled(machine, t, *split(y), still, None if turned else senses)
        events.append(f"{senses} {t:.9g}")
    return *coordinates(machine, y), events


def stopped(machine: Machine, t: float, y: Any, pairs: Sequence[int]) -> Any:
    """The nearest state with which some pairs have no relative rate."""
    q, rate = (part.reshape(-1, 3) for part in np.split(y, 2))
    state, closed = mb.Instant(machine.system, q, rate), 2 * len(machine.system.joints)
    _, gradients, _ = conditions(machine, state)
    names = list(machine.factors)
    S = [state.coordinate(machine.system.joints[names[j]]).gradient for j in pairs]
    rows = np.vstack([gradients, *S])
    target = np.concatenate([np.zeros(closed), driven(machine, t, 1), np.zeros(len(pairs))])
    misfit = np.linalg.lstsq(rows, rows @ state.q_dot - target, rcond=None)[0]
    return np.concatenate([q.ravel(), state.q_dot - misfit])
