"""Frames are the user's own: the same mechanism in other link frames has the same forces."""

from __future__ import annotations

import cmath
import copy
import json
import random

import numpy as np
import pytest

from tests.doors import linkage_of as loads
from tests.model.joints.chance import document, xy

ROUNDING = 1e-11  # [-] of the largest force: roundings times a condition of some tens

LAW = {"kind": "polynomial", "of": "rate", "coefficients": [2.0, -0.7]}
OF_STROKE = {"kind": "polynomial", "coefficients": [3.0, -2.0, 0.5]}


def reframed(data, seed):
    """The document with every link's frame moved and turned at random, and by how much."""
    chance = random.Random(seed)
    data = copy.deepcopy(data)
    moved = {"frame": (0j, 0.0)}
    for name, link in data["links"].items():
        d, turn = complex(chance.uniform(-1, 1), chance.uniform(-1, 1)), chance.uniform(-3, 3)
        moved[name] = d, turn
        x, y, angle = link["pose"]
        o = complex(x, y) + d * cmath.exp(1j * angle)
        link["pose"] = [o.real, o.imag, angle + turn]
        if "cm" in link:
            link["cm"] = place(link["cm"], moved[name])

    def turn_of(links):
        return moved[links[1]][1] - moved[links[0]][1]

    for joint in data["joints"].values():
        ends = [moved[link] for link in joint["links"]]
        joint["at"] = [place(at, end) for at, end in zip(joint["at"], ends, strict=True)]
        if "angle" in joint:
            joint["angle"] = [a - end[1] for a, end in zip(joint["angle"], ends, strict=True)]
    for load in data["loads"].values():
        links = load.get("links") or [load.get("link")]
        if load["type"] in ("force", "spring", "thrust"):
            at = load["at"] if "links" in load else [load["at"]]
            at = [place(z, moved[link]) for z, link in zip(at, links, strict=True)]
            load["at"] = at if "links" in load else at[0]
        if load.get("axes") == "link":
            load["force"] = place(load["force"], (0j, moved[links[0]][1]))
        if "direction" in load:
            load["direction"] = place(load["direction"], (0j, moved[links[0]][1]))
        joint = data["joints"].get(load.get("joint", ""))
        if load["type"] == "torsion_spring" and (joint is None or joint["type"] == "R"):
            load["rest_angle"] += turn_of(joint["links"] if joint else links)
    return data, {
        name: turn_of(joint["links"])
        for name, driver in data["drivers"].items()
        if (joint := data["joints"][driver["joint"]])["type"] == "R"
    }


def place(z, frame):
    d, turn = frame
    return xy((complex(*z) - d) * cmath.exp(-1j * turn))


def with_laws(data):
    """Loads that follow laws, on the first links of a document."""
    a, b, c = list(data["links"])[:3]
    data["loads"] |= {
        "push": {"type": "thrust", "links": [a, b], "at": [[0.1, 0.2], [0.3, 0]], "law": OF_STROKE},
        "along": {
            "type": "thrust",
            "links": [b, c],
            "at": [[0.2, 0.1], [0, 0.4]],
            "law": OF_STROKE,
            "direction": [1.0, 0.5],
        },
        "brake": {"type": "motor", "links": [a, c], "law": LAW},
    }
    return data


@pytest.mark.parametrize("seed", range(4))
def test_other_link_frames_change_no_force(seed):
    kinds = (("dyad", "dyad", "dyad"), ("cylinder", "dyad"), ("dyad", "triad"), ("fork", "dyad"))
    data = with_laws(document(seed, kinds[seed], rough=True, slack=0.0))
    other, turns = reframed(data, seed + 50)
    one, two = (loads(json.dumps(d)).decompose() for d in (data, other))
    drivers = data["drivers"]
    home = {name: home_of(data, driver["joint"]) for name, driver in drivers.items()}
    runs = []
    for made, shift in ((one, {}), (two, turns)):
        at = {name: home[name] + 0.01 + shift.get(name, 0.0) for name in drivers}
        ask = {"rates": dict.fromkeys(at, 1.0), "accelerations": dict.fromkeys(at, -2.0)}
        runs.append(made.compile().run(at=at, **ask, on_gap="mark"))
    first, second = runs
    names = [n for n in first if n.endswith((".reaction", ".N", ".drive", ".friction", ".slip"))]
    largest = max(np.abs(first[n]).max() for n in names)
    assert largest > 1
    for name in names:
        assert np.abs(first[name] - second[name]).max() <= ROUNDING * largest, name


def home_of(data, joint):
    """Coordinate of a joint in the poses of a document."""
    said = data["joints"][joint]
    poses = {"frame": (0j, 0.0)}
    poses |= {n: (complex(*k["pose"][:2]), k["pose"][2]) for n, k in data["links"].items()}
    (o, a), (p, b) = (poses[link] for link in said["links"])
    if said["type"] == "R":
        return b - a
    d = (
        p
        + complex(*said["at"][1]) * cmath.exp(1j * b)
        - o
        - complex(*said["at"][0]) * cmath.exp(1j * a)
    )
    return (d * cmath.exp(-1j * (a + said["angle"][0]))).real


def test_a_slide_whose_frame_a_law_reads_is_left_alone():
    """A driven slide at an angle has a frame of its own; a law of its angle wants the user's."""
    law = {"kind": "polynomial", "coefficients": [0.0, 2.0]}
    data = {
        "format": "blockmech/joints",
        "version": 1,
        "links": {"slide": {"pose": [0.5, 0, -0.4]}, "arm": {"pose": [0.5, 0, 0.6]}},
        "joints": {
            "S": {
                "type": "P",
                "links": ["frame", "slide"],
                "at": [[0, 0], [0, 0]],
                "angle": [0, 0.4],
            },
            "R": {"type": "R", "links": ["slide", "arm"], "at": [[0, 0], [0, 0]]},
        },
        "drivers": {"push": {"joint": "S"}, "turn": {"joint": "R"}},
        "loads": {"m": {"type": "motor", "links": ["slide", "arm"], "law": law}},
    }
    made = loads(json.dumps(data)).decompose()
    assert made.data["blocks"]["slide"]["type"] == "group.general"
    at = {"push": 0.7, "turn": 1.1}
    run = made.compile().run(at=at, rates=dict.fromkeys(at, 0.0))
    assert run["driver.turn.drive"][0] == pytest.approx(-2.0 * 1.1, rel=1e-12)
    assert run["link.slide.angle"][0] == pytest.approx(-0.4, abs=1e-14)
