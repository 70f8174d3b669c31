"""Mechanisms with triads, wired by hand, as graph files say them."""

import copy
import json
import math

from blockmech.modes.closing import triad_modes
from blockmech.modes.triad import Triad
from tests.doors import graph_of as loads
from tests.doors import linkage_of as linkages
from tests.model.joints.machines import guide, joints_file, pin


def graph(name, blocks, wires, drive):
    """A graph file; wires as ``"marker joint"``."""
    ends = (dict(zip(("from", "to"), wire.split(), strict=True)) for wire in wires)
    head = {"format": "blockmech/graph", "version": 1, "name": name}
    return head | {"blocks": blocks, "wires": list(ends), "scene": {"drive": drive}}


def turning(start, end, rate=1.0):
    return {"law": "constant_rate", "rate": rate, "from": start, "to": end}


def place(z):
    return [complex(z).real, complex(z).imag]


def group(poses, pairs, drivers):
    """A general group of links without masses."""
    home = {"drivers": drivers, "poses": poses}
    return {"type": "group.general", "links": {n: {} for n in poses}, "pairs": pairs, "home": home}


def stephenson(lengths, pins, at, crank, pivots, home=4.0, mode=0):
    """A crank and a triad on two fixed pivots; its home is a mode at a crank angle."""
    end = complex(at) + crank * complex(math.cos(home), math.sin(home))
    held = [end, *map(complex, pivots)]
    result = triad_modes(Triad.rrr(lengths, pins), held)[mode]
    poses = {"platform": [result.o.real, result.o.imag, result.angle]}
    pairs = {}
    for n, (g, l, p) in enumerate(zip(held, lengths, map(complex, pins), strict=True), start=1):
        leg = result.o + result.e * p - g
        poses[f"leg_{n}"] = [g.real, g.imag, math.atan2(leg.imag, leg.real)]
        pairs[f"G{n}"] = {"type": "R", "link": f"leg_{n}"}
        pairs[f"P{n}"] = pin(f"leg_{n}", "platform", (l, 0.0), place(p))
    frame = {"A": at, "G2": pivots[0], "G3": pivots[1]}
    blocks = {
        "frame": {"type": "frame", "markers": {n: {"at": place(z)} for n, z in frame.items()}},
        "crank": {"type": "driver.crank", "length": crank},
        "triad": group(poses, pairs, {"crank": home}),
    }
    wires = "frame.A crank.A", "crank.B triad.G1", "frame.G2 triad.G2", "frame.G3 triad.G3"
    return graph("stephenson", blocks, wires, {"crank": turning(home, home + 1)})


def overturned():
    """Two arcs longer than a turn; see `tests.modes.test_circuits`."""
    return stephenson(
        [1.62, 1.12, 2.75], [0, 0.52 + 0.12j, 0.69 + 0.86j], 0, 1.6, [0.61 + 0.97j, 0.91 - 1.74j]
    )


def of_joints(graph):
    """A graph of `stephenson` as links and joints; its driver counts the other way."""
    blocks = graph["blocks"]
    home, pairs = blocks["triad"]["home"], blocks["triad"]["pairs"]
    q, frame = home["drivers"]["crank"], blocks["frame"]["markers"]
    joints = {
        "O": pin("crank", "frame", (0, 0), frame["A"]["at"]),
        "A": pin("crank", "leg_1", (blocks["crank"]["length"], 0), (0, 0)),
    }
    for n in (2, 3):
        joints[f"G{n}"] = pin("frame", f"leg_{n}", frame[f"G{n}"]["at"], (0, 0))
    joints |= {name: pair for name, pair in pairs.items() if "links" in pair}
    document = joints_file({"crank": [*frame["A"]["at"], q], **home["poses"]}, joints, {})
    return document | {"drivers": {"motor": {"joint": "O", **turning(-q, 1 - q)}}}


