"""A joint of blocks is dragged to another place: what of the document follows.

All that stands at the joint in the shown pose goes with it, all other joints stay where they
are, and the lengths between them follow. What is fixed to a link and is no joint keeps its
place on the link.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from blockmech.compiled import Compiled
from blockmech.draw.motion import Motion, moves_of_result
from blockmech.draw.sketch import Sketch, shown_markers, sketch_of
from blockmech.ground.errors import RequestError, refused
from blockmech.ground.tolerances import BLUR
from blockmech.ground.values import Place, xy
from blockmech.model.joints.varied import phase
from blockmech.model.spots import Spot, marker_place
from blockmech.model.structure import LinkRef, MarkerRef
from blockmech.typing import Arguments, Data, Record

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


class Hold(NamedTuple):
    """A joint that is taken hold of: a motion of one sample, its place [m] in it, all handles."""

    motion: Motion
    z: complex
    handles: dict[str, Spot]

    @classmethod
    def of(cls, mechanism: Compiled | None, name: str, coordinates: Mapping[str, Any]) -> Hold:
        """A joint at coordinates [rad or m] of the drivers.

        Raises `RequestError` where nothing moves or closes, and for what cannot be dragged.
        """
        if mechanism is None:
            raise refused(name, "the diagram is no mechanism yet", "mend it first")
        at = {driver: [float(coordinates[driver])] for driver in mechanism.drivers}
        settings: Arguments = {"rates": dict.fromkeys(at, 0.0), "want": (), "friction": "none"}
        motion = moves_of_result(mechanism.run(at=at, on_gap="mark", **settings))
        if not motion.feasible.any():
            raise refused(name, "the mechanism does not close in this pose", "choose another pose")
        handles = handles_of(motion, sketch_of(motion))
        if name not in handles:
            raise undraggable(name)
        return cls(motion, complex(motion.at(*handles[name])[0]), handles)


def undraggable(name: str) -> RequestError:
    """Why a joint cannot be dragged."""
    fault = "no length and no marker of a block puts it there, so it cannot be dragged"
    return refused(name, fault, "change its block's form", code="not-dragged")


class Dragged(NamedTuple):
    """What a drag makes.

    Attributes
    ----------
    form : of the document
    q : driver -> coordinate [rad or m] in the pose in which the joint stands elsewhere
    sides : block -> twice the area [m2] of its dyad's triangle; its sign is that of the branch
    """

    form: Data
    q: dict[str, Any]
    sides: dict[str, Any]


def dragged(form: Record, motion: Motion, k: int, old: complex, new: complex) -> Dragged:
    """What stands at ``old`` [m] in sample k stands at ``new``, of any type with arithmetic.

    A crank that turns by it starts as much further on, where the scene says its start. What
    no length or marker places stays, and the form is the same.
    """
    s, size = motion.structure, max(np.abs([*(z[k] for z in motion.origin.values()), old]))

    def move(z: complex) -> complex:
        return new if abs(z - old) <= BLUR * size else z

    changed: Data = copy.deepcopy(dict(form))
    for marker in changed["blocks"][s.frame].get("markers", {}).values():
        marker["at"] = _local_place(marker["at"], 0j, 1, 0j, 1, move)
    starts = changed.get("scene", {}).get("initial", {})
    result = Dragged(changed, {driver: float(q[k]) for driver, q in motion.q.items()}, {})
    for name in (name for name in s.blocks if name in changed["blocks"]):
        turn = _drag_block(changed["blocks"][name], name, motion, k, move, result.sides)
        for driver, ref in s.driven.items():
            if ref.block != name:
                continue
            if driver in result.q:
                result.q[driver] += turn * s.coordinate(driver).sign
            if driver in starts:
                starts[driver]["q"] += turn * s.coordinate(driver).sign
    return result


def _drag_block(
    block: Data, name: str, motion: Motion, k: int, move: Move, sides: dict[str, Any]
) -> Any:
    """Change lengths and markers of a block in place; the angle [rad] by which its link turns."""
    s = motion.structure
    model = s.blocks[name]
    joined = {m for ref, m in s.feeds.items() if s.joint(ref).kind == "R"}
    pins, turn = dict[str, Any](), 0.0
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
                turn = phase(e2 / e)
        for marker, marker_data in block.get("links", {}).get(link, {}).get("markers", {}).items():
            stays = (o2, e2) != (o, e) and MarkerRef(name, link, marker) in joined
            marker_data["at"] = _local_place(marker_data["at"], o, e, o2, e2, move, stays)
    if {"B", "C", "D"} <= set(pins) and block.get("branch", 1) in (-1, 1):
        side = ((pins["D"] - pins["B"]).conjugate() * (pins["C"] - pins["B"])).imag
        if side:
            sides[name] = side
            block["branch"] = 1 if side > 0 else -1
    return turn


def _local_place(
    at: Any, o: complex, e: complex, o2: complex, e2: complex, move: Move, stays: bool = False
) -> Any:
    """A place on a link whose frame (origin, axis) changes: dragged, left on the ground or kept."""
    z = o + e * Place.parse(at).z
    if move(z) == z and not stays:
        return at
    return xy((move(z) - o2) / e2)
