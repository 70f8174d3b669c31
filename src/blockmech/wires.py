"""What travels along a wire: motion forward, force and moment back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from blockmech.errors import Problem, RequestError, listed
from blockmech.model.structure import Structure

Read = Callable[..., Mapping[str, Any]]
"""Outputs of the blocks by name at the samples of a run; see `Result.inside`."""


def travelling(structure: Structure, read: Read, n: int, name: str) -> dict[str, Any]:
    """Quantities on the wire "marker -> joint", at the n samples of a run.

    Returns
    -------
    dict of arrays (n,): forward ``p`` [m], ``v`` [m/s], ``a`` [m/s2], ``om`` [rad/s],
    ``al`` [rad/s2] of the marker and its link; back ``F`` [N] and ``M`` [N m] on the
    link of the marker, about the marker's point, and ``power`` [W] that flows forward.
    Of one driver also ``J_red`` [kg m2 or kg] and ``tau_red`` [N m or N], the shares of the
    joint's block in what is reduced to it; those of all blocks add up to the driver's.

    Raises `RequestError` where there is no such wire.
    """
    wires = {f"{m} -> {j}": (m, j) for j, m in structure.feeds.items()}
    if name not in wires:
        raise RequestError(
            Problem(
                "no-such-wire",
                name,
                "there is no such wire",
                f"wires: {listed(wires, 30)}",
                "",
            )
        )
    marker, joint = wires[name]
    names = [f"{marker}.{x}" for x in ("p", "v", "a")]
    fixed = marker.on == structure.frame_link
    rates = [] if fixed else [f"{marker.on}.omega", f"{marker.on}.alpha"]
    found = read(*names, *rates, f"{joint}.wrench_F", f"{joint}.wrench_M")
    still = np.zeros(n)
    wire = {
        "p": found[names[0]],
        "v": found[names[1]],
        "a": found[names[2]],
        "om": still if fixed else found[rates[0]],
        "al": still if fixed else found[rates[1]],
        "F": found[f"{joint}.wrench_F"],
        "M": found[f"{joint}.wrench_M"],
    }
    power = -(wire["F"] * np.conj(wire["v"])).real - wire["M"] * wire["om"]
    return {**wire, "power": power, **_shares(structure, read, joint.block)}


def _shares(structure: Structure, read: Read, block: str) -> dict[str, Any]:
    """What of the reduced inertia and effort is the block's; empty with several drivers."""
    if len(structure.drivers) != 1:
        return {}
    (driver,) = structure.driven
    head = structure.driven[driver].block
    found = {}
    for what in ("J_red", "tau_red"):
        if block != head:
            found[what] = read(f"{block}.{what}")[f"{block}.{what}"]
            continue
        others = [f"{b}.{what}" for b in structure.blocks if b != head]
        values = read(f"{driver}.{what}", *others)  # under the driver's name stand all blocks
        found[what] = values[f"{driver}.{what}"] - sum(values[name] for name in others)
    return found
