"""Documents of links and joints for the tests, and the same ones written another way."""

from __future__ import annotations

import cmath
import copy
import json
from collections.abc import Mapping
from typing import Any

from blockmech import Linkage
from blockmech.model.form import VERSION
from tests.doors import linkage_of as loads
from tests.gallery import JOINTS
from tests.model.joints.machines import guide, pin, turned_round
from tests.wiring import recorded

Document = dict[str, Any]

PIN = {"law": "coulomb", "coefficient": 0.2, "radius": 0.02}
HEAD = {"format": "blockmech/joints", "version": VERSION}
GUIDE = {"law": "coulomb", "coefficient": 0.15}


def linkage(document: Mapping[str, Any]) -> Linkage:
    """The linkage of a document."""
    return loads(json.dumps(document))


def _turning(joint: str, rate: float = 3.0, start: float = 0.0, end: float = 6.0) -> Document:
    return {"joint": joint, "law": "constant_rate", "rate": rate, "from": start, "to": end}


def four_bar() -> Document:
    """The four-bar of [R10], with a marker at the plate's apex."""
    result = copy.deepcopy(recorded("ruiz_fourbar")["document"])
    apex = result["loads"]["weightlike"]["at"]
    result["links"]["2"]["markers"] = {"S": {"at": apex}}
    return result


def slider_crank() -> Document:
    """Offset, massive, with friction in a pin and in the guide, the slider's point on the frame."""
    return dict(
        HEAD,
        name="slider_crank",
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
            "O": pin("frame", "crank", (0, 0), (0, 0), friction=PIN),
            "A": pin("crank", "rod", (0.1, 0), (0, 0), friction=PIN),
            "B": pin("rod", "piston", (0.3, 0), (0.01, 0.02)),
            "S": guide(
                "frame", "piston", (0.3, 0.01), (0.0, 0.03), (0.1, 0.1), slider=0, friction=GUIDE
            ),
        },
        drivers={"motor": _turning("O")},
        loads={"gas": {"type": "force", "link": "piston", "at": [0, 0.01], "force": [-50, 4]}},
    )


def rough(name: str) -> Document:
    """A document of the gallery with masses, weight and friction, its points off their lines."""
    document: Document = json.loads((JOINTS / f"{name}.json").read_text("utf-8"))
    document.pop("expect", None)
    for k, link in enumerate(document["links"].values()):
        link |= {"mass": 1.0 + k, "inertia": 0.1, "cm": [0.1, 0.02]}
    for joint in document["joints"].values():
        joint["friction"] = PIN if joint["type"] == "R" else GUIDE
    for driver in document["drivers"].values():
        driver |= {"from": driver.get("from", 0.0), "to": driver.get("to", 6.0)}
    push = {"type": "force", "link": list(document["links"])[-1], "at": [0, 0.1], "force": [5, -90]}
    return document | {"gravity": [1.0, -9.81], "loads": {"push": push}}


def arm() -> Document:
    """Two drivers, the second on a moving link, carry a dyad; a pin holds three links."""
    return dict(
        HEAD,
        name="arm",
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
            "shoulder": pin("frame", "upper", (0, 0), (0, 0)),
            "elbow": pin("upper", "lower", (1, 0), (0, 0)),
            "hand": pin("lower", "strut", (0.8, 0), (0, 0), friction=PIN),
            "knot": {
                "type": "R",
                "links": ["tie", "strut", "rocker"],
                "at": [[0, 0], [0.9, 0], [0.75, 0]],
            },
            "base": pin("frame", "rocker", (2.4, 0), (0, 0), friction=PIN),
            "edge": pin("lid", "tie", (0.7, 0), (0.6, 0)),
            "hinge": pin("frame", "lid", (3.0, 0.2), (0, 0)),
        },
        drivers={
            "lift": _turning("shoulder", 0.5, 0.9, 1.1),
            "bend": _turning("elbow", -0.4, -1.3, -1.5),
        },
        loads={"weight": {"type": "force", "link": "lid", "at": [0.3, 0], "force": [3, -20]}},
    )


