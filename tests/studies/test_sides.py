"""Preload and pressure angle: at zero a contact is of another kind than above."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm

AT = {"a": [0.3, 1.0]}
OUTPUTS = ("a.drive", "b.A.reaction")
CASES = [("preload", 0.0), ("preload", 20.0), ("pressure_angle", 0.0), ("pressure_angle", 0.35)]


def wheels(number: str, value: float, friction: bool = True) -> bm.Graph:
    """Two unbalanced wheels on rubbing pins, with a belt or with teeth between them."""
    g = bm.Graph("wheels", gravity=(0.0, -9.81))
    pin = {"A": bm.friction.Coulomb(coefficient=0.1, radius=0.02)} if friction else {}
    g.add("frame", bm.Frame(markers={"a": (0.0, 0.0), "b": (1.0, 0.0)}))
    for name, mass in (("a", 2.0), ("b", 1.0)):
        link = bm.Link(mass=mass, inertia=0.1, cm=(0.2, 0.0))
        g.add(name, bm.Crank(length=0.3, links={"crank": link}, friction=pin))
        g.connect(f"frame.{name}", f"{name}.A")
    follows = {"driver": "a", "driven": "b", number: value}
    if number == "preload":
        g.add("c", bm.Belt(radii=(0.1, 0.2), **follows))
    else:
        g.add("c", bm.Gear(teeth=(20, 40), **follows))
    return g


@pytest.mark.parametrize(("number", "value"), CASES)
def test_a_study_over_zero_has_the_numbers_of_each_design(number, value):
    g, above = wheels(number, value), {"preload": 20.0, "pressure_angle": 0.35}[number]
    want = [f"poses({output})" for output in OUTPUTS]
    study = g.compile().study({f"c.{number}": [0.0, above]}, want=want, at=AT)
    assert study.status == ("ok", "ok")
    for k, x in enumerate((0.0, above)):
        run = g.replace({f"c.{number}": x}).run(at=AT, want=OUTPUTS)
        for output in OUTPUTS:
            np.testing.assert_allclose(study[f"poses({output})"][k], run[output], rtol=1e-12)


@pytest.mark.parametrize(("number", "value"), CASES)
def test_a_function_of_all_numbers_has_those_of_a_run(number, value):
    mech = wheels(number, value).compile()
    f = mech.function(["a.q"], OUTPUTS, "*", library="numpy")
    y, run = f(f.parameters, {"a.q": np.array(AT["a"])}), mech.run(at=AT, rates=0.0, want=OUTPUTS)
    for output in OUTPUTS:
        np.testing.assert_allclose(y[output], run[output], rtol=1e-12)


@pytest.mark.parametrize("number", ["preload", "pressure_angle"])
def test_at_zero_it_has_no_derivative(number):
    with pytest.raises(bm.RequestError, match="zero of it is another kind of contact"):
        wheels(number, 0.0).compile().sensitivity("b.A.reaction.x", f"c.{number}", at=AT)


def test_without_friction_a_pressure_angle_has_one():
    output, address, h = "b.A.reaction.x", "c.pressure_angle", 1e-6
    slopes = wheels("pressure_angle", 0.0, False).compile().sensitivity(output, address, at=AT)
    x, y = (wheels("pressure_angle", p, False).run(at=AT, want=output)[output] for p in (0.0, h))
    np.testing.assert_allclose(slopes[output, address], (y - x) / h, rtol=1e-5)
