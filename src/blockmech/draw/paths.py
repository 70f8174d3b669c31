"""Paths of markers: which of them are drawn, and how they are named."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.draw.motion import Motion, marker_place
from blockmech.draw.sketch import shown_markers
from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.model.structure import MarkerRef

Paths = Mapping[str, NDArray[np.complex128]]
PATHS = 8  # that are drawn if none are named


def paths_of(motion: Motion, names: Iterable[str] | None) -> Paths:
    """Paths (n,) [m] of markers: those named, else the user's, else inner joints.

    Raises `RequestError` for names of no marker of a moving link.
    """
    s = motion.structure
    moving = _markers(motion.mechanism)
    if names is None:
        named = {marker: name for name, marker in moving.items()}
        names = [named[m] for m in _usual_paths(motion.mechanism, named)]
    names = list(names)
    wrong = [n for n in names if n not in moving]
    if wrong:
        raise RequestError(
            Problem(
                "unknown-marker",
                n,
                "no marker of a moving link has that name",
                f"markers: {listed(moving, 16)}",
                close_match(n, moving),
            )
            for n in wrong
        )
    return {n: motion.at(moving[n].on, marker_place(s, moving[n])) for n in names}


def _markers(mechanism: Compiled) -> dict[str, MarkerRef]:
    """Markers of moving links by name; a joint-based document has its own, and its pins."""
    s, names = mechanism.structure, mechanism.names
    every = {str(m): m for name in s.blocks for m in s.markers(name)}
    if names is None:
        return every
    found = {
        f"link.{link}.{marker}": ref
        for link, name in names.links.items()
        for marker, ref in name.markers.items()
        if ref.on != s.frame_link
    }
    pins = {str(ref): name for ref, name in mechanism.joint_names.items()}
    return found | {pins[place]: ref for place, ref in every.items() if place in pins}


def _usual_paths(mechanism: Compiled, named: Collection[MarkerRef]) -> list[MarkerRef]:
    s = mechanism.structure
    own = [m for m in shown_markers(mechanism) if m in named]
    inner = [
        m
        for name, block in s.blocks.items()
        for m in s.markers(name)
        if m.name in block.joints and not block.joints[m.name].outer
        if block.joints[m.name].kind == "R" and m in named
    ]
    return (own or inner)[-PATHS:]  # the last ones are the mechanism's outputs
