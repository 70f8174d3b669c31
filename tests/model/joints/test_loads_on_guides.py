"""Springs, dampers and thrusts on a sliding joint by its name; markers by distance and angle."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import blockmech as bm

Q = np.array([0.3, 1.2, 2.0, 4.4])
RATE = 5.0


def press(**load):
    """A slider-crank whose piston is on a guide at an angle."""
    m = bm.Linkage("press")
    for name in ("crank", "rod", "piston"):
        m.add_link(name)
    direction = cmath.rect(1.0, 0.4)
    m.add_joint("A", "R", ["frame", "crank"], point=0j)
    m.add_joint("B", "R", ["crank", "rod"], point=0.1 + 0.05j)
    m.add_joint("C", "R", ["rod", "piston"], point=0.45 * direction)
    m.add_joint("S", "P", ["frame", "piston"], point=0.45 * direction, angle=0.4)
    m.add_driver("motor", "A", bm.motion.ConstantRate(rate=RATE))
    if load:
        m.add_load("load", joint="S", **load)
    return m.compile()


@pytest.mark.parametrize(
    ("load", "force"),
    [
        (bm.Spring(stiffness=300.0, free_length=0.02), lambda s, v: -300.0 * (s - 0.02)),
        (bm.Spring(stiffness=0.0, damping=40.0), lambda s, v: -40.0 * v),
        (
            bm.Spring(stiffness=300.0, free_length=0.02, damping=40.0),
            lambda s, v: -300.0 * (s - 0.02) - 40.0 * v,
        ),
        (bm.Thrust(law=lambda coordinate: 7.0 + coordinate**2), lambda s, v: 7.0 + s**2),
        (bm.Thrust(law=lambda rate: -3.0 * rate), lambda s, v: -3.0 * v),
    ],
)
def test_load_on_a_guide_is_a_force_of_its_coordinate(load, force):
    """The drive does its work: T q' = -F s', s the coordinate of the guide."""
    mechanism = press(load=load)
    run = mechanism.run(at=Q)
    s, v = run["joint.S.coordinate"], run["joint.S.slip"]
    expected = -force(s, v) * v / RATE
    drive = run["driver.motor.drive"]
    assert np.abs(drive - expected).max() <= 1e-11 * np.abs(expected).max()
    assert mechanism.verify(at=Q).ok


@pytest.mark.parametrize(
    ("keys", "because"),
    [
        ({"joint": "B"}, "B is a pin, along which nothing pulls"),
        ({"joint": "S", "links": ["rod", "piston"]}, "names links and joint"),
        ({"links": ["rod", "piston"]}, '"links" and "at" belong together'),
        ({}, "names neither links nor a joint"),
    ],
)
def test_where_a_spring_takes_hold_is_said_once(keys, because):
    def add():
        m = bm.Linkage.from_data(press().document.to_data())
        m.add_load("spring", "spring", stiffness=1.0, **keys)
        m.compile()

    with pytest.raises(bm.GraphError, match=because):
        add()


def test_markers_have_a_distance_and_an_angle():
    m = bm.Linkage("plate")
    markers = {"P": {"polar": (2.5, "30deg")}, "G": {"at": {"polar": (1.0, 0.5)}, "angle": "90deg"}}
    m.add_link("plate", pose=(0, 0, 0), markers=markers)
    result = m.links["plate"].markers
    assert result["P"].at.z == pytest.approx(cmath.rect(2.5, math.pi / 6), abs=1e-15)
    assert result["G"].at.z == pytest.approx(cmath.rect(1.0, 0.5), abs=1e-15)
    again = bm.Linkage.from_json(m.to_json())
    assert again.links["plate"].markers["P"].at.z == result["P"].at.z
