"""Whether the effort is what a reduced system says it is made of; and its typical speed."""

from __future__ import annotations

import math

import numpy as np

from blockmech.dynamics.system.reduced import Metered, One

PROBES = 2  # states at which the split of the effort is checked before it is trusted
AGREES = 1e-9
SLOWER = (1.0, 0.1, 0.01, 0.0)  # of a typical speed


def typical_speed(start: One, qd0: float) -> float:
    """Speed after a radian or metre, roughly [rad/s or m/s]; never zero."""
    return (abs(qd0) + math.sqrt(2 * abs(start.tau) / start.J) if start.J > 0 else 1.0) or 1.0


def splits(meter: Metered, q0: float, qd0: float, t0: float, batch: bool = False) -> bool:
    """Whether the effort is what the system says it is made of; checked at a few states.

    ``batch``: with the part that follows rate and time as batches give it, else as single
    states do.
    """
    system = meter.system
    if system.depends_on <= {"q"}:
        return True
    rest = system.rate_load if batch else system.rate_load_one
    if rest is None and ("time" in system.depends_on or not system.damped):
        return False
    wanted = frozenset({"damping"}) if system.damped else frozenset()
    usual = qd0 or typical_speed(meter.one(q0, qd0, t0), qd0)
    for i in range(1, PROBES + 1):
        q, t = q0 + 0.7 * i, t0 + 0.23 * i
        for slower in SLOWER:  # a table of the rate may end
            qd = slower * usual * (1.0 + 0.37 * i)
            here = meter.one(q, qd, t)
            if math.isfinite(here.tau) or not here.margin > 0:
                break
        whole = here.tau
        sample = meter.sample(np.array([q]), wanted)
        found = float(sample.tau[0])
        if sample.damping is not None:
            found -= float(sample.damping[0]) * qd
        if batch:
            found += float(np.sum(meter.rate_load(np.array([q]), np.array([qd]), t)))
        elif system.rate_load_one is not None:
            found += system.rate_load_one(q, qd, t)
        if here.margin > 0 and not abs(found - whole) <= AGREES * (abs(found) + abs(whole)):
            return False
    return True
