"""Motion with joint friction of any law, in absolute coordinates: no code of the package.

Unknown at a state are the accelerations of all links, what the joints transmit, and the friction
of the pairs; all but the law is linear:

    M q'' - G^T x - H^T t = Q - h        G q'' = -bias        t_j = -side_j (c_j |load_j| + d_j)

Friction is iterated to rounding. Sides, the senses of slip, are given; where a slip vanishes the
integration is ended by an event and goes on with the other one. It is for motions that nothing
holds at a standstill. A guide is without length.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.independent import multibody as mb

Law = Callable[[float], Any]  # speed -> factor of the load and drag, or a function of the load
TOLERANCE = 1e-12
STILL = 1e-8  # [rad/s or m/s] all slips below it: the mechanism stands


def stribeck(
    static: float, kinetic: float, speed: float, exponent: float, viscous: float, arm: float
) -> Law:
    """Stribeck's curve of a pin of radius ``arm`` [m], or of a guide with ``arm`` 1."""

    def law(w: float) -> tuple[float, float]:
        fall = (static - kinetic) * np.exp(-((w / speed) ** exponent))
        return arm * (kinetic + fall + viscous * w), 0.0

    return law


def film(viscosity: float, r: float, length: float, c: float, S: Any, F: Any) -> Law:
    """A journal of radius r, clearance c [m] whose friction variable is F at Sommerfeld's S."""
    from scipy.interpolate import pchip_interpolate

    def law(w: float) -> Callable[[float], float]:
        turns = w / (2 * np.pi)

        def couple(load: float) -> float:
            s = (r / c) ** 2 * viscosity * turns * 2 * r * length / load
            variable = F[-1] * s / S[-1] if s > S[-1] else float(pchip_interpolate(S, F, s))
            return variable * c / r * load * r

        return couple

    return law


def resisting(said: Any, load: float) -> float:
    """What a law holds against the slip under a load."""
    if callable(said):
        return float(said(load))
    factor, drag = said
    return float(factor * load + drag)


def acceleration(
    system: mb.System, poses: Any, rates: Any, laws: Mapping[str, Law], sides: Mapping[str, float]
) -> Any:
    """Second derivatives (n, 3) with the drivers idle."""
    instant = mb.Instant(system, poses, rates)
    held = 2 * len(system.joints)
    _, gradients, biases = instant.rows()
    mass, remaining = instant.inertia()
    slips = np.array([instant.coordinate(system.joints[name]).gradient for name in laws])
    n = poses.size
    matrix = np.zeros((n + held, n + held))
    matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = mass, -gradients[:held].T, gradients[:held]
    right = np.zeros((n + held, 1 + len(laws)))
    right[:n, 0], right[n:, 0] = instant.applied() - remaining, -biases[:held]
    right[:n, 1:] = slips.T
    solution = np.linalg.solve(matrix, right)
    places = {name: 2 * list(system.joints).index(name) for name in laws}
    said = [laws[x](abs(float(row @ instant.q_dot))) for x, row in zip(laws, slips, strict=True)]
    t = np.zeros(len(laws))
    for _ in range(200):
        last, x = t, solution[n:, 0] + solution[n:, 1:] @ t
        loads = [
            np.hypot(x[k], x[k + 1]) if system.joints[name].type == "R" else abs(x[k])
            for name, k in places.items()
        ]
        resists = [resisting(x, g) for x, g in zip(said, loads, strict=True)]
        t = np.array([-sides[name] * x for name, x in zip(laws, resists, strict=True)])
        if np.abs(t - last).max() <= 1e-15 * np.abs(t).max():
            return (solution[:n, 0] + solution[:n, 1:] @ t).reshape(-1, 3)
    raise mb.NoSolution("friction does not settle")


def moved(
    system: mb.System, poses: Any, rates: Any, laws: Mapping[str, Law], t_end: float
) -> tuple[Any, Any, int]:
    """Poses and rates (n, 3) after a time [s], and how often a pair reversed on the way."""
    shape = poses.shape
    y, t, reversals = np.concatenate([poses.ravel(), rates.ravel()]).astype(float), 0.0, 0

    def slip(name: str, y: Any) -> float:
        q, qd = (part.reshape(shape) for part in np.split(y, 2))
        instant = mb.Instant(system, q, qd)
        return float(instant.coordinate(system.joints[name]).gradient @ instant.q_dot)

    y = mb._project(system, y)
    sides = {name: np.sign(slip(name, y)) for name in laws}

    def slope(_: float, y: Any) -> Any:
        q, qd = (part.reshape(shape) for part in np.split(y, 2))
        return np.concatenate([qd.ravel(), acceleration(system, q, qd, laws, sides).ravel()])

    while t < t_end:
        events = []
        for name in laws:

            def reverses(_: float, y: Any, name: str = name) -> float:
                return slip(name, y)

            reverses.terminal, reverses.direction = True, -sides[name]  # type: ignore[attr-defined]
            events.append(reverses)
        leg = solve_ivp(
            slope, (t, t_end), y, "DOP853", events=events, rtol=TOLERANCE, atol=TOLERANCE / 10
        )
        t, y = float(leg.t[-1]), mb._project(system, leg.y[:, -1])
        stands = max(abs(slip(name, y)) for name in laws) < STILL  # and goes back from there
        for name, times in zip(laws, leg.t_events, strict=True):
            if len(times) or stands:
                sides[name], reversals = -sides[name], reversals + 1
    poses, rates = (part.reshape(shape) for part in np.split(y, 2))
    return poses, rates, reversals
