"""What travels along wires: motion forward, force and moment back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from blockmech.ground.errors import among
from blockmech.model.structure import JointRef, MarkerRef, Structure
from blockmech.typing import Data, Record

Read = Callable[..., Record]
"""Outputs of the blocks by name at the samples of a run; see `Result.inside`."""


def wires_of(structure: Structure) -> dict[str, tuple[MarkerRef, JointRef]]:
    """Wire "marker -> joint" -> its ends."""
    return {f"{marker} -> {joint}": (marker, joint) for joint, marker in structure.feeds.items()}


def on_wires(structure: Structure, read: Read, n: int, *names: str) -> dict[str, Data]:
    """Quantities on wires "marker -> joint", on all if none is named, at the n samples of a run.

    Returns
    -------
    wire -> dict of arrays (n,): forward ``p`` [m], ``v`` [m/s], ``a`` [m/s2], ``om`` [rad/s],
    ``al`` [rad/s2] of the marker and its link; back ``F`` [N] and ``M`` [N m] on the
    link of the marker, about the marker's point, and ``power`` [W] that flows forward.
    Of one driver also ``J_red`` [kg m2 or kg] and ``tau_red`` [N m or N], the shares of the
    joint's block in what is reduced to it; those of all blocks add up to the driver's.

    Raises `RequestError` where there is no such wire.
    """
    wires = wires_of(structure)
    among(wires, "wire", names, "no-such-wire")
    read_of = {name: _outputs(structure, *wires[name]) for name in names or wires}
    every = {
        output: None for wire in read_of.values() for parts in wire.values() for output in parts
    }
    values = read(*every)
    travels: dict[str, Data] = {}
    for name, wire in read_of.items():
        quantities = {
            key: values[parts[0]] - sum(values[x] for x in parts[1:]) if parts else np.zeros(n)
            for key, parts in wire.items()
        }
        F, v, M, om = (quantities[key] for key in ("F", "v", "M", "om"))
        travels[name] = {**quantities, "power": -(F * np.conj(v)).real - M * om}
    return travels


def _outputs(structure: Structure, marker: MarkerRef, joint: JointRef) -> dict[str, list[str]]:
    """What travels on a wire -> the output that it is, less further ones; none where it is zero."""
    fixed = marker.on == structure.frame_link
    outputs = {"p": [f"{marker}.p"], "v": [f"{marker}.v"], "a": [f"{marker}.a"]}
    outputs |= {"om": [] if fixed else [f"{marker.on}.omega"]}
    outputs |= {"al": [] if fixed else [f"{marker.on}.alpha"]}
    outputs |= {"F": [f"{joint}.wrench_F"], "M": [f"{joint}.wrench_M"]}
    if len(structure.drivers) != 1:
        return outputs
    (driver,) = structure.drivers
    head = structure.driven[driver].block
    rest = [block for block in structure.blocks if block != head]
    for quantity in ("J_red", "tau_red"):  # under the driver's name stand all blocks
        blocks = [driver, *rest] if joint.block == head else [joint.block]
        outputs[quantity] = [f"{block}.{quantity}" for block in blocks]
    return outputs
