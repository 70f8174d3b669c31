"""Several drivers with joint friction: what sticks and slips, by us and by the judge."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import JOINTS
from tests.independent import multibody as mb
from tests.independent import rubbing as judge
from tests.independent import sticking
from tests.independent.kept import kept
from tests.independent.rubbing import stribeck

CURVE = {"static": 0.4, "kinetic": 0.25, "stribeck_speed": 0.8, "exponent": 2.0, "viscous": 0.01}
COULOMB = {"law": "coulomb", "coefficient": 0.3}
STRIBECK = {"law": "stribeck", **CURVE}


def fivebar():
    document = json.loads((JOINTS / "fivebar_falling.json").read_text("utf-8"))
    return {key: x for key, x in document.items() if key not in ("expect", "initial")}


ARM = {
    "format": "blockmech/joints",
    "version": 1,
    "name": "arm",
    "gravity": [0.0, -9.81],
    "links": {
        "upper": {"mass": 2.0, "inertia": 0.05, "cm": [0.25, 0.01], "pose": [0.0, 0.0, 0.0]},
        "fore": {"mass": 1.0, "inertia": 0.02, "cm": [0.2, 0.0], "pose": [0.5, 0.0, 0.0]},
    },
    "joints": {
        "shoulder": {"type": "R", "links": ["frame", "upper"], "at": [[0.0, 0.0], [0.0, 0.0]]},
        "elbow": {"type": "R", "links": ["upper", "fore"], "at": [[0.5, 0.0], [0.0, 0.0]]},
    },
    "drivers": {"shoulder": {"joint": "shoulder"}, "elbow": {"joint": "elbow"}},
}
# A bead on a turning rod, and a slide that carries a pendulum: guides that stick.
BEAD = {
    "format": "blockmech/joints",
    "version": 1,
    "name": "bead",
    "gravity": [0.0, -3.0],
    "links": {
        "rod": {"mass": 1.0, "inertia": 0.3, "cm": [0.1, 0.0], "pose": [0.0, 0.0, 0.3]},
        "bead": {"mass": 0.5, "inertia": 0.001, "pose": [0.38, 0.12, 0.3]},
    },
    "joints": {
        "hub": {"type": "R", "links": ["frame", "rod"], "at": [[0.0, 0.0], [0.0, 0.0]]},
        "slot": {"type": "P", "links": ["rod", "bead"], "at": [[0.0, 0.02], [0.0, 0.0]]},
    },
    "drivers": {"hub": {"joint": "hub"}, "slot": {"joint": "slot"}},
}
CART = {
    "format": "blockmech/joints",
    "version": 1,
    "name": "cart",
    "gravity": [0.0, -9.81],
    "links": {
        "cart": {"mass": 2.0, "inertia": 0.1, "pose": [0.0, 0.0, 0.1]},
        "bob": {"mass": 1.5, "inertia": 0.01, "cm": [0.5, 0.0], "pose": [0.0, 0.0, 0.0]},
    },
    "joints": {
        "rail": {
            "type": "P",
            "links": ["frame", "cart"],
            "at": [[0.0, 0.0], [0.0, 0.0]],
            "angle": [0.1, 0.0],
        },
        "pin": {"type": "R", "links": ["cart", "bob"], "at": [[0.0, 0.0], [0.0, 0.0]]},
    },
    "drivers": {"rail": {"joint": "rail"}, "pin": {"joint": "pin"}},
}
# document, radius of each pin (1: a guide), law, start, time, times at which something begins to
# stick: what makes the case worth while
CASES = {
    "five-bar from rest": (fivebar, dict.fromkeys("ABCDE", 0.1), COULOMB, None, 0.5, 0),
    "five-bar, Stribeck": (fivebar, dict.fromkeys("ABCDE", 0.1), STRIBECK, None, 0.5, 0),
    "five-bar moving": (
        fivebar,
        {"A": 0.2, "B": 0.02, "C": 0.3, "D": 0.02, "E": 0.1},
        STRIBECK,
        {"left": (1.2, 0.8), "right": (2.2, -0.9)},
        0.5,
        1,
    ),
    "arm": (
        lambda: ARM,
        {"shoulder": 0.02, "elbow": 0.1},
        COULOMB,
        {"shoulder": (0.0, 0.0), "elbow": (0.0, 0.0)},
        0.8,
        1,
    ),
    "arm, Stribeck": (
        lambda: ARM,
        {"shoulder": 0.1, "elbow": 0.08},
        STRIBECK,
        {"shoulder": (-0.4, 2.0), "elbow": (0.3, -4.0)},
        1.2,
        1,
    ),
    "bead": (
        lambda: BEAD,
        {"hub": 0.2, "slot": 1.0},
        {"law": "coulomb", "coefficient": 1.2},
        {"hub": (0.3, 1.5), "slot": (0.4, -0.5)},
        1.0,
        1,
    ),
    "cart": (
        lambda: CART,
        {"rail": 1.0, "pin": 0.03},
        {"law": "coulomb", "coefficient": 0.3},
        {"rail": (0.0, 0.3), "pin": (-0.4, 0.0)},
        1.2,
        1,
    ),
}


def law_of(data, radius):
    if data["law"] == "stribeck":
        return stribeck(*(CURVE[x] for x in CURVE), radius)
    return lambda w: (data["coefficient"] * radius, 0.0)


@kept(mb, sticking, judge, CURVE)
def by_the_judge(document, radii, data, start, t_end):
    """Coordinates and rates of the drivers, and the senses of slip from when on."""
    system = mb.read(document)
    laws = {name: law_of(data, radius) for name, radius in radii.items()}
    q, rate = (np.array([pair[i] for pair in start.values()]) for i in (0, 1))
    poses = mb.assemble(system, system.home, q)
    moved = sticking.moved(system, poses, mb.rates(system, poses, rate), laws, t_end)
    poses, rates, history = moved
    here = mb.Instant(system, poses, rates)
    rows = [here.coordinate(system.joints[d.joint]) for d in system.drivers.values()]
    result = [float(r.value) for r in rows], [float(r.gradient @ here.q_dot) for r in rows]
    return *result, [(float(t), [int(s) for s in sides]) for t, sides in history]


@pytest.mark.parametrize("case", CASES)
def test_what_sticks_and_slips_moves_as_maximal_coordinates_say(case):
    make, radii, data, start, t_end, sticks = CASES[case]
    document = copy.deepcopy(make())
    start = start or {"left": (1.2, 0.0), "right": (2.2, 0.0)}
    q, rate, history = by_the_judge(document, radii, data, start, t_end)
    for name, radius in radii.items():
        joint = document["joints"][name]
        joint["friction"] = {**data, **({"radius": radius} if joint["type"] == "R" else {})}
    mech = bm.Linkage.from_data(document).compile()
    result = mech.simulate(f"time={t_end}", start=start, accuracy=1e-9, want="*")
    motion = result.motion
    assert motion.reached
    turns = (motion.q_end - q) / (2 * np.pi)
    rotary = [mech.structure.driver_joint(d).rotary for d in mech.drivers]
    whole = np.where(rotary, np.round(turns), 0.0)
    assert np.abs(motion.q_end - 2 * np.pi * whole - q).max() <= 1e-8
    assert np.abs(motion.qd_end - rate).max() <= 1e-7
    assert [s.begin for s in motion.slips] == pytest.approx([t for t, _ in history], abs=1e-8)
    order = [list(radii).index(name.removeprefix("joint.")) for name in mech.frictional_joints]
    # A joint's own order of links may differ from that of the groups: the slip's sign with it.
    expected = [tuple(s[k] for k in order) for _, s in history]
    assert [[abs(x) for x in s.sides] for s in motion.slips] == [
        list(map(abs, s)) for s in expected
    ]
    assert sum(e.kind.startswith("sticking") for e in motion.events) >= sticks
    assert motion.facts["energy_balance"] <= 1e-11
    assert mech.verify(result).ok
