"""Steps in which nothing happens, told of many at once: those of machine code take no time to look.

What is told here is what `Lookout.in_step` would find; a step in doubt is left to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.dop853 import Step, between
from blockmech.dynamics.events import NEAR, PARTS, Lookout
from blockmech.dynamics.motion import Floats


def looked_over(lookout: Lookout, steps: Sequence[Step]) -> tuple[list[int], Floats, Floats]:
    """Indices of m steps in which something may happen, from the state on at which a lookout is.

    And states (n, m + 1) and values (rules, m + 1) where they begin, and at the end of the last.
    """
    t, y = np.array([s.t for s in steps]), np.array([s.y for s in steps]).T
    ends = np.array([rule.among(t, y) for rule in lookout.rules])
    states = np.column_stack((lookout.y, y))
    values = np.column_stack((lookout.values, ends))
    a, b = values[:, :-1], values[:, 1:]
    way = np.array([rule.direction for rule in lookout.rules])[:, None]
    turned = ((a < 0) & (b >= 0) & (way >= 0)) | ((a > 0) & (b <= 0) & (way <= 0))
    spans, may = np.array(lookout.spans)[:, None], [[rule.dips] for rule in lookout.rules]
    ways = (np.abs(np.diff(states[: spans.size])) / spans).max(axis=0)
    dips = np.array(may) & (np.minimum(a, b) < np.minimum(NEAR, PARTS * math.tau * ways))
    calm: NDArray[np.bool_] = np.asarray(~turned.any(axis=0))
    look = np.flatnonzero(calm & (dips.any(axis=0) | ~_steady(lookout, steps, states)))
    if look.size:
        some = [steps[i] for i in look.tolist()]
        calm[look] = _calm_inside(lookout, some, a[:, look], b[:, look], dips[:, look])
    return np.flatnonzero(~calm).tolist(), states, values


def _steady(lookout: Lookout, steps: Sequence[Step], states: Floats) -> NDArray[np.bool_]:
    """Whether (m,) nothing turns within a step: rates at both ends and between are alike."""
    if not lookout.simple:
        return np.zeros(len(steps), bool)
    h = np.array([s.t - s.t_old for s in steps])
    rates = np.array([states[1, :-1], states[1, 1:], np.diff(states[0]) / h])
    low, high = np.sort(rates, axis=0)[[0, -1]]
    return np.asarray(((low > 0) & (high < 2 * low)) | ((high < 0) & (low > 2 * high)))


def _calm_inside(
    lookout: Lookout, steps: Sequence[Step], begin: Floats, end: Floats, dips: Any
) -> NDArray[np.bool_]:
    """Whether values (rules, m) at the ends of steps keep their signs inside, and do not dip.

    One that dips cannot reach zero where it changes by less than itself.
    """
    t = np.array([s.t_old + (s.t - s.t_old) * np.arange(1.0, PARTS) / PARTS for s in steps])
    y = between(steps, t)
    calm = np.ones(len(steps), bool)
    for rule, a, b, dip in zip(lookout.rules, begin, end, dips, strict=True):
        if rule.parts == 1 and not dip.any():
            continue
        each = 1 if rule.parts == PARTS else 2
        times, states = t[:, each - 1 :: each], np.moveaxis(y[:, :, each - 1 :: each], 1, 0)
        flat = states.reshape(len(states), -1)
        inner = np.reshape(rule.among(times.ravel(), flat), times.shape)
        row = np.column_stack((a, inner, b))
        low, high = row.min(axis=1), row.max(axis=1)
        same = (low > 0) | (high < 0) if rule.parts > 1 else True
        calm &= same & (~dip | ((low > 0) & (high < 2 * low)))
    return calm
