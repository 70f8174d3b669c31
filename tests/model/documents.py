"""Documents of links and joints for the tests, and the same ones written another way."""

from __future__ import annotations

import cmath
import copy
import json
import random
from collections.abc import Mapping
from typing import Any

from blockmech import Linkage
from tests.doors import linkage_of as loads
from tests.wiring import recorded

Document = dict[str, Any]

PIN = {"law": "coulomb", "coefficient": 0.2, "radius": 0.02}
GUIDE = {"law": "coulomb", "coefficient": 0.15}


def linkage(document: Mapping[str, Any]) -> Linkage:
    """The linkage of a document."""
    return loads(json.dumps(document))


def _document(name: str, **sections: Any) -> Document:
    return {"format": "blockmech/joints", "version": 1, "name": name, **sections}


def _pin(first: str, at: Any, second: str, there: Any, **more: Any) -> Document:
    return {"type": "R", "links": [first, second], "at": [list(at), list(there)], **more}


def _guide(first: str, at: Any, second: str, there: Any, angle: Any, **more: Any) -> Document:
    return {**_pin(first, at, second, there), "type": "P", "angle": list(angle), **more}


def _turning(joint: str, rate: float = 3.0, start: float = 0.0, end: float = 6.0) -> Document:
    return {"joint": joint, "law": "constant_rate", "rate": rate, "from": start, "to": end}


def four_bar() -> Document:
    """The four-bar of [R10], with a marker at the plate's apex."""
    found = copy.deepcopy(recorded("ruiz_fourbar")["document"])
    apex = found["loads"]["weightlike"]["at"]
    found["links"]["2"]["markers"] = {"S": {"at": apex}}
    return found


def slider_crank() -> Document:
    """Offset, massive, with friction in a pin and in the guide, the slider's point on the frame."""
    return _document(
        "slider_crank",
        gravity=[1.0, -9.81],
        links={
            "crank": {"mass": 1.0, "inertia": 0.01, "cm": [0.05, 0.01], "pose": [0, 0, 0.7]},
            "rod": {
                "mass": 2.0,
                "inertia": 0.05,
                "cm": [0.15, 0.02],
                "pose": [0.08, 0.06, -0.2],
                "markers": {"P": {"at": [0.1, 0.05]}},
            },
            "piston": {"mass": 1.5, "inertia": 0.02, "cm": [0.03, 0.01], "pose": [0.37, 0, 0]},
        },
        joints={
            "O": _pin("frame", (0, 0), "crank", (0, 0), friction=PIN),
            "A": _pin("crank", (0.1, 0), "rod", (0, 0), friction=PIN),
            "B": _pin("rod", (0.3, 0), "piston", (0.01, 0.02)),
            "S": _guide(
                "frame", (0.3, 0.01), "piston", (0.0, 0.03), (0.1, 0.1), slider=0, friction=GUIDE
            ),
        },
        drivers={"motor": _turning("O")},
        loads={"gas": {"type": "force", "link": "piston", "at": [0, 0.01], "force": [-50, 4]}},
    )


def shaper() -> Document:
    """Crank, block on a slotted lever, rod and ram: a P joint between two moving links."""
    return _document(
        "shaper",
        gravity=[0.0, -9.81],
        links={
            "crank": {"mass": 3.0, "inertia": 0.02, "cm": [0.04, 0.0], "pose": [0, 0.3, 0.5]},
            "block": {"mass": 0.5, "inertia": 0.001, "cm": [0.01, 0.0], "pose": [0.1, 0.36, 1.3]},
            "lever": {"mass": 6.0, "inertia": 0.3, "cm": [0.3, 0.0], "pose": [0, 0, 1.3]},
            "rod": {"mass": 1.0, "inertia": 0.01, "cm": [0.12, 0.0], "pose": [0.17, 0.58, 0.3]},
            "ram": {"mass": 8.0, "inertia": 0.4, "cm": [0.1, 0.05], "pose": [0.4, 0.65, 0]},
        },
        joints={
            "O": _pin("frame", (0, 0.3), "crank", (0, 0)),
            "B": _pin("crank", (0.12, 0), "block", (0, 0), friction=PIN),
            "slot": _guide("lever", (0, 0), "block", (0, 0), (0, 0), friction=GUIDE),
            "D": _pin("frame", (0, 0), "lever", (0, 0), friction=PIN),
            "T": _pin("lever", (0.6, 0), "rod", (0, 0)),
            "C": _pin("rod", (0.25, 0), "ram", (0, 0)),
            "way": _guide("frame", (0, 0.65), "ram", (0, 0), (0, 0), friction=GUIDE),
        },
        drivers={"motor": _turning("O", 4.0)},
        loads={"cut": {"type": "force", "link": "ram", "at": [0, 0], "force": [-200, 0]}},
    )


