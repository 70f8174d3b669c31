"""Journal bearings with a table f(S) in a slider-crank and in an arm, by us and by the judge.

The table is the closed form of the short bearing (Ocvirk; DuBois & Ocvirk, NACA Report 1157, 1953)
at eccentricities 0.98 to 0.1, with boundary friction at rest.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest

import blockmech as bm
from tests.independent import multibody as mb
from tests.independent import rubbing, sticking
from tests.independent.test_rubbing import DOCUMENT
from tests.independent.test_sticking import ARM

SLENDER, BOUNDARY = 0.5, 4.0
ECCENTRIC = np.array([0.98, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1])
ROOT = np.sqrt(np.pi**2 * (1 - ECCENTRIC**2) + 16 * ECCENTRIC**2)
NUMBERS = (1 - ECCENTRIC**2) ** 2 / (np.pi * ECCENTRIC * ROOT) / SLENDER**2
VARIABLES = 2 * np.pi**2 * NUMBERS / np.sqrt(1 - ECCENTRIC**2)
TABLE = {
    "sommerfeld": [0.0, *NUMBERS.tolist()],
    "friction_variable": [BOUNDARY, *VARIABLES.tolist()],
}
OIL = {"viscosity": 0.3, "radius": 0.03, "length": 0.03, "clearance": 6e-5}
LAW = {"law": "hydrodynamic", **OIL, **TABLE}


def film():
    return rubbing.film(*OIL.values(), *TABLE.values())


def with_films(document, joints):
    data = copy.deepcopy(document)
    for name in joints:
        data["joints"][name]["friction"] = LAW
    return bm.Linkage.from_data(data).compile()


def test_a_slider_crank_moves_as_maximal_coordinates_say(monkeypatch):
    monkeypatch.setattr(rubbing, "TOLERANCE", 3e-14)  # the curve bends suddenly at its rows
    system, laws, t_end = mb.read(DOCUMENT), dict.fromkeys("OAB", film()), 0.12
    poses = mb.assemble(system, system.home, [0.7])
    rates = mb.rates(system, poses, [9.0])
    poses, rates, reversals = rubbing.moved(system, poses, rates, laws, t_end)
    assert reversals
    result = with_films(DOCUMENT, "OAB").simulate(
        f"time={t_end}", start={"motor": (0.7, 9.0)}, method="dop853", accuracy=1e-9, want=()
    )
    assert result.motion.q_end == pytest.approx(poses[0, 2], abs=1e-9)
    assert result.motion.qd_end == pytest.approx(rates[0, 2], abs=1e-7)
    without = (
        bm.Linkage.from_data(DOCUMENT)
        .compile()
        .simulate(f"time={t_end}", start={"motor": (0.7, 9.0)})
    )
    assert abs(without.motion.q_end - result.motion.q_end) > 1e-3


def test_numbers_of_a_film_have_derivatives():
    at, names = np.linspace(0.3, 2.3, 5), ("viscosity", "clearance", "radius", "length")
    settings = {"at": at, "rates": 25.0, "want": "driver.motor.drive"}
    to = [f"joints.A.friction.{name}" for name in names]
    exact = with_films(DOCUMENT, "OAB").sensitivity(to=to, **settings)

    def drive(name, value):
        data = copy.deepcopy(DOCUMENT)
        for joint in "OAB":
            data["joints"][joint]["friction"] = LAW | ({name: value} if joint == "A" else {})
        return bm.Linkage.from_data(data).run(**settings)["driver.motor.drive"]

    for name, address in zip(names, to, strict=True):
        step = 1e-4 * OIL[name]
        slope = (drive(name, OIL[name] + step) - drive(name, OIL[name] - step)) / (2 * step)
        expected = np.abs(slope).max()
        assert np.abs(exact["driver.motor.drive", address] - slope).max() <= 1e-5 * expected
        assert expected > 0


def test_two_drivers_move_as_maximal_coordinates_say():
    system, laws, t_end = mb.read(ARM), dict.fromkeys(("shoulder", "elbow"), film()), 0.04
    start = {"shoulder": (-0.4, 2.0), "elbow": (0.3, -4.0)}
    q, rate = (np.array([pair[i] for pair in start.values()]) for i in (0, 1))
    poses = mb.assemble(system, system.home, q)
    poses, rates, _ = sticking.moved(system, poses, mb.rates(system, poses, rate), laws, t_end)
    here = mb.Instant(system, poses, rates)
    expected = [here.coordinate(system.joints[x]).value for x in start]
    motion = (
        with_films(ARM, start).simulate(f"time={t_end}", start=start, accuracy=1e-9, want=()).motion
    )
    assert np.abs(motion.q_end - expected).max() <= 1e-8


def test_couples_of_a_given_motion_are_the_films_at_the_reactions():
    mech = with_films(DOCUMENT, "OAB")
    run = mech.run(at=np.linspace(0.1, 6.2, 13), rates=25.0, want="*")
    for joint in "OAB":
        loads, slips = np.abs(run[f"joint.{joint}.reaction"]), np.abs(run[f"joint.{joint}.slip"])
        couples = [film()(w)(g) for w, g in zip(slips, loads, strict=True)]
        assert np.abs(run[f"joint.{joint}.friction"]) == pytest.approx(couples, rel=1e-12)
    assert mech.verify(at=np.linspace(0.1, 6.2, 13), rates=25.0).ok
