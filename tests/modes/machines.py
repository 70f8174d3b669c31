"""Mechanisms with triads, wired by hand, as graph files say them."""

import copy
import json
import math

from blockmech.modes.closing import triad_modes
from blockmech.modes.triad import Triad
from tests.doors import graph_of as loads
from tests.doors import linkage_of as linkages


def stephenson(lengths, pins, at, crank, pivots, home=4.0, mode=0):
    """A crank and a triad on two fixed pivots; its home is a mode at a crank angle."""
    end = complex(at) + crank * complex(math.cos(home), math.sin(home))
    held = [end, *map(complex, pivots)]
    found = triad_modes(Triad.rrr(lengths, pins), held)[mode]
    poses = {"platform": [found.o.real, found.o.imag, found.angle]}
    pairs = {}
    for n, (g, l, p) in enumerate(zip(held, lengths, map(complex, pins), strict=True), start=1):
        leg = found.o + found.e * p - g
        poses[f"leg_{n}"] = [g.real, g.imag, math.atan2(leg.imag, leg.real)]
        pairs[f"G{n}"] = {"type": "R", "link": f"leg_{n}"}
        pairs[f"P{n}"] = {
            "type": "R",
            "links": [f"leg_{n}", "platform"],
            "at": [[l, 0.0], [p.real, p.imag]],
        }
    frame = {"A": at, "G2": pivots[0], "G3": pivots[1]}
    markers = {n: {"at": [complex(z).real, complex(z).imag]} for n, z in frame.items()}
    return {
        "format": "blockmech/graph",
        "version": 1,
        "name": "stephenson",
        "blocks": {
            "frame": {"type": "frame", "markers": markers},
            "crank": {"type": "driver.crank", "length": crank},
            "triad": {
                "type": "group.general",
                "links": {name: {} for name in poses},
                "pairs": pairs,
                "home": {"drivers": {"crank": home}, "poses": poses},
            },
        },
        "wires": [
            {"from": "frame.A", "to": "crank.A"},
            {"from": "crank.B", "to": "triad.G1"},
            {"from": "frame.G2", "to": "triad.G2"},
            {"from": "frame.G3", "to": "triad.G3"},
        ],
        "scene": {
            "drive": {"crank": {"law": "constant_rate", "rate": 1.0, "from": home, "to": home + 1}}
        },
    }


def overturned():
    """Two arcs longer than a turn; see `tests.modes.test_connection`."""
    return stephenson(
        [1.62, 1.12, 2.75], [0, 0.52 + 0.12j, 0.69 + 0.86j], 0, 1.6, [0.61 + 0.97j, 0.91 - 1.74j]
    )


def of_joints(graph):
    """A graph of `stephenson` as links and joints; its driver counts the other way."""
    blocks = graph["blocks"]
    home, pairs = blocks["triad"]["home"], blocks["triad"]["pairs"]
    q, frame = home["drivers"]["crank"], blocks["frame"]["markers"]
    joints = {
        "O": {"type": "R", "links": ["crank", "frame"], "at": [[0, 0], frame["A"]["at"]]},
        "A": {
            "type": "R",
            "links": ["crank", "leg_1"],
            "at": [[blocks["crank"]["length"], 0], [0, 0]],
        },
    }
    for n in (2, 3):
        at = [frame[f"G{n}"]["at"], [0, 0]]
        joints[f"G{n}"] = {"type": "R", "links": ["frame", f"leg_{n}"], "at": at}
    joints |= {name: pair for name, pair in pairs.items() if "links" in pair}
    poses = {"crank": [*frame["A"]["at"], q], **home["poses"]}
    law = {"law": "constant_rate", "rate": 1.0, "from": -q, "to": 1 - q}
    return {
        "format": "blockmech/joints",
        "version": 1,
        "name": "stephenson",
        "links": {name: {"pose": pose} for name, pose in poses.items()},
        "joints": joints,
        "drivers": {"motor": {"joint": "O", **law}},
    }


def on_a_rocker(length=3.0):
    """A triad on the coupler point of a four-bar whose crank cannot turn fully."""
    document = overturned()
    blocks = document["blocks"]
    blocks["frame"]["markers"]["D"] = {"at": [4.0, 0.0]}
    blocks["crank"]["length"] = length
    blocks["dyad"] = {"type": "dyad.rrr", "l_i": 3.0, "l_j": 2.0, "branch": 1}
    wires = [w for w in document["wires"] if w["to"] != "triad.G1"]
    wires += [
        {"from": "crank.B", "to": "dyad.B"},
        {"from": "frame.D", "to": "dyad.D"},
        {"from": "dyad.C", "to": "triad.G1"},
    ]
    pins = {"P1": 0, "P2": 2.0, "P3": 1.0 + 1.5j}
    frame = {"G2": 6 + 2j, "G3": 3 + 5j}
    lengths = {"P1": 1.5, "P2": 2.0, "P3": 2.2}
    for name, z in frame.items():
        blocks["frame"]["markers"][name] = {"at": [complex(z).real, complex(z).imag]}
    for name, z in pins.items():
        at = [[lengths[name], 0.0], [complex(z).real, complex(z).imag]]
        blocks["triad"]["pairs"][name]["at"] = at
    return document | {"wires": wires}, (frame, pins, lengths)


