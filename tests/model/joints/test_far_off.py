"""Mechanisms and loads far from the origin, where coordinates are known to fewer digits."""

import copy
import json

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS

ROUNDED = 1e-12  # of a coordinate: some thousand roundings, over the lengths


def document(name):
    data = json.loads((GRAPHS / "joints" / f"{name}.json").read_text("utf-8"))
    data.pop("expect", None)
    return data


def shifted(data, x, y):
    """The same with all its places elsewhere on the ground."""
    data = copy.deepcopy(data)
    for joint in data["joints"].values():
        for k, link in enumerate(joint["links"]):
            if link == "frame":
                joint["at"][k] = [joint["at"][k][0] + x, joint["at"][k][1] + y]
    for link in data["links"].values():
        link["pose"] = [link["pose"][0] + x, link["pose"][1] + y, link["pose"][2]]
    return data


@pytest.mark.parametrize("name", ["ruiz_fourbar", "slider_crank", "oldham_coupling"])
@pytest.mark.parametrize("away", [1e5, 1e7])
def test_joints_close_far_from_the_origin(name, away):
    data, want = document(name), ["driver.*.drive", "link.*.omega"]
    at_origin = bm.Linkage.from_data(data).run(samples=9, want=want, friction="none")
    remote = bm.Linkage.from_data(shifted(data, away, -0.7 * away))
    run = remote.run(samples=9, want=want, friction="none")
    for output in at_origin:
        size = np.abs(at_origin[output]).max() or 1.0
        assert np.abs(run[output] - at_origin[output]).max() <= ROUNDED * away * size
    assert remote.compile().verify(samples=9).ok


def test_joints_that_gape_do_not_close_far_from_the_origin():
    data = shifted(document("ruiz_fourbar"), 1e7, 0.0)
    data["joints"]["C"]["at"][0] = [20.0, 0.0]
    assert {problem.code for problem in bm.Linkage.from_data(data).check()} == {"does-not-close"}


@pytest.mark.parametrize("away", [1e3, 1e12, 1.6e19])
def test_a_load_far_out_on_a_link_does_not_stop_the_friction_of_its_guide(away):
    data = document("stribeck_slider_crank")
    data["loads"]["work"]["at"] = [away, 0.0]
    mechanism = bm.Linkage.from_data(data).compile()
    run = mechanism.run(samples=7)
    assert (run["joint.guide.friction"] * run["joint.guide.slip"] < 0.0).all()
    assert mechanism.verify(samples=7).ok