def press() -> Document:
    """Driven along a guide: two sliders with a pin between them, one on the driven table."""
    return _document(
        "press",
        gravity=[0.0, -9.81],
        links={
            "table": {"mass": 2.0, "inertia": 0.1, "cm": [0.1, 0.0], "pose": [0.2, 0, 0]},
            "foot": {"mass": 1.0, "inertia": 0.05, "cm": [0.0, 0.1], "pose": [0.5, 0.3, 0.9]},
            "stamp": {"mass": 3.0, "inertia": 0.2, "cm": [0.0, 0.2], "pose": [0.6, 0.5, 0]},
        },
        joints={
            "bed": _guide("frame", (0, 0), "table", (0.1, 0), (0, 0), friction=GUIDE),
            "wedge": _guide("table", (0.2, 0.1), "foot", (0, 0), (0.9, 0), friction=GUIDE),
            "pin": _pin("foot", (0.1, 0.1), "stamp", (0, 0), friction=PIN),
            "column": _guide("frame", (0.6, 0), "stamp", (0, 0), (1.5708, 1.5708), slider=0),
        },
        drivers={"ram": _turning("bed", 0.2, 0.3, 0.4)},
        loads={"work": {"type": "force", "link": "stamp", "at": [0, 0.3], "force": [5, -90]}},
    )


def arm() -> Document:
    """Two drivers, the second on a moving link, carry a dyad; a pin holds three links."""
    return _document(
        "arm",
        gravity=[0.0, -9.81],
        links={
            "upper": {"mass": 4.0, "inertia": 0.3, "cm": [0.5, 0.0], "pose": [0, 0, 0.9]},
            "lower": {"mass": 2.0, "inertia": 0.1, "cm": [0.3, 0.1], "pose": [0.62, 0.78, -0.4]},
            "strut": {"mass": 1.0, "inertia": 0.1, "cm": [0.5, 0.0], "pose": [1.4, 0.45, -0.8]},
            "rocker": {"mass": 1.5, "inertia": 0.1, "cm": [0.4, 0.0], "pose": [2.4, 0, 2.2]},
            "tie": {"mass": 0.5, "inertia": 0.02, "cm": [0.3, 0.0], "pose": [2.0, 0.5, -1.0]},
            "lid": {"mass": 0.7, "inertia": 0.03, "cm": [0.2, 0.1], "pose": [3.0, 0.2, 2.4]},
        },
        joints={
            "shoulder": _pin("frame", (0, 0), "upper", (0, 0)),
            "elbow": _pin("upper", (1, 0), "lower", (0, 0)),
            "hand": _pin("lower", (0.8, 0), "strut", (0, 0), friction=PIN),
            "knot": {
                "type": "R",
                "links": ["tie", "strut", "rocker"],
                "at": [[0, 0], [0.9, 0], [0.75, 0]],
            },
            "base": _pin("frame", (2.4, 0), "rocker", (0, 0), friction=PIN),
            "edge": _pin("lid", (0.7, 0), "tie", (0.6, 0)),
            "hinge": _pin("frame", (3.0, 0.2), "lid", (0, 0)),
        },
        drivers={
            "lift": _turning("shoulder", 0.5, 0.9, 1.1),
            "bend": _turning("elbow", -0.4, -1.3, -1.5),
        },
        loads={"weight": {"type": "force", "link": "lid", "at": [0.3, 0], "force": [3, -20]}},
    )


