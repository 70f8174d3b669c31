"""A joint is dragged to another place: what of the document follows.

All that stands at the joint in the shown pose goes with it, all other joints stay where they
are, and the lengths between them follow. What is fixed to a link and is no joint keeps its
place on the link.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from blockmech.draw.motion import Motion
from blockmech.draw.sketch import Sketch, shown_markers
from blockmech.ground.tolerances import BLUR
from blockmech.ground.values import Place, xy
from blockmech.model.spots import Spot, marker_place
from blockmech.model.structure import LinkRef, MarkerRef
from blockmech.typing import Data, Record

Move = Callable[[complex], complex]


def handles_of(motion: Motion, sketch: Sketch) -> dict[str, Spot]:
    """What can be taken hold of: pins, sliders and markers by name, one at a place."""
    s = motion.structure
    spots = {pin.names[0]: pin.spot for pin in sketch.pins}
    spots |= {slider.name: slider.point for slider in sketch.sliders if not slider.inside}
    for marker in shown_markers(motion.mechanism):
        spots[str(marker)] = Spot(marker.on, marker_place(s, marker))
    k = int(np.flatnonzero(motion.feasible)[0])
    positions = {complex(motion.at(*spot)[k]): name for name, spot in reversed(spots.items())}
    return {name: spots[name] for name in spots if name in positions.values()}


def dragged(form: Record, motion: Motion, k: int, old: complex, new: complex) -> Data:
    """The form in which what stands at ``old`` [m] in sample k stands at ``new``.

    A crank that turns by it starts as much further on, where the scene says its start. What
    no length or marker places stays, and the form is the same.
    """
    size = max(np.abs([*(z[k] for z in motion.origin.values()), old, new]))

    def move(z: complex) -> complex:
        return new if abs(z - old) <= BLUR * size else z

    changed: Data = copy.deepcopy(dict(form))
    if "joints" in form:
        _drag_joints(changed, motion, k, move)
        return changed
    s = motion.structure
    for marker in changed["blocks"][s.frame].get("markers", {}).values():
        marker["at"] = _put(marker["at"], 0j, 1, 0j, 1, move)
    starts = changed.get("scene", {}).get("initial", {})
    for name in s.blocks:
        turned = _drag_block(changed["blocks"][name], name, motion, k, move)
        for driver, ref in s.driven.items():
            if ref.block == name and driver in starts and s.joint(ref).rotary:
                starts[driver]["q"] += turned * s.coordinate(driver).sign
    return changed


def _drag_block(block: Data, name: str, motion: Motion, k: int, move: Move) -> float:
    """Change lengths and markers of a block in place; the angle [rad] by which its link turns."""
    s = motion.structure
    model = s.blocks[name]
    joined = {m for ref, m in s.feeds.items() if s.joint(ref).kind == "R"}
    pins, turned = {}, 0.0
    for link in model.link_names:
        ref = LinkRef(name, link)
        o, e = complex(motion.origin[ref][k]), complex(motion.axis[ref][k])
        if not np.isfinite(o * e):
            continue
        o2, e2 = move(o), e
        for marker in (m.name for m in s.markers(name) if m.link == link):
            built = model.built_in.get(marker)
            if built is None:
                continue
            z = o + e * marker_place(s, MarkerRef(name, link, marker))
            pins[marker] = move(z)
            if built.along and (move(z), o2) != (z, o) and move(z) != o2:
                e2 = (move(z) - o2) / abs(move(z) - o2)
                block[built.along] = abs(move(z) - o2)
                turned = float(np.angle(e2 / e))
        for marker, marker_data in block.get("links", {}).get(link, {}).get("markers", {}).items():
            stays = (o2, e2) != (o, e) and MarkerRef(name, link, marker) in joined
            marker_data["at"] = _put(marker_data["at"], o, e, o2, e2, move, stays)
    if {"B", "C", "D"} <= set(pins) and block.get("branch", 1) in (-1, 1):
        turn = ((pins["D"] - pins["B"]).conjugate() * (pins["C"] - pins["B"])).imag
        if turn:
            block["branch"] = 1 if turn > 0 else -1
    return turned


def _drag_joints(form: Data, motion: Motion, k: int, move: Move) -> None:
    """Change the places of joints and markers on the links of a joint-based form in place."""
    frames = {"frame": (0j, 1 + 0j)}
    names = motion.mechanism.names
    for link, name in names.links.items() if names is not None else ():
        axis = motion.axis[name.link] * np.exp(1j * name.turn)
        origin = motion.at(name.link, marker_place(motion.structure, name.marker))
        frames[link] = complex(origin[k]), complex(axis[k])
    for joint in form["joints"].values():
        if joint["type"] == "R":
            for i, link in enumerate(joint["links"]):
                joint["at"][i] = _put(joint["at"][i], *frames[link], *frames[link], move)
    for link, (o, e) in frames.items():
        for marker in form["links"].get(link, {}).get("markers", {}).values():
            marker["at"] = _put(marker["at"], o, e, o, e, move)


def _put(
    at: Any, o: complex, e: complex, o2: complex, e2: complex, move: Move, stays: bool = False
) -> Any:
    """A place on a link whose frame (origin, axis) changes: dragged, left on the ground or kept."""
    z = o + e * Place.parse(at).z
    if move(z) == z and not stays:
        return at
    return xy((move(z) - o2) / e2)
