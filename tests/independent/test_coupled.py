"""What coupled machines of the gallery expect is what their energies say."""

from __future__ import annotations

import json

import pytest

from tests.gallery import GRAPHS
from tests.independent.coupled import rack_gripper, valve_engine

MACHINES = {"valve_engine": (valve_engine, 120.0), "rack_gripper": (rack_gripper, 8.0)}


@pytest.mark.parametrize("name", MACHINES)
def test_expected_numbers_are_those_of_the_energies(name):
    (said,) = json.loads((GRAPHS / f"{name}.json").read_text("utf-8"))["expect"]
    reference, moved = MACHINES[name]
    (places,) = said["at"].values()
    for k, q in enumerate(places):
        result = reference(q, moved)
        for output, values in said["want"].items():
            assert values[k] == pytest.approx(float(result[output]), rel=1e-14, abs=1e-16)
