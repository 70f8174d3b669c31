"""Loads without a value where a motion ends: tables that end, functions that give NaN.

A method only sees that the equation of motion says nothing further on, as it does where links do
not reach.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.motion_outputs import by_column
from blockmech.ground.errors import listed
from blockmech.ground.values import Axis
from blockmech.loads.laws import Table
from blockmech.result.failures import loads_without_value
from blockmech.result.motion import Event, Motion
from blockmech.result.samples import Samples

if TYPE_CHECKING:
    from blockmech.dynamics.source import Source

AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)  # [rad or m, per s, s], or relative to what is larger


def with_undefined_loads(mechanism: Source, motion: Motion) -> Motion:
    """The motion; its end named after a load that has no value there, if there is one.

    A method only sees that the equation of motion says nothing further on, as it does where
    links do not reach: tables that end, functions that give NaN, springs of no length.
    """
    if motion.end not in (ends.IMPOSSIBLE, ends.UNDEFINED_LOAD) and motion.status != "failed":
        return motion
    silent = undefined_loads(mechanism, motion)
    if not silent:
        return motion
    events = [event for event in motion.events if event.kind != motion.end]
    if motion.status != "failed":
        events.append(Event(ends.UNDEFINED_LOAD, motion.t_end, motion.q_end, motion.qd_end))
    names, states = mechanism.drivers, zip(*np.atleast_1d(motion.q_end, motion.qd_end), strict=True)
    units = [mechanism.structure.driver_joint(name).coordinate_unit for name in names]
    state = [
        f"{name} = {q:.6g} {unit}, rate {rate:.6g} {unit}/s"
        for name, unit, (q, rate) in zip(names, units, states, strict=True)
    ]
    note = f"{listed(silent)} gives no value beyond t = {motion.t_end:.9g} s, {listed(state)}"
    return replace(
        motion, end=ends.UNDEFINED_LOAD, events=tuple(events), notes=(*motion.notes, note)
    )


def undefined_loads(mechanism: Source, motion: Motion) -> list[str]:
    """Loads, with the ends of their tables, that have no value at the end or just ahead of it."""
    end, rate = (np.atleast_1d(x).astype(float) for x in (motion.q_end, motion.qd_end))
    before = motion.at(motion.t_end - AHEAD[-2] * (motion.t_end - motion.t_start)).qd
    steps, grows = np.array(AHEAD)[:, None], np.sign(rate - np.atleast_1d(before))
    q = end + steps * np.sign(rate) * np.maximum(np.abs(end), 1.0)
    rate = rate + steps * grows * np.maximum(np.abs(rate), 1.0)
    t = motion.t_end + steps[:, 0] * max(abs(motion.t_end), 1.0)
    inputs = by_column("q", q) | by_column("qd", rate) | by_column("qdd", 0 * q)
    inputs |= by_column("x", motion.signal_states(np.full(len(t), motion.t_end)))
    silent = loads_without_value(mechanism, Samples(len(t), inputs, t))
    return [f"{name}{_range(mechanism, name)}" for name in silent]


def _range(mechanism: Source, name: str) -> str:
    """Where the table of a load has values, in words; nothing for other laws."""
    structure, load = mechanism.structure, mechanism.structure.elements[name]
    law = getattr(load, "law", None)
    if not isinstance(law, Table) or law.whole:
        return ""
    pairs = {driver: Axis.of(structure.driver_joint(driver).kind) for driver in mechanism.drivers}
    unit = load.axis(Axis(known=pairs)).argument(law.of)
    low, high = law.arguments[0], law.arguments[-1]
    return f" (a table of the {law.of} from {low:.6g} to {high:.6g} {unit})"
