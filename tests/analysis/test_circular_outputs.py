"""An angle that is known but for whole turns is followed where it passes half a turn."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import blockmech as bm

OUTPUTS = ("link.rocker.angle", "joint.D.coordinate")


def crank_rocker(turn: float) -> bm.Mechanism:
    """A crank-rocker of 1, 2.5, 2 and 2.5 m whose rocker is drawn turned by an angle [rad]."""
    m = bm.Linkage("crank_rocker")
    m.add_link("crank", pose=(0.0, 0.0, 0.6))
    m.add_link("rod", pose=(0.8, 0.6, 0.3))
    m.add_link("rocker", pose=(2.5, 0.0, 1.9 + turn), mass=1.0)
    tip = cmath.rect(2.0, -turn)
    m.add_joint("A", "R", ["frame", "crank"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_joint("B", "R", ["crank", "rod"], at=[(1.0, 0.0), (0.0, 0.0)])
    m.add_joint("C", "R", ["rod", "rocker"], at=[(2.5, 0.0), (tip.real, tip.imag)])
    m.add_joint("D", "R", ["frame", "rocker"], at=[(2.5, 0.0), (0.0, 0.0)])
    m.add_driver("motor", "A", bm.motion.ConstantRate(rate=1.0))
    return m.compile()


PLAIN, TURNED = crank_rocker(0.0), crank_rocker(math.pi - 1.9)


@pytest.mark.parametrize("output", OUTPUTS)
def test_it_has_the_extremes_and_the_stroke_of_its_swing(output):
    plain, turned = PLAIN.extremes(output), TURNED.extremes(output)
    swing = plain.maximum.value - plain.minimum.value
    assert turned.maximum.value - turned.minimum.value == pytest.approx(swing, rel=1e-12)
    assert TURNED.stroke(output).length == pytest.approx(swing, rel=1e-12)
    study = TURNED.study({"links.rod.mass": [1.0, 2.0]}, want=f"range({output})", samples=60)
    np.testing.assert_allclose(study[f"range({output})"], swing, rtol=1e-9)


@pytest.mark.parametrize("output", OUTPUTS)
def test_it_is_solved_for_whatever_turns_the_value_has(output):
    value = float(TURNED.run(at=1.0, want=output)[output][0])
    for turns in (-1, 0, 1):
        solutions = TURNED.solve({output: value + math.tau * turns})
        coordinates = [solution["driver.motor.q"] for solution in solutions]
        plain = PLAIN.solve({output: PLAIN.run(at=1.0, want=output)[output][0]})
        expected = [solution["driver.motor.q"] for solution in plain]
        np.testing.assert_allclose(coordinates, expected, rtol=1e-9)


@pytest.mark.parametrize("output", OUTPUTS)
def test_its_scatter_is_that_of_small_deviations(output):
    passing = TURNED.solve({output: math.pi})[0]["driver.motor.q"]
    spread = {"joints.B.at[0].x": bm.dist.Normal(1.0, 1e-4)}
    bands = TURNED.tolerance(spread, output, at=passing, count=200)
    assert bands.sampled[output].deviation == pytest.approx(bands[output], rel=0.3)


def test_a_number_is_identified_from_it():
    output, at = "joint.D.coordinate", np.linspace(0.2, 6.0, 40)
    address = "joints.B.at[0].x"
    truth = TURNED.document.replace({address: 1.01}).run(at=at, want=output)[output]
    assert np.ptp(truth) > 6.0  # it jumps
    data = {"driver.motor.q": at, output: truth}
    fit = bm.design.identify(TURNED, address, data)
    assert fit.values[address] == pytest.approx(1.01, rel=1e-9)
