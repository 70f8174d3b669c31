"""Motions that come to rest: waiting for it, and where indifferent equilibria leave them."""

from __future__ import annotations

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import TOO_MANY
from blockmech.dynamics.integration.integrate import FOREVER
from blockmech.dynamics.integration.legs import FINEST
from blockmech.dynamics.steady.equilibrium import Rest, equilibrium
from blockmech.dynamics.steady.flow import FINE, LOOSE, Flow, state_at_end
from blockmech.dynamics.steady.outcome import Lost
from blockmech.dynamics.until import Until

PATIENCE = 2000  # evaluations, at first, after which rest is looked for
AT_REST = 1e-3  # distance from a stable equilibrium, in scales, that counts as rest
AWAY = 1e-3  # step beside an unstable equilibrium, in scales
GONE = 1e-14  # of a speed that has come to nothing
DOUBLINGS = 40


def resting_place(flow: Flow, x: Floats, scale: Floats, wait: bool) -> Rest | None:
    """The equilibrium that the motion from a state (2k,) comes to.

    ``wait``: whether to follow it; else only a start at rest at an equilibrium has one.

    Raises `Lost` where the motion ends by itself, `Spent`.
    """
    k = flow.drivers
    rest = equilibrium(flow.equation, flow.t0, x[:k], scale)
    if rest is not None and not x[k:].any() and np.abs(rest.q - x[:k]).max() <= 2 * rest.error:
        if rest.kind != "unstable" or not wait:
            return rest
        x = x + np.concatenate([AWAY * scale, np.zeros(k)])
    if not wait:
        return None
    most, t = PATIENCE, 0.0
    while True:
        done = flow.towards(x, Until("time", FOREVER), LOOSE, (), most)
        x, t = state_at_end(done), t + done.t_end - flow.t0
        if done.end not in (TOO_MANY, "time"):
            raise Lost(done.end, t)
        rest = equilibrium(flow.equation, flow.t0, x[:k], scale)
        if rest is not None and rest.values[0].real <= 0 and _beside(x, rest, scale):
            return rest
        most *= 2


def _beside(x: Floats, rest: Rest, scale: Floats) -> bool:
    k = rest.q.size
    fast = float(np.abs(rest.values).max())
    apart = np.abs(x[:k] - rest.q) / scale + np.abs(x[k:]) / scale / fast
    return bool(apart.max() <= AT_REST)


def glided(flow: Flow, x: Floats, rest: Rest, scale: float) -> Rest | None:
    """Where damping alone stops a driver that could rest anywhere near by."""
    if not x[1]:
        return rest
    rate = float(np.abs(rest.values).max())
    T = 1 / rate
    for _ in range(DOUBLINGS):
        (done,) = flow.after(x, T, FINEST)
        end = state_at_end(done)
        if abs(end[1]) <= GONE * rate * scale:
            break
        T *= 2
    else:
        return None
    (other,) = flow.after(x, T, FINE)
    error = 2 * abs(float(end[0] - state_at_end(other)[0])) + 2 * abs(float(end[1])) / rate
    error += flow.equation.table_error * max(1.0, abs(float(end[0] - x[0])))
    return Rest(end[:1], rest.values, error)