def on_a_rocker(length=3.0):
    """A triad on the coupler point of a four-bar whose crank cannot turn fully."""
    document = overturned()
    blocks = document["blocks"]
    pins = {"P1": 0, "P2": 2.0, "P3": 1.0 + 1.5j}
    frame = {"G2": 6 + 2j, "G3": 3 + 5j}
    lengths = {"P1": 1.5, "P2": 2.0, "P3": 2.2}
    blocks["frame"]["markers"] |= {n: {"at": place(z)} for n, z in {"D": 4.0, **frame}.items()}
    blocks["crank"]["length"] = length
    blocks["dyad"] = {"type": "dyad.rrr", "l_i": 3.0, "l_j": 2.0, "branch": 1}
    for name, z in pins.items():
        blocks["triad"]["pairs"][name]["at"] = [[lengths[name], 0.0], place(z)]
    document["wires"] = [w for w in document["wires"] if w["to"] != "triad.G1"]
    for start, end in (("crank.B", "dyad.B"), ("frame.D", "dyad.D"), ("dyad.C", "triad.G1")):
        document["wires"].append({"from": start, "to": end})
    return document, (frame, pins, lengths)


def sliding():
    """A slide drive, and a triad with a leg of each kind: a link, a guide on the platform,
    and a slider on a guide of the driven link."""
    markers = {"rail": {"at": [0, 0], "angle": 0.2}, "G": {"at": [2, 0.3]}, "H": {"at": [1, 2]}}
    slider = {"markers": {"guide": {"at": [0.1, 0.0], "angle": 1.3}}}
    pairs = {
        "G": {"type": "R", "link": "rod", "at": [0.2, 0.1]},
        "P1": pin("platform", "rod", (1, 0.2), (1.4, 0)),
        "H": {"type": "R", "link": "sleeve", "at": [0.0, 0.15]},
        "P2": guide("sleeve", "platform", (0.3, 0.0), (0.4, 0.9), (0.4, 0.1)),
        "shoe_guide": {"type": "P", "link": "shoe", "at": [0.05, 0.1], "angle": -0.3},
        "P3": pin("shoe", "platform", (0.1, 0.0), (0, 0)),
    }
    poses = {link: [0.0, 0.0, 0.0] for link in ("platform", "rod", "sleeve", "shoe")}
    blocks = {
        "frame": {"type": "frame", "markers": markers},
        "ram": {"type": "driver.slide", "links": {"slider": slider}},
        "triad": group(poses, pairs, {"ram": 0.1}),
    }
    wires = ("frame.rail ram.S", "frame.G triad.G", "frame.H triad.H", "ram.guide triad.shoe_guide")
    return graph("sliding", blocks, wires, {"ram": turning(0.0, 0.4)})


CYLINDERS = [1.9, 2.1, 2.0]  # [m] lengths at home
FEET = [0, 4, 1.5 + 3.6j]
PINS = [0, 1.6, 0.7 + 1.1j]


def on_cylinders():
    """A platform on three cylinders: 3-RPR, three drivers inside one group; no home yet."""
    pairs, poses = {}, {"platform": [0.0, 0.0, 0.0]}
    for n, pivot in enumerate(PINS, start=1):
        barrel, rod = f"barrel_{n}", f"rod_{n}"
        poses |= {barrel: [0.0, 0.0, 0.0], rod: [0.0, 0.0, 0.0]}
        pairs[f"G{n}"] = {"type": "R", "link": barrel}
        bore = guide(barrel, rod, (0.2, 0), (0.1, 0))
        if n == 3:  # said the other way round
            bore = guide(rod, barrel, (-0.1, 0), (-0.2, 0), (math.pi, math.pi))
        pairs[f"q{n}"] = bore | {"driven": True}
        pairs[f"P{n}"] = pin(rod, "platform", (0, 0), place(pivot))
    home = {f"triad.q{n}": q for n, q in enumerate(CYLINDERS, start=1)}
    markers = {f"G{n}": {"at": place(z)} for n, z in enumerate(FEET, start=1)}
    frame = {"type": "frame", "markers": markers}
    wires = [f"frame.G{n} triad.G{n}" for n in (1, 2, 3)]
    blocks = {"frame": frame, "triad": group(poses, pairs, home)}
    return graph("cylinders", blocks, wires, dict.fromkeys(home, turning(0.3, 4.0, 0.1)))


def with_home(document, put):
    """The document with another mode of a group: what `Modes` says to put there."""
    changed = copy.deepcopy(document)
    changed["blocks"]["triad"] |= json.loads(json.dumps(put))
    return changed


def compiled(document):
    if document["format"] == "blockmech/joints":
        return linkages(json.dumps(document)).compile()
    return loads(json.dumps(document)).compile()
