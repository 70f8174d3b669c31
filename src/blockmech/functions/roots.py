"""The last place at which something holds, between one where it does and one where not.

And what searches are limited by: samples of a turn, and steps of Newton's method from afar.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import HALVINGS

SCANNED = 720  # samples of a turn among which something is looked for: every half degree
LONGEST_STEP = 0.3  # of Newton's method, in sizes of what moves and in radians
# The first term brings a link a turn round, the second from there to a singular pose: each step
# halves the distance.
NEWTON_STEPS = math.ceil(math.tau / LONGEST_STEP) + 2 * HALVINGS


def bisect(holds: Callable[[float], bool], inside: float, outside: float) -> float:
    """The last place, going from ``inside`` to ``outside``, where a condition holds.

    ``inside`` is taken to hold and ``outside`` not to; they are not asked. No number lies
    between what is returned and one where the condition fails.
    """
    for _ in range(4 * np.finfo(float).nmant):  # digits of a double; to zero there are a thousand
        middle = inside + (outside - inside) / 2
        if middle in (inside, outside):
            break
        if holds(middle):
            inside = middle
        else:
            outside = middle
    return inside


def last_place(value: Callable[[float], float], inside: float, outside: float) -> float:
    """The last place, going from ``inside`` to ``outside``, where a value is not negative.

    By inverse quadratic interpolation (Chandrupatla) down to some roundings, then as `bisect`,
    which takes five times as many values where this is smooth. NaN counts as negative.
    Source: Chandrupatla, Advances in Engineering Software 28 (1997).
    """
    a, b, t = inside, outside, 0.5
    fa, fb = value(a), value(b)
    for _ in range(np.finfo(float).nmant):
        x = a + t * (b - a)
        fx = value(x)
        if (fx >= 0) == (fa >= 0):
            c, fc = a, fa
        else:
            c, b, fc, fb = b, a, fb, fa
        a, fa = x, fx
        margin = 2 * EPS * max(abs(a), abs(b)) / abs(b - a)
        if not margin < 0.5:
            break
        t = 0.5
        if fa != fc != fb:
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            if phi * phi < xi and (1 - phi) ** 2 < 1 - xi:
                t = fa / (fb - fa) * fc / (fb - fc)
                t += (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        t = min(max(t, margin), 1 - margin)
    holds, fails = (a, b) if fa >= 0 else (b, a)
    return bisect(lambda x: value(x) >= 0, holds, fails)
