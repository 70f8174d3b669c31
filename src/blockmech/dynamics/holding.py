"""How long joint friction holds a driver at rest under loads of the time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from scipy.optimize import brentq

from blockmech.dynamics import loads
from blockmech.dynamics.estimate import COMPARED
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System


def released(
    system: System, q: float, t: float, t_last: float
) -> tuple[float | None, tuple[float, float]]:
    """First time [s] after t at which the loads push beyond what friction holds, and that then.

    None where they do not until ``t_last``, or, if that is infinite, in a period of the loads.
    Holding: (lowest, highest) driving effort [N m or N]; it moves forward where the highest is
    negative, backward where the lowest is positive.
    """
    friction, size = system.friction, system.load_size(q)
    assert friction is not None

    def holding(s: float) -> tuple[float, float]:
        return friction.rest(q, s, size).holding

    def beyond(s: float) -> float:
        low, high = holding(s)
        return max(low, -high)

    structure = system.compiled.structure
    periods = loads.time_periods(structure)
    if "time" not in system.depends_on:
        return None, holding(t)
    latest = t_last if math.isfinite(t_last) else t + max(periods, default=1.0)
    part = min(periods, default=latest - t) / COMPARED
    a, kink = t, loads.next_time_kink(structure, t)
    while a < latest:
        b = min(a + part, kink, latest)
        if b == kink:
            kink = loads.next_time_kink(structure, kink)
        if beyond(b) > 0:
            until = b if beyond(a) >= 0 else float(brentq(beyond, a, b, xtol=EPS, rtol=4 * EPS))
            return until, holding(math.nextafter(until, math.inf))
        a = b
    return None, holding(latest)
