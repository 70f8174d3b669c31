"""Coulomb's law of a pair: what it takes, and what fits which kind of pair."""

import pytest

import blockmech as bm
from blockmech.ground.errors import GraphError
from tests import machines


def test_worn_in_pins_take_four_thirds_of_the_materials_coefficient():
    # Baranov, in [R10]; the paper's f' = 0.40 is that of 0.30
    law = bm.friction.Coulomb.from_material_coefficient(0.3, radius=0.0075)
    assert law.coefficient == pytest.approx(0.4, rel=1e-15)
    assert law.factor == pytest.approx(0.003, rel=1e-15)


def test_factor_is_a_length_for_pins_and_a_number_for_guides():
    assert bm.friction.Coulomb(coefficient=0.2, radius=0.05).factor == 0.2 * 0.05
    assert bm.friction.Coulomb(coefficient=0.2).factor == 0.2
    assert bm.friction.Coulomb(coefficient=0.2, guide_length=3.0).factor == 0.2


def test_no_coefficient_is_no_friction_and_no_iteration():
    smooth = bm.friction.Coulomb(coefficient=0.0, radius=0.05)
    r = machines.crank(1.0, bm.Link(mass=1.0, cm=(0.5, 0.0)), smooth).run(at=1.0, rates=3.0)
    assert r["crank.A.friction"][0] == 0.0
    assert not r.quality.iterations


WRONG = {
    "negative coefficient": lambda: bm.friction.Coulomb(coefficient=-0.1, radius=0.1),
    "endless coefficient": lambda: bm.friction.Coulomb(coefficient=float("inf"), radius=0.1),
    "no radius": lambda: bm.friction.Coulomb(coefficient=0.1, radius=0.0),
    "no guide length": lambda: bm.friction.Coulomb(coefficient=0.1, guide_length=-1.0),
    "another law": lambda: bm.friction.Coulomb(law="viscous", coefficient=0.1),
    "pin without radius": lambda: bm.Crank(friction={"A": bm.friction.Coulomb(coefficient=0.1)}),
    "pin with guide length": lambda: bm.Crank(
        friction={"A": bm.friction.Coulomb(coefficient=0.1, radius=0.1, guide_length=1.0)}
    ),
    "guide with radius": lambda: bm.SlideDrive(
        friction={"S": bm.friction.Coulomb(coefficient=0.1, radius=0.1)}
    ),
    "joint that is not there": lambda: bm.Crank(
        friction={"B": bm.friction.Coulomb(coefficient=0.1, radius=0.1)}
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_law_that_does_not_fit_is_refused(name):
    with pytest.raises(GraphError):
        WRONG[name]()
