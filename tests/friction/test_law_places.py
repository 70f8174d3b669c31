"""Every friction law in every place that takes one: the table of both, a row a law."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import blockmech as bm
from blockmech.friction.laws import LAWS
from tests.friction.test_law_kernels import EXAMPLES
from tests.independent.test_rubbing import DOCUMENT

DRIVE, TIMES = "driver.motor.drive", np.linspace(0.0, 1.0, 4)
PINS = {name: law for name, law in EXAMPLES.items() if "R" in law.kinds and "guide" not in name}


def rubbing(law):
    """A slider-crank of links and joints with the law in its second pin."""
    document = copy.deepcopy(DOCUMENT)
    data = law.model_dump(exclude_defaults=True) | {"law": law.law}
    document["joints"]["A"]["friction"] = data | ({"radius": 0.03} if "radius" in data else {})
    document["drivers"]["motor"] |= {"law": "constant_rate", "rate": 5.0}
    return bm.Linkage.from_data(document)


def test_the_table_has_all_laws():
    assert {law.law for law in PINS.values()} == {name for name in LAWS if name in own_laws()}


def own_laws():
    """Names of the package's own laws: tests of others may have registered more."""
    return {name for name in LAWS if LAWS[name].__module__.startswith("blockmech.")}


@pytest.mark.parametrize("name", PINS)
def test_a_law_holds_in_every_place(name):
    linkage = rubbing(PINS[name])
    assert linkage.check() == []
    assert bm.Linkage.from_data(linkage.to_data()).to_data() == linkage.to_data()
    mech = linkage.compile()
    run = mech.run(times=TIMES, want=DRIVE)[DRIVE]
    single = mech.run(times=TIMES, want=DRIVE, precision="complex64")[DRIVE]
    assert single == pytest.approx(run, abs=1e-5 * np.abs(run).max())
    last = mech.run(times=TIMES, want=DRIVE, friction="successive")[DRIVE]
    assert last == pytest.approx(run, abs=1e-7 * np.abs(run).max())
    # a number of the law: its derivative, and a study of it, against runs of designs near by
    address = next(a for a in mech.parameters() if "A.friction." in a)
    x, exact = mech.parameters()[address].value, mech.sensitivity(DRIVE, address, times=TIMES)
    near = [x * (1 + 1e-4 * k) for k in (-2, -1, 1, 2)]
    rows = [linkage.replace({address: y}).run(times=TIMES, want=DRIVE)[DRIVE] for y in near]
    slope = np.dot([1, -8, 8, -1], rows) / (12e-4 * x)
    assert np.abs(exact[DRIVE, address] - slope).max() * x <= 1e-7 * np.abs(run).max()
    study = mech.study({address: near[:2]}, want=f"poses({DRIVE})", times=TIMES)
    assert study[f"poses({DRIVE})"] == pytest.approx(np.array(rows[:2]), abs=1e-10)
    assert mech.verify(study).ok
    # a short motion, and what stands beside it
    moved = mech.simulate("time=0.002", start={"motor": (0.7, 9.0)}, want=(), accuracy=1e-8)
    assert moved.motion.reached
    assert mech.equilibria(friction="newton") is not None
