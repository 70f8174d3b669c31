"""What travels along a wire: motion forward, force and moment back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from blockmech.errors import Problem, RequestError, listed
from blockmech.model.structure import Structure

Read = Callable[..., Mapping[str, Any]]
"""Outputs of the blocks by name at the samples of a run; see `Result.inside`."""


def travelling(
    structure: Structure, read: Read, n: int, source: str, target: str
) -> dict[str, Any]:
    """Quantities on the wire from a marker to a joint, at the n samples of a run.

    Returns
    -------
    dict of arrays (n,): forward ``p`` [m], ``v`` [m/s], ``a`` [m/s2], ``om`` [rad/s],
    ``al`` [rad/s2] of the marker and its link; back ``F`` [N] and ``M`` [N m] on the
    link of the marker, about the marker's point, and ``power`` [W] that flows forward.

    Raises `RequestError` where there is no such wire.
    """
    wires = {f"{m} -> {j}": (m, j) for j, m in structure.feeds.items()}
    if f"{source} -> {target}" not in wires:
        raise RequestError(
            Problem(
                "no-such-wire",
                f"{source} -> {target}",
                "there is no such wire",
                f"wires: {listed(wires, 30)}",
                "",
            )
        )
    marker, joint = wires[f"{source} -> {target}"]
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
    return {**wire, "power": power}