def boom() -> Document:
    """A boom on a cylinder between two pivots: the driver is inside a group."""
    return _document(
        "boom",
        gravity=[0.0, -9.81],
        links={
            "barrel": {"mass": 2.0, "inertia": 0.2, "cm": [0.3, 0.0], "pose": [0, 0, 0.79]},
            "rod": {"mass": 1.0, "inertia": 0.1, "cm": [-0.2, 0.01], "pose": [0.87, 0.87, 0.79]},
            "beam": {"mass": 5.0, "inertia": 1.2, "cm": [1.0, 0.1], "pose": [0, 0.5, 0.4]},
            "link": {"mass": 0.8, "inertia": 0.05, "cm": [0.4, 0.0], "pose": [1.84, 1.28, -1.1]},
            "lever": {"mass": 1.1, "inertia": 0.1, "cm": [0.5, 0.0], "pose": [2.9, 0.0, 2.5]},
        },
        joints={
            "foot": _pin("frame", (0, 0), "barrel", (0, 0), friction=PIN),
            "bore": _guide("barrel", (0.2, 0), "rod", (-0.1, 0), (0, 0), friction=GUIDE),
            "eye": _pin("rod", (0, 0), "beam", (0.95, 0.0), friction=PIN),
            "root": _pin("frame", (0, 0.5), "beam", (0, 0)),
            "tip": _pin("beam", (2.0, 0), "link", (0, 0)),
            "knee": _pin("link", (0.9, 0), "lever", (0.8, 0), friction=PIN),
            "heel": _pin("frame", (2.9, 0), "lever", (0, 0)),
        },
        drivers={"ram": _turning("bore", 0.1, 0.86, 0.93)},
        loads={"weight": {"type": "force", "link": "lever", "at": [0.3, 0], "force": [3, -20]}},
    )


DOCUMENTS = {
    "four_bar": four_bar,
    "slider_crank": slider_crank,
    "shaper": shaper,
    "press": press,
    "arm": arm,
    "boom": boom,
}


# -- the same mechanism written another way ---------------------------------------------


def shuffled(document: Document, seed: int) -> Document:
    """Links, joints, drivers and loads in another order."""
    chance = random.Random(seed)
    found = dict(document)
    for section in ("links", "joints", "drivers", "loads"):
        items = list(document.get(section, {}).items())
        chance.shuffle(items)
        found[section] = dict(items)
    return found


def flipped(document: Document, joint: str) -> Document:
    """The links of a joint named in the other order; a driver's coordinate changes sign."""
    found = copy.deepcopy(document)
    said = found["joints"][joint]
    for key in ("links", "at", "angle"):
        if key in said:
            said[key].reverse()
    if said["type"] == "P":
        said["slider"] = 1 - said.get("slider", 1)
    return _recounted(found, joint, -1, 0.0)


def pointed_back(document: Document, joint: str) -> Document:
    """The directed lines of a P joint pointing the other way."""
    found = copy.deepcopy(document)
    said = found["joints"][joint]
    said["angle"] = [angle + cmath.pi for angle in said["angle"]]
    return _recounted(found, joint, -1, 0.0)


def reframed(document: Document, link: str, origin: complex, turn: float) -> Document:
    """The frame of a link somewhere else on it; coordinates of drivers on it shift."""
    found = copy.deepcopy(document)

    def seen(at: Any) -> list[float]:
        place = cmath.rect(*at["polar"]) if isinstance(at, dict) else complex(*at)
        z = (place - origin) * cmath.exp(-1j * turn)
        return [z.real, z.imag]

    said = found["links"][link]
    x, y, angle = said["pose"]
    o = complex(x, y) + cmath.exp(1j * angle) * origin
    said["pose"] = [o.real, o.imag, angle + turn]
    said["cm"] = seen(said.get("cm", [0, 0]))
    for marker in said.get("markers", {}).values():
        marker["at"] = seen(marker["at"])
    for name, joint in found["joints"].items():
        for k, other in enumerate(joint["links"]):
            if other == link:
                joint["at"][k] = seen(joint["at"][k])
                if "angle" in joint:
                    joint["angle"][k] -= turn
                elif any(d["joint"] == name for d in found["drivers"].values()):
                    found = _recounted(found, name, 1, turn if k else -turn)
    for load in found.get("loads", {}).values():
        if load.get("link") == link and "at" in load:
            load["at"] = seen(load["at"])
    return found


def _recounted(document: Document, joint: str, sign: int, offset: float) -> Document:
    """The document with ``sign * q + offset`` as coordinate of the driver of a joint."""
    for driver in document["drivers"].values():
        if driver["joint"] == joint and "law" in driver:
            driver["rate"] *= sign
            driver["from"], driver["to"] = (
                sign * q + offset for q in (driver["from"], driver["to"])
            )
    for name, start in document.get("initial", {}).items():
        if document["drivers"][name]["joint"] == joint:
            start["q"] = sign * start["q"] + offset
            start["rate"] = sign * start["rate"]
    return document
