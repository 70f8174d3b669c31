"""Linkages that are drawn at a dead centre, as tools that draw do, or not quite closed.

At a dead centre the drawing does not tell the assembly mode, for two meet. So a joint that nothing
drives is moved a little from the drawn pose, and where all links stand then tells it. Where slots
are all but singular, places that are rounded close as they are drawn or not at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from blockmech.ground.errors import BlockmechError, GraphError
from blockmech.typing import Data

STEP = 0.05  # [rad], and of the size of a linkage
MOST = 60  # joints that are tried


def beyond(linkage: Any, rounded: Callable[[], Any]) -> Any:
    """A `blockmech.Linkage` itself, or where it stands at a dead centre, one that stands beside."""
    codes = _problems(linkage)
    if "does-not-close" in codes:  # by the rounding of slots that are all but singular
        linkage = rounded()
        codes = _problems(linkage)
    if "dead-centre" not in codes:
        return linkage
    data = linkage.to_data()
    for driver, joint, step in _trials(data):
        drivers = {**data["drivers"], driver: {"joint": joint}}
        changes = {"drivers": drivers, "couplings": {}, "stops": {}, "loads": {}}
        try:
            trial = type(linkage).from_data({**data, **changes})
            starts = dict.fromkeys(drivers, 0.0) | {driver: step}
            pose = trial.run(at=starts, want=["link.*.p", "link.*.angle"], static=True)
        except BlockmechError:
            continue
        links = {name: dict(link) for name, link in data["links"].items()}
        for name in links:
            z, angle = complex(pose[f"link.{name}.p"][0]), float(pose[f"link.{name}.angle"][0])
            links[name]["pose"] = [z.real, z.imag, angle]
        note = f"it is drawn at a dead centre of {driver}: read with {joint} moved by {step:.3g}"
        notes = [*data.get("notes", []), f"{note}, which tells the mode; poses say the other one"]
        bent = type(linkage).from_data({**data, "links": links, "notes": notes})
        if "dead-centre" not in _problems(bent):
            return bent
    return linkage


def _problems(linkage: Any) -> set[str]:
    """Codes of what is wrong with a linkage."""
    try:
        linkage.decompose()
    except GraphError as error:
        return {problem.code for problem in error.problems}
    return set()


def _trials(data: Data) -> Iterator[tuple[str, str, float]]:
    """A driver, the joint that moves in its place, and by how much [rad or m]."""
    driven = {driver["joint"] for driver in data["drivers"].values()}
    points = [complex(*z) for joint in data["joints"].values() for z in joint["at"]]
    size = max(abs(z - points[0]) for z in points)
    movable = ((name, x) for name, x in data["joints"].items() if x["type"] != "weld")
    joints = [(name, joint) for name, joint in movable if name not in driven]
    joints.sort(key=lambda x: (x[1]["type"] == "P", x[1]["type"], "frame" not in x[1]["links"]))
    for name, joint in joints[:MOST]:
        step = STEP * (size if joint["type"] == "P" else 1.0)
        for driver in data["drivers"]:
            yield from ((driver, name, math.copysign(step, sign)) for sign in (1, -1))