def boom() -> Document:
    """A boom on a cylinder between two pivots: the driver is inside a group."""
    return dict(
        HEAD,
        name="boom",
        gravity=[0.0, -9.81],
        links={
            "barrel": {"mass": 2.0, "inertia": 0.2, "cm": [0.3, 0.0], "pose": [0, 0, 0.79]},
            "rod": {"mass": 1.0, "inertia": 0.1, "cm": [-0.2, 0.01], "pose": [0.87, 0.87, 0.79]},
            "beam": {"mass": 5.0, "inertia": 1.2, "cm": [1.0, 0.1], "pose": [0, 0.5, 0.4]},
            "link": {"mass": 0.8, "inertia": 0.05, "cm": [0.4, 0.0], "pose": [1.84, 1.28, -1.1]},
            "lever": {"mass": 1.1, "inertia": 0.1, "cm": [0.5, 0.0], "pose": [2.9, 0.0, 2.5]},
        },
        joints={
            "foot": pin("frame", "barrel", (0, 0), (0, 0), friction=PIN),
            "bore": guide("barrel", "rod", (0.2, 0), (-0.1, 0), (0, 0), friction=GUIDE),
            "eye": pin("rod", "beam", (0, 0), (0.95, 0.0), friction=PIN),
            "root": pin("frame", "beam", (0, 0.5), (0, 0)),
            "tip": pin("beam", "link", (2.0, 0), (0, 0)),
            "knee": pin("link", "lever", (0.9, 0), (0.8, 0), friction=PIN),
            "heel": pin("frame", "lever", (2.9, 0), (0, 0)),
        },
        drivers={"ram": _turning("bore", 0.1, 0.86, 0.93)},
        loads={"weight": {"type": "force", "link": "lever", "at": [0.3, 0], "force": [3, -20]}},
    )


DOCUMENTS = {
    "four_bar": four_bar,
    "slider_crank": slider_crank,
    "shaper": lambda: reframed(rough("whitworth_shaper"), "lever", 0.1j, 0.4),
    "trammel": lambda: reframed(rough("elliptic_trammel"), "shoe", 0.02j, -0.3),
    "arm": arm,
    "boom": boom,
}


# -- the same mechanism written another way ---------------------------------------------


def flipped(document: Document, joint: str) -> Document:
    """The links of a joint named in the other order; a driver's coordinate changes sign."""
    return _recounted(turned_round(document, joint), joint, -1, 0.0)


def pointed_back(document: Document, joint: str) -> Document:
    """The directed lines of a P joint pointing the other way."""
    result = copy.deepcopy(document)
    said = result["joints"][joint]
    said["angle"] = [angle + cmath.pi for angle in said["angle"]]
    return _recounted(result, joint, -1, 0.0)


def reframed(document: Document, link: str, origin: complex, turn: float) -> Document:
    """The frame of a link somewhere else on it; coordinates of drivers on it shift."""
    result = copy.deepcopy(document)

    def seen(at: Any) -> list[float]:
        position = cmath.rect(*at["polar"]) if isinstance(at, dict) else complex(*at)
        z = (position - origin) * cmath.exp(-1j * turn)
        return [z.real, z.imag]

    link_data = result["links"][link]
    x, y, angle = link_data["pose"]
    o = complex(x, y) + cmath.exp(1j * angle) * origin
    link_data["pose"] = [o.real, o.imag, angle + turn]
    link_data["cm"] = seen(link_data.get("cm", [0, 0]))
    for marker in link_data.get("markers", {}).values():
        marker["at"] = seen(marker["at"])
    for name, joint in result["joints"].items():
        for k, member in enumerate(joint["links"]):
            if member == link:
                joint["at"][k] = seen(joint["at"][k])
                if "angle" in joint:
                    joint["angle"][k] -= turn
                elif any(d["joint"] == name for d in result["drivers"].values()):
                    result = _recounted(result, name, 1, turn if k else -turn)
    for load in result.get("loads", {}).values():
        if load.get("link") == link and "at" in load:
            load["at"] = seen(load["at"])
    return result


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