def sliding():
    """A slide drive, and a triad with a leg of each kind: a link, a guide on the platform,
    and a slider on a guide of the driven link."""
    document = {
        "format": "blockmech/graph",
        "version": 1,
        "name": "sliding",
        "blocks": {
            "frame": {
                "type": "frame",
                "markers": {
                    "rail": {"at": [0.0, 0.0], "angle": 0.2},
                    "G": {"at": [2.0, 0.3]},
                    "H": {"at": [1.0, 2.0]},
                },
            },
            "ram": {
                "type": "driver.slide",
                "links": {"slider": {"markers": {"guide": {"at": [0.1, 0.0], "angle": 1.3}}}},
            },
            "triad": {
                "type": "group.general",
                "links": {"platform": {}, "rod": {}, "sleeve": {}, "shoe": {}},
                "pairs": {
                    "G": {"type": "R", "link": "rod", "at": [0.2, 0.1]},
                    "P1": {"type": "R", "links": ["platform", "rod"], "at": [[1, 0.2], [1.4, 0]]},
                    "H": {"type": "R", "link": "sleeve", "at": [0.0, 0.15]},
                    "P2": {
                        "type": "P",
                        "links": ["sleeve", "platform"],
                        "at": [[0.3, 0.0], [0.4, 0.9]],
                        "angle": [0.4, 0.1],
                    },
                    "shoe_guide": {
                        "type": "P",
                        "link": "shoe",
                        "at": [0.05, 0.1],
                        "angle": -0.3,
                    },
                    "P3": {"type": "R", "links": ["shoe", "platform"], "at": [[0.1, 0.0], [0, 0]]},
                },
                "home": {"drivers": {"ram": 0.1}, "poses": {}},
            },
        },
        "wires": [
            {"from": "frame.rail", "to": "ram.S"},
            {"from": "frame.G", "to": "triad.G"},
            {"from": "frame.H", "to": "triad.H"},
            {"from": "ram.guide", "to": "triad.shoe_guide"},
        ],
        "scene": {"drive": {"ram": {"law": "constant_rate", "rate": 1.0, "from": 0.0, "to": 0.4}}},
    }
    poses = {link: [0.0, 0.0, 0.0] for link in ("platform", "rod", "sleeve", "shoe")}
    document["blocks"]["triad"]["home"]["poses"] = poses
    return document


CYLINDERS = [1.9, 2.1, 2.0]  # [m] lengths at home
FEET = [0, 4, 1.5 + 3.6j]
PINS = [0, 1.6, 0.7 + 1.1j]


def on_cylinders():
    """A platform on three cylinders: 3-RPR, three drivers inside one group; no home yet."""
    names = [f"{part}_{n}" for n in (1, 2, 3) for part in ("barrel", "rod")]
    pairs = {}
    for n, pin in enumerate(PINS, start=1):
        barrel, rod, z = f"barrel_{n}", f"rod_{n}", complex(pin)
        pairs[f"G{n}"] = {"type": "R", "link": barrel}
        pairs[f"q{n}"] = {
            "type": "P",
            "links": [barrel, rod] if n < 3 else [rod, barrel],
            "at": [[0.2, 0], [0.1, 0]] if n < 3 else [[-0.1, 0], [-0.2, 0]],
            "angle": [0.0, 0.0] if n < 3 else [3.141592653589793, 3.141592653589793],
            "driven": True,
        }
        pairs[f"P{n}"] = {"type": "R", "links": [rod, "platform"], "at": [[0, 0], [z.real, z.imag]]}
    poses = {name: [0.0, 0.0, 0.0] for name in ("platform", *names)}
    home = {f"triad.q{n}": q for n, q in enumerate(CYLINDERS, start=1)}
    markers = {f"G{n}": {"at": [complex(g).real, complex(g).imag]} for n, g in enumerate(FEET, 1)}
    law = {"law": "constant_rate", "rate": 0.1, "from": 0.3, "to": 4.0}
    return {
        "format": "blockmech/graph",
        "version": 1,
        "name": "platform_on_cylinders",
        "blocks": {
            "frame": {"type": "frame", "markers": markers},
            "triad": {
                "type": "group.general",
                "links": {name: {} for name in poses},
                "pairs": pairs,
                "home": {"drivers": home, "poses": poses},
            },
        },
        "wires": [{"from": f"frame.G{n}", "to": f"triad.G{n}"} for n in (1, 2, 3)],
        "scene": {"drive": {"triad.q1": law, "triad.q2": law, "triad.q3": law}},
    }


def with_home(document, put, group="triad"):
    """The document with another mode of a group: what `Modes` says to put there."""
    changed = copy.deepcopy(document)
    changed["blocks"][group] |= json.loads(json.dumps(put))
    return changed


def compiled(document):
    if document["format"] == "blockmech/joints":
        return linkages(json.dumps(document)).compile()
    return loads(json.dumps(document)).compile()
