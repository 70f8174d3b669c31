"""What is left of a motion to an end that integration stops short of: dead centres, no inertia."""

from __future__ import annotations

import math
from dataclasses import replace

from blockmech.dynamics.ends import DEAD_CENTRE, LEAST_MARGIN, NO_INERTIA
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.system.reduced import Metered

NEARLY = 1.5  # what the time left to an end is at most, relative to what the end state tells


def up_to_its_end(meter: Metered, motion: Motion) -> Motion:
    """The motion with what is left to an end that is named, but not reached."""
    if motion.end in (DEAD_CENTRE, NO_INERTIA):
        near = _dead_centre_time if motion.end == DEAD_CENTRE else _no_inertia_time
        at = near(meter, motion)
        facts = {**motion.facts, f"{motion.end.replace(' ', '_')}_time": at}
        left = NEARLY * abs(at - motion.t_end) if math.isfinite(at) else math.inf
        motion = replace(motion, facts=facts, time_error=motion.time_error + left)
    return replace(motion, cost=meter.cost)


def _dead_centre_time(meter: Metered, motion: Motion) -> float:
    """When the margin would be zero: it goes with the square of the time left [s]."""
    q, qd = float(motion.q_end), float(motion.qd_end)
    h = 1e-3 * LEAST_MARGIN
    margin = meter.one(q).margin
    slope = (margin - meter.one(q - math.copysign(h, qd)).margin) / h
    rate = abs(slope * qd)
    if not math.isfinite(margin) or abs(margin) <= abs(slope) * h:  # it is there
        return motion.t_end
    return motion.t_end + 2 * margin / rate if rate > 0 else math.nan


def _no_inertia_time(meter: Metered, motion: Motion) -> float:
    """When the inertia would be zero: its root goes straight, so the way does as a root [s]."""
    q, qd = float(motion.q_end), float(motion.qd_end)
    one = meter.one(q)
    way = abs(2 * one.J / one.dJ) if one.dJ else 0.0
    return motion.t_end + way / (2 * abs(qd)) if qd else math.nan
