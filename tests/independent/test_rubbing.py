"""A slider-crank and a four-bar with Stribeck friction in all pairs, by us and by the judge."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import JOINTS
from tests.independent import multibody as mb
from tests.independent import rubbing as judge
from tests.independent.kept import kept
from tests.independent.rubbing import moved, stribeck

CURVE = {"static": 0.3, "kinetic": 0.18, "stribeck_speed": 1.5, "exponent": 2.0, "viscous": 0.004}
GROUND = 0.035  # [m] radius of the four-bar's fourth pin, in the place of the guide
RADII = {"O": 0.03, "A": 0.025, "B": 0.02}
DOCUMENT = {
    "format": "blockmech/joints",
    "version": 1,
    "name": "rubbing slider-crank",
    "gravity": [0.0, -9.81],
    "links": {
        "crank": {"mass": 3.0, "inertia": 0.05, "cm": [0.05, 0.02], "pose": [0.0, 0.0, 0.7]},
        "rod": {"mass": 1.2, "inertia": 0.02, "cm": [0.25, 0.01], "pose": [0.115, 0.097, -0.15]},
        "ram": {"mass": 2.0, "inertia": 0.01, "cm": [0.02, 0.0], "pose": [0.7, 0.01, 0.05]},
    },
    "joints": {
        "O": {"type": "R", "links": ["frame", "crank"], "at": [[0.0, 0.0], [0.0, 0.0]]},
        "A": {"type": "R", "links": ["crank", "rod"], "at": [[0.15, 0.0], [0.0, 0.0]]},
        "B": {"type": "R", "links": ["rod", "ram"], "at": [[0.6, 0.0], [0.0, 0.0]]},
        "guide": {
            "type": "P",
            "links": ["frame", "ram"],
            "at": [[0.0, 0.01], [0.0, 0.0]],
            "angle": [0.05, 0.0],
        },
    },
    "drivers": {"motor": {"joint": "O"}},
    "loads": {
        "work": {"type": "force", "link": "ram", "at": [0.0, 0.03], "force": [-20.0, 5.0]},
    },
}


FOURBAR = copy.deepcopy(DOCUMENT) | {"name": "rubbing four-bar"}
FOURBAR["links"] |= {
    "rod": {"mass": 1.2, "inertia": 0.02, "cm": [0.25, 0.01], "pose": [0.115, 0.097, 0.3]},
    "ram": {"mass": 2.0, "inertia": 0.06, "cm": [0.15, 0.0], "pose": [0.5, -0.05, 1.4]},
}
FOURBAR["joints"] = {
    **{name: DOCUMENT["joints"][name] for name in "OA"},
    "B": {"type": "R", "links": ["rod", "ram"], "at": [[0.5, 0.0], [0.35, 0.0]]},
    "guide": {"type": "R", "links": ["frame", "ram"], "at": [[0.5, -0.05], [0.0, 0.0]]},
}


@kept(mb, judge, CURVE, RADII, GROUND)
def rubbing(document, q, rate, t_end, exponent):
    """Crank angle and rate after a time by the judge, and the reversals."""
    system = mb.read(document)
    curve = [CURVE[x] for x in ("static", "kinetic", "stribeck_speed")]
    laws = {name: stribeck(*curve, exponent, CURVE["viscous"], r) for name, r in RADII.items()}
    arm = 1.0 if document["joints"]["guide"]["type"] == "P" else GROUND
    laws["guide"] = stribeck(*curve, exponent, CURVE["viscous"], arm)
    poses = mb.assemble(system, system.home, [q])
    rates = mb.rates(system, poses, [rate])
    poses, rates, reversals = moved(system, poses, rates, laws, t_end)
    return float(poses[0, 2]), float(rates[0, 2]), reversals


@pytest.mark.parametrize("exponent", [1.0, 2.0])
@pytest.mark.parametrize(
    ("source", "q", "rate", "t_end"),
    [
        pytest.param(DOCUMENT, 0.7, 9.0, 0.5, id="slider-crank"),
        pytest.param(DOCUMENT, 2.5, -6.0, 0.4, id="slider-crank, back"),
        pytest.param(FOURBAR, 0.7, 9.0, 0.5, id="four-bar"),
        pytest.param(FOURBAR, 2.5, -6.0, 0.4, id="four-bar, back"),
    ],
)
def test_a_mechanism_moves_as_maximal_coordinates_say(source, q, rate, t_end, exponent):
    document = copy.deepcopy(source)
    for name, joint in document["joints"].items():
        arm = RADII | ({"guide": GROUND} if joint["type"] == "R" else {})
        shape = {"radius": arm[name]} if name in arm else {}
        joint["friction"] = {"law": "stribeck", **CURVE, "exponent": exponent, **shape}
    mech = bm.Linkage.from_data(document).compile()
    angle, speed, reversals = rubbing(source, q, rate, t_end, exponent)
    assert reversals >= 2
    for method in ("auto", "radau"):
        motion = mech.simulate(
            f"time={t_end}", start={"motor": (q, rate)}, method=method, accuracy=1e-11, want=()
        ).motion
        assert motion.reached
        assert abs(motion.q_end - angle) <= 1e-9
        assert abs(motion.qd_end - speed) <= 1e-8
        assert not np.isnan(motion.error)


def test_the_gallery_moves_as_maximal_coordinates_say():
    """The expected numbers in ``graphs``, from the links and joints of the same file."""
    document = json.loads((JOINTS / "stribeck_slider_crank.json").read_text("utf-8"))
    (expected,) = document.pop("expect")
    result = of_a_file(document, expected["simulate"]["times"])
    assert result[-1][2] > 6  # pairs reverse, and all of them where it turns back
    for i, part in enumerate(("q", "rate")):
        told = expected["want"][f"driver.motor.{part}"]
        assert np.abs(np.subtract(told, [at[i] for at in result])).max() <= 1e-9


@kept(mb, judge)
def of_a_file(document, times):
    """Angle and rate of the crank at times, and the reversals until then."""
    laws, joints = {}, copy.deepcopy(document["joints"])
    for name, joint in joints.items():
        law = joint.pop("friction")
        keys = ("static", "kinetic", "stribeck_speed", "exponent", "viscous")
        laws[name] = stribeck(*(law[key] for key in keys), law.get("radius", 1.0))
    system, start = mb.read(document | {"joints": joints}), document["initial"]["motor"]
    poses = mb.assemble(system, system.home, [start["q"]])
    rates = mb.rates(system, poses, [start["rate"]])
    result = [moved(system, poses, rates, laws, t) for t in times]
    return [(float(q[0, 2]), float(rate[0, 2]), reversals) for q, rate, reversals in result]
