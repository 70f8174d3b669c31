"""SciPy's own integrators, one leg at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.dynamics.legs import FINEST, Ask, Hit, Leg, directions, scales
from blockmech.dynamics.surfaces import Surface

DIFFERENCE = 1.5e-8  # relative step of a difference quotient
NAMES = {"dop853": "DOP853", "lsoda": "LSODA", "radau": "Radau"}


def integrate(ask: Ask, method: str) -> Leg:
    """One leg by `scipy.integrate.solve_ivp`."""
    from scipy.integrate import solve_ivp

    rtol, atol = scales(ask.equation, ask.y, ask.tolerance)
    more: dict[str, Any] = {"rtol": rtol}
    if method == "radau":  # it takes one relative tolerance only
        more = {"rtol": max(ask.tolerance, FINEST), "jac": _jacobian(ask)}
    solution = solve_ivp(
        ask.rhs,
        (ask.t, ask.end),
        ask.y,
        method=NAMES[method],
        atol=atol,
        dense_output=True,
        events=[_event(s, d) for s, d in zip(ask.surfaces, directions(ask), strict=True)],
        max_step=ask.longest,
        **more,
    )
    tiny = 4 * np.finfo(float).eps * max(abs(ask.t), abs(float(solution.t[-1])))
    hits = [
        Hit(surface, float(t), y)
        for surface, times, states in zip(
            ask.surfaces, solution.t_events, solution.y_events, strict=True
        )
        for t, y in zip(times, states, strict=True)
        if t - ask.t > tiny
    ]
    return Leg(
        t0=ask.t,
        t1=float(solution.t[-1]),
        y1=solution.y[:, -1].copy(),
        dense=solution.sol,
        hits=tuple(sorted(hits, key=lambda hit: (hit.t, hit.surface.terminal))),
        failed=solution.status == -1,
        turned=float(np.abs(solution.y[-1]).max()),
    )


def _jacobian(ask: Ask) -> Any:
    """df/dy by differences; nothing depends on the work, which is the last state.

    Coordinates are moved back against the motion: ahead there may be no pose.
    """
    k, w = ask.equation.drivers, ask.equation.speed

    def jacobian(t: float, y: Any) -> Any:
        base = np.asarray(ask.rhs(t, y))
        steps = DIFFERENCE * np.maximum(np.abs(y), [1e-3] * k + [1e-3 * w] * k + [1.0])
        steps[:k] *= np.where(y[k : 2 * k] > 0, -1.0, 1.0)
        columns = np.zeros((y.size, y.size))
        for i in range(2 * k):
            moved = y.copy()
            moved[i] += steps[i]
            columns[:, i] = (np.asarray(ask.rhs(t, moved)) - base) / (moved[i] - y[i])
        return columns

    return jacobian


def _event(surface: Surface, direction: int) -> Any:
    def event(t: float, y: Any) -> float:
        return surface.value(t, y)

    event.direction = direction  # type: ignore[attr-defined]
    event.terminal = surface.terminal  # type: ignore[attr-defined]
    return event
