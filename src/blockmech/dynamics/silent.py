"""Loads without a value: tables that end, functions that give NaN, springs of no length.

A method only sees that the equation of motion says nothing further on, as it does where
links do not reach. Which of the two it is, and which load it is, is asked here, once,
of the mechanism at where the motion ended.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import IMPOSSIBLE, UNDEFINED_LOAD
from blockmech.dynamics.motion import Event, Motion
from blockmech.errors import listed
from blockmech.result import Result
from blockmech.samples import Samples

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

ACTIONS = (".couple", ".force")
LITTLE = 1e-6  # of the run: how long before its end it is looked at which way rates go
AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)  # [rad or m, per s, s], or relative to what is larger


def told_of_loads(mechanism: Compiled, motion: Motion) -> Motion:
    """The motion; its end named after a load that has no value there, if there is one."""
    if motion.end not in (IMPOSSIBLE, UNDEFINED_LOAD) and motion.status != "failed":
        return motion
    silent = silent_loads(mechanism, motion)
    if not silent:
        return motion
    events = [event for event in motion.events if event.kind != motion.end]
    if motion.status != "failed":
        events.append(Event(UNDEFINED_LOAD, motion.t_end, motion.q_end, motion.qd_end))
    note = f"{listed(silent)} gives no value beyond t = {motion.t_end:.9g} s"
    return replace(motion, end=UNDEFINED_LOAD, events=tuple(events), notes=(*motion.notes, note))


def silent_loads(mechanism: Compiled, motion: Motion) -> list[str]:
    """Loads that have no value where the motion ended or just ahead, in a good pose."""
    names = list(mechanism.structure.elements)
    if not names:
        return []
    q, rate, t = _ahead(motion)
    given: dict[str, Floats] = {}
    for i in range(q.shape[1]):
        given |= {f"q_{i}": q[:, i], f"qd_{i}": rate[:, i], f"qdd_{i}": np.zeros(len(t))}
    wanted = {
        name: [o for o in mechanism.outputs if o.startswith(f"{name}.") and o.endswith(ACTIONS)]
        for name in names
    }
    every = [output for outputs in wanted.values() for output in outputs]
    plan = mechanism.plan(every, friction="none")
    samples = Samples(len(t), given, t)
    values, engine = mechanism.evaluate(plan, samples)
    found = Result(mechanism, plan, samples, values, engine, {"friction": "none"})
    good = np.ones(len(t), bool)
    for margin in found.quality.margin.values():
        good &= np.broadcast_to(margin, t.shape) > 0

    def silent(output: str) -> bool:
        return bool(np.isnan(np.broadcast_to(found[output].T, t.shape)[good]).any())

    return [name for name, outputs in wanted.items() if any(map(silent, outputs))]


def _ahead(motion: Motion) -> tuple[Floats, Floats, Floats]:
    """States from the end on: coordinates and rates (n, k), times (n,)."""
    end, rate = (np.atleast_1d(x).astype(float) for x in (motion.q_end, motion.qd_end))
    before = motion.at(motion.t_end - LITTLE * (motion.t_end - motion.t_start)).qd
    grows = np.sign(rate - np.atleast_1d(before))
    far = np.array(AHEAD)[:, None]
    q = end + far * np.sign(rate) * np.maximum(np.abs(end), 1.0)
    rates = rate + far * grows * np.maximum(np.abs(rate), 1.0)
    return q, rates, motion.t_end + far[:, 0] * max(abs(motion.t_end), 1.0)
