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
        known = f"wires: {listed(wires, 30)}"
        raise RequestError(Problem("no-such-wire", name, "there is no such wire", known))
    marker, joint = wires[name]
    names = {"p": f"{marker}.p", "v": f"{marker}.v", "a": f"{marker}.a"}
    names |= {"om": f"{marker.on}.omega", "al": f"{marker.on}.alpha"}
    names |= {"F": f"{joint}.wrench_F", "M": f"{joint}.wrench_M"}
    still = ("om", "al") if marker.on == structure.frame_link else ()
    found = read(*(said for key, said in names.items() if key not in still))
    wire = {key: np.zeros(n) if key in still else found[said] for key, said in names.items()}
    power = -(wire["F"] * np.conj(wire["v"])).real - wire["M"] * wire["om"]
    return {**wire, "power": power, **_shares(structure, read, joint.block)}


def on_all_wires(structure: Structure, read: Read, n: int) -> dict[str, dict[str, Any]]:
    """What travels on every wire of joints, by its name, all of it read at once."""
    wanted: dict[str, None] = {}

    def note(*names: str) -> Mapping[str, Any]:
        wanted.update(dict.fromkeys(names))
        return dict.fromkeys(names, np.zeros(n))

    names = [f"{marker} -> {joint}" for joint, marker in structure.feeds.items()]
    for name in names:
        travelling(structure, note, n, name)
    values = read(*wanted)
    return {name: travelling(structure, lambda *_: values, n, name) for name in names}


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
