"""Scenes without losses: every motion is periodic by itself, or none is."""

from __future__ import annotations

from dataclasses import replace

from blockmech.dynamics.ends import INTERRUPTED
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.steady.outcome import no_steady

FAMILY = (
    "no load dissipates, so every motion near by is periodic too: this is the one from the "
    "start, and disturbances neither grow nor fade"
)


def conserved(motion: Motion) -> Motion:
    """The motion by ``energy`` from the start, if it repeats.

    Raises `RequestError` where it does not, with the reason.
    """
    if motion.status == "failed" or motion.end == INTERRUPTED:
        return motion
    if motion.regime == "rest":
        return replace(motion, status="reached", end="steady")
    if motion.status == "reached":
        facts = {**motion.facts, "multiplier": 1.0}
        return replace(motion, facts=facts, notes=(*motion.notes, FAMILY))
    work = motion.facts.get("work_per_period")
    if work is not None:
        raise no_steady(
            f"{motion.regime}: over {motion.facts['period_of_loads']:.9g} rad the loads do a work "
            f"of {work:.9g} J, whatever the speed, so that changes from turn to turn",
            'add a damper or a motor curve, or ask for "time=<s>"',
        )
    raise no_steady(
        f"the motion from the start ends by itself ({motion.end}) after {motion.t_end:.9g} s, "
        "so nothing repeats"
    )
