"""Documents that people would write, for tests."""

from __future__ import annotations

import cmath
import copy


def pin(first, second, at_first, at_second, **options):
    """A revolute joint."""
    return {"type": "R", "links": [first, second], "at": [[*at_first], [*at_second]], **options}


def guide(first, second, at_first, at_second, angle=(0.0, 0.0), **options):
    """A prismatic joint."""
    at = [[*at_first], [*at_second]]
    return {"type": "P", "links": [first, second], "at": at, "angle": [*angle], **options}


def joints_file(links, joints, drivers, **options):
    """A document of named poses, joints and drivers."""
    return {
        "format": "blockmech/joints",
        "version": 2,
        "name": "machine",
        "links": {name: {"pose": [*pose]} for name, pose in links.items()},
        "joints": joints,
        "drivers": {name: {"joint": joint} for name, joint in drivers.items()},
        **options,
    }


def fourbar():
    """A crank-rocker without masses."""
    return joints_file(
        {"crank": (0, 0, 1.0), "rod": (0.54, 0.84, 0.3), "rocker": (2.5, 0, 1.9)},
        {
            "A": pin("frame", "crank", (0, 0), (0, 0)),
            "B": pin("crank", "rod", (1, 0), (0, 0)),
            "C": pin("rod", "rocker", (2.5, 0), (2, 0)),
            "D": pin("frame", "rocker", (2.5, 0), (0, 0)),
        },
        {"motor": "A"},
    )


ROUGH = {"law": "coulomb", "coefficient": 0.1}
TURN = {"law": "constant_rate", "rate": 100.0, "from": 0.0, "to": 6.283185307179586}
SLIDER_CRANK = {
    "format": "blockmech/joints",
    "version": 2,
    "name": "slider_crank",
    "gravity": [0.0, -9.81],
    "links": {
        "crank": {"mass": 1.0, "inertia": 0.01, "cm": [0.05, 0.0], "pose": [0.0, 0.0, 0.7]},
        "rod": {"mass": 2.0, "inertia": 0.05, "cm": [0.15, 0.0], "pose": [0.08, 0.06, -0.2]},
        "piston": {"mass": 1.5, "inertia": 0.002, "cm": [0.0, 0.0], "pose": [0.37, 0.0, 0.0]},
    },
    "joints": {
        "O": pin("frame", "crank", (0.0, 0.0), (0.0, 0.0)),
        "A": pin("crank", "rod", (0.1, 0.0), (0.0, 0.0), friction=ROUGH | {"radius": 0.01}),
        "B": pin("rod", "piston", (0.3, 0.0), (0.0, 0.0)),
        "S": guide("frame", "piston", (0.0, 0.0), (0.0, 0.0), friction=ROUGH),
    },
    "drivers": {"motor": {"joint": "O"} | TURN},
    "loads": {"gas": {"type": "force", "link": "piston", "at": [0.0, 0.0], "force": [-500.0, 0.0]}},
}
"""The example of the format's description."""


def slider_crank():
    """A copy of the example."""
    return copy.deepcopy(SLIDER_CRANK)


def parallelogram(lengths=(1.0, 1.0, 1.0), angle=0.7):
    """So many cranks of given lengths, a unit apart, under one rod."""
    o = cmath.rect(1.0, angle)
    links, joints = {"rod": (o.real, o.imag, 0.0)}, {}
    for k, length in enumerate(lengths):
        name = "abcdefgh"[k]
        links[name] = (k, 0.0, angle)
        joints[f"F{name}"] = pin("frame", name, (k, 0), (0, 0))
        joints[f"R{name}"] = pin(name, "rod", (length, 0), (k, 0))
    return joints_file(links, joints, {"motor": "Fa"})


def turned_round(data, joint):
    """The same document with the links of a joint named the other way round."""
    data = copy.deepcopy(data)
    joint_data = data["joints"][joint]
    for key in ("links", "at", "angle"):
        if key in joint_data:
            joint_data[key] = joint_data[key][::-1]
    if joint_data["type"] == "P":
        joint_data["slider"] = 1 - joint_data.get("slider", 1)
    return data


def chain(number):
    """A crank and so many RRR dyads, each on the rocker before it."""
    links, joints = {"crank": (0.0, 0.0, 0.7)}, {"O": pin("frame", "crank", (0, 0), (0, 0))}
    poses = {"crank": (0j, 0.7)}
    before, at = "crank", 1.0 + 0j
    for k in range(number):
        o, angle = poses[before]
        B = o + at * cmath.exp(1j * angle)
        C, D = B + 1.0 + 1.2j, B + 2.0 + (0.3j if k % 2 else -0.3j)
        rod, rocker = f"rod{k:04}", f"rocker{k:04}"
        poses[rod], poses[rocker] = (B, cmath.phase(C - B)), (D, cmath.phase(C - D))
        for name in (rod, rocker):
            o, angle = poses[name]
            links[name] = (o.real + 1e-4, o.imag, angle)
        joints[f"B{k:04}"] = pin(before, rod, (at.real, at.imag), (0, 0))
        joints[f"C{k:04}"] = pin(rod, rocker, (abs(C - B), 0), (abs(C - D), 0))
        joints[f"D{k:04}"] = pin("frame", rocker, (D.real, D.imag), (0, 0))
        before, at = rocker, complex(abs(C - D) * 0.6, 0.1)
    return joints_file(links, joints, {"motor": "O"})
