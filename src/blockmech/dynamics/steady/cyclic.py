"""Cyclic coordinates: drivers on whose place nothing depends, such as a balanced flywheel.

Their rates may repeat under loads of the time although their coordinates never do: those
advance by whatever they advance. Where nothing depends on the rates either, the loads add
the same to them in every period.

Source: Goldstein, Classical Mechanics, 1980, section 2-6 (cyclic coordinates).
"""

from __future__ import annotations

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.legs import FINEST
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.steady.flow import FINE, Flow, sampled, state_at_end
from blockmech.dynamics.steady.outcome import no_steady
from blockmech.dynamics.steady.shooting import SAFETY, Cycle

PLACES = 48  # coordinates that are compared
AROUND, AHEAD = 0.5, 10.0  # of the way that was seen: how far further it is looked, and onward
NARROWEST = 1e-3  # way that is looked at [spans]
LOOKED = ((0.0, 1.0, 0.0), (0.37, -0.6, 0.29), (-0.83, 1.7, 0.71))
"""Where it is looked at: the other drivers' places [spans], rates [typical], time [T]."""
SAME = 1e-12  # relative difference of accelerations that is rounding
ROUNDS = 64  # rounding errors of a rate in a period, in its own size, that are no change of it


def cyclic_drivers(flow: Flow, seen: Floats, T: float, turns: Floats, span: float) -> list[int]:
    """Drivers on whose coordinate nothing depends: over a period of the place, or where they go.

    Parameters
    ----------
    seen : (m, 2k) states of a motion, in the order of time
    T : period of the loads [s]
    turns : (k,) periods of the place [rad or m], 0 where there is none
    span : [rad or m] over which things change
    """
    k = flow.drivers
    found = []
    for i in range(k):
        rows = []
        for place, rate, share in LOOKED:
            y = np.append(seen[0], 0.0)
            y[:k] += place * span
            y[k : 2 * k] += rate * flow.equation.speed
            states = np.tile(y, (PLACES, 1))
            states[:, i] = _places(seen[:, i], turns[i], span)
            rows.append(_accelerations(flow, flow.t0 + share * T, states))
        if _same(rows):
            found.append(i)
    return found


def _places(q: Floats, turn: float, span: float) -> Floats:
    """Coordinates that tell whether anything depends on one that went along q (m,)."""
    low, high = float(q.min()), float(q.max())
    if turn:
        low, high = q[0], q[0] + turn
    else:
        wide = max(high - low, NARROWEST * span)
        onward = AHEAD * float(q[-1] - q[0])
        low += min(onward, -AROUND * wide)
        high += max(onward, AROUND * wide)
    return low + (high - low) * (np.arange(PLACES) + 0.5) / PLACES


def free_of_rates(flow: Flow, x: Floats, T: float) -> bool:
    """Whether the accelerations of cyclic drivers do not depend on the rates either."""
    k = flow.drivers
    states = np.tile(np.append(x, 0.0), (len(LOOKED), 1))
    states[:, k : 2 * k] += np.array([[rate * flow.equation.speed] for _, rate, _ in LOOKED])
    return _same([_accelerations(flow, flow.t0 + share * T, states) for *_, share in LOOKED])


def _accelerations(flow: Flow, t: float, states: Floats) -> Floats:
    """(n, k) at states (n, 2k + 1)."""
    k = flow.drivers
    flow.count(len(states))
    rows = [np.asarray(flow.equation.rhs(t, y), dtype=np.float64)[k : 2 * k] for y in states]
    return np.array(rows)


def _same(rows: list[Floats]) -> bool:
    """Whether accelerations (n, k) are one in each row; rows that cannot be are left out."""
    here = np.array([row for row in rows if np.isfinite(row).any()])
    if not here.size or not np.isfinite(here).all():
        return False
    return bool(np.ptp(here, axis=1).max() <= SAME * np.abs(here).max())


def coasting(flow: Flow, x: Floats, T: float) -> Cycle:
    """The motion from a state under loads that follow the time alone, which repeats by itself.

    Raises `RequestError` where the loads change a rate in every period, and `Lost`.
    """
    k = flow.drivers
    runs, other = (flow.after(x, T, tolerance) for tolerance in (FINEST, FINE))
    states, end = sampled(runs, T, flow.t0), state_at_end(runs[-1])
    error = SAFETY * np.abs(states - sampled(other, T, flow.t0)).max(axis=0)
    size = np.abs(states[:, k:]).max(axis=0) + np.ptp(states[:, k:], axis=0)
    gained = end[k:] - x[k:]
    if (np.abs(gained) > error[k:] + (ROUNDS * EPS + flow.equation.table_error) * size).any():
        gain = gained[np.argmax(np.abs(gained))]
        raise no_steady(
            f"the loads follow the time alone, and every {T:.9g} s they change the rate by "
            f"{gain:.6g}, whatever it is",
            'add a damper or a motor curve, or ask for "time=<s>"',
        )
    shift = np.concatenate([(end - x)[:k], np.zeros(k)])
    wrong = error[:k] + error[k:] * T + 8 * EPS * np.abs(end[:k])
    wrong += flow.equation.table_error * np.maximum(1.0, np.abs(shift[:k]))
    return Cycle(x, T, 1, shift, runs, np.ones(k), float(wrong.max()), 4 * EPS * T)
