"""What a reader of a result must know of it: friction cut short, links without inertia."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from blockmech.ground.errors import listed
from blockmech.model.structure import LinkRef
from blockmech.result.quality import OK
from blockmech.typing import Floats, Record

FEW = 10  # turns that a user may want to see


def remainder_of_friction(method: object, bounds: Floats, status: Sequence[str]) -> str:
    """How far off iterations of friction that are cut short may be.

    bounds : (n,) [-] relative to the largest friction, see `Result.friction_error`
    """
    largest = np.max(bounds[np.array([word == OK for word in status])], initial=0.0)
    remark = f"pairs are within about {largest:.1e} of the largest friction of their group"
    remark = remark if np.isfinite(largest) else "it has no bound where its certificate is 1"
    return f'friction "{method}": {remark}'


def missing_data(result: Any, rates: Callable[[Sequence[LinkRef]], Sequence[float]]) -> list[str]:
    """What the mechanism or the request lacks, perhaps, for what a result's outputs shall say.

    rates : of links [rad/s], at the first sample
    """
    mechanism, units = result.mechanism, {result._output(name).unit for name in result}
    notes = []
    if result.motion is None and units and result.n:
        notes += missing_rates(mechanism, result.samples.inputs, units)
        notes += missing_turns(mechanism, result.samples.inputs)
    if {"N", "N m"} & units:
        notes += missing_places(mechanism.document)
        if result.n and not result.settings["static"]:
            notes += missing_inertia(mechanism, rates)
    return notes


def missing_places(document: Any) -> list[str]:
    """Loads of links and joints that say no place on their link, and so act at its origin."""
    loads = getattr(document, "loads", {}).items() if hasattr(document, "joints") else ()
    names = [n for n, x in loads if "at" in type(x).model_fields.keys() - x.model_fields_set]
    note = "no at, so it acts at the origin of its link's axes"
    return [f"{listed(names, 4)}: {note}"] if names else []


def missing_rates(mechanism: Any, inputs: Record, units: Iterable[str]) -> list[str]:
    """Drivers at rest for want of a law of motion, where all that is asked for is rates."""
    drivers, laws = enumerate(mechanism.drivers), mechanism.scene.drive
    still = [d for i, d in drivers if d not in laws and not np.any(inputs[f"qd_{i}"])]
    if not still or not all("/s" in unit for unit in units):
        return []
    return [f"{listed(still, 4)}: no law of motion, so the rate is 0; give rates="]


def missing_turns(mechanism: Any, inputs: Record) -> list[str]:
    """Drivers that are seen over one turn of the several after which a mechanism repeats."""
    notes = []
    for i, driver in enumerate(mechanism.drivers):
        turns, travel = mechanism.structure.turns(driver) or 0, float(np.ptp(inputs[f"q_{i}"]))
        if 1 < turns <= FEW and math.isclose(travel, math.tau):
            end = f'a law of motion with end="{turns} turns" shows all'
            notes.append(f"the mechanism repeats after {turns} turns of {driver}: {end}")
    return notes


def missing_inertia(
    mechanism: Any, rates: Callable[[Sequence[LinkRef]], Sequence[float]]
) -> list[str]:
    """Links without mass or inertia, which forces do not know of.

    mechanism : a `Compiled`, which stands above; rates : of links [rad/s]
    """
    structure = mechanism.structure
    properties = {link: structure.properties(link) for link in structure.links}
    if not any(link.massive for link in properties.values()):
        of = "forces are those of the loads alone" if structure.elements else "forces are zero"
        return [f"no link has mass or inertia: {of}"]
    points = [link for link, x in properties.items() if x.mass > 0 and x.inertia == 0]
    names = {} if mechanism.names is None else mechanism.names.links
    link_names = {where.link: name for name, where in names.items()}
    turning = [
        str(link_names.get(link, link))
        for link, rate in zip(points, rates(points), strict=True)
        if abs(rate) > 0
    ]
    explanation = "mass and no inertia: they count as points at their cm"
    notes = [f"{listed(turning, 4)} turn with {explanation}"] if turning else []
    links = getattr(mechanism.document, "links", {})
    joints = mechanism.document.joints.values() if links else ()
    seats = {link for x in joints for link, at in zip(x.links, x.at, strict=True) if at.z == 0}
    heavy = [name for name, x in links.items() if x.mass and "cm" not in x.model_fields_set]
    if loose := [name for name in heavy if name not in seats]:
        notes.append(f"{listed(loose, 4)}: no cm, so the mass is at the origin of its axes")
    return notes
